"""Parrot's own player, as Olympe brings it, opens a stream of the gateway."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import olympe
from support.process import gateway_process, simulator_process
from support.world import VIDEO_PORT, loopback

pytestmark = [pytest.mark.third_party, olympe.needed]

CONFIG = """
endpoints: ["tcpin://{gateway}:5760"]
video: {{host: {gateway}, rtsp_port: 8555}}
http: off
drones: [{{name: alpha, sysid: 1, address: {drone}, rtsp_port: {port}}}]
"""


async def test_parrots_player_opens_a_stream_of_the_gateway(tmp_path: Path) -> None:
    drone, gateway, config = loopback(), loopback(), tmp_path / "fleet.yaml"
    config.write_text(CONFIG.format(gateway=gateway, drone=drone, port=VIDEO_PORT))
    options = ("--http-port", "0", "--rtsp-port", str(VIDEO_PORT))
    async with simulator_process(drone, tmp_path / "sim.jsonl", *options), gateway_process(config, 100.0):
        url = f"rtsp://{gateway}:8555/1/visible"
        report, err = await olympe.run("olympe_relay.py", url, "alpha visible", timeout=90.0)
    assert report == {"played": True, "sizes": [[1280, 720]] * 40}, err
