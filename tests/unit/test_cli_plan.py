"""`anafi-mav plan` with files, as it is called."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from plan_samples import FLIGHT

from anafi_mav.cli import main
from anafi_mav.plans import files
from anafi_mav.plans.files import Format


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


def test_convert_tells_what_is_lost(flight: Path, capsys: pytest.CaptureFixture[str]) -> None:
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
        (["check", "{}"], "--model: expected the drone that is to fly it, one of 4k, thermal, usa, ai"),
        (["check", "{}", "--model", "4k", "--max-altitude", "0"], "--max-altitude: expected metres, above 0 and up to"),
        (["show", "{}", "--height", "nan"], "--height: expected metres above take-off, up to 1000, got 'nan'"),
        (["show", "{}", "--model", "bebop"], "--model: expected one of 4k, thermal, usa, ai, got 'bebop'"),
        (["show", "x.mavlink"], "--model: expected one of 4k, thermal, usa, ai: a .mavlink file does not say"),
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
    assert main(["plan", *(word.format(flight) for word in words)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"anafi-mav: {said}")
    assert error.count("\n") == 1


def test_a_file_that_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", str(tmp_path / "none.plan")]) == 1
    assert capsys.readouterr().err == "anafi-mav: none.plan: No such file or directory\n"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no endless file here")
def test_an_endless_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "show", "/dev/zero"]) == 1
    assert capsys.readouterr().err == "anafi-mav: zero: it is larger than 16 MiB: no flight plan\n"


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
