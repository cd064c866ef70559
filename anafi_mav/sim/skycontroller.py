"""Simulated Skycontroller between a drone and a client: sticks, buttons, piloting source.

It answers messages for the controller itself (projects skyctrl, drone_manager, mapper), everything else passes
through both ways. Its pilot's sticks fly the drone while the piloting source is "SkyController"; with "Controller"
they have no effect and the client's PCMDs are used, which are dropped otherwise (skyctrl.xml 4-20-0). A grabbed
axis or button is reported and does nothing else (mapper.xml 138-1). Grab and source are reset when the connection
ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.wire import Message, UnknownMessage
from anafi_mav.arsdk.link.handshake import DeviceInfo
from anafi_mav.arsdk.messages import ardrone3, camera, drone_manager, gimbal, mapper, rth, skyctrl
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.drone_manager import DroneManagerConnectionState as Connection
from anafi_mav.arsdk.messages.generic import ListFlags
from anafi_mav.arsdk.messages.mapper import AxisAction, ButtonAction, ButtonEvent
from anafi_mav.arsdk.messages.proto import device_manager
from anafi_mav.arsdk.messages.skyctrl import Source
from anafi_mav.sim.features.device_manager import DeviceManager

MODELS = {3: 0x0918, 4: 0x091D}
"""Generation -> product number."""
SOFTWARE, HARDWARE = "1.8.2", "SIM"

YAW, THROTTLE, ROLL, PITCH, TILT, ZOOM = range(6)
"""Axes. Positive is clockwise, up, right, forward, camera up, closer."""
RETURN_HOME, TAKEOFF_LAND, RESET_CAMERA, RESET_ZOOM = range(4)
"""Buttons."""

ATTITUDE_PERIOD = 0.05
"""s between two attitudes of the controller: 20 Hz (anafi_ros)."""
PLACE_PERIOD = 1.0
"""s between two reports of the controller's place to the drone."""
STICKS_PERIOD = 0.05
"""s between two PCMDs of the controller's own."""
LETTING_GO = 10
"""PCMDs with centred sticks after the pilot's last deflection."""

_AXIS_BUTTONS = {YAW: (4, 5), THROTTLE: (7, 6), ROLL: (8, 9), PITCH: (10, 11), TILT: (12, 13), ZOOM: (14, 15)}
"""Axis -> the buttons that stand for its lower and its upper end."""

_ONLY = 1 << ListFlags.FIRST | 1 << ListFlags.LAST
_EMPTY = 1 << ListFlags.EMPTY

_AXES = {
    YAW: AxisAction.YAW,
    THROTTLE: AxisAction.GAZ,
    ROLL: AxisAction.ROLL,
    PITCH: AxisAction.PITCH,
    TILT: AxisAction.CAMERA_TILT,
    ZOOM: AxisAction.CAMERA_ZOOM,
}
_BUTTONS = {
    RETURN_HOME: ButtonAction.RETURN_HOME,
    TAKEOFF_LAND: ButtonAction.TAKEOFF_LAND,
    RESET_CAMERA: ButtonAction.CENTER_CAMERA,
}

Forward = Callable[[Message | UnknownMessage, float], None]


class Skycontroller:
    """One controller with its drone.

    `send` sends its own messages while a client is connected.
    """

    def __init__(
        self,
        generation: int,
        drone: DeviceInfo,
        forward: Forward,
        note: Callable[[str, dict[str, Any]], None],
        radio: Callable[[bool], None],
    ) -> None:
        """Create the controller of `drone`.

        `forward` passes a command to the drone, `radio` sets whether the drone receives the controller.
        """
        self.drone = drone
        self.info = DeviceInfo(
            MODELS[generation], f"PI0{40 + generation}{drone.serial[-13:]:0>13}", drone.port, f"SC{generation}"
        )
        self.battery = 87
        """Percent."""
        self.attitude = (0.0, 0.0, 0.0)
        """Roll, pitch, yaw in rad of the thing in the pilot's hands."""
        self.position: tuple[float, float, float] | None = None
        """deg, deg, m above sea level; None while its GPS has no fix. See `locate`."""
        self.source = Source.SKY_CONTROLLER
        self.axes = [0] * 6
        """Percent that each axis is deflected."""
        self.grabbed_buttons = 0
        self.grabbed_axes = 0
        self.send: Callable[[Message], object] | None = None
        self.flying_state = FlyingState.LANDED
        """Last state that the drone reported; it decides the function of the take-off button."""
        self.returning = False
        self.knows_drone = True
        """It would connect to the drone again by itself."""
        self.dropped = 0
        """PCMDs that did not reach the drone because the sticks fly it."""
        self._manager = DeviceManager(drone) if generation >= 4 else None
        """Protobuf services; None on a controller before generation 4."""
        self._calibration: list[tuple[float, skyctrl.State]] = []
        """Future steps of the controller's magnetometer calibration: (time, state)."""
        self._pressed = 0
        self._forward = forward
        self._note = note
        self._set_radio = radio
        self._radio = True
        self._now = 0.0
        self._next_attitude = 0.0
        self._next_place = 0.0
        self._next_sticks = 0.0
        self._to_let_go = 0

    # -- what the pilot does

    def stick(self, axis: int, percent: int) -> None:
        """Hold an axis at -100..100."""
        if not 0 <= axis < 6 or not -100 <= percent <= 100:
            raise ValueError(f"axis {axis} at {percent} %")
        before, self.axes[axis] = self.axes[axis], percent
        self._note("stick", {"axis": axis, "percent": percent})
        for button, sign in zip(_AXIS_BUTTONS[axis], (-1, 1), strict=True):
            was, now = before == sign * 100, percent == sign * 100
            if was != now:
                self._button(button, now)
        if before == percent:
            return
        if self.grabbed_axes >> axis & 1:
            self._tell(mapper.GrabAxisEvent(axis, percent))
        elif axis == TILT:
            frame, none = gimbal.FrameOfReference.ABSOLUTE, gimbal.FrameOfReference.NONE
            speed = percent / 100.0
            velocity = gimbal.ControlMode.VELOCITY
            self._forward(gimbal.SetTarget(0, velocity, none, 0.0, frame, speed, none, 0.0), self._now)
        elif axis == ZOOM:
            self._forward(camera.SetZoomTarget(0, camera.ZoomControlMode.VELOCITY, percent / 100.0), self._now)
        else:
            self._to_let_go = LETTING_GO
            self._next_sticks = self._now

    def press(self, button: int) -> None:
        """Press one of the four buttons; `release` it later."""
        self._button(button, True)

    def release(self, button: int) -> None:
        self._button(button, False)

    def _button(self, button: int, down: bool) -> None:
        mask = 1 << button
        self._pressed = self._pressed | mask if down else self._pressed & ~mask
        if button < 4:
            self._note("button", {"button": button, "pressed": down})
        if self.grabbed_buttons & mask:
            self._tell(mapper.GrabButtonEvent(button, ButtonEvent.PRESS if down else ButtonEvent.RELEASE))
        elif down:
            action = self._action(button)
            if action is not None:
                self._forward(action, self._now)

    def _action(self, button: int) -> Message | None:
        if button == RETURN_HOME:
            return rth.Abort() if self.returning else rth.ReturnToHome()
        if button == TAKEOFF_LAND:
            down = (FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY)
            return ardrone3.TakeOff() if self.flying_state in down else ardrone3.Landing()
        if button == RESET_CAMERA:
            return gimbal.ResetOrientation(0)
        if button == RESET_ZOOM:
            return camera.ResetZoom(0)
        return None

    def locate(self, latitude: float, longitude: float, altitude: float) -> None:
        """Carry the controller to a place (deg, deg, m above sea level) where its GPS has a fix."""
        self.position = (latitude, longitude, altitude)
        self._note("controller gps", {"latitude": latitude, "longitude": longitude})
        self._tell(*self._place_messages())
        self._next_place = self._now

    def _place_messages(self) -> list[Message]:
        if self.position is None:
            return [skyctrl.GpsFixChanged(0), skyctrl.GpsPositionChanged(500.0, 500.0, 500.0, 500.0)]
        return [skyctrl.GpsFixChanged(1), skyctrl.GpsPositionChanged(*self.position, 0.0)]

    # -- the radio between controller and drone

    @property
    def radio(self) -> bool:
        """False when the drone is out of the controller's reach; the client stays connected to it."""
        return self._radio

    @radio.setter
    def radio(self, up: bool) -> None:
        if up == self._radio:
            return
        self._radio = up
        self._set_radio(up)
        self._tell(self._connection())
        self._tell(mapper.ActiveProduct(self.drone.model_id if up else 0))
        if self._manager is not None:
            self._tell(self._manager.state(up, self.knows_drone))

    def _connection(self) -> Message:
        drone = self.drone
        state = Connection.CONNECTED if self._radio else Connection.SEARCHING
        return drone_manager.ConnectionState(state, drone.serial, drone.model_id, drone.name)

    # -- the link to the controller that is connected

    def link_up(self, send: Callable[[Message], object]) -> None:
        """Handle the connection of a client."""
        self.send = send

    def link_lost(self) -> None:
        """They are gone: the sticks fly again."""
        self.send = None
        self._grab(0, 0)
        self._set_source(Source.SKY_CONTROLLER)

    def tick(self, now: float) -> None:
        """Attitude and PCMDs as they become due."""
        self._now = now
        if now >= self._next_attitude:
            self._next_attitude = max(self._next_attitude + ATTITUDE_PERIOD, now)
            self._tell(skyctrl.AttitudeChanged(*_quaternion(*self.attitude)))
        if self.position is not None and self._radio and now >= self._next_place:
            self._next_place = now + PLACE_PERIOD
            self._forward(ardrone3.SendControllerGPS(*self.position, 2.0, 3.0), now)
        while self._calibration and now >= self._calibration[0][0]:
            self._tell(skyctrl.MagnetoCalibrationStateV2(self._calibration.pop(0)[1]))
        if self.source is not Source.SKY_CONTROLLER or now < self._next_sticks:
            return
        sticks = [0 if self.grabbed_axes >> axis & 1 else self.axes[axis] for axis in (ROLL, PITCH, YAW, THROTTLE)]
        if any(sticks):
            self._to_let_go = LETTING_GO
        elif self._to_let_go:
            self._to_let_go -= 1
        else:
            return
        self._next_sticks = max(self._next_sticks + STICKS_PERIOD, now)
        roll, pitch, yaw, gaz = sticks
        self._forward(ardrone3.PCMD(1 if roll or pitch else 0, roll, pitch, yaw, gaz, 0), now)

    def heard_from_drone(self, message: Message) -> None:
        """An event of the drone passes."""
        if isinstance(message, ardrone3.FlyingStateChanged):
            self.flying_state = message.state
        elif isinstance(message, rth.State):
            self.returning = message.state in (rth.RthState.IN_PROGRESS, rth.RthState.PENDING)

    def receive(self, message: Message | UnknownMessage, now: float) -> bool:
        """Handle a message of the client; return False when it is for the drone."""
        self._now = now
        match message:
            case skyctrl.AllStates():
                self._tell(*self._states(), skyctrl.AllStatesChanged())
            case skyctrl.AllSettings():
                self._tell(*self._settings(), skyctrl.AllSettingsChanged())
            case skyctrl.CurrentDateTime(text):
                self._tell(skyctrl.CurrentDateTimeChanged(text))
            case skyctrl.SetPilotingSource(source):
                self._set_source(source)
                self._tell(skyctrl.PilotingSource(self.source))
            case skyctrl.EnableMagnetoCalibrationQualityUpdates(enable):
                self._tell(skyctrl.MagnetoCalibrationQualityUpdatesState(int(enable != 0)))
            case skyctrl.StartCalibration():
                self._calibrate()
            case skyctrl.AbortCalibration():
                self._calibration.clear()
                self._tell(skyctrl.MagnetoCalibrationStateV2(skyctrl.State.CALIBRATED))
            case drone_manager.DiscoverDrones():
                self._tell(self._list_item())
            case drone_manager.Connect(serial, _):
                if serial == self.drone.serial:
                    self._tell(self._connection())
            case drone_manager.Forget(serial):
                if serial == self.drone.serial:
                    self.knows_drone = False
                self._tell(self._known_item())
            case mapper.Grab(buttons, axes):
                self._grab(buttons & 0xFFFF, axes & 0x3F)
                self._tell(self._grab_state())
                for axis in range(6):
                    if axes >> axis & 1 and self.axes[axis]:
                        self._tell(mapper.GrabAxisEvent(axis, self.axes[axis]))
            case mapper.ResetMapping():
                self._tell(*self._mapping())
            case mapper.EnterVolatileMapping() | mapper.ExitVolatileMapping():
                self._tell(mapper.VolatileMappingState(int(isinstance(message, mapper.EnterVolatileMapping))))
            case ardrone3.PCMD() if self.source is Source.SKY_CONTROLLER:
                self.dropped += 1
            case ProtobufMessage() if self._manager is not None:
                if isinstance(message, device_manager.ForgetDevice) and message.uid == self.drone.serial:
                    self.knows_drone = False
                answer = self._manager.handle(message, self._radio, self.knows_drone)
                self._tell(*(answer or ()))
                return answer is not None or not self._radio
            case Message() | UnknownMessage():
                project = message.id.project if isinstance(message, UnknownMessage) else message.ID.project
                # What is left of its own projects it has no answer to.
                return project in (4, 137, 138) or not self._radio
        return True

    def _calibrate(self) -> None:
        """Calibrate the magnetometer as if the pilot turned the controller, one axis a second."""
        if not self._calibration:
            axes = (skyctrl.State.CALIBRATING_X, skyctrl.State.CALIBRATING_Y, skyctrl.State.CALIBRATING_Z)
            self._calibration = [(self._now + n, one) for n, one in enumerate((*axes, skyctrl.State.CALIBRATED))]

    def _tell(self, *messages: Message) -> None:
        if self.send is not None:
            for message in messages:
                self.send(message)

    def _grab(self, buttons: int, axes: int) -> None:
        if (buttons, axes) != (self.grabbed_buttons, self.grabbed_axes):
            self.grabbed_buttons, self.grabbed_axes = buttons, axes
            self._note("grab", {"buttons": buttons, "axes": axes})

    def _set_source(self, source: Source) -> None:
        if source in (Source.SKY_CONTROLLER, Source.CONTROLLER) and source != self.source:
            self.source = Source(source)
            self._note("piloting source", {"source": self.source.name})

    def _grab_state(self) -> Message:
        return mapper.GrabState(self.grabbed_buttons, self.grabbed_axes, self._pressed & self.grabbed_buttons)

    def _list_item(self) -> Message:
        drone = self.drone
        visible = 1 << drone_manager.VisibleState.WIFI_VISIBLE
        return drone_manager.DroneListItem(
            drone.serial, drone.model_id, drone.name, 1, 1, visible, drone_manager.Security.WPA2, 1, -40, _ONLY
        )

    def _known_item(self) -> Message:
        drone, secret = self.drone, drone_manager.Security.WPA2
        if not self.knows_drone:
            return drone_manager.KnownDroneItem("", 0, "", secret, 0, _EMPTY)
        return drone_manager.KnownDroneItem(drone.serial, drone.model_id, drone.name, secret, 1, _ONLY)

    def _states(self) -> list[Message]:
        drone = self.drone
        return [
            self._known_item(),
            self._list_item(),
            self._connection(),
            mapper.ActiveProduct(drone.model_id if self._radio else 0),
            self._grab_state(),
            *self._mapping(),
            mapper.VolatileMappingState(0),
            skyctrl.PilotingSource(self.source),
            skyctrl.BatteryChanged(self.battery),
            skyctrl.BatteryState(skyctrl.BatteryStatus.DISCHARGING),
            *self._place_messages(),
            skyctrl.MagnetoCalibrationQualityUpdatesState(0),
            skyctrl.MagnetoCalibrationState(skyctrl.CalibrationStatus.CALIBRATED, 255, 255, 255),
            skyctrl.MagnetoCalibrationStateV2(skyctrl.State.CALIBRATED),
        ]

    def _settings(self) -> list[Message]:
        return [
            skyctrl.ProductSerialChanged(self.info.serial),
            skyctrl.ProductVersionChanged(SOFTWARE, HARDWARE),
        ]

    def _mapping(self) -> list[Message]:
        """The factory's mapping of the drone's product."""
        product = self.drone.model_id
        rows: list[Message] = []
        for index, (button, action) in enumerate(_BUTTONS.items()):
            flags = _place(index, len(_BUTTONS))
            rows.append(mapper.ButtonMappingItem(index, product, action, 1 << button, flags))
        for index, (axis, axis_action) in enumerate(_AXES.items()):
            rows.append(mapper.AxisMappingItem(index, product, axis_action, axis, 0, _place(index, len(_AXES))))
        rows.append(mapper.ExpoMapItem(0, product, 0, mapper.ExpoType.LINEAR, _EMPTY))
        rows.append(mapper.InvertedMapItem(0, product, 0, 0, _EMPTY))
        return rows


def _place(index: int, count: int) -> int:
    """list_flags of one row of several."""
    return (index == 0) << ListFlags.FIRST | (index == count - 1) << ListFlags.LAST


def _quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """w, x, y, z of aerospace angles (rad), North-East-Down."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
