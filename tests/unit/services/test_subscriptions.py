"""The table of event handlers: which are called for an event of the drone, and in which order."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.values import arrived

from anafi_mav.clock import SystemClock
from anafi_mav.drone import Drone, events
from anafi_mav.drone.events import FlyingState, Message
from anafi_mav.drone.piloting.state import PilotingState
from anafi_mav.drone.values import Values
from anafi_mav.mavlink.node import Node
from anafi_mav.services.plan.fence_service import FenceService
from anafi_mav.services.system import System
from anafi_mav.vehicle.base.subscriptions import ValueHandlers, ValueInterest, in_order


def test_handlers_of_several_tables_keep_table_order() -> None:
    called: list[str] = []

    def handler(name: str) -> Callable[[object, float], None]:
        return lambda message, now: called.append(f"{name} at {now}")

    joined = in_order(
        [
            {events.SpeedChanged: handler("vehicle")},
            {},
            {events.AttitudeChanged: handler("attitude"), events.SpeedChanged: handler("first")},
            {events.SpeedChanged: handler("second")},
        ]
    )
    assert joined.keys() == {events.SpeedChanged, events.AttitudeChanged}
    for call in joined[events.SpeedChanged]:
        call(None, 2.5)
    assert called == ["vehicle at 2.5", "first at 2.5", "second at 2.5"]


def test_events_with_the_same_handlers_share_them() -> None:
    class Owner:
        def handle(self, message: Message, now: float) -> None: ...

    owner = Owner()
    table = {events.SpeedChanged: owner.handle, events.AttitudeChanged: owner.handle}
    joined = in_order([table])
    assert joined[events.SpeedChanged] is joined[events.AttitudeChanged]
    assert ValueInterest(table).kinds is ValueInterest(reversed(table)).kinds


@pytest.mark.parametrize(
    ("kind", "owners"),
    [
        (
            events.FlyingStateChanged,
            "Vehicle MessageService EventService FenceService RallyService RollSignService OffboardFlight "
            "WarningService TakeoffPointService DownloadService",
        ),
        (events.MavlinkFilePlayingStateChanged, "MessageService MissionFlight System"),
        (events.MissionItemExecuted, "MissionFlight"),
        (events.SensorsStatesListChanged, "EventService WarningService System"),
    ],
    ids=lambda value: value.__name__ if isinstance(value, type) else "",
)
async def test_event_reaches_vehicle_then_services_then_change_messages(kind: type[Message], owners: str) -> None:
    clock = SystemClock()
    system = System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)
    joined = in_order(system.subscriptions())
    assert [call.__qualname__.partition(".")[0] for call in joined.get(kind, ())] == owners.split()


async def test_components_of_equal_drones_share_what_follows_from_their_streams() -> None:
    clock = SystemClock()
    node = Node(clock=clock)
    one, other = (System(node, Drone("127.0.42.1"), id, clock, 0.0, allow_kill=False) for id in (1, 2))
    assert len(one.components) == len(other.components) > 1
    for ours, theirs in zip(one.components, other.components, strict=True):
        assert ours.telemetry is theirs.telemetry
        assert ours.own_commands is theirs.own_commands
        assert ours.messages.index is theirs.messages.index


def test_handler_of_values_is_called_once_for_those_that_arrive_together() -> None:
    called: list[str] = []

    def handler(name: str) -> Callable[[Values, float], None]:
        return lambda values, now: called.append(f"{name}: {len(values.layout.kinds)} at {now}")

    handlers = ValueHandlers(
        [
            {handler("vehicle"): ValueInterest((events.SpeedChanged, events.AttitudeChanged))},
            {
                handler("speed"): ValueInterest((events.SpeedChanged,)),
                handler("height"): ValueInterest((events.AltitudeChanged,)),
            },
        ]
    )
    for values in (
        (events.AttitudeChanged(0.0, 0.0, 0.0), events.SpeedChanged(0.0, 0.0, 0.0)),
        (events.AltitudeChanged(1.0),),
    ):
        for now in (1.5, 2.5):
            handlers.call(arrived(*values), now)
    assert called == [
        *("vehicle: 2 at 1.5", "speed: 2 at 1.5", "vehicle: 2 at 2.5", "speed: 2 at 2.5"),
        *("height: 1 at 1.5", "height: 1 at 2.5"),
    ]


def test_handler_of_values_is_called_while_its_interest_is_on() -> None:
    called: list[str] = []
    speed, task = ValueInterest((events.SpeedChanged,)), ValueInterest((events.SpeedChanged,), is_on=False)

    def first(values: Values, now: float) -> None:
        called.append(f"first at {now}")
        if now == 4.0:
            task.switch(False)

    handlers = ValueHandlers([{lambda values, now: called.append(f"task at {now}"): task, first: speed}])
    values = arrived(events.SpeedChanged(0.0, 0.0, 0.0))
    for now, is_on in ((1.0, False), (2.0, True), (3.0, False), (4.0, True), (5.0, False)):
        if now != 5.0:  # the handler switched it off
            task.switch(is_on)
        handlers.call(values, now)
    assert called == [
        *("first at 1.0", "task at 2.0", "first at 2.0", "first at 3.0", "task at 4.0", "first at 4.0"),
        "first at 5.0",
    ]


async def test_values_are_handled_in_the_sequence_of_services() -> None:
    clock = SystemClock()
    system = System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)
    owners = [
        handler.__qualname__.partition(".")[0]
        for table in system.value_subscriptions()
        for handler, interest in table.items()
        if events.SpeedChanged in interest.kinds
    ]
    expected = "MessageService OrbitService FenceService RollSignService OffboardFlight FollowFlight HighLatencyService"
    assert owners == [*expected.split(), "EventSamples"]


ON_GROUND = (None, FlyingState.LANDED, FlyingState.EMERGENCY)


def fence_with_speeds() -> tuple[FenceService, ValueInterest]:
    clock = SystemClock()
    system = System(Node(clock=clock), Drone("127.0.42.1"), 1, clock, 0.0, allow_kill=False)
    fence = next(service for service in system.services if isinstance(service, FenceService))
    (interest,) = fence.value_subscriptions().values()
    return fence, interest


async def test_fence_of_a_drone_found_flying_looks_at_speeds() -> None:
    fence, speeds = fence_with_speeds()
    for state in (None, *FlyingState, None):
        fence.host.drone.piloting.set_state(PilotingState(flying=state))
        fence.link_up()
        assert speeds.is_on is (state not in ON_GROUND)


async def test_fence_looks_at_speeds_after_each_flying_state_but_those_on_the_ground() -> None:
    fence, speeds = fence_with_speeds()
    report = fence.subscriptions()[events.FlyingStateChanged]
    for state in (*FlyingState, *FlyingState):
        for _ in range(2):  # a drone may report it twice
            report(events.FlyingStateChanged(state), 1.0)
            assert speeds.is_on is (state not in ON_GROUND)
