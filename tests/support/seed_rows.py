"""Every row of the appendix of the anafi_ros paper, and what reads or drives it here, model by model.

`docs/generate.py` makes docs/seed.md of this table and `test_drone_seed_rows.py` runs it. A row without `drive` says
why. The paper's own mistakes (units, swapped texts) are not repeated: what a row means is what the drone does.
"""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path

from anafi_mav.arsdk.messages import common, gimbal
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.piloting_style import PilotingStyleStyle
from anafi_mav.arsdk.messages.rth import RthEndingBehavior, RthHomeType
from anafi_mav.arsdk.messages.thermal import RenderingMode
from anafi_mav.arsdk.messages.user_storage import FormattingType
from anafi_mav.arsdk.video.rtp_h264 import Picture
from anafi_mav.drone import Drone, PilotingCommand
from anafi_mav.drone.payload.camera_enums import CameraMode, PhotoMode, Streaming, Style
from anafi_mav.drone.payload.camera_state import PhotoSettings
from anafi_mav.drone.payload.gimbal import Aim
from anafi_mav.drone.video.video import VideoFrame
from support.simulated import Pair, take_off

MODELS = ("4k", "thermal", "usa", "ai")
OLDER = ("4k", "thermal", "usa")
THERMAL = ("thermal", "usa")

CONTROLLER = "through a Skycontroller only: tests/unit/drone/controller/test_controller.py"
LOCAL = "a setting of the computer: an argument of `media.download`; in the gateway `media: {download_folder}`"

Drive = Callable[[Pair], Awaitable[object]]
"""Reads or drives the row; raises when it does not work. The result must be neither None nor False."""


@dataclass(frozen=True)
class Row:
    kind: str
    """"subscribed topic", "published topic", "service" or "parameter"."""
    name: str
    how: str
    """What of `Drone` it is; or why it is not reachable."""
    drive: Drive | None = None
    models: tuple[str, ...] = MODELS
    """Those that have it; on the others the verb raises `NotSupported`."""


def _of(path: str) -> Callable[[Drone], object]:
    """The value at a dotted path below the drone."""

    def read(drone: Drone) -> object:
        value: object = drone
        for part in path.split("."):
            name, _, index = part.partition("[")
            value = getattr(value, name)
            if index:
                value = value[int(index.rstrip("]"))]  # type: ignore[index]
        return value

    return read


def _reads(path: str, first: Callable[[Pair], Awaitable[object]] | None = None) -> Drive:
    """Wait until the state has this value: telemetry comes within a second."""

    async def drive(pair: Pair) -> object:
        if first is not None:
            await first(pair)
        read = _of(path)
        came = asyncio.Event()
        undo = pair.drone.subscribe(lambda message, now: came.set() if read(pair.drone) is not None else None)
        try:
            if read(pair.drone) is None:
                await asyncio.wait_for(came.wait(), 5.0)
        finally:
            undo()
        value = read(pair.drone)
        return True if value is False else value  # a state that says no has been read all the same

    return drive


async def _up(pair: Pair) -> None:
    await take_off(pair.drone)


def _done(verb: Callable[[Drone], Awaitable[object]]) -> Drive:
    """Run a verb that returns nothing."""

    async def drive(pair: Pair) -> object:
        await verb(pair.drone)
        return True

    return drive


def _confirms(verb: Callable[[Drone], Awaitable[object]], expected: object) -> Drive:
    """Run a verb that returns what the drone confirmed."""

    async def drive(pair: Pair) -> object:
        got = await verb(pair.drone)
        assert got == expected, f"expected {expected}, the drone confirmed {got}"
        return True

    return drive


def _flying(verb: Callable[[Drone], Awaitable[object]]) -> Drive:
    """Run a verb in the air."""

    async def drive(pair: Pair) -> object:
        await _up(pair)
        await verb(pair.drone)
        return True

    return drive


# -- what takes more than one line


async def _zoom(pair: Pair) -> object:
    await pair.drone.camera.set_zoom_speed(10.0)
    level = await pair.drone.camera.zoom(2.0)
    pair.drone.camera.zoom_rate(-0.5)
    return await pair.drone.camera.stop_zoom() <= level


async def _sticks(pair: Pair) -> object:
    await _up(pair)
    pair.drone.piloting.pilot(PilotingCommand(roll_deg=5.0, pitch_deg=-5.0, yaw_rate_dps=20.0, climb_mps=0.5))
    await pair.real.wait_log(lambda e: e.name == "ardrone3.Piloting.PCMD" and e.args["roll"] == 50)
    pair.drone.piloting.hover()
    return True


async def _move_to(pair: Pair) -> object:
    await _up(pair)
    latitude, longitude = pair.real.firmware.place()
    move = await pair.drone.piloting.move_to(latitude + 1e-5, longitude, 2.0, heading_deg=0.0)
    return await move.result()


async def _turn_gimbal(pair: Pair) -> object:
    there = await pair.drone.gimbal.point(pitch=Aim(-10.0))
    pair.drone.gimbal.turn(pitch=Aim(20.0))
    await pair.drone.expect(gimbal.Attitude, lambda m: m.gimbal_id == 0 and m.pitch_absolute > -5.0)
    await pair.drone.gimbal.stop()
    return there


async def _photo(pair: Pair) -> object:
    await pair.drone.camera.set_mode(CameraMode.PHOTO)
    await pair.drone.camera.set_photo(PhotoSettings(mode=PhotoMode.SINGLE))
    return await pair.drone.camera.take_photo()


async def _series(pair: Pair) -> object:
    await pair.drone.camera.set_mode(CameraMode.PHOTO)
    await pair.drone.camera.set_photo(PhotoSettings(mode=PhotoMode.TIME_LAPSE, interval=2.0))
    assert await pair.drone.camera.take_photo() is None
    await pair.drone.camera.stop_photo()
    return True


async def _record(pair: Pair) -> object:
    await pair.drone.camera.set_mode(CameraMode.RECORDING)
    await pair.drone.camera.start_recording()
    return True


async def _film(pair: Pair) -> object:
    await _record(pair)
    return await pair.drone.camera.stop_recording()


async def _arm(pair: Pair) -> object:
    await pair.drone.piloting.hand_launch()
    await pair.drone.piloting.cancel_hand_launch()
    return True


async def _calibrate(pair: Pair) -> object:
    await pair.drone.calibration.start_magnetometer()
    await pair.drone.calibration.magnetometer_done()
    return True


async def _reboot(pair: Pair) -> object:
    await pair.drone.reboot()
    return not pair.real.powered


async def _return(pair: Pair) -> object:
    await _up(pair)
    await pair.drone.piloting.return_home()
    await pair.drone.piloting.cancel_return_home()
    return True


PLAN = """QGC WPL 120
0\t0\t3\t22\t0.0\t0.0\t0.0\t0.0\t48.878900\t2.367700\t3.0\t1
1\t0\t{frame}\t93\t60.0\t{unused}\t{unused}\t{unused}\t{place}\t{place}\t{place}\t1
"""


async def _upload(pair: Pair) -> str:
    if pair.drone.flight_plan.version == 1:
        plan = PLAN.format(frame=3, unused="0.0", place="0.0")
    else:
        plan = PLAN.format(frame=2, unused="-1", place="nan")
    return await pair.drone.flight_plan.upload(plan.encode())


async def _play(pair: Pair) -> object:
    await pair.drone.flight_plan.start(await _upload(pair))
    return True


async def _pause(pair: Pair) -> object:
    await _play(pair)
    await pair.drone.expect(common.MissionItemExecuted, timeout=20.0)
    await pair.drone.flight_plan.pause()
    return True


async def _stop_plan(pair: Pair) -> object:
    await _play(pair)
    await pair.drone.expect(common.MissionItemExecuted, timeout=20.0)
    await pair.drone.flight_plan.stop()
    return True


async def _set_home(pair: Pair) -> object:
    latitude, longitude = pair.real.firmware.place()
    await pair.drone.home.set_preferred_type(RthHomeType.CUSTOM)
    return await pair.drone.home.set_custom_location(latitude + 1e-5, longitude, 0.0)


async def _download(pair: Pair) -> object:
    media = await _photo(pair)
    assert isinstance(media, str)
    with tempfile.TemporaryDirectory() as directory:
        files = await pair.drone.media.download_media(media, Path(directory))
    await pair.drone.media.delete(media)
    return files


async def _free(pair: Pair) -> object:
    return await pair.drone.storage.start_monitoring(1)


async def _emergency(pair: Pair) -> object:
    await _up(pair)
    await pair.drone.piloting.emergency()
    return pair.drone.piloting.state.flying in (FlyingState.EMERGENCY, FlyingState.LANDED)


async def _picture(pair: Pair) -> object:
    pictures: list[Picture] = []
    undo = pair.drone.video.subscribe_pictures(pictures.append)
    async with pair.drone.video.watching():
        undo()
    return any(picture.is_key for picture in pictures)


async def _camera_info(pair: Pair) -> object:
    async with pair.drone.video.watching():
        shown = pair.drone.video.state.shown
        return shown is not None and None not in (shown.fov_deg, shown.principal_point, shown.distortion)


async def _frame(pair: Pair) -> VideoFrame:
    async with pair.drone.video.watching():
        return await pair.drone.video.next_frame(10.0)


def _said(name: str, field: str, note: str = "") -> Row:
    """What is reported with the pictures only."""

    async def drive(pair: Pair) -> object:
        return getattr((await _frame(pair)).metadata, field)

    return Row("published topic", name, f"`video.state.frame.metadata.{field}`{note}", drive)


def _both(name: str, path: str, read: Callable[[VideoFrame], object], where: str) -> Row:
    """What comes as an event, and with every picture while the video runs."""

    async def drive(pair: Pair) -> object:
        assert read(await _frame(pair)) is not None
        return await _reads(path)(pair)

    return Row("published topic", name, f"`{path}`; with the video `{where}`", drive)


def _reading(name: str, path: str, first: Callable[[Pair], Awaitable[object]] | None = None) -> Row:
    return Row("published topic", name, f"`{path}`", _reads(path, first))


ROWS: tuple[Row, ...] = (
    # -- commands
    Row("subscribed topic", "camera/command", "`camera.zoom`, `zoom_rate`, `stop_zoom`", _zoom),
    Row("subscribed topic", "drone/command", "`piloting.pilot`", _sticks),
    Row(
        "subscribed topic",
        "drone/moveby",
        "`piloting.move_by`",
        _flying(lambda drone: drone.piloting.move_by(1.0, 0.0, 0.0, 0.0)),
    ),
    Row("subscribed topic", "drone/moveto", "`piloting.move_to`", _move_to),
    Row("subscribed topic", "gimbal/command", "`gimbal.point`, `aim`, `turn`, `stop`", _turn_gimbal),
    # -- states
    _reading("battery/health", "battery.state.health_percent"),
    _reading("battery/percentage", "battery.state.percent"),
    _reading("battery/voltage", "battery.state.voltage_mv"),
    _said("camera/awb_b_gain", "awb_b_gain"),
    _said("camera/awb_r_gain", "awb_r_gain"),
    Row("published topic", "camera/camera_info", "`video.state.shown`", _camera_info),
    _said(
        "camera/exposure_time", "exposure_time", ", ms; without the video `camera[0].shutter_s` has the nearest step"
    ),
    Row("published topic", "camera/image", "`video.subscribe_pictures`, not decoded", _picture),
    _said("camera/hfov", "hfov", ", rad"),
    _said("camera/iso_gain", "iso_gain", "; without the video `camera[0].iso` has the nearest step"),
    _said("camera/vfov", "vfov", ", rad"),
    _reading("camera/zoom", "camera.state.cameras[0].zoom"),
    _reading("drone/altitude", "piloting.state.height"),
    _reading("drone/altitude_above_to", "piloting.state.altitude"),
    _both("drone/attitude", "piloting.state.attitude", lambda frame: frame.attitude, "video.state.frame.attitude"),
    _reading("drone/gps/fix", "gps.state.fixed"),
    _reading("drone/gps/location", "gps.state.location"),
    _reading("drone/gps/satellites", "gps.state.satellites"),
    _both("drone/rpy", "piloting.state.attitude", lambda frame: frame.attitude, "video.state.frame.attitude"),
    _both(
        "drone/speed", "piloting.state.velocity", lambda frame: frame.metadata.speed, "video.state.frame.metadata.speed"
    ),
    _reading("drone/state", "piloting.state.flying"),
    _reading("gimbal/attitude/absolute", "gimbal.state[0].attitude"),
    _reading("home/location", "home.state.location", _up),
    _reading("link/quality", "link.state.quality"),
    Row("published topic", "skycontroller/attitude", CONTROLLER),
    Row("published topic", "skycontroller/command", CONTROLLER),
    Row("published topic", "skycontroller/rpy", CONTROLLER),
    Row("published topic", "storage/available", "`storage.start_monitoring`, `StorageState.available`", _free),
    _reading("time", "product.state.date_time"),
    # -- services
    Row("service", "camera/photo/stop", "`camera.stop_photo`", _series),
    Row("service", "camera/photo/take", "`camera.take_photo`", _photo),
    Row("service", "camera/recording/start", "`camera.start_recording`", _record),
    Row("service", "camera/recording/stop", "`camera.stop_recording`", _film),
    Row("service", "camera/reset", "`camera.reset_zoom`", _done(lambda drone: drone.camera.reset_zoom())),
    Row("service", "drone/arm", "`piloting.hand_launch`, `cancel_hand_launch`", _arm),
    Row("service", "drone/calibrate", "`calibration.start_magnetometer`, `magnetometer_done`", _calibrate),
    Row("service", "drone/emergency", "`piloting.emergency`", _emergency),
    Row("service", "drone/halt", "`piloting.stop`, `hover`", _flying(lambda drone: drone.piloting.stop())),
    Row("service", "drone/land", "`piloting.land`", _flying(lambda drone: drone.piloting.land())),
    Row("service", "drone/reboot", "`reboot`", _reboot),
    Row("service", "drone/rth", "`piloting.return_home`", _return),
    Row("service", "drone/takeoff", "`piloting.take_off`", _done(lambda drone: drone.piloting.take_off())),
    Row("service", "flightplan/pause", "`flight_plan.pause`", _pause),
    Row("service", "flightplan/start", "`flight_plan.start`", _play),
    Row("service", "flightplan/stop", "`flight_plan.stop`", _stop_plan),
    Row("service", "flightplan/upload", "`flight_plan.upload`", _upload),
    Row("service", "gimbal/calibrate", "`gimbal.calibrate`", _done(lambda drone: drone.gimbal.calibrate())),
    Row("service", "gimbal/reset", "`gimbal.reset_orientation`", lambda pair: pair.drone.gimbal.reset_orientation()),
    Row("service", "home/navigate", "`piloting.return_home`, `cancel_return_home`", _return),
    Row("service", "home/set", "`home.set_custom_location`", _set_home),
    Row("service", "skycontroller/offboard", CONTROLLER),
    Row("service", "storage/download", "`media.download_media`, `delete`", _download),
    Row(
        "service",
        "storage/format",
        "`storage.format`",
        _done(lambda drone: drone.storage.format(FormattingType.QUICK)),
    ),
    # -- parameters
    Row(
        "parameter",
        "camera/autorecord",
        "`camera.set_autorecord`",
        _confirms(lambda d: d.camera.set_autorecord(True), True),
    ),
    Row("parameter", "camera/ev_compensation", "`camera.set_ev`", _confirms(lambda d: d.camera.set_ev(1.0), 1.0)),
    Row("parameter", "camera/hdr", "`camera.set_hdr`", _confirms(lambda d: d.camera.set_hdr(True), True)),
    Row(
        "parameter",
        "camera/max_zoom_speed",
        "`camera.set_zoom_speed`",
        _confirms(lambda d: d.camera.set_zoom_speed(0.5), 0.5),
    ),
    Row(
        "parameter",
        "camera/mode",
        "`camera.set_mode`",
        _confirms(lambda d: d.camera.set_mode(CameraMode.PHOTO), CameraMode.PHOTO),
    ),
    Row(
        "parameter",
        "camera/relative",
        "`piloting.set_style`",
        _confirms(
            lambda d: d.piloting.set_style(PilotingStyleStyle.CAMERA_OPERATED), PilotingStyleStyle.CAMERA_OPERATED
        ),
    ),
    Row(
        "parameter",
        "camera/rendering",
        "`thermal.set_mode`, `set_rendering`",
        _confirms(lambda d: d.thermal.set_rendering(RenderingMode.BLENDED, 0.5), (RenderingMode.BLENDED, 0.5)),
        THERMAL,
    ),
    Row(
        "parameter",
        "camera/streaming",
        "`camera.set_streaming`",
        _confirms(lambda d: d.camera.set_streaming(Streaming.HIGH_RELIABILITY), Streaming.HIGH_RELIABILITY),
        OLDER,
    ),
    Row(
        "parameter",
        "camera/style",
        "`camera.set_style`",
        _confirms(lambda d: d.camera.set_style(Style.STANDARD), Style.STANDARD),
    ),
    Row(
        "parameter",
        "drone/banked_turn",
        "`piloting.set_banked_turn`",
        _confirms(lambda d: d.piloting.set_banked_turn(True), True),
    ),
    Row(
        "parameter",
        "drone/max_altitude",
        "`piloting.set_max_altitude`",
        _confirms(lambda d: d.piloting.set_max_altitude(20.0), 20.0),
    ),
    Row(
        "parameter",
        "drone/max_distance",
        "`piloting.set_max_distance`, `set_geofence`",
        _confirms(lambda d: d.piloting.set_max_distance(50.0), 50.0),
    ),
    Row(
        "parameter",
        "drone/max_horizontal_speed",
        "`piloting.set_max_horizontal_speed`; these models have it as an argument of `move_to`",
        _confirms(lambda d: d.piloting.set_max_horizontal_speed(5.0), 5.0),
        (),
    ),
    Row(
        "parameter",
        "drone/max_pitch_roll",
        "`piloting.set_max_tilt`",
        _confirms(lambda d: d.piloting.set_max_tilt(20.0), 20.0),
    ),
    Row(
        "parameter",
        "drone/max_pitch_roll_rate",
        "`piloting.set_max_tilt_speed`",
        _confirms(lambda d: d.piloting.set_max_tilt_speed(200.0), 200.0),
    ),
    Row(
        "parameter",
        "drone/max_vertical_speed",
        "`piloting.set_max_vertical_speed`",
        _confirms(lambda d: d.piloting.set_max_vertical_speed(2.0), 2.0),
    ),
    Row(
        "parameter",
        "drone/max_yaw_rate",
        "`piloting.set_max_rotation_speed`",
        _confirms(lambda d: d.piloting.set_max_rotation_speed(180.0), 180.0),
    ),
    Row("parameter", "drone/model", "`identity.model`", _reads("identity.model.key")),
    Row(
        "parameter",
        "gimbal/max_speed",
        "`gimbal.set_max_speed`",
        lambda pair: pair.drone.gimbal.set_max_speed(100.0),
    ),
    Row("parameter", "home/autotrigger", "`home.set_by_itself`", _confirms(lambda d: d.home.set_by_itself(True), True)),
    Row(
        "parameter",
        "home/ending_behavior",
        "`home.set_ending`, `set_ending_altitude`",
        _confirms(lambda d: d.home.set_ending(RthEndingBehavior.HOVERING), RthEndingBehavior.HOVERING),
    ),
    Row(
        "parameter",
        "home/min_altitude",
        "`home.set_min_altitude`",
        _confirms(lambda d: d.home.set_min_altitude(30.0), 30.0),
    ),
    Row("parameter", "home/precise", "`home.set_precise`", _confirms(lambda d: d.home.set_precise(True), True)),
    Row(
        "parameter",
        "home/type",
        "`home.set_preferred_type`",
        _confirms(lambda d: d.home.set_preferred_type(RthHomeType.TAKEOFF), RthHomeType.TAKEOFF),
    ),
    Row("parameter", "storage/download_folder", LOCAL),
)
