"""Read the metadata of each picture of the live video, 30 times a second. Nothing is decoded.

    anafi-mav sim --rtsp-port 8554                               # in one terminal
    python examples/python_api/metadata.py --rtsp-port 8554      # in another

The video server of a real ANAFI is at port 554, which is the default here.
"""

from __future__ import annotations

import argparse
import asyncio
import csv
import math
from pathlib import Path

from anafi_mav.drone import AnafiMavError, VideoFrame, connect

COLUMNS = ["taken_s", "roll_deg", "pitch_deg", "yaw_deg", "north_mps", "east_mps", "down_mps", "exposure_ms", "iso"]


def row(frame: VideoFrame) -> list[object]:
    """One picture's values; None stands where the drone did not say."""
    metadata, attitude = frame.metadata, frame.attitude
    angles = [None] * 3 if attitude is None else [attitude.roll, attitude.pitch, attitude.yaw]
    degrees = [None if angle is None else round(math.degrees(angle), 2) for angle in angles]
    speed = [None] * 3 if metadata.speed is None else [round(part, 2) for part in metadata.speed]
    return [f"{frame.taken:.4f}", *degrees, *speed, metadata.exposure_time, metadata.iso_gain]


async def record(address: str, rtsp_port: int, seconds: float, file: Path | None) -> None:
    frames: list[VideoFrame] = []
    async with connect(address, rtsp_port=rtsp_port) as drone:
        print(f"connected: {drone.identity.model.title}", flush=True)
        async with drone.video.watching():  # the block begins with the first picture
            shown = drone.video.state.shown
            print(f"stream: {shown.title if shown else 'unknown'}", flush=True)
            end = drone.video.subscribe(frames.append)
            await asyncio.sleep(seconds)
            end()
    if len(frames) < 2:
        raise SystemExit("the pictures came without metadata")
    duration = frames[-1].taken - frames[0].taken
    print(f"{len(frames)} pictures, {(len(frames) - 1) / duration:.1f} a second", flush=True)
    print(", ".join(f"{name} {value}" for name, value in zip(COLUMNS, row(frames[-1]), strict=True)), flush=True)
    if file is not None:
        with file.open("w", newline="") as stream:
            csv.writer(stream).writerows([COLUMNS, *(row(frame) for frame in frames)])
        print(f"written: {file}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Record the metadata of the live video.")
    parser.add_argument("address", nargs="?", default="127.0.42.1", help="of the drone (%(default)s, a simulated one)")
    parser.add_argument("--rtsp-port", type=int, default=554, metavar="PORT", help="of its video (%(default)s)")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long to record (%(default)s)")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write all of it to a file")
    arguments = parser.parse_args()
    try:
        asyncio.run(record(arguments.address, arguments.rtsp_port, arguments.seconds, arguments.csv))
    except AnafiMavError as error:
        raise SystemExit(f"{type(error).__name__}: {error}") from None


if __name__ == "__main__":
    main()
