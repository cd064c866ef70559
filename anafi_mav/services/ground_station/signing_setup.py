"""SETUP_SIGNING: a client sets, replaces or removes the signing key of its endpoint.

The message names a system, but the key belongs to the link: it is the endpoint's, whichever system is addressed. It is
accepted over an endpoint that already signs, where only a holder of the key can send it, or over a loopback endpoint,
and only while every drone of the gateway is known to be disarmed. All systems then send a heartbeat with the new key:
QGroundControl waits 5 s for one that verifies (qgroundcontrol#14268). A refusal is a text of severity ERROR that holds
the word "signing", which ends its waiting.
"""

from __future__ import annotations

import logging
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

    def receive(self, inbound: Inbound) -> None:
        """Take one SETUP_SIGNING that is addressed to a system of ours. Its key is never logged."""
        message, channel = inbound.message, inbound.channel
        active = [system for system in self._systems() if system.active]
        answering = next(
            (system for system in active if system.sysid == message.target_system), next(iter(active), None)
        )
        reason = self._refusal(inbound)
        if reason is None:
            assert channel.signing is not None
            secret = bytes(message.secret_key)
            if not channel.signing.is_key(secret):
                reason = self._replace(channel, secret, message.initial_timestamp, inbound.sysid, answering)
        if reason is not None:
            text = texts.REFUSED.fill(what=texts.SIGNING, reason=reason)
            logger.warning("%s: %s", channel.name, text)
            if answering is not None:
                answering.text(Severity.ERROR, text, channel)
            return
        if answering is not None:
            answering.text(Severity.INFO, texts.SIGNING_ON if channel.is_signed else texts.SIGNING_OFF, channel)
        for system in active:
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

    def _replace(
        self, channel: Channel, secret: bytes, timestamp: int, sender: int, answering: SigningSystem | None
    ) -> OperatorText | None:
        """Use another key, and return None or the reason of a failure."""
        signing = channel.signing
        assert signing is not None
        is_key = any(secret)
        text = (texts.SIGNING_KEY_CHANGED if is_key else texts.SIGNING_SWITCHED_OFF).fill(system=sender)

        def announce() -> None:
            # The last that clients without the new key can read.
            for other in self._channels():
                if other.signing is signing and other is not channel and answering is not None:
                    answering.text(Severity.WARNING, text, other)

        try:
            self._keys.replace(signing, secret, timestamp, before_use=announce)
        except OSError as error:
            logger.warning("key %s: %s", signing.name, error.strerror or error)
            return texts.KEY_UNWRITABLE
        logger.warning("key %s: %s, on %s", signing.name, text, channel.name)
        return None
