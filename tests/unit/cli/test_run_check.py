"""`anafi-mav run --check`: a line for each thing that a start needs, and nothing is left open."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from support.world import loopback

from anafi_mav.cli import main
from anafi_mav.state_lock import StateLock


def configuration(folder: Path, port: int, more: str = "") -> str:
    path = folder / "fleet.yaml"
    path.write_text(f"""
        state: {folder / "state"}
        endpoints: ["tcpin://127.0.0.1:{port}"]
        drones: [{{name: alpha, sysid: 1, address: {loopback()}}}]
        video: {{rtsp_port: 0}}
        http: {{port: 0}}
        {more}
    """)
    return str(path)


def check(path: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    status = main(["run", "-c", path, "--check"])
    return status, capsys.readouterr().out


def test_check_of_a_good_configuration_leaves_nothing_open(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = configuration(tmp_path, 0)
    for _ in range(2):
        status, out = check(path, capsys)
        assert status == 0
        assert "versions: ok: anafi-mav " in out
        assert "configuration: ok: 1 drones, 1 endpoints" in out
        assert "state: ok: " in out
        assert "open: ok: endpoint tcpin://127.0.0.1:" in out
        assert "WRONG" not in out


def test_check_names_a_busy_port(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        status, out = check(configuration(tmp_path, taken.getsockname()[1]), capsys)
    assert status == 1
    assert "endpoints[0]: WRONG: cannot open tcpin://127.0.0.1:" in out


def test_check_names_another_gateway_of_the_state_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lock = StateLock(tmp_path / "state")
    assert lock.acquire() is None
    try:
        status, out = check(configuration(tmp_path, 0), capsys)
    finally:
        lock.release()
    assert status == 1
    assert "state: WRONG: expected a folder that no other gateway uses" in out


def test_check_names_the_key_of_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out = check(configuration(tmp_path, 0, "pose: eyes"), capsys)
    assert status == 1
    assert "configuration: WRONG: " in out
    assert "fleet.yaml: pose: expected video or events" in out
