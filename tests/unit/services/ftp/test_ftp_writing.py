"""A file that a client replaces over MAVLink FTP: parts in any order, twice, too long, abandoned."""

from __future__ import annotations

import struct

from anafi_mav.services.files import FileError as Error
from anafi_mav.services.files import FileTree
from anafi_mav.services.ftp.ftp import ACK, MAX_CLIENTS, NAK, PAYLOAD, SESSION_TIMEOUT, FtpServer, Opcode

PATH = b"@MISSION/mission.dat"
ROOM = 1000


class Writable:
    """One file that can be written; empty content is refused."""

    def __init__(self) -> None:
        tree = FileTree({"/@MISSION/mission.dat": lambda query: b"old"})
        self.open, self.list, self.checksum, self.remove = tree.open, tree.list, tree.checksum, tree.remove
        self.refused = tree.refused
        self.written: list[bytes] = []

    def room(self, path: str) -> int | None:
        return ROOM if path.encode() == PATH else None

    def write(self, path: str, content: bytes) -> bool:
        self.written.append(content)
        return bool(content)


class Bench:
    def __init__(self) -> None:
        self.server, self.files, self.now, self.seq = FtpServer(lambda who: str(who)[0]), Writable(), 0.0, 0

    def ask(
        self, opcode: int, data: bytes = b"", *, offset: int = 0, seq: int | None = None, who: str = "a"
    ) -> tuple[int, bytes]:
        """Opcode and data of the answer. Without a `seq` each request has another one."""
        self.seq += 2
        header = struct.pack("<HBBBBBBI", self.seq if seq is None else seq, 0, opcode, len(data), 0, 0, 0, offset)
        reply = self.server.receive(who, (header + data).ljust(PAYLOAD, b"\0"), self.files, self.now)
        assert reply is not None
        size = struct.unpack_from("<HBBBBBBI", reply)[3]
        return reply[3], reply[12 : 12 + size]


def test_file_is_written_when_its_session_is_terminated() -> None:
    b = Bench()
    assert b.ask(Opcode.CREATE_FILE, PATH) == (ACK, b"")
    assert b.ask(Opcode.WRITE_FILE, b"world", offset=6) == (ACK, b"")
    assert b.ask(Opcode.WRITE_FILE, b"hello ") == (ACK, b"")
    assert b.ask(Opcode.WRITE_FILE, b"hello ") == (ACK, b"")  # its answer was lost
    assert b.files.written == []
    assert b.ask(Opcode.TERMINATE_SESSION, seq=77) == (ACK, b"")
    assert b.ask(Opcode.TERMINATE_SESSION, seq=77) == (ACK, b"")
    assert b.files.written == [b"hello world"]


def test_restarted_client_with_equal_sequence_numbers_writes_again() -> None:
    b = Bench()
    for content in (b"first", b"second"):
        assert b.ask(Opcode.CREATE_FILE, PATH, seq=0) == (ACK, b"")
        assert b.ask(Opcode.WRITE_FILE, content, seq=2) == (ACK, b"")
        assert b.ask(Opcode.TERMINATE_SESSION, seq=4) == (ACK, b"")
    assert b.files.written == [b"first", b"second"]


def test_late_repetition_of_terminate_request_spares_the_next_session() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH, seq=0)
    b.ask(Opcode.WRITE_FILE, b"first", seq=2)
    b.ask(Opcode.TERMINATE_SESSION, seq=4)
    b.ask(Opcode.CREATE_FILE, PATH, seq=6)
    assert b.ask(Opcode.TERMINATE_SESSION, seq=4) == (ACK, b"")
    b.ask(Opcode.WRITE_FILE, b"second", seq=8)
    assert b.ask(Opcode.TERMINATE_SESSION, seq=10) == (ACK, b"")
    assert b.files.written == [b"first", b"second"]


def test_repeated_create_request_does_not_empty_the_file() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH, seq=5)
    b.ask(Opcode.WRITE_FILE, b"hello")
    assert b.ask(Opcode.CREATE_FILE, PATH, seq=5) == (ACK, b"")
    b.ask(Opcode.TERMINATE_SESSION)
    assert b.files.written == [b"hello"]


def test_recreated_file_is_empty() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH, seq=5)
    b.ask(Opcode.WRITE_FILE, b"hello")
    b.ask(Opcode.CREATE_FILE, PATH, seq=9)
    b.ask(Opcode.WRITE_FILE, b"x")
    b.ask(Opcode.TERMINATE_SESSION)
    assert b.files.written == [b"x"]


def test_refused_content_is_an_error_of_the_termination() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH)
    assert b.ask(Opcode.TERMINATE_SESSION) == (NAK, bytes((Error.FAIL,)))
    assert b.server.sessions == 0


def test_too_long_file_is_refused_at_the_exceeding_part() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH)
    assert b.ask(Opcode.WRITE_FILE, b"x" * 100, offset=ROOM - 100) == (ACK, b"")
    assert b.ask(Opcode.WRITE_FILE, b"x" * 100, offset=ROOM - 99) == (NAK, bytes((Error.FAIL,)))
    assert b.ask(Opcode.WRITE_FILE, b"x", offset=2**32 - 1) == (NAK, bytes((Error.FAIL,)))


def test_file_that_is_not_terminated_is_dropped() -> None:
    b = Bench()
    for end in (lambda: b.ask(Opcode.RESET_SESSIONS), lambda: b.server.forget(lambda who: True), lambda: expired(b)):
        b.ask(Opcode.CREATE_FILE, PATH)
        b.ask(Opcode.WRITE_FILE, b"hello")
        end()
        assert b.ask(Opcode.WRITE_FILE, b"!", offset=5) == (NAK, bytes((Error.INVALID_SESSION,)))
    assert b.files.written == []


def expired(b: Bench) -> None:
    b.now += SESSION_TIMEOUT
    b.server.expire(b.now)


def test_file_under_writing_cannot_be_read_in_its_session() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH)
    for opcode in (Opcode.READ_FILE, Opcode.BURST_READ_FILE):
        assert b.ask(opcode) == (NAK, bytes((Error.INVALID_SESSION,)))


def test_many_clients_end_no_upload() -> None:
    b = Bench()
    b.ask(Opcode.CREATE_FILE, PATH, who="pilot")
    for number in range(3 * MAX_CLIENTS):
        assert b.ask(Opcode.NONE, who=f"observer {number}") == (ACK, b"")
    assert b.ask(Opcode.WRITE_FILE, b"hello", who="pilot") == (ACK, b"")
    b.ask(Opcode.TERMINATE_SESSION, who="pilot")
    assert b.files.written == [b"hello"]


def test_client_of_a_crowded_channel_gives_way_first() -> None:
    b = Bench()
    b.ask(Opcode.TERMINATE_SESSION, who="pilot", seq=7)
    for number in range(3 * MAX_CLIENTS):
        b.ask(Opcode.NONE, who=f"observer {number}")
    assert "pilot" in b.server._clients
    assert len(b.server._clients) == MAX_CLIENTS


def test_client_is_refused_while_all_others_write() -> None:
    b = Bench()
    for number in range(MAX_CLIENTS):
        b.ask(Opcode.CREATE_FILE, PATH, who=f"{number}")
    assert b.ask(Opcode.CREATE_FILE, PATH, who="late") == (NAK, bytes((Error.NO_SESSIONS_AVAILABLE,)))
    assert b.server.sessions == MAX_CLIENTS
