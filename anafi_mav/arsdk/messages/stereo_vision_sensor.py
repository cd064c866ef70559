"""Feature 159, stereo_vision_sensor (Ai)."""

from __future__ import annotations

from typing import Annotated

from anafi_mav.arsdk.codec.wire import ENUM, U8, U16, Bits, Message, OpenEnum, event


class Model(OpenEnum):
    FSTCAM = 0


class Feature(OpenEnum):
    CALIBRATION = 0


class StereoVisionSensorCalibrationState(OpenEnum):
    REQUIRED = 0
    OK = 1


@event("stereo_vision_sensor.capabilities", 159, 0, 1)
class Capabilities(Message, frozen=True):
    sensor_id: Annotated[int, U8]
    model: Annotated[Model, ENUM]
    supported_features: Annotated[int, Bits(U16, Feature)]


@event("stereo_vision_sensor.calibration_state", 159, 0, 2)
class CalibrationState(Message, frozen=True):
    sensor_id: Annotated[int, U8]
    state: Annotated[StereoVisionSensorCalibrationState, ENUM]
