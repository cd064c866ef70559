"""Flight plans in the simulator: its reader of the file, and what each item makes the drone do."""

from __future__ import annotations

import math

import pytest
from support.plan_samples import PARROTS_EXAMPLE
from support.sim_bench import HOME, Bench

from anafi_mav import geo
from anafi_mav.arsdk.messages import ardrone3, camera, common, flight_plan, rth
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.common import FlightPlanComponent as Part
from anafi_mav.arsdk.messages.common import MavlinkType, PlayError, PlayingState
from anafi_mav.arsdk.messages.rth import RthState, StateReason
from anafi_mav.sim.plan.plan_file import MAX_ITEMS, PlanCommand, PlanFileError, PlanFrame, read
from anafi_mav.sim.states import all_states

S = FlyingState
NAN = math.nan
V1, V2 = MavlinkType.FLIGHT_PLAN, MavlinkType.FLIGHT_PLAN_V2


def line(command: int, *p: float, at: tuple[float, float, float] | None = None, frame: int = 3) -> str:
    """One item; `at` is (north, east) of home in m and the altitude."""
    p1, p2, p3, p4 = (*p, 0.0, 0.0, 0.0, 0.0)[:4]
    x, y = (0.0, 0.0) if at is None else geo.destination(*HOME[:2], at[0], at[1])
    z = 0.0 if at is None else at[2]
    return "\t".join(map(str, (0, 0, frame, command, p1, p2, p3, p4, f"{x:.8f}", f"{y:.8f}", z, 1)))


def text(*lines: str) -> bytes:
    return "\n".join(("QGC WPL 120", *lines, "")).encode()


# -- the reader


def test_the_sample_of_parrots_pages() -> None:
    items = read(PARROTS_EXAMPLE, 2)
    assert [item.command for item in items] == [22, 16, 2000, 93, 2001, 16, 21]
    assert items[1][2:] == (0.0, 0.0, 0.0, 0.0, 48.879, 2.366549, 20.0)
    assert math.isnan(items[0].p4)
    assert (items[2].frame, items[3].p1) == (PlanFrame.MISSION, 10.0)
    assert len(read(PARROTS_EXAMPLE, 1)) == 7
    assert read(text(line(16, at=(0.0, 0.0, 5.0))).replace(b"120", b"110"), 1)[0].altitude == 5.0


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("command", list(PlanCommand))
def test_each_plan_command_is_read_in_its_version(command: PlanCommand, version: int) -> None:
    data = text(line(command, 1.0, at=(1.0, 1.0, 5.0)))
    if version == 1 and command in (195, 197, 206, 214):
        with pytest.raises(PlanFileError):
            read(data, version)
    else:
        assert read(data, version)[0].command is command


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "line 1: no QGC WPL header"),
        (b"\xff\xfe", "not a text"),
        (b"QGC WPL x\n", "line 1: no QGC WPL header"),
        (b"QGC WPL 120\n", "0 items"),
        (text("1\t2\t3"), "line 2: 3 columns"),
        (text(line(16, at=(0.0, 0.0, 1.0)), line(19)), "line 3: 19 is not a valid PlanCommand"),
        (text(line(16, frame=7)), "line 2: 7 is not a valid PlanFrame"),
        (text(line(93).replace("93\t0.0", "93\tlong")), "line 2: could not convert string to float: 'long'"),
        (text(line(93, math.inf)), "line 2: an infinite number"),
        (text(line(16).replace("0.00000000", "91.0")), "line 2: no position"),
        (text(line(16, at=(0.0, 0.0, NAN))), "line 2: no position"),
        (text(*[line(93)] * (MAX_ITEMS + 1)), f"{MAX_ITEMS + 1} items"),
    ],
)
def test_invalid_plan_file_is_refused(data: bytes, reason: str) -> None:
    with pytest.raises(PlanFileError) as caught:
        read(data, 1)
    assert str(caught.value) == reason


# -- flights


class Flight:
    """A bench and the plan it plays."""

    def __init__(self, *lines: str, model: str = "4k", flying: bool = False) -> None:
        self.bench = Bench(model)
        if flying:
            self.bench.take_off()
            self.bench.climb(10.0)
        self.type = V2 if model == "ai" else V1
        self.uid = self.bench.firmware.plans.put(text(*lines))
        self.bench.events.clear()

    def start(self) -> None:
        self.bench.send(common.Start(self.uid, self.type))

    def play(self, limit: float = 90.0) -> None:
        self.start()
        assert self.states == [PlayingState.PLAYING]
        self.bench.run_until(lambda: self.states[-1] is PlayingState.STOPPED, limit)

    @property
    def states(self) -> list[PlayingState]:
        return [event.state for event in self.bench.of(common.MavlinkFilePlayingStateChanged)]

    @property
    def executed(self) -> list[int]:
        return [event.idx for event in self.bench.of(common.MissionItemExecuted)]

    def until_item(self, index: int) -> None:
        self.bench.run_until(lambda: index in self.executed)


def test_a_plan_from_the_ground_to_the_ground() -> None:
    flight = Flight(
        line(22), line(16, 0, 2, at=(20.0, 0.0, 8.0)), line(16, 0, 2, 0, 90, at=(20.0, 15.0, 8.0)), line(21)
    )
    bench = flight.bench
    flight.start()
    assert bench.states() == [S.MOTOR_RAMPING]
    assert bench.of(common.MavlinkFilePlayingStateChanged) == [
        common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, flight.uid, V1)
    ]
    flight.until_item(1)
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx((20.0, 0.0, 8.0), abs=2.0)
    bench.run_until(lambda: bench.state is S.LANDED)
    assert flight.executed == [0, 1, 2, 3]
    assert flight.states == [PlayingState.PLAYING, PlayingState.STOPPED]
    assert (bench.pose.north, bench.pose.east) == pytest.approx((20.0, 15.0), abs=2.5)
    assert bench.states() == [S.MOTOR_RAMPING, S.TAKINGOFF, S.HOVERING, S.FLYING, S.LANDING, S.LANDED]


def test_takeoff_item_is_optional_in_version_1_only() -> None:
    flight = Flight(line(16, 0, 2, at=(10.0, 0.0, 5.0)))
    flight.play()
    assert flight.bench.pose.north == pytest.approx(10.0, abs=2.0)
    flight.bench.rest()
    flight = Flight(line(16, 0, 2, at=(10.0, 0.0, 5.0)), model="ai")
    flight.start()
    assert flight.bench.of(common.StartingErrorEvent) == [common.StartingErrorEvent()]
    assert flight.states == [PlayingState.STOPPED]


def test_the_speed_is_the_last_one_asked_for() -> None:
    far = line(16, 0, 2, at=(60.0, 0.0, 10.0))
    flight = Flight(line(178, 1, 3), far, flying=True)
    flight.start()
    flight.bench.run(8.0)
    assert flight.bench.pose.ground_speed == pytest.approx(3.0, abs=0.15)
    flight = Flight(far, flying=True)
    flight.start()
    flight.bench.run(6.0)
    assert flight.bench.pose.ground_speed == pytest.approx(5.0, abs=0.3)


def test_the_heading_of_a_way_point() -> None:
    flight = Flight(line(16, 0, 1, 0, 120, at=(12.0, 0.0, 10.0)), line(93, 3), flying=True)
    flight.play()
    assert math.degrees(flight.bench.pose.yaw) == pytest.approx(120.0, abs=2.0)


def test_a_delay_lasts() -> None:
    flight = Flight(line(112, 2), line(93, 4), line(93, -1), flying=True)
    began = flight.bench.now
    flight.play()
    assert flight.bench.now - began == pytest.approx(6.0, abs=0.1)
    assert flight.executed == [0, 1, 2]
    flight.bench.rest()


def test_return_item_ends_the_plan() -> None:
    flight = Flight(line(16, 0, 2, at=(30.0, 0.0, 10.0)), line(20), line(16, at=(0.0, 50.0, 10.0)), flying=True)
    flight.play()
    bench = flight.bench
    bench.run_until(lambda: bool(bench.of(rth.State)) and bench.of(rth.State)[-1].state is RthState.IN_PROGRESS)
    assert bench.of(rth.State)[-1].reason is StateReason.FLIGHTPLAN
    assert flight.executed == [0, 1]


def test_pause_and_go_on() -> None:
    flight = Flight(line(16, 0, 2, at=(40.0, 0.0, 10.0)), line(16, 0, 2, at=(40.0, 10.0, 10.0)), flying=True)
    bench = flight.bench
    flight.start()
    bench.run(5.0)
    bench.send(common.Pause())
    bench.rest()
    here = bench.pose.north
    bench.run(3.0)
    assert bench.pose.north == pytest.approx(here, abs=0.1)
    flight.start()
    bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)
    assert flight.states == [PlayingState.PLAYING, PlayingState.PAUSED, PlayingState.PLAYING, PlayingState.STOPPED]
    assert flight.executed == [0, 1]


def test_stop_hovers_and_next_start_begins_again() -> None:
    flight = Flight(line(93, 1), line(16, 0, 2, at=(40.0, 0.0, 10.0)), flying=True)
    bench = flight.bench
    flight.start()
    bench.run(4.0)
    assert bench.send(common.Stop())[0] == common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, flight.uid, V1)
    bench.rest()
    assert bench.send(common.Stop()) == [common.MavlinkFilePlayingStateChanged(PlayingState.STOPPED, "", V1)]
    flight.start()
    bench.run(2.0)
    assert flight.executed == [0, 0]


def test_the_pilot_has_no_say_meanwhile() -> None:
    flight = Flight(line(93, 5), flying=True)
    bench = flight.bench
    flight.start()
    bench.sticks(2.0, pitch=100)
    assert bench.pose.north == pytest.approx(0.0, abs=0.1)
    bench.send(ardrone3.MoveBy(5.0, 0.0, 0.0, 0.0))
    assert bench.of(ardrone3.MoveByEnd)[-1].error is ardrone3.MoveByError.BUSY


@pytest.mark.parametrize("command", [ardrone3.Landing(), ardrone3.Emergency(), rth.ReturnToHome()])
def test_flight_plan_is_ended_by_landing_emergency_and_return(
    command: ardrone3.Landing | ardrone3.Emergency | rth.ReturnToHome,
) -> None:
    flight = Flight(line(93, 30), flying=True)
    flight.start()
    flight.bench.run(0.5)
    flight.bench.send(command)
    assert flight.states[-1] is PlayingState.STOPPED


def test_lost_fix_ends_the_plan() -> None:
    flight = Flight(line(93, 30), flying=True)
    flight.start()
    flight.bench.faults.gps = False
    flight.bench.run(0.2)
    assert flight.states[-1] is PlayingState.STOPPED
    assert flight.bench.of(common.MavlinkPlayErrorStateChanged)[-1].error is PlayError.GPS_NOT_FIXED
    flight.bench.rest()


# -- camera and gimbal


def pitch(bench: Bench) -> float:
    bench.firmware.gimbal.advance(bench.firmware.time)
    return bench.firmware.gimbal.attitude(bench.pose).pitch_absolute


def commands(bench: Bench) -> list[str]:
    return [note["command"].rpartition(".")[2] for note in bench.notes if "camera." in str(note.get("command"))]


def test_the_camera_turns_and_looks_at_a_point() -> None:
    # Straight ahead, 20 m away and 20 m below: 45 degrees down.
    lines = (line(205, -30), line(93, 2), line(201, 3, at=(20.0, 0.0, -10.0)), line(50000, 2, 0), line(93, 3))
    flight = Flight(*lines, line(50000, 0), line(93, 1), flying=True)
    flight.start()
    flight.until_item(1)
    assert pitch(flight.bench) == pytest.approx(-30.0, abs=0.5)
    flight.until_item(4)
    assert pitch(flight.bench) == pytest.approx(-45.0, abs=1.0)
    flight.bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)


def test_the_nose_stays_on_the_point_all_the_way() -> None:
    lines = (line(201, 3, at=(0.0, 20.0, 0.0)), line(50000, 2, 0), line(93, 4), line(16, 0, 2, at=(30.0, 0.0, 10.0)))
    flight = Flight(*lines, flying=True)
    flight.start()
    flight.until_item(2)
    worst = 0.0
    while flight.states[-1] is PlayingState.PLAYING:
        flight.bench.run(0.1)
        bearing, _ = flight.bench.pose.bearing(0.0, 20.0)
        worst = max(worst, abs(bearing - flight.bench.pose.yaw))
    assert math.degrees(worst) < 6.0


def test_photos_and_videos() -> None:
    lines = (line(2000, 0, 1, 12), line(2500), line(93, 2), line(2501), line(50001, 0, 2.0), line(2000), line(93, 5))
    flight = Flight(*lines, line(2001), flying=True)
    flight.play()
    bench = flight.bench
    saved = [e for e in bench.of(camera.PhotoProgress) if e.result is camera.PhotoResult.PHOTO_SAVED]
    assert saved
    results = [e.result for e in bench.of(camera.RecordingProgress)]
    assert results == [camera.RecordingResult.STARTED, camera.RecordingResult.STOPPED]
    modes = [e.mode for e in bench.of(camera.PhotoMode)]
    assert modes == [camera.CameraPhotoMode.SINGLE, camera.CameraPhotoMode.TIME_LAPSE]
    assert commands(bench) == [
        *("set_camera_mode", "set_photo_mode", "take_photo"),
        *("set_camera_mode", "start_recording", "stop_recording"),
        *("set_camera_mode", "set_photo_mode", "take_photo", "stop_photo"),
    ]


@pytest.mark.parametrize("model", ["4k", "ai"])
def test_photo_item_takes_its_number_of_photos(model: str) -> None:
    """One every 2 s until there are three, although the plan waits for 12 s."""
    photos = line(2000, 2, 3, 12) if model == "4k" else line(2000, 0, 2, 3)
    flight = Flight(photos, line(93, 12), model=model, flying=True)
    flight.play()
    flight.bench.run(1.0)
    (media,) = flight.bench.firmware.payload.media
    assert len({resource.number for resource in media.resources}) == 3
    assert flight.bench.firmware.operator.camera_busy is False


def test_a_panorama_turns_once_round() -> None:
    flight = Flight(line(2800, 360, 0, 60), flying=True)
    before = flight.bench.body.heading
    began = flight.bench.now
    flight.play()
    assert math.degrees(flight.bench.body.heading - before) == pytest.approx(360.0, abs=2.0)
    assert 6.0 < flight.bench.now - began < 10.0  # at 60 deg/s
    flight.bench.run(0.5)
    (media,) = flight.bench.firmware.payload.media
    assert (media.describe()["photo_mode"], media.describe()["expected_count"]) == ("PANORAMA", 13)
    headings = [round(resource.scene.heading) % 360 for resource in media.resources]
    off = [math.remainder(heading - 30.0 * number, 360.0) for number, heading in enumerate(headings)]
    assert max(map(abs, off)) <= 3.0


@pytest.mark.parametrize("model", ["usa", "ai"])
def test_a_panorama_upwards(model: str) -> None:
    # 60 degrees up at 20 a second, from 30 below the horizon.
    flight = Flight(line(205, -30.0), line(93, 2.0), line(2800, 0, 60, 0, 20), model=model, flying=True)
    flight.play()
    assert flight.bench.firmware.operator.tilt == pytest.approx(30.0, abs=1.0)
    flight.bench.run(0.5)
    (media,) = flight.bench.firmware.payload.media
    tilts = [resource.scene.pitch for resource in media.resources]
    assert tilts == pytest.approx([-30.0, 0.0, 30.0], abs=3.0)
    assert not flight.bench.firmware.payload.cameras.busy


def test_stopped_panorama_keeps_its_photos() -> None:
    flight = Flight(line(2800, 360, 0, 30), flying=True)
    flight.start()
    flight.bench.run(4.0)
    flight.bench.send(common.Stop())
    flight.bench.run(0.5)
    (media,) = flight.bench.firmware.payload.media
    assert 2 <= len(media.resources) <= 6
    assert not flight.bench.firmware.payload.cameras.busy


# -- what keeps it from starting


def refused(flight: Flight) -> set[Part]:
    flight.start()
    assert flight.bench.of(common.StartingErrorEvent)
    assert flight.states == [PlayingState.STOPPED]
    found: dict[Part, int] = {}
    for event in flight.bench.of(common.ComponentStateListChanged):
        found[event.component] = event.State
    return {part for part, ok in found.items() if not ok}


def test_an_unknown_file_and_a_bad_one() -> None:
    flight = Flight(line(93, 1))
    flight.uid = "gone"
    assert refused(flight) == {Part.MAVLINK_FILE}
    assert common.ComponentStateListChanged(Part.MAVLINK_FILE, 0) in all_states(flight.bench.firmware)
    flight = Flight(line(19))
    assert refused(flight) == {Part.MAVLINK_FILE}
    flight = Flight(line(93, 1))
    flight.type = V2  # a 4K has none
    assert refused(flight) == {Part.MAVLINK_FILE}


def test_refused_file_is_cleared_by_the_next_start() -> None:
    flight = Flight(line(93, 1))
    good, flight.uid = flight.uid, "gone"
    refused(flight)
    flight.uid = good
    flight.bench.events.clear()
    flight.play()
    assert common.ComponentStateListChanged(Part.MAVLINK_FILE, 1) in flight.bench.events


def test_no_way_point_beyond_the_fence_or_the_ceiling() -> None:
    flight = Flight(line(16, at=(120.0, 0.0, 10.0)))
    flight.bench.send(ardrone3.NoFlyOverMaxDistance(1))
    assert refused(flight) == {Part.WAYPOINTS_BEYOND_GEOFENCE}
    flight = Flight(line(16, at=(0.0, 0.0, 151.0)))
    assert refused(flight) == {Part.WAYPOINTS_BEYOND_GEOFENCE}
    # 185 m above the sea are 150 m above a ground at 35 m.
    flight = Flight(line(16, at=(0.0, 0.0, 184.0), frame=0))
    flight.start()
    assert flight.states == [PlayingState.PLAYING]


def test_fence_of_a_plan_is_around_the_take_off() -> None:
    near = Flight(line(16, at=(230.0, 0.0, 10.0)))
    near.bench.body.place(200.0, 0.0, 0.0)
    near.bench.run(0.1)
    near.bench.send(ardrone3.NoFlyOverMaxDistance(1))
    near.start()
    assert near.states == [PlayingState.PLAYING]
    far = Flight(line(16, at=(50.0, 0.0, 10.0)))
    far.bench.body.place(200.0, 0.0, 0.0)
    far.bench.run(0.1)
    far.bench.send(ardrone3.NoFlyOverMaxDistance(1))
    assert refused(far) == {Part.WAYPOINTS_BEYOND_GEOFENCE}


def test_not_without_gps_or_calibration() -> None:
    flight = Flight(line(93, 1))
    flight.bench.faults.gps = False
    flight.bench.run(0.1)
    assert flight.bench.of(common.AvailabilityStateChanged)[-1].AvailabilityState == 0
    assert refused(flight) == {Part.GPS}
    assert flight.bench.of(common.MavlinkPlayErrorStateChanged)[-1].error is PlayError.GPS_NOT_FIXED
    flight = Flight(line(93, 1))
    flight.bench.faults.magneto_required = True
    flight.bench.run(0.1)
    assert refused(flight) == {Part.CALIBRATION, Part.TAKE_OFF}


@pytest.mark.parametrize("part", Part)
def test_plan_with_failed_component_is_refused(part: Part) -> None:
    flight = Flight(line(93, 1))
    flight.bench.faults.refuse_plan = frozenset({part})
    flight.bench.run(0.1)
    assert refused(flight) == {part}
    flight.bench.faults.refuse_plan = frozenset()
    flight.bench.run(0.1)
    flight.bench.events.clear()
    flight.start()
    assert flight.states == [PlayingState.PLAYING]


# -- without a controller


def test_plan_ends_at_link_loss_unless_allowed() -> None:
    flight = Flight(line(93, 5), flying=True)
    bench = flight.bench
    flight.start()
    bench.firmware.link_lost()
    assert flight.states[-1] is PlayingState.STOPPED
    flight = Flight(line(93, 5), flying=True)
    bench = flight.bench
    bench.send(common.ReturnHomeOnDisconnect(0))
    bench.send(rth.SetDelay(2))
    flight.start()
    bench.firmware.link_lost()
    bench.run(4.0)
    assert flight.states == [PlayingState.PLAYING]
    bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)
    assert bench.run_until(lambda: bool(bench.of(rth.State))) == pytest.approx(2.0, abs=0.1)
    assert bench.of(rth.State)[-1].reason is StateReason.CONNECTION_LOST


# -- the Ai


def test_version_2_goes_where_take_off_and_landing_say() -> None:
    here = (8.0, 0.0, 6.0)
    flight = Flight(line(22, 0, 0, 0, NAN, at=here), line(21, 0, 0, 0, NAN, at=(8.0, 12.0, 4.0)), model="ai")
    flight.start()
    bench = flight.bench
    flight.until_item(0)
    assert (bench.pose.north, bench.pose.east, bench.pose.up) == pytest.approx(here, abs=5.0)
    bench.run_until(lambda: bench.state is S.LANDED)
    assert (bench.pose.north, bench.pose.east) == pytest.approx((8.0, 12.0), abs=5.0)
    assert flight.executed == [0, 1]


def test_the_way_in_goes_high() -> None:
    # Up to the return height (20 m), over there, then down to the way point's 5 m.
    flight = Flight(line(16, 0, 1, at=(15.0, 0.0, 5.0)), model="ai", flying=True)
    bench = flight.bench
    flight.start()
    bench.run_until(lambda: bench.pose.up > 19.0)
    assert bench.pose.north == pytest.approx(0.0, abs=0.5)
    bench.run_until(lambda: bench.pose.north > 10.0)
    assert bench.pose.up == pytest.approx(20.0, abs=1.0)
    bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)
    assert bench.pose.up == pytest.approx(5.0, abs=1.0)


def test_start_at_an_item_under_another_name() -> None:
    flight = Flight(line(22), line(93, 50), line(93, 1), model="ai", flying=True)
    bench = flight.bench
    answer = bench.send(flight_plan.StartAtV2(flight.uid, "mine", flight_plan.MavlinkType.FLIGHT_PLAN_V2, 2, 1))
    assert answer == [common.MavlinkFilePlayingStateChanged(PlayingState.PLAYING, "mine", V2)]
    bench.firmware.link_lost()  # plays on: that is what the last argument says
    bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)
    assert flight.executed == [2]
    (recovery,) = bench.of(flight_plan.RecoveryInfo)
    assert (recovery.flightplan_id, recovery.custom_id, recovery.item) == (flight.uid, "mine", 2)
    assert recovery in all_states(bench.firmware)
    assert bench.send(flight_plan.ClearRecoveryInfo()) == [flight_plan.RecoveryInfo("", "", 0, 0, "")]


def test_plan_stopped_at_start_reports_no_run_time() -> None:
    """Start and Landing may arrive between two steps of the simulation; the running time is unsigned."""
    flight = Flight(line(22), line(93, 50), model="ai", flying=True)
    bench = flight.bench
    bench.run(5.0)
    bench.send(flight_plan.StartAtV2(flight.uid, "mine", flight_plan.MavlinkType.FLIGHT_PLAN_V2, 0, 1))
    bench.send(ardrone3.Landing())
    (recovery,) = bench.of(flight_plan.RecoveryInfo)
    assert recovery.running_time == 0


def test_ai_reports_missing_inputs_of_a_flight_plan() -> None:
    bench = Bench("ai")
    bench.faults.gps = False
    bench.run(0.1)
    assert bench.of(flight_plan.Info)[-1].missing_inputs == 1 << flight_plan.Indicator.DRONE_GPS
    flight = Flight(line(93, 1), model="ai", flying=True)
    answer = flight.bench.send(flight_plan.StartAt(flight.uid, "", flight_plan.MavlinkType.FLIGHT_PLAN_V2, 7))
    assert common.StartingErrorEvent() in answer  # there is no such item


def test_a_way_point_out_of_reach_is_skipped() -> None:
    flight = Flight(line(16, 0, 1, at=(50.0, 0.0, 20.0)), line(93, 1), model="ai", flying=True)
    bench = flight.bench
    flight.start()
    bench.run_until(lambda: bench.pose.north > 5.0)
    bench.send(ardrone3.MaxDistance(20.0))
    bench.send(ardrone3.NoFlyOverMaxDistance(1))
    bench.run_until(lambda: flight.states[-1] is PlayingState.STOPPED)
    assert bench.of(flight_plan.WaypointSkipped) == [flight_plan.WaypointSkipped(0)]
