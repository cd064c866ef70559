"""The camera beside missions, restarts and other controllers, and its thermal half; judged by the simulator."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support import camera_commands
from support.cameras import ACCEPTED, PHOTO, VIDEO, command, enter, photos, press, request, shoot, texts, videos
from support.ext_params import CHOICE, fetch, write
from support.fault_scenarios import on_command, watched
from support.flavours import both
from support.mav import CAMERA, Client
from support.missions import ACTIVE, PAUSED, put, start, state, takeoff, way
from support.plans import Item
from support.sim_settings import sim_value
from support.world import HOME, WEB_PORT, World, loopback, world

from anafi_mav.arsdk.messages import camera as camera_messages
from anafi_mav.arsdk.messages import thermal as thermal_messages
from anafi_mav.arsdk.messages.thermal import RenderingMode, ThermalMode
from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.mavlink import dialect
from anafi_mav.sim import DroneSpec, Simulator

REJECTED, DENIED, UNSUPPORTED = (
    dialect.MAV_RESULT_TEMPORARILY_REJECTED,
    dialect.MAV_RESULT_DENIED,
    dialect.MAV_RESULT_UNSUPPORTED,
)
PANORAMA = dialect.MAV_CMD_PANORAMA_CREATE
SOURCE, RESET = dialect.MAV_CMD_SET_CAMERA_SOURCE, dialect.MAV_CMD_RESET_CAMERA_SETTINGS
THERMAL_RANGE = dialect.MAVLINK_MSG_ID_CAMERA_THERMAL_RANGE
NAN = math.nan


@both
async def test_mission_keeps_its_camera_while_items_need_it(flavour: str) -> None:
    """A series of the mission: only a photo is taken for a client, until the mission pauses."""
    photo = Item(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p1=0.0, p2=2.0, p3=0.0, p4=NAN, frame=2)
    end = Item(dialect.MAV_CMD_IMAGE_STOP_CAPTURE, 0.0, 0.0, p1=0.0, frame=2)
    async with world(flavour=flavour, web=True) as w:
        await put(w, [takeoff(6.0), photo, way(60.0, 0.0, 6.0), end, way(75.0, 0.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=mark, timeout=30.0)
        for id, params in (
            (dialect.MAV_CMD_IMAGE_STOP_CAPTURE, (0,)),
            (dialect.MAV_CMD_SET_CAMERA_MODE, (0, VIDEO)),
            (dialect.MAV_CMD_SET_CAMERA_ZOOM, (dialect.ZOOM_TYPE_RANGE, 50)),
            (RESET, (1,)),
        ):
            assert await command(w.client, id, *params) == REJECTED, id
        assert any("mission" in text for text in texts(w.client, mark))
        assert not w.commands("camera.stop_photo")
        mark = w.client.mark()
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)).result == ACCEPTED
        await state(w, PAUSED, since=mark)
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_ZOOM, dialect.ZOOM_TYPE_RANGE, 60) == ACCEPTED


async def test_panorama_of_a_mission_is_stopped_by_no_client() -> None:
    panorama = Item(PANORAMA, 0.0, 0.0, p1=360.0, p2=0.0, p3=10.0, p4=10.0, frame=2)
    async with world(web=True) as w:
        await put(w, [takeoff(6.0), panorama, way(20.0, 0.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 1, since=mark, timeout=30.0)
        assert await command(w.client, dialect.MAV_CMD_IMAGE_STOP_CAPTURE, 0) == REJECTED
        assert "Photo refused: mission uses camera" in texts(w.client, mark)
        assert w.drone.firmware.payload.cameras.busy


async def test_photo_during_a_mission_is_taken_and_its_items_go_on() -> None:
    photo = Item(dialect.MAV_CMD_IMAGE_START_CAPTURE, 0.0, 0.0, p1=0.0, p2=0.0, p3=1.0, p4=NAN, frame=2)
    async with world(web=True) as w:
        await enter(w.client, PHOTO)
        await put(w, [takeoff(6.0), way(20.0, 0.0, 6.0), photo, way(30.0, 0.0, 6.0)])
        mark = w.client.mark()
        await start(w)
        await state(w, ACTIVE, seq=1, since=mark)
        image = await shoot(w.client)
        await w.client.wait("CAMERA_IMAGE_CAPTURED", lambda m: m.image_index == image.image_index + 1, timeout=30.0)
        assert len(photos(w)) == 2


async def test_recording_of_the_pilot_is_shown_with_its_time() -> None:
    async with world() as w:
        mark = w.client.mark()
        press(w, camera_messages.SetCameraMode(0, camera_messages.CameraCameraMode.RECORDING))
        press(w, camera_messages.StartRecording(0))
        status = await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.video_status == 1, since=mark)
        assert status.recording_time_ms < 1000
        assert await command(w.client, dialect.MAV_CMD_VIDEO_STOP_CAPTURE, 0) == ACCEPTED
        assert len(videos(w)) == 1


async def test_index_and_recording_survive_a_restart_of_the_gateway(tmp_path: Path) -> None:
    drone, address = loopback(), loopback()
    spec = DroneSpec(address=drone, home=HOME, http_port=WEB_PORT)
    config = Config(
        endpoints=(f"tcpin://{address}:5760",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone, http_port=WEB_PORT),),
        state=str(tmp_path / "state"),
    )
    async with Simulator([spec], speed=1.0, seed=1) as simulator:
        async with Gateway(config) as gateway:
            w = World(simulator, gateway, address)
            await w.connect()
            assert await gateway.ready(10.0)
            await w.client.wait("GLOBAL_POSITION_INT", since=0)
            await enter(w.client, PHOTO)
            assert (await shoot(w.client)).image_index == 0
            await enter(w.client, VIDEO)
            assert await command(w.client, dialect.MAV_CMD_VIDEO_START_CAPTURE, 0, 0) == ACCEPTED
            status = await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.video_status == 1, since=0)
            began = simulator.drones[0].time
            await w.client.close()
        async with Gateway(config) as gateway:
            w = World(simulator, gateway, address)
            await w.connect()
            assert await gateway.ready(10.0)
            await w.client.wait("GLOBAL_POSITION_INT", since=0)
            status = await request(w.client, "CAMERA_CAPTURE_STATUS")
            assert (status.video_status, status.image_count) == (1, 1)
            assert status.recording_time_ms / 1e3 == pytest.approx(simulator.drones[0].time - began, abs=1.5)
            assert await command(w.client, dialect.MAV_CMD_VIDEO_STOP_CAPTURE, 0) == ACCEPTED
            await enter(w.client, PHOTO)
            assert (await shoot(w.client)).image_index == 1
            await w.client.close()
            await simulator.close()


@pytest.mark.parametrize("model", ["thermal", "usa"])
async def test_camera_source_chooses_the_shown_picture(model: str) -> None:
    async with world(model=model) as w:
        for params, mode, rendering in (
            ((0, dialect.CAMERA_SOURCE_IR, 0), ThermalMode.BLENDED, RenderingMode.THERMAL),
            ((0, dialect.CAMERA_SOURCE_RGB, dialect.CAMERA_SOURCE_IR), ThermalMode.BLENDED, RenderingMode.BLENDED),
            ((0, dialect.CAMERA_SOURCE_RGB, 0), ThermalMode.DISABLED, None),
        ):
            assert await command(w.client, SOURCE, *params) == ACCEPTED
            thermal = w.drone.firmware.payload.thermal
            assert thermal.mode is mode
            if rendering is not None:
                assert w.commands("thermal.set_rendering")[-1].args["mode"] == rendering
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_NDVI, 0) == DENIED
        await enter(w.client, VIDEO)
        assert await command(w.client, dialect.MAV_CMD_VIDEO_START_CAPTURE, 0, 0) == ACCEPTED
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == REJECTED
        assert await command(w.client, dialect.MAV_CMD_VIDEO_STOP_CAPTURE, 0) == ACCEPTED
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 1) == ACCEPTED
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_MODE, 0, PHOTO) == REJECTED


async def test_camera_source_is_not_refused_by_a_report_of_before_the_change() -> None:
    async with world(model="thermal", speed=1.0) as w:
        mark = w.client.mark()
        before = thermal_messages.Mode(ThermalMode.DISABLED)
        reported = on_command(w, "thermal.set_mode", lambda: w.drone.inject(before))
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == ACCEPTED
        await reported
        assert texts(w.client, mark) == []


async def test_command_after_a_change_of_the_source_is_for_the_shown_camera() -> None:
    """Which camera works is reported later than the thermal mode."""
    async with world(model="thermal", speed=1.0) as w:
        await enter(w.client, PHOTO)
        w.drone.faults.late = {camera_messages.CameraStates.NAME: 0.8}
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == ACCEPTED
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_MODE, 0, PHOTO) == REJECTED
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_RGB, 0) == ACCEPTED
        await enter(w.client, VIDEO)
        assert sim_value(w.drone, "CAM_MODE") == VIDEO


async def test_zoom_is_refused_while_the_thermal_picture_is_shown() -> None:
    async with world(model="thermal") as w:
        zoom = dialect.MAV_CMD_SET_CAMERA_ZOOM, dialect.ZOOM_TYPE_RANGE, 50.0
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == ACCEPTED
        mark = w.client.mark()
        assert await command(w.client, *zoom) == REJECTED
        assert texts(w.client, mark) == ["Zoom refused: shown camera has no zoom"]
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_RGB, 0) == ACCEPTED
        assert await command(w.client, *zoom) == ACCEPTED


async def test_series_that_a_thermal_mode_ends_restores_its_settings() -> None:
    """Its end may be reported when the thermal camera is the active one already."""
    async with world(model="thermal", speed=1.0) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 2, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0)
        w.drone.faults.late = dict.fromkeys((camera_messages.PhotoProgress.NAME, camera_messages.PhotoState.NAME), 0.5)
        press(w, thermal_messages.SetMode(ThermalMode.BLENDED))
        await w.drone.wait_log(lambda e: e.name == camera_messages.SetPhotoMode.NAME and e.args["mode"] == 0, 5.0)
        restored = [entry.args for entry in w.commands(camera_messages.SetPhotoMode.NAME)][-1]
        assert (restored["cam_id"], restored["mode"]) == (0, camera_messages.CameraPhotoMode.SINGLE)


async def test_series_that_a_thermal_mode_ends_without_a_link_restores_its_settings() -> None:
    async with world(model="thermal", speed=1.0) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 2, 0) == ACCEPTED
        w.drone.faults.mute = True
        await watched(6.0)
        press(w, thermal_messages.SetMode(ThermalMode.BLENDED))
        await watched(1.0)
        w.drone.faults.mute = False
        await w.drone.wait_log(lambda e: e.name == camera_messages.SetPhotoMode.NAME and e.args["mode"] == 0, 20.0)
        assert w.commands(camera_messages.SetPhotoMode.NAME)[-1].args["cam_id"] == 0


async def test_photo_of_another_camera_ends_a_series_whose_end_was_not_reported() -> None:
    """It is reported as any other, and the settings of before the series are those of its own camera."""
    unreported = frozenset((camera_messages.PhotoProgress.NAME, camera_messages.PhotoState.NAME))
    results = camera_messages.PhotoResult
    async with world(model="thermal", speed=1.0) as w:
        await enter(w.client, PHOTO)
        assert await command(w.client, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 2, 0) == ACCEPTED
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=0)
        w.drone.faults.unreported = unreported
        press(w, thermal_messages.SetMode(ThermalMode.BLENDED))
        await watched(1.0)
        w.drone.faults.unreported = frozenset()
        blended, mark = min(w.gateway.systems[0].drone.camera.state.active), w.client.mark()
        for result, count, media in ((results.TAKING_PHOTO, 0, ""), (results.PHOTO_TAKEN, 1, "")):
            w.drone.inject(camera_messages.PhotoProgress(blended, result, count, media))
        await w.drone.wait_log(lambda e: e.name == camera_messages.SetPhotoMode.NAME and e.args["mode"] == 0, 5.0)
        assert w.commands(camera_messages.SetPhotoMode.NAME)[-1].args["cam_id"] == 0
        w.drone.inject(camera_messages.PhotoProgress(blended, results.PHOTO_SAVED, 1, "9"))
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=mark)


async def test_camera_source_of_a_model_without_thermal_camera_is_unsupported() -> None:
    async with world() as w:
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == UNSUPPORTED


async def test_thermal_range_of_a_model_without_thermal_camera_is_unsupported() -> None:
    async with world() as w:
        for id in (dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_SET_MESSAGE_INTERVAL):
            assert await command(w.client, id, THERMAL_RANGE, 1e6) == UNSUPPORTED, id
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_GET_MESSAGE_INTERVAL, THERMAL_RANGE) == ACCEPTED
        assert (await w.client.wait("MESSAGE_INTERVAL", since=mark)).interval_us == 0


async def test_thermal_range_is_that_of_an_absolute_palette() -> None:
    async with world(model="thermal") as w:
        assert await command(w.client, dialect.MAV_CMD_REQUEST_MESSAGE, THERMAL_RANGE) == REJECTED
        assert await command(w.client, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, THERMAL_RANGE, 1e6) == ACCEPTED
        assert await command(w.client, SOURCE, 0, dialect.CAMERA_SOURCE_IR, 0) == ACCEPTED
        for name, value, kind in (("CAM_THM_PALETTE", 0.0, CHOICE), ("CAM_THM_LOW", 5.0, 9), ("CAM_THM_HIGH", 60.0, 9)):
            assert (await write(w.client, name, value, kind)).param_result == dialect.PARAM_ACK_ACCEPTED, name
        shown = await request(w.client, "CAMERA_THERMAL_RANGE")
        assert (shown.stream_id, shown.min, shown.max) == (2, pytest.approx(5.0, abs=0.1), pytest.approx(60.0, abs=0.1))


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_reset_restores_the_settings_of_the_factory(model: str) -> None:
    async with world(model=model) as w:
        await enter(w.client, PHOTO)
        for name, value in (("CAM_PHOTOMODE", 2.0), ("CAM_WBMODE", 2.0)):
            assert (await write(w.client, name, value, CHOICE)).param_result == dialect.PARAM_ACK_ACCEPTED
        assert await command(w.client, dialect.MAV_CMD_SET_CAMERA_ZOOM, dialect.ZOOM_TYPE_RANGE, 50) == ACCEPTED
        assert await command(w.client, RESET, 0) == DENIED
        assert await command(w.client, RESET, 1) == ACCEPTED
        assert [sim_value(w.drone, name) for name in ("CAM_PHOTOMODE", "CAM_WBMODE", "CAM_MODE")] == [0.0, 0.0, 0.0]
        assert (await request(w.client, "CAMERA_SETTINGS")).zoomLevel == pytest.approx(0.0, abs=1.0)


async def test_reset_is_refused_if_the_drone_keeps_a_value() -> None:
    async with world() as w:
        camera = w.drone.firmware.payload.cameras[0]
        flat = camera_messages.CameraStyle.PLOG
        camera.lens = replace(camera.lens, styles=(flat,))
        press(w, camera_messages.SetStyle(0, flat))
        mark = w.client.mark()
        assert await command(w.client, RESET, 1) == REJECTED
        assert "Camera reset refused: drone keeps its value" in texts(w.client, mark)
        assert w.commands("camera.set_style")


async def test_stop_overtakes_no_start_of_another_client() -> None:
    """Both are sent in one segment: the recording has begun and has ended when both are answered."""
    async with world() as w:
        await enter(w.client, VIDEO)
        mark = w.client.mark()
        w.client.send_command(dialect.MAV_CMD_VIDEO_START_CAPTURE, 0, 0, target=(1, CAMERA))
        assert await command(w.client, dialect.MAV_CMD_VIDEO_STOP_CAPTURE, 0) == ACCEPTED
        acks = [(ack.command, ack.result) for _, ack in w.client.since(mark, "COMMAND_ACK")]
        assert acks == [
            (dialect.MAV_CMD_VIDEO_START_CAPTURE, ACCEPTED),
            (dialect.MAV_CMD_VIDEO_STOP_CAPTURE, ACCEPTED),
        ]
        assert len(videos(w)) == 1
        assert not w.drone.firmware.payload.cameras.busy


async def test_panorama_turns_the_hovering_drone_and_hold_ends_it() -> None:
    async with world(web=True) as w:
        assert await command(w.client, PANORAMA, 360, 180) == REJECTED  # on the ground
        await w.take_off(10.0)
        mark = w.client.mark()
        assert await command(w.client, PANORAMA, 180, 0) == ACCEPTED
        assert w.commands("animation.start_horizontal_180_photo_panorama")
        await w.client.wait("CAMERA_IMAGE_CAPTURED", since=mark, timeout=60.0)
        (panorama,) = photos(w)
        assert panorama.mode == "PANORAMA"
        images = [image for _, image in w.client.since(mark, "CAMERA_IMAGE_CAPTURED")]
        assert len(images) == len(panorama.resources)

        mark = w.client.mark()
        assert await command(w.client, PANORAMA, 360, 180) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 1, since=mark)
        assert (await w.client.command(dialect.MAV_CMD_DO_PAUSE_CONTINUE, 0)).result == ACCEPTED
        await w.drone.wait_log(lambda e: e.name == "animation.cancel")
        for angle in range(180, 190):  # the drone offers no panorama until it has stopped
            await w.client.wait("HEARTBEAT")
            if (result := await command(w.client, PANORAMA, angle, 0)) == ACCEPTED:
                break
        assert result == ACCEPTED
        mark = w.client.mark()
        ack = await w.client.command(dialect.MAV_CMD_DO_REPOSITION, -1, 1, x=HOME[0] + 2e-4, y=HOME[1], z=10.0, frame=6)
        assert ack.result == ACCEPTED, texts(w.client, mark)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 15.0, 30.0)


@pytest.mark.parametrize(
    ("amount", "reason"), [(math.inf, "value is not a number"), (-1.0, "value is negative")], ids=["inf", "-1"]
)
async def test_impossible_interval_or_distance_of_photos_is_named(amount: float, reason: str) -> None:
    async with world() as w:
        for id, component, params in (
            (dialect.MAV_CMD_IMAGE_START_CAPTURE, CAMERA, (0, amount, 2)),
            (dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, 1, (amount,)),
        ):
            mark = w.client.mark()
            ack = await w.client.command(id, *params, target=(1, component))
            assert ack.result == dialect.MAV_RESULT_DENIED
            assert f"Photo refused: {reason}" in texts(w.client, mark)


async def test_stop_of_photos_ends_a_panorama() -> None:
    async with world(web=True, model="ai") as w:
        await w.take_off(10.0)
        mark = w.client.mark()
        assert await command(w.client, PANORAMA, 360, 180) == ACCEPTED
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 1, since=mark)
        mark = w.client.mark()
        assert await command(w.client, dialect.MAV_CMD_IMAGE_STOP_CAPTURE) == ACCEPTED
        assert not w.drone.firmware.payload.cameras.busy
        await w.client.wait("CAMERA_CAPTURE_STATUS", lambda s: s.image_status == 0, since=mark)


async def test_stop_of_photos_ends_a_panorama_that_waits_for_photo_mode() -> None:
    """It found no panorama, was accepted, and the panorama began."""
    async with world(web=True, clients=2) as w:
        first, second = w.clients
        await w.take_off(10.0)
        await enter(first, VIDEO)
        w.drone.faults.late = {camera_messages.CameraMode.NAME: 0.8}
        mark, changes = first.mark(), len(w.commands(camera_messages.SetCameraMode.NAME))
        first.send_command(PANORAMA, 180, 0, target=(1, CAMERA))
        await w.drone.wait_log(lambda e: len(w.commands(camera_messages.SetCameraMode.NAME)) > changes)
        assert await command(second, dialect.MAV_CMD_IMAGE_STOP_CAPTURE) == ACCEPTED
        await first.wait("COMMAND_ACK", lambda ack: ack.command == PANORAMA and ack.result != 5, since=mark)
        started = len([entry for entry in w.drone.log if entry.name.startswith("animation.start")])
        assert len(w.commands("animation.cancel")) == started


async def test_panorama_overtakes_no_newer_flight_command() -> None:
    """Both are sent at once while the camera has to change its mode first."""
    async with world(web=True, clients=2) as w:
        other = w.clients[1]
        await w.take_off(10.0)
        for id, params, others in (
            (dialect.MAV_CMD_DO_SET_MODE, (1, 4, 3), {}),
            (dialect.MAV_CMD_DO_REPOSITION, (-1, 1), {"x": HOME[0] + 2e-4, "y": HOME[1], "z": 10.0, "frame": 6}),
            (dialect.MAV_CMD_NAV_LAND, (), {}),
        ):
            await enter(w.client, VIDEO)
            mark = w.client.mark()
            w.client.send_command(PANORAMA, 180, 0, target=(1, CAMERA))
            assert (await other.command(id, *params, **others)).result == ACCEPTED
            ack = await w.client.wait("COMMAND_ACK", lambda a: a.command == PANORAMA and a.result != 5, since=mark)
            assert ack.result == dialect.MAV_RESULT_CANCELLED
            if id == dialect.MAV_CMD_DO_REPOSITION:
                await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 15.0, 30.0)
        await w.drone.wait_log(lambda e: e.name.endswith("FlyingStateChanged") and "LANDED" in str(e.args), 30.0)
        assert not [entry for entry in w.drone.log if entry.name.startswith("animation.start")]


@both
@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
async def test_conf_009_payload_commands_are_those_of_the_page(flavour: str, model: str) -> None:
    """Each command of camera, gimbal, storage and video to both components: docs/camera.md is true."""
    table = camera_commands.make_system()
    autopilot, camera = table.components
    async with world(flavour=flavour, model=model) as w:
        for component, other in ((autopilot, camera), (camera, autopilot)):
            for id, name in camera_commands.commands():
                offered = [one.name for one in camera_commands.flavours(component, other, id)]
                is_done = flavour in offered
                if name in camera_commands.THERMAL_ONLY and model not in camera_commands.THERMAL_MODELS:
                    is_done = False
                ack = await w.client.command(id, NAN, NAN, NAN, NAN, target=(1, component.compid), timeout=20.0)
                assert (ack.result != UNSUPPORTED, ack.get_srcComponent()) == (is_done, component.compid), name


async def test_geotag_is_that_of_the_picture_while_the_video_runs() -> None:
    async with world(web=True, speed=1.0, video_latency=0.1) as w:
        await w.take_off(8.0)
        await enter(w.client, PHOTO)
        mark = w.client.mark()
        exposure = dialect.MAVLINK_MSG_ID_ANAFI_CAMERA_EXPOSURE
        assert (await w.client.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, exposure, 1e6)).result == ACCEPTED
        await w.client.wait("ANAFI_CAMERA_EXPOSURE", since=mark, timeout=10.0)
        turned = dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW  # held to the body, which pitches as it accelerates
        assert (await w.client.command(turned, -40, NAN, x=0.0, z=0.0)).result == ACCEPTED
        w.client.send_command(dialect.MAV_CMD_DO_REPOSITION, 6, 1, x=HOME[0] + 3e-4, y=HOME[1], z=12.0, frame=6)
        await w.drone.wait_log(lambda e: e.kind == "pose" and e.args["north"] > 6.0, 20.0)
        image = await shoot(w.client)
        scene = photos(w)[0].resources[0].scene
        w0, x, y, z = image.q
        pitch = math.degrees(math.asin(2 * (w0 * y - z * x)))
        assert pitch == pytest.approx(scene.pitch, abs=1.0)
        assert abs(scene.pitch + 40.0) > 5.0
        assert image.alt / 1e3 == pytest.approx(scene.altitude, abs=0.4)


# QGroundControl 5 (VehicleCameraControl.cc): what it sends, in its order, with its unset parameters of 0.


async def station_command(client: Client, id: int, *params: float) -> int:
    """A COMMAND_LONG of QGroundControl to the camera: seven parameters, 0 where it sets none."""
    seven = [*params, *[0.0] * (7 - len(params))]
    return await command(client, id, *seven[:4], x=seven[4], y=seven[5], z=seven[6])


async def station_request(client: Client, kind: str, number: float = 0.0) -> Any:
    """A message of the camera, as QGroundControl requests it."""
    mark = client.mark()
    id = getattr(dialect, f"MAVLINK_MSG_ID_{kind}")
    assert await station_command(client, dialect.MAV_CMD_REQUEST_MESSAGE, id, number) == ACCEPTED
    message = await client.wait(kind, since=mark)
    assert message.get_srcComponent() == CAMERA
    return message


@both
@pytest.mark.parametrize("model", ["4k", "thermal", "usa", "ai"])
async def test_requests_of_qgroundcontrol_work_the_camera(flavour: str, model: str) -> None:
    async with world(model=model, flavour=flavour, web=True) as w:
        station = w.client
        await station.wait("CAMERA_HEARTBEAT", since=0)
        information = await station_request(station, "CAMERA_INFORMATION")
        flags = information.flags
        assert flags & dialect.CAMERA_CAP_FLAGS_HAS_MODES
        assert flags & dialect.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
        assert information.cam_definition_version
        assert information.cam_definition_uri.startswith("mftp://")
        settings = await fetch(station)
        assert "CAM_MODE" in settings  # with such a parameter the station sends no MAV_CMD_SET_CAMERA_MODE
        await station_request(station, "CAMERA_SETTINGS")
        first = await station_request(station, "VIDEO_STREAM_INFORMATION")
        assert first.stream_id == 1
        for number in range(1, first.count + 1):
            mark = station.mark()
            await station_request(station, "VIDEO_STREAM_INFORMATION", number)
            assert station.since(mark, "VIDEO_STREAM_INFORMATION")[0][1].stream_id == number
            assert (await station_request(station, "VIDEO_STREAM_STATUS", number)).stream_id == number
        number = 2 if model == "ai" else 1  # the card
        storage = await station_request(station, "STORAGE_INFORMATION", number)
        assert storage.status == dialect.STORAGE_STATUS_READY
        status = await station_request(station, "CAMERA_CAPTURE_STATUS")
        assert (status.image_status, status.video_status) == (0, 0)

        # The photo button, then the video button, each after its mode.
        kind = settings["CAM_MODE"].param_type
        assert (await write(station, "CAM_MODE", PHOTO, kind)).param_result == dialect.PARAM_ACK_ACCEPTED
        mark = station.mark()
        assert await station_command(station, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 0, 1) == ACCEPTED
        shot = await station.wait("CAMERA_IMAGE_CAPTURED", since=mark)
        assert (shot.capture_result, len(photos(w))) == (1, 1)
        assert await station_command(station, dialect.MAV_CMD_IMAGE_START_CAPTURE, 0, 1, 0) == ACCEPTED  # a series
        await station.wait("CAMERA_CAPTURE_STATUS", lambda m: m.image_status >= 2, since=mark)
        assert await station_command(station, dialect.MAV_CMD_IMAGE_STOP_CAPTURE) == ACCEPTED
        assert (await write(station, "CAM_MODE", VIDEO, kind)).param_result == dialect.PARAM_ACK_ACCEPTED
        mark = station.mark()
        assert await station_command(station, dialect.MAV_CMD_VIDEO_START_CAPTURE) == ACCEPTED
        await station.wait("CAMERA_CAPTURE_STATUS", lambda m: m.video_status == 1, since=mark)
        assert await station_command(station, dialect.MAV_CMD_VIDEO_STOP_CAPTURE) == ACCEPTED
        await station.wait("CAMERA_CAPTURE_STATUS", lambda m: m.video_status == 0, since=mark)
        assert len(videos(w)) == 1

        # Zoom: slider, step, pressed and released; then reset and format.
        for kind, level in (
            (dialect.ZOOM_TYPE_RANGE, 30.0),
            (dialect.ZOOM_TYPE_STEP, 1.0),
            (dialect.ZOOM_TYPE_CONTINUOUS, 1.0),
            (dialect.ZOOM_TYPE_CONTINUOUS, 0.0),
        ):
            assert await station_command(station, dialect.MAV_CMD_SET_CAMERA_ZOOM, kind, level) == ACCEPTED
        assert await station_command(station, dialect.MAV_CMD_RESET_CAMERA_SETTINGS, 1) == ACCEPTED
        assert await station_command(station, dialect.MAV_CMD_STORAGE_FORMAT, number, 1) == ACCEPTED
        storage = await station_request(station, "STORAGE_INFORMATION", number)
        assert storage.status == dialect.STORAGE_STATUS_READY
        assert not photos(w) + videos(w)
