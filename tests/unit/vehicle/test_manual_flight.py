"""What the sticks of ground stations say, and who holds them."""

from __future__ import annotations

from typing import Any

import pytest

from anafi_mav.mavlink import dialect
from anafi_mav.services.setpoint.stick_messages import RcChannels, manual_sticks
from anafi_mav.vehicle.manual_flight import Sticks


def manual(x: int = 0, y: int = 0, z: int = 500, r: int = 0) -> Any:
    return dialect.MAVLink_manual_control_message(1, x, y, z, r, 0)


@pytest.mark.parametrize(
    ("axes", "sticks"),
    [
        ({}, Sticks()),
        ({"x": 1000}, Sticks(forward=1.0)),
        ({"x": -500}, Sticks(forward=-0.5)),
        ({"y": 400}, Sticks(right=0.4)),
        ({"r": -1000}, Sticks(turn=-1.0)),
        ({"z": 1000}, Sticks(climb=1.0)),
        ({"z": 0}, Sticks(climb=-1.0)),
        ({"z": 750}, Sticks(climb=0.5)),
        ({"x": 30, "y": -30, "r": 30, "z": 515}, Sticks()),  # not quite in the middle
        ({"x": 31}, Sticks(forward=0.031)),
        ({"x": 32767, "y": 200}, Sticks(right=0.2)),
        ({"z": 32767}, Sticks()),
    ],
)
def test_the_axes_of_manual_control(axes: dict[str, int], sticks: Sticks) -> None:
    assert manual_sticks(manual(**axes)) == sticks


def test_manual_control_without_axes_is_no_input() -> None:
    assert manual_sticks(manual(32767, 32767, 32767, 32767)) is None


@pytest.mark.parametrize("axes", [{"x": 1001}, {"y": -32768}, {"r": 20000}, {"z": 1001}, {"z": -1}])
def test_axes_of_another_scale_are_not_flown(axes: dict[str, int]) -> None:
    assert isinstance(manual_sticks(manual(**axes)), str)


def override(*channels: int) -> Any:
    return dialect.MAVLink_rc_channels_override_message(1, 1, *channels, *[0xFFFF] * (8 - len(channels)))


def after(*messages: Any) -> RcChannels:
    channels = RcChannels()
    for message in messages:
        result = channels.after(message)
        assert isinstance(result, RcChannels)
        channels = result
    return channels


@pytest.mark.parametrize(
    ("channels", "sticks"),
    [
        ((1500, 1500, 1500, 1500), Sticks()),
        ((2000, 1500, 1500, 1500), Sticks(right=1.0)),
        ((1500, 1250, 1500, 1500), Sticks(forward=0.5)),  # ArduPilot: low is nose down
        ((1500, 2000, 1500, 1500), Sticks(forward=-1.0)),
        ((1500, 1500, 1750, 1500), Sticks(climb=0.5)),
        ((1500, 1500, 1000, 1500), Sticks(climb=-1.0)),
        ((1500, 1500, 1500, 1000), Sticks(turn=-1.0)),
        ((2200, 1500, 1500, 1500), Sticks(right=1.0)),
        ((0, 0, 1750, 0), Sticks(climb=0.5)),
    ],
)
def test_the_channels(channels: tuple[int, ...], sticks: Sticks) -> None:
    assert after(override(*channels)).sticks == sticks


def test_override_changes_only_the_set_channels() -> None:
    first = override(1700, 0xFFFF, 0xFFFF, 0xFFFF)
    assert after(first).sticks == Sticks(right=0.4)
    assert after(first, override(0xFFFF, 1300, 0xFFFF, 0xFFFF)).sticks == Sticks(right=0.4, forward=0.4)
    assert after(first, override(0, 1300, 0xFFFF, 0xFFFF)).sticks == Sticks(forward=0.4)
    assert after(first, override(0, 0xFFFF, 0xFFFF, 0xFFFF)).released
    assert after(override()).released
    assert after(override(0, 0, 0, 0, 1500, 1500)).released  # other channels are no one's sticks


@pytest.mark.parametrize("value", [1, 799, 2201, 65534])
def test_channels_of_another_scale_are_not_flown(value: int) -> None:
    assert isinstance(RcChannels().after(override(value)), str)
