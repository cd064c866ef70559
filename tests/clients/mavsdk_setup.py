"""MAVSDK's plugins param, ftp, component_metadata and events as their users write them.

    mavsdk_setup.py URL FOLDER FLAVOUR

It prints a line a step; the test that runs it holds them against the simulator's own log.
"""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

from mavsdk.asyncio.plugins.component_metadata import ComponentMetadataAsync, MetadataType
from mavsdk.asyncio.plugins.events import EventsAsync
from mavsdk.asyncio.plugins.ftp import FtpAsync, FtpError
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError
from mavsdk_base import connected, say


async def parameters(param: ParamAsync, flavour: str) -> None:
    everything = await param.get_all_params()
    say("parameters", len(everything.int_params) + len(everything.float_params))
    if flavour == "px4":
        name, whole = "RTL_RETURN_ALT", "SYS_AUTOSTART"
    else:
        name, whole = "FENCE_ALT_MAX", "RTL_ALT"
    say("height", await param.get_param_float(name))
    await param.set_param_float(name, 41.5)
    say("height", await param.get_param_float(name))
    say("whole", await param.get_param_int(whole))
    try:
        await param.set_param_float(name, 1e6)
    except ParamError as error:
        say("refused", error.result.name)
    say("height", await param.get_param_float(name))


async def transfers(ftp: FtpAsync, folder: Path) -> None:
    listed = await ftp.list_directory("/")
    say("listed", *sorted(entry.name for entry in listed.entries))
    for burst in (True, False):
        target = folder / ("burst" if burst else "read")
        target.mkdir()
        async for _ in ftp.download("/parameter.json", str(target), burst):
            pass
        content = (target / "parameter.json").read_bytes()
        say("downloaded", len(content), len(json.loads(content)["parameters"]))
        same = await ftp.are_files_identical(str(target / "parameter.json"), "/parameter.json")
        say("identical", same)
    try:
        async for _ in ftp.download("/nothing.json", str(folder), True):
            pass
    except FtpError as error:
        say("missing", error.result.name)
    (folder / "mine").write_text("mine")
    try:
        async for _ in ftp.upload(str(folder / "mine"), "/"):
            pass
    except FtpError as error:
        say("upload", error.result.name)
    try:
        await ftp.remove_file("/parameter.json")
    except FtpError as error:
        say("remove", error.result.name)


async def described(metadata: ComponentMetadataAsync) -> None:
    wanted = {MetadataType.PARAMETER, MetadataType.EVENTS}

    async def collect() -> None:
        async for update in metadata.subscribe_metadata_available():
            document = json.loads(update.json_metadata)
            if update.type == MetadataType.PARAMETER:
                say("metadata", "parameter", len(document["parameters"]))
            elif update.type == MetadataType.EVENTS:
                say("metadata", "events", *document["components"])
            wanted.discard(update.type)
            if not wanted:
                return

    collecting = asyncio.ensure_future(collect())
    await asyncio.sleep(0)
    await metadata.request_autopilot_component()
    await asyncio.wait_for(collecting, 20.0)


def report_line(report: Any) -> str:
    mode = report.current_mode_intention
    problems = [f"{one.message} ({one.health_component})" for one in report.all_problems]
    wrong = sorted(part.name for part in report.health_components if part.has_error)
    return f"report {mode.mode_name} can_arm={mode.can_arm_or_run} problems={problems} errors={wrong}"


async def watch(events: EventsAsync) -> None:
    async def reports() -> None:
        async for report in events.subscribe_health_and_arming_checks():
            say(report_line(report))

    async def others() -> None:
        async for event in events.subscribe_events():
            say("event", event.event_namespace, event.event_name, event.message)

    await asyncio.gather(reports(), others())


async def main(url: str, folder: Path, flavour: str) -> None:
    async with connected(url) as drone:
        await parameters(ParamAsync(drone), flavour)
        await transfers(FtpAsync(drone), folder)
        await described(ComponentMetadataAsync(drone))
        say("done")
        await watch(EventsAsync(drone))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], Path(sys.argv[2]), sys.argv[3]))
