"""What the simulator logged of the true pose, ten times a second at best, read at a moment between."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any


def pose_at(log: Iterable[dict[str, Any]], t: float) -> dict[str, float]:
    """All of one drone's pose at a log time, on straight ways between the entries before and after it; so no yaw near
    south.

    A busy machine lets a moving drone get metres further from one entry to the next. Raises AssertionError when the
    log does not reach around that time.
    """
    poses = [entry for entry in log if entry["kind"] == "pose"]
    around = next(((a, b) for a, b in itertools.pairwise(poses) if a["t"] <= t < b["t"]), None)
    assert around, f"{t} is not within the log's poses, {[entry['t'] for entry in poses[:: max(1, len(poses) - 1)]]}"
    before, after = around
    part = (t - before["t"]) / (after["t"] - before["t"])
    return {key: value + part * (after["args"][key] - value) for key, value in before["args"].items()}
