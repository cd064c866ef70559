"""The EVENT interface's core: numbers that wrap, events that can be had again, arguments by hand-made bytes."""

from __future__ import annotations

import re

import pytest

from anafi_mav.drone.events import TakeoffChecklistType
from anafi_mav.mavlink import dialect
from anafi_mav.services.event import event_table as table
from anafi_mav.services.event.event_table import EVENTS, HealthComponent, events_file, mode_groups
from anafi_mav.services.event.events import KEPT, MAX_REQUEST, EventLog, part_of
from anafi_mav.services.flavours import ARDUPILOT, FLAVOURS, PX4, Flavour


def filled(count: int) -> EventLog:
    log = EventLog()
    for _ in range(count):
        log.add(table.ARMED, table.ARMED.pack(), 0)
    return log


def sequences(log: EventLog, first: int, last: int) -> list[int]:
    """Sequence of each event that comes again, and minus the sequence of each error."""
    return [
        message.sequence if isinstance(message, dialect.MAVLink_event_message) else -message.sequence
        for message in log.again(first, last, 255, 190)
    ]


def test_requested_events_are_sent_again() -> None:
    log = filled(5)
    assert log.sequence == 5
    assert sequences(log, 2, 4) == [2, 3, 4]
    assert sequences(log, 3, 3) == [3]
    assert sequences(log, 5, 7) == [5, -6, -7]


def test_discarded_event_request_is_answered_by_an_error() -> None:
    """The error names where to go on."""
    log = filled(KEPT + 10)
    assert sequences(log, 10, 11) == [-10, 11]
    (error,) = log.again(10, 10, 255, 190)
    assert isinstance(error, dialect.MAVLink_response_event_error_message)
    assert (error.target_system, error.target_component) == (255, 190)
    assert (error.sequence, error.sequence_oldest_available) == (10, 11)


def test_numbers_wrap() -> None:
    log = filled(0xFFFF)
    log.add(table.ARMED, table.ARMED.pack(), 0)
    assert log.sequence == 0
    assert sequences(log, 0xFFFE, 0) == [0xFFFE, 0xFFFF, 0]


def test_a_request_is_bounded() -> None:
    assert len(sequences(filled(3), 0, 0xFFFF)) == MAX_REQUEST
    assert len(sequences(EventLog(), 9, 8)) == MAX_REQUEST


def test_arguments() -> None:
    """One after the other, little endian, no padding (libevents README.md §Serialization)."""
    packed = table.ARMING_SUMMARY.pack(0, 0x08, 0x02, 0x3FF, 0x41)
    assert packed == bytes.fromhex("00 08000000 02000000 ff030000 41000000").ljust(40, b"\0")
    assert table.BATTERY.pack(0x3FF, HealthComponent.BATTERY.index, 2)[:6] == bytes.fromhex("ff030000 02 02")
    assert table.ARMING_SUMMARY.id == 0x01000001
    assert table.ARMING_SUMMARY.log_levels == 0x88
    assert table.NO_FIX.log_levels == 0x44


def test_numbers_are_unique() -> None:
    assert len({event.number for event in EVENTS}) == len(EVENTS)
    assert len({event.name for event in EVENTS}) == len(EVENTS)


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
def test_the_file_obeys_the_schema(flavour: Flavour) -> None:
    """What libevents' validation/schema.json asks for, as far as it concerns this file."""
    document = events_file(flavour)
    assert document["version"] == 2
    (component,) = document["components"].values()
    assert re.fullmatch(r"[a-z][a-z0-9_]*", component["namespace"])
    for name, one in component["enums"].items():
        assert re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*_t", name)
        for value, entry in one["entries"].items():
            assert re.fullmatch(r"[0-9]+", value)
            assert re.fullmatch(r"[a-z][a-z0-9_]*", entry["name"])
            assert entry["description"]
    for group, content in component["event_groups"].items():
        for event in content["events"].values():
            assert re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*", event["name"])
            assert 1 <= len(event["message"]) <= 120
            types = [argument["type"] for argument in event.get("arguments", [])]
            assert all(kind in component["enums"] or kind in ("uint8_t", "uint32_t") for kind in types)
            if group in ("arming_check", "health") and event.get("type") != "summary":
                assert types[:2] == ["navigation_mode_group_t", "uint8_t"]
    assert min(map(int, component["enums"]["health_component_t"]["entries"])) == 1  # the first bit is none


def test_every_mode_number_is_in_one_group() -> None:
    for flavour in (PX4, ARDUPILOT):
        numbers = [number for group in mode_groups(flavour).values() for number in group]
        assert len(numbers) == len(set(numbers))
        assert set(numbers) >= set(flavour.modes) - {0x000A0000}  # motors cut: nothing to arm for


def test_every_check_has_a_part() -> None:
    for check in TakeoffChecklistType:
        assert part_of(check) in HealthComponent
    assert part_of(TakeoffChecklistType.BATTERY_IS_TOO_COLD) is HealthComponent.BATTERY
    assert part_of(TakeoffChecklistType.MAGNETO_CALIBRATION) is HealthComponent.MAGNETOMETER
    assert part_of(TakeoffChecklistType(99)) is HealthComponent.SYSTEM
