"""The status of a gateway as one record, for its page, its metrics and `anafi-mav status`.

`gateway_status` makes it; "/status.json" of the web server serves it. It is an interface: a field that a reader may
rely on is only removed or changed together with `VERSION`; readers ignore fields that they do not know. None, or an
empty text, is a value that is not known.
"""

from __future__ import annotations

import msgspec

VERSION = 1

PATH = "/status.json"
"""On the gateway's web server."""


class Quantiles(msgspec.Struct, frozen=True, kw_only=True):
    """Durations of the last minute, or of the last events, ms."""

    count: int = 0
    p50_ms: float | None = None
    p99_ms: float | None = None
    max_ms: float | None = None

    @classmethod
    def of(cls, seconds: list[float]) -> Quantiles:
        """Return the quantiles of some durations, s."""
        if not seconds:
            return cls()
        ordered = sorted(seconds)
        last = len(ordered) - 1
        p50, p99, most = (round(ordered[round(share * last)] * 1000.0, 3) for share in (0.5, 0.99, 1.0))
        return cls(count=len(ordered), p50_ms=p50, p99_ms=p99, max_ms=most)


class ClientStatus(msgspec.Struct, frozen=True, kw_only=True):
    """One peer of an endpoint: a channel."""

    name: str
    """The endpoint's URL and, where it has several peers, which one."""
    systems: tuple[str, ...]
    """Systems heard on it, as "255/190" (system/component)."""
    silence_s: float | None
    """Time since its last frame; None: it has sent none."""
    sent_bytes: int
    received_bytes: int
    dropped_bytes: int
    sent_rate: float
    """Bytes per second that leave to it."""
    received_rate: float
    """Bytes per second that arrive from it."""
    counters: dict[str, int]


class EndpointStatus(msgspec.Struct, frozen=True, kw_only=True):
    """One MAVLink endpoint."""

    url: str
    state: str
    """One line for people."""
    clients: tuple[ClientStatus, ...]
    refused: dict[str, int]
    """Refused peers and messages by reason: of senders that are no client, and of the present clients."""
    counters: dict[str, int]
    """All counters of senders that are no client."""


class RefusedCommand(msgspec.Struct, frozen=True, kw_only=True):
    """A command whose result was not ACCEPTED."""

    age_s: float
    sender: str
    """System and component, as "255/190"."""
    client: str
    """Channel on which it arrived."""
    command: str
    """Name of the MAV_CMD."""
    result: str
    """Name of the MAV_RESULT."""
    reason: str
    """Text that the client received; empty: none."""


class CommandsStatus(msgspec.Struct, frozen=True, kw_only=True):
    """Answered commands of one drone since the start of the gateway."""

    results: dict[str, int]
    """By name of the MAV_RESULT."""
    latency: Quantiles
    """From the arrival to the final acknowledgement of the last accepted commands: the drone's confirmation."""
    refused: tuple[RefusedCommand, ...]
    """The last ones, newest first."""


class DroneStatus(msgspec.Struct, frozen=True, kw_only=True):
    """One drone. State fields are None while it is not connected."""

    name: str
    sysid: int
    address: str
    interface: str | None
    connected: bool
    problem: str
    """Reason why it is not connected; empty while it is."""
    connections: int
    """Since the start of the gateway."""
    model: str
    serial: str
    firmware: str
    has_skycontroller: bool | None
    mode: str | None
    armed: bool | None
    flying: str | None
    """ON_GROUND, TAKEOFF, IN_AIR, LANDING or UNKNOWN."""
    battery_percent: int | None
    gps_fix: bool | None
    satellites: int | None
    height_m: float | None
    """Above the take-off point."""
    radio_quality: int | None
    """1 (poor) to 5 (very good), as the drone reports it."""
    radio_dbm: int | None
    silence_s: float | None
    """Time since its last datagram."""
    stream: str
    """The video stream that it shows; empty: no picture can be watched."""
    viewers: int
    operator: int = 0
    """System id of the station that has the drone by operator control; 0: none, and while it is not connected."""
    secondaries: tuple[int, ...] = ()
    """System ids of the heard stations that may command beside an operator."""
    warnings: tuple[str, ...]
    """Dangerous settings and reasons against a take-off."""
    commands: CommandsStatus
    counters: dict[str, int]
    """Of its link."""


class ServerStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The video server or the web server."""

    url: str
    clients: int
    counters: dict[str, int]


class GatewayStatus(msgspec.Struct, frozen=True, kw_only=True):
    """The whole."""

    version: int
    """Of this record: `VERSION`."""
    program: str
    """Version of anafi-mav."""
    pid: int
    time: float
    """When the record was made, s since 1970 (UTC)."""
    uptime_s: float
    loop_delay: Quantiles
    """How late timers of the event loop were within the last minute."""
    problems: tuple[str, ...]
    """Of the state folder and the recording."""
    drones: tuple[DroneStatus, ...]
    endpoints: tuple[EndpointStatus, ...]
    video: ServerStatus | None
    web: ServerStatus | None
    counters: dict[str, int]
    """All counters, as `Gateway.counters()` has them."""
