"""MAVLink FTP: the server's side of the protocol. No I/O.

`FtpServer.receive` takes the payload of a FILE_TRANSFER_PROTOCOL and returns the payload of the answer; a burst is
then
taken part by part with `burst`. A `Files` lists the files; some can be replaced as a whole. Protocol: MAVLink ftp.md.

Every answer follows from the request and the file alone, which stays as it was when it was opened. So a lost answer
is
made again when its request is received again. A written file becomes valid when its session is terminated, and not
before.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from anafi_mav.mavlink import dialect
from anafi_mav.services.checksum import crc32
from anafi_mav.services.files import Entry

PAYLOAD = 251
"""Bytes of the message's payload field."""
DATA = 239
"""Bytes of data behind the header of 12."""

MAX_CLIENTS = 32
"""Clients whose sessions are kept: as many as channels.

More would be made-up addresses; the one that has been silent longest is dropped.
"""
MAX_SESSIONS = 4
"""Files that one client may have open: MAVProxy's parameters, mission and a transfer by hand are three."""
MAX_PATH = DATA
"""A path fills at most one message."""

SESSION_TIMEOUT = 20.0
"""s without a request after which a session is closed. MAVSDK gives up after 5 s, MAVProxy repeats within 10 s."""
TAKEOVER = 1.0
"""s of silence after which the same client may open another file under a session's number.

Clients that number their sessions themselves (MAVSDK's is always 0) may have lost the end of a transfer, or have been
restarted; a session that is being read is not closed under its reader, which would get the wrong file.
"""

BURST_PARTS = 128
"""Parts of one burst, some 30 KB.

The client requests the next burst, which shows that it is still connected.
"""

_HEADER = struct.Struct("<HBBBBBBI")


class Opcode(enum.IntEnum):
    NONE = 0
    TERMINATE_SESSION = 1
    RESET_SESSIONS = 2
    LIST_DIRECTORY = 3
    OPEN_FILE_RO = 4
    READ_FILE = 5
    CREATE_FILE = 6
    WRITE_FILE = 7
    REMOVE_FILE = 8
    CREATE_DIRECTORY = 9
    REMOVE_DIRECTORY = 10
    OPEN_FILE_WO = 11
    TRUNCATE_FILE = 12
    RENAME = 13
    CALC_FILE_CRC32 = 14
    BURST_READ_FILE = 15
    LIST_DIRECTORY_WITH_TIME = 16


ACK, NAK = dialect.MAV_FTP_OPCODE_ACK, dialect.MAV_FTP_OPCODE_NAK

_PROTECTED = frozenset(
    {
        Opcode.REMOVE_FILE,
        Opcode.CREATE_DIRECTORY,
        Opcode.REMOVE_DIRECTORY,
        Opcode.TRUNCATE_FILE,
        Opcode.RENAME,
    }
)


class Error(enum.IntEnum):
    """MAV_FTP_ERR, the ones in use."""

    FAIL = 1
    INVALID_DATA_SIZE = 3
    INVALID_SESSION = 4
    NO_SESSIONS_AVAILABLE = 5
    EOF = 6
    UNKNOWN_COMMAND = 7
    FILE_PROTECTED = 9
    FILE_NOT_FOUND = 10


class State(enum.Enum):
    """Of one session."""

    CLOSED = "closed"
    OPEN = "open"
    BURSTING = "bursting"
    WRITING = "writing"


class Event(enum.Enum):
    OPEN = "open"
    READ = "read"
    BURST = "burst"
    BURST_ENDS = "burst ends"
    CREATE = "create"
    WRITE = "write"
    TERMINATE = "terminate"
    EXPIRE = "expire"


TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: {
        Event.OPEN: State.OPEN,
        Event.CREATE: State.WRITING,
    },
    State.OPEN: {
        Event.OPEN: State.OPEN,
        Event.CREATE: State.WRITING,
        Event.READ: State.OPEN,
        Event.BURST: State.BURSTING,
        Event.TERMINATE: State.CLOSED,
        Event.EXPIRE: State.CLOSED,
    },
    State.BURSTING: {
        Event.OPEN: State.OPEN,
        Event.CREATE: State.WRITING,
        Event.READ: State.OPEN,
        Event.BURST: State.BURSTING,
        Event.BURST_ENDS: State.OPEN,
        Event.TERMINATE: State.CLOSED,
        Event.EXPIRE: State.CLOSED,
    },
    State.WRITING: {
        Event.OPEN: State.OPEN,
        Event.CREATE: State.WRITING,
        Event.WRITE: State.WRITING,
        Event.TERMINATE: State.CLOSED,
        Event.EXPIRE: State.CLOSED,
    },
}
"""State transitions of a session; a missing pair cannot happen.

Reading a closed session is answered with INVALID_SESSION, and so is writing to one that was opened to read.
"""


class Files(Protocol):
    """The files that a client is shown."""

    def read(self, path: str) -> bytes | None:
        """The content; None when there is no such file."""

    def list(self, path: str) -> list[Entry] | None:
        """Return the entries, always in the same sequence; None when there is no such directory."""

    def room(self, path: str) -> int | None:
        """Return the bytes that a client may write to a file; None when it is read-only or missing."""

    def write(self, path: str, content: bytes) -> bool:
        """Replace a file that has `room`; False when the content cannot be used."""


@dataclass
class _Session:
    state: State = State.CLOSED
    path: str = ""
    content: bytes = b""
    written: bytearray = field(default_factory=bytearray)
    """Received content of a file that is being written."""
    room: int = 0
    """Bytes that it may have."""
    created: int = -1
    """Sequence number of the request that created its file."""
    used: float = 0.0
    """Time of its client's last request."""
    burst_seq: int = 0
    """Sequence number of the next part."""
    burst_offset: int = 0
    burst_size: int = DATA
    burst_left: int = 0
    """Parts that the burst may still have."""

    def step(self, event: Event) -> None:
        self.state = TRANSITIONS[self.state][event]


@dataclass
class _Client:
    sessions: dict[int, _Session] = field(default_factory=dict)
    """Those that are open."""
    terminated: tuple[int, int] | None = None
    """Sequence number and session of the last TerminateSession: a repetition is answered again."""
    seen: float = 0.0


@dataclass(frozen=True)
class FtpRequest:
    """A request, parsed from the payload."""

    seq: int
    session: int
    opcode: int
    size: int
    offset: int
    data: bytes
    """All bytes after the header; `size` is the number that counts.

    Except in a read, where `size` is the number of requested bytes.
    """

    @property
    def path(self) -> str:
        """The path in the data, with or without a NUL at its end."""
        return self.data[: min(self.size, MAX_PATH)].split(b"\0", 1)[0].decode("ascii", errors="replace")


def parse(payload: bytes) -> FtpRequest | None:
    """Return the request in a payload; None when the payload is too short."""
    if len(payload) < _HEADER.size:
        return None
    seq, session, opcode, size, _, _, _, offset = _HEADER.unpack_from(payload)
    return FtpRequest(seq, session, opcode, size, offset, payload[_HEADER.size :])


def format_reply(
    request: FtpRequest, opcode: int, data: bytes = b"", *, seq: int, session: int, offset: int, complete: bool = False
) -> bytes:
    """Return the payload of a reply."""
    header = _HEADER.pack(
        seq & 0xFFFF, session, opcode, len(data), request.opcode, int(complete), 0, offset & 0xFFFFFFFF
    )
    return (header + data).ljust(PAYLOAD, b"\0")


class FtpServer:
    """The sessions of all clients of one component.

    A client's sessions are its own: no other can reach them.
    """

    def __init__(self) -> None:
        self._clients: dict[Hashable, _Client] = {}
        """In the sequence of their last request."""

    @property
    def sessions(self) -> int:
        """Number of open sessions of all clients."""
        return sum(len(client.sessions) for client in self._clients.values())

    def receive(self, who: Hashable, payload: bytes, files: Files, now: float) -> bytes | None:
        """Return the payload of the answer; None when the payload is no request.

        After a BurstReadFile, call `burst` for more.
        """
        request = parse(payload)
        if request is None or request.opcode >= ACK:
            return None
        client = self._clients.pop(who, None) or _Client()
        self._clients[who] = client
        client.seen = now
        if len(self._clients) > MAX_CLIENTS:
            del self._clients[next(iter(self._clients))]
        answer = self._answer(client, request, files, now)
        return self._nak(request, answer) if isinstance(answer, Error) else answer

    def burst(self, who: Hashable) -> bytes | None:
        """Return the next part of this client's burst; None when none is due."""
        client = self._clients.get(who)
        if client is None:
            return None
        for number, session in client.sessions.items():
            if session.state is State.BURSTING:
                return self._part(number, session)
        return None

    def expire(self, now: float) -> None:
        """Close the sessions that no client has used for `SESSION_TIMEOUT`."""
        for who, client in list(self._clients.items()):
            for number, session in list(client.sessions.items()):
                if now - session.used >= SESSION_TIMEOUT:
                    session.step(Event.EXPIRE)
                    del client.sessions[number]
            if not client.sessions and now - client.seen >= SESSION_TIMEOUT:
                del self._clients[who]

    def forget(self, gone: Callable[[Hashable], bool]) -> None:
        """Forget the disconnected clients, for which `gone` is true."""
        for who in [who for who in self._clients if gone(who)]:
            del self._clients[who]

    def bursting(self, who: Hashable) -> bool:
        """True when a part of a burst is due to this client."""
        client = self._clients.get(who)
        return client is not None and any(one.state is State.BURSTING for one in client.sessions.values())

    # One request.

    def _answer(self, client: _Client, request: FtpRequest, files: Files, now: float) -> bytes | Error:
        if request.size > DATA:
            return Error.INVALID_DATA_SIZE
        match request.opcode:
            case Opcode.NONE:
                return self._ack(request)
            case Opcode.RESET_SESSIONS:
                for session in client.sessions.values():
                    session.step(Event.TERMINATE)
                client.sessions.clear()
                return self._ack(request)
            case Opcode.TERMINATE_SESSION:
                return self._terminate(client, request, files)
            case Opcode.CREATE_FILE | Opcode.OPEN_FILE_WO:
                return self._create(client, request, files, now)
            case Opcode.WRITE_FILE:
                return self._write(client, request, now)
            case Opcode.OPEN_FILE_RO:
                return self._open(client, request, files, now)
            case Opcode.READ_FILE:
                return self._read(client, request, now)
            case Opcode.BURST_READ_FILE:
                return self._begin_burst(client, request, now)
            case Opcode.LIST_DIRECTORY | Opcode.LIST_DIRECTORY_WITH_TIME:
                return self._list(request, files)
            case Opcode.CALC_FILE_CRC32:
                content = files.read(request.path)
                if content is None:
                    return Error.FILE_NOT_FOUND
                return self._ack(request, struct.pack("<I", crc32(content)))
            case opcode if opcode in _PROTECTED:
                return Error.FILE_PROTECTED
        return Error.UNKNOWN_COMMAND

    def _terminate(self, client: _Client, request: FtpRequest, files: Files) -> bytes | Error:
        session = client.sessions.pop(request.session, None)
        this = (request.seq, request.session)
        if session is None and client.terminated != this:
            return Error.INVALID_SESSION
        if session is not None:
            writing = session.state is State.WRITING
            session.step(Event.TERMINATE)
            if writing and not files.write(session.path, bytes(session.written)):
                return Error.FAIL
        client.terminated = this
        return self._ack(request)

    def _session_for(self, client: _Client, request: FtpRequest, now: float) -> _Session | Error:
        """Return the session in which a file is to be opened or created."""
        session = client.sessions.get(request.session)
        if session is None:
            if len(client.sessions) >= MAX_SESSIONS:
                return Error.NO_SESSIONS_AVAILABLE
            session = client.sessions[request.session] = _Session()
        elif session.path != request.path and now - session.used < TAKEOVER:
            return Error.NO_SESSIONS_AVAILABLE
        return session

    def _create(self, client: _Client, request: FtpRequest, files: Files, now: float) -> bytes | Error:
        """Begin to replace a file.

        A retransmission of the request must not drop what has been written since.
        """
        room = files.room(request.path)
        if room is None:
            return Error.FILE_PROTECTED
        session = self._session_for(client, request, now)
        if isinstance(session, Error):
            return session
        if session.state is not State.WRITING or session.created != request.seq:
            session.step(Event.CREATE)
            session.path, session.content, session.written = request.path, b"", bytearray()
            session.room, session.created = room, request.seq
        session.used = now
        return self._ack(request)

    def _write(self, client: _Client, request: FtpRequest, now: float) -> bytes | Error:
        """Take a part of a file; parts may arrive in any sequence and more than once."""
        session = client.sessions.get(request.session)
        if session is None or session.state is not State.WRITING:
            return Error.INVALID_SESSION
        data = request.data[: request.size]
        end = request.offset + len(data)
        if end > session.room:
            return Error.FAIL
        session.step(Event.WRITE)
        session.used = now
        session.written.extend(bytes(max(end - len(session.written), 0)))
        session.written[request.offset : end] = data
        return self._ack(request)

    def _open(self, client: _Client, request: FtpRequest, files: Files, now: float) -> bytes | Error:
        path = request.path
        content = files.read(path)
        if content is None:
            return Error.FILE_NOT_FOUND
        session = self._session_for(client, request, now)
        if isinstance(session, Error):
            return session
        session.step(Event.OPEN)
        session.path, session.content, session.used = path, content, now
        return self._ack(request, struct.pack("<I", len(content)))

    def _read(self, client: _Client, request: FtpRequest, now: float) -> bytes | Error:
        session = client.sessions.get(request.session)
        if session is None or session.state is State.WRITING:
            return Error.INVALID_SESSION
        session.step(Event.READ)
        session.used = now
        data = session.content[request.offset : request.offset + (request.size or DATA)]
        return self._ack(request, data) if data else Error.EOF

    def _begin_burst(self, client: _Client, request: FtpRequest, now: float) -> bytes | Error:
        session = client.sessions.get(request.session)
        if session is None or session.state is State.WRITING:
            return Error.INVALID_SESSION
        session.used = now
        if request.offset >= len(session.content):
            session.step(Event.READ)
            return Error.EOF
        session.step(Event.BURST)
        session.burst_seq = request.seq + 1
        session.burst_offset = request.offset
        session.burst_size = request.size or DATA
        session.burst_left = BURST_PARTS
        return self._part(request.session, session)

    def _part(self, number: int, session: _Session) -> bytes:
        """Return the next part of a session's burst.

        The last one is marked as complete: at the end of the file, or after enough parts.
        """
        offset, seq = session.burst_offset, session.burst_seq
        data = session.content[offset : offset + session.burst_size]
        session.burst_offset += len(data)
        session.burst_seq += 1
        session.burst_left -= 1
        complete = session.burst_offset >= len(session.content) or session.burst_left <= 0
        if complete:
            session.step(Event.BURST_ENDS)
        return format_reply(
            FtpRequest(0, number, Opcode.BURST_READ_FILE, 0, 0, b""),
            ACK,
            data,
            seq=seq,
            session=number,
            offset=offset,
            complete=complete,
        )

    def _list(self, request: FtpRequest, files: Files) -> bytes | Error:
        entries = files.list(request.path)
        if entries is None:
            return Error.FILE_NOT_FOUND
        timed = request.opcode == Opcode.LIST_DIRECTORY_WITH_TIME
        data = b""
        for entry in entries[request.offset :]:
            line = _line(entry, timed=timed)
            if len(data) + len(line) > DATA:
                break
            data += line
        return self._ack(request, data) if data else Error.EOF

    @staticmethod
    def _ack(request: FtpRequest, data: bytes = b"") -> bytes:
        return format_reply(request, ACK, data, seq=request.seq + 1, session=request.session, offset=request.offset)

    @staticmethod
    def _nak(request: FtpRequest, error: Error) -> bytes:
        return format_reply(
            request, NAK, bytes((error,)), seq=request.seq + 1, session=request.session, offset=request.offset
        )


def _line(entry: Entry, *, timed: bool) -> bytes:
    """Return one entry as ListDirectory sends it.

    With time, which no file here has: 0, unknown.
    """
    line = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
    if timed:
        line += "\t0" if entry.size is not None else "\t0\t0"
    return line.encode("ascii") + b"\0"
