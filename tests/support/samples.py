"""The sample missions, and what a simulated drone has to have done when it has flown one, by its log.

One judge for every client: MAVSDK flies some of the combinations of sample and model in real time, a client of our own
flies all of them in virtual time (`clients/test_sample_missions.py`, `conformance/test_conf_missions_samples.py`).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from anafi_mav.plans.formats import files
from support.flight_checks import Log, check, looked, photos, tilts

FOLDER = Path(__file__).parents[2] / "missions"

ZOOMS = {"4k": 3.0, "thermal": 3.0, "usa": 32.0, "ai": 6.0}
"""Model -> how far it zooms. Each flies every sample."""

CAMERA = {
    "corridor": ["take_photo", "stop_photo", "take_photo"],
    "inspection": ["take_photo"] * 6,
    "loop": ["take_photo"] * 3,
    "orbit": ["start_recording", "stop_recording"],
    "panorama": ["panorama"] * 2,
    "structure": ["take_photo", "stop_photo"] * 2,
    "survey": ["take_photo", "stop_photo", "take_photo"],
    "timelapse": ["take_photo", "stop_photo"],
}
"""What the cameras do, in order. An order to take photos by time or distance is one until it is ended."""

TILTS = {
    "corridor": [-60.0],
    "inspection": [0.0, -30.0, -15.0, 0.0],
    "structure": [-10.0],
    "survey": [-90.0],
}
"""Where the gimbal items point the camera, deg: down is negative."""

AIMED = 0.5
"""deg that it may be beside that."""

LAPSES = {"corridor": 1, "structure": 2, "survey": 1, "timelapse": 1}
"""Items that begin one. Of each the number of photos is known but for one; single photos are one each."""

SAMPLES = (
    *("inspection", "orbit", "heights", "loop", "corridor"),
    *("panorama", "timelapse", "delivery", "survey", "structure"),
)
"""The shorter flights and the longer ones."""


def path_of(sample: str) -> Path:
    """The file of a sample."""
    return FOLDER / f"{sample}.plan"


def judge(sample: str, model: str, log: Log, *, jump_beyond: int = 0) -> None:
    """Judge one flight whole: way points, camera, gimbal, region of interest and photos.

    `jump_beyond`: how many items behind its target a jump goes, see `flown.executed`.
    """
    begun = check(log, files.load(path_of(sample)), jump_beyond)
    assert log.camera() == CAMERA.get(sample, [])
    half = (1.0 + ZOOMS[model]) / 2.0
    zooms = log.zooms()
    assert zooms == ([half, 1.0] if sample == "inspection" else []), zooms
    assert tilts(log, begun) == pytest.approx(TILTS.get(sample, []), abs=AIMED)
    assert looked(log, begun) == (sample == "orbit")
    counts = photos(log, begun)
    assert all(abs(taken - expected) <= (expected > 1) for taken, expected in counts), counts
    assert sum(expected > 1 for _, expected in counts) == LAPSES.get(sample, 0), counts
