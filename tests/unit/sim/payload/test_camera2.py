"""The Ai's camera in its own language: lists, settings, photos, recordings, zoom, and orders of its flight plans."""

from __future__ import annotations

import math
from typing import Any

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import Message, decode, encode
from anafi_mav.arsdk.messages import ardrone3, camera, user_storage_v2
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.sim.world.motion import STEP

PHOTO, RECORDING = camera2.CameraMode.PHOTO, camera2.CameraMode.RECORDING


@pytest.fixture
def bench() -> Bench:
    return Bench("ai")


def configure(bench: Bench, **fields: Any) -> camera2.Config:
    """Set something; what is set then."""
    answer = bench.send(camera2.Configure(camera_id=0, config=camera2.Config(**fields)))
    states = [message for message in answer if isinstance(message, camera2.State) and message.config is not None]
    assert states[-1].config is not None
    return states[-1].config


def photos(bench: Bench) -> list[tuple[str, str, str]]:
    return [(m.type.name, m.media_id, m.stop_reason.name) for m in bench.of(camera2.Photo)]


def test_there_is_one_camera(bench: Bench) -> None:
    main, blended = camera2.CameraModel.MAIN, camera2.CameraModel.THERMAL_BLENDED
    assert bench.send(camera2.ListCameras()) == [camera2.CameraList(cameras={0: main})]
    assert bench.send(camera2.ListCameras(model_filter=(main,))) == [camera2.CameraList(cameras={0: main})]
    assert bench.send(camera2.ListCameras(model_filter=(blended,))) == [camera2.CameraList(cameras={})]
    assert bench.send(camera2.GetState(camera_id=1)) == []
    assert Bench("4k").send(camera2.ListCameras()) == []


def test_its_state_survives_the_wire(bench: Bench) -> None:
    (state,) = bench.send(camera2.GetState(camera_id=0, include_default_capabilities=True))
    assert isinstance(state, camera2.State)
    assert decode(encode(state)) == state
    assert (state.camera_id, state.active) == (0, True)
    assert state.default_capabilities is not None
    assert state.default_capabilities == state.current_capabilities
    photo, burst, recording = state.default_capabilities.rules
    assert (photo.camera_modes, recording.camera_modes) == ((PHOTO,), (RECORDING,))
    assert (photo.video_recording_codecs, recording.photo_modes) == (None, None)
    assert photo.photo_modes == tuple(mode for mode in camera2.PhotoMode if mode.name != "BURST")
    assert (burst.photo_modes, burst.photo_file_formats) == (
        (camera2.PhotoMode.BURST,),
        (camera2.PhotoFileFormat.JPEG,),
    )
    assert recording.video_recording_codecs == (camera2.VideoCodec.H264, camera2.VideoCodec.H265)
    # 50 to 6400, in both modes.
    for rule in (photo, recording):
        isos = rule.exposure_manual_iso_sensitivities
        assert isos is not None
        assert (isos[0], isos[-1]) == (camera2.IsoSensitivity._50, camera2.IsoSensitivity._6400)
    assert photo.photo_time_lapse_interval_range == camera2.DoubleRange(min=1.0, max=3600.0)
    assert state.config is not None
    assert None not in [getattr(state.config, name) for name in ("camera_mode", "ev_compensation", "zoom_max_speed")]
    assert state.zoom is not None
    assert state.zoom.zoom_level_max == 6.0


def test_settings(bench: Bench) -> None:
    before = configure(bench)
    after = configure(
        bench,
        camera_mode=PHOTO,
        ev_compensation=camera2.EvCompensation._1_00,
        image_style=camera2.ImageStyle.PLOG,
        exposure_mode=camera2.ExposureMode.MANUAL,
        exposure_manual_shutter_speed=camera2.ShutterSpeed._1_OVER_500,
        zoom_max_speed=99.0,
        photo_time_lapse_interval=0.1,
    )
    assert (after.camera_mode, after.ev_compensation) == (PHOTO, camera2.EvCompensation._1_00)
    assert after.exposure_manual_shutter_speed is camera2.ShutterSpeed._1_OVER_500
    assert (after.zoom_max_speed, after.photo_time_lapse_interval) == (10.0, 1.0)
    assert after.white_balance_mode is before.white_balance_mode
    kept = configure(
        bench,
        image_style=camera2.ImageStyle.PHOTOGRAMMETRY,
        exposure_manual_shutter_speed=camera2.ShutterSpeed._1,
        ev_compensation=camera2.EvCompensation(44),
        image_contrast=math.nan,
    )
    assert kept == after
    (empty,) = bench.send(camera2.Configure(camera_id=0))
    assert isinstance(empty, camera2.State)
    assert empty.config == after


def test_a_burst_is_jpeg(bench: Bench) -> None:
    raw = camera2.PhotoFileFormat.DNG_JPEG
    single = configure(bench, photo_file_format=raw)
    assert single.photo_file_format is raw
    burst = configure(bench, photo_mode=camera2.PhotoMode.BURST, photo_file_format=raw)
    assert burst.photo_file_format is camera2.PhotoFileFormat.JPEG


def test_a_photo(bench: Bench) -> None:
    configure(bench, camera_mode=PHOTO)
    bench.send(camera2.StartPhoto(camera_id=0))
    bench.run(1.0)
    assert photos(bench) == [
        ("START", "", "USER_REQUEST"),
        ("TAKING_PHOTO", "", "USER_REQUEST"),
        ("STOP", "10000001", "CAPTURE_DONE"),
    ]
    states = [m.photo.state.name for m in bench.of(camera2.State) if m.photo is not None]
    assert states[-2:] == ["ACTIVE", "INACTIVE"]
    assert [media.id for media in bench.firmware.payload.media] == ["10000001"]


def test_a_lapse_ends_when_it_is_stopped(bench: Bench) -> None:
    mode = camera2.PhotoMode.TIME_LAPSE
    configure(bench, camera_mode=PHOTO, photo_mode=mode, photo_time_lapse_interval=1.0)
    bench.send(camera2.StartPhoto(camera_id=0))
    bench.run(3.0)
    assert configure(bench, camera_mode=RECORDING).camera_mode is PHOTO
    bench.send(camera2.StopPhoto(camera_id=0))
    assert photos(bench)[-1] == ("STOP", "10000001", "USER_REQUEST")
    assert bench.of(camera2.NextPhotoInterval)[0].mode is mode
    (media,) = bench.firmware.payload.media
    assert len(media.resources) == 3


def test_photo_that_cannot_be_taken_is_answered_with_the_reason(bench: Bench) -> None:
    bench.send(camera2.StartPhoto(camera_id=0))
    assert photos(bench) == [("STOP", "", "ALREADY")]
    configure(bench, camera_mode=PHOTO)
    bench.faults.storage_full = True
    bench.run(0.1)
    bench.send(camera2.StartPhoto(camera_id=0))
    assert photos(bench)[-1] == ("STOP", "", "INSUFFICIENT_STORAGE_SPACE")


def test_a_recording(bench: Bench) -> None:
    bench.run(2 * STEP)  # between two looks at the clock
    bench.send(camera2.StartRecording(camera_id=0))
    assert [m.recording.duration for m in bench.of(camera2.State) if m.recording is not None][-1] == 0
    bench.run(2.0)
    (state,) = bench.send(camera2.GetState(camera_id=0))
    assert isinstance(state, camera2.State)
    assert state.recording is not None
    assert state.recording.duration == pytest.approx(2000, abs=60)
    bench.send(camera2.StopRecording(camera_id=0))
    observed = [(m.type.name, m.media_id, m.stop_reason.name) for m in bench.of(camera2.Recording)]
    assert observed == [("START", "", "USER_REQUEST"), ("STOP", "10000001", "USER_REQUEST")]
    bench.send(camera2.StartRecording(camera_id=0))
    bench.run(1.0)
    configure(bench, camera_mode=PHOTO)
    assert bench.of(camera2.Recording)[-1].stop_reason is camera2.RecordingStopReason.CONFIGURATION_CHANGE


def test_camera2_autorecord_starts_a_recording(bench: Bench) -> None:
    configure(bench, auto_record_mode=camera2.AutoRecordMode.FLIGHT)
    bench.take_off()
    assert bench.of(camera2.Recording)[-1].type is camera2.RecordingEvent.START
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bench.of(camera2.Recording)[-1].type is camera2.RecordingEvent.STOP)


def test_zoom(bench: Bench) -> None:
    def level(**fields: Any) -> camera2.ZoomLevel:
        (answer,) = bench.send(camera2.SetZoomTarget(camera_id=0, **fields))
        assert isinstance(answer, camera2.ZoomLevel)
        return answer

    assert level(control_mode=camera2.ZoomControlMode.LEVEL, target=9.0).level == 6.0
    # Half of 68 degrees has a tangent of 0.6745; a third of it belongs to 2 * 12.67 degrees.
    answer = level(control_mode=camera2.ZoomControlMode.LEVEL, target=3.0)
    assert answer.hfov == pytest.approx(25.34, abs=0.01)
    assert level(control_mode=camera2.ZoomControlMode.HFOV, target=25.34).level == pytest.approx(3.0, abs=0.01)
    assert bench.send(camera2.SetZoomTarget(camera_id=0, control_mode=camera2.ZoomControlMode.HFOV, target=0.0)) == []
    (reset,) = bench.send(camera2.ResetZoom(camera_id=0))
    assert isinstance(reset, camera2.ZoomLevel)
    assert reset.level == 1.0
    assert reset.hfov == pytest.approx(68.0)
    level(control_mode=camera2.ZoomControlMode.VELOCITY, target=1.0)
    bench.run(3.0)
    # Up to where 8000 pixels are 3840.
    assert bench.firmware.payload.telemetry()[0].level == pytest.approx(8000 / 3840)  # type: ignore[attr-defined]


def test_locks_and_metadata(bench: Bench) -> None:
    def state(message: Message) -> camera2.State:
        (answer,) = bench.send(message)
        assert isinstance(answer, camera2.State)
        return answer

    mode = camera2.ExposureLockMode.FULL_LOCK
    lock = state(camera2.LockExposure(camera_id=0, mode=mode)).exposure_lock
    assert lock is not None
    assert lock.mode is mode
    white = state(camera2.LockWhiteBalance(camera_id=0, mode=camera2.WhiteBalanceLockMode.LOCKED)).white_balance_lock
    assert white is not None
    assert white.mode is camera2.WhiteBalanceLockMode.LOCKED
    state(camera2.SetMediaMetadata(camera_id=0, metadata=camera2.MediaMetadata(copyright="me")))
    observed = state(camera2.SetMediaMetadata(camera_id=0, metadata=camera2.MediaMetadata(custom_id="7")))
    assert observed.media_metadata == camera2.MediaMetadata(copyright="me", custom_id="7", custom_title="")


def test_a_flight_plan_speaks_the_older_words(bench: Bench) -> None:
    payload, time = bench.firmware.payload, bench.firmware.time
    payload.operate(camera.SetCameraMode(0, camera.CameraCameraMode.PHOTO), time)
    lapse = camera.SetPhotoMode(
        0,
        camera.CameraPhotoMode.TIME_LAPSE,
        camera.PhotoFormat.RECTILINEAR,
        camera.PhotoFileFormat.JPEG,
        camera.BurstValue.BURST_14_OVER_1S,
        camera.BracketingPreset.PRESET_1EV,
        1.0,
    )
    payload.operate(lapse, time)
    payload.operate(camera.TakePhoto(0), time)
    bench.run(2.5)
    payload.operate(camera.StopPhoto(0), bench.firmware.time)
    payload.operate(camera.SetCameraMode(0, camera.CameraCameraMode.RECORDING), bench.firmware.time)
    payload.operate(camera.StartRecording(0), bench.firmware.time)
    bench.run(1.0)
    payload.operate(camera.StopRecording(0), bench.firmware.time)
    assert [(media.video, len(media.resources)) for media in payload.media] == [(False, 3), (True, 1)]


def test_formatting_takes_the_camera_away(bench: Bench) -> None:
    bench.send(user_storage_v2.Format(1, ""))
    bench.run_until(lambda: bool(bench.of(user_storage_v2.FormatResult)))
    states = [m.recording.state.name for m in bench.of(camera2.State) if m.recording is not None]
    assert states == ["UNAVAILABLE", "INACTIVE"]
