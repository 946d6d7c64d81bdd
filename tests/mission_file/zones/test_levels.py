"""Floors and ceilings as other programs write them: one meaning for every spelling, and never a smaller zone."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.export.kml import write_kml
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.attributes import BOUNDS, NAME_ATTRIBUTES, REFERENCE_NAMES, UNIT_NAMES
from gcsplan.mission_file.zones.draft import SHOWN_ZONES, ZoneDraft, place_zones, zone_notes
from gcsplan.mission_file.zones.file import ZoneFile
from gcsplan.mission_file.zones.levels import LevelError, Limit, read_level
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.effort import draws
from tests.support.paths import REPOSITORY

FRAME = Frame(36.6, -84.3)
RING = [[-84.31, 36.59], [-84.29, 36.59], [-84.29, 36.61], [-84.31, 36.61], [-84.31, 36.59]]
UNITS_M = {"M": Fraction(1), "metres": Fraction(1), "FT": Fraction(3048, 10000), "feet": Fraction(3048, 10000)}
ABOVE_SEA = ("AMSL", "MSL", "asl")
ABOVE_GROUND = ("AGL", "GND", "SFC", "asfc")


def features(*properties: dict[str, Any], **more: Any) -> str:
    polygon = {"type": "Polygon", "coordinates": [RING], **more}
    return json.dumps(
        {
            "type": "FeatureCollection",
            "features": [{"type": "Feature", "properties": p, "geometry": polygon} for p in properties],
        }
    )


def placemark(data: dict[str, Any], drawing: str = "", up: str = "") -> str:
    ring = " ".join(f"{lon},{lat}{up}" for lon, lat in RING)
    extended = "".join(
        f"<Data name={quoteattr(k)}><value>{escape(str(v))}</value></Data>" for k, v in data.items() if k != "name"
    )
    return (
        f"<kml><Placemark><name>{escape(str(data.get('name', '')))}</name><ExtendedData>{extended}</ExtendedData>"
        f"<Polygon>{drawing}<outerBoundaryIs><LinearRing><coordinates>{ring}</coordinates></LinearRing>"
        "</outerBoundaryIs></Polygon></Placemark></kml>"
    )


def read(folder: Path, text: str, name: str = "air.geojson") -> ZoneFile:
    (folder / name).write_text(text, encoding="utf-8")
    return read_zones(folder / name, where="m")


def zone(folder: Path, properties: dict[str, Any], **more: Any) -> ZoneDraft:
    found = read(folder, features(properties, **more))
    assert found.problems == []
    (draft,) = found.zones
    return draft


def limits(draft: ZoneDraft) -> tuple[str, str]:
    return str(draft.floor or "ground"), str(draft.ceiling or "unlimited")


def notes(found: ZoneFile) -> str:
    assert found.problems == []
    return "\n".join(map(str, zone_notes(place_zones(found.zones, FRAME)[0])))


# -- one level ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "level"),
    [
        ("1500 FT AMSL", Level(457.2, "amsl")),
        ("1500ft msl", Level(457.2, "amsl")),
        ("AMSL 1500 Feet", Level(457.2, "amsl")),
        ("1500' ASL", Level(457.2, "amsl")),
        ("10,000 FT MSL", Level(3048.0, "amsl")),
        ("457.2 M AMSL", Level(457.2, "amsl")),
        ("0.500 M AMSL", Level(0.5, "amsl")),
        ("450M AGL", Level(450.0, "agl")),
        ("450 m GND", Level(450.0, "agl")),
        ("500 FT SFC", Level(152.4, "agl")),
        ("0 FT AGL", Level(0.0, "agl")),
        ("0 AMSL", Level(0.0, "amsl")),
        ("0", Level(0.0, "agl")),
        ("GND", Level(0.0, "agl")),
        (" sfc ", Level(0.0, "agl")),
        ("UNL", Limit.UNLIMITED),
        ("Unlimited", Limit.UNLIMITED),
        ("FL 65", Limit.PRESSURE),
        ("fl065", Limit.PRESSURE),
        ("6500 FT STD", Limit.PRESSURE),
        ("65 FL STD", Limit.PRESSURE),
    ],
)
def test_a_level_is_read_as_it_is_written(text: str, level: Level | Limit) -> None:
    assert read_level(text) == level


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("1500", "no unit and no reference"),
        ("1500 FT", "no reference"),
        ("1500 AMSL", "no unit"),
        ("FT AMSL", "no number"),
        ("AGL", "no number"),
        ("MSL", "no number"),
        ("1500 FT AMSL (457 M)", "'(' is not known"),
        ("1500 FT 457 M AMSL", "several numbers"),
        ("1500 FT M AMSL", "two units"),
        ("1500 FT AMSL AGL", "two references"),
        ("FL 65 AGL", "pressure altitude, not one above ground"),
        ("FL 65 FT", "two units"),
        ("UNL 1500 FT", "unlimited and has a limit"),
        ("UNL GND", "unlimited and has a limit"),
        ("1.500 FT AMSL", "thousands"),
        ("1.500", "thousands"),
        ("1,500 M AMSL", "thousands"),
        ("0,500 FT AMSL", "thousands"),
        ("1,5 M AMSL", "',' is not known"),
        ("1500 FT WGS84", "'WGS' is not known"),
        ("1500 FT QNH", "'QNH' is not known"),
        ("FL 65 or 1500 ft AGL", "'OR' is not known"),
        ("by NOTAM", "'BY' is not known"),
        ("", "no number"),
        ("\u0661\u0665 FT AMSL", "is not known"),
        ("1e9 M AMSL", "more than"),
        ("1e99 M AMSL", "more than"),
        ("9" * 60 + " M AMSL", "too long"),
    ],
)
def test_a_level_is_never_guessed(text: str, why: str) -> None:
    with pytest.raises(LevelError, match=re.escape(why)):
        read_level(text)


SOUP = st.lists(
    st.sampled_from(
        ["1500", "120.5", "0", "-3", "65", *UNITS_M, *ABOVE_SEA, *ABOVE_GROUND, "FL", "STD", "UNL", "TO", "1.500"]
    ),
    max_size=5,
)


@pytest.mark.slow
@settings(max_examples=draws(400))
@given(SOUP, st.sampled_from([" ", "  ", "\t"]), st.booleans())
def test_words_that_leave_a_choice_are_no_level(words: list[str], gap: str, lower: bool) -> None:
    """The oracle reads words one by one: a level of metres has one number, one unit, one reference, nothing else."""
    text = gap.join(words)
    try:
        level = read_level(text.lower() if lower else text)
    except LevelError:
        return
    numbers = [w for w in words if re.fullmatch(r"-?[\d.]+", w)]
    units = {UNITS_M[w] for w in words if w in UNITS_M}
    references = {"amsl" if w in ABOVE_SEA else "agl" for w in words if w in (*ABOVE_SEA, *ABOVE_GROUND)}
    assert "TO" not in words
    if level is Limit.UNLIMITED:
        assert numbers == []
        assert "UNL" in words
    elif level is Limit.PRESSURE:
        assert len(numbers) == 1
        assert {"FL", "STD"} & set(words)
        assert not references
    else:
        assert isinstance(level, Level)
        assert not {"FL", "STD", "UNL"} & set(words)
        if not numbers or (Fraction(numbers[0]) == 0 and not references):
            assert level == Level(0.0, "agl")  # reaches down to the ground, whatever was meant
            return
        assert len(numbers) == 1
        assert references == {level.datum}
        assert len(units) == 1 or (not units and Fraction(numbers[0]) == 0)
        assert Fraction(level.value_m) == pytest.approx(Fraction(numbers[0]) * next(iter(units), 1), abs=1e-9)


# -- every spelling of a zone -------------------------------------------------------------------------------------

KEYS: dict[str, tuple[str, ...]] = {
    "floor": ("lower", "floor", "LOWER_LIMIT", "lowerLimit", "Bottom", "base", "LOWER_ALT", "lowerCeiling"),
    "ceiling": ("upper", "ceiling", "UPPER_LIMIT", "upperLimit", "Top", "UPPERLIMIT", "UPPER_ALT", "upperCeiling"),
}


def spellings(bound: str, number: str, unit: str, reference: str) -> st.SearchStrategy[dict[str, Any]]:
    """Attributes that all say ``number`` ``unit`` ``reference``."""

    def either(text: str) -> st.SearchStrategy[str]:
        return st.sampled_from([text, text.lower(), text.upper(), text.title()])

    key = st.sampled_from(KEYS[bound]).flatmap(either)
    low = "lower" if bound == "floor" else "upper"
    texts = st.sampled_from(
        [f"{number} {unit} {reference}", f"{number}{unit} {reference}", f"{reference} {number} {unit}",
         f"{reference}{number}{unit}"]
    )  # fmt: skip
    return st.one_of(
        st.builds(lambda k, t: {k: t}, key, texts.flatmap(either)),
        st.builds(lambda k: {f"{k}_{reference}_{unit}": number}, key),
        st.builds(lambda k: {f"{k}_{unit}_{reference}": float(number)}, key),
        st.builds(
            lambda v, u, r: {f"{low}_{v}": float(number), f"{low}_{u}": unit, f"{low}_{r}": reference},
            st.sampled_from(["val", "VALUE", "limit"]), st.sampled_from(["uom", "UNIT"]),
            st.sampled_from(["CODE", "reference", "VerticalReference", "datum"]),
        ),
        st.builds(lambda k: {k: f"{number} {reference}", "uomDimensions": unit}, key),
    )  # fmt: skip


NUMBERS = st.decimals(1, 9000, places=1).map(str)
ANY_UNIT = st.sampled_from(["M", "FT"])
ANY_REFERENCE = st.sampled_from(["AMSL", "AGL", "MSL", "SFC"])


@pytest.mark.nightly
@settings(max_examples=draws(150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), NUMBERS, ANY_UNIT, ANY_REFERENCE, st.sampled_from(["floor", "ceiling"]), st.booleans())
def test_every_spelling_of_a_level_gives_the_same_zone(
    tmp_path: Path, data: st.DataObject, number: str, unit: str, reference: str, bound: str, as_kml: bool
) -> None:
    datum = "amsl" if reference in ("AMSL", "MSL") else "agl"
    exact = Fraction(number) * UNITS_M[unit]
    plain = zone(tmp_path, {"name": "R", f"{bound}_{datum}_m": float(exact)})
    said = {data.draw(st.sampled_from(["name", "NAME", "Name"])): "R"} | data.draw(
        spellings(bound, number, unit, reference)
    )
    found = read(tmp_path, placemark({"name": "R"} | said), "air.kml") if as_kml else read(tmp_path, features(said))
    assert found.problems == []
    (draft,) = found.zones
    assert (draft.name, draft.floor, draft.ceiling) == (plain.name, plain.floor, plain.ceiling)
    level = draft.floor if bound == "floor" else draft.ceiling
    assert level is not None
    assert abs(Fraction(level.value_m) - exact) < Fraction(1, 10**9)
    ours = any(key.lower() == f"{bound}_{datum}_m" for key in said)
    assert ("R (" in notes(found)) == (not ours)  # how it was read is told


@pytest.mark.slow
@settings(max_examples=draws(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.sampled_from([
            "lower", "UPPER", "floor_agl_m", "ceiling_amsl_m", "LOWER_UOM", "upper_code", "uom", "UPPER_VAL", "top_ft",
            "base_m_agl", "UPPER_FT", "units", "lowerVerticalReference",
        ]),
        st.sampled_from([
            None, "", "GND", "UNL", "FL 65", "1500 FT AMSL", "300 M AGL", "1500", 1500, 120.5, 0, "FT", "M", "MSL",
            "AGL", "STD", True, [], {"value": 900, "unit": 1, "referenceDatum": 1},
            {"value": 65, "unit": 6, "referenceDatum": 2},
        ]),
        max_size=4,
    )
)  # fmt: skip
def test_no_attributes_limit_a_zone_by_more_than_they_say(tmp_path: Path, said: dict[str, Any]) -> None:
    """A bound is one of the numbers that are written, in a unit and over a reference that are written."""
    found = read(tmp_path, features({"name": "R"} | said))
    text = " ".join([*said, *(json.dumps(v) for v in said.values())]).upper()
    for draft in found.zones:
        for level in (draft.floor, draft.ceiling):
            if level is None:
                continue
            numbers = {Fraction(x) for x in re.findall(r"[\d.]+", text) if x != "."}
            metres = {n * u for n in numbers for u in (Fraction(1), UNITS_M["FT"])}
            assert any(abs(Fraction(level.value_m) - m) < Fraction(1, 10**9) for m in metres)
            sea = any(w in text for w in ("AMSL", "MSL", '"REFERENCEDATUM": 1'))
            ground = any(w in text for w in ("AGL", "GND"))
            assert sea if level.datum == "amsl" else ground
    assert found.zones or found.problems
    assert all("zone 'R'" in str(p) or "floor" in str(p) for p in found.problems)


# -- authorities' files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("properties", "floor", "ceiling"),
    [
        # FAA
        ({"NAME": "R", "LOWER_VAL": "0", "LOWER_UOM": "FT", "LOWER_CODE": "SFC", "UPPER_VAL": "4000", "UPPER_UOM": "FT",
          "UPPER_CODE": "MSL", "UPPER_DESC": "TI"}, "ground", "1219.2 m AMSL"),
        # ED-269
        ({"name": "R", "uomDimensions": "M", "lowerLimit": 0, "lowerVerticalReference": "AGL", "upperLimit": 120,
          "upperVerticalReference": "AGL"}, "ground", "120 m AGL"),
        # openAIP, its converter and its service
        ({"name": "R", "lowerCeiling": {"value": 500, "unit": "FT", "referenceDatum": "GND"},
          "upperCeiling": {"value": 90, "unit": "FL", "referenceDatum": "STD"}}, "152.4 m AGL", "unlimited"),
        ({"name": "R", "lowerLimit": {"value": 0, "unit": 1, "referenceDatum": 0},
          "upperLimit": {"value": 2500, "unit": 1, "referenceDatum": 1}}, "ground", "762 m AMSL"),
        # AIXM through a database
        ({"name": "R", "dist_vert_lower_val": 1000, "dist_vert_lower_uom": "FT", "dist_vert_lower_code": "MSL",
          "dist_vert_upper_val": "UNL"}, "304.8 m AMSL", "unlimited"),
        ({"NAME": "R", "LOWER": "GND", "UPPER": "UNL"}, "ground", "unlimited"),
        ({"Name": "R", "LOWER": None, "UPPER": ""}, "ground", "unlimited"),
        ({"name": "R", "FLOOR_AMSL_M": 300, "Ceiling_AGL_m": 50}, "300 m AMSL", "50 m AGL"),
        ({"name": "R", "floor_agl_m": 50, "lower": "50 M AGL"}, "50 m AGL", "unlimited"),
    ],
)  # fmt: skip
def test_files_of_authorities_are_read(tmp_path: Path, properties: dict[str, Any], floor: str, ceiling: str) -> None:
    draft = zone(tmp_path, properties)
    assert (draft.name, *limits(draft)) == ("R", floor, ceiling)


def test_the_layer_of_ed_318_is_read(tmp_path: Path) -> None:
    layer = {"upper": 400, "upperReference": "AGL", "lower": 0, "lowerReference": "AGL", "uom": "ft"}
    assert limits(zone(tmp_path, {}, layer=layer)) == ("ground", "121.92 m AGL")
    found = read(tmp_path, features({}, layer=layer | {"upperReference": "WGS84"}))
    assert "features[0].geometry.layer.upper: zone 'air[0]': upper 400" in str(found.problems[0])


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        ({"NAME": "R-12", "UPPER": "1500"},
         "features[0].properties.UPPER: zone 'R-12': UPPER '1500' cannot be read as a level: it has no unit and no "
         "reference. Write for example 1500 FT AMSL, 450 M AGL, FL 65, GND or UNL"),
        ({"NAME": "R-12", "UPPER_VAL": 1500, "UPPER_UOM": "FT"}, "UPPER_VAL 1500 (FT) cannot be read"),
        ({"NAME": "R-12", "UPPER": "GND"}, "wholly under ground"),
        ({"NAME": "R-12", "LOWER": "UNL"}, "floor without end"),
        ({"NAME": "R-12", "LOWER": "500 FT AGL", "floor_agl_m": 100}, "two things about one floor"),
        ({"NAME": "R-12", "UPPER": "UNL", "ceiling_agl_m": 100}, "two things about one ceiling"),
        ({"NAME": "R-12", "UPPER": "FL 95", "ceiling_amsl_m": 100}, "two things about one ceiling"),
        ({"NAME": "R-12", "ceiling_agl_m": "400 FT AGL"}, "two units"),
        ({"NAME": "R-12", "floor_agl_m": 100, "floor_unit": "ft"}, "two units"),
        ({"NAME": "R-12", "UPPER": True}, "no number and no text"),
        ({"NAME": "R-12", "UPPER": {"value": 5, "unit": 4, "referenceDatum": 1}}, "its unit 4 is not known"),
        ({"NAME": "R-12", "UPPER": {"value": 5, "altitude": 4}}, "its 'altitude' is not known"),
        ({"NAME": "R-12", "radius_m": 5, "RADIUS_M": 6}, "contradict each other"),
    ],
)  # fmt: skip
def test_a_level_that_cannot_be_read_names_zone_attribute_and_value(
    tmp_path: Path, properties: dict[str, Any], words: str
) -> None:
    found = read(tmp_path, features(properties))
    assert found.zones == []
    assert words in str(found.problems[0])
    assert "'R-12'" in str(found.problems[0])


def test_attributes_that_stand_twice_in_kml_must_agree(tmp_path: Path) -> None:
    text = placemark({"name": "R", "upper": "100 M AGL"}).replace(
        "</ExtendedData>", '<Data name="upper"><value>50 M AGL</value></Data></ExtendedData>'
    )
    assert "two things about one ceiling" in str(read(tmp_path, text, "air.kml").problems[0])


# -- what is told -------------------------------------------------------------------------------------------------


def test_flight_levels_limit_nothing_and_are_told(tmp_path: Path) -> None:
    found = read(tmp_path, features({"name": "TMA", "LOWER": "FL 65", "UPPER": "FL 195"}))
    assert limits(found.zones[0]) == ("ground", "unlimited")
    assert "no mission passes under them: TMA (LOWER 'FL 65')" in notes(found)
    assert "no mission passes over them: TMA (UPPER 'FL 195')" in notes(found)


def test_what_is_not_read_is_told_zone_by_zone(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        features(
            {"name": "a", "HEIGHT": 30, "fid": 7}, {"name": "b", "PLANCHER": "1500 FT AMSL"}, {"name": "c", "x": 1}
        ),
    )  # fmt: skip
    assert [limits(z) for z in found.zones] == [("ground", "unlimited")] * 3
    assert notes(found) == (
        "air.geojson: these attributes are not read, and limit nothing: a (HEIGHT 30), b (PLANCHER '1500 FT AMSL')"
    )


def test_a_radius_on_a_polygon_is_told(tmp_path: Path) -> None:
    assert "radius of a polygon is not read" in notes(read(tmp_path, features({"name": "a", "radius_m": 500})))


def test_altitudes_of_geojson_are_told(tmp_path: Path) -> None:
    high = features({"name": "a"}, coordinates=[[[*p, 500.0] for p in RING]])
    assert (
        notes(read(tmp_path, high)) == "air.geojson: the altitudes of corners are not read as limits: a (up to 500 m)"
    )


def test_own_names_in_a_file_are_read_without_a_word(tmp_path: Path) -> None:
    found = read(
        tmp_path, features({"name": "a", "floor_amsl_m": 300, "ceiling_agl_m": 50.5, "kind": "no_fly", "fid": 1})
    )
    assert limits(found.zones[0]) == ("300 m AMSL", "50.5 m AGL")
    assert notes(found) == ""


def test_a_country_does_not_flood_the_notes(tmp_path: Path) -> None:
    found = read(tmp_path, features(*({"name": f"z{i}", "LOWER": "FL 65"} for i in range(SHOWN_ZONES + 5))))
    assert notes(found).endswith(f"z{SHOWN_ZONES - 1} (LOWER 'FL 65'), and 5 more")


# -- what KML draws -----------------------------------------------------------------------------------------------

DRAWN = "<extrude>{}</extrude><altitudeMode>{}</altitudeMode>"


@pytest.mark.parametrize(
    ("drawing", "up", "ceiling"),
    [
        (DRAWN.format(1, "relativeToGround"), ",120", "120 m AGL"),
        (DRAWN.format("true", "relativeToGround"), ",120.5", "120.5 m AGL"),
        (DRAWN.format(1, "absolute"), ",900", "900 m AMSL"),
        (DRAWN.format(0, "relativeToGround"), ",120", "unlimited"),
        ("<altitudeMode>absolute</altitudeMode>", ",900", "unlimited"),
        (DRAWN.format(1, "clampToGround"), ",120", "unlimited"),
        (DRAWN.format(1, "relativeToSeaFloor"), ",120", "unlimited"),
        ("<extrude>1</extrude>", ",120", "unlimited"),
        (DRAWN.format(1, "relativeToGround"), "", "unlimited"),
        (DRAWN.format(1, "relativeToGround"), ",0", "unlimited"),
        (DRAWN.format(1, "absolute"), ",0", "unlimited"),
        (DRAWN.format(1, "absolute"), ",nan", "unlimited"),
        (DRAWN.format(1, "absolute"), ",1e300", "unlimited"),
        (DRAWN.format(1, "absolute") + DRAWN.format(1, "relativeToGround"), ",120", "unlimited"),
    ],
)
def test_a_polygon_that_is_drawn_down_to_the_ground_has_its_ceiling(
    tmp_path: Path, drawing: str, up: str, ceiling: str
) -> None:
    found = read(tmp_path, placemark({"name": "R"}, drawing, up), "air.kml")
    assert limits(found.zones[0]) == ("ground", ceiling)
    told = notes(found)
    if ceiling != "unlimited":
        assert f"R ({ceiling})" in told
    elif up in (",120", ",900"):
        assert "drawn altitudes are not read as limits: R" in told


def test_the_highest_corner_is_the_ceiling(tmp_path: Path) -> None:
    text = placemark({"name": "R"}, DRAWN.format(1, "relativeToGround"), ",120").replace("36.61,120", "36.61,150", 1)
    found = read(tmp_path, text, "air.kml")
    assert limits(found.zones[0])[1] == "150 m AGL"
    assert "the highest corner's" in notes(found)


@pytest.mark.parametrize("upper", ["UNL", "FL 65", "500 M AMSL"])
def test_attributes_hold_where_the_drawing_says_another_height(tmp_path: Path, upper: str) -> None:
    found = read(tmp_path, placemark({"name": "R", "UPPER": upper}, DRAWN.format(1, "absolute"), ",300"), "air.kml")
    assert limits(found.zones[0])[1] == ("500 m AMSL" if upper.startswith("500") else "unlimited")
    assert "drawn altitudes are not read" in notes(found)


@pytest.mark.parametrize("floor", [None, Level(50.0, "agl"), Level(612.3456789, "amsl")])
@pytest.mark.parametrize("ceiling", [None, Level(80.0, "agl"), Level(901.23456789, "amsl")])
def test_zones_of_our_own_kml_come_back_as_they_were(
    tmp_path: Path, floor: Level | None, ceiling: Level | None
) -> None:
    text = write_kml("m", [], [Zone("R", Circle(0.0, 0.0, 500.0), floor, ceiling)], FRAME)
    found = read(tmp_path, text, "mission.kml")
    assert found.problems == []
    assert {(z.floor, z.ceiling) for z in found.zones} == {(floor, ceiling)}


@pytest.fixture
def options_notes() -> Callable[[Path], str]:
    def told(file: Path) -> str:
        from gcsplan.mission_file.options_world import OpenWorld, WorldOptions

        world = OpenWorld(
            WorldOptions({"dem": "sample:jacksboro", "vertical_datum": "EGM96"}, (str(file),), {"min_agl_m": 30.0})
        )
        return "\n".join(str(n) for n in world.around([(36.6, -84.3)])[1]["notes"])  # type: ignore[attr-defined]

    return told


def test_only_zones_that_matter_are_told(tmp_path: Path, options_notes: Callable[[Path], str]) -> None:
    whole = json.loads(features({"name": "near", "LOWER": "FL 65"}, {"name": "far", "LOWER": "FL 65"}))
    whole["features"][1]["geometry"] = {"type": "Polygon", "coordinates": [[[x + 60.0, y] for x, y in RING]]}
    file = tmp_path / "air.geojson"
    file.write_text(json.dumps(whole))
    told = options_notes(file)
    assert "under them: near (LOWER 'FL 65')" in told
    assert "far (" not in told


def test_a_file_that_is_no_geojson_is_still_refused_whole(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        read(tmp_path, "{")


def test_three_decimals_are_no_thousands_where_the_name_says_metres(tmp_path: Path) -> None:
    found = read(tmp_path, placemark({"name": "R", "ceiling_agl_m": "60.125", "Floor_AGL_m": "1.000"}), "air.kml")
    assert limits(found.zones[0]) == ("1 m AGL", "60.125 m AGL")


def test_the_page_about_zones_names_every_attribute() -> None:
    page = (REPOSITORY / "docs/how-to/zones.md").read_text(encoding="utf-8")
    for word in (*NAME_ATTRIBUTES, *BOUNDS, *UNIT_NAMES, *REFERENCE_NAMES):
        assert f"`{word}`" in page
