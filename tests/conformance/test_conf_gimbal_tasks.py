"""The gimbal beside other tasks: regions of interest, missions, mounts, pictures; judged by the simulator."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import goto
from support.flavours import both
from support.gimbal import (
    CONFIGURE,
    EARTH_FRAME,
    LEVEL,
    NAN,
    PITCHYAW,
    VEHICLE_FRAME,
    YAW_LOCK,
    beat,
    euler,
    looks,
    next_truth,
    rate,
    request,
    send_rates,
    truth,
)
from support.mav import Client
from support.missions import ACTIVE, COMPLETE, PAUSED, put, start, state, takeoff, way
from support.plans import Item
from support.world import HOME, World, loopback, world

from anafi_mav import geo, units
from anafi_mav.arsdk.messages import common, gimbal
from anafi_mav.arsdk.messages.ardrone3 import PoiMode, PoiStatus
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.mavlink import dialect as newer
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.faults import CLEAR, Impairment
from anafi_mav.vehicle.base.modes import FlightMode

ACCEPTED, DENIED, REJECTED, UNSUPPORTED = (
    dialect.MAV_RESULT_ACCEPTED,
    dialect.MAV_RESULT_DENIED,
    dialect.MAV_RESULT_TEMPORARILY_REJECTED,
    dialect.MAV_RESULT_UNSUPPORTED,
)
CANCELLED = newer.MAV_RESULT_CANCELLED
ROI, NO_ROI, ROI_SYSTEM, ROI_BESIDE, OLD_ROI = (
    dialect.MAV_CMD_DO_SET_ROI_LOCATION,
    dialect.MAV_CMD_DO_SET_ROI_NONE,
    dialect.MAV_CMD_DO_SET_ROI_SYSID,
    dialect.MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET,
    dialect.MAV_CMD_DO_SET_ROI,
)
MOUNT, MOUNT_MODE = dialect.MAV_CMD_DO_MOUNT_CONTROL, dialect.MAV_CMD_DO_MOUNT_CONFIGURE
TARGETING, GPS_POINT = dialect.MAV_MOUNT_MODE_MAVLINK_TARGETING, dialect.MAV_MOUNT_MODE_GPS_POINT
PAUSE, INTERVAL = dialect.MAV_CMD_DO_PAUSE_CONTINUE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL
EAST = geo.destination(HOME[0], HOME[1], 0.0, 20.0)
NORTH = geo.destination(HOME[0], HOME[1], 60.0, 0.0)
STATUS, ATTITUDE = "GIMBAL_MANAGER_STATUS", "GIMBAL_DEVICE_ATTITUDE_STATUS"


def pois(w: World) -> list[Any]:
    return [entry.args for entry in w.commands("ardrone3.Piloting.StartPilotedPOIV2")]


async def heads(w: World, degrees: float) -> None:
    """Wait until the simulated drone's true heading is this."""
    since = w.drone.log[-1].t
    wanted = degrees * units.RAD_PER_DEG
    await w.drone.wait_log(
        lambda e: e.kind == "pose" and abs(units.wrap_pi(e.args["yaw"] - wanted)) < 0.05, 20.0, since=since
    )


async def region(w: World, status: PoiStatus, mode: PoiMode) -> None:
    """Wait until the drone has reported this of its region of interest."""
    poi = w.gateway.systems[0].drone.poi
    await w.client.wait("HEARTBEAT", lambda beat: (poi.state.status, poi.state.mode) == (status, mode), since=0)


async def test_region_is_locked_until_a_client_aims_the_gimbal() -> None:
    async with world() as w:
        await w.take_off(20.0)
        # A rate in force ends before the drone takes the gimbal.
        assert (await w.client.command(PITCHYAW, NAN, NAN, 3.0, NAN, x=LEVEL)).result == ACCEPTED
        assert (await w.client.command(ROI, 154.0, x=EAST[0], y=EAST[1], z=HOME[2])).result == ACCEPTED
        assert [poi["mode"] for poi in pois(w)] == [PoiMode.LOCKED_GIMBAL]
        await heads(w, 90.0)
        await looks(w, pitch_absolute=-45.0)
        assert not [m for _, m in w.client.since(0, "STATUSTEXT") if "Gimbal" in m.text]
        # Angles: the nose stays on the region, the gimbal is the client's.
        assert (await w.client.command(PITCHYAW, -10.0, 0.0, x=LEVEL)).result == ACCEPTED
        assert [poi["mode"] for poi in pois(w)] == [PoiMode.LOCKED_GIMBAL, PoiMode.FREE_GIMBAL]
        await looks(w, pitch_absolute=-10.0)
        assert abs(math.degrees(w.drone.pose.yaw) - 90.0) < 3.0
        # Locked again, and freed by a message.
        assert (await w.client.command(ROI, x=EAST[0], y=EAST[1], z=HOME[2])).result == ACCEPTED
        await looks(w, pitch_absolute=-45.0)
        pitch = 25.0 * units.RAD_PER_DEG
        w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, LEVEL, 1, pitch, NAN, NAN, NAN))
        await looks(w, pitch_absolute=25.0)
        assert pois(w)[-1]["mode"] == PoiMode.FREE_GIMBAL
        assert (await w.client.command(NO_ROI, 2.0)).result == DENIED
        assert (await w.client.command(NO_ROI)).result == ACCEPTED
        assert len(w.commands("ardrone3.Piloting.StopPilotedPOI")) == 1


def report_place(system: Client, to: tuple[float, float]) -> None:
    """Let another system report that it is at a place, at the height of home."""
    place = (round(to[0] * 1e7), round(to[1] * 1e7), round(HOME[2] * 1e3), 0, 0, 0, 0, 0)
    system.send(dialect.MAVLink_global_position_int_message(0, *place))


async def test_region_follows_another_system_that_reports_its_position() -> None:
    async with world() as w:
        await w.take_off(20.0)
        other = await w.connect(7, 1)

        assert (await w.client.command(ROI_SYSTEM, 7.0)).result == REJECTED
        assert (await w.client.command(ROI_SYSTEM, NAN)).result == REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "ROI refused: param1 is no system", since=0)
        report_place(other, EAST)
        assert (await w.client.command(ROI_SYSTEM, 7.0)).result == ACCEPTED
        await heads(w, 90.0)
        report_place(other, NORTH)
        await heads(w, 0.0)
        await looks(w, pitch_absolute=-math.degrees(math.atan2(20.0, 60.0)))
        await w.client.wait("STATUSTEXT", lambda m: m.text == "ROI kept: no position of system 7", timeout=8.0)
        assert (await w.client.command(NO_ROI)).result == ACCEPTED
        count = len(pois(w))
        report_place(other, EAST)
        await next_truth(w)
        await next_truth(w)
        assert len(pois(w)) == count


async def test_region_of_a_place_follows_no_system_of_an_older_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """The newer command arrives between the drone's confirmation of the older one and its acknowledgement."""
    async with world() as w:
        await w.take_off(20.0)
        other = await w.connect(7, 1)

        poi = w.gateway.systems[0].drone.poi
        confirmed = poi.start

        async def start(*place: Any) -> None:
            await confirmed(*place)
            if len(pois(w)) == 1:
                assert (await w.client.command(ROI, x=NORTH[0], y=NORTH[1], z=HOME[2])).result == ACCEPTED

        monkeypatch.setattr(poi, "start", start)
        report_place(other, EAST)
        await next_truth(w)
        await w.client.command(ROI_SYSTEM, 7.0)
        await heads(w, 0.0)
        report_place(other, geo.destination(HOME[0], HOME[1], 0.0, 40.0))
        for _ in range(10):
            await next_truth(w)
        assert len(pois(w)) == 2


async def test_region_follows_another_drone_of_the_gateway() -> None:
    address, drones = loopback(), [loopback(), loopback()]
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=tuple(DroneConfig(name=f"d{n}", sysid=n, address=place) for n, place in enumerate(drones, 1)),
        http=False,
        video=False,
    )
    homes = (HOME, (*NORTH, HOME[2]))
    specs = [DroneSpec(address=place, home=home, http_port=None) for place, home in zip(drones, homes, strict=True)]
    async with Simulator(specs, speed=3.0, seed=1) as simulator, Gateway(config) as gateway:
        assert await gateway.ready(10.0)
        w = World(simulator, gateway, address, "px4")
        await w.connect()
        try:
            await w.client.wait("GLOBAL_POSITION_INT", lambda m: m.get_srcSystem() == 2, since=0)
            await w.take_off(20.0)
            assert (await w.client.command(ROI_SYSTEM, 1.0)).result == REJECTED
            assert (await w.client.command(ROI_SYSTEM, 2.0)).result == ACCEPTED
            await looks(w, pitch_absolute=-math.degrees(math.atan2(20.0, 60.0)))
            await heads(w, 0.0)
            other = simulator.drones[1]
            for command, z in (
                (dialect.MAV_CMD_COMPONENT_ARM_DISARM, NAN),
                (dialect.MAV_CMD_NAV_TAKEOFF, HOME[2] + 20.0),
            ):
                assert (await w.client.command(command, 1.0, z=z, target=(2, 1))).result == ACCEPTED
            await other.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 10.0, 20.0)
            place = geo.destination(HOME[0], HOME[1], 60.0, 60.0)
            goto = dialect.MAV_CMD_DO_REPOSITION
            frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
            ack = await w.client.command(goto, -1.0, 1.0, frame=frame, x=place[0], y=place[1], z=20.0, target=(2, 1))
            assert ack.result == ACCEPTED
            await heads(w, 45.0)
        finally:
            await w.client.close()
            await simulator.close()


async def test_region_beside_the_path_turns_nose_and_gimbal() -> None:
    """40 m to the north and 40 m up: the path rises by 45 deg; 10 deg below it, and 30 deg to the right."""
    there = geo.destination(HOME[0], HOME[1], 40.0, 0.0)
    async with world(speed=1.0) as w:
        assert (await w.client.command(ROI_BESIDE, x=0.0, y=0.0, z=0.0)).result == REJECTED
        await w.take_off(5.0)
        frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
        goto = await w.client.command(
            dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=frame, x=there[0], y=there[1], z=45.0
        )
        assert goto.result == ACCEPTED
        assert (await w.client.command(ROI_BESIDE, x=-10.0, y=0.0, z=30.0)).result == ACCEPTED
        await heads(w, 30.0)
        await w.client.wait(ATTITUDE, lambda m: abs(euler(m)[1] - 35.0) < 3.0)
        assert truth(w).pitch_absolute == pytest.approx(35.0, abs=3.0)


async def answer(client: Client, command: int, since: int) -> int:
    """Return the final result of a command that was sent without waiting."""
    final = dialect.MAV_RESULT_IN_PROGRESS
    ack = await client.wait("COMMAND_ACK", lambda m: m.command == command and m.result != final, since=since)
    return int(ack.result)


async def test_angle_beside_the_end_of_a_region_starts_no_region() -> None:
    """The drone reports the end later than it is commanded: until then nothing may be sent for the region."""
    async with world() as w:
        await w.take_off(20.0)
        other = await w.connect(254, 190)
        place = {"x": EAST[0], "y": EAST[1], "z": HOME[2]}
        assert (await w.client.command(ROI, **place)).result == ACCEPTED
        # The same region after an angle is no retransmission: it locks the gimbal again.
        assert (await w.client.command(PITCHYAW, -10.0, x=LEVEL)).result == ACCEPTED
        assert (await w.client.command(ROI, **place)).result == ACCEPTED
        modes = [PoiMode.LOCKED_GIMBAL, PoiMode.FREE_GIMBAL, PoiMode.LOCKED_GIMBAL]
        assert [poi["mode"] for poi in pois(w)] == modes

        ends: list[tuple[int, tuple[float, ...]]] = [
            (NO_ROI, ()),
            (dialect.MAV_CMD_DO_SET_MODE, (1, 4, 3)),
            (dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, ()),
        ]
        for number, (end, params) in enumerate(ends):
            # A Hold of this client ends the second region, a return of the other client the third.
            if number:
                assert (await other.command(ROI, **place)).result == ACCEPTED
            count, sender = len(pois(w)), other if number == 2 else w.client
            mark, since = sender.mark(), w.client.mark()
            sender.send_command(end, *params)
            w.client.send_command(PITCHYAW, -20.0 - number, x=LEVEL)
            assert await answer(sender, end, mark) == ACCEPTED
            assert await answer(w.client, PITCHYAW, since) == ACCEPTED
            await looks(w, pitch_absolute=-20.0 - number)
            assert len(pois(w)) == count
            assert w.gateway.systems[0].drone.poi.state.status == PoiStatus.AVAILABLE
            if sender is w.client and number:  # retransmitted after another client's command, it is not begun again
                assert (await other.command(ROI, **place)).result == CANCELLED
                other.send_command(NO_ROI)
        assert w.gateway.systems[0].vehicle.mode is FlightMode.RETURN
        # A return is not replaced by a region, by whichever command or message.
        for command, params in ((ROI, {}), (MOUNT, {"z": GPS_POINT})):
            assert (await other.command(command, 0.0, 0.0, 0.0, 0.0, **{**place, **params})).result == REJECTED
        assert len(pois(w)) == count


async def test_mount_place_replaces_a_goto_as_a_region_does() -> None:
    there = geo.destination(HOME[0], HOME[1], 200.0, 0.0)
    async with world() as w:
        await w.take_off(10.0)
        other = await w.connect(254, 190)
        frame = dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT
        goto = {"frame": frame, "x": there[0], "y": there[1], "z": 10.0}
        assert (await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, **goto)).result == ACCEPTED
        # A message, which may be one of a stream, is refused; the flight goes on.
        other.send(dialect.MAVLink_mount_configure_message(1, 1, GPS_POINT, 1, 1, 1))
        other.send(dialect.MAVLink_mount_control_message(1, 1, *[round(value * 1e7) for value in EAST], 300, 0))
        await other.wait("STATUSTEXT", lambda m: m.text == "ROI refused: drone flies", since=0)
        # A command replaces it, in the order of flight commands.
        ack = await other.command(MOUNT, 0.0, 0.0, 0.0, 0.0, x=EAST[0], y=EAST[1], z=GPS_POINT)
        assert ack.result == ACCEPTED
        # No change of the mode shows that the goto is over.
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Goto ended: region of interest instead", since=0)
        await heads(w, 90.0)
        names = [entry.name.rpartition(".")[2] for entry in w.drone.log if entry.kind == "command"]
        assert [name for name in names if name in ("moveTo", "CancelMoveTo", "StartPilotedPOIV2")] == [
            "moveTo",
            "CancelMoveTo",
            "StartPilotedPOIV2",
        ]
        # A region that still ends a goto is withdrawn by "none".
        goto["z"] = 12.0  # not the earlier one sent again
        assert (await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, **goto)).result == ACCEPTED
        mark, count = other.mark(), len(pois(w))
        other.send_command(ROI, x=EAST[0], y=EAST[1], z=HOME[2])
        other.send_command(NO_ROI)
        assert await answer(other, ROI, mark) == REJECTED
        assert await answer(other, NO_ROI, mark) == ACCEPTED
        await next_truth(w)
        assert len(pois(w)) == count


async def test_region_is_refused_while_a_mission_is_flown() -> None:
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(60.0, 0.0, 6.0), way(90.0, 0.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await state(w, ACTIVE, seq=1, since=mark)
        for command in (ROI, OLD_ROI):
            assert (await w.client.command(command, 0.0, x=EAST[0], y=EAST[1], z=HOME[2])).result == REJECTED
        assert pois(w) == []
        assert w.gateway.systems[0].vehicle.mission.flying


async def test_message_beside_a_command_on_a_region_is_carried_out() -> None:
    """Both wait until the drone frees the gimbal; the newer target counts."""
    async with world() as w:
        await w.take_off(20.0)
        assert (await w.client.command(ROI, x=EAST[0], y=EAST[1], z=HOME[2])).result == ACCEPTED
        await region(w, PoiStatus.RUNNING, PoiMode.LOCKED_GIMBAL)
        mark = w.client.mark()
        began = w.drone.log[-1].t
        w.client.send_command(PITCHYAW, -20.0, x=LEVEL)
        await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.StartPilotedPOIV2", 5.0, since=began)
        pitch = 30.0 * units.RAD_PER_DEG
        w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, LEVEL, 1, pitch, NAN, NAN, NAN))
        assert await answer(w.client, PITCHYAW, mark) == CANCELLED
        await looks(w, pitch_absolute=30.0)
        assert [poi["mode"] for poi in pois(w)] == [PoiMode.LOCKED_GIMBAL, PoiMode.FREE_GIMBAL]
        assert w.commands("ardrone3.Piloting.StopPilotedPOI") == []


@pytest.mark.parametrize(
    ("flavour", "frame", "z"),
    [
        ("px4", dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT, 0.0),
        ("px4", None, HOME[2]),
        ("ardupilot", dialect.MAV_FRAME_GLOBAL, HOME[2]),
        ("ardupilot", None, 0.0),  # dronekit, Tower
    ],
)
async def test_older_region_command_reads_the_place_first(flavour: str, frame: int | None, z: float) -> None:
    """Mission Planner and dronekit send param1 = 0 with a place; that is no "none"."""
    async with world(flavour=flavour) as w:
        await w.take_off(20.0)
        ack = await w.client.command(OLD_ROI, 0.0, 0.0, 0.0, 0.0, frame=frame, x=EAST[0], y=EAST[1], z=z)
        assert ack.result == ACCEPTED
        await heads(w, 90.0)
        await looks(w, pitch_absolute=-45.0)
        assert (await w.client.command(OLD_ROI, 0.0)).result == ACCEPTED
        assert len(w.commands("ardrone3.Piloting.StopPilotedPOI")) == 1


def owner(status: Any) -> tuple[int, int]:
    return status.primary_control_sysid, status.primary_control_compid


@pytest.mark.parametrize("changes", [frozenset(), frozenset({"gimbal"}), frozenset({"photos"})])
@both
async def test_conf_074_payload_changed_during_a_pause_is_set_again(flavour: str, changes: frozenset[str]) -> None:
    """A survey goes on with its own pitch and photos; untouched ones go on in the file that the drone has."""
    aim = Item(MOUNT, 0.0, 0.0, z=TARGETING, p1=-60.0, p2=NAN, p3=NAN, p4=NAN, frame=2)
    begin = Item(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p1=0.0, p2=2.0, p3=0.0, p4=NAN, frame=2)
    end = Item(dialect.MAV_CMD_IMAGE_STOP_CAPTURE, 0.0, 0.0, p1=0.0, frame=2)
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), aim, begin, way(60.0, 0.0, 6.0), way(60.0, 20.0, 6.0), end])
        await start(w)
        await state(w, ACTIVE, seq=3, since=0)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0, timeout=30.0)
        mark = w.client.mark()
        assert (await w.client.command(PAUSE, 0.0)).result == ACCEPTED
        await state(w, PAUSED, seq=3, since=mark)
        if "gimbal" in changes:
            assert (await w.client.command(PITCHYAW, 20.0, x=LEVEL)).result == ACCEPTED
            await looks(w, pitch_absolute=20.0)
        if "photos" in changes:
            stop = dialect.MAV_CMD_IMAGE_STOP_CAPTURE
            assert (await w.client.command(stop, 0.0, target=(1, 100))).result == ACCEPTED
        assert (await w.client.command(PAUSE, 1.0)).result == ACCEPTED
        await looks(w, pitch_absolute=-60.0)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", timeout=30.0)
        await state(w, ACTIVE, seq=3)
        before, after = (entry.args["filepath"] for entry in w.commands("common.Mavlink.Start"))
        assert (before != after) is bool(changes)


async def test_resumed_mission_that_aims_at_once_reports_no_change() -> None:
    """Near to a way point the line after it, which aims, is reported in one frame with the resumption.

    An event that is not acknowledged holds the others back, so that they share the next frame.
    """
    executed = common.MissionItemExecuted.NAME
    aim = Item(MOUNT, 0.0, 0.0, z=TARGETING, p1=-60.0, p2=NAN, p3=NAN, p4=NAN, frame=2)
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), way(40.0, 0.0, 6.0, p2=10.0), aim, way(60.0, 0.0, 6.0)])
        await start(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 27.0, 30.0)
        mark = w.client.mark()
        assert (await w.client.command(PAUSE, 0.0)).result == ACCEPTED
        await state(w, PAUSED, seq=1, since=mark)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["vn"]) < 0.1 and e.args["north"] > 30.0)
        w.drone.faults.unreported = frozenset({gimbal.Attitude.NAME})
        w.drone.faults.late = dict.fromkeys((common.MavlinkFilePlayingStateChanged.NAME, executed), 0.2)
        w.client.send_command(PAUSE, 1.0)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == common.Start.NAME)
        w.drone.faults.down = Impairment(loss=1.0)
        w.drone.faults.battery = 80
        await w.drone.wait_log(lambda e: e.name == executed and e.args["idx"] == 3)
        w.drone.faults.down = CLEAR
        await state(w, COMPLETE, since=mark)
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert "Mission resumes: gimbal or camera were changed" not in said


@pytest.mark.parametrize("tilts", [True, False])
async def test_ai_resumes_at_its_height_and_reports_a_changed_gimbal(tilts: bool) -> None:
    """A new file would begin with a climb to the height of a return, 20 m."""
    aim = Item(MOUNT, 0.0, 0.0, z=TARGETING, p1=-60.0, p2=NAN, p3=NAN, p4=NAN, frame=2)
    async with world(model="ai", web=True) as w:
        await put(w, [takeoff(6.0), way(5.0, 0.0, 6.0), aim, way(60.0, 0.0, 6.0)])
        await start(w)
        await state(w, ACTIVE, seq=3, since=0)
        await looks(w, pitch_absolute=-60.0)
        mark = w.client.mark()
        assert (await w.client.command(PAUSE, 0.0)).result == ACCEPTED
        await state(w, PAUSED, seq=3, since=mark)
        if tilts:
            assert (await w.client.command(PITCHYAW, 20.0, x=LEVEL)).result == ACCEPTED
            await looks(w, pitch_absolute=20.0)
        assert (await w.client.command(PAUSE, 1.0)).result == ACCEPTED
        await state(w, COMPLETE, since=mark)
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert ("Mission resumes: gimbal or camera were changed" in said) is tilts
        assert len({entry.args["flightplan_id"] for entry in w.commands("flight_plan.start_at_v2")}) == 1
        assert w.drone.pose.up < 8.0


@both
async def test_conf_100_mission_has_the_gimbal_while_its_items_come(flavour: str) -> None:
    aim = Item(PITCHYAW, 0.0, 0.0, z=1.0, p1=-30.0, p2=NAN, p3=NAN, p4=NAN, frame=2)
    async with world(flavour=flavour, web=True) as w:
        me = (255, 190)

        async def belongs(to: tuple[int, int], since: int) -> None:
            await w.client.wait(STATUS, lambda m: owner(m) == to, since=since, timeout=30.0)

        await put(w, [takeoff(6.0), way(60.0, 0.0, 6.0), aim, way(75.0, 0.0, 6.0)])
        beat(w.client)
        assert (await w.client.command(CONFIGURE, *me, -1, -1)).result == ACCEPTED
        assert (await w.client.command(PITCHYAW, NAN, NAN, -0.5, NAN, x=LEVEL)).result == ACCEPTED
        mark = w.client.mark()
        await start(w)
        await belongs((1, 1), mark)
        assert (await w.client.command(CONFIGURE, *me, -1, -1)).result == REJECTED
        assert (await w.client.command(PITCHYAW, 20.0, x=LEVEL)).result == REJECTED
        assert (await w.client.command(NO_ROI)).result == REJECTED
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Gimbal refused: mission has control", since=mark)
        last = w.commands("gimbal.set_target")[-1].args
        assert (last["control_mode"], last["pitch"]) == (1, 0.0)  # the client's rate was stopped

        await state(w, ACTIVE, seq=1, since=mark)
        mark = w.client.mark()
        assert (await w.client.command(PAUSE, 0.0)).result == ACCEPTED
        await state(w, PAUSED, since=mark)
        await belongs((0, 0), mark)
        beat(w.client)
        assert (await w.client.command(CONFIGURE, *me, -1, -1)).result == ACCEPTED
        assert (await w.client.command(PITCHYAW, 20.0, x=LEVEL)).result == ACCEPTED
        await looks(w, pitch_absolute=20.0)
        mark = w.client.mark()
        assert (await w.client.command(PAUSE, 1.0)).result == ACCEPTED
        await belongs((1, 1), mark)
        await looks(w, pitch_absolute=-30.0)  # the mission's own item
        await belongs((0, 0), mark)
        assert (await w.client.command(PITCHYAW, 5.0, x=LEVEL)).result == ACCEPTED


@pytest.mark.parametrize("is_command", [True, False])
async def test_angles_while_a_region_begins_free_the_gimbal(is_command: bool) -> None:
    """Within the round trip of its start: the drone would lock the gimbal after them."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        w.client.send_command(ROI, x=EAST[0], y=EAST[1], z=0.0, frame=6)
        await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.StartPilotedPOIV2", 5.0)
        if is_command:
            assert (await w.client.command(PITCHYAW, 20.0, NAN, NAN, NAN, x=LEVEL)).result == ACCEPTED
        else:
            pitch = math.radians(20.0)
            w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, LEVEL, 1, pitch, NAN, NAN, NAN))
        await looks(w, pitch_absolute=20.0)
        starts = [entry.args["mode"] for entry in w.commands("ardrone3.Piloting.StartPilotedPOIV2")]
        assert starts == [PoiMode.LOCKED_GIMBAL, PoiMode.FREE_GIMBAL]


@pytest.mark.parametrize("is_command", [True, False])
async def test_angles_while_a_goto_ends_for_a_region_keep_the_gimbal(is_command: bool) -> None:
    """The region has been commanded before them, and begins after them."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        assert await goto(w, 200.0, 6.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 10.0, 20.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        w.client.send_command(ROI, x=EAST[0], y=EAST[1], z=0.0, frame=6)
        await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.CancelMoveTo", 5.0)
        if is_command:
            assert (await w.client.command(PITCHYAW, 20.0, NAN, NAN, NAN, x=LEVEL)).result == ACCEPTED
        else:
            pitch = math.radians(20.0)
            w.client.send(dialect.MAVLink_gimbal_manager_set_pitchyaw_message(1, 1, LEVEL, 1, pitch, NAN, NAN, NAN))
        start = await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.StartPilotedPOIV2", 5.0)
        assert start.args["mode"] == PoiMode.FREE_GIMBAL
        await looks(w, pitch_absolute=20.0)


async def test_conf_139_mount_commands_and_messages_have_the_same_signs() -> None:
    async with world(flavour="ardupilot") as w:
        assert (await w.client.command(MOUNT, -30.0, 5.0, 10.0, 0.0, x=0.0, y=0.0, z=TARGETING)).result == ACCEPTED
        await looks(w, pitch_absolute=-30.0, roll_absolute=5.0)
        shown = await w.client.wait("MOUNT_ORIENTATION", lambda m: abs(m.pitch + 30.0) < 0.5)
        assert (shown.roll, shown.yaw) == pytest.approx((5.0, 0.0), abs=0.5)
        status = await request(w.client, dialect.MAVLINK_MSG_ID_MOUNT_STATUS, "MOUNT_STATUS")
        assert (status.pointing_a, status.pointing_b) == pytest.approx((-3000, 500), abs=50)
        # dronekit: MOUNT_CONFIGURE, then MOUNT_CONTROL in hundredths of a degree.
        w.client.send(dialect.MAVLink_mount_configure_message(1, 1, TARGETING, 1, 1, 1))
        w.client.send(dialect.MAVLink_mount_control_message(1, 1, 1500, -500, 0, 0))
        await looks(w, pitch_absolute=15.0, roll_absolute=-5.0)
        assert (await w.client.command(MOUNT_MODE, dialect.MAV_MOUNT_MODE_NEUTRAL)).result == ACCEPTED
        await looks(w, pitch_absolute=0.0)
        for mode in (dialect.MAV_MOUNT_MODE_RETRACT, dialect.MAV_MOUNT_MODE_RC_TARGETING):
            assert (await w.client.command(MOUNT_MODE, mode)).result == UNSUPPORTED
            assert (await w.client.command(MOUNT, 10.0, 0.0, 0.0, 0.0, z=mode)).result == UNSUPPORTED
        w.client.send(dialect.MAVLink_mount_configure_message(1, 1, dialect.MAV_MOUNT_MODE_NEUTRAL, 1, 1, 1))
        w.client.send(dialect.MAVLink_mount_control_message(1, 1, 1500, 0, 0, 0))  # no angles in this mode
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Gimbal refused: mount mode 1 unsupported", since=0)
        assert truth(w).pitch_absolute == 0.0

        # A place: degE7 in single precision as MAVProxy sends it, and by message.
        await w.take_off(20.0)
        degrees = [value * 1e7 for value in EAST]
        ack = await w.client.command(MOUNT, 0.0, 0.0, 0.0, 0.0, x=degrees[0], y=degrees[1], z=GPS_POINT)
        assert ack.result == ACCEPTED
        await heads(w, 90.0)
        assert pois(w)[-1]["altitude"] == pytest.approx(0.0, abs=0.01)
        w.client.send(dialect.MAVLink_mount_configure_message(1, 1, GPS_POINT, 1, 1, 1))
        places = [round(value * 1e7) for value in NORTH]
        count = len(pois(w))
        for _ in range(5):  # a stream of one place is one region
            w.client.send(dialect.MAVLink_mount_control_message(1, 1, *places, 300, 0))
            await next_truth(w)
        await heads(w, 0.0)
        assert pois(w)[-1]["altitude"] == pytest.approx(3.0, abs=0.01)
        assert len(pois(w)) == count + 1


async def test_conf_099_components_refuse_what_is_not_theirs_at_once() -> None:
    async with world() as w:
        for component, message in ((100, dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION), (1, 259)):
            began = w.client.mark()
            ack = await w.client.command(dialect.MAV_CMD_REQUEST_MESSAGE, message, target=(1, component), timeout=1.0)
            assert ack.result == UNSUPPORTED
            assert ack.get_srcComponent() == component
            assert len(w.client.since(began, "COMMAND_ACK")) == 1


async def test_manager_status_leaves_five_times_a_second_on_request() -> None:
    async with world(speed=1.0) as w:

        async def per_second() -> float:
            await w.client.wait(STATUS)  # the first one after the change may be early
            mark = w.client.mark()
            for _ in range(5):
                await w.client.wait(STATUS)
            times = [m.time_boot_ms for _, m in w.client.since(mark, STATUS)]
            return 1000.0 * (len(times) - 1) / (times[-1] - times[0])

        ack = await w.client.command(INTERVAL, dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS, 200_000)
        assert ack.result == ACCEPTED
        assert await per_second() == pytest.approx(5.0, rel=0.15)
        ack = await w.client.command(INTERVAL, dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS, 0)
        assert ack.result == ACCEPTED
        assert await per_second() == pytest.approx(1.0, rel=0.15)


async def test_attitude_at_30_hz_is_made_of_pictures() -> None:
    """An Ai that turns: the yaw of each picture, to the nose and to north, belongs to one moment."""
    async with world(model="ai", speed=1.0, video_latency=0.1) as w:
        if w.drone.rtsp_port is None:
            pytest.skip(w.drone.rtsp_problem)
        await w.take_off(5.0)
        assert (await w.client.command(PITCHYAW, -30.0, 20.0, x=LEVEL)).result == ACCEPTED
        await looks(w, yaw_relative=20.0, pitch_absolute=-30.0)
        for message in (dialect.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS, dialect.MAVLINK_MSG_ID_ATTITUDE):
            assert (await w.client.command(INTERVAL, message, 33_333)).result == ACCEPTED
        await w.client.wait("HEARTBEAT", lambda _: w.gateway.systems[0].drone.video.state.playing, timeout=10.0)

        async def measure(flags: int, yaw: float) -> list[Any]:
            assert (await w.client.command(PITCHYAW, -30.0, yaw, x=flags)).result == ACCEPTED
            await looks(w, pitch_absolute=-30.0)
            mark = w.client.mark()
            turn = await w.client.command(dialect.MAV_CMD_CONDITION_YAW, 40.0, NAN, 1.0, 1.0)
            assert turn.result == ACCEPTED  # at its end
            for _ in range(3):
                await w.client.wait("HEARTBEAT")
            return [m for _, m in w.client.since(mark, ATTITUDE)]

        frame = VEHICLE_FRAME | EARTH_FRAME
        statuses = await measure(LEVEL, 20.0)
        times = [m.time_boot_ms for m in statuses]
        assert 1000.0 * (len(times) - 1) / (times[-1] - times[0]) == pytest.approx(30.0, rel=0.1)
        headings = {m.time_boot_ms: m.yaw for _, m in w.client.since(0, "ATTITUDE")}
        for status in statuses:
            assert status.flags & frame == VEHICLE_FRAME
            assert euler(status) == pytest.approx((0.0, -30.0, 20.0), abs=1.0)
            assert status.delta_yaw == pytest.approx(headings.get(status.time_boot_ms, status.delta_yaw), abs=1e-4)
        assert len({round(status.delta_yaw, 2) for status in statuses}) > 3  # it turned meanwhile
        locked = math.degrees(w.drone.pose.yaw) + 10.0
        for status in (await measure(LEVEL | YAW_LOCK, locked))[5:]:
            assert status.flags & frame == EARTH_FRAME
            assert euler(status) == pytest.approx((0.0, -30.0, locked), abs=2.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
async def test_pitch_up_is_positive_in_every_message(sign: float) -> None:
    """The worst error there is: up must be up in angles, rates, manual control and reports of the whole chain."""
    async with world(speed=1.0) as w:
        assert (await w.client.command(PITCHYAW, sign * 30.0, x=LEVEL)).result == ACCEPTED
        await looks(w, pitch_absolute=sign * 30.0)
        assert w.commands("gimbal.set_target")[-1].args["pitch"] == sign * 30.0  # gimbal.xml: + is up
        assert euler(await w.client.wait(ATTITUDE))[1] == pytest.approx(sign * 30.0, abs=0.5)
        send_rates(w.client, sign * 12.0)
        assert await rate(w, "pitch_absolute", 2) == pytest.approx(sign * 12.0, rel=0.1)


# QGroundControl 5 (GimbalController.cc): what it sends, in its order, with its unset parameters of 0.


async def station_command(client: Client, id: int, *params: float, target: int = 1) -> Any:
    """A COMMAND_LONG of QGroundControl: seven parameters, 0 where it sets none."""
    seven = [*params, *[0.0] * (7 - len(params))]
    return await client.command(id, *seven[:4], x=seven[4], y=seven[5], z=seven[6], target=(1, target))


@pytest.mark.parametrize(("model", "flavour"), [("4k", "px4"), ("ai", "ardupilot")])
async def test_requests_of_qgroundcontrol_turn_the_gimbal(model: str, flavour: str) -> None:
    has_yaw = model == "ai"
    async with world(model=model, flavour=flavour, speed=1.0) as w:
        station = w.client
        information = dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION
        # Each component with a heartbeat is asked; it then waits for status and attitude of the same device.
        ack = await station_command(station, dialect.MAV_CMD_REQUEST_MESSAGE, information, target=100)
        assert ack.result == UNSUPPORTED
        mark = station.mark()
        ack = await station_command(station, dialect.MAV_CMD_REQUEST_MESSAGE, information)
        assert ack.result == ACCEPTED
        manager = await station.wait("GIMBAL_MANAGER_INFORMATION", since=mark)
        device = manager.gimbal_device_id
        assert 1 <= device <= 6
        for kind in (STATUS, ATTITUDE):
            seen = await station.wait(kind)
            assert (seen.get_srcComponent(), seen.gimbal_device_id) == (1, device)
        # Its default rates, requested where one is late.
        for message in (dialect.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS, information + 5):
            assert (await station_command(station, INTERVAL, message, 0.0)).result == ACCEPTED

        # A click: it takes control and aims at once, without waiting for the acknowledgement.
        beat(station)
        mark = station.mark()
        take = dialect.MAVLink_command_long_message(1, 1, CONFIGURE, 0, 255, 190, -1, -1, NAN, NAN, device)
        flags = LEVEL | VEHICLE_FRAME
        click = dialect.MAVLink_command_long_message(1, 1, PITCHYAW, 0, -20.0, 15.0, NAN, NAN, flags, 0, device)
        station.send_raw(station.pack(take) + station.pack(click))
        for command in (CONFIGURE, PITCHYAW):
            ack = await station.wait("COMMAND_ACK", lambda ack, command=command: ack.command == command, since=mark)
            assert ack.result == ACCEPTED
        await looks(w, pitch_absolute=-20.0, yaw_relative=15.0 if has_yaw else 0.0)
        status = await station.wait(STATUS, since=mark)
        assert owner(status) == (255, 190)

        # Buttons: the same command with rates each 0.5 s while one is pressed, then zeros.
        for _ in range(3):
            beat(station)
            ack = await station_command(station, PITCHYAW, NAN, NAN, 10.0, -4.0, LEVEL, 0.0, device)
            assert ack.result == ACCEPTED
            assert await rate(w, "pitch_absolute", 2) == pytest.approx(10.0, rel=0.1)
        ack = await station_command(station, PITCHYAW, NAN, NAN, 0.0, 0.0, LEVEL, 0.0, device)
        assert ack.result == ACCEPTED
        assert await next_truth(w) == await next_truth(w)

        # Yaw lock: the angles that it shows, to north; and back.
        shown = await station.wait(ATTITUDE)
        pitch, yaw = euler(shown)[1], euler(shown)[2] + math.degrees(shown.delta_yaw)
        ack = await station_command(station, PITCHYAW, pitch, yaw, NAN, NAN, LEVEL | YAW_LOCK, 0.0, device)
        assert ack.result == ACCEPTED
        locked = await station.wait(ATTITUDE, lambda m: not has_yaw or m.flags & YAW_LOCK)
        frame = EARTH_FRAME if has_yaw else VEHICLE_FRAME
        assert locked.flags & (VEHICLE_FRAME | EARTH_FRAME) == frame
        ack = await station_command(station, PITCHYAW, 0.0, 0.0, NAN, NAN, flags, 0.0, device)
        assert ack.result == ACCEPTED
        await looks(w, pitch_absolute=0.0, yaw_relative=0.0)

        mark = station.mark()
        ack = await station_command(station, CONFIGURE, -3.0, -3.0, -1.0, -1.0, NAN, NAN, device)
        assert ack.result == ACCEPTED
        assert owner(await station.wait(STATUS, since=mark)) == (0, 0)
        assert not [m.text for _, m in station.since(0, "STATUSTEXT") if "Gimbal" in m.text]


# The end of things.


async def test_calibrating_gimbal_refuses_targets_at_once() -> None:
    async with world() as w:
        w.client.send_command(dialect.MAV_CMD_PREFLIGHT_CALIBRATION, 0, 0, 0, 0, x=2.0)
        await w.client.wait(ATTITUDE, lambda m: m.failure_flags & dialect.GIMBAL_DEVICE_ERROR_FLAGS_CALIBRATION_RUNNING)
        assert (await w.client.command(PITCHYAW, -20.0, x=LEVEL, timeout=1.0)).result == REJECTED
        assert w.commands("gimbal.set_target") == []


async def test_rate_in_force_is_stopped_after_a_lost_link() -> None:
    async with world(speed=1.0) as w:
        assert (await w.client.command(PITCHYAW, NAN, NAN, 4.0, NAN, x=LEVEL)).result == ACCEPTED
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 1.5)
        turned = truth(w).pitch_absolute
        w.drone.faults.mute = False
        await w.client.wait(ATTITUDE, timeout=30.0)
        await w.drone.wait_log(
            lambda e: e.name == "gimbal.set_target" and (e.args["control_mode"], e.args["pitch"]) == (1, 0.0), 10.0
        )
        before = await next_truth(w)
        assert before == await next_truth(w)
        assert before.pitch_absolute > turned - 1.0
