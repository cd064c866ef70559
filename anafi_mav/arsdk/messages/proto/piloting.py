"""piloting: speed mode and take-off altitude of the Ai. Metres above the ground."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.envelope import ProtobufEnvelope, ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import BOOL, ENUM, FLOAT, RECORD, Field, Submessage, Wrapped
from anafi_mav.arsdk.codec.wire import OpenEnum

COMMAND = ProtobufEnvelope("arsdk.piloting.Command", "piloting.Command")
EVENT = ProtobufEnvelope("arsdk.piloting.Event", "piloting.Event")


class AssistanceMode(OpenEnum):
    ASSISTED_ATTITUDE = 0
    ASSISTED_ALTITUDE = 1


class Feature(OpenEnum):
    HAND_LAUNCH = 0
    ATTI_MODE = 1


class FlightMode(OpenEnum):
    LOITER = 0
    MANUAL_COPTER = 1
    MANUAL_PLANE = 2


class SpeedMode(OpenEnum):
    NORMAL_SPEED_MODE = 0
    LOW_SPEED_MODE = 1


class TakeoffState(OpenEnum):
    IDLE = 0
    ARMING = 1
    READY = 2
    RESCUE = 3
    UNLOCK = 4
    RAMPING = 5
    ASCENT = 6


class VehicleMode(OpenEnum):
    COPTER = 0
    PLANE = 1


class VehicleType(OpenEnum):
    MULTICOPTER = 0
    VTOL = 1
    HELICOPTER = 2
    PLANE = 3


class SpeedModeValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[SpeedMode, Field(1, ENUM)] = SpeedMode.NORMAL_SPEED_MODE


class AttiMode(Submessage, frozen=True, kw_only=True):
    enabled: Annotated[bool, Field(1, BOOL)] = False


class AssistanceModeValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[AssistanceMode, Field(1, ENUM)] = AssistanceMode.ASSISTED_ATTITUDE


class TakeoffStateValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[TakeoffState, Field(1, ENUM)] = TakeoffState.IDLE


class VehicleTypeValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[VehicleType, Field(1, ENUM)] = VehicleType.MULTICOPTER


class VehicleModeValue(Submessage, frozen=True, kw_only=True):
    value: Annotated[VehicleMode, Field(1, ENUM)] = VehicleMode.COPTER


class FloatRange(Submessage, frozen=True, kw_only=True):
    min: Annotated[float, Field(1, FLOAT)] = 0.0
    max: Annotated[float, Field(2, FLOAT)] = 0.0


@COMMAND.message("GetState", 16)
class GetState(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("GetCapabilities", 17)
class GetCapabilities(ProtobufMessage, frozen=True, kw_only=True):
    pass


@COMMAND.message("SetSpeedMode", 18)
class SetSpeedMode(ProtobufMessage, frozen=True, kw_only=True):
    speed_mode: Annotated[SpeedMode, Field(1, ENUM)] = SpeedMode.NORMAL_SPEED_MODE


@COMMAND.message("SetTakeoffHoveringAltitude", 19)
class SetTakeoffHoveringAltitude(ProtobufMessage, frozen=True, kw_only=True):
    """Metres; the range is in `Capabilities`."""

    altitude: Annotated[float, Field(1, FLOAT)] = 0.0


@COMMAND.message("SetPreferredAttiMode", 20)
class SetPreferredAttiMode(ProtobufMessage, frozen=True, kw_only=True):
    enabled: Annotated[bool, Field(1, BOOL)] = False


@COMMAND.message("StartFlightMode", 21)
class StartFlightMode(ProtobufMessage, frozen=True, kw_only=True):
    value: Annotated[FlightMode, Field(1, ENUM)] = FlightMode.LOITER


@COMMAND.message("SetAssistanceMode", 22)
class SetAssistanceMode(ProtobufMessage, frozen=True, kw_only=True):
    value: Annotated[AssistanceMode, Field(1, ENUM)] = AssistanceMode.ASSISTED_ATTITUDE


@EVENT.message("State", 16)
class State(ProtobufMessage, frozen=True, kw_only=True):
    speed_mode: Annotated[SpeedModeValue | None, Field(1, RECORD)] = None
    takeoff_hovering_altitude: Annotated[float | None, Wrapped(2, FLOAT)] = None
    preferred_atti_mode: Annotated[AttiMode | None, Field(3, RECORD)] = None
    current_atti_mode: Annotated[AttiMode | None, Field(4, RECORD)] = None
    assistance_mode: Annotated[AssistanceModeValue | None, Field(5, RECORD)] = None
    takeoff_state: Annotated[TakeoffStateValue | None, Field(6, RECORD)] = None
    vehicle_type: Annotated[VehicleTypeValue | None, Field(7, RECORD)] = None
    vehicle_mode: Annotated[VehicleModeValue | None, Field(8, RECORD)] = None


@EVENT.message("Capabilities", 17)
class Capabilities(ProtobufMessage, frozen=True, kw_only=True):
    speed_modes: Annotated[tuple[SpeedMode, ...], Field(1, ENUM)] = ()
    supported_features: Annotated[tuple[Feature, ...], Field(2, ENUM)] = ()
    takeoff_hovering_altitude_range: Annotated[FloatRange | None, Field(3, RECORD)] = None
    flight_modes: Annotated[tuple[FlightMode, ...], Field(4, ENUM)] = ()
    assistance_modes: Annotated[tuple[AssistanceMode, ...], Field(5, ENUM)] = ()
    supported_vehicle_modes: Annotated[tuple[VehicleMode, ...], Field(6, ENUM)] = ()
