"""Table of each MAV_CMD in a flight plan of the drone: its exactness and its lines.

For a refused command it holds the reason. docs/plan-translation.md is made from it. The meaning of a command is from
MAVLink's common.xml; the meaning of a line is from Parrot's flight plan page. A command that is not here is refused.
"""

from __future__ import annotations

from anafi_mav.plans.rules.rule import Fidelity, Rule
from anafi_mav.plans.rules.rules_camera import CAMERA
from anafi_mav.plans.rules.rules_flight import FLIGHT

_NO_ACTUATOR = "The drone has no actuator that a flight plan could move."

_REFUSED = tuple(
    Rule(command, Fidelity.REFUSED, why)
    for command, why in {
        82: "The drone flies straight lines: draw the curve as way points.",
        114: "A flight plan cannot begin something on the way to a way point: draw one there.",
        179: "A flight plan cannot say where home is: set it before.",
        181: _NO_ACTUATOR,
        183: _NO_ACTUATOR,
        187: _NO_ACTUATOR,
        207: "A flight plan cannot switch the fence.",
        211: _NO_ACTUATOR,
        532: "A flight plan cannot focus.",
        601: "Write a DO_JUMP.",
        4501: "A flight plan cannot begin something on the way to a way point: draw one there.",
    }.items()
)

TABLE: dict[int, Rule] = {
    row.command: row for row in sorted((*FLIGHT, *CAMERA, *_REFUSED), key=lambda row: row.command)
}
