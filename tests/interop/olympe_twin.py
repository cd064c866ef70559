"""A flight plan from a file, flown with Parrot's Olympe alone: ``olympe_twin.py ADDRESS PORT MODEL FILE``.

Knows nothing of this project. Prints one JSON object: which expectations came true. Olympe's log goes to stderr.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

OUT = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # Olympe logs to stdout

import olympe  # noqa: E402
from olympe.messages.ardrone3.PilotingState import FlyingStateChanged  # noqa: E402
from olympe.messages.common.Mavlink import Start  # noqa: E402
from olympe.messages.common.MavlinkState import MavlinkFilePlayingStateChanged  # noqa: E402

LIMIT = 120.0
"""s for the flight."""

ATTEMPTS = 3
"""Its HTTP gives up after half a second, which a busy machine may need."""


def main(address: str, port: str, model: str, path: str) -> None:
    olympe.log.update_config({"loggers": {"olympe": {"level": "WARNING"}, "ulog": {"level": "WARNING"}}})
    drone, steps = olympe.Drone(address, http_port=int(port)), {}
    steps["connect"] = bool(drone.connect())
    for attempt in range(ATTEMPTS):
        try:
            uid = str(drone.flightplan.upload(Path(path).read_bytes()))
            break
        except TimeoutError:
            if attempt == ATTEMPTS - 1:
                raise
    ended = MavlinkFilePlayingStateChanged(state="stopped", _policy="wait", _timeout=LIMIT)
    plan = "flightPlanV2" if model == "ai" else "flightPlan"
    steps["flown"] = bool(drone(Start(filepath=uid, type=plan) >> ended).wait(_timeout=LIMIT).success())
    landed = FlyingStateChanged(state="landed", _policy="check_wait", _timeout=LIMIT)
    steps["landed"] = bool(drone(landed).wait(_timeout=LIMIT).success())
    steps["disconnect"] = bool(drone.disconnect())
    print(json.dumps(steps), file=OUT, flush=True)
    # Olympe's own way out takes seconds.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:5])
