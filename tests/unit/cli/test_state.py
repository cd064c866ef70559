"""`anafi-mav run` and its state folder: one gateway each, and what is said when it cannot be used."""

from __future__ import annotations

import re
import resource
import signal
import sys
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.mav import Client
from support.product import product, program
from support.world import loopback

from anafi_mav.mavlink.key_ring import write_key
from anafi_mav.state_lock import read_holder, state_folder

MISSIONS = Path(__file__).parents[3] / "missions"


def fleet(address: str, drone: str, state: str = "") -> str:
    return f"""
        {state}
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {drone}}}}}]
    """


async def test_second_gateway_on_a_state_folder_names_the_process(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    drone = loopback()
    async with product(tmp_path / "one", fleet(loopback(), drone)) as first:
        holder = read_holder(state_folder(None))
        assert holder is not None
        assert holder.pid == first.process.pid
        (held,) = holder.drones
        assert (held.name, held.address) == ("alpha", drone)
        assert held.serial.startswith("PI04")
        await first.entry("session", "up")  # the log is written a little later than the gateway says ready
        before = len(first.entries("session"))
        # The same drone behind other endpoints: what a person starts who believes that the first one has ended.
        async with product(tmp_path / "two", fleet(loopback(), drone), ready=False) as second:
            assert await second.end() == 2
            (complaint,) = second.complaints
            assert complaint.startswith(f"anafi-mav: {tmp_path / 'two' / 'fleet.yaml'}: state: expected a folder that")
            assert f"process id {first.process.pid}, alpha at {drone}," in complaint
            assert "end that gateway, or name another folder" in complaint
            assert not second.log.exists()  # a simulator begins with its log
        # With a folder of its own it runs.
        config = fleet(loopback(), loopback(), f"state: {tmp_path / 'other'}")
        async with product(tmp_path / "two", config) as third:
            assert third.lines[-1].startswith("ready")
        assert len(first.entries("session")) == before
    assert read_holder(state_folder(None)) is None


async def test_unusable_state_folder_is_reported_and_sets_exit_status(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file in its place")
    address = loopback()
    async with product(tmp_path, fleet(address, loopback(), f"state: {tmp_path / 'state'}")) as p:
        assert any("state folder cannot be used" in line for line in p.complaints), p
        for _ in range(2):
            words = ("plan", "upload", str(MISSIONS / "loop.plan"), "--endpoint", f"tcpout://{address}:5760")
            async with program(sys.executable, "-m", "anafi_mav", *words) as upload:
                assert await upload.end() == 1, upload
                assert "system 1: Plans not kept: state folder cannot be used" in upload.lines
                assert "mission: 9 items on system 1" in upload.lines
        p.process.send_signal(signal.SIGTERM)
        assert await p.end() == 1
        assert any(line.startswith(f"anafi-mav: not kept: {tmp_path / 'state'}") for line in p.complaints), p


@pytest.mark.skipif(sys.platform != "linux", reason="the limit of another process's files is Linux's")
async def test_full_disk_is_reported_to_each_client_that_uploads(tmp_path: Path) -> None:
    """A limit on the size of the gateway's files stands for the disk: each write fails, as on one that is full."""
    address = loopback()
    config = fleet(address, loopback(), f"state: {tmp_path / 'state'}")
    words = ("plan", "upload", str(MISSIONS / "loop.plan"), "--endpoint", f"tcpout://{address}:5760")
    async with product(tmp_path, config) as p:
        limits = resource.prlimit(p.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(p.process.pid, resource.RLIMIT_FSIZE, (0, limits[1]))
        for _ in range(2):
            async with program(sys.executable, "-m", "anafi_mav", *words) as upload:
                assert await upload.end() == 1, upload
                assert "system 1: Plans not kept: state folder cannot be used" in upload.lines
                assert "mission: 9 items on system 1" in upload.lines  # the gateway has it until its end
        assert any("changes end with gateway" in line for line in p.complaints), p
        resource.prlimit(p.process.pid, resource.RLIMIT_FSIZE, limits)
        async with program(sys.executable, "-m", "anafi_mav", *words) as upload:
            assert await upload.end() == 0, upload
        p.process.send_signal(signal.SIGTERM)
        assert await p.end() == 0


async def test_timestamps_that_are_not_kept_at_the_end_set_the_exit_status(tmp_path: Path) -> None:
    """A file in the place of the folder of keys, put there after they were saved last, stands for a full disk."""
    address, keys = loopback(), tmp_path / "state" / "keys"
    write_key(keys, "field", bytes(range(40)))
    config = f"""
        state: {tmp_path / "state"}
        endpoints: ["tcpin://{address}:5760?signing=field"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}}}}}]
    """
    async with product(tmp_path, config) as p:
        keys.rename(tmp_path / "away")
        keys.write_text("a file in its place")
        p.process.send_signal(signal.SIGTERM)
        assert await p.end() == 1
        (line,) = (line for line in p.complaints if line.startswith("anafi-mav: not kept: "))
        assert line == "anafi-mav: not kept: key field: File exists; old frames may be accepted after a restart"


async def test_run_with_every_message_logged_passes_no_escapes_on(tmp_path: Path) -> None:
    """A client's text, and a parameter's name that no vehicle has, with sequences for the operator's terminal."""
    address = loopback()
    async with product(tmp_path, fleet(address, loopback()), "-vv") as p:
        client = await Client().connect(5760, address)
        await client.heartbeat(lambda beat: True)
        client.send(dialect.MAVLink_statustext_message(6, b"\x1b]0;owned\x07 hello\nforged"))
        client.send(dialect.MAVLink_param_request_read_message(1, 1, b"\x1b[2JX", -1))
        client.send(dialect.MAVLink_param_request_read_message(1, 1, b"ANF_MODEL", -1))
        await client.wait("PARAM_VALUE", lambda m: m.param_id == "ANF_MODEL", since=0)
        await client.close()
        p.process.send_signal(signal.SIGTERM)
        assert await p.end() == 0
    logged = "\n".join(p.complaints)
    assert "owned" in logged
    assert not {"\x1b", "\x07"} & set(logged)
    assert not [line for line in p.complaints if line.startswith("forged")]
    assert all(re.match(r"\d{4}-\d\d-\d\d [\d:,]+ (DEBUG|INFO|WARNING) [a-z_.]+: ", line) for line in p.complaints)
