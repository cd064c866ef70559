"""Makes the status record of a gateway from drones, systems, endpoints and servers.

    report = StatusReport(node, clock)
    report.start()
    report.gateway([...], problems=[...])

The page, the metrics and `anafi-mav status` show what is in the record (`status_record`) and nothing else.
"""

from __future__ import annotations

import asyncio
import math
import os
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from anafi_mav import __version__
from anafi_mav.clock import Clock
from anafi_mav.drone import Drone
from anafi_mav.mav_enums import enums
from anafi_mav.mavlink.base import Endpoint
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Node
from anafi_mav.relay.server import RelayServer
from anafi_mav.services.commands import CommandLog
from anafi_mav.services.system import System
from anafi_mav.status_record import (
    VERSION,
    ClientStatus,
    CommandsStatus,
    DroneStatus,
    EndpointStatus,
    GatewayStatus,
    Quantiles,
    RefusedCommand,
    ServerStatus,
)
from anafi_mav.vehicle.failsafe_settings import warnings_of
from anafi_mav.web.server import HttpServer

RATE_EVERY = 2.0
"""s over which the rates of clients are averaged: long enough for a message that leaves once a second."""

MAX_SYSTEMS = 20
"""Systems of one client that are listed: a router brings a fleet."""


REFUSALS = {
    "refused_addresses": "address not in allowed_peers",
    "refused_peers": "all places taken",
    "refused_browsers": "HTTP or TLS of a browser, not MAVLink",
    "refused_access": "message beyond the access of the endpoint",
    "refused_observer": "message of an observer to another endpoint",
    "refused_systems": "message to a system that the endpoint does not reach",
    "refused_operator": "message while another station is the operator",
    "refused_unsigned": "frame without a signature",
    "refused_signature": "wrong signature",
    "refused_replay": "frame with an old time stamp",
    "refused_unsaved": "frame with a time stamp that is not saved yet",
    "refused_forwards": "frame that the endpoint must not sign",
    "withheld_frames": "frames to a peer that has not proved its address",
    "late_frames": "frame too old on arrival",
    "repeated_samples": "sample repeated or out of order",
    "misdirected_frames": "frame for another system than its key's",
    "bad_envelopes": "sample without a valid envelope",
}
"""Counter of an endpoint or a channel: reason of the refusal, for people."""


class ReportedDrone(NamedTuple):
    """One drone of the gateway, as the record needs it."""

    name: str
    sysid: int
    address: str
    interface: str | None
    problem: str
    connections: int
    drone: Drone
    system: System


class StatusReport:
    """Makes the record, and measures rates. `start` and `stop` once each."""

    def __init__(self, node: Node, clock: Clock) -> None:
        self._node = node
        self._clock = clock
        self._started = clock.monotonic()
        self._sampled = self._started
        self._totals: dict[Channel, tuple[int, int]] = {}
        self._rates: dict[Channel, tuple[float, float]] = {}
        """Bytes per second to and from each channel."""
        self._timer: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Begin to measure rates."""
        self._sample()

    def stop(self) -> None:
        """Stop measuring. Idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _sample(self) -> None:
        now = self._clock.monotonic()
        elapsed = now - self._sampled
        totals = {channel: (channel.sent_bytes, channel.received_bytes) for channel in self._node.channels}
        if elapsed > 0.0:
            self._rates = {
                channel: ((sent - before[0]) / elapsed, (received - before[1]) / elapsed)
                for channel, (sent, received) in totals.items()
                for before in (self._totals.get(channel, (0, 0)),)
            }
        self._totals, self._sampled = totals, now
        self._timer = asyncio.get_running_loop().call_later(RATE_EVERY, self._sample)

    def gateway(
        self,
        drones: Iterable[ReportedDrone],
        *,
        problems: Sequence[str],
        counters: Counter[str],
        relay: RelayServer | None,
        web: HttpServer | None,
    ) -> GatewayStatus:
        """Return the record as of now."""
        now = self._clock.monotonic()
        return GatewayStatus(
            version=VERSION,
            program=__version__,
            pid=os.getpid(),
            time=round(time.time(), 3),
            uptime_s=round(now - self._started, 1),
            loop_delay=Quantiles.of(self._node.loop_delays()),
            problems=tuple(str(problem) for problem in problems),
            drones=tuple(self.drone(drone, relay) for drone in drones),
            endpoints=tuple(self._endpoint(endpoint, now) for endpoint in self._node.endpoints),
            video=None
            if relay is None
            else ServerStatus(
                url=f"rtsp://{relay.host}:{relay.port}/",
                clients=relay.viewers,
                counters={"sessions": relay.sessions, "refused_token": relay.refused["token"]},
            ),
            web=None
            if web is None
            else ServerStatus(url=web.describe(), clients=web.connections, counters=dict(web.refused)),
            counters=dict(counters),
        )

    def _endpoint(self, endpoint: Endpoint, now: float) -> EndpointStatus:
        mine = [one for one in self._node.channels if one.endpoint == endpoint.url]
        closed = self._node.closed_counters(endpoint.url)
        refused: Counter[str] = Counter()
        for counters in (endpoint.counters, closed, *(channel.counters + channel.parser.counters for channel in mine)):
            refused.update({REFUSALS[name]: count for name, count in counters.items() if name in REFUSALS})
        return EndpointStatus(
            url=endpoint.shown_url,
            state=f"{endpoint.describe()}{endpoint.signing_note}",
            refused=dict(refused),
            clients=tuple(self._client(channel, now) for channel in mine),
            counters=dict(endpoint.counters),
        )

    def _client(self, channel: Channel, now: float) -> ClientStatus:
        sent_rate, received_rate = self._rates.get(channel, (0.0, 0.0))
        sources = self._node.sources(channel)[:MAX_SYSTEMS]
        return ClientStatus(
            name=channel.name,
            systems=tuple(f"{sysid}/{compid}" for sysid, compid in sources),
            silence_s=None if channel.heard_at is None else round(now - channel.heard_at, 1),
            sent_bytes=channel.sent_bytes,
            received_bytes=channel.received_bytes,
            dropped_bytes=channel.dropped_bytes,
            sent_rate=round(sent_rate, 1),
            received_rate=round(received_rate, 1),
            counters=dict(channel.counters + channel.parser.counters),
        )

    def drone(self, reported: ReportedDrone, relay: RelayServer | None) -> DroneStatus:
        """Return the record of one drone as of now."""
        now = self._clock.monotonic()
        drone, system = reported.drone, reported.system
        known, connected = drone.identity, system.active
        source = None if relay is None else relay.source(str(reported.sysid))
        vehicle = system.vehicle
        warnings: list[str] = [str(text) for text in system.notices]
        if connected:
            warnings += [str(warning.text) for warning in warnings_of(drone, system.failsafe_limits)]
            warnings += [f"take-off refused: {blocker}" for blocker in drone.takeoff_blockers()]
        altitude, silence = drone.piloting.state.altitude, drone.silent_for
        return DroneStatus(
            name=reported.name,
            sysid=reported.sysid,
            address=reported.address,
            interface=reported.interface,
            connected=connected,
            problem="" if connected else str(reported.problem) or "no answer yet",
            connections=reported.connections,
            model=known.model.title if known.serial else "",
            serial=known.serial,
            firmware=known.firmware or "",
            has_skycontroller=drone.controller.present if connected else None,
            mode=vehicle.mode.value if connected else None,
            armed=vehicle.armed if connected else None,
            flying=vehicle.landed.name if connected else None,
            battery_percent=drone.battery.state.percent if connected else None,
            gps_fix=drone.gps.state.fixed if connected else None,
            satellites=drone.gps.state.satellites if connected else None,
            height_m=round(altitude, 1) if connected and altitude is not None and math.isfinite(altitude) else None,
            radio_quality=drone.link.state.quality if connected else None,
            radio_dbm=drone.link.state.rssi_dbm if connected else None,
            silence_s=None if silence is None or not connected else round(silence, 2),
            stream=drone.streams.shown.kind.value if connected and source is not None else "",
            viewers=0 if source is None else source.viewers,
            operator=vehicle.operators.operator if connected else 0,
            secondaries=tuple(vehicle.operators.shown_secondaries(now)) if connected else (),
            warnings=tuple(warnings),
            commands=_commands([component.commands.log for component in system.components], now),
            counters=dict(drone.counters),
        )


def _commands(logs: Sequence[CommandLog], now: float) -> CommandsStatus:
    results: Counter[int] = Counter()
    for log in logs:
        results.update(log.results)
    refusals = sorted((refusal for log in logs for refusal in log.refusals), key=lambda one: -one.at)
    return CommandsStatus(
        results={_named("MAV_RESULT", result): count for result, count in sorted(results.items())},
        latency=Quantiles.of([duration for log in logs for duration in log.durations]),
        refused=tuple(
            RefusedCommand(
                age_s=round(now - refusal.at, 1),
                sender=f"{refusal.sysid}/{refusal.compid}",
                client=refusal.client,
                command=_named("MAV_CMD", refusal.command),
                result=_named("MAV_RESULT", refusal.result),
                reason=str(refusal.reason),  # an operator text, which has no JSON
            )
            for refusal in refusals
        ),
    )


def _named(enum: str, number: int) -> str:
    """Return the name of an entry of a MAVLink enum without the enum's own, or its number."""
    entry = enums[enum].get(number)
    return str(number) if entry is None else entry.name.removeprefix(f"{enum}_")
