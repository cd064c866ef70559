"""Feature 140, controller_info: position of the controller.

The drone uses it to follow the controller or to return to it.
"""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import F32, F64, U8, Bits, Buffer, Message, OpenEnum, command, event


class SupportedCommand(OpenEnum):
    GPS = 0
    GPS_V2 = 1
    BAROMETER_V2 = 2


@command("controller_info.gps", 140, 0, 1, Buffer.NON_ACK)
class Gps(Message, frozen=True):
    latitude: Annotated[float, F64]
    longitude: Annotated[float, F64]
    altitude: Annotated[float, F32]
    """m above mean sea level."""
    horizontal_accuracy: Annotated[float, F32]
    vertical_accuracy: Annotated[float, F32]
    north_speed: Annotated[float, F32]
    east_speed: Annotated[float, F32]
    down_speed: Annotated[float, F32]
    timestamp: Annotated[float, F64]
    """ms of any monotonic clock."""


@command("controller_info.barometer", 140, 0, 2, Buffer.NON_ACK)
class Barometer(Message, frozen=True):
    pressure: Annotated[float, F32]
    timestamp: Annotated[float, F64]


@event("controller_info.validity_from_drone", 140, 0, 3, Buffer.NON_ACK)
class ValidityFromDrone(Message, frozen=True):
    is_valid: Annotated[int, U8]


@event("controller_info.capabilities", 140, 0, 4)
class Capabilities(Message, frozen=True):
    supported_command: Annotated[int, Bits(U8, SupportedCommand)]
