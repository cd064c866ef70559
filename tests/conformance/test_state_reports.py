"""A state that cannot be read or written is reported to each client that uploads a plan, and to no other."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.plans import circle, upload
from support.world import HOME, World, loopback, world

from anafi_mav.state_lock import state_folder
from anafi_mav.texts import PLANS_NOT_KEPT


async def each_upload_is_reported(w: World) -> str:
    """Upload as two of three clients, one of them twice; return the gateway's problem."""
    first, second, silent = w.clients
    plan = [circle(HOME[:2], 100.0)]
    for client in (first, second, first):
        mark = client.mark()
        ack = await upload(client, plan, dialect.MAV_MISSION_TYPE_FENCE)
        assert ack.type == dialect.MAV_MISSION_ACCEPTED
        await client.wait("STATUSTEXT", lambda m: m.text == PLANS_NOT_KEPT, since=mark)
    assert PLANS_NOT_KEPT not in [m.text for _, m in silent.since(0, "STATUSTEXT")]
    return w.gateway.state_problems()[-1]


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (Path.mkdir, "Is a directory"),  # reading it fails, also for root
        pytest.param(
            lambda path: os.mkfifo(path),
            "expected a file, got a pipe",
            marks=pytest.mark.skipif(os.name != "posix", reason="the pipes are those of POSIX"),
        ),
    ],
    ids=["folder", "pipe"],
)
async def test_unreadable_state_file_is_reported_to_each_client_that_uploads(
    spoil: Callable[[Path], None], problem: str
) -> None:
    drone, folder = loopback(), state_folder(None)
    assert folder is not None
    async with world(drone_address=drone) as w:
        serial = w.drone.identity.serial
    spoil(folder / f"{serial}.json")
    async with world(drone_address=drone, clients=3) as w:
        assert (await each_upload_is_reported(w)).startswith(f"{folder / serial}.json: {problem}")


def below_a_file(home: Path) -> None:
    home.rmdir()
    home.write_text("a file in its place")


def dangling_link(home: Path) -> None:
    (home / "anafi-mav").symlink_to(home / "absent" / "folder")


def of_another_user(home: Path) -> None:
    (home / "anafi-mav").mkdir(mode=0o000)


@pytest.mark.parametrize(
    "spoil",
    [
        below_a_file,
        dangling_link,
        pytest.param(of_another_user, marks=pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")),
    ],
)
async def test_unusable_state_folder_is_reported_to_each_client_that_uploads(
    spoil: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    spoil(home)
    monkeypatch.setenv("XDG_STATE_HOME", str(home))
    async with world(clients=3) as w:
        assert any(str(home) in problem for problem in w.gateway.state_problems())
        assert str(home) in await each_upload_is_reported(w)
