"""Parrot's Olympe as a process of its own: what its scripts report, and what Olympe complains of."""

from __future__ import annotations

import asyncio
import importlib.util
import itertools
import json
import re
import socket
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, NamedTuple

import pytest

from support import clock, olympe_server
from support.pairwise import selection
from support.process import simulator_process
from support.world import loopback

SCRIPTS = Path(__file__).parents[1] / "interop"

HTTP_PORT, RTSP_PORT = 8080, 8554
"""Of the simulator where Olympe accepts a port, so that no one needs the right to listen on 80 and 554."""

needed = pytest.mark.skipif(
    importlib.util.find_spec("olympe") is None,
    reason="Olympe is not installed: package parrot-olympe exists for x86-64 Linux, Python < 3.12",
)


class Combination(NamedTuple):
    """What a program of Olympe's can be run on."""

    program: str
    model: str
    controller: str
    """Olympe's class: Drone, or the Skycontroller in front of the drone."""
    version: int
    """Of ARSDK's protocol: Olympe's wire format is the newest, or the one that the drone asks for."""


def _combinations() -> Iterator[Combination]:
    """Every combination that can be, the rarer programs first."""
    models, controllers = ("4k", "thermal", "usa", "ai"), ("Drone", "SkyController3", "SkyController4")
    # Olympe's examples are for the Ai's burst, and its files travel by HTTP, whatever the version of the protocol.
    yield from (Combination("media", "ai", controller, 3) for controller in ("Drone", "SkyController4"))
    # Version 1 of a file is the same on all models but the Ai.
    yield from (Combination("twin", model, "Drone", 3) for model in ("4k", "ai"))
    for program, model, controller, version in itertools.product(("video", "visit"), models, controllers, (3, 2, 1)):
        if model == "ai" and (controller == "SkyController3" or version < 3):
            continue  # it flies with the fourth only, and its camera's state is longer than older versions carry
        if program == "video" and controller == "SkyController3":
            continue  # Olympe wants its port 554, see `rtsp_of_a_skycontroller_3`; visits look where they may
        yield Combination(program, model, controller, version)


COMBINATIONS = tuple(_combinations())
SELECTED = frozenset(selection(COMBINATIONS))
"""Every pair of program, model, controller and version that can be occurs in one of them; the others are `full`."""


def combinations(program: str) -> list[Any]:
    """The combinations of a program for `pytest.mark.parametrize`, most of them marked `full`."""
    return [
        pytest.param(
            combination,
            id="-".join(map(str, combination[1:])),
            marks=() if combination in SELECTED else pytest.mark.full,
        )
        for combination in COMBINATIONS
        if combination.program == program
    ]


HARMLESS = {
    r"ulog - pomp - timer \S+: missed \d+ events": "the machine is busy, so one of Olympe's timers came late",
    r"stop_piloting - Unable to stop piloting interface": "Olympe 8.5 never returns the result of its own stop",
    r"ulog - mux - mux_channel_ip_disconnected err=2": "the web server closed what Olympe has just closed itself",
    r"olympe\.media - _adownload - Resource '\S+' disk i/o timedout": "the machine is busy; the script asks again",
    r"ulog - arsdk - (net|mux) (ping failures: 1|PONG: payload mismatch)$": (
        "the machine is busy, so the answer to one ping came after the next had gone out"
    ),
    r"Time synchronization failed for ": (
        "it gives the drone two seconds for the answer, in which a busy machine may not get through all states; "
        "`clock_set` sees that it was given"
    ),
}
"""Lines at WARNING and above that Olympe writes without the drone's fault, whatever it does."""

HARMLESS_WITH_VIDEO = {
    r"Video output files won't open for stream": "the pictures are looked at and not written to a file",
    r"VideoDecoder#\d+: coded video media format H264/AVCC not supported": (
        "pdraw offers its decoder the stream in both forms, and the decoder takes the other"
    ),
    r"_media_removed - Received removed event from unknown ID": (
        "pdraw tells of the stream in the form that nobody asked for"
    ),
    r"ulog - pomp - event \S+ is still attached to loop": "Olympe destroys the queue of a stream before its event",
    r"mbuf_base_frame_queue_deinit:\d+: pomp_evt_destroy err=16": "the same",
    r"tskt_impl - packet timestamping failed, fall back to current ts": "the machine is busy; the time is good enough",
    r"pdraw_dmxstrm - .*recvFrameCb: demuxer is not started": "a picture came while pdraw was about to begin or to end",
    r"pdraw_dmxstrm - EVT:STREAM;event='\w+';.*status=0;": "pdraw's record of what went well",
}


def complaints(err: str, *harmless: dict[str, str]) -> list[str]:
    """The lines of Olympe's log at WARNING and above for which no one knows a reason, and messages it cannot read."""
    known = [pattern for patterns in (HARMLESS, *harmless) for pattern in patterns]
    observed = [
        line
        for line in err.splitlines()
        if re.search(r"\[(WARNING|ERROR|CRITICAL)\]|Traceback|[Uu]nknown message", line)
    ]
    return [line for line in observed if not any(re.search(pattern, line) for pattern in known)]


async def run(script: str, *arguments: str, timeout: float) -> tuple[Any, str]:
    """What a script of `interop` reports, and Olympe's own log. `timeout` in s only ends what hangs."""
    words = (str(SCRIPTS / script), *arguments)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        start = _forked if olympe_server.is_running() else _alone
        await asyncio.wait_for(start(words, out, err), timeout)
        out.seek(0)
        err.seek(0)
        report, log = out.read(), err.read().decode()
    assert report, log
    return json.loads(report), log


async def _forked(words: Sequence[str], out: IO[bytes], err: IO[bytes]) -> None:
    """Run a script to its end in a process that has imported Olympe already."""
    loop = asyncio.get_running_loop()
    with (
        tempfile.TemporaryFile() as nothing,
        olympe_server.start(words, (nothing.fileno(), out.fileno(), err.fileno())) as connection,
        clock.everybodys(),
    ):
        connection.setblocking(False)
        for _ in ("process id", "exit status"):
            olympe_server.number(await loop.sock_recv(connection, olympe_server.ANSWER))


async def _alone(words: Sequence[str], out: IO[bytes], err: IO[bytes]) -> None:
    """Run a script to its end in a process of its own."""
    process = await asyncio.create_subprocess_exec(sys.executable, *words, stdout=out, stderr=err)
    try:
        await process.wait()
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def visit(
    script: str, on: Combination, folder: Path, *arguments: str, timeout: float, options: tuple[str, ...]
) -> tuple[Any, str, list[dict[str, Any]]]:
    """The script against a simulated drone of its own: what it reports, Olympe's log, and the simulator's."""
    kind, model = on.controller, on.model
    options += ("--protocol", str(on.version))
    address, log, downloads = loopback(), folder / "sim.jsonl", folder / "downloads"
    downloads.mkdir()
    http, rtsp = str(HTTP_PORT), str(RTSP_PORT if kind != "SkyController3" else rtsp_of_a_skycontroller_3())
    if kind != "Drone":
        options += ("--skycontroller", kind[-1])
    ports = ("--http-port", http, *(("--rtsp-port", rtsp) if rtsp != "0" else ()))
    async with simulator_process(address, log, "--model", model, "--seed", "1", *ports, *options):
        report, err = await run(script, address, kind, model, http, rtsp, str(downloads), *arguments, timeout=timeout)
    entries = [json.loads(line) for line in log.read_text().splitlines()]
    clock_set(entries, kind)
    return report, err, entries


def rtsp_of_a_skycontroller_3() -> int:
    """Olympe asks it for video at port 554 and nowhere else; 0 where this user may not open that."""
    with socket.socket() as probe:
        try:
            probe.bind((loopback(), 554))
        except PermissionError:
            return 0
    return 554


def clock_set(log: list[dict[str, Any]], kind: str) -> None:
    """Olympe sent the date to all that it was connected to, and the drone said it back."""
    observed = [entry for entry in log if entry["name"].endswith(".Common.CurrentDateTime")]
    assert {entry["name"].partition(".")[0] for entry in observed} == {"common"} | (
        {"skyctrl"} if kind != "Drone" else set()
    )
    at, date = next((entry["t"], entry["args"]) for entry in observed if entry["kind"] == "command")
    answers = [entry for entry in log if entry["name"] == "common.CommonState.CurrentDateTimeChanged"]
    assert date in [entry["args"] for entry in answers if entry["t"] >= at], answers


def failed(steps: dict[str, dict[str, Any]]) -> dict[str, object]:
    """What did not come true, and what Olympe says of it."""
    return {name: step.get("explained") for name, step in steps.items() if not step["ok"]}


def during(log: list[dict[str, Any]], report: dict[str, Any]) -> list[dict[str, Any]]:
    """What the simulator logged while a part of a visit lasted."""
    first = min(step["from"] for step in report["steps"].values())
    last = max(step["to"] for step in report["steps"].values())
    return [entry for entry in log if first <= entry["t"] <= last]
