"""Feature 175, alarms and the take-off checklist."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, U8, Bits, Message, OpenEnum, event
from anafi_mav.arsdk.messages.generic import ListFlags


class Type(OpenEnum):
    USER_EMERGENCY = 0
    MOTOR_CUTOUT = 1
    DRONE_INCLINATION_TOO_HIGH = 2
    MAGNETO_PERTURBATION = 3
    MAGNETO_LOW_EARTH_FIELD = 4
    HORIZONTAL_GEOFENCE_REACHED = 5
    VERTICAL_GEOFENCE_REACHED = 6
    FREEFALL_DETECTED = 7
    FSTCAM_DECALIBRATED = 8
    DRI_FAILING = 9
    VIDEO_DSP_FAULT = 10
    PITOT_DEFECTIVE = 11
    AUTOPILOT_INTERNAL_ERROR = 12
    EXTERNAL_AUTOPILOT_ERROR = 13


class TakeoffChecklistType(OpenEnum):
    UPDATE_ONGOING = 0
    GYRO = 1
    MAGNETO = 2
    BARO = 3
    GPS = 4
    ULTRASOUND = 5
    VCAM = 6
    VERTICAL_TOF = 7
    CELLULAR_FLASHING = 8
    DRONE_INCLINATION_TOO_HIGH = 9
    BATTERY_CRITICAL = 10
    BATTERY_IDENTIFICATION = 11
    BATTERY_IS_CONNECTED = 12
    BATTERY_IS_TOO_HOT = 13
    BATTERY_IS_TOO_COLD = 14
    BATTERY_OLD_FW = 15
    MAGNETO_CALIBRATION = 16
    BATTERY_LOST_COMM = 17
    DRI = 18
    MOTOR_DOWN = 19
    NO_SMARTBATTERY = 20
    TAKEOFF_FORBIDDEN_BY_BATTERY = 21
    AUTOPILOT_CONFIGURATION = 22
    PITOT = 23
    AUTOPILOT_UNAVAILABLE = 24


class State(OpenEnum):
    OFF = 0
    ON = 1


@event("alarms.alarms", 175, 0, 1)
class Alarms(Message, frozen=True):
    type: Annotated[Type, ENUM]
    state: Annotated[State, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]


@event("alarms.takeoff_checklist", 175, 0, 2)
class TakeoffChecklist(Message, frozen=True):
    check: Annotated[TakeoffChecklistType, ENUM]
    state: Annotated[State, ENUM]
    list_flags: Annotated[int, Bits(U8, ListFlags)]
