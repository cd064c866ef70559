"""The FTP server's core: sessions by the table, answers by hand-made payloads, and nothing that bytes could break."""

from __future__ import annotations

import random
import struct

import pytest

from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import FileTree, Query
from anafi_mav.services.ftp.ftp import (
    ACK,
    BURST_PARTS,
    DATA,
    MAX_CLIENTS,
    MAX_SESSIONS,
    NAK,
    PAYLOAD,
    SESSION_TIMEOUT,
    TAKEOVER,
    TRANSITIONS,
    Error,
    Event,
    FtpServer,
    Opcode,
    State,
)

CONTENT = bytes(range(256)) * 4
OTHER = b"other"


def tree() -> FileTree:
    return FileTree(
        {
            "/data.bin": lambda query: CONTENT,
            "/deep/other.txt": lambda query: OTHER,
            "/@PARAM/param.pck": lambda query: repr(sorted(query.items())).encode(),
            "/empty": lambda query: b"",
        }
    )


def request(
    opcode: int, data: bytes = b"", *, seq: int = 0, session: int = 0, size: int | None = None, offset: int = 0
) -> bytes:
    header = struct.pack("<HBBBBBBI", seq, session, opcode, len(data) if size is None else size, 0, 0, 0, offset)
    return (header + data).ljust(PAYLOAD, b"\0")


class Reply:
    """An answer, taken apart."""

    def __init__(self, payload: bytes | None) -> None:
        assert payload is not None
        assert len(payload) == PAYLOAD
        fields = struct.unpack_from("<HBBBBBBI", payload)
        self.seq, self.session, self.opcode, self.size, self.req_opcode, self.complete, _, self.offset = fields
        self.data = payload[12 : 12 + self.size]

    @property
    def error(self) -> int:
        assert self.opcode == NAK
        assert self.size == 1
        return self.data[0]


class Bench:
    def __init__(self) -> None:
        self.server = FtpServer()
        self.now = 0.0

    def ask(self, payload: bytes, who: object = "a") -> Reply:
        return Reply(self.server.receive(who, payload, tree(), self.now))


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("event", Event)
def test_every_transition(state: State, event: Event) -> None:
    """A closed session can only be opened; the end of a burst belongs to a burst."""
    expected = {
        Event.OPEN: State.OPEN,
        Event.READ: State.OPEN,
        Event.BURST: State.BURSTING,
        Event.TERMINATE: State.CLOSED,
        Event.EXPIRE: State.CLOSED,
        Event.CREATE: State.WRITING,
    }
    if state is State.CLOSED:
        assert TRANSITIONS[state].get(event) is {Event.OPEN: State.OPEN, Event.CREATE: State.WRITING}.get(event)
    elif event is Event.WRITE:
        assert TRANSITIONS[state].get(event) is (State.WRITING if state is State.WRITING else None)
    elif state is State.WRITING and event in (Event.READ, Event.BURST):
        assert event not in TRANSITIONS[state]
    elif event is Event.BURST_ENDS:
        assert TRANSITIONS[state].get(event) is (State.OPEN if state is State.BURSTING else None)
    else:
        assert TRANSITIONS[state][event] is expected[event]


def test_open_and_read() -> None:
    b = Bench()
    # by hand: sequence 7, session 0, opcode 4, size 9, path
    opened = b.ask(bytes.fromhex("0700 00 04 09 00 00 00 00000000") + b"/data.bin".ljust(239, b"\0"))
    assert (opened.seq, opened.session, opened.opcode, opened.req_opcode) == (8, 0, ACK, 4)
    assert opened.data == (1024).to_bytes(4, "little")
    read = b.ask(request(Opcode.READ_FILE, seq=9, size=100, offset=1000))
    assert (read.seq, read.opcode, read.offset, read.data) == (10, ACK, 1000, CONTENT[1000:])
    assert b.ask(request(Opcode.READ_FILE, seq=11, size=239, offset=0)).data == CONTENT[:239]
    assert b.ask(request(Opcode.READ_FILE, seq=13, size=10, offset=1024)).error == Error.EOF
    assert b.ask(request(Opcode.READ_FILE, seq=13, size=10, offset=2**32 - 1)).error == Error.EOF
    assert b.ask(request(Opcode.TERMINATE_SESSION, seq=15)).opcode == ACK
    assert b.ask(request(Opcode.READ_FILE, seq=17, size=10)).error == Error.INVALID_SESSION


def test_sequence_numbers_wrap() -> None:
    b = Bench()
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", seq=0xFFFF)).seq == 0


@pytest.mark.parametrize("path", [b"/data.bin", b"data.bin", b"./data.bin", b"//data.bin", b"/data.bin\0"])
def test_ways_to_write_a_path(path: bytes) -> None:
    assert Bench().ask(request(Opcode.OPEN_FILE_RO, path)).opcode == ACK


@pytest.mark.parametrize(
    "path", [b"", b"/", b"/nothing", b"../data.bin", b"/deep/../data.bin", b"/..", b"\xff\xfe", b"/deep", b"a" * 239]
)
def test_no_such_file(path: bytes) -> None:
    """A way out of the tree is no file either, even if it would lead back into it."""
    b = Bench()
    assert b.ask(request(Opcode.OPEN_FILE_RO, path)).error == Error.FILE_NOT_FOUND
    assert b.ask(request(Opcode.CALC_FILE_CRC32, path)).error == Error.FILE_NOT_FOUND
    assert b.server.sessions == 0


def test_queries() -> None:
    queries: list[Query] = []
    made = FileTree({"/@PARAM/param.pck": lambda query: queries.append(query) or b"x"})  # type: ignore[func-returns-value]
    assert made.read("@PARAM/param.pck?start=3&count=10&withdefaults=1") == b"x"
    assert made.read("@PARAM/param.pck") == b"x"
    assert queries == [{"start": "3", "count": "10", "withdefaults": "1"}, {}]
    assert made.read("@PARAM/param.pck?" + "&".join(f"a{n}=1" for n in range(100))) is None


def test_bursts() -> None:
    """Parts one after the other, each with the next sequence number; the last one says that it is the last."""
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", seq=0))
    parts = [b.ask(request(Opcode.BURST_READ_FILE, seq=4, size=100, offset=24))]
    while (part := b.server.burst("a")) is not None:
        parts.append(Reply(part))
    assert b"".join(part.data for part in parts) == CONTENT[24:]
    assert [part.seq for part in parts] == list(range(5, 15))
    assert [part.offset for part in parts] == list(range(24, 1024, 100))
    assert [part.complete for part in parts] == [0] * 9 + [1]
    assert {part.req_opcode for part in parts} == {Opcode.BURST_READ_FILE}
    assert b.ask(request(Opcode.BURST_READ_FILE, seq=20, size=100, offset=1024)).error == Error.EOF
    assert not b.server.bursting("a")


def test_a_burst_ends_after_a_while() -> None:
    long = FileTree({"/long": lambda query: bytes(DATA * (BURST_PARTS + 5))})
    server = FtpServer()
    server.receive("a", request(Opcode.OPEN_FILE_RO, b"/long"), long, 0.0)
    parts = [Reply(server.receive("a", request(Opcode.BURST_READ_FILE, size=DATA), long, 0.0))]
    while (part := server.burst("a")) is not None:
        parts.append(Reply(part))
    assert len(parts) == BURST_PARTS
    assert [part.complete for part in parts][-2:] == [0, 1]


@pytest.mark.parametrize("interruption", [Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS, Opcode.READ_FILE])
def test_burst_ends_on_each_of_these_requests(interruption: Opcode) -> None:
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    b.ask(request(Opcode.BURST_READ_FILE, seq=2, size=10))
    b.ask(request(interruption, seq=4, size=5))
    assert b.server.burst("a") is None


def test_an_empty_file() -> None:
    b = Bench()
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/empty")).data == bytes(4)
    assert b.ask(request(Opcode.READ_FILE, seq=2, size=10)).error == Error.EOF
    assert b.ask(request(Opcode.BURST_READ_FILE, seq=4, size=10)).error == Error.EOF


def test_lists() -> None:
    b = Bench()
    listed = b.ask(request(Opcode.LIST_DIRECTORY, b"/"))
    assert listed.data == b"D@PARAM\0Fdata.bin\t1024\0Ddeep\0Fempty\t0\0"
    assert b.ask(request(Opcode.LIST_DIRECTORY, b"/", offset=2)).data == b"Ddeep\0Fempty\t0\0"
    assert b.ask(request(Opcode.LIST_DIRECTORY, b"/", offset=4)).error == Error.EOF
    assert b.ask(request(Opcode.LIST_DIRECTORY, b"", offset=3)).data == b"Fempty\t0\0"
    assert b.ask(request(Opcode.LIST_DIRECTORY, b"/deep")).data == b"Fother.txt\t5\0"
    assert b.ask(request(Opcode.LIST_DIRECTORY_WITH_TIME, b"/deep")).data == b"Fother.txt\t5\t0\0"
    assert b.ask(request(Opcode.LIST_DIRECTORY_WITH_TIME, b"/")).data.startswith(b"D@PARAM\t0\t0\0F")
    for path in (b"/..", b"/nothing", b"/data.bin"):
        assert b.ask(request(Opcode.LIST_DIRECTORY, path)).error == Error.FILE_NOT_FOUND


def test_a_long_list_takes_several_messages() -> None:
    many = FileTree({f"/file{number:03d}": lambda query: b"" for number in range(50)})
    server, names, offset = FtpServer(), [], 0
    while True:
        reply = Reply(server.receive("a", request(Opcode.LIST_DIRECTORY, b"/", offset=offset), many, 0.0))
        if reply.opcode == NAK:
            assert reply.error == Error.EOF
            break
        lines = reply.data.split(b"\0")[:-1]
        names += lines
        offset += len(lines)
    assert names == [b"Ffile%03d\t0" % number for number in range(50)]


def test_crc() -> None:
    reply = Bench().ask(request(Opcode.CALC_FILE_CRC32, b"/data.bin"))
    assert reply.data == crc32(CONTENT).to_bytes(4, "little")


@pytest.mark.parametrize(
    "opcode",
    [
        Opcode.CREATE_FILE,
        Opcode.REMOVE_FILE,
        Opcode.CREATE_DIRECTORY,
        Opcode.REMOVE_DIRECTORY,
        Opcode.OPEN_FILE_WO,
        Opcode.TRUNCATE_FILE,
        Opcode.RENAME,
    ],
)
def test_nothing_can_be_written(opcode: Opcode) -> None:
    assert Bench().ask(request(opcode, b"/data.bin")).error == Error.FILE_PROTECTED


def test_write_without_a_created_file_is_an_invalid_session() -> None:
    b = Bench()
    assert b.ask(request(Opcode.WRITE_FILE, b"x")).error == Error.INVALID_SESSION
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    assert b.ask(request(Opcode.WRITE_FILE, b"x")).error == Error.INVALID_SESSION


def test_odd_requests() -> None:
    b = Bench()
    assert b.ask(request(Opcode.NONE, seq=3)).opcode == ACK
    assert b.ask(request(99)).error == Error.UNKNOWN_COMMAND
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", size=240)).error == Error.INVALID_DATA_SIZE
    assert b.server.receive("a", request(ACK), tree(), 0.0) is None  # somebody's answer
    assert b.server.receive("a", request(NAK), tree(), 0.0) is None
    assert b.server.receive("a", bytes(11), tree(), 0.0) is None


def test_a_lost_answer_comes_again() -> None:
    """The same sequence number, the same request: the same answer."""
    b = Bench()
    for payload in (
        request(Opcode.OPEN_FILE_RO, b"/data.bin", seq=2),
        request(Opcode.READ_FILE, seq=4, size=50, offset=30),
        request(Opcode.BURST_READ_FILE, seq=6, size=50, offset=30),
        request(Opcode.LIST_DIRECTORY, b"/", seq=8),
        request(Opcode.CALC_FILE_CRC32, b"/data.bin", seq=10),
        request(Opcode.TERMINATE_SESSION, seq=12),
        request(Opcode.RESET_SESSIONS, seq=14),
    ):
        first = b.server.receive("a", payload, tree(), b.now)
        assert b.server.receive("a", payload, tree(), b.now) == first
    # A new request to end what has ended is another matter.
    assert b.ask(request(Opcode.TERMINATE_SESSION, seq=16)).error == Error.INVALID_SESSION


def test_clients_do_not_share_sessions() -> None:
    b = Bench()
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"), "a").session == 0
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/deep/other.txt"), "b").session == 0
    assert b.ask(request(Opcode.READ_FILE, seq=2, size=5), "a").data == CONTENT[:5]
    assert b.ask(request(Opcode.READ_FILE, seq=2, size=5), "b").data == OTHER
    b.ask(request(Opcode.RESET_SESSIONS, seq=4), "b")
    assert b.ask(request(Opcode.READ_FILE, seq=4, size=5), "a").data == CONTENT[:5]
    assert b.ask(request(Opcode.READ_FILE, seq=6, size=5), "c").error == Error.INVALID_SESSION


def test_numbers_that_a_client_gives() -> None:
    """MAVProxy numbers its sessions; each is a file of its own, and there is an end to them."""
    b = Bench()
    for number in range(MAX_SESSIONS):
        assert b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", session=40 + number)).session == 40 + number
    over = b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", session=99))
    assert over.error == Error.NO_SESSIONS_AVAILABLE
    b.ask(request(Opcode.TERMINATE_SESSION, session=41))
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", session=99)).opcode == ACK


def test_a_number_that_is_still_open() -> None:
    """Nobody gets another file than he opened: not at once, and after a silence the new one."""
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/deep/other.txt", seq=2)).error == Error.NO_SESSIONS_AVAILABLE
    assert b.ask(request(Opcode.READ_FILE, seq=4, size=5)).data == CONTENT[:5]
    b.now = TAKEOVER
    assert b.ask(request(Opcode.OPEN_FILE_RO, b"/deep/other.txt", seq=6)).opcode == ACK
    assert b.ask(request(Opcode.READ_FILE, seq=8, size=5)).data == OTHER


def test_open_file_keeps_its_content() -> None:
    contents = iter([b"first", b"second"])
    changing = FileTree({"/x": lambda query: next(contents)})
    server = FtpServer()
    server.receive("a", request(Opcode.OPEN_FILE_RO, b"/x"), changing, 0.0)
    server.receive("b", request(Opcode.OPEN_FILE_RO, b"/x"), changing, 0.0)
    assert Reply(server.receive("a", request(Opcode.READ_FILE, size=9), changing, 0.0)).data == b"first"


def test_silence_closes_a_session() -> None:
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    b.now = SESSION_TIMEOUT - 0.1
    b.server.expire(b.now)
    assert b.ask(request(Opcode.READ_FILE, seq=2, size=5)).opcode == ACK
    b.now += SESSION_TIMEOUT
    b.server.expire(b.now)
    assert b.server.sessions == 0
    assert b.ask(request(Opcode.READ_FILE, seq=4, size=5)).error == Error.INVALID_SESSION


def test_a_crowd_of_clients_is_bounded() -> None:
    b = Bench()
    for number in range(3 * MAX_CLIENTS):
        b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"), number)
    assert b.server.sessions == MAX_CLIENTS
    b.server.forget(lambda who: who != 3 * MAX_CLIENTS - 1)
    assert b.server.sessions == 1


def test_no_bytes_break_it() -> None:
    """Any payload is answered with a payload or with nothing; what is kept stays bounded."""
    rng = random.Random(20261121)
    server, files = FtpServer(), tree()
    seeds = [request(opcode, b"/data.bin", seq=3) for opcode in Opcode]
    for step in range(20_000):
        if rng.random() < 0.3:
            payload = rng.randbytes(rng.randrange(0, 300))
        else:
            mutated = bytearray(rng.choice(seeds))
            for _ in range(rng.randrange(0, 6)):
                mutated[rng.randrange(len(mutated))] = rng.randrange(256)
            payload = bytes(mutated)
        who = rng.randrange(50)
        answer = server.receive(who, payload, files, step * 0.01)
        assert answer is None or len(answer) == PAYLOAD
        part = server.burst(who)
        assert part is None or len(part) == PAYLOAD
        if step % 100 == 0:
            server.expire(step * 0.01)
        assert server.sessions <= MAX_CLIENTS * MAX_SESSIONS
