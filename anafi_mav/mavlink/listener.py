"""Base class of the endpoints that wait for clients: who may connect, and who gives way."""

from __future__ import annotations

import asyncio
import ipaddress
import logging
from abc import abstractmethod
from typing import Any, ClassVar

from anafi_mav.clock import Clock
from anafi_mav.mavlink.base import Endpoint, EndpointUrl, Sink
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.peer_table import PeerTable, PlaceLog

logger = logging.getLogger(__name__)

SWEEP_EVERY = 5.0
"""s between looks for idle clients."""

MAX_LOGGED = 64
"""Refused addresses that are logged, each once: an address is easily made up, and a log is read by people."""


class Listener(Endpoint):
    """An endpoint with clients that come and go."""

    IDLE_LIMIT: ClassVar[float]
    """s of silence after which a client is dropped by default."""
    IDLE_LEVEL: ClassVar[int]
    """The level at which that is logged."""

    def __init__(self, url: EndpointUrl, sink: Sink, clock: Clock) -> None:
        super().__init__(url, sink, clock)
        limit = url.options.idle_limit
        self._table: PeerTable[Any] = PeerTable(
            url.options.max_clients,
            self.IDLE_LIMIT if limit is None else limit,
            lambda peer: self._channel_of(peer).proved_at,
        )
        self._refused: set[str] = set()
        self._place_log = PlaceLog(logger, self.url)
        self._sweep: asyncio.TimerHandle | None = None

    @abstractmethod
    def _drop(self, peer: Any) -> None:
        """End the channel of a client and free its place."""

    @abstractmethod
    def _channel_of(self, peer: Any) -> Channel:
        """Return the channel of a client that has a place."""

    @abstractmethod
    def _shown(self, peer: Any) -> str:
        """Return the address of a client, for people."""

    def expire(self, now: float) -> None:
        """Drop the clients that have been silent for too long."""
        for peer in self._table.idle(now):
            self.counters["idle_peers"] += 1
            silence = self._table.silence(peer, now)
            logger.log(self.IDLE_LEVEL, "%s: %s dropped: silent for %.0f s", self.url, self._shown(peer), silence)
            self._drop(peer)

    def _start_sweep(self) -> None:
        self._sweep = asyncio.get_running_loop().call_later(SWEEP_EVERY, self._sweep_now)

    def _sweep_now(self) -> None:
        self.expire(self._clock.monotonic())
        self._start_sweep()

    def _stop_sweep(self) -> None:
        if self._sweep is not None:
            self._sweep.cancel()
            self._sweep = None

    def _is_allowed(self, host: str) -> bool:
        """True when this address may connect.

        A refusal is counted, and logged once for each address.
        """
        networks = self.parsed.options.networks
        if networks is None:
            return True
        address = ipaddress.ip_address(host.partition("%")[0])
        if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped is not None:
            address = address.ipv4_mapped
        if any(address in network for network in networks):
            return True
        self.counters["refused_addresses"] += 1
        if host not in self._refused and len(self._refused) < MAX_LOGGED:
            self._refused.add(host)
            logger.warning("%s: %s refused: not one of allowed_peers", self.url, host)
        return False

    def _make_room(self, name: str, now: float, *, known: bool) -> bool:
        """Return True if there is a place for a client, after one of its kind has given way."""
        if not self._table.is_full(known=known):
            return True
        other = self._table.replaceable(now, known=known)
        if other is None:
            self.counters["refused_peers"] += 1
            self._place_log.warn("refused", f"{name} refused: all {len(self._table)} places are taken", now)
            return False
        self.counters["evicted_peers"] += 1
        silence = self._table.silence(other, now)
        kind = "known" if known else "unknown"
        self._place_log.warn(kind, f"{name} replaces {self._shown(other)}, silent for {silence:.0f} s", now)
        self._drop(other)
        return True
