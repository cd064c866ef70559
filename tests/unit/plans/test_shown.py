"""Plans as tables and pictures, and lines on maps as plans."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.plan_samples import FLIGHT, document, encoded, structure_scan, waypoint

from anafi_mav import mav_enums
from anafi_mav.errors import PlanError
from anafi_mav.plans import path, plot, table
from anafi_mav.plans.formats import files
from anafi_mav.plans.plan import RELATIVE, Item, Plan, Point
from anafi_mav.plans.shots import ShotKind, shots

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


def test_table_rows_say_items_in_words() -> None:
    rows = list(table.rows_of(FLIGHT))
    assert {"10 s", "to item 2, 3 times", "1 photos", "within 2 m, heading 90°"} <= {row.words for row in rows}
    assert any(row.height == "60 m AMSL" and row.place == "48.8789000, 2.3679000" for row in rows)
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


def test_items_without_own_description_show_their_fields() -> None:
    odd = Plan((Item(4999, 2, (1.5, None, 0.0, 0.0, 7.0, 0.0, 0.0), False), waypoint(0, 0, 5.0, frame=10)))
    first, second = table.rows_of(odd)
    assert first.command == "4999"
    assert first.words == "param1 1.5, param5 7, waits to be continued"
    assert second.height == "5 m above ground"


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


MISSIONS = Path(__file__).parents[3] / "missions"


def test_shots_of_a_survey_are_on_its_lanes() -> None:
    found = shots(files.load(MISSIONS / "survey.plan"))
    assert {kind for kind, _, _ in found.ways} == {ShotKind.PHOTOS}
    assert len(found.ways) == 7  # four lanes and what joins them, not the way there
    assert found.looks == ()


def test_orbit_shows_a_video_and_its_target() -> None:
    """From the way point before the region of interest; the video ends where it began."""
    found = shots(files.load(MISSIONS / "orbit.plan"))
    assert [kind for kind, _, _ in found.ways] == [ShotKind.VIDEO] * 8
    assert found.ways[0][1] == found.ways[-1][2] == (48.8790349, 2.3677)
    assert found.looks == (((48.8790349, 2.3677), (48.8792597, 2.3677)),)
    assert found.photos == ()


def test_inspection_shows_photos_at_their_places() -> None:
    plan = files.load(MISSIONS / "inspection.plan")
    found = shots(plan)
    assert found.ways == ()
    assert set(found.photos) <= {(stop.latitude, stop.longitude) for stop in path.way(plan)}
    assert len(found.photos) == sum(item.command == 2000 for item in plan.items)


def test_profile_of_a_plan_has_climb_and_return() -> None:
    """There and back along a line: 20 m north of home at 30 m, then home."""
    home = Point(48.8789, 2.3677, 35.0)
    items = (
        Item(mav_enums.MAV_CMD_NAV_TAKEOFF, 3, (0.0, 0.0, 0.0, None, home.latitude, home.longitude, 10.0)),
        waypoint(20.0, 0.0, 30.0),
        Item(mav_enums.MAV_CMD_NAV_RETURN_TO_LAUNCH, 2, (0.0,) * 7),
    )
    plan = Plan(items, home)
    flown, back = plot.profile_of(plan, list(path.way(plan)))
    away = flown[-1][0]
    assert flown[:3] == [(0.0, 0.0), (0.0, 10.0), (0.0, 10.0)]
    assert flown[3] == (away, 30.0)
    assert back[0] == back[1] == (away, 30.0)
    assert back[2] == (pytest.approx(2.0 * away), 30.0)
    low = replace(plan, items=(items[0], items[2]))
    # A return climbs to the height that it is set to.
    assert plot.profile_of(low, list(path.way(low)))[1] == [(0.0, 10.0), (0.0, 20.0), (0.0, 20.0)]
    assert plot.profile_of(replace(plan, items=items[:2]), list(path.way(plan)))[1] == []


@pytest.mark.parametrize(
    ("metres", "wanted"), [(17.6, 10.0), (20.0, 20.0), (9.9, 5.0), (1.0, 1.0), (0.0, 0.1), (730.0, 500.0)]
)
def test_scale_bar_has_a_round_length(metres: float, wanted: float) -> None:
    assert plot.round_length(metres) == pytest.approx(wanted)


@pytest.mark.parametrize("name", ["orbit", "inspection", "survey"])
def test_scale_bar_has_the_length_of_its_label(name: str) -> None:
    """Measured where it counts: on the map as it is drawn, after both axes have got one scale."""
    figure = pytest.importorskip("matplotlib.figure", reason="the extra `plots` is not installed").Figure(
        figsize=(8, 9)
    )
    plan = files.load(MISSIONS / f"{name}.plan")
    chart = figure.subplots(2, 1)[0]
    assert plan.home is not None
    plot._map(chart, plan, list(path.way(plan)), (plan.home.latitude, plan.home.longitude))
    importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure).draw()
    (bar,) = (line for line in chart.lines if line.get_gid() == "scale")
    (text,) = (text for text in chart.texts if text.get_text().endswith(" m") and text.get_text()[0].isdigit())
    ends = bar.get_transform().transform(list(zip(*bar.get_data(), strict=True)))
    (left, _), (right, _) = chart.transData.inverted().transform(ends)
    assert right - left == pytest.approx(float(text.get_text().removesuffix(" m")))
    assert chart.get_xlim()[0] <= left < right <= chart.get_xlim()[1]


def test_picture_shows_direction_climb_return_photos_north_and_scale(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    for name, wanted in (
        ("survey", {"return", "photos on the way", "take-off to 25 m", "N", "return, at 20 m or higher"}),
        ("orbit", {"video", "looked at", "return"}),
        ("inspection", {"photo", "home"}),
    ):
        target = tmp_path / f"{name}.svg"
        plot.draw(files.load(MISSIONS / f"{name}.plan"), name, target)
        text = target.read_text()
        assert [words for words in wanted if f"<!-- {words} -->" not in text] == []
        assert 'id="scale"' in text


def test_impossible_pictures_are_refused() -> None:
    with pytest.raises(PlanError, match=r"pictures end in \.png, \.svg, \.pdf"):
        plot.draw(FLIGHT, "x", Path("x.gif"))
    with pytest.raises(PlanError, match="it has no places: nothing to draw"):
        plot.draw(Plan(), "x", Path("x.png"))


@pytest.mark.parametrize("text", [KML, json.dumps(GEOJSON)], ids=["kml", "geojson"])
def test_a_line_on_a_map_is_a_plan(text: str) -> None:
    plan = files.parse(text.encode(), "walk", height=20.0)
    places = ((48.8789, 2.3677), (48.8789, 2.3687), (48.8799, 2.3687))
    assert plan == Plan(
        tuple(Item(mav_enums.MAV_CMD_NAV_WAYPOINT, RELATIVE, (0.0, 0.0, 0.0, None, *place, 20.0)) for place in places)
    )
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
