"""The settings of a zenoh session, from the URL of an endpoint. No I/O.

zenoh's own defaults look for others by multicast and by what peers report, and listen. Here a session connects to the
address in the URL, or listens there, and does nothing else.
"""

from __future__ import annotations

from typing import Any

from anafi_mav.mavlink.base import EndpointUrl

CONNECT_LIMIT_MS = 3000
"""ms of one attempt to connect, at first and after a loss; the next one follows, and between them the session can be
closed. A handshake is three times there and back, with TLS five times. With zenoh's default of 10 s after a loss two
attempts that are not answered are 22 s without drones."""

RETRY = {"period_init_ms": 250, "period_max_ms": 2000, "period_increase_factor": 2}
"""ms between attempts to connect again after a loss."""

WAIT_BEFORE_DROP_US = 250_000
"""µs that the writer waits for a full link before zenoh drops a sample, the newest. Meanwhile our queue drops the
oldest, and counts them."""


def locator(url: EndpointUrl) -> str:
    """Return zenoh's name of the URL's address, like tcp/127.0.0.1:7447."""
    host = f"[{url.place}]" if ":" in url.place else url.place
    return f"{url.options.link}/{host}:{url.number}"


def session_settings(url: EndpointUrl) -> dict[str, Any]:
    """Return zenoh's configuration keys and their values."""
    options, place = url.options, [locator(url)]
    role = "listen" if options.listen else "connect"
    settings: dict[str, Any] = {
        # A client talks to one router. Two peers behind a router would not find each other without gossip.
        "mode": "peer" if options.listen else "client",
        "connect/endpoints": [] if options.listen else place,
        "connect/timeout_ms": CONNECT_LIMIT_MS,
        "connect/exit_on_failure": True,
        "connect/retry": RETRY,
        "transport/unicast/open_timeout": CONNECT_LIMIT_MS,
        "listen/endpoints": place if options.listen else [],
        "listen/exit_on_failure": True,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": WAIT_BEFORE_DROP_US,
    }
    if options.ca is not None:
        settings["transport/link/tls/root_ca_certificate"] = options.ca
    if options.certificate is not None:
        settings[f"transport/link/tls/{role}_certificate"] = options.certificate
        settings["transport/link/tls/enable_mtls"] = True
    if options.private_key is not None:
        settings[f"transport/link/tls/{role}_private_key"] = options.private_key
    return settings
