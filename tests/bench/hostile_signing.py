"""Hostile frames against a signed endpoint: how many are admitted, and what a station feels meanwhile.

    .venv/bin/python tests/bench/hostile_signing.py [FRAMES]

Default: 100 000 datagrams to a signed `udpin`, in equal parts unsigned, of MAVLink 1, signed with another key, with a
damaged signature, and recorded from the station, each a command to arm. A quarter of them leaves from the station's own
address. Gateway, simulated drone, station and attacker are one process and share its core: the rate is a lower limit.
Each burst is followed by a wait until the gateway has counted it, so that none is lost in a socket's buffer. Behind
each burst the station sends a command and measures the time to its COMMAND_ACK.

Judged by the simulator's log and by the gateway's counters. Exit status 1 if one frame was admitted.
"""

from __future__ import annotations

import asyncio
import os
import random
import sys
import tempfile
import time
from pathlib import Path

from common import loopback, machine, quantile
from pymavlink.dialects.v20 import ardupilotmega as stock

sys.path.insert(0, str(Path(__file__).parents[1]))

from support.lines import UdpClient
from support.signed import OTHER, SECRET, make_key

from anafi_mav.config import Config, DroneConfig
from anafi_mav.gateway import Gateway
from anafi_mav.sim import DroneSpec, Simulator

PORT, BURST = 14550, 100
HOME = (48.8789, 2.3677, 35.0)
ARM = stock.MAV_CMD_COMPONENT_ARM_DISARM
HARMLESS = stock.MAV_CMD_REQUEST_MESSAGE
REFUSALS = ("refused_unsigned", "refused_signature", "refused_replay")


class Recorder(UdpClient):
    """A station whose frames are recorded."""

    def __init__(self) -> None:
        super().__init__(255)
        self.recorded: list[bytes] = []

    def send_raw(self, data: bytes) -> None:
        self.recorded.append(data)
        super().send_raw(data)


def hostile(kind: int, recorded: list[bytes], chance: random.Random) -> bytes:
    """One datagram of one of five kinds."""
    arm = stock.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    sender = stock.MAVLink(None, 255, 190)
    sender.seq = chance.randrange(256)
    if kind == 0:
        return bytes(arm.pack(sender))
    if kind == 1:
        return bytes(arm.pack(sender, force_mavlink1=True))
    if kind == 4:
        return chance.choice(recorded)
    sender.signing.secret_key = OTHER if kind == 2 else SECRET
    sender.signing.sign_outgoing = True
    sender.signing.timestamp = 10**14
    sender.signing.link_id = chance.randrange(256)
    raw = bytearray(arm.pack(sender))
    if kind == 3:
        raw[-chance.randint(1, 12)] ^= chance.randint(1, 255)
    return bytes(raw)


async def run(total: int, address: str) -> bool:
    chance = random.Random(14)
    config = Config(
        endpoints=(f"udpin://{address}:{PORT}?signing=field",),
        drones=(DroneConfig(name="alpha", sysid=1, address=loopback()),),
        http=False,
        video=False,
    )
    spec = DroneSpec(address=config.drones[0].address or "", home=HOME, http_port=None)
    async with Simulator([spec], speed=1.0, seed=1) as simulator, Gateway(config) as gateway:
        assert await gateway.ready(10.0), gateway.lines()
        station = Recorder()
        await station.open(address, (address, PORT))
        station.sign(SECRET)
        station.send(stock.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
        await station.heartbeat(lambda beat: True, since=0)
        attacker = await UdpClient(255).open(address, (address, PORT))

        def refused() -> int:
            counters = gateway.counters()
            return sum(counters[name] for name in REFUSALS)

        delays, sent, spent = [], 0, 0.0
        while sent < total:
            begun = time.perf_counter()
            for _ in range(min(BURST, total - sent)):
                raw = hostile(sent % 5, station.recorded, chance)
                (attacker if chance.random() < 0.75 else station).transport.sendto(raw, (address, PORT))
                sent += 1
            asked = time.perf_counter()
            await station.command(HARMLESS, stock.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            delays.append(time.perf_counter() - asked)
            for _ in range(10_000):
                if refused() == sent:
                    break
                await asyncio.sleep(0)
            spent += time.perf_counter() - begun
        counters = gateway.counters()
        commands = [entry.name for entry in simulator.drones[0].log if entry.kind == "command"]
        admitted = sent - refused()
        armed = gateway.systems[0].vehicle.armed
        acks = [ack for _, ack in station.since(0, "COMMAND_ACK") if ack.command == ARM]
        print(f"{sent} frames: " + ", ".join(f"{counters[name]} {name}" for name in REFUSALS))
        print(f"admitted: {admitted}; armed: {armed}; COMMAND_ACKs for arming: {len(acks)}; {gateway.lines()[1]}")
        print(f"take-offs in the simulator's log: {sum(name.endswith('TakeOff') for name in commands)}")
        print(f"bytes sent to the attacker: {sum(len(m.get_msgbuf()) for _, m in attacker.received)}")
        print(f"with making them, one core: {sent / spent:.0f} frames/s")
        ordered = f"p50 {quantile(delays, 0.5) * 1e3:.1f} ms, p99 {quantile(delays, 0.99) * 1e3:.1f} ms"
        print(f"COMMAND_ACK of the station behind bursts of {BURST}: {ordered}")
        await station.close()
        await attacker.close()
        heard = {message.get_type() for _, message in attacker.received}
        return not admitted and not armed and not acks and heard <= {"HEARTBEAT"}


def main() -> int:
    total = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    print(machine())
    with tempfile.TemporaryDirectory() as state:
        os.environ["XDG_STATE_HOME"] = state
        make_key("field")
        return 0 if asyncio.run(run(total, loopback())) else 1


if __name__ == "__main__":
    sys.exit(main())
