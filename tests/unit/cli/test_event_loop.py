"""Which sockets the gateway's event loop reads, in which order and how often, by a clock set by hand."""

from __future__ import annotations

import asyncio
import selectors
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial

import pytest

from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.session import Session
from anafi_mav.arsdk.link.transport import Role, Transport
from anafi_mav.arsdk.messages.common import AllStates
from anafi_mav.cli.event_loop import (
    AT_ONCE,
    BUSY,
    LOOKUPS,
    MOST_OWED,
    PATIENCE,
    PAUSE,
    WINDOW,
    GatewayLoop,
    PacedSelector,
)
from anafi_mav.cli.paced_calls import LONGEST, SLICE
from anafi_mav.mavlink import dialect, frames
from anafi_mav.mavlink.node import Inbound, Node

UNANSWERED = 30.0
"""s until a lookup ends without an answer."""


class Moment:
    """A clock that is set by hand, and by waiting."""

    def __init__(self) -> None:
        self.now = 100.0
        self.waits: list[float | None] = []
        """Waits for sockets that brought none."""

    def monotonic(self) -> float:
        return self.now


class Bench:
    """A selector with sockets of clients and drones, each with data or without."""

    def __init__(self, stack: ExitStack) -> None:
        self.moment = moment = Moment()

        class Waiting(selectors.DefaultSelector):
            """Moves the clock instead of waiting."""

            def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
                found = super().select(0)
                if not found and timeout != 0:
                    moment.waits.append(timeout)
                    moment.now += timeout or 0.0
                return found

        self.selector = stack.enter_context(PacedSelector(moment.monotonic, Waiting))
        self._stack = stack
        self._far: dict[str, socket.socket] = {}
        self.near: dict[str, socket.socket] = {}

    def add(self, name: str, *, is_drone: bool = False, has_data: bool = False) -> None:
        near, far = socket.socketpair()
        self.near[name], self._far[name] = self._stack.enter_context(near), self._stack.enter_context(far)
        if is_drone:
            self.selector.read_after_clients(near)
        self.selector.register(near, selectors.EVENT_READ, name)
        if has_data:
            self.send(name)

    def add_drones(self, count: int) -> list[str]:
        names = [f"drone {number}" for number in range(count)]
        for name in names:
            self.add(name, is_drone=True, has_data=True)
        return names

    def send(self, name: str) -> None:
        self._far[name].send(b"data")

    def select(self, timeout: float | None = None, *, reads: bool = False) -> list[str]:
        """Return the names of the sockets handed out, and read what they have if it is so."""
        names = [key.data for key, _ in self.selector.select(timeout)]
        for name in names if reads else ():
            self.near[name].recv(100)
        return names

    def make_busy(self) -> None:
        """Let drones be busy for a window, and begin the next one."""
        self.select(0)
        self.moment.now += WINDOW
        for _ in range(BUSY + 1):
            self.select(0)
        self.moment.now += WINDOW
        self.select(0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with ExitStack() as stack:
        yield Bench(stack)


# A busy time.


def test_few_drones_with_data_are_never_waited_for(bench: Bench) -> None:
    bench.add("drone", is_drone=True, has_data=True)
    for _ in range(20):
        assert bench.select() == ["drone"]
        bench.moment.now += WINDOW / 10
    assert bench.moment.waits == []


def test_busy_drones_are_looked_at_once_in_a_pause(bench: Bench) -> None:
    bench.add("drone", is_drone=True, has_data=True)
    bench.make_busy()
    assert bench.select(0) == []
    bench.moment.now += PAUSE / 4
    assert bench.select() == ["drone"]
    assert bench.moment.waits == [pytest.approx(PAUSE * 3 / 4)]
    bench.moment.now += PAUSE
    assert bench.select() == ["drone"]
    assert len(bench.moment.waits) == 1


def test_client_is_not_waited_for_in_a_pause(bench: Bench) -> None:
    bench.add("drone", is_drone=True, has_data=True)
    bench.add("client")
    bench.make_busy()
    bench.send("client")
    assert bench.select(reads=True) == ["client"]
    assert bench.moment.waits == []
    assert bench.select() == ["drone"]
    assert bench.moment.waits == [pytest.approx(PAUSE)]


def test_busy_client_makes_no_pause(bench: Bench) -> None:
    bench.add("client", has_data=True)
    bench.add("drone", is_drone=True)
    bench.make_busy()
    bench.send("drone")
    assert bench.select(reads=True) == ["client"]
    assert bench.select(0.1) == ["drone"]
    assert bench.moment.waits == []


def test_timer_within_a_pause_is_not_late(bench: Bench) -> None:
    bench.add("drone", is_drone=True, has_data=True)
    bench.make_busy()
    assert bench.select(PAUSE / 2) == []
    assert bench.moment.waits == [PAUSE / 2]


def test_drones_that_are_no_longer_busy_are_looked_at_at_once(bench: Bench) -> None:
    bench.add("drone", is_drone=True, has_data=True)
    bench.make_busy()
    bench.moment.now += WINDOW
    bench.select()
    assert bench.select() == ["drone"]
    assert bench.moment.waits == []


# The order.


def test_drones_are_handed_out_a_few_at_a_time_each_once_in_a_round(bench: Bench) -> None:
    names = bench.add_drones(2 * AT_ONCE + 1)
    rounds = [[bench.select() for _ in range(3)] for _ in range(2)]
    assert [[len(lot) for lot in one] for one in rounds] == [[AT_ONCE, AT_ONCE, 1]] * 2
    assert [sorted(name for lot in one for name in lot) for one in rounds] == [sorted(names)] * 2


def test_client_comes_alone_before_drones_with_data(bench: Bench) -> None:
    bench.add_drones(AT_ONCE)
    bench.add("client", has_data=True)
    assert bench.select(reads=True) == ["client"]
    assert len(bench.select()) == AT_ONCE


def test_client_comes_between_drones_of_one_round(bench: Bench) -> None:
    bench.add_drones(2 * AT_ONCE)
    bench.add("client")
    assert len(bench.select()) == AT_ONCE
    bench.send("client")
    assert bench.select(reads=True) == ["client"]
    assert len(bench.select()) == AT_ONCE


def test_work_of_a_client_goes_on_before_drones(bench: Bench) -> None:
    """The event loop passes a timeout of 0 while callbacks wait: a command takes some iterations."""
    bench.add_drones(1)
    bench.add("client", has_data=True)
    assert bench.select(reads=True) == ["client"]
    assert [bench.select(0) for _ in range(5)] == [[]] * 5
    assert bench.select(1.0) == ["drone 0"]


def test_work_of_drones_does_not_keep_other_drones_waiting(bench: Bench) -> None:
    bench.add_drones(2 * AT_ONCE)
    assert [len(bench.select(0)) for _ in range(2)] == [AT_ONCE, AT_ONCE]


def test_drones_have_as_much_time_as_clients_that_never_stop(bench: Bench) -> None:
    bench.add_drones(200 * AT_ONCE)
    bench.add("client", has_data=True)
    spent = {"client": 0.0, "drone": 0.0}
    for _ in range(200):
        name = bench.select(0)[0].split()[0]
        spent[name] += 0.001
        bench.moment.now += 0.001
    assert spent["drone"] == pytest.approx(spent["client"], abs=2 * PATIENCE)


def test_client_waits_for_a_bounded_time_after_another_has_taken_long(bench: Bench) -> None:
    bench.add_drones(200)
    bench.add("client", has_data=True)
    assert bench.select() == ["client"]
    bench.moment.now += 1.0
    waited = 0.0
    while bench.select() != ["client"]:
        bench.moment.now += 0.001
        waited += 0.001
    assert MOST_OWED - PATIENCE <= waited <= MOST_OWED


# Sockets that change meanwhile.


def test_drone_that_is_closed_while_it_waits_is_left_out(bench: Bench) -> None:
    bench.add_drones(AT_ONCE + 1)
    (last,) = set(bench.near) - set(bench.select())
    bench.selector.unregister(bench.near[last])
    assert bench.select(0) == []


def test_socket_with_the_number_of_a_closed_drone_is_a_clients(bench: Bench) -> None:
    bench.add_drones(1)
    drone = bench.near["drone 0"]
    number = drone.fileno()
    bench.selector.unregister(drone)
    drone.close()
    bench.add("client", has_data=True)
    assert bench.near["client"].fileno() == number
    bench.add("other", is_drone=True, has_data=True)
    assert bench.select(reads=True) == ["client"]
    assert bench.select() == ["other"]


def test_drone_that_is_paused_and_resumed_is_still_a_drones(bench: Bench) -> None:
    """As asyncio does with a stream whose reader is slow."""
    bench.add_drones(1)
    bench.selector.unregister(bench.near["drone 0"])
    bench.selector.register(bench.near["drone 0"], selectors.EVENT_READ, "drone 0")
    bench.add("client", has_data=True)
    assert bench.select(reads=True) == ["client"]
    assert bench.select() == ["drone 0"]


def test_open_socket_becomes_a_drones(bench: Bench) -> None:
    bench.add("drone", has_data=True)
    bench.add("client", has_data=True)
    bench.selector.read_after_clients(bench.near["drone"])
    assert bench.select(reads=True) == ["client"]
    assert bench.select() == ["drone"]


@pytest.mark.parametrize("is_drone", [False, True])
def test_socket_is_waited_for_as_it_was_changed_last(bench: Bench, is_drone: bool) -> None:
    """A drone's, while it waits for its turn."""
    bench.add_drones(AT_ONCE)
    bench.add("socket", is_drone=is_drone, has_data=True)
    while "socket" not in bench.select():
        pass
    bench.selector.modify(bench.near["socket"], selectors.EVENT_READ | selectors.EVENT_WRITE, "changed")
    assert bench.selector.get_key(bench.near["socket"]).data == "changed"
    while "changed" not in (names := bench.select()):
        assert "socket" not in names


# The event loop, with real sockets.


def test_clients_frame_is_received_between_the_datagrams_of_many_drones() -> None:
    """A client sends while the first of 40 drones is read: its frame comes before most of the others'."""
    drones = 40

    async def fly() -> list[str]:
        order: list[str] = []
        loop = asyncio.get_running_loop()
        node = Node()
        await node.start(["udpin://127.0.0.1:0"])
        (port,) = [endpoint.local_port for endpoint in node.endpoints]
        client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        client.connect(("127.0.0.1", port))
        ping = frames.frame(frames.pack(dialect.MAVLink_ping_message(0, 1, 1, 1)), 0, 255, 190)
        arrived = asyncio.Event()

        def heard(inbound: Inbound) -> None:
            order.append("client")
            arrived.set()

        def flew(message: Message | UnknownMessage, now: float) -> None:
            if not order:
                client.send(ping)
            order.append("drone")

        node.add_host(1, 1, heard)
        sessions = []
        data = _datagram()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as air:
            air.bind(("127.0.0.1", 0))
            for _ in range(drones):
                sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
                sock.connect(air.getsockname())
                session = Session(Transport(Role.CONTROLLER, 3, loop.time()), flew)
                await session.open(sock)
                sessions.append(session)
            for session in sessions:
                air.sendto(data, session.address)
            await asyncio.wait_for(arrived.wait(), 5.0)
        for session in sessions:
            await session.close()
        await node.close()
        client.close()
        return order

    loop = GatewayLoop()
    try:
        order = loop.run_until_complete(fly())
    finally:
        loop.close()
    assert order.index("client") <= AT_ONCE


def test_client_is_read_between_paced_calls_and_after_overdue_timers() -> None:
    """Calls that each take as long as those of an iteration; after a stall there are `LONGEST` of them."""
    most = round(LONGEST / SLICE) + 2
    order: list[str] = []
    loop = GatewayLoop()
    near, far = socket.socketpair()

    def call(name: str) -> None:
        if not order:
            far.send(b"data")
            loop.call_later(0, order.append, "timer")
        order.append(name)
        end = loop.time() + SLICE
        while loop.time() < end:
            pass

    def read() -> None:
        near.recv(100)
        order.append("client")

    def request() -> None:
        for number in range(2 * most):
            loop.call_after_clients(partial(call, f"call {number}"))
        loop.call_after_clients(loop.stop)

    try:
        near.setblocking(False)
        loop.add_reader(near, read)
        loop.call_soon(request)
        loop.run_forever()
    finally:
        loop.close()
        near.close()
        far.close()
    at = order.index("client")
    assert at <= most
    assert order[at + 1] == "timer"
    assert [*order[:at], *order[at + 2 :]] == [f"call {number}" for number in range(2 * most)]


def test_names_that_are_not_resolved_delay_no_other_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a name server that does not answer: neither work in threads nor the end of the program waits for it."""
    answer = threading.Event()

    def resolve(*address: object) -> list[object]:
        answer.wait(UNANSWERED)
        return [address]

    monkeypatch.setattr(socket, "getaddrinfo", resolve)

    async def look() -> None:
        loop = asyncio.get_running_loop()
        lookups = [loop.create_task(loop.getaddrinfo(f"drone{number}.test", 44445)) for number in range(3 * LOOKUPS)]
        assert await asyncio.wait_for(asyncio.to_thread(lambda: 7), UNANSWERED / 2) == 7
        await asyncio.wait_for(loop.shutdown_default_executor(), UNANSWERED / 2)
        answer.set()
        found: object = await lookups[0]
        assert found == [("drone0.test", 44445, 0, 0, 0, 0)]
        for lookup in lookups:
            lookup.cancel()
        await asyncio.wait(lookups)

    loop = GatewayLoop()
    try:
        loop.run_until_complete(look())
    finally:
        answer.set()
        loop.close()


def _datagram() -> bytes:
    """A datagram of a drone, with one message."""
    drone = Transport(Role.DEVICE, 3, 0.0)
    drone.send(AllStates(), 0.0)
    (datagram,) = drone.outgoing(0.0)
    return datagram
