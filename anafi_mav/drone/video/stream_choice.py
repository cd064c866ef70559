"""Streams of a drone's cameras, the shown one, and the command that changes it.

An ANAFI sends one stream to the gateway. On Thermal and USA the thermal camera's mode and rendering decide what it
shows, whichever client sets them. On the Ai the gateway chooses among the stereo camera's pictures and the main
camera's.
"""

from __future__ import annotations

import asyncio
import enum
import logging
from collections.abc import Callable
from typing import Any

import msgspec

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import thermal as thermal_messages
from anafi_mav.arsdk.messages.thermal import RenderingMode, ThermalMode
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.thermal import ACTIVE_CAMERAS, Thermal
from anafi_mav.drone.video.video import Video
from anafi_mav.errors import CommandRejected, NotSupported
from anafi_mav.models import Model, PayloadSensor

log = logging.getLogger("anafi_mav")

MAIN_SIZE, THERMAL_SIZE, DISPARITY_SIZE = (1280, 720), (960, 720), (176, 90)
"""Width and height of the streams where the model's record has no lens (Parrot Sphinx)."""

RAW_THERMAL, BLENDED_THERMAL = "ParrotThermalVideo", "ParrotThermalBlendedVideo"
"""Titles of the streams that a Thermal or USA offers in the modes STANDARD and BLENDED (anafi_ros, Olympe)."""
DISPARITY_MAP = "Disparity map"
"""Title of the Ai's stereo stream (Olympe)."""


class StreamKind(enum.Enum):
    """Content of a stream; the value is its name in URIs."""

    VISIBLE = "visible"
    THERMAL = "thermal"
    BLENDED = "blended"
    DISPARITY = "disparity"

    @property
    def is_thermal(self) -> bool:
        """True when the thermal camera takes part in the picture."""
        return self in (StreamKind.THERMAL, StreamKind.BLENDED)


class OfferedStream(msgspec.Struct, frozen=True):
    """A stream that a drone can show."""

    number: int
    """From 1, as MAVLink counts streams."""
    kind: StreamKind
    width: int
    height: int


ChangeCallback = Callable[[], None]


def offered_streams(model: Model) -> tuple[OfferedStream, ...]:
    """Return the streams of a model; the first one shows the main camera."""
    size = MAIN_SIZE if model.lens is None else (model.lens.width, model.lens.height)
    kinds = [(StreamKind.VISIBLE, size)]
    if PayloadSensor.THERMAL in model.payloads:
        kinds += [(StreamKind.THERMAL, THERMAL_SIZE), (StreamKind.BLENDED, THERMAL_SIZE)]
    if PayloadSensor.STEREO in model.payloads:
        kinds.append((StreamKind.DISPARITY, DISPARITY_SIZE))
    return tuple(OfferedStream(number, kind, *size) for number, (kind, size) in enumerate(kinds, 1))


class StreamChoice:
    """The streams of one drone. The shown one is read from the drone's own state."""

    def __init__(self, model: Callable[[], Model], thermal: Thermal, camera: Camera, video: Video) -> None:
        self._model = model
        self._thermal = thermal
        self._camera = camera
        self._video = video
        self._chosen = StreamKind.VISIBLE
        """Stream of a model whose client chooses it."""
        self._kind = StreamKind.VISIBLE
        self._is_linked = False
        self._showing = asyncio.Lock()
        self._callbacks: tuple[ChangeCallback, ...] = ()

    @property
    def offered(self) -> tuple[OfferedStream, ...]:
        """The streams of this model, by number."""
        return offered_streams(self._model())

    @property
    def shown(self) -> OfferedStream:
        """The stream that the drone shows."""
        return next((stream for stream in self.offered if stream.kind is self._kind), self.offered[0])

    @property
    def is_recording(self) -> bool:
        """True while a camera records: the drone records what it shows, so that it must not change."""
        return any(camera.recording_now for camera in self._camera.state.cameras.values())

    def ends_photos(self, kind: StreamKind) -> bool:
        """Return True when a change to this stream would end the photos that are being taken.

        The thermal mode changes the camera that takes them.
        """
        changes_camera = kind.is_thermal or self._shown_by_drone().is_thermal
        return changes_camera and self._camera.state.is_taking

    def subscribe(self, callback: ChangeCallback) -> Callable[[], None]:
        """Call `callback` whenever another stream is shown; return the function that ends it."""
        self._callbacks = (*self._callbacks, callback)

        def undo() -> None:
            self._callbacks = tuple(other for other in self._callbacks if other is not callback)

        return undo

    def is_shown(self, kind: StreamKind) -> bool:
        """Return True when the drone shows this stream, and has answered each change of it.

        While nothing may change it, it is the reported one.
        """
        is_certain = self._thermal.is_settled or self.is_recording or self.ends_photos(kind)
        return kind is self._shown_by_drone() and is_certain

    async def show(self, kind: StreamKind) -> None:
        """Show this stream from now on; return when the drone has confirmed it.

        Of several calls the latest wins. Raises `NotSupported` for a stream that this model does not have,
        `CommandRejected` while a camera records, for a thermal stream also while it takes photos, or when the drone
        keeps another mode, `CommandTimeout`, `LinkLost`.
        """
        if kind not in (stream.kind for stream in self.offered):
            raise NotSupported(f"{kind.value} stream")
        async with self._showing:
            try:
                if not self.is_shown(kind):
                    await self._change(kind)
            finally:
                if self._is_linked:
                    self._follow()

    async def _change(self, kind: StreamKind) -> None:
        if self.is_recording:
            raise CommandRejected("a camera records")
        if self.ends_photos(kind):
            raise CommandRejected("a camera takes photos")
        if PayloadSensor.THERMAL not in self._model().payloads:
            self._chosen = kind
            return
        # THERMAL is a rendering of the blended stream: STANDARD sends the sensor's raw picture, for programs that
        # colour it themselves (GroundSDK ThermalControl; anafi_ros uses BLENDED for both renderings).
        mode = ThermalMode.BLENDED if kind.is_thermal else ThermalMode.DISABLED
        if self._thermal.state.mode is not mode or not self._thermal.is_settled:
            if await self._thermal.set_mode(mode) is not mode:
                raise CommandRejected("the drone keeps its thermal mode")
            await self._camera.until_active(ACTIVE_CAMERAS[mode])  # the next command is for that camera
        if kind.is_thermal:
            wanted = RenderingMode.THERMAL if kind is StreamKind.THERMAL else RenderingMode.BLENDED
            rendering, _ = await self._thermal.set_rendering(wanted)
            if rendering is not wanted:
                raise CommandRejected("the drone keeps its rendering")

    # -- what the drone reports

    def reactions(self) -> dict[type[Message], Callable[[Any, float], None]]:
        """Return the handlers of the drone's events."""
        return dict.fromkeys((thermal_messages.Mode, thermal_messages.Rendering), lambda message, now: self._on_event())

    def link_up(self) -> None:
        """Take the stream that the drone shows.

        A choice on an earlier connection is dropped.
        """
        self._chosen = StreamKind.VISIBLE
        self._is_linked = True
        self._follow()

    def link_lost(self) -> None:
        """Keep the stream until the drone has sent its states again."""
        self._is_linked = False

    def _on_event(self) -> None:
        # Mode and rendering follow each other, in a change and when the states are sent: one change, not two.
        if self._is_linked and not self._showing.locked():
            self._follow()

    def _shown_by_drone(self) -> StreamKind:
        mode, rendering = self._thermal.state.mode, self._thermal.state.rendering
        if PayloadSensor.THERMAL not in self._model().payloads or mode not in (
            ThermalMode.STANDARD,
            ThermalMode.BLENDED,
        ):
            return self._chosen
        if mode is ThermalMode.STANDARD or rendering in (RenderingMode.THERMAL, RenderingMode.MONOCHROME):
            return StreamKind.THERMAL
        return StreamKind.BLENDED

    def _title(self, kind: StreamKind) -> str | None:
        """Return the title of a stream on the drone's video server; None is its own choice."""
        if kind.is_thermal:
            return RAW_THERMAL if self._thermal.state.mode is ThermalMode.STANDARD else BLENDED_THERMAL
        return DISPARITY_MAP if kind is StreamKind.DISPARITY else None

    def _follow(self) -> None:
        kind, before = self._shown_by_drone(), self._kind
        self._kind = kind
        self._video.select(self._title(kind))
        if kind is before:
            return
        for callback in self._callbacks:
            try:
                callback()
            except Exception:
                log.exception("a subscriber failed on a change of the stream")
