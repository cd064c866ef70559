"""The status record as Prometheus metrics, in the text exposition format 0.0.4. No I/O.

The format is three lines of rules (HELP, TYPE, samples with escaped labels), which a test holds against Prometheus'
own parser. Names follow its conventions: base units, `_total` for counters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from anafi_mav.status_record import DroneStatus, GatewayStatus, Quantiles

CONTENT_TYPE = "text/plain; version=0.0.4"

PREFIX = "anafi_mav_"


class Sample(NamedTuple):
    """A value with its labels."""

    labels: Mapping[str, object]
    value: float | int | bool | None
    """None: not known, and so not written."""


class Metric(NamedTuple):
    """One metric with all its samples."""

    name: str
    kind: str
    """gauge or counter."""
    help: str
    samples: Iterable[Sample]


def exposition(status: GatewayStatus) -> str:
    """Return the metrics of a status."""
    lines: list[str] = []
    for metric in metrics(status):
        name = PREFIX + metric.name
        samples = [
            f"{name}{_labels(one.labels)} {float(one.value):.17g}" for one in metric.samples if one.value is not None
        ]
        if samples:
            lines += [f"# HELP {name} {metric.help}", f"# TYPE {name} {metric.kind}", *samples]
    return "\n".join([*lines, ""])


def _labels(labels: Mapping[str, object]) -> str:
    if not labels:
        return ""
    return "{" + ",".join(f'{name}="{_escaped(str(value))}"' for name, value in labels.items()) + "}"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace("\n", "\\n").replace('"', '\\"')


def metrics(status: GatewayStatus) -> Iterator[Metric]:
    """Yield each metric of the gateway."""
    yield _gauge("info", "Version of the gateway.", [Sample({"version": status.program}, 1)])
    yield _gauge("uptime_seconds", "Time since the start.", [Sample({}, status.uptime_s)])
    yield _gauge("loop_delay_seconds", "How late timers were in the last minute.", _quantiles({}, status.loop_delay))
    yield _gauge("state_problems", "Problems with state folder and recording.", [Sample({}, len(status.problems))])
    yield from _of_drones([({"drone": drone.name, "sysid": drone.sysid}, drone) for drone in status.drones])
    yield from _of_endpoints(status)
    names = tuple(f"{drone.name}." for drone in status.drones)
    own = {event: count for event, count in status.counters.items() if not event.startswith(names)} if names else {}
    yield _counter("mavlink_events_total", "Counters of all MAVLink endpoints.", _events({}, own))
    if status.video is not None:
        yield _gauge("video_viewers", "Viewers of the video server.", [Sample({}, status.video.clients)])
    if status.web is not None:
        yield _gauge("web_connections", "Open connections of the web server.", [Sample({}, status.web.clients)])
        refused = [Sample({"reason": reason}, count) for reason, count in status.web.counters.items()]
        yield _counter("web_refused_total", "Refused requests of the web server.", refused)


def _of_drones(drones: list[tuple[dict[str, object], DroneStatus]]) -> Iterator[Metric]:
    def each(name: str, text: str, values: Iterable[float | int | bool | None]) -> Metric:
        return _gauge(name, text, [Sample(labels, value) for (labels, _), value in zip(drones, values, strict=True)])

    all_drones = [drone for _, drone in drones]
    yield each("drone_connected", "1 while the drone is connected.", [one.connected for one in all_drones])
    yield _counter(
        "drone_connections_total",
        "Connections to the drone.",
        [Sample(labels, one.connections) for labels, one in drones],
    )
    yield each("drone_armed", "1 while armed.", [one.armed for one in all_drones])
    yield each(
        "drone_in_air",
        "1 while off the ground.",
        [None if one.flying in (None, "UNKNOWN") else one.flying != "ON_GROUND" for one in all_drones],
    )
    yield each(
        "drone_battery_ratio",
        "Charge of the battery.",
        [None if one.battery_percent is None else one.battery_percent / 100.0 for one in all_drones],
    )
    yield each("drone_gps_fix", "1 with a GPS fix.", [one.gps_fix for one in all_drones])
    yield each("drone_satellites", "Satellites in use.", [one.satellites for one in all_drones])
    yield each("drone_height_meters", "Height above the take-off point.", [one.height_m for one in all_drones])
    yield each("drone_radio_quality", "Link quality, 1 (poor) to 5.", [one.radio_quality for one in all_drones])
    yield each("drone_radio_dbm", "Signal strength.", [one.radio_dbm for one in all_drones])
    yield each("drone_silence_seconds", "Time since the last datagram.", [one.silence_s for one in all_drones])
    yield each("drone_warnings", "Dangerous settings and take-off blockers.", [len(one.warnings) for one in all_drones])
    yield each("drone_operator", "System id of the operator; 0: none.", [one.operator for one in all_drones])
    yield each("drone_video_viewers", "Viewers of the drone's video.", [one.viewers for one in all_drones])
    yield _counter(
        "drone_link_events_total",
        "Counters of the drone's present or last connection.",
        [sample for labels, one in drones for sample in _events(labels, one.counters)],
    )
    yield _counter(
        "commands_total",
        "Answered commands by result.",
        [
            Sample({**labels, "result": result}, count)
            for labels, one in drones
            for result, count in one.commands.results.items()
        ],
    )
    yield _gauge(
        "command_seconds",
        "Time from the arrival of an accepted command to its acknowledgement.",
        [sample for labels, one in drones for sample in _quantiles(labels, one.commands.latency)],
    )


def _of_endpoints(status: GatewayStatus) -> Iterator[Metric]:
    endpoints = status.endpoints
    yield _gauge(
        "endpoint_clients",
        "Clients of the endpoint.",
        [Sample({"endpoint": one.url}, len(one.clients)) for one in endpoints],
    )
    yield _counter(
        "endpoint_events_total",
        "Counters of the endpoint, of senders that are no client.",
        [sample for one in endpoints for sample in _events({"endpoint": one.url}, one.counters)],
    )
    clients = [({"endpoint": one.url, "client": client.name}, client) for one in endpoints for client in one.clients]
    for name, text in (
        ("sent_bytes", "Bytes sent to the client."),
        ("received_bytes", "Bytes received from the client."),
        ("dropped_bytes", "Bytes dropped because the client was too slow."),
    ):
        samples = [Sample(labels, getattr(client, name)) for labels, client in clients]
        yield _counter(f"client_{name}_total", text, samples)


def _gauge(name: str, text: str, samples: Iterable[Sample]) -> Metric:
    return Metric(name, "gauge", text, samples)


def _counter(name: str, text: str, samples: Iterable[Sample]) -> Metric:
    return Metric(name, "counter", text, samples)


def _events(labels: Mapping[str, object], counters: Mapping[str, int]) -> list[Sample]:
    return [Sample({**labels, "event": event}, count) for event, count in sorted(counters.items())]


def _quantiles(labels: Mapping[str, object], found: Quantiles) -> list[Sample]:
    pairs = (("0.5", found.p50_ms), ("0.99", found.p99_ms), ("1", found.max_ms))
    return [Sample({**labels, "quantile": quantile}, None if ms is None else ms / 1000.0) for quantile, ms in pairs]
