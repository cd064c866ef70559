"""Element alerts: what the drone warns about, and what it says keeps it on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import msgspec
from msgspec.structs import replace

from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages import alarms, ardrone3
from anafi_mav.arsdk.messages.alarms import TakeoffChecklistType
from anafi_mav.arsdk.messages.ardrone3 import AlertState, ForcedLandingReason, MotorError, WarningLevel
from anafi_mav.drone.element import Element, Reducer, with_item


class AlertsState(msgspec.Struct, frozen=True):
    """Warnings of the drone, and its own list of what prevents a take-off."""

    alert: AlertState | None = None
    """The one alert of older firmware."""
    alarms: Mapping[alarms.Type, bool] = {}
    """Alarm -> is raised."""
    checklist: Mapping[TakeoffChecklistType, bool] = {}
    """Check -> keeps the drone on the ground."""
    forced_landing: ForcedLandingReason | None = None
    """Why the drone is about to land by itself; NONE when it is not."""
    forced_landing_delay_s: int | None = None
    """Seconds until it does, 0 = now; None while `forced_landing` is NONE."""
    motor_error: MotorError | None = None
    motors: int | None = None
    """The motors `motor_error` is about: bit n is motor n."""
    too_dark_to_hover: bool | None = None
    """No GPS, and too dark for the vertical camera to hold the position."""
    too_high_to_hover: bool | None = None
    """No GPS, and too high for the vertical camera to hold the position."""
    wind: WarningLevel | None = None
    vibration: WarningLevel | None = None
    icing: WarningLevel | None = None


def _forced_landing(state: AlertsState, message: ardrone3.ForcedLandingAutoTrigger) -> AlertsState:
    planned = message.reason != ForcedLandingReason.NONE
    return replace(state, forced_landing=message.reason, forced_landing_delay_s=message.delay if planned else None)


class Alerts(Element[AlertsState]):
    """Warnings that the drone reports.

    No verbs: `Drone.blockers` sums up what prevents a take-off.
    """

    NOTHING = AlertsState()
    REDUCERS: ClassVar[Mapping[type[Message], Reducer]] = {
        ardrone3.AlertStateChanged: lambda state, message: replace(state, alert=message.state),
        alarms.Alarms: lambda state, message: replace(
            state, alarms=with_item(state.alarms, message.type, message.state != 0, message.list_flags)
        ),
        alarms.TakeoffChecklist: lambda state, message: replace(
            state, checklist=with_item(state.checklist, message.check, message.state != 0, message.list_flags)
        ),
        ardrone3.ForcedLandingAutoTrigger: _forced_landing,
        ardrone3.MotorErrorStateChanged: lambda state, message: replace(
            state, motor_error=message.motorError, motors=message.motorIds
        ),
        ardrone3.HoveringWarning: lambda state, message: replace(
            state,
            too_dark_to_hover=message.no_gps_too_dark != 0,
            too_high_to_hover=message.no_gps_too_high != 0,
        ),
        ardrone3.WindStateChanged: lambda state, message: replace(state, wind=message.state),
        ardrone3.VibrationLevelChanged: lambda state, message: replace(state, vibration=message.state),
        ardrone3.IcingLevelChanged: lambda state, message: replace(state, icing=message.state),
    }


def spoken(value: OpenEnum) -> str:
    """Parrot's name of a value as words: MOTOR_RAMPING -> "motor ramping"."""
    return value.name.lower().replace("_", " ")
