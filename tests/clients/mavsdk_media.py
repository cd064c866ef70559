"""MAVSDK's plugin ftp on the camera component: the drone's photos and videos.

    mavsdk_media.py URL FOLDER VIDEO

It prints a line a step. VIDEO is the path of a file for a download by bursts.
"""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

from mavsdk.asyncio.plugins.ftp import FtpAsync, FtpError
from mavsdk_base import connected, say

CAMERA = 100


async def transfers(ftp: FtpAsync, folder: Path, video: str) -> None:
    await ftp.set_target_compid(CAMERA)
    (day,) = [entry.name for entry in (await ftp.list_directory("/media")).entries]
    say("day", day)
    files = sorted(entry.name for entry in (await ftp.list_directory(f"/media/{day}")).entries)
    say("files", *files)
    for name in files:
        path = f"/media/{day}/{name}"
        async for _ in ftp.download(path, str(folder), path == video):
            pass
        say("identical", name, await ftp.are_files_identical(str(folder / name), path))
    await ftp.remove_file(video)
    try:
        await ftp.remove_file(video)
    except FtpError as error:
        say("removed", error.result.name)


async def main(url: str, folder: Path, video: str) -> None:
    async with connected(url) as drone:
        await transfers(FtpAsync(drone), folder, video)
    say("done")


asyncio.run(main(sys.argv[1], Path(sys.argv[2]), sys.argv[3]))
