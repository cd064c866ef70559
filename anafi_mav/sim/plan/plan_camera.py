"""Camera actions of a flight plan: photos, series of photos, recordings."""

from __future__ import annotations

from collections.abc import Callable

from anafi_mav.arsdk.messages import camera
from anafi_mav.arsdk.messages.common import MavlinkType
from anafi_mav.sim.payload.camera_operator import CameraOperator
from anafi_mav.sim.plan.plan_file import PlanCommand, PlanLine


class PlanCamera:
    """The camera in the hands of the plan that plays."""

    def __init__(self, operator: CameraOperator) -> None:
        self._operator = operator
        self._type = MavlinkType.FLIGHT_PLAN
        self._still: tuple[float, float] = (0.0, 0.0)
        self._photos = 0
        """How many are to be taken before photographing ends by itself; 0: it does not."""

    def start(self, type: MavlinkType) -> None:
        """A plan of this type begins: nothing of the one before holds."""
        self._type = type
        self._still, self._photos = (0.0, 0.0), 0

    def tick(self) -> None:
        """End a series that has all its photos."""
        if self._photos and self._operator.shots >= self._photos:
            self._photos = 0
            self._operator.operate(camera.StopPhoto(0))

    def count(self, item: PlanLine) -> float:
        """How many photos START_PHOTO is for; 0: until it is stopped."""
        return item.p3 if self._type is MavlinkType.FLIGHT_PLAN_V2 else item.p2

    def carry_out(self, item: PlanLine) -> None:
        """Begin one of `COMMANDS`."""
        COMMANDS[item.command](self, item)

    def _still_mode(self, item: PlanLine) -> None:
        self._still = (item.p1, item.p2)

    def _start_photo(self, item: PlanLine) -> None:
        interval = item.p2 if self._type is MavlinkType.FLIGHT_PLAN_V2 else item.p1
        mode, step = camera.CameraPhotoMode.SINGLE, 0.0
        if self.count(item) != 1:
            gps = self._still[0] == 1 and not interval > 0.0
            mode = camera.CameraPhotoMode.GPS_LAPSE if gps else camera.CameraPhotoMode.TIME_LAPSE
            step = interval if interval > 0.0 else self._still[1]
        self._photograph(mode, step)
        self._photos = int(self.count(item)) if self.count(item) > 1 else 0

    def _trigger(self, item: PlanLine) -> None:
        if not item.p1 > 0.0:
            self._stop_photo(item)
        elif item.command is PlanCommand.TRIGGER_DISTANCE:
            self._photograph(camera.CameraPhotoMode.GPS_LAPSE, item.p1)
        else:
            self._photograph(camera.CameraPhotoMode.TIME_LAPSE, item.p1 / 1000.0)

    def _photograph(self, mode: camera.CameraPhotoMode, step: float) -> None:
        self._photos = 0
        self._operator.operate(camera.SetCameraMode(0, camera.CameraCameraMode.PHOTO))
        self._operator.operate(
            camera.SetPhotoMode(
                0,
                mode,
                camera.PhotoFormat.RECTILINEAR,
                camera.PhotoFileFormat.JPEG,
                camera.BurstValue.BURST_14_OVER_1S,
                camera.BracketingPreset.PRESET_1EV,
                step,
            )
        )
        self._operator.operate(camera.TakePhoto(0))

    def _stop_photo(self, item: PlanLine) -> None:
        self._photos = 0
        self._operator.operate(camera.StopPhoto(0))

    def _start_video(self, item: PlanLine) -> None:
        self._operator.operate(camera.SetCameraMode(0, camera.CameraCameraMode.RECORDING))
        self._operator.operate(camera.StartRecording(0))

    def _stop_video(self, item: PlanLine) -> None:
        self._operator.operate(camera.StopRecording(0))


COMMANDS: dict[PlanCommand, Callable[[PlanCamera, PlanLine], None]] = {
    PlanCommand.TRIGGER_DISTANCE: PlanCamera._trigger,
    PlanCommand.TRIGGER_INTERVAL: PlanCamera._trigger,
    PlanCommand.START_PHOTO: PlanCamera._start_photo,
    PlanCommand.STOP_PHOTO: PlanCamera._stop_photo,
    PlanCommand.START_VIDEO: PlanCamera._start_video,
    PlanCommand.STOP_VIDEO: PlanCamera._stop_video,
    PlanCommand.SET_STILL_MODE: PlanCamera._still_mode,
}
