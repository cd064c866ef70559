"""Pytest plugin: repeats a failed `third_party` test once, and prints the first failure.

The marker is for tests whose outcome depends on a program of another client's that runs in real time. A test in virtual
time, or of our own processes alone, never repeats: a failure of one is a defect to be found.
"""

from __future__ import annotations

import pytest

MARKER = "third_party"


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", f"{MARKER}: judges a foreign process in real time; a failure is repeated once")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give each marked test one repetition (pytest-rerunfailures)."""
    for item in items:
        if item.get_closest_marker(MARKER) is not None:
            item.add_marker(pytest.mark.flaky(reruns=1))
            # The limit of pytest-timeout counts once for a test with its repetition, unless it is that of the call.
            item.add_marker(pytest.mark.timeout(func_only=True))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print each repeated test with its first failure, whether or not the repetition passed."""
    for report in terminalreporter.stats.get("rerun", []):
        terminalreporter.write_line(f"repeated: {report.nodeid}")
        terminalreporter.write_line(report.longreprtext)
