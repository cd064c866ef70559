"""Event loop of the gateway: it reads sockets of clients first, and those of drones in turn.

The datagrams of a hundred drones take twenty milliseconds, and often arrive together. A client's setpoint or command
waits for a few of them at most: sockets of drones are handed out `AT_ONCE` at a time, and clients are looked at before
each lot. What a client's message has begun goes on before the next lot. Both sides have equal time when there is more
to do than the process can.

Each wake-up costs system calls, a change of the process and a processor whose caches hold other things. With 250
drones a datagram arrives every tenth of a millisecond. While drones send that many, their sockets are looked at every
`PAUSE`, and what is sent for them shares datagrams. Clients do not wait, and with few drones nothing waits.

What drones have due at a time is done between looks at the sockets, a little at a time (`paced_calls`).

Names are looked up in threads of their own. A name server that does not answer keeps a thread for half a minute, and
each attempt to connect takes another one. asyncio's own threads are few, missions are translated in them, and the end
of the program waits for them.
"""

from __future__ import annotations

import asyncio
import selectors
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from typing import Any, TypeAlias, TypeVar

from anafi_mav.cli.paced_calls import PacedCall, PacedCalls
from anafi_mav.disk_writer import DiskWriter
from anafi_mav.receive_buffer import OpenSocket

AT_ONCE = 6
"""Sockets of drones that are read in an event-loop iteration at most: less than a millisecond of work."""

PATIENCE = 0.002
"""s by which clients may be ahead of drones whose datagrams wait: a command takes some event-loop iterations."""

MOST_OWED = 0.005
"""s that clients wait at most for drones that clients have delayed."""

PAUSE = 0.002
"""s between two looks at the sockets of drones while they are busy: much less than the 20 ms that telemetry may
take."""

WINDOW = 0.1
"""s over which sockets of drones with data are counted."""

BUSY = 60
"""Sockets with data within `WINDOW` that make a busy time: of 20 drones that send 30 times a second."""

LOOKUPS = 16
"""Names that are looked up at the same time. One that waits for its turn is forgotten when its attempt ends."""

ResultT = TypeVar("ResultT")

Ready: TypeAlias = list[tuple[selectors.SelectorKey, int]]


class PacedSelector(selectors.BaseSelector):
    """Hands out sockets with data, those of clients first."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        make: Callable[[], selectors.BaseSelector] = selectors.DefaultSelector,
    ) -> None:
        self._monotonic = monotonic
        self._all = make()
        self._clients = make()
        """The same without the sockets of drones."""
        self._sockets: dict[int, OpenSocket] = {}
        """Sockets that bring what drones send, by file descriptor; also closed ones, whose number is free again."""
        self._drones: dict[int, selectors.SelectorKey] = {}
        """Those that are registered."""

        self._waiting: deque[tuple[int, int]] = deque()
        """Sockets of drones with data, in turn: (file descriptor, events)."""
        self._serves_clients = False
        """What was handed out last was of clients, and is worked on."""
        self._since = 0.0
        """When that was (s, monotonic)."""
        self._owed = 0.0
        """s that clients are ahead of the drones that wait."""

        self._count = 0
        """Sockets of drones with data in the present window."""
        self._until = 0.0
        """End of that window (s, monotonic)."""
        self._is_busy = False
        self._next = 0.0
        """When to look at drones again (s, monotonic) in a busy time."""

    @property
    def looked(self) -> float:
        """When sockets were looked at last (s, monotonic)."""
        return self._since

    # The registered sockets.

    def read_after_clients(self, sock: OpenSocket) -> None:
        """Treat a socket as a drone's until it is closed."""
        fd = sock.fileno()
        self._sockets[fd] = sock
        key = self._all.get_map().get(fd)
        if key is not None and fd not in self._drones:
            self._clients.unregister(fd)
            self._drones[fd] = key

    def register(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        key = self._all.register(fileobj, events, data)
        sock = self._sockets.get(key.fd)
        if sock is not None and sock.fileno() == key.fd:
            self._drones[key.fd] = key
        else:
            self._sockets.pop(key.fd, None)  # of a closed socket, whose number another has now
            self._clients.register(fileobj, events, data)
        return key

    def unregister(self, fileobj: Any) -> selectors.SelectorKey:
        key = self._all.unregister(fileobj)
        if self._drones.pop(key.fd, None) is None:
            self._clients.unregister(fileobj)
        return key

    def modify(self, fileobj: Any, events: int, data: Any = None) -> selectors.SelectorKey:
        key = self._all.modify(fileobj, events, data)
        if key.fd in self._drones:
            self._drones[key.fd] = key
        else:
            self._clients.modify(fileobj, events, data)
        return key

    def get_map(self) -> Mapping[Any, selectors.SelectorKey]:
        return self._all.get_map()

    def close(self) -> None:
        self._all.close()
        self._clients.close()

    # Those with data.

    def select(self, timeout: float | None = None) -> Ready:
        """Return sockets with data, of clients or of a few drones.

        Waits for at most `timeout` s; None: for any time.
        """
        now = self._monotonic()
        if not self._waiting:
            self._owed = 0.0
            found = self._look(timeout, now)
        else:
            took = now - self._since
            self._owed = min(self._owed + took, MOST_OWED) if self._serves_clients else max(self._owed - took, 0.0)
            found = self._clients.select(0)
        # With a timeout of 0 the event loop has more to do: of the client that has just been read.
        goes_on = bool(found) or (self._serves_clients and timeout == 0)
        self._serves_clients = not self._waiting or (goes_on and self._owed < PATIENCE)
        self._since = self._monotonic()
        return found if self._serves_clients else self._next_drones()

    def _look(self, timeout: float | None, now: float) -> Ready:
        """Wait for sockets with data; return those of clients, and queue those of drones."""
        if self._is_busy and (rest := self._next - now) > 0.0:
            found = self._clients.select(rest if timeout is None else min(rest, timeout))
            if found or (timeout is not None and timeout <= rest):
                return found
            timeout = timeout and timeout - rest
        clients = []
        for key, events in self._all.select(timeout):
            if key.fd in self._drones:
                self._waiting.append((key.fd, events))
            else:
                clients.append((key, events))
        now = self._monotonic()
        if now >= self._until:
            self._is_busy = self._count >= BUSY and now < self._until + WINDOW
            self._count, self._until = 0, now + WINDOW
        self._count += len(self._waiting)
        self._next = now + PAUSE
        return clients

    def _next_drones(self) -> Ready:
        ready: Ready = []
        while self._waiting and len(ready) < AT_ONCE:
            fd, events = self._waiting.popleft()
            key = self._drones.get(fd)  # closed meanwhile, or waited for in another way
            if key is not None and events & key.events:
                ready.append((key, events & key.events))
        return ready


class GatewayLoop(asyncio.SelectorEventLoop):
    """An event loop with that selector, and with calls that give way to sockets."""

    def __init__(self) -> None:
        self._paced = PacedSelector()
        super().__init__(self._paced)
        self._calls = PacedCalls(lambda: self._paced.looked, self._request_calls, self.time)
        self._names = DiskWriter("anafi-mav-names", threads=LOOKUPS)

    async def getaddrinfo(
        self,
        host: bytes | str | None,
        port: bytes | str | int | None,
        *,
        family: int = 0,
        type: int = 0,
        proto: int = 0,
        flags: int = 0,
    ) -> Any:
        """Look a name up in a thread that nothing else waits for."""
        lookup = partial(socket.getaddrinfo, host, port, family, type, proto, flags)
        return await self.run_in_executor(self._names, lookup)

    def close(self) -> None:
        self._names.shutdown()
        super().close()

    def read_after_clients(self, sock: OpenSocket) -> None:
        """See `receive_buffer.read_after_clients`."""
        self._paced.read_after_clients(sock)

    def call_after_clients(self, call: PacedCall) -> None:
        """See `clock.YieldingCall`."""
        self._calls.request(call)

    def cancel_after_clients(self, call: PacedCall) -> None:
        """See `clock.YieldingCall`."""
        self._calls.cancel(call)

    def _request_calls(self) -> None:
        self.call_at(self.time(), self._calls.run)  # an iteration calls timers after sockets, the most overdue first


def run(work: Coroutine[Any, Any, ResultT]) -> ResultT:
    """Run a coroutine as asyncio.run does.

    Windows has an event loop of its own, without a selector.
    """
    if sys.platform == "win32":
        return asyncio.run(work)
    if sys.version_info >= (3, 11):
        with asyncio.Runner(loop_factory=GatewayLoop) as runner:
            return runner.run(work)

    class Policy(asyncio.DefaultEventLoopPolicy):
        def new_event_loop(self) -> asyncio.AbstractEventLoop:
            return GatewayLoop()

    asyncio.set_event_loop_policy(Policy())  # Python 3.10 has no Runner, and 3.16 has no policies
    return asyncio.run(work)
