"""Every command of README and docs runs as it stands there, and prints what the page says."""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import stat
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest
from support.product import Process, product
from support.world import loopback

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "missions" / "README.md"]

NOT_RUN = {
    "python3 -m venv": "it installs from the network; what it starts then is run by tests/unit/cli/test_run.py",
    "mavproxy.py": "MAVProxy is flown by tests/clients/test_mavproxy.py",
    "anafi-mav doctor 192.168.42.1": "it wants an aircraft; tests/unit/cli/test_doctor.py runs it on simulated ones",
    "anafi-mav run -c fleet.yaml --check": "it wants a fleet; tests/unit/cli/test_run_check.py runs it on one",
    "anafi-mav media": "it needs files on a drone; tests/conformance/test_media_download.py runs its verbs",
    "for name in missions/*.plan; do": "tests/unit/plans/test_missions.py makes each of them by the same command",
}
"""Beginnings of commands that are not run here, with the reason."""

GATEWAY = ("plan upload", "plan download", "plan fly")
"""Commands that need a gateway: they get the endpoint of one, for 5760 of this machine may be another's."""

_PROGRAMS = ("anafi-mav ", "mavproxy.py ", "python3 ", "for ", "pip ")
_SHELL = ("", "sh", "shell", "bash", "console")


@dataclass(frozen=True)
class Command:
    """One command of a page."""

    page: str
    text: str
    output: tuple[str, ...]
    """What the page says that it prints; empty when it does not say. A line "…" is any lines."""

    def __str__(self) -> str:
        return f"{self.page}: {self.text}"


def blocks(text: str) -> list[list[str]]:
    """The lines of each block of code that is of a shell's: fenced without another language, or indented."""
    found: list[list[str]] = []
    fence: tuple[str, list[str]] | None = None
    """Language and lines of the block that is open."""
    indented: list[str] = []
    for line in [*text.splitlines(), ""]:
        if line.startswith("```"):
            if fence is None:
                fence = (line[3:].strip(), [])
                continue
            if fence[0] in _SHELL:
                found.append(fence[1])
            fence = None
        elif fence is not None:
            fence[1].append(line)
        elif line.startswith("    "):
            indented.append(line[4:])
        elif indented:
            found.append(indented)
            indented = []
    return found


def commands(page: Path) -> list[Command]:
    """The commands of a page: behind "$ ", with what they print, or whole lines that begin with a program."""
    name, found = str(page.relative_to(ROOT)), []
    for block in blocks(page.read_text(encoding="utf-8")):
        prompts = [number for number, line in enumerate(block) if line.startswith("$ ")]
        for begin, end in pairwise([*prompts, len(block)]):
            found.append(Command(name, block[begin][2:], tuple(block[begin + 1 : end])))
        if not prompts:
            found += [Command(name, line, ()) for line in block if line.startswith(_PROGRAMS)]
    return found


ALL = [command for page in PAGES for command in commands(page)]
FILES = [
    command
    for command in ALL
    if command.text.startswith("anafi-mav plan ")
    and not any(word in command.text for word in GATEWAY)
    and not command.text.startswith(tuple(NOT_RUN))
]
FLOWN = [command for command in ALL if any(word in command.text for word in GATEWAY)]
SIMULATORS = [command for command in ALL if command.text.startswith("anafi-mav sim ")]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the repository's folders that commands name, with `anafi-mav` in the path."""
    for name in ("missions", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name)
    program = tmp_path / "bin" / "anafi-mav"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m anafi_mav "$@"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return tmp_path


async def shell(folder: Path, text: str) -> Process:
    """The command as a shell in that folder starts it; its output is one."""
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    python_path = f"{ROOT}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    env = {"PATH": path, "PYTHONPATH": python_path}
    return await Process.start("sh", "-c", f"cd '{folder}' && exec {text} 2>&1", env=env)


def shows(lines: list[str], wanted: tuple[str, ...]) -> bool:
    """These lines, with any others where "…" stands."""
    pattern = "".join(".*?" if line == "…" else re.escape(line + "\n") for line in wanted)
    return re.fullmatch(pattern, "".join(line + "\n" for line in lines), re.DOTALL) is not None


def test_documented_commands_are_found_and_exceptions_are_of_them() -> None:
    assert {command.page for command in ALL} >= {"README.md", "docs/plans.md", "docs/simulator.md"}
    assert len(FILES) >= 5
    assert len(FLOWN) >= 4
    assert len(SIMULATORS) >= 1
    for beginning in NOT_RUN:
        assert any(command.text.startswith(beginning) for command in ALL), f"{beginning}: an exception for nothing"
    covered = {*FILES, *FLOWN, *SIMULATORS}
    left = [str(one) for one in ALL if one not in covered and not one.text.startswith(tuple(NOT_RUN))]
    assert left == [], "run them, or say why not"


@pytest.mark.parametrize("command", FILES, ids=str)
async def test_documented_command_with_files_prints_what_the_page_says(folder: Path, command: Command) -> None:
    if " plot " in command.text:
        pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    held = await shell(folder, command.text)
    status = await held.end(60.0)
    assert shows(held.lines, command.output) or not command.output, str(held)
    assert status == int(any(": error: " in line for line in command.output)), str(held)


@pytest.mark.parametrize("command", SIMULATORS, ids=str)
async def test_documented_simulator_starts_and_ends(folder: Path, command: Command) -> None:
    """At addresses of its own: two runs of the tests on one machine do not meet."""
    net = f"127.{random.randint(64, 126)}.{random.randint(1, 254)}."
    for path in (folder / "examples").glob("*.yaml"):
        path.write_text(path.read_text().replace("127.0.42.", net))
    held = await shell(folder, command.text.replace("127.0.42.", net))
    try:
        await held.line(lambda line: line.startswith("ready"))
        held.process.send_signal(signal.SIGINT)
        assert await held.end(20.0) == 0, str(held)
        if "--log" in command.text:
            assert (folder / "flight.jsonl").stat().st_size > 0
    finally:
        await held.put_away()


async def test_documented_commands_for_a_vehicle_end_well(folder: Path) -> None:
    """One after the other, as a person would type them who reads on."""
    address = loopback()
    config = f"""
        endpoints: ["tcpin://{address}:5760"]
        drones: [{{name: alpha, sysid: 1, sim: {{address: {loopback()}, speed: 8}}}}]
    """
    seen = set()
    async with product(folder, config):
        for command in sorted(FLOWN, key=lambda one: "fly" in one.text):
            if command.text in seen:
                continue
            seen.add(command.text)
            held = await shell(folder, f"{command.text} --endpoint tcpout://{address}:5760")
            assert await held.end(120.0) == 0, f"{command}{held}"


def test_scenario_of_the_page_is_the_file_that_it_names() -> None:
    page = (ROOT / "docs" / "simulator.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    assert (ROOT / "examples" / "bad-day.yaml").read_text(encoding="utf-8").endswith(shown)
