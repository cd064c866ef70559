"""/metrics against Prometheus' own parser."""

from __future__ import annotations

from msgspec.structs import replace
from prometheus_client.parser import text_string_to_metric_families
from support.statuses import CLIENT, STATUS

from anafi_mav.web.metrics import exposition

FAMILIES = {family.name: family for family in text_string_to_metric_families(exposition(STATUS))}
SAMPLES = {
    (sample.name, frozenset(sample.labels.items())): sample.value
    for family in FAMILIES.values()
    for sample in family.samples
}


def value(name: str, **labels: str) -> float:
    return SAMPLES[f"anafi_mav_{name}", frozenset(labels.items())]


def test_metrics_have_the_values_of_the_record_in_base_units() -> None:
    assert value("info", version="1.2.3") == 1.0
    assert value("drone_battery_ratio", drone="alpha", sysid="1") == 0.57
    assert value("drone_in_air", drone="alpha", sysid="1") == 1.0
    assert value("drone_connected", drone="bravo", sysid="2") == 0.0
    assert value("drone_operator", drone="alpha", sysid="1") == 255.0
    assert value("drone_operator", drone="bravo", sysid="2") == 0.0
    assert value("command_seconds", drone="alpha", sysid="1", quantile="0.99") == 0.25
    assert value("loop_delay_seconds", quantile="0.5") == 0.0002
    assert value("commands_total", drone="alpha", sysid="1", result="DENIED") == 1.0
    assert value("endpoint_events_total", endpoint="tcpin://127.0.0.1:5760", event="refused_peers") == 2.0
    assert value("web_refused_total", reason="token") == 5.0


def test_metrics_of_a_peers_name_survive_quotes_and_line_ends() -> None:
    assert value("client_sent_bytes_total", endpoint="tcpin://127.0.0.1:5760", client=CLIENT.name) == 123456.0


def test_unknown_values_have_no_sample() -> None:
    drones = {sample.labels["drone"] for sample in FAMILIES["anafi_mav_drone_battery_ratio"].samples}
    assert drones == {"alpha"}


def test_drone_with_unknown_flying_state_is_not_in_the_air() -> None:
    alpha, bravo = STATUS.drones
    text = exposition(replace(STATUS, drones=(replace(alpha, flying="UNKNOWN"), bravo)))
    assert "anafi_mav_drone_connected" in text
    assert "anafi_mav_drone_in_air" not in text


def test_counters_of_drones_are_not_counted_twice() -> None:
    assert [sample.labels["event"] for sample in FAMILIES["anafi_mav_mavlink_events"].samples] == ["sent_frames"]
    assert value("drone_link_events_total", drone="alpha", sysid="1", event="received") == 900.0


def test_counters_and_gauges_are_declared() -> None:
    kinds = {family.type for family in FAMILIES.values()}
    assert kinds == {"gauge", "counter"}
    assert all(family.documentation for family in FAMILIES.values())
