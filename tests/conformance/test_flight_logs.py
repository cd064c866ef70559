"""Item 131: the drone's flight logs by LOG_REQUEST_* and in the directory @MAV_LOG of MAVLink FTP."""

from __future__ import annotations

import struct
import zlib
from datetime import datetime

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import ACK, CRC, FAIL, LIST, NOT_FOUND, OPEN, READ, REMOVE, Ftp
from support.mav import Client
from support.world import World, world

from anafi_mav.sim.payload.flight_log_store import BLOCK, FlightLogFile
from anafi_mav.sim.world.quirks import Quirk

DATE = "20261121T101112+0100"
TIME = 1795252272
"""The same in s since 1970, by hand: 20778 days, 9 h 11 min 12 s."""

FIRST_ID = {"px4": 0, "ardupilot": 1}
ALL = 0xFFFFFFFF


def add_log(w: World, seconds: float, date: str = DATE) -> FlightLogFile:
    """A log of an earlier flight."""
    return w.drone.firmware.flight_logs.add(date, seconds)


def stored(w: World) -> list[str]:
    """Names of the logs on the drone."""
    return [log.name for log in w.drone.firmware.flight_logs]


def content(log: FlightLogFile) -> bytes:
    return b"".join(log.parts(0, log.size, log.size))


async def entries(client: Client, start: int = 0, end: int = 0xFFFF) -> list[tuple[int, ...]]:
    """Id, count, last id, time and size of each log."""
    mark = client.mark()
    client.send(dialect.MAVLink_log_request_list_message(1, 1, start, end))
    last = await client.wait("LOG_ENTRY", lambda m: m.id >= min(m.last_log_num, end), since=mark)
    found = [m for _, m in client.since(mark, "LOG_ENTRY")]
    assert found[-1] is last
    return [(m.id, m.num_logs, m.last_log_num, m.time_utc, m.size) for m in found]


async def data(client: Client, id: int, offset: int, end: int, count: int = ALL) -> bytes:
    """The bytes of a log from `offset` to `end`."""
    mark = client.mark()
    client.send(dialect.MAVLink_log_request_data_message(1, 1, id, offset, count))
    await client.wait("LOG_DATA", lambda m: m.ofs + m.count == end, since=mark, timeout=30.0)
    parts = [m for _, m in client.since(mark, "LOG_DATA")]
    assert {m.id for m in parts} == {id}
    assert [m.ofs for m in parts] == list(range(offset, end, 90))  # in their order, none twice
    return b"".join(bytes(m.data[: m.count]) for m in parts)


@both
async def test_conf_131_log_of_a_flight_is_downloaded(flavour: str) -> None:
    async with world(flavour=flavour, web=True, speed=2.0) as w:
        first = FIRST_ID[flavour]
        await w.take_off(3.0)
        assert await entries(w.client) == [(0, 0, 0, 0, 0)]  # the flight goes on
        await w.client.command(dialect.MAV_CMD_NAV_LAND)
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == 1, timeout=30.0)
        (log,) = w.drone.firmware.flight_logs
        ((id, count, last, time, size),) = await entries(w.client)
        assert (id, count, last, size) == (first, 1, first, log.size)
        assert time == datetime.strptime(log.date, "%Y%m%dT%H%M%S%z").timestamp()
        assert await data(w.client, id, 0, log.size) == content(log)


@both
async def test_conf_131_parts_of_logs_are_sent_again(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        first = FIRST_ID[flavour]
        logs = [add_log(w, 2.0), add_log(w, 200.0), add_log(w, 1.0, "unreadable")]
        # Without a readable time it is the oldest: nothing shows when it was made.
        sizes = [1 * BLOCK, 2 * BLOCK, 200 * BLOCK]
        times = [0, TIME, TIME]
        expected = [(first + n, 3, first + 2, times[n], sizes[n]) for n in range(3)]
        assert await entries(w.client) == expected
        assert await entries(w.client, first + 1, first + 1) == expected[1:2]
        whole = content(logs[1])
        assert await data(w.client, first + 2, 0, len(whole)) == whole
        assert await data(w.client, first + 2, 46_080, 92_160, 46_080) == whole[46_080:92_160]
        assert await data(w.client, first + 2, 190_080, len(whole), 46_080) == whole[190_080:]
        assert await data(w.client, first + 1, 90, 91, 1) == content(logs[0])[90:91]
        for id, offset in ((first + 2, len(whole)), (first + 3, 0), (0xFFFF, 7)):
            mark = w.client.mark()
            w.client.send(dialect.MAVLink_log_request_data_message(1, 1, id, offset, 90))
            none = await w.client.wait("LOG_DATA", since=mark)
            assert (none.id, none.ofs, none.count) == (id, offset, 0)


async def test_conf_131_ids_stay_those_of_the_list_that_was_sent() -> None:
    async with world(web=True) as w:
        add_log(w, 2.0)
        kept = add_log(w, 3.0)
        await entries(w.client)
        other = await w.connect(254)
        await entries(other)
        await Ftp(other).ask(REMOVE, b"@MAV_LOG/log-1.bin")
        assert await entries(other) == [(0, 1, 0, TIME, kept.size)]
        assert await data(w.client, 1, 0, kept.size) == content(kept)
        assert await data(other, 0, 0, kept.size) == content(kept)


async def test_conf_131_download_ends_on_request() -> None:
    async with world(web=True) as w:
        log = add_log(w, 5000.0)
        await entries(w.client)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_log_request_data_message(1, 1, 0, 0, ALL))
        await w.client.wait("LOG_DATA", lambda m: m.ofs > 10_000, since=mark)
        w.client.send(dialect.MAVLink_log_request_end_message(1, 1))
        ping = dialect.MAVLink_ping_message(0, 77, 0, 0)
        w.client.send(ping)
        await w.client.wait("PING", lambda m: m.seq == 77)
        mark = w.client.mark()
        await w.client.wait("HEARTBEAT", since=mark, timeout=2.0)
        await w.client.wait("HEARTBEAT", since=w.client.mark(), timeout=2.0)
        assert w.client.since(mark, "LOG_DATA") == []
        # One that is requested instead of another replaces it.
        w.client.send(dialect.MAVLink_log_request_data_message(1, 1, 0, 0, ALL))
        tail = log.size - 900
        assert (await data_of(w.client, tail, 900))[-1] == log.size


async def data_of(client: Client, offset: int, count: int) -> list[int]:
    """Ends of the parts that a request for this part of log 0 brings, without those of an earlier request."""
    mark = client.mark()
    client.send(dialect.MAVLink_log_request_data_message(1, 1, 0, offset, count))
    await client.wait("LOG_DATA", lambda m: m.ofs + m.count == offset + count, since=mark, timeout=30.0)
    return [m.ofs + m.count for _, m in client.since(mark, "LOG_DATA") if m.ofs >= offset]


@both
async def test_conf_131_logs_are_erased_on_the_ground_alone(flavour: str) -> None:
    async with world(flavour=flavour, web=True, speed=2.0) as w:
        add_log(w, 2.0)
        add_log(w, 3.0)
        await w.take_off(3.0)
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_log_erase_message(1, 1))
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Erase logs refused: not on the ground", since=mark)
        ftp = Ftp(w.client)
        assert (await ftp.ask(REMOVE, b"@MAV_LOG/log-1.bin")).error == FAIL
        assert stored(w) == ["log-1.bin", "log-2.bin"]
        await w.client.command(dialect.MAV_CMD_NAV_LAND)
        await w.client.wait("EXTENDED_SYS_STATE", lambda m: m.landed_state == 1, since=mark, timeout=30.0)
        assert stored(w) == ["log-1.bin", "log-2.bin", "log-3.bin"]
        # As QGroundControl: the list is requested at once, and shows what is left.
        w.client.send(dialect.MAVLink_log_erase_message(1, 1))
        assert await entries(w.client) == [(0, 0, 0, 0, 0)]
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Flight logs erased: 3", since=mark)
        assert stored(w) == []


async def test_conf_131_repeated_erasure_is_one_text() -> None:
    async with world(web=True) as w:
        add_log(w, 2.0)
        mark = w.client.mark()
        for _ in range(3):
            w.client.send(dialect.MAVLink_log_erase_message(1, 1))
        assert await entries(w.client) == [(0, 0, 0, 0, 0)]  # behind them
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "erased" in m.text]
        assert texts == ["Flight logs erased: 1"]


async def test_conf_131_repeated_request_does_not_begin_the_list_again() -> None:
    async with world(web=True) as w:
        log = add_log(w, 2.0)
        assert w.drone.web is not None
        w.drone.web.mute = True
        mark = w.client.mark()
        for _ in range(4):  # its sender repeats it before the drone answers
            w.client.send(dialect.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
            await w.client.wait("HEARTBEAT", since=w.client.mark())
        assert w.client.since(mark, "LOG_ENTRY") == []
        w.drone.web.mute = False
        await w.client.wait("LOG_ENTRY", lambda m: m.size == log.size, since=mark)
        assert w.drone.web.served["flight logs"] == 1


async def test_conf_131_list_that_cannot_be_had_is_not_empty() -> None:
    async with world(web=True) as w:
        add_log(w, 2.0)
        assert w.drone.web is not None
        w.drone.web.mute = True
        mark = w.client.mark()
        w.client.send(dialect.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
        await w.client.wait(
            "STATUSTEXT", lambda m: m.text.startswith("Flight logs unavailable: "), since=mark, timeout=15.0
        )
        assert w.client.since(mark, "LOG_ENTRY") == []


@both
async def test_conf_131_logs_are_files_of_ftp(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        small, large = add_log(w, 2.0), add_log(w, 300.0)
        ftp = Ftp(w.client)
        names = [f"F{log.name}\t{log.size}" for log in (small, large)]
        assert await ftp.names("@MAV_LOG") == names
        assert await ftp.names("/@MAV_LOG/") == names
        assert await ftp.download(f"@MAV_LOG/{large.name}") == content(large)
        (crc,) = struct.unpack("<I", (await ftp.ask(CRC, f"@MAV_LOG/{small.name}".encode())).data)
        assert crc == zlib.crc32(content(small), 0xFFFFFFFF) ^ 0xFFFFFFFF
        for path in ("@MAV_LOG/log-3.bin", "@MAV_LOG/../log-1.bin", "@MAV_LOG/x/log-1.bin"):
            assert (await ftp.ask(OPEN, path.encode())).error == NOT_FOUND
        assert (await ftp.ask(LIST, b"@MAV_LOG/x")).error == NOT_FOUND
        assert (await ftp.ask(REMOVE, f"@MAV_LOG/{small.name}".encode())).opcode == ACK
        assert stored(w) == [large.name]
        assert await ftp.names("@MAV_LOG") == names[1:]


async def test_conf_131_drone_without_ranges_sends_its_logs() -> None:
    async with world(web=True) as w:
        w.drone.faults.quirks = frozenset({Quirk.NO_HTTP_RANGE})
        log, ftp = add_log(w, 400.0), Ftp(w.client)
        await ftp.ask(OPEN, f"@MAV_LOG/{log.name}".encode())
        for offset in (300_000, 5, log.size - 9):
            part = await ftp.ask(READ, size=239, offset=offset)
            assert part.data == content(log)[offset : offset + 239]
