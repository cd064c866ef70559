"""Pytest plugin: processor and wall time of each test, summed per file, as JSON in the file named by COSTS_FILE.

The processor time of a test is that of its worker and of the child processes that have ended with it.
"""

from __future__ import annotations

import json
import os
import resource
import time
from collections import defaultdict
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

FILE = "COSTS_FILE"
"""Environment variable with the name of the file to write."""

_KEY = "cost"
_START = pytest.StashKey[tuple[float, float]]()


def _now() -> tuple[float, float]:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), time.process_time() + children.ru_utime + children.ru_stime


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    item.stash[_START] = _now()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    if call.when == "teardown":
        wall, cpu = (after - before for after, before in zip(_now(), item.stash[_START], strict=True))
        item.user_properties.append((_KEY, (wall, cpu)))
    return (yield)


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput") and os.environ.get(FILE):
        config.pluginmanager.register(_Costs(Path(os.environ[FILE])))


class _Costs:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._files: dict[str, list[float]] = defaultdict(lambda: [0, 0.0, 0.0])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        for wall, cpu in (
            value for name, value in report.user_properties if name == _KEY and report.when == "teardown"
        ):
            sums = self._files[report.nodeid.partition("::")[0]]
            sums[0], sums[1], sums[2] = sums[0] + 1, sums[1] + wall, sums[2] + cpu

    def pytest_sessionfinish(self) -> None:
        self._path.write_text(json.dumps(self._files), encoding="utf-8")
