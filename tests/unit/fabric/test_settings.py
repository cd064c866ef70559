"""The URL of a fabric endpoint, and the settings of its zenoh session."""

from __future__ import annotations

import pytest

from anafi_mav.clock import SystemClock
from anafi_mav.errors import ConfigError
from anafi_mav.fabric.settings import locator, session_settings
from anafi_mav.mavlink.endpoint import is_open_to_network, is_readable_on_the_way, make_endpoint, parse_endpoint

TLS = "zenoh://router.example:7447?link=tls&ca=ca.pem&certificate=me.pem&private_key=me.key"


def test_session_looks_for_no_one_and_listens_nowhere() -> None:
    settings = session_settings(parse_endpoint("zenoh://127.0.0.1:7447"))
    assert settings["mode"] == "client"
    assert settings["connect/endpoints"] == ["tcp/127.0.0.1:7447"]
    assert settings["listen/endpoints"] == []
    assert settings["scouting/multicast/enabled"] is False
    assert settings["scouting/gossip/enabled"] is False


def test_session_listens_where_the_url_says_so() -> None:
    settings = session_settings(parse_endpoint("zenoh://[::1]:7447?listen=true&link=udp"))
    assert (settings["mode"], settings["connect/endpoints"]) == ("peer", [])
    assert settings["listen/endpoints"] == ["udp/[::1]:7447"]


def test_certificates_are_those_of_the_side() -> None:
    settings = session_settings(parse_endpoint(TLS))
    assert settings["connect/endpoints"] == ["tls/router.example:7447"]
    tls = {key.rpartition("/")[2]: value for key, value in settings.items() if "/tls/" in key}
    assert tls == {
        "root_ca_certificate": "ca.pem",
        "connect_certificate": "me.pem",
        "connect_private_key": "me.key",
        "enable_mtls": True,
    }
    listening = session_settings(parse_endpoint(f"{TLS}&listen=true"))
    assert listening["transport/link/tls/listen_certificate"] == "me.pem"


def test_locator_is_zenohs() -> None:
    assert locator(parse_endpoint("zenoh://10.0.0.7:1?link=quic")) == "quic/10.0.0.7:1"


@pytest.mark.parametrize(
    ("url", "readable"),
    [
        ("zenoh://127.0.0.1:7447", False),
        ("zenoh://localhost:7447", False),
        ("zenoh://10.0.0.7:7447", True),
        ("zenoh://0.0.0.0:7447?listen=true", True),
        ("zenoh://10.0.0.7:7447?link=udp", True),
        ("zenoh://10.0.0.7:7447?link=tls", False),
        ("udpin://0.0.0.0:14550", False),
    ],
)
def test_network_without_tls_is_noticed(url: str, readable: bool) -> None:
    assert is_readable_on_the_way(parse_endpoint(url)) is readable


def test_other_end_of_a_router_on_this_computer_is_not_local() -> None:
    url = parse_endpoint("zenoh://127.0.0.1:7447")
    assert not url.is_loopback
    assert not is_open_to_network(url)


@pytest.mark.parametrize(
    ("query", "key"),
    [
        ("prefix=a/*", "prefix"),
        ("prefix=/a", "prefix"),
        ("prefix=", "prefix"),
        ("link=serial", "link"),
        ("ca=ca.pem", "link"),
        ("link=tls&certificate=me.pem", "certificate"),
        ("frames=many", "frames"),
    ],
)
def test_option_that_makes_no_sense_is_refused(query: str, key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_endpoint(f"zenoh://127.0.0.1:7447?{query}")
    assert f" {key}: " in caught.value.problem


def test_program_without_a_fabric_refuses_the_scheme() -> None:
    url = parse_endpoint("zenoh://127.0.0.1:7447")
    with pytest.raises(ConfigError, match="for run, and --zenoh of ground"):
        make_endpoint(url, None, SystemClock())  # type: ignore[arg-type]  # not reached


def test_plus_sign_in_a_file_name_of_a_url_stays() -> None:
    url = parse_endpoint("zenoh://router.example:7447?link=tls&ca=/etc/c++/ca%20one.pem")
    assert url.options.ca == "/etc/c++/ca one.pem"
