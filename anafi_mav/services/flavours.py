"""Flavours: the autopilot as which the gateway appears to a client.

The flight core is one; names and numbers differ.

A channel keeps its flavour until it closes. PX4 is what QGroundControl and MAVSDK get the most from, ArduPilot is
what MAVProxy, dronekit and Mission Planner were written for, standard is MAVLink's own autopilot-neutral way, which
few clients know (conformance E1, E3, E4).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.channel import Channel
from anafi_mav.vehicle.base.modes import FlightMode

PX4_BITS = 1 << 16
"""Lowest mode number that is one of PX4's packed ones, in any flavour (conformance E5)."""


def _whole(number: float) -> int | None:
    """Return the mode number in a parameter; None when the value is no such number."""
    if not math.isfinite(number) or number != int(number) or not 0 <= number < 1 << 32:
        return None
    return int(number)


def px4_number(main: int, sub: int) -> int:
    """Return PX4's packed mode number: main mode in bits 16..23, sub mode in bits 24..31.

    Source: PX4-Autopilot src/modules/commander/px4_custom_mode.h.
    """
    return main << 16 | sub << 24


@dataclass(frozen=True)
class Flavour:
    """Presentation of the neutral flight core as an autopilot of one family."""

    name: str
    """As in the URL of an endpoint."""
    autopilot: int
    """MAV_AUTOPILOT of the heartbeat."""
    numbers: Mapping[FlightMode, int]
    """custom_mode of each mode."""
    modes: Mapping[int, FlightMode]
    """Modes that a client may select by number.

    Not every mode that is shown is among them, and some are shown as another.
    """
    version: tuple[int, int, int]
    """The release whose behaviour is followed: major, minor, patch."""
    version_type: int
    """FIRMWARE_VERSION_TYPE."""
    mode_names: Mapping[FlightMode, str]
    """The modes that clients are shown by AVAILABLE_MODES, by their names and in their order."""
    packed_modes: bool
    """custom_mode is a main mode in bits 16..23 and a sub mode in bits 24..31. DO_SET_MODE may name the two as param2
    and param3, HIGH_LATENCY2 has room for the upper half alone. Otherwise it is one number below 65536."""
    parameter_names: str
    """The table of names by which clients know parameters, in `parameter_service.NAME_TABLES`."""
    rssi_full: int
    """RC_CHANNELS.rssi of a perfect link (conformance A6, F 134)."""
    bytewise: bool
    """Parameters: an INT32 travels as the bits of the float field; otherwise as the float of equal value."""
    relative_frames_are_amsl: bool
    """The z of some commands (`commands.Altitude.AMSL`) is above mean sea level in the frames 3 and 6 too: MAVSDK sends
    it so, as PX4 takes it (conformance B1)."""
    zero_home: bool = False
    """Item 0 of a mission is home."""
    float_plans: bool = False
    """Items of plans are requested with MISSION_REQUEST, which clients of this family answer in either form; otherwise
    with MISSION_REQUEST_INT."""
    always_continues: bool = False
    """True when a mission continues after each item.

    autocontinue 0 means 1, and is read back as 1 (ArduPilot; PX4 stops there).
    """
    partial_plans: bool = False
    """Clients replace single items of a plan (MISSION_WRITE_PARTIAL_LIST)."""
    relative_takeoff: bool = False
    """The height of a take-off command counts from the ground, whatever else the command says."""
    zero_is_unset: bool = False
    """Clients of this family send 0 for what they do not set; NaN elsewhere."""
    guided_setpoints: bool = False
    """Setpoints fly the drone in mode Guided, without a mode of their own."""
    unstreamed: frozenset[int] = frozenset()
    """Message ids that a client of this family gets on change and on request only, not at an interval by default."""
    first_answer_as_final: bool = False
    """Clients of this family take the first acknowledgement of a calibration or a restart for the final one.
    dronekit2's tests count exactly one, Mission Planner waits up to 25 s for it."""
    joystick_overrides: bool = False
    """A stick that leaves the middle takes the drone over from what flies it (PX4's COM_RC_OVERRIDE)."""
    data_streams: bool = False
    """REQUEST_DATA_STREAM sets rates. PX4 ignores it, and MAVProxy would slow a PX4 down by it."""
    camera_at_autopilot: bool = False
    """Component 1 carries out camera commands as well, for camera id 0 or 1: clients of this family address them there.
    """
    packed_files: bool = False
    """Parameters and plans are also files (`@PARAM/param.pck` and others). PX4's clients do not look for them."""
    text_version: bool = False
    """flight_custom_version of AUTOPILOT_VERSION is 8 characters; otherwise bytes 2, 1, 0 are major, minor, patch, and
    behind them is a hash of the release (QGroundControl InitialConnectStateMachine.cc)."""
    sik_radio: bool = False
    """RADIO_STATUS is read as a SiK radio's register, 1.9 a dB above -127 dBm (Mission Planner CurrentState.cs), and
    255 is unknown; otherwise as a signed number of dBm (QGroundControl RadioStatusFactGroup.cc), and 0 is unknown."""
    gimbal_keeps_horizon: bool = False
    """Clients of this family set no lock of the gimbal, and mean pitch and roll to the horizon; otherwise an axis
    without a lock follows the body."""
    loiter_command: bool = False
    """MAV_CMD_NAV_LOITER_UNLIM enters Loiter where the vehicle is (ArduCopter GCS_MAVLink_Copter.cpp). Mission
    Planner's action Loiter_Unlim and pymavlink's set_mode_loiter send it."""
    relative_long_regions: bool = False
    """Altitudes of regions of interest in a COMMAND_LONG count from the take-off point (ArduPilot, as MAVProxy's pull
    request 1154 says; dronekit sends them so); otherwise they are above mean sea level."""
    station_position_leads: bool = False
    """In mode Follow a station sends its GLOBAL_POSITION_INT as the target (QGroundControl APMFirmwarePlugin.cc,
    ArduCopter AP_Follow.cpp); otherwise only FOLLOW_TARGET."""
    base_mode_in_custom0: bool = False
    """HIGH_LATENCY2.custom0 is HEARTBEAT.base_mode, as a signed byte."""
    first_log_id: int = 0
    """Id of the oldest flight log. QGroundControl and Mission Planner count an ArduPilot's logs from 1."""
    title: str = ""
    """Name of the autopilot in its banner; empty: none."""

    @property
    def guided_mode(self) -> FlightMode:
        """The mode of a vehicle that a client of this family has sent to a place."""
        return FlightMode.GUIDED if self.guided_setpoints else FlightMode.HOLD

    def custom_mode(self, mode: FlightMode) -> int:
        """Return the custom_mode of a heartbeat in this mode."""
        return self.numbers[mode]

    def mode_of_number(self, number: int) -> FlightMode | None:
        """Return the mode that a custom_mode selects; None when we do not have it.

        For SET_MODE, and for DO_SET_MODE in one number.
        """
        if number >= PX4_BITS:
            return _PX4_MODES.get(number)
        return self.modes.get(number)

    def mode_of_parameters(self, main: float, sub: float) -> FlightMode | None:
        """Return the mode that MAV_CMD_DO_SET_MODE names with param2 and param3.

        Returns None for a mode that we do not have. `packed_modes`: below 256 param2 is the main mode and param3 the
        sub mode
        (NaN = 0). All flavours: from 65536 on param2 is a packed number of PX4's. Otherwise param2 is the mode's
        number
        (conformance E5).
        """
        number = _whole(main)
        if number is None:
            return None
        if self.packed_modes and number < PX4_BITS:
            part = 0 if math.isnan(sub) else _whole(sub)
            if part is None or number > 0xFF or part > 0xFF:
                return None
            number = px4_number(number, part)
        return self.mode_of_number(number)


_PX4_NUMBERS = {
    FlightMode.POSITION: px4_number(3, 0),
    FlightMode.ORBIT: px4_number(3, 1),
    FlightMode.TAKEOFF: px4_number(4, 2),
    FlightMode.HOLD: px4_number(4, 3),
    FlightMode.GUIDED: px4_number(4, 3),
    FlightMode.MISSION: px4_number(4, 4),
    FlightMode.RETURN: px4_number(4, 5),
    FlightMode.LAND: px4_number(4, 6),
    FlightMode.FOLLOW: px4_number(4, 8),
    FlightMode.OFFBOARD: px4_number(6, 0),
    FlightMode.TERMINATED: px4_number(10, 0),
}
_PX4_MODES = {
    number: mode
    for mode, number in _PX4_NUMBERS.items()
    if mode not in (FlightMode.GUIDED, FlightMode.ORBIT)  # shown as another, and entered by a command only
}

_PX4_NAMES = {
    mode: mode.value
    for mode in (
        FlightMode.POSITION,
        FlightMode.HOLD,
        FlightMode.MISSION,
        FlightMode.RETURN,
        FlightMode.LAND,
        FlightMode.TAKEOFF,
        FlightMode.OFFBOARD,
        FlightMode.FOLLOW,
        FlightMode.ORBIT,
        FlightMode.TERMINATED,
    )
}

_OLD_GIMBAL = frozenset({dialect.MAVLINK_MSG_ID_MOUNT_ORIENTATION})
"""Clients of the gimbal protocol, version 2, read GIMBAL_DEVICE_ATTITUDE_STATUS."""

PX4 = Flavour(
    name="px4",
    autopilot=dialect.MAV_AUTOPILOT_PX4,
    numbers=_PX4_NUMBERS,
    modes=_PX4_MODES,
    mode_names=_PX4_NAMES,
    packed_modes=True,
    parameter_names="px4",
    rssi_full=100,
    version=(1, 16, 0),
    # A development build: of an official one that is older than the newest QGroundControl says so in a dialog at each
    # connect (FirmwarePlugin::checkIfIsLatestStable), in either family. It shows "1.16.0dev" for it.
    version_type=dialect.FIRMWARE_VERSION_TYPE_DEV,
    bytewise=True,
    relative_frames_are_amsl=True,
    unstreamed=_OLD_GIMBAL,
    joystick_overrides=True,
)

# Numbers of ArduCopter/mode.h. Its Brake is our Hold: it stops, and no client's setpoints or sticks move the drone.
_BRAKE, _LOITER, _POSHOLD, _GUIDED = 17, 5, 16, 4
_COPTER_NUMBERS = {
    FlightMode.POSITION: _LOITER,
    FlightMode.ORBIT: 7,
    FlightMode.TAKEOFF: _GUIDED,
    FlightMode.HOLD: _BRAKE,
    FlightMode.GUIDED: _GUIDED,
    FlightMode.MISSION: 3,
    FlightMode.RETURN: 6,
    FlightMode.LAND: 9,
    FlightMode.FOLLOW: 23,
    FlightMode.OFFBOARD: _GUIDED,
    FlightMode.TERMINATED: _BRAKE,
}

_COPTER_NAMES = {
    FlightMode.POSITION: "Loiter",
    FlightMode.HOLD: "Brake",
    FlightMode.GUIDED: "Guided",
    FlightMode.MISSION: "Auto",
    FlightMode.RETURN: "RTL",
    FlightMode.LAND: "Land",
    FlightMode.FOLLOW: "Follow",
    FlightMode.ORBIT: "Circle",
}
"""ArduCopter's names."""

ARDUPILOT = Flavour(
    name="ardupilot",
    autopilot=dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
    numbers=_COPTER_NUMBERS,
    modes={
        3: FlightMode.MISSION,
        _GUIDED: FlightMode.GUIDED,
        _LOITER: FlightMode.POSITION,
        6: FlightMode.RETURN,
        9: FlightMode.LAND,
        _POSHOLD: FlightMode.POSITION,
        _BRAKE: FlightMode.HOLD,
        20: FlightMode.GUIDED,  # GUIDED_NOGPS takes attitudes alone, and ours takes them with or without GPS
        21: FlightMode.RETURN,  # SMART_RTL: an ANAFI has one way home
        23: FlightMode.FOLLOW,
    },
    mode_names=_COPTER_NAMES,
    packed_modes=False,
    parameter_names="ardupilot",
    rssi_full=254,
    version=(4, 5, 7),
    version_type=dialect.FIRMWARE_VERSION_TYPE_DEV,
    bytewise=False,
    relative_frames_are_amsl=False,
    zero_home=True,
    float_plans=True,
    always_continues=True,
    partial_plans=True,
    relative_takeoff=True,
    zero_is_unset=True,
    guided_setpoints=True,
    first_answer_as_final=True,
    data_streams=True,
    camera_at_autopilot=True,
    packed_files=True,
    text_version=True,
    sik_radio=True,
    gimbal_keeps_horizon=True,
    loiter_command=True,
    relative_long_regions=True,
    station_position_leads=True,
    base_mode_in_custom0=True,
    first_log_id=1,
    # ArduCopter sends home when it is set; programs take one that arrives later for news (dronekit2's own tests).
    unstreamed=frozenset({dialect.MAVLINK_MSG_ID_HOME_POSITION}),
    title="ArduCopter V4.5.7",
)

STANDARD = Flavour(
    name="standard",
    autopilot=dialect.MAV_AUTOPILOT_GENERIC,
    numbers=_PX4_NUMBERS,
    modes=_PX4_MODES,
    mode_names=_PX4_NAMES,
    packed_modes=True,
    parameter_names="px4",
    rssi_full=100,
    version=PX4.version,
    version_type=PX4.version_type,
    bytewise=True,
    relative_frames_are_amsl=True,
    unstreamed=_OLD_GIMBAL,
    relative_takeoff=True,  # MAVSDK's "pure" path sends the height above ground (conformance F 156)
)

FLAVOURS = {flavour.name: flavour for flavour in (PX4, ARDUPILOT, STANDARD)}
"""By the name in the URL of an endpoint. Another one is another record here; nothing asks which flavour it is."""


STANDARD_MODES: dict[FlightMode, int] = {
    FlightMode.POSITION: dialect.MAV_STANDARD_MODE_POSITION_HOLD,
    FlightMode.ORBIT: dialect.MAV_STANDARD_MODE_ORBIT,
    FlightMode.RETURN: dialect.MAV_STANDARD_MODE_SAFE_RECOVERY,
    FlightMode.MISSION: dialect.MAV_STANDARD_MODE_MISSION,
    FlightMode.LAND: dialect.MAV_STANDARD_MODE_LAND,
    FlightMode.TAKEOFF: dialect.MAV_STANDARD_MODE_TAKEOFF,
}
"""MAV_STANDARD_MODE of each mode, the same in all flavours; what is missing is non-standard (conformance A3)."""

_BY_STANDARD: dict[float, FlightMode] = {
    number: mode for mode, number in STANDARD_MODES.items() if mode is not FlightMode.ORBIT
}


def mode_of_standard(number: float) -> FlightMode | None:
    """Return the mode that MAV_CMD_DO_SET_STANDARD_MODE selects; None when it cannot.

    We do not have the mode then, or a command of its own begins it.
    """
    return _BY_STANDARD.get(number)


def flavour_of(channel: Channel) -> Flavour:
    """Return the flavour of a channel's endpoint; PX4 when its URL names none."""
    return FLAVOURS[channel.options.flavour or PX4.name]


def by_flavour(channels: Sequence[Channel]) -> Sequence[tuple[Flavour, Sequence[Channel]]]:
    """Return each flavour with its channels.

    Channels of one flavour stay in the list that they are in.
    """
    names = {channel.options.flavour or PX4.name for channel in channels}
    if len(names) == 1:
        return [(FLAVOURS[names.pop()], channels)]
    groups: dict[str, tuple[Flavour, list[Channel]]] = {}
    for channel in channels:
        flavour = flavour_of(channel)
        groups.setdefault(flavour.name, (flavour, []))[1].append(channel)
    return list(groups.values())
