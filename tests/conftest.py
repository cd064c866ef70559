"""Notes which flavours of the gateway a test has spoken to, and makes the conformance table of a run's results.

pytest tests/conformance tests/clients -m "not soak" --conformance=docs/conformance.md
"""

from __future__ import annotations

import itertools
import os
import re
import signal
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support import clock, flavours, programs
from support.conformance_items import ITEMS

from anafi_mav.arsdk.link import watchdog

clock.install()
programs.install()

# Whatever the user's shell says, the programs that tests start share compiled modules: without them each start of
# anafi-mav compiles all of it again, which takes longer than most tests.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# aiohttp reads the system's certificate authorities twice when it is imported, 40 ms in each program that tests start.
# No test needs them.
os.environ["SSL_CERT_FILE"] = os.devnull

pytest_plugins = [
    "support.slots",
    "support.heap",
    "support.order",
    "support.collection",
    "support.olympe_server",
    "support.repeats",
    "support.fuzz_seed",
]

# Gateway, simulator and client share one event loop here: when it stalls, so does the Skycontroller that would be given
# its axes back. Tests of the watchdog run the gateway as a process of its own.
watchdog.LIMIT = None

# A shell starts what runs in its background with SIGINT ignored, and the programs that tests start would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

_STATES = itertools.count()
"""Names of state folders."""

_NUMBER = re.compile(r"test_conf_(\d{3})")

HEAD = """\
# Conformance

<!-- Made by `pytest --conformance=docs/conformance.md` from its results. With `-m "not soak"` the combinations marked
`full` count too. -->

For people who choose a client, or doubt an answer of the gateway. After reading you know what a client can rely on, and
the test that shows it.

Each item is shown over real sockets with a simulated drone behind the gateway, and judged by the simulator's own log.
Its number is in the tests' names, `test_conf_NNN`. A flavour is the autopilot that an endpoint shows its clients.

| cell | meaning |
|---|---|
| a number | so many tests of this flavour have passed; items that do not depend on the flavour have one count |
| a dash | the item does not concern this flavour |

Times in an item are those of timers. Most tests run on a clock that leaves out the computing time of client, gateway
and simulated drone in their one process (`tests/support/clock.py`). `tests/bench/` measures that time.

| | item | px4 | ardupilot | shown in |
|---|---|---|---|---|
"""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--conformance", metavar="FILE", default=None, help="write the conformance table of this run")


def pytest_asyncio_loop_factories() -> dict[str, Any]:
    """The loops that tests run in: of one kind."""
    return {"quick": clock.Loop}


def pytest_configure(config: pytest.Config) -> None:
    path = config.getoption("--conformance")
    if path is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Table(Path(path)), "conformance-table")


@pytest.fixture(autouse=True)
def _flavours_spoken_to(request: pytest.FixtureRequest) -> Iterator[None]:
    flavours.SHOWN.clear()
    yield
    request.node.user_properties.append(("flavours", sorted(flavours.SHOWN)))


@pytest.fixture(autouse=True)
def _own_state(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Set a state folder that no other test has, and no user; it does not exist.

    A gateway remembers plans by the serial number of its drone, and simulated drones share those. A folder that is made
    for each test costs more than most tests: only those that use `tmp_path` have their state in it.
    """
    if "tmp_path" in request.fixturenames:
        folder = request.getfixturevalue("tmp_path") / "state"
    else:
        folder = tmp_path_factory.getbasetemp() / "states" / str(next(_STATES))
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))


class _Table:
    """Collects what the tests of each item said."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._reports: dict[int, list[Any]] = defaultdict(list)
        self._said: dict[str, list[str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        number = _NUMBER.search(report.nodeid)
        if number is None:
            return
        if report.outcome == "rerun":
            return  # `support.repeats` prints it, the repetition counts
        if report.when == "call" or report.outcome != "passed":
            self._reports[int(number[1])].append(report)
        if report.when == "teardown":
            self._said[report.nodeid] = dict(report.user_properties).get("flavours", [])

    def pytest_sessionfinish(self) -> None:
        kept = self._kept()
        rows = [kept.get(number, "") if number not in self._reports else "" for number in sorted(ITEMS)]
        rows = [row or self._row(number) for row, number in zip(rows, sorted(ITEMS), strict=True)]
        self._path.write_text(HEAD + "".join(rows), encoding="utf-8")

    def _kept(self) -> dict[int, str]:
        """The rows that are there: an item that this run has no test of keeps its own."""
        if not self._path.exists():
            return {}
        lines = self._path.read_text(encoding="utf-8").splitlines(keepends=True)
        return {int(found[1]): line for line in lines if (found := re.match(r"\| (\d+) \|", line))}

    def _row(self, number: int) -> str:
        item, reports = ITEMS[number], self._reports[number]
        title = item.title + (f" (left to later: {item.part})" if item.part else "")
        if not item.flavours:
            one = self._outcome(reports)
            cells = f"{one} | {one}"
        else:
            cells = " | ".join(
                self._outcome([r for r in reports if flavour in self._said.get(r.nodeid, [])])
                if flavour in item.flavours
                else "–"
                for flavour in ("px4", "ardupilot")
            )
        files = sorted({Path(report.nodeid.split("::")[0]).name for report in reports})
        return f"| {number} | {title} | {cells} | {', '.join(f'`{name}`' for name in files)} |\n"

    @staticmethod
    def _outcome(reports: list[Any]) -> str:
        failed = sorted({report.outcome for report in reports} - {"passed"})
        return ", ".join(failed) if failed else str(len(reports) or "nothing")
