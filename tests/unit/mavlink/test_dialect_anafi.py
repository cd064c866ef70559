"""The messages of our own: their ids collide with no one's, their wire format stays, their numbers are Parrot's."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import fastcrc
import pymavlink
import pytest

from anafi_mav.arsdk.codec.wire import OpenEnum
from anafi_mav.arsdk.messages import alarms, ardrone3, common, rth, skyctrl
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.frames import frame, pack

DEFINITIONS = ET.parse(Path(__file__).parents[3] / "dialect" / "anafi.xml").getroot()
OURS = {int(message.get("id") or 0): message for message in DEFINITIONS.iterfind("messages/message")}
GENERATOR = Path(__file__).parents[3] / "dialect" / "generate.py"

# Ranges of message ids given away by mavlink/mavlink de1e078a (2026-07-22) message_definitions/v1.0/all.xml, with what
# it says that will be given next. Below 300 are the messages of MAVLink 1 and minimal.xml.
RANGES = [
    (0, 10_000),
    (10_001, 10_999),
    (11_000, 11_999),
    (12_900, 12_999),
    (17_000, 17_199),
    (42_000, 42_999),
    (50_000, 50_099),
    (51_000, 51_999),
    (52_000, 52_619),
    (53_000, 53_999),
    (54_000, 60_000),
    (60_000, 60_049),
    (60_050, 60_099),
]


def test_ids_are_in_range_and_fit_message_interval() -> None:
    assert len(OURS) == len(list(DEFINITIONS.iterfind("messages/message")))
    assert all(61_400 <= id <= 61_499 for id in OURS)
    assert not any(first <= id <= last for id in OURS for first, last in RANGES)
    for id in OURS:
        dialect.MAVLink_message_interval_message(id, 0).pack(dialect.MAVLink(None))  # an uint16


def test_no_definition_inside_pymavlink_has_our_ids_or_names() -> None:
    files = sorted((Path(pymavlink.__file__).parent / "dialects" / "v20").glob("*.xml"))
    assert len(files) > 15
    names = {message.get("name") for message in OURS.values()}
    enums = {enum.get("name") for enum in DEFINITIONS.iterfind("enums/enum")}
    for file in files:
        other = ET.parse(file)
        assert not {int(m.get("id") or 0) for m in other.iterfind("messages/message")} & set(OURS), file.name
        assert not {m.get("name") for m in other.iterfind("messages/message")} & names, file.name
        assert not {e.get("name") for e in other.iterfind("enums/enum")} & enums, file.name


_SIZES = {"uint64_t": 8, "float": 4, "uint32_t": 4, "int32_t": 4, "uint16_t": 2, "int16_t": 2, "int8_t": 1}


def _extra(message: ET.Element) -> tuple[int, int]:
    """(CRC extra, payload length) by MAVLink serialization.md §crc_extra and §field_reordering, without mavgen."""
    fields = []
    for field in message.iterfind("field"):
        kind, _, count = (field.get("type") or "").rstrip("]").partition("[")
        fields.append((kind, field.get("name") or "", int(count or 0), _SIZES.get(kind, 1)))
    ordered = sorted(fields, key=lambda field: -field[3])
    text = f"{message.get('name')} ".encode()
    length = 0
    for kind, name, count, size in ordered:
        text += f"{kind} {name} ".encode() + (bytes((count,)) if count else b"")
        length += size * (count or 1)
    crc = fastcrc.crc16.mcrf4xx(text)
    return (crc & 0xFF) ^ (crc >> 8), length


@pytest.mark.parametrize("id", sorted(OURS))
def test_generated_message_has_the_specified_checksum(id: int) -> None:
    kind = dialect.mavlink_map[id]
    assert kind.msgname == OURS[id].get("name")
    assert (kind.crc_extra, kind.unpacker.size) == _extra(OURS[id])


@pytest.mark.parametrize(
    ("id", "crc_extra", "length"),
    [
        (61_400, 99, 16),
        (61_401, 197, 31),
        (61_402, 47, 20),
        (61_403, 98, 12),
        (61_410, 11, 20),
        (61_411, 139, 20),
        (61_412, 23, 58),
        (61_420, 202, 38),
        (61_421, 221, 42),
    ],
)
def test_the_wire_format_is_frozen(id: int, crc_extra: int, length: int) -> None:
    """A person who changes a published message breaks every client that knows it: take a new id instead."""
    assert _extra(OURS[id]) == (crc_extra, length)


@pytest.mark.parametrize(
    ("prefix", "parrots", "bits"),
    [
        ("ANAFI_FLYING_STATE", ardrone3.FlyingState, False),
        ("ANAFI_WARNING_LEVEL", ardrone3.WarningLevel, False),
        ("ANAFI_ALERT", ardrone3.AlertState, False),
        ("ANAFI_FORCED_LANDING", ardrone3.ForcedLandingReason, False),
        ("ANAFI_PLAN_STATE", common.PlayingState, False),
        ("ANAFI_HOME_TYPE", rth.RthHomeType, False),
        ("ANAFI_RETURN_STATE", rth.RthState, False),
        ("ANAFI_RETURN_REASON", rth.StateReason, False),
        ("ANAFI_RETURN_TRIGGER", rth.AutoTriggerReason, False),
        ("ANAFI_REACHABILITY", rth.RthHomeReachability, False),
        ("ANAFI_RETURN_END", rth.RthEndingBehavior, False),
        ("ANAFI_PILOTING_SOURCE", skyctrl.Source, False),
        ("ANAFI_CALIBRATION", skyctrl.CalibrationStatus, False),
        ("ANAFI_CONTROLLER_BATTERY", skyctrl.BatteryStatus, False),
        ("ANAFI_CHECK", alarms.TakeoffChecklistType, True),
        ("ANAFI_ALARM", alarms.Type, True),
    ],
)
def test_enums_have_parrots_numbers(prefix: str, parrots: type[OpenEnum], bits: bool) -> None:
    values = {
        int(entry.get("value") or -1)
        for enum in DEFINITIONS.iterfind("enums/enum")
        if enum.get("name") == prefix
        for entry in enum.iterfind("entry")
    }
    assert values - {255} == {1 << value if bits else int(value) for value in parrots}


def test_c_headers_pack_the_same_bytes(tmp_path: Path) -> None:
    """What `generate.py --c` writes is compiled, and one message goes through it."""
    compiler = shutil.which("cc")
    made = subprocess.run(
        [sys.executable, GENERATOR, "--c", tmp_path / "mavlink"], capture_output=True, text=True, timeout=60
    )
    assert made.returncode == 0, made.stderr
    header = Path(made.stdout.strip())
    assert header == tmp_path / "mavlink" / "anafi" / "mavlink.h"
    assert {f"mavlink_msg_{kind.get('name', '').lower()}.h" for kind in OURS.values()} <= {
        file.name for file in header.parent.iterdir()
    }
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    program = tmp_path / "program.c"
    program.write_text(
        """
        #include <stdio.h>
        #include "anafi/mavlink.h"
        int main(void) {
            mavlink_message_t message;
            uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
            mavlink_msg_anafi_link_pack(7, 1, &message, 123456, 19330000, -15, 5, ANAFI_LINK_FLAGS_REPORTED);
            unsigned length = mavlink_msg_to_send_buffer(bytes, &message);
            for (unsigned i = 0; i < length; i++) printf("%02x", bytes[i]);
            return 0;
        }
        """
    )
    built = subprocess.run(
        [compiler, "-std=c99", "-I", tmp_path / "mavlink", "-o", tmp_path / "program", program],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert built.returncode == 0, built.stderr
    printed = subprocess.run([tmp_path / "program"], capture_output=True, text=True, timeout=10).stdout
    ours = dialect.MAVLink_anafi_link_message(123456, 19_330_000, -15, 5, dialect.ANAFI_LINK_FLAGS_REPORTED)
    assert printed == frame(pack(ours), 0, 7, 1).hex()
    # By hand: the payload is little-endian and ordered by size, the header says 12 bytes, system 7, component 1, 61403.
    payload = struct.pack("<IIhBB", 123456, 19_330_000, -15, 5, 1)
    assert re.fullmatch("fd0c000000" + "0701" + "dbef00" + payload.hex() + "[0-9a-f]{4}", printed)
