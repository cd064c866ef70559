"""`anafi-mav plan` with files, as it is called."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.plan_samples import FLIGHT

from anafi_mav.cli import main
from anafi_mav.cli.terminal import say_table
from anafi_mav.plans.formats import files
from anafi_mav.plans.formats.files import Format

MISSIONS = Path(__file__).parents[3] / "missions"


@pytest.fixture
def flight(tmp_path: Path) -> Path:
    files.save(FLIGHT, tmp_path / "flight.plan", Format.QGC)
    return tmp_path / "flight.plan"


def test_show(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", str(flight)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("flight.plan: 12 items, home ")
    assert lines[1].split() == ["item", "command", "latitude,", "longitude", "height", "leg"]
    assert len(lines) == 2 + 12


def test_show_in_a_pipe_prints_aligned_lines(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", str(flight)]) == 0
    head, *rows = capsys.readouterr().out.splitlines()[1:]
    place = head.index("latitude")
    assert all(row[place - 2 : place].isspace() and row == row.rstrip() for row in rows if len(row) > place)
    assert rows[1].startswith("   1  DO_")
    assert any(len(row) > 80 for row in rows)  # the width of a terminal that is not there


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("columns", [30, 60, 200])
def test_show_on_a_terminal_folds_the_last_column_only(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    """A terminal narrower than the other columns wraps lines by itself; no character is cut off."""
    screen = _Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("LINES", "25")  # rich takes a dumb terminal for one of 80 columns unless both are set
    monkeypatch.setenv("TERM", "dumb")
    say_table(
        ("a", "number", "words"), [("48.8789000, 2.3677000", "12", "word " * 20), ("\x1b[2J", "7", "")], right=(1,)
    )
    text = re.sub(r"\x1b\[[0-9;]*m", "", screen.getvalue())
    lines = text.splitlines()
    assert lines[1].startswith("48.8789000, 2.3677000      12  word word")
    assert text.count("word") - text.count("words") == 20
    assert r"\x1b[2J" in lines[-1]
    assert max(map(len, lines)) <= max(columns, 21 + 2 + 6 + 2 + 24 + 2)


def test_convert_lists_losses(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = flight.with_suffix(".waypoints")
    assert main(["plan", "convert", str(flight), str(out)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "not kept: the fence of 2 zones: a file of its own would hold it" in said
    assert said[-1].startswith("flight.waypoints: 12 items, home ")
    assert files.load(out).items == FLIGHT.items
    assert main(["plan", "convert", str(out), str(flight.with_name("again.plan"))]) == 0
    assert files.load(flight.with_name("again.plan")).items == FLIGHT.items


def test_a_line_becomes_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line, out = tmp_path / "walk.geojson", tmp_path / "walk.plan"
    line.write_text('{"type": "LineString", "coordinates": [[2.3677, 48.8789], [2.3687, 48.8789]]}')
    assert main(["plan", "convert", str(line), str(out)]) == 1
    assert not out.exists()
    assert "a height above take-off has to be said" in capsys.readouterr().err
    assert main(["plan", "convert", str(line), str(out), "--height", "20"]) == 0
    assert [item.params[6] for item in files.load(out).items] == [20.0, 20.0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["show", "{}", "--height", "0"], "--height: expected metres above take-off, up to 1000, got 0"),
        (["check", "{}", "--model", "4k", "--max-altitude", "0"], "--max-altitude: expected metres, above 0 and up to"),
        (["show", "{}", "--height", "nan"], "--height: expected metres above take-off, up to 1000, got 'nan'"),
        (["show", "{}", "--model", "bebop"], "--model: expected one of 4k, thermal, usa, ai, got 'bebop'"),
        (["show", "{}.mavlink"], "--model: expected one of 4k, thermal, usa, ai: a .mavlink file does not say"),
        (["convert", "{}", "x.mavlink"], "--model: expected one of 4k, thermal, usa, ai, for a .mavlink file"),
        (
            ["convert", "{}", "x.gpx"],
            "OUT: expected a file that ends in one of .plan, .waypoints, .txt",
        ),
    ],
)
def test_wrong_options_are_one_line(
    flight: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    flight.with_name("flight.plan.mavlink").write_bytes(flight.read_bytes())
    assert main(["plan", *(word.format(flight) for word in words)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"anafi-mav: {said}")
    assert error.count("\n") == 1


def test_missing_plan_file_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", str(tmp_path / "none.plan")]) == 1
    assert capsys.readouterr().err == "anafi-mav: none.plan: No such file or directory\n"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no endless file here")
def test_an_endless_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", "/dev/zero"]) == 1
    assert capsys.readouterr().err == "anafi-mav: zero: expected a file, got a device\n"


def test_plot(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    picture = flight.with_suffix(".svg")
    assert main(["plan", "plot", str(flight), "-o", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    assert capsys.readouterr().out == f"drawn {picture}\n"
    first = picture.read_bytes()
    assert main(["plan", "plot", str(flight), "-o", str(flight.with_suffix(".gif"))]) == 1
    assert "pictures end in" in capsys.readouterr().err
    assert first == picture.read_bytes()


def test_plot_without_matplotlib(
    flight: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["plan", "plot", str(flight), "-o", "x.png"]) == 2
    said = capsys.readouterr().err
    assert said == "anafi-mav: plot: expected matplotlib to be installed: pip install 'anafi-mav[plots]'\n"


def test_check_knows_how_the_drone_is_set(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "check", str(flight), "--model", "4k"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("flight.plan: an ANAFI 4K flies it, ")
    assert main(["plan", "check", str(flight), "--model", "4k", "--max-altitude", "22"]) == 1
    assert (
        capsys.readouterr().out.splitlines()[-1]
        == "flight.plan: error: item 8: 25 m above take-off is higher than the limit of 22 m"
    )
    assert main(["plan", "check", str(flight), "--model", "4k", "--max-distance", "15"]) == 1
    assert "flight.plan: error: item 5: " in capsys.readouterr().out


# Without --model.


def test_check_without_a_model_is_for_all(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "check", str(flight)]) == 0
    last = capsys.readouterr().out.splitlines()[-4:]
    assert [line.split(" flies it")[0] for line in last] == [
        f"flight.plan: an ANAFI {model}" for model in ("4K", "Thermal", "USA", "Ai")
    ]
    assert main(["plan", "check", str(flight), "--max-altitude", "22"]) == 1
    # What all have is said once.
    error = "flight.plan: error: item 8: 25 m above take-off is higher than the limit of 22 m"
    assert capsys.readouterr().out.splitlines().count(error) == 1


def test_check_without_a_model_names_models_with_problems(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "check", str(MISSIONS / "inspection.plan")]) == 0
    said = capsys.readouterr().out
    assert "inspection.plan: ANAFI Ai: warning: item 0: an Ai begins at 20 m" in said
    assert "inspection.plan: warning: item 8: flown by the gateway" in said


def test_check_for_a_fleet_covers_its_models(flight: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fleet = tmp_path / "fleet.yaml"
    fleet.write_text("drones: [{name: a, sysid: 1, sim: {model: ai}}, {name: b, sysid: 2, sim: {model: usa}}]")
    assert main(["plan", "check", str(flight), "-c", str(fleet)]) == 0
    flies = [line.split(" flies it")[0] for line in capsys.readouterr().out.splitlines() if "flies it" in line]
    assert flies == ["flight.plan: an ANAFI USA", "flight.plan: an ANAFI Ai"]
    fleet.write_text("drones: [{name: a, sysid: 1, address: 192.168.42.1}]")  # whose model no one knows
    assert main(["plan", "check", str(flight), "-c", str(fleet)]) == 0
    assert capsys.readouterr().out.count(" flies it") == 4


def test_check_of_parrot_file_covers_models_reading_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["plan", "check", str(MISSIONS / "loop.v1.mavlink")]) == 0
    capsys.readouterr()
    assert main(["plan", "check", str(MISSIONS / "orbit.v2.mavlink")]) == 0
    assert "an ANAFI Ai flies it" in capsys.readouterr().out


def test_check_and_show_as_json(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "check", str(flight), "--json", "--max-altitude", "22"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["file"] == "flight.plan"
    assert set(found["models"]) == {"ANAFI 4K", "ANAFI Thermal", "ANAFI USA", "ANAFI Ai"}
    assert found["models"]["ANAFI 4K"]["flies"] is False
    assert {"severity": "error", "item": 8, "what": "25 m above take-off is higher than the limit of 22 m"} in found[
        "models"
    ]["ANAFI 4K"]["problems"]
    assert main(["plan", "show", str(flight), "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [(item["item"], item["command"]) for item in shown["items"]] == [
        (number, item.command) for number, item in enumerate(FLIGHT.items)
    ]
    assert shown["items"][0]["name"] == "NAV_TAKEOFF"
    assert {zone["kind"] for zone in shown["fence"]} == {"circle", "polygon"}
    assert FLIGHT.home is not None
    assert shown["home"]["latitude"] == FLIGHT.home.latitude


# Files.


@pytest.mark.parametrize(
    "words",
    [
        ["show", "none.mavlink"],
        ["check", "none.mavlink"],
        ["check", "none.plan", "--model", "bebop"],
        ["convert", "none.plan", "x.gpx"],
        ["convert", "none.plan", "x.mavlink"],
        ["plot", "none.plan"],
        ["upload", "none.plan", "--sysid", "x"],
        ["fly", "none.plan", "--sysid", "0"],
    ],
    ids=" ".join,
)
def test_absent_file_is_reported_before_a_missing_option(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", *words]) == 1
    assert capsys.readouterr().err == f"anafi-mav: {words[1]}: No such file or directory\n"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize("action", ["show", "check", "upload"])
def test_pipe_is_refused_and_not_waited_for(tmp_path: Path, action: str, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "pipe.plan")
    assert main(["plan", action, str(tmp_path / "pipe.plan")]) == 1
    assert capsys.readouterr().err == "anafi-mav: pipe.plan: expected a file, got a pipe\n"


def test_convert_replaces_a_file_only_with_force(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = flight.with_suffix(".waypoints")
    out.write_text("the old one")
    assert main(["plan", "convert", str(flight), str(out)]) == 2
    assert capsys.readouterr().err == f"anafi-mav: OUT: {out} exists: --force replaces it\n"
    assert out.read_text() == "the old one"
    assert main(["plan", "convert", str(flight), str(out), "--force"]) == 0
    assert files.load(out).items == FLIGHT.items
    folder = flight.with_name("folder.plan")
    folder.mkdir()
    assert main(["plan", "convert", str(flight), str(folder)]) == 2
    assert "OUT: expected the name of a file, got" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="opens a terminal by os.openpty, which Windows does not have")
@pytest.mark.parametrize(("answer", "status"), [(b"y\n", 0), (b"no\n", 2)])
def test_convert_at_a_terminal_asks(flight: Path, answer: bytes, status: int) -> None:
    out = flight.with_suffix(".waypoints")
    out.write_text("the old one")
    parent, child = os.openpty()
    command = (sys.executable, "-m", "anafi_mav", "plan", "convert", str(flight), str(out))
    with subprocess.Popen(command, stdin=child, stdout=subprocess.DEVNULL, stderr=child) as process:
        os.close(child)
        question = b""
        while b"[y/N]" not in question:
            question += os.read(parent, 1000)
        assert b"exists. Replace it?" in question
        os.write(parent, answer)
        assert process.wait(60.0) == status
    os.close(parent)
    assert (out.read_text() == "the old one") is (status == 2)


def test_plan_with_a_key_twice_is_refused(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = flight.read_text()
    flight.write_text(text.replace('"command": 22,', '"command": 22, "command": 21,', 1))
    assert text != flight.read_text()
    assert main(["plan", "show", str(flight)]) == 1
    said = capsys.readouterr().err
    assert said == "anafi-mav: flight.plan: no JSON: the key 'command' stands twice in one object\n"
