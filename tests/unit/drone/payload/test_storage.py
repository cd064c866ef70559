"""Storages in the three ways of telling about them, and formatted and watched in the simulator."""

from __future__ import annotations

import asyncio

import pytest
from msgspec.structs import replace
from support.scripted_device import STATES, ScriptedDevice
from support.simulated import connected

from anafi_mav.arsdk.codec.wire import Message
from anafi_mav.arsdk.messages import common
from anafi_mav.arsdk.messages import user_storage as v1
from anafi_mav.arsdk.messages import user_storage_v2 as v2
from anafi_mav.arsdk.messages.proto import storage as v3
from anafi_mav.arsdk.messages.user_storage import Feature, FormattingType, FsState, PhyState
from anafi_mav.drone import Drone
from anafi_mav.drone.expectation import Commander
from anafi_mav.drone.payload.camera_enums import StoragePolicy
from anafi_mav.drone.payload.storage import Storage, StorageState
from anafi_mav.errors import CommandRejected, CommandTimeout, LocalProtocolError, NotSupported

TELLS = 1 << Feature.FORMAT_RESULT_EVT_SUPPORTED
FIRST, LAST, EMPTY, REMOVE = 1, 2, 4, 8

OLD: list[Message] = [
    v1.Capabilities(TELLS),
    v1.SupportedFormattingTypes(1 << FormattingType.FULL),
    v1.Info("SD", 64_000),
    v1.State(PhyState.AVAILABLE, FsState.READY, 0, 0, 0),
    v1.SdcardUuid("abc"),
]
AI: list[Message] = [
    v2.Capabilities(0, TELLS, v2.StorageType.INTERNAL_STORAGE, FIRST),
    v2.Capabilities(1, TELLS, v2.StorageType.REMOVABLE_STORAGE, LAST),
    v2.Info(0, "Internal", 8_000, FIRST),
    v2.Info(1, "SD", 64_000, LAST),
    v2.State(0, v2.PhyState.AVAILABLE, v2.FsState.READY, 0, 0, 0, "ext4", FIRST),
    v2.State(1, v2.PhyState.AVAILABLE, v2.FsState.FORMAT_NEEDED, 0, 0, 0, "exfat", LAST),
]
NEW: list[Message] = [
    v3.StorageList(storages=(v3.Storage(id=0), v3.Storage(id=1, type=v3.StorageType.REMOVABLE))),
    v3.State(
        id=1,
        storage_info=v3.StorageInfo(name="SD", capacity=64_000),
        storage_state=v3.StorageState(
            physical_state=v3.PhysicalState.AVAILABLE, file_system_state=v3.FileSystemState.FORMAT_NEEDED
        ),
        default_capabilities=v3.Capabilities(
            supported_features=(v3.Feature.FORMAT_RESULT_EVENT_SUPPORTED,),
            supported_erasing_types=(v3.ErasingType.FULL, v3.ErasingType.QUICK),
        ),
    ),
]


async def connect(device: ScriptedDevice, reported: list[Message]) -> Drone:
    device.script[common.AllStates] = lambda _: [*STATES, *reported, common.AllStatesChanged()]
    drone = device.drone()
    await drone.connect()
    return drone


async def test_one_card(device: ScriptedDevice) -> None:
    drone = await connect(device, OLD)
    assert drone.storage.main == 0
    card = drone.storage[0]
    assert (card.name, card.capacity, card.ready, card.removable, card.uuid) == ("SD", 64_000, True, None, "abc")
    device.script[v1.StartMonitoring] = lambda _: [v1.Monitor(1234)]
    assert await drone.storage.start_monitoring(2) == 1234
    assert device.got(v1.StartMonitoring) == [v1.StartMonitoring(2)]
    device.script[v1.StopMonitoring] = lambda _: [v1.State(PhyState.AVAILABLE, FsState.READY, 0, 0, 0)]
    await drone.storage.stop_monitoring()
    await drone.close()


async def test_internal_memory_and_card(device: ScriptedDevice) -> None:
    drone = await connect(device, AI)
    assert drone.storage.main == 1
    assert (drone.storage[0].removable, drone.storage[0].ready) == (False, True)
    assert (drone.storage[1].name, drone.storage[1].ready) == ("SD", False)
    device.script[v2.StartMonitoring] = lambda _: [v2.Monitor(0, 1, FIRST), v2.Monitor(1, 77, LAST)]
    assert await drone.storage.start_monitoring() == 77
    device.script[v2.FormatWithType] = lambda _: [
        v2.FormatResult(0, v2.FormattingResult.ERROR, 3),
        v2.FormatProgress(1, v2.FormattingStep.CLEARING_DATA, 50, 3),
        v2.FormatResult(1, v2.FormattingResult.SUCCESS, 3),
    ]
    await drone.storage.format(FormattingType.QUICK, "card")
    assert device.got(v2.FormatWithType) == [v2.FormatWithType(1, "card", v2.FormattingType.QUICK)]
    assert drone.storage[1].percent is None
    # A card that is taken out is gone; an empty list says nothing about the others.
    heard = asyncio.ensure_future(drone.expect(v2.State, lambda m: m.list_flags == EMPTY))
    await asyncio.sleep(0)
    device.say(
        v2.State(1, v2.PhyState.UNDETECTED, v2.FsState.UNKNOWN, 0, 0, 0, "", REMOVE),
        v2.State(0, v2.PhyState.UNDETECTED, v2.FsState.UNKNOWN, 0, 0, 0, "", EMPTY),
    )
    await heard
    assert set(drone.storage.state) == {0}
    with pytest.raises(NotSupported, match="storage 1"):
        await drone.storage.start_monitoring(id=1)
    await drone.close()


@pytest.mark.parametrize(
    ("policy", "with_card", "without", "removed", "full"),
    [
        (None, 1, 0, 0, 1),
        (StoragePolicy.PRIORITY_REMOVABLE, 1, 0, 0, 1),
        (StoragePolicy.REMOVABLE, 1, 1, None, 1),
        (StoragePolicy.PRIORITY_INTERNAL, 0, 0, 0, 1),
        (StoragePolicy.INTERNAL, 0, 0, 0, 0),
    ],
)
def test_storage_for_media_follows_policy_and_presence(
    policy: StoragePolicy | None, with_card: int, without: int, removed: int | None, full: int
) -> None:
    """`full`: the internal storage is."""
    storage = Storage(Commander())
    internal = StorageState(removable=False, physical=PhyState.AVAILABLE, available=1000)
    card = StorageState(removable=True, physical=PhyState.AVAILABLE, file_system=FsState.FORMATTING)
    for state, expected in (
        ({0: internal, 1: card}, with_card),
        ({0: internal, 1: replace(card, physical=PhyState.UNDETECTED)}, without),
        ({0: internal}, removed),
        ({0: replace(internal, available=0), 1: card}, full),
        ({}, 0),
    ):
        storage.set_state(state)
        assert storage.for_media(policy) == expected


async def test_the_protobuf_service(device: ScriptedDevice) -> None:
    drone = await connect(device, NEW)
    assert drone.storage.main == 1
    assert drone.storage[1].file_system == FsState.FORMAT_NEEDED
    device.script[v3.StartMonitoring] = lambda m: [v3.Monitor(id=m.id, available_space=5)]
    assert await drone.storage.start_monitoring() == 5
    device.script[v3.Format] = lambda m: [v3.FormattingResult(id=m.id, status=v3.FormattingStatus.DENIED)]
    with pytest.raises(CommandRejected, match="denied"):
        await drone.storage.format(FormattingType.QUICK)
    await drone.close()


async def test_a_drone_that_does_not_tell_how_a_format_ended(device: ScriptedDevice) -> None:
    drone = await connect(device, [v1.Capabilities(0), *OLD[1:]])
    last = FsState.READY
    device.script[v1.FormatWithType] = lambda _: [
        v1.State(PhyState.AVAILABLE, state, 0, 0, 0) for state in (FsState.READY, FsState.FORMATTING, last)
    ]
    await drone.storage.format()
    last = FsState.ERROR
    with pytest.raises(CommandRejected):
        await drone.storage.format()
    await drone.close()


async def test_wrong_wishes(device: ScriptedDevice) -> None:
    drone = await connect(device, OLD)
    with pytest.raises(NotSupported, match="quick"):
        await drone.storage.format(FormattingType.QUICK)
    for period in (0, 256):
        with pytest.raises(LocalProtocolError):
            await drone.storage.start_monitoring(period)
    with pytest.raises(CommandTimeout):
        await drone.storage.format(timeout=0.2)
    await drone.close()


async def test_a_drone_without_any(device: ScriptedDevice) -> None:
    drone = await connect(device, [])
    assert drone.storage[0] == StorageState()
    with pytest.raises(NotSupported):
        await drone.storage.format()
    await drone.close()


@pytest.mark.parametrize("model", ["4k", "ai"])
async def test_in_the_simulator(model: str) -> None:
    async with connected(model) as (drone, _):
        card = drone.storage[drone.storage.main]
        assert card.ready
        assert card.capacity == 64_000_000_000
        free = await drone.storage.start_monitoring(1)
        assert 0 < free <= card.capacity
        await drone.storage.format(FormattingType.QUICK)
        assert drone.storage[drone.storage.main].ready
        await drone.storage.stop_monitoring()
        assert drone.storage[drone.storage.main].monitoring is False
