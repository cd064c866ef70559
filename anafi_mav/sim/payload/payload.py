"""Payload of the drone: cameras, storage and media, calendar, and an Ai's further services."""

from __future__ import annotations

from collections.abc import Callable

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.thermal import ThermalMode
from anafi_mav.sim.features.services import Services
from anafi_mav.sim.payload.camera2 import Camera2
from anafi_mav.sim.payload.cameras import Cameras
from anafi_mav.sim.payload.capture import Studio
from anafi_mav.sim.payload.jpeg_scene import Scene
from anafi_mav.sim.payload.media import MediaStore
from anafi_mav.sim.payload.storage import Storage
from anafi_mav.sim.payload.thermal import Thermal
from anafi_mav.sim.world.calendar import Calendar
from anafi_mav.sim.world.model import AircraftModel


class Payload:
    """One drone's. `scene` says what its camera sees."""

    def __init__(
        self, model: AircraftModel, name: str, run_id: str, emit: Callable[[Message], None], scene: Callable[[], Scene]
    ) -> None:
        self.calendar = Calendar()
        self.media = MediaStore(run_id, model.title, len(model.cards) - 1, emit)
        self.storage = Storage(model, self.media)
        studio = Studio(self.media, self.storage.place, self.calendar, scene)
        self.cameras: Cameras | Camera2 = Camera2(model, studio) if model.modern else Cameras(model, studio)
        self.storage.place.busy = lambda: self.cameras.busy
        self.thermal = Thermal(self._on_thermal_mode) if model.thermal else None
        self.services = Services(name) if model.modern else None
        self._time = 0.0

    def reboot(self, run_id: str, time: float, *, wipe: bool) -> None:
        """Handle a power-off: end photos and recordings; keep the stored media unless `wipe` is set."""
        self.cameras.work(lambda capture: capture.interrupt(time), time)
        self.storage.forget()
        self.media.begin_run(run_id)
        if wipe:
            self.media.remove_all()

    def handle(self, message: Message, time: float) -> list[Message] | None:
        """The answer to a command; None when it is not for the payload."""
        self._time = time
        answer = self.cameras.handle(message, time)
        if answer is None and self.thermal is not None:
            answer = self.thermal.handle(message)
        if answer is None and self.services is not None:
            answer = self.services.handle(message)
        if answer is None:
            formatting = self.storage.place.formatting
            answer = self.storage.handle(message, time)
            if answer is not None and self.storage.place.formatting != formatting:
                answer += self.cameras.states_changed()
        return answer

    def operate(self, message: Message, time: float) -> list[Message]:
        """Execute a camera command of the autopilot, given as a message of the older cameras.

        This form is used on every model, also on those with the newer camera messages.
        """
        if isinstance(self.cameras, Camera2):
            return self.cameras.operate(message, time)
        return self.handle(message, time) or []

    def panorama_begin(self, kind: str, count: int, time: float) -> list[Message]:
        """Begin a panorama: one media of `count` pictures.

        The camera is switched to photo mode, which stops a recording; refused while it takes photos.
        """
        messages = self.operate(camera.SetCameraMode(0, camera.CameraCameraMode.PHOTO), time)
        return messages + self.cameras.work(lambda capture: capture.begin_panorama(kind, count, time), time)

    def panorama_shot(self, time: float) -> list[Message]:
        """One of them, now."""
        return self.cameras.work(lambda capture: capture.panorama_shot(time), time)

    def panorama_end(self, time: float) -> list[Message]:
        """That was all."""
        return self.cameras.work(lambda capture: capture.end_panorama(time), time)

    def lacks(self, fix: bool, calibrated: bool, flying: bool) -> list[Message]:
        """Report the unmet conditions of a move or a flight plan, if they changed.

        Only on models that report them.
        """
        return [] if self.services is None else self.services.lacks(fix, calibrated, flying)

    def tick(self, time: float, flying: bool) -> list[Message]:
        """Advance to `time` (s) and return the messages that are due."""
        self._time = time
        formatting = self.storage.place.formatting
        messages = self.cameras.tick(time, flying)
        messages += self.storage.tick(time)
        self.media.tick(time)
        if self.storage.place.formatting != formatting:
            messages += self.cameras.states_changed()
        return messages

    def telemetry(self) -> list[Message]:
        """Return the messages sent five times a second."""
        return self.cameras.telemetry()

    def states_report(self) -> list[Message]:
        """Return the payload's messages of the AllStates answer."""
        return [
            *self.cameras.states_report(),
            *(() if self.thermal is None else self.thermal.states_report()),
            *self.storage.states_report(),
            *self.media.states_report(),
            *(() if self.services is None else self.services.states_report()),
        ]

    def _on_thermal_mode(self, mode: ThermalMode) -> list[Message]:
        assert isinstance(self.cameras, Cameras)  # no other model has a thermal mode
        return list(self.cameras.activate(mode, self._time))
