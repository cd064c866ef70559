"""MAVLink FTP: the server's side of the protocol. No I/O.

`FtpServer.receive` takes the payload of a FILE_TRANSFER_PROTOCOL and returns the payload of the answer. Where the files
need time it returns a `Wait` instead: its caller awaits the value and hands it to `finish`, which returns the answers
to the request and to its repetitions. A burst is then taken part by part with `burst`. Protocol: MAVLink ftp.md.

Every answer follows from the request and the file alone, which stays as it was when it was opened. So a lost answer is
made again when its request is received again; the answer to a request that must not run twice is kept. A written file
becomes valid when its session is terminated, and not before.
"""

from __future__ import annotations

import enum
import struct
from collections import Counter
from collections.abc import Awaitable, Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from anafi_mav.mavlink import dialect
from anafi_mav.services.files import MAX_SIZE, Entry, FileError, FileRefused, FileSource

PAYLOAD = 251
"""Bytes of the message's payload field."""
DATA = 239
"""Bytes of data behind the header of 12."""

MAX_CLIENTS = 32
"""Clients whose sessions are kept: as many as channels.

More would be made-up addresses: one of the channel with most clients is dropped, the one that has been silent longest.
One that writes a file is not.
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

BURST_PARTS = 256
"""Parts of one burst, some 60 KB: as many as a client's socket holds (Linux: 208 KiB, 768 bytes for each).

The client requests the next burst, which shows that it is still connected.
"""

MAX_WAITS = 8
"""Requests of one client that wait for a file at the same time: MAVProxy requests five missing parts at once.

A further one is dropped; its client repeats it.
"""
MAX_REPETITIONS = 16
"""Sequence numbers under which one waiting request is answered: QGroundControl repeats it three times, each time with
another number."""

RESTARTED = 1 << 15
"""Distance from one sequence number to another, modulo 2**16, from which the second is not newer.

A client that restarts counts from the beginning, and its TerminateSession may equal the one whose answer is kept.
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
        Opcode.CREATE_DIRECTORY,
        Opcode.REMOVE_DIRECTORY,
        Opcode.TRUNCATE_FILE,
        Opcode.RENAME,
    }
)

_SHORT = frozenset({Opcode.NONE, Opcode.TERMINATE_SESSION, Opcode.RESET_SESSIONS})
"""Requests that never wait for a file."""

_KEPT = frozenset({Opcode.TERMINATE_SESSION, Opcode.REMOVE_FILE, Opcode.CALC_FILE_CRC32})
"""Requests whose answer is kept for a repetition: the first two must not run twice, a checksum reads a whole file."""


class State(enum.Enum):
    """Of one session."""

    CLOSED = "closed"
    OPENING = "opening"
    OPEN = "open"
    BURSTING = "bursting"
    WRITING = "writing"


class Event(enum.Enum):
    OPEN = "open"
    OPENED = "opened"
    REFUSED = "refused"
    READ = "read"
    BURST = "burst"
    BURST_ENDS = "burst ends"
    CREATE = "create"
    WRITE = "write"
    TERMINATE = "terminate"
    EXPIRE = "expire"


_BEGIN = {Event.OPEN: State.OPENING, Event.CREATE: State.WRITING}
_END = {Event.TERMINATE: State.CLOSED, Event.EXPIRE: State.CLOSED}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = {
    State.CLOSED: _BEGIN,
    State.OPENING: _BEGIN | _END | {Event.OPENED: State.OPEN, Event.REFUSED: State.CLOSED},
    State.OPEN: _BEGIN | _END | {Event.READ: State.OPEN, Event.BURST: State.BURSTING},
    State.BURSTING: _BEGIN | _END | {Event.READ: State.OPEN, Event.BURST: State.BURSTING, Event.BURST_ENDS: State.OPEN},
    State.WRITING: _BEGIN | _END | {Event.WRITE: State.WRITING},
}
"""State transitions of a session; a missing pair cannot happen.

Reading a session that is not open is answered with INVALID_SESSION, and so is writing to one that was opened to read.
"""


class Files(Protocol):
    """The files that a client is shown.

    Methods raise `FileRefused`, at once or when their answer is awaited.
    """

    def open(self, path: str) -> FileSource | Awaitable[FileSource]:
        """Open a file to read."""

    def list(self, path: str) -> Sequence[Entry] | Awaitable[Sequence[Entry]]:
        """Return the entries of a directory, always in the same sequence."""

    def checksum(self, path: str) -> int | Awaitable[int]:
        """Return MAVLink's CRC-32 of a file."""

    def remove(self, path: str) -> Awaitable[None] | None:
        """Remove a file."""

    def room(self, path: str) -> int | None:
        """Return the bytes that a client may write to a file; None when it is read-only or missing."""

    def write(self, path: str, content: bytes) -> bool | Awaitable[bool]:
        """Replace a file that has `room`.

        False, at once or when awaited, if the content cannot be used.
        """

    def refused(self, refusal: FileRefused) -> None:
        """Notify the client of the reason of a refusal."""


@dataclass
class _Session:
    state: State = State.CLOSED
    path: str = ""
    source: FileSource | None = None
    """The file that is open."""
    written: bytearray = field(default_factory=bytearray)
    """Received content of a file that is being written."""
    room: int = 0
    """Bytes that it may have."""
    created: int = -1
    """Sequence number of the request that created its file."""
    used: float = 0.0
    """Time of its client's last request."""
    served: float = 0.0
    """When it last sent a part of a burst, or waited for its file."""
    burst_seq: int = 0
    """Sequence number of the next part."""
    burst_offset: int = 0
    burst_size: int = DATA
    burst_start: int = 0
    """Offset of its first part."""
    burst_data: bytes = b""
    """All its bytes."""

    def step(self, event: Event) -> None:
        self.state = TRANSITIONS[self.state][event]


@dataclass(eq=False)
class Wait:
    """A request that waits for a file. Await `value`, then call `FtpServer.finish`."""

    value: Awaitable[Any]
    who: Hashable
    requests: list[FtpRequest]
    """The request and its repetitions, each with another sequence number."""
    files: Files
    then: Callable[[Any, FtpRequest], bytes | FileError]
    """Makes the answer to one of them."""
    session: int | None = None
    """Number of the session that it belongs to; None: to none."""
    abandon: Callable[[], object] = lambda: None
    """Called when the answer is no longer wanted; set by the caller that awaits."""

    @property
    def is_checksum(self) -> bool:
        """True when a whole file must be read."""
        return self.requests[0].opcode == Opcode.CALC_FILE_CRC32


@dataclass
class _Client:
    sessions: dict[int, _Session] = field(default_factory=dict)
    """Those that are open."""
    waits: list[Wait] = field(default_factory=list)
    kept: tuple[FtpRequest, bytes] | None = None
    """The last request of `_KEPT` and its answer, which a repetition gets again."""
    seen: float = 0.0
    """Time of the last request."""
    heard: float | None = None
    """Time of the last heartbeat; None: it has sent none since its first request."""

    def is_silent(self, now: float) -> bool:
        """Return True for a client whose heartbeats have stopped; one that sends none only waits."""
        return self.heard is not None and now - max(self.heard, self.seen) >= SESSION_TIMEOUT

    @property
    def is_writing(self) -> bool:
        return any(session.state is State.WRITING for session in self.sessions.values())


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

    def repeats(self, other: FtpRequest) -> bool:
        """Return True when it asks for the same, under any sequence number."""
        return replace(self, seq=other.seq) == other

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


def protected(payload: bytes) -> bytes | None:
    """Return the answer to a request that its sender may not make; None when it is no request."""
    request = parse(payload)
    if request is None or request.opcode >= ACK:
        return None
    error = bytes((FileError.FILE_PROTECTED,))
    return format_reply(request, NAK, error, seq=request.seq + 1, session=request.session, offset=request.offset)


class FtpServer:
    """The sessions of all clients of one component.

    A client's sessions are its own: no other can reach them.
    """

    def __init__(self, channel_of: Callable[[Hashable], Hashable] = lambda who: None) -> None:
        """`channel_of`: the channel of a client; by default all are of one."""
        self._channel_of = channel_of
        self._clients: dict[Hashable, _Client] = {}
        """In the sequence of their last request."""

    @property
    def sessions(self) -> int:
        """Number of open sessions of all clients."""
        return sum(len(client.sessions) for client in self._clients.values())

    def receive(self, who: Hashable, payload: bytes, files: Files, now: float) -> bytes | Wait | None:
        """Return the payload of the answer, or what the answer waits for.

        None when the payload is no request, or one that already waits. After a BurstReadFile, call `burst` for more.
        """
        request = parse(payload)
        if request is None or request.opcode >= ACK:
            return None
        client = self._clients.pop(who, None) or _Client()
        self._clients[who] = client
        client.seen = now
        if len(self._clients) > MAX_CLIENTS and not self._make_room(who):
            del self._clients[who]
            return self._reply(client, request, FileError.NO_SESSIONS_AVAILABLE)
        if client.kept is not None:
            if client.kept[0] == request:
                return client.kept[1]
            if not 0 < (request.seq - client.kept[0].seq) % (2 * RESTARTED) < RESTARTED:
                client.kept = None
        if self._waits(client, request) or (len(client.waits) >= MAX_WAITS and request.opcode not in _SHORT):
            return None
        try:
            answer = self._answer(who, client, request, files, now)
        except FileRefused as refusal:
            files.refused(refusal)
            answer = refusal.error
        if isinstance(answer, Wait):
            client.waits.append(answer)
            return answer
        return self._reply(client, request, answer)

    def finish(self, wait: Wait, value: Any) -> list[bytes]:
        """Return the answers to a request that has waited; none when its client no longer wants it.

        `value`: what it has waited for, or the `FileRefused` that was raised.
        """
        client = self._clients.get(wait.who)
        if client is None or wait not in client.waits:
            return []
        client.waits.remove(wait)
        if isinstance(value, FileRefused):
            wait.files.refused(value)
            self._end_opening(client, wait)
        replies = []
        for request in wait.requests:
            answer = value.error if isinstance(value, FileRefused) else wait.then(value, request)
            replies.append(self._reply(client, request, answer))
        return replies

    def burst(self, who: Hashable, now: float) -> bytes | None:
        """Return the next part of this client's burst; None when none is due.

        It keeps the session open: on a slow line a burst takes longer than `SESSION_TIMEOUT`.
        """
        client = self._clients.get(who)
        if client is None:
            return None
        for number, session in client.sessions.items():
            if session.state is State.BURSTING:
                session.served = now
                return self._part(number, session)
        return None

    def heartbeat(self, who: Hashable, now: float) -> None:
        """Note a heartbeat: its sender still waits for its answers."""
        if (client := self._clients.get(who)) is not None:
            client.heard = now

    def expire(self, now: float) -> None:
        """Close the sessions without a request, a part sent or an answer due for `SESSION_TIMEOUT`.

        A slow drone may take longer than that for one answer, which is then still owed to the client. A checksum, which
        reads a whole file, ends when the heartbeats of its client have stopped for as long.
        """
        for who, client in list(self._clients.items()):
            if client.is_silent(now):
                self._abandon(client, None, Opcode.CALC_FILE_CRC32)
            waiting = {wait.session for wait in client.waits}
            for number, session in list(client.sessions.items()):
                if number in waiting:
                    session.served = now
                elif now - max(session.used, session.served) >= SESSION_TIMEOUT:
                    self._close(client, number, Event.EXPIRE)
            if not client.sessions and not client.waits and now - client.seen >= SESSION_TIMEOUT:
                del self._clients[who]

    def forget(self, gone: Callable[[Hashable], bool]) -> None:
        """Forget the disconnected clients, for which `gone` is true."""
        for who in [who for who in self._clients if gone(who)]:
            self._drop(who)

    def bursting(self, who: Hashable) -> bool:
        """True when a part of a burst is due to this client."""
        client = self._clients.get(who)
        return client is not None and any(one.state is State.BURSTING for one in client.sessions.values())

    # Requests that wait.

    def _waits(self, client: _Client, request: FtpRequest) -> bool:
        """Return True for the repetition of a request that waits; it is answered with it."""
        for wait in client.waits:
            if wait.requests[0].repeats(request):
                if request not in wait.requests and len(wait.requests) < MAX_REPETITIONS:
                    wait.requests.append(request)
                return True
        return False

    def _after(
        self,
        who: Hashable,
        request: FtpRequest,
        files: Files,
        value: Any,
        then: Callable[[Any, FtpRequest], bytes | FileError],
        session: int | None = None,
    ) -> bytes | FileError | Wait:
        """Answer with a value that is at hand, or when it has arrived."""
        if isinstance(value, Awaitable):
            return Wait(value, who, [request], files, then, session)
        return then(value, request)

    def _reply(self, client: _Client, request: FtpRequest, answer: bytes | FileError) -> bytes:
        reply = self._nak(request, answer) if isinstance(answer, FileError) else answer
        if request.opcode in _KEPT and answer is not FileError.INVALID_SESSION:
            client.kept = (request, reply)
        return reply

    def _make_room(self, newest: Hashable) -> bool:
        """Drop a client in place of this one; return False when all write files."""
        counts = Counter(self._channel_of(who) for who in self._clients)
        silent = [who for who, client in self._clients.items() if who != newest and not client.is_writing]
        if not silent:
            return False
        self._drop(max(silent, key=lambda who: counts[self._channel_of(who)]))  # the first of equals: silent longest
        return True

    def _drop(self, who: Hashable) -> None:
        client = self._clients.pop(who)
        for wait in client.waits:
            wait.abandon()

    def _close(self, client: _Client, number: int, event: Event) -> _Session:
        """Close a session with everything that waits for its file."""
        session = client.sessions.pop(number)
        session.step(event)
        self._abandon(client, number)
        return session

    def _abandon(self, client: _Client, number: int | None, opcode: int | None = None) -> None:
        """Abandon what waits in a session, None: in none; with `opcode` only requests of this kind."""
        for wait in [
            wait for wait in client.waits if wait.session == number and opcode in (None, wait.requests[0].opcode)
        ]:
            client.waits.remove(wait)
            wait.abandon()

    # One request.

    def _answer(
        self, who: Hashable, client: _Client, request: FtpRequest, files: Files, now: float
    ) -> bytes | FileError | Wait:
        if request.size > DATA:
            return FileError.INVALID_DATA_SIZE
        match request.opcode:
            case Opcode.NONE:
                return self._ack(request)
            case Opcode.RESET_SESSIONS:
                for number in list(client.sessions):
                    self._close(client, number, Event.TERMINATE)
                return self._ack(request)
            case Opcode.TERMINATE_SESSION:
                return self._terminate(who, client, request, files)
            case Opcode.CREATE_FILE | Opcode.OPEN_FILE_WO:
                return self._create(client, request, files, now)
            case Opcode.WRITE_FILE:
                return self._write(client, request, now)
            case Opcode.OPEN_FILE_RO:
                return self._open(who, client, request, files, now)
            case Opcode.READ_FILE:
                return self._read(who, client, request, files, now)
            case Opcode.BURST_READ_FILE:
                return self._begin_burst(who, client, request, files, now)
            case Opcode.LIST_DIRECTORY | Opcode.LIST_DIRECTORY_WITH_TIME:
                return self._after(who, request, files, files.list(request.path), self._listed)
            case Opcode.CALC_FILE_CRC32:
                return self._after(who, request, files, files.checksum(request.path), self._summed)
            case Opcode.REMOVE_FILE:
                return self._after(who, request, files, files.remove(request.path), self._removed)
            case opcode if opcode in _PROTECTED:
                return FileError.FILE_PROTECTED
        return FileError.UNKNOWN_COMMAND

    def _terminate(self, who: Hashable, client: _Client, request: FtpRequest, files: Files) -> bytes | FileError | Wait:
        if request.session not in client.sessions:
            return FileError.INVALID_SESSION
        writing = client.sessions[request.session].state is State.WRITING
        session = self._close(client, request.session, Event.TERMINATE)
        if not writing:
            return self._ack(request)
        return self._after(who, request, files, files.write(session.path, bytes(session.written)), self._written)

    def _written(self, is_used: bool, request: FtpRequest) -> bytes | FileError:
        return self._ack(request) if is_used else FileError.FAIL

    def _session_for(self, client: _Client, request: FtpRequest, now: float) -> _Session | FileError:
        """Return the session in which a file is to be opened or created."""
        session = client.sessions.get(request.session)
        if session is None:
            if len(client.sessions) >= MAX_SESSIONS:
                return FileError.NO_SESSIONS_AVAILABLE
            return _Session()
        if session.path != request.path and now - session.used < TAKEOVER:
            return FileError.NO_SESSIONS_AVAILABLE
        return session

    def _create(self, client: _Client, request: FtpRequest, files: Files, now: float) -> bytes | FileError:
        """Begin to replace a file.

        A retransmission of the request must not drop what has been written since.
        """
        room = files.room(request.path)
        if room is None:
            return FileError.FILE_PROTECTED
        session = self._session_for(client, request, now)
        if isinstance(session, FileError):
            return session
        client.sessions[request.session] = session
        if session.state is not State.WRITING or session.created != request.seq:
            self._abandon(client, request.session)
            session.step(Event.CREATE)
            session.path, session.source, session.written = request.path, None, bytearray()
            session.room, session.created = room, request.seq
        session.used = now
        return self._ack(request)

    def _write(self, client: _Client, request: FtpRequest, now: float) -> bytes | FileError:
        """Take a part of a file; parts may arrive in any sequence and more than once."""
        session = client.sessions.get(request.session)
        if session is None or session.state is not State.WRITING:
            return FileError.INVALID_SESSION
        data = request.data[: request.size]
        end = request.offset + len(data)
        if end > session.room:
            return FileError.FAIL
        session.step(Event.WRITE)
        session.used = now
        session.written.extend(bytes(max(end - len(session.written), 0)))
        session.written[request.offset : end] = data
        return self._ack(request)

    def _open(
        self, who: Hashable, client: _Client, request: FtpRequest, files: Files, now: float
    ) -> bytes | FileError | Wait:
        session = self._session_for(client, request, now)
        if isinstance(session, FileError):
            return session
        opening = files.open(request.path)
        client.sessions[request.session] = session
        self._abandon(client, request.session)
        session.step(Event.OPEN)
        session.path, session.source, session.used = request.path, None, now

        def opened(source: FileSource, request: FtpRequest) -> bytes | FileError:
            if source.size > MAX_SIZE:
                raise ValueError(f"MAVLink FTP cannot address a file of {source.size} bytes")
            if session.source is None:
                session.step(Event.OPENED)
                session.source = source
            return self._ack(request, struct.pack("<I", session.source.size))

        return self._after(who, request, files, opening, opened, request.session)

    def _end_opening(self, client: _Client, wait: Wait) -> None:
        """End the session of a file that cannot be opened."""
        for number, session in list(client.sessions.items()):
            if number == wait.session and session.state is State.OPENING:
                session.step(Event.REFUSED)
                del client.sessions[number]

    def _read(
        self, who: Hashable, client: _Client, request: FtpRequest, files: Files, now: float
    ) -> bytes | FileError | Wait:
        session = client.sessions.get(request.session)
        if session is None or session.source is None:
            return FileError.INVALID_SESSION
        session.step(Event.READ)
        session.used = now
        size = min(request.size or DATA, session.source.size - request.offset)
        if size <= 0:
            return FileError.EOF
        reading = session.source.read(request.offset, size)
        return self._after(
            who, request, files, reading, lambda data, request: self._ack(request, data), request.session
        )

    def _begin_burst(
        self, who: Hashable, client: _Client, request: FtpRequest, files: Files, now: float
    ) -> bytes | FileError | Wait:
        """Load the bytes of a burst; its first part is the answer."""
        session = client.sessions.get(request.session)
        if session is None or session.source is None:
            return FileError.INVALID_SESSION
        session.step(Event.READ)
        session.used = now
        part = request.size or DATA
        size = min(part * BURST_PARTS, session.source.size - request.offset)
        if size <= 0:
            return FileError.EOF

        self._abandon(client, request.session, Opcode.BURST_READ_FILE)

        def loaded(data: bytes, request: FtpRequest) -> bytes:
            session.step(Event.BURST)
            session.burst_seq, session.burst_size, session.burst_data = request.seq + 1, part, data
            session.burst_offset = session.burst_start = request.offset
            return self._part(request.session, session)

        return self._after(who, request, files, session.source.read(request.offset, size), loaded, request.session)

    def _part(self, number: int, session: _Session) -> bytes:
        """Return the next part of a session's burst.

        The last one is marked as complete: at the end of the file, or after enough parts.
        """
        offset, seq = session.burst_offset, session.burst_seq
        sent = offset - session.burst_start
        data = session.burst_data[sent : sent + session.burst_size]
        session.burst_offset += len(data)
        session.burst_seq += 1
        complete = sent + len(data) >= len(session.burst_data)
        if complete:
            session.burst_data = b""
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

    def _listed(self, entries: Sequence[Entry], request: FtpRequest) -> bytes | FileError:
        timed = request.opcode == Opcode.LIST_DIRECTORY_WITH_TIME
        data = b""
        for entry in entries[request.offset :]:
            line = _line(entry, timed=timed)
            if len(data) + len(line) > DATA:
                break
            data += line
        return self._ack(request, data) if data else FileError.EOF

    def _summed(self, crc: int, request: FtpRequest) -> bytes:
        return self._ack(request, struct.pack("<I", crc))

    def _removed(self, nothing: None, request: FtpRequest) -> bytes:
        return self._ack(request)

    @staticmethod
    def _ack(request: FtpRequest, data: bytes = b"") -> bytes:
        return format_reply(request, ACK, data, seq=request.seq + 1, session=request.session, offset=request.offset)

    @staticmethod
    def _nak(request: FtpRequest, error: FileError) -> bytes:
        return format_reply(
            request, NAK, bytes((error,)), seq=request.seq + 1, session=request.session, offset=request.offset
        )


def _line(entry: Entry, *, timed: bool) -> bytes:
    """Return one entry as ListDirectory sends it, with its time (s since 1970, 0.

    Unknown) if wanted.
    """
    line = f"D{entry.name}" if entry.size is None else f"F{entry.name}\t{entry.size}"
    if timed:
        line += f"\t{entry.modified}" if entry.size is not None else f"\t0\t{entry.modified}"
    return line.encode("ascii", errors="replace") + b"\0"
