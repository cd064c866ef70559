"""Events of values: kept undecoded, read later, and reported together. The result is that of handling each at once."""

from __future__ import annotations

import asyncio
import random
import struct
from typing import Annotated, Any

import pytest
from support.scripted_device import ScriptedDevice
from support.values import arrived

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.codec.wire import Message, join, receive, unpacked
from anafi_mav.arsdk.messages import ardrone3, camera, gimbal
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.drone import Drone, Velocity
from anafi_mav.drone.element import StateWatch, defer
from anafi_mav.drone.expectation import Commander
from anafi_mav.drone.payload.gimbal import Gimbal
from anafi_mav.drone.piloting.state import Attitude
from anafi_mav.drone.status.gps import Gps
from anafi_mav.drone.values import VALUES, Values
from anafi_mav.errors import LocalProtocolError

BOUNDS = (b"\0\0\0\0", b"\xff\xff\xff\xff", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\0\x80", b"\1\0\0\0")
"""Zero, ones, not a number, infinity, minus zero, one: as floats, as integers or as halves of doubles."""


def noise(kind: type[Message], rng: random.Random) -> Values:
    """An event of values with any bytes, of one of two cameras or gimbals if it is of one."""
    arguments = b"".join(rng.choice(BOUNDS) if rng.random() < 0.3 else rng.randbytes(4) for _ in range(16))
    (received,) = receive([struct.pack("<BBHB", *kind.ID, rng.randrange(2)) + arguments])
    assert isinstance(received, Values)
    assert received.layout.kinds == (kind,)
    return received


def shown(state: object) -> str:
    """A state in words: NaN differs from itself, and minus zero replaces no zero."""
    return repr(state).replace("-0.0", "0.0")


async def test_deferred_values_give_the_states_of_values_reduced_at_once() -> None:
    drone, rng = Drone("127.0.42.1"), random.Random(1)
    deferring = [element for element in drone._elements if element.REDUCERS.keys() & VALUES]
    assert {kind for element in deferring for kind in element.REDUCERS} & VALUES == VALUES - {ardrone3.PositionChanged}
    for element in deferring:
        kinds = [kind for kind in element.REDUCERS if kind in VALUES]
        state: Any = element.NOTHING
        for step in range(2000):
            together = [noise(kind, rng) for kind in rng.sample(kinds, rng.randint(1, len(kinds)))]
            for event in together:
                (message,) = event.messages()
                state = element.REDUCERS[type(message)](state, message)
            defer(element, join(together))
            if rng.random() < 0.2:
                assert shown(element.state) == shown(state), f"{type(element).__name__}, step {step}"
        assert shown(element.state) == shown(state)


@pytest.mark.parametrize("kind", sorted(VALUES, key=lambda kind: kind.NAME), ids=lambda kind: kind.NAME)
def test_value_that_is_too_short_is_not_received(kind: type[Message]) -> None:
    whole = noise(kind, random.Random(2))
    size = next(size for size in range(64) if wire.decode(whole.data[:size]) is not None and size >= 4)
    assert receive([whole.data[: size - 1]]) == []
    assert repr(list(unpacked([whole]))) == repr([wire.decode(whole.data[:size])])


def test_event_of_values_has_arguments_of_fixed_size_and_a_byte_as_number() -> None:
    class Text(Message, frozen=True):
        name: Annotated[str, wire.STRING]

    class Wide(Message, frozen=True):
        id: Annotated[int, wire.U16]

    for declared, of in ((Text, None), (Wide, "id")):
        with pytest.raises(LocalProtocolError):
            wire.value("test.wrong", 250, 7, 1, of=of)(declared)


def test_newer_value_replaces_that_of_the_same_gimbal_alone() -> None:
    element = Gimbal(Commander())
    for id, pitch in ((0, 10.0), (1, 20.0), (0, 30.0)):
        frames = (gimbal.FrameOfReference.RELATIVE,) * 3
        defer(element, arrived(gimbal.Attitude(id, *frames, 0.0, pitch, 0.0, 0.0, 0.0, 0.0)))
    assert [element[id].attitude.relative.pitch for id in (0, 1)] == [30.0, 20.0]  # type: ignore[union-attr]


def test_watch_notices_a_deferred_value() -> None:
    gps = Gps()
    watch = StateWatch(gps)
    assert watch.has_changed()
    defer(gps, arrived(ardrone3.GpsLocationChanged(48.0, 2.0, 100.0, 1, 1, 1)))
    assert watch.has_changed()
    assert not watch.has_changed()


def test_reset_forgets_deferred_values() -> None:
    gps = Gps()
    defer(gps, arrived(ardrone3.GpsLocationChanged(48.0, 2.0, 100.0, 1, 1, 1)))
    gps.reset()
    assert gps.state == Gps.NOTHING
    assert gps.settled == Gps.NOTHING


async def test_settled_state_has_events_but_no_waiting_values() -> None:
    piloting = Drone("127.0.42.1").piloting
    landed = ardrone3.FlyingStateChanged(FlyingState.LANDED)
    piloting.set_state(piloting.REDUCERS[ardrone3.FlyingStateChanged](piloting.state, landed))
    defer(piloting, arrived(ardrone3.SpeedChanged(1.0, 2.0, 3.0)))
    assert (piloting.settled.flying, piloting.settled.velocity) == (FlyingState.LANDED, None)
    assert (piloting.state.flying, piloting.state.velocity) == (FlyingState.LANDED, Velocity(1.0, 2.0, 3.0))
    assert piloting.settled.velocity == Velocity(1.0, 2.0, 3.0)


ATTITUDE, OTHER_ATTITUDE = ardrone3.AttitudeChanged(0.5, 0.0, 0.0), ardrone3.AttitudeChanged(0.25, 0.0, 0.0)
SPEED = ardrone3.SpeedChanged(1.0, 2.0, 3.0)
ZOOM = camera.ZoomLevel(0, 2.0)


class Journal:
    """What the subscribers of a drone are called with, in sequence, with the roll that the state has then."""

    def __init__(self, drone: Drone) -> None:
        self._drone = drone
        self.lines: list[tuple[Any, ...]] = []
        self._last = asyncio.Event()
        drone.subscribe_values(self._on_values)

    def _roll(self) -> float:
        attitude = self._drone.piloting.state.attitude
        return -1.0 if attitude is None else attitude.roll

    def _on_values(self, values: Values, now: float) -> None:
        messages = tuple(values.messages())
        assert tuple(map(type, messages)) == values.layout.kinds
        self.lines.append((*(type(message).__name__ for message in messages), self._roll()))
        if camera.ZoomLevel in values:
            self._last.set()

    def on_message(self, message: Message, now: float) -> None:
        self.lines.append((message, self._roll()))

    async def end(self) -> None:
        """Return after the frame with the zoom."""
        await asyncio.wait_for(self._last.wait(), 3.0)


async def test_values_of_a_frame_are_reported_together_until_one_is_repeated(
    drone: Drone, device: ScriptedDevice
) -> None:
    journal = Journal(drone)
    device.say(ATTITUDE, SPEED, OTHER_ATTITUDE, ZOOM)
    await journal.end()
    assert journal.lines == [("AttitudeChanged", "SpeedChanged", 0.5), ("AttitudeChanged", "ZoomLevel", 0.25)]


async def test_values_behind_the_end_of_a_session_are_not_received(drone: Drone, device: ScriptedDevice) -> None:
    """A Skycontroller that loses its drone ends the session while a frame is handled."""
    journal, session = Journal(drone), drone._session
    assert session is not None
    drone.subscribe(lambda message, now: session.end("test"), without=VALUES - {ardrone3.SpeedChanged})
    device.say(SPEED, ATTITUDE, ZOOM)
    await asyncio.wait_for(asyncio.shield(session.lost), 3.0)
    await asyncio.sleep(0)  # to the end of the frame
    assert journal.lines == []
    assert drone.piloting.state.attitude is None


async def test_value_behind_the_end_of_a_session_by_values_is_not_received(
    drone: Drone, device: ScriptedDevice
) -> None:
    session = drone._session
    assert session is not None
    drone.subscribe_values(lambda values, now: session.end("test"))
    device.say(ATTITUDE, OTHER_ATTITUDE, ZOOM)  # the second attitude has the first one reported
    await asyncio.wait_for(asyncio.shield(session.lost), 3.0)
    await asyncio.sleep(0)  # to the end of the frame
    attitude = drone.piloting.state.attitude
    assert attitude is not None
    assert attitude.roll == 0.5


async def test_subscriber_gets_each_value_after_those_before_it_are_reported(
    drone: Drone, device: ScriptedDevice
) -> None:
    journal = Journal(drone)
    undo = drone.subscribe(journal.on_message, without=VALUES - {ardrone3.SpeedChanged})
    device.say(ATTITUDE, SPEED, OTHER_ATTITUDE, SPEED, ZOOM)
    await journal.end()
    assert journal.lines == [
        ("AttitudeChanged", 0.5),
        (SPEED, 0.5),
        ("SpeedChanged", "AttitudeChanged", 0.25),
        (SPEED, 0.25),
        ("SpeedChanged", "ZoomLevel", 0.25),
    ]
    undo()
    journal.lines.clear()
    journal._last.clear()
    device.say(SPEED, ZOOM)
    await journal.end()
    assert journal.lines == [("SpeedChanged", "ZoomLevel", 0.25)]


async def test_subscriber_of_all_messages_gets_every_value(drone: Drone, device: ScriptedDevice) -> None:
    heard: list[Message] = []
    journal = Journal(drone)
    drone.subscribe(lambda message, now: heard.append(message))
    device.say(ATTITUDE, OTHER_ATTITUDE, SPEED, ATTITUDE, ZOOM)
    await journal.end()
    assert heard == [ATTITUDE, OTHER_ATTITUDE, SPEED, ATTITUDE, ZOOM]


async def test_expectation_gets_a_value_that_is_replaced_in_the_same_frame(
    drone: Drone, device: ScriptedDevice
) -> None:
    journal = Journal(drone)
    expected = asyncio.ensure_future(drone.expect(ardrone3.AttitudeChanged, lambda message: message.roll == 0.5))
    await asyncio.sleep(0)
    device.say(ATTITUDE, OTHER_ATTITUDE, ZOOM)
    assert await expected == ATTITUDE
    await journal.end()
    assert drone.piloting.state.attitude == Attitude(0.25, 0.0, 0.0)


async def test_failing_subscriber_of_values_does_not_affect_others(
    drone: Drone, device: ScriptedDevice, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(values: Values, now: float) -> None:
        raise RuntimeError("mine")

    undo = drone.subscribe_values(fail)
    journal = Journal(drone)
    device.say(ATTITUDE, ZOOM)
    await journal.end()
    assert "a subscriber failed on ardrone3.PilotingState.AttitudeChanged, camera.zoom_level" in caplog.text
    undo()
    caplog.clear()
    device.say(ATTITUDE, ZOOM)
    journal._last.clear()
    await journal.end()
    assert not caplog.text
