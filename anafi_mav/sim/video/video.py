"""Live video of the simulated models: their streams and the metadata of the pictures."""

from __future__ import annotations

from dataclasses import dataclass

from anafi_mav.arsdk.video import sdp
from anafi_mav.arsdk.video.sdp import MediaDescription, SessionDescription
from anafi_mav.arsdk.video.video_metadata import (
    PROTO_PROFILE,
    V3_PROFILE,
    FlyingState,
    FrameMetadata,
    LinkInfo,
    LinkStatus,
    LinkType,
    Location,
    Ned,
    PilotingMode,
    Quaternion,
    StarfishLink,
    Vector3,
    WifiLink,
)
from anafi_mav.models import PayloadSensor
from anafi_mav.sim.autopilot.firmware import Firmware
from anafi_mav.sim.features.services import QUALITY
from anafi_mav.sim.features.wireless import RSSI
from anafi_mav.sim.payload.optics import Optics, zoomed
from anafi_mav.sim.world.model import AircraftModel
from anafi_mav.units import DEG_PER_RAD, RAD_PER_DEG, quaternion_from_euler

GOODPUT = 20_000
"""kbit/s of the link. Assumed."""


@dataclass(frozen=True)
class StreamIntrinsics:
    """A camera's calibration, in pixels of its stream (anafi_ros, folder calibration)."""

    centre: tuple[float, float]
    radial: tuple[float, float, float]
    tangential: tuple[float, float]


@dataclass(frozen=True)
class CameraStream:
    """One camera as it is streamed."""

    title: str
    """Name that Olympe requests as `media_name`."""
    control: str
    """Last part of its URL."""
    width: int
    height: int
    lens: int | None = 0
    """Id of its camera; None: one that cannot be set."""
    gimbal: int = 0
    """That carries it."""
    kind: str = "front"
    spectrum: str = "visible"
    default: bool = False
    hfov: float = 0.0
    """deg, of one that cannot be set."""
    intrinsics: StreamIntrinsics | None = None


def streams_of(model: AircraftModel) -> tuple[CameraStream, ...]:
    """Return the streams of a model's cameras; the first is the default."""
    lens = model.lens
    intrinsics = StreamIntrinsics((lens.cx, lens.cy), (lens.k1, lens.k2, lens.k3), (lens.p1, lens.p2))
    title, control = ("Front camera", "front") if model.modern else ("DefaultVideo", "video")
    return (
        CameraStream(title, control, lens.width, lens.height, default=True, intrinsics=intrinsics),
        *(_THERMAL if PayloadSensor.THERMAL in model.record.payloads else ()),
        *(_STEREO if PayloadSensor.STEREO in model.record.payloads else ()),
    )


_THERMAL = (
    CameraStream("ParrotThermalVideo", "thermal", 960, 720, lens=1, spectrum="thermal"),
    CameraStream("ParrotThermalBlendedVideo", "thermal-blended", 960, 720, lens=2, spectrum="blended"),
)
_STEREO = (
    # The width of the stereo pictures' view is assumed.
    CameraStream("Disparity map", "disparity", 176, 90, lens=None, gimbal=1, kind="disparity", hfov=110.0),
)


def profile(model: AircraftModel) -> int:
    """Which metadata goes with a model's pictures."""
    return PROTO_PROFILE if model.modern else V3_PROFILE


def optics(firmware: Firmware, stream: CameraStream) -> Optics:
    """Return the optical settings of a stream's camera."""
    if stream.lens is None:
        return Optics(zoomed(stream.hfov, 1.0))
    return firmware.payload.cameras.optics(stream.lens)


def metadata(firmware: Firmware, stream: CameraStream) -> FrameMetadata:
    """Return the metadata of a picture taken now.

    Its timestamp is of the simulated clock, the same as `SimulatedDrone.time`, and so are the times of everything
    that it reports: a measurement between two pictures does not depend on the load of the host. It is never zero,
    because the protocol buffer cannot carry zero.
    """
    pose, model, seen = firmware.pose, firmware.model, optics(firmware, stream)
    firmware.gimbal.advance(firmware.time)
    looks = firmware.gimbal.attitude(pose, stream.gimbal)
    location = None
    if firmware.fix:
        latitude, longitude = firmware.place()
        location = Location(
            latitude=latitude,
            longitude=longitude,
            altitude_amsl=firmware.altitude,
            satellites=firmware.satellites,
        )
    roll, pitch, yaw = (
        angle * RAD_PER_DEG for angle in (looks.roll_absolute, looks.pitch_absolute, looks.yaw_absolute)
    )
    picture = stream.lens is not None
    return FrameMetadata(
        drone_quat=Quaternion(*quaternion_from_euler(pose.roll, pose.pitch, pose.yaw)),
        location=location,
        ground_distance=pose.up,
        altitude_ato=pose.up,
        speed=Ned(pose.vn, pose.ve, pose.vd),
        battery_percentage=firmware.battery.percent,
        flying_state=FlyingState(int(firmware.state)),
        piloting_mode=_mode(firmware),
        animation_in_progress=firmware.animations.running,
        position=Ned(pose.north, pose.east, 0.0 - pose.up) if model.modern else None,
        local_position=Vector3(pose.north, pose.east, 0.0 - pose.up) if model.modern else None,
        timestamp=max(1, round(firmware.time * 1e6)),
        # What the user turns is pitch, and yaw where the gimbal has it.
        base_quat=Quaternion(*quaternion_from_euler(roll, 0.0, pose.yaw)),
        quat=Quaternion(*quaternion_from_euler(roll, pitch, yaw)),
        exposure_time=_milliseconds(seen.exposure, model) if picture else None,
        iso_gain=seen.iso if picture else None,
        awb_r_gain=seen.gains[0] if picture else None,
        awb_b_gain=seen.gains[1] if picture else None,
        hfov=seen.hfov,
        vfov=seen.vfov(stream.width, stream.height),
        zoom_level=seen.zoom if picture else None,
        wifi=None if model.modern else WifiLink(goodput=GOODPUT, quality=QUALITY, rssi=RSSI),
        starfish=_STARFISH if model.modern else None,
    )


def _milliseconds(exposure: float, model: AircraftModel) -> float | None:
    """Return the exposure time in ms, or None when an older model cannot report it.

    Version 3 of the metadata is limited to 256 ms; how an aircraft reports longer times is not known, here the
    field is left out.
    """
    return exposure * 1000.0 if model.modern or exposure < 0.25 else None


_STARFISH = StarfishLink(
    links=(
        LinkInfo(type=LinkType.WLAN, status=LinkStatus.RUNNING, quality=QUALITY, active=True),
        LinkInfo(type=LinkType.CELLULAR, status=LinkStatus.DOWN),
    ),
    quality=QUALITY,
)


def _mode(firmware: Firmware) -> PilotingMode:
    if firmware.flight_plan.playing:
        return PilotingMode.FLIGHT_PLAN
    if firmware.homing.flying:
        return PilotingMode.RETURN_HOME
    if firmware.follow.engaged:
        return PilotingMode.TRACKING
    return PilotingMode.MOVE_TO if firmware.guidance.heading_for_place else PilotingMode.MANUAL


def describe(
    firmware: Firmware,
    address: str,
    base: str,
    name: str,
    streams: tuple[CameraStream, ...],
    duration: float | None = None,
) -> SessionDescription:
    """The description of what is at the URL `base`; `duration` in s of a recording, None: live."""
    model, identity = firmware.model, firmware.identity
    return SessionDescription(
        name=name,
        info=identity.name,
        tool=f"{model.title} {model.software}",
        address=address,
        control=base,
        duration=duration,
        attributes=(
            (sdp.MAKER, "Parrot"),
            (sdp.MODEL, model.title),
            (sdp.MODEL_ID, f"{model.product_id:04x}"),
            (sdp.SERIAL, identity.serial),
            (sdp.BUILD_ID, model.software),
            (sdp.BOOT_ID, identity.boot_id),
            (sdp.RUN_ID, identity.run_id),
        ),
        media=tuple(_describe(firmware, stream) for stream in streams),
    )


def _describe(firmware: Firmware, stream: CameraStream) -> MediaDescription:
    from anafi_mav.sim.video.h264 import encoder

    shown = encoder(stream.width, stream.height)
    seen = optics(firmware, stream)
    hfov, vfov = seen.hfov * DEG_PER_RAD, seen.vfov(stream.width, stream.height) * DEG_PER_RAD
    attributes = [
        (sdp.CAMERA_TYPE, stream.kind),
        (sdp.CAMERA_SPECTRUM, stream.spectrum),
        (sdp.PICTURE_FOV, f"{hfov:.2f},{vfov:.2f}"),
    ]
    if stream.default:
        attributes.insert(0, (sdp.DEFAULT_MEDIA, "1"))
    if stream.intrinsics is not None:
        (x, y), radial, tangential = stream.intrinsics.centre, stream.intrinsics.radial, stream.intrinsics.tangential
        attributes += [
            (sdp.CAMERA_MODEL_TYPE, "perspective"),
            (sdp.PERSPECTIVE_DISTORTION, ",".join(f"{number:.8f}" for number in (*radial, *tangential))),
            (sdp.PRINCIPAL_POINT, f"{x / stream.width:.6f},{y / stream.height:.6f}"),
        ]
    return MediaDescription(
        title=stream.title, control=stream.control, sps=shown.sps, pps=shown.pps, attributes=tuple(attributes)
    )
