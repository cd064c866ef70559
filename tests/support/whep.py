"""A browser's part of WHEP, played by aiortc: offer, answer, decoded pictures."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import aiohttp
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription

from support.pictures import Image

LIMIT = 20.0
"""s for a picture, on a busy machine."""


@dataclass
class Browser:
    """One session."""

    connection: RTCPeerConnection
    answer: str
    place: str
    """URL of the session."""
    track: Any

    async def image(self) -> Image:
        """The next decoded picture."""
        frame = await asyncio.wait_for(self.track.recv(), LIMIT)
        image: Image = frame.to_ndarray(format="bgr24")
        return image

    async def ended(self) -> None:
        """Wait until the gateway has ended the session."""
        while self.connection.connectionState not in ("closed", "failed"):
            changed = asyncio.Event()
            self.connection.once("connectionstatechange", changed.set)
            await asyncio.wait_for(changed.wait(), LIMIT)


async def offer() -> tuple[RTCPeerConnection, str]:
    """A connection and its offer to receive video."""
    connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
    transceiver = connection.addTransceiver("video", direction="recvonly")
    # aiortc has no candidates on a computer without network, and no option for the loopback address.
    ice = transceiver.receiver.transport.transport.iceGatherer._connection
    gather = ice.get_component_candidates
    ice.get_component_candidates = lambda component, addresses, timeout=5: gather(component, ["127.0.0.1"], timeout)
    await connection.setLocalDescription(await connection.createOffer())
    return connection, connection.localDescription.sdp


async def post(url: str, sdp: str | bytes, kind: str = "application/sdp") -> tuple[int, str, str]:
    """Status, text and Location of the answer to an offer."""
    async with (
        aiohttp.ClientSession() as client,
        client.post(url, data=sdp, headers={"Content-Type": kind}) as answer,
    ):
        return answer.status, await answer.text(), answer.headers.get("Location", "")


async def delete(url: str) -> int:
    async with aiohttp.ClientSession() as client, client.delete(url) as answer:
        return answer.status


@asynccontextmanager
async def browser(root: str, drone: str = "1") -> AsyncIterator[Browser]:
    """A browser that watches a drone of the web server at `root`."""
    connection, sdp = await offer()
    try:
        status, text, place = await post(f"{root}/whep/{drone}", sdp)
        assert status == 201, text
        await connection.setRemoteDescription(RTCSessionDescription(text, "answer"))
        yield Browser(connection, text, f"{root}{place}", connection.getReceivers()[0].track)
    finally:
        await connection.close()
