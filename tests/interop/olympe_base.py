"""What the scripts written against Parrot's Olympe share: one connection, its steps, and a report in JSON.

Import it before Olympe: that logs to stdout, which is where the report goes. Olympe's log goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

import olympe  # noqa: E402
from olympe.features.media import media as media_feature  # noqa: E402
from olympe.messages.ardrone3 import PilotingState  # noqa: E402

LIMIT = 60.0
"""s for anything: a machine may be slow. What takes its time on an aircraft is distinguished by the simulator's log."""

# Olympe tries once to open the websocket of the media, for half a second, and knows nothing of them if that fails.
media_feature.HTTP_CONNECTION_TIMEOUT = LIMIT


def plain(value: Any) -> Any:
    """Enums as their names, C structures as what they hold, for JSON."""
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
    if isinstance(value, int | float | str | bool) or value is None:
        return value
    return getattr(value, "_name_", str(value))


class Visit:
    """One connection of Olympe's class `kind`: Drone, SkyController3 or SkyController4."""

    def __init__(self, address: str, kind: str, model: str, http_port: str, rtsp_port: str) -> None:
        self.address = address
        self.http_port = int(http_port)
        self.model = model
        self.direct = kind == "Drone"
        self.drone = getattr(olympe, kind)(address, http_port=self.http_port)
        # Olympe finds the way to the video through a Skycontroller by itself, and accepts no port then.
        self.video = {"address": address, "port": int(rtsp_port)} if self.direct else {}
        self.report: dict[str, dict[str, Any]] = {}
        self.settles = False
        self.begin("connection")

    def begin(self, part: str) -> None:
        """What follows is reported under this name."""
        self.steps: dict[str, dict[str, object]] = {}
        self.result: dict[str, Any] = {"steps": self.steps}
        self.report[part] = self.result

    @contextmanager
    def step(self, name: str) -> Iterator[dict[str, object]]:
        """What a step came to, and when it began and ended on the machine's monotonic clock."""
        assert name not in self.steps, f"two steps are called {name}"
        entry: dict[str, object] = {"ok": False, "from": time.monotonic()}
        self.steps[name] = entry
        yield entry
        entry["to"] = time.monotonic()
        if self.settles:
            # A period of its telemetry passes, so that who watches the drone can tell where a step has left it.
            self.hear(2)

    def hear(self, times: int) -> None:
        """So many words of the drone on its attitude."""
        for _ in range(times):
            self.drone(PilotingState.AttitudeChanged(_policy="wait", _timeout=LIMIT)).wait()

    def say(self, name: str, ok: bool) -> bool:
        with self.step(name) as entry:
            entry["ok"] = ok
        return ok

    def hold(self, roll: int, pitch: int, yaw: int, gaz: int) -> bool:
        """Hold the sticks until the drone flies, and reports its attitude some more; it hovers soon after."""
        flying = PilotingState.FlyingStateChanged(state="flying", _policy="wait", _timeout=LIMIT)
        flew = self.drone(flying)
        self.drone.piloting(roll, pitch, yaw, gaz, LIMIT)
        ok = self.heard(flew)
        self.hear(5)
        self.drone.piloting(0, 0, 0, 0, 0.1)
        at_rest = PilotingState.FlyingStateChanged(state="hovering", _policy="check_wait", _timeout=LIMIT)
        return self.heard(self.drone(at_rest)) and ok

    def expect(self, name: str, expectation: object) -> bool:
        """One expectation of the drone, waited for; what fails is described by Olympe."""
        with self.step(name) as entry:
            return self._wait(entry, self.drone(expectation))

    def ask(self, name: str, expectation: object) -> bool:
        """One expectation of its media."""
        with self.step(name) as entry:
            return self._wait(entry, self.drone.media(expectation))

    @staticmethod
    def _wait(entry: dict[str, object], scheduled: Any) -> bool:
        waited = scheduled.wait(_timeout=LIMIT)
        entry["ok"] = ok = bool(waited.success())
        if not ok:
            entry["explained"] = str(waited.explain())
        return ok

    @staticmethod
    def heard(scheduled: Any) -> bool:
        """Something that was asked for before, to be waited for now."""
        return bool(scheduled.wait(_timeout=LIMIT).success())

    def state(self, message: object) -> Any:
        return plain(dict(self.drone.get_state(message)))

    def state_of(self, message: object) -> Any:
        """Of the first of a list."""
        return plain(dict(self.drone.get_state(message)[0]))

    def known(self, message: object) -> bool:
        try:
            return bool(self.drone.get_state(message))
        except (KeyError, RuntimeError, ValueError):
            return False

    def comes_to_know(self, message: Any) -> bool:
        """Return True when a state is known or comes soon: Olympe asks for some of them itself when it is connected.

        Olympe does not find the state of a camera by "check", and a busy machine begins to wait after it came.
        """
        for _ in range(int(LIMIT)):
            if self.known(message):
                return True
            self.drone(message(_policy="wait", _timeout=1.0)).wait()
        return False

    def flying_state(self, name: str, state: str) -> bool:
        """It is now, or will be."""
        return self.expect(name, PilotingState.FlyingStateChanged(state=state, _policy="check_wait", _timeout=LIMIT))

    def connect(self) -> bool:
        with self.step("connect") as entry:
            entry["ok"] = ok = bool(self.drone.connect())
        return ok

    def disconnect(self) -> None:
        with self.step("disconnect") as entry:
            entry["ok"] = bool(self.drone.disconnect())

    def end(self) -> None:
        """Report, and leave: Olympe's own way out takes seconds."""
        json.dump(self.report, OUT)
        OUT.flush()
        os._exit(0)


def quiet() -> None:
    """Olympe logs warnings and worse."""
    olympe.log.update_config({"loggers": {name: {"level": "WARNING"} for name in ("olympe", "ulog", "urllib3")}})


def arguments() -> list[str]:
    return sys.argv[1:]
