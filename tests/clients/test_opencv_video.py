"""ffmpeg, as OpenCV brings it, watches the simulated models: a player that is not Parrot's."""

from __future__ import annotations

import asyncio
import itertools
import json
import sys
from pathlib import Path

import pytest
from support.process import simulator_process
from support.world import loopback

pytestmark = pytest.mark.third_party

SCRIPT = """
import json, os, sys
sys.path.insert(0, sys.argv[2])
os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "rtsp_transport;udp"
import cv2
from support.pictures import horizon, strip
capture = cv2.VideoCapture(sys.argv[1], cv2.CAP_FFMPEG)
shapes, moments, horizons = [], [], []
for _ in range(40):
    ok, picture = capture.read()
    if not ok:
        break
    shapes.append(picture.shape)
    moments.append(strip(picture))
    horizons.append(horizon(picture, 0.25))
print(json.dumps({"shapes": shapes, "moments": moments, "horizons": horizons}))
"""
PORT = 8554
TESTS = Path(__file__).parents[1]


@pytest.mark.parametrize(("model", "shape"), [("4k", [720, 1280, 3]), ("ai", [1080, 1920, 3])])
async def test_ffmpeg_plays_the_live_stream(model: str, shape: list[int], tmp_path: Path) -> None:
    address, log = loopback(), tmp_path / "sim.jsonl"
    options = ("--model", model, "--http-port", "0", "--rtsp-port", str(PORT))
    async with simulator_process(address, log, *options):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", SCRIPT, f"rtsp://{address}:{PORT}/live", str(TESTS)), stdout=asyncio.subprocess.PIPE
        )
        try:
            out, _ = await asyncio.wait_for(process.communicate(), 60.0)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    seen = json.loads(out)
    assert seen["shapes"] == [shape] * 40
    assert seen["horizons"] == pytest.approx([0.5] * 40, abs=0.01)  # on the ground, looking ahead
    moments = seen["moments"]
    assert all(later[0] > earlier[0] and later[1] > earlier[1] for earlier, later in itertools.pairwise(moments))
