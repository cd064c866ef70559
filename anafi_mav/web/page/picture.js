"use strict";

// The live picture of one drone by WebRTC (WHEP) in a <video> of the page.

const PICTURE_RETRY = 2000; // ms after a failure
const PICTURE_LIMIT = 15000; // ms until the gateway answers; it waits 8 s for the drone's first picture
const PICTURE_SILENCE = 5000; // ms without a decoded picture after which the session is made again

class LivePicture {
  constructor(video, sysid) {
    this.video = video;
    this.sysid = sysid;
    this.session = null; // {connection, place, stream, pictures, rate, moved}
    this.opening = false;
    this.retryAt = 0;
    this.failure = ""; // why the picture could not be opened
  }

  get playing() {
    return this.session !== null && this.session.pictures > 0;
  }

  // Call it every second with the stream that the drone shows; "" for none.
  async watch(stream) {
    if (this.session !== null) {
      const mine = this.session;
      await this.count(mine);
      const silent = !this.opening && performance.now() - mine.moved > PICTURE_SILENCE;
      const ended = ["failed", "closed"].includes(mine.connection.connectionState);
      if (this.session === mine && (silent || ended || mine.stream !== stream)) this.close();
    }
    if (this.session === null && stream && !this.opening && performance.now() >= this.retryAt) {
      this.opening = true;
      this.open(stream).finally(() => { this.opening = false; });
    }
  }

  async open(stream) {
    const connection = new RTCPeerConnection();
    const mine = { connection, place: "", stream, pictures: 0, rate: 0, moved: performance.now() };
    this.session = mine;
    try {
      const { receiver } = connection.addTransceiver("video", { direction: "recvonly" });
      receiver.jitterBufferTarget = 0; // a pilot needs the newest picture
      this.video.srcObject = new MediaStream([receiver.track]);
      await connection.setLocalDescription(await connection.createOffer());
      // Without the browser's own addresses: the gateway does not use them, the browser connects.
      const answer = await fetch(`/whep/${this.sysid}`, {
        method: "POST",
        headers: { "Content-Type": "application/sdp" },
        body: connection.localDescription.sdp,
        signal: AbortSignal.timeout(PICTURE_LIMIT),
      });
      const text = await answer.text();
      if (answer.status !== 201) throw new Error(text.trim() || `status ${answer.status}`);
      mine.place = answer.headers.get("Location");
      if (this.session !== mine) {
        this.release(mine); // closed meanwhile
        return;
      }
      await connection.setRemoteDescription({ type: "answer", sdp: text });
      mine.moved = performance.now();
      this.failure = "";
    } catch (error) {
      this.failure = error.message;
      this.close();
    }
  }

  release(old) {
    old.connection.close();
    // Also while the page is left: the drone's video ends with its last viewer.
    if (old.place) fetch(old.place, { method: "DELETE", keepalive: true }).catch(() => {});
  }

  close() {
    const old = this.session;
    this.session = null;
    this.retryAt = performance.now() + PICTURE_RETRY;
    if (old !== null) this.release(old);
  }

  async count(mine) {
    const before = mine.pictures;
    for (const row of (await mine.connection.getStats()).values()) {
      if (row.type === "inbound-rtp") mine.pictures = row.framesDecoded ?? 0;
    }
    mine.rate = mine.pictures - before;
    if (mine.rate > 0) mine.moved = performance.now();
  }
}
