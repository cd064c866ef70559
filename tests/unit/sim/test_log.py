"""The simulator's log: bounded in memory, whole in the file, waited for without polling."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
from support.world import loopback

from anafi_mav.arsdk.codec.wire import MessageId, UnknownMessage
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.errors import CommandTimeout
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.log import Log, LogFile


def test_memory_is_bounded_and_the_file_is_not(tmp_path: Path) -> None:
    path = tmp_path / "log"
    file = LogFile(path)
    log = Log("127.0.42.1", 3, file)
    for number in range(10):
        log.add(float(number), "state", "step", {"number": number})
    file.flush()
    assert [entry.args["number"] for entry in log] == [7, 8, 9]
    assert (len(log), log[0].t, log[-1].t) == (3, 7.0, 9.0)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["args"]["number"] for line in lines] == list(range(10))
    assert lines[0] == {"t": 0.0, "drone": "127.0.42.1", "kind": "state", "name": "step", "args": {"number": 0}}
    file.close()
    file.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
async def test_full_disk_ends_the_log_and_not_the_drones(caplog: pytest.LogCaptureFixture) -> None:
    async with Simulator(
        [DroneSpec(address=loopback(), http_port=None, rtsp_port=None)], log=Path("/dev/full")
    ) as simulator:
        (drone,) = simulator.drones
        await drone.wait_log(lambda entry: entry.kind == "pose" and entry.args["time"] > 0.5)
    assert [record.getMessage() for record in caplog.records] == [
        "/dev/full: No space left on device: the log ends here"
    ]


def test_messages_have_parrots_names(tmp_path: Path) -> None:
    file = LogFile(tmp_path / "log")
    log = Log("d", 10, file)
    log.add_message(1.0, "command", ardrone3.PCMD(1, 2, -3, 4, 5, 0))
    log.add_message(2.0, "event", ardrone3.FlyingStateChanged(FlyingState.HOVERING))
    log.add_message(3.0, "command", UnknownMessage(MessageId(200, 1, 2), b"\x01\xff"))
    file.close()
    assert log[0].name == "ardrone3.Piloting.PCMD"
    assert log[0].args == {"flag": 1, "roll": 2, "pitch": -3, "yaw": 4, "gaz": 5, "timestampAndSeqNum": 0}
    assert log[1].args["state"] is FlyingState.HOVERING
    lines = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()]
    assert lines[1]["args"] == {"state": 2}
    assert (lines[2]["name"], lines[2]["args"]) == ("200-1-2", {"payload": "01ff"})


async def test_awaited_log_without_memory_and_file_is_used() -> None:
    log = Log("d", 0, None)
    assert not log.used
    log.add(1.0, "state", "step", {})
    waiting = asyncio.create_task(log.wait(lambda entry: entry.name == "step", 5.0))
    await asyncio.sleep(0.0)
    assert log.used
    log.add(2.0, "state", "step", {})
    assert (await waiting).t == 2.0
    assert (log.used, len(log)) == (False, 0)


def test_find() -> None:
    log = Log("d", 10, None)
    log.add(1.0, "command", "ardrone3.Piloting.moveTo", {})
    log.add(2.0, "command", "ardrone3.Piloting.PCMD", {})
    log.add(3.0, "event", "ardrone3.Piloting.PCMD", {})
    assert [entry.t for entry in log.find("command")] == [1.0, 2.0]
    assert [entry.t for entry in log.find("command", "PCMD")] == [2.0]
    assert [entry.t for entry in log.find("command", since=2.0)] == [2.0]


async def test_wait_looks_back_and_forward() -> None:
    log = Log("d", 10, None)
    log.add(1.0, "state", "a", {})
    assert (await log.wait(lambda entry: entry.name == "a", 0.0)).t == 1.0
    waiting = asyncio.ensure_future(log.wait(lambda entry: entry.name == "a", 5.0, since=1.5))
    await asyncio.sleep(0)
    log.add(2.0, "state", "b", {})
    assert not waiting.done()
    log.add(3.0, "state", "a", {})
    log.add(4.0, "state", "a", {})
    assert (await waiting).t == 3.0
    with pytest.raises(CommandTimeout):
        await log.wait(lambda entry: entry.name == "c", 0.01)
    log.add(5.0, "state", "c", {})  # no one waits for it any more
