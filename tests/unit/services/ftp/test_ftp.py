"""The FTP server's core: sessions by the table, answers by hand-made payloads, and nothing that bytes could break."""

from __future__ import annotations

import random
import struct
from typing import Any

import pytest

from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import Entry, FileRefused, FileSource, FileTree, MadeFile, Query
from anafi_mav.services.files import FileError as Error
from anafi_mav.services.ftp.ftp import (
    ACK,
    BURST_PARTS,
    DATA,
    MAX_CLIENTS,
    MAX_SESSIONS,
    MAX_WAITS,
    NAK,
    PAYLOAD,
    SESSION_TIMEOUT,
    TAKEOVER,
    TRANSITIONS,
    Event,
    FtpServer,
    Opcode,
    State,
    Wait,
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

    def __init__(self, payload: bytes | Wait | None) -> None:
        assert isinstance(payload, bytes)
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
        Event.OPEN: State.OPENING,
        Event.READ: State.OPEN,
        Event.BURST: State.BURSTING,
        Event.TERMINATE: State.CLOSED,
        Event.EXPIRE: State.CLOSED,
        Event.CREATE: State.WRITING,
    }
    if state is State.CLOSED:
        assert TRANSITIONS[state].get(event) is {Event.OPEN: State.OPENING, Event.CREATE: State.WRITING}.get(event)
    elif event in (Event.OPENED, Event.REFUSED):
        ends = {Event.OPENED: State.OPEN, Event.REFUSED: State.CLOSED}
        assert TRANSITIONS[state].get(event) is (ends[event] if state is State.OPENING else None)
    elif event is Event.WRITE:
        assert TRANSITIONS[state].get(event) is (State.WRITING if state is State.WRITING else None)
    elif state in (State.WRITING, State.OPENING) and event in (Event.READ, Event.BURST):
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
    assert made.open("@PARAM/param.pck?start=3&count=10&withdefaults=1") == MadeFile(b"x")
    assert made.open("@PARAM/param.pck") == MadeFile(b"x")
    assert queries == [{"start": "3", "count": "10", "withdefaults": "1"}, {}]
    with pytest.raises(FileRefused):
        made.open("@PARAM/param.pck?" + "&".join(f"a{n}=1" for n in range(100)))


def test_bursts() -> None:
    """Parts one after the other, each with the next sequence number; the last one says that it is the last."""
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin", seq=0))
    parts = [b.ask(request(Opcode.BURST_READ_FILE, seq=4, size=100, offset=24))]
    while (part := b.server.burst("a", 0.0)) is not None:
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
    while (part := server.burst("a", 0.0)) is not None:
        parts.append(Reply(part))
    assert len(parts) == BURST_PARTS
    assert [part.complete for part in parts][-2:] == [0, 1]


def test_burst_slower_than_the_timeout_keeps_its_session() -> None:
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    b.ask(request(Opcode.BURST_READ_FILE, seq=2, size=200))
    for _ in range(5):
        b.now += SESSION_TIMEOUT / 2
        assert b.server.burst("a", b.now) is not None
        b.server.expire(b.now)
    assert b.server.sessions == 1
    assert not b.server.bursting("a")
    b.server.expire(b.now + SESSION_TIMEOUT)
    assert b.server.sessions == 0


@pytest.mark.parametrize("interruption", [Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS, Opcode.READ_FILE])
def test_burst_ends_on_each_of_these_requests(interruption: Opcode) -> None:
    b = Bench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/data.bin"))
    b.ask(request(Opcode.BURST_READ_FILE, seq=2, size=10))
    b.ask(request(interruption, seq=4, size=5))
    assert b.server.burst("a", 0.0) is None


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
    assert b.server.receive("a", request(ACK), tree(), 0.0) is None  # another client's answer
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


def test_terminate_with_same_number_closes_the_next_file() -> None:
    """A client that numbers its requests from 0 for each file sends the same TerminateSession for each."""
    b = Bench()
    for path in (b"/data.bin", b"/deep/other.txt", b"/data.bin"):
        assert b.ask(request(Opcode.OPEN_FILE_RO, path, seq=0)).opcode == ACK
        assert b.ask(request(Opcode.TERMINATE_SESSION, seq=2)).opcode == ACK
        assert b.server.sessions == 0


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
    """No one gets another file than he opened: not at once, and after a silence the new one."""
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


# -- files that need time


class Later:
    """An awaitable for a value that the test hands over itself."""

    def __await__(self) -> Any:
        raise AssertionError("the core awaits nothing")
        yield


class Slow(FileTree):
    """A tree whose files need time: `/slow`, of the size of CONTENT."""

    def __init__(self) -> None:
        super().__init__({"/fast": lambda query: OTHER})
        self.asked: list[Any] = []
        self.reasons: list[FileRefused] = []

    def open(self, path: str) -> Any:
        return super().open(path) if path == "/fast" else self._later("open", path)

    def list(self, path: str) -> Any:
        return self._later("list", path)

    def checksum(self, path: str) -> Any:
        return self._later("checksum", path)

    def remove(self, path: str) -> Any:
        return self._later("remove", path)

    def refused(self, refusal: FileRefused) -> None:
        self.reasons.append(refusal)

    def _later(self, *what: object) -> Later:
        self.asked.append(what)
        return Later()


class SlowSource:
    """An open file whose bytes need time."""

    size = len(CONTENT)

    def read(self, offset: int, size: int) -> Any:
        return Later()


class SlowBench:
    def __init__(self) -> None:
        self.server, self.files, self.now = FtpServer(), Slow(), 0.0

    def ask(self, payload: bytes, who: object = "a") -> Wait:
        wait = self.server.receive(who, payload, self.files, self.now)
        assert isinstance(wait, Wait)
        return wait

    def again(self, payload: bytes) -> bytes | Wait | None:
        return self.server.receive("a", payload, self.files, self.now)

    def finish(self, wait: Wait, value: object) -> list[Reply]:
        return [Reply(payload) for payload in self.server.finish(wait, value)]

    def opened(self, source: FileSource | None = None) -> None:
        (reply,) = self.finish(self.ask(request(Opcode.OPEN_FILE_RO, b"/slow")), source or SlowSource())
        assert reply.data == len(CONTENT).to_bytes(4, "little")


def test_late_file_is_answered_once_for_each_sequence_number() -> None:
    """QGroundControl repeats a request under another number, MAVSDK under the same."""
    b = SlowBench()
    wait = b.ask(request(Opcode.OPEN_FILE_RO, b"/slow", seq=2))
    for seq in (2, 4, 2, 6):
        assert b.again(request(Opcode.OPEN_FILE_RO, b"/slow", seq=seq)) is None
    assert [reply.seq for reply in b.finish(wait, SlowSource())] == [3, 5, 7]
    assert b.files.asked == [("open", "/slow")]
    assert b.finish(wait, SlowSource()) == []


def test_late_read_and_burst_are_answered_with_their_bytes() -> None:
    b = SlowBench()
    b.opened()
    (read,) = b.finish(b.ask(request(Opcode.READ_FILE, seq=4, size=100, offset=1000)), CONTENT[1000:])
    assert (read.seq, read.offset, read.data) == (5, 1000, CONTENT[1000:])
    wait = b.ask(request(Opcode.BURST_READ_FILE, seq=6, size=100, offset=24))
    assert not b.server.bursting("a")
    parts = b.finish(wait, CONTENT[24:])
    while (part := b.server.burst("a", 0.0)) is not None:
        parts.append(Reply(part))
    assert b"".join(part.data for part in parts) == CONTENT[24:]
    assert [part.complete for part in parts] == [0] * 9 + [1]
    assert Reply(b.again(request(Opcode.READ_FILE, seq=8, size=9, offset=1024))).error == Error.EOF


def test_late_refusal_names_its_error_and_ends_the_opening() -> None:
    b = SlowBench()
    refusal = FileRefused(Error.FAIL)
    (reply,) = b.finish(b.ask(request(Opcode.OPEN_FILE_RO, b"/slow")), refusal)
    assert reply.error == Error.FAIL
    assert b.files.reasons == [refusal]
    assert b.server.sessions == 0
    b.opened()
    (reply,) = b.finish(b.ask(request(Opcode.READ_FILE, seq=4, size=9)), FileRefused(Error.FAIL))
    assert reply.error == Error.FAIL
    assert b.server.sessions == 1  # its client may try again


@pytest.mark.parametrize("end", ["terminate", "reset", "forget", "another file"])
def test_session_that_ends_abandons_what_waits(end: str) -> None:
    b = SlowBench()
    b.opened()
    wait, abandoned = b.ask(request(Opcode.READ_FILE, seq=4, size=9)), []
    wait.abandon = lambda: abandoned.append(end)
    b.now = SESSION_TIMEOUT
    match end:
        case "terminate":
            b.again(request(Opcode.TERMINATE_SESSION, seq=6))
        case "reset":
            b.again(request(Opcode.RESET_SESSIONS, seq=6))
        case "forget":
            b.server.forget(lambda who: True)
        case _:
            assert Reply(b.again(request(Opcode.OPEN_FILE_RO, b"/fast", seq=6))).data == b"\5\0\0\0"
    assert abandoned == [end]
    assert b.finish(wait, b"123456789") == []


def test_session_does_not_expire_while_its_client_is_owed_an_answer() -> None:
    """The drone may take a minute for a list or a piece of a file, and the client waits for the answer."""
    b = SlowBench()
    opening = b.ask(request(Opcode.OPEN_FILE_RO, b"/slow"))
    for now in (SESSION_TIMEOUT, 2.0 * SESSION_TIMEOUT):
        b.server.expire(now)
    assert [reply.opcode for reply in b.finish(opening, SlowSource())] == [ACK]
    b.now = 2.5 * SESSION_TIMEOUT
    b.server.expire(b.now)
    (read,) = b.finish(b.ask(request(Opcode.READ_FILE, seq=4, size=9)), b"123456789")
    assert read.data == b"123456789"
    b.server.expire(3.5 * SESSION_TIMEOUT)
    assert b.server.sessions == 0


@pytest.mark.parametrize(("beats", "is_abandoned"), [((), False), ((1.0,), True), ((1.0, SESSION_TIMEOUT), False)])
def test_checksum_ends_when_heartbeats_of_its_client_stop(beats: tuple[float, ...], is_abandoned: bool) -> None:
    """One that has sent none waits as long as the file takes."""
    b = SlowBench()
    wait, abandoned = b.ask(request(Opcode.CALC_FILE_CRC32, b"/slow")), []
    wait.abandon = lambda: abandoned.append(1)
    b.server.heartbeat("b", 0.0)  # of a client without a request
    for at in beats:
        b.server.expire(at)
        b.server.heartbeat("a", at)
    b.server.expire(1.0 + SESSION_TIMEOUT)
    assert bool(abandoned) == is_abandoned
    assert bool(b.finish(wait, 7)) != is_abandoned


def test_file_being_opened_is_not_replaced_by_an_impatient_request() -> None:
    b = SlowBench()
    b.ask(request(Opcode.OPEN_FILE_RO, b"/slow"))
    assert Reply(b.again(request(Opcode.OPEN_FILE_RO, b"/fast", seq=2))).error == Error.NO_SESSIONS_AVAILABLE
    assert Reply(b.again(request(Opcode.READ_FILE, seq=4, size=9))).error == Error.INVALID_SESSION


def test_waiting_requests_of_a_client_are_bounded() -> None:
    b = SlowBench()
    b.opened()
    waits = [b.ask(request(Opcode.READ_FILE, seq=4, size=1, offset=n)) for n in range(MAX_WAITS)]
    assert b.again(request(Opcode.READ_FILE, seq=6, size=1, offset=99)) is None
    assert b.finish(waits[0], b"x")
    b.ask(request(Opcode.READ_FILE, seq=6, size=1, offset=99))
    assert Reply(b.again(request(Opcode.TERMINATE_SESSION, seq=8))).opcode == ACK


@pytest.mark.parametrize(("opcode", "value"), [(Opcode.REMOVE_FILE, None), (Opcode.CALC_FILE_CRC32, 7)])
def test_repeated_removal_or_checksum_is_not_run_again(opcode: Opcode, value: object) -> None:
    b = SlowBench()
    payload = request(opcode, b"/slow", seq=2)
    (reply,) = b.server.finish(b.ask(payload), value)
    assert b.again(payload) == reply
    assert len(b.files.asked) == 1
    b.ask(request(opcode, b"/slow", seq=4))
    assert len(b.files.asked) == 2


def test_late_list_is_paged_by_its_offset() -> None:
    b = SlowBench()
    wait = b.ask(request(Opcode.LIST_DIRECTORY_WITH_TIME, b"/media", offset=1))
    entries = [Entry("a", 5), Entry("b", 6, modified=1_800_000_000), Entry("c", None, modified=3)]
    (reply,) = b.finish(wait, entries)
    assert reply.data == b"Fb\t6\t1800000000\0Dc\t0\t3\0"


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
        part = server.burst(who, 0.0)
        assert part is None or len(part) == PAYLOAD
        if step % 100 == 0:
            server.expire(step * 0.01)
        assert server.sessions <= MAX_CLIENTS * MAX_SESSIONS
