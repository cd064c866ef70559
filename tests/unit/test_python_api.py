"""The public Python API: its list of stable names, and that each is documented with types."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

from anafi_mav import drone
from anafi_mav.drone import events

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "python_api").glob("*.py"))

STABLE = """
Aim Alerts AlertsState AnafiMavError Angles Animations AnimationsState Antiflicker Attitude Avoidance Battery
BatteryState Blocker BlockerKind Bracketing Burst Calibration CalibrationState Camera CameraKind CameraMode CameraState
CamerasState Colour CommandRejected CommandTimeout Controller ControllerState Displacement Drone ExposureMode
ExposureSettings Feature FlightPlan FlightPlanState FlyingState FollowMe FollowMeState FrameMetadata Gimbal
GimbalAttitude GimbalState Gps GpsState Home HomeState Identity KnownDrone Limits Link LinkLost LinkState
LocalProtocolError Location MODELS Media MediaItem MediaState Metering Model Move MoveEnd Ned NotSupported Notification
Palette PhotoFile PhotoFormat PhotoMode PhotoOption PhotoSettings Picture Piloting PilotingCommand PilotingState Place
PlanOnDrone PlayingState Poi PoiState Position Product ProductState Quaternion Range RecordingMode RecordingOption
RecordingSettings Recovery RemoteProtocolError Resolution Resource Shown Sound SoundState Storage StorageState Streaming
Style StyleSettings Support Thermal ThermalState Trajectory Velocity Video VideoFrame VideoState WhiteBalance WifiLink
connect events
"""
"""Names that programs of others import. Removing or renaming one breaks them: it needs a line in the changelog."""


def test_exported_names_are_the_stable_ones() -> None:
    assert sorted(drone.__all__) == sorted(STABLE.split())


def test_every_exported_name_exists() -> None:
    assert [name for name in drone.__all__ if not hasattr(drone, name)] == []
    assert [name for name in events.__all__ if not hasattr(events, name)] == []


def test_package_ships_its_types() -> None:
    assert (Path(drone.__file__).parents[1] / "py.typed").is_file()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_example_imports_stable_names_only(path: Path) -> None:
    """A newcomer copies it: what it uses of the package has to be what stays."""
    stable = {"anafi_mav.drone": set(drone.__all__), "anafi_mav.drone.events": set(events.__all__)}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert all(alias.name.partition(".")[0] in sys.stdlib_module_names for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            if node.module.partition(".")[0] not in sys.stdlib_module_names:
                assert {alias.name for alias in node.names} <= stable[node.module]
