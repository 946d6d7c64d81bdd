"""ED-269, ED-318 and openAIP: limits, shapes, several volumes, who authorises, and that nothing is left out unnamed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from gcsplan.mission_file.published.times import Hours
from tests.mission_file.published.made import (
    HOLE,
    RING,
    collection,
    ed269,
    ed318,
    limits,
    openaip,
    outcome,
    read,
    remarks,
    said,
    volume,
)
from tests.support.attacks import draw_attacks
from tests.support.paths import DATA

AIRSPACE = DATA / "airspace"
LAYER = {"upper": 150, "upperReference": "AGL", "lower": 50, "lowerReference": "AGL", "uom": "m"}


def of(*zones: Any) -> dict[str, Any]:
    return {"title": "made", "features": list(zones)}


# -- ED-269


def test_an_authorisation_is_named_with_who_gives_it(tmp_path: Path) -> None:
    found = read(tmp_path, of(ed269(restriction="REQ_AUTHORISATION")))
    assert "may be entered with an authorisation" in remarks(found)
    assert "Office a@b.example P3D before" in remarks(found)
    found = read(tmp_path, of(ed269(restriction="CONDITIONAL", restrictionConditions=["below 50 m"])))
    assert "under conditions, which are not judged: they are no-fly: below 50 m" in remarks(found)


@pytest.mark.parametrize(
    ("zone", "words"),
    [
        (ed269(volume(lowerVerticalReference=...)), ""),  # 0 of whatever is the ground
        (ed269(volume(upperVerticalReference=...)), "upperLimit 120 M cannot be read as a level: it has no reference"),
        (ed269(volume(uomDimensions=...)), "upperLimit 120 AGL cannot be read as a level: it has no unit"),
        (ed269(volume(uomDimensions="YD")), "'YD' is not known"),
        (ed269(volume(upperVerticalReference="QNH")), "'QNH' is not known"),
        (ed269(volume(upperLimit="high")), "upperLimit high M AGL cannot be read as a level: 'HIGH' is not known"),
        (ed269(volume(upperLimit=0)), "the zone would lie wholly under ground"),
        (ed269(volume(lowerLimit=200)), "the floor must be below the ceiling"),
        (ed269(volume(horizontalProjection={"type": "Circle", "center": [8, 47]})), "a Circle has a radius in metres"),
        (ed269(volume(horizontalProjection={"type": "Circle", "center": [8, 47], "radius": -1})), "above 0"),
        (ed269(volume(horizontalProjection={"type": "Line"})), "must be a Polygon or a Circle, given 'Line'"),
        (ed269(volume(horizontalProjection={"type": "Polygon", "coordinates": [[[47, 98], [1, 2]]]})), "look swapped"),
        (ed269(volume(horizontalProjection={"type": "Polygon", "coordinates": [[[8, 47], [8, 48]]]})), "at least 3"),
        (ed269({"uomDimensions": "M"}), "a volume has a horizontalProjection"),
        (ed269(restriction=None), "zone 'Made zone': restriction must be text, given None"),
        (ed269(geometry=[]), "geometry must be a list of volumes"),
        (7, "features[1]: must be an object, given 7"),
    ],
)
def test_what_ed269_cannot_say_is_named_with_its_feature(tmp_path: Path, zone: Any, words: str) -> None:
    found = said(tmp_path, of(ed269(), zone))
    assert (words in found and "features[1]" in found) if words else not found


def test_ed269_of_interuss_is_read_with_its_times(tmp_path: Path) -> None:
    found = read(tmp_path, (AIRSPACE / "ed269_interuss.json").read_bytes(), hours=Hours.read("2026-11-28"))
    assert not found.problems
    assert not any(z.faults for z in found.zones)
    assert [(z.name, *limits(z)) for z in found.zones if not z.unused] == [
        ("Lausanne Airport/1", "ground", "120 m AGL"),
        ("Lausanne Airport/2", "30 m AGL", "120 m AGL"),
        ("Lausanne Airport/3", "60 m AGL", "120 m AGL"),
        ("Lake Geneva Wildlife Preserve", "ground", "120 m AGL"),
        ("Gantrisch Nature Park", "ground", "76.2 m AGL"),
    ]  # the circles ended in 2023, and one Gantrisch restricts nothing
    always = read(tmp_path, (AIRSPACE / "ed269_interuss.json").read_bytes()).zones
    assert [z.radius_m for z in always if not z.unused][:4] == [3000.0, 1000.0, 2500.0, 3500.0]


def test_ed269_in_the_form_of_its_first_version(tmp_path: Path) -> None:
    found = read(tmp_path, (AIRSPACE / "ed269_zone_list.json").read_bytes())
    assert [(z.name, *limits(z)) for z in found.zones] == [("LSXX City Sample", "ground", "unlimited")]
    assert "UASZoneList[0]" in said(tmp_path, {"UASZoneList": [ed269(volume(lowerLimit="1e3"))]})
    assert limits(read(tmp_path, of(ed269(volume(lowerLimit="30.5")))).zones[0]) == ("30.5 m AGL", "120 m AGL")


# -- ED-318


def test_the_swiss_sample_is_read(tmp_path: Path) -> None:
    found = read(tmp_path, (AIRSPACE / "ed318_switzerland.json").read_bytes())
    assert not found.problems
    assert not any(z.faults for z in found.zones)
    assert [(z.name, *limits(z)) for z in found.zones] == [
        ("LSZB Bern-Belp 2", "60 m AGL", "unlimited"),
        ("Protected natural object Langmatt", "ground", "unlimited"),
        ("LSTB Bellechasse (Airport perimeter)", "ground", "unlimited"),
    ]
    assert "Skyguide Special Flight Office" in remarks(found)


EVERY_DAY = {"day": "ANY", "startTime": "", "startEvent": "", "endTime": "", "endEvent": ""}
GROUPED = {
    "UASZone": {
        "identifier": "MADE1", "country": "ESP", "name": "", "type": "REQ_AUTHORIZATION", "variant": "COMMON",
        "restrictionConditions": "", "reasons": "AIR_TRAFFIC",
    },
    "limitedApplicability": [{"startDateTime": "", "endDateTime": "", "schedule": [EVERY_DAY]}],
    "zoneAuthority": [{"purpose": "AUTHORIZATION", "intervalBefore": 0, "name": "", "email": "made@a.example"}],
    "verticalLayer": {"upper": 900, "upperReference": "AGL", "lower": 45, "lowerReference": "AGL", "UOM": ""},
}  # fmt: skip
IN_ONE_TABLE = EVERY_DAY | {
    "identifier": "MADE1", "country": "ESP", "name": "", "type": "REQ_AUTHORIZATION", "variant": "COMMON",
    "purpose": "AUTHORIZATION", "name_authority": "", "email": "made@a.example", "phone": "",
    "upper": 900, "upperReference": "AGL", "lower": 45, "lowerReference": "AGL", "uom": "M",
    "startDateTime": "2026-01-01T00:00:00Z", "endDateTime": "",
}  # fmt: skip


@pytest.mark.parametrize("properties", [GROUPED, IN_ONE_TABLE])
@pytest.mark.parametrize("alone", [False, True])
def test_ed318_as_spain_lays_it_out(tmp_path: Path, properties: dict[str, Any], *, alone: bool) -> None:
    feature = {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [RING]}}
    found = read(tmp_path, feature if alone else {"type": "FeatureCollection", "features": [feature]})
    assert not found.problems
    assert [(z.name, *limits(z)) for z in found.zones] == [("MADE1", "45 m AGL", "900 m AGL")]
    assert "made@a.example" in remarks(found)
    assert "not understood" not in remarks(found)


def test_the_times_of_one_table_are_read(tmp_path: Path) -> None:
    def zones(on: str, **changes: Any) -> int:
        properties = IN_ONE_TABLE | changes
        feature = {"type": "Feature", "properties": properties, "geometry": {"type": "Polygon", "coordinates": [RING]}}
        return sum(not z.unused for z in read(tmp_path, feature, hours=Hours.read(on)).zones)

    assert (zones("2025-12-31"), zones("2025-12-30"), zones("2026-06-01")) == (1, 0, 1)
    assert (zones("2026-06-02", day="SUN"), zones("2026-06-02", day="TUE")) == (0, 1)  # a Tuesday
    assert zones("2026-06-02", day="SUN", startEvent="BMCT") == 1  # the sun is not computed


def test_the_standard_s_own_sample_is_read(tmp_path: Path) -> None:
    found = read(tmp_path, (AIRSPACE / "ed318_collection.json").read_bytes())
    assert not found.problems
    assert not any(z.faults for z in found.zones)
    assert [(z.name, limits(z), z.radius_m) for z in found.zones] == [
        ("LFPG-2/1", ("50 m AGL", "150 m AGL"), None),
        ("LFPG-2/2", ("ground", "50 m AGL"), None),
        ("Fictitious circle", ("50 m AGL", "150 m AGL"), 3500.0),
    ]
    assert "LFPG-UASZoneManager" in remarks(found)


def test_ed318_layers_collections_and_units(tmp_path: Path) -> None:
    shape = {"type": "Polygon", "coordinates": [RING]}
    feet = LAYER | {"uom": "ft", "upper": 1500, "upperReference": "AMSL", "lower": 0}
    found = read(tmp_path, collection(
        ed318({"type": "GeometryCollection", "layer": feet, "geometries": [shape, shape | {"layer": LAYER}]}),
        ed318({"type": "MultiPolygon", "coordinates": [[RING, HOLE], [RING]]}),
    ))  # fmt: skip
    assert not found.problems
    assert [limits(z) for z in found.zones] == [
        ("ground", "457.2 m AMSL"), ("50 m AGL", "150 m AGL"), ("ground", "unlimited"), ("ground", "unlimited"),
    ]  # fmt: skip
    assert [z.name for z in found.zones] == ["Made/1", "Made/2", "Made/1", "Made/2"]


@pytest.mark.parametrize(
    ("feature", "words"),
    [
        (ed318({"type": "Point", "coordinates": [8, 47]}), "a Point has an extent with subType Circle and radius"),
        (ed318({"type": "LineString", "coordinates": RING}), "must be a Polygon, a MultiPolygon or a Point"),
        (ed318({"type": "GeometryCollection", "geometries": []}), "a GeometryCollection has geometries"),
        (ed318({"type": "Polygon", "coordinates": 5}), "a polygon is a list of rings"),
        (ed318(layer=LAYER | {"upperReference": "QNE"}), "upper 150 m QNE cannot be read as a level"),
        (ed318(layer=[1]), "layer must be an object"),
        (ed318(7), "the zone has no geometry, given 7"),
        (ed318(type=""), "type must be text"),
        ({"type": "Feature"}, "must be a Feature with properties"),
    ],
)
def test_what_ed318_cannot_say_is_named_with_its_feature(tmp_path: Path, feature: Any, words: str) -> None:
    found = said(tmp_path, collection(ed318(), feature))
    assert words in found
    assert "features[1]" in found


# -- openAIP


@pytest.mark.parametrize("wrap", [lambda a: {"items": a, "totalPages": 1}, lambda a: a, lambda a: collection(
    *({"type": "Feature", "properties": {k: v for k, v in one.items() if k != "geometry"}, "geometry": one["geometry"]}
      for one in a))])  # fmt: skip
def test_openaip_is_read_in_its_three_wrappings(tmp_path: Path, wrap: Any) -> None:
    level = {"value": 95, "unit": 6, "referenceDatum": 2}
    metres = {"value": 120, "unit": 0, "referenceDatum": 0}
    ones = [openaip(), openaip(upperLimit=level), openaip(lowerLimit=metres), openaip(type=10, icaoClass=8)]
    found = read(tmp_path, wrap(ones), flight_level_error_m=100.0)
    assert not found.problems
    assert [limits(z) for z in found.zones[:3]] == [
        ("ground", "1066.8 m AMSL"), ("ground", "2995.6 m AMSL"), ("120 m AGL", "1066.8 m AMSL"),
    ]  # fmt: skip
    assert [bool(z.unused) for z in found.zones] == [False, False, False, True]  # an information region


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"upperLimit": {"value": 100, "unit": 9, "referenceDatum": 1}}, "cannot be read as a level"),
        (
            {"upperLimit": {"value": "x", "unit": 1, "referenceDatum": 1}},
            "upperLimit x FT MSL cannot be read as a level: 'X' is not known",
        ),
        ({"type": 99}, "type must be one of openAIP's numbers, given 99"),
        ({"icaoClass": 7}, "icaoClass must be one of openAIP's numbers, given 7"),
        ({"geometry": {"type": "Point", "coordinates": [8, 47]}}, "the geometry must be a Polygon, given 'Point'"),
    ],
)
def test_what_openaip_cannot_say_is_named(tmp_path: Path, changes: Any, words: str) -> None:
    assert words in said(tmp_path, [openaip(), openaip(**changes)])


def test_a_page_of_several_is_refused(tmp_path: Path) -> None:
    words = said(tmp_path, {"items": [openaip()], "page": 1, "totalPages": 3})
    assert "the file is page 1 of 3" in words


def test_limits_that_move_and_hours_of_a_week_make_no_zone_smaller(tmp_path: Path) -> None:
    low = {"value": 500, "unit": 1, "referenceDatum": 0}
    hours = {"operatingHours": [{"dayOfWeek": 0, "startTime": "08:00", "endTime": "16:00"}]}
    found = read(tmp_path, [openaip(lowerLimit=low, lowerLimitMin=low, hoursOfOperation=hours)])
    assert limits(found.zones[0])[0] == "ground"
    assert "limits of these zones move" in remarks(found)
    assert "hours of operation are not read" in remarks(found)


# -- attacks


@pytest.mark.parametrize(
    "content",
    [
        {"features": [{"geometry": [{"horizontalProjection": None}]}]},
        {"items": [openaip(), None, [], {"geometry": 5}]},
        collection(ed318(), None),
        [ed269(), None],
        "[" * 100_000,
        b"\xff\xfe",
    ],
)
def test_broken_files_end_in_a_message(tmp_path: Path, content: Any) -> None:
    assert "zones.json" in said(tmp_path, content)
    assert outcome(tmp_path, content) == "refused"


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats() | st.text(max_size=8)
    | st.sampled_from([RING, "YES", "2026-01-01T00:00Z", "MON", "Polygon", "Circle", "AMSL", "WGS84", "FT", "FL"]),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.sampled_from(["type", "coordinates", "radius", "value", "unit", "day"]), inner, max_size=4),
    max_leaves=8,
)  # fmt: skip
SAMPLES = [
    of(ed269(volume(), applicability=[{"permanent": "NO", "schedule": [{"day": ["MON"], "startTime": "06:00Z"}]}])),
    collection(ed318(), ed318({"type": "Point", "coordinates": [8, 47], "extent": {"subType": "Circle", "radius": 9}})),
    {"items": [openaip(hoursOfOperation={"operatingHours": []}, activeFrom="2026-01-01T00:00Z")]},
]


def spoilt(draw: Any, value: Any) -> Any:
    """A copy with one random member of it replaced by junk."""
    if isinstance(value, dict | list) and value and draw(st.integers(0, 5)):
        copy: Any = value.copy()
        key = draw(st.sampled_from(sorted(copy) if isinstance(copy, dict) else range(len(copy))))
        copy[key] = spoilt(draw, copy[key])
        return copy
    return draw(JUNK)


@pytest.mark.nightly
@pytest.mark.draws
def test_a_spoilt_file_gives_its_zones_or_words_of_what_is_wrong(tmp_path: Path) -> None:
    def attack(data: st.DataObject) -> str:
        value = data.draw(st.sampled_from(SAMPLES))
        for _ in range(data.draw(st.integers(1, 3))):
            value = spoilt(data.draw, value)
        return outcome(tmp_path, json.dumps(value).encode("utf-8", "surrogatepass"))

    assert draw_attacks(240, attack) == {"zones", "refused"}
