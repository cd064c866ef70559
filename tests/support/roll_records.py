"""What a gateway of before has found out about the sign of a drone's roll."""

from __future__ import annotations

import json
from pathlib import Path

from anafi_mav.services.monitor.roll_sign_service import KEY, written
from anafi_mav.sim import SimulatedDrone
from anafi_mav.vehicle.base.roll_sign import RollSign


def remember_roll(folder: Path, drone: SimulatedDrone, sign: RollSign = RollSign.NORMAL, firmware: str = "") -> None:
    """Write the drone's file as a gateway leaves it that knows the sign, for a firmware (left out: the drone's own)."""
    serial = drone.identity.serial
    settings = {KEY: written(firmware or drone.firmware.model.software, sign)}
    content = {"version": 1, "serial": serial, "plans": {}, "settings": settings}
    (folder / f"{serial}.json").write_text(json.dumps(content), encoding="utf-8")
