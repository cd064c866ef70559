"""The I/O-free parts of the parameter protocol: encodings, hash and packed file by hand-computed bytes."""

from __future__ import annotations

import math
import struct
from types import SimpleNamespace
from typing import Any

import pytest
from MAVProxy.modules.lib.param_ftp import ftp_param_decode

from anafi_mav.drone.status.battery import BatteryState
from anafi_mav.mavlink.frames import pack
from anafi_mav.models import MODELS, unknown
from anafi_mav.services.checksum import crc32
from anafi_mav.services.flavours import ARDUPILOT, FLAVOURS, PX4
from anafi_mav.services.parameter.parameter_codec import (
    HASH_NAME,
    NO_INDEX,
    ParamType,
    carried,
    carrier,
    hash_check,
    name_of,
    packed_file,
    param_value,
)
from anafi_mav.services.parameter.parameter_service import parameters_of
from anafi_mav.services.parameter.parameter_table_setup import SETUP_PX4


@pytest.mark.parametrize(
    ("value", "kind", "bytewise", "bits"),
    [
        (1, ParamType.INT32, True, 0x00000001),
        (-1, ParamType.INT32, True, 0xFFFFFFFF),
        (2**31 - 1, ParamType.INT32, True, 0x7FFFFFFF),
        (-(2**31), ParamType.INT32, True, 0x80000000),
        (0x7F800001, ParamType.INT32, True, 0x7F800001),  # the bits of a signalling NaN
        (-2, ParamType.INT16, True, 0x0000FFFE),
        (-2, ParamType.INT8, True, 0x000000FE),
        (20.5, ParamType.REAL32, True, 0x41A40000),
        (1, ParamType.INT32, False, 0x3F800000),
        (-4001, ParamType.INT32, False, 0xC57A1000),
        (7, ParamType.INT8, False, 0x40E00000),
        (20.5, ParamType.REAL32, False, 0x41A40000),
        (math.nan, ParamType.REAL32, True, 0x7FC00000),
    ],
)
def test_the_float_field(value: float, kind: ParamType, bytewise: bool, bits: int) -> None:
    """Four bytes of param_value on the wire, little endian, as MAVLink parameter.md has them."""
    assert carrier(value, kind, bytewise=bytewise) == bits
    message = param_value("SIXTEEN_LETTERS_", value, kind, count=3, index=2, bytewise=bytewise)
    payload = pack(message).payload
    assert payload[:4] == struct.pack("<I", bits)
    assert payload[4:] == b"\x03\x00\x02\x00SIXTEEN_LETTERS_" + bytes((kind.mav,))


@pytest.mark.parametrize("value", [0, 1, -1, 4001, 2**31 - 1, -(2**31)])
def test_bytewise_integer_decodes_to_the_same_value(value: int) -> None:
    (field,) = struct.unpack("<f", struct.pack("<i", value))
    assert carried(field, ParamType.INT32, bytewise=True) == value


@pytest.mark.parametrize(
    ("field", "kind", "value"),
    [
        (4.0, ParamType.INT32, 4.0),
        (4.4, ParamType.INT8, 4.0),
        (-3.0, ParamType.INT16, -3.0),
        (2.5, ParamType.REAL32, 2.5),
    ],
)
def test_cast_value_decodes_to_the_same_value(field: float, kind: ParamType, value: float) -> None:
    assert carried(field, kind, bytewise=False) == value


@pytest.mark.parametrize("field", [math.nan, math.inf, -math.inf])
def test_no_whole_number_in_the_field(field: float) -> None:
    assert math.isnan(carried(field, ParamType.INT32, bytewise=False))


def test_crc32() -> None:
    """The common check value 0xCBF43926 of "123456789" has both inversions; without them it is another."""
    assert crc32(b"") == 0
    assert crc32(b"123456789") == 0x2DFD2D88
    assert crc32(b"6789", crc32(b"12345")) == crc32(b"123456789")
    # bit by bit, from the definition: polynomial 0xEDB88320 reflected, beginning with 0
    crc = 0
    for byte in b"ANF":
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xEDB88320 if crc & 1 else 0)
    assert crc32(b"ANF") == crc


def test_hash() -> None:
    """Over names and raw values in the order of the names, whatever the order of the list."""
    values = [("SYS_AUTOSTART", 4001.0, ParamType.INT32), ("MIS_TAKEOFF_ALT", 2.5, ParamType.REAL32)]
    data = b"MIS_TAKEOFF_ALT" + b"\x00\x00\x20\x40" + b"SYS_AUTOSTART" + b"\xa1\x0f\x00\x00"
    assert hash_check(values) == crc32(data)
    message = param_value(HASH_NAME, crc32(data), ParamType.UINT32, count=2, index=NO_INDEX, bytewise=True)
    assert pack(message).payload == struct.pack("<IHH", crc32(data), 2, 0xFFFF) + b"_HASH_CHECK\0\0\0\0\0\x05"


VALUES = [
    ("RTL_ALT", 2000.0, ParamType.INT32),
    ("RTL_ALT_FINAL", 0.0, ParamType.INT16),
    ("SIMPLE", -1.0, ParamType.INT8),
]


def test_packed_file() -> None:
    """By hand: header, then type, common characters and others less one, the others, the value."""
    assert packed_file(VALUES) == bytes.fromhex(
        "1b67 0300 0300"  # magic, in the file, in all
        "03 60 52544c5f414c54 d0070000"  # INT32, 0 common, 7 others "RTL_ALT", 2000
        "02 57 5f46494e414c 0000"  # INT16, 7 common, 6 others "_FINAL", 0
        "01 50 53494d504c45 ff"  # INT8, 0 common, 6 others "SIMPLE", -1
    )


@pytest.mark.parametrize(("start", "count", "names"), [(0, None, 3), (1, None, 2), (1, 1, 1), (3, 5, 0)])
def test_packed_parts(start: int, count: int | None, names: int) -> None:
    data = packed_file(VALUES, start, count)
    assert struct.unpack("<HHH", data[:6]) == (0x671B, names, 3)


def test_mavproxy_reads_the_packed_file() -> None:
    data = packed_file([(one.name, 1.0, one.kind) for one in parameters_of(ARDUPILOT)])
    assert [name.decode() for name, _, _ in ftp_param_decode(data).params] == [
        one.name for one in parameters_of(ARDUPILOT)
    ]


@pytest.mark.parametrize(
    ("field", "name"),
    [("SIXTEEN_LETTERS_", "SIXTEEN_LETTERS_"), ("SHORT\0junk", "SHORT"), (b"SHORT\0", "SHORT"), (b"\xff", "�")],
)
def test_names(field: str | bytes, name: str) -> None:
    assert name_of(field) == name


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
def test_the_tables_are_sound(flavour: object) -> None:
    parameters = parameters_of(flavour)  # type: ignore[arg-type]
    names = [one.name for one in parameters]
    assert names == sorted(names)
    # One of the two is a model's that can avoid obstacles, the other everyone else's (`parameter_table_setup`).
    assert [name for name in set(names) if names.count(name) > 1] == ([] if flavour is ARDUPILOT else ["COM_OBS_AVOID"])
    native = {one.name for one in parameters if one.name.startswith("ANF_")}
    for one in parameters:
        assert one.name.replace("_", "").isalnum()
        assert one.name == one.name.upper()
        assert not one.native or one.native in native
        assert one.kind is not ParamType.UINT32
        assert one.native or one.source  # docs/parameters.md has it
        if flavour is PX4:
            assert one.kind in (ParamType.INT32, ParamType.REAL32)  # all that PX4 has
        if one.write is not None:  # a choice, a range, or both can be shown to a user
            assert one.values or one.limits is not None


def battery_parameters(model: str, state: BatteryState) -> dict[str, float]:
    battery, identity = SimpleNamespace(state=state), SimpleNamespace(model=MODELS.get(model, unknown(0)))
    host: Any = SimpleNamespace(drone=SimpleNamespace(battery=battery, identity=identity))
    return {one.name: one.value(host) for one in SETUP_PX4 if one.name.startswith("BAT1_")}


def test_battery_parameters_follow_the_battery_report() -> None:
    reported = BatteryState(cell_count=4, cell_min_mv=3300, cell_max_mv=4400)
    values = battery_parameters("ai", reported)
    assert (values["BAT1_N_CELLS"], values["BAT1_V_EMPTY"], values["BAT1_V_CHARGED"]) == (4, 3.3, 4.4)


def test_battery_parameters_without_report_are_model_values_or_unknown() -> None:
    values = battery_parameters("4k", BatteryState())
    assert (values["BAT1_N_CELLS"], values["BAT1_V_EMPTY"], values["BAT1_V_CHARGED"]) == (2, -1, -1)
    assert battery_parameters("later", BatteryState())["BAT1_N_CELLS"] == -1
