"""The reasons for which the status shows that peers and messages were refused."""

from __future__ import annotations

import re
from pathlib import Path

import anafi_mav
from anafi_mav.gateway_status import REFUSALS

COUNTED = re.compile(r'counters\["(refused_[a-z]+)"\]')


def test_every_counter_of_refusals_has_a_reason_in_the_status() -> None:
    """Those of `anafi-mav ground` are in its own lines."""
    package = Path(anafi_mav.__file__).parent
    files = [*package.glob("mavlink/*.py"), *package.glob("services/**/*.py"), package / "fabric" / "endpoint.py"]
    counted = {name for path in files for name in COUNTED.findall(path.read_text(encoding="utf-8"))}
    assert {"refused_access", "refused_peers"} <= counted
    assert counted - REFUSALS.keys() == set()
