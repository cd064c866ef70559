"""How many tests run at once on a machine with several runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from support.slots import lock, slot


def test_as_many_are_locked_as_there_are_slots(tmp_path: Path) -> None:
    held = [lock(tmp_path, 2) for _ in range(3)]
    assert [one is not None for one in held] == [True, True, False]
    for one in held[:2]:
        assert one is not None
        os.close(one)
    with slot(tmp_path, 1):
        assert lock(tmp_path, 1) is None
    again = lock(tmp_path, 1)
    assert again is not None
    os.close(again)


def test_slot_of_a_killed_run_is_free(tmp_path: Path) -> None:
    code = f"""
import time
from pathlib import Path
from support.slots import slot

with slot(Path({str(tmp_path)!r}), 1):
    print("held", flush=True)
    time.sleep(60.0)  # until it is killed
"""
    tests = Path(__file__).parents[2]
    with subprocess.Popen([sys.executable, "-c", code], cwd=tests, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        assert lock(tmp_path, 1) is None
        other.kill()
    with slot(tmp_path, 1):
        pass
