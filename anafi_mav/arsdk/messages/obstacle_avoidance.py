"""Feature 172, obstacle_avoidance (Ai)."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, U16, U32, Bits, Message, OpenEnum, command, event


class Mode(OpenEnum):
    DISABLED = 0
    STANDARD = 1


class State(OpenEnum):
    INACTIVE = 0
    ACTIVE = 1
    DEGRADED = 2


class Availability(OpenEnum):
    UNAVAILABLE = 0
    AVAILABLE = 1
    DEGRADED = 2


class Alert(OpenEnum):
    HIGH_DEVIATION = 0
    STUCK = 1
    STEREO_FAILURE = 2
    STEREO_LENS_FAILURE = 3
    GIMBAL_FAILURE = 4
    TOO_DARK = 5
    ESTIMATION_UNRELIABLE = 6
    CALIBRATION_FAILURE = 7
    POOR_GPS = 8
    STRONG_WIND = 9
    COMPUTATIONAL_ERROR = 10
    BLIND_MOTION_DIRECTION = 11
    FREEZE = 12
    STEREO_UNAVAILABLE = 13


@command("obstacle_avoidance.set_mode", 172, 0, 1)
class SetMode(Message, frozen=True):
    mode: Annotated[Mode, ENUM]


@event("obstacle_avoidance.status", 172, 0, 2)
class Status(Message, frozen=True):
    mode: Annotated[Mode, ENUM]
    state: Annotated[State, ENUM]
    availability: Annotated[Availability, ENUM]


@event("obstacle_avoidance.alerts", 172, 0, 3)
class Alerts(Message, frozen=True):
    alerts: Annotated[int, Bits(U16, Alert)]


@event("obstacle_avoidance.alert_timer", 172, 0, 4)
class AlertTimer(Message, frozen=True):
    alert: Annotated[Alert, ENUM]
    timer: Annotated[int, U32]
