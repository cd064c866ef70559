"""The start of the program: the garbage collector works when a command runs, and leaves the modules alone.

Its end: without finalization where zenoh is loaded, whose threads would abort the process.
"""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

MISSIONS = Path(__file__).parents[3] / "missions"

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


@pytest.mark.skipif(os.name != "posix", reason="closing a standard stream (`>&-`) needs a POSIX shell")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_program_with_closed_standard_streams_does_its_work(closed: str, tmp_path: Path) -> None:
    words = f'exec "$0" -m anafi_mav keygen field --hex --state "$1" {closed}'
    done = subprocess.run(["sh", "-c", words, sys.executable, tmp_path], input=b"11" * 32, capture_output=True)
    is_blind = "<" in closed
    assert done.returncode == (2 if is_blind else 0)  # without stdin there is no key
    assert done.stderr in (b"", b"anafi-mav: --hex: expected 64 hexadecimal digits that are not all 0\n")
    assert (tmp_path / "keys" / "field.key").exists() is not is_blind


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="opens a terminal by os.openpty, which Windows does not have")
def test_terminal_without_a_character_gets_its_escape(tmp_path: Path) -> None:
    """Also in a table, which rich writes."""
    plan = tmp_path / "b\u00fccher.plan"
    plan.write_bytes((MISSIONS / "survey.plan").read_bytes())
    parent, child = os.openpty()
    command = (sys.executable, "-m", "anafi_mav", "plan", "show", str(plan))
    env = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "200", "TERM": "xterm"}
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=child, stderr=child, env=env) as process:
        os.close(child)
        shown = b""
        with suppress(OSError):  # Linux: the other end is closed
            while data := os.read(parent, 4096):
                shown += data
        assert process.wait(60.0) == 0, shown
    os.close(parent)
    assert b"b\\xfccher.plan: 14 items" in shown
    assert b"NAV_RETURN_TO_LAUNCH" in shown


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, which only Linux has")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_on_a_full_disk_is_reported_and_an_error(unbuffered: str, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    words = [sys.executable, "-m", "anafi_mav", "keygen", "field", "--state", str(tmp_path)]
    assert subprocess.run(words, stdout=subprocess.DEVNULL).returncode == 0
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run([*words, "--show"], stdout=full, stderr=subprocess.PIPE, text=True, env=environment)
    assert done.returncode == 1
    assert done.stderr.splitlines() == ["anafi-mav: stdout cannot be written: No space left on device"]


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_reader_that_has_left_is_no_error(unbuffered: str, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    words = [sys.executable, "-m", "anafi_mav", "keygen", "field", "--state", str(tmp_path)]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(words, stdout=writer, stderr=subprocess.PIPE, text=True, env=environment)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
