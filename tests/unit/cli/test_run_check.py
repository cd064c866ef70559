"""`anafi-mav run --check`: a line for each thing that a start needs, and nothing is left open or written."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from support.world import loopback

from anafi_mav.cli import main
from anafi_mav.mavlink.key_ring import write_key
from anafi_mav.state_lock import StateLock


def configuration(folder: Path, port: int, more: str = "", *, state: str = "state", signed: str = "") -> str:
    path = folder / "fleet.yaml"
    path.write_text(f"""
        state: {folder / state}
        endpoints: ["tcpin://127.0.0.1:{port}{signed}"]
        drones: [{{name: alpha, sysid: 1, address: {loopback()}}}]
        video: {{rtsp_port: 0}}
        {more or "http: {port: 0}"}
    """)
    return str(path)


def check(path: str, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    status = main(["run", "-c", path, "--check", *options])
    return status, capsys.readouterr().out


def test_check_of_a_good_configuration_leaves_nothing_open(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = configuration(tmp_path, 0)
    for _ in range(2):
        status, out = check(path, capsys)
        assert status == 0
        assert "versions: ok: anafi-mav " in out
        assert "configuration: ok: 1 drone, 1 endpoint\n" in out
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


def test_check_names_the_option_of_an_endpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out = check(configuration(tmp_path, 0), capsys, "--endpoint", "udpout://127.0.0.1")
    assert status == 1
    assert "--endpoint: WRONG: 'udpout://127.0.0.1': expected udpout://HOST:PORT" in out
    assert "endpoints[0]" not in out


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


def files(folder: Path) -> dict[str, bytes | None]:
    """Everything in a folder."""
    return {str(path): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def test_check_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither a token, a recorded session, a lock, a log nor the timestamp of a key."""
    write_key(tmp_path / "state" / "keys", "field", bytes(range(40)))
    more = f"""
        http: {{host: 0.0.0.0, port: 0}}
        recording: {{folder: {tmp_path / "flights"}}}"""
    path = configuration(tmp_path, 0, more, signed="?signing=field")
    before = files(tmp_path)
    status, out = check(path, capsys, "--log-file", str(tmp_path / "gateway.log"))
    assert (status, "WRONG" in out) == (0, False), out
    assert "signed with key field" in out
    assert f"recording: ok: folder can be written: {tmp_path / 'flights'}" in out
    assert files(tmp_path) == before


def test_check_shows_the_warnings_of_a_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = configuration(tmp_path, 0, "http: {host: 0.0.0.0, port: 0}")
    status, out = check(path, capsys, "--endpoint", "udpin://0.0.0.0:0")
    assert status == 0
    assert "configuration: ok: warning: http.host: 0.0.0.0 is open to the network without TLS" in out
    assert "warning: endpoints[0]: udpin://0.0.0.0:0 is open to the network without signing" in out


@pytest.mark.parametrize(
    ("folder", "wrong"),
    [
        ("FOLDER/fleet.yaml/x", "media.download_folder: WRONG: FOLDER/fleet.yaml/x: Not a directory"),
        ("~no-such-user/x", "media.download_folder: WRONG: expected the path of a folder: "),
        ("FOLDER/" + 300 * "x", "media.download_folder: WRONG: FOLDER/" + 300 * "x" + ": File name too long"),
        (r'"a\0b"', "media.download_folder: WRONG: expected the path of a folder, got 'a\\x00b'"),
        ("FOLDER/photos", "media.download_folder: ok: folder can be written: FOLDER/photos"),
    ],
)
def test_check_looks_at_the_folder_for_media(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], folder: str, wrong: str
) -> None:
    more = f"http: {{port: 0}}\n        media: {{download_folder: {folder.replace('FOLDER', str(tmp_path))}}}"
    status, out = check(configuration(tmp_path, 0, more), capsys)
    assert wrong.replace("FOLDER", str(tmp_path)) in out
    assert status == ("WRONG" in wrong)


def test_check_names_a_log_of_the_simulator_that_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "fleet.yaml"
    drone = f"{{name: alpha, sysid: 1, sim: {{address: {loopback()}}}}}"
    path.write_text(
        f"state: {tmp_path}/state\nendpoints: ['tcpin://127.0.0.1:0']\nhttp: off\nvideo: off\ndrones: [{drone}]"
    )
    status, out = check(str(path), capsys, "--sim-log", str(tmp_path))
    assert status == 1
    assert f"--sim-log: expected a file that can be written, got {tmp_path}: Is a directory" in out


@pytest.mark.parametrize(
    ("more", "state", "log_file", "wrong"),
    [
        ("recording: {folder: FOLDER/fleet.yaml/x}", "state", "log", "recording.folder: WRONG: expected a folder that"),
        ("", "fleet.yaml/state", "log", "state: WRONG: FOLDER/fleet.yaml/state: Not a directory"),
        ("", "odd", "log", "state: WRONG: FOLDER/odd/gateway.lock: Is a directory"),
        ("", "state", "absent/log", "--log-file: expected a file that can be written, got FOLDER/absent/log: No such"),
        ("", "state", "", "--log-file: expected a file that can be written, got FOLDER: Is a directory"),
    ],
)
def test_check_names_what_cannot_be_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], more: str, state: str, log_file: str, wrong: str
) -> None:
    (tmp_path / "odd" / "gateway.lock").mkdir(parents=True)
    path = configuration(tmp_path, 0, more.replace("FOLDER", str(tmp_path)), state=state)
    status, out = check(path, capsys, "--log-file", str(tmp_path / log_file))
    assert status == 1
    assert wrong.replace("FOLDER", str(tmp_path)) in out
