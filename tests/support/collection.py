"""Pytest plugin: the workers of a run collect the same tests, each beginning with other files.

In a new clone a file's assertions are rewritten when it is imported first, and the result is stored beside it. Workers
that import all files at the same time and in the same order each do all of this.
"""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest

from support.order import WORKERS

WORKER = "PYTEST_XDIST_WORKER"
"""Environment variable with the name of a worker: gw0 is the first."""

_PLACE = pytest.StashKey[int]()
"""Position of a file or folder in its folder."""


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Begin a folder with that part of it that no other worker begins with."""
    report = yield
    if isinstance(collector, pytest.Directory) and report.result:
        for place, child in enumerate(report.result):
            child.stash[_PLACE] = place
        number, workers = int(os.environ.get(WORKER, "gw0")[2:]), int(os.environ.get(WORKERS, "1"))
        first = len(report.result) * number // workers
        report.result = [*report.result[first:], *report.result[:first]]
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests into the order that all workers share."""
    items.sort(key=lambda item: [node.stash.get(_PLACE, 0) for node in item.listchain()])
