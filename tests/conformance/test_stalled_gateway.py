"""The gateway's process is stopped in flight: what the pilot at a Skycontroller can do then, by the simulator's log."""

from __future__ import annotations

import asyncio
import math
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any, cast

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import (
    ACCEPTED,
    GOTO,
    LAND_CMD,
    PX4_HOLD,
    PX4_OFFBOARD,
    REJECTED,
    SET_MODE,
    goto,
    heard,
    results,
    until,
)
from support.mav import NAN, Client
from support.missions import CORNERS, put, start
from support.plans import around
from support.process import gateway_process
from support.setpoints import said, streaming
from support.world import HOLD, HOME, WEB_PORT, World, loopback

from anafi_mav import texts
from anafi_mav.arsdk.messages import ardrone3
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.rth import StateReason
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.errors import CommandTimeout
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.units import quaternion_from_euler
from anafi_mav.vehicle.follow import SILENCE
from anafi_mav.vehicle.vehicle import POSITION_OLD

PITCH_STICK = 3
"""Its axis at the Skycontroller (mapper.xml)."""

LIMIT = 2.5
"""s that the gateway's event loop may stall: more than this machine makes it wait."""

PX4_FOLLOW = (1, 4, 8)

TOO_OLD = "Command refused: too old on arrival"

AXES = ("roll", "pitch", "yaw", "gaz")

BAD_AIR = Impairment(loss=0.25, delay=0.2)


class Operator(Client):
    """A station whose operator commands again what a busy machine has made too old on arrival."""

    async def command(self, id: int, *params: float, **options: Any) -> Any:
        for _ in range(20):
            mark = self.mark()
            ack = await super().command(id, *params, **options)
            if ack.result != REJECTED:
                return ack
            await self.heartbeat(lambda beat: True, timeout=10.0)  # the reason follows the acknowledgement
            if not any(m.text == TOO_OLD for _, m in self.since(mark, "STATUSTEXT")):
                return ack
        raise AssertionError("always too old on arrival")


@asynccontextmanager
async def apart(folder: Path, generation: int | None) -> AsyncIterator[tuple[World, asyncio.subprocess.Process]]:
    """A simulated drone here, and its gateway as a process of its own."""
    drone, address = loopback(), loopback()
    spec = DroneSpec(address=drone, home=HOME, http_port=WEB_PORT, skycontroller=generation)
    config = folder / "fleet.yaml"
    config.write_text(
        f"drones: [{{name: alpha, sysid: 1, address: {drone}, http_port: {WEB_PORT}}}]\n"
        f"endpoints: ['tcpin://{address}:5760']\n"
    )
    async with Simulator([spec], speed=2.0, seed=1) as simulator, gateway_process(config, LIMIT) as process:
        w = World(simulator, cast(Gateway, None), address)
        try:
            w.take(await Operator().connect(5760, address))
            await w.client.wait("GLOBAL_POSITION_INT", since=0, timeout=20.0)
            yield w, process
        finally:
            for client in w.clients:
                await client.close()
            if process.returncode is None:
                process.kill()  # an end by SIGTERM stays with a flying drone for two seconds
                await process.wait()


async def set_out(w: World, way: str) -> asyncio.Task[Any] | None:
    """Have something of ours fly; the task that keeps it flying, if it needs one."""
    if way == "mission":
        await put(w, CORNERS)
        await start(w)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 2.0, 40.0)
        return None
    await w.take_off()
    if way == "goto":
        assert await goto(w, 200.0, 10.0) == ACCEPTED
        return None

    if way == "orbit":
        assert (await w.client.command(dialect.MAV_CMD_DO_ORBIT, 8.0, 2.0)).result == ACCEPTED
        return None

    async def stream() -> None:
        while True:
            rotation = list(quaternion_from_euler(0.0, -0.05, 0.0))
            w.client.send(dialect.MAVLink_set_attitude_target_message(0, 1, 1, 0b111, rotation, 0.0, 0.0, 0.0, 0.5))
            await asyncio.sleep(0.05)  # the client's setpoint rate

    task = asyncio.ensure_future(stream())
    for _ in range(20):  # a host that stalls for longer than setpoints last is no part of this
        await asyncio.sleep(0.3)  # setpoints arrive before the command, in one TCP connection
        if (await w.client.command(dialect.MAV_CMD_DO_SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED:
            return task
    raise AssertionError("Offboard was never accepted")


def given_back(w: World) -> bool:
    pilot = w.drone.skycontroller
    assert pilot is not None
    return pilot.source is Source.SKY_CONTROLLER and pilot.grabbed_axes == 0


async def stopped(w: World, gateway: asyncio.subprocess.Process, seconds: float) -> None:
    """Stop the gateway's process, and return when the simulator has flown on for so long."""
    gateway.send_signal(signal.SIGSTOP)
    until = asyncio.get_running_loop().time() + seconds
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > until, seconds + 10.0)


async def sees(w: World, true: Any, timeout: float = 20.0) -> None:
    """Wait until this is true of the simulated aircraft: looked at with every line of its log."""
    if not true():
        await w.drone.wait_log(lambda entry: true(), timeout)


@pytest.mark.parametrize("generation", [3, 4])
@pytest.mark.parametrize("way", ["goto", "mission", "offboard", "orbit"])
async def test_pilot_has_sticks_while_gateway_is_stopped(tmp_path: Path, way: str, generation: int) -> None:
    async with apart(tmp_path, generation) as (w, gateway):
        pilot = w.drone.skycontroller
        assert pilot is not None
        task = await set_out(w, way)
        try:
            await sees(w, lambda: pilot.source is Source.CONTROLLER and pilot.grabbed_axes != 0)
            w.drone.faults.up = w.drone.faults.down = BAD_AIR
            commands = [e.name for e in w.drone.log if e.kind == "command"]
            gateway.send_signal(signal.SIGSTOP)
            await sees(w, lambda: given_back(w))
            assert w.drone.session is not None  # by the watchdog: the Skycontroller has not missed the gateway yet
            # His stick reaches the drone, and nothing else was ended for him.
            pilot.stick(PITCH_STICK, 50)
            await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] == 50, 10.0)
            new = [e.name for e in w.drone.log if e.kind == "command"][len(commands) :]
            assert {name for name in new if not name.endswith("PCMD")} == set()
            w.drone.faults.up = w.drone.faults.down = Impairment()
            gateway.send_signal(signal.SIGCONT)
            if way == "goto":
                await sees(w, lambda: heard(w, "CancelMoveTo") != [])
            elif way == "mission":
                await sees(w, lambda: heard(w, "Pause", "Stop") != [])
            # The client goes on, and the pilot keeps the drone.
            await w.client.heartbeat(lambda beat: True, timeout=10.0)
            assert given_back(w)
        finally:
            if task is not None:
                task.cancel()


@pytest.mark.parametrize("generation", [3, 4])
async def test_goto_is_stopped_after_a_stall_that_ended_the_connection(tmp_path: Path, generation: int) -> None:
    """The pilot has the sticks since, and the drone flew the goto on to its end."""
    async with apart(tmp_path, generation) as (w, gateway):
        w.simulator.speed = 1.0
        await w.take_off()
        await goto(w, 300.0, 10.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 15.0, 20.0)
        gateway.send_signal(signal.SIGSTOP)
        await w.drone.wait_log(lambda e: e.kind == "session" and e.name == "lost", 20.0)
        assert given_back(w)
        lost = asyncio.get_running_loop().time()
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > lost + 6.0, 15.0)
        mark, back = w.client.mark(), asyncio.get_running_loop().time()
        gateway.send_signal(signal.SIGCONT)
        await w.drone.wait_log(lambda e: e.name == "flying" and e.args["to"] == "hovering", 15.0, since=back)
        await said(w.client, "Goto ended: link lost", mark)
        assert w.drone.pose.north < 200.0
        assert given_back(w)


async def test_stopped_gateway_with_nothing_flying_sends_nothing(tmp_path: Path) -> None:
    async with apart(tmp_path, 3) as (w, gateway):
        pilot = w.drone.skycontroller
        assert pilot is not None
        await w.take_off()
        await sees(w, lambda: given_back(w))
        back = w.drone.log[len(w.drone.log) - 1].t
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 1.0)  # its acknowledgement has arrived
        before = [e.t for e in w.drone.log if e.kind == "controller"]
        gateway.send_signal(signal.SIGSTOP)
        stopped = w.drone.log[len(w.drone.log) - 1].t
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > stopped + LIMIT + 1.0, 30.0)
        assert [e.t for e in w.drone.log if e.kind == "controller"] == before


def deflected(w: World, since: float) -> list[float]:
    """When stick positions that move the drone reached it after a moment."""
    return [e.t for e in w.commands("ardrone3.Piloting.PCMD") if e.t > since and any(e.args[axis] for axis in AXES)]


async def test_commands_sent_to_a_stalled_gateway_are_dropped(tmp_path: Path) -> None:
    """A program's setpoints and a goto wait in the gateway's socket; the program is gone when it runs again."""
    async with apart(tmp_path, None) as (w, gateway):
        task = await set_out(w, "offboard")
        assert task is not None
        loop = asyncio.get_running_loop()
        await w.drone.wait_log(lambda e: e.name.endswith("PCMD") and e.args["pitch"] > 10, 10.0)
        gateway.send_signal(signal.SIGSTOP)
        await asyncio.sleep(1.5)  # the program sends on
        place = around((HOME[0], HOME[1]), (100.0, 0.0))[0]
        w.client.send_command(GOTO, -1, 1, 0, frame=6, x=place[0], y=place[1], z=10.0)
        task.cancel()
        await asyncio.sleep(1.5)
        back, mark = loop.time(), w.client.mark()
        gateway.send_signal(signal.SIGCONT)
        await w.client.heartbeat(lambda beat: beat.custom_mode == HOLD, since=mark, timeout=10.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 2.0, 10.0)
        # None is made of what had waited. One may have been in the making when the process was stopped.
        assert len(deflected(w, back)) <= 1
        assert heard(w, "moveTo") == []
        # The goto's sender knows that it is not flown.
        assert results(w.client, mark) == [(GOTO, REJECTED)]
        texts = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert TOO_OLD in texts


def far_target() -> Any:
    """FOLLOW_TARGET, 200 m north of home."""
    place = around((HOME[0], HOME[1]), (200.0, 0.0))[0]
    unknown = [NAN] * 3
    latitude, longitude = (round(degrees * 1e7) for degrees in place)
    return dialect.MAVLink_follow_target_message(
        0, 1, latitude, longitude, HOME[2], unknown, unknown, [NAN] * 4, unknown, unknown, 0
    )


async def follow_northwards(w: World) -> None:
    """Choose mode Follow, until the drone flies after its target."""
    await w.take_off(8.0)
    assert (await w.client.command(SET_MODE, *PX4_FOLLOW)).result == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 20.0)


def grabs(w: World, since: float) -> list[Any]:
    """Grabs of axes that the Skycontroller received after a moment."""
    return [e for e in w.drone.log if e.t > since and e.name.endswith("grab") and e.args["axes"]]


@pytest.mark.parametrize("generation", [None, 3])
async def test_target_from_before_a_stall_is_followed_no_further(tmp_path: Path, generation: int | None) -> None:
    """Nor are the sticks taken from the pilot, who has them since."""
    async with apart(tmp_path, generation) as (w, gateway):
        async with streaming(w.client, far_target, 0.5):
            await follow_northwards(w)
            await stopped(w, gateway, SILENCE + 1.0)
        back, mark = asyncio.get_running_loop().time(), w.client.mark()
        gateway.send_signal(signal.SIGCONT)
        await said(w.client, "Follow ended: target lost", mark)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 1.0, 10.0)
        assert deflected(w, back) == []
        assert grabs(w, back) == []


@pytest.mark.parametrize(
    ("command", "params", "heard_as"), [(LAND_CMD, (), "Landing"), (SET_MODE, PX4_HOLD, "CancelMoveTo")]
)
async def test_stop_sent_to_a_stalled_gateway_is_carried_out(
    tmp_path: Path, command: int, params: tuple[float, ...], heard_as: str
) -> None:
    """A person must be able to stop the drone, and cannot know that the gateway does not run."""
    async with apart(tmp_path, None) as (w, gateway):
        await set_out(w, "goto")
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 20.0)
        mark = w.client.mark()
        gateway.send_signal(signal.SIGSTOP)
        w.client.send_command(command, *params)
        await asyncio.sleep(1.5)  # a stall is a second or more
        assert results(w.client, mark) == []
        gateway.send_signal(signal.SIGCONT)
        assert await until(w.client, mark, 1) == [(command, ACCEPTED)]
        assert len(heard(w, heard_as)) == 1


async def test_land_sent_to_a_stalled_gateway_behind_a_skycontroller_4_is_not_delayed(tmp_path: Path) -> None:
    """The watchdog's process still sends when the gateway goes on, and has to end before the gateway may send."""
    async with apart(tmp_path, 4) as (w, gateway):
        w.simulator.speed = 1.0
        await set_out(w, "goto")
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 5.0, 20.0)
        gateway.send_signal(signal.SIGSTOP)
        await sees(w, lambda: given_back(w))
        w.client.send_command(LAND_CMD)
        back = asyncio.get_running_loop().time()
        gateway.send_signal(signal.SIGCONT)
        change = await w.drone.wait_log(lambda e: e.name == "flying" and e.t > back, 15.0)
        assert change.args["to"] == "landing"  # and not hovering, after which the verb repeats its Landing


async def test_mode_sent_to_a_stalled_gateway_stops_the_drone(tmp_path: Path) -> None:
    """As dronekit sends it: SET_MODE, which has no answer."""
    async with apart(tmp_path, None) as (w, gateway):
        await set_out(w, "goto")
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0, 20.0)
        gateway.send_signal(signal.SIGSTOP)
        w.client.send(dialect.MAVLink_set_mode_message(1, 1, w.modes.hold))
        await asyncio.sleep(1.5)
        gateway.send_signal(signal.SIGCONT)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name.endswith("CancelMoveTo"), 10.0)


async def test_locations_that_a_stalled_gateway_has_not_received_are_not_missing(tmp_path: Path) -> None:
    """The text blames the drone's GPS receiver. Locations that stop after the stall are reported."""
    async with apart(tmp_path, None) as (w, gateway):
        await w.take_off()
        await stopped(w, gateway, POSITION_OLD + 1.0)
        mark = w.client.mark()
        gateway.send_signal(signal.SIGCONT)
        await w.client.wait("GLOBAL_POSITION_INT", since=mark, timeout=10.0)
        w.drone.faults.unreported = frozenset({ardrone3.GpsLocationChanged.NAME})
        unreported = w.client.mark()
        lost = texts.POSITION_LOST.fill(seconds=POSITION_OLD)
        await w.client.wait("STATUSTEXT", lambda m: m.text == lost, since=unreported, timeout=20.0)
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert said.count(lost) == 1
        assert texts.POSITION_FOUND not in said


@pytest.mark.parametrize("way", ["goto", "mission", "offboard", "orbit"])
async def test_ended_gateway_leaves_a_hovering_drone(tmp_path: Path, way: str) -> None:
    """SIGTERM, with a program that goes on sending: the drone stands, and nothing of before moves it."""
    async with apart(tmp_path, None) as (w, gateway):
        task = await set_out(w, way)
        try:
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] ** 2 + e.args["ve"] ** 2 > 1.0, 20.0)
            gateway.send_signal(signal.SIGTERM)
            assert await asyncio.wait_for(gateway.wait(), 20.0) == 0
            ended = w.drone.log[len(w.drone.log) - 1].t
            await w.drone.wait_log(
                lambda e: e.kind == "pose" and e.t > ended and e.args["vn"] ** 2 + e.args["ve"] ** 2 < 0.04, 10.0
            )
            assert w.drone.flying_state in (FlyingState.HOVERING, FlyingState.FLYING)
            stood = w.drone.pose
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > ended + 3.0, 10.0)
            assert math.hypot(w.drone.pose.north - stood.north, w.drone.pose.east - stood.east) < 1.0
            assert abs(w.drone.pose.up - stood.up) < 0.5
        finally:
            if task is not None:
                task.cancel()


RETURN_DELAY = 4.0
"""s from the loss of the link to the drone's return."""


async def flies_away(w: World) -> None:
    """Wait until setpoints fly the drone 20 m north of its home.

    Where a busy machine has kept the program from sending for too long, its user chooses Offboard again.
    """
    for _ in range(12):
        with suppress(CommandTimeout):
            await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["vn"] > 1.0 and e.args["north"] > 20.0, 5.0)
            return
        assert (await w.client.command(SET_MODE, *PX4_OFFBOARD)).result == ACCEPTED
    raise AssertionError("the drone never flew away")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
async def test_gateway_killed_or_hung_leaves_a_returning_drone(tmp_path: Path, number: signal.Signals) -> None:
    """The drone notices the silence by itself: it hovers, and flies home after its delay."""
    async with apart(tmp_path, None) as (w, gateway):
        w.drone.firmware.settings.set("rth_delay", RETURN_DELAY)
        task = await set_out(w, "offboard")
        assert task is not None
        try:
            await flies_away(w)
            gateway.send_signal(number)
            struck = asyncio.get_running_loop().time()
            await w.drone.wait_log(
                lambda e: e.kind == "pose" and math.hypot(e.args["vn"], e.args["ve"]) < 0.3, 20.0, since=struck
            )
            assert not w.drone.firmware.homing.active
            await w.drone.wait_log(lambda e: math.hypot(w.drone.pose.north, w.drone.pose.east) < 2.0, 60.0)
            assert w.drone.firmware.homing.reason is StateReason.CONNECTION_LOST
        finally:
            task.cancel()
