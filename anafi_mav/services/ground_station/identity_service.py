"""Identity of a vehicle: AUTOPILOT_VERSION, PROTOCOL_VERSION and its capability bits."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from anafi_mav import __version__
from anafi_mav.drone import Drone
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import char_field
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.capabilities import capability_bits
from anafi_mav.services.commands import Command
from anafi_mav.services.flavours import Flavour, flavour_of
from anafi_mav.services.service import MessageHandler, Request, Service
from anafi_mav.services.version_numbers import version_numbers


def _version(text: str) -> int:
    """ "1.8.2" as MAVLink's four version bytes, the last one 0."""
    major, minor, patch = version_numbers(text)
    return major << 24 | minor << 16 | patch << 8


def _custom_version(firmware: str, flavour: Flavour) -> bytes:
    """The ANAFI's firmware as the stations of a flavour read flight_custom_version."""
    if flavour.text_version:
        return char_field(firmware, 8).ljust(8, b"\0")
    return _version(firmware).to_bytes(4, "little")[1:] + hashlib.sha256(__version__.encode()).digest()[:5]


def autopilot_version(drone: Drone, flavour: Flavour, capabilities: int) -> dialect.MAVLink_message:
    """Return AUTOPILOT_VERSION.

    The serial number is the unique id; its hash is the older 64-bit one. flight_sw_version is the release that the
    flavour follows, middleware_sw_version is anafi-mav's own, os_sw_version the ANAFI's firmware, and so is
    flight_custom_version, which ground stations show.
    """
    identity = drone.identity
    serial = identity.serial.encode()
    firmware = identity.firmware or ""
    major, minor, patch = flavour.version
    return dialect.MAVLink_autopilot_version_message(
        capability_bits(capabilities, flavour),
        major << 24 | minor << 16 | patch << 8 | flavour.version_type,
        _version(__version__),
        _version(firmware),
        identity.model.id,
        _custom_version(firmware, flavour),
        bytes(8),
        bytes(8),
        0x19CF,  # Parrot's USB vendor id
        identity.model.id,
        int.from_bytes(hashlib.sha256(serial).digest()[:8], "little"),
        serial[:18].ljust(18, b"\0"),
    )


def protocol_version() -> dialect.MAVLink_message:
    """Return PROTOCOL_VERSION: MAVLink 1 is accepted, 2 is sent."""
    return dialect.MAVLink_protocol_version_message(200, 100, 200, bytes(8), bytes(8))


class IdentityService(Service):
    """Service that sends the vehicle's identity on request."""

    def requests(self) -> Mapping[int, Request]:
        return {
            dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            dialect.MAVLINK_MSG_ID_PROTOCOL_VERSION: lambda inbound, command: protocol_version(),
        }

    def messages(self) -> Mapping[int, MessageHandler]:
        return {dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION_REQUEST: self._asked}

    def _asked(self, inbound: Inbound) -> None:
        """Answer AUTOPILOT_VERSION_REQUEST, which Mission Planner still sends.

        It is older than MAV_CMD_REQUEST_MESSAGE.
        """
        self.host.send(self._made(inbound), inbound.channel)

    def _version(self, inbound: Inbound, command: Command) -> dialect.MAVLink_message:
        return self._made(inbound)

    def _made(self, inbound: Inbound) -> dialect.MAVLink_message:
        return autopilot_version(self.host.drone, flavour_of(inbound.channel), self.host.capabilities)
