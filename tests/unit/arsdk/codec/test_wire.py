"""The command codec, against bytes worked out by hand from arsdk-ng's encoder."""

from __future__ import annotations

from typing import Annotated

import pytest

from anafi_mav.arsdk.codec import wire
from anafi_mav.arsdk.messages import ardrone3, common, rth, user_storage
from anafi_mav.errors import LocalProtocolError

VECTORS = [
    # project 0 (common), class 4, command 0: no arguments
    ("00 04 0000", common.AllStates()),
    # flag 1, roll 0, pitch 50, yaw 0, gaz -20, timestamp 0
    ("01 00 0200  01 00 32 00 ec 00000000", ardrone3.PCMD(1, 0, 50, 0, -20, 0)),
    # enum as i32
    ("01 04 0100  02000000", ardrone3.FlyingStateChanged(ardrone3.FlyingState.HOVERING)),
    # 1.0, -2.0, 0.5, 0.0 as floats
    ("01 00 0700  0000803f 000000c0 0000003f 00000000", ardrone3.MoveBy(1.0, -2.0, 0.5, 0.0)),
    # NUL-terminated string
    ("00 03 0200  41 4e 41 00", common.ProductNameChanged("ANA")),
    # a string in front of a u64
    ("91 00 0100  73 64 00 0010000000000000", user_storage.Info("sd", 4096)),
    # feature: class 0
    ("92 00 0d00  01000000 00000000", rth.State(rth.RthState.IN_PROGRESS, rth.StateReason.USER_REQUEST)),
]


@pytest.mark.parametrize(("text", "message"), VECTORS)
def test_known_bytes(text: str, message: wire.Message) -> None:
    data = bytes.fromhex(text)
    assert wire.encode(message) == data
    assert wire.decode(data) == message


@pytest.mark.parametrize(("text", "message"), VECTORS)
def test_shorter_prefix_is_refused_and_longer_one_tolerated(text: str, message: wire.Message) -> None:
    data = bytes.fromhex(text)
    for size in range(len(data)):
        assert wire.decode(data[:size]) is None
    assert wire.decode(data + b"\1\2\3") == message


def test_unknown_message_survives_as_raw() -> None:
    data = bytes.fromhex("fa 07 3412 deadbeef")
    message = wire.decode(data)
    assert message == wire.UnknownMessage(wire.MessageId(250, 7, 0x1234), bytes.fromhex("deadbeef"))
    assert wire.encode(message) == data


def test_unknown_enum_value_survives_as_integer() -> None:
    data = bytes.fromhex("01 04 0100  4d000000")
    message = wire.decode(data)
    assert isinstance(message, ardrone3.FlyingStateChanged)
    assert message.state == 77
    assert message.state.name == "UNKNOWN_77"
    assert wire.encode(message) == data


def test_invalid_utf8_is_replaced() -> None:
    assert wire.decode(bytes.fromhex("00 03 0200 ff 41 00")) == common.ProductNameChanged("\ufffdA")


@pytest.mark.parametrize(
    "message",
    [
        ardrone3.PCMD(1, 128, 0, 0, 0, 0),
        ardrone3.PCMD(256, 0, 0, 0, 0, 0),
        common.ProductNameChanged("a\0b"),
        ardrone3.MoveBy("far", 0.0, 0.0, 0.0),  # type: ignore[arg-type]
    ],
)
def test_our_own_wrong_arguments_raise(message: wire.Message) -> None:
    with pytest.raises(LocalProtocolError, match=type(message).__name__):
        wire.encode(message)


def test_an_id_can_be_declared_once_only() -> None:
    with pytest.raises(LocalProtocolError, match=r"1-0-2 belongs to ardrone3\.Piloting\.PCMD"):

        @wire.command("ardrone3.Piloting.Again", 1, 0, 2)
        class Again(wire.Message, frozen=True):
            flag: Annotated[int, wire.U8]
