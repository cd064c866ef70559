"""The pages for browsers in a real Chromium: the live picture of a simulated drone."""

from __future__ import annotations

import asyncio

import cv2
import numpy as np
import pytest
from support import chromium
from support.chromium import STRIP
from support.mav import CAMERA, Client
from support.pictures import horizon
from support.world import OPTIONS_PORT, World, world

from anafi_mav.mavlink import dialect
from anafi_mav.mavlink.dialect import (
    MAV_CMD_DO_PARACHUTE,
    MAV_CMD_VIDEO_START_STREAMING,
    MAV_RESULT_ACCEPTED,
    MAV_RESULT_UNSUPPORTED,
)

pytestmark = [pytest.mark.chromium, pytest.mark.third_party, chromium.needed]

STATE = "document.getElementById('state')?.textContent ?? ''"


def url(w: World, path: str) -> str:
    assert w.gateway.web is not None
    return f"http://127.0.0.1:{w.gateway.web.port}{path}"


def moment(bits: str) -> tuple[int, int]:
    """Number and time (ms) of the picture with this strip."""
    value = int(bits, 2)
    return value >> 20, value & 0xFFFFF


def any_light(bits: str) -> bool:
    """False while nothing is drawn."""
    return "1" in bits


async def viewers_end(w: World) -> None:
    """Wait until no page watches: one that is left ends its session at once."""
    assert w.gateway.relay is not None
    end = asyncio.get_running_loop().time() + chromium.LIMIT
    while w.gateway.relay.viewers:
        assert asyncio.get_running_loop().time() < end
        await asyncio.sleep(chromium.LOOK)


async def test_pages_show_the_live_picture_of_one_session() -> None:
    async with world(speed=1.0) as w, chromium.chromium() as browser:
        pages = [await browser.page(), await browser.page()]
        await pages[0].open(url(w, "/"))
        await pages[0].until("document.querySelector('.name')?.href", lambda link: link == url(w, "/drone/1"))
        for page in pages:
            await page.open(url(w, "/drone/1"))
        for page in pages:
            await page.until(STATE, lambda text: "visible 1280 × 720" in text)
            await page.command("Page.bringToFront")  # the other tab decodes its pictures and does not draw them
            first = moment(await page.until(STRIP, any_light))
            later = moment(await page.until(STRIP, lambda bits, first=first: moment(bits) > first))
            assert 0 < first[1] < later[1] <= w.drone.firmware.time * 1000.0
        shown = cv2.imdecode(np.frombuffer(await pages[1].screenshot(), np.uint8), cv2.IMREAD_COLOR)
        assert horizon(shown, 0.3) is not None
        assert w.gateway.relay is not None
        assert w.gateway.relay.source("1").viewers == 2
        await pages[0].close()
        await pages[1].open("about:blank")
        await viewers_end(w)


async def test_page_follows_the_stream_that_the_drone_shows() -> None:
    async with world(model="thermal", speed=1.0) as w, chromium.chromium() as browser:
        page = await browser.page()
        await page.open(url(w, "/drone/1"))
        await page.until(STATE, lambda text: "visible 1280 × 720" in text)
        ack = await w.client.command(MAV_CMD_VIDEO_START_STREAMING, 2, target=(1, CAMERA))
        assert ack.result == MAV_RESULT_ACCEPTED
        await page.until(STATE, lambda text: "thermal 960 × 720" in text)
        shown = cv2.imdecode(np.frombuffer(await page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
        blue, _, red = (int(shade) for shade in shown[500, 300])
        assert red > blue + 80  # warm ground; that of the visible picture is green


PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}


async def test_status_page_on_a_phone_shows_drone_refusal_and_picture() -> None:
    async with world(speed=1.0) as w, chromium.chromium() as browser:
        page = await browser.page()
        await page.command("Emulation.setDeviceMetricsOverride", **PHONE)
        await page.open(url(w, "/status"))
        await page.until(
            "document.querySelector('#drones .name')?.textContent", lambda text: text == "alpha (system 1)"
        )
        ack = await w.client.command(MAV_CMD_DO_PARACHUTE, 1)
        assert ack.result == MAV_RESULT_UNSUPPORTED
        await page.until("document.getElementById('refused').innerText", lambda text: "DO_PARACHUTE" in text)
        await page.until("document.getElementById('endpoints').innerText", lambda text: "255/190" in text)
        await page.js("document.querySelector('#drones button').click()")
        await page.until("document.querySelector('#drones video').videoWidth", lambda width: width == 1280)
        assert await page.js("document.documentElement.scrollWidth") == PHONE["width"]
        await page.js("document.querySelector('#drones button').click()")
        await viewers_end(w)


LINK = "document.querySelector('#drones .link')?.textContent ?? ''"


async def beats(*stations: Client) -> None:
    """A heartbeat a second, without which an operator is lost."""
    while True:
        for station in stations:
            station.send(
                dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
            )
        await asyncio.sleep(1.0)


async def test_status_page_names_operator_and_secondary_until_release() -> None:
    async with (
        world(speed=1.0, options=("operator_control=true&secondaries=254",)) as w,
        chromium.chromium() as browser,
    ):
        page = await browser.page()
        await page.command("Emulation.setDeviceMetricsOverride", **PHONE)
        await page.open(url(w, "/status"))
        await page.until(LINK, lambda text: "connections 1" in text and "operator" not in text)
        teacher, student = [await w.connect(sysid, port=OPTIONS_PORT) for sysid in (255, 254)]
        beating = asyncio.ensure_future(beats(teacher, student))
        request = dialect.MAV_CMD_REQUEST_OPERATOR_CONTROL
        ack = await teacher.command(request, 1, 0, 10, 255, x=0.0, y=0.0, z=0.0)
        assert ack.result == MAV_RESULT_ACCEPTED
        await page.until(LINK, lambda text: text.endswith(", operator system 255 (secondaries 254)"))
        assert await page.js("document.documentElement.scrollWidth") == PHONE["width"]
        ack = await teacher.command(request, 0, 0, 0, 255, x=0.0, y=0.0, z=0.0)
        assert ack.result == MAV_RESULT_ACCEPTED
        await page.until(LINK, lambda text: "operator" not in text)
        beating.cancel()
