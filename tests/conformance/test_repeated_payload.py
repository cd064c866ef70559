"""Equal commands to the camera within seconds: new ones are carried out, retransmissions are not."""

from __future__ import annotations

import asyncio

import pytest
from support.cameras import ACCEPTED, PHOTO, VIDEO, command, enter, photos, press, shoot, videos
from support.flavours import both
from support.mav import CAMERA, NAN
from support.world import World, world

from anafi_mav.arsdk.messages import camera as camera_messages
from anafi_mav.arsdk.messages.thermal import RenderingMode
from anafi_mav.mavlink import dialect

START, STOP = dialect.MAV_CMD_VIDEO_START_CAPTURE, dialect.MAV_CMD_VIDEO_STOP_CAPTURE
MODE, SOURCE = dialect.MAV_CMD_SET_CAMERA_MODE, dialect.MAV_CMD_SET_CAMERA_SOURCE
SHOOT, DISTANCE = dialect.MAV_CMD_IMAGE_START_CAPTURE, dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST
ZOOM, FORMAT, PANORAMA = (
    dialect.MAV_CMD_SET_CAMERA_ZOOM,
    dialect.MAV_CMD_STORAGE_FORMAT,
    dialect.MAV_CMD_PANORAMA_CREATE,
)
IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS


def records(w: World) -> bool:
    return bool(w.drone.firmware.payload.cameras.busy)


between = pytest.mark.parametrize("other", [0, 1], ids=["same-client", "other-client"])
"""Index of the client that sends the command between the two equal ones."""


@both
@between
async def test_recording_started_again_after_a_stop_runs(flavour: str, other: int) -> None:
    async with world(flavour=flavour, clients=2) as w:
        await enter(w.client, VIDEO)
        for index, id in ((0, START), (other, STOP), (0, START)):
            assert await command(w.clients[index], id, 0, 0) == ACCEPTED
        assert records(w)
        assert len(w.commands("camera.start_recording")) == 2


@between
@pytest.mark.parametrize("first", [PHOTO, VIDEO])
async def test_mode_set_back_and_forth_is_the_last_one(first: int, other: int) -> None:
    second = VIDEO if first == PHOTO else PHOTO
    async with world(clients=2) as w:
        await enter(w.client, second)
        for index, mode in ((0, first), (other, second), (0, first)):
            assert await command(w.clients[index], MODE, 0, mode) == ACCEPTED
        assert w.commands("camera.set_camera_mode")[-1].args["value"] == (1 if first == PHOTO else 0)


async def test_modes_sent_in_one_burst_run_in_order() -> None:
    async with world() as w:
        await enter(w.client, VIDEO)
        before, mark = len(w.commands("camera.set_camera_mode")), w.client.mark()
        for mode in (PHOTO, VIDEO, PHOTO):
            w.client.send_command(MODE, 0, mode, target=(1, CAMERA))
        for _ in range(3):
            ack = await w.client.wait("COMMAND_ACK", lambda ack: ack.result != IN_PROGRESS, since=mark)
            assert ack.result == ACCEPTED
            mark = w.client.mark()
        modes = [entry.args["value"] for entry in w.commands("camera.set_camera_mode")[before:]]
        assert modes == [1, 0, 1]


async def test_recording_stopped_at_the_autopilot_starts_again() -> None:
    async with world(flavour="ardupilot") as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START, 0, 0) == ACCEPTED
        assert (await w.client.command(STOP, 0)).result == ACCEPTED
        assert await command(w.client, START, 0, 0) == ACCEPTED
        assert records(w)


async def test_recording_stopped_by_the_pilot_starts_again() -> None:
    async with world() as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START, 0, 0) == ACCEPTED
        mark = w.client.mark()
        press(w, camera_messages.StopRecording(cam_id=0))
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: not s.video_status, since=mark)
        assert await command(w.client, START, 0, 0) == ACCEPTED
        assert records(w)
        assert len(videos(w)) >= 1


async def test_source_of_another_client_is_set_back() -> None:
    thermal, visible = (0, dialect.CAMERA_SOURCE_IR, 0), (0, dialect.CAMERA_SOURCE_RGB, 0)
    async with world(model="thermal", clients=2) as w:
        first, second = w.clients
        for client, source in ((first, thermal), (second, visible), (first, thermal), (first, thermal)):
            assert await command(client, SOURCE, *source) == ACCEPTED
        assert w.commands("thermal.set_rendering")[-1].args["mode"] == RenderingMode.THERMAL


@between
async def test_photos_by_distance_begin_again_after_their_end(other: int) -> None:
    async with world(clients=2) as w:
        for index, distance in ((0, 5.0), (other, 0.0), (0, 5.0)):
            assert (await w.clients[index].command(DISTANCE, distance)).result == ACCEPTED
        assert records(w)
        assert len(w.commands("camera.take_photo")) == 2


async def resend(w: World, id: int, params: tuple[float, ...], every: float, *, confirms: bool = False) -> list[int]:
    """Send a command six times as a client that receives no answer; return all results."""
    mark = w.client.mark()
    padded = [*params, *[NAN] * (7 - len(params))]
    for confirmation in range(6):
        w.client.send(dialect.MAVLink_command_long_message(1, CAMERA, id, confirmation if confirms else 0, *padded))
        await asyncio.sleep(every)  # the client's own timer
    return [ack.result for _, ack in w.client.since(mark, "COMMAND_ACK") if ack.result != IN_PROGRESS]


repeats = pytest.mark.parametrize("every", [0.5, 1.0])


@repeats
@pytest.mark.parametrize(("number", "confirms"), [(7, False), (0, True)])
async def test_photo_whose_answer_is_lost_is_one_photo(every: float, number: int, confirms: bool) -> None:
    async with world() as w:
        await enter(w.client, PHOTO)
        results = await resend(w, SHOOT, (0, 0, 1, number), every, confirms=confirms)
        assert set(results) == {ACCEPTED}
        assert len(w.commands("camera.take_photo")) == len(photos(w)) == 1


@repeats
async def test_step_of_zoom_whose_answer_is_lost_is_one(every: float) -> None:
    async with world() as w:
        before = len(w.commands("camera.set_zoom_target"))
        results = await resend(w, ZOOM, (dialect.ZOOM_TYPE_STEP, 1), every, confirms=True)
        assert set(results) == {ACCEPTED}
        assert len(w.commands("camera.set_zoom_target")) == before + 1


@repeats
async def test_format_whose_answer_is_lost_is_one_format(every: float) -> None:
    async with world() as w:
        assert set(await resend(w, FORMAT, (1, 1), every)) == {ACCEPTED}
        assert len(w.commands("user_storage.format_with_type")) == 1


async def test_format_after_a_photo_is_a_new_one() -> None:
    async with world(web=True) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, FORMAT, 1, 1) == ACCEPTED
        await shoot(w.client)
        assert await command(w.client, FORMAT, 1, 1) == ACCEPTED
        assert not photos(w)
        assert len(w.commands("user_storage.format_with_type")) == 2


async def test_panorama_whose_answer_is_lost_is_one_panorama() -> None:
    async with world(web=True, speed=1.0) as w:
        await w.take_off(8.0)
        results = await resend(w, PANORAMA, (180, 0), 0.5)
        assert set(results) == {ACCEPTED}
        assert len(w.commands("animation.start_horizontal_180_photo_panorama")) == 1


async def test_panorama_after_a_hold_is_not_confirmed_unflown() -> None:
    async with world(web=True) as w:
        await w.take_off(8.0)
        assert await command(w.client, PANORAMA, 180, 0) == ACCEPTED
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == ACCEPTED
        result = await command(w.client, PANORAMA, 180, 0)
        begun = len(w.commands("animation.start_horizontal_180_photo_panorama"))
        assert (result == ACCEPTED) == (begun == 2)
