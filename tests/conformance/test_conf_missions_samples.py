"""Every sample mission on every model, flown from a client of our own, judged as those that MAVSDK flies.

Only upload and start are this client's. `clients/test_sample_missions.py` says which combinations MAVSDK flies.
"""

from __future__ import annotations

import msgspec
import pytest
from support.flight_checks import Log
from support.missions import COMPLETE, put, start, state
from support.plans import Item
from support.samples import SAMPLES, ZOOMS, judge, path_of
from support.world import World, world

from anafi_mav.plans.formats import files
from anafi_mav.plans.plan import Item as PlanItem
from anafi_mav.services.plan.item_messages import DEGREES, to_wire
from anafi_mav.sim import drone

SPEED = 8.0
"""Simulated seconds in one."""

POSES = 0.1
"""Simulated s between two poses in the log, as at speed 1: at 8 m/s a corner would be cut between two."""


def sent(item: PlanItem) -> Item:
    """An item as it travels."""
    wire = to_wire(item)
    return Item(wire.command, wire.x / DEGREES, wire.y / DEGREES, wire.z, *wire.params, frame=wire.frame)


def log_of(w: World) -> Log:
    """The drone's log as it would be in a file."""
    return Log(msgspec.json.decode(msgspec.json.encode(list(w.drone.log))))


@pytest.mark.parametrize("model", ZOOMS)
@pytest.mark.parametrize("sample", SAMPLES)
async def test_conf_075_sample_mission_on_each_model_is_flown_as_written(
    sample: str, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drone, "POSE_PERIOD", POSES / SPEED)
    async with world(web=True, model=model, speed=SPEED, telemetry_rate=5.0) as w:
        await put(w, [sent(item) for item in files.load(path_of(sample)).items])
        await start(w)
        await state(w, COMPLETE, timeout=200.0)
        judge(sample, model, log_of(w))
