"""A flight written against Parrot's Olympe alone, as any of its users would write it. Knows nothing of this project.

It says what each step of the flight came to, when it began and ended, and what Olympe believes of the drone.
"""

from __future__ import annotations

import math

from olympe_base import LIMIT, Visit, plain  # isort: skip
from olympe.messages import (
    battery,
    camera,
    camera2,
    common,
    follow_me,
    gimbal,
    mediastore,
    move,
    rth,
    user_storage,
    user_storage_v2,
)
from olympe.messages.ardrone3 import (
    GPSSettingsState,
    GPSState,
    Piloting,
    PilotingEvent,
    PilotingSettings,
    PilotingSettingsState,
    PilotingState,
    SettingsState,
    SoundState,
    SpeedSettings,
    SpeedSettingsState,
)

NORTH, EAST = 9.0, 12.0
"""m from the take-off place to the target of the moveTo: 15 m away."""
METRES_PER_DEGREE = 111_195.0

AT_START = (
    common.SettingsState.ProductNameChanged,
    common.SettingsState.ProductSerialHighChanged,
    common.SettingsState.ProductSerialLowChanged,
    common.SettingsState.ProductVersionChanged,
    common.CommonState.BatteryStateChanged,
    common.CommonState.BootId,
    common.RunState.RunIdChanged,
    common.CalibrationState.MagnetoCalibrationStateChanged,
    common.CalibrationState.MagnetoCalibrationRequiredState,
    common.CalibrationState.MagnetoCalibrationAxisToCalibrateChanged,
    common.CalibrationState.MagnetoCalibrationStartedChanged,
    common.FlightPlanState.AvailabilityStateChanged,
    common.FlightPlanState.ComponentStateListChanged,
    SettingsState.MotorFlightsStatusChanged,
    PilotingSettingsState.MaxTiltChanged,
    PilotingSettingsState.MaxAltitudeChanged,
    PilotingSettingsState.MaxDistanceChanged,
    PilotingSettingsState.NoFlyOverMaxDistanceChanged,
    PilotingSettingsState.BankedTurnChanged,
    SpeedSettingsState.MaxVerticalSpeedChanged,
    SpeedSettingsState.MaxRotationSpeedChanged,
    SpeedSettingsState.MaxPitchRollRotationSpeedChanged,
    PilotingState.FlyingStateChanged,
    PilotingState.NavigateHomeStateChanged,
    PilotingState.PilotedPOIV2,
    GPSSettingsState.GPSFixStateChanged,
    GPSSettingsState.HomeChanged,
    SoundState.AlertSound,
    battery.serial,
    battery.cycle_count,
    battery.health,
    gimbal.absolute_attitude_bounds,
    gimbal.relative_attitude_bounds,
    gimbal.max_speed,
    gimbal.calibration_state,
    mediastore.state,
    follow_me.target_is_controller,
)
"""What anafi_ros asks Olympe for as soon as `connect` has returned; a state that has not come raises there."""


def at_rest() -> object:
    """The drone hovers, now or soon. Expectations are used up by their success, hence one for each use."""
    return PilotingState.FlyingStateChanged(state="hovering", _policy="check_wait", _timeout=LIMIT)


def moved(status: str) -> object:
    return PilotingState.moveToChanged(status=status, _timeout=LIMIT)


class Flight(Visit):
    def last(self, message: object) -> object:
        return plain(dict(self.drone.get_last_event(message).args))

    def of_the_model(self) -> tuple[object, ...]:
        """The same of cameras and card, of which an Ai speaks otherwise."""
        if self.model == "ai":
            return (camera2.Event.CameraList, camera2.Event.State, user_storage_v2.info)
        return (camera.camera_states, camera.camera_capabilities, camera.recording_capabilities, user_storage.info)

    def sticks(self, name: str, roll: int, pitch: int, yaw: int, gaz: int) -> None:
        with self.step(name) as entry:
            entry["ok"] = self.hold(roll, pitch, yaw, gaz)

    def fly(self) -> None:
        self.begin("flight")
        self.settles = True
        result = self.result
        result["missing"] = [
            message.fullName for message in (*AT_START, *self.of_the_model()) if not self.comes_to_know(message)
        ]
        result["known"] = {
            "name": self.state(common.SettingsState.ProductNameChanged),
            "serial_high": self.state(common.SettingsState.ProductSerialHighChanged),
            "serial_low": self.state(common.SettingsState.ProductSerialLowChanged),
            "battery": self.state(common.CommonState.BatteryStateChanged),
            "fix": self.state(GPSSettingsState.GPSFixStateChanged),
            "satellites": self.state(GPSState.NumberOfSatelliteChanged),
            "flying": self.state(PilotingState.FlyingStateChanged),
            "tilt": self.state(PilotingSettingsState.MaxTiltChanged),
            "home": self.state(GPSSettingsState.HomeChanged),
        }

        self.expect("settings", PilotingSettings.MaxTilt(20) & SpeedSettings.MaxRotationSpeed(90))
        self.expect("the same again", PilotingSettings.MaxTilt(20))
        self.expect("beyond the range", PilotingSettings.MaxTilt(60, _timeout=1))
        result["clamped"] = self.state(PilotingSettingsState.MaxTiltChanged)
        self.expect("back", PilotingSettings.MaxTilt(20))

        self.expect(
            "take off", Piloting.TakeOff() >> PilotingState.FlyingStateChanged(state="hovering", _timeout=LIMIT)
        )
        result["home"] = home = self.state(GPSSettingsState.HomeChanged)
        assert isinstance(home, dict)
        here = home["latitude"], home["longitude"]

        self.expect("moveBy", Piloting.moveBy(5, 0, -1, 0, _timeout=LIMIT) >> at_rest())
        result["moveBy"] = self.last(PilotingEvent.moveByEnd)

        latitude = here[0] + NORTH / METRES_PER_DEGREE
        longitude = here[1] + EAST / METRES_PER_DEGREE / math.cos(math.radians(here[0]))
        result["target"] = [latitude, longitude, 6.0]
        self.expect("moveTo", Piloting.moveTo(latitude, longitude, 6.0, "TO_TARGET", 0.0) >> moved("DONE") >> at_rest())
        self.expect(
            "extended_move_to",
            move.extended_move_to(*here, 4.0, "heading_during", 90.0, 4, 2, 60) >> moved("DONE") >> at_rest(),
        )
        turn = math.pi / 2
        self.expect("extended_move_by", move.extended_move_by(4, 2, -1, turn, 3, 1, 60, _timeout=LIMIT) >> at_rest())
        result["extended_move_by"] = self.last(PilotingEvent.moveByEnd)
        far = here[0] + 60 / METRES_PER_DEGREE
        flying = PilotingState.FlyingStateChanged(state="flying", _policy="check_wait", _timeout=LIMIT)
        # Slowly: how much later this program gets to cancel it is up to the machine.
        self.expect("far", move.extended_move_to(far, here[1], 5.0, "none", 0.0, 1, 1, 60) >> flying)
        self.hear(4)  # on a part of the way
        self.expect("cancel", Piloting.CancelMoveTo() >> moved("CANCELED") >> at_rest())

        with self.step("start_piloting") as entry:
            entry["ok"] = bool(self.drone.start_piloting())
        self.sticks("forward", 0, 50, 0, 0)
        self.sticks("right", 50, 0, 0, 0)
        self.sticks("clockwise", 0, 0, 50, 0)
        self.sticks("up", 0, 0, 0, 50)
        with self.step("stop_piloting") as entry:
            self.drone.stop_piloting()  # says False whatever happens: `_stop_piloting_impl` returns nothing (8.5.0)
            entry["ok"] = True

        self.expect("ways of return", rth.set_min_altitude(25.0) & rth.set_ending_behavior("hovering"))
        self.expect("return", rth.return_to_home())
        self.expect(
            "abort",
            rth.abort()
            >> PilotingState.NavigateHomeStateChanged("available", "stopped", _policy="check_wait")
            >> at_rest(),
        )
        self.expect(
            "NavigateHome",
            Piloting.NavigateHome(1) >> rth.state("available", "finished", _timeout=LIMIT) >> at_rest(),
        )
        result["rth"] = self.state(rth.state)
        landed = PilotingState.FlyingStateChanged(state="landed", _timeout=LIMIT)
        counted = SettingsState.MotorFlightsStatusChanged(nbFlights=1, _policy="check_wait", _timeout=LIMIT)
        self.expect("land", Piloting.Landing() >> (landed & counted))
        result["flights"] = self.state(SettingsState.MotorFlightsStatusChanged)
        self.settles = False
