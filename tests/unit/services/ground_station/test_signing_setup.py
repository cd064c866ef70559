"""SETUP_SIGNING: over which endpoint and in which state a key is changed, and who receives which text."""

from __future__ import annotations

import asyncio
import random
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from support.hanging_disk import PATIENCE, hanging

from anafi_mav.clock import SystemClock
from anafi_mav.drone.events import FlyingState
from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.access import Access
from anafi_mav.mavlink.channel import Channel
from anafi_mav.mavlink.key_ring import KeyRing, read_key, write_key
from anafi_mav.mavlink.node import Inbound
from anafi_mav.mavlink.signing import LATEST
from anafi_mav.services.ground_station.signing_setup import SigningSetup
from anafi_mav.state_lock import STATE_WRITER
from anafi_mav.texts import OperatorText
from anafi_mav.vehicle.base.severity import Severity

SECRET, OTHER, NONE = bytes(range(32)), bytes(range(1, 33)), bytes(32)


@dataclass
class Craft:
    """The vehicle of a system."""

    armed: bool = False
    flying_state: FlyingState | None = FlyingState.LANDED


@dataclass
class Drone:
    """A system of the gateway, and what it sent."""

    sysid: int
    active: bool = True
    vehicle: Any = field(default_factory=Craft)
    texts: list[tuple[Channel | None, Severity, str]] = field(default_factory=list)
    heartbeats: int = 0

    def text(self, severity: Severity, text: OperatorText, to: Channel | None = None) -> None:
        self.texts.append((to, severity, text))

    def send_heartbeat(self) -> None:
        self.heartbeats += 1


class Bench:
    """Two channels of one endpoint, one of another, and two drones."""

    def __init__(self, folder: Path, secret: bytes | None, *, is_local: bool) -> None:
        if secret is not None:
            write_key(folder, "field", secret + bytes(8))
        self.keys = KeyRing(folder, SystemClock())
        self.channels = [Channel(name, lambda raw: None) for name in ("one", "two", "elsewhere")]
        for channel, key in zip(self.channels, ("field", "field", "elsewhere"), strict=True):
            channel.is_local = is_local
            signing = self.keys.open(key, is_required=False)
            assert signing is not None
            channel.protect(signing)
        self.drones = [Drone(1), Drone(2)]
        self.setup = SigningSetup(self.keys, lambda: self.channels, lambda: self.drones)

    @property
    def key(self) -> Any:
        return self.channels[0].signing

    def post(self, secret: bytes, *, target: int = 2, timestamp: int = 0, is_permitted: bool = True) -> None:
        message = dialect.MAVLink_setup_signing_message(target, 1, list(secret), timestamp)
        self.setup.receive(Inbound(message, message.get_msgId(), self.channels[0], 255, 190, 0.0, is_permitted))

    async def send(self, secret: bytes, *, target: int = 2, timestamp: int = 0, is_permitted: bool = True) -> None:
        """Send it, and wait for its answer."""
        self.post(secret, target=target, timestamp=timestamp, is_permitted=is_permitted)
        await self.setup.settle()


@pytest.mark.parametrize(("secret", "is_local"), [(SECRET, False), (SECRET, True), (None, True), (NONE, True)])
async def test_signed_or_loopback_endpoint_takes_a_key(tmp_path: Path, secret: bytes | None, is_local: bool) -> None:
    bench = Bench(tmp_path / "keys", secret, is_local=is_local)
    await bench.send(OTHER)
    assert bench.key.is_key(OTHER)
    one, two, _ = bench.channels
    # The addressed system answers; all systems of the endpoint show themselves with the new key.
    assert bench.drones[1].texts == [
        (two, Severity.WARNING, "Signing key changed by system 255"),
        (one, Severity.INFO, "Signing on: key in use"),
    ]
    assert bench.drones[0].texts == []
    assert [drone.heartbeats for drone in bench.drones] == [1, 1]
    elsewhere = bench.channels[2].signing
    assert elsewhere is not None
    assert not elsewhere.is_on
    await bench.send(NONE)
    assert not bench.key.is_on
    assert bench.drones[1].texts[-2:] == [
        (two, Severity.WARNING, "Signing switched off by system 255"),
        (one, Severity.INFO, "Signing off"),
    ]
    await bench.keys.close()


async def test_same_key_again_is_confirmed_and_not_announced(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=False)
    await bench.send(SECRET, timestamp=2**47)
    assert bench.drones[1].texts == [(bench.channels[0], Severity.INFO, "Signing on: key in use")]
    assert bench.key.timestamp < 2**47
    assert not (tmp_path / "keys" / "field.key.old").exists()


@pytest.mark.parametrize("secret", [None, NONE])
@pytest.mark.parametrize("wanted", [OTHER, NONE])
async def test_remote_unsigned_endpoint_takes_no_key(tmp_path: Path, secret: bytes | None, wanted: bytes) -> None:
    bench = Bench(tmp_path / "keys", secret, is_local=False)
    await bench.send(wanted)
    assert not bench.key.is_on
    refusal = (bench.channels[0], Severity.ERROR, "Signing refused: endpoint is not on loopback")
    assert bench.drones[1].texts == [refusal]
    assert [drone.heartbeats for drone in bench.drones] == [0, 0]


async def test_observer_changes_no_key(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    bench.channels[0].access = Access.OBSERVE
    await bench.send(OTHER, is_permitted=False)
    assert bench.key.is_key(SECRET)
    refusal = (bench.channels[0], Severity.ERROR, "Signing refused: access of endpoint is observe")
    assert bench.drones[1].texts == [refusal]


async def test_refusals_of_an_endpoint_are_one_line_of_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A client has another port, and with that another name, whenever it connects."""
    bench = Bench(tmp_path / "keys", SECRET, is_local=False)
    for channel in bench.channels[:2]:
        channel.endpoint = "tcpin://192.0.2.1:5760"
        message = dialect.MAVLink_setup_signing_message(2, 1, list(OTHER), 0)
        bench.setup.receive(Inbound(message, message.get_msgId(), channel, 255, 190, 0.0, False))
    await bench.setup.settle()
    warnings = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert len(warnings) == 2
    assert len(set(warnings)) == 1


@pytest.mark.parametrize("active", [True, False])
async def test_key_is_not_changed_while_any_drone_is_armed(tmp_path: Path, active: bool) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    bench.drones[0].vehicle.armed, bench.drones[0].active = True, active  # also one whose link is lost
    for wanted in (OTHER, NONE):
        await bench.send(wanted)
    assert bench.key.is_key(SECRET)
    refusal = (bench.channels[0], Severity.ERROR, "Signing refused: system 1 is armed")
    assert bench.drones[1].texts == [refusal, refusal]


async def test_key_is_not_changed_before_each_drone_was_heard(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    bench.drones[0].vehicle.flying_state, bench.drones[0].active = None, False
    for wanted in (OTHER, NONE):
        await bench.send(wanted)
    assert bench.key.is_key(SECRET)
    refusal = (bench.channels[0], Severity.ERROR, "Signing refused: state of system 1 is unknown")
    assert bench.drones[1].texts == [refusal, refusal]


async def test_random_setup_signing_is_a_key_or_a_refusal(tmp_path: Path, fuzz_seed: int) -> None:
    chance = random.Random(fuzz_seed)
    bench = Bench(tmp_path / "keys", None, is_local=True)
    for _ in range(30):
        secret = chance.choice((SECRET, NONE, chance.randbytes(32)))
        bench.drones[0].vehicle.armed = is_armed = chance.random() < 0.3
        before = bench.key.timestamp
        await bench.send(secret, target=chance.randrange(256), timestamp=chance.getrandbits(chance.choice((8, 48, 64))))
        assert is_armed or bench.key.is_key(secret)
        assert before <= bench.key.timestamp < LATEST
        assert bench.keys.problem == ""


async def test_key_that_cannot_be_stored_is_not_used(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    (tmp_path / "keys" / "field.key.old").mkdir()
    await bench.send(OTHER)
    assert bench.key.is_key(SECRET)
    refusal = (bench.channels[0], Severity.ERROR, "Signing refused: key file cannot be written")
    assert bench.drones[1].texts == [refusal]


async def test_key_is_written_outside_of_the_event_loop_and_used_afterwards(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    with hanging(STATE_WRITER):
        bench.post(OTHER)
        bench.post(OTHER)  # some stations send it twice
        assert bench.key.is_key(SECRET)
        assert [drone.texts for drone in bench.drones] == [[], []]
    await bench.setup.settle()
    assert bench.key.is_key(OTHER)
    one, two, _ = bench.channels
    in_use = (one, Severity.INFO, "Signing on: key in use")
    assert bench.drones[1].texts == [(two, Severity.WARNING, "Signing key changed by system 255"), in_use, in_use]
    await bench.keys.close()


async def test_drone_that_is_armed_while_the_key_is_written_keeps_the_old_one(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    with hanging(STATE_WRITER):
        bench.post(OTHER)
        bench.drones[0].vehicle.armed = True
    await bench.setup.settle()
    assert bench.drones[1].texts == [(bench.channels[0], Severity.ERROR, "Signing refused: system 1 is armed")]
    assert bench.key.is_key(SECRET)
    assert await STATE_WRITER.drain(PATIENCE)
    assert (read_key(tmp_path / "keys", "field") or b"")[:32] == SECRET


async def test_key_behind_a_hanging_disk_is_refused_and_not_written_later(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    with hanging(STATE_WRITER):
        await bench.send(OTHER)
        refusal = (bench.channels[0], Severity.ERROR, "Signing refused: key file cannot be written")
        assert bench.drones[1].texts == [refusal]
    assert await STATE_WRITER.drain(PATIENCE)
    assert bench.key.is_key(SECRET)
    assert (read_key(tmp_path / "keys", "field") or b"")[:32] == SECRET


async def test_other_key_that_waited_for_the_disk_is_refused(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    third = bytes(range(2, 34))
    with hanging(STATE_WRITER):
        bench.post(OTHER)
        bench.post(third)  # it would not have arrived with the key that is in use then
    await bench.setup.settle()
    assert bench.key.is_key(OTHER)
    assert "Signing refused: another key has been set" in caplog.text
    assert third.hex() not in caplog.text


async def test_end_of_the_gateway_leaves_the_old_key(tmp_path: Path) -> None:
    bench = Bench(tmp_path / "keys", SECRET, is_local=True)
    with hanging(STATE_WRITER):
        bench.post(OTHER)
        await asyncio.sleep(0)
        await bench.setup.close()
    assert await STATE_WRITER.drain(PATIENCE)
    assert bench.key.is_key(SECRET)
    assert (read_key(tmp_path / "keys", "field") or b"")[:32] == SECRET
