"""Gateway, drone, firmware and dangerous settings as texts for each client.

Sent to each client once after its first message, after a reconnection, and on request. Mission Planner takes the
firmware from a text that begins like ArduCopter's (conformance D3, F 149).
"""

from __future__ import annotations

import logging
from collections.abc import Mapping

from anafi_mav import __version__, texts
from anafi_mav.clock import NEVER
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.commands import Command
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.service import Host, Query, Service
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity
from anafi_mav.vehicle.failsafe_settings import warnings_of

logger = logging.getLogger(__name__)

GREET_AFTER = 1.5
"""s from a client's first message to its banner.

QGroundControl creates its vehicle on the first heartbeat, and shows texts only after that.
"""

PILOT_IN_CONTROL = (
    texts.SKYCONTROLLER_IN_CONTROL,
    texts.SKYCONTROLLER_WARNS_ONLY,
)
"""First texts behind a Skycontroller: what a client must not rely on."""


def banner(drone: Drone, flavour: Flavour) -> list[OperatorText]:
    """The texts: the gateway, and the drone with its firmware."""
    identity = drone.identity
    return [
        texts.BANNER_FLAVOUR.fill(title=flavour.title, version=__version__)
        if flavour.title
        else texts.BANNER.fill(version=__version__),
        texts.BANNER_DRONE.fill(model=identity.model.title, serial=identity.serial, firmware=identity.firmware),
    ]


class BannerService(Service):
    """Sends the banner to each client once, some time after its first message.

    A station that has just found a vehicle does not show texts yet.
    """

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._due: dict[Channel, float] = {}
        """When a channel is to be greeted."""

    def queries(self) -> Mapping[int, Query]:
        return {dialect.MAV_CMD_DO_SEND_BANNER: self._banner}

    def link_up(self) -> None:
        for text in self._failsafe_warnings():  # the clients get theirs with the banner
            logger.warning("%s: %s", self.host.drone.name, text)
        now = self.host.clock.monotonic()
        self._due = dict.fromkeys(self.host.heard_channels(), now + GREET_AFTER)

    def channel_closed(self, channel: Channel) -> None:
        self._due.pop(channel, None)

    def client_appeared(self, channel: Channel, now: float) -> None:
        self._due.setdefault(channel, now + GREET_AFTER)

    def tick(self, now: float) -> float:
        if not self._due:
            return NEVER
        listening = self.host.channels  # one that pays for each byte is greeted when it takes telemetry again
        for channel in [channel for channel, at in self._due.items() if now >= at and channel in listening]:
            del self._due[channel]
            self._greet(channel)
        return min((at for channel, at in self._due.items() if channel in listening), default=NEVER)

    def _greet(self, channel: Channel) -> None:
        if self.host.drone.controller.present:
            for text in PILOT_IN_CONTROL:
                self.host.text(Severity.WARNING, text, channel)
        for text in self.host.notices:
            self.host.text(Severity.CRITICAL, text, channel)
        for text in (*self.host.vehicle.standing_warnings, *self._failsafe_warnings()):
            self.host.text(Severity.WARNING, text, channel)
        for text in banner(self.host.drone, flavour_of(channel)):
            self.host.text(Severity.INFO, text, channel)

    def _failsafe_warnings(self) -> list[OperatorText]:
        return [warning.text for warning in warnings_of(self.host.drone, self.host.failsafe_limits)]

    def _banner(self, inbound: Inbound, command: Command) -> int:
        self._due.pop(inbound.channel, None)
        self._greet(inbound.channel)
        return dialect.MAV_RESULT_ACCEPTED
