"""The public Python API: its list of stable names, and that each is documented with types."""

from __future__ import annotations

import ast
import inspect
import sys
from pathlib import Path

import pytest
from support.python_api import classes, members

from anafi_mav import drone
from anafi_mav.drone import events

EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "python_api").glob("*.py"))

STABLE = """
Aim Alerts AlertsState AnafiMavError Angles Animations AnimationsState Antiflicker Attitude Avoidance Battery
BatteryState Blocker BlockerKind Bracketing Burst Calibration CalibrationState Camera CameraKind CameraMode
CameraState CamerasState Colour CommandRejected CommandTimeout Controller ControllerState Displacement Drone
ExposureMode ExposureSettings Feature FlightLog FlightLogs FlightPlan FlightPlanState FlyingState FollowMe
FollowMeState FrameMetadata Gimbal GimbalAttitude GimbalCalibration GimbalState Gps GpsState HandshakeRefused Home
HomeState Identity
KnownDrone Limits Link LinkLost LinkState LocalProtocolError Location MODELS Media MediaItem MediaState Metering Model
Move MoveEnd Ned NotSupported Notification Palette PhotoFile PhotoFormat PhotoMode PhotoOption PhotoSettings Picture
Piloting PilotingCommand PilotingState Place PlanOnDrone PlayingState Poi PoiState Position Product ProductState
Quaternion Range RecordingMode RecordingOption RecordingSettings Recovery RemoteProtocolError Resolution Resource
Shown Sound SoundState Storage StoragePolicy StorageState Streaming Style StyleSettings Support Thermal ThermalState
Trajectory Velocity Video VideoCodec VideoFrame VideoState WhiteBalance WifiLink connect events
"""
"""Names that programs of others import. Removing or renaming one breaks them: it needs a line in the changelog."""


def test_exported_names_are_the_stable_ones() -> None:
    assert sorted(drone.__all__) == sorted(STABLE.split())


def test_every_exported_name_exists() -> None:
    assert [name for name in drone.__all__ if not hasattr(drone, name)] == []
    assert [name for name in events.__all__ if not hasattr(events, name)] == []


@pytest.mark.parametrize("owner", classes(), ids=lambda owner: owner.__name__)
def test_public_class_and_methods_are_documented_and_typed(owner: type) -> None:
    undocumented = [] if inspect.getdoc(owner) and owner.__doc__ else [owner.__name__]
    untyped = []
    for name, member in members(owner):
        function = member.fget if isinstance(member, property) else member
        if not function.__doc__:
            undocumented.append(f"{owner.__name__}.{name}")
        signature = inspect.signature(function)
        parameters = [one for one in signature.parameters.values() if one.name != "self"]
        if any(one.annotation is one.empty for one in parameters) or signature.return_annotation is signature.empty:
            untyped.append(f"{owner.__name__}.{name}")
    assert undocumented == []
    assert untyped == []


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


def test_python_of_the_guide_compiles() -> None:
    text = (EXAMPLES[0].parents[2] / "docs" / "python-api.md").read_text(encoding="utf-8")
    blocks = [block.split("```")[0] for block in text.split("```python\n")[1:]]
    assert len(blocks) >= 4
    for block in blocks:
        compile(block, "docs/python-api.md", "exec", flags=ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
