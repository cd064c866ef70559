"""Pytest plugin: the garbage collector leaves alone what exists before the first test.

Modules and thousands of collected tests last as long as the run. A full collection that looks through all of them takes
about a second, and while they are being made there would be one after each quarter.
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
