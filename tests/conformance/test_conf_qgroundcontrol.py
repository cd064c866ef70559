"""QGroundControl's pages and its window: what its sources ask for and act on, played as messages.

The names are in `support/qgroundcontrol.json`, page by page.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.ftp import Ftp
from support.mav import Client
from support.params import fetch, read, value_of
from support.world import world

PAGES: list[dict[str, Any]] = json.loads((Path(__file__).parents[1] / "support" / "qgroundcontrol.json").read_text())[
    "pages"
]


def pages_of(flavour: str) -> list[dict[str, Any]]:
    return [page for page in PAGES if page["flavour"] == flavour]


async def open_page(client: Client, page: dict[str, Any], flavour: str) -> dict[str, float]:
    """Request each name of a page as its refresh does, and return the answers. PARAM_ERROR fails."""
    mark = client.mark()
    names = page["names"]
    for name in names:
        client.send(dialect.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    values = {}
    for name in names:
        value = await client.wait("PARAM_VALUE", lambda m, name=name: m.param_id == name, since=mark)
        values[name] = value_of(value, flavour)
    assert not client.since(mark, "PARAM_ERROR"), page["page"]
    return values


@pytest.mark.parametrize(
    ("flavour", "model"), [("px4", "4k"), ("px4", "ai"), ("ardupilot", "4k"), ("ardupilot", "usa")]
)
async def test_conf_052_each_page_of_qgroundcontrol_is_answered(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        listed = await fetch(w.client, flavour)
        for page in pages_of(flavour):
            missing = set(page["names"]) - listed.keys()
            assert not missing, (page["page"], page["source"])
            values = await open_page(w.client, page, flavour)
            assert all(math.isfinite(value) for value in values.values()), (page["page"], values)


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
async def test_no_parameter_is_nan(flavour: str) -> None:
    """Neither in PARAM_VALUE nor in the packed file; -1 stands for what is not known."""
    async with world(flavour=flavour) as w:
        values = {name: value_of(message, flavour) for name, message in (await fetch(w.client, flavour)).items()}
        assert all(math.isfinite(value) for value in values.values())
        if flavour == "px4":
            assert values["BAT_LOW_THR"] == values["MPC_LAND_SPEED"] == -1
        else:
            assert values["INS_ACCOFFS_X"] == values["COMPASS_OFS_X"] == -1
            packed = await Ftp(w.client).download("/@PARAM/param.pck")
            assert struct.pack("<f", math.nan) not in packed


@pytest.mark.parametrize(("model", "cells"), [("4k", 2), ("usa", 3)])
async def test_battery_page_shows_the_cells_of_the_model(model: str, cells: int) -> None:
    async with world(model=model) as w:
        assert value_of(await read(w.client, "BAT1_N_CELLS")) == cells
        assert value_of(await read(w.client, "BAT1_SOURCE")) == 1


async def test_compass_of_the_ardupilot_flavour_is_the_first_by_priority() -> None:
    """Otherwise QGroundControl's summary calls it unused (APMSensorsComponentSummary.qml)."""
    async with world(flavour="ardupilot") as w:
        first = await read(w.client, "COMPASS_PRIO1_ID")
        assert first.param_value == (await read(w.client, "COMPASS_DEV_ID")).param_value != 0


async def test_obstacle_avoidance_is_off_on_a_model_without_it() -> None:
    async with world() as w:
        assert value_of(await read(w.client, "COM_OBS_AVOID")) == 0


async def test_unknown_name_is_answered_by_param_error_alone() -> None:
    async with world() as w:
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_param_request_read_message(1, 1, b"CAL_MAG7_ROT", -1))
        error = await w.client.wait("PARAM_ERROR", since=mark)
        assert (error.param_id, error.error) == ("CAL_MAG7_ROT", 1)
        await w.client.wait("HEARTBEAT", timeout=3.0)
        assert not [m for _, m in w.client.since(mark, "PARAM_VALUE") if m.param_id == "CAL_MAG7_ROT"]


async def test_compass_calibration_turns_three_of_qgroundcontrols_pictures() -> None:
    """SensorsComponentController::_handleUASTextMessage: CAL_MAG_SIDES says which pictures there are, each turns from
    its "orientation detected" to its "side done"."""
    nose, left, down = 1 << 1, 1 << 2, 1 << 5
    async with world() as w:
        assert value_of(await read(w.client, "CAL_MAG_SIDES")) == nose | left | down
        mark = w.client.mark()
        calibrate = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
        ack = await w.client.command(calibrate, 0, 1, 0, 0, x=0.0, y=0.0, z=0.0, timeout=20.0)
        assert ack.result == dialect.MAV_RESULT_ACCEPTED
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        sides = [
            text for text in said if text.endswith(("orientation detected", "side done, rotate to a different side"))
        ]
        assert sides == [
            f"[cal] {side} {what}"
            for side in ("front", "left", "down")
            for what in ("orientation detected", "side done, rotate to a different side")
        ]
        assert said[-1] == "[cal] calibration done: mag"
