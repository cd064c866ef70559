"""Finds loopback addresses for simulated drones.

Each drone has an address of its own, with the ports of the aircraft. Where the loopback network is one address (macOS),
the first drone has its usual ports, and each further one free ports.
"""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import os
import socket
from collections.abc import Collection
from typing import NamedTuple

from anafi_mav.arsdk.link.handshake import C2D_PORT, HANDSHAKE_PORT
from anafi_mav.errors import ConfigError

HTTP_PORT, HTTP_PORT_FOR_USERS = 80, 8080
"""The aircraft's web server, and its stand-in where an ordinary user may not open port 80."""
RTSP_PORT, RTSP_PORT_FOR_USERS = 554, 8554
"""The same of its video."""


class Ports(NamedTuple):
    """Ports of a simulated drone: discovery, and the two servers."""

    discovery: int
    http: int
    rtsp: int


SHARED = "127.0.0.1"
"""The one loopback address of every system, on which drones can differ by their ports."""

CANDIDATES = [f"127.0.42.{host}" for host in range(1, 255)] + [SHARED]
"""Addresses for simulated drones that have one of their own."""


def spot(text: str) -> dict[str, str]:
    """Convert an address of the command line to the configuration keys of a drone.

    "192.168.42.1" or "192.168.42.1%wlan1".
    """
    address, percent, interface = text.partition("%")
    return {"address": address, "interface": interface} if percent else {"address": address}


class Reservations(contextlib.ExitStack):
    """Addresses that no other `anafi-mav run` on this machine will choose until this is closed.

    Between choosing an address and the simulator's binding it, another program may choose the same. So each address
    is marked by a UDP socket at the number of its discovery port, where ARSDK has nothing but TCP.
    """

    def choose(
        self,
        key_path: str,
        discovery_port: int,
        http_port: int | None,
        rtsp_port: int | None,
        avoid: Collection[str | None] = (),
    ) -> tuple[str, Ports]:
        """Return the first address whose usual ports are free, else `SHARED`; and the ports there.

        Raises `ConfigError`.
        """
        for address in CANDIDATES:
            if address in avoid:
                continue
            try:
                return address, self.take(address, discovery_port, http_port, rtsp_port)
            except OSError as error:
                if error.errno not in (errno.EADDRINUSE, errno.EADDRNOTAVAIL):
                    raise ConfigError(key_path, f"cannot open ports on {address}: {error.strerror}") from error
        try:
            return SHARED, self._take_free(http_port, rtsp_port)
        except OSError as error:
            raise ConfigError(key_path, f"expected free ports on {SHARED}: {error.strerror}") from error

    def _take_free(self, http_port: int | None, rtsp_port: int | None) -> Ports:
        """Choose free ports on `SHARED` and mark them as ours.

        Raises OSError if a wanted port is taken.
        """
        with contextlib.ExitStack() as probes:
            found = [
                probes.enter_context(_bound(socket.SOCK_STREAM, SHARED, port or 0)).getsockname()[1]
                for port in (None, http_port, rtsp_port)
            ]
        ports = Ports(*found)
        self.enter_context(_bound(socket.SOCK_DGRAM, SHARED, ports.discovery))
        return ports

    def take(self, address: str, discovery_port: int, http_port: int | None, rtsp_port: int | None) -> Ports:
        """Mark `address` as ours; returns its ports.

        Raises OSError if a port is not free.
        """
        with contextlib.ExitStack() as attempt:
            attempt.enter_context(_bound(socket.SOCK_DGRAM, address, discovery_port))
            with _bound(socket.SOCK_DGRAM, address, C2D_PORT):
                for port in (discovery_port, HANDSHAKE_PORT):
                    _bound(socket.SOCK_STREAM, address, port).close()
                found = Ports(
                    discovery_port,
                    _server_port(address, http_port, HTTP_PORT, HTTP_PORT_FOR_USERS),
                    _server_port(address, rtsp_port, RTSP_PORT, RTSP_PORT_FOR_USERS),
                )
            self.push(attempt.pop_all())
        return found

    def take_configured(
        self, key_path: str, address: str, discovery_port: int, http_port: int | None, rtsp_port: int | None
    ) -> Ports:
        """As `take`, for an address that the user wrote down. Raises `ConfigError`."""
        try:
            return self.take(address, discovery_port, http_port, rtsp_port)
        except OSError as error:
            servers = f"{http_port or HTTP_PORT} and {rtsp_port or RTSP_PORT}"
            ports = f"{discovery_port}, {HANDSHAKE_PORT}, {C2D_PORT}, {servers}"
            wanted = f"an address of this machine with free ports {ports}"
            raise ConfigError(key_path, f"expected {wanted}, got {address}: {error.strerror}") from error


def _server_port(address: str, wanted: int | None, usual: int, stand_in: int) -> int:
    """The port that a server may have there: `wanted`, else the usual or its stand-in.

    Raises OSError if taken.
    """
    if wanted is None:
        try:
            _bound(socket.SOCK_STREAM, address, usual).close()
            return usual
        except PermissionError:
            wanted = stand_in
    _bound(socket.SOCK_STREAM, address, wanted).close()
    return wanted


def _bound(kind: socket.SocketKind, address: str, port: int) -> socket.socket:
    """Return a socket bound to the address and port.

    Raises OSError (EADDRINUSE, EADDRNOTAVAIL, EACCES) if they are not available.
    """
    bound = socket.socket(socket.AF_INET, kind)
    try:
        # As asyncio's servers do it: a port is free while old connections fade. On Windows it would be free always.
        if kind is socket.SOCK_STREAM and os.name == "posix":
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((str(ipaddress.IPv4Address(address)), port))
        if kind is socket.SOCK_STREAM:  # with SO_REUSEADDR two may bind on Linux as long as none listens
            bound.listen(1)
    except OSError:
        bound.close()
        raise
    return bound
