"""Pose of the camera at a moment, by events and by pictures."""

from __future__ import annotations

import math

import pytest
from support.values import arrived

from anafi_mav.drone import events
from anafi_mav.drone.events import FrameOfReference, Message
from anafi_mav.services.camera.camera_pose import KEPT, MOST, SPACING, EventSamples
from anafi_mav.services.camera.pose_track import FURTHEST, SAMPLES, PoseTrack, SampledPoses, SampleTrack


def test_value_is_interpolated_between_samples() -> None:
    track = SampleTrack(1)
    track.add(1.0, 10.0)
    track.add(1.2, 20.0)
    assert track.value(1.05) == pytest.approx((12.5,))
    assert track.value(0.5) == (10.0,)
    assert track.value(1.5) == (20.0,)
    assert track.value(1.2 + FURTHEST + 0.1) is None


def test_sample_that_is_not_newer_is_left_out() -> None:
    track = SampleTrack(1)
    track.add(1.0, 10.0)
    track.add(1.0, 99.0)
    track.add(0.5, 99.0)
    track.add(2.0, math.nan)
    assert track.value(1.0) == (10.0,)
    assert track.newest == 1.0


def test_oldest_samples_give_way_to_newer_ones() -> None:
    track = SampleTrack(2)
    for number in range(SAMPLES + 10):
        track.add(float(number), 10.0 * number, -float(number))
    assert track.value(10.0) == (100.0, -10.0)
    assert track.value(SAMPLES + 8.5) == pytest.approx((10.0 * (SAMPLES + 8.5), -(SAMPLES + 8.5)))
    assert track.distance(0.0) == 10.0
    assert track.value(9.0) == (100.0, -10.0)


def test_cleared_track_has_no_samples_of_before() -> None:
    track = SampleTrack(1)
    track.add(5.0, 1.0)
    track.clear()
    assert track.value(5.0) is None
    assert track.distance(5.0) == math.inf
    track.add(4.0, 2.0)
    assert track.value(5.0) == (2.0,)


def test_angle_is_interpolated_across_south() -> None:
    track = SampleTrack(1, turn=math.tau)
    track.add(1.0, math.radians(175.0))
    track.add(2.0, math.radians(-175.0))
    assert track.value(1.5) == pytest.approx((math.pi,))


@pytest.mark.parametrize(
    ("first", "second", "between"),
    [(179.9999, -179.9997, -179.9999), (-179.9999, 179.9997, 179.9999), (2.0, 2.0002, 2.0001)],
)
def test_place_is_interpolated_across_the_180th_meridian(first: float, second: float, between: float) -> None:
    poses = PoseTrack(SampledPoses())
    poses.events.places.add(1.0, -16.0, first)
    poses.events.places.add(2.0, -16.0002, second)
    assert poses.pose(1.5).place == pytest.approx((-16.0001, between), abs=1e-9)


def test_position_continues_at_the_reported_velocity() -> None:
    poses = PoseTrack(SampledPoses())
    poses.events.places.add(1.0, 48.0, 2.0)
    poses.events.velocities.add(1.0, 10.0, 0.0)
    pose = poses.pose(1.5)
    assert pose.place is not None
    assert (pose.place[0] - 48.0) * 111_195.0 == pytest.approx(5.0, abs=0.05)
    assert pose.place[1] == pytest.approx(2.0, abs=1e-9)


def test_gimbal_and_heading_are_joined() -> None:
    poses = PoseTrack(SampledPoses())
    poses.events.gimbals.add(1.0, 0.0, math.radians(-30.0), math.radians(20.0))
    assert poses.pose(1.0).camera is None
    poses.events.headings.add(1.0, math.radians(170.0))
    assert poses.pose(1.0).camera == pytest.approx((0.0, math.radians(-30.0), math.radians(-170.0)))


def test_picture_near_the_moment_is_the_source() -> None:
    poses = PoseTrack(SampledPoses())
    for source, pitch in ((poses.events, -0.1), (poses.pictures, -0.2)):
        source.gimbals.add(1.0, 0.0, pitch, 0.0)
        source.headings.add(1.0, 0.0)
        source.places.add(1.0, 48.0 - pitch, 2.0)
    near, far = poses.pose(1.1), poses.pose(1.4)
    assert near.camera is not None
    assert near.camera[1] == pytest.approx(-0.2)
    assert near.place == pytest.approx((48.2, 2.0))
    assert far.camera is not None
    assert far.camera[1] == pytest.approx(-0.1)


def test_pose_is_complete_once_newer_samples_have_arrived() -> None:
    poses = PoseTrack(SampledPoses())
    poses.events.gimbals.add(1.0, 0.0, 0.0, 0.0)
    poses.events.places.add(1.0, 48.0, 2.0)
    assert not poses.is_complete(1.1)
    poses.events.gimbals.add(1.2, 0.0, 0.0, 0.0)
    poses.events.places.add(1.2, 48.0, 2.0)
    assert poses.is_complete(1.1)


def attitude_of_gimbal(id: int, yaw: float) -> Message:
    frame = FrameOfReference.RELATIVE
    return events.GimbalAttitudeChanged(id, frame, frame, frame, yaw, 99.0, 99.0, 99.0, -30.0, 5.0)


def test_samples_of_events_are_read_from_their_bytes() -> None:
    samples = EventSamples()
    poses = PoseTrack(samples)
    speed, height, heading = (
        events.SpeedChanged(10.0, 0.0, 99.0),
        events.AltitudeChanged(12.5),
        events.AttitudeChanged(99.0, 99.0, 0.5),
    )
    samples.add(arrived(heading, speed, height, attitude_of_gimbal(0, 20.0)), 1.0)
    samples.add(arrived(events.GpsLocationChanged(48.0, 2.0, 100.0, 1, 1, 1)), 1.0)
    pose = poses.pose(1.0)
    assert pose.place == pytest.approx((48.0, 2.0))
    assert pose.height == 12.5
    assert pose.camera == pytest.approx((math.radians(5.0), math.radians(-30.0), 0.5 + math.radians(20.0)))
    assert poses.is_complete(1.0)
    later = poses.pose(2.0).place
    assert later is not None
    assert later[0] == pytest.approx(48.0 + 10.0 / 111_200.0, abs=1e-6)


def test_events_without_values_are_no_samples() -> None:
    samples = EventSamples()
    samples.add(arrived(events.AltitudeChanged(12.5), attitude_of_gimbal(0, 20.0)), 1.0)
    samples.add(arrived(events.AltitudeChanged(math.nan), attitude_of_gimbal(1, 80.0)), 1.2)
    assert samples.heights.value(1.2) == (12.5,)
    gimbal = samples.gimbals.value(1.2)
    assert gimbal is not None
    assert gimbal[2] == pytest.approx(math.radians(20.0))
    samples.add(arrived(events.GpsLocationChanged(500.0, 500.0, 500.0, -1, -1, -1)), 1.2)
    assert not PoseTrack(samples).is_complete(1.2)


def test_heights_that_no_measure_has_are_no_samples() -> None:
    samples = EventSamples()
    samples.add(arrived(events.AltitudeChanged(1.7e308)), 1.0)
    samples.add(arrived(events.AltitudeChanged(-1.7e308)), 1.2)
    assert samples.heights.value(1.1) is None


def test_events_closer_than_the_spacing_are_left_out() -> None:
    samples = EventSamples()
    for number in range(4):
        samples.add(arrived(events.AltitudeChanged(float(number))), 1.0 + 0.75 * SPACING * number)
    assert samples.heights.value(1.0 + 0.75 * SPACING) == pytest.approx((1.0,))
    assert samples.heights.newest == 1.0 + 1.5 * SPACING


def test_values_of_other_kinds_are_kept_within_the_spacing() -> None:
    samples = EventSamples()
    heading, speed = events.AttitudeChanged(0.0, 0.0, 0.5), events.SpeedChanged(10.0, 0.0, 0.0)
    kinds = heading, speed, events.AltitudeChanged(12.5), attitude_of_gimbal(0, 20.0)
    place = events.GpsLocationChanged(48.0, 2.0, 100.0, 1, 1, 1)
    samples.add(arrived(*kinds), 1.0)
    samples.add(arrived(*kinds), 1.0 + 0.5 * SPACING)
    assert samples.headings.newest == 1.0
    samples.add(arrived(heading, place), 1.0 + 0.5 * SPACING)
    assert (samples.headings.newest, samples.places.newest) == (1.0 + 0.5 * SPACING, 1.0 + 0.5 * SPACING)
    samples.add(arrived(speed), 1.0 + 0.7 * SPACING)
    assert (samples.velocities.newest, samples.heights.newest) == (1.0 + 0.7 * SPACING, 1.0)
    samples.clear()
    samples.add(arrived(*kinds), 1.0 + 0.9 * SPACING)
    assert samples.headings.newest == 1.0 + 0.9 * SPACING


def test_events_are_kept_for_a_time_and_up_to_a_number() -> None:
    samples = EventSamples()
    samples.add(arrived(events.AltitudeChanged(1.0)), 1.0)
    samples.add(arrived(events.AltitudeChanged(2.0)), 1.0 + KEPT)
    assert samples.heights.distance(1.0) == 0.0
    samples.add(arrived(events.AltitudeChanged(3.0)), 1.1 + KEPT)
    assert samples.heights.distance(1.0) == KEPT
    for number in range(MOST + 1):  # of as many layouts
        samples.add(arrived(events.AltitudeChanged(0.0), attitude_of_gimbal(number % 256, 0.0)), 4.2)
    assert samples.heights.distance(1.0) == pytest.approx(3.2)
