"""Unmodified MAVProxy signs with a key of `anafi-mav keygen`, and flies over an endpoint with that key."""

from __future__ import annotations

import asyncio
import hashlib
import re
import shutil
import sys
from pathlib import Path

import pytest
from support.product import product, program
from support.world import HOME, loopback

pytestmark = pytest.mark.third_party

MAVPROXY = shutil.which("mavproxy.py", path=str(Path(sys.executable).parent)) or "mavproxy.py"
PASSPHRASE, OTHER = "correct-horse-battery-staple", "another-horse-battery-staple"


async def test_mavproxy_with_the_passphrase_is_served_alone(tmp_path: Path) -> None:
    address, state = loopback(), tmp_path / "signed"
    words = (sys.executable, "-m", "anafi_mav", "keygen", "field", "--passphrase", "--state", str(state))
    keygen = await asyncio.create_subprocess_exec(*words, stdin=asyncio.subprocess.PIPE)
    await keygen.communicate(PASSPHRASE.encode() + b"\n")
    assert keygen.returncode == 0
    config = f"""
        state: {state}
        endpoints: ["tcpin://{address}:5760?flavour=ardupilot&signing=field"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, home: {list(HOME)}, speed: 3}}}}]
    """
    words = (sys.executable, "-u", MAVPROXY, f"--master=tcp:{address}:5760", f"--state-basedir={tmp_path}")
    async with (
        product(tmp_path, config) as p,
        program(*words, stdin=asyncio.subprocess.PIPE, env={"HOME": str(tmp_path)}) as mavproxy,
    ):
        await mavproxy.line(lambda line: "online system 1" in line)
        # Without the key nothing that it sends arrives.
        mavproxy.say("arm throttle")
        mavproxy.say(f"signing key {PASSPHRASE}")
        await mavproxy.line(lambda line: "Setup signing key" in line)
        # It replaces the key of the vehicle: SETUP_SIGNING over the signed endpoint, and its own frames at once.
        mavproxy.say(f"signing setup {OTHER}")
        await mavproxy.line(lambda line: "Signing on: key in use" in line)
        assert (state / "keys" / "field.key").read_bytes()[:32] == hashlib.sha256(OTHER.encode()).digest()
        for command, name in (("mode GUIDED", "DO_SET_MODE"), ("arm throttle", "COMPONENT_ARM_DISARM")):
            since = len(mavproxy.lines)
            mavproxy.say(command)
            await mavproxy.line(lambda line, name=name: f"{name}: ACCEPTED" in line, since=since, timeout=15.0)
        mavproxy.say("takeoff 3")
        await p.flying_state("hovering")
        assert not mavproxy.said("COMPONENT_ARM_DISARM: ACCEPTED")[1:]
        assert any(re.search(r"key field: frames refused: \d+ unsigned", line) for line in p.complaints)
        said = "\n".join(p.complaints + p.lines)
        assert PASSPHRASE not in said
        assert OTHER not in said
