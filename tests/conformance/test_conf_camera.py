"""Items 84 to 93, 96, 97, 128, 129, 136, 138, 154: the camera component, judged by the simulator's own state."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace
from support.cameras import ACCEPTED, PHOTO, VIDEO, command, enter, photos, press, request, shoot, texts, videos
from support.ext_params import CHOICE, fetch, read, value_of, write
from support.fault_scenarios import on_command, watched
from support.flavours import both
from support.ftp import Ftp
from support.mav import CAMERA, Client
from support.sim_settings import sim_value
from support.world import HOME, World, world

from anafi_mav import geo
from anafi_mav.arsdk.messages import camera as camera_messages
from anafi_mav.arsdk.messages import user_storage
from anafi_mav.arsdk.messages import user_storage_v2 as v2
from anafi_mav.arsdk.messages.camera import Availability, State
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.arsdk.messages.user_storage import FsState, PhyState
from anafi_mav.drone.payload.media import MediaItem
from anafi_mav.mavlink import dialect
from anafi_mav.sim.payload import capture
from anafi_mav.sim.world.faults import Impairment

DENIED, FAILED, REJECTED, UNSUPPORTED = (
    dialect.MAV_RESULT_DENIED,
    dialect.MAV_RESULT_FAILED,
    dialect.MAV_RESULT_TEMPORARILY_REJECTED,
    dialect.MAV_RESULT_UNSUPPORTED,
)
START_PHOTO, STOP_PHOTO = dialect.MAV_CMD_IMAGE_START_CAPTURE, dialect.MAV_CMD_IMAGE_STOP_CAPTURE
START_VIDEO, STOP_VIDEO = dialect.MAV_CMD_VIDEO_START_CAPTURE, dialect.MAV_CMD_VIDEO_STOP_CAPTURE
ZOOM, FORMAT = dialect.MAV_CMD_SET_CAMERA_ZOOM, dialect.MAV_CMD_STORAGE_FORMAT

IMAGE = dialect.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED
SINGLE, TIME_LAPSE, GPS_LAPSE = 0.0, 3.0, 4.0
"""Of CAM_PHOTOMODE."""

models = pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])

BASE = (
    dialect.CAMERA_CAP_FLAGS_CAPTURE_VIDEO
    | dialect.CAMERA_CAP_FLAGS_CAPTURE_IMAGE
    | dialect.CAMERA_CAP_FLAGS_HAS_MODES
    | dialect.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
    | dialect.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
)
THERMAL = BASE | dialect.CAMERA_CAP_FLAGS_HAS_THERMAL_RANGE
FLAGS = {"4k": BASE, "thermal": THERMAL, "usa": THERMAL, "ai": BASE}
SIZES = {"4k": (5344, 4016), "thermal": (5344, 4016), "usa": (5344, 4016), "ai": (8000, 6000)}

LEGACY = {
    dialect.MAV_CMD_REQUEST_CAMERA_INFORMATION: "CAMERA_INFORMATION",
    dialect.MAV_CMD_REQUEST_CAMERA_SETTINGS: "CAMERA_SETTINGS",
    dialect.MAV_CMD_REQUEST_STORAGE_INFORMATION: "STORAGE_INFORMATION",
    dialect.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: "CAMERA_CAPTURE_STATUS",
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION: "VIDEO_STREAM_INFORMATION",
    dialect.MAV_CMD_REQUEST_VIDEO_STREAM_STATUS: "VIDEO_STREAM_STATUS",
}


@both
@models
async def test_conf_084_information_is_true_to_the_model(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        await w.client.wait("CAMERA_HEARTBEAT", since=0)
        about = await request(w.client, "CAMERA_INFORMATION")
        assert (about.flags, (about.resolution_h, about.resolution_v)) == (FLAGS[model], SIZES[model])
        assert bytes(about.vendor_name).rstrip(b"\0") == b"Parrot"
        assert (about.gimbal_device_id, about.camera_device_id) == (1, 0)
        assert about.cam_definition_version
        assert about.cam_definition_uri.startswith("mftp://")


@both
async def test_conf_085_older_requests_and_request_message_agree(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        for id, kind in LEGACY.items():
            by_message, mark = await request(w.client, kind), w.client.mark()
            assert await command(w.client, id, 1) == ACCEPTED
            old = (await w.client.wait(kind, since=mark)).to_dict()
            new = by_message.to_dict()
            for message in (old, new):
                message.pop("time_boot_ms", None)
            assert str(old) == str(new)
        assert await command(w.client, dialect.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE, 0) == DENIED


@both
@models
async def test_conf_086_photo_is_reported_with_file(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model, web=True) as w:
        await enter(w.client, PHOTO)
        for index in range(2):
            mark = w.client.mark()
            image = await shoot(w.client)
            assert (image.image_index, image.capture_result) == (index, 1)
            assert (image.lat / 1e7, image.lon / 1e7) == pytest.approx(HOME[:2], abs=2e-6)
            day, _, name = image.file_url.removeprefix("mftp://[;comp=100]/media/").partition("/")
            resource = photos(w)[index].resources[0]
            assert name == resource.id
            assert await Ftp(w.client, component=CAMERA).download(f"/media/{day}/{name}") == resource.content()
            await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0 and s.image_count, since=mark)
            states = [status.image_status for _, status in w.client.since(mark, "CAMERA_CAPTURE_STATUS")]
            assert states[0] == 1
            assert states[-1] == 0


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_086_refused_and_unannounced_photos_are_distinguished(model: str) -> None:
    """The pilot's button is refused while a client's photo is taken; later one has no report but its media."""
    async with world(model=model, web=True) as w:
        await enter(w.client, PHOTO)
        mark = w.client.mark()
        assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
        assert w.drone.firmware.payload.cameras.busy
        press(w, camera_messages.TakePhoto(0))
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=mark)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0 and s.image_count, since=mark)
        if model == "ai":
            w.drone.inject(
                camera2.Photo(
                    camera_id=0,
                    type=camera2.PhotoEvent.STOP,
                    stop_reason=camera2.PhotoStopReason.CAPTURE_DONE,
                    media_id="unannounced",
                )
            )
        else:
            result = camera_messages.PhotoResult.PHOTO_SAVED
            w.drone.inject(camera_messages.PhotoProgress(0, result, 1, "unannounced"))
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 1, since=mark)
        images = [image for _, image in w.client.since(mark, "CAMERA_IMAGE_CAPTURED")]
        assert [(image.image_index, image.capture_result) for image in images] == [(0, 1), (1, 1)]
        assert len(photos(w)) == 1


async def test_conf_086_geotag_is_that_of_the_shutter() -> None:
    """The drone accelerates with its camera turned down; the simulator knows the pose at the shutter."""
    async with world(web=True, speed=1.0) as w:
        await w.take_off(8.0)
        await enter(w.client, PHOTO)
        turned = dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
        assert (await w.client.command(turned, -40, math.nan, x=0.0, z=0.0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["gimbal_pitch"] + 40.0) < 0.5, 10.0)
        w.client.send_command(dialect.MAV_CMD_DO_REPOSITION, 6, 1, x=HOME[0] + 3e-4, y=HOME[1], z=12.0, frame=6)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 6.0, 20.0)
        image = await shoot(w.client)
        scene = photos(w)[0].resources[0].scene
        away = geo.distance(image.lat / 1e7, image.lon / 1e7, scene.latitude, scene.longitude)
        assert away < 0.6  # 0.1 s at 6 m/s
        assert image.alt / 1e3 == pytest.approx(scene.altitude, abs=0.7)
        w0, x, y, z = image.q
        pitch = math.degrees(math.asin(2 * (w0 * y - z * x)))
        assert pitch == pytest.approx(scene.pitch, abs=2.0)


async def test_conf_086_shutter_of_a_photo_that_is_reported_twice_is_one_picture() -> None:
    async with world(model="ai", speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        taking = camera2.Photo(camera_id=0, type=camera2.PhotoEvent.TAKING_PHOTO)
        repeated = on_command(w, "camera2.Command.StartPhoto", lambda: w.drone.inject(taking))
        first = await shoot(w.client)
        await repeated
        await w.client.wait("HEARTBEAT")
        assert (await shoot(w.client)).image_index == first.image_index + 1


async def test_conf_087_shutter_of_a_series_that_is_reported_twice_is_one_picture() -> None:
    """An ANAFI Ai counts no pictures. The series was ended one picture early."""
    async with world(model="ai", speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        taking = camera2.Photo(camera_id=0, type=camera2.PhotoEvent.TAKING_PHOTO)
        assert await command(w.client, START_PHOTO, 0, 3, 3) == ACCEPTED
        for index in range(2):
            await w.drone.wait_log(lambda e, taken=index + 1: w.drone.firmware.payload.cameras.shots == taken, 10.0)
            await watched(0.5)
            w.drone.inject(taking)
        await w.drone.wait_log(lambda e: bool(photos(w)) and not w.drone.firmware.payload.cameras.busy, 20.0)
        (series,) = photos(w)
        assert len(series.resources) == 3
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 2, since=0)
        assert (await request(w.client, "CAMERA_CAPTURE_STATUS")).image_count == 3


async def test_shutters_of_a_series_that_arrive_together_after_a_silence_are_pictures_each() -> None:
    async with world(model="ai", speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 1.5, 6) == ACCEPTED
        cameras = w.drone.firmware.payload.cameras
        await w.drone.wait_log(lambda e: cameras.shots == 2, 10.0)
        await watched(1.2)
        w.drone.faults.mute = True  # the shutters of the third and the fourth picture are repeated until it is heard
        await watched(2.3)
        w.drone.faults.mute = False
        await w.drone.wait_log(lambda e: bool(photos(w)) and not cameras.busy, 20.0)
        (series,) = photos(w)
        assert len(series.resources) == 6


@pytest.mark.parametrize(("mode", "pictures"), [(1.0, 7), (2.0, 14)], ids=["bracketing", "burst"])
async def test_conf_087_shutter_of_a_burst_that_is_reported_twice_is_one_picture(mode: float, pictures: int) -> None:
    async with world(model="ai", speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert (await write(w.client, "CAM_PHOTOMODE", mode, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
        taking = camera2.Photo(camera_id=0, type=camera2.PhotoEvent.TAKING_PHOTO)
        for _ in range(pictures):
            w.drone.inject(taking)
        last = pictures - 1
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == last, since=0)
        await watched(1.0)
        assert (await request(w.client, "CAMERA_CAPTURE_STATUS")).image_count == pictures


async def test_conf_086_shutter_that_is_reported_again_after_the_end_is_not_that_of_the_next_photo() -> None:
    """An ANAFI Ai counts no pictures. The next photo had the time and the place of the repeated report."""
    async with world(model="ai", speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        first = await shoot(w.client)
        w.drone.inject(camera2.Photo(camera_id=0, type=camera2.PhotoEvent.TAKING_PHOTO))
        for _ in range(3):
            await w.client.wait("HEARTBEAT", since=w.client.mark())
        second = await shoot(w.client)
        assert (second.image_index, len(photos(w))) == (first.image_index + 1, 2)
        assert second.time_boot_ms - first.time_boot_ms > 2000


async def test_conf_086_photos_that_are_taken_before_the_first_is_stored_have_their_own_files() -> None:
    result, progress = camera_messages.PhotoResult, camera_messages.PhotoProgress
    shown = "CAMERA_IMAGE_CAPTURED"
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        for _ in range(2):
            assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
            assert w.drone.firmware.payload.cameras.busy
            w.drone.faults.unreported = frozenset()
            w.drone.inject(progress(0, result.PHOTO_TAKEN, 1, ""))
            w.drone.faults.unreported = frozenset({progress.NAME})
            await w.drone.wait_log(lambda e: not w.drone.firmware.payload.cameras.busy, 10.0)
        w.drone.faults.unreported = frozenset()
        stored = [media.id for media in photos(w)]
        for id in stored:
            w.drone.inject(progress(0, result.PHOTO_SAVED, 1, id))
        await w.client.wait(shown, lambda image: image.image_index == 1, since=0)
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, IMAGE, -1) == ACCEPTED
        await w.client.wait(shown, lambda image: image.image_index == 1, since=mark)
        images = sorted((image for _, image in w.client.since(mark, shown)), key=lambda image: image.time_boot_ms)
        names = [image.file_url.rpartition("/")[2] for image in images]
        assert names == [media.resources[0].id for media in photos(w)]


@both
async def test_conf_087_series_counts_and_ends(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await enter(w.client, PHOTO)
        mark = w.client.mark()
        assert await command(w.client, START_PHOTO, 0, 2, 3) == ACCEPTED
        status = await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status >= 2, since=mark)
        assert status.image_interval == pytest.approx(2.0)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, since=w.client.mark(), timeout=20.0)
        await w.drone.wait_log(lambda e: e.name == "camera.set_photo_mode" and "SINGLE" in str(e.args), 5.0)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 2, since=mark)
        (series,) = photos(w)
        assert (series.mode, len(series.resources)) == ("TIMELAPSE", 3)
        images = [image for _, image in w.client.since(mark, "CAMERA_IMAGE_CAPTURED")]
        assert [image.image_index for image in images] == [0, 1, 2]
        assert len({image.file_url for image in images}) == 3
        times = [image.time_boot_ms / 1e3 for image in images]
        assert all(later - earlier == pytest.approx(2.0 / 3.0, abs=0.2) for earlier, later in pairwise(times))

        assert await command(w.client, START_PHOTO, 0, 2, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 4, timeout=20.0)
        mark = w.client.mark()
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, since=mark)
        assert len(w.commands("camera.stop_photo")) == 2
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_087_one_picture_of_a_series_is_one(model: str) -> None:
    async with world(model=model, web=True) as w:
        await enter(w.client, PHOTO)
        for count in (0.5, -1.0, math.inf):
            assert await command(w.client, START_PHOTO, 0, 1, count) == DENIED
        assert (await write(w.client, "CAM_PHOTOMODE", 3.0, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        mark = w.client.mark()
        assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=mark)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0 and s.image_count, since=mark)
        assert not w.drone.firmware.payload.cameras.busy
        assert [(media.mode, len(media.resources)) for media in photos(w)] == [("TIMELAPSE", 1)]
        # The limit was that series' alone.
        assert await command(w.client, START_PHOTO, 0, 0, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 2, timeout=20.0)
        assert w.drone.firmware.payload.cameras.busy


LATE_STATES = {kind.NAME: 0.7 for kind in (camera_messages.PhotoState, camera_messages.RecordingState, camera2.State)}
"""The drone reports the state of photos and recordings s after their progress; it promises no order."""


@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize(
    ("mode", "start", "stop"), [(PHOTO, (START_PHOTO, 0, 2, 0), STOP_PHOTO), (VIDEO, (START_VIDEO, 0), STOP_VIDEO)]
)
async def test_conf_087_stop_just_after_a_start_and_start_just_after_a_stop(
    model: str, mode: int, start: tuple[int, ...], stop: int
) -> None:
    async with world(model=model, speed=1.0, web=True) as w:
        await enter(w.client, mode)
        w.drone.faults.late = LATE_STATES
        assert await command(w.client, *start) == ACCEPTED
        assert await command(w.client, stop, 0) == ACCEPTED
        assert not w.drone.firmware.payload.cameras.busy
        assert await command(w.client, *start) == ACCEPTED
        assert w.drone.firmware.payload.cameras.busy


async def test_conf_087_one_picture_of_a_series_is_one_although_its_begin_is_reported_late() -> None:
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert (await write(w.client, "CAM_PHOTOMODE", 3.0, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        w.drone.faults.late = LATE_STATES
        mark = w.client.mark()
        assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
        await w.drone.wait_log(lambda e: not w.drone.firmware.payload.cameras.busy, 10.0)
        assert texts(w.client, mark) == []


async def test_conf_087_series_is_not_ended_by_the_count_of_the_one_before() -> None:
    """The first shutter of this one is reported before its begin."""
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 1, 3) == ACCEPTED
        await w.drone.wait_log(lambda e: bool(photos(w)) and not w.drone.firmware.payload.cameras.busy, 20.0)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 2, since=0)
        w.drone.faults.unreported = frozenset({camera_messages.PhotoProgress.NAME})
        w.drone.faults.late = {camera_messages.PhotoState.NAME: 0.5}

        stops = len(w.commands("camera.stop_photo"))
        started = asyncio.ensure_future(command(w.client, START_PHOTO, 0, 1, 2))
        await w.drone.wait_log(lambda e: len(w.commands("camera.take_photo")) == 2, 10.0)
        w.drone.faults.unreported = frozenset()
        w.drone.inject(camera_messages.PhotoProgress(0, camera_messages.PhotoResult.PHOTO_TAKEN, 1, ""))
        assert await started == ACCEPTED
        await watched(1.0)
        assert len(w.commands("camera.stop_photo")) == stops


async def photo_mode_shown(client: Client, mode: float, since: int) -> None:
    """Wait until a change of CAM_PHOTOMODE to this mode is sent."""
    shown = "PARAM_EXT_VALUE"
    await client.wait(shown, lambda m: m.param_id == "CAM_PHOTOMODE" and value_of(m) == mode, since=since, timeout=30.0)


@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize("count", [0, 2])
async def test_conf_087_photo_mode_is_restored_after_a_series(model: str, count: int) -> None:
    """`count`: pictures after which it ends by itself; 0: it is stopped."""
    async with world(model=model, web=True) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        assert await command(w.client, START_PHOTO, 0, 2, count) == ACCEPTED
        assert sim_value(w.drone, "CAM_PHOTOMODE") == TIME_LAPSE
        mark = w.client.mark()
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 1, since=0, timeout=10.0)
        if not count:
            assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        await photo_mode_shown(w.client, before, mark)
        assert sim_value(w.drone, "CAM_PHOTOMODE") == before


@pytest.mark.parametrize(
    ("model", "mode", "name", "others", "before"),
    [
        ("ai", SINGLE, "CAM_PHOTODIST", 5.0, 10.0),
        ("ai", GPS_LAPSE, "CAM_PHOTOLAPSE", 3.0, 2.0),
        ("4k", GPS_LAPSE, "CAM_PHOTOLAPSE", 3.0, 2.0),
    ],
)
async def test_conf_087_interval_of_before_is_restored_after_a_series(
    model: str, mode: float, name: str, others: float, before: float
) -> None:
    """An ANAFI Ai has one interval for each of the two series, the others one for both."""
    async with world(model=model, web=True) as w:
        await enter(w.client, PHOTO)
        assert (await write(w.client, "CAM_PHOTOMODE", mode, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        assert sim_value(w.drone, name) == before
        if mode == SINGLE:
            ack = await w.client.command(dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, others)
        else:
            ack = await w.client.command(START_PHOTO, 0, others, 0, target=(1, CAMERA))
        assert (ack.result, sim_value(w.drone, name)) == (ACCEPTED, others)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        await w.drone.wait_log(lambda e: sim_value(w.drone, "CAM_PHOTOMODE") == mode, 10.0)
        assert sim_value(w.drone, name) == before


async def test_intervals_of_both_series_of_an_ai_are_read_and_written_in_any_photo_mode() -> None:
    async with world(model="ai") as w:
        assert [value_of(await read(w.client, name)) for name in ("CAM_PHOTOLAPSE", "CAM_PHOTODIST")] == [2.0, 10.0]
        for name, value in (("CAM_PHOTODIST", 7.0), ("CAM_PHOTOLAPSE", 3.0)):
            ack = await write(w.client, name, value, dialect.MAV_PARAM_EXT_TYPE_REAL32)
            assert (ack.param_result, value_of(ack)) == (dialect.PARAM_ACK_ACCEPTED, value)
            assert sim_value(w.drone, name) == value


async def lose_link(w: World, seconds: float) -> None:
    """No datagram passes for this time; return when the vehicle is heard again."""
    w.drone.faults.mute = True
    await watched(seconds)
    w.drone.faults.mute = False
    mark = w.client.mark()
    await w.client.wait("GLOBAL_POSITION_INT", since=mark, timeout=30.0)


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_087_pictures_are_reported_once_around_a_lost_link(model: str) -> None:
    """Those that were taken without a link are not reported, and the others have the names of their own files."""
    async with world(model=model, speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 2, 0) == ACCEPTED
        shown = "CAMERA_IMAGE_CAPTURED"
        await w.client.wait(shown, lambda image: image.image_index == 2, since=0, timeout=10.0)
        await lose_link(w, 8.0)
        begun = w.drone.firmware.payload.cameras.shots
        last = await w.client.wait(shown, lambda image: image.image_index == 4, timeout=10.0)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        assert begun > 4
        await w.client.wait("HEARTBEAT")
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, IMAGE, last.image_index) == ACCEPTED
        image = await w.client.wait(shown, since=mark)
        names = [resource.id for resource in photos(w)[0].resources]
        assert image.file_url.rpartition("/")[2] in names[begun:]
        status = await request(w.client, "CAMERA_CAPTURE_STATUS")
        assert status.image_count < len(names)


@pytest.mark.parametrize("ends", [False, True])
async def test_conf_087_series_goes_on_after_a_lost_link_and_ends_as_commanded(ends: bool) -> None:
    """`ends`: another controller has stopped it meanwhile."""
    async with world(speed=1.0) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        assert await command(w.client, START_PHOTO, 0, 2, 8) == ACCEPTED
        mark = w.client.mark()
        w.drone.faults.mute = True
        await watched(6.0)
        if ends:
            press(w, camera_messages.StopPhoto(0))
        await lose_link(w, 1.0)
        await photo_mode_shown(w.client, before, mark)
        assert sim_value(w.drone, "CAM_PHOTOMODE") == before
        assert len(photos(w)[0].resources) <= 8


async def test_conf_087_settings_that_the_end_of_the_link_kept_from_being_restored_are_restored_after_it() -> None:
    async with world(speed=1.0) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        assert await command(w.client, START_PHOTO, 0, 2, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0, timeout=10.0)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        mark = w.client.mark()
        w.drone.faults.mute = True
        await watched(6.0)
        assert sim_value(w.drone, "CAM_PHOTOMODE") == TIME_LAPSE
        await lose_link(w, 1.0)
        await photo_mode_shown(w.client, before, mark)
        assert sim_value(w.drone, "CAM_PHOTOMODE") == before
        assert not texts(w.client, mark)


@pytest.mark.parametrize("is_lost", [True, False])
async def test_conf_087_photo_mode_of_a_series_that_does_not_begin_is_restored(is_lost: bool) -> None:
    """The drone sets the mode and does not report it; `is_lost`: because the link is lost."""
    async with world(speed=1.0) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        w.drone.faults.unreported = frozenset({camera_messages.PhotoMode.NAME})
        answer = asyncio.ensure_future(command(w.client, START_PHOTO, 0, 2, 0))
        await w.drone.wait_log(lambda e: sim_value(w.drone, "CAM_PHOTOMODE") == TIME_LAPSE, 10.0)
        session = w.drone.session
        assert session is not None
        if is_lost:
            session.end("restart")
        assert await answer == FAILED
        w.drone.faults.unreported = frozenset()
        await w.drone.wait_log(lambda e: sim_value(w.drone, "CAM_PHOTOMODE") == before, 30.0)


async def test_conf_087_series_whose_end_was_lost_with_the_link_is_ended_after_it() -> None:
    async with world(speed=1.0) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 2, 2) == ACCEPTED
        taken = camera_messages.PhotoProgress(0, camera_messages.PhotoResult.PHOTO_TAKEN, 2, "")
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0, timeout=10.0)
        w.drone.faults.up = Impairment(loss=1.0)
        w.drone.inject(taken)
        await watched(0.5)
        assert w.gateway.systems[0].drone.camera[0].taking
        w.drone.faults.mute = True
        await watched(6.0)
        w.drone.faults.up = Impairment()
        await lose_link(w, 1.0)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "camera.stop_photo", 10.0)


async def test_conf_087_series_whose_state_was_not_reported_before_the_link_was_lost_ends_as_commanded() -> None:
    """Its begin was: it is under way."""
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        w.drone.faults.late = {camera_messages.PhotoState.NAME: 1.5}
        answer = asyncio.ensure_future(command(w.client, START_PHOTO, 0, 2, 5))
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "camera.take_photo", 10.0)
        await watched(0.3)
        session = w.drone.session
        assert session is not None
        session.end("restart")
        assert await answer == ACCEPTED
        w.drone.faults.late = {}
        await w.drone.wait_log(lambda e: bool(photos(w)) and not w.drone.firmware.payload.cameras.busy, 30.0)
        assert len(photos(w)[0].resources) <= 6
        await w.drone.wait_log(lambda e: sim_value(w.drone, "CAM_PHOTOMODE") == before, 5.0)


async def test_conf_087_long_series_is_listed_when_it_has_grown(monkeypatch: pytest.MonkeyPatch) -> None:
    """A list names all pictures of the series: with each of them it would take the radio of the flight."""
    count = 30
    async with world(speed=8.0, web=True) as w:
        media = w.gateway.systems[0].drone.media
        get, listed = media.get, []

        async def counted(id: str) -> MediaItem:
            listed.append(id)
            return await get(id)

        monkeypatch.setattr(media, "get", counted)
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 2, count) == ACCEPTED
        shown = "CAMERA_IMAGE_CAPTURED"
        first = await w.client.wait(shown, lambda image: image.image_index == 4, since=0, timeout=20.0)
        assert first.file_url
        await w.client.wait(shown, lambda image: image.image_index == count - 1, since=0, timeout=60.0)
        await w.client.wait("HEARTBEAT")
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, IMAGE, -1) == ACCEPTED
        await w.client.wait(shown, lambda image: image.image_index == count - 1, since=mark)
        images = [image for _, image in w.client.since(mark, shown)]
        names = [image.file_url.rpartition("/")[2] for image in images]
        assert names == [resource.id for resource in photos(w)[0].resources]
        assert 10 < len(listed) < count


async def test_conf_087_series_whose_begin_is_reported_late_keeps_its_settings() -> None:
    """The drone reports the first picture as stored before it reports that photos are taken."""
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        w.drone.faults.late = {camera_messages.PhotoState.NAME: 1.5}
        assert await command(w.client, START_PHOTO, 0, 2, 3) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 2, since=0, timeout=10.0)
        await w.drone.wait_log(lambda e: e.kind == "command" and e.name == "camera.stop_photo", 5.0)
        names = [
            e.name
            for e in w.drone.log
            if e.kind == "command" and e.name in ("camera.set_photo_mode", "camera.stop_photo")
        ]
        assert names == ["camera.set_photo_mode", "camera.stop_photo"]


async def test_mode_that_is_reported_once_more_before_it_changes_is_not_refused() -> None:
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        before = camera_messages.CameraMode(0, camera_messages.CameraCameraMode.RECORDING)
        reported = on_command(w, "camera.set_camera_mode", lambda: w.drone.inject(before))
        await enter(w.client, PHOTO)
        await reported
        assert texts(w.client, mark) == []


async def test_mode_that_is_reported_once_more_on_a_slow_link_is_not_refused() -> None:
    """The change arrives half a second after that report, and its answer as much later."""
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.4)
        before = camera_messages.CameraMode(0, camera_messages.CameraCameraMode.RECORDING)
        w.drone.inject(before)  # arrives after the command is sent
        await enter(w.client, PHOTO)
        assert texts(w.client, mark) == []


async def test_conf_087_series_is_not_ended_by_the_late_end_of_the_photo_before() -> None:
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        before = sim_value(w.drone, "CAM_PHOTOMODE")
        w.drone.faults.late = {camera_messages.PhotoState.NAME: 0.8}
        assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
        await w.drone.wait_log(lambda e: bool(photos(w)) and not w.drone.firmware.payload.cameras.busy, 10.0)
        assert await command(w.client, START_PHOTO, 0, 2, 3) == ACCEPTED
        shown = "CAMERA_IMAGE_CAPTURED"
        await w.client.wait(shown, lambda image: image.image_index == 3, since=0, timeout=20.0)
        await w.drone.wait_log(lambda e: sim_value(w.drone, "CAM_PHOTOMODE") == before, 10.0)
        assert [len(media.resources) for media in photos(w)] == [1, 3]


async def test_conf_087_files_of_a_series_on_a_slow_card_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture is reported before the drone reports that it is stored."""
    monkeypatch.setattr(capture, "SAVE_TIME", 1.5)
    shown = "CAMERA_IMAGE_CAPTURED"
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, START_PHOTO, 0, 3, 0) == ACCEPTED
        await w.client.wait(shown, lambda image: image.image_index == 1, since=0, timeout=20.0)
        await w.drone.wait_log(lambda e: len(photos(w)[0].resources) == 2, 10.0)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        names = [""]
        for _ in range(10):
            if "" not in names:
                break
            mark = w.client.mark()
            await w.client.wait("HEARTBEAT", since=mark)
            assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, IMAGE, -1) == ACCEPTED
            await w.client.wait(shown, lambda image: image.image_index == 1, since=mark)
            names = [image.file_url.rpartition("/")[2] for _, image in w.client.since(mark, shown)]
        assert names == [resource.id for resource in photos(w)[0].resources]


async def test_conf_087_picture_that_is_reported_after_the_end_of_its_series_is_captured() -> None:
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        w.drone.faults.late = {camera_messages.PhotoProgress.NAME: 0.7}
        assert await command(w.client, START_PHOTO, 0, 2, 0) == ACCEPTED
        await w.drone.wait_log(lambda e: bool(photos(w)) and len(photos(w)[0].resources) == 2, 10.0)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        image = await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 1, since=0)
        assert image.capture_result == 1
        assert (await shoot(w.client)).image_index == 2
        assert (await request(w.client, "CAMERA_CAPTURE_STATUS")).image_count == 3
        assert [len(media.resources) for media in photos(w)] == [2, 1]


@pytest.mark.parametrize("model", ["4k", "ai"])
@pytest.mark.parametrize(("interval", "count", "mode"), [(0, 1, "SINGLE"), (2, 2, "TIMELAPSE")])
async def test_conf_087_photo_after_a_series_is_taken_as_commanded(
    model: str, interval: int, count: int, mode: str
) -> None:
    """The settings of before the series are restored a round trip later."""
    async with world(model=model, speed=1.0) as w:
        await enter(w.client, PHOTO)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        assert await command(w.client, START_PHOTO, 0, 2, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0, timeout=10.0)
        assert await command(w.client, STOP_PHOTO, 0) == ACCEPTED
        assert await command(w.client, START_PHOTO, 0, interval, count) == ACCEPTED
        mark = w.client.mark()
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, since=mark, timeout=20.0)
        second = photos(w)[-1]
        assert (len(photos(w)), second.mode, len(second.resources)) == (2, mode, count)


async def test_conf_087_bursts_whose_end_is_reported_early_are_one_message_per_file() -> None:
    shown = "CAMERA_IMAGE_CAPTURED"
    async with world(speed=1.0, web=True) as w:
        await enter(w.client, PHOTO)
        assert (await write(w.client, "CAM_PHOTOMODE", 2.0, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        w.drone.faults.late = {camera_messages.PhotoProgress.NAME: 0.7}
        for number in (1, 2):
            assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
            await w.client.wait(shown, lambda image, n=number: image.image_index == 14 * n - 1, since=0, timeout=10.0)
        images = [image for _, image in w.client.since(0, shown)]
        assert [image.image_index for image in images] == list(range(28))
        assert all(image.capture_result == 1 for image in images)
        names = [image.file_url.rpartition("/")[2] for image in images]
        assert names == [resource.id for media in photos(w) for resource in media.resources]


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_conf_087_burst_and_bracketing_are_one_message_per_file(model: str) -> None:
    async with world(model=model, web=True) as w:
        await enter(w.client, PHOTO)
        first = 0
        for mode, name in ((2.0, "BURST"), (1.0, "BRACKETING")):
            assert (await write(w.client, "CAM_PHOTOMODE", mode, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
            mark = w.client.mark()
            assert await command(w.client, START_PHOTO, 0, 0, 1) == ACCEPTED
            await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 1, since=mark)
            await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, timeout=10.0)
            media = photos(w)[-1]
            last = first + len(media.resources) - 1
            await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image, n=last: image.image_index == n, since=mark)
            images = [image for _, image in w.client.since(mark, "CAMERA_IMAGE_CAPTURED")]
            assert (media.mode, last > first) == (name, True)
            assert [(image.image_index, image.file_url.rpartition("/")[2]) for image in images] == [
                (index, resource.id) for index, resource in enumerate(media.resources, first)
            ]
            first = last + 1


@both
async def test_conf_087_photos_by_distance(flavour: str) -> None:
    async with world(flavour=flavour, web=True) as w:
        await w.take_off(8.0)
        mark = w.client.mark()
        distance = dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST
        assert (await w.client.command(distance, 5.0)).result == ACCEPTED
        w.client.send_command(dialect.MAV_CMD_DO_REPOSITION, 4, 1, x=HOME[0] + 3e-4, y=HOME[1], z=8.0, frame=6)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 28.0, 30.0)
        assert (await w.client.command(distance, 0.0)).result == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 5, since=mark)
        places = [resource.scene.north for resource in photos(w)[0].resources]
        assert all(later - earlier == pytest.approx(5.0, abs=0.7) for earlier, later in pairwise(places))
        images = [image for _, image in w.client.since(mark, "CAMERA_IMAGE_CAPTURED")]
        assert len(images) == len(places)
        assert [image.image_index for image in images] == list(range(len(places)))


@both
async def test_conf_088_repeated_sequence_number_takes_one_photo(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        await enter(w.client, PHOTO)
        for _ in range(3):
            assert await command(w.client, START_PHOTO, 0, 0, 1, 7) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0)
        assert await command(w.client, START_PHOTO, 0, 0, 1, 8) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda image: image.image_index == 1, since=0)
        assert len(photos(w)) == 2


@both
@models
async def test_conf_089_recording_runs_and_ends(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        await enter(w.client, VIDEO)
        mark = w.client.mark()
        assert await command(w.client, START_VIDEO, 0, 5) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.recording_time_ms > 1000, since=mark)
        times = [s.recording_time_ms for _, s in w.client.since(mark, "CAMERA_CAPTURE_STATUS") if s.video_status]
        assert len(times) >= 5
        assert times == sorted(times)
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_MODE, 0, PHOTO) == REJECTED
        assert await command(w.client, STOP_VIDEO, 0) == ACCEPTED
        assert len(videos(w)) == 1
        status = await request(w.client, "CAMERA_CAPTURE_STATUS")
        assert (status.video_status, status.recording_time_ms) == (0, 0)
        assert await command(w.client, STOP_VIDEO, 0) == ACCEPTED


@pytest.mark.parametrize("is_state_first", [False, True])
async def test_conf_089_recording_that_ends_by_itself_is_a_text(is_state_first: bool) -> None:
    async with world() as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        mark = w.client.mark()
        results = camera_messages.RecordingResult
        w.drone.inject(camera_messages.RecordingProgress(0, results.ERROR_BAD_STATE, ""))  # it goes on
        await w.client.wait("HEARTBEAT")
        assert not texts(w.client, mark)
        ends = (
            camera_messages.RecordingProgress(0, results.STOPPED_NO_STORAGE_SPACE, "9"),
            camera_messages.RecordingState(0, Availability.AVAILABLE, State.INACTIVE, 0),
        )
        for end in reversed(ends) if is_state_first else ends:
            w.drone.inject(end)
        text = await w.client.wait("STATUSTEXT", lambda m: m.text.startswith("Recording ended"), since=mark)
        assert text.severity == dialect.MAV_SEVERITY_WARNING


async def test_end_of_a_recording_that_is_reported_again_is_one_text() -> None:
    async with world() as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        mark = w.client.mark()
        full = camera_messages.RecordingResult.STOPPED_NO_STORAGE_SPACE
        end = camera_messages.RecordingProgress(0, full, "9")
        inactive = camera_messages.RecordingState(0, Availability.AVAILABLE, State.INACTIVE, 0)
        for event in (end, inactive, end):
            w.drone.inject(event)
        for _ in range(2):
            await w.client.wait("HEARTBEAT", since=w.client.mark())
        assert len([text for text in texts(w.client, mark) if text.startswith("Recording ended")]) == 1


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_recording_on_a_full_storage_is_refused_at_once(model: str) -> None:
    async with world(model=model) as w:
        await enter(w.client, VIDEO)
        w.drone.faults.storage_full = True
        await w.client.wait("HEARTBEAT")  # it takes effect within 50 ms
        mark = w.client.mark()
        assert await command(w.client, START_VIDEO, 0, 0) == REJECTED
        assert any("storage space" in text for text in texts(w.client, mark))


async def test_recording_is_not_refused_by_the_late_end_of_another_one() -> None:
    """The drone has ended that for a change of its settings; such an end may have no media."""
    reconfigured = camera_messages.RecordingResult.STOPPED_RECONFIGURED
    async with world(speed=1.0) as w:
        await enter(w.client, VIDEO)
        w.drone.faults.up = w.drone.faults.down = Impairment(delay=0.3)
        w.drone.inject(camera_messages.RecordingProgress(0, reconfigured, ""))  # arrives after the start is sent
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_recording_just_after_another_one_counts_from_its_own_begin(model: str) -> None:
    async with world(model=model) as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 5) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.recording_time_ms > 2000)
        assert await command(w.client, STOP_VIDEO, 0) == ACCEPTED
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        status = await request(w.client, "CAMERA_CAPTURE_STATUS")
        assert status.video_status
        assert status.recording_time_ms < 1000


async def test_late_end_of_a_recording_is_not_that_of_the_next_one() -> None:
    async with world(model="ai") as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        assert await command(w.client, STOP_VIDEO, 0) == ACCEPTED
        assert await command(w.client, START_VIDEO, 0, 5) == ACCEPTED
        mark = w.client.mark()
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.recording_time_ms > 1000, since=mark)
        late = camera2.Recording(
            type=camera2.RecordingEvent.STOP,
            media_id="1",
            stop_reason=camera2.RecordingStopReason.INSUFFICIENT_STORAGE_SPACE,
        )
        w.drone.inject(late)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.recording_time_ms > 2000, since=mark)
        statuses = [s for _, s in w.client.since(mark, "CAMERA_CAPTURE_STATUS")]
        assert all(status.video_status for status in statuses)
        times = [status.recording_time_ms for status in statuses]
        assert times == sorted(times)
        assert not texts(w.client, mark)


@both
@models
async def test_conf_090_mode_is_changed_and_reported(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        for mode, wrong in ((PHOTO, START_VIDEO), (VIDEO, START_PHOTO)):
            mark = w.client.mark()
            await enter(w.client, mode)
            assert (await w.client.wait("CAMERA_SETTINGS", since=mark)).mode_id == mode
            assert await command(w.client, wrong, 0, 0, 1) == REJECTED
            assert any("mode" in text for text in texts(w.client, mark))
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_MODE, 0, dialect.CAMERA_MODE_IMAGE_SURVEY) == DENIED
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_MODE, 2, PHOTO) == DENIED


@pytest.mark.parametrize("is_default", [True, False])
async def test_capabilities_that_are_reported_in_part_take_no_mode_from_an_ai(is_default: bool) -> None:
    """Those of its present settings, or some of those of all."""
    rules = (camera2.CapabilitiesRule(index=2, video_recording_codecs=(camera2.VideoCodec.H264,)),)
    if not is_default:
        rules = (replace(rules[0], camera_modes=(camera2.CameraMode.RECORDING,)),)
    part = camera2.Capabilities(rules=rules)
    async with world(model="ai") as w:
        found = await fetch(w.client)
        kinds = {"default_capabilities" if is_default else "current_capabilities": part}
        w.drone.inject(camera2.State(camera_id=0, **kinds))
        await watched(0.5)
        await enter(w.client, PHOTO)
        assert sim_value(w.drone, "CAM_MODE") == 0.0
        assert (await write(w.client, "CAM_EV", 1.0, dialect.MAV_PARAM_EXT_TYPE_REAL32)).param_result == 0
        assert set(await fetch(w.client)) == set(found)
        assert w.gateway.systems[0].drone.camera[0].storage_policies


@both
@models
async def test_conf_092_each_storage_is_reported(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        count = 2 if model == "ai" else 1
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, 261, 0) == ACCEPTED
        found = [message for _, message in w.client.since(mark, "STORAGE_INFORMATION")]
        assert [(s.storage_id, s.storage_count, s.status) for s in found] == [
            (number, count, dialect.STORAGE_STATUS_READY) for number in range(1, count + 1)
        ]
        card = found[-1]
        assert card.total_capacity == pytest.approx(64e9 / 2**20)
        assert card.used_capacity + card.available_capacity == pytest.approx(card.total_capacity)
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, 261, count + 1) == DENIED


async def test_storage_name_ends_with_a_whole_character() -> None:
    """The label of a card may have eleven characters of three bytes: one byte more than the field has."""
    async with world() as w:
        name = "照" * 10
        w.drone.inject(user_storage.Info(name + "照", 64_000_000_000))
        message = await w.client.wait("STORAGE_INFORMATION", lambda m: name.encode() in bytes(m.get_msgbuf()))
        assert name.encode() + b"\0" in bytes(message.get_msgbuf())


PROBLEMS = [
    (PhyState.UNDETECTED, FsState.UNKNOWN, dialect.STORAGE_STATUS_EMPTY, DENIED),
    (PhyState.TOO_SLOW, FsState.UNKNOWN, dialect.STORAGE_STATUS_NOT_SUPPORTED, DENIED),
    (PhyState.AVAILABLE, FsState.FORMAT_NEEDED, dialect.STORAGE_STATUS_UNFORMATTED, DENIED),
    (PhyState.AVAILABLE, FsState.PASSWORD_NEEDED, dialect.STORAGE_STATUS_NOT_SUPPORTED, DENIED),
    (PhyState.AVAILABLE, FsState.FORMATTING, dialect.STORAGE_STATUS_UNFORMATTED, REJECTED),
]


async def test_conf_092_unusable_storage_is_pushed_and_refuses_photos() -> None:
    async with world() as w:
        await enter(w.client, PHOTO)
        for physical, file_system, status, result in PROBLEMS:
            mark = w.client.mark()
            w.drone.inject(user_storage.State(physical, file_system, 0, 1, 5))
            await w.client.wait("STORAGE_INFORMATION", is_in(status), since=mark)
            assert await command(w.client, START_PHOTO, 0, 0, 1) == result
            assert any(text.startswith("Photo refused: ") for text in texts(w.client, mark))
        mark = w.client.mark()
        w.drone.inject(user_storage.State(PhyState.AVAILABLE, FsState.READY, 0, 1, 5))
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Storage 1: ready", since=mark)
        await shoot(w.client)


async def test_conf_096_change_without_a_link_is_pushed_after_it() -> None:
    """A station asks only once, and would show the recording for good."""
    async with world(speed=1.0) as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        mark = w.client.mark()
        w.drone.faults.mute = True
        await watched(6.0)
        press(w, camera_messages.StopRecording(0))
        press(w, camera_messages.SetCameraMode(0, camera_messages.CameraCameraMode.PHOTO))
        await lose_link(w, 1.0)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.video_status == 0, since=mark)
        await w.client.wait("CAMERA_SETTINGS", lambda s: s.mode_id == PHOTO, since=mark)
        assert not texts(w.client, mark)


async def test_conf_092_storage_that_changes_without_a_link_is_pushed_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    async with world(speed=1.0) as w:
        mark = w.client.mark()
        w.drone.faults.mute = True
        await watched(6.0)
        report = user_storage.State(PhyState.AVAILABLE, FsState.FORMAT_NEEDED, 0, 1, 5)
        monkeypatch.setattr(w.drone.firmware.payload.storage.place, "states_report", lambda: [report])
        await lose_link(w, 1.0)
        await w.client.wait("STORAGE_INFORMATION", is_in(dialect.STORAGE_STATUS_UNFORMATTED), since=mark)
        await w.client.wait("STATUSTEXT", lambda m: m.text == "Storage 1: storage not formatted", since=mark)


async def test_conf_092_photo_without_card_goes_to_the_internal_storage() -> None:
    """The Ai writes to its internal storage without a card, unless its setting forbids that."""
    async with world(model="ai") as w:
        await enter(w.client, PHOTO)
        mark = w.client.mark()
        absent = v2.PhyState.UNDETECTED
        w.drone.inject(v2.State(1, absent, v2.FsState.UNKNOWN, 0, 1, 5, "", 0))
        await w.client.wait("STORAGE_INFORMATION", is_in(dialect.STORAGE_STATUS_EMPTY), since=mark)
        used = dialect.STORAGE_USAGE_FLAG_SET
        await w.client.wait("STORAGE_INFORMATION", lambda m: m.storage_id == 1 and m.storage_usage & used, since=mark)
        status = await request(w.client, "CAMERA_CAPTURE_STATUS")
        assert status.available_capacity == pytest.approx(8e9 / 2**20, rel=0.1)
        assert (await shoot(w.client)).capture_result == 1
        assert await command(w.client, FORMAT, 1, 1) == ACCEPTED
        assert (await request(w.client, "CAMERA_CAPTURE_STATUS")).image_count == 0
        assert (await write(w.client, "CAM_STORAGE", 1.0, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        assert await command(w.client, START_PHOTO, 0, 0, 1) == DENIED
        assert "Photo refused: no storage" in texts(w.client, mark)


def is_in(status: int) -> Callable[[Any], bool]:
    """Return a test for STORAGE_INFORMATION with this status."""
    return lambda message: bool(message.status == status)


@both
@models
async def test_conf_093_format_erases_and_resets_the_index(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model, web=True) as w:
        number = 2 if model == "ai" else 1
        await enter(w.client, PHOTO)
        await shoot(w.client)
        assert await command(w.client, FORMAT, number, 0) == DENIED
        assert await command(w.client, FORMAT, 3, 1) == DENIED
        if model == "ai":
            assert await command(w.client, FORMAT, math.nan, 1) == DENIED
        mark = w.client.mark()
        assert await command(w.client, FORMAT, number, 1) == ACCEPTED
        assert not photos(w)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_count == 0, since=mark)
        await w.client.wait("STORAGE_INFORMATION", lambda s: s.status == dialect.STORAGE_STATUS_READY, since=mark)
        assert (await shoot(w.client)).image_index == 0


async def test_conf_093_format_without_a_result_event_resets_the_index() -> None:
    """The state of the file system alone shows its end."""
    async with world(web=True) as w:
        await enter(w.client, PHOTO)
        await shoot(w.client)
        w.drone.inject(user_storage.Capabilities(1 << user_storage.Feature.FORMAT_WHEN_READY_ALLOWED))
        w.drone.faults.unreported = frozenset({user_storage.FormatResult.NAME})
        await w.client.wait("HEARTBEAT")
        mark = w.client.mark()
        assert await command(w.client, FORMAT, 1, 1) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_count == 0, since=mark)
        assert (await shoot(w.client)).image_index == 0


async def test_conf_093_format_after_which_the_drone_checks_its_card_resets_the_index() -> None:
    """Without a result event STORAGE_FORMAT is ACCEPTED then, too."""
    state = user_storage.State.NAME
    async with world(web=True) as w:
        await enter(w.client, PHOTO)
        await shoot(w.client)
        w.drone.inject(user_storage.Capabilities(1 << user_storage.Feature.FORMAT_WHEN_READY_ALLOWED))
        await w.client.wait("HEARTBEAT")
        w.drone.faults.unreported = frozenset({user_storage.FormatResult.NAME, state})
        mark, answer = w.client.mark(), asyncio.ensure_future(command(w.client, FORMAT, 1, 1))
        await w.drone.wait_log(lambda e: e.name == "user_storage.format_with_type")
        w.drone.faults.unreported = frozenset()
        for file_system in (FsState.FORMATTING, FsState.CHECKING, FsState.READY):
            w.drone.inject(user_storage.State(PhyState.AVAILABLE, file_system, 0, 1, 5))
        w.drone.faults.unreported = frozenset({user_storage.FormatResult.NAME, state})
        assert await answer == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_count == 0, since=mark)


async def test_conf_093_format_is_refused_in_flight_and_while_recording() -> None:
    async with world() as w:
        await enter(w.client, VIDEO)
        assert await command(w.client, START_VIDEO, 0, 0) == ACCEPTED
        assert await command(w.client, FORMAT, 1, 1) == REJECTED
        assert await command(w.client, STOP_VIDEO, 0) == ACCEPTED
        await w.take_off()
        assert await command(w.client, FORMAT, 1, 1) == REJECTED
        assert not w.commands("user_storage.format_with_type")


async def test_conf_129_format_goes_on_after_a_cancel() -> None:
    """The drone cannot end a format, so CANCELLED would be a lie."""
    async with world() as w:
        mark = w.client.mark()
        w.client.send_command(FORMAT, 1, 1, target=(1, CAMERA))
        await w.drone.wait_log(lambda e: e.name == "user_storage.format_with_type")
        w.client.send(dialect.MAVLink_command_cancel_message(1, CAMERA, FORMAT))
        ack = await w.client.wait(
            "COMMAND_ACK",
            lambda m: m.command == FORMAT and m.result != dialect.MAV_RESULT_IN_PROGRESS,
            since=mark,
            timeout=10.0,
        )
        assert ack.result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "user_storage.format_result")


@both
async def test_conf_011_camera_reset_format_and_home_report_no_early_progress(flavour: str) -> None:
    """MAVSDK returns with an IN_PROGRESS of these, and the end then aborts its whole program. It waits for 2 s."""
    async with world(flavour=flavour) as w:
        sent = (
            (dialect.MAV_CMD_DO_SET_HOME, (1,), 1),
            (dialect.MAV_CMD_RESET_CAMERA_SETTINGS, (1,), CAMERA),
            (FORMAT, (1, 1), CAMERA),
        )
        w.drone.faults.mute = True
        mark = w.client.mark()
        for _ in range(4):  # as MAVSDK repeats them
            for command_id, params, component in sent:
                w.client.send_command(command_id, *params, target=(1, component))
            await asyncio.sleep(0.5)
        acks = [(ack.command, ack.result) for _, ack in w.client.since(mark, "COMMAND_ACK")]
        assert dialect.MAV_RESULT_IN_PROGRESS not in dict(acks).values(), acks


@both
async def test_conf_096_change_by_the_pilot_is_pushed(flavour: str) -> None:
    async with world(flavour=flavour, clients=2) as w:
        await enter(w.client, VIDEO)
        marks = [client.mark() for client in w.clients]
        press(w, camera_messages.SetCameraMode(0, camera_messages.CameraCameraMode.PHOTO))
        for client, mark in zip(w.clients, marks, strict=True):
            assert (await client.wait("CAMERA_SETTINGS", since=mark)).mode_id == PHOTO
        marks = [client.mark() for client in w.clients]
        press(w, camera_messages.TakePhoto(0))
        for client, mark in zip(w.clients, marks, strict=True):
            assert (await client.wait("CAMERA_IMAGE_CAPTURED", since=mark)).capture_result == 1


async def zoomed(client: Client, kind: int, value: float) -> float:
    """Zoom; return the level that the camera reports once it stands."""
    assert await command(client, ZOOM, kind, value) == ACCEPTED
    return float((await request(client, "CAMERA_SETTINGS")).zoomLevel)


@both
@models
async def test_conf_097_zoom_by_range_step_and_rate(flavour: str, model: str) -> None:
    async with world(flavour=flavour, model=model) as w:
        client = w.client
        assert await zoomed(client, dialect.ZOOM_TYPE_RANGE, 50) == pytest.approx(50.0, abs=1.0)
        assert await zoomed(client, dialect.ZOOM_TYPE_STEP, 1) > 55.0
        assert await zoomed(client, dialect.ZOOM_TYPE_STEP, -1) == pytest.approx(50.0, abs=1.0)
        assert await zoomed(client, dialect.ZOOM_TYPE_STEP, -1) < 45.0
        assert await zoomed(client, dialect.ZOOM_TYPE_RANGE, 150) == pytest.approx(100.0, abs=1.0)
        mark = client.mark()
        assert await command(client, ZOOM, dialect.ZOOM_TYPE_CONTINUOUS, -1) == ACCEPTED
        await client.wait("CAMERA_SETTINGS", lambda s: s.zoomLevel < 90.0, since=mark)
        stood = await zoomed(client, dialect.ZOOM_TYPE_CONTINUOUS, 0)
        assert 0.0 <= stood < 95.0
        assert await command(client, ZOOM, dialect.ZOOM_TYPE_RANGE, math.nan) == DENIED
        assert await command(client, ZOOM, dialect.ZOOM_TYPE_FOCAL_LENGTH, 30) == UNSUPPORTED
        assert await command(client, dialect.MAV_CMD_SET_CAMERA_FOCUS, 0, 1) == UNSUPPORTED


@both
async def test_conf_128_component_information_of_the_camera(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        about = await request(w.client, "COMPONENT_INFORMATION_BASIC")
        assert about.vendor_name == "Parrot"
        assert about.capabilities & dialect.MAV_PROTOCOL_CAPABILITY_FTP


async def test_conf_136_field_of_view_on_request() -> None:
    async with world() as w:
        ground = await request(w.client, "CAMERA_FOV_STATUS")
        assert ground.lat_image == -(2**31)  # the camera looks level
        await w.take_off(10.0)
        await w.client.command(dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, -45, math.nan, x=0.0, z=0.0)
        await w.drone.wait_log(lambda e: e.kind == "pose" and abs(e.args["gimbal_pitch"] + 45.0) < 0.5, 10.0)
        await w.client.wait("GIMBAL_DEVICE_ATTITUDE_STATUS")
        seen = await request(w.client, "CAMERA_FOV_STATUS")
        assert 60.0 < seen.hfov < 80.0
        away = geo.distance(seen.lat_image / 1e7, seen.lon_image / 1e7, seen.lat_camera / 1e7, seen.lon_camera / 1e7)
        assert away == pytest.approx(10.0, abs=1.0)


@both
async def test_conf_138_history_by_index_and_range(flavour: str) -> None:
    async with world(flavour=flavour) as w:
        client = w.client
        await enter(client, PHOTO)
        for _ in range(3):
            await shoot(client)
        for params, indices in (
            ((1,), [1]),
            ((0, 1), [0, 1]),
            ((1, -1), [1, 2]),
            ((-1,), [0, 1, 2]),
            ((-1, 0), [0, 1, 2]),
        ):
            assert await again(client, dialect.MAV_CMD_REQUEST_MESSAGE, 263, *params) == indices
        assert await again(client, dialect.MAV_CMD_REQUEST_CAMERA_IMAGE_CAPTURE, 2) == [2]
        for missing in ((3,), (7, 9)):
            mark = client.mark()
            assert await command(client, dialect.MAV_CMD_REQUEST_MESSAGE, 263, *missing) == DENIED
            assert len(client.since(mark, "COMMAND_ACK")) == 1


async def again(client: Client, id: int, *params: float) -> list[int]:
    """The indices of the photos that a request sends."""
    mark = client.mark()
    assert await command(client, id, *params) == ACCEPTED
    return [image.image_index for _, image in client.since(mark, "CAMERA_IMAGE_CAPTURED")]


@both
async def test_conf_154_tracking_is_unsupported_and_not_announced(flavour: str) -> None:
    async with world(flavour=flavour, model="ai") as w:
        for id in (
            dialect.MAV_CMD_CAMERA_TRACK_POINT,
            dialect.MAV_CMD_CAMERA_TRACK_RECTANGLE,
            dialect.MAV_CMD_CAMERA_STOP_TRACKING,
        ):
            assert await command(w.client, id, 0.5, 0.5) == UNSUPPORTED
        flags = (await request(w.client, "CAMERA_INFORMATION")).flags
        assert not flags & (
            dialect.CAMERA_CAP_FLAGS_HAS_TRACKING_POINT
            | dialect.CAMERA_CAP_FLAGS_HAS_TRACKING_RECTANGLE
            | dialect.CAMERA_CAP_FLAGS_HAS_TRACKING_GEO_STATUS
        )


async def test_conf_120_camera_panel_of_the_autopilot() -> None:
    """Clients of ArduPilot's family address the camera at component 1, and know no modes."""
    async with world(flavour="ardupilot", also="px4") as w:
        client = w.client
        for id, params in (
            (START_PHOTO, (0, 0, 1)),
            (dialect.MAV_CMD_DO_DIGICAM_CONTROL, (0, 0, 0, 0)),
            (START_VIDEO, (0, 0)),
            (STOP_VIDEO, (0,)),
            (ZOOM, (dialect.ZOOM_TYPE_RANGE, 50)),
            (dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, (5,)),
            (STOP_PHOTO, (1,)),
            (dialect.MAV_CMD_DO_CONTROL_VIDEO, (1, 0, 0, 1)),
            (dialect.MAV_CMD_DO_CONTROL_VIDEO, (1, 0, 0, 0)),
        ):
            mark = client.mark()
            x = 1.0 if id == dialect.MAV_CMD_DO_DIGICAM_CONTROL else math.nan
            assert (await client.command(id, *params, x=x)).result == ACCEPTED, id
            if id in (START_PHOTO, dialect.MAV_CMD_DO_DIGICAM_CONTROL):
                await client.wait("CAMERA_IMAGE_CAPTURED", since=mark)
                await client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, since=mark)
        assert (len(videos(w)), [media.mode for media in photos(w)]) == (2, ["SINGLE", "SINGLE", "GPSLAPSE"])
        assert (await client.command(START_PHOTO, 2, 0, 1)).result == DENIED
        other = await w.connect(port=5761)
        assert (await other.command(START_PHOTO, 0, 0, 1)).result == UNSUPPORTED
        for id in (200, 203, 204, 205, 206):
            assert (await other.command(id, 2 if id == dialect.MAV_CMD_DO_MOUNT_CONFIGURE else 0)).result == ACCEPTED
