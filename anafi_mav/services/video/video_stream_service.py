"""Video streams: their URIs and state, and the commands that choose among them.

Opening a URI changes nothing in the drone: stations open streams by themselves. VIDEO_START_STREAMING with the id of a
stream shows that stream, for all viewers; the latest command wins. VIDEO_STOP_STREAMING ends no view of another client:
a viewer stops by closing its own. Rules: conformance A8, MAVLink camera.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from anafi_mav import texts, units
from anafi_mav.drone.video.stream_choice import OfferedStream, StreamKind
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, require_camera
from anafi_mav.services.service import Answer, Host, Request, Service
from anafi_mav.vehicle.base.refusal import Refused
from anafi_mav.vehicle.base.severity import Severity

FRAME_RATE = 30.0
"""Pictures per second of a stream that is not running."""

ALL = 0
"""Stream id of all streams (common.xml VIDEO_START_STREAMING)."""

NAMES = {
    StreamKind.VISIBLE: "Visible",
    StreamKind.THERMAL: "Thermal",
    StreamKind.BLENDED: "Blended",
    StreamKind.DISPARITY: "Disparity",
}
"""As stations list them."""


class VideoStreamService(Service):
    """Answers requests for the streams, and the commands that start and stop them."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._undo: Callable[[], None] | None = None
        self._reported: StreamKind | None = None
        """The shown stream as the clients know it; None before the first connection."""
        self._informed: set[Channel] = set()
        """Channels that received the text which explains a missing URI."""

    def camera_flags(self) -> int:
        return dialect.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM if self.host.uris.has_video else 0

    def requests(self) -> Mapping[int, Request]:
        return {
            dialect.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION: self._information,
            dialect.MAVLINK_MSG_ID_VIDEO_STREAM_STATUS: self._status,
        }

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_VIDEO_START_STREAMING: Action(
                self._start,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                group=ActionGroup.STREAM,
            ),
            dialect.MAV_CMD_VIDEO_STOP_STREAMING: Action(
                self._stop,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.STOP,
                group=ActionGroup.STREAM,
            ),
        }

    def link_up(self) -> None:
        streams = self.host.drone.streams
        self._undo = streams.subscribe(self._switched)
        if self._reported not in (None, streams.shown.kind):
            self._switched()  # while there was no link
        self._reported = streams.shown.kind

    def link_down(self) -> None:
        if self._undo is not None:
            self._undo()
            self._undo = None

    def channel_closed(self, channel: Channel) -> None:
        self._informed.discard(channel)

    # Commands.

    async def _start(self, command: Command) -> None:
        stream = self._commanded(command)
        if stream is None:
            return  # each URI is open whenever its stream is shown
        streams = self.host.drone.streams
        if streams.is_shown(stream.kind):
            return
        if self.host.vehicle.mission_needs_camera:
            raise Refused(texts.VIDEO_STREAM, texts.MISSION_USES_CAMERA)
        if streams.is_recording:
            raise Refused(texts.VIDEO_STREAM, texts.CAMERA_RECORDS)
        if streams.ends_photos(stream.kind):
            raise Refused(texts.VIDEO_STREAM, texts.CAMERA_TAKES_PHOTOS)
        self.host.end_others(ActionGroup.STREAM)
        await streams.show(stream.kind)

    async def _stop(self, command: Command) -> None:
        self._commanded(command)

    def _commanded(self, command: Command) -> OfferedStream | None:
        """Return the stream of a command, None for all.

        Raises `Refused` when there is no such stream, or no such camera (param2).
        """
        require_camera(texts.VIDEO_STREAM, command.params[1])
        id = command.params[0]
        if id == ALL or math.isnan(id):
            return None
        stream = self._stream(id)
        if stream is None:
            raise Refused(texts.VIDEO_STREAM, texts.STREAM_UNKNOWN, lasting=True)
        return stream

    def _stream(self, id: float) -> OfferedStream | None:
        return next((stream for stream in self.host.drone.streams.offered if stream.number == id), None)

    # Messages.

    def _information(self, inbound: Inbound, command: Command) -> Answer:
        return self._of_requested(command, lambda stream: self._describe(stream, inbound.channel))

    def _status(self, inbound: Inbound, command: Command) -> Answer:
        return self._of_requested(command, self._report)

    def _of_requested(self, command: Command, build: Callable[[OfferedStream], dialect.MAVLink_message]) -> Answer:
        """Return the message of the requested stream, or those of all."""
        id = command.params[1]
        if id == ALL or math.isnan(id):
            return [build(stream) for stream in self.host.drone.streams.offered]
        stream = self._stream(id)
        return dialect.MAV_RESULT_DENIED if stream is None else build(stream)

    def _switched(self) -> None:
        """Report every stream: one has begun to be shown, another has ended."""
        self._reported = self.host.drone.streams.shown.kind
        for stream in self.host.drone.streams.offered:
            self.host.send(self._report(stream))

    def _describe(self, stream: OfferedStream, channel: Channel) -> dialect.MAVLink_message:
        return dialect.MAVLink_video_stream_information_message(
            stream.number,
            len(self.host.drone.streams.offered),
            dialect.VIDEO_STREAM_TYPE_RTSP,
            self._flags(stream),
            self._rate(stream),
            stream.width,
            stream.height,
            self._bitrate(stream),
            0,
            self._hfov(stream),
            NAMES[stream.kind].encode(),
            self._uri(stream, channel).encode(),
            dialect.VIDEO_STREAM_ENCODING_H264,
        )

    def _report(self, stream: OfferedStream) -> dialect.MAVLink_message:
        return dialect.MAVLink_video_stream_status_message(
            stream.number,
            self._flags(stream),
            self._rate(stream),
            stream.width,
            stream.height,
            self._bitrate(stream),
            0,
            self._hfov(stream),
        )

    def _uri(self, stream: OfferedStream, channel: Channel) -> str:
        """Return the URI of a stream for the clients of a channel; empty when they cannot reach it."""
        uris = self.host.uris
        uri = uris.rtsp(channel.local_host, f"/{self.host.sysid}/{stream.kind.value}")
        if uri is None and uris.rtsp_hint is not None and channel not in self._informed:
            self._informed.add(channel)
            self.host.text(Severity.NOTICE, uris.rtsp_hint, channel)
        return uri or ""

    def _is_shown(self, stream: OfferedStream) -> bool:
        return self.host.drone.streams.shown.kind is stream.kind

    def _flags(self, stream: OfferedStream) -> int:
        running = dialect.VIDEO_STREAM_STATUS_FLAGS_RUNNING if self._is_shown(stream) else 0
        thermal = dialect.VIDEO_STREAM_STATUS_FLAGS_THERMAL if stream.kind.is_thermal else 0
        return running | thermal

    def _rate(self, stream: OfferedStream) -> float:
        rate = self.host.drone.video.state.rate_hz if self._is_shown(stream) else None
        return FRAME_RATE if rate is None else rate

    def _bitrate(self, stream: OfferedStream) -> int:
        """Return bits per second as measured; 0 (unknown) for a stream without a viewer."""
        return self.host.drone.video.bits_per_second if self._is_shown(stream) else 0

    def _hfov(self, stream: OfferedStream) -> int:
        """Return the horizontal field of view in deg; 0 is unknown."""
        drone = self.host.drone
        if not self._is_shown(stream):
            return 0
        video, frame = drone.video.state, drone.video.state.frame
        if frame is not None and frame.metadata.hfov is not None:
            return units.saturate(frame.metadata.hfov * units.DEG_PER_RAD, 16, signed=False)
        if video.shown is not None and video.shown.fov_deg is not None:
            return units.saturate(video.shown.fov_deg[0], 16, signed=False)
        view = drone.camera[0].hfov_deg if stream.kind is StreamKind.VISIBLE else None
        return 0 if view is None else units.saturate(view, 16, signed=False)
