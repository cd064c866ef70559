"""A flight plan and a point of interest, flown with Parrot's Olympe alone: ``olympe_plan.py ADDRESS PORT MODEL``.

Knows nothing of this project. Prints one JSON object: which expectations came true, the plan's name. Olympe's log
goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # Olympe logs to stdout

import olympe  # noqa: E402
from olympe.messages.ardrone3.Piloting import Landing, StartPilotedPOIV2, StopPilotedPOI, TakeOff  # noqa: E402
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged  # noqa: E402
from olympe.messages.common.FlightPlanEvent import StartingErrorEvent  # noqa: E402
from olympe.messages.common.FlightPlanState import ComponentStateListChanged  # noqa: E402
from olympe.messages.common.Mavlink import Pause, Start, Stop  # noqa: E402
from olympe.messages.common.MavlinkState import MavlinkFilePlayingStateChanged, MissionItemExecuted  # noqa: E402

LIMIT = 60.0
"""s for anything."""

PLAN = b"""QGC WPL 120
0\t0\t3\t22\t0\t0\t0\t0\t0\t0\t0\t1
1\t0\t3\t16\t0\t1\t0\t0\t48.879080\t2.367700\t8\t1
2\t0\t2\t93\t2\t0\t0\t0\t0\t0\t0\t1
3\t0\t2\t205\t-45\t0\t0\t0\t0\t0\t2\t1
4\t0\t2\t2500\t0\t0\t0\t0\t0\t0\t0\t1
5\t0\t3\t16\t0\t1\t0\t0\t48.878900\t2.367700\t8\t1
6\t0\t2\t2501\t0\t0\t0\t0\t0\t0\t0\t1
7\t0\t3\t21\t0\t0\t0\t0\t0\t0\t0\t1
"""


class Flight:
    def __init__(self, address: str, port: str, model: str) -> None:
        self.drone = olympe.Drone(address, http_port=int(port))
        self.type = "flightPlanV2" if model == "ai" else "flightPlan"
        self.steps: dict[str, dict[str, object]] = {}
        self.result: dict[str, object] = {"steps": self.steps}

    def expect(self, name: str, expectation: object) -> bool:
        waited = self.drone(expectation).wait(_timeout=LIMIT)
        ok = bool(waited.success())
        self.steps[name] = {"ok": ok} if ok else {"ok": ok, "explained": str(waited.explain())}
        return ok

    def upload(self) -> str:
        """Its HTTP gives up after half a second, which a busy machine may need: up to three times."""
        for attempt in range(3):
            try:
                return str(self.drone.flightplan.upload(PLAN))
            except TimeoutError:
                if attempt == 2:
                    raise
        raise AssertionError("three attempts")

    def fly(self) -> dict[str, object]:
        ok = bool(self.drone.connect())
        self.steps["connect"] = {"ok": ok}
        if not ok:
            return self.result
        uid = self.upload()
        self.expect(
            "an unknown file is refused",
            Start(filepath="nothing", type=self.type, _no_expect=True) >> StartingErrorEvent(_timeout=LIMIT)
            & ComponentStateListChanged(component="Mavlink_File", State=0, _policy="check_wait", _timeout=LIMIT),
        )
        self.expect("start", Start(filepath=uid, type=self.type))
        self.expect("on the way", MissionItemExecuted(idx=0, _policy="wait", _timeout=LIMIT))
        self.expect("pause", Pause())
        self.expect("hover", FlyingStateChanged(state="hovering", _policy="check_wait", _timeout=LIMIT))
        self.expect("go on", Start(filepath=uid, type=self.type))
        for item in (1, 2, 6):  # 7, the landing, begins at once: too soon for a wait that comes after 6
            self.expect(f"item {item}", MissionItemExecuted(idx=item, _policy="wait", _timeout=LIMIT))
        stopped = MavlinkFilePlayingStateChanged(state="stopped", _policy="check_wait", _timeout=LIMIT)
        self.expect("the end", stopped)
        self.expect("landed", FlyingStateChanged(state="landed", _policy="check_wait", _timeout=LIMIT))
        self.expect("take-off", TakeOff())
        self.expect("in the air", FlyingStateChanged(state="hovering", _policy="check_wait", _timeout=LIMIT))
        self.expect("point of interest", StartPilotedPOIV2(48.8789, 2.3680, 0.0, "locked_gimbal"))
        self.expect("no more", StopPilotedPOI())
        self.expect("start anew", Start(filepath=uid, type=self.type))
        self.expect("stop", Stop())
        self.expect("landing", Landing())
        self.expect("on the ground", FlyingStateChanged(state="landed", _policy="check_wait", _timeout=LIMIT))
        self.steps["disconnect"] = {"ok": bool(self.drone.disconnect())}
        return self.result


def main() -> None:
    olympe.log.update_config({"loggers": {"olympe": {"level": "WARNING"}, "ulog": {"level": "WARNING"}}})
    result = Flight(*sys.argv[1:4]).fly()
    print(json.dumps(result), file=OUT, flush=True)
    # Olympe's own way out takes seconds.
    os._exit(0)


if __name__ == "__main__":
    main()
