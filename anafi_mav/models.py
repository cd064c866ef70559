"""The models of the ANAFI family, a record each: facts needed before a drone reports any.

They are facts of Parrot's data sheets and of the anafi_ros paper's table of models, and shared by all rooms. Values
that a drone reports are not here: the simulator sends its own, and the other side takes what it receives. Figures of
the airframe are not here either: they are the simulator's (`sim.world.model`).
"""

from __future__ import annotations

import enum
from typing import Literal

import msgspec


class PayloadSensor(enum.Enum):
    """A sensor besides the main camera."""

    THERMAL = "thermal camera"
    STEREO = "stereo camera"


class Intrinsics(msgspec.Struct, frozen=True):
    """Pinhole model of the live video at zoom 1, in pixels.

    Distortion as in OpenCV's five-parameter model. Parrot publishes no calibration. These are the ones that anafi_ros
    carries (camera/camera_info of its paper), each measured on one drone of its model; another of the same model
    differs
    by about a percent.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float


class PlanFigures(msgspec.Struct, frozen=True, kw_only=True):
    """Figures for writing and checking a flight plan without a drone (anafi_ros paper)."""

    version: Literal[1, 2]
    """Of Parrot's flight-plan format."""
    max_speed: float
    """m/s over ground."""
    ceiling: float
    """m above mean sea level."""
    flight_time: float
    """s of a full battery."""


class Model(msgspec.Struct, frozen=True, kw_only=True):
    """A model of the ANAFI family, by the number in its announcement (discovery's model.id)."""

    id: int
    key: str
    """Short name as used in configurations: "4k"."""
    title: str
    protobuf: bool
    """True for models that report some of their states in protobuf only, on request."""
    lens: Intrinsics | None
    """Lens of its main camera; None when no calibration is known."""
    payloads: tuple[PayloadSensor, ...]
    """Its sensors besides the main camera."""
    battery_cells: int | None
    """Cells in series, where the drone does not report them; None when unknown."""
    plan_figures: PlanFigures | None
    """None when it is not known what plans it flies."""
    skycontrollers: tuple[int, ...]
    """The generations of Skycontroller that fly it."""
    firmware: tuple[int, ...]
    """First parts of the version that this program is written for; later ones are taken to be like it."""
    simulated: bool
    """True when `sim.world.model` has its airframe, so that a configuration may ask for a simulated one."""

    @property
    def plan_version(self) -> int | None:
        """Version of Parrot's flight-plan format that it flies.

        None when the model alone does not decide it.
        """
        return None if self.plan_figures is None else self.plan_figures.version

    def plans(self) -> PlanFigures:
        """Return the figures of its flight plans.

        Raises `ValueError` when they are not known.
        """
        if self.plan_figures is None:
            raise ValueError(f"{self.title}: it is not known what plans it flies")
        return self.plan_figures


MODELS: dict[str, Model] = {}
"""By key, in the order in which they are listed to people."""

BY_ID: dict[int, Model] = {}
"""The same records by the number that a drone announces, in its order."""


def add(model: Model) -> None:
    """Make a model known to every room. Raises `ValueError` when its key or number is taken."""
    if model.key in MODELS or model.id in BY_ID:
        raise ValueError(f"model {model.key} (0x{model.id:04x}): there is one with this key or number")
    MODELS[model.key] = BY_ID[model.id] = model
    ordered = sorted(BY_ID.items())
    BY_ID.clear()
    BY_ID.update(ordered)


def unknown(id: int) -> Model:
    """The record for a number that no model has: as little is assumed as possible."""
    return Model(
        id=id,
        key=f"0x{id:04x}",
        title="unknown model",
        protobuf=True,  # asking in protobuf does no harm to a drone without it
        lens=None,
        payloads=(),
        battery_cells=None,
        plan_figures=None,
        skycontrollers=(),
        firmware=(),
        simulated=False,
    )


NO_MODEL = msgspec.structs.replace(unknown(0), key="", title="", protobuf=False)
"""Before the first connection."""


def simulated() -> list[str]:
    """The keys of the models that can be simulated."""
    return [model.key for model in MODELS.values() if model.simulated]


def planned() -> dict[str, Model]:
    """The models that flight plans can be checked for and written for, by key."""
    return {key: model for key, model in MODELS.items() if model.plan_figures is not None}


for _model in (
    Model(
        id=0x0914,
        key="4k",
        title="ANAFI 4K",
        protobuf=False,
        lens=Intrinsics(1280, 720, 953.87, 948.50, 642.81, 345.59, 0.028871, -0.024042, 0.004109, 0.001563, 0.0),
        payloads=(),
        battery_cells=2,
        plan_figures=PlanFigures(version=1, max_speed=15.0, ceiling=4500.0, flight_time=25 * 60.0),
        skycontrollers=(3, 4),
        firmware=(1, 8),
        simulated=True,
    ),
    Model(
        id=0x0919,
        key="thermal",
        title="ANAFI Thermal",
        protobuf=False,
        lens=Intrinsics(1280, 720, 947.10, 949.49, 649.16, 365.35, 0.003086, 0.018344, 0.000088, 0.004435, 0.0),
        payloads=(PayloadSensor.THERMAL,),
        battery_cells=2,
        plan_figures=PlanFigures(version=1, max_speed=15.0, ceiling=4500.0, flight_time=26 * 60.0),
        skycontrollers=(3, 4),
        firmware=(1, 8),
        simulated=True,
    ),
    Model(
        id=0x091E,
        key="usa",
        title="ANAFI USA",
        protobuf=False,
        lens=Intrinsics(1280, 720, 927.10, 923.18, 646.77, 362.74, 0.006502, -0.012889, -0.001738, 0.002491, -0.01654),
        payloads=(PayloadSensor.THERMAL,),
        battery_cells=3,
        plan_figures=PlanFigures(version=1, max_speed=14.7, ceiling=6000.0, flight_time=32 * 60.0),
        skycontrollers=(3, 4),
        firmware=(1, 8),
        simulated=True,
    ),
    Model(
        id=0x091A,
        key="ai",
        title="ANAFI Ai",
        protobuf=True,
        lens=Intrinsics(1920, 1080, 1505.94, 1492.49, 997.28, 504.10, 0.05074, -0.046698, 0.001345, 0.007041, 0.0),
        payloads=(PayloadSensor.STEREO,),
        battery_cells=3,
        plan_figures=PlanFigures(version=2, max_speed=16.0, ceiling=5000.0, flight_time=32 * 60.0),
        skycontrollers=(4,),
        firmware=(7,),
        simulated=True,
    ),
    Model(
        id=0x091B,
        key="ua",
        title="ANAFI UA",
        protobuf=False,
        lens=None,
        payloads=(),
        battery_cells=3,
        plan_figures=None,
        skycontrollers=(),
        firmware=(1, 8),
        simulated=False,
    ),
):
    add(_model)
