"""Leads the peers of MAVLink endpoints to systems on the fabric: each is a station."""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Sequence

from anafi_mav.clock import Clock
from anafi_mav.errors import ConfigError
from anafi_mav.fabric.arrivals import Arrival, FabricSample, LinkChange, TokenChange
from anafi_mav.fabric.connection import FabricConnection
from anafi_mav.fabric.envelope import MAX_SAMPLE, FrameNumbers, Ping, Pong, UpEnvelope, micros, sender_of, split_frames
from anafi_mav.fabric.keys import KeyKind, station_id
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, reason
from anafi_mav.mavlink.channel import Channel, total
from anafi_mav.mavlink.endpoint import make_endpoint
from anafi_mav.mavlink.frames import SIGNED, ReceivedFrame
from anafi_mav.mavlink.router import targets
from anafi_mav.mavlink.stall import StallWatch

logger = logging.getLogger(__name__)

LOCAL_OPTIONS = {"frames", "datagram_bytes", "max_clients", "idle_limit", "allowed_peers", "bytes_per_second"}
"""Options that an endpoint for stations may have: the others are the gateways' to decide."""

FABRIC_OPTIONS = {"prefix", "link", "listen", "ca", "certificate", "private_key"}

WARN_EVERY = 10.0
"""s between two warnings about lost frames."""

ALL = "*"


class _FabricStation:
    """One peer on the fabric."""

    def __init__(self, name: str, channel: Channel) -> None:
        self.name = name
        self.channel = channel
        self.received = FrameNumbers()
        """Of the frames from the fabric."""
        self._numbers: defaultdict[int, int] = defaultdict(int)

    def next_number(self, sysid: int) -> int:
        """Return the number of the next sample to a system."""
        self._numbers[sysid] += 1
        return self._numbers[sysid]


class FabricGround:
    """Endpoints for stations on one side, the fabric on the other. `start` once, `close` once."""

    def __init__(
        self,
        fabric: EndpointUrl,
        stations: Sequence[EndpointUrl],
        clock: Clock,
        *,
        on_systems: Callable[[list[int]], None] = lambda sysids: None,
    ) -> None:
        """Create it, closed.

        `on_systems` is called with the systems on the fabric whenever they change. Raises `ConfigError`.
        """
        self.counters: Counter[str] = Counter()
        """unknown_keys, refused_keys (of SETUP_SIGNING without a signature), no_system (frames for systems that are not
        on the fabric, as far as it has reported), stale (frames that waited while the host stalled, and are published
        with that age), lost_frames (from gateways to stations), misdirected_frames (of another system than their
        key's), and those of the queues."""
        self._clock = clock
        self._on_systems = on_systems
        self._url = fabric
        self._connection = FabricConnection(fabric, self.counters, self._arrived)
        if fabric.scheme != "zenoh":
            raise ConfigError("--zenoh", f"expected zenoh://HOST:PORT, got {fabric.text}")
        for key, url, allowed in (
            ("--zenoh", fabric, FABRIC_OPTIONS),
            *(("--endpoint", url, LOCAL_OPTIONS) for url in stations),
        ):
            for option in url.options.changed():
                if option not in allowed:
                    raise ConfigError(key, f"{url.text}: expected no {option}: the gateway's endpoint has it")
        for number, url in enumerate(stations):
            if url.text in (other.text for other in stations[:number]):
                raise ConfigError("--endpoint", f"expected an endpoint of its own, {url.text} is given twice")
        try:
            self.endpoints = [make_endpoint(url, self, clock) for url in stations]
            """For stations."""
        except ConfigError as error:
            raise ConfigError("--endpoint", error.problem) from error
        self._open: list[Endpoint] = []
        self._stalls = StallWatch(self._stalled, clock)
        self._stations: dict[Channel, _FabricStation] = {}
        self._by_name: dict[str, _FabricStation] = {}
        self._count = 0
        self._warned = -WARN_EVERY
        """Time of the last warning about lost frames."""
        self._holders: defaultdict[int, set[str]] = defaultdict(set)
        """Gateways that hold a system id: one, but for a moment."""
        self._shown: set[int] = set()
        """Systems whose frames have reached stations: frames may arrive before the token of their system.

        zenoh reports tokens and samples in a thread each, and over `udp` a token may be lost for seconds. A station
        that is shown a system commands it: such a command must not be dropped."""

    @property
    def sysids(self) -> list[int]:
        """The systems on the fabric, sorted."""
        return sorted(sysid for sysid, holders in self._holders.items() if holders)

    @property
    def _reachable(self) -> set[int]:
        """The systems to which stations' frames are published."""
        return self._shown.union(self.sysids)

    async def start(self) -> None:
        """Open everything. Raises `ConfigError`; nothing is then left open."""
        self._stalls.start()
        try:
            try:
                await self._connection.open()
            except OSError as error:
                raise ConfigError("--zenoh", f"cannot open {self._url.text}: {reason(error)}") from error
            self._connection.zenoh.watch_tokens(self._connection.keys.drone_token(ALL, ALL))
            for endpoint in self.endpoints:
                try:
                    await endpoint.open()
                except OSError as error:
                    raise ConfigError("--endpoint", f"cannot open {endpoint.url}: {reason(error)}") from error
                self._open.append(endpoint)
        except BaseException:
            await self.close()
            raise

    async def close(self) -> None:
        """Close everything: the stations' tokens end."""
        self._stalls.stop()
        while self._open:
            await self._open.pop().close()
        await self._connection.close()

    def lines(self) -> list[str]:
        """Return a line for the fabric and one for each endpoint."""
        state = "connected" if self._connection.is_up else f"not connected ({self._connection.problem}), retrying"
        return [f"fabric {self._url.text}: {state}", *(f"stations {one.describe()}" for one in self.endpoints)]

    def all_counters(self) -> Counter[str]:
        """Return everything counted, that of the stations' channels included."""
        return self.counters + total(self._stations)

    # What endpoints report.

    def opened(self, channel: Channel) -> None:
        """Make a peer a station on the fabric, once it has proved to be at its address."""
        if channel.proof is None:
            self._join(channel)

    def _join(self, channel: Channel) -> None:
        self._count += 1
        station = _FabricStation(station_id(self._connection.session, self._count), channel)
        self._stations[channel] = self._by_name[station.name] = station
        keys = self._connection.keys
        self._connection.zenoh.subscribe(f"{keys.down(ALL, station.name)}/**")
        self._connection.zenoh.declare_token(keys.station_token(station.name))
        logger.info("%s: station %s", channel.name, station.name)

    def closed(self, channel: Channel) -> None:
        """Leave the fabric."""
        station = self._stations.pop(channel, None)
        if station is not None:
            del self._by_name[station.name]
            keys = self._connection.keys
            self._connection.zenoh.end(keys.station_token(station.name))
            self._connection.zenoh.end(f"{keys.down(ALL, station.name)}/**")

    def proved(self, channel: Channel) -> None:
        """Make a peer a station, which a made-up address is not: the places of gateways are few."""
        self._join(channel)

    def introduce(self, channel: Channel) -> None:
        """Do nothing: the endpoints here have no keys."""

    def received(self, channel: Channel, frames: list[ReceivedFrame], reached: Collection[int] | None = None) -> None:
        """Publish the frames of a peer, each for its system."""
        now, station = self._clock.monotonic(), self._stations.get(channel)
        if frames:
            channel.hear(frames, now)
        if station is None or not frames:
            return
        waited = self._stalls.waited
        if waited:
            self.counters["stale"] += len(frames)
        reachable = self._reachable
        by_system: defaultdict[int, list[bytes]] = defaultdict(list)
        for received in frames:
            if received.id == dialect.MAVLINK_MSG_ID_SETUP_SIGNING and not received.raw[2] & SIGNED:
                # A gateway takes it from signed links only. All that may read them on the network have the key.
                self.counters["refused_keys"] += 1
                logger.warning("%s: key of SETUP_SIGNING not published: use anafi-mav keygen", channel.endpoint)
                continue
            target = targets(received.message)[0]
            systems = reachable if target == 0 else reachable & {target}
            if not systems:
                self.counters["no_system"] += 1
            for sysid in systems:
                by_system[sysid].append(received.raw)
        for sysid, parts in by_system.items():
            self._publish(station, sysid, parts, micros(now - waited))

    def _publish(self, station: _FabricStation, sysid: int, parts: list[bytes], sent: int) -> None:
        key, sample = self._connection.keys.up(sysid, station.name), b""
        for part in [*parts, b""]:
            if sample and (not part or len(sample) + len(part) > MAX_SAMPLE):
                envelope = UpEnvelope(self._connection.session, station.next_number(sysid), sent)
                self._connection.publish(key, sample, envelope.encode())
                sample = b""
            sample += part

    def _stalled(self, seconds: float) -> None:
        logger.warning("the host stalled for %.1f s: what stations sent meanwhile counts as so old", seconds)

    # What the fabric reports.

    def _arrived(self, arrival: Arrival) -> None:
        if isinstance(arrival, FabricSample):
            self._sample(arrival)
        elif isinstance(arrival, TokenChange):
            self._token(arrival)
        elif isinstance(arrival, LinkChange):
            logger.warning("%s: %s", self._url.text, "connected" if arrival.is_up else arrival.problem)
            self._forget_frames()

    def _token(self, change: TokenChange) -> None:
        key = self._connection.keys.parse(change.key)
        if key is None or key.kind is not KeyKind.DRONE:
            self.counters["unknown_keys"] += 1
            return
        before = self.sysids
        if change.is_alive:
            self._holders[key.sysid].add(key.owner)
        else:
            self._holders[key.sysid].discard(key.owner)
            if not self._holders[key.sysid]:
                self._shown.discard(key.sysid)
            self._forget_frames()
        if self.sysids != before:
            self._on_systems(self.sysids)

    def _sample(self, sample: FabricSample) -> None:
        key = self._connection.keys.parse(sample.key)
        station = None if key is None else self._by_name.get(key.owner)
        if key is None or station is None:
            self.counters["unknown_keys"] += 1
            return
        keys = self._connection.keys
        holders = [keys.drone_token(key.sysid, holder) for holder in self._holders[key.sysid]]
        self._connection.zenoh.note_heard(*holders, is_in_use=True)
        if key.kind is KeyKind.PING:
            ping = Ping.decode(sample.payload)
            if ping is not None:
                pong = Pong(ping.session, ping.sent, micros(self._clock.monotonic()))
                pong_key = keys.pong(key.sysid, station.name)
                self._connection.publish(pong_key, pong.encode(), is_urgent=True)
        elif key.kind is KeyKind.DOWN:
            self._shown.add(key.sysid)
            for raw in split_frames(sample.payload):
                if sender_of(raw) != key.sysid:  # a router's rules name the keys of a gateway
                    self.counters["misdirected_frames"] += 1
                    continue
                self._count_lost(station.received.missing(raw))
                station.channel.forward(raw, is_answer=True)

    def _forget_frames(self) -> None:
        """Count from the next frames on: a gateway begins at 0 again for a station that it lost."""
        for station in self._stations.values():
            station.received = FrameNumbers()

    def _count_lost(self, missing: int) -> None:
        if not missing:
            return
        self.counters["lost_frames"] += missing
        now = self._clock.monotonic()
        if now - self._warned >= WARN_EVERY:
            self._warned = now
            logger.warning("%s: %d frames to stations lost so far", self._url.text, self.counters["lost_frames"])
