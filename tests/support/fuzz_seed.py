"""Pytest plugin: a seed for tests with random input, another one in each run.

A run prints its seed at the start and with each failure of a test that uses it. `--fuzz-seed N`, or FUZZ_SEED=N in the
environment, repeats a run's input.
"""

from __future__ import annotations

import os
import random
from collections.abc import Generator
from typing import Any

import pytest

VARIABLE = "FUZZ_SEED"
"""Environment variable; the workers of a run inherit it."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fuzz-seed", type=int, metavar="N", help="seed of tests with random input (default: random)")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Choose the seed before the workers start."""
    if config.option.fuzz_seed is not None:
        os.environ[VARIABLE] = str(config.option.fuzz_seed)
    elif VARIABLE not in os.environ:
        os.environ[VARIABLE] = str(random.SystemRandom().randrange(10**6))
        config.add_cleanup(lambda: os.environ.pop(VARIABLE, None))
    int(os.environ[VARIABLE])


def repetition() -> str:
    """Return the line that says how to repeat the input of this run."""
    return f"fuzz seed {os.environ[VARIABLE]}: --fuzz-seed {os.environ[VARIABLE]} repeats it"


def pytest_sessionstart(session: pytest.Session) -> None:
    """Print the seed, also in a quiet run, which has no header."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None and not hasattr(session.config, "workerinput"):
        reporter.write_line(repetition())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Print the seed with a failure of a test that uses it."""
    report = yield
    if report.failed and "fuzz_seed" in getattr(item, "fixturenames", ()):
        report.sections.append(("fuzz seed", repetition()))
    return report


@pytest.fixture(scope="session")
def fuzz_seed() -> int:
    """The seed of this run; a test derives its own from it: `random.Random(f"{fuzz_seed} {flavour}")`."""
    return int(os.environ[VARIABLE])
