"""The start of the program: the garbage collector works when a command runs, and leaves the modules alone."""

from __future__ import annotations

import subprocess
import sys

PROBE = """
import gc, sys, types
from anafi_mav import cli
from anafi_mav.__main__ import main

probe = types.ModuleType("anafi_mav.cli.probe")
probe.add_arguments = lambda parser: print("imported", gc.isenabled())
probe.run = lambda arguments: print("runs", gc.isenabled(), gc.get_freeze_count() > 10_000) or 0
sys.modules[probe.__name__] = probe
cli.COMMANDS["probe"] = "say what the collector does"
sys.argv = ["anafi-mav", "probe"]
sys.exit(main())
"""


def test_garbage_collector_is_off_during_import_and_on_in_the_command() -> None:
    done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["imported False", "runs True True"]


def test_run_and_sim_import_neither_numpy_nor_rich() -> None:
    code = "import sys; import anafi_mav.cli.run, anafi_mav.cli.sim; print({'numpy', 'rich'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
