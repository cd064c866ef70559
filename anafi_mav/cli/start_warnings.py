"""Warnings at a start: exposure to other computers, and values that are probably not meant."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import NamedTuple

from anafi_mav.config import Config, remarks
from anafi_mav.errors import ConfigError
from anafi_mav.mavlink.base import EndpointUrl
from anafi_mav.mavlink.endpoint import is_open_to_network, is_readable_on_the_way, parse_endpoint
from anafi_mav.mavlink.key_ring import folder_of, has_key
from anafi_mav.relay.uri_host import is_loopback
from anafi_mav.services.flavours import FLAVOURS
from anafi_mav.state_lock import state_folder


class StartWarning(NamedTuple):
    """One line, and the colour in which a terminal shows it."""

    text: str
    style: str = "yellow"


def warnings_of(config: Config) -> Iterator[StartWarning]:
    """Yield the warnings about a gateway's configuration.

    Reads key files; writes nothing.
    """
    for remark in remarks(config):
        yield StartWarning(remark)
    state = state_folder(config.state)
    for index, entry in enumerate(config.endpoints):
        with contextlib.suppress(ConfigError):  # the gateway says what is wrong with it
            url = parse_endpoint(entry, tuple(FLAVOURS))
            is_signed = state is not None and has_key(folder_of(state), url.key_name)
            yield from _of_endpoint(f"endpoints[{index}]: {url.text}", url, is_signed=is_signed)
    http, video = config.http_server, config.video_server
    if http is not None and not is_loopback(http.host):
        yield StartWarning(
            f"http.host: {http.host} is open to the network without TLS: a program on the way can read the token of "
            "the web page; put a reverse proxy with TLS before it"
        )
    if video is not None and not is_loopback(video.host):
        yield StartWarning(
            f"video.host: {video.host} is open to the network without TLS: a program on the way can watch"
        )


def _of_endpoint(name: str, url: EndpointUrl, *, is_signed: bool) -> Iterator[StartWarning]:
    may_fly = url.options.access != "observe"
    if is_open_to_network(url) and not is_signed:
        can = "fly the drones" if may_fly else "read the drones' data"
        yield StartWarning(f"{name} is open to the network without signing: any program that reaches it can {can}")
    if is_readable_on_the_way(url):
        can = "read it and fly the drones" if may_fly and not is_signed else "read it"
        what = f"crosses the network without TLS: a program on the way can {can}; use link=tls"
        yield StartWarning(f"{name} {what}", "red")


def warnings_of_ground(fabric: EndpointUrl, stations: list[EndpointUrl]) -> Iterator[StartWarning]:
    """Yield the warnings about a ground process.

    Keys are the gateways': it knows none.
    """
    yield from _of_endpoint(f"--zenoh: {fabric.text}", fabric, is_signed=False)
    for url in stations:
        if is_open_to_network(url):
            what = "is open to the network: any program that reaches it can fly the drones of gateways without signing"
            yield StartWarning(f"--endpoint: {url.text} {what}")
