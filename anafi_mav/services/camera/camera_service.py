"""Messages about the camera itself, and the commands that set it up.

MAVLink camera.md; conformance A8, C6. What a client or the pilot changes is sent to every client.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from typing import Any

from anafi_mav import texts
from anafi_mav.clock import NEVER
from anafi_mav.drone.element import StateWatch
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.camera_enums import CameraMode
from anafi_mav.drone.values import VALUES, Values
from anafi_mav.drone.video.stream_choice import StreamKind
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.node import Inbound
from anafi_mav.services.camera import camera_messages
from anafi_mav.services.camera.camera_pose import current_pose
from anafi_mav.services.camera.camera_reset import reset_camera
from anafi_mav.services.camera.camera_targets import enter_mode, is_at_autopilot, require_free, require_idle
from anafi_mav.services.commands import Action, ActionGroup, Altitude, Command, Effect, ProgressPolicy, require_camera
from anafi_mav.services.service import Answer, Host, Request, Service
from anafi_mav.services.stream import MessageStream, Times
from anafi_mav.vehicle.base.refusal import Refused, Unsupported
from anafi_mav.vehicle.base.subscriptions import Subscriptions, ValueInterest, ValueSubscriptions
from anafi_mav.vehicle.vehicle import Vehicle

ZOOM_SHOWN = 0.5
"""% of the zoom range by which CAMERA_SETTINGS must differ from the last one to be sent again."""

SOURCES: Mapping[float, StreamKind] = {
    dialect.CAMERA_SOURCE_DEFAULT: StreamKind.VISIBLE,
    dialect.CAMERA_SOURCE_RGB: StreamKind.VISIBLE,
    dialect.CAMERA_SOURCE_IR: StreamKind.THERMAL,
}


class CameraService(Service):
    """The camera's identity, mode, zoom and source."""

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._sent_settings: tuple[CameraMode | None, float] | None = None
        """Mode and zoom of the last CAMERA_SETTINGS to all."""
        self._sent_flags: int | None = None
        self._level: float | bytes | None = None
        """Zoom of the newest event about it, or the bytes of that event."""
        self._camera = StateWatch(host.drone.camera)
        host.definition.subscribe(self._send_information)

    def link_up(self) -> None:
        self._camera.reset()
        if self._sent_settings is None:
            self._sent_settings, self._sent_flags = self._settings(), camera_messages.flags(self.host.drone)
        self._send_changed()  # without a link the pilot, or the drone itself, may have changed them

    # Messages.

    def streams(self) -> Mapping[int, MessageStream]:
        return {
            dialect.MAVLINK_MSG_ID_CAMERA_SETTINGS: MessageStream(
                lambda vehicle, times: camera_messages.settings(vehicle.drone, times)
            ),
            dialect.MAVLINK_MSG_ID_CAMERA_FOV_STATUS: MessageStream(
                lambda vehicle, times: camera_messages.fov_status(vehicle, times, current_pose(vehicle))
            ),
            dialect.MAVLINK_MSG_ID_CAMERA_THERMAL_RANGE: MessageStream(_thermal_range, is_supported=_has_thermal),
        }

    def requests(self) -> Mapping[int, Request]:
        return {dialect.MAVLINK_MSG_ID_CAMERA_INFORMATION: self._information}

    def _information(self, inbound: Inbound, command: Command) -> Answer:
        return self._made()

    def _made(self) -> dialect.MAVLink_message:
        host = self.host
        return camera_messages.information(
            host.drone, host.times(), host.camera_flags, host.definition.uri, host.definition.version
        )

    def _send_information(self) -> None:
        """Send CAMERA_INFORMATION to all: the definition or the flags have changed."""
        self.host.send(self._made())

    def _settings(self) -> tuple[CameraMode | None, float]:
        camera = self.host.drone.camera[self.host.drone.camera.active_id]
        return camera.mode, camera_messages.zoom_percent(camera)

    def _send_settings(self) -> None:
        self._sent_settings = self._settings()
        message = camera_messages.settings(self.host.drone, self.host.times())
        if message is not None:
            self.host.send(message)

    def subscriptions(self) -> Subscriptions:
        return {kind: self._on_zoom for kind in Camera.ZOOM_EVENTS if kind not in VALUES}

    def value_subscriptions(self) -> ValueSubscriptions:
        return {self._on_zoom_value: ValueInterest(VALUES.intersection(Camera.ZOOM_EVENTS))}

    def _on_zoom(self, message: Any, now: float) -> None:
        self._note_zoom(message.level)

    def _on_zoom_value(self, values: Values, now: float) -> None:
        for kind in Camera.ZOOM_EVENTS:
            place = values.layout.places.get(kind)
            if place is not None and values.data[place] != self._level:
                self._note_zoom(values.data[place])

    def _note_zoom(self, level: float | bytes) -> None:
        if level != self._level:
            self._level = level
            self.host.look_soon()

    def tick(self, now: float) -> float:
        """Send what has changed, by a client or otherwise."""
        if self._camera.has_changed():
            self._send_changed()
        return NEVER

    def _send_changed(self) -> None:
        mode, zoom = self._settings()
        if self._sent_settings is not None and mode is not None:
            last_mode, last_zoom = self._sent_settings
            same_zoom = math.isnan(zoom) or abs(zoom - last_zoom) < ZOOM_SHOWN
            if mode is not last_mode or not same_zoom:
                self._send_settings()
        found = camera_messages.flags(self.host.drone)
        if self._sent_flags is not None and found != self._sent_flags:
            self._send_information()
        self._sent_flags = found

    # Commands.

    def actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_SET_CAMERA_MODE: Action(
                self._set_mode,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                group=ActionGroup.CAMERA,
            ),
            dialect.MAV_CMD_RESET_CAMERA_SETTINGS: Action(
                self._reset,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                progress=ProgressPolicy.LATE,
                group=ActionGroup.CAMERA,
            ),
            dialect.MAV_CMD_SET_CAMERA_SOURCE: Action(
                self._set_source,
                location=False,
                altitude=Altitude.UNUSED,
                effect=Effect.TARGET,
                group=ActionGroup.STREAM,
            ),
            dialect.MAV_CMD_SET_CAMERA_ZOOM: Action(
                self._zoom, location=False, altitude=Altitude.UNUSED, effect=_effect_of_zoom, group=ActionGroup.ZOOM
            ),
        }

    def autopilot_actions(self) -> Mapping[int, Action]:
        return {
            dialect.MAV_CMD_SET_CAMERA_ZOOM: Action(
                self._zoom,
                location=False,
                altitude=Altitude.UNUSED,
                effect=_effect_of_zoom,
                group=ActionGroup.ZOOM,
                offered=is_at_autopilot,
            )
        }

    async def _set_mode(self, command: Command) -> None:
        """MAV_CMD_SET_CAMERA_MODE: param2 0 photo, 1 video."""
        require_camera(texts.CAMERA_MODE, command.params[0])
        wanted = next((mode for mode, number in camera_messages.MODES.items() if number == command.params[1]), None)
        await self.change_mode(wanted)

    async def change_mode(self, wanted: CameraMode | None) -> None:
        """Change between photos and video; None is a mode that the camera does not have."""
        drone = self.host.drone
        camera = drone.camera[drone.camera.active_id]
        if camera.modes is None:
            raise Refused(texts.CAMERA_MODE, texts.CAMERA_UNKNOWN)
        if wanted is None:
            raise Refused(texts.CAMERA_MODE, texts.NO_SUCH_MODE, lasting=True)
        await enter_mode(self.host, wanted, texts.CAMERA_MODE)
        self._send_settings()

    async def _zoom(self, command: Command) -> None:
        """MAV_CMD_SET_CAMERA_ZOOM: param1 0 step, 1 rate, 2 share of the range; param2 the value."""
        kind, value = command.params[0], command.params[1]
        require_camera(texts.ZOOM, command.params[2])
        drone = self.host.drone
        id = drone.camera.active_id
        camera = drone.camera[id]
        if camera.feature is None:
            raise Refused(texts.ZOOM, texts.CAMERA_UNKNOWN)
        if camera.zoom_max is None or camera.zoom_max <= 1.0:  # the thermal camera
            raise Refused(texts.ZOOM, texts.CAMERA_LACKS_ZOOM)
        if math.isnan(kind):
            raise Refused(texts.ZOOM, texts.NUMBER_MISSING, lasting=True)
        if kind not in (dialect.ZOOM_TYPE_STEP, dialect.ZOOM_TYPE_CONTINUOUS, dialect.ZOOM_TYPE_RANGE):
            raise Unsupported(texts.ZOOM, texts.ZOOM_TYPE)
        if not math.isfinite(value):
            raise Refused(texts.ZOOM, texts.NUMBER_MISSING, lasting=True)
        require_free(self.host.vehicle, texts.ZOOM)
        ended = self.host.end_others(ActionGroup.ZOOM)
        if ended:
            await asyncio.wait(ended)
        if kind == dialect.ZOOM_TYPE_CONTINUOUS:
            await drone.camera.start_zoom(value, id)
        elif kind == dialect.ZOOM_TYPE_STEP:
            await drone.camera.zoom(camera_messages.stepped_zoom(camera, value), id)
        else:
            await drone.camera.zoom(camera_messages.zoom_factor(camera, value), id)
        self._send_settings()

    async def _set_source(self, command: Command) -> None:
        """MAV_CMD_SET_CAMERA_SOURCE: param2 the shown picture; param3 not 0: blended."""
        require_camera(texts.CAMERA_SOURCE, command.params[0])
        drone = self.host.drone
        if not camera_messages.has_thermal(drone.identity.model):
            raise Unsupported(texts.CAMERA_SOURCE, texts.NO_THERMAL_CAMERA)
        first, second = command.params[1], command.params[2]
        kind = SOURCES.get(0.0 if math.isnan(first) else first)
        if kind is None:
            raise Refused(texts.CAMERA_SOURCE, texts.NO_SUCH_SOURCE, lasting=True)
        if second and not math.isnan(second):
            kind = StreamKind.BLENDED
        if not drone.streams.is_shown(kind):
            require_free(self.host.vehicle, texts.CAMERA_SOURCE)
            require_idle(drone, texts.CAMERA_SOURCE)
            self.host.end_others(ActionGroup.STREAM)
        await drone.streams.show(kind)

    async def _reset(self, command: Command) -> None:
        """MAV_CMD_RESET_CAMERA_SETTINGS: set the active camera as after a factory reset."""
        require_camera(texts.CAMERA_RESET, command.params[1])
        if command.params[0] != 1.0:
            raise Refused(texts.CAMERA_RESET, texts.RESET_VALUE, lasting=True)
        require_free(self.host.vehicle, texts.CAMERA_RESET)
        require_idle(self.host.drone, texts.CAMERA_RESET)
        camera = self.host.drone.camera
        is_reset = await reset_camera(camera, camera.active_id)
        self._send_settings()
        if not is_reset:
            raise Refused(texts.CAMERA_RESET, texts.VALUE_KEPT)


def _effect_of_zoom(command: Command) -> Effect:
    """A step counts each time; a factor or a rate may be set twice."""
    return Effect.EACH if command.params[0] == dialect.ZOOM_TYPE_STEP else Effect.TARGET


def _has_thermal(vehicle: Vehicle) -> bool:
    return camera_messages.has_thermal(vehicle.drone.identity.model)


def _thermal_range(vehicle: Vehicle, times: Times) -> dialect.MAVLink_message | None:
    return camera_messages.thermal_range(vehicle.drone, times)
