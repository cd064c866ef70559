"""What the simulated cameras show and say of it: pictures that a decoder reads, and metadata by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav.arsdk.messages import animation, ardrone3, camera, controller_info, follow_me, gimbal, rth
from anafi_mav.arsdk.messages.camera import ExposureMode, IsoSensitivity, ShutterSpeed, WhiteBalanceMode
from anafi_mav.arsdk.messages.proto import camera2
from anafi_mav.arsdk.video.sdp import (
    CAMERA_TYPE,
    DEFAULT_MEDIA,
    MODEL_ID,
    PICTURE_FOV,
    format_description,
    parse_description,
)
from anafi_mav.arsdk.video.video_metadata import (
    PROTO_PROFILE,
    V3_PROFILE,
    FlyingState,
    FrameMetadata,
    PilotingMode,
    Quaternion,
    WifiLink,
    decode_v3,
    encode_v3,
)
from anafi_mav.sim.payload import optics
from anafi_mav.sim.video import video
from anafi_mav.sim.video.h264 import encoder
from anafi_mav.sim.video.video import streams_of
from anafi_mav.sim.world.model import MODELS


def say(bench: Bench, stream: int = 0) -> FrameMetadata:
    return video.metadata(bench.firmware, streams_of(bench.firmware.model)[stream])


# -- the metadata


def test_a_drone_on_the_ground() -> None:
    bench = Bench()
    said = say(bench)
    assert said.drone_quat == Quaternion(1.0, 0.0, 0.0, 0.0)
    assert said.location is not None
    assert (said.location.latitude, said.location.longitude, said.location.altitude_amsl) == HOME
    assert said.location.satellites == 14
    assert (said.ground_distance, said.altitude_ato) == (0.0, 0.0)
    assert (said.battery_percentage, said.flying_state, said.piloting_mode) == (
        100, FlyingState.LANDED, PilotingMode.MANUAL,
    )  # fmt: skip
    assert said.timestamp == round(bench.firmware.time * 1e6)
    assert (said.exposure_time, said.iso_gain) == (pytest.approx(16.667, abs=1e-3), 100)
    assert (said.awb_r_gain, said.awb_b_gain) == (1.60, 2.05)
    # 69 degrees across 16:9: 2 atan(tan 34.5 * 9/16) = 42.27 degrees.
    assert said.hfov == pytest.approx(math.radians(69.0))
    assert said.vfov == pytest.approx(math.radians(42.27), abs=1e-4)
    assert said.wifi == WifiLink(goodput=20_000, quality=5, rssi=-40)
    assert said.starfish is said.position is None


def test_a_flight_is_said_as_it_is_flown() -> None:
    bench = Bench()
    bench.take_off()
    bench.climb(10.0)
    bench.send(ardrone3.MoveBy(0.0, 0.0, 0.0, math.pi / 2.0))
    bench.run_until(lambda: bool(bench.of(ardrone3.MoveByEnd)))
    # Facing east, the stick forward: east and nose down.
    bench.send(ardrone3.MaxTilt(20.0))
    bench.sticks(1.5, pitch=100)
    said = say(bench)
    assert said.flying_state is FlyingState.FLYING
    assert said.ground_distance == said.altitude_ato == pytest.approx(10.0, abs=0.3)
    assert said.location is not None
    assert said.location.altitude_amsl == pytest.approx(HOME[2] + 10.0, abs=0.3)
    assert said.location.longitude > HOME[1] + 1e-5
    assert said.speed is not None
    assert said.speed.east > 3.0
    assert abs(said.speed.north) < 0.3
    # Yaw 90 degrees and pitch -20: w = cos 45 cos 10, x = -sin 45 sin(-10), y = cos 45 sin(-10), z = sin 45 cos 10.
    expected = (0.6964, 0.1228, -0.1228, 0.6964)
    assert said.drone_quat == pytest.approx(expected, abs=0.01)
    # The gimbal keeps the picture level, and the picture looks east.
    assert said.quat == pytest.approx((math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), abs=0.01)
    assert said.base_quat == pytest.approx(said.quat, abs=1e-6)
    encode_v3(said)


def test_the_picture_tilts_with_the_gimbal() -> None:
    bench = Bench()
    none, absolute = gimbal.FrameOfReference.NONE, gimbal.FrameOfReference.ABSOLUTE
    bench.send(gimbal.SetTarget(0, gimbal.ControlMode.POSITION, none, 0.0, absolute, -90.0, none, 0.0))
    bench.run(3.0)
    said = say(bench)
    # Straight down: pitch -90, w = cos 45, y = -sin 45.
    assert said.quat == pytest.approx((math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0), abs=1e-6)
    assert said.base_quat == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-6)


def test_metadata_names_the_piloting_mode() -> None:
    bench = Bench()
    bench.take_off()
    bench.climb(20.0)
    latitude, longitude, _ = HOME
    bench.send(ardrone3.MoveTo(latitude + 0.001, longitude, 20.0, ardrone3.OrientationMode.NONE, 0.0))
    bench.run(3.0)
    assert say(bench).piloting_mode is PilotingMode.MOVE_TO
    bench.send(ardrone3.NavigateHome(1))
    bench.run_until(lambda: rth.RthState.IN_PROGRESS in [event.state for event in bench.of(rth.State)])
    assert say(bench).piloting_mode is PilotingMode.RETURN_HOME
    bench.send(ardrone3.NavigateHome(0))
    bench.run(1.0)
    assert say(bench).piloting_mode is PilotingMode.MANUAL


def test_metadata_reports_animations_and_tracking() -> None:
    bench = Bench()
    bench.take_off()
    bench.climb(10.0)
    assert not say(bench).animation_in_progress
    bench.send(animation.StartHorizontalPanorama(0, 0.0, 0.0))
    assert say(bench).animation_in_progress
    bench.send(animation.Cancel())
    bench.send(follow_me.SetTargetIsController(1))
    for _ in range(3):
        bench.send(controller_info.Gps(HOME[0], HOME[1] + 0.0001, HOME[2], 3.0, 3.0, 0.0, 0.0, 0.0, 0.0))
        bench.run(0.2)
    bench.send(follow_me.Start(follow_me.Mode.LOOK_AT))
    assert say(bench).piloting_mode is PilotingMode.TRACKING


def test_without_a_fix_the_place_is_unknown() -> None:
    bench = Bench()
    bench.faults.gps = False
    bench.run(0.2)
    said = say(bench)
    assert said.location is None
    assert encode_v3(said)[4:12] == bytes.fromhex("7d000000 7d000000")


def test_the_settings_of_the_camera_are_what_its_pictures_say() -> None:
    bench = Bench("thermal")
    manual = camera.SetExposureSettings(
        0,
        ExposureMode.MANUAL,
        ShutterSpeed.SHUTTER_1_OVER_1_5,
        IsoSensitivity.ISO_800,
        IsoSensitivity.ISO_3200,
        camera.AutoExposureMeteringMode.STANDARD,
    )
    bench.send(manual)
    custom = camera.WhiteBalanceTemperature.T_10000
    bench.send(camera.SetWhiteBalance(0, WhiteBalanceMode.CUSTOM, custom))
    bench.send(camera.SetZoomTarget(0, camera.ZoomControlMode.LEVEL, 3.0))
    said, blended = say(bench), say(bench, 2)
    # 667 ms are more than version 3 can say.
    assert (said.exposure_time, said.iso_gain) == (None, 800)
    assert said.awb_r_gain == pytest.approx(1.60 * math.sqrt(2.0))
    assert said.awb_b_gain == pytest.approx(2.05 / math.sqrt(2.0))
    # tan 34.5 / 3 = 0.22910: 2 * 12.904 degrees.
    assert said.hfov == pytest.approx(math.radians(25.808), abs=1e-4)
    assert said.zoom_level == 3.0
    assert (blended.exposure_time, blended.iso_gain) == (pytest.approx(16.667, abs=1e-3), 100)
    assert blended.hfov == pytest.approx(math.radians(57.0))


@pytest.mark.parametrize("shutter", ShutterSpeed)
@pytest.mark.parametrize("kelvin", [camera.WhiteBalanceTemperature.T_1500, camera.WhiteBalanceTemperature.T_15000])
def test_whatever_is_set_fits_into_version_3(shutter: ShutterSpeed, kelvin: camera.WhiteBalanceTemperature) -> None:
    bench = Bench("usa")
    isos, metering = IsoSensitivity.ISO_3200, camera.AutoExposureMeteringMode.STANDARD
    bench.send(camera.SetExposureSettings(0, ExposureMode.MANUAL, shutter, isos, isos, metering))
    bench.send(camera.SetWhiteBalance(0, WhiteBalanceMode.CUSTOM, kelvin))
    bench.send(camera.SetZoomTarget(0, camera.ZoomControlMode.LEVEL, 32.0))
    said = say(bench)
    back = decode_v3(encode_v3(said))
    assert back is not None
    assert back.exposure_time == pytest.approx(said.exposure_time, abs=2**-8)
    assert (back.awb_r_gain, back.awb_b_gain) == pytest.approx((said.awb_r_gain, said.awb_b_gain), abs=2**-14)
    assert back.iso_gain == 3200
    # tan 34.5 / 32: 2.46 degrees.
    assert back.hfov == pytest.approx(math.radians(2.46), abs=1e-3)


def test_an_ai_says_more() -> None:
    bench = Bench("ai")
    config = camera2.Config(
        exposure_mode=camera2.ExposureMode.MANUAL_SHUTTER_SPEED,
        exposure_manual_shutter_speed=camera2.ShutterSpeed._1_OVER_30,
        exposure_manual_iso_sensitivity=camera2.IsoSensitivity._800,
        white_balance_mode=camera2.WhiteBalanceMode.CUSTOM,
        white_balance_temperature=camera2.WhiteBalanceTemperature._5000,
    )
    bench.send(camera2.Configure(config=config))
    bench.send(camera2.SetZoomTarget(control_mode=camera2.ZoomControlMode.LEVEL, target=2.0))
    said, disparity = say(bench), say(bench, 1)
    assert (said.exposure_time, said.iso_gain) == (pytest.approx(33.333, abs=1e-3), 100)
    assert (said.awb_r_gain, said.awb_b_gain) == (1.60, 2.05)
    assert said.zoom_level == 2.0
    assert said.hfov == pytest.approx(2.0 * math.atan(math.tan(math.radians(34.0)) / 2.0))
    assert said.wifi is None
    assert said.starfish is not None
    assert [(link.quality, link.active) for link in said.starfish.links] == [(5, True), (0, False)]
    assert (said.position, said.local_position) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert disparity.exposure_time is disparity.iso_gain is disparity.zoom_level is None
    assert disparity.hfov == pytest.approx(math.radians(110.0))


def test_every_step_has_a_number() -> None:
    for shutters in (ShutterSpeed, camera2.ShutterSpeed):
        seconds = [optics.seconds(shutter) for shutter in shutters]
        assert (seconds[0], seconds[-1]) == (1e-4, 1.0)
        assert seconds == sorted(seconds)
    for isos in (IsoSensitivity, camera2.IsoSensitivity):
        numbers = [optics.sensitivity(iso) for iso in isos]
        assert numbers[0] == (50 if isos is IsoSensitivity else 25)
        assert numbers == sorted(numbers)
    temperature: Any
    for modes, temperature in (
        (WhiteBalanceMode, camera.WhiteBalanceTemperature.T_5000),
        (camera2.WhiteBalanceMode, camera2.WhiteBalanceTemperature._5000),
    ):
        for mode in modes:
            red, blue = optics.white_balance(mode, temperature)
            assert 0.5 < red < 3.0
            assert 0.5 < blue < 4.0


# -- the description


@pytest.mark.parametrize("model", MODELS)
def test_streams_have_the_names_that_olympe_asks_for(model: str) -> None:
    bench = Bench(model)
    text = format_description(
        video.describe(bench.firmware, "127.0.0.1", "rtsp://127.0.0.1/live", "live", streams_of(bench.firmware.model))
    )
    described = parse_description(text)
    assert described is not None
    thermal = ["DefaultVideo", "ParrotThermalVideo", "ParrotThermalBlendedVideo"]
    names = {"4k": thermal[:1], "thermal": thermal, "usa": thermal, "ai": ["Front camera", "Disparity map"]}
    assert [media.title for media in described.media] == names[model]
    assert [media.attribute(DEFAULT_MEDIA) for media in described.media] == ["1", *[None] * (len(names[model]) - 1)]
    assert described.media[0].attribute(CAMERA_TYPE) == "front"
    assert described.media[0].attribute(PICTURE_FOV) == ("68.00,41.55" if model == "ai" else "69.00,42.27")
    assert described.attribute(MODEL_ID) == f"{MODELS[model].product_id:04x}"
    assert described.info == bench.firmware.identity.name
    assert [video.profile(MODELS[model])] == [PROTO_PROFILE if model == "ai" else V3_PROFILE]
    for media, stream in zip(described.media, streams_of(bench.firmware.model), strict=True):
        assert media.sps == encoder(stream.width, stream.height).sps
