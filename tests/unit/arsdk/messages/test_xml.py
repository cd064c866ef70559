"""Our message tables against Parrot's own XML, which the parrot-olympe wheel carries."""

from __future__ import annotations

import importlib.util
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import anafi_mav.arsdk.messages
from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.link.transport import RETRIED_FOR_EVER


def find_xml() -> Path | None:
    spec = importlib.util.find_spec("arsdk")
    for place in (spec.submodule_search_locations or []) if spec else []:
        folder = Path(place) / "xml"
        if folder.is_dir():
            return folder
    return None


XML = find_xml()
pytestmark = pytest.mark.skipif(
    XML is None, reason="Parrot's XML is not installed: package parrot-olympe (x86-64 Linux, Python < 3.12) has it"
)

REQUIRED = {
    "common.SettingsState": "ProductNameChanged ProductVersionChanged ProductSerialHighChanged ProductSerialLowChanged",
    "common.Common": "Reboot",
    "common.CommonState": (
        "BatteryStateChanged SensorsStatesListChanged CurrentDateTimeChanged LinkSignalQuality BootId FlightId"
    ),
    "common.Mavlink": "Start Pause Stop",
    "common.MavlinkState": "MavlinkFilePlayingStateChanged MissionItemExecuted",
    "common.Calibration": "MagnetoCalibration",
    "common.CalibrationState": (
        "MagnetoCalibrationStateChanged MagnetoCalibrationRequiredState "
        "MagnetoCalibrationAxisToCalibrateChanged MagnetoCalibrationStartedChanged"
    ),
    "common.FlightPlanState": "AvailabilityStateChanged ComponentStateListChanged",
    "common.RunState": "RunIdChanged",
    "ardrone3.Piloting": (
        "TakeOff PCMD Landing Emergency NavigateHome moveBy UserTakeOff moveTo StopPilotedPOI "
        "StartPilotedPOIV2 SmartTakeOffLand"
    ),
    "ardrone3.PilotingSettings": "MaxAltitude MaxTilt MaxDistance NoFlyOverMaxDistance BankedTurn MaxHorizontalSpeed",
    "ardrone3.PilotingState": (
        "FlyingStateChanged NavigateHomeStateChanged PositionChanged SpeedChanged AttitudeChanged "
        "AltitudeChanged GpsLocationChanged moveToChanged MotionState ReturnHomeBatteryCapacity "
        "HoveringWarning ForcedLandingAutoTrigger WindStateChanged VibrationLevelChanged "
        "AltitudeAboveGroundChanged PilotedPOIV2"
    ),
    "ardrone3.PilotingSettingsState": (
        "MaxAltitudeChanged MaxTiltChanged MaxDistanceChanged NoFlyOverMaxDistanceChanged BankedTurnChanged "
        "MaxHorizontalSpeedChanged"
    ),
    "ardrone3.SpeedSettings": "MaxVerticalSpeed MaxRotationSpeed MaxPitchRollRotationSpeed",
    "ardrone3.SpeedSettingsState": "MaxVerticalSpeedChanged MaxRotationSpeedChanged MaxPitchRollRotationSpeedChanged",
    "ardrone3.SettingsState": "MotorErrorStateChanged MotorFlightsStatusChanged",
    "ardrone3.GPSSettingsState": "HomeChanged GPSFixStateChanged",
    "ardrone3.GPSState": "NumberOfSatelliteChanged",
    "ardrone3.PilotingEvent": "moveByEnd",
    "ardrone3.Sound": "StartAlertSound StopAlertSound",
    "ardrone3.SoundState": "AlertSound",
    "skyctrl.SettingsState": "AllSettingsChanged ProductSerialChanged ProductVersionChanged",
    "skyctrl.SkyControllerState": "BatteryChanged BatteryState AttitudeChanged",
    "skyctrl.CoPiloting": "setPilotingSource",
    "skyctrl.CoPilotingState": "pilotingSource",
    "skyctrl.CalibrationState": "MagnetoCalibrationState MagnetoCalibrationQualityUpdatesState",
    "follow_me": "start stop state mode_info target_trajectory target_is_controller",
    "wifi": "rssi_changed",
    "drone_manager": "discover_drones drone_list_item connect forget connection_state known_drone_item",
    "mapper": "grab grab_state grab_button_event grab_axis_event active_product",
    "camera": (
        "camera_capabilities recording_capabilities exposure set_white_balance white_balance "
        "set_ev_compensation ev_compensation set_antiflicker_mode antiflicker_mode set_style style "
        "set_zoom_target zoom_level zoom_info max_zoom_speed set_max_zoom_speed "
        "zoom_velocity_quality_degradation set_zoom_velocity_quality_degradation set_hdr_setting hdr_setting "
        "hdr set_camera_mode camera_mode set_recording_mode recording_mode set_photo_mode photo_mode "
        "set_streaming_mode streaming_mode take_photo photo_progress photo_state start_recording "
        "stop_recording recording_progress recording_state set_autorecord autorecord reset_zoom camera_states "
        "stop_photo next_photo_delay"
    ),
    "user_storage": "info monitor state start_monitoring format_result format_with_type format_progress",
    "rth": (
        "home_type_capabilities home_type preferred_home_type set_preferred_home_type takeoff_location "
        "set_custom_location custom_location return_to_home abort state home_reachability rth_auto_trigger "
        "set_min_altitude min_altitude set_auto_trigger_mode auto_trigger_mode set_ending_behavior "
        "ending_behavior set_ending_hovering_altitude ending_hovering_altitude info home_location"
    ),
    "gimbal": (
        "gimbal_capabilities relative_attitude_bounds max_speed set_max_speed set_target attitude "
        "absolute_attitude_bounds reset_orientation calibration_state calibrate calibration_result alert"
    ),
    "battery": "alert health voltage cycle_count serial temperature capacity cell_voltage",
    "mediastore": "state counters",
    "precise_home": "mode set_mode state",
    "thermal": (
        "set_mode mode set_palette_settings set_rendering rendering set_emissivity set_background_temperature "
        "set_sensitivity set_shutter_mode palette_settings emissivity background_temperature sensitivity "
        "shutter_mode"
    ),
    "piloting_style": "style set_style capabilities",
    "user_storage_v2": "info monitor state start_monitoring format_result format_with_type format_progress",
    "flight_plan": "info waypoint_skipped start_at start_at_v2 capabilities recovery_info",
    "poi": "info",
    "move": "extended_move_to extended_move_by info",
    "obstacle_avoidance": "set_mode status",
    "alarms": "alarms takeoff_checklist",
    "skyctrl.Settings": "AllSettings",
    "skyctrl.Common": "AllStates CurrentDateTime",
    "skyctrl.CommonState": "AllStatesChanged CurrentDateTimeChanged",
    "mission": "custom_msg_enable",
    "animation": "availability state cancel start_horizontal_panorama start_dronie start_spiral",
}
"""What the topics, services and parameters of the seed paper, and Olympe's connection, stand on, by scope."""


@dataclass(frozen=True)
class Argument:
    """An argument as both sides describe it; `names` are the values of its enum or bitfield, from 0 on."""

    name: str
    type: str
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Description:
    """A message as both sides describe it."""

    name: str
    direction: wire.Direction
    buffer: wire.Buffer
    arguments: tuple[Argument, ...]
    retried: bool = field(default=False, compare=False)


def enum_names(element: ElementTree.Element, tag: str) -> tuple[str, ...]:
    return tuple(bare(child.attrib["name"]) for child in element.findall(tag))


def bare(name: str) -> str:
    """A name of an enum value without what differs by spelling habit only: flyingState, FLYING_STATE, _2_4_GHZ."""
    return re.sub(r"[\W_]", "", name).upper()


def parrot_argument(element: ElementTree.Element, enums: dict[str, tuple[str, ...]]) -> Argument:
    name, type = element.attrib["name"], element.attrib["type"]
    if type == "enum":
        return Argument(name, "enum", enum_names(element, "enum"))
    kind, _, rest = type.partition(":")
    if kind == "enum":
        return Argument(name, "enum", enums[rest])
    if kind == "bitfield":
        base, _, enum = rest.partition(":")
        return Argument(name, "bitfield:" + base, enums[enum])
    return Argument(name, type)


def parrot_message(
    element: ElementTree.Element, scope: str, event: bool, enums: dict[str, tuple[str, ...]]
) -> Description:
    return Description(
        f"{scope}.{element.attrib['name']}",
        wire.Direction.EVENT if event else wire.Direction.COMMAND,
        wire.Buffer(element.attrib.get("buffer", "ACK").lower()),
        tuple(parrot_argument(argument, enums) for argument in element.findall("arg")),
        element.attrib.get("timeout") == "RETRY",
    )


def read_parrot() -> dict[wire.MessageId, Description]:
    """Every message of Parrot's."""
    assert XML is not None
    result: dict[wire.MessageId, Description] = {}
    common_enums: dict[str, tuple[str, ...]] = {}
    generic = ElementTree.parse(XML / "generic.xml").getroot()
    common_enums |= {enum.attrib["name"]: enum_names(enum, "value") for enum in generic.iter("enum")}
    for path in sorted(XML.glob("*.xml")):
        root = ElementTree.parse(path).getroot()
        scope, number = root.attrib["name"], int(root.attrib["id"])
        if root.tag == "feature":
            enums = common_enums | {
                enum.attrib["name"]: enum_names(enum, "value") for enum in root.findall("enums/enum")
            }
            for element in root.findall("msgs/*"):
                id = wire.MessageId(number, 0, int(element.attrib["id"]))
                assert id not in result
                result[id] = parrot_message(element, scope, element.tag == "evt", enums)
        else:
            for group in root.findall("class"):
                # A project does not say who sends; the convention is in the name of the class.
                event = group.attrib["name"].endswith(("State", "Event"))
                for element in group.findall("cmd"):
                    id = wire.MessageId(number, int(group.attrib["id"]), int(element.attrib["id"]))
                    assert id not in result
                    result[id] = parrot_message(element, f"{scope}.{group.attrib['name']}", event, {})
    return result


def our_argument(name: str, type: wire.WireType, python: type) -> Argument:
    if isinstance(type, wire.Bits):
        return Argument(name, "bitfield:" + type.base.parrot, value_names(type.names))
    if issubclass(python, wire.OpenEnum):
        return Argument(name, type.parrot, value_names(python))
    return Argument(name, type.parrot)


def value_names(enum: type) -> tuple[str, ...]:
    assert issubclass(enum, wire.OpenEnum)
    members = list(enum)
    assert [int(member) for member in members] == list(range(len(members)))
    return tuple(bare(member.name) for member in members)


def our_message(message: type[wire.Message]) -> Description:
    return Description(
        message.NAME,
        message.DIRECTION,
        message.BUFFER,
        tuple(our_argument(*field) for field in wire.wire_fields(message)),
    )


def declared() -> list[type[wire.Message]]:
    home = anafi_mav.arsdk.messages.__name__
    return [
        message
        for message in wire.declared_messages()
        if message.__module__.startswith(home) and not issubclass(message, ProtobufMessage)
    ]


@pytest.fixture(scope="module")
def parrot() -> dict[wire.MessageId, Description]:
    return read_parrot()


@pytest.mark.parametrize("message", declared(), ids=lambda message: message.NAME)
def test_message_is_as_parrot_describes_it(
    message: type[wire.Message], parrot: dict[wire.MessageId, Description]
) -> None:
    assert our_message(message) == parrot[message.ID]


def test_nothing_is_missing_that_the_aircraft_stands_on() -> None:
    wanted = {f"{scope}.{name}" for scope, names in REQUIRED.items() for name in names.split()}
    assert wanted <= {message.NAME for message in declared()}


def test_commands_without_retry_limit_are_those_of_the_xml(parrot: dict[wire.MessageId, Description]) -> None:
    commands = {id for id, message in parrot.items() if message.retried and message.direction is wire.Direction.COMMAND}
    assert commands == RETRIED_FOR_EVER


def test_the_envelope_of_protobuf_messages_is_generics(parrot: dict[wire.MessageId, Description]) -> None:
    fields = (Argument("service_id", "u16"), Argument("msg_num", "u16"), Argument("payload", "binary"))
    for message in (message for message in wire.declared_messages() if issubclass(message, ProtobufMessage)):
        theirs = parrot[message.ID]
        assert (theirs.direction, theirs.buffer, theirs.arguments) == (message.DIRECTION, message.BUFFER, fields)


def test_the_comparison_saw_something(parrot: dict[wire.MessageId, Description]) -> None:
    assert len(parrot) == 784
    assert len(declared()) > 450
    assert parrot[wire.MessageId(146, 0, 13)].arguments[0].names[:2] == ("AVAILABLE", "INPROGRESS")
