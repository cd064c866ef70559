"""The cameras: both of Parrot's vocabularies behind one interface; photographed and filmed in the simulator."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator

import pytest
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera as old
from anafi_mav.arsdk.messages.proto import antiflicker as mains
from anafi_mav.arsdk.messages.proto import camera2 as new
from anafi_mav.drone import Drone, Range
from anafi_mav.drone.payload.camera_enums import (
    Antiflicker,
    Burst,
    CameraKind,
    CameraMode,
    ExposureMode,
    Metering,
    PhotoFile,
    PhotoFormat,
    PhotoMode,
    RecordingMode,
    Resolution,
    StoragePolicy,
    Streaming,
    Style,
    VideoCodec,
    WhiteBalance,
    bare,
    nearest,
    parrot,
    quantity,
    word,
)
from anafi_mav.drone.payload.camera_state import ExposureSettings, PhotoSettings, RecordingSettings
from anafi_mav.errors import CommandRejected, CommandTimeout, LocalProtocolError, NotSupported

NAN = float("nan")

# -- words


def test_numbers_of_both_lists() -> None:
    assert quantity(old.ShutterSpeed.SHUTTER_1_OVER_60) == pytest.approx(1 / 60)
    assert quantity(old.ShutterSpeed.SHUTTER_1_OVER_1_5) == pytest.approx(2 / 3)
    assert quantity(new.ShutterSpeed._1_OVER_1_POINT_5) == pytest.approx(2 / 3)
    assert quantity(old.Framerate.FPS_8_6) == 8.6
    assert quantity(new.Framerate._12_POINT_5) == 12.5
    assert (quantity(old.IsoSensitivity.ISO_100), quantity(new.IsoSensitivity._100)) == (100, 100)
    assert quantity(old.WhiteBalanceTemperature.T_5000) == 5000
    assert quantity(old.CameraStyle.PLOG) is None
    assert nearest(old.ShutterSpeed, 1 / 125) is old.ShutterSpeed.SHUTTER_1_OVER_120
    assert nearest(new.IsoSensitivity, 110.0) is new.IsoSensitivity._100
    for wrong in (0.0, -1.0, NAN):
        with pytest.raises(LocalProtocolError):
            nearest(old.Framerate, wrong)


def test_words_of_both_lists() -> None:
    # photo and recording change places
    assert parrot(old.CameraCameraMode, CameraMode.PHOTO) == 1
    assert parrot(new.CameraMode, CameraMode.PHOTO) == 0
    assert parrot(old.CameraStyle, Style.INTENSE) == 2
    assert parrot(new.ImageStyle, Style.INTENSE) == 3
    assert parrot(old.Resolution, Resolution.UHD_4K) == old.Resolution.RES_UHD_4K
    assert parrot(new.VideoResolution, Resolution.UHD_4K) == new.VideoResolution._2160P
    assert parrot(mains.Mode, Antiflicker.HZ_60) == 3
    assert parrot(old.CameraAntiflickerMode, Antiflicker.OFF) == 0
    assert parrot(new.BurstValue, Burst.B10_OVER_2S) == new.BurstValue._10_OVER_2S
    assert word(CameraMode, old.CameraCameraMode(77)) is None
    assert word(CameraMode, None) is None
    with pytest.raises(NotSupported, match="photogrammetry"):
        parrot(old.CameraStyle, Style.PHOTOGRAMMETRY)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (PhotoMode, old.CameraPhotoMode),
        (PhotoMode, new.PhotoMode),
        (PhotoFormat, old.PhotoFormat),
        (PhotoFormat, new.PhotoFormat),
        (PhotoFile, old.PhotoFileFormat),
        (PhotoFile, new.PhotoFileFormat),
        (Burst, old.BurstValue),
        (Burst, new.BurstValue),
        (RecordingMode, old.CameraRecordingMode),
        (RecordingMode, new.VideoRecordingMode),
        (Resolution, old.Resolution),
        (ExposureMode, old.ExposureMode),
        (ExposureMode, new.ExposureMode),
        (Metering, old.AutoExposureMeteringMode),
        (Metering, new.ExposureMetering),
        (WhiteBalance, old.WhiteBalanceMode),
        (WhiteBalance, new.WhiteBalanceMode),
        (Style, old.CameraStyle),
        (Style, new.ImageStyle),
        (Streaming, old.CameraStreamingMode),
        (Antiflicker, old.CameraAntiflickerMode),
        (Antiflicker, mains.Mode),
        (CameraKind, old.Model),
        (CameraKind, new.CameraModel),
    ],
)
def test_every_value_has_a_word(ours: type, theirs: type) -> None:
    for value in theirs:  # type: ignore[attr-defined]
        assert word(ours, value) is not None, bare(value)


# -- scripted devices


OLD: list[Message] = [
    old.CameraCapabilities(
        cam_id=0,
        model=old.Model.MAIN,
        exposure_modes=0b111,
        exposure_lock_supported=old.Supported.NOT_SUPPORTED,
        exposure_roi_lock_supported=old.Supported.NOT_SUPPORTED,
        ev_compensations=0b111 << 8,
        white_balance_modes=1 << old.WhiteBalanceMode.CUSTOM,
        custom_white_balance_temperatures=1,
        white_balance_lock_supported=old.Supported.SUPPORTED,
        styles=1,
        camera_modes=0b11,
        hyperlapse_values=1,
        bracketing_presets=1,
        burst_values=1,
        streaming_modes=1,
        timelapse_interval_min=2.0,
        gpslapse_interval_min=1.0,
        auto_exposure_metering_modes=1,
    ),
    old.RecordingCapabilities(0, 1, 1 << 3, 0b101, old.Supported.SUPPORTED, 3),
    old.PhotoCapabilities(0, 0b11001, 0b11, 0b101, old.Supported.SUPPORTED, 3),
    old.CameraStates(1),
    old.CameraMode(0, old.CameraCameraMode.PHOTO),
    old.PhotoMode(
        0,
        old.CameraPhotoMode.SINGLE,
        old.PhotoFormat.RECTILINEAR,
        old.PhotoFileFormat.DNG_JPEG,
        old.BurstValue.BURST_4_OVER_1S,
        old.BracketingPreset.PRESET_1EV,
        2.0,
    ),
    old.PhotoState(0, old.Availability.AVAILABLE, old.State.INACTIVE),
    old.RecordingState(0, old.Availability.NOT_AVAILABLE, old.State.INACTIVE, 0),
    old.ZoomInfo(0, old.Availability.AVAILABLE, 1.4, 3.0),
    old.ZoomLevel(0, 1.0),
    old.MaxZoomSpeed(0, 0.25, 10.0, 0.5),  # Parrot's order: min, max, current
    old.EvCompensation(0, old.CameraEvCompensation.EV_0_33),
    old.ExposureSettings(
        0,
        old.ExposureMode.AUTOMATIC,
        old.ShutterSpeed.SHUTTER_1_OVER_60,
        0,
        old.IsoSensitivity.ISO_100,
        0,
        old.IsoSensitivity.ISO_3200,
        0,
        old.AutoExposureMeteringMode.STANDARD,
    ),
]


@pytest.fixture
def states() -> list[Message]:
    """What the device reports at the start."""
    return [*STATES, *OLD]


async def test_the_state_of_an_older_camera(device: ScriptedDevice, drone: Drone) -> None:
    now = drone.camera[0]
    assert (now.kind, now.mode) == (CameraKind.MAIN, CameraMode.PHOTO)
    assert drone.camera.state.active == frozenset({0})
    assert now.zoom_speed_range == Range(0.5, 0.25, 10.0)
    assert now.ev == pytest.approx(1 / 3)
    assert now.evs == pytest.approx((-1 / 3, 0.0, 1 / 3))
    assert now.photo is not None
    assert (now.photo.format, now.photo.file, now.photo.burst) == (
        PhotoFormat.RECTILINEAR,
        PhotoFile.DNG_JPEG,
        Burst.B4_OVER_1S,
    )
    assert now.recordings[0].framerates == (24.0, 30.0)
    assert now.photos[0].modes == frozenset({PhotoMode.SINGLE, PhotoMode.TIME_LAPSE, PhotoMode.GPS_LAPSE})
    assert drone.camera[7].mode is None
    assert not device.got(new.ListCameras)


async def test_a_wish_changes_only_what_it_names(device: ScriptedDevice, drone: Drone) -> None:
    device.script[old.SetPhotoMode] = lambda m: [old.PhotoMode(0, *(getattr(m, f) for f in m.__struct_fields__[1:]))]
    photo = await drone.camera.set_photo(PhotoSettings(mode=PhotoMode.TIME_LAPSE, interval=4.0))
    assert device.got(old.SetPhotoMode) == [
        old.SetPhotoMode(
            0,
            old.CameraPhotoMode.TIME_LAPSE,
            old.PhotoFormat.RECTILINEAR,
            old.PhotoFileFormat.DNG_JPEG,
            old.BurstValue.BURST_4_OVER_1S,
            old.BracketingPreset.PRESET_1EV,
            4.0,
        )
    ]
    assert photo is not None
    assert photo.interval == 4.0
    with pytest.raises(NotSupported):
        await drone.camera.set_photo(PhotoSettings(megapixels=12.0))
    with pytest.raises(NotSupported):
        await drone.camera.set_photo(PhotoSettings(signed=True))
    with pytest.raises(NotSupported):
        await drone.camera.set_recording(RecordingSettings(codec=VideoCodec.H265))
    with pytest.raises(LocalProtocolError):
        await drone.camera.set_photo(PhotoSettings(interval=NAN))


async def test_report_of_before_a_change_is_not_its_answer(device: ScriptedDevice, drone: Drone) -> None:
    before, after = old.CameraCameraMode.PHOTO, old.CameraCameraMode.RECORDING
    device.script[old.SetCameraMode] = lambda m: [old.CameraMode(0, before), old.CameraMode(0, m.value)]
    assert await drone.camera.set_mode(CameraMode.RECORDING) is CameraMode.RECORDING
    device.script[old.SetCameraMode] = lambda m: [old.CameraMode(0, after)]  # it keeps its mode
    assert await drone.camera.set_mode(CameraMode.PHOTO) is CameraMode.RECORDING


async def test_another_cameras_answer_is_none(device: ScriptedDevice, drone: Drone) -> None:
    device.script[old.SetEvCompensation] = lambda m: [
        old.EvCompensation(1, m.value),
        old.EvCompensation(0, old.CameraEvCompensation.EV_0_00),
    ]
    assert await drone.camera.set_ev(1.3) == 0.0
    assert device.got(old.SetEvCompensation)[0].value == old.CameraEvCompensation.EV_1_33


async def test_verbs_that_an_older_camera_lacks_are_not_supported(drone: Drone) -> None:
    for call in (
        drone.camera.set_hdr(True),
        drone.camera.set_autorecord(True),
        drone.camera.set_streaming(Streaming.LOW_LATENCY),
        drone.camera.set_storage_policy(StoragePolicy.REMOVABLE),
        drone.camera.lock_exposure(),
        drone.camera.set_antiflicker(Antiflicker.AUTO),
        drone.camera.set_mode(CameraMode.PHOTO, id=2),
        drone.camera.zoom(2.0, id=2),
    ):
        with pytest.raises(NotSupported):
            await call


PROGRESS = old.PhotoResult


async def test_photo_with_a_timeout_of_nan_raises_and_is_not_taken(device: ScriptedDevice, drone: Drone) -> None:
    device.script[old.TakePhoto] = lambda _: [old.PhotoProgress(0, PROGRESS.TAKING_PHOTO, 0, "")]
    with pytest.raises(LocalProtocolError, match="timeout"):
        await drone.camera.take_photo(timeout=NAN)
    assert device.got(old.TakePhoto) == []


async def test_a_photo_is_done_when_it_is_stored(device: ScriptedDevice, drone: Drone) -> None:
    device.script[old.TakePhoto] = lambda _: [
        old.PhotoState(0, old.Availability.AVAILABLE, old.State.ACTIVE),
        old.PhotoProgress(0, PROGRESS.TAKING_PHOTO, 0, ""),
        old.PhotoProgress(1, PROGRESS.PHOTO_SAVED, 0, "another's"),
        old.PhotoProgress(0, PROGRESS.PHOTO_TAKEN, 1, ""),
        old.PhotoProgress(0, PROGRESS.PHOTO_SAVED, 1, "10000001"),
        old.PhotoState(0, old.Availability.AVAILABLE, old.State.INACTIVE),
    ]
    assert await drone.camera.take_photo() == "10000001"
    assert drone.camera[0].last_photo == "10000001"
    device.script[old.TakePhoto] = lambda _: [old.PhotoProgress(0, PROGRESS.ERROR_NO_STORAGE_SPACE, 0, "")]
    with pytest.raises(CommandRejected, match="no storage space"):
        await drone.camera.take_photo()
    # It has begun and says no more.
    device.script[old.TakePhoto] = lambda _: [old.PhotoProgress(0, PROGRESS.TAKING_PHOTO, 0, "")]
    with pytest.raises(CommandTimeout):
        await drone.camera.take_photo(timeout=0.2)


@pytest.mark.parametrize("until_saved", [True, False])
async def test_photo_that_is_reported_late_is_not_the_next_one(
    device: ScriptedDevice, drone: Drone, until_saved: bool
) -> None:
    """The drone is ready for the next photo before it reports that it has stored the one before."""
    device.script[old.TakePhoto] = lambda _: [
        old.PhotoProgress(0, PROGRESS.PHOTO_SAVED, 1, "10000001"),
        old.PhotoProgress(0, PROGRESS.ERROR_NO_STORAGE_SPACE, 0, ""),
    ]
    with pytest.raises(CommandRejected, match="no storage space"):
        await drone.camera.take_photo(until_saved=until_saved)


async def test_verbs_that_the_camera_reports_unavailable_are_rejected(drone: Drone) -> None:
    with pytest.raises(CommandRejected):
        await drone.camera.start_recording()
    with pytest.raises(CommandRejected):
        await drone.camera.stop_recording()
    with pytest.raises(CommandRejected):
        await drone.camera.stop_photo()


async def test_zoom_is_clipped_repeated_and_replaced(device: ScriptedDevice, drone: Drone) -> None:
    sent = 0

    def answer(_: old.SetZoomTarget) -> list[Message]:
        nonlocal sent
        sent += 1
        return [] if sent == 1 else [old.ZoomLevel(0, 2.0), old.ZoomLevel(0, 3.0)]

    device.script[old.SetZoomTarget] = answer
    assert await drone.camera.zoom(50.0) == 3.0
    assert [m.target for m in device.got(old.SetZoomTarget)] == [3.0, 3.0]
    device.script[old.SetZoomTarget] = lambda _: []
    waiting = asyncio.ensure_future(drone.camera.zoom(2.0))
    await asyncio.sleep(0)
    drone.camera.zoom_rate(-7.0)
    with pytest.raises(CommandRejected):
        await waiting
    assert device.got(old.SetZoomTarget)[-1] == old.SetZoomTarget(0, old.ZoomControlMode.VELOCITY, -1.0)
    drone.camera.zoom_to(0.5)
    await device.until(old.SetZoomTarget, sent + 3)
    assert device.got(old.SetZoomTarget)[-1] == old.SetZoomTarget(0, old.ZoomControlMode.LEVEL, 1.0)
    with pytest.raises(LocalProtocolError):
        drone.camera.zoom_rate(NAN)


async def test_capabilities_of_a_list_are_replaced_removed_and_emptied(device: ScriptedDevice, drone: Drone) -> None:
    """By Parrot's list flags and the number of each; an event may be received twice."""

    async def after(*events: Message) -> tuple[int, int]:
        device.say(*events[:-1])
        await device.acknowledged(events[-1])
        return len(drone.camera[0].recordings), len(drone.camera[0].photos)

    def recording(number: int, resolution: int, flags: int) -> Message:
        return old.RecordingCapabilities(number, 1, 1 << resolution, 1, old.Supported.SUPPORTED, flags)

    def photo(number: int, flags: int) -> Message:
        return old.PhotoCapabilities(number, 1, 1, 1, old.Supported.SUPPORTED, flags)

    assert await after(recording(1, 1, 2)) == (2, 1)
    assert await after(recording(1, 3, 2)) == (2, 1)
    assert drone.camera[0].recordings[1].resolutions == {Resolution.R1080P}
    assert await after(recording(1, 3, 8)) == (1, 1)
    assert await after(photo(1, 2)) == (1, 2)
    assert await after(photo(1, 2)) == (1, 2)
    assert await after(photo(1, 8)) == (1, 1)
    assert await after(recording(0, 0, 4)) == (0, 1)
    assert await after(photo(0, 4)) == (0, 0)


# -- the Ai

CONFIG = new.Config(
    camera_mode=new.CameraMode.RECORDING,
    photo_mode=new.PhotoMode.SINGLE,
    photo_resolution=new.PhotoResolution._12_MEGA_PIXELS,
    photo_time_lapse_interval=2.0,
    photo_gps_lapse_interval=7.0,
    video_recording_resolution=new.VideoResolution._2160P,
    video_recording_framerate=new.Framerate._30,
    video_recording_dynamic_range=new.DynamicRange.HDR8,
    photo_dynamic_range=new.DynamicRange.STANDARD,
    ev_compensation=new.EvCompensation._0_00,
    white_balance_mode=new.WhiteBalanceMode.AUTOMATIC,
    image_style=new.ImageStyle.STANDARD,
    image_saturation=0.5,
    zoom_max_speed=0.5,
    auto_record_mode=new.AutoRecordMode.DISABLED,
    exposure_mode=new.ExposureMode.AUTOMATIC,
)
STATE = new.State(
    camera_id=3,
    active=True,
    default_capabilities=new.Capabilities(
        rules=(
            new.CapabilitiesRule(
                index=0,
                camera_modes=(new.CameraMode.PHOTO,),
                photo_modes=(new.PhotoMode.SINGLE,),
                zoom_max_speed_range=new.DoubleRange(min=0.1, max=1.0),
                image_saturation_range=new.DoubleRange(min=-2.0, max=2.0),
            ),
            new.CapabilitiesRule(
                index=1,
                camera_modes=(new.CameraMode.RECORDING,),
                video_recording_modes=(new.VideoRecordingMode.STANDARD,),
                video_recording_framerates=(new.Framerate._30, new.Framerate._24),
                ev_compensations=(new.EvCompensation._0_33, new.EvCompensation._0_00),
            ),
        )
    ),
    config=CONFIG,
    photo=new.StatePhoto(state=new.PhotoState.UNAVAILABLE),
    recording=new.StateRecording(state=new.RecordingState.INACTIVE),
    zoom=new.StateZoom(zoom_level_max=6.0, zoom_high_quality_level_max=2.0),
)


@pytest.fixture
async def ai() -> AsyncIterator[ScriptedDevice]:
    async with ScriptedDevice(0x091A) as device:
        device.script[new.ListCameras] = lambda _: [new.CameraList(cameras={3: new.CameraModel.MAIN})]
        device.script[new.GetState] = lambda _: [STATE]
        device.script[mains.GetState] = lambda _: [mains.State(automatic=mains.Frequency._50_HZ)]
        yield device


@pytest.fixture
async def ai_drone(ai: ScriptedDevice) -> AsyncIterator[Drone]:
    async with ai.connected() as drone:
        yield drone


async def test_the_cameras_of_an_ai_are_asked_for(ai: ScriptedDevice, ai_drone: Drone) -> None:
    assert ai.got(new.GetState) == [new.GetState(camera_id=3, include_default_capabilities=True)]
    now = ai_drone.camera[3]
    assert (now.kind, now.mode) == (CameraKind.MAIN, CameraMode.RECORDING)
    assert now.modes == frozenset(CameraMode)
    assert now.zoom_speed_range == Range(0.5, 0.1, 1.0)
    assert (now.zoom_max, now.ev, now.hdr) == (6.0, 0.0, True)
    assert now.evs == pytest.approx((0.0, 1 / 3))
    assert now.photo is not None
    assert (now.photo.megapixels, now.photo.interval) == (12.0, 2.0)
    assert now.recording is not None
    assert (now.recording.resolution, now.recording.framerate) == (Resolution.UHD_4K, 30.0)
    assert now.recordings[0].framerates == (24.0, 30.0)
    assert now.style is not None
    assert now.style.saturation == Range(0.5, -2.0, 2.0)
    assert (now.photo_available, now.recording_now) == (False, False)
    assert ai_drone.camera.state.antiflicker == Antiflicker.AUTO
    assert ai_drone.camera.state.active == frozenset({3})


async def test_number_that_no_message_can_carry_is_unknown(ai: ScriptedDevice, ai_drone: Drone) -> None:
    heard = asyncio.ensure_future(ai_drone.expect(new.State))
    await asyncio.sleep(0)
    ai.say(
        new.State(
            camera_id=3,
            config=new.Config(photo_mode=new.PhotoMode.TIME_LAPSE, photo_time_lapse_interval=1e39),
            zoom=new.StateZoom(zoom_level_max=sys.float_info.max),
        )
    )
    await heard
    now = ai_drone.camera[3]
    assert now.photo is not None
    assert (now.photo.mode, now.photo.interval) == (PhotoMode.TIME_LAPSE, 2.0)  # as before
    assert now.zoom_max is None


async def test_an_ai_that_does_not_answer_connects_all_the_same(ai: ScriptedDevice) -> None:
    ai.script[new.GetState] = lambda _: []
    drone = ai.drone()
    await drone.connect()
    assert drone.camera[3].mode is None
    with pytest.raises(NotSupported):
        await drone.camera.set_mode(CameraMode.PHOTO, id=3)
    await drone.close()


async def test_a_setting_of_an_ai_is_one_selected_field(ai: ScriptedDevice, ai_drone: Drone) -> None:
    ai.script[new.Configure] = lambda m: [
        new.State(camera_id=3, photo=new.StatePhoto(state=new.PhotoState.INACTIVE)),  # about something else
        new.State(camera_id=3, config=m.config),
    ]
    camera = ai_drone.camera
    assert await camera.set_ev(1.0, id=3) == 1.0
    assert ai.got(new.Configure)[-1].config == new.Config(ev_compensation=new.EvCompensation._1_00)
    assert await camera.set_mode(CameraMode.PHOTO, id=3) is CameraMode.PHOTO
    assert ai.got(new.Configure)[-1].config == new.Config(camera_mode=new.CameraMode.PHOTO)
    # What was not in the answer stays known.
    assert camera[3].zoom_speed == 0.5
    photo = await camera.set_photo(PhotoSettings(mode=PhotoMode.GPS_LAPSE, interval=5.0), id=3)
    assert ai.got(new.Configure)[-1].config == new.Config(
        photo_mode=new.PhotoMode.GPS_LAPSE, photo_gps_lapse_interval=5.0
    )
    assert photo is not None
    assert (photo.mode, photo.interval, photo.megapixels) == (PhotoMode.GPS_LAPSE, 5.0, 12.0)
    exposure = await camera.set_exposure(ExposureSettings(mode=ExposureMode.MANUAL, shutter_s=0.01, iso=51.0), id=3)
    assert exposure == ExposureSettings(ExposureMode.MANUAL, 0.01, 50.0)
    signed = await camera.set_photo(PhotoSettings(signed=True, keeps_live_video=False), id=3)
    assert ai.got(new.Configure)[-1].config == new.Config(
        photo_signature=new.DigitalSignature.DRONE, photo_streaming_mode=new.PhotoStreamingMode.INTERRUPT
    )
    assert signed is not None
    assert (signed.signed, signed.keeps_live_video) == (True, False)
    recording = await camera.set_recording(RecordingSettings(codec=VideoCodec.H265), id=3)
    assert ai.got(new.Configure)[-1].config == new.Config(video_recording_codec=new.VideoCodec.H265)
    assert recording is not None
    assert recording.codec is VideoCodec.H265
    assert await camera.set_white_balance(WhiteBalance.CUSTOM, 5100.0, id=3) == (WhiteBalance.CUSTOM, 5000.0)
    assert await camera.set_style(Style.PASTEL, id=3) is Style.PASTEL
    assert await camera.set_zoom_speed(0.2, id=3) == 0.2
    assert await camera.set_autorecord(True, id=3) is True
    assert await camera.set_hdr(False, id=3) is False
    with pytest.raises(NotSupported):
        await camera.set_streaming(Streaming.LOW_LATENCY, id=3)
    with pytest.raises(NotSupported):
        await camera.set_recording(RecordingSettings(hyperlapse=15), id=3)
    with pytest.raises(LocalProtocolError):
        await camera.set_recording(RecordingSettings(), id=3)


async def test_report_of_another_setting_of_an_ai_is_not_the_answer_to_a_change(
    ai: ScriptedDevice, ai_drone: Drone
) -> None:
    other = new.State(camera_id=3, config=new.Config(ev_compensation=new.EvCompensation._1_00))
    ai.script[new.Configure] = lambda m: [other, new.State(camera_id=3, config=m.config)]
    assert await ai_drone.camera.set_mode(CameraMode.PHOTO, id=3) is CameraMode.PHOTO
    assert await ai_drone.camera.set_hdr(False, id=3) is False
    assert await ai_drone.camera.set_ev(-1.0, id=3) == -1.0
    for kelvin in (4000.0, 5000.0):
        assert await ai_drone.camera.set_white_balance(WhiteBalance.CUSTOM, kelvin, id=3) == (
            WhiteBalance.CUSTOM,
            kelvin,
        )


async def test_photo_and_film_of_an_ai(ai: ScriptedDevice, ai_drone: Drone) -> None:
    with pytest.raises(CommandRejected):
        await ai_drone.camera.take_photo(id=3)
    heard = asyncio.ensure_future(ai_drone.expect(new.State))
    await asyncio.sleep(0)
    ai.say(new.State(camera_id=3, photo=new.StatePhoto(state=new.PhotoState.INACTIVE)))
    await heard
    ai.script[new.StartPhoto] = lambda _: [
        new.Photo(camera_id=3, type=new.PhotoEvent.START),
        new.Photo(camera_id=3, type=new.PhotoEvent.STOP, media_id="42", stop_reason=new.PhotoStopReason.CAPTURE_DONE),
    ]
    assert await ai_drone.camera.take_photo(id=3) == "42"
    ai.script[new.StartPhoto] = lambda _: [
        new.Photo(camera_id=3, type=new.PhotoEvent.STOP, stop_reason=new.PhotoStopReason.STORAGE_UNAVAILABLE)
    ]
    with pytest.raises(CommandRejected, match="storage unavailable"):
        await ai_drone.camera.take_photo(id=3)
    ai.script[new.StartRecording] = lambda _: [
        new.Recording(camera_id=3, type=new.RecordingEvent.START),
        new.State(camera_id=3, recording=new.StateRecording(state=new.RecordingState.ACTIVE, duration=0)),
    ]
    await ai_drone.camera.start_recording(id=3)
    if not ai_drone.camera[3].recording_now:
        await ai_drone.expect(new.State)
    ai.script[new.StopRecording] = lambda _: [
        new.Recording(camera_id=3, type=new.RecordingEvent.STOP, media_id="43"),
    ]
    assert await ai_drone.camera.stop_recording(id=3) == "43"
    ai.script[new.StopRecording] = lambda _: [
        new.Recording(camera_id=3, type=new.RecordingEvent.STOP, media_id=media) for media in ("43", "44")
    ]
    assert await ai_drone.camera.stop_recording(id=3) == "44"  # the end of the recording before is reported again


async def test_zoom_of_an_ai(ai: ScriptedDevice, ai_drone: Drone) -> None:
    ai.script[new.SetZoomTarget] = lambda m: [new.ZoomLevel(camera_id=3, level=m.target, hfov=20.0)]
    assert await ai_drone.camera.zoom(4.0, id=3) == 4.0
    assert ai_drone.camera[3].hfov_deg == 20.0
    ai.script[new.SetZoomTarget] = lambda m: [new.ZoomLevel(camera_id=3, level=m.target, hfov=70000.0)]
    await ai_drone.camera.zoom(2.0, id=3)
    assert ai_drone.camera[3].hfov_deg is None  # of no lens
    ai.script[new.ResetZoom] = lambda _: [new.ZoomLevel(camera_id=3, level=1.0)]
    assert await ai_drone.camera.reset_zoom(id=3) == 1.0
    ai.script[mains.SetMode] = lambda _: [mains.State(fixed=mains.Frequency._60_HZ)]
    assert await ai_drone.camera.set_antiflicker(Antiflicker.HZ_60) is Antiflicker.HZ_60


# -- the simulator


@pytest.mark.parametrize("model", ["4k", "thermal", "usa"])
async def test_in_the_simulator(model: str) -> None:
    async with connected(model) as (drone, _):
        camera = drone.camera
        assert set(camera.state.cameras) == ({0} if model == "4k" else {0, 1, 2})
        assert camera.state.active == frozenset({0})
        assert await camera.set_mode(CameraMode.PHOTO) is CameraMode.PHOTO
        await camera.set_photo(PhotoSettings(mode=PhotoMode.SINGLE, file=PhotoFile.DNG_JPEG))
        media = await camera.take_photo()
        assert media
        await camera.set_photo(PhotoSettings(mode=PhotoMode.TIME_LAPSE, interval=2.0))
        assert await camera.take_photo() is None
        assert camera[0].taking
        await drone.expect(old.PhotoProgress, lambda m: m.result == PROGRESS.PHOTO_TAKEN and m.photo_count > 1)
        assert await camera.stop_photo() not in ("", media)
        assert await camera.set_mode(CameraMode.RECORDING) is CameraMode.RECORDING
        recording = await camera.set_recording(RecordingSettings(resolution=Resolution.UHD_4K, framerate=25.0))
        assert recording is not None
        assert (recording.resolution, recording.framerate) == (Resolution.UHD_4K, 25.0)
        await camera.start_recording()
        await camera.start_recording()
        film = await camera.stop_recording()
        assert film not in ("", media)
        assert camera[0].last_recording == film
        speed = await camera.set_zoom_speed(10.0)
        assert speed == 10.0
        assert await camera.zoom(2.0) == pytest.approx(2.0, rel=0.01)
        camera.zoom_rate(-0.1)
        assert 1.0 <= await camera.stop_zoom() < 2.01
        assert await camera.reset_zoom() == pytest.approx(1.0, rel=0.01)
        assert await camera.set_ev(-1.0) == -1.0
        exposure = await camera.set_exposure(ExposureSettings(mode=ExposureMode.AUTOMATIC_PREFER_SHUTTER))
        assert exposure is not None
        assert exposure.mode is ExposureMode.AUTOMATIC_PREFER_SHUTTER
        assert await camera.set_white_balance(WhiteBalance.CUSTOM, 4500.0) == (WhiteBalance.CUSTOM, 4500.0)
        assert await camera.set_hdr(True) is True
        assert await camera.set_style(Style.STANDARD) is Style.STANDARD
        assert await camera.set_streaming(Streaming.HIGH_RELIABILITY) is Streaming.HIGH_RELIABILITY
        assert await camera.set_autorecord(True) is True
        assert await camera.set_antiflicker(Antiflicker.HZ_50) is Antiflicker.HZ_50
        assert await camera.set_zoom_may_degrade(True) is True


async def test_timeout_of_nan_raises_before_the_camera_or_gimbal_begins() -> None:
    """Found at the first report, it cancelled the task of the caller, and the photo was taken."""
    async with connected("4k") as (drone, real):
        await drone.camera.set_mode(CameraMode.PHOTO)
        before = list(real.log.find("command"))
        for call in drone.camera.take_photo(timeout=NAN), drone.gimbal.calibrate(timeout=NAN):
            with pytest.raises(LocalProtocolError, match="timeout"):
                await call
        assert list(real.log.find("command")) == before


async def test_photo_returns_its_own_media_although_that_of_the_one_before_is_reported_late() -> None:
    """The state of the second is reported before the first is reported as stored."""
    async with connected("4k", speed=1.0) as (drone, simulator):
        await drone.camera.set_mode(CameraMode.PHOTO)
        taken = drone.expect(old.PhotoProgress, lambda m: m.result == old.PhotoResult.PHOTO_TAKEN, 5.0)
        await asyncio.gather(drone.camera.take_photo(until_saved=False), taken)
        simulator.faults.late = {old.PhotoProgress.NAME: 0.7}
        await simulator.wait_log(lambda e: not simulator.firmware.payload.cameras.busy, 5.0)
        media_id = await drone.camera.take_photo()
        stored = [media.id for media in simulator.firmware.payload.media]
        assert (len(stored), media_id) == (2, stored[-1])
