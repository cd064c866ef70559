"""A client can end a landing, nothing of the gateway itself does. Judged by what the simulated drone did."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.callers import CALLERS, system_of
from support.fault_scenarios import (
    ACCEPTED,
    DENIED,
    LAND_CMD,
    PX4_HOLD,
    PX4_OFFBOARD,
    REJECTED,
    RTL,
    SET_MODE,
    TAKEOFF_CMD,
    another_controller,
    goto,
    heard,
    home_being_undone,
    watched,
)
from support.mav import NAN, Client
from support.missions import LAND as LAND_ITEM
from support.missions import put, start, takeoff, way
from support.setpoints import attitude, local, streaming
from support.world import HOLD, LAND, POSITION, RETURN, World, world

from anafi_mav.arsdk.messages import ardrone3, rth
from anafi_mav.errors import AnafiMavError
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk
from anafi_mav.vehicle.base.modes import FlightMode
from anafi_mav.vehicle.base.right import Extent

BAD_AIR = Impairment(loss=0.25, delay=0.2)
PX4_POSITION = (1, 3, 0)
PX4_MISSION = (1, 4, 4)
PAUSE = dialect.MAV_CMD_DO_PAUSE_CONTINUE


async def landing(w: World, height: float = 8.0) -> None:
    """The drone lands because a client commanded it."""
    await w.take_off(height)
    assert (await w.client.command(LAND_CMD)).result == ACCEPTED
    await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
    await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)


def flown(w: World) -> list[str]:
    """The flying states that the drone had, in order."""
    return [entry.args["to"] for entry in w.drone.log if entry.name == "flying"]


def sticks(w: World, since: int = 0) -> list[tuple[int, ...]]:
    entries = [entry.args for entry in w.commands("ardrone3.Piloting.PCMD")][since:]
    return [tuple(args[name] for name in ("flag", "roll", "pitch", "yaw", "gaz")) for args in entries]


async def text(client: Client, words: str, since: int = 0) -> Any:
    return await client.wait("STATUSTEXT", lambda m: words in m.text, since=since)


STOPS: dict[str, Callable[[Client], Any]] = {
    "Hold": lambda client: client.command(SET_MODE, *PX4_HOLD),
    "Position": lambda client: client.command(SET_MODE, *PX4_POSITION),
    "Pause": lambda client: client.command(PAUSE, 0),
    "Pause by reposition": lambda client: client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 0, 0, NAN),
    "Takeoff": lambda client: client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0),
}


@pytest.mark.parametrize("stop", STOPS)
async def test_landing_is_ended_by_another_clients_stop_commands(stop: str) -> None:
    async with world(speed=1.0) as w:
        other = await w.connect(sysid=250)
        await landing(w)
        before, mark = len(sticks(w)), other.mark()
        assert (await STOPS[stop](other)).result == ACCEPTED
        shown = POSITION if stop == "Position" else HOLD
        await other.heartbeat(lambda beat: beat.custom_mode == shown, since=mark)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 8.0)
        await watched(2.0)
        assert "landed" not in flown(w)
        assert w.drone.pose.up > 2.0
        if stop == "Takeoff":
            assert heard(w, "TakeOff")[1:] == ["TakeOff"]
        else:
            assert heard(w, "TakeOff")[1:] == []
        sent = sticks(w, before)
        assert set(sent) <= {(0, 0, 0, 0, 100), (0, 0, 0, 0, 0)}
        assert sent.count((0, 0, 0, 0, 100)) <= 21
        await text(w.client, "Landing aborted by system 250")


@pytest.mark.parametrize(("mode", "shown"), [(4, 4), (5, 5), (17, 17), (6, 6)])
async def test_landing_is_ended_by_modes_of_ardupilot(mode: int, shown: int) -> None:
    """Guided, Loiter, Brake, RTL."""
    async with world(speed=1.0, flavour="ardupilot") as w:
        await landing(w)
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, 1, mode)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == shown, since=mark)
        assert "landed" not in flown(w)


async def test_ai_landing_is_ended_by_takeoff_like_ground_sdk() -> None:
    async with world(speed=1.0, model="ai") as w:
        await landing(w)
        taken_off = len(heard(w, "TakeOff"))
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        assert heard(w, "SmartTakeOffLand") == ["SmartTakeOffLand"]
        assert len(heard(w, "TakeOff")) == taken_off
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 8.0)


async def test_landing_is_not_ended_by_goto_setpoints_or_sticks() -> None:
    async with world(speed=1.0, flavour="ardupilot", also="px4") as w:
        pilot = await w.connect(sysid=240, port=5761)
        await landing(w, 5.0)
        ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, 0, NAN, frame=6, x=48.879, y=2.3677, z=5.0)
        assert ack.result == REJECTED
        for _ in range(20):
            w.client.send(
                dialect.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, 1, 0b110111000111, 0, 0, 0, 1.0, 0, -1.0, 0, 0, 0, 0, 0
                )
            )
            pilot.send(dialect.MAVLink_manual_control_message(1, 500, 0, 1000, 0, 0))
            await asyncio.sleep(0.05)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        assert flown(w)[-2:] == ["landing", "landed"]


async def test_takeoff_to_a_height_above_the_ceiling_does_not_end_a_landing() -> None:
    async with world(speed=1.0) as w:
        await landing(w)
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=1e30)).result == DENIED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 30.0)
        assert heard(w, "TakeOff") == ["TakeOff"]  # the one of the flight
        assert flown(w).count("landing") == 1


@pytest.mark.parametrize("quirk", [Quirk.LANDING_IGNORES_TAKEOFF, Quirk.LANDING_IGNORES_GAZ])
@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_takeoff_ends_landing_of_firmware_with_one_way(quirk: Quirk, model: str) -> None:
    async with world(speed=1.0, model=model) as w:
        w.drone.faults.quirks = frozenset({quirk})
        await landing(w, 12.0)
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 8.0)
        assert "landed" not in flown(w)


async def test_hold_is_refused_after_a_landing_ignored_gaz() -> None:
    async with world(speed=2.0) as w:
        w.drone.faults.quirks = frozenset({Quirk.LANDING_IGNORES_GAZ})
        await landing(w, 4.0)
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == REJECTED
        await text(w.client, "Landing not aborted: already landed", mark)
        assert flown(w)[-1] == "landed"
        assert heard(w, "TakeOff") == ["TakeOff"]


async def test_land_during_the_end_of_a_landing_lands() -> None:
    async with world(speed=1.0) as w:
        await landing(w)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        w.client.send_command(SET_MODE, *PX4_HOLD)
        await w.drone.wait_log(lambda e: e.name == "ardrone3.Piloting.PCMD" and e.args["gaz"] > 0, 5.0)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        await watched(1.0)
        assert flown(w)[-1] == "landed"


async def test_hold_right_after_land_holds() -> None:
    """The Landing has left and is not answered when Hold replaces it."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        w.client.send_command(LAND_CMD)
        await asyncio.sleep(0.1)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await watched(3.0)
        assert flown(w)[-1] == "hovering"
        assert w.drone.pose.up > 5.0


async def test_goto_right_after_land_is_refused() -> None:
    """The Landing has left and is not answered: a goto does not replace it."""
    async with world(speed=1.0) as w:
        await w.take_off(6.0)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.2)
        mark = w.client.mark()
        w.client.send_command(LAND_CMD)
        await asyncio.sleep(0.1)
        assert await goto(w, 20.0, 6.0) == REJECTED
        await text(w.client, "Goto refused: drone is landing", mark)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        assert heard(w, "moveTo", "extended_move_to") == []


# Not ours to end.


async def test_forced_landing_is_ended_by_no_client() -> None:
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        w.drone.faults.motor_error = ardrone3.MotorError.ERROR_MOTOR_STALLED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "emergency_landing", 5.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        before, mark = len(sticks(w)), w.client.mark()
        for stop in STOPS.values():
            assert (await stop(w.client)).result == REJECTED
        assert set(sticks(w, before)) <= {(0, 0, 0, 0, 0)}
        await text(w.client, "Hold refused: forced landing", mark)


@pytest.mark.parametrize("skycontroller", [3, 4])
async def test_landing_by_skycontroller_button_is_ended_by_no_client(skycontroller: int) -> None:
    async with world(speed=1.0, skycontroller=skycontroller) as w:
        await w.take_off(8.0)
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(1)
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        mark = w.client.mark()
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == REJECTED
        await text(w.client, "Hold refused: Skycontroller pilot is landing", mark)
        assert (await w.client.command(TAKEOFF_CMD, x=0.0, y=0.0, z=5.0)).result == REJECTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


@pytest.mark.parametrize("late", ["", rth.State.NAME, ardrone3.FlyingStateChanged.NAME])
async def test_landing_by_skycontroller_button_in_a_clients_return_is_ended_by_no_client(late: str) -> None:
    """It was taken for the end of that return: Hold ended it, Mission flew on, and a text had it hover."""
    async with world(speed=1.0, web=True, skycontroller=3) as w:
        assert w.drone.skycontroller is not None
        await w.take_off(12.0)
        await put(w, [takeoff(12.0), way(9.0, 0.0, 12.0)])
        assert await goto(w, 40.0, 12.0) == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 39.0, 40.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        w.drone.faults.late = {late: 0.4}
        mark = w.client.mark()
        w.drone.skycontroller.press(1)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == w.modes.land)
        await watched(0.6)
        for mode in (PX4_HOLD, PX4_MISSION):
            assert (await w.client.command(SET_MODE, *mode)).result == REJECTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        assert "hovering" not in flown(w)[flown(w).index("landing") :]
        assert not [m.text for _, m in w.client.since(mark, "STATUSTEXT") if "hovering" in m.text]


async def test_client_landing_behind_a_skycontroller_is_ended_by_clients() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await landing(w)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 8.0)


async def test_landing_of_the_pilot_after_a_land_that_was_never_sent_is_ended_by_no_client() -> None:
    async with world(speed=1.0, skycontroller=3) as w:
        await w.take_off(8.0)
        await home_being_undone(w)
        w.client.send_command(LAND_CMD)  # waits for what it replaces
        await watched(0.2)
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        assert heard(w, "Landing") == []
        assert w.drone.skycontroller is not None
        w.drone.skycontroller.press(1)
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        await watched(5.0)  # until another Hold counts
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == REJECTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)


async def test_landing_of_another_controller_begins_level_under_tilting_setpoints() -> None:
    """What a firmware keeps of the last PCMD must not carry it sideways to the ground."""
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        async with streaming(w.client, attitude(pitch=-0.15)):
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] > 0, 5.0)
            another_controller(w, ardrone3.Landing())
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 5.0)
            await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] == 0, 1.0)
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        assert sticks(w)[-1] == (0, 0, 0, 0, 0)


# Callers without the right.


@pytest.mark.parametrize("caller", CALLERS)
async def test_no_caller_without_a_clients_right_ends_a_landing(caller: str) -> None:
    async with world(speed=1.0) as w:
        await landing(w)
        before = len(sticks(w))
        with contextlib.suppress(AnafiMavError):
            await CALLERS[caller](system_of(w))
        await watched(0.5)
        assert flown(w)[-1] in ("landing", "landed")
        assert all(args[4] <= 0 for args in sticks(w, before))
        assert heard(w, "TakeOff") == ["TakeOff"]


async def test_joystick_override_ends_a_clients_landing() -> None:
    """The right that the override has: what clients commanded, and nothing of the drone's own."""
    async with world(speed=1.0) as w:
        await landing(w)
        vehicle = system_of(w).vehicle
        await vehicle.hold(FlightMode.POSITION, vehicle.right("joystick", Extent.COMMANDED))
        await w.client.heartbeat(lambda beat: beat.custom_mode == POSITION)
    async with world(speed=1.0) as w:
        await w.take_off(8.0)
        another_controller(w, ardrone3.Landing())
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        vehicle = system_of(w).vehicle
        with pytest.raises(AnafiMavError, match="drone is landing"):
            await vehicle.hold(FlightMode.POSITION, vehicle.right("joystick", Extent.COMMANDED))


async def test_return_begins_once_the_landing_has_ended() -> None:
    async with world(speed=2.0) as w:
        await landing(w)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        assert "landed" not in flown(w)


# Raced with the touchdown.


RACE = [-0.3, -0.15, 0.0, 0.15, 0.3]


@pytest.mark.parametrize("offset", RACE)
@pytest.mark.parametrize("stop", ["Hold", "Takeoff"])
async def test_abort_raced_with_touchdown(stop: str, offset: float) -> None:
    """200 ms each way, a quarter lost: no matter which one wins, the acknowledgement says what the drone does."""
    await _race(stop, offset, frozenset())


@pytest.mark.parametrize("offset", RACE)
async def test_takeoff_near_touchdown_with_late_firmware(offset: float) -> None:
    await _race("Takeoff", offset, frozenset({Quirk.TAKEOFF_FROM_GROUND_LATE}))


async def _race(stop: str, offset: float, quirks: frozenset[Quirk]) -> None:
    async with world(speed=1.0) as w:
        await landing(w, 2.0)
        w.drone.faults.quirks = quirks
        w.drone.faults.up = w.drone.faults.down = BAD_AIR
        speed = 0.5  # m/s near the ground (sim.motion)
        if offset < 0.0:
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["up"] < speed * -offset + 0.1, 10.0)
        else:
            await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 10.0)
            await asyncio.sleep(offset)
        taken_off = len(heard(w, "TakeOff"))
        mark = w.client.mark()
        result = (await STOPS[stop](w.client)).result
        await watched(5.0)
        now = flown(w)[-1]
        if stop == "Hold":
            assert len(heard(w, "TakeOff")) == taken_off
            assert "motor_ramping" not in flown(w)[2:]
            if now == "landed" and result == ACCEPTED:  # it was on the ground before, for the gateway too
                assert "Landing not aborted" not in [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        if result == REJECTED:
            assert now == "landed", flown(w)
        if now in ("hovering", "flying"):
            assert result == ACCEPTED, flown(w)


# Modes that begin once the drone hovers.


async def test_offboard_with_setpoints_ends_a_landing_and_flies() -> None:
    async with world(speed=1.0) as w:
        await landing(w, 10.0)
        async with streaming(w.client, local(0b110111000111, v=(1.0, 0.0, 0.0))):
            assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 0.7, 10.0)
        assert "landed" not in flown(w)


async def test_mission_ends_a_landing_and_is_flown() -> None:
    async with world(speed=2.0, web=True) as w:
        await put(w, [way(12.0, 0.0, 8.0)])
        await landing(w, 10.0)
        assert (await w.client.command(SET_MODE, *PX4_MISSION)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 3.0, 15.0)
        assert "landed" not in flown(w)


@pytest.mark.parametrize("mode", [PX4_OFFBOARD, PX4_MISSION])
async def test_unavailable_mode_leaves_the_landing_alone(mode: tuple[int, int, int]) -> None:
    """No setpoints arrive, there is no mission: a command that is refused disturbs nothing."""
    async with world(speed=1.0) as w:
        await landing(w, 6.0)
        before = len(sticks(w))
        assert (await w.client.command(SET_MODE, *mode)).result == REJECTED
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landed", 20.0)
        assert all(args[4] <= 0 for args in sticks(w, before))
        assert flown(w)[-2:] == ["landing", "landed"]


async def test_mission_landing_is_ended_by_hold_not_mission_mode() -> None:
    async with world(speed=2.0, web=True) as w:
        await put(w, [takeoff(8.0), way(8.0, 0.0, 8.0), LAND_ITEM])
        await start(w)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "landing", 60.0)
        await w.client.heartbeat(lambda beat: beat.custom_mode == LAND)
        await w.client.command(SET_MODE, *PX4_MISSION)
        assert flown(w)[-1] == "landing"
        assert (await w.client.command(SET_MODE, *PX4_HOLD)).result == ACCEPTED
        await watched(2.0)
        assert flown(w)[-1] in ("flying", "hovering")
