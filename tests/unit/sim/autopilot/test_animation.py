"""Animations of the simulated drone: what is available, how it flies, what it photographs, and what ends it."""

from __future__ import annotations

import itertools
import math

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import animation, ardrone3, camera, follow_me, rth
from anafi_mav.arsdk.messages.animation import AnimationState, Indicator, PlayMode, Type
from anafi_mav.arsdk.messages.ardrone3 import FlyingState, PoiMode
from anafi_mav.sim.autopilot.animation_paths import STARTS
from anafi_mav.sim.world.place import WorldOrigin

RAD = math.pi / 180.0
ALL = 0xFF
"""provided_params: every value counts."""


@pytest.fixture
def bench() -> Bench:
    """Hovering at 10 m, heading north."""
    bench = Bench()
    bench.take_off()
    bench.climb(10.0)
    return bench


def place(north: float, east: float) -> tuple[float, float]:
    return WorldOrigin(*HOME).place(north, east)


def look_at(bench: Bench, north: float, east: float, up: float = 0.0) -> None:
    """Let there be a point of interest."""
    bench.send(ardrone3.StartPilotedPOIV2(*place(north, east), up, PoiMode.LOCKED_GIMBAL))
    bench.run(5.0)
    bench.events.clear()


def perform(bench: Bench, command: Message, limit: float = 120.0) -> list[Message]:
    """Fly a figure to its end; what was said."""
    before = len(bench.events)
    bench.send(command)
    assert bench.firmware.animations.running, "it has not begun"
    bench.run_until(lambda: not bench.firmware.animations.running, limit)
    return bench.events[before:]


def states(events: list[Message]) -> list[tuple[Type, int]]:
    return [(event.type, event.percent) for event in events if isinstance(event, animation.State)]


def available(bench: Bench) -> set[Type]:
    bits = bench.of(animation.Availability)[-1].values
    return {type for type in Type if bits >> type & 1}


# -- what there is


def test_available_animations_are_reported_on_change() -> None:
    bench = Bench()
    assert not bench.of(animation.Availability)
    bench.take_off()
    bench.run(0.1)
    alone = {Type.HORIZONTAL_PANORAMA, Type.DRONIE, Type.HORIZONTAL_REVEAL, Type.VERTICAL_REVEAL, Type.VERTIGO}
    alone |= {Type.TWIST_UP, Type.HORIZONTAL_180_PHOTO_PANORAMA, Type.VERTICAL_180_PHOTO_PANORAMA}
    alone |= {Type.SPHERICAL_PHOTO_PANORAMA}
    assert available(bench) == alone
    look_at(bench, 20.0, 0.0)
    bench.run(0.1)
    bits = bench.firmware.animations.states_report()[0]
    assert isinstance(bits, animation.Availability)
    around = {Type.SPIRAL, Type.PARABOLA, Type.CANDLE, Type.DOLLY_SLIDE, Type.POSITION_TWIST_UP}
    assert {type for type in Type if bits.values >> type & 1} == alone | around
    bench.faults.gps = False
    bench.run(0.1)
    assert available(bench) == set()


def test_ai_reports_missing_inputs_of_an_animation() -> None:
    bench = Bench("ai")

    def missing() -> dict[Type, int]:
        return {info.type: info.missing_inputs for info in bench.of(animation.Info)[-15:]}

    report = bench.firmware.animations.states_report()
    modes = [message.mode for message in report if isinstance(message, animation.Capabilities)]
    assert modes == [animation.Mode.MANUAL, animation.Mode.FOLLOW_ME, animation.Mode.POI, animation.Mode.LOOK_AT]
    infos = [message for message in report if isinstance(message, animation.Info)]
    assert (infos[0].list_flags, infos[-1].list_flags, len(infos)) == (1, 2, 15)
    assert all(info.missing_inputs & 1 << Indicator.DRONE_FLYING for info in infos)
    bench.take_off()
    bench.run(0.1)
    assert missing()[Type.SUPER_WIDE_PHOTO_PANORAMA] == 0
    assert missing()[Type.SPIRAL] == 1 << Indicator.TARGET_POSITION_ACCURACY


@pytest.mark.parametrize("command", sorted(STARTS, key=lambda kind: kind.NAME), ids=lambda kind: kind.NAME)
def test_nothing_begins_on_the_ground(command: type[Message]) -> None:
    bench = Bench("ai")
    bench.events.clear()
    assert bench.send(command(*(0 for _ in command.__struct_fields__))) == []
    assert not bench.firmware.animations.running


# -- how they fly


def test_a_horizontal_panorama_turns_on_the_spot(bench: Bench) -> None:
    began = bench.now
    said = perform(bench, animation.StartHorizontalPanorama(ALL, -1.5 * math.pi, 0.5))
    assert isinstance(said[0], animation.HorizontalPanoramaState)
    assert said[0].rotation_angle == pytest.approx(-1.5 * math.pi)
    assert [observed.state for observed in bench.of(animation.HorizontalPanoramaState)] == [
        AnimationState.RUNNING,
        AnimationState.IDLE,
    ]
    found = states(said)
    assert (found[0], found[-1]) == ((Type.HORIZONTAL_PANORAMA, 0), (Type.NONE, 0))
    percents = [percent for type, percent in found if type is Type.HORIZONTAL_PANORAMA]
    assert percents == sorted(percents)
    assert len(percents) > 10
    assert bench.body.heading == pytest.approx(-1.5 * math.pi, abs=3.0 * RAD)
    assert bench.now - began == pytest.approx(1.5 * math.pi / 0.5, abs=4.0)
    pose = bench.pose
    assert (pose.north, pose.east, pose.up) == pytest.approx((0.0, 0.0, 10.0), abs=0.3)


def test_omitted_animation_values_are_the_drones_defaults(bench: Bench) -> None:
    bench.send(
        animation.StartDronie(1 << animation.DronieConfigParam.DISTANCE, 99.0, 12.0, PlayMode.ONCE_THEN_MIRRORED)
    )
    state = bench.of(animation.DronieState)[-1]
    assert (state.speed, state.distance, state.play_mode) == (2.5, 12.0, PlayMode.NORMAL)


def test_a_dronie_goes_back_and_up(bench: Bench) -> None:
    perform(bench, animation.StartDronie(ALL, 3.0, 20.0, PlayMode.NORMAL))
    pose = bench.pose  # the camera looks level: 15 degrees up at least
    assert (pose.north, pose.up) == pytest.approx(
        (-20.0 * math.cos(15 * RAD), 10.0 + 20.0 * math.sin(15 * RAD)), abs=0.4
    )
    assert pose.yaw == pytest.approx(0.0, abs=0.05)


def test_mirrored_animation_returns(bench: Bench) -> None:
    high = 0.0
    bench.send(animation.StartTwistUp(ALL, 2.0, 8.0, math.pi, 1.0, PlayMode.ONCE_THEN_MIRRORED))
    while bench.firmware.animations.running:
        bench.run(0.05)
        high = max(high, bench.pose.up)
    assert high == pytest.approx(18.0, abs=0.4)
    pose = bench.pose
    assert (pose.north, pose.east, pose.up, pose.yaw) == pytest.approx((0.0, 0.0, 10.0, 0.0), abs=0.3)


def test_a_reveal_begins_with_a_look_down(bench: Bench) -> None:
    tilts = []
    bench.send(animation.StartHorizontalReveal(ALL, 3.0, 12.0, PlayMode.NORMAL))
    while bench.firmware.animations.running:
        bench.run(0.05)
        tilts.append(bench.firmware.operator.tilt)
    assert min(tilts) == pytest.approx(-90.0, abs=1.0)
    assert tilts[-1] == pytest.approx(0.0, abs=1.5)
    assert bench.pose.north == pytest.approx(12.0, abs=0.3)


def test_a_vertical_reveal_rises_and_turns(bench: Bench) -> None:
    perform(bench, animation.StartVerticalReveal(ALL, 2.0, 5.0, math.pi, 1.0, PlayMode.NORMAL))
    assert bench.pose.up == pytest.approx(15.0, abs=0.3)
    assert bench.body.heading == pytest.approx(math.pi, abs=0.06)


def test_a_vertigo_keeps_the_subject_as_large(bench: Bench) -> None:
    perform(bench, animation.StartVertigo(ALL, 5.0, 2.0, animation.VertigoFinishAction.NONE, PlayMode.NORMAL))
    assert bench.pose.north == pytest.approx(-10.0, abs=0.3)  # the subject is taken to be 10 m away
    assert zoom(bench) == pytest.approx(2.0, abs=0.05)
    perform(bench, animation.StartVertigo(ALL, 5.0, 99.0, animation.VertigoFinishAction.UNZOOM, PlayMode.NORMAL))
    bench.run(1.0)
    assert zoom(bench) == pytest.approx(1.0, abs=0.05)
    assert bench.pose.north == pytest.approx(-30.0, abs=0.4)  # the 4K's zoom ends at 3


def zoom(bench: Bench) -> float:
    (level,) = bench.firmware.payload.telemetry()
    assert isinstance(level, camera.ZoomLevel)
    return level.level


def test_a_spiral_goes_round_the_point(bench: Bench) -> None:
    look_at(bench, 10.0, 0.0)
    distances, bearings = [], []
    bench.send(animation.StartSpiral(ALL, 3.0, 2.0, 5.0, 1.0, PlayMode.NORMAL))
    while bench.firmware.animations.running:
        bench.run(0.1)
        bearing, distance = bench.pose.bearing(10.0, 0.0)
        distances.append(distance)
        bearings.append(bearing)
        assert abs(math.remainder(bearing - bench.pose.yaw, 2 * math.pi)) < 0.5  # the nose stays on it
    assert distances[0] == pytest.approx(10.0, abs=1.0)
    assert distances[-1] == pytest.approx(20.0, abs=1.0)
    assert bench.pose.up == pytest.approx(15.0, abs=0.5)
    turned = sum(math.remainder(b - a, 2 * math.pi) for a, b in itertools.pairwise(bearings))
    assert turned == pytest.approx(2 * math.pi, abs=0.3)


def test_a_parabola_ends_beyond_the_point(bench: Bench) -> None:
    look_at(bench, 10.0, 0.0)
    highest = 0.0
    bench.send(animation.StartParabola(ALL, 4.0, 10.0, PlayMode.NORMAL))
    while bench.firmware.animations.running:
        bench.run(0.1)
        highest = max(highest, bench.pose.up)
    assert highest == pytest.approx(20.0, abs=1.0)
    assert (bench.pose.north, bench.pose.up) == pytest.approx((20.0, 10.0), abs=0.5)


@pytest.mark.parametrize(
    ("command", "north", "east", "up"),
    [
        # Two metres before the point, then up.
        (animation.StartCandle(ALL, 3.0, 6.0, PlayMode.NORMAL), 8.0, 0.0, 16.0),
        # A quarter of a turn about a point 10 m north: the drone, south of it, would be west of it. 14.14 m to there.
        (animation.StartDollySlide(ALL, 3.0, math.pi / 2, 14.142, PlayMode.NORMAL), 10.0, -10.0, 10.0),
        (animation.StartPositionTwistUp(ALL, 2.0, 4.0, math.pi, 1.0, PlayMode.NORMAL), 10.0, 0.0, 14.0),
    ],
    ids=lambda value: getattr(value, "NAME", ""),
)
def test_where_figures_about_a_point_end(bench: Bench, command: Message, north: float, east: float, up: float) -> None:
    look_at(bench, 10.0, 0.0)
    perform(bench, command)
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((north, east, up), abs=0.5)


@pytest.mark.parametrize(
    "command",
    [
        animation.StartSpiral(ALL, 3.0, 2.0, 5.0, 1.0, PlayMode.NORMAL),  # nothing to fly around
        animation.StartFlip(animation.FlipType.FRONT),  # no ANAFI does that
        animation.StartSuperWidePhotoPanorama(),  # an Ai does
        animation.StartDronie(ALL, math.nan, 20.0, PlayMode.NORMAL),
        animation.StartDronie(ALL, 3.0, 1e9, PlayMode.NORMAL),
        animation.StartDronie(ALL, -3.0, 20.0, PlayMode.NORMAL),
        animation.StartDronie(ALL, 3.0, 20.0, PlayMode(9)),
    ],
    ids=repr,
)
def test_unavailable_animation_is_ignored(bench: Bench, command: Message) -> None:
    assert bench.send(command) == []
    assert not bench.firmware.animations.running


# -- pictures


@pytest.mark.parametrize(
    ("model", "command", "kind", "count"),
    [
        ("4k", animation.StartHorizontal180PhotoPanorama(), "HORIZONTAL_180", 9),
        ("usa", animation.StartVertical180PhotoPanorama(), "VERTICAL_180", 9),
        ("4k", animation.StartSphericalPhotoPanorama(), "SPHERICAL", 42),
        ("ai", animation.StartSuperWidePhotoPanorama(), "SUPER_WIDE", 9),
        ("ai", animation.StartHorizontal180PhotoPanorama(), "HORIZONTAL_180", 9),
    ],
)
def test_a_photo_panorama_is_one_media_of_many_pictures(model: str, command: Message, kind: str, count: int) -> None:
    bench = Bench(model)
    bench.take_off()
    bench.climb(10.0)
    perform(bench, command, limit=300.0)
    bench.run(0.5)
    (media,) = bench.firmware.payload.media
    observed = media.describe()
    assert (observed["photo_mode"], observed["panorama_type"], observed["expected_count"]) == ("PANORAMA", kind, count)
    assert len(media.resources) == count
    views = {(round(one.scene.pitch / 5.0), round(one.scene.heading / 5.0)) for one in media.resources}
    assert len(views) > count * 0.8, "the pictures show different things"
    assert all(resource.content().startswith(b"\xff\xd8") for resource in media.resources[:2])
    assert not bench.firmware.payload.cameras.busy


def test_photos_of_a_panorama_are_reported_like_photos(bench: Bench) -> None:
    said = perform(bench, animation.StartHorizontal180PhotoPanorama())
    bench.run(0.5)
    results = [event.result for event in bench.of(camera.PhotoProgress)]
    assert results[0] is camera.PhotoResult.TAKING_PHOTO
    assert results.count(camera.PhotoResult.PHOTO_TAKEN) == 9
    assert results[-1] is camera.PhotoResult.PHOTO_SAVED
    assert bench.of(camera.PhotoState)[-1].state is camera.State.INACTIVE
    assert states(said)[-1] == (Type.NONE, 0)


def test_full_card_prevents_panorama_photos_not_the_turn(bench: Bench) -> None:
    bench.faults.storage_full = True
    bench.run(0.1)
    perform(bench, animation.StartHorizontal180PhotoPanorama())
    assert bench.of(camera.PhotoProgress)[-1].result is camera.PhotoResult.ERROR_NO_STORAGE_SPACE
    assert len(bench.firmware.payload.media) == 0


# -- ends


def test_cancel_stops_and_reports_the_animation(bench: Bench) -> None:
    bench.send(animation.StartDronie(ALL, 5.0, 100.0, PlayMode.NORMAL))
    bench.run(4.0)
    (canceling,) = bench.send(animation.Cancel())
    assert isinstance(canceling, animation.DronieState)
    assert canceling.state is AnimationState.CANCELING
    bench.run_until(lambda: not bench.firmware.animations.running)
    assert bench.of(animation.DronieState)[-1].state is AnimationState.IDLE
    assert bench.of(animation.State)[-1] == animation.State(Type.NONE, 0)
    before = bench.pose.north
    bench.run(3.0)
    assert bench.pose.north == pytest.approx(before, abs=0.3)


def test_cancel_with_nothing_running_is_answered(bench: Bench) -> None:
    assert bench.send(animation.Cancel()) == [animation.State(Type.NONE, 0)]


def test_another_animation_replaces_the_running_one(bench: Bench) -> None:
    bench.send(animation.StartDronie(ALL, 5.0, 100.0, PlayMode.NORMAL))
    bench.run(1.0)
    said = bench.send(animation.StartHorizontalPanorama(0, 0.0, 0.0))
    assert [type(event) for event in said] == [
        animation.DronieState,
        animation.State,
        animation.HorizontalPanoramaState,
        animation.State,
    ]


def test_piloting_commands_are_ignored_meanwhile(bench: Bench) -> None:
    bench.send(animation.StartHorizontalPanorama(0, 0.0, 0.0))
    bench.sticks(2.0, pitch=100)
    assert math.hypot(bench.pose.north, bench.pose.east) < 0.3
    (end,) = bench.send(ardrone3.MoveBy(10.0, 0.0, 0.0, 0.0))
    assert isinstance(end, ardrone3.MoveByEnd)
    assert end.error is ardrone3.MoveByError.BUSY
    assert bench.firmware.animations.running


@pytest.mark.parametrize("command", [ardrone3.Landing(), rth.ReturnToHome(), ardrone3.Emergency()], ids=repr)
def test_animation_ends_by_each_of_these(bench: Bench, command: Message) -> None:
    bench.sticks(4.0, pitch=50)
    bench.rest()
    bench.send(animation.StartSphericalPhotoPanorama())
    bench.run(4.0)
    bench.send(command)
    assert not bench.firmware.animations.running
    assert bench.of(animation.State)[-1].type is Type.NONE
    bench.run(0.5)
    (media,) = bench.firmware.payload.media
    assert 0 < len(media.resources) < 42  # what was taken is kept
    if isinstance(command, ardrone3.Landing):
        bench.run_until(lambda: bench.state is FlyingState.LANDED)


def test_animation_ends_with_the_link(bench: Bench) -> None:
    bench.send(animation.StartDronie(ALL, 5.0, 100.0, PlayMode.NORMAL))
    bench.run(2.0)
    bench.firmware.link_lost()
    assert not bench.firmware.animations.running
    bench.rest()


def test_followed_target_is_the_target_of_animations(bench: Bench) -> None:
    assert bench.firmware.target is None
    bench.send(follow_me.TargetImageDetection(0.0, -45.0 * RAD, 0.0, 200, 1, 0))
    assert bench.firmware.target == pytest.approx((10.0, 0.0, 0.0), abs=0.2)
