"""What the drone element makes of a simulated model's camera reports, without a connection."""

from __future__ import annotations

from typing import Any

from anafi_mav.arsdk.messages.proto import antiflicker
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.camera_state import CamerasState
from anafi_mav.drone.payload.thermal import Thermal, ThermalState
from anafi_mav.services.camera_definition.catalogue import Catalogue
from anafi_mav.sim.payload.camera2 import Camera2
from anafi_mav.sim.payload.payload import Payload
from anafi_mav.sim.world.model import MODELS

MODEL_KEYS = ("4k", "thermal", "usa", "ai")


def payload(model: str) -> Payload:
    """The simulator's payload of a model; it takes no pictures here."""

    def scene() -> Any:
        raise AssertionError("no picture is taken")

    return Payload(MODELS[model], model, "run", lambda message: None, scene)


def states(model: str) -> tuple[CamerasState, ThermalState]:
    """The states after the reports of a connection."""
    parts = payload(model)
    cameras, thermal = CamerasState(), ThermalState()
    messages = parts.states_report()
    if isinstance(parts.cameras, Camera2):
        assert parts.services is not None
        mains = parts.services.handle(antiflicker.GetState(include_default_capabilities=True))
        messages += [parts.cameras.state(default=True), *(mains or ())]
    for message in messages:
        if type(message) in Camera.REDUCERS:
            cameras = Camera.REDUCERS[type(message)](cameras, message)
        if type(message) in Thermal.REDUCERS:
            thermal = Thermal.REDUCERS[type(message)](thermal, message)
    return cameras, thermal


def catalogue(model: str) -> Catalogue:
    """The settings of a simulated model."""
    found = Catalogue()
    found.learn(*states(model))
    return found
