"""A flight plan and a point of interest, flown with Parrot's Olympe alone. Knows nothing of this project."""

from __future__ import annotations

from olympe_base import LIMIT, Visit  # isort: skip
from olympe.messages.ardrone3.Piloting import Landing, StartPilotedPOIV2, StopPilotedPOI, TakeOff
from olympe.messages.common.FlightPlanEvent import StartingErrorEvent
from olympe.messages.common.FlightPlanState import ComponentStateListChanged
from olympe.messages.common.Mavlink import Pause, Start, Stop
from olympe.messages.common.MavlinkState import MavlinkFilePlayingStateChanged, MissionItemExecuted

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


class Plan(Visit):
    def upload(self) -> str:
        """Its HTTP gives up after half a second, which a busy machine may need: up to three times."""
        for attempt in range(3):
            try:
                return str(self.drone.flightplan.upload(PLAN))
            except TimeoutError:
                if attempt == 2:
                    raise
        raise AssertionError("three attempts")

    def play_plan(self) -> None:
        self.begin("plan")
        type = "flightPlanV2" if self.model == "ai" else "flightPlan"
        uid = self.upload()
        self.expect(
            "an unknown file is refused",
            Start(filepath="nothing", type=type, _no_expect=True) >> StartingErrorEvent(_timeout=LIMIT)
            & ComponentStateListChanged(component="Mavlink_File", State=0, _policy="check_wait", _timeout=LIMIT),
        )
        # Asked for beforehand: what comes quickly is not missed by a slow listener.
        executed = {
            item: self.drone(MissionItemExecuted(idx=item, _policy="wait", _timeout=LIMIT)) for item in (0, 1, 2, 6, 7)
        }
        self.expect("start", Start(filepath=uid, type=type))
        self.say("on the way", self.heard(executed[0]))
        self.expect("pause", Pause())
        self.flying_state("hover", "hovering")
        self.expect("go on", Start(filepath=uid, type=type))
        for item in (1, 2, 6, 7):
            self.say(f"item {item}", self.heard(executed[item]))
        stopped = MavlinkFilePlayingStateChanged(state="stopped", _policy="check_wait", _timeout=LIMIT)
        self.expect("the end", stopped)
        self.flying_state("landed", "landed")
        self.expect("take-off", TakeOff())
        self.flying_state("in the air", "hovering")
        self.expect("point of interest", StartPilotedPOIV2(48.8789, 2.3680, 0.0, "locked_gimbal"))
        self.expect("no more", StopPilotedPOI())
        self.expect("start again", Start(filepath=uid, type=type))
        self.expect("stop", Stop())
        self.expect("landing", Landing())
        self.flying_state("on the ground", "landed")
