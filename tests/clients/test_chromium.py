"""The pages for browsers in a real Chromium: the live picture of a simulated drone."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support import chromium
from support.chromium import Page
from support.pictures import horizon
from support.world import World, world

pytestmark = [pytest.mark.chromium, pytest.mark.third_party, chromium.needed]

STATE = "document.getElementById('state')?.textContent ?? ''"
STRIP = """(() => {
  const video = document.getElementById("picture"), canvas = document.createElement("canvas");
  canvas.width = video.videoWidth; canvas.height = video.videoHeight;
  const context = canvas.getContext("2d");
  context.drawImage(video, 0, 0);
  const row = context.getImageData(0, canvas.height - 12, canvas.width, 1).data;
  let bits = "";
  for (let block = 0; block < 32; block++)
    bits += row[4 * Math.floor((block + 0.5) * canvas.width / 32)] > 128 ? "1" : "0";
  return bits;
})()"""


def url(w: World, path: str) -> str:
    assert w.gateway.web is not None
    return f"http://127.0.0.1:{w.gateway.web.port}{path}"


async def moment(page: Page) -> tuple[int, int]:
    """Number and time (ms) of the picture that a page shows."""
    value = int(await page.js(STRIP), 2)
    return value >> 20, value & 0xFFFFF


async def test_pages_show_the_live_picture_of_one_session() -> None:
    async with world(speed=1.0) as w, chromium.chromium() as browser:
        pages = [await browser.page(), await browser.page()]
        await pages[0].open(url(w, "/"))
        await pages[0].until("document.querySelector('.name')?.href", lambda link: link == url(w, "/drone/1"))
        for page in pages:
            await page.open(url(w, "/drone/1"))
        for page in pages:
            await page.until(STATE, lambda text: "visible 1280 × 720" in text)
            moments = [await moment(page) for _ in range(3)]
            assert moments == sorted(moments)
            now = w.drone.firmware.time * 1000.0
            assert 0.0 <= now - moments[-1][1] < 5000.0
        shown = cv2.imdecode(np.frombuffer(await pages[0].screenshot(), np.uint8), cv2.IMREAD_COLOR)
        assert horizon(shown, 0.3) is not None
        assert w.gateway.relay is not None
        assert w.gateway.relay.source("1").viewers == 2
        for page in pages:
            await page.close()
