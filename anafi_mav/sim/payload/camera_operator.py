"""Camera control for the autopilot: aiming, zooming and taking pictures.

Used by flight plans, animations and points of interest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import camera, gimbal
from anafi_mav.arsdk.messages.gimbal import ControlMode, FrameOfReference
from anafi_mav.sim.payload.gimbal import Gimbals
from anafi_mav.sim.payload.payload import Payload
from anafi_mav.sim.world.motion import Pose


class CameraOperator:
    """One drone's. `moment` gives the simulated time (s) and the pose."""

    def __init__(
        self,
        gimbals: Gimbals,
        payload: Payload,
        moment: Callable[[], tuple[float, Pose]],
        emit: Callable[[Message], None],
        note: Callable[[str, dict[str, Any]], None],
    ) -> None:
        self._gimbals = gimbals
        self._payload = payload
        self._moment = moment
        self._emit = emit
        self._note = note

    @property
    def tilt(self) -> float:
        """Of the camera, deg above the horizon."""
        time, pose = self._moment()
        self._gimbals.advance(time)
        return self._gimbals.attitude(pose).pitch_absolute

    def aim(self, elevation: float) -> None:
        """Point the camera so far above the horizon (deg); the other axes stay as they are."""
        time, pose = self._moment()
        none, absolute = FrameOfReference.NONE, FrameOfReference.ABSOLUTE
        target = gimbal.SetTarget(0, ControlMode.POSITION, none, 0.0, absolute, elevation, none, 0.0)
        self._gimbals.handle(target, pose, time, True)

    def zoom(self, level: float) -> None:
        time, _ = self._moment()
        command = camera.SetZoomTarget(0, camera.ZoomControlMode.LEVEL, level)
        self._tell(self._payload.operate(command, time))

    def operate(self, message: Message) -> None:
        """Let the payload take a command, in the older camera's words."""
        self._note("payload", {"command": message.NAME})
        self._tell(self._payload.operate(message, self._moment()[0]))

    @property
    def camera_busy(self) -> bool:
        return self._payload.cameras.busy

    @property
    def shots(self) -> int:
        """Pictures that have been taken of what is being photographed."""
        return self._payload.cameras.shots

    def panorama_begin(self, kind: str, count: int) -> None:
        """Begin a panorama: one media of `count` pictures.

        `kind` is the web server's name of the panorama, or empty.
        """
        self._note("payload", {"panorama": kind, "count": count})
        self._tell(self._payload.panorama_begin(kind, count, self._moment()[0]))

    def panorama_shot(self) -> None:
        """One of them, now."""
        self._tell(self._payload.panorama_shot(self._moment()[0]))

    def panorama_end(self) -> None:
        """That was all."""
        self._tell(self._payload.panorama_end(self._moment()[0]))

    def _tell(self, messages: Iterable[Message]) -> None:
        for message in messages:
            self._emit(message)
