"""Node: all endpoints of the gateway, the router between them and the way to our hosts.

node = Node()
await node.start(["udpout://127.0.0.1:14550", "tcpin://127.0.0.1:5760"])
node.add_host(1, 1, autopilot.receive)
node.send(heartbeat, sysid=1, compid=1)
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import msgspec

from anafi_mav.clock import Clock, SystemClock
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.base import Endpoint, reason
from anafi_mav.mavlink.channel import Channel, total
from anafi_mav.mavlink.endpoint import make_endpoint, parse_endpoint
from anafi_mav.mavlink.frames import ReceivedFrame, pack
from anafi_mav.mavlink.router import Router
from anafi_mav.mavlink.stall import StallWatch

logger = logging.getLogger(__name__)
message_logger = logging.getLogger("anafi_mav.message")
"""Every message that reaches one of our hosts, decoded."""


class Inbound(msgspec.Struct, frozen=True):
    """A message for one of our hosts: addressed to its component, its system, or to all."""

    message: Any
    """A message of the dialect."""
    channel: Channel
    """Channel it arrived on, and to which an answer goes."""
    sysid: int
    """System id of the sender."""
    compid: int
    """Component id of the sender."""
    now: float
    """When it arrived, by the clock's monotonic time."""


Receiver = Callable[[Inbound], None]
"""Takes the messages for one of our hosts."""


class Node:
    """Our place in the MAVLink network. `start` once, `close` once (twice does no harm)."""

    def __init__(
        self,
        *,
        on_channel: Callable[[Channel, bool], None] | None = None,
        clock: Clock | None = None,
        flavours: Sequence[str] = (),
    ) -> None:
        """`flavours` are those that the URL of an endpoint may name."""
        self.on_channel = on_channel
        """Called with True when a channel opened and with False when it closed."""
        self.channels: list[Channel] = []
        """The channels that are open now. A new list whenever they change: safe to iterate over while sending."""
        self.endpoints: list[Endpoint] = []
        """In the order of the URLs."""
        self._clock = clock or SystemClock()
        self._telemetry: set[int] = set()
        self._router: Router[Channel, Receiver] = Router()
        self._delivers = True
        self._flavours = flavours
        self._closed_counters: Counter[str] = Counter()
        self._stalls: StallWatch | None = None

    async def start(self, urls: Sequence[str]) -> None:
        """Open an endpoint for each URL.

        Raises `ConfigError` with key path "endpoints[i]"; nothing is left open.
        """
        self._stalls = StallWatch(self._stalled)
        self._stalls.start()
        parsed = []
        for index, text in enumerate(urls):
            try:
                parsed.append(parse_endpoint(text, self._flavours))
            except ConfigError as error:
                raise ConfigError(f"endpoints[{index}]", error.problem) from error
        for index, url in enumerate(parsed):
            endpoint = make_endpoint(url, self, self._clock)
            try:
                await endpoint.open()
            except OSError as error:
                await self.close()
                problem = f"cannot open {url.text}: {reason(error)}"
                raise ConfigError(f"endpoints[{index}]", problem) from error
            except BaseException:
                await self.close()
                raise
            self.endpoints.append(endpoint)

    async def close(self) -> None:
        """Close every endpoint."""
        if self._stalls is not None:
            self._stalls.stop()
        while self.endpoints:
            await self.endpoints.pop().close()

    def add_host(self, sysid: int, compid: int, host: Receiver) -> None:
        """Deliver messages for this component of this system to `host`.

        Component 0 stands for all components of the system that have no host of their own.
        """
        self._router.add_host(sysid, compid, host)

    def remove_hosts(self, sysid: int) -> None:
        """Stop delivering messages for this system, and route them to other systems with its id."""
        self._router.remove_hosts(sysid)

    def add_telemetry(self, ids: Iterable[int]) -> None:
        """Let messages with these ids give way when they are forwarded for other systems."""
        self._telemetry.update(ids)

    def stop_delivering(self) -> None:
        """Drop what arrives for our hosts from now on. Sending and forwarding continue."""
        self._delivers = False

    def send(
        self,
        message: dialect.MAVLink_message,
        *,
        sysid: int,
        compid: int,
        to: Channel | Iterable[Channel] | None = None,
        give_way: bool = False,
    ) -> None:
        """Send as this system and component to one channel, to some, or to all.

        A closed one only counts it.

        `give_way`: a full channel drops this before an answer, because the next one of its kind replaces it. Raises
        `LocalProtocolError` for a field that does not fit; nothing is then sent to anybody.
        """
        self._router.own_sources.add((sysid, compid))
        packed = pack(message)
        if isinstance(to, Channel):
            to.send_packed(packed, sysid, compid, give_way=give_way)
            return
        for channel in self.channels if to is None else to:
            channel.send_packed(packed, sysid, compid, give_way=give_way)

    def counters(self) -> Counter[str]:
        """Everything counted since the start: by channels, endpoints and the router."""
        result = self._closed_counters + total(self.channels) + self._router.counters
        for endpoint in self.endpoints:
            result.update(endpoint.counters)
        return result

    # What endpoints report.

    def opened(self, channel: Channel) -> None:
        logger.info("%s: open", channel.name)
        self._router.add(channel)
        self.channels = [*self.channels, channel]
        if self.on_channel is not None:
            self._guarded(self.on_channel, channel, True)

    def closed(self, channel: Channel) -> None:
        logger.info("%s: closed", channel.name)
        self._router.remove(channel)
        self.channels = [other for other in self.channels if other is not channel]
        self._closed_counters.update(total([channel]))
        if self.on_channel is not None:
            self._guarded(self.on_channel, channel, False)

    def received(self, channel: Channel, frames: list[ReceivedFrame]) -> None:
        now, old = self._clock.monotonic(), self._stalls is not None and self._stalls.old
        for received in frames:
            route = self._router.route(channel, received, now)
            if route.forward:
                raw = received.version_2()
                for other in route.forward:
                    other.forward(raw, give_way=received.id in self._telemetry)
            if not route.hosts or not self._delivers:
                continue
            if old:
                self._closed_counters["stale"] += 1
                continue
            message_logger.debug("%s: %s", channel.name, received.message)
            inbound = Inbound(received.message, channel, received.sysid, received.compid, now)
            for host in route.hosts:
                self._guarded(host, inbound)

    def _stalled(self, seconds: float) -> None:
        logger.warning("the host stalled for %.1f s: what clients sent meanwhile is dropped", seconds)

    def _guarded(self, callback: Callable[..., None], *arguments: object) -> None:
        """Call back. A mistake in a service must not close the socket that brought the message."""
        try:
            callback(*arguments)
        except Exception as error:
            asyncio.get_running_loop().call_exception_handler(
                {"message": f"{callback!r} failed on a MAVLink message", "exception": error}
            )
