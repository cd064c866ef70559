"""What `olympe_controller.py` did with a Skycontroller, judged by the simulator's own log."""

from __future__ import annotations

from typing import Any

import pytest

from support.olympe import during, failed

PRODUCTS = {"4k": 0x0914, "thermal": 0x0919, "usa": 0x091E, "ai": 0x091A}

CONTROLLERS_OWN = ("skyctrl.", "mapper.", "drone_manager.", "devicemanager.", "controllerNetwork.")


def check_controller(report: dict[str, Any], kind: str, model: str, log: list[dict[str, Any]]) -> None:
    """It showed its drone, and let it be flown."""
    assert failed(report["steps"]) == {}
    known = report["known"]
    assert known["product"] == {"product": PRODUCTS[model]}
    assert known["source"] == {"source": "SkyController"}
    assert known["battery"] == {"percent": 87}
    assert known["version"]["software"] == "1.8.2"
    assert known["drone name"]["name"].startswith("ANAFI")

    if kind == "SkyController4":
        assert known["devices"]["connected"]["device"]["uid"] == known["web"]["serial"]
        assert known["devices"]["connected"]["device"]["model"] == PRODUCTS[model]
        (paired,) = known["devices"]["known_devices"]["devices"]
        assert paired["info"]["uid"] == known["web"]["serial"]
    assert known["web"]["serial"] == known["serial of the drone"]["high"] + known["serial of the drone low"]["low"]

    # The drone did not receive what was the controller's business, and flew what it was commanded.
    commands = [entry for entry in log if entry["kind"] == "command"]
    assert not [entry for entry in commands if entry["name"].startswith(CONTROLLERS_OWN)]
    assert [report["moveBy"][name] for name in ("dX", "dY", "dZ")] == pytest.approx((5.0, 0.0, -1.0), abs=0.1)
    flight = during(log, report)
    sticks = [entry["args"]["pitch"] for entry in flight if entry["name"] == "ardrone3.Piloting.PCMD"]
    assert 40 in sticks
    poses = [entry["args"] for entry in flight if entry["kind"] == "pose"]
    assert max(pose["north"] for pose in poses) > 5.5, "5 m by moveBy and some more with the sticks"
    assert max(pose["up"] for pose in poses) == pytest.approx(2.0, abs=0.2), "1 m of take-off and 1 of moveBy"
    assert [entry["args"]["to"] for entry in flight if entry["kind"] == "state"][-1] == "landed"
