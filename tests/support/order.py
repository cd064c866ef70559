"""Pytest plugin: the tests that last longest begin first, so that the end of a run does not wait for one of them.

Workers get equal parts of the list and then take from the ends of each other's (`--dist worksteal`): a long test at
the end of a part would run alone while the other workers have nothing left. The longest wait for programs that run in
real time, and compute little. The parts of half of the workers begin with them, and the others compute meanwhile. All
in one part would be one worker's work for longer than the rest of the run, and in all parts no processor would be busy.
"""

from __future__ import annotations

import os
from itertools import islice

import pytest

WORKERS = "PYTEST_XDIST_WORKER_COUNT"
"""Environment variable with their number, in a worker."""

LONGEST = {
    "test_conf_075_121_every_sample_once_by_mavsdk": 70,
    "test_flights_of_mavsdks_examples_end_by_themselves": 50,
    "test_flights_of_dronekits_examples_end_by_themselves": 50,
    "test_the_same_file_flies_the_same_path": 50,
    "test_olympe_does_everything": 40,
    "test_mavsdk_offboard": 40,
    "test_conf_061_items_by_mavsdk_on_a_bad_link": 30,
    "test_olympe_watches_a_flight": 25,
    "test_conf_118_setpoints": 22,
    "test_interrupted_plan_fly_leaves_the_flight_alone": 22,
    "test_conf_119_the_ardupilot_flavour": 20,
    "test_mavsdk_follow_me": 19,
    "test_conf_116_mavsdk_action_and_calibration": 19,
    "test_telemetry_and_info": 17,
    "test_conf_075_117_dronekit_missions": 17,
    "test_a_plan_is_flown_and_followed": 17,
    "test_conf_117_dronekit": 15,
    "test_olympes_media_examples": 12,
    "test_conf_061_items_by_mavsdk_there_and_back": 12,
}
"""Test function -> s of wall time beside other work. Those who wait for a foreign program that runs in real time."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Move the longest to the fronts of parts, the longest of them first; all others keep their order."""
    longest = sorted(filter(_seconds, items), key=_seconds, reverse=True)
    others = iter([item for item in items if not _seconds(item)])
    workers = int(os.environ.get(WORKERS, "1"))
    waiting = max(1, workers // 2)
    parts: list[pytest.Item] = []
    left = len(items)
    for worker in range(workers):
        size = left // (workers - worker)  # as `WorkStealingScheduling.check_schedule` has it
        left -= size
        first = longest[worker::waiting] if worker < waiting else []
        parts += [*first, *islice(others, max(0, size - len(first)))]
    items[:] = [*parts, *others]


def _seconds(item: pytest.Item) -> int:
    return LONGEST.get(item.name.partition("[")[0], 0)
