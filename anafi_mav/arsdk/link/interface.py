"""Sockets that use one network interface only.

Every ANAFI is 192.168.42.1 in its own Wi-Fi, every Skycontroller 192.168.53.1. A host with two radios therefore has
two routes to the same address, and the kernel takes the first for all sockets. A socket bound to an interface
(SO_BINDTODEVICE, Linux socket(7)) sends and receives there whatever the routes say, so that two aircraft with one
address are two. Linux allows it to every user since 5.7. The kernel must not check the way back against its routes:
net.ipv4.conf.*.rp_filter has to be 0 or 2.
"""

from __future__ import annotations

import asyncio
import ipaddress
import os
import socket
import sys
from pathlib import Path

from anafi_mav.errors import LinkLost
from anafi_mav.receive_buffer import read_after_clients

ROUTES = Path("/proc/net/route")
_ROUTE_UP = 1

SO_BINDTODEVICE = getattr(socket, "SO_BINDTODEVICE", None)
"""None: this system has no such option (macOS, Windows)."""


def bind_to_interface(sock: socket.socket, interface: str | None) -> None:
    """Let `sock` use this interface only; None: whatever the routes say.

    Raises `LinkLost` when that cannot be: a radio may be plugged in later.
    """
    if interface is None:
        return
    if SO_BINDTODEVICE is None:
        raise LinkLost(f"interface {interface}: this system cannot bind a socket to an interface")
    try:
        sock.setsockopt(socket.SOL_SOCKET, SO_BINDTODEVICE, interface.encode() + b"\0")
    except OSError as error:
        raise LinkLost(f"interface {interface}: {os.strerror(error.errno or 0)}") from error


async def open_connection(
    host: str, port: int, *, local_address: str | None = None, interface: str | None = None
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """A TCP connection over IPv4, which is all that ARSDK knows.

    Raises `OSError`, of which `LinkLost` is one.
    """
    try:
        if interface is None:
            local = None if local_address is None else (local_address, 0)
            reader, writer = await asyncio.open_connection(host, port, family=socket.AF_INET, local_addr=local)
        else:
            reader, writer = await _open_connection(host, port, local_address, interface)
    except UnicodeError as error:  # of a name that no computer can have: Python refuses to look it up
        raise socket.gaierror(socket.EAI_NONAME, f"{host!r} is no host name") from error
    read_after_clients(writer.get_extra_info("socket"))
    return reader, writer


async def _open_connection(
    host: str, port: int, local_address: str | None, interface: str
) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    """Open a connection that uses one interface only."""
    loop = asyncio.get_running_loop()
    found = await loop.getaddrinfo(host, port, family=socket.AF_INET, type=socket.SOCK_STREAM)
    sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        bind_to_interface(sock, interface)
        if local_address is not None:
            sock.bind((local_address, 0))
        await loop.sock_connect(sock, found[0][4])
        return await asyncio.open_connection(sock=sock)
    except BaseException:
        sock.close()
        raise


def networks() -> list[tuple[str, ipaddress.IPv4Network]]:
    """Return the directly connected IPv4 networks, each with its interface.

    Loopback and networks behind routers are not included. Empty where the system is not Linux.
    """
    try:
        lines = ROUTES.read_text().splitlines()[1:]
    except OSError:
        return []
    found = []
    for line in lines:
        interface, destination, gateway, flags, _, _, _, mask, *_ = line.split()
        if int(flags, 16) & _ROUTE_UP and int(gateway, 16) == 0 and int(mask, 16) != 0:
            network = ipaddress.IPv4Network((_address(destination), str(_address(mask))), strict=False)
            found.append((interface, network))
    return found


def _address(text: str) -> ipaddress.IPv4Address:
    """An address as it lies in memory, printed as one number (Linux net/ipv4/fib_trie.c)."""
    return ipaddress.IPv4Address(int(text, 16).to_bytes(4, sys.byteorder))
