"""The log of the long-running commands: its file, and its lines as JSON."""

from __future__ import annotations

import errno
import json
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from support.hanging_disk import PATIENCE, hanging_file

from anafi_mav.cli import log
from anafi_mav.cli.terminal import STDERR_WRITER, complain, write_stderr
from anafi_mav.errors import ConfigError
from anafi_mav.subject import DRONE


def line(formatter: logging.Formatter, text: str, *arguments: object) -> str:
    return formatter.format(logging.LogRecord("anafi_mav.x", logging.WARNING, "f", 1, text, arguments, None))


def test_json_line_names_level_logger_and_drone() -> None:
    token = DRONE.set("alpha")
    try:
        entry = json.loads(line(log.JsonFormatter(), "lost: %s", "no answer"))
    finally:
        DRONE.reset(token)
    assert entry.pop("time").endswith("Z")
    assert entry == {
        "level": "WARNING",
        "logger": "anafi_mav.x",
        "drone": "alpha",
        "message": "lost: no answer",
    }


def test_json_line_of_hostile_text_is_ascii_without_controls() -> None:
    text = line(log.JsonFormatter(), "\x1b[31m\n\x7f\u202e")
    assert text.isascii()
    assert text.isprintable()
    assert json.loads(text)["message"] == "\x1b[31m\n\x7f\u202e"


def test_log_file_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log, "FILE_BYTES", 200)
    path = tmp_path / "gateway.log"
    file = log.BoundedLogFile(path)
    for number in range(300):
        file.write(f"line {number}")
    files = sorted(one.name for one in tmp_path.iterdir())
    assert files == ["gateway.log", *(f"gateway.log.{number}" for number in range(1, log.OLD_FILES + 1))]
    assert all(one.stat().st_size <= 200 for one in tmp_path.iterdir())
    assert path.read_text().endswith("line 299\n")


def test_log_to_a_device_is_not_put_aside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As root, /dev/null would get another name, and a file would take its place. A pipe stands for it."""
    monkeypatch.setattr(log, "FILE_BYTES", 200)
    path = tmp_path / "log"
    os.mkfifo(path)
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as reading:
        file = log.BoundedLogFile(path)
        for number in range(100):
            file.write(f"line {number}")
        assert reading.read().endswith(b"line 99\n")
    assert [one.name for one in tmp_path.iterdir()] == ["log"]


def test_log_file_that_cannot_be_put_aside_begins_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a file in /var/log that root has made for the user of the service."""

    def refuse(path: Path, target: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(log, "FILE_BYTES", 200)
    monkeypatch.setattr(Path, "replace", refuse)
    path = tmp_path / "gateway.log"
    file = log.BoundedLogFile(path)
    for number in range(100):
        file.write(f"line {number}")
    assert [one.name for one in tmp_path.iterdir()] == ["gateway.log"]
    assert path.stat().st_size <= 200
    assert path.read_text().endswith("line 99\n")
    assert STDERR_WRITER.wait(PATIENCE)
    assert capsys.readouterr().err.count("begins again, because it cannot be put aside: ") == 1
    path.unlink()
    path.mkdir()
    for number in range(100):
        file.write(f"line {number}")
    assert STDERR_WRITER.wait(PATIENCE)
    assert capsys.readouterr().err.count("cannot be written: ") == 1


def test_link_to_the_log_file_keeps_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As /dev/stderr, which would be another file for every program then."""
    monkeypatch.setattr(log, "FILE_BYTES", 200)
    link, folder = tmp_path / "stderr", tmp_path / "logs"
    folder.mkdir()
    link.symlink_to(folder / "gateway.log")
    file = log.BoundedLogFile(link)
    for number in range(30):
        file.write(f"line {number}")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["logs", "stderr"]
    assert sorted(one.name for one in folder.iterdir()) == ["gateway.log", "gateway.log.1"]
    assert link.is_symlink()
    assert link.read_text().endswith("line 29\n")


def test_repeated_line_is_counted_once_for_all_outputs(tmp_path: Path) -> None:
    first, second = log.LogFileHandler(tmp_path / "a"), log.LogFileHandler(tmp_path / "b")
    outputs = log.LogOutputs([first, second])
    for number in range(3):
        outputs.handle(logging.LogRecord("x", logging.WARNING, "f", 1, "%s: line %d", ("alpha", number), None))
    first.end(PATIENCE)
    second.end(PATIENCE)
    assert (tmp_path / "a").read_text() == (tmp_path / "b").read_text() == "alpha: line 0\n"


def test_full_disk_is_reported_once(capsys: pytest.CaptureFixture[str]) -> None:
    file = log.BoundedLogFile(Path("/dev/full"))
    for _ in range(3):
        file.write("line")
    assert STDERR_WRITER.wait(PATIENCE)
    assert capsys.readouterr().err.count("/dev/full cannot be written: [Errno 28]") == 1


def test_complaint_follows_the_lines_of_the_log_before_it(capfd: pytest.CaptureFixture[str]) -> None:
    """A thread writes those."""
    STDERR_WRITER.post(lambda: time.sleep(0.1))
    log.LogThreadHandler(STDERR_WRITER, write_stderr, "terminal").emit(logging.makeLogRecord({"msg": "line"}))
    complain("no gateway")
    assert capfd.readouterr().err.splitlines() == ["line", "anafi-mav: no gateway"]


@pytest.mark.skipif(os.name != "posix", reason="uses os.setuid and folder permissions, which Windows does not have")
def test_log_file_in_a_folder_that_refuses_new_files_passes_the_check() -> None:
    """As /dev/null, or a file in /var/log: a start writes it without a new name."""
    script = """
import os, sys
from pathlib import Path
from anafi_mav.cli import log
if os.geteuid() == 0:
    os.setuid(65534)
log.check("--log-file", Path("/dev/null"))
log.check("--log-file", Path(sys.argv[1]))
"""
    with TemporaryDirectory() as name:
        path = Path(name) / "gateway.log"
        path.touch()
        path.chmod(0o666)
        path.parent.chmod(0o555)
        run = subprocess.run(
            [sys.executable, "-c", script, str(path)], capture_output=True, text=True, check=False, timeout=30
        )
        path.parent.chmod(0o755)
    assert run.stderr == ""


def test_log_file_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^--log-file: expected a file that can be written"):
        log.set_up(path=tmp_path / "absent" / "gateway.log")


def test_lines_that_a_hanging_disk_cannot_take_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(log, "MAX_WAITING", 10)
    path, drain = hanging_file(tmp_path / "gateway.log")
    handler = log.LogFileHandler(path)
    for number in range(100):
        handler.handle(logging.LogRecord("x", logging.WARNING, "f", 1, "line %d", (number,), None))
    handler.end(0.0)
    with os.fdopen(drain) as reading:
        lines: list[str] = []
        while not lines or "lost" not in lines[-1]:
            if found := reading.readline().strip():
                lines.append(found)
            handler.end(0.0)
    written = len(lines) - 1
    assert lines[:-1] == [f"line {number}" for number in range(written)]
    assert written in (10, 11)  # those that wait, and the one that the thread holds
    assert lines[-1] == f"{100 - written} lines lost: disk too slow"
    assert capsys.readouterr().err.count(f"--log-file: {path} is too slow: lines are lost") == 1
