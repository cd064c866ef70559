"""`anafi-mav keygen`: keys of passphrases as stations make them, and no secret that was not asked for."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from anafi_mav.cli import MISUSED, main
from anafi_mav.mavlink.key_ring import path_of, read_key, write_key
from anafi_mav.mavlink.signing import LATEST
from anafi_mav.state_lock import StateLock

PASSPHRASE = "correct-horse-battery-staple"


@pytest.fixture
def state(tmp_path: Path) -> Path:
    return tmp_path / "state"


def keygen(state: Path, *words: str) -> int:
    return main(["keygen", "field", "--state", str(state), *words])


def secret(state: Path) -> bytes:
    return (read_key(state / "keys", "field") or b"")[:32]


def typed(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(text + "\n"))


def test_random_key_is_written_and_not_shown(state: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert keygen(state) == 0
    made = secret(state)
    assert len(made) == 32
    said = capsys.readouterr()
    assert f"key field: {path_of(state / 'keys', 'field')}" in said.out
    assert made.hex() not in said.out + said.err
    assert keygen(state, "--show") == 0
    assert capsys.readouterr().out == made.hex() + "\n"
    assert secret(state) == made


def test_key_in_another_users_state_folder_belongs_to_that_user(state: Path) -> None:
    """Root makes it for a service with a user of its own. Any other user has folders of its own only."""
    state.mkdir()
    if os.name == "posix" and os.geteuid() == 0:
        os.chown(state, 65534, 65534)
    assert keygen(state) == 0
    assert keygen(state, "--replace") == 0
    made = [state / "keys", *(state / "keys").iterdir()]
    assert len(made) == 3
    assert {path.stat().st_uid for path in made} == {state.stat().st_uid}


@pytest.mark.parametrize(
    ("station", "expected"),
    [
        ("mavproxy", hashlib.sha256(PASSPHRASE.encode()).hexdigest()),
        # By OpenSSL 3.0: openssl kdf -kdfopt digest:SHA256 … -kdfopt iter:600000 PBKDF2
        ("qgroundcontrol", "dba7b409e255adcd3c2c01e03a10d239b532836a682e4d15f37bca6852d34a47"),
    ],
)
def test_key_of_a_passphrase_is_the_stations(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], station: str, expected: str
) -> None:
    typed(monkeypatch, PASSPHRASE)
    assert keygen(state, "--passphrase", "--station", station) == 0
    assert secret(state).hex() == expected
    said = capsys.readouterr()
    assert PASSPHRASE not in said.out + said.err
    assert expected not in said.out + said.err


@pytest.mark.parametrize(
    ("option", "text"),
    [("--passphrase", "short"), ("--passphrase", "with a space in it"), ("--hex", "00" * 32), ("--hex", "ab" * 31)],
)
def test_unusable_secret_is_refused_and_not_repeated(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], option: str, text: str
) -> None:
    typed(monkeypatch, text)
    assert keygen(state, option) == MISUSED
    said = capsys.readouterr()
    assert text not in said.out + said.err
    assert not (state / "keys").exists()


def test_existing_key_is_replaced_on_request_and_restored(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert keygen(state) == 0
    first = secret(state)
    assert keygen(state) == MISUSED
    assert "--replace" in capsys.readouterr().err
    typed(monkeypatch, "ab" * 32)
    assert keygen(state, "--hex", "--replace") == 0
    assert secret(state) == bytes.fromhex("ab" * 32)
    before = (read_key(state / "keys", "field") or b"")[32:]
    for expected in (first, bytes.fromhex("ab" * 32)):
        assert keygen(state, "--undo") == 0
        assert secret(state) == expected
    after = (read_key(state / "keys", "field") or b"")[32:]
    assert int.from_bytes(after, "little") >= int.from_bytes(before, "little")


def test_random_key_begins_at_the_clock(state: Path) -> None:
    write_key(state / "keys", "field", bytes(range(32)) + LATEST.to_bytes(8, "little"))
    assert keygen(state, "--replace") == 0
    content = read_key(state / "keys", "field") or b""
    assert int.from_bytes(content[32:], "little") < LATEST


def test_key_of_a_running_gateway_is_not_changed(state: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert keygen(state) == 0
    lock = StateLock(state)
    assert lock.acquire() is None
    for words in (["--replace"], ["--undo"]):
        assert keygen(state, *words) == MISUSED
        assert "end it first" in capsys.readouterr().err
    lock.release()
    assert keygen(state, "--undo") == MISUSED
    assert "no key before field" in capsys.readouterr().err


def test_name_that_is_no_file_name_is_refused(state: Path) -> None:
    assert main(["keygen", "../field", "--state", str(state)]) == MISUSED
    assert not state.exists()


def test_passphrase_that_is_no_text_is_refused(
    state: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"gr\xfc\xdfe aus\n"), encoding="utf-8"))
    assert keygen(state, "--passphrase") == MISUSED
    assert "expected the passphrase as a line of text; nothing was changed" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="it needs a pseudo-terminal")
@pytest.mark.parametrize(
    ("typed", "status"), [(b"\x03", 130), (b"\x04", MISUSED), (b"", 143)], ids=["Ctrl-C", "Ctrl-D", "SIGTERM"]
)
def test_prompt_that_is_left_shows_again_what_is_typed(state: Path, typed: bytes, status: int) -> None:
    import fcntl
    import termios

    outer, inner = os.openpty()

    def take_terminal() -> None:
        os.setsid()
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)

    words = [sys.executable, "-m", "anafi_mav", "keygen", "field", "--passphrase", "--state", str(state)]
    with subprocess.Popen(words, stdin=inner, stdout=inner, stderr=inner, preexec_fn=take_terminal) as process:
        said = b""
        while not said.endswith(b": "):  # getpass hides what is typed before it asks
            said += os.read(outer, 1)
        assert not termios.tcgetattr(inner)[3] & termios.ECHO
        if typed:
            os.write(outer, typed)
        else:
            process.terminate()
        assert process.wait() == status
        assert termios.tcgetattr(inner)[3] & termios.ECHO
    os.close(inner)
    os.close(outer)
    assert not (state / "keys").exists()
