"""What a client leaves behind in the gateway when its connection is closed: over hours there are many of them."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect
from support import ext_params
from support.fault_scenarios import ARM, LAND_CMD, PX4_HOLD, SET_MODE
from support.mav import CAMERA, Client
from support.params import send_set
from support.world import OPTIONS_PORT, World, world

from anafi_mav.arsdk.messages import ardrone3, camera
from anafi_mav.mavlink.channel import Channel

COMMANDS = ((ARM, (0.0,), 1), (SET_MODE, PX4_HOLD, 1), (LAND_CMD, (), 1))
PICTURES = 30
"""A second."""
RADIUS = "GF_MAX_HOR_DIST"


def channels() -> list[Channel]:
    """All channels, open or closed."""
    gc.collect()
    return [found for found in gc.get_objects() if isinstance(found, Channel)]


async def all_forgotten(before: int) -> None:
    """Wait until no more channels are left than before. No event reports that an object is forgotten."""
    end = asyncio.get_running_loop().time() + 10.0
    while len(channels()) > before:
        assert asyncio.get_running_loop().time() < end, channels()
        await asyncio.sleep(0.1)


async def leave(w: World, client: Client) -> None:
    w.clients.remove(client)
    await client.close()


async def command_all(w: World, sysid: int) -> None:
    """Send each command as a client of its own, which then closes its connection."""
    client = await w.connect(sysid)
    for command, params, component in COMMANDS:
        await client.command(command, *params, target=(1, component))
    await client.command(dialect.MAV_CMD_SET_CAMERA_ZOOM, 1, 2, target=(1, CAMERA))
    await client.command(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1, 0, target=(1, CAMERA))
    await leave(w, client)


async def test_commands_of_a_client_do_not_keep_its_closed_channel() -> None:
    async with world() as w:
        before = len(channels())
        for sysid in (201, 202, 203):
            await command_all(w, sysid)
        for command, params, component in COMMANDS:  # the newest commands are those of a client that stays
            await w.client.command(command, *params, target=(1, component))
        await all_forgotten(before)  # the gateway closes a channel when it has read the end of the connection


def set_camera_parameter(client: Client) -> None:
    ext_params.send_set(client, "CAM_EV", 1.0, dialect.MAV_PARAM_EXT_TYPE_REAL32)


def record_video(client: Client) -> None:
    """Begin a recording whose status is sent twice a second while it runs."""
    start = dialect.MAV_CMD_VIDEO_START_CAPTURE
    client.send(dialect.MAVLink_command_long_message(1, CAMERA, start, 0, 0, 2.0, 0, 0, 0, 0, 0))


@pytest.mark.parametrize(
    ("send", "command"),
    [
        (set_camera_parameter, camera.SetEvCompensation.NAME),
        (record_video, camera.StartRecording.NAME),
    ],
)
async def test_action_does_not_keep_a_channel_closed_before_its_end(
    send: Callable[[Client], None], command: str
) -> None:
    async with world() as w:
        before = len(channels())
        w.drone.faults.unreported = frozenset({camera.EvCompensation.NAME})
        w.drone.faults.late = {report.NAME: 1.0 for report in (camera.RecordingProgress, camera.RecordingState)}
        client = await w.connect(201)
        send(client)
        await w.drone.wait_log(lambda entry: entry.name == command)
        await leave(w, client)
        await all_forgotten(before)


async def test_parameter_refused_after_its_channel_closed_does_not_keep_it() -> None:
    async with world() as w:
        before = len(channels())
        w.drone.faults.late = {ardrone3.MaxDistanceChanged.NAME: 1.0}
        send_set(w.client, RADIUS, 150.0, dialect.MAV_PARAM_TYPE_REAL32)
        await w.drone.wait_log(lambda entry: entry.name == ardrone3.MaxDistance.NAME)
        client = await w.connect(201)
        send_set(client, RADIUS, 1.0, dialect.MAV_PARAM_TYPE_REAL32)  # too small, which is judged after the first one
        await leave(w, client)
        await all_forgotten(before)


def is_of_pictures(times: list[float]) -> bool:
    """Return True when ten messages arrived within a second: events are five."""
    return len(times) >= 10 and times[-1] - times[-10] < 1.0


async def test_pictures_requested_on_a_channel_do_not_keep_it() -> None:
    async with world() as w:
        before = len(channels())
        client = await w.connect(201)
        interval = await client.command(
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL, dialect.MAVLINK_MSG_ID_ATTITUDE, 1e6 / PICTURES
        )
        assert interval.result == dialect.MAV_RESULT_ACCEPTED
        end = asyncio.get_running_loop().time() + 10.0
        while not is_of_pictures([at for at, _ in client.since(0, "ATTITUDE")]):
            assert asyncio.get_running_loop().time() < end
            await client.wait("ATTITUDE")
        await leave(w, client)
        await all_forgotten(before)


async def test_text_about_denied_access_does_not_keep_its_channel() -> None:
    async with world(options=["access=observe"]) as w:
        before = len(channels())
        client = await w.connect(201, port=OPTIONS_PORT)
        mark = client.mark()
        assert (await client.command(ARM, 0.0)).result == dialect.MAV_RESULT_DENIED
        await client.wait("STATUSTEXT", since=mark)
        await leave(w, client)
        await all_forgotten(before)
