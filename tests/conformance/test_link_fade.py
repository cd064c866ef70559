"""The drone's link is silent for a while: the session is kept, nothing of before is sent, and what flew hovers."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support.fault_scenarios import ACCEPTED, FAILED, GOTO, LAND_CMD, RTL, goto, results, until
from support.world import HOME, RETURN, World, world

from anafi_mav import geo
from anafi_mav.sim.world.faults import Impairment
from anafi_mav.sim.world.quirks import Quirk


def sessions(w: World) -> list[str]:
    """Sessions of the drone that began or ended, oldest first."""
    return [entry.name for entry in w.drone.log if entry.kind == "session"]


def commands(w: World, since: float) -> list[str]:
    """What the drone received after a moment, by the last part of Parrot's names, without stick positions."""
    names = [e.name.rpartition(".")[2] for e in w.drone.log if e.kind == "command" and e.t > since]
    return [name for name in names if name != "PCMD"]


def now() -> float:
    return asyncio.get_running_loop().time()


async def silent(w: World, seconds: float) -> float:
    """The air is gone for so long; the moment at which it is back."""
    w.drone.faults.mute = True
    await asyncio.sleep(seconds)
    w.drone.faults.mute = False
    return now()


async def flown_north(w: World, metres: float = 5.0) -> None:
    assert await goto(w, 200.0, 10.0) == ACCEPTED
    await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > metres, 20.0)


async def test_silence_of_three_seconds_keeps_session_and_hovers() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        await flown_north(w)
        mark = w.client.mark()
        back = await silent(w, 3.2)
        await w.drone.wait_log(lambda e: e.name.endswith("CancelMoveTo") and e.t > back, 5.0)
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        assert sessions(w) == ["up"]
        assert "moveTo" not in commands(w, back)
        # No heartbeat while the drone was not heard.
        beats = [t for t, _ in w.client.since(mark, "HEARTBEAT") if t < back]
        assert not beats or beats[-1] < back - 0.5
        stopped = w.drone.pose.north
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 4.0, 10.0)
        assert abs(w.drone.pose.north - stopped) < 15.0  # it brakes, and does not go on to 200 m


async def test_command_in_silence_fails_and_is_not_repeated() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        w.drone.faults.mute = True
        mark = w.client.mark()
        place = geo.destination(*HOME[:2], 60.0, 0.0)
        w.client.send_command(GOTO, -1, 1, 0, frame=6, x=place[0], y=place[1], z=10.0)
        await w.client.wait("COMMAND_ACK", lambda m: m.result == FAILED, since=mark, timeout=5.0)
        assert results(w.client, mark) == [(GOTO, FAILED)]
        w.drone.faults.mute = False
        back = now()
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 2.0, 10.0)
        assert "moveTo" not in commands(w, 0.0)


async def test_land_to_a_lost_drone_fails_with_a_text_and_can_be_sent_again() -> None:
    """In the simulator's log: the Land of the silence is not flown later, the one after it is."""
    async with world(speed=1.0) as w:
        await w.take_off()
        w.drone.faults.mute = True
        await w.client.silence("HEARTBEAT", 3.0)
        mark = w.client.mark()
        for component in (1, 0):
            w.client.send_command(LAND_CMD, target=(1, component))
        w.client.send_command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        w.client.send_command(dialect.MAV_CMD_SET_CAMERA_ZOOM, 1, 2, target=(1, 100))
        zoom = dialect.MAV_CMD_SET_CAMERA_ZOOM
        assert await until(w.client, mark, 3) == [(LAND_CMD, FAILED), (LAND_CMD, FAILED), (zoom, FAILED)]
        acks = [m.get_srcComponent() for _, m in w.client.since(mark, "COMMAND_ACK")]
        assert acks == [1, 1, 100]
        said = [m.text for _, m in w.client.since(mark, "STATUSTEXT")]
        assert said == 3 * ["Command failed: drone not connected"]
        assert w.client.since(mark, "AUTOPILOT_VERSION") == []
        w.drone.faults.mute = False
        back = now()
        await w.client.heartbeat(lambda beat: True, timeout=10.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 2.0, 10.0)
        assert "Landing" not in commands(w, 0.0)
        assert (await w.client.command(LAND_CMD)).result == ACCEPTED
        assert "Landing" in commands(w, back)


async def test_commanded_return_goes_on_through_a_silence() -> None:
    async with world(speed=1.0) as w:
        await w.take_off()
        await flown_north(w, 20.0)
        assert (await w.client.command(RTL)).result == ACCEPTED
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN)
        back = await silent(w, 3.2)
        await w.client.heartbeat(lambda beat: beat.custom_mode == RETURN, timeout=5.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 2.0, 10.0)
        assert commands(w, back) == []


@pytest.mark.parametrize("seconds", [5.0, 9.0])
async def test_longer_silence_ends_with_one_session(seconds: float) -> None:
    """New handshakes begin after 4 s; whichever of both sessions is heard first goes on."""
    async with world(speed=1.0) as w:
        await w.take_off()
        await flown_north(w)
        began = now()
        back = await silent(w, seconds)
        mark = w.client.mark()
        await w.client.heartbeat(lambda beat: True, since=mark, timeout=6.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.t > back + 6.0, 10.0)
        assert [e.t - began > 4.0 for e in w.drone.log if e.kind == "session"][1:] == [True] * (len(sessions(w)) - 1)
        assert w.drone.session is not None
        assert "moveTo" not in commands(w, back)
        await w.client.heartbeat(lambda beat: True)


async def test_refused_handshake_is_reported_with_its_status() -> None:
    """No datagram passes either way, but the TCP ports of the drone answer: as after a fade of its radio."""
    async with world(speed=1.0) as w:
        w.drone.faults.quirks = frozenset({Quirk.HANDSHAKE_REFUSED_8S})
        await w.take_off()
        session = w.drone.session
        assert session is not None
        session.mute = True
        mark = w.client.mark()
        text = await w.client.wait("STATUSTEXT", lambda m: "refused" in m.text, since=mark, timeout=8.0)
        assert text.text == "Connection refused by drone (status -1)"
        assert text.severity == dialect.MAV_SEVERITY_WARNING
        assert len(text.text) <= 50
        # The old session lives on, and is taken up again without a handshake.
        session.mute = False
        await w.client.heartbeat(lambda beat: True, timeout=5.0)
        assert sessions(w) == ["up"]


async def test_handshake_succeeds_once_the_kept_session_has_ended() -> None:
    async with world(speed=1.0) as w:
        w.drone.faults.quirks = frozenset({Quirk.HANDSHAKE_REFUSED_8S})
        session: Any = w.drone.session
        began = now()
        session.mute = True
        await w.drone.wait_log(lambda e: e.kind == "session" and e.name == "up" and e.t > began, 15.0)
        (up,) = (e.t for e in w.drone.log if e.kind == "session" and e.name == "up" and e.t > began)
        assert 7.5 <= up - began <= 12.0
        await w.client.heartbeat(lambda beat: True, timeout=5.0)


async def test_drone_that_is_not_heard_but_hears_the_gateway_notices_the_loss() -> None:
    """Its failsafe begins as if neither heard the other: pings would keep the session, and the move, alive."""
    async with world(speed=1.0, quirks=(Quirk.HANDSHAKE_REFUSED_8S.value,)) as w:
        await w.take_off()
        await flown_north(w)
        w.drone.faults.down = Impairment(loss=1.0)
        await w.drone.wait_log(lambda e: e.kind == "session" and e.name == "lost", 15.0)


async def test_drone_that_is_not_heard_but_hears_the_gateway_is_stopped() -> None:
    async with world(speed=1.0, quirks=(Quirk.HANDSHAKE_REFUSED_8S.value,)) as w:
        await w.take_off()
        await flown_north(w)
        w.drone.faults.down = Impairment(loss=1.0)
        await w.drone.wait_log(lambda e: w.drone.pose.ground_speed < 0.2, 10.0)
        assert sessions(w) == ["up"]


@pytest.mark.parametrize("generation", [3, 4])
async def test_axes_after_a_silence_go_back_to_the_pilot(generation: int) -> None:
    async with world(speed=1.0, skycontroller=generation) as w:
        pilot = w.drone.skycontroller
        assert pilot is not None
        await w.take_off()
        await flown_north(w)
        assert pilot.grabbed_axes != 0
        await silent(w, 3.2)
        await w.drone.wait_log(lambda e: pilot.grabbed_axes == 0, 5.0)
        assert sessions(w) == ["up"]
