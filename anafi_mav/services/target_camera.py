"""Check of the target camera id, which the commands of camera and video streams have."""

from __future__ import annotations

import math

from anafi_mav import texts
from anafi_mav.mavlink import dialect
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.refusal import Refused

OURS = (0.0, 1.0, float(dialect.MAV_COMP_ID_CAMERA))
"""Target camera ids that mean the drone's camera: all cameras, the autopilot's first, this component."""


def require_camera(what: OperatorText, id: float) -> None:
    """Refuse a command for a camera that does not exist."""
    if not math.isnan(id) and id not in OURS:
        raise Refused(what, texts.NO_SUCH_CAMERA.fill(number=f"{id:g}"), lasting=True)
