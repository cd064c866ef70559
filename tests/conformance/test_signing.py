"""Signed endpoints: clients with pymavlink's signer are served, all others are refused and change nothing."""

from __future__ import annotations

import asyncio
import functools
import logging
import random
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as stock
from support.lines import UdpClient
from support.signed import OTHER, SECRET, keys, make_key, setup_signing
from support.world import ARMED, HOME, loopback, world

from anafi_mav.config import Config, DroneConfig, RecordingConfig
from anafi_mav.gateway import Gateway
from anafi_mav.mav_enums import MAV_CMD_COMPONENT_ARM_DISARM as ARM
from anafi_mav.mav_enums import MAV_RESULT_ACCEPTED, MAV_SEVERITY_ERROR
from anafi_mav.mavlink.frames import MAGIC_2, SIGNED
from anafi_mav.recording.tlog import TlogReader
from anafi_mav.sim import DroneSpec, Simulator

BURST = 50
"""Datagrams that a socket's buffer holds."""


def has_refused(gateway: Gateway, number: int) -> bool:
    counters = gateway.counters()
    return counters["refused_unsigned"] + counters["refused_signature"] + counters["refused_replay"] == number


async def until(ready: Callable[[], bool]) -> None:
    """Wait for a counter of the gateway, which has no event of its own."""
    for _ in range(10_000):
        if ready():
            return
        await asyncio.sleep(0)
    raise AssertionError


def is_signed(message: object) -> bool:
    return bool(message.get_signed())  # type: ignore[attr-defined]


async def test_setup_signing_on_loopback_signs_the_endpoint(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    async with world(also="px4", recording=RecordingConfig(folder=str(tmp_path / "recorded"))) as w:
        station, other, elsewhere = w.client, await w.connect(254), await w.connect(253, port=5761)
        mark, other_mark = station.mark(), other.mark()
        station.send(setup_signing(SECRET))
        text = await other.wait("STATUSTEXT", lambda m: "Signing key" in m.text, since=other_mark)
        assert text.text == "Signing key changed by system 255"
        # As QGroundControl: it keeps reading unsigned frames until a heartbeat verifies, and then signs.
        station.expect_key(SECRET)
        await station.wait("HEARTBEAT", is_signed, since=mark)
        await station.wait("CAMERA_HEARTBEAT", is_signed, since=mark)
        (file,) = keys().glob("*.key")
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        assert file.read_bytes()[:32] == SECRET

        # Without the key no command arrives.
        before = w.gateway.counters()["refused_unsigned"]
        other.send_command(ARM, 1)
        station.send_command(ARM, 1)
        station.sign(SECRET)
        mark = station.mark()
        assert (await station.command(ARM, 1)).result == MAV_RESULT_ACCEPTED
        await until(lambda: w.gateway.counters()["refused_unsigned"] >= before + 2)
        assert not other.since(other_mark, "COMMAND_ACK")

        # Armed: no key is changed, over whichever endpoint.
        for client in (station, elsewhere):
            mark = client.mark()
            client.send(setup_signing(OTHER))
            refused = await client.wait("STATUSTEXT", lambda m: "igning" in m.text, since=mark)
            assert (refused.text, refused.severity) == ("Signing refused: system 1 is armed", MAV_SEVERITY_ERROR)
        assert (await station.command(ARM, 0)).result == MAV_RESULT_ACCEPTED
        await station.heartbeat(lambda beat: not beat.base_mode & ARMED)

        # Another key, then none.
        mark = station.mark()
        station.send(setup_signing(OTHER))
        station.sign(OTHER)
        await station.wait("HEARTBEAT", is_signed)
        assert file.with_suffix(".key.old").read_bytes()[:32] == SECRET
        station.send(setup_signing(bytes(32)))
        station.sign(None)
        await station.heartbeat(lambda beat: not is_signed(beat), since=station.mark())
        assert (await other.command(ARM, 1)).result == MAV_RESULT_ACCEPTED
        for client in w.clients:
            assert not client.since(0, "SETUP_SIGNING")
    recorded = [path.read_bytes() for path in (tmp_path / "recorded").rglob("*.tlog")]
    entries = [entry.frame for data in recorded for entry in TlogReader().receive(data)]
    assert any(raw[5] == 255 for raw in entries)
    assert not any(raw[0] == MAGIC_2 and raw[2] & SIGNED for raw in entries)
    for secret in (SECRET, OTHER):
        assert secret not in b"".join(recorded)
        for form in (secret.hex(), repr(secret), str(secret), str(list(secret)), str(tuple(secret))):
            assert form[1:-1] not in caplog.text


async def test_signed_endpoint_survives_hostile_frames_and_a_restart() -> None:
    chance, address, drone_address = random.Random(14), loopback(), loopback()
    name = f"udpin-{address}-14550"
    make_key(name)
    config = Config(
        endpoints=(f"udpin://{address}:14550",),
        drones=(DroneConfig(name="alpha", sysid=1, address=drone_address),),
        http=False,
        video=False,
    )
    spec = DroneSpec(address=drone_address, home=HOME, http_port=None)
    recorded: list[bytes] = []

    class Recorder(UdpClient):
        def send_raw(self, data: bytes) -> None:
            recorded.append(data)
            super().send_raw(data)

    async def hostile(gateway: Gateway, attacker: UdpClient) -> None:
        """Send unsigned, forged and recorded commands, and wait until each is refused."""
        plain, forger = stock.MAVLink(None, 255, 190), stock.MAVLink(None, 255, 190)
        forger.signing.secret_key, forger.signing.sign_outgoing = chance.randbytes(32), True
        forger.signing.timestamp = 10**14
        arm = stock.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        frames = [arm.pack(plain) for _ in range(300)] + [arm.pack(forger) for _ in range(300)] + recorded * 20
        chance.shuffle(frames)
        for number, raw in enumerate(frames, 1):
            attacker.send_raw(raw)
            if number % BURST and number < len(frames):
                continue
            await until(functools.partial(has_refused, gateway, number))

    async with Simulator([spec], speed=4.0, seed=1) as simulator:
        drone = simulator.drones[0]

        async def armed_by_station() -> None:
            station = await Recorder(255).open(address, (address, 14550))
            station.sign(SECRET)
            while not station.since(0, "HEARTBEAT"):  # one a second, as a station does
                station.send(stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
                with suppress(AssertionError):
                    await station.heartbeat(is_signed, timeout=1.0)
            assert (await station.command(ARM, 1)).result == MAV_RESULT_ACCEPTED
            assert (await station.command(ARM, 0)).result == MAV_RESULT_ACCEPTED
            await station.close()

        file = keys() / f"{name}.key"
        for kind in ("first start", "restart", "start after a crash"):
            async with Gateway(config) as gateway:
                assert await gateway.ready(10.0), gateway.lines()
                attacker = await UdpClient(255).open(address, (address, 14550))
                await hostile(gateway, attacker)
                assert gateway.counters()["refused_replay"] == 20 * len(recorded)
                assert gateway.lines()[1].endswith(f"0 peers, signed with key {name}")
                # One heartbeat in a tenth of a second shows a station which key it needs: fewer bytes than it sent.
                kinds = {message.get_type() for _, message in attacker.received}
                assert kinds <= {"HEARTBEAT"}
                assert len(attacker.received) < 20
                assert not gateway.systems[0].vehicle.armed
                await attacker.close()
                recorded.clear()
                await armed_by_station()
                in_use = file.read_bytes()
            if kind == "restart":
                file.write_bytes(in_use)  # as a crash leaves it
        assert drone.flying_state.name == "LANDED"
