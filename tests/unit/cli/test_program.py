"""The start of the program: the garbage collector works when a command runs, and leaves the modules alone.

Its end: without finalization where zenoh is loaded, whose threads would abort the process.
"""

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

END = """
import atexit, gc, os, sys, types
from anafi_mav import cli
from anafi_mav.__main__ import main

class Finalized:
    def __del__(self, write=os.write):
        write(1, b"finalized\\n")

kept = Finalized()
probe = types.ModuleType("anafi_mav.cli.probe")
probe.add_arguments = lambda parser: None
probe.run = lambda arguments: gc.unfreeze() or 3  # what is frozen is not finalized
sys.modules[probe.__name__] = probe
cli.COMMANDS["probe"] = "end"
if sys.argv[1:]:
    sys.modules["zenoh"] = types.ModuleType("zenoh")
sys.argv = ["anafi-mav", "probe"]
atexit.register(print, "ends")
sys.exit(main())
"""


def test_program_with_zenoh_ends_without_finalization() -> None:
    for words, printed in (["zenoh"], ["ends"]), ([], ["ends", "finalized"]):
        done = subprocess.run([sys.executable, "-c", END, *words], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout.splitlines(), done.stderr) == (3, printed, "")


def test_garbage_collector_is_off_during_import_and_on_in_the_command() -> None:
    done = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["imported False", "runs True True"]


def test_run_and_sim_import_neither_numpy_nor_rich() -> None:
    code = "import sys; import anafi_mav.cli.run, anafi_mav.cli.sim; print({'numpy', 'rich'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
