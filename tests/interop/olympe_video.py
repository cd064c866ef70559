"""Live video and replay with Parrot's Olympe alone: ``olympe_video.py ADDRESS CLASS MODEL HTTP RTSP FOLDER``.

The arguments are those of `olympe_visit.py`. The first of the model's streams is watched while the drone flies and its
camera zooms, the others for a moment, and then all at once. Directly at the drone a recording is made and replayed.
Prints one JSON object: what each step came to, and for each stream what Olympe decoded: pictures and what they say.
"""

from __future__ import annotations

import json
import sys
import time
import urllib.request
from pathlib import Path

from olympe.features.video.pdraw import Callbacks, StreamInfo, video_frame_type
from olympe.messages import camera, camera2
from olympe.messages.ardrone3 import Piloting, PilotingEvent
from olympe.utils.enum import get_enum_value_as_int
from olympe_base import LIMIT, Visit, quiet
from olympe_look import NAMES, Look, Watch


class Video(Look, Visit):
    log: Path
    """The simulator's."""

    def together(self, names: list[str]) -> None:
        """All streams in one session."""
        watches = {name: Watch() for name in names}
        raw = (get_enum_value_as_int(video_frame_type.raw), None)
        streams = [
            StreamInfo(name=name, callbacks=[Callbacks(media_type=raw, video_frame=watch.raw)])
            for name, watch in watches.items()
        ]
        with self.step("play all") as entry:
            entry["ok"] = bool(
                self.drone.streaming.play_multiple_stream(
                    resource_name="live", streams_list=streams, timeout=LIMIT, **self.video
                )
            )
        for name, watch in watches.items():
            self.say(f"{name} beside others", watch.wait(10))
        self.say("stop all", bool(self.drone.streaming.stop()))
        for name, watch in watches.items():
            self.result["streams"][f"{name} beside others"] = watch.observed()

    def fly(self, watch: Watch) -> None:
        """A little; at each turn the drone is left alone until a picture has reported it."""
        self.say("on the ground", watch.wait_for_state("FS_LANDED"))
        self.expect("take off", Piloting.TakeOff())
        self.say("seen to hover", watch.wait_for_state("FS_HOVERING"))
        end = PilotingEvent.moveByEnd(_policy="check", _timeout=LIMIT)
        self.expect("move", Piloting.moveBy(6, 0, -2, 1.0, _timeout=LIMIT) >> end)
        if self.model == "ai":
            zoom = camera2.Command.SetZoomTarget(camera_id=0, control_mode="level", target=2.0)
            self.expect("zoom", zoom & camera2.Event.ZoomLevel(camera_id=0, level=2.0))
        else:
            self.expect("zoom", camera.set_zoom_target(0, "level", 2.0) & camera.zoom_level(cam_id=0, level=2.0))
        self.expect("land", Piloting.Landing())
        self.say("seen to land", watch.wait_for_state("FS_LANDING") and watch.wait_for_state("FS_LANDED"))

    def replay(self, name: str) -> None:
        """Record for three seconds of the machine's time, and watch it."""
        if self.model == "ai":
            start = camera2.Event.Recording(type="start", stop_reason="user_request", _policy="wait")
            self.expect("record", camera2.Command.StartRecording(camera_id=0) & start)
            time.sleep(3.0)
            stop = camera2.Event.Recording(type="stop", _policy="wait")
            self.expect("recorded", camera2.Command.StopRecording(camera_id=0) & stop)
        else:
            self.expect("record", camera.start_recording(cam_id=0))
            time.sleep(3.0)
            self.expect("recorded", camera.stop_recording(cam_id=0))
        url = f"http://{self.address}:{self.http_port}/api/v1/media/medias"
        with urllib.request.urlopen(url, timeout=LIMIT) as answer:
            (media,) = json.load(answer)
        watch = self.play(name, media["replay_url"])
        self.say("replay", watch.wait(1))
        self.say("replay finished", self.wait_for_end_of_recording())
        watch.wait_for_silence(4.0)
        self.stop("replay", watch)
        self.result["streams"]["replay"]["duration"] = media["duration"]

    def wait_for_end_of_recording(self) -> bool:
        """Wait until the simulator has sent the last picture: it writes its log beside our folder."""
        deadline = time.monotonic() + LIMIT
        while '"finished"' not in self.log.read_text(encoding="utf-8"):
            if time.monotonic() > deadline:
                return False
            time.sleep(0.1)  # another process writes the file
        return True

    def watch_all(self) -> None:
        self.begin("video")
        first, *others = names = NAMES[self.model]
        watch = self.play(first)
        self.fly(watch)
        self.stop(first, watch)
        for name in others:
            watch = self.play(name)
            self.say(f"pictures of {name}", watch.wait(10))
            self.stop(name, watch)
        if self.direct:
            self.replay(first)
        if others:
            self.together(names)


def main() -> None:
    *where, folder = sys.argv[1:]
    quiet()
    visit = Video(*where)
    visit.log = Path(folder).with_name("sim.jsonl")
    if visit.connect():
        visit.watch_all()
        visit.begin("end")
        visit.disconnect()
    visit.end()


if __name__ == "__main__":
    main()
