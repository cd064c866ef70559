"""Answers to AllStates and AllSettings, which a controller sends when it connects.

Parrot specifies no list; this is what its XML marks "at connection" for the model (a 4K) and what anafi_ros reads
when it starts. The closing AllStatesChanged or AllSettingsChanged is sent by the caller, after all of it.
"""

from __future__ import annotations

from collections.abc import Iterable

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import (
    ardrone3,
    common,
    piloting_style,
    precise_home,
    wifi,
)
from anafi_mav.sim.autopilot.firmware import Firmware
from anafi_mav.sim.autopilot.safety import checklist
from anafi_mav.sim.features.wireless import COUNTRIES, RSSI


def _bits(values: Iterable[int]) -> int:
    return sum(1 << value for value in values)


def all_settings(firmware: Firmware) -> list[Message]:
    """The answer to AllSettings without its closing message."""
    identity, model = firmware.identity, firmware.model
    return [
        common.ProductVersionChanged(model.software, model.hardware),
        common.ProductSerialHighChanged(identity.serial[:4]),
        common.ProductSerialLowChanged(identity.serial[4:]),
        common.BoardIdChanged("simulated"),
        *firmware.settings.report(),
        *firmware.homing.settings_report(),
        ardrone3.GPSFixStateChanged(int(firmware.fix)),
        *(ardrone3.ProductMotorVersionListChanged(motor, "SIM", "1.0", "1.0") for motor in range(1, 5)),
        ardrone3.ProductGPSVersionChanged("1.0", "1.0"),
        ardrone3.MotorSoftwareVersionChanged("1.0"),
        firmware.flights_report(),
        *firmware.warnings.settings_report(),
        wifi.SupportedCountries(";".join(COUNTRIES)),
        wifi.SupportedSecurityTypes(1 << wifi.SecurityType.OPEN | 1 << wifi.SecurityType.WPA2),
    ]


def all_states(firmware: Firmware) -> list[Message]:
    """The answer to AllStates without its closing message."""
    pose = firmware.pose
    return [
        *firmware.battery.states_report(),
        *(common.SensorsStatesListChanged(sensor, int(firmware.sensor_ok(sensor))) for sensor in common.Sensor),
        common.CurrentDateTimeChanged(firmware.datetime),
        common.LinkSignalQuality(5),
        wifi.RssiChanged(RSSI),
        common.BootId(firmware.identity.boot_id),
        common.FlightId(firmware.flight_id),
        common.RunIdChanged(firmware.identity.run_id),
        *firmware.compass.states_report(),
        *firmware.flight_plan.states_report(),
        ardrone3.FlyingStateChanged(firmware.state),
        ardrone3.AlertStateChanged(firmware.alert),
        *firmware.position_report(),
        *firmware.motion_report(),
        ardrone3.AltitudeAboveGroundChanged(pose.up),
        ardrone3.HoveringWarning(0, 0),
        *firmware.endurance.states_report(),
        *firmware.warnings.states_report(),
        *firmware.poi.states_report(),
        ardrone3.NumberOfSatelliteChanged(firmware.satellites),
        ardrone3.AlertSound(firmware.sound),
        *firmware.homing.states_report(),
        *firmware.gimbal.states_report(pose),
        *firmware.payload.states_report(),
        precise_home.Capabilities(_bits(precise_home.PreciseHomeMode)),
        precise_home.State(precise_home.PreciseHomeState.UNAVAILABLE),
        piloting_style.Capabilities(_bits(piloting_style.PilotingStyleStyle)),
        *firmware.animations.states_report(),
        *firmware.follow.states_report(),
        *firmware.alarms.report(),
        *checklist(firmware.blockers()),
    ]
