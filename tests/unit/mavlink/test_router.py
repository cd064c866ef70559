"""Routing: what is ours, what is passed on, and what never is."""

from __future__ import annotations

from typing import Any

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import MAX_SOURCES, Parser, ReceivedFrame, frame, pack
from anafi_mav.mavlink.router import EVERY_COMPONENT, RING_FRAMES, RING_WINDOW, Router, targets

GCS, OTHER_GCS, OURS, FOREIGN = (255, 190), (254, 190), 1, 42


def received(message: Any, source: tuple[int, int] = GCS, seq: int = 0) -> ReceivedFrame:
    [one] = Parser().receive(frame(pack(message), seq, *source))
    return one


def heartbeat(seq: int = 0, source: tuple[int, int] = GCS) -> ReceivedFrame:
    return received(dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3), source, seq)


def command(system: int, component: int, seq: int = 0, source: tuple[int, int] = GCS) -> ReceivedFrame:
    return received(dialect.MAVLink_command_long_message(system, component, 512, 0, 1, 0, 0, 0, 0, 0, 0), source, seq)


@pytest.fixture
def router() -> Router[str, str]:
    router = Router[str, str]()
    for name in ("a", "b", "c"):
        router.add(name)
    router.add_host(OURS, 1, "autopilot")
    router.own_sources.add((OURS, 1))
    return router


def test_message_without_target_reaches_all_but_its_sender(router: Router[str, str]) -> None:
    route = router.route("a", heartbeat(), 0.0)
    assert (route.hosts, route.forward) == (("autopilot",), ("b", "c"))
    assert router.counters["forwarded"] == 2


def test_message_with_target_0_reaches_all(router: Router[str, str]) -> None:
    route = router.route("a", command(0, 0), 0.0)
    assert (route.hosts, route.forward) == (("autopilot",), ("b", "c"))


@pytest.mark.parametrize(("component", "hosts"), [(0, ("autopilot",)), (1, ("autopilot",)), (77, ())])
def test_a_message_to_our_system_stays_with_us(
    router: Router[str, str], component: int, hosts: tuple[str, ...]
) -> None:
    router.route("b", heartbeat(source=OTHER_GCS), 0.0)
    route = router.route("a", command(OURS, component), 0.0)
    assert (route.hosts, route.forward) == (hosts, ())


FLEET = {(3, EVERY_COMPONENT): "all of 3", (2, 1): "autopilot 2", (1, 100): "camera 1", (1, 1): "autopilot 1"}
"""Hosts in the order in which they are added, which is not that of their addresses."""


@pytest.mark.parametrize(
    ("system", "component", "hosts"),
    [
        (0, 0, ["autopilot 1", "camera 1", "autopilot 2", "all of 3"]),
        (0, 1, ["autopilot 1", "autopilot 2", "all of 3"]),
        (0, 100, ["camera 1", "all of 3"]),
        (1, 0, ["autopilot 1", "camera 1"]),
        (1, 1, ["autopilot 1"]),
        (1, 100, ["camera 1"]),
        (1, 154, []),  # our system, another's component
        (2, 0, ["autopilot 2"]),
        (2, 100, []),
        (3, 0, ["all of 3"]),
        (3, 77, ["all of 3"]),
        (42, 0, []),
        (42, 1, []),
    ],
)
def test_message_reaches_the_hosts_of_its_target(system: int, component: int, hosts: list[str]) -> None:
    router = Router[str, str]()
    router.add("a")
    for address, host in FLEET.items():
        router.add_host(*address, host)
    assert [*router.route("a", command(system, component), 0.0).hosts] == hosts


def test_hosts_of_a_message_without_target_are_all() -> None:
    router = Router[str, str]()
    router.add("a")
    for address, host in FLEET.items():
        router.add_host(*address, host)
    assert router.route("a", heartbeat(), 0.0).hosts == ("autopilot 1", "camera 1", "autopilot 2", "all of 3")
    manual_control = dialect.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0)  # its only target is a system
    assert router.route("a", received(manual_control), 0.0).hosts == ("autopilot 1", "camera 1")


def test_removed_system_leaves_the_hosts_of_others() -> None:
    router = Router[str, str]()
    for address, host in FLEET.items():
        router.add_host(*address, host)
    router.remove_hosts(1)
    router.remove_hosts(9)
    assert router.hosts(0, 0) == ("autopilot 2", "all of 3")
    assert router.hosts(1, 1) == ()


def test_companion_component_receives_its_messages(router: Router[str, str]) -> None:
    router.route("c", heartbeat(source=(OURS, 191)), 0.0)
    assert router.route("a", command(OURS, 191), 0.0).forward == ("c",)
    assert router.route("a", command(OURS, 1), 0.0).forward == ()
    assert router.route("a", command(OURS, 0), 0.0).forward == ()


def test_foreign_system_is_reached_on_its_channel_only(router: Router[str, str]) -> None:
    assert router.route("a", command(FOREIGN, 1, seq=1), 0.0).forward == ()
    router.route("b", heartbeat(source=(FOREIGN, 1)), 0.0)
    route = router.route("a", command(FOREIGN, 1, seq=2), 0.0)
    assert (route.hosts, route.forward) == ((), ("b",))
    # By its system, whatever component is meant (MAVLink routing.md §rules).
    assert router.route("a", command(FOREIGN, 100, seq=3), 0.0).forward == ("b",)
    # Its own channel is where the message came from: no echo.
    assert router.route("b", command(FOREIGN, 1, seq=4), 0.0).forward == ()


def test_an_answer_finds_the_way_back(router: Router[str, str]) -> None:
    router.route("a", heartbeat(), 0.0)
    ack = dialect.MAVLink_command_ack_message(400, 0, 0, 0, GCS[0], GCS[1])
    route = router.route("b", received(ack, (FOREIGN, 1)), 0.0)
    assert (route.hosts, route.forward) == ((), ("a",))


def test_closed_channel_removes_its_systems(router: Router[str, str]) -> None:
    router.route("b", heartbeat(source=(FOREIGN, 1)), 0.0)
    router.remove("b")
    assert router.heard_on(FOREIGN) == []
    assert router.route("a", command(FOREIGN, 1), 0.0).forward == ()
    router.add("b")
    assert router.route("a", command(FOREIGN, 1), 0.0).forward == ()


def test_a_disowned_system_is_nobodys(router: Router[str, str]) -> None:
    router.remove_hosts(OURS)
    route = router.route("a", command(OURS, 1), 0.0)
    assert (route.hosts, route.forward) == ((), ())


def test_absent_host_receives_what_has_no_other_destination(router: Router[str, str]) -> None:
    router.add_absent_host(OURS, "absent")
    assert router.route("a", command(OURS, 1, seq=1), 0.0).hosts == ("autopilot",)
    router.remove_hosts(OURS)
    for component in (1, 100, 0):
        assert router.route("a", command(OURS, component, seq=2), 0.0).hosts == ("absent",)
    assert router.route("a", command(0, 0, seq=3), 0.0).hosts == ()
    assert router.route("a", command(OURS, 1, seq=4), 0.0, {FOREIGN}).hosts == ()
    router.route("b", heartbeat(source=(OURS, 191)), 0.0)  # a companion computer
    route = router.route("a", command(OURS, 191, seq=5), 0.0)
    assert (route.hosts, route.forward) == ((), ("b",))
    assert router.route("a", command(OURS, 1, seq=6), 0.0).hosts == ("absent",)


def test_setup_signing_is_never_passed_on(router: Router[str, str]) -> None:
    router.route("b", heartbeat(source=(FOREIGN, 1)), 0.0)
    for target, hosts in ((FOREIGN, ()), (0, ("autopilot",)), (OURS, ("autopilot",))):
        message = dialect.MAVLink_setup_signing_message(target, 1, [7] * 32, 1)
        route = router.route("a", received(message), 0.0)
        assert (route.hosts, route.forward) == (hosts, ())


def test_our_own_echo_is_dropped_and_teaches_nothing(router: Router[str, str]) -> None:
    route = router.route("a", heartbeat(source=(OURS, 1)), 0.0)
    assert (route.hosts, route.forward) == ((), ())
    assert router.counters["own_sources"] == 1
    assert router.heard_on(OURS) == []


def test_another_vehicle_with_our_name_of_before_receives_nothing() -> None:
    """It was heard while our drone was not connected yet: it must not fly what is commanded to ours."""
    router = Router[str, str]()
    for name in ("a", "b"):
        router.add(name)
    router.add_absent_host(OURS, "absent")
    router.route("b", heartbeat(source=(OURS, 1)), 0.0)
    assert router.route("a", command(OURS, 1, seq=1), 0.0).forward == ("b",)
    router.add_host(OURS, 1, "autopilot")
    router.own((OURS, 1))
    route = router.route("a", command(OURS, 1, seq=2), 0.0)
    assert (route.hosts, route.forward) == (("autopilot",), ())
    router.remove_hosts(OURS)
    route = router.route("a", command(OURS, 1, seq=3), 0.0)
    assert (route.hosts, route.forward) == (("absent",), ())


def test_frame_received_twice_is_forwarded_once(router: Router[str, str]) -> None:
    frame = heartbeat(seq=9)
    assert router.route("a", frame, 10.0).forward == ("b", "c")
    assert router.route("b", frame, 10.1).forward == ()
    assert router.route("a", frame, 10.2).forward == ()
    assert router.counters["rings"] == 2
    # Another sequence number is another frame, and so is the same one much later.
    assert router.route("a", heartbeat(seq=10), 10.2).forward == ("b", "c")
    assert router.route("a", frame, 10.0 + RING_WINDOW).forward == ("b", "c")


def test_frame_that_may_not_be_forwarded_takes_no_place(router: Router[str, str]) -> None:
    router.route("c", heartbeat(source=(FOREIGN, 1)), 0.0)
    land = command(FOREIGN, 1, seq=7)
    assert router.route("a", land, 1.0, may_forward=False).forward == ()
    assert router.route("b", land, 1.1).forward == ("c",)
    assert router.counters["rings"] == 0


def test_router_remembers_a_bounded_number_of_sources(router: Router[str, str]) -> None:
    for sysid in range(2, 250):
        for compid in (1, 2, 3):
            router.route("a", heartbeat(seq=compid, source=(sysid, compid)), 0.0)
    assert len(router._channels["a"]) == MAX_SOURCES
    assert router.counters["sources_ignored"] == 248 * 3 - MAX_SOURCES
    assert len(router._recent) == RING_FRAMES
    # Its flood takes no room from others.
    router.route("b", heartbeat(source=(FOREIGN, 9)), 0.0)
    assert "b" in router.heard_on(FOREIGN)


def test_system_0_is_nobodys_name(router: Router[str, str]) -> None:
    assert router.route("a", heartbeat(source=(0, 0)), 0.0).hosts == ("autopilot",)
    assert router.heard_on(0) == []


def test_unknown_message_is_forwarded_and_reaches_no_host(router: Router[str, str]) -> None:
    unknown = ReceivedFrame(None, 0xABCDE, *GCS, b"\xfd\x00\x00\x00\x00\xff\xbe\xde\xbc\x0a\x00\x00")
    route = router.route("a", unknown, 0.0)
    assert (route.hosts, route.forward) == ((), ("b", "c"))
    assert router.heard_on(GCS[0]) == []


def test_targets_of_messages() -> None:
    assert targets(dialect.MAVLink_manual_control_message(7, 0, 0, 0, 0, 0)) == (7, 0)
    assert targets(dialect.MAVLink_set_mode_message(5, 1, 0)) == (5, 0)
    assert targets(dialect.MAVLink_command_long_message(3, 100, 1, 0, 0, 0, 0, 0, 0, 0, 0)) == (3, 100)
    assert targets(dialect.MAVLink_system_time_message(1, 2)) == (0, 0)
    assert targets(None) == (0, 0)
