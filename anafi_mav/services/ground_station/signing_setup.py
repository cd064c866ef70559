"""SETUP_SIGNING: a client sets, replaces or removes the signing key of its endpoint.

The message names a system, but the key belongs to the link: it is the endpoint's, whichever system is addressed. It is
accepted over an endpoint that already signs, where only a holder of the key can send it, or over a loopback endpoint,
and only while every drone of the gateway is known to be disarmed. All systems then send a heartbeat with the new key:
QGroundControl waits 5 s for one that verifies (qgroundcontrol#14268). A refusal is a text of severity ERROR that holds
the word "signing", which ends its waiting.

The key's file is written by the thread of files. What it depends on is looked at again before the key is used, and
further SETUP_SIGNING wait: they are answered one after the other.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from anafi_mav import texts
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.key_ring import KeyRing
from anafi_mav.mavlink.node import Inbound
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.vehicle import Vehicle

logger = logging.getLogger(__name__)

MAX_WAITING = 16
"""Messages that wait while a key is written: each station sends one or two."""


class SigningSystem(Protocol):
    """A MAVLink system of the gateway, as far as its endpoints' keys concern it."""

    sysid: int
    active: bool
    vehicle: Vehicle

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        """Send a STATUSTEXT to one channel."""

    def send_heartbeat(self) -> None:
        """Send a HEARTBEAT to all."""


class SigningSetup:
    """Decides about each SETUP_SIGNING and performs it."""

    def __init__(
        self, keys: KeyRing, channels: Callable[[], Sequence[Channel]], systems: Callable[[], Sequence[SigningSystem]]
    ) -> None:
        self._keys = keys
        self._channels = channels
        self._systems = systems
        self._waiting: deque[Inbound] = deque()
        self._replacing: asyncio.Task[None] | None = None

    def receive(self, inbound: Inbound) -> None:
        """Take one SETUP_SIGNING that is addressed to a system of ours. Its key is never logged."""
        if self._replacing is None:
            self._take(inbound)
        elif len(self._waiting) < MAX_WAITING:
            self._waiting.append(inbound)
        else:
            logger.warning("%s: Signing refused: too many keys wait", inbound.channel.endpoint)

    async def settle(self) -> None:
        """Wait until each message has its answer."""
        while self._replacing is not None:
            await asyncio.wait([self._replacing])

    async def close(self) -> None:
        """End a change that waits for the disk: the old key remains."""
        self._waiting.clear()
        if self._replacing is not None:
            self._replacing.cancel()
            await asyncio.wait([self._replacing])

    def _take(self, inbound: Inbound) -> None:
        reason, channel = self._refusal(inbound), inbound.channel
        if reason is None and channel.signing is not None and not channel.signing.is_key(_secret(inbound)):
            self._replacing = asyncio.get_running_loop().create_task(self._replace(inbound))
        else:
            self._answer(inbound, reason)

    def _active(self) -> list[SigningSystem]:
        return [system for system in self._systems() if system.active]

    def _answering(self, inbound: Inbound) -> SigningSystem | None:
        active, target = self._active(), inbound.message.target_system
        return next((system for system in active if system.sysid == target), next(iter(active), None))

    def _answer(self, inbound: Inbound, reason: OperatorText | None) -> None:
        """Send the text of a refusal, or the text and the heartbeats of the key in use (None)."""
        channel, answering = inbound.channel, self._answering(inbound)
        if reason is not None:
            text = texts.REFUSED.fill(what=texts.SIGNING, reason=reason)
            # By the endpoint, not by the client: one line in five seconds, from however many addresses.
            logger.warning("%s: %s", channel.endpoint, text)
            logger.debug("%s: %s", channel.name, text)
            if answering is not None:
                answering.text(Severity.ERROR, text, channel)
            return
        if answering is not None:
            answering.text(Severity.INFO, texts.SIGNING_ON if channel.is_signed else texts.SIGNING_OFF, channel)
        for system in self._active():
            system.send_heartbeat()

    def _refusal(self, inbound: Inbound) -> OperatorText | None:
        channel = inbound.channel
        if not inbound.is_permitted:
            return texts.ACCESS_TOO_LOW.fill(access=channel.access.name.lower())
        if channel.signing is None:
            return texts.NO_KEY_FOLDER
        if not channel.is_signed and not channel.is_local:
            return texts.REMOTE_AND_UNSIGNED
        for system in self._systems():
            if system.vehicle.armed:
                return texts.SYSTEM_ARMED.fill(system=system.sysid)
            if system.vehicle.flying_state is None:  # it may fly: the gateway may have been restarted in flight
                return texts.SYSTEM_UNKNOWN.fill(system=system.sysid)
        return None

    async def _replace(self, inbound: Inbound) -> None:
        """Use another key, answer, and go on with the messages that waited."""
        try:
            reason = await self._stored(inbound)
            self._answer(inbound, reason)
        finally:
            self._replacing = None
            while self._waiting and self._replacing is None:
                self._take_late(self._waiting.popleft(), inbound)

    def _take_late(self, inbound: Inbound, before: Inbound) -> None:
        """Take a message that waited.

        It is judged as if it arrived now, when the key that let it in may have been replaced.
        """
        signing = inbound.channel.signing
        is_replaced = signing is before.channel.signing and signing is not None and signing.is_key(_secret(before))
        if is_replaced and _secret(inbound) != _secret(before):
            logger.warning("%s: Signing refused: another key has been set", inbound.channel.name)
        else:
            self._take(inbound)

    async def _stored(self, inbound: Inbound) -> OperatorText | None:
        """Store a key and use it; return None, or the reason for which the old one remains."""
        channel, secret = inbound.channel, _secret(inbound)
        signing = channel.signing
        assert signing is not None
        text = (texts.SIGNING_KEY_CHANGED if any(secret) else texts.SIGNING_SWITCHED_OFF).fill(system=inbound.sysid)
        reason: OperatorText | None = None

        def before_use() -> bool:
            """Look again, and announce the key: the last that clients without it can read."""
            nonlocal reason
            reason = self._refusal(inbound)
            answering = self._answering(inbound)
            for other in self._channels() if reason is None else ():
                if other.signing is signing and other is not channel and answering is not None:
                    answering.text(Severity.WARNING, text, other)
            return reason is None

        try:
            if await self._keys.replace(signing, secret, inbound.message.initial_timestamp, before_use=before_use):
                logger.warning("key %s: %s, on %s", signing.name, text, channel.name)
        except OSError as error:
            logger.warning("key %s: %s", signing.name, error.strerror or error)
            return texts.KEY_UNWRITABLE
        return reason


def _secret(inbound: Inbound) -> bytes:
    return bytes(inbound.message.secret_key)
