"""Pytest plugin: the garbage collector leaves alone what outlives the tests.

Modules and thousands of collected tests last as long as the run, and so does what tests leave behind in caches and in
modules that they are the first to import. A full collection that looks through all of them takes about a second before
the first test, and a fifth of one after a thousand tests: longer than the tests that begin and end with a collection.
"""

from __future__ import annotations

import gc
from collections.abc import Generator

import pytest


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect the tests without the garbage collector, and keep what is made for good."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, object, object]:
    """Keep for good what the last test of a file leaves, once garbage is collected and fixtures have ended."""
    result = yield
    if nextitem is not None and nextitem.path != item.path:
        gc.collect()
        gc.freeze()
    return result
