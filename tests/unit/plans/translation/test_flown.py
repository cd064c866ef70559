"""Sample missions, translated and flown by the simulated firmware: what counts is where it has been and what it did."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from support.sim_bench import HOME, Bench

from anafi_mav import geo, mav_enums
from anafi_mav.arsdk.messages import camera, common
from anafi_mav.arsdk.messages.ardrone3 import FlyingState
from anafi_mav.arsdk.messages.common import MavlinkType, PlayingState
from anafi_mav.plans.formats import files
from anafi_mav.plans.plan import GLOBAL, RELATIVE, WAYPOINT, Item
from anafi_mav.plans.translation.translate import (
    FlightPlanFile,
    GatewayStep,
    Start,
    TranslatedMission,
    examine,
    translate,
)
from anafi_mav.units import DEG_PER_RAD

MISSIONS = Path(__file__).parents[4] / "missions"

ZOOM, TURN = mav_enums.MAV_CMD_SET_CAMERA_ZOOM, mav_enums.MAV_CMD_CONDITION_YAW

WITHIN = 2.0
"""m."""


class Flown:
    """A mission from the ground, its steps left out: what the gateway would fly there is not the translation's."""

    def __init__(self, name: str, model: str) -> None:
        self.items = files.load(MISSIONS / f"{name}.plan").items
        self.bench = Bench(model)
        self.version = self.bench.firmware.model.plan_version
        self.done: list[int] = []
        self.seen: dict[int, tuple[float, float, float, float]] = {}
        """Item -> where the drone was when it was done: m north, east, up; deg of its heading."""
        assert examine(self.items, self.version).faults == ()
        self.flight: TranslatedMission = translate(self.items, self.version, self._start())
        for part in self.flight.parts:
            if isinstance(part, GatewayStep):
                self.done += part.done
            else:
                self._fly(part)

    def _start(self) -> Start:
        return Start(HOME[0], HOME[1], 0.0, flying=False, takeoff_amsl=HOME[2], heading=0.0)

    def _fly(self, leg: FlightPlanFile) -> None:
        bench = self.bench
        bench.events.clear()
        kind = MavlinkType.FLIGHT_PLAN if self.version == 1 else MavlinkType.FLIGHT_PLAN_V2
        bench.send(common.Start(bench.firmware.plans.put(leg.content), kind))
        heard, lines, states = 0, [], []
        while PlayingState.STOPPED not in states:
            for event in bench.events[heard:]:
                if isinstance(event, common.MissionItemExecuted):
                    lines.append(event.idx)
                    self._note(leg.done[event.idx])
                elif isinstance(event, common.MavlinkFilePlayingStateChanged):
                    states.append(event.state)
            heard = len(bench.events)
            assert states, "it has not begun"
            bench.turn()
        assert lines == list(range(len(leg.origins)))
        assert states == [PlayingState.PLAYING, PlayingState.STOPPED]

    def _note(self, items: tuple[int, ...]) -> None:
        self.done += items
        pose = self.bench.pose
        for item in items:
            self.seen[item] = (pose.north, pose.east, pose.up, pose.yaw * DEG_PER_RAD)

    def missed_by(self, number: int, item: Item) -> float:
        """How far (m) from its place the item was done."""
        latitude, longitude, height = item.params[4:]
        north, east = geo.offset(*HOME[:2], latitude or 0.0, longitude or 0.0)
        up = (height or 0.0) - (HOME[2] if item.frame == GLOBAL else 0.0)
        return math.dist(self.seen[number][:3], (north, east, up))


def check(flown: Flown) -> None:
    assert flown.done == list(range(len(flown.items)))
    steps = [number for number, item in enumerate(flown.items) if item.command in (ZOOM, TURN)]
    assert [part.item for part in flown.flight.parts if isinstance(part, GatewayStep)] == steps
    for number, item in enumerate(flown.items):
        if item.command == WAYPOINT:
            assert flown.missed_by(number, item) < WITHIN, number


def photos(bench: Bench) -> int:
    bench.run(2.0)
    return sum(len(media.resources) for media in bench.firmware.payload.media)


def test_a_survey() -> None:
    flown = Flown("survey", "ai")
    check(flown)
    # Seven ways between eight way points, one every 15 m, and one at each end.
    places = [geo.offset(*HOME[:2], item.params[4] or 0.0, item.params[5] or 0.0)
              for item in flown.items if item.command == WAYPOINT]  # fmt: skip
    way = sum(math.dist(one, two) for one, two in pairwise(places))
    assert photos(flown.bench) == pytest.approx(way / 15.0 + 2, abs=3)
    assert flown.bench.firmware.operator.tilt == pytest.approx(-90.0, abs=1.0)


@pytest.mark.parametrize("model", ["4k", "ai"])
def test_gateway_zooms_between_the_files_of_an_inspection(model: str) -> None:
    flown = Flown("inspection", model)
    check(flown)
    where = 0
    for number, item in enumerate(flown.items):  # a photo is taken at the way point before it
        where = number if item.command == WAYPOINT else where
        if item.command == 2000:
            assert math.dist(flown.seen[number][:3], flown.seen[where][:3]) < WITHIN, number
    assert photos(flown.bench) == sum(item.command == 2000 for item in flown.items)
    headings = [number for number, item in enumerate(flown.items) if item.command == WAYPOINT and item.params[3]]
    assert headings
    for number in headings:
        assert flown.seen[number][3] == pytest.approx(flown.items[number].params[3], abs=5.0)
    flown.bench.run_until(lambda: flown.bench.state is FlyingState.LANDED)


def test_orbit_looks_at_its_centre() -> None:
    """50 m north of home; the camera is on it at each way point, and the video runs from the first to the last."""
    flown = Flown("orbit", "thermal")
    check(flown)
    middle = geo.offset(*HOME[:2], 48.8792597, 2.3677)
    for number in range(6, 13):
        north, east, _, heading = flown.seen[number]
        bearing = math.atan2(middle[1] - east, middle[0] - north) * DEG_PER_RAD
        assert math.remainder(bearing - heading, 360.0) == pytest.approx(0.0, abs=6.0), number
    results = [event.result for event in flown.bench.of(camera.RecordingProgress)]
    assert results == [camera.RecordingResult.STARTED, camera.RecordingResult.STOPPED]


def test_structure_scan_looks_to_its_right() -> None:
    """Clockwise around the structure: on the way east it looks south."""
    flown = Flown("structure", "usa")
    check(flown)
    for number, heading in ((6, 180.0), (7, 270.0), (8, 0.0), (9, 90.0)):
        assert math.remainder(flown.seen[number][3] - heading, 360.0) == pytest.approx(0.0, abs=6.0), number


def test_heights_above_the_sea() -> None:
    flown = Flown("heights", "4k")
    check(flown)
    assert {item.frame for item in flown.items if item.command == WAYPOINT} == {GLOBAL, RELATIVE}
