"""Answers that would be false: what a drone that falls, starts its motors or lands is said to do."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, PX4_HOLD, REJECTED
from support.params import write
from support.setpoints import said, texts
from support.world import World, world

from anafi_mav.arsdk.messages.ardrone3 import FlyingState

ARM, TAKEOFF, LAND = dialect.MAV_CMD_COMPONENT_ARM_DISARM, dialect.MAV_CMD_NAV_TAKEOFF, dialect.MAV_CMD_NAV_LAND
RTL, SET_MODE = dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH, dialect.MAV_CMD_DO_SET_MODE
FORCE = 21196
MAINTENANCE: dict[str, tuple[int, tuple[float, ...], dict[str, float]]] = {
    "Restart": (dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, (1,), {}),
    "Calibration of the compass": (dialect.MAV_CMD_PREFLIGHT_CALIBRATION, (0, 1), {}),
    "Calibration of the gimbal": (dialect.MAV_CMD_PREFLIGHT_CALIBRATION, (0, 0, 0, 0), {"x": 2.0}),
    "Compass calibration": (dialect.MAV_CMD_DO_START_MAG_CAL, (0, 0, 0), {}),
    "Return": (RTL, (), {}),
}


async def state(w: World, name: str) -> None:
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == name, 20.0)


async def test_falling_drone_is_neither_restarted_nor_calibrated() -> None:
    """After a motor cut the drone is in no flight and not on the ground: nothing is begun, and nothing is announced."""
    async with world(allow_kill=True, speed=0.5) as w:
        await w.take_off(20.0)
        assert (await w.client.command(ARM, 0, FORCE)).result == ACCEPTED
        await state(w, "emergency")
        mark = w.client.mark()
        for name, (command, params, rest) in MAINTENANCE.items():
            ack = await w.client.command(command, *params, **rest)
            assert ack.result == REJECTED, name
        assert w.drone.pose.up > 0.0
        said_now = texts(w.client, mark)
        assert [text for text in said_now if "refused: emergency stop" not in text] == []
        begun = ("Reboot", "MagnetoCalibration", "calibrate")
        assert [e.name for e in w.drone.log if e.kind == "command" and e.name.endswith(begun)] == []


async def test_origin_of_a_client_is_refused_with_a_text_and_the_origin_in_force() -> None:
    """MAVSDK's set_gps_global_origin compares the GPS_GLOBAL_ORIGIN that answers."""
    async with world(clients=2) as w:
        marks = [client.mark() for client in w.clients]
        w.client.send(dialect.MAVLink_set_gps_global_origin_message(1, 473977418, 85455939, 488000))
        await said(w.client, "Origin not set: it is the takeoff point", marks[0])
        origin = await w.client.wait("GPS_GLOBAL_ORIGIN", since=marks[0])
        here = await w.client.wait("GLOBAL_POSITION_INT", since=0)
        assert (origin.latitude, origin.longitude) == (here.lat, here.lon)
        await w.clients[1].heartbeat(lambda beat: True)
        assert texts(w.clients[1], marks[1]) == []


async def test_takeoff_while_the_motors_start_is_not_refused_as_in_the_air() -> None:
    async with world(speed=0.3, clients=2) as w:
        await ramping(w)
        mark = w.clients[1].mark()
        assert (await w.clients[1].command(TAKEOFF, x=0.0, y=0.0, z=4.0)).result == REJECTED
        await said(w.clients[1], "Takeoff refused: drone is starting its motors", mark)


async def ramping(w: World) -> None:
    """A client's take-off has reached the drone, whose motors start."""
    assert (await w.client.command(ARM, 1)).result == ACCEPTED
    w.client.send_command(TAKEOFF, x=0.0, y=0.0, z=5.0)
    await state(w, "motor_ramping")
    await w.client.heartbeat(lambda beat: beat.system_status == dialect.MAV_STATE_ACTIVE)


async def test_hold_while_the_motors_start_says_that_the_drone_takes_off() -> None:
    """Hold ends what follows the take-off, not the drone's own rise to 1 m: who means to stop it must send Land."""
    async with world(speed=0.3) as w:
        await ramping(w)
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await said(w.client, "Hold: takeoff possible, to 1 m", mark)


async def test_landing_by_disarm_is_not_taken_for_the_pilots() -> None:
    """The propellers are stopped just above the ground, and another station's Hold does not find a pilot's landing."""
    async with world(speed=0.1, skycontroller=3, clients=2) as w:
        await ramping(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] > 0.2, 30.0)
        mark = w.clients[1].mark()
        w.client.send_command(ARM, 0)
        await state(w, "landing")
        await w.clients[1].heartbeat(lambda beat: beat.custom_mode == w.modes.land)
        await w.clients[1].command(SET_MODE, *PX4_HOLD)
        assert [text for text in texts(w.clients[1], mark) if "pilot" in text] == []


async def test_drone_in_a_hand_receives_no_return_and_hold_says_that_it_may_take_off() -> None:
    """With ANF_HAND_LAUNCH arming starts the motors: the drone waits to be thrown, and a return would wait with it."""
    async with world(speed=1.0) as w:
        await write(w.client, "ANF_HAND_LAUNCH", 1, dialect.MAV_PARAM_TYPE_INT32)
        assert (await w.client.command(ARM, 1)).result == ACCEPTED
        mark = w.client.mark()
        assert (await w.client.command(RTL)).result == REJECTED
        await said(w.client, "Return refused: drone is starting its motors", mark)
        assert [e for e in w.drone.log if e.name == "rth.return_to_home"] == []
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await said(w.client, "Hold: takeoff possible, to 1 m", mark)
        assert (await w.client.command(LAND)).result == ACCEPTED
        assert w.drone.firmware.state is FlyingState.LANDED
