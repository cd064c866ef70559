"""Feature 168, poi: point of interest."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import U32, Bits, Message, OpenEnum, event


class Indicator(OpenEnum):
    DRONE_GPS = 0
    DRONE_MAGNETO = 1
    DRONE_GEOFENCE = 2
    DRONE_MIN_ALTITUDE = 3
    DRONE_MAX_ALTITUDE = 4
    DRONE_FLYING = 5
    TARGET_POSITION_ACCURACY = 6
    TARGET_IMAGE_DETECTION = 7
    DRONE_TARGET_DISTANCE_MIN = 8
    DRONE_TARGET_DISTANCE_MAX = 9
    TARGET_HORIZ_SPEED = 10
    TARGET_VERT_SPEED = 11
    TARGET_ALTITUDE_ACCURACY = 12
    DRONE_BATTERY = 13
    DRONE_STATE = 14


@event("poi.info", 168, 0, 1)
class Info(Message, frozen=True):
    missing_inputs: Annotated[int, Bits(U32, Indicator)]
