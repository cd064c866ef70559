"""What outlives the gateway: written whole, read with care, never lost."""

from __future__ import annotations

import asyncio
import json
import math
import os
from pathlib import Path

import pytest
from support.hanging_disk import PATIENCE, hanging

from anafi_mav import mav_enums
from anafi_mav.services.memory import MAX_ASIDE, MAX_BYTES, Memory
from anafi_mav.state_lock import STATE_WRITER, state_folder
from anafi_mav.vehicle.fence.plan_items import PlanItem, opaque_id

SERIAL = "PI040443BA8K000123"
ITEMS = (
    PlanItem(
        mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0, (50.0, 0.0, math.nan, -1.5), 488789000, -23677000, 12.25, 1, 1
    ),
    PlanItem(
        mav_enums.MAV_CMD_NAV_WAYPOINT,
        3,
        (math.inf, -math.inf, 1.401298464324817e-45, 3.4028234663852886e38),
        2**31 - 1,
        -(2**31),
        math.nan,
    ),
)


def same(one: tuple[PlanItem, ...], other: tuple[PlanItem, ...]) -> bool:
    """Equal, with NaN equal to NaN."""
    return repr(one) == repr(other)


async def test_memory_returns_stored_values_after_reopening(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "state"
    memory = Memory(folder)
    assert await memory.load(SERIAL) is None
    memory.put(1, ITEMS)
    memory.put(2, ())
    memory.settings["fence"] = {"action": "LAND", "floor": 2.5}
    assert await memory.save() is None
    assert files(folder) == [f"{SERIAL}.json"]
    again = Memory(folder)
    assert await again.load(SERIAL) is None
    assert set(again.plans) == {1}
    assert same(again.plans[1], ITEMS)
    assert opaque_id(again.plans[1]) == opaque_id(ITEMS)
    assert again.settings == {"fence": {"action": "LAND", "floor": 2.5}}
    # Another drone has another file.
    other = Memory(folder)
    assert await other.load("PI000000000000002") is None
    assert (other.plans, other.settings) == ({}, {})


async def test_newest_of_many_saves_is_stored(tmp_path: Path) -> None:
    memory = Memory(tmp_path)
    await memory.load(SERIAL)
    saves = []
    for number in range(50):
        memory.settings["number"] = number
        saves.append(asyncio.ensure_future(memory.save()))
        await asyncio.sleep(0)
    assert await asyncio.gather(*saves) == [None] * 50
    again = Memory(tmp_path)
    await again.load(SERIAL)
    assert again.settings["number"] == 49
    assert len(files(tmp_path)) == 1  # nothing is left of the writing


async def test_save_on_a_hanging_disk_is_a_problem_until_it_is_written(tmp_path: Path) -> None:
    memory = Memory(tmp_path)
    await memory.load(SERIAL)
    memory.settings["number"] = 7
    with hanging(STATE_WRITER):
        problem = await memory.save()
        assert problem is memory.problem is not None
        assert "the disk does not answer" in problem
    behind = asyncio.get_running_loop().run_in_executor(STATE_WRITER, int)
    await asyncio.wait_for(behind, PATIENCE)  # its thread has reported what it wrote before that
    assert memory.problem is None
    again = Memory(tmp_path)
    await again.load(SERIAL)
    assert again.settings == {"number": 7}


async def test_load_on_a_hanging_disk_ends_and_the_file_is_kept(tmp_path: Path) -> None:
    stored = Memory(tmp_path)
    await stored.load(SERIAL)
    stored.settings["number"] = 7
    assert await stored.save() is None
    memory = Memory(tmp_path)
    with hanging(STATE_WRITER):
        line = await memory.load(SERIAL)
        assert line is not None
        assert line.endswith("the disk does not answer; no plans, new ones not kept")
        assert (memory.plans, memory.settings) == ({}, {})
    # What is set meanwhile does not replace what was never read.
    memory.settings["number"] = 8
    assert await memory.save() == memory.problem == line
    again = Memory(tmp_path)
    assert await again.load(SERIAL) is None
    assert again.settings == {"number": 7}


async def test_late_file_is_reported_and_added_at_the_next_connection(tmp_path: Path) -> None:
    stored, reported = Memory(tmp_path), asyncio.Queue[str]()
    await stored.load(SERIAL)
    stored.put(0, ITEMS)
    stored.put(1, ITEMS)
    stored.settings.update(number=7, name="old")
    assert await stored.save() is None
    memory = Memory(tmp_path, reported.put_nowait)
    with hanging(STATE_WRITER):
        await memory.load(SERIAL)
        memory.put(1, ())  # a client clears the fence meanwhile
        memory.settings["name"] = "new"
        before = memory.generation
        assert await memory.load(SERIAL) is None  # the link was lost, and the disk still hangs
        assert (reported.qsize(), memory.generation) == (0, before)
    assert await asyncio.wait_for(reported.get(), PATIENCE) == "Stored plans read late: unused until reconnection"
    assert memory.plans == {1: ()}
    assert memory.problem is not None
    assert await memory.load(SERIAL) is None
    assert memory.generation == before + 1
    assert same(memory.plans[0], ITEMS)
    assert (memory.plans[1], memory.settings) == ((), {"number": 7, "name": "new"})
    assert memory.problem is None
    assert await memory.save() is None
    again = Memory(tmp_path)
    await again.load(SERIAL)
    assert (set(again.plans), again.settings) == ({0}, {"number": 7, "name": "new"})


async def test_unreadable_file_that_can_be_read_later_is_read_at_the_next_connection(tmp_path: Path) -> None:
    (tmp_path / f"{SERIAL}.json").mkdir()
    memory = Memory(tmp_path)
    assert await memory.load(SERIAL) is not None
    (tmp_path / f"{SERIAL}.json").rmdir()
    (tmp_path / f"{SERIAL}.json").write_text(json.dumps(valid()))
    assert await memory.load(SERIAL) is None
    assert (set(memory.plans), memory.problem) == ({1}, None)


async def test_load_that_is_cancelled_leaves_the_drone_before_it(tmp_path: Path) -> None:
    memory = Memory(tmp_path)
    await memory.load("PI000000000000002")
    memory.settings["number"] = 7
    with hanging(STATE_WRITER):
        loading = asyncio.ensure_future(memory.load(SERIAL))
        await asyncio.sleep(0.1)
        loading.cancel()
        await asyncio.wait([loading])
    assert await memory.save() is None
    assert (files(tmp_path), memory.settings) == (["PI000000000000002.json"], {"number": 7})


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def plan(*item: object) -> bytes:
    """A file with one list of one item."""
    return json.dumps({**valid(), "plans": {"1": [item]}}).encode()


def valid() -> dict[str, object]:
    return {"version": 1, "serial": SERIAL, "plans": {"1": [[5003, 0, [1.0, None, "inf", 0.0], 1, 2, 3.0, 1, 0]]}}


BAD = {
    "not JSON": b"{]",
    "empty": b"",
    "binary": bytes(range(256)),
    "a list": b"[]",
    "no version": json.dumps({**valid(), "version": None}).encode(),
    "another version": json.dumps({**valid(), "version": 2}).encode(),
    "another drone": json.dumps({**valid(), "serial": "X"}).encode(),
    "an unknown key": json.dumps({**valid(), "more": 1}).encode(),
    "an item that is too short": plan(5003, 0),
    "a number out of range": plan(99999, 0, [0, 0, 0, 0], 1, 2, 3, 1, 0),
    "a place out of range": plan(16, 0, [0, 0, 0, 0], 2**31, 2, 3, 1, 0),
    "a float out of range": plan(16, 0, [1e300, 0, 0, 0], 1, 2, 3, 1, 0),
    "too many items": json.dumps({**valid(), "plans": {"1": [[16, 0, [0, 0, 0, 0], 1, 2, 3, 1, 0]] * 5001}}).encode(),
    "a setting that no float holds": json.dumps(
        {**valid(), "settings": {"parameters": {"a": [1, -(10**400)]}}}
    ).encode(),
    "deep": b'{"settings":' + b"[" * 100_000,
    "large": b" " * (MAX_BYTES + 1),
}


@pytest.mark.parametrize("data", BAD.values(), ids=BAD)
async def test_a_bad_file_is_one_line_and_is_kept(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / f"{SERIAL}.json"
    for number in (1, 2):
        file.write_bytes(data)
        memory = Memory(tmp_path)
        line = await memory.load(SERIAL)
        assert line is not None
        assert line.startswith(f"{file}: ")
        assert line.endswith(f"put aside as {SERIAL}.unreadable-{number}")
        assert "\n" not in line
        assert (memory.plans, memory.settings) == ({}, {})
        memory.put(1, ITEMS)
        assert await memory.save() is None
        assert (tmp_path / f"{SERIAL}.unreadable-{number}").read_bytes() == data
    assert await Memory(tmp_path).load(SERIAL) is None


async def test_bad_file_that_cannot_be_put_aside_is_not_replaced(tmp_path: Path) -> None:
    file = tmp_path / f"{SERIAL}.json"
    file.write_bytes(b"{")
    for number in range(1, MAX_ASIDE + 1):
        file.with_suffix(f".unreadable-{number}").write_bytes(b"[")
    memory = Memory(tmp_path)
    line = await memory.load(SERIAL)
    assert line is not None
    assert line.endswith("no plans, new ones not kept")
    memory.put(1, ITEMS)
    assert await memory.save() == line
    assert file.read_bytes() == b"{"


async def test_the_good_one_is_good(tmp_path: Path) -> None:
    """So that each of the bad ones is bad for what its name says."""
    (tmp_path / f"{SERIAL}.json").write_text(json.dumps(valid()))
    memory = Memory(tmp_path)
    assert await memory.load(SERIAL) is None
    assert same(
        memory.plans[1],
        (PlanItem(mav_enums.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0, (1.0, math.nan, math.inf, 0.0), 1, 2, 3.0),),
    )


async def test_unreadable_memory_file_is_not_replaced(tmp_path: Path) -> None:
    """A folder in its place stands for a file that this user may not read: the tests may run as root."""
    (tmp_path / f"{SERIAL}.json").mkdir()
    memory = Memory(tmp_path)
    line = await memory.load(SERIAL)
    assert line is not None
    assert "new ones not kept" in line
    memory.put(1, ITEMS)
    assert await memory.save() == memory.problem == line  # the client that uploads is notified each time
    assert await memory.load(SERIAL) is None
    assert memory.plans[1] == ITEMS  # and has it until the gateway ends, also after a loss of the link
    assert (tmp_path / f"{SERIAL}.json").is_dir()


async def test_uncreatable_folder_is_reported(tmp_path: Path) -> None:
    memory = Memory(tmp_path / "state")
    assert await memory.load(SERIAL) is None
    (tmp_path / "state").write_text("")  # another program's file
    memory.put(1, ITEMS)
    line = await memory.save()
    assert line is not None
    assert line.endswith("changes end with gateway")
    assert memory.plans[1] == ITEMS  # it holds all the same


@pytest.mark.parametrize("serial", ["", "../../etc/passwd", "a/b", "x" * 65, "a\nb", ".", "é"])
async def test_serial_number_unusable_as_file_name_is_not_stored(tmp_path: Path, serial: str) -> None:
    memory = Memory(tmp_path)
    assert await memory.load(serial) is None
    memory.put(1, ITEMS)
    assert await memory.save() is None
    assert files(tmp_path) == []


async def test_without_a_folder(tmp_path: Path) -> None:
    memory = Memory(None)
    assert await memory.load(SERIAL) is None
    memory.put(1, ITEMS)
    assert await memory.save() is None


def test_state_folder_follows_option_and_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_STATE_HOME", "/var/xdg")
    assert state_folder(None) == Path("/var/xdg/anafi-mav")
    assert state_folder("~/here") == tmp_path / "here"
    assert state_folder("/there") == Path("/there")
    for nothing in ("", "relative/path"):  # XDG: a relative path is to be ignored
        monkeypatch.setenv("XDG_STATE_HOME", nothing)
        assert state_folder(None) == tmp_path / ".local" / "state" / "anafi-mav"
    monkeypatch.delenv("XDG_STATE_HOME")
    assert state_folder(None) == tmp_path / ".local" / "state" / "anafi-mav"
    assert os.environ.get("XDG_STATE_HOME") is None
