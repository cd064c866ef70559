"""All cameras of a model before the Ai.

Addresses commands to them, selects the active one and starts automatic recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.camera import CameraAntiflickerMode, CameraCameraMode, State, Supported
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.thermal import ThermalMode
from anafi_mav.sim.payload.camera import Camera, bits
from anafi_mav.sim.payload.capture import Capture, Studio
from anafi_mav.sim.payload.optics import Optics
from anafi_mav.sim.world.model import AircraftModel

ACTIVE = {ThermalMode.DISABLED: 0, ThermalMode.STANDARD: 1, ThermalMode.BLENDED: 2}
"""Id of the camera that a thermal mode makes the active one."""


class Cameras:
    """Cameras by id; exactly one is active."""

    def __init__(self, model: AircraftModel, studio: Studio) -> None:
        speed = model.settings["zoom_speed"]
        self._captures = {lens.id: Capture(Camera(lens, speed), studio) for lens in model.lenses}
        self._antiflicker = CameraAntiflickerMode.AUTO
        self._time = 0.0
        self._flying = False

    def __getitem__(self, id: int) -> Camera:
        return self._captures[id].camera

    @property
    def busy(self) -> bool:
        """One of them is at work for the card."""
        return any(capture.busy for capture in self._captures.values())

    @property
    def shots(self) -> int:
        """Pictures that have been taken of what is being photographed."""
        return self._active.shots

    @property
    def _active(self) -> Capture:
        return next(capture for capture in self._captures.values() if capture.camera.active)

    def optics(self, id: int) -> Optics:
        """Return the optical settings with which a camera's picture is taken."""
        return self[id].optics()

    # -- time

    def tick(self, time: float, flying: bool) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        seconds, self._time = time - self._time, time
        messages: list[Message] = []
        for capture in self._captures.values():
            if capture.busy:
                messages += capture.tick(time)
            if capture.camera.zooming:
                capture.camera.advance_zoom(seconds)
        if flying != self._flying:
            self._flying = flying
            messages += self._autorecord(flying, time)
        return messages

    def _autorecord(self, flying: bool, time: float) -> Iterable[Message]:
        """Start recording at take-off and stop it at landing, when autorecord is enabled.

        Only in recording mode.
        """
        active = self._active
        wanted = active.camera.autorecord is State.ACTIVE and active.camera.mode is CameraCameraMode.RECORDING
        if not wanted or flying == active.recording:
            return ()
        return active.start_recording(time) if flying else active.stop_recording(time)

    def telemetry(self) -> list[Message]:
        """Return the messages sent five times a second."""
        return [
            capture.camera.zoom_report()
            for capture in self._captures.values()
            if capture.camera.active and capture.camera.lens.zoom_max > 1.0
        ]

    def work(self, act: Callable[[Capture], Iterable[Message]], time: float) -> list[Message]:
        """Let the active camera do something; what it says of it."""
        return list(act(self._active))

    # -- commands

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """Return the answer to a command of this feature, or None for any other message.

        A command for a camera that does not exist is not answered.
        """
        if isinstance(message, camera.SetAntiflickerMode):
            if message.mode in tuple(CameraAntiflickerMode):
                self._antiflicker = message.mode
            return [self._antiflicker_report()]
        capture = self._captures.get(getattr(message, "cam_id", -1))
        handler = _HANDLERS.get(type(message))
        if handler is not None:
            return [] if capture is None else list(handler(self, capture, message, time))
        if capture is None:
            return None if not message.NAME.startswith("camera.") else []
        return capture.camera.handle(message)

    def _take_photo(self, capture: Capture, m: Message, time: float) -> Iterable[Message]:
        return capture.take_photo(time)

    def _stop_photo(self, capture: Capture, m: Message, time: float) -> Iterable[Message]:
        return capture.stop_photo(time)

    def _start_recording(self, capture: Capture, m: Message, time: float) -> Iterable[Message]:
        return capture.start_recording(time)

    def _stop_recording(self, capture: Capture, m: Message, time: float) -> Iterable[Message]:
        return capture.stop_recording(time)

    def _set_mode(self, capture: Capture, m: camera.SetCameraMode, time: float) -> Iterable[Message]:
        settings = capture.camera
        changes = m.value in settings.lens.modes and m.value is not settings.mode and not capture.shooting
        if changes:
            yield from capture.interrupt(time)
            settings.set_mode(m.value)
        yield from settings.mode_report()
        if changes:
            yield from capture.states()

    def _set_recording(self, capture: Capture, m: camera.SetRecordingMode, time: float) -> Iterable[Message]:
        settings = capture.camera
        before = settings.recording_report()
        settings.set_recording(m)
        after = settings.recording_report()
        if after != before and capture.recording:
            yield from capture.interrupt(time)
        yield after
        if after != before:
            yield settings.hdr_change()
            yield from settings.zoom_change()

    def _set_photo(self, capture: Capture, m: camera.SetPhotoMode, time: float) -> Iterable[Message]:
        settings = capture.camera
        before = settings.photo_report()
        if not capture.shooting:
            settings.set_photo(m)
        yield settings.photo_report()
        if settings.photo_report() != before:
            yield settings.hdr_change()

    def activate(self, mode: ThermalMode, time: float) -> Iterable[Message]:
        """Activate the camera of a thermal mode.

        It reports all its settings, as Parrot's camera.xml describes.
        """
        before = self._active
        after = self._captures[ACTIVE[mode]]
        if before is after:
            return
        yield from before.interrupt(time)
        before.camera.active, after.camera.active = False, True
        yield self._states()
        yield from before.states()
        yield from after.camera.settings_report()
        yield from after.states()

    def states_changed(self) -> list[Message]:
        """Report the active camera's photo and recording states, after other events changed them."""
        return self._active.states()

    # -- reports

    def _states(self) -> Message:
        return camera.CameraStates(1 << self._active.camera.id)

    def _antiflicker_report(self) -> Message:
        automatic = self._antiflicker is CameraAntiflickerMode.AUTO
        return camera.AntiflickerMode(
            self._antiflicker, CameraAntiflickerMode.MODE_50HZ if automatic else self._antiflicker
        )

    def states_report(self) -> list[Message]:
        """Return the camera messages of the AllStates answer."""
        captures = list(self._captures.values())
        messages = [capture.camera.capabilities() for capture in captures]
        messages += self._lists()
        messages += [camera.AntiflickerCapabilities(bits(CameraAntiflickerMode)), self._antiflicker_report()]
        messages.append(self._states())
        for capture in captures:
            messages += capture.camera.settings_report()
            messages += capture.states()
        return messages

    def _lists(self) -> list[Message]:
        """Return the capability lists of all cameras: one of recordings and one of photos."""
        lenses = [capture.camera.lens for capture in self._captures.values()]
        recordings = [(lens.id << 8 | n, one) for lens in lenses for n, one in enumerate(lens.recordings)]
        photos = [(lens.id << 8 | n, two) for lens in lenses for n, two in enumerate(lens.photos)]
        return [
            *(
                camera.RecordingCapabilities(
                    id,
                    bits(one.modes),
                    bits([one.resolution]),
                    bits(one.framerates),
                    Supported.SUPPORTED if one.hdr else Supported.NOT_SUPPORTED,
                    _flags(n, len(recordings)),
                )
                for n, (id, one) in enumerate(recordings)
            ),
            *(
                camera.PhotoCapabilities(
                    id,
                    bits(two.modes),
                    bits(two.formats),
                    bits(two.files),
                    Supported.SUPPORTED if two.hdr else Supported.NOT_SUPPORTED,
                    _flags(n, len(photos)),
                )
                for n, (id, two) in enumerate(photos)
            ),
        ]


def _flags(n: int, count: int) -> int:
    return (n == 0) << ListFlags.FIRST | (n == count - 1) << ListFlags.LAST


_HANDLERS: dict[type[Message], Callable[[Cameras, Capture, Any, float], Iterable[Message]]] = {
    camera.TakePhoto: Cameras._take_photo,
    camera.StopPhoto: Cameras._stop_photo,
    camera.StartRecording: Cameras._start_recording,
    camera.StopRecording: Cameras._stop_recording,
    camera.SetCameraMode: Cameras._set_mode,
    camera.SetRecordingMode: Cameras._set_recording,
    camera.SetPhotoMode: Cameras._set_photo,
}
