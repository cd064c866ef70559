"""The simulated cameras: every setting's answer, photos in all their modes, recordings, in Parrot's order of events."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from support.sim_bench import Bench

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import ardrone3, camera, common, mediastore, thermal, user_storage
from anafi_mav.arsdk.messages.camera import (
    AutoExposureMeteringMode,
    Availability,
    BracketingPreset,
    BurstValue,
    CameraAntiflickerMode,
    CameraCameraMode,
    CameraEvCompensation,
    CameraPhotoMode,
    CameraRecordingMode,
    CameraStreamingMode,
    CameraStyle,
    ExposureMode,
    Framerate,
    HyperlapseValue,
    IsoSensitivity,
    PhotoFileFormat,
    PhotoFormat,
    PhotoResult,
    RecordingResult,
    Resolution,
    ShutterSpeed,
    State,
    WhiteBalanceMode,
    WhiteBalanceTemperature,
    ZoomControlMode,
)
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.sim.payload.cameras import Cameras

PHOTO, RECORDING = CameraCameraMode.PHOTO, CameraCameraMode.RECORDING


@pytest.fixture
def bench() -> Bench:
    return Bench()


def cameras(bench: Bench) -> Cameras:
    assert isinstance(bench.firmware.payload.cameras, Cameras)
    return bench.firmware.payload.cameras


def photo_mode(
    mode: CameraPhotoMode = CameraPhotoMode.SINGLE,
    file: PhotoFileFormat = PhotoFileFormat.JPEG,
    interval: float = 2.0,
    burst: BurstValue = BurstValue.BURST_14_OVER_1S,
    bracketing: BracketingPreset = BracketingPreset.PRESET_1EV_2EV_3EV,
) -> camera.SetPhotoMode:
    return camera.SetPhotoMode(0, mode, PhotoFormat.RECTILINEAR, file, burst, bracketing, interval)


def shoot(bench: Bench, mode: camera.SetPhotoMode | None = None) -> list[Message]:
    """Take a photo and wait until it is on the card; what was reported about it."""
    bench.send(camera.SetCameraMode(0, PHOTO))
    if mode is not None:
        bench.send(mode)
    before = len(bench.events)
    bench.send(camera.TakePhoto(0))
    bench.run_until(lambda: photo_state(bench).state is State.INACTIVE)
    return bench.events[before:]


def photo_state(bench: Bench) -> camera.PhotoState:
    return bench.of(camera.PhotoState)[-1]


def exposure(
    mode: ExposureMode,
    shutter: ShutterSpeed = ShutterSpeed.SHUTTER_1_OVER_100,
    iso: IsoSensitivity = IsoSensitivity.ISO_200,
    max_iso: IsoSensitivity = IsoSensitivity.ISO_800,
    metering: AutoExposureMeteringMode = AutoExposureMeteringMode.STANDARD,
) -> camera.SetExposureSettings:
    return camera.SetExposureSettings(0, mode, shutter, iso, max_iso, metering)


# -- settings


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (
            camera.SetEvCompensation(0, CameraEvCompensation.EV_1_33),
            camera.EvCompensation(0, CameraEvCompensation.EV_1_33),
        ),
        (
            camera.SetEvCompensation(0, CameraEvCompensation(19)),
            camera.EvCompensation(0, CameraEvCompensation.EV_0_00),
        ),
        (
            camera.SetWhiteBalance(0, WhiteBalanceMode.SUNNY, WhiteBalanceTemperature.T_9000),
            camera.WhiteBalance(0, WhiteBalanceMode.SUNNY, WhiteBalanceTemperature.T_5000, State.INACTIVE),
        ),
        (
            camera.SetWhiteBalance(0, WhiteBalanceMode.CUSTOM, WhiteBalanceTemperature.T_9000),
            camera.WhiteBalance(0, WhiteBalanceMode.CUSTOM, WhiteBalanceTemperature.T_9000, State.INACTIVE),
        ),
        (  # a mode this camera has not got
            camera.SetWhiteBalance(0, WhiteBalanceMode.SNOW, WhiteBalanceTemperature.T_9000),
            camera.WhiteBalance(0, WhiteBalanceMode.AUTOMATIC, WhiteBalanceTemperature.T_5000, State.INACTIVE),
        ),
        (  # nor a lock
            camera.SetWhiteBalanceLock(0, State.ACTIVE),
            camera.WhiteBalance(0, WhiteBalanceMode.AUTOMATIC, WhiteBalanceTemperature.T_5000, State.INACTIVE),
        ),
        (
            camera.SetAntiflickerMode(CameraAntiflickerMode.MODE_60HZ),
            camera.AntiflickerMode(CameraAntiflickerMode.MODE_60HZ, CameraAntiflickerMode.MODE_60HZ),
        ),
        (
            camera.SetAntiflickerMode(CameraAntiflickerMode.AUTO),
            camera.AntiflickerMode(CameraAntiflickerMode.AUTO, CameraAntiflickerMode.MODE_50HZ),
        ),
        (camera.SetStyle(0, CameraStyle.PLOG), camera.Style(0, CameraStyle.STANDARD, 0, -3, 3, 0, -3, 3, 0, -3, 3)),
        (
            camera.SetStyleParams(0, 2, -2, 9),
            camera.Style(0, CameraStyle.STANDARD, 2, -3, 3, -2, -3, 3, 3, -3, 3),
        ),
        (camera.SetMaxZoomSpeed(0, 1.5), camera.MaxZoomSpeed(0, 0.01, 10.0, 1.5)),
        (camera.SetMaxZoomSpeed(0, 99.0), camera.MaxZoomSpeed(0, 0.01, 10.0, 10.0)),
        (camera.SetMaxZoomSpeed(0, math.nan), camera.MaxZoomSpeed(0, 0.01, 10.0, 0.34)),
        (
            camera.SetZoomVelocityQualityDegradation(0, 1),
            camera.ZoomVelocityQualityDegradation(0, 1),
        ),
        (
            camera.SetStreamingMode(0, CameraStreamingMode.HIGH_RELIABILITY),
            camera.StreamingMode(0, CameraStreamingMode.HIGH_RELIABILITY),
        ),
        (camera.SetAutorecord(0, State.ACTIVE), camera.Autorecord(0, State.ACTIVE)),
    ],
)
def test_a_setting(bench: Bench, command: Message, answer: Message) -> None:
    assert bench.send(command) == [answer]
    assert bench.send(command) == [answer]  # reported again, though nothing changed


def test_a_style_keeps_its_own_parameters() -> None:
    bench = Bench("thermal")
    bench.send(camera.SetStyleParams(0, 1, 1, 1))
    bench.send(camera.SetStyle(0, CameraStyle.PASTEL))
    assert bench.send(camera.SetStyleParams(0, -1, 0, 0))[0] == camera.Style(
        0, CameraStyle.PASTEL, -1, -3, 3, 0, -3, 3, 0, -3, 3
    )
    assert bench.send(camera.SetStyle(0, CameraStyle.STANDARD))[0] == camera.Style(
        0, CameraStyle.STANDARD, 1, -3, 3, 1, -3, 3, 1, -3, 3
    )


def test_absent_camera_does_not_answer(bench: Bench) -> None:
    for command in (camera.TakePhoto(1), camera.SetEvCompensation(9, CameraEvCompensation.EV_0_00)):
        assert bench.send(command) == []


def test_exposure_takes_what_the_mode_uses() -> None:
    bench = Bench("usa")

    def values(command: Message) -> tuple[object, ...]:
        report = bench.send(command)[0]
        assert isinstance(report, camera.ExposureSettings)
        return report.mode, report.manual_shutter_speed, report.manual_iso_sensitivity, report.max_iso_sensitivity

    start = (ShutterSpeed.SHUTTER_1_OVER_60, IsoSensitivity.ISO_100, IsoSensitivity.ISO_3200)
    mode = ExposureMode.MANUAL_SHUTTER_SPEED
    assert values(exposure(mode)) == (mode, ShutterSpeed.SHUTTER_1_OVER_100, *start[1:])
    mode = ExposureMode.MANUAL_ISO_SENSITIVITY
    assert values(exposure(mode, ShutterSpeed.SHUTTER_1)) == (
        mode,
        ShutterSpeed.SHUTTER_1_OVER_100,
        IsoSensitivity.ISO_200,
        IsoSensitivity.ISO_3200,
    )
    mode = ExposureMode.AUTOMATIC
    assert values(exposure(mode))[3] is IsoSensitivity.ISO_800
    # ISO 50 is below the range of these sensors: nothing changes, and that is said.
    kept = values(exposure(mode, max_iso=IsoSensitivity.ISO_50))
    assert kept == (mode, ShutterSpeed.SHUTTER_1_OVER_100, IsoSensitivity.ISO_200, IsoSensitivity.ISO_800)
    mode = ExposureMode.MANUAL
    assert values(exposure(mode, ShutterSpeed.SHUTTER_1, IsoSensitivity.ISO_1600))[:3] == (
        mode,
        ShutterSpeed.SHUTTER_1,
        IsoSensitivity.ISO_1600,
    )
    now = bench.of(camera.Exposure)[-1]
    assert (now.shutter_speed, now.iso_sensitivity) == (ShutterSpeed.SHUTTER_1, IsoSensitivity.ISO_1600)


def test_a_4k_has_no_manual_exposure_and_no_lock(bench: Bench) -> None:
    report = bench.send(exposure(ExposureMode.MANUAL))[0]
    assert isinstance(report, camera.ExposureSettings)
    assert (report.mode, report.manual_shutter_speed_capabilities) == (ExposureMode.AUTOMATIC, 0)
    now = bench.send(camera.LockExposure(0))[0]
    assert isinstance(now, camera.Exposure)
    assert now.lock is State.INACTIVE


def test_exposure_lock_ends_with_the_mode() -> None:
    bench = Bench("thermal")

    def lock(command: Message) -> tuple[State, float, float]:
        now = bench.send(command)[-1]
        assert isinstance(now, camera.Exposure)
        return now.lock, now.lock_roi_x, now.lock_roi_y

    assert lock(camera.LockExposure(0)) == (State.ACTIVE, -1.0, -1.0)
    assert lock(camera.LockExposureOnRoi(0, 0.25, 1.5)) == (State.ACTIVE, 0.25, 1.0)
    assert lock(exposure(ExposureMode.MANUAL_SHUTTER_SPEED))[0] is State.INACTIVE
    assert lock(camera.LockExposure(0))[0] is State.ACTIVE
    assert lock(camera.UnlockExposure(0))[0] is State.INACTIVE
    bench.send(exposure(ExposureMode.MANUAL))
    assert lock(camera.LockExposure(0))[0] is State.INACTIVE
    white = bench.send(camera.SetWhiteBalanceLock(0, State.ACTIVE))[0]
    assert white == camera.WhiteBalance(0, WhiteBalanceMode.AUTOMATIC, WhiteBalanceTemperature.T_5000, State.ACTIVE)
    white = bench.send(camera.SetWhiteBalance(0, WhiteBalanceMode.SUNNY, WhiteBalanceTemperature.T_5000))[0]
    assert white == camera.WhiteBalance(0, WhiteBalanceMode.SUNNY, WhiteBalanceTemperature.T_5000, State.INACTIVE)


@pytest.mark.parametrize(
    ("mode", "resolution", "framerate", "taken"),
    [
        (CameraRecordingMode.STANDARD, Resolution.RES_1080P, Framerate.FPS_24, True),
        (CameraRecordingMode.HYPERLAPSE, Resolution.RES_2_7K, Framerate.FPS_30, True),
        (CameraRecordingMode.HIGH_FRAMERATE, Resolution.RES_720P, Framerate.FPS_120, True),
        (CameraRecordingMode.STANDARD, Resolution.RES_1080P, Framerate.FPS_60, False),
        (CameraRecordingMode.HYPERLAPSE, Resolution.RES_DCI_4K, Framerate.FPS_24, False),
        (CameraRecordingMode.STANDARD, Resolution.RES_480P, Framerate.FPS_30, False),
    ],
)
def test_a_recording_mode(
    bench: Bench, mode: CameraRecordingMode, resolution: Resolution, framerate: Framerate, taken: bool
) -> None:
    answer = bench.send(camera.SetRecordingMode(0, mode, resolution, framerate, HyperlapseValue.RATIO_60))[0]
    assert isinstance(answer, camera.RecordingMode)
    wanted = (mode, resolution, framerate)
    factory = (CameraRecordingMode.STANDARD, Resolution.RES_UHD_4K, Framerate.FPS_30)
    assert (answer.mode, answer.resolution, answer.framerate) == (wanted if taken else factory)


@pytest.mark.parametrize(
    ("command", "taken"),
    [
        (photo_mode(CameraPhotoMode.TIME_LAPSE, interval=5.0), True),
        (photo_mode(CameraPhotoMode.BURST), True),
        (photo_mode(CameraPhotoMode.BURST, burst=BurstValue.BURST_4_OVER_4S), False),
        (photo_mode(CameraPhotoMode.BRACKETING, bracketing=BracketingPreset.PRESET_3EV), True),
        (photo_mode(CameraPhotoMode.SINGLE, PhotoFileFormat.DNG_JPEG), True),
        (photo_mode(CameraPhotoMode(7)), False),
        (photo_mode(CameraPhotoMode.GPS_LAPSE, interval=math.nan), False),
    ],
)
def test_a_photo_mode(bench: Bench, command: camera.SetPhotoMode, taken: bool) -> None:
    answer = bench.send(command)[0]
    assert isinstance(answer, camera.PhotoMode)
    assert (answer.mode == command.mode and answer.file_format == command.file_format) == taken


def test_an_interval_has_a_limit(bench: Bench) -> None:
    assert bench.send(photo_mode(CameraPhotoMode.TIME_LAPSE, interval=0.5))[0] == camera.PhotoMode(
        0,
        CameraPhotoMode.TIME_LAPSE,
        PhotoFormat.RECTILINEAR,
        PhotoFileFormat.JPEG,
        BurstValue.BURST_14_OVER_1S,
        BracketingPreset.PRESET_1EV_2EV_3EV,
        2.0,
    )


def test_hdr_is_for_settings_that_allow_it(bench: Bench) -> None:
    assert bench.send(camera.SetHdrSetting(0, State.ACTIVE)) == [
        camera.HdrSetting(0, State.ACTIVE),
        camera.Hdr(0, Availability.AVAILABLE, State.ACTIVE),
    ]
    fast = camera.SetRecordingMode(
        0,
        CameraRecordingMode.SLOW_MOTION,
        Resolution.RES_1080P,
        Framerate.FPS_60,
        HyperlapseValue.RATIO_15,
    )
    assert camera.Hdr(0, Availability.NOT_AVAILABLE, State.INACTIVE) in bench.send(fast)


def test_camera_mode_reports_its_available_functions(bench: Bench) -> None:
    answer = bench.send(camera.SetCameraMode(0, PHOTO))
    assert answer[0] == camera.CameraMode(0, PHOTO)
    assert answer[-2:] == [
        camera.PhotoState(0, Availability.AVAILABLE, State.INACTIVE),
        camera.RecordingState(0, Availability.NOT_AVAILABLE, State.INACTIVE, 0),
    ]
    assert bench.send(camera.SetCameraMode(0, CameraCameraMode(5)))[0] == camera.CameraMode(0, PHOTO)


# -- zoom


def test_zoom_to_a_level(bench: Bench) -> None:
    def level(value: float) -> Message:
        return bench.send(camera.SetZoomTarget(0, ZoomControlMode.LEVEL, value))[0]

    assert level(2.5) == camera.ZoomLevel(0, 2.5)
    assert level(9.0) == camera.ZoomLevel(0, 3.0)
    assert level(0.1) == camera.ZoomLevel(0, 1.0)
    assert bench.send(camera.SetZoomTarget(0, ZoomControlMode.LEVEL, math.nan)) == []
    level(2.0)
    assert bench.send(camera.ResetZoom(0)) == [camera.ZoomLevel(0, 1.0)]


def test_zoom_at_a_speed(bench: Bench) -> None:
    def zoom() -> float:
        return cameras(bench)[0].zoom

    bench.send(camera.SetMaxZoomSpeed(0, 0.4))
    bench.send(camera.SetZoomTarget(0, ZoomControlMode.VELOCITY, 0.5))
    bench.run(0.5)
    # The tangent of half of 69 degrees is 0.6873; after 0.5 s at half of 0.4/s it is 0.5873: zoom 1.170.
    assert zoom() == pytest.approx(0.6873 / 0.5873, abs=0.02)
    bench.run(5.0)
    # It stops where a 4K recording begins to invent pixels: 5344 of the sensor's for 3840.
    assert zoom() == pytest.approx(5344 / 3840)
    bench.send(camera.SetZoomVelocityQualityDegradation(0, 1))
    bench.run(5.0)
    assert zoom() == 3.0
    bench.send(camera.SetZoomTarget(0, ZoomControlMode.VELOCITY, -1.0))
    bench.run(5.0)
    assert zoom() == 1.0


def test_a_usa_zooms_to_32() -> None:
    bench = Bench("usa")
    assert bench.send(camera.SetZoomTarget(0, ZoomControlMode.LEVEL, 99.0)) == [camera.ZoomLevel(0, 32.0)]


def test_fine_zoom_follows_the_resolution(bench: Bench) -> None:
    answer = bench.send(
        camera.SetRecordingMode(
            0,
            CameraRecordingMode.STANDARD,
            Resolution.RES_1080P,
            Framerate.FPS_30,
            HyperlapseValue.RATIO_15,
        )
    )
    info = next(message for message in answer if isinstance(message, camera.ZoomInfo))
    assert (info.high_quality_maximum_level, info.maximum_level) == pytest.approx((2.783, 3.0), abs=1e-3)


# -- photos


def test_a_photo(bench: Bench) -> None:
    bench.send(common.CurrentDateTime("20261121T101112+0100"))
    observed = shoot(bench)
    assert observed == [
        camera.PhotoState(0, Availability.AVAILABLE, State.ACTIVE),
        camera.PhotoProgress(0, PhotoResult.TAKING_PHOTO, 0, ""),
        camera.PhotoProgress(0, PhotoResult.PHOTO_TAKEN, 1, ""),
        mediastore.Counters(0, 1, 0, 1),
        camera.PhotoProgress(0, PhotoResult.PHOTO_SAVED, 1, "10000001"),
        camera.PhotoState(0, Availability.AVAILABLE, State.INACTIVE),
    ]
    (media,) = bench.firmware.payload.media
    assert media.describe()["photo_mode"] == "SINGLE"
    assert media.describe()["run_id"] == "run"
    assert media.date == "20261121T101112+0100"
    (resource,) = media.resources
    assert resource.id == "100000010001.JPG"
    assert (resource.scene.latitude, resource.scene.longitude) == pytest.approx((48.8789, 2.3677), abs=1e-7)
    assert resource.content()[:2] == b"\xff\xd8"
    assert resource.size == len(resource.content())


def test_a_raw_photo_is_two_files(bench: Bench) -> None:
    shoot(bench, photo_mode(CameraPhotoMode.SINGLE, PhotoFileFormat.DNG_JPEG))
    (media,) = bench.firmware.payload.media
    assert [resource.id for resource in media.resources] == ["100000010001.JPG", "100000010001.DNG"]


def test_burst_reports_shots_at_a_limited_rate(bench: Bench) -> None:
    observed = shoot(bench, photo_mode(CameraPhotoMode.BURST))
    counts = [m.photo_count for m in observed if isinstance(m, camera.PhotoProgress) and m.result.name == "PHOTO_TAKEN"]
    # A shot each 71 ms, a report each 100 ms at most, and always one of the last.
    assert counts == [2, 4, 6, 8, 10, 12, 14]
    assert mediastore.Counters(0, 1, 0, 14) in observed


def test_the_files_of_a_burst_arrive_one_by_one(bench: Bench) -> None:
    websocket: list[str] = []
    bench.firmware.payload.media.notify = lambda name, data: websocket.append(name)
    bench.send(camera.SetCameraMode(0, PHOTO))
    bench.send(photo_mode(CameraPhotoMode.BURST))
    bench.send(camera.TakePhoto(0))
    bench.run(0.57)  # shots each 71 ms, the first at 71 ms, their files 0.3 s later
    (media,) = bench.firmware.payload.media
    assert [resource.number for resource in media.resources] == [1, 2, 3]
    assert websocket == ["media_created", *["media_updated", "resource_created"] * 2]
    assert photo_state(bench).state is State.ACTIVE
    bench.run(0.8)
    assert len(media.resources) == 14
    assert photo_state(bench).state is State.INACTIVE


@pytest.mark.parametrize(
    ("preset", "count"),
    [
        (BracketingPreset.PRESET_2EV, 3),
        (BracketingPreset.PRESET_1EV_3EV, 5),
        (BracketingPreset.PRESET_1EV_2EV_3EV, 7),
    ],
)
def test_bracketing_is_reported_at_its_end(bench: Bench, preset: BracketingPreset, count: int) -> None:
    observed = shoot(bench, photo_mode(CameraPhotoMode.BRACKETING, bracketing=preset))
    results = [(m.result.name, m.photo_count) for m in observed if isinstance(m, camera.PhotoProgress)]
    assert results == [("TAKING_PHOTO", 0), ("PHOTO_TAKEN", count), ("PHOTO_SAVED", count)]
    assert mediastore.Counters(0, 1, 0, count) in observed


def test_a_time_lapse_goes_on_until_it_is_stopped(bench: Bench) -> None:
    bench.send(camera.SetCameraMode(0, PHOTO))
    bench.send(photo_mode(CameraPhotoMode.TIME_LAPSE, interval=2.0))
    bench.send(camera.TakePhoto(0))
    bench.run(5.0)  # shots at 0.1, 2.1 and 4.1 s
    assert photo_state(bench).state is State.ACTIVE
    delays = [delay.remaining for delay in bench.of(camera.NextPhotoDelay)]
    assert delays[:4] == pytest.approx([1.6, 1.1, 0.6, 0.1], abs=0.06)
    assert bench.send(camera.StopPhoto(0)) == [
        camera.PhotoProgress(0, PhotoResult.PHOTO_SAVED, 3, "10000001"),
        camera.PhotoState(0, Availability.AVAILABLE, State.INACTIVE),
    ]
    (media,) = bench.firmware.payload.media
    assert len(media.resources) == 3


def test_a_lapse_stopped_at_once_has_a_photo_all_the_same(bench: Bench) -> None:
    bench.send(camera.SetCameraMode(0, PHOTO))
    bench.send(photo_mode(CameraPhotoMode.TIME_LAPSE, interval=2.0))
    bench.send(camera.TakePhoto(0))
    answer = bench.send(camera.StopPhoto(0))
    assert [type(message).__name__ for message in answer] == [
        "Counters",
        "PhotoProgress",
        "PhotoProgress",
        "PhotoState",
    ]


def test_a_gps_lapse_counts_metres(bench: Bench) -> None:
    bench.take_off()
    bench.send(camera.SetCameraMode(0, PHOTO))
    bench.send(photo_mode(CameraPhotoMode.GPS_LAPSE, interval=3.0))
    bench.send(camera.TakePhoto(0))
    bench.run(3.0)
    assert bench.of(camera.NextPhotoDelay)[-1].remaining == pytest.approx(3.0, abs=0.2)
    bench.send(ardrone3.MoveBy(10.0, 0.0, 0.0, 0.0))
    bench.run_until(lambda: bool(bench.of(ardrone3.MoveByEnd)))
    bench.send(camera.StopPhoto(0))
    (media,) = bench.firmware.payload.media
    places = [resource.scene.north for resource in media.resources]
    # Looked at every 50 ms: up to 0.4 m late at the speed of a move.
    assert places == pytest.approx([0.0, 3.2, 6.4, 9.6], abs=0.4)


def test_no_photo_in_recording_mode_and_none_at_a_time(bench: Bench) -> None:
    refused = [
        camera.PhotoProgress(0, PhotoResult.ERROR_BAD_STATE, 0, ""),
        camera.PhotoState(0, Availability.NOT_AVAILABLE, State.INACTIVE),
    ]
    assert bench.send(camera.TakePhoto(0)) == refused
    assert bench.send(camera.StopPhoto(0)) == refused
    bench.send(camera.SetCameraMode(0, PHOTO))
    bench.send(camera.TakePhoto(0))
    assert bench.send(camera.TakePhoto(0))[0] == refused[0]
    # And the mode stays as it is until the photo is on the card.
    assert bench.send(camera.SetCameraMode(0, RECORDING))[0] == camera.CameraMode(0, PHOTO)


# -- recordings


def test_a_recording(bench: Bench) -> None:
    bench.send(common.CurrentDateTime("19700101T000100+0000"))
    began = bench.send(camera.StartRecording(0))
    assert began[0] == camera.RecordingProgress(0, RecordingResult.STARTED, "")
    assert began[1] == camera.RecordingState(0, Availability.AVAILABLE, State.ACTIVE, 60_000)
    bench.run(2.5)
    ended = bench.send(camera.StopRecording(0))
    assert ended == [
        mediastore.Counters(1, 0, 1, 0),
        camera.RecordingProgress(0, RecordingResult.STOPPED, "10000001"),
        camera.RecordingState(0, Availability.AVAILABLE, State.INACTIVE, 0),
    ]
    (media,) = bench.firmware.payload.media
    assert media.describe()["duration"] == 2500
    (file,) = media.resources
    assert file.id == "100000010001.MP4"
    assert file.content()[4:8] == b"ftyp"
    assert len(file.content()) == file.size
    assert bench.send(camera.StopRecording(0))[0] == camera.RecordingProgress(0, RecordingResult.ERROR_BAD_STATE, "")


def test_a_recording_ends_when_another_mode_is_set(bench: Bench) -> None:
    bench.send(camera.StartRecording(0))
    assert bench.send(camera.StartRecording(0))[0] == camera.RecordingProgress(0, RecordingResult.ERROR_BAD_STATE, "")
    bench.run(1.0)
    answer = bench.send(camera.SetCameraMode(0, PHOTO))
    assert camera.RecordingProgress(0, RecordingResult.STOPPED_RECONFIGURED, "10000001") in answer
    assert answer[-1] == camera.RecordingState(0, Availability.NOT_AVAILABLE, State.INACTIVE, 0)
    assert bench.send(camera.StartRecording(0))[0] == camera.RecordingProgress(0, RecordingResult.ERROR_BAD_STATE, "")


def test_a_hyperlapse_is_shorter_and_a_slow_motion_longer(bench: Bench) -> None:
    def length(mode: CameraRecordingMode, resolution: Resolution, framerate: Framerate) -> float:
        bench.send(camera.SetRecordingMode(0, mode, resolution, framerate, HyperlapseValue.RATIO_30))
        bench.send(camera.StartRecording(0))
        bench.run(6.0)
        bench.send(camera.StopRecording(0))
        seconds: float = list(bench.firmware.payload.media)[-1].describe()["duration"] / 1000.0
        return seconds

    assert length(CameraRecordingMode.HYPERLAPSE, Resolution.RES_1080P, Framerate.FPS_30) == pytest.approx(0.2)
    assert length(CameraRecordingMode.SLOW_MOTION, Resolution.RES_720P, Framerate.FPS_120) == pytest.approx(24.0)


def test_recording_by_itself(bench: Bench) -> None:
    bench.send(camera.SetAutorecord(0, State.ACTIVE))
    bench.take_off()
    assert bench.of(camera.RecordingState)[-1].state is State.ACTIVE
    bench.send(ardrone3.Landing())
    bench.run_until(lambda: bool(bench.of(camera.RecordingProgress)[1:]))
    assert bench.state is ardrone3.FlyingState.LANDED
    assert bench.of(camera.RecordingProgress)[-1].result is RecordingResult.STOPPED


# -- what is reported at the connection


def last(message: camera.RecordingCapabilities | camera.PhotoCapabilities) -> bool:
    return bool(message.list_flags & 1 << ListFlags.LAST)


@pytest.mark.parametrize(
    ("model", "ids", "photos"),
    [("4k", [0, 1, 2, 3, 4, 5], [0]), ("thermal", [0, 1, 2, 3, 4, 5, 512], [0]), ("usa", [0, 1, 2, 3, 4, 5, 512], [0])],
)
def test_capabilities(model: str, ids: list[int], photos: list[int]) -> None:
    report = Bench(model).firmware.payload.states_report()
    recordings = [message for message in report if isinstance(message, camera.RecordingCapabilities)]
    assert [one.id for one in recordings] == ids
    assert [last(one) for one in recordings] == [False] * (len(ids) - 1) + [True]
    assert [one.id for one in report if isinstance(one, camera.PhotoCapabilities)] == photos
    cameras = [message.cam_id for message in report if isinstance(message, camera.CameraCapabilities)]
    assert cameras == ([0] if model == "4k" else [0, 1, 2])
    assert [m for m in report if isinstance(m, camera.CameraStates)] == [camera.CameraStates(1)]


def test_an_ai_has_no_such_cameras() -> None:
    bench = Bench("ai")
    assert not [m for m in bench.firmware.payload.states_report() if m.NAME.startswith("camera.")]
    assert bench.send(camera.TakePhoto(0)) == []
    assert bench.send(thermal.SetMode(thermal.ThermalMode.BLENDED)) == []
    assert bench.send(user_storage.StartMonitoring(1)) == []


# -- thermal


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        (thermal.SetMode(thermal.ThermalMode(7)), thermal.Mode(thermal.ThermalMode.DISABLED)),
        (thermal.SetEmissivity(0.5), thermal.Emissivity(0.5)),
        (thermal.SetEmissivity(1.5), thermal.Emissivity(1.0)),
        (thermal.SetEmissivity(math.nan), thermal.Emissivity(1.0)),
        (thermal.SetBackgroundTemperature(300.0), thermal.BackgroundTemperature(300.0)),
        (thermal.SetBackgroundTemperature(-1.0), thermal.BackgroundTemperature(293.15)),
        (thermal.SetSensitivity(thermal.Range.HIGH), thermal.Sensitivity(thermal.Range.HIGH)),
        (thermal.SetShutterMode(thermal.ShutterTrigger.MANUAL), thermal.ShutterMode(thermal.ShutterTrigger.MANUAL)),
        (
            thermal.SetRendering(thermal.RenderingMode.MONOCHROME, 2.0),
            thermal.Rendering(thermal.RenderingMode.MONOCHROME, 1.0),
        ),
        (thermal.SetPalettePart(0.1, 0.2, 0.3, 1.4, 3), thermal.PalettePart(0.1, 0.2, 0.3, 1.0, 3)),
        (
            thermal.SetPaletteSettings(
                thermal.PaletteMode.ABSOLUTE,
                280.0,
                310.0,
                thermal.ColorizationMode.LIMITED,
                thermal.RelativeRangeMode.LOCKED,
                thermal.SpotType.COLD,
                0.25,
            ),
            thermal.PaletteSettings(
                thermal.PaletteMode.ABSOLUTE,
                280.0,
                310.0,
                thermal.ColorizationMode.LIMITED,
                thermal.RelativeRangeMode.LOCKED,
                thermal.SpotType.COLD,
                0.25,
            ),
        ),
    ],
)
@pytest.mark.parametrize("model", ["thermal", "usa"])
def test_a_thermal_setting(model: str, command: Message, answer: Message) -> None:
    assert Bench(model).send(command) == [answer]
    assert Bench("4k").send(command) == []


def test_a_palette_arrives_in_parts() -> None:
    bench = Bench("usa")

    def palette() -> list[Message]:
        return [m for m in bench.firmware.payload.states_report() if isinstance(m, thermal.PalettePart)]

    assert len(palette()) == 2
    first, middle, end = 1 << ListFlags.FIRST, 0, 1 << ListFlags.LAST
    parts = [(0.0, first), (0.5, middle), (1.0, end)]
    for index, flags in parts:
        bench.send(thermal.SetPalettePart(0.5, 0.5, 0.5, index, flags))
    assert palette() == [thermal.PalettePart(0.5, 0.5, 0.5, index, flags) for index, flags in parts]
    bench.send(thermal.SetPalettePart(0.0, 0.0, 0.0, 0.0, 1 << ListFlags.EMPTY))
    assert palette() == [thermal.PalettePart(0.0, 0.0, 0.0, 0.0, 1 << ListFlags.EMPTY)]


def test_blending_makes_the_blended_camera_the_active_one() -> None:
    bench = Bench("thermal")
    bench.send(camera.StartRecording(0))
    bench.run(1.0)
    answer = bench.send(thermal.SetMode(thermal.ThermalMode.BLENDED))
    assert thermal.Mode(thermal.ThermalMode.BLENDED) in answer
    assert camera.RecordingProgress(0, RecordingResult.STOPPED_RECONFIGURED, "10000001") in answer
    assert camera.CameraStates(0b100) in answer
    assert camera.RecordingState(0, Availability.NOT_AVAILABLE, State.INACTIVE, 0) in answer
    assert answer[-1] == camera.RecordingState(2, Availability.AVAILABLE, State.INACTIVE, 0)
    assert bench.send(camera.StartRecording(2))[0] == camera.RecordingProgress(2, RecordingResult.STARTED, "")
    bench.run(1.0)
    bench.send(camera.StopRecording(2))
    media = list(bench.firmware.payload.media)[-1]
    assert media.describe()["thermal"] is True
    mode = cameras(bench)[2].recording_report()
    assert isinstance(mode, camera.RecordingMode)
    assert (mode.resolution, mode.framerate) == (Resolution.RES_720P_SD, Framerate.FPS_9)


def test_every_command_is_answered_with_odd_values() -> None:
    """No argument makes the simulator raise, and no setting is left without an answer."""
    silent: list[type[Message]] = []
    commands: list[Callable[[], Message]] = [
        lambda: camera.SetCameraMode(0, CameraCameraMode(-1)),
        lambda: camera.SetStreamingMode(0, CameraStreamingMode(77)),
        lambda: camera.SetHdrSetting(0, State(9)),
        lambda: camera.SetAutorecord(0, State(9)),
        lambda: camera.SetStyle(0, CameraStyle(99)),
        lambda: camera.SetAntiflickerMode(CameraAntiflickerMode(9)),
        lambda: camera.SetAlignmentOffsets(0, math.nan, math.inf, 0.0),
        lambda: camera.SetRecordingMode(0, CameraRecordingMode(9), Resolution(99), Framerate(99), HyperlapseValue(9)),
        lambda: exposure(ExposureMode(99)),
        lambda: camera.SetWhiteBalance(0, WhiteBalanceMode(99), WhiteBalanceTemperature(99)),
    ]
    for make in commands:
        bench = Bench("thermal")
        before = bench.firmware.payload.states_report()
        if not bench.send(make()):
            silent.append(type(make()))
        assert bench.firmware.payload.states_report() == before
    assert silent == []
