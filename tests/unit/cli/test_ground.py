"""`anafi-mav ground`: what it warns about before it opens anything."""

from __future__ import annotations

import pytest
from support.fabric import free_port

from anafi_mav.cli import main


def test_endpoint_for_stations_beyond_loopback_warns_at_start(capsys: pytest.CaptureFixture[str]) -> None:
    """192.0.2.1 is an address of no computer (RFC 5737): nothing is opened by this test."""
    fabric = f"zenoh://127.0.0.1:{free_port()}"
    assert main(["ground", "--zenoh", fabric, "--endpoint", "tcpin://192.0.2.1:5760"]) == 2
    warning, error = capsys.readouterr().err.splitlines()
    assert warning.startswith("anafi-mav: warning: --endpoint: tcpin://192.0.2.1:5760 is open to the network: ")
    assert error.startswith("anafi-mav: --endpoint: cannot open tcpin://192.0.2.1:5760: ")


def test_fabric_as_endpoint_for_stations_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    url = "zenoh://127.0.0.1:7447"
    assert main(["ground", "--zenoh", url, "--endpoint", url]) == 2
    expected = f"anafi-mav: --endpoint: {url}: expected another scheme: zenoh:// is for run, and --zenoh of ground"
    assert capsys.readouterr().err.strip() == expected


def test_endpoint_that_is_given_twice_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Its station would get each message twice, and each of its commands would be published twice."""
    url = "udpout://127.0.0.1:14550"
    assert main(["ground", "--zenoh", f"zenoh://127.0.0.1:{free_port()}", *2 * ("--endpoint", url)]) == 2
    expected = f"anafi-mav: --endpoint: expected an endpoint of its own, {url} is given twice"
    assert capsys.readouterr().err.strip() == expected
