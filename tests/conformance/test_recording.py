"""A recorded flight: what is in its two files, and what a ground station sees of it at a replay."""

from __future__ import annotations

import asyncio
import struct
import sys
from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.lines import UdpClient
from support.missions import ACTIVE, put, start, state, takeoff, way
from support.missions import LAND as LAND_ITEM
from support.world import ARMED, HOLD, LAND, world

from anafi_mav.arsdk.messages import common
from anafi_mav.cli import main, replay
from anafi_mav.cli.replay import files_of, read_tlogs, read_traces
from anafi_mav.config import RecordingConfig

KEY = bytes(range(32))
PASSWORD = b"open sesame"
SECRETS = (
    dialect.MAVLink_auth_key_message(PASSWORD),
    dialect.MAVLink_wifi_config_ap_message(b"field", PASSWORD),
    dialect.MAVLink_change_operator_control_message(1, 0, 0, PASSWORD),
)


async def flown(folder: Path) -> Path:
    """Record a short flight; the folder of its session."""
    async with world(speed=8.0, recording=RecordingConfig(folder=str(folder))) as w:
        await w.take_off(5.0)
        w.client.send(dialect.MAVLink_setup_signing_message(1, 1, KEY, 1))
        for secret in SECRETS:
            w.client.send(secret)
        assert (await w.client.command(dialect.MAV_CMD_NAV_LAND)).result == dialect.MAV_RESULT_ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode != LAND, timeout=30.0)
        (line,) = (line for line in w.gateway.lines() if line.startswith("recording "))
    return Path(line.removeprefix("recording "))


async def test_recording_has_both_wires_on_one_clock_and_no_key(tmp_path: Path) -> None:
    session = await flown(tmp_path)
    tlogs, traces = files_of(session)
    recorded = b"".join(path.read_bytes() for path in tlogs)
    assert KEY not in recorded
    assert PASSWORD not in recorded
    log = mavutil.mavlink_connection(str(tlogs[0]))
    messages = []
    while (message := log.recv_match()) is not None:
        messages.append((log.timestamp, message))
    kinds = {(message.get_srcSystem(), message.get_type()) for _, message in messages}
    assert {(1, "HEARTBEAT"), (1, "ATTITUDE"), (1, "COMMAND_ACK"), (255, "COMMAND_LONG")} <= kinds
    land = next(at for at, m in messages if m.get_type() == "COMMAND_LONG" and m.command == dialect.MAV_CMD_NAV_LAND)
    trace = list(read_traces(traces))
    assert {entry.drone for entry in trace} == {"alpha"}
    landing = next(entry for entry in trace if entry.name == "ardrone3.Piloting.Landing")
    state = next(
        entry
        for entry in trace
        if entry.name.endswith("FlyingStateChanged") and entry.args["state"] == 4 and entry.t > landing.t
    )
    ack = next(at for at, m in messages if m.get_type() == "COMMAND_ACK" and m.command == dialect.MAV_CMD_NAV_LAND)
    assert land <= landing.t <= state.t
    assert landing.t <= ack + 1e-5
    times = [entry.time for entry in read_tlogs(tlogs)]
    assert times == sorted(times)


async def test_recording_has_the_events_that_the_drone_has_sent_alone(tmp_path: Path) -> None:
    """It shows whether a real drone reports the end of its plan: the gateway finds that out without a report, too."""
    playing = common.MavlinkFilePlayingStateChanged.NAME
    async with world(web=True, recording=RecordingConfig(folder=str(tmp_path))) as w:
        await put(w, [takeoff(5.0), way(8.0, 0.0, 5.0), LAND_ITEM])
        await start(w)
        await state(w, ACTIVE, seq=1)
        w.drone.faults.unreported = frozenset({playing})
        await w.client.heartbeat(lambda beat: not beat.base_mode & ARMED, timeout=30.0)
        (line,) = (line for line in w.gateway.lines() if line.startswith("recording "))
    _, traces = files_of(Path(line.removeprefix("recording ")))
    states = [entry.args["state"] for entry in read_traces(traces) if entry.name == playing]
    assert states[-1] == common.PlayingState.PLAYING


async def test_replay_shows_a_station_the_vehicle_alone(tmp_path: Path) -> None:
    session = await flown(tmp_path)
    station, limited, other = [await UdpClient(255).open("127.0.0.1") for _ in range(3)]
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "anafi_mav", "replay", str(session), "--speed", "20", "--trace"),
        *("--endpoint", f"udpout://127.0.0.1:{station.port}"),
        *("--endpoint", f"udpout://127.0.0.1:{limited.port}?systems=1&block_messages=ATTITUDE"),
        *("--endpoint", f"udpout://127.0.0.1:{other.port}?systems=7"),
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        out, _ = await process.communicate()
        assert process.returncode == 0
        await station.heartbeat(lambda beat: beat.custom_mode == LAND, since=0)
        modes = [m.custom_mode for _, m in station.since(0, "HEARTBEAT")]
        assert modes.index(HOLD) < modes.index(LAND)
        assert {m.get_srcSystem() for _, m in station.received} == {1}
        await limited.heartbeat(lambda beat: beat.custom_mode == LAND, since=0)
        assert "ATTITUDE" not in {message.get_type() for _, message in limited.received}
        assert other.mark() == 0
        assert b"alpha command ardrone3.Piloting.Landing {}" in out
        assert out.decode().splitlines()[-1].endswith("frames played")
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
        for client in (station, limited, other):
            await client.close()


async def test_replay_of_a_file_of_other_bytes_can_be_ended(tmp_path: Path) -> None:
    """It is searched for frames in a thread; the event loop, which sees Ctrl-C, goes on."""
    path = tmp_path / "film.tlog"
    path.write_bytes(bytes(3_000_000))
    playing = asyncio.ensure_future(replay.play([path], [], ["udpout://127.0.0.1:9"], 1.0, 0.0))
    for _ in range(20):
        await asyncio.sleep(0)
    assert not playing.done()
    playing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await playing


def test_replay_names_a_file_that_cannot_be_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "gateway.0001.tlog").mkdir()
    assert main(["replay", str(tmp_path), "--endpoint", "udpout://127.0.0.1:9"]) == 1
    assert capsys.readouterr().err == f"anafi-mav: {tmp_path}/gateway.0001.tlog: cannot be read: Is a directory\n"


@pytest.mark.parametrize(
    "content", [b"", b"QGC WPL 110\n" * 40, bytes(range(256)) * 300], ids=["empty", "text", "bytes"]
)
def test_replay_of_a_file_without_a_frame_fails(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "film.tlog"
    path.write_bytes(content)
    assert main(["replay", str(path), "--endpoint", "udpout://127.0.0.1:9"]) == 1
    assert capsys.readouterr().err == f"anafi-mav: {path}: no MAVLink frame: expected a tlog\n"


@pytest.mark.parametrize(
    ("start", "error"),
    [
        ("-5", "expected a number of seconds, 0 or more, got -5"),
        ("9", "expected at most the 3 s of the recording, got 9"),
    ],
)
def test_replay_from_outside_the_recording_is_refused(
    start: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = dialect.MAVLink_heartbeat_message(2, dialect.MAV_AUTOPILOT_PX4, 0, 0, 3, 3).pack(sender)
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(struct.pack(">Q", second * 1_000_000) + beat for second in range(100, 104)))
    assert main(["replay", str(path), "--endpoint", "udpout://127.0.0.1:9", "--start", start]) == 2
    assert capsys.readouterr().err == f"anafi-mav: --start: {error}\n"


@pytest.mark.parametrize("times", [(4000000000, 100, 101, 102), (100, 4000000000, 101, 102), (3800, 3801, 200, 201)])
async def test_replay_goes_on_where_the_recorded_clock_was_set_back(times: tuple[int, ...], tmp_path: Path) -> None:
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = dialect.MAVLink_heartbeat_message(2, dialect.MAV_AUTOPILOT_PX4, 0, 0, 3, 3).pack(sender)
    path = tmp_path / "flight.tlog"
    path.write_bytes(b"".join(struct.pack(">Q", second * 1_000_000) + beat for second in times))
    assert await replay.play([path], [], ["udpout://127.0.0.1:9"], 20.0, 0.0) == 4


def test_recorded_clock_counts_on_after_it_was_set_back() -> None:
    """Entries of two sources may be in another order by a fraction of a second."""
    clock = replay.RecordedClock()
    times = (1000.0, 1001.0, 1000.9, 1001.5, 400.0, 401.0)
    assert [clock.advance(at) for at in times] == [0.0, 1.0, 1.0, 1.5, 1.5, 2.5]


def test_replay_names_the_option_of_a_wrong_endpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "gateway.0001.tlog").write_bytes(b"")
    assert main(["replay", str(tmp_path), "--endpoint", "udpout://127.0.0.1"]) == 2
    assert capsys.readouterr().err.startswith(
        "anafi-mav: --endpoint: 'udpout://127.0.0.1': expected udpout://HOST:PORT"
    )


def test_parts_of_a_session_follow_each_other_by_number(tmp_path: Path) -> None:
    names = [f"gateway.{number:04d}.tlog" for number in (9999, 10000, 998)]
    for name in names:
        (tmp_path / name).touch()
    assert [path.name for path in files_of(tmp_path)[0]] == [names[2], names[0], names[1]]
