"""Items 113-115 of the conformance list: MAVLink FTP over real sockets."""

from __future__ import annotations

import asyncio
import json
import random
import struct
import time
import zlib

from MAVProxy.modules.lib.param_ftp import ftp_param_decode
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.flavours import both
from support.ftp import (
    ACK,
    BURST,
    CRC,
    EOF,
    LIST,
    NO_SESSION,
    NOT_FOUND,
    OPEN,
    PROTECTED,
    READ,
    RESET,
    TERMINATE,
    Ftp,
    taken_apart,
)
from support.params import fetch, value_of
from support.world import world


@both
async def test_conf_113_list_open_read_burst_crc(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        ftp = Ftp(w.client)
        listed = (await ftp.ask(LIST, b"/")).data.split(b"\0")[:-1]
        names = [line[1:].split(b"\t")[0].decode() for line in listed]
        assert names == sorted(names)
        assert {"general.json", "general.json.xz", "parameter.json", "events.json"} <= set(names)
        assert ("@PARAM" in names) is (flavour == "ardupilot")
        assert (await ftp.ask(LIST, b"/", offset=len(names))).error == EOF
        sizes = dict(line[1:].split(b"\t") for line in listed if line.startswith(b"F"))

        opened = await ftp.ask(OPEN, b"/parameter.json")
        (size,) = struct.unpack("<I", opened.data)
        assert size == int(sizes[b"parameter.json"])
        content = b""
        while len(content) < size:
            content += (await ftp.ask(READ, session=opened.session, size=200, offset=len(content))).data
        assert (await ftp.ask(READ, session=opened.session, size=200, offset=size)).error == EOF
        assert (await ftp.ask(TERMINATE, session=opened.session)).opcode == ACK
        assert (await ftp.ask(READ, session=opened.session, size=200)).error == NO_SESSION
        assert json.loads(content)["parameters"]

        assert await ftp.download("/parameter.json") == content  # the same, by bursts
        (crc,) = struct.unpack("<I", (await ftp.ask(CRC, b"/parameter.json")).data)
        assert crc == zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF
        assert (await ftp.ask(RESET)).opcode == ACK


async def test_conf_113_a_lost_reply_is_sent_again() -> None:
    """A client that lost an answer repeats its request under the same number and gets the same answer."""
    async with world() as w:
        ftp = Ftp(w.client)
        for request in (
            {"opcode": OPEN, "data": b"/parameter.json"},
            {"opcode": READ, "size": 100, "offset": 300},
            {"opcode": LIST, "data": b"/", "offset": 1},
            {"opcode": TERMINATE},
        ):
            seq = ftp.seq
            first = await ftp.ask(**request, seq=seq)
            assert first.opcode == ACK
            assert await ftp.ask(**request, seq=seq) == first
        # And a burst: from where it began, with the same numbers.
        await ftp.ask(OPEN, b"/parameter.json")
        seq, bursts = ftp.seq, []
        for _ in range(2):
            mark = w.client.mark()
            ftp.send(BURST, size=239, seq=seq)
            await w.client.wait("FILE_TRANSFER_PROTOCOL", lambda m: taken_apart(m).complete == 1, since=mark)
            bursts.append([taken_apart(m) for _, m in w.client.since(mark, "FILE_TRANSFER_PROTOCOL")])
        assert bursts[0] == bursts[1]
        assert [part.seq for part in bursts[0]] == list(range(seq + 1, seq + 1 + len(bursts[0])))


async def test_conf_113_no_way_out_and_nothing_to_write() -> None:
    async with world() as w:
        ftp = Ftp(w.client)
        for path in (
            b"../pyproject.toml",
            b"/../../etc/passwd",
            b"/etc/passwd",
            b"@PARAM/../../etc/passwd",
            b"\xff" * 20,
        ):
            for opcode in (OPEN, CRC, LIST):
                assert (await ftp.ask(opcode, path)).error == NOT_FOUND
        for opcode in (6, 8, 9, 10, 11, 12, 13):
            assert (await ftp.ask(opcode, b"/parameter.json")).error == PROTECTED
        assert (await ftp.ask(7, b"/parameter.json")).error == NO_SESSION
        assert (await ftp.ask(77)).error == 7
        assert await ftp.download("/general.json")  # all as it was


async def test_conf_114_param_pck_px4() -> None:
    """PX4's clients ask, too: a plain no, at once."""
    async with world() as w:
        began = time.monotonic()
        assert (await Ftp(w.client).ask(OPEN, b"@PARAM/param.pck?withdefaults=1")).error == NOT_FOUND
        assert time.monotonic() - began < 0.2


async def test_conf_114_param_pck_ardupilot() -> None:
    """The packed file has what the list has, name by name and bit by bit; MAVProxy's own decoder reads it."""
    async with world(flavour="ardupilot") as w:
        values = await fetch(w.client)
        ftp = Ftp(w.client)
        for path in ("@PARAM/param.pck", "/@PARAM/param.pck", "@PARAM/param.pck?withdefaults=1"):
            decoded = ftp_param_decode(await ftp.download(path))
            assert [name.decode() for name, _, _ in decoded.params] == list(values)
            for name, value, kind in decoded.params:
                message = values[name.decode()]
                assert {1: 2, 2: 4, 3: 6, 4: 9}[kind] == message.param_type
                assert struct.pack("<f", value) == struct.pack("<f", value_of(message, "ardupilot"))
        part = await ftp.download("@PARAM/param.pck?start=3&count=5")
        assert struct.unpack("<HHH", part[:6]) == (0x671B, 5, len(values))
        for path in (b"@PARAM/param.pck?start=abc", b"@PARAM/param.pck?x=1", b"@PARAM/other.pck"):
            assert (await ftp.ask(OPEN, path)).error == NOT_FOUND


async def test_conf_115_two_clients() -> None:
    """Each has a session 0 of its own, on the same channel or on another; a reset is for one's own."""
    async with world(clients=2) as w:
        first, second = (Ftp(client) for client in w.clients)
        assert (await first.ask(OPEN, b"/parameter.json")).session == 0
        assert (await second.ask(OPEN, b"/events.json")).session == 0
        expected = (await first.ask(READ, size=100)).data
        assert (await second.ask(READ, size=100)).data != expected
        assert (await second.ask(RESET)).opcode == ACK
        assert (await second.ask(READ, size=100)).error == NO_SESSION
        assert (await first.ask(READ, size=100)).data == expected
        # Two programs behind one connection.
        third = Ftp(w.client, sender=(254, 191))
        assert (await third.ask(READ, size=100)).error == NO_SESSION


async def test_downloads_at_the_same_time() -> None:
    async with world(clients=3) as w:
        contents = await asyncio.gather(*(Ftp(client).download("/parameter.json") for client in w.clients))
        assert len(set(contents)) == 1


async def test_payloads_of_any_kind() -> None:
    """Nothing that a client puts into the payload stops the heartbeat, or an orderly client."""
    rng = random.Random(7)
    async with world(clients=2) as w:
        mark = w.clients[1].mark()
        for _ in range(2000):
            size = rng.randrange(0, 251)
            payload = (
                rng.randbytes(size) if rng.random() < 0.5 else bytes((0, 0, 0, rng.randrange(17), size)) + bytes(9)
            )
            w.client.send(dialect.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload.ljust(251, b"\0"))))
        assert json.loads(await Ftp(w.clients[1]).download("/general.json"))
        await w.clients[1].wait("HEARTBEAT", since=mark)
