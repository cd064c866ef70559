"""docs/real-aircraft.md against the code: its texts, parameters and quirks exist, and its tables are complete."""

from __future__ import annotations

import re
from pathlib import Path

from anafi_mav.sim.world.quirks import QUIRKS
from anafi_mav.texts import ROLL_SIGN_INVERTED as INVERTED
from anafi_mav.texts import ROLL_SIGN_VERIFIED as VERIFIED

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "real-aircraft.md").read_text(encoding="utf-8")
ROWS = [line.split(" | ") for line in PAGE.splitlines() if re.match(r"\| \d+ \|", line)]
SOURCE = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "anafi_mav").rglob("*.py"))

CHECKS = [row for row in ROWS if row[1] in ("propellers off", "in free space")]
ASSUMED = [row for row in ROWS if row not in CHECKS]


def test_real_aircraft_page_numbers_all_checks_and_assumptions() -> None:
    assert [int(row[0].strip("| ")) for row in CHECKS] == [*range(1, len(CHECKS) + 1)]
    assert len(CHECKS) > 20
    where = [row[1] for row in CHECKS]
    assert where == sorted(where, key=("propellers off", "in free space").index), "first without propellers"
    assert [int(row[0].strip("| ")) for row in ASSUMED] == [*range(1, 48)]
    assert all(len(row) == 4 and all(cell.strip("| ") for cell in row) for row in ROWS)


def test_real_aircraft_page_names_existing_quirks_and_parameters() -> None:
    named = set(re.findall(r"quirks? ((?:`[a-z0-9-]+`(?:, | and )?)+)", PAGE))
    quirks = {name for group in named for name in re.findall(r"`([a-z0-9-]+)`", group)}
    assert quirks
    assert quirks <= QUIRKS.keys()
    parameters = set(re.findall(r"`(ANF_[A-Z_]+)`", PAGE))
    known = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    assert {name for name in parameters if f"`{name}`" not in known} == set()


def test_real_aircraft_page_quotes_texts_of_the_code() -> None:
    quoted = ("Take-off altitude estimated", "Take-off altitude inaccurate", "Connection refused by drone",
              "Drone connected to another controller", "Drone flies a plan that is not this mission",
              "Mission refused by drone", "file not accepted", "Mission complete")  # fmt: skip
    for text in (*quoted, INVERTED, VERIFIED):
        assert text in PAGE, text
        assert text in SOURCE, text


def test_new_statustexts_fit_one_message() -> None:
    longest = (
        INVERTED,
        VERIFIED,
        "Take-off altitude estimated: GPS only (+-10 m)",
        "Take-off altitude inaccurate: GPS +-127 m",
        "Setpoint refused: estimated AMSL: -1234 m < 15 m",
        "Item 5000 refused: estimated AMSL: -1234 m < 15 m",
        "Setpoint refused: AMSL unknown, no GPS fix",
        "Setpoint refused: take-off point unknown",
        "Setpoint refused: 4000 m > geofence 4000 m",
        "Drone geofence ends: centre is 12345 m off",
        "Tilt limit 10 deg: roll sign not verified",
        "Offboard refused: roll sign inverted",
    )
    assert [text for text in longest if len(text.encode()) > 50] == []
