"""Angles, rates, signs and frames of the gimbal's messages, by hand."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence

import pytest

from anafi_mav import geo, texts, units
from anafi_mav.drone import Aim, GimbalAttitude, GimbalState
from anafi_mav.drone.events import Axis, FrameOfReference
from anafi_mav.drone.payload.gimbal import Angles
from anafi_mav.mavlink import dialect
from anafi_mav.services.gimbal import mount, targets
from anafi_mav.services.gimbal.gimbal_messages import mount_orientation, pictured_rotation
from anafi_mav.services.gimbal.targets import Frames, GimbalTarget
from anafi_mav.services.stream import Times
from anafi_mav.vehicle.base.geo_point import GeoPoint

ABSOLUTE, RELATIVE = FrameOfReference.ABSOLUTE, FrameOfReference.RELATIVE
NAN = math.nan
ROLL_LOCK, PITCH_LOCK, YAW_LOCK = (
    dialect.GIMBAL_MANAGER_FLAGS_ROLL_LOCK,
    dialect.GIMBAL_MANAGER_FLAGS_PITCH_LOCK,
    dialect.GIMBAL_MANAGER_FLAGS_YAW_LOCK,
)
EARTH, VEHICLE = dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME, dialect.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME


def frames(flags: int = 0, *, locks_horizon: bool = False, heading: float | None = 90.0) -> Frames:
    return Frames(flags, locks_horizon, heading)


@pytest.mark.parametrize(
    ("flags", "locks_horizon", "held"),
    [(0, False, RELATIVE), (0, True, ABSOLUTE), (PITCH_LOCK, False, ABSOLUTE), (YAW_LOCK, False, RELATIVE)],
)
def test_pitch_keeps_its_sign_and_its_lock_decides_the_frame(
    flags: int, locks_horizon: bool, held: FrameOfReference
) -> None:
    target = targets.read(frames(flags, locks_horizon=locks_horizon), {Axis.PITCH: -30.0}, {})
    assert target == GimbalTarget({Axis.PITCH: Aim(-30.0, held)})


@pytest.mark.parametrize(
    ("flags", "given", "aim"),
    [
        # The nose heads east (90 deg).
        (0, 20.0, Aim(20.0, RELATIVE)),
        (YAW_LOCK, 20.0, Aim(20.0, ABSOLUTE)),
        (VEHICLE, 20.0, Aim(20.0, RELATIVE)),
        (VEHICLE | YAW_LOCK, 20.0, Aim(110.0, ABSOLUTE)),
        (EARTH, 110.0, Aim(20.0, RELATIVE)),
        (EARTH | YAW_LOCK, 110.0, Aim(110.0, ABSOLUTE)),
        (VEHICLE | YAW_LOCK, 120.0, Aim(-150.0, ABSOLUTE)),
        (0, 180.0, Aim(180.0, RELATIVE)),
    ],
)
def test_yaw_is_given_in_one_frame_and_held_in_another(flags: int, given: float, aim: Aim) -> None:
    assert targets.read(frames(flags), {Axis.YAW: given}, {}) == GimbalTarget({Axis.YAW: aim})


@pytest.mark.parametrize(
    ("flags", "angles", "rates", "reason"),
    [
        (dialect.GIMBAL_MANAGER_FLAGS_RETRACT, {Axis.PITCH: 0.0}, {}, texts.NO_RETRACT),
        (EARTH | VEHICLE, {Axis.YAW: 0.0}, {}, texts.TWO_YAW_FRAMES),
        (0, {Axis.PITCH: NAN}, {Axis.PITCH: NAN}, texts.NOTHING_ASKED),
        (0, {Axis.PITCH: -4500.0}, {}, texts.GIMBAL_ANGLE),
        (0, {}, {Axis.PITCH: 2000.0}, texts.GIMBAL_RATE),
        (EARTH, {Axis.YAW: 0.0}, {}, texts.HEADING_UNKNOWN),
    ],
)
def test_target_that_cannot_be_is_refused(
    flags: int, angles: Mapping[Axis, float], rates: Mapping[Axis, float], reason: object
) -> None:
    assert targets.read(frames(flags, heading=None), angles, rates) == reason


def test_angle_of_an_axis_replaces_its_rate() -> None:
    both = {Axis.PITCH: 1.0, Axis.YAW: 2.0}
    target = targets.read(frames(), {Axis.PITCH: -30.0}, both)
    assert target == GimbalTarget({Axis.PITCH: Aim(-30.0, RELATIVE)}, {Axis.YAW: Aim(2.0, RELATIVE)})


def single(values: Sequence[float]) -> tuple[float, ...]:
    """The same numbers in the single precision of a message."""
    return struct.unpack(f"<{len(values)}f", struct.pack(f"<{len(values)}f", *values))


@pytest.mark.parametrize("yaw", [-170.0, -30.0, 0.0, 30.0, 75.0])
@pytest.mark.parametrize("roll", [-20.0, 0.0, 20.0])
@pytest.mark.parametrize("pitch", [-116.0, -89.0, -45.0, 0.0, 45.0, 89.0, 150.0])
def test_quaternion_gives_the_angles_of_a_gimbal(roll: float, pitch: float, yaw: float) -> None:
    q = single(units.quaternion_from_euler(*(angle * units.RAD_PER_DEG for angle in (roll, pitch, yaw))))
    assert targets.of_quaternion(q) == pytest.approx({Axis.ROLL: roll, Axis.PITCH: pitch, Axis.YAW: yaw}, abs=0.01)


@pytest.mark.parametrize("pitch", [-90.0, 90.0])
@pytest.mark.parametrize("yaw", [-170.0, -30.0, 0.0, 30.0, 75.0])
def test_quaternion_straight_down_or_up_has_no_roll(pitch: float, yaw: float) -> None:
    q = single(units.quaternion_from_euler(0.0, pitch * units.RAD_PER_DEG, yaw * units.RAD_PER_DEG))
    assert targets.of_quaternion(q) == pytest.approx({Axis.ROLL: 0.0, Axis.PITCH: pitch, Axis.YAW: yaw}, abs=0.1)


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 0.0), (NAN, 0.0, 0.0, 1.0)])
def test_quaternion_that_is_no_rotation_gives_none(q: tuple[float, ...]) -> None:
    assert targets.of_quaternion(q) is None


def test_manual_control_is_a_share_of_range_and_speed() -> None:
    ranges = {Axis.PITCH: (-116.0, 176.0), Axis.YAW: (-48.0, 48.0)}
    speeds = {Axis.PITCH: 90.0, Axis.YAW: 60.0}

    def read(*shares: float) -> object:
        message = dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, 0, 1, *shares)
        return targets.from_manual(message, frames(), ranges, speeds)

    assert read(-0.5, 0.5, NAN, NAN) == GimbalTarget({Axis.PITCH: Aim(-58.0, RELATIVE), Axis.YAW: Aim(24.0, RELATIVE)})
    assert read(NAN, NAN, 0.1, -0.5) == GimbalTarget(
        rates={Axis.PITCH: Aim(9.0, RELATIVE), Axis.YAW: Aim(-30.0, RELATIVE)}
    )
    assert read(1.1, NAN, NAN, NAN) == texts.GIMBAL_SHARE


def test_manual_yaw_that_is_locked_to_north_is_a_share_of_the_range_from_the_nose() -> None:
    """Half of 48 deg to the right of a nose at 170 deg is 194 deg from north."""
    message = dialect.MAVLink_gimbal_manager_set_manual_control_message(1, 1, YAW_LOCK, 1, NAN, 0.5, NAN, NAN)
    target = targets.from_manual(message, frames(YAW_LOCK, heading=170.0), {Axis.YAW: (-48.0, 48.0)}, {})
    assert target == GimbalTarget({Axis.YAW: Aim(-166.0, ABSOLUTE)})


@pytest.mark.parametrize(("id", "is_ours"), [(0, True), (NAN, True), (1, True), (154, True), (2, False), (171, False)])
def test_device_ids_that_mean_the_gimbal(id: float, is_ours: bool) -> None:
    assert targets.is_device(id) is is_ours


def test_mount_reads_places_in_both_units() -> None:
    place = GeoPoint(48.8789, 2.3677)
    assert mount.point(48.8789, 2.3677) == place
    far = mount.point(488789000.0, 23677000.0)
    assert far is not None
    assert geo.distance(*far, *place) < 0.01
    assert mount.point(NAN, 2.0) is None


def test_direction_of_a_path_to_the_east_and_up() -> None:
    there = geo.destination(48.8789, 2.3677, 0.0, 30.0)
    bearing, elevation = mount.direction(GeoPoint(48.8789, 2.3677), GeoPoint(*there), 30.0)
    assert math.degrees(bearing) == pytest.approx(90.0, abs=0.1)
    assert math.degrees(elevation) == pytest.approx(45.0, abs=0.1)


@pytest.mark.parametrize(("pitch", "to_nose"), [(-30.0, 20.0), (-90.0, 0.0), (60.0, -40.0)])
def test_picture_is_turned_back_by_the_heading(pitch: float, to_nose: float) -> None:
    """It looks `to_nose` from a nose that heads south-west; the metadata have it from north."""
    heading = 225.0 * units.RAD_PER_DEG
    angles = pitch * units.RAD_PER_DEG, to_nose * units.RAD_PER_DEG
    from_north = units.quaternion_from_euler(0.0, angles[0], angles[1] + heading)
    turned = pictured_rotation(from_north, heading, earth=False)
    wanted = units.quaternion_from_euler(0.0, *angles)
    assert turned is not None
    assert abs(sum(a * b for a, b in zip(turned, wanted, strict=True))) == pytest.approx(1.0)
    assert pictured_rotation(from_north, heading, earth=True) == from_north
    assert pictured_rotation(from_north, None, earth=False) is None
    assert pictured_rotation(None, heading, earth=True) is None


@pytest.mark.parametrize(("heading", "yaw_absolute"), [(math.radians(170.0), -160.0), (None, NAN)])
def test_absolute_yaw_of_a_mount_counts_from_the_north_of_the_heading(
    heading: float | None, yaw_absolute: float
) -> None:
    """By hand: 170 deg and 30 deg to the right are 200 deg. The gimbal's own yaw is to magnetic north, 15 deg less."""
    held = dict.fromkeys(Axis, RELATIVE)
    attitude = GimbalAttitude(held, relative=Angles(30.0, -10.0, 0.0), absolute=Angles(-175.0, -12.0, 1.0))
    message = mount_orientation(GimbalState(attitude=attitude), heading, Times(0, 0, 5))
    assert message is not None
    found = message.time_boot_ms, message.roll, message.pitch, message.yaw, message.yaw_absolute
    assert found == pytest.approx((5, 1.0, -12.0, 30.0, yaw_absolute), nan_ok=True)
