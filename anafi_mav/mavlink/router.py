"""Routes messages to our hosts and to other channels (MAVLink routing.md §rules). No I/O.

A host is a component of ours, looked up by system and component. Our hosts are on every channel; other systems are
learned from the messages that they send. Rules beyond routing.md: a frame that comes back to us is not forwarded
again, for endpoints are easily wired into a ring, and SETUP_SIGNING, which carries a key, never is.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Container, Hashable
from typing import Generic, TypeVar

import msgspec

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import MAX_SOURCES, ReceivedFrame, Verdict

KeyT = TypeVar("KeyT", bound=Hashable)
HostT = TypeVar("HostT")

EVERY_COMPONENT = 0
"""As a target all components of a system (MAV_COMP_ID_ALL); in `add_host` those that have no host of their own."""

RING_WINDOW = 0.5
"""s in which the same frame is not passed on twice. A sender's sequence number makes all its frames differ, and half
a second is longer than the way round through other routers."""

RING_FRAMES = 512
"""Frames remembered for that: what some busy systems send in half a second. With more traffic the window is shorter."""


class Route(msgspec.Struct, Generic[KeyT, HostT], frozen=True):
    """Destinations of a message."""

    hosts: tuple[HostT, ...]
    """Our hosts that it is for, in the order of their system and component."""
    forward: tuple[KeyT, ...]
    """The channels that it is passed on to."""
    is_refused: bool = False
    """True for a message to a system that the channel does not reach."""


class Router(Generic[KeyT, HostT]):
    """Routes between channels, each known by a key, and our hosts.

    Several channels may lead to one system.
    """

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        """forwarded (per channel), own_sources (a frame in one of our names came in), rings, sources_ignored."""
        self._channels: dict[KeyT, set[tuple[int, int]]] = {}
        self._hosts: dict[int, dict[int, HostT]] = {}
        """Our hosts by system and component, in that order."""
        self._absent_hosts: dict[int, HostT] = {}
        """Our hosts of systems without another host."""
        self.own_sources: set[tuple[int, int]] = set()
        """Systems and components in whose name we have sent: frames from them are echoes, and not learned from."""
        self._recent: OrderedDict[bytes, float] = OrderedDict()

    def add(self, channel: KeyT) -> None:
        """Add an opened channel, on which no system is known yet."""
        self._channels[channel] = set()

    def remove(self, channel: KeyT) -> None:
        """Remove a closed channel and the systems behind it."""
        self._channels.pop(channel, None)

    def add_host(self, sysid: int, compid: int, host: HostT) -> None:
        """Route messages for this component to `host`.

        Messages for this system are no longer routed to other systems.
        """
        self._hosts.setdefault(sysid, {})[compid] = host
        self._hosts = {system: dict(sorted(self._hosts[system].items())) for system in sorted(self._hosts)}

    def remove_hosts(self, sysid: int) -> None:
        """This system is not ours at present, e.g. because its drone is disconnected."""
        self._hosts.pop(sysid, None)

    def add_absent_host(self, sysid: int, host: HostT) -> None:
        """Route messages for this system to `host` while it has no other host.

        A component of it that is heard on a channel, of another gateway for example, gets its messages itself.
        """
        self._absent_hosts[sysid] = host

    def hosts(self, system: int, component: int, reached: Container[int] | None = None) -> tuple[HostT, ...]:
        """Return our hosts that a target addresses, of the systems in `reached` (None: of all).

        System 0 means all systems, component 0 all components.
        """
        systems = self._hosts if system == 0 else {system: self._hosts.get(system, {})}
        if reached is not None:
            systems = {system: hosts for system, hosts in systems.items() if system in reached}
        if component == EVERY_COMPONENT:
            return tuple([host for hosts in systems.values() for host in hosts.values()])
        found = [hosts.get(component, hosts.get(EVERY_COMPONENT)) for hosts in systems.values()]
        return tuple([host for host in found if host is not None])

    def own(self, source: tuple[int, int]) -> None:
        """Note that frames leave in this name from now on.

        Another sender that had it before is no destination any longer: its answers are dropped.
        """
        self.own_sources.add(source)
        for sources in self._channels.values():
            sources.discard(source)

    def is_ours(self, sysid: int) -> bool:
        """Return True for a system that has a host of ours, also one that is not there at present."""
        return sysid in self._hosts or sysid in self._absent_hosts

    def heard_on(self, sysid: int, compid: int | None = None) -> list[KeyT]:
        """The channels on which this system, or this component of it, has been heard."""
        channels = self._channels.items()
        if compid is not None:
            return [channel for channel, sources in channels if (sysid, compid) in sources]
        return [channel for channel, sources in channels if any(source[0] == sysid for source in sources)]

    def sources(self, channel: KeyT) -> list[tuple[int, int]]:
        """Return the systems and components heard on a channel, sorted."""
        return sorted(self._channels.get(channel, ()))

    def route(
        self,
        channel: KeyT,
        received: ReceivedFrame,
        now: float,
        reached: Container[int] | None = None,
        *,
        may_forward: bool = True,
        may_learn: bool = True,
    ) -> Route[KeyT, HostT]:
        """Return the destinations of a frame from this channel, and learn its source.

        `reached`: the systems that the channel reaches; None: all. `may_forward` is False for a frame that goes to our
        hosts alone: it then takes no place from the same frame on a channel that may send it. `may_learn` is False for
        a frame in the name of another sender: messages for that one must not go to this channel.
        """
        source = (received.sysid, received.compid)
        if source in self.own_sources:
            self.counters["own_sources"] += 1
            return Route((), ())
        # 0 is the address of all, the name of none.
        is_named = received.message is not None and received.sysid != 0 and received.verdict is not Verdict.ALLOWED
        if is_named and may_learn and source not in self._channels.get(channel, ()):
            self._learn(channel, source)
        target, component = targets(received.message)
        hosts = () if received.message is None else self.hosts(target, component, reached)
        destinations = self._destinations(target, component, received.id) if may_forward else []
        is_refused = False
        if reached is not None and target != 0 and target not in reached:
            is_refused, destinations = True, []
        elif received.message is not None and target not in self._hosts:
            hosts = hosts or self._absent_host(target, component)
        forward = tuple([other for other in destinations if other != channel])
        if forward:
            if self._is_repeated(received.identity, now):
                self.counters["rings"] += 1
                forward = ()
            self.counters["forwarded"] += len(forward)
        return Route(hosts, forward, is_refused)

    def _absent_host(self, target: int, component: int) -> tuple[HostT, ...]:
        host = self._absent_hosts.get(target)
        return () if host is None or self.heard_on(target, component or None) else (host,)

    def _destinations(self, target: int, component: int, id: int) -> list[KeyT]:
        if id == dialect.MAVLINK_MSG_ID_SETUP_SIGNING:
            return []
        if target == 0:
            return list(self._channels)
        if target in self._hosts:
            # A companion computer may share the system of one of our drones.
            return self.heard_on(target, component) if component else []
        return self.heard_on(target)

    def _learn(self, channel: KeyT, source: tuple[int, int]) -> None:
        sources = self._channels.get(channel)
        if sources is None:
            return
        if len(sources) < MAX_SOURCES:
            sources.add(source)
        else:
            self.counters["sources_ignored"] += 1

    def _is_repeated(self, identity: bytes, now: float) -> bool:
        last = self._recent.get(identity)
        if last is not None and now - last < RING_WINDOW:
            return True  # the first time stays: a sender without sequence numbers gets a frame through now and then
        self._recent.pop(identity, None)
        self._recent[identity] = now
        if len(self._recent) > RING_FRAMES:
            self._recent.popitem(last=False)
        return False


def has_target(message: object) -> bool:
    """Return True for a message with a field for its target, whatever that says."""
    return hasattr(message, "target_system") or isinstance(message, dialect.MAVLink_manual_control_message)


def targets(message: object) -> tuple[int, int]:
    """Return target system and component of a message; 0 means all.

    It is 0 too where the message has no such field.
    """
    if isinstance(message, dialect.MAVLink_manual_control_message):
        return message.target, 0
    return getattr(message, "target_system", 0), getattr(message, "target_component", 0)
