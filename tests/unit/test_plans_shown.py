"""Plans as tables and pictures, and lines on maps as plans."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from plan_samples import FLIGHT, document, encoded, structure_scan, waypoint

from anafi_mav.errors import PlanError
from anafi_mav.plans import files, path, plot, table
from anafi_mav.plans.plan import RELATIVE, Item, Plan

LINE = [[2.3677, 48.8789], [2.3687, 48.8789, 120.0], [2.3687, 48.8799]]
KML = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>walk</name><Placemark><LineString>
<altitudeMode>clampToGround</altitudeMode>
<coordinates>
  2.3677,48.8789,0 2.3687,48.8789,120
  2.3687,48.8799
</coordinates></LineString></Placemark></Document></kml>
"""
GEOJSON: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [2.3, 48.8]}},
        {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": LINE}},
    ],
}


def test_a_table_says_items_in_words() -> None:
    rows = [line.split("  ") for line in table.lines(FLIGHT)]
    words = {row[-1].strip() for row in rows}
    assert {"10 s", "to item 2, 3 times", "1 photos", "within 2 m, heading 90°"} <= words
    assert any("60 m AMSL" in line and "48.8789000, 2.3679000" in line for line in table.lines(FLIGHT))
    said = table.summary(FLIGHT)
    assert said.startswith("12 items, home 48.8789000, 2.3677000 at 35 m AMSL, 37 m from the first place to the last")
    # The last waypoint is at 60 m above the sea, and home at 35.
    assert "up to 25 m high, a fence of 2 zones, 2 rally points" in said
    assert "items 0 to 17 are a StructureScan" in table.summary(files.parse(encoded(document(structure_scan())), "x"))


def test_the_way_of_a_plan() -> None:
    """0.0001 degrees of latitude are 11.12 m, 0.0002 of longitude 14.67 m."""
    stops = list(path.way(FLIGHT))
    assert [(stop.item, stop.height) for stop in stops] == [(0, 15.0), (2, 20.0), (5, 25.0), (8, 25.0)]
    assert path.length(stops) == pytest.approx(11.12 + 14.67 + 11.12, abs=0.02)
    unknown = list(path.way(replace(FLIGHT, home=None)))
    assert unknown[-1].height is None
    assert table.summary(Plan()) == "0 items"


def test_items_without_words_of_their_own() -> None:
    odd = Plan((Item(4999, 2, (1.5, None, 0.0, 0.0, 7.0, 0.0, 0.0), False), waypoint(0, 0, 5.0, frame=10)))
    lines = list(table.lines(odd))
    assert "4999" in lines[1]
    assert lines[1].endswith("param1 1.5, param5 7, waits to be continued")
    assert "5 m above ground" in lines[2]


@pytest.mark.parametrize("suffix", plot.SUFFIXES)
def test_a_picture(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    target = tmp_path / f"plan{suffix}"
    plot.draw(FLIGHT, "flight", target)
    head = target.read_bytes()[:200]
    assert head.startswith({".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix])
    if suffix == ".svg":
        text = target.read_text()
        assert text.count("<!-- stay inside -->") == 1
        assert "<!-- height above take-off -->" in text


def test_pictures_that_cannot_be() -> None:
    with pytest.raises(PlanError, match=r"pictures end in \.png, \.svg, \.pdf"):
        plot.draw(FLIGHT, "x", Path("x.gif"))
    with pytest.raises(PlanError, match="it has no places: nothing to draw"):
        plot.draw(Plan(), "x", Path("x.png"))


@pytest.mark.parametrize("text", [KML, json.dumps(GEOJSON)], ids=["kml", "geojson"])
def test_a_line_on_a_map_is_a_plan(text: str) -> None:
    plan = files.parse(text.encode(), "walk", height=20.0)
    places = ((48.8789, 2.3677), (48.8789, 2.3687), (48.8799, 2.3687))
    assert plan == Plan(tuple(Item(16, RELATIVE, (0.0, 0.0, 0.0, None, *place, 20.0)) for place in places))
    with pytest.raises(PlanError, match=r"^walk: it is a line on a map: a height above take-off has to be said for it"):
        files.parse(text.encode(), "walk")


BOMB = '<?xml version="1.0"?><!DOCTYPE k [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><kml>&b;</kml>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<kml><Document/></kml>", "it has no lines, expected one"),
        (KML.replace("</Document>", "<LineString/></Document>"), "2 lines"),
        ("<kml><LineString></kml>", "no KML: mismatched tag"),
        ("<?xml version='1.0' encoding='x-none'?><kml/>", "no KML"),
        (BOMB, "it declares a document type: no KML"),
        ("<kml>" * 100_000, "no KML"),
        (KML.replace("48.8799", "148.8799"), "point 2 of its line is no place"),
        (KML.replace(",48.8799", ""), "point 2 of its line is no place"),
        (json.dumps({"type": "LineString", "coordinates": []}), "its line has 0 points"),
        (json.dumps({"type": "LineString", "coordinates": [[1, "x"]]}), "point 0 of its line is no place"),
        (json.dumps({"type": "LineString", "coordinates": [[float("1e400"), 1]]}), "no JSON"),
        (json.dumps({"type": "LineString"}), "no GeoJSON that can be read"),
        (json.dumps({"type": "LineString", "coordinates": 5}), "no GeoJSON that can be read"),
        (json.dumps({"type": "GeometryCollection", "geometries": [7, None]}), "it has no lines"),
        (json.dumps({"type": "FeatureCollection", "features": 5}), "no GeoJSON that can be read"),
    ],
)  # fmt: skip
def test_wrong_lines(text: str, words: str) -> None:
    with pytest.raises(PlanError) as info:
        files.parse(text.encode(), "walk", height=20.0)
    assert str(info.value).startswith("walk: ")
    assert words in str(info.value)
