"""A look at the live video with Parrot's Olympe alone: pictures and what they say. Knows nothing of this project."""

from __future__ import annotations

import threading
from typing import Any

from olympe_base import LIMIT, Visit, plain  # isort: skip

NAMES = {
    "4k": ["DefaultVideo"],
    "thermal": ["DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"],
    "usa": ["DefaultVideo", "ParrotThermalBlendedVideo"],
    "ai": ["Front camera", "Disparity map"],
}
"""The streams of each model, by the names that its users know."""

SESSION = ("friendly_name", "model_id", "serial_number", "title", "picture_fov", "camera_model", "boot_id")


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
        self._looked_at = 0

    def raw(self, frame: Any) -> None:
        frame.ref()
        try:
            kind, said = frame.vmeta()
            if self.size is None:
                self.size = (frame.width, frame.height)
                picture = frame.as_ndarray()
                # Luma in the sky and on the ground at the right edge, away from all text.
                sky, ground = int(0.35 * frame.height), int(0.7 * frame.height)
                self.shades = (int(picture[sky, frame.width - 4]), int(picture[ground, frame.width - 4]))
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

    def wait_for_state(self, flying: str) -> bool:
        """A picture has said that the drone does this, or one will: none of those that were waited for before."""

        def seen() -> bool:
            while self._looked_at < len(self.said):
                self._looked_at += 1
                if self.said[self._looked_at - 1]["drone"]["flying_state"] == flying:
                    return True
            return False

        with self._more:
            return self._more.wait_for(seen, LIMIT)

    def wait_for_silence(self, seconds: float) -> None:
        with self._more:
            while True:
                before = len(self.said)
                if not self._more.wait_for(lambda before=before: len(self.said) > before, seconds):  # type: ignore[misc]
                    return

    def observed(self) -> dict[str, object]:
        return {
            "said": self.said,
            "kinds": sorted(self.kinds),
            "coded": self.coded,
            "size": self.size,
            "shades": self.shades,
            "session": self.session,
        }


class Look(Visit):
    def play(self, name: str, resource: str = "live") -> Watch:
        watch = Watch()
        with self.step(f"play {resource} {name}") as entry:
            entry["ok"] = bool(
                self.drone.streaming.play(
                    resource_name=resource,
                    media_name=name,
                    raw_cb=watch.raw,
                    coded_bytestream_cb=watch.bytestream,
                    timeout=LIMIT,
                    **self.video,
                )
            )
        return watch

    def stop(self, name: str, watch: Watch) -> None:
        for stream in self.drone.streaming.multistreams:
            observed = stream.session_metadata
            watch.session = {key: plain(observed[key]) for key in SESSION if key in observed}
        with self.step(f"stop {name}") as entry:
            entry["ok"] = bool(self.drone.streaming.stop())
        self.result.setdefault("streams", {})[name] = watch.observed()

    def watch_live(self) -> None:
        """Some pictures of the drone's first camera."""
        self.begin("look")
        name = NAMES[self.model][0]
        watch = self.play(name)
        self.say("pictures", watch.wait(15))
        self.stop(name, watch)
