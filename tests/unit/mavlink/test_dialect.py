"""The overlay is upstream's wire format, and a contradiction stops the generator."""

from __future__ import annotations

import ast
import importlib.util
import re
import struct
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType

import pytest

from anafi_mav import mav_enums
from anafi_mav.mavlink import dialect

# id, name, CRC extra, length without and with extension fields, fields in wire order.
# Computed by hand-written code (not mavgen) from mavlink/mavlink de1e078a (2026-07-22) message_definitions/v1.0/all.xml
# by the rules of MAVLink serialization.md §crc_extra and §field_reordering; BATTERY_INFO 26/140 and CONTROL_STATUS
# 21/12 agree with the headers of mavlink/c_library_v2.
UPSTREAM = [
    (
        *(8, "LINK_NODE_STATUS", 117, 36, 36),
        "timestamp tx_rate rx_rate messages_sent messages_received messages_lost rx_parse_err tx_overflows "
        "rx_overflows tx_buf rx_buf",
    ),
    (
        *(42, "MISSION_CURRENT", 28, 2, 18),
        "seq total mission_state mission_mode mission_id fence_id rally_points_id",
    ),
    (44, "MISSION_COUNT", 221, 4, 9, "count target_system target_component mission_type opaque_id"),
    (47, "MISSION_ACK", 153, 3, 8, "target_system target_component type mission_type opaque_id"),
    (80, "COMMAND_CANCEL", 14, 4, 4, "command target_system target_component"),
    (111, "TIMESYNC", 34, 16, 18, "tc1 ts1 target_system target_component"),
    (126, "SERIAL_CONTROL", 220, 79, 81, "baudrate timeout device flags count data target_system target_component"),
    (
        *(300, "PROTOCOL_VERSION", 217, 22, 22),
        "version min_version max_version spec_version_hash library_version_hash",
    ),
    (
        *(372, "BATTERY_INFO", 26, 140, 140),
        "discharge_minimum_voltage charging_minimum_voltage resting_minimum_voltage charging_maximum_voltage "
        "charging_maximum_current nominal_voltage discharge_maximum_current discharge_maximum_burst_current "
        "design_capacity full_charge_capacity cycle_count weight id battery_function type state_of_health "
        "cells_in_series manufacture_date serial_number name",
    ),
    (
        *(395, "COMPONENT_INFORMATION", 0, 212, 212),
        "time_boot_ms general_metadata_file_crc peripherals_metadata_file_crc general_metadata_uri "
        "peripherals_metadata_uri",
    ),
    (
        *(396, "COMPONENT_INFORMATION_BASIC", 50, 160, 160),
        "capabilities time_boot_ms time_manufacture_s vendor_name model_name software_version hardware_version "
        "serial_number",
    ),
    (397, "COMPONENT_METADATA", 182, 108, 108, "time_boot_ms file_crc uri"),
    (400, "PLAY_TUNE_V2", 110, 254, 254, "format target_system target_component tune"),
    (
        *(410, "EVENT", 160, 53, 53),
        "id event_time_boot_ms sequence destination_component destination_system log_levels arguments",
    ),
    (411, "CURRENT_EVENT_SEQUENCE", 106, 3, 3, "sequence flags"),
    (412, "REQUEST_EVENT", 33, 6, 6, "first_sequence last_sequence target_system target_component"),
    (
        *(413, "RESPONSE_EVENT_ERROR", 77, 7, 7),
        "sequence sequence_oldest_available target_system target_component reason",
    ),
    (512, "CONTROL_STATUS", 21, 12, 12, "flags gcs_main gcs_secondary"),
]


@pytest.mark.parametrize(("id", "name", "crc", "base", "full", "fields"), UPSTREAM, ids=lambda value: str(value)[:24])
def test_overlaid_message_is_upstreams(id: int, name: str, crc: int, base: int, full: int, fields: str) -> None:
    message = dialect.mavlink_map[id]
    assert message.msgname == name
    assert message.crc_extra == crc
    assert message.unpacker.size == full
    assert " ".join(message.ordered_fieldnames) == fields
    # Extension fields are those that a constructor gives a default; mavgen keeps no other trace of the border.
    extensions = len(message.__init__.__defaults__ or ())
    formats = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)
    assert struct.calcsize("<" + "".join(formats[: len(formats) - extensions])) == base


# Same source, the enums.
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("MAV_CMD_REQUEST_OPERATOR_CONTROL", 32100),
        ("MAV_RESULT_CANCELLED", 6),
        ("MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME", 9),
        ("MAV_RESULT_NOT_IN_CONTROL", 10),
        ("MAV_MODE_PROPERTY_AUTO_MODE", 4),
        ("COMP_METADATA_TYPE_EVENTS", 4),
        ("MAV_EVENT_ERROR_REASON_UNAVAILABLE", 0),
        ("GCS_CONTROL_STATUS_FLAGS_TAKEOVER_ALLOWED", 2),
    ],
)
def test_overlaid_enum_entry_is_upstreams(name: str, value: int) -> None:
    assert getattr(dialect, name) == value


def test_dialect_has_version_2_and_messages_of_both_autopilots() -> None:
    assert dialect.WIRE_PROTOCOL_VERSION == "2.0"
    assert dialect.MAVLink_available_modes_message.id == 435
    assert dialect.MAVLink_ekf_status_report_message.id == 193  # ArduPilot's own
    assert len(dialect.mavlink_map) > 300


def test_messages_have_the_attributes_of_mavgens_constructor() -> None:
    """They are the classes' own: a constructor sets the fields alone."""
    message = dialect.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3)
    assert message.get_msgId() == 0
    assert message.get_type() == "HEARTBEAT"
    assert message.get_fieldnames() == dialect.MAVLink_heartbeat_message.fieldnames
    assert (message.get_seq(), message.get_srcSystem(), message.get_signed(), message.get_crc()) == (0, 0, False, None)
    assert sorted(vars(message)) == sorted(dialect.MAVLink_heartbeat_message.fieldnames)


def test_message_classes_lack_descriptions_units_and_older_names() -> None:
    """They are not used, and take memory for as long as the gateway runs."""
    unused = {"fielddisplays_by_name", "fieldenums_by_name", "fieldunits_by_name", "native_format", "name"}
    for kind in dialect.mavlink_map.values():
        assert not unused & vars(kind).keys()
        assert kind.__doc__ is None


def test_packing_a_message_leaves_others_of_its_class_alone() -> None:
    packed, other = (dialect.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3) for _ in range(2))
    sender = dialect.MAVLink(None, 7, 8)
    sender.seq = 9
    packed.pack(sender)
    assert (packed.get_srcSystem(), packed.get_seq()) == (7, 9)
    assert (other.get_srcSystem(), other.get_seq(), other.get_msgbuf()) == (0, 0, b"")


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    path = Path(__file__).parents[3] / "dialect" / "generate.py"
    spec = importlib.util.spec_from_file_location("generate", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_generated_modules_agree_with_their_definitions(generator: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "mavlink").mkdir()
    fresh = {path.name: path.read_bytes() for path in generator.generate(tmp_path)}
    used = [Path(str(module.__file__)) for module in (mav_enums, dialect)]
    assert fresh == {path.name: path.read_bytes() for path in used}, "run dialect/generate.py"


def test_enums_equal_mavgens_numbers_and_names(generator: ModuleType, tmp_path: Path) -> None:
    """mavgen's own module, before its enums are taken out, is the referee."""
    path = tmp_path / "whole.py"
    generator._run_mavgen(path, "Python3")
    spec = importlib.util.spec_from_file_location("whole", path)
    assert spec is not None
    assert spec.loader is not None
    whole = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(whole)

    def entries(module: ModuleType) -> dict[str, list[tuple[int, str, bool]]]:
        found = module.enums.items()
        return {enum: [(n, one.name, one.has_location) for n, one in table.items()] for enum, table in found}

    def numbers(module: ModuleType) -> dict[str, int]:
        return {name: value for name, value in vars(module).items() if isinstance(value, int)}

    assert entries(whole) == entries(mav_enums)
    assert numbers(whole) == numbers(dialect)
    assert numbers(mav_enums).items() <= numbers(dialect).items()
    assert set().union(*({one for _, one, _ in table} for table in entries(whole).values())) <= set(numbers(mav_enums))


def test_enums_are_stored_once_and_import_nothing() -> None:
    assert dialect.enums is mav_enums.enums
    tree = ast.parse(Path(mav_enums.__file__).read_text(encoding="utf-8"))
    assert not [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]


def overlay(text: str) -> ET.ElementTree:
    return ET.ElementTree(ET.fromstring(f"<mavlink>{text}</mavlink>"))


@pytest.mark.parametrize("text", ["", "\n# enums\n", "\n# enums\nX = 1\n# message IDs\n"])
def test_module_of_another_mavgen_is_refused(generator: ModuleType, text: str) -> None:
    with pytest.raises(generator.OverlayError, match="mavgen"):
        generator.split(text)


def test_merge_leaves_equal_definitions_unchanged(generator: ModuleType) -> None:
    trees = generator.read_definitions()
    before = {name: ET.tostring(tree.getroot()) for name, tree in trees.items()}
    ping = next(m for m in trees["common.xml"].iterfind("messages/message") if m.get("name") == "PING")
    generator.merge(trees, overlay(f"<messages>{ET.tostring(ping, 'unicode')}</messages>"))
    assert {name: ET.tostring(tree.getroot()) for name, tree in trees.items()} == before


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            '<messages><message id="4" name="OTHER"><field type="uint8_t" name="a"/></message></messages>',
            "message id 4 of OTHER belongs to PING",
        ),
        (
            '<messages><message id="5000" name="PING"><field type="uint8_t" name="a"/></message></messages>',
            "PING has id 4, not 5000",
        ),
        (
            '<messages><message id="4" name="PING"><field type="uint8_t" name="time_usec"/></message></messages>',
            "PING is another message",
        ),
        (
            '<messages><message id="66" name="REQUEST_DATA_STREAM"><field type="uint8_t" name="target_system"/>'
            '<field type="uint8_t" name="target_component"/><field type="uint8_t" name="req_stream_id"/>'
            '<field type="uint16_t" name="req_message_rate"/><field type="uint8_t" name="start_stop"/>'
            '<field type="uint8_t" name="more"/></message></messages>',
            "REQUEST_DATA_STREAM has too few fields",
        ),
        (
            '<enums><enum name="MAV_RESULT"><entry value="77" name="MAV_RESULT_DENIED"/></enum></enums>',
            "MAV_RESULT_DENIED is 2",
        ),
    ],
)
def test_a_contradiction_is_refused(generator: ModuleType, text: str, complaint: str) -> None:
    with pytest.raises(generator.OverlayError, match=complaint):
        generator.merge(generator.read_definitions(), overlay(text))
