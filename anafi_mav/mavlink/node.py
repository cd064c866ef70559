"""Node: all endpoints of the gateway, the router between them and the way to our hosts.

node = Node()
await node.start(["udpout://127.0.0.1:14550", "tcpin://127.0.0.1:5760"])
node.add_host(1, 1, autopilot.receive)
node.send(heartbeat, sysid=1, compid=1)
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from typing import Any, Protocol

import msgspec

from anafi_mav.clock import Clock, SystemClock
from anafi_mav.endpoint_options import EndpointConfig
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import STOPPING, WITH_SECRETS, Access, concerns_link, needed_access, needed_by_others
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, reason
from anafi_mav.mavlink.channel import Channel, total
from anafi_mav.mavlink.endpoint import EndpointFactory, make_endpoint, parse_endpoint
from anafi_mav.mavlink.frames import Batch, Packed, ReceivedFrame, pack
from anafi_mav.mavlink.key_ring import KeyRing
from anafi_mav.mavlink.router import Route, Router, has_target, targets
from anafi_mav.mavlink.signing import Signing
from anafi_mav.mavlink.stall import StallWatch

logger = logging.getLogger(__name__)
message_logger = logging.getLogger("anafi_mav.message")
"""Every message that reaches one of our hosts, decoded."""


class Inbound(msgspec.Struct, frozen=True):
    """A message for one of our hosts: addressed to its component, its system, or to all."""

    message: Any
    """A message of the dialect."""
    id: int
    """Its number."""
    channel: Channel
    """Channel it arrived on, and to which an answer goes."""
    sysid: int
    """System id of the sender."""
    compid: int
    """Component id of the sender."""
    now: float
    """When it arrived, by the clock's monotonic time."""
    is_permitted: bool = True
    """False when it needs more than the access of its channel: it must have no effect."""
    is_late: bool = False
    """True for a command or mode that may have been sent while the host stalled: only a stop has an effect."""

    @property
    def client(self) -> Hashable:
        """The sender, as a key among all clients."""
        return (self.channel, self.sysid, self.compid)


Receiver = Callable[[Inbound], None]
"""Takes the messages for one of our hosts."""


class FrameTap(Protocol):
    """Sees what passes a node beside its channels: for a recording."""

    def sent(self, packed: Packed, sysid: int, compid: int) -> None: ...

    def received(self, frame: ReceivedFrame) -> None: ...


def _is_stations_heartbeat(message: Any) -> bool:
    return isinstance(message, dialect.MAVLink_heartbeat_message) and message.type == dialect.MAV_TYPE_GCS


def _is_harmless(message: Any) -> bool:
    """Return True if a permitted message of an observer neither deceives nor disturbs others.

    It is a station's heartbeat, or reads from one system.
    """
    return _is_stations_heartbeat(message) or (targets(message)[0] != 0 and not concerns_link(message))


def _log_change(change: str, channel: Channel) -> None:
    """Log that a channel opened or closed. One per made-up address would fill the log."""
    logger.log(logging.INFO if channel.proof is None else logging.DEBUG, "%s: %s", channel.name, change)


class Node:
    """Our place in the MAVLink network. `start` once, `close` once (twice does no harm)."""

    def __init__(
        self,
        *,
        on_channel: Callable[[Channel, bool], None] | None = None,
        clock: Clock | None = None,
        flavours: Sequence[str] = (),
        keys: KeyRing | None = None,
        on_setup_signing: Receiver | None = None,
        factories: Mapping[str, EndpointFactory] | None = None,
        forwards: bool = True,
    ) -> None:
        """`flavours` are those that the URL of an endpoint may name.

        `keys`: the signing keys; None: no endpoint signs. `on_setup_signing` receives SETUP_SIGNING in place of the
        host that it is for: the key in it belongs to the endpoint. None: it is dropped. `factories` make the endpoints
        of schemes that this room has none for. Without `forwards` nothing passes from one client to another.
        """
        self.on_channel = on_channel
        """Called with True when a channel opened, or its peer has proved its address, and with False when it closed."""
        self.channels: list[Channel] = []
        """The channels that are open now. A new list whenever they change: safe to iterate over while sending."""
        self.endpoints: list[Endpoint] = []
        """In the order of the URLs."""
        self.tap: FrameTap | None = None
        """Sees messages to single channels, and received frames."""
        self._clock = clock or SystemClock()
        self._telemetry: set[int] = set()
        self._router: Router[Channel, Receiver] = Router()
        self._delivers = True
        self._forwards = forwards
        self._flavours = flavours
        self._keys = keys
        self._on_setup_signing = on_setup_signing
        self._factories = factories or {}
        self._heartbeats: dict[tuple[int, int], Packed] = {}
        """The newest of each of our components; without those of autopilots, which depend on the flavour."""
        self._stale = 0
        """Messages of the time of a stall."""
        self._closed: defaultdict[str, Counter[str]] = defaultdict(Counter)
        """What was counted by closed channels, by the URL of their endpoint."""
        self._stalls: StallWatch | None = None

    async def start(self, entries: Sequence[str | EndpointConfig]) -> None:
        """Open an endpoint for each URL, or mapping with one.

        Raises `ConfigError` with key path "endpoints[i]"; nothing is left open.
        """
        self._stalls = StallWatch(self._stalled, self._clock)
        self._stalls.start()
        parsed = []
        for index, entry in enumerate(entries):
            try:
                parsed.append(parse_endpoint(entry, self._flavours))
            except ConfigError as error:
                key = f".{error.key_path}" if error.key_path else ""
                raise ConfigError(f"endpoints[{index}]{key}", error.problem) from error
        signings = [self._signing(index, url) for index, url in enumerate(parsed)]
        if self._keys is not None:
            await self._keys.start()
        for index, url in enumerate(parsed):
            try:
                endpoint = make_endpoint(url, self, self._clock, self._factories)
            except ConfigError as error:
                await self.close()
                raise ConfigError(f"endpoints[{index}]", error.problem) from error
            endpoint.signing = signings[index]
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
        if self._keys is not None:
            await self._keys.close()

    def _signing(self, index: int, url: EndpointUrl) -> Signing | None:
        if self._keys is None:
            if url.options.signing is None:
                return None
            raise ConfigError(f"endpoints[{index}].signing", "expected none: this program has no keys")
        try:
            return self._keys.open(url.key_name, is_required=url.options.signing is not None)
        except ConfigError as error:
            raise ConfigError(f"endpoints[{index}].signing", error.problem) from error

    def add_host(self, sysid: int, compid: int, host: Receiver) -> None:
        """Deliver messages for this component of this system to `host`.

        Component 0 stands for all components of the system that have no host of their own.
        """
        self._router.add_host(sysid, compid, host)

    def add_absent_host(self, sysid: int, host: Receiver) -> None:
        """Deliver messages for this system to `host` while it has no other host, and none elsewhere."""
        self._router.add_absent_host(sysid, host)

    def remove_hosts(self, sysid: int) -> None:
        """Stop delivering messages for this system, and route them to other systems with its id."""
        self._router.remove_hosts(sysid)
        self._heartbeats = {source: packed for source, packed in self._heartbeats.items() if source[0] != sysid}

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
        `LocalProtocolError` for a field that does not fit; nothing is then sent.
        """
        if (sysid, compid) not in self._router.own_sources:
            self._router.own((sysid, compid))
        packed = pack(message)
        if packed.id == dialect.MAVLINK_MSG_ID_HEARTBEAT and compid != dialect.MAV_COMP_ID_AUTOPILOT1:
            self._heartbeats[sysid, compid] = packed
        if isinstance(to, Channel):
            to.send_packed(packed, sysid, compid, give_way=give_way, is_answer=True)
            if self.tap is not None:
                self._guarded(self.tap.sent, packed, sysid, compid)
            return
        for channel in self.channels if to is None else to:
            channel.send_packed(packed, sysid, compid, give_way=give_way)

    def send_batch(self, batch: Batch, to: Iterable[Channel]) -> None:
        """Send messages of streams of one of our components to some channels."""
        if batch.sender not in self._router.own_sources:
            self._router.own(batch.sender)
        for channel in to:
            channel.send_batch(batch)

    def sources(self, channel: Channel) -> list[tuple[int, int]]:
        """Return the systems and components heard on a channel, sorted."""
        return self._router.sources(channel)

    def loop_delays(self) -> list[float]:
        """Return how late the event loop ran its timers within the last minute, s."""
        return [] if self._stalls is None else list(self._stalls.delays)

    @property
    def stalled(self) -> float:
        """How long the host stalled since the start, s."""
        return 0.0 if self._stalls is None else self._stalls.stalled

    def closed_counters(self, url: str) -> Counter[str]:
        """Return what the closed channels of an endpoint have counted."""
        return self._closed[url]

    def counters(self) -> Counter[str]:
        """Everything counted since the start: by channels, endpoints and the router."""
        result = total(self.channels) + self._router.counters
        for counters in self._closed.values():
            result.update(counters)
        if self._stale:
            result["stale"] = self._stale
        for endpoint in self.endpoints:
            result.update(endpoint.counters)
        return result

    # What endpoints report.

    def opened(self, channel: Channel) -> None:
        _log_change("open", channel)
        self._router.add(channel)
        self.channels = [*self.channels, channel]
        if self.on_channel is not None:
            self._guarded(self.on_channel, channel, True)

    def proved(self, channel: Channel) -> None:
        logger.info("%s: proved its address", channel.name)
        self.channels = [*self.channels]
        if self.on_channel is not None:
            self._guarded(self.on_channel, channel, True)

    def closed(self, channel: Channel) -> None:
        _log_change("closed", channel)
        self._router.remove(channel)
        self.channels = [other for other in self.channels if other is not channel]
        self._closed[channel.endpoint].update(total([channel]))
        if self.on_channel is not None:
            self._guarded(self.on_channel, channel, False)

    def introduce(self, channel: Channel) -> None:
        for (sysid, compid), packed in self._heartbeats.items():
            if channel.has_system(sysid):
                channel.send_packed(packed, sysid, compid)
                return

    def received(self, channel: Channel, frames: list[ReceivedFrame], reached: Collection[int] | None = None) -> None:
        reached = channel.system_ids if reached is None else reached
        now = self._clock.monotonic()
        stalls = self._stalls
        old = (
            stalls is not None
            and self._clock.boottime() >= stalls.punctual_until
            and not channel.has_ages
            and stalls.waited > 0.0
        )
        if frames:
            channel.hear(frames, now)
        for received in frames:
            if self.tap is not None:
                self._guarded(self.tap.received, received)
            permitted, may_forward = True, self._forwards
            is_false = is_hidden = False
            if reached is not None or not channel.is_unrestricted:
                permitted = channel.access is Access.ALL or self._permits(channel, received)
                is_false = channel.access is Access.OBSERVE and self._has_name_of_other(channel, received)
                # A system of ours that the channel does not reach is not behind it: commands to it are answered here.
                is_hidden = (
                    reached is not None and received.sysid not in reached and self._router.is_ours(received.sysid)
                )
                may_forward = (
                    may_forward and permitted and self._may_forward(channel, received, reached, is_false=is_false)
                )
            route = self._router.route(
                channel, received, now, reached, may_forward=may_forward, may_learn=not (is_false or is_hidden)
            )
            if route.is_refused:
                channel.counters["refused_systems"] += 1
            if route.forward:
                self._forward(channel, received, route)
            if not route.hosts or not self._delivers:
                continue
            if old:
                self._stale += 1
                if received.id not in STOPPING:
                    continue
            message, id = received.message, received.id
            inbound = Inbound(message, id, channel, received.sysid, received.compid, now, permitted, old)
            if id == dialect.MAVLINK_MSG_ID_SETUP_SIGNING:
                # Before the log and the hosts: it holds a key.
                if self._on_setup_signing is not None:
                    self._guarded(self._on_setup_signing, inbound)
                continue
            shown = message.get_type() if id in WITH_SECRETS else message
            message_logger.debug("%s: %s", channel.name, shown)
            for host in route.hosts:
                self._guarded(host, inbound)

    def _forward(self, channel: Channel, received: ReceivedFrame, route: Route[Channel, Receiver]) -> None:
        give_way, is_answer = received.id in self._telemetry, targets(received.message)[0] != 0
        for other in route.forward:
            if not other.has_system(received.sysid) or (give_way and not other.can_stream(received.id)):
                other.counters["filtered_frames"] += 1
            elif (raw := other.prepare_forward(received, channel)) is not None:
                other.forward(raw, give_way=give_way, is_answer=is_answer)

    def _permits(self, channel: Channel, received: ReceivedFrame) -> bool:
        """Return True if the channel's access covers a frame; otherwise it is counted."""
        if needed_access(received.message) <= channel.access:
            return True
        self._count_refused(channel, received)
        return False

    def _count_refused(self, channel: Channel, received: ReceivedFrame) -> None:
        name = "unknown" if received.message is None else received.message.get_type()
        channel.counters["refused_access"] += 1
        channel.counters[f"refused_access.{name}"] += 1

    def _has_name_of_other(self, channel: Channel, received: ReceivedFrame) -> bool:
        """Return True for a frame in the name of a system of ours.

        Or in that of one behind a channel with more access.
        """
        return self._router.is_ours(received.sysid) or any(
            other.access > channel.access for other in self._router.heard_on(received.sysid)
        )

    def _may_forward(
        self, channel: Channel, received: ReceivedFrame, reached: Collection[int] | None, *, is_false: bool
    ) -> bool:
        """Return True if a permitted frame may reach other channels; otherwise it is counted.

        `reached`: the only systems that it may reach; None: all. `is_false`: it is an observer's, in the name of
        another sender.
        """
        if reached is not None and not self._stays_within(reached, received):
            channel.counters["filtered_frames"] += 1
            return False
        if channel.access is Access.OBSERVE and (is_false or not _is_harmless(received.message)):
            channel.counters["refused_observer"] += 1
            return False
        if channel.access is Access.CONTROL and needed_by_others(received.message) > channel.access:
            if not self._router.is_ours(targets(received.message)[0]):
                self._count_refused(channel, received)
            return False
        return True

    def _stays_within(self, systems: Collection[int], received: ReceivedFrame) -> bool:
        """Return True if a frame reaches these systems alone: `systems`, or a key's.

        The router decides about frames for one system. To all go a station's heartbeat, and what these systems send
        to no target: a command to system 0 would be one to the systems behind other endpoints. COMMAND_ACK of older
        autopilots has no target though it has the field.
        """
        message = received.message
        if targets(message)[0] != 0 or _is_stations_heartbeat(message):
            return True
        is_ack = isinstance(message, dialect.MAVLink_command_ack_message)
        return received.sysid in systems and (is_ack or not has_target(message))

    def _stalled(self, seconds: float) -> None:
        logger.warning(
            "the host stalled for %.1f s: of what clients sent meanwhile only stops have an effect",
            seconds,
        )

    def _guarded(self, callback: Callable[..., None], *arguments: object) -> None:
        """Call back. A mistake in a service must not close the socket that brought the message."""
        try:
            callback(*arguments)
        except Exception as error:
            asyncio.get_running_loop().call_exception_handler(
                {"message": f"{callback!r} failed on a MAVLink message", "exception": error}
            )
