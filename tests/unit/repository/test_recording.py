"""Recordings of client sessions: which differences of two are found, and which are allowed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.recording import STEP, Line, Texts, compare, file_transfer, joined, kept, read, write

ATTITUDE = {"from": [1, 1], "time_boot_ms": 5000, "roll": 0.25}


def line(at: float, name: str = "ATTITUDE", recipient: str = "mavlink 255/190", **fields: object) -> Line:
    return Line(at, recipient, name, fields)


def kinds(old: list[Line], new: list[Line], texts: Texts | None = None) -> list[str]:
    return [difference.kind for difference in compare(old, new, texts=texts)]


OLD = [line(1.0, roll=0.1), line(2.0, roll=0.2), line(3.0, roll=0.3)]


def test_recording_equal_to_itself_has_no_difference() -> None:
    assert kinds(OLD, list(OLD)) == []


@pytest.mark.parametrize(
    ("new", "expected"),
    [
        ([OLD[0], OLD[2]], ["missing"]),
        ([OLD[0], OLD[1]], ["missing"]),
        ([*OLD[:2], line(2.5, roll=0.9), OLD[2]], ["extra"]),
        ([*OLD, line(4.0, roll=0.3)], ["extra"]),
        ([OLD[0], line(2.0, roll=-0.2), OLD[2]], ["fields"]),
        ([OLD[0], line(2.0, roll=0.2, pitch=0.0), OLD[2]], ["fields"]),
        ([OLD[0], line(2.0 + 2 * STEP, roll=0.2), OLD[2]], ["time"]),
        ([line(1.0, roll=0.2), line(2.0, roll=0.1), OLD[2]], ["fields", "fields"]),
        ([replace(one, recipient="mavlink 254/190") for one in OLD], ["missing", "extra"] * 3),
        ([replace(one, name="VFR_HUD") for one in OLD], ["missing", "extra"] * 3),
    ],
)
def test_each_kind_of_difference_is_found(new: list[Line], expected: list[str]) -> None:
    assert sorted(kinds(OLD, new)) == sorted(expected)


def test_time_within_one_step_is_allowed() -> None:
    assert kinds(OLD, [replace(one, at=one.at + STEP) for one in OLD]) == []
    assert kinds(OLD, [replace(one, at=one.at - STEP) for one in OLD]) == []


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ({"time_boot_ms": 5000}, {"time_boot_ms": 5016}, []),
        ({"time_boot_ms": 5000}, {"time_boot_ms": 5050}, ["fields"]),
        ({"time_usec": 5_000_000}, {"time_usec": 5_016_000}, []),
        ({"tc1": 5_000_000_000}, {"tc1": 5_016_000_000}, []),
        ({"seq": 5}, {"seq": 6}, ["fields"]),
    ],
)
def test_field_with_time_of_sending_may_differ_one_step(
    old: dict[str, int], new: dict[str, int], expected: list[str]
) -> None:
    assert kinds([line(5.0, **old)], [line(5.0, **new)]) == expected


@pytest.mark.parametrize(
    ("field", "old", "new", "expected"),
    [
        ("q", [0.5, -0.08684554], [0.5, -0.08684552], []),
        ("roll", 0.25, 0.2500005, []),
        ("roll", 0.25, 0.25001, ["fields"]),
        ("x", 20.0, 20.000002, []),
        ("x", 0.00001, -0.00001, ["fields"]),
        ("latitude", 48.8789, 48.8789001, ["fields"]),
        ("roll", 36, 37, ["fields"]),
        ("on", False, True, ["fields"]),
    ],
)
def test_last_bits_of_fractions_may_differ(field: str, old: object, new: object, expected: list[str]) -> None:
    assert kinds([line(1.0, **{field: old})], [line(1.0, **{field: new})]) == expected


def test_order_of_types_at_one_instant_does_not_matter() -> None:
    old = [line(1.0, roll=0.1), line(1.0, "VFR_HUD", alt=3.0), line(1.0, recipient="drone", roll=0)]
    assert kinds(old, old[::-1]) == []


def test_order_within_type_and_recipient_matters() -> None:
    old = [line(1.0, "COMMAND_ACK", result=5), line(1.0, "COMMAND_ACK", result=0)]
    assert kinds(old, old[::-1]) == ["extra", "missing"]


def test_repeated_mission_current_counts_once() -> None:
    one, two = line(1.0, "MISSION_CURRENT", seq=1), line(1.2, "MISSION_CURRENT", seq=2)
    old = [one, replace(one, at=1.1), two, replace(two, at=1.3)]
    assert kinds(old, [one, two]) == []
    assert kinds([one, two], old) == []
    assert kinds(old, [one, two, replace(one, at=1.4)]) == ["extra"]
    again = line(1.0, "COMMAND_ACK", result=0)
    assert kinds([again, again], [again]) == ["missing"]


def test_not_a_number_equals_itself() -> None:
    nan = float("nan")
    assert kinds([line(1.0, q=[nan, 1.0], yaw=nan)], [line(1.0, q=[nan, 1.0], yaw=nan)]) == []
    assert kinds([line(1.0, yaw=nan)], [line(1.0, yaw=0.0)]) == ["fields"]


TABLE = Texts(
    [
        ("Takeoff forgotten: nobody armed", "Takeoff cancelled: not armed within {seconds} s"),
        ("Goto refused: it is {metres} m beyond {what}", "Goto refused: {metres} m outside {what}"),
    ]
)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("Takeoff forgotten: nobody armed", "Takeoff cancelled: not armed within 10 s", []),
        ("Takeoff forgotten: nobody armed", "Takeoff cancelled", ["fields"]),
        ("Goto refused: it is 40 m beyond the polygon", "Goto refused: 40 m outside the polygon", []),
        ("Goto refused: it is 40 m beyond the polygon", "Goto refused: 41 m outside the polygon", ["fields"]),
        ("Goto refused: no GPS fix", "Goto refused: no GPS", ["fields"]),
        ("Goto refused: no GPS fix", "Goto refused: no GPS fix", []),
    ],
)
def test_text_may_change_according_to_the_table(old: str, new: str, expected: list[str]) -> None:
    before, after = [line(1.0, "STATUSTEXT", text=old)], [line(1.0, "STATUSTEXT", text=new)]
    assert kinds(before, after, TABLE) == expected
    assert kinds(before, after) == (["fields"] if old != new else [])


def test_table_is_read_from_file(tmp_path: Path) -> None:
    table = tmp_path / "texts"
    table.write_text("# old and new\nMotors cut\tMotors stopped by {who}\n", encoding="utf-8")
    assert Texts.read(table).same("Motors cut", "Motors stopped by system 255")
    assert not Texts.read(table).same("Motors cut", "Motors")


def test_file_transfers_are_not_compared_when_texts_may_differ() -> None:
    old, new = [line(1.0, "FILE_TRANSFER_PROTOCOL", crc=1)], [line(1.0, "FILE_TRANSFER_PROTOCOL", crc=2)]
    assert kinds(old, new) == ["fields"]
    assert kinds(old, new, TABLE) == []


def test_recording_is_read_as_written(tmp_path: Path) -> None:
    lines = [line(1.25, roll=-0.5, text="a\tb\nc, a 5° turn"), line(2.0, "VFR_HUD", "drone", q=[1, None])]
    write(tmp_path / "one", lines)
    assert read(tmp_path / "one") == lines


def test_text_in_chunks_is_one_line() -> None:
    pieces = [
        (1.0, {"severity": 4, "text": "x" * 50, "id": 7, "chunk_seq": 0}),
        (1.1, {"severity": 6, "text": "short", "id": 0, "chunk_seq": 0}),
        (1.2, {"severity": 4, "text": "end", "id": 7, "chunk_seq": 1}),
    ]
    expected = [(1.1, {"severity": 6, "text": "short"}), (1.2, {"severity": 4, "text": "x" * 50 + "end"})]
    assert list(joined(pieces)) == expected


def test_counter_of_pcmd_is_not_recorded() -> None:
    fields = {"flag": 1, "roll": 5, "timestampAndSeqNum": 99}
    assert kept("ardrone3.Piloting.PCMD", fields) == {"flag": 1, "roll": 5}


def test_file_transfer_header_is_recorded_without_its_data() -> None:
    payload = bytes([0x34, 0x12, 1, 128, 2, 5, 1, 0, 0, 1, 0, 0]) + b"abXX"
    header = file_transfer(payload)
    assert (header.pop("crc"), header) == (
        0x9E83486D,  # CRC-32 of "ab"
        {"seq": 0x1234, "session": 1, "opcode": 128, "size": 2, "req_opcode": 5, "burst_complete": 1, "offset": 256},
    )
