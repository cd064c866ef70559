"""What missions and fences keep of the items that a client sent: autocontinue of ArduPilot's, circles of radius 0."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest
from support.plan_wire import FENCE, MISSION, peer, replies, texts

from anafi_mav.mavlink import dialect
from anafi_mav.services.flavours import ARDUPILOT, PX4, STANDARD, Flavour
from anafi_mav.services.plan.fence_kind import FenceKind
from anafi_mav.services.plan.item_messages import item_int
from anafi_mav.services.plan.mission_kind import MissionKind
from anafi_mav.services.plan.plan_protocol import MissionProtocol
from anafi_mav.services.plan.plan_transfer import Commit
from anafi_mav.services.statustext import CHUNK
from anafi_mav.vehicle.fence.plan_items import PlanItem

LAT, LON = 488789000, 23677000
ACCEPTED, INVALID_PARAM1 = dialect.MAV_MISSION_ACCEPTED, dialect.MAV_MISSION_INVALID_PARAM1

HOME = PlanItem(dialect.MAV_CMD_NAV_WAYPOINT, dialect.MAV_FRAME_GLOBAL, (0.0, 0.0, 0.0, 0.0), LAT, LON, 35.0)


def waypoint(north: int, autocontinue: int) -> PlanItem:
    return PlanItem(
        dialect.MAV_CMD_NAV_WAYPOINT,
        dialect.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        (0.0, 0.0, 0.0, 90.0),
        LAT + north,
        LON,
        10.0,
        autocontinue,
    )


def circle(command: int, radius: float) -> PlanItem:
    return PlanItem(command, dialect.MAV_FRAME_GLOBAL, (radius, 0.0, 0.0, 0.0), LAT, LON, 0.0)


def plans() -> MissionProtocol:
    return MissionProtocol([MissionKind(lambda: HOME, lambda: 2), FenceKind()])


def upload(plans: MissionProtocol, items: list[PlanItem], kind: int, flavour: Flavour) -> tuple[Any, list[str]]:
    """The acknowledgement, and the texts."""
    who = peer(flavour=flavour)
    effects = plans.receive(dialect.MAVLink_mission_count_message(1, 1, len(items), kind), who, 0.0)
    said = texts(effects)
    for seq, item in enumerate(items):
        effects = plans.receive(item_int(item, seq, 1, 1, kind), who, 0.0)
        said += texts(effects)
    for commit in [effect for effect in effects if isinstance(effect, Commit)]:
        effects = plans.stored(commit, 0.0)
    return replies(effects)[-1], said


def read_back(plans: MissionProtocol, kind: int, flavour: Flavour) -> list[Any]:
    who = peer(flavour=flavour)
    (count,) = replies(plans.receive(dialect.MAVLink_mission_request_list_message(1, 1, kind), who, 1.0))
    asked = [dialect.MAVLink_mission_request_int_message(1, 1, seq, kind) for seq in range(count.count)]
    return [reply for message in asked for reply in replies(plans.receive(message, who, 1.0))]


def test_autocontinue_0_of_ardupilot_client_becomes_1() -> None:
    protocol = plans()
    ack, _ = upload(protocol, [HOME, waypoint(1000, 0), waypoint(2000, 0), waypoint(3000, 1)], MISSION, ARDUPILOT)
    assert ack.type == ACCEPTED
    assert [item.autocontinue for item in protocol.transfers[MISSION].items] == [1, 1, 1]
    assert [item.autocontinue for item in read_back(protocol, MISSION, ARDUPILOT)] == [1, 1, 1, 1]
    assert [item.autocontinue for item in read_back(protocol, MISSION, PX4)] == [1, 1, 1]


@pytest.mark.parametrize("flavour", [PX4, STANDARD])
def test_autocontinue_0_of_other_clients_stays_a_stop(flavour: Flavour) -> None:
    protocol = plans()
    upload(protocol, [waypoint(1000, 0), waypoint(2000, 1)], MISSION, flavour)
    stops = protocol.transfers[MISSION].items
    assert [item.autocontinue for item in stops] == [0, 1]
    fault = MissionKind(lambda: HOME, lambda: 2).examine(stops, flavour)
    assert fault is not None
    assert "autocontinue 0 is unsupported" in fault.reason


@pytest.mark.parametrize("flavour", [PX4, ARDUPILOT])
@pytest.mark.parametrize(
    "command",
    [
        dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
        dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
        dialect.MAV_CMD_NAV_FENCE_HOME_CIRCLE_INCLUSION,
    ],
)
def test_fence_circle_of_radius_0_is_dropped_with_warning(command: int, flavour: Flavour) -> None:
    protocol = plans()
    good = circle(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 80.0)
    ack, said = upload(protocol, [good, circle(command, 0.0), circle(command, -0.0)], FENCE, flavour)
    assert ack.type == ACCEPTED
    assert protocol.transfers[FENCE].items == (good,)
    assert [item.param1 for item in read_back(protocol, FENCE, flavour)] == [80.0]
    assert said == ["Fence circle 1 ignored: radius 0", "Fence circle 2 ignored: radius 0"]


def test_fence_circle_of_radius_0_needs_no_place() -> None:
    """MAVSDK's geofence example fills its list with one at 0/0."""
    void = msgspec.structs.replace(circle(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0.0), x=0, y=0)
    good = circle(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 80.0)
    ack, said = upload(plans(), [good, void], FENCE, PX4)
    assert ack.type == ACCEPTED
    assert said == ["Fence circle 1 ignored: radius 0"]


def test_fence_circle_of_negative_radius_is_refused() -> None:
    ack, said = upload(plans(), [circle(dialect.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, -1.0)], FENCE, PX4)
    assert ack.type == INVALID_PARAM1
    assert said == ["Fence refused: item 0: radius -1 m"]


def test_warning_about_a_circle_fits_a_statustext() -> None:
    items = [circle(dialect.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, 0.0)] * FenceKind.capacity
    assert max(map(len, FenceKind().remarks(items))) <= CHUNK
