"""Live video and replay with Parrot's Olympe alone: ``olympe_video.py ADDRESS CLASS RTSP_PORT HTTP_PORT MEDIA...``.

CLASS is Olympe's: Drone, SkyController3 or SkyController4; through a Skycontroller the ports are not used. The first
MEDIA is watched while the drone flies and its camera zooms, the others for a moment, and then all at once. With
HTTP_PORT a recording is made and replayed. Knows nothing of this project. Prints one JSON object: what each step came
to, and for each stream what Olympe decoded: pictures and what they say. Olympe's log goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
import urllib.request
from typing import Any

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # Olympe logs to stdout

import olympe  # noqa: E402
from olympe.features.video.pdraw import Callbacks, StreamInfo, video_frame_type  # noqa: E402
from olympe.messages import camera, camera2  # noqa: E402
from olympe.messages.ardrone3 import Piloting, PilotingEvent, PilotingState  # noqa: E402
from olympe.utils.enum import get_enum_value_as_int  # noqa: E402

LIMIT = 20.0
"""s for anything."""


class Watch:
    """What came of one stream."""

    def __init__(self) -> None:
        self.said: list[Any] = []
        self.kinds: set[str] = set()
        self.coded = 0
        self.size: tuple[int, int] | None = None
        self.shades: tuple[int, int] | None = None
        self.session: dict[str, object] = {}
        self._more = threading.Condition()

    def raw(self, frame: Any) -> None:
        frame.ref()
        try:
            kind, said = frame.vmeta()
            if self.size is None:
                self.size = (frame.width, frame.height)
                picture = frame.as_ndarray()
                self.shades = (int(picture[0, 0]), int(picture[frame.height - 1, 0]))
            with self._more:
                self.kinds.add(kind.name)
                self.said.append(said)
                self._more.notify_all()
        finally:
            frame.unref()

    def bytestream(self, frame: Any) -> None:
        with self._more:
            self.coded += 1
            self._more.notify_all()

    def wait(self, count: int) -> bool:
        with self._more:
            return self._more.wait_for(lambda: len(self.said) >= count, LIMIT)

    def wait_for_silence(self, seconds: float) -> None:
        with self._more:
            while True:
                before = len(self.said)
                if not self._more.wait_for(lambda before=before: len(self.said) > before, seconds):  # type: ignore[misc]
                    return

    def told(self) -> dict[str, object]:
        return {
            "said": self.said,
            "kinds": sorted(self.kinds),
            "coded": self.coded,
            "size": self.size,
            "shades": self.shades,
            "session": self.session,
        }


class Visit:
    def __init__(self, address: str, kind: str, rtsp_port: str, http_port: str, names: list[str]) -> None:
        self.address, self.http_port = address, int(http_port)
        direct = kind == "Drone"
        self.drone = olympe.Drone(address, http_port=self.http_port) if direct else getattr(olympe, kind)(address)
        # Olympe finds the way through a Skycontroller by itself, and will not be told a port then.
        self.where = {"address": address, "port": int(rtsp_port)} if direct else {}
        self.names = names
        self.ai = "Front camera" in names
        self.steps: dict[str, object] = {}
        self.streams: dict[str, object] = {}

    def expect(self, name: str, expectation: object) -> None:
        waited = self.drone(expectation).wait(_timeout=LIMIT)
        self.steps[name] = True if waited.success() else str(waited.explain())

    def play(self, name: str, resource: str = "live") -> Watch:
        watch = Watch()
        self.steps[f"play {resource} {name}"] = bool(
            self.drone.streaming.play(
                resource_name=resource,
                media_name=name,
                raw_cb=watch.raw,
                coded_bytestream_cb=watch.bytestream,
                timeout=LIMIT,
                **self.where,
            )
        )
        return watch

    def together(self) -> None:
        """All streams in one session."""
        watches = {name: Watch() for name in self.names}
        raw = (get_enum_value_as_int(video_frame_type.raw), None)
        streams = [
            StreamInfo(name=name, callbacks=[Callbacks(media_type=raw, video_frame=watch.raw)])
            for name, watch in watches.items()
        ]
        self.steps["play all"] = bool(
            self.drone.streaming.play_multiple_stream(
                resource_name="live", streams_list=streams, timeout=LIMIT, **self.where
            )
        )
        for name, watch in watches.items():
            self.steps[f"{name} beside others"] = watch.wait(20)
        self.steps["stop all"] = bool(self.drone.streaming.stop())
        for name, watch in watches.items():
            self.streams[f"{name} beside others"] = watch.told()

    def stop(self, name: str, watch: Watch) -> None:
        for stream in self.drone.streaming.multistreams:
            told = stream.session_metadata
            watch.session = {key: plain(told[key]) for key in SESSION if key in told}
        self.steps[f"stop {name}"] = bool(self.drone.streaming.stop())
        self.streams[name] = watch.told()

    def fly(self) -> None:
        hovering = PilotingState.FlyingStateChanged(state="hovering", _policy="wait", _timeout=15)
        landed = PilotingState.FlyingStateChanged(state="landed", _policy="wait", _timeout=20)
        end = PilotingEvent.moveByEnd(_policy="check", _timeout=1)
        self.expect("take off", Piloting.TakeOff() >> hovering)
        self.expect("move", Piloting.moveBy(6, 0, -2, 1.0, _timeout=30) >> end)
        if self.ai:
            zoom = camera2.Command.SetZoomTarget(camera_id=0, control_mode="level", target=2.0)
            self.expect("zoom", zoom >> camera2.Event.ZoomLevel(camera_id=0, level=2.0))
        else:
            self.expect("zoom", camera.set_zoom_target(0, "level", 2.0) & camera.zoom_level(cam_id=0, level=2.0))
        self.expect("land", Piloting.Landing() >> landed)

    def replay(self) -> None:
        """Record two seconds, and watch them."""
        if self.ai:
            start = camera2.Event.Recording(type="start", stop_reason="user_request")
            self.expect("record", camera2.Command.StartRecording(camera_id=0) >> start)
            time.sleep(2.0)
            stopped = self.drone(
                camera2.Command.StopRecording(camera_id=0) >> camera2.Event.Recording(type="stop")
            ).wait(_timeout=LIMIT)
            self.steps["recorded"] = bool(stopped.success())
        else:
            self.expect("record", camera.start_recording(cam_id=0))
            time.sleep(2.0)
            self.expect("recorded", camera.stop_recording(cam_id=0))
        url = f"http://{self.address}:{self.http_port}/api/v1/media/medias"
        with urllib.request.urlopen(url, timeout=5) as answer:
            (media,) = json.load(answer)
        watch = self.play(self.names[0], media["replay_url"])
        self.steps["replay"] = watch.wait(1)
        watch.wait_for_silence(1.5)
        self.steps["length"] = media["duration"] > 0
        self.stop("replay", watch)
        self.streams["replay"]["duration"] = media["duration"]  # type: ignore[index]

    def run(self) -> None:
        self.steps["connect"] = bool(self.drone.connect())
        first, *others = self.names
        watch = self.play(first)
        self.steps["pictures"] = watch.wait(30)
        self.fly()
        self.steps["more pictures"] = watch.wait(len(watch.said) + 10)
        self.stop(first, watch)
        for name in others:
            watch = self.play(name)
            self.steps[f"pictures of {name}"] = watch.wait(30)
            self.stop(name, watch)
        if self.http_port:
            self.replay()
        if others:
            self.together()
        self.steps["disconnect"] = bool(self.drone.disconnect())


SESSION = ("friendly_name", "model_id", "serial_number", "title", "picture_fov", "camera_model", "boot_id")


def plain(value: Any) -> object:
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, bytes):
        return value.split(b"\0")[0].decode()
    if isinstance(value, list | tuple):
        if value and all(isinstance(item, bytes) and len(item) == 1 for item in value):
            return b"".join(value).split(b"\0")[0].decode()
        return [plain(item) for item in value]
    if hasattr(value, "as_dict"):
        return plain(type(value).as_dict(value))
    return value if isinstance(value, int | float | str | bool) or value is None else str(value)


def main() -> None:
    address, kind, rtsp_port, http_port, *names = sys.argv[1:]
    visit = Visit(address, kind, rtsp_port, http_port, names)
    visit.run()
    json.dump({"steps": visit.steps, "streams": visit.streams}, OUT)
    OUT.flush()
    # Olympe's own way out takes seconds and is not what is tested here.
    os._exit(0)


if __name__ == "__main__":
    main()
