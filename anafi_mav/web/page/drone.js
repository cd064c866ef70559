"use strict";

// The live picture of one drone by WebRTC (WHEP), and the drone's state, requested every second.

const PERIOD = 1000; // ms between two looks at drone and picture
const RETRY = 2000; // ms after a failure
const SILENCE = 5000; // ms without a decoded picture after which the session is made again

const sysid = Number(location.pathname.split("/").pop());
const video = document.getElementById("picture");

let session = null; // {connection, place, stream, pictures, rate, moved}
let opening = false;
let retryAt = 0;
let failure = ""; // why the picture could not be opened

async function open(stream) {
  const connection = new RTCPeerConnection();
  const mine = { connection, place: "", stream, pictures: 0, rate: 0, moved: performance.now() };
  session = mine;
  try {
    const { receiver } = connection.addTransceiver("video", { direction: "recvonly" });
    receiver.jitterBufferTarget = 0; // a pilot needs the newest picture
    video.srcObject = new MediaStream([receiver.track]);
    await connection.setLocalDescription(await connection.createOffer());
    // Without the browser's own addresses: the gateway does not use them, the browser connects.
    const answer = await fetch(`/whep/${sysid}`, {
      method: "POST",
      headers: { "Content-Type": "application/sdp" },
      body: connection.localDescription.sdp,
    });
    const text = await answer.text();
    if (answer.status !== 201) throw new Error(text.trim() || `status ${answer.status}`);
    mine.place = answer.headers.get("Location");
    if (session !== mine) {
      release(mine); // closed meanwhile
      return;
    }
    await connection.setRemoteDescription({ type: "answer", sdp: text });
    mine.moved = performance.now();
    failure = "";
  } catch (error) {
    failure = error.message;
    close();
  }
}

function release(old) {
  old.connection.close();
  // Also while the page is left: the drone's video ends with its last viewer.
  if (old.place) fetch(old.place, { method: "DELETE", keepalive: true }).catch(() => {});
}

function close() {
  const old = session;
  session = null;
  retryAt = performance.now() + RETRY;
  if (old !== null) release(old);
}

async function count(mine) {
  const before = mine.pictures;
  for (const row of (await mine.connection.getStats()).values()) {
    if (row.type === "inbound-rtp") mine.pictures = row.framesDecoded ?? 0;
  }
  mine.rate = mine.pictures - before;
  if (mine.rate > 0) mine.moved = performance.now();
}

async function watch(drone) {
  if (session !== null) {
    const mine = session;
    await count(mine);
    const silent = !opening && performance.now() - mine.moved > SILENCE;
    const ended = ["failed", "closed"].includes(mine.connection.connectionState);
    if (session === mine && (silent || ended || mine.stream !== drone.stream)) close();
  }
  if (session === null && drone.stream && !opening && performance.now() >= retryAt) {
    opening = true;
    open(drone.stream).finally(() => { opening = false; });
  }
}

function show(drone) {
  document.title = `${drone.name} – anafi-mav`;
  document.getElementById("name").textContent = drone.name;
  const playing = session !== null && session.pictures > 0;
  const picture = playing ? `, ${drone.stream} ${video.videoWidth} × ${video.videoHeight}, ${session.rate} pictures/s` : "";
  document.getElementById("state").textContent =
    `System ${drone.sysid}` + (drone.model ? `, ${drone.model}` : "") + picture;
}

function problem(drone) {
  if (drone === undefined) return `The gateway has no drone with system id ${sysid}.`;
  if (!drone.connected) return `Not connected: ${drone.problem}`;
  if (!drone.stream) return "No picture: the video is switched off in the gateway's configuration.";
  return failure ? `No picture: ${failure}` : "";
}

async function refresh() {
  let text;
  try {
    const answer = await fetch("/drones");
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    const drone = (await answer.json()).find((one) => one.sysid === sysid);
    if (drone === undefined || !drone.connected) {
      if (session !== null) close();
    } else {
      await watch(drone);
    }
    if (drone !== undefined) show(drone);
    text = problem(drone);
  } catch (error) {
    text = `The gateway does not answer (${error.message}).`;
  }
  document.getElementById("problem").textContent = text;
  setTimeout(refresh, PERIOD);
}

addEventListener("pagehide", close);
refresh();
