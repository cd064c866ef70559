"""A program that is forked from the server (`support.programs`) is like one that Python starts, and costs less."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support import clock
from support.programs import PROGRAM
from support.world import loopback

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="support.programs needs PR_SET_CHILD_SUBREAPER, which only Linux has"
)

FORKED, STARTED = PROGRAM, [sys.executable, "-s", "-m", "anafi_mav"]
"""Another option of Python is the server's cue to leave the start to `subprocess`."""


def is_forked(process: subprocess.Popen[bytes]) -> bool:
    return b"program_server" in Path(f"/proc/{process.pid}/cmdline").read_bytes()


@pytest.mark.parametrize(
    "words", [["--version"], ["plan"], ["plan", "check", "absent.plan"], ["keygen", "field", "-x"]]
)
def test_forked_program_says_the_same_and_ends_with_the_same_status(words: list[str], tmp_path: Path) -> None:
    environment = {**os.environ, "COLUMNS": "60", "XDG_STATE_HOME": str(tmp_path / "state")}
    ends = [
        subprocess.run([*start, *words], cwd=tmp_path, env=environment, capture_output=True, stdin=subprocess.DEVNULL)
        for start in (FORKED, STARTED)
    ]
    assert ends[0].stdout + ends[0].stderr
    assert len({(end.returncode, end.stdout, end.stderr) for end in ends}) == 1


def test_forked_program_takes_its_folder_environment_and_stdin(tmp_path: Path) -> None:
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    words = [*FORKED, "keygen", "field", "--hex"]
    subprocess.run(words, input=b"11" * 32, cwd=tmp_path, env=environment, check=True, capture_output=True)
    assert (tmp_path / "state" / "anafi-mav" / "keys" / "field.key").stat().st_mode & 0o777 == 0o600


def test_forked_program_is_a_child_of_ours_until_it_has_ended() -> None:
    address = loopback()
    words = ["sim", "--address", address, "--rtsp-port", "0", "--http-port", "0"]
    files = []
    for start, forked in (FORKED, True), (STARTED, False):
        process = subprocess.Popen([*start, *words], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL)
        with process:
            assert process.stdout is not None
            while not process.stdout.readline().startswith(b"ready"):
                assert process.poll() is None
            assert is_forked(process) is forked
            parent = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[1]
            assert int(parent) == os.getpid()
            assert not clock.childless()
            opened = [str(one.readlink()).partition(":")[0] for one in Path(f"/proc/{process.pid}/fd").iterdir()]
            files.append(sorted(one for one in opened if ".so" not in one))  # libffi keeps its own file open
            process.send_signal(signal.SIGKILL)
        assert process.returncode == -signal.SIGKILL
        assert clock.childless()
    assert files[0] == files[1], "the server's own files are not in the program"


def test_variable_that_python_reads_at_its_start_has_its_effect() -> None:
    environment = {**os.environ, "PYTHONVERBOSE": "1"}
    done = subprocess.run([*FORKED, "--version"], env=environment, capture_output=True, check=True)
    assert b"import" in done.stderr


def test_program_is_forked_beside_a_stopped_process_of_ours() -> None:
    hangups: list[int] = []
    before = signal.signal(signal.SIGHUP, lambda number, frame: hangups.append(number))
    try:
        with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as stopped:
            stopped.send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, stopped.pid, os.WSTOPPED)
            subprocess.run([*FORKED, "--version"], check=True, capture_output=True)
            stopped.send_signal(signal.SIGCONT)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert not hangups
