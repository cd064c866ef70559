"""The drone of the unit tests, connected over real sockets to a device that does what a test commands."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
from support.scripted_device import SETTINGS, STATES, ScriptedDevice

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.drone import Drone


@pytest.fixture
def states() -> list[Message]:
    """States that the device reports at the start; a module that wants more says so in its own."""
    return STATES


@pytest.fixture
def settings() -> list[Message]:
    """And of its settings."""
    return SETTINGS


@pytest.fixture
async def device(states: list[Message], settings: list[Message]) -> AsyncIterator[ScriptedDevice]:
    async with ScriptedDevice() as device:
        device.script[common.AllStates] = lambda _: [*states, common.AllStatesChanged()]
        device.script[common.AllSettings] = lambda _: [*settings, common.AllSettingsChanged()]
        yield device


@pytest.fixture
async def drone(device: ScriptedDevice) -> AsyncIterator[Drone]:
    async with device.connected() as drone:
        yield drone
