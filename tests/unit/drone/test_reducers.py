"""Whatever a drone says, no reducer of the payload's elements raises, and no state grows without end."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

import pytest

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.envelope import ProtobufMessage
from anafi_mav.arsdk.codec.protobuf import FieldType, Map, Submessage, record_fields
from anafi_mav.arsdk.codec.wire import Message, OpenEnum
from anafi_mav.arsdk.messages import ardrone3, gimbal
from anafi_mav.arsdk.messages import camera as old
from anafi_mav.arsdk.messages.proto import camera2 as new
from anafi_mav.drone.automatic.animations import Animations
from anafi_mav.drone.automatic.flight_plan import FlightPlan
from anafi_mav.drone.automatic.follow_me import FollowMe
from anafi_mav.drone.automatic.poi import Poi
from anafi_mav.drone.controller.controller import Controller
from anafi_mav.drone.element import MAX_ITEMS, Element, finite, position
from anafi_mav.drone.payload.camera import Camera
from anafi_mav.drone.payload.camera_state import MAX_OPTIONS, CamerasState
from anafi_mav.drone.payload.gimbal import Gimbal
from anafi_mav.drone.payload.media import Media
from anafi_mav.drone.payload.storage import Storage
from anafi_mav.drone.payload.thermal import Thermal
from anafi_mav.drone.piloting.piloting import Piloting
from anafi_mav.drone.piloting.state import PilotingState, Velocity
from anafi_mav.drone.status.calibration import Calibration
from anafi_mav.drone.status.home import Home
from anafi_mav.drone.status.sound import Sound

ELEMENTS: list[type[Element[Any]]] = [
    Animations,
    Calibration,
    Camera,
    Controller,
    FlightPlan,
    FollowMe,
    Gimbal,
    Home,
    Media,
    Piloting,
    Poi,
    Sound,
    Storage,
    Thermal,
]

FLOATS = (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300, 0.5)
INTS = (0, 1, 2, 3, 7, 19, 255, 1 << 31)


def plain(message: type[Message], rng: random.Random) -> Message | None:
    """An event out of noise."""
    filler = rng.choice([0, 0xFF, 0x7F, 0x80])
    body = bytes(rng.randrange(256) if rng.random() < 0.5 else filler for _ in range(96)) + b"\0\0\0"
    event = wire.decode(struct.pack("<BBH", *message.ID) + body)
    return event if type(event) is message else None


def record(kind: type[Submessage], rng: random.Random, depth: int = 0) -> Any:
    """A record of random fields: anything that its bytes could make of it."""
    values: dict[str, Any] = {}
    for field in record_fields(kind):
        if rng.random() < 0.4:
            continue

        def one(field: Any = field) -> Any:
            number = rng.choice(INTS)
            if field.wire.kind is FieldType.RECORD:
                return record(field.python, rng, depth + 1)
            if isinstance(field.python, type) and issubclass(field.python, OpenEnum):
                return field.python(number)
            return {float: rng.choice(FLOATS), str: "x" * (number % 9), bool: number % 2 == 0}.get(field.python, number)

        if isinstance(field.wire, Map):
            values[field.name] = {rng.choice(INTS) + n: one() for n in range(rng.choice([1, 100]))}
        elif field.repeated:
            values[field.name] = tuple(one() for _ in range(rng.choice([0, 1, 3] if depth else [0, 1, 100])))
        else:
            values[field.name] = one()
    return kind(**values)


@pytest.mark.parametrize("element", ELEMENTS)
def test_no_reducer_raises(element: type[Element[Any]]) -> None:
    rng = random.Random(133)
    state = element.NOTHING
    for _ in range(40):
        for message, reducer in element.REDUCERS.items():
            event = record(message, rng) if issubclass(message, ProtobufMessage) else plain(message, rng)
            if event is not None:  # several strings, and too few ends in the noise
                state = reducer(state, event)
    for name in dir(type(state)):
        getattr(state, name)
    for one in state.values() if isinstance(state, dict) else state.cameras.values() if element is Camera else ():
        for name in dir(type(one)):
            getattr(one, name)


def test_reducers_listen_to_events_only() -> None:
    for element in ELEMENTS:
        for message in element.REDUCERS:
            assert message.DIRECTION is wire.Direction.EVENT, message


def test_maps_and_lists_do_not_grow_without_end() -> None:
    gimbals: Any = Gimbal.NOTHING
    cameras = CamerasState()
    for id in range(256):
        gimbals = Gimbal.REDUCERS[gimbal.Alert](gimbals, gimbal.Alert(id, 0))
        cameras = Camera.REDUCERS[old.ZoomLevel](cameras, old.ZoomLevel(id, 1.0))
        cameras = Camera.REDUCERS[old.PhotoCapabilities](
            cameras, old.PhotoCapabilities(id, 1, 1, 1, old.Supported.SUPPORTED, 0)
        )
    assert len(gimbals) == len(cameras.cameras) == MAX_ITEMS
    modern = CamerasState()
    for id in range(10 * MAX_ITEMS):
        modern = Camera.REDUCERS[new.State](modern, new.State(camera_id=id, active=True))
    assert len(modern.cameras) == len(modern.active) == MAX_ITEMS
    assert len(cameras.cameras[0].photos) == MAX_OPTIONS
    many = new.CameraList(cameras=dict.fromkeys(range(1000), new.CameraModel.MAIN))
    assert len(Camera.REDUCERS[new.CameraList](CamerasState(), many).cameras) == MAX_ITEMS


def test_number_that_no_float_of_32_bits_holds_is_unknown() -> None:
    assert finite(1e30) == 1e30
    for number in (1e300, -1e300, math.inf, math.nan):
        assert finite(number) is None
        assert position(48.0, 2.0, number) is None


@pytest.mark.parametrize("speed", [3e38, -3e38, math.inf, math.nan])
def test_speed_whose_amount_no_float_of_32_bits_holds_is_unknown(speed: float) -> None:
    """Each component fits one, and the ground speed of VFR_HUD does not."""
    reduce = Piloting.REDUCERS[ardrone3.SpeedChanged]
    known = reduce(PilotingState(), ardrone3.SpeedChanged(3.0, -4.0, 1.0))
    assert known.velocity == Velocity(3.0, -4.0, 1.0)
    assert reduce(known, ardrone3.SpeedChanged(speed, speed, 0.0)).velocity is None
