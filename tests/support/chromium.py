"""A headless Chromium of the distribution, steered by its own protocol (CDP) over a WebSocket."""

from __future__ import annotations

import asyncio
import base64
import itertools
import os
import shutil
import tempfile
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import aiohttp
import pytest

PROGRAM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)

needed = pytest.mark.skipif(PROGRAM is None, reason="Chromium is not installed")

LIMIT = 40.0
"""s for a start, and for what a page has to show, on a busy machine."""

LOOK = 0.1
"""s between two looks at a page."""

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
"""Script: the 32 blocks of the simulated picture that a page shows, as 0 and 1."""

FLAGS = (
    *("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--remote-debugging-port=0"),
    *("--disable-background-networking", "--disable-component-update", "--disable-default-apps", "--disable-sync"),
    *("--window-size=1280,900", "--hide-scrollbars"),
)


class Page:
    """One tab."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)

    async def command(self, method: str, **params: Any) -> dict[str, Any]:
        number = next(self._numbers)
        await self._socket.send_json({"id": number, "method": method, "params": params})
        while True:
            message = await asyncio.wait_for(self._socket.receive_json(), LIMIT)
            if message.get("id") == number:
                assert "error" not in message, message
                return dict(message["result"])

    async def open(self, url: str) -> None:
        await self.command("Page.navigate", url=url)

    async def js(self, expression: str) -> Any:
        """The value of an expression, awaited."""
        answer = await self.command("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    async def until(self, expression: str, accept: Callable[[Any], bool] = bool) -> Any:
        """The value of an expression, once it is accepted."""
        end = asyncio.get_running_loop().time() + LIMIT
        while not accept(value := await self.js(expression)):
            assert asyncio.get_running_loop().time() < end, (
                f"{expression}: {value!r}; {await self.js('document.body.innerText')!r}"
            )
            await asyncio.sleep(LOOK)
        return value

    async def screenshot(self) -> bytes:
        """The window as a PNG file."""
        return base64.b64decode((await self.command("Page.captureScreenshot", format="png"))["data"])

    async def close(self) -> None:
        """Close the tab."""
        await self.command("Page.close")
        await self._socket.close()


class Chromium:
    """One browser."""

    def __init__(self, client: aiohttp.ClientSession, place: str) -> None:
        self._client = client
        self._place = place

    async def page(self) -> Page:
        """A new tab."""
        async with self._client.put(f"{self._place}/json/new?about:blank") as answer:
            url = (await answer.json())["webSocketDebuggerUrl"]
        return Page(await self._client.ws_connect(url, max_msg_size=0))


@asynccontextmanager
async def chromium() -> AsyncIterator[Chromium]:
    """A browser with a profile of its own."""
    assert PROGRAM is not None
    # Chromium's sandbox needs a user that is not root.
    flags = (*FLAGS, "--no-sandbox") if os.geteuid() == 0 else FLAGS
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        process = await asyncio.create_subprocess_exec(
            *(PROGRAM, *flags, f"--user-data-dir={profile}", "about:blank"),
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        assert process.stderr is not None
        drain: asyncio.Task[bytes] | None = None
        try:
            line = await asyncio.wait_for(_listening(process.stderr), LIMIT)
            drain = asyncio.create_task(process.stderr.read())
            place = line.decode().split()[-1].split("/")[2]
            async with aiohttp.ClientSession() as client:
                yield Chromium(client, f"http://{place}")
        finally:
            with suppress(ProcessLookupError):
                process.terminate()
            try:
                await asyncio.wait_for(process.wait(), 5.0)
            except asyncio.TimeoutError:
                process.kill()
                await process.wait()
            if drain is not None:
                await drain


async def _listening(output: asyncio.StreamReader) -> bytes:
    """The line that names the address of the protocol."""
    while line := await output.readline():
        if b"DevTools listening on" in line:
            return line
    raise AssertionError("Chromium has ended")
