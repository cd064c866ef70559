"""Take a photo, download its files and check their MD5. The drone stays on the ground.

    anafi-mav sim --http-port 8080                             # in one terminal
    python examples/python_api/photo.py --http-port 8080       # in another

The web server of a real ANAFI is at port 80, which is the default here.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from pathlib import Path

from anafi_mav.drone import AnafiMavError, CameraMode, PhotoFile, PhotoMode, PhotoSettings, connect


async def photograph(address: str, http_port: int, folder: Path) -> None:
    async with connect(address, http_port=http_port) as drone:
        print(f"connected: {drone.identity.model.title}", flush=True)
        camera = drone.camera
        await camera.set_mode(CameraMode.PHOTO)
        await camera.set_photo(PhotoSettings(mode=PhotoMode.SINGLE, file=PhotoFile.JPEG))

        media_id = await camera.take_photo()  # returns when the file is stored on the drone
        if media_id is None:
            raise SystemExit("the camera is in a mode that takes a series")
        print(f"photo {media_id}", flush=True)

        media = await drone.media.get(media_id)
        if media.gps is not None:
            print(f"taken at {media.gps.latitude:.6f}, {media.gps.longitude:.6f}", flush=True)
        for path in await drone.media.download_media(media_id, folder):
            print(f"downloaded {path.name}: {path.stat().st_size} bytes", flush=True)
        print(f"{len(await drone.media.list())} media on the drone", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Take a photo and download it.")
    parser.add_argument("address", nargs="?", default="127.0.42.1", help="of the drone (%(default)s, a simulated one)")
    parser.add_argument("--http-port", type=int, default=80, metavar="PORT", help="of its web server (%(default)s)")
    parser.add_argument("--folder", type=Path, metavar="DIR", help="where to save it (default: a temporary folder)")
    arguments = parser.parse_args()
    folder = arguments.folder or Path(tempfile.mkdtemp(prefix="anafi-"))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        asyncio.run(photograph(arguments.address, arguments.http_port, folder))
    except AnafiMavError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from None


if __name__ == "__main__":
    main()
