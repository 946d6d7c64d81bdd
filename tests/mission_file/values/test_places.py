"""A place in every form that people paste, and no place where two readings are possible."""

from __future__ import annotations

import csv
import math
import re
from fractions import Fraction
from typing import Any

import pytest
import yaml
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.load import load_mission
from gcsplan.mission_file.request import MissionFile
from gcsplan.mission_file.values import schema
from gcsplan.mission_file.values.places import MAX_CHARS, PLACE_EXAMPLES, read_place
from gcsplan.notes.note import Note
from tests.oracles.grids import band_of, mgrs_of, utm_of
from tests.support.effort import draws
from tests.support.paths import DATA, REPOSITORY

TABLE = DATA / "mgrs.csv"
DMS = (47.0 + 23.0 / 60.0 + 49.5 / 3600.0, 8.0 + 20.0 / 60.0 + 38.5 / 3600.0)
GRID = (47.3967902883677, 8.643828630072571)  # 32T 473123 5249321, by PROJ's cct
METRE_DEG = 1.0 / 111_000.0

LATS = st.floats(-79.9, 83.9)
LONS = st.floats(-179.99, 179.99)


def degrees(text: str) -> tuple[float, float]:
    place = read_place(text)
    return place.lat_deg, place.lon_deg


def apart_m(a: tuple[float, float], b: tuple[float, float]) -> float:
    east = (a[1] - b[1] + 180.0) % 360.0 - 180.0
    return math.hypot(a[0] - b[0], east * math.cos(math.radians(a[0]))) / METRE_DEG


def refusal(text: str) -> str:
    with pytest.raises(ValueError, match="`") as caught:
        read_place(text)
    assert repr(text) in str(caught.value) or len(text) > MAX_CHARS
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("47.39708, 8.34403", (47.39708, 8.34403)),
        ("47.39708,8.34403", (47.39708, 8.34403)),
        ("47.39708 8.34403", (47.39708, 8.34403)),
        ("47.39708; 8.34403", (47.39708, 8.34403)),
        ("(47.39708, 8.34403)", (47.39708, 8.34403)),
        ("[47.39708, 8.34403]", (47.39708, 8.34403)),
        ("47.39708°, 8.34403°", (47.39708, 8.34403)),
        ("-33.8570, 151.2150", (-33.857, 151.215)),
        ("\u221233.8570, 151.2150", (-33.857, 151.215)),
        ("47.39708\u00a0N,\u200e 8.34403\u00a0E", (47.39708, 8.34403)),
        ("1e-05, -8.5E+1", (1e-5, -85.0)),
        ("47, 8", (47.0, 8.0)),
        ("47,8", (47.0, 8.0)),
        ("47.39708 N, 8.34403 E", (47.39708, 8.34403)),
        ("N47.39708 E8.34403", (47.39708, 8.34403)),
        ("n 47.39708 / e 8.34403", (47.39708, 8.34403)),
        ("47.39708° north, 8.34403° east", (47.39708, 8.34403)),
        ("8.34403 E, 47.39708 N", (47.39708, 8.34403)),
        ("33.8570S 151.2150E", (-33.857, 151.215)),
        ("36.6 deg N 84.38 deg W", (36.6, -84.38)),
        ("47°23'49.5\"N 8°20'38.5\"E", DMS),
        ("47°23′49.5″N 8°20′38.5″E", DMS),
        ("47°23’49.5”N, 8°20’38.5”E", DMS),
        ("47º 23' 49.5'' N  008º 20' 38.5'' E", DMS),
        ("N47°23'49.5\" E8°20'38.5\"", DMS),
        ("47°23'49.5\", 8°20'38.5\"", DMS),
        ("47°23'49.5\" 8°20'38.5\"", DMS),
        ("47d23'49.5\"N 8d20'38.5\"E", DMS),
        ("47:23:49.5N 8:20:38.5E", DMS),
        ("47:23:49.5, 8:20:38.5", DMS),
        ("47 23 49.5 N, 8 20 38.5 E", DMS),
        ("47 23 49.5, 8 20 38.5", DMS),
        ("47°23.825'N 8°20.6416'E", (47.0 + 23.825 / 60.0, 8.0 + 20.6416 / 60.0)),
        ("N 47° 23.825 E 008° 20.6416", (47.0 + 23.825 / 60.0, 8.0 + 20.6416 / 60.0)),
        ("-0°30', -0°15'", (-0.5, -0.25)),
        ("32T 473123 5249321", GRID),
        ("32t 473123 5249321", GRID),
        ("32 N 473123 5249321", GRID),
        ("32 north 473123 5249321", GRID),
        ("UTM 32T 473123 5249321", GRID),
        ("zone 32N 473123mE 5249321mN", GRID),
        ("32T 473123 E 5249321 N", GRID),
        ("32T, 473123.0, 5249321.0", GRID),
        ("32T E473123 N5249321", GRID),
        ("32TMT7312349321", GRID),
        ("32tmt7312349321", GRID),
        ("32T MT 73123 49321", GRID),
        ("MGRS 32TMT 73123 49321", GRID),
    ],
)  # fmt: skip
def test_what_people_paste_is_read(text: str, place: tuple[float, float]) -> None:
    assert degrees(text) == pytest.approx(place, abs=1e-9)
    assert read_place(text).note is None


def test_the_examples_of_messages_are_one_of_each_format() -> None:
    first = degrees(PLACE_EXAMPLES[0])
    assert [apart_m(degrees(text), first) < 25_000.0 for text in PLACE_EXAMPLES] == [True] * 5


@pytest.mark.slow
@settings(max_examples=draws(300))
@given(st.integers(-9_000_000_000, 9_000_000_000), st.integers(-18_000_000_000, 18_000_000_000), st.integers(0, 8))
def test_decimal_degrees_are_exact_to_the_digit(lat: int, lon: int, digits: int) -> None:
    lat_deg, lon_deg = round(lat / 1e8, digits), round(lon / 1e8, digits)
    plain = f"{lat_deg:.{digits}f}, {lon_deg:.{digits}f}"
    assert degrees(plain) == (lat_deg, lon_deg)
    letters = f"{abs(lat_deg):.{digits}f}{'S' if lat_deg < 0 else 'N'} {abs(lon_deg):.{digits}f}" + "EW"[lon_deg < 0]
    assert degrees(letters) == (lat_deg, lon_deg)


@pytest.mark.slow
@settings(max_examples=draws(300))
@given(st.integers(-324_000_000, 324_000_000), st.integers(-648_000_000, 648_000_000), st.sampled_from("'′’"),
       st.sampled_from(["\"", "″", "”", "''"]), st.sampled_from(["", " "]), st.booleans())  # fmt: skip
def test_sexagesimal_degrees_are_exact_to_the_digit(
    lat: int, lon: int, minute: str, second: str, gap: str, colons: bool
) -> None:
    """``lat`` and ``lon`` are thousandths of a second."""

    def written(value: int, letter: str) -> str:
        whole, thousandths = divmod(abs(value), 1000)
        d, m, s = whole // 3600, whole // 60 % 60, f"{whole % 60}.{thousandths:03d}"
        if colons:
            return f"{d}:{m}:{s} {letter}"
        return f"{d}°{gap}{m}{minute}{gap}{s}{second}{gap}{letter}"

    text = f"{written(lat, 'S' if lat < 0 else 'N')} {written(lon, 'W' if lon < 0 else 'E')}"
    assert degrees(text) == (float(Fraction(lat, 3_600_000)), float(Fraction(lon, 3_600_000)))


@pytest.mark.slow
@settings(max_examples=draws(300))
@given(LATS, LONS, st.booleans())
def test_utm_is_that_of_a_second_implementation(lat: float, lon: float, band: bool) -> None:
    assume(abs(lat) > 1e-6)  # at the equator a northing of 10 000 000 rounds to the other hemisphere
    utm = utm_of(lat, lon)
    letter = band_of(lat) if band and band_of(lat) != "S" else " south" if utm.south else " north"
    text = f"{utm.zone}{letter} {utm.easting_m:.3f} {utm.northing_m:.3f}"
    assert apart_m(degrees(text), (lat, lon)) < 0.01


@pytest.mark.slow
@settings(max_examples=draws(300))
@given(LATS, LONS, st.integers(1, 5))
def test_mgrs_is_the_square_of_a_second_implementation(lat: float, lon: float, digits: int) -> None:
    utm, size_m = utm_of(lat, lon), 10 ** (5 - digits)
    assume(min(x % 1.0 for x in utm[2:]) > 0.01)  # the series is exact to a millimetre
    place = read_place(mgrs_of(lat, lon, digits))
    corner = f"{utm.zone} {'south' if utm.south else 'north'} " + " ".join(
        f"{x // size_m * size_m:.0f}" for x in utm[2:]
    )
    size = f"{size_m} m" if size_m < 1000 else f"{size_m // 1000} km"
    assert apart_m((place.lat_deg, place.lon_deg), degrees(corner)) < 1e-6
    told = place.note is not None and place.note.code == "place_is_a_square" and place.note.data["size"] == size
    assert told == (digits < 5) == (place.note is not None)


def test_mgrs_is_that_of_other_programs() -> None:
    """Texts by GEOTRANS (the package mgrs 1.6.0); the corners of their squares agree with PyGeodesy 26.10."""
    with TABLE.open(encoding="ascii", newline="") as opened:
        rows = list(csv.DictReader(opened))
    assert len(rows) == 120
    for row in rows:
        corner = float(row["corner_lat_deg"]), float(row["corner_lon_deg"])
        assert apart_m(degrees(row["text"]), corner) < 0.001, row["text"]


def test_the_letter_s_is_a_band_or_a_hemisphere_and_never_guessed() -> None:
    words = refusal("10S 551234 4182345")
    north, south = re.findall(r"`([^`]+)`", words)
    assert degrees(north) == pytest.approx((37.78703, -122.41813), abs=1e-5)
    assert degrees(south) == pytest.approx((-52.50661, -122.24514), abs=1e-5)
    assert all(f"{x:.5f}" in words for x in (*degrees(north), *degrees(south)))
    sydney = read_place("56S 334873 6252266")  # not a northing of band S
    assert (sydney.lat_deg, sydney.lon_deg) == pytest.approx((-33.857, 151.215), abs=1e-5)
    assert sydney.note == Note("zone_letter_is_the_hemisphere", zone=56)


REFUSED = [
    ("147.2, 36.6", "degrees: latitude and longitude look swapped: 147.2 is no latitude"),
    ("95, 195", "latitude must be within ±90°"),
    ("47, 190", "longitude must be within ±180°"),
    ("90.0001 N, 8 E", "a latitude is at most 90°"),
    ("473123 5249321", "metres of UTM need their zone"),
    ("47,39708, 8,34403", "the decimals begin with a point"),
    ("47,39708 8,34403", "the decimals begin with a point"),
    ("47,39708 N 8,34403 E", "decimals begin with a point"),
    ("47,39 8", "one angle has minutes and the other one has not"),
    ("47.39708, 8.34403, 512", "a height stands as agl_m"),
    ("47 23 8 20", "with a comma between them"),
    ("47.4", "with a comma between them"),
    ("nowhere", "write latitude and longitude"),
    ("", "write latitude and longitude"),
    ("5 Main Street", "is no part of it"),
    ("47.4 N", "it is a latitude alone; the longitude is missing"),
    ("8.3 E", "it is a longitude alone; the latitude is missing"),
    ("47.4 N, 8.3", "both angles have a letter"),
    ("N 47.4, 8.3 E", "both angles have a letter"),
    ("47.4 N 8.3 N", "one letter is N or S and the other one E or W"),
    ("-47.4 S, 8.3 E", "both say the hemisphere"),
    ("47°60'N 8°20'E", "minutes are below 60, given 60"),
    ("47°23'60\"N 8°20'E", "seconds are below 60, given 60"),
    ("47.5°30'N 8°20'E", "47.5 has decimals"),
    ("47°23.5'30\"N 8°20'E", "23.5 has decimals"),
    ("0T 473123 5249321", "UTM: zones are 1 to 60"),
    ("61T 473123 5249321", "UTM: zones are 1 to 60"),
    ("32O 473123 5249321", "UTM: O is no band of latitude"),
    ("32U 473123 5249321", "outside band U (48° to 56°)"),
    ("32T 5249321 473123", "easting and northing look swapped"),
    ("32T 47312 5249321", "an easting is 100000 to 900000"),
    ("32T 473123 52493210", "a northing is at most 10000000"),
    ("32 north 473123 9500000", "UTM reaches from 80° S to 84° N"),
    ("32 south 473123 900000", "UTM reaches from 80° S to 84° N"),
    ("32S 473123 900000", "UTM reaches from 80° S to 84° N"),
    ("32T 473123", "UTM: give zone, band or hemisphere, easting and northing"),
    ("UTM 473123 5249321", "UTM: give zone, band or hemisphere"),
    ("32T", "MGRS: give zone, band, two letters"),
    ("32TMT", "a whole square of 100 km"),
    ("32TMT731234932", "same number of digits"),
    ("32TMT 73123 4932", "same number of digits"),
    ("32TMT 7 3 1 2", "same number of digits"),
    ("32TMT731234493212", "at most 5 digits each"),
    ("32TIT7312349321", "no square IT in zone 32"),
    ("32TAT7312349321", "no square AT in zone 32"),
    ("32TMA7312349321", "not in band T"),
    ("32TJT0000149321", "outside zone 32T"),
    ("32XEK0000", "there is no zone 32X"),
    ("99TMT7312349321", "MGRS: zones are 1 to 60"),
    ("ZAH0000000000", "squares at the poles are not read"),
    ("9" * 101, "at most 100 characters"),
]


@pytest.mark.parametrize(("text", "words"), REFUSED)
def test_what_is_no_place_is_refused_with_its_format_and_an_example_that_works(text: str, words: str) -> None:
    said = refusal(text)
    assert words in said
    examples = re.findall(r"`([^`]+)`", said)
    assert examples
    for example in examples:
        read_place(example)


@pytest.mark.slow
@settings(max_examples=draws(500))
@given(st.text(st.sampled_from("0123456789.,:;/ +-°'\"NSEWTMUZdeg′″\u00a0"), max_size=40) | st.text(max_size=120))
def test_any_text_is_a_place_on_earth_or_refused_with_a_cure(text: str) -> None:
    try:
        lat, lon = degrees(text)
    except ValueError as why:
        assert "`" in str(why)  # noqa: PT017
        return
    assert abs(lat) <= 90.0
    assert abs(lon) <= 180.0


# -- in a mission -------------------------------------------------------------------------------------------------


def mission(**vehicle: Any) -> dict[str, Any]:
    own = {"name": "a", "sysid": 1, "autopilot": "arducopter", "start": [47.39708, 8.34403], "goal": [47.398, 8.36]}
    limits = {"min_agl_m": 30, "horizontal_clearance_m": 10, "track_error_m": 3, "altitude_error_m": 5}
    return {"version": 1, "terrain": {"flat_m": 400}, "limits": limits, "vehicles": [own | vehicle]}


def load(whole: dict[str, Any] | str) -> MissionFile:
    return load_mission(text=whole if isinstance(whole, str) else yaml.safe_dump(whole, allow_unicode=True))


def problems(whole: dict[str, Any] | str) -> tuple[Mistake, ...]:
    with pytest.raises(InputError) as caught:
        load(whole)
    return caught.value.problems


@pytest.mark.parametrize(
    "place",
    ["47.39708, 8.34403", {"lat": 47.39708, "lon": 8.34403}, {"latitude": 47.39708, "longitude": 8.34403},
     {"lat": 47.39708, "lng": 8.34403}, ["47.39708 N", "8.34403 E"], {"lat": "47.39708 N", "lon": "8.34403"}],
)  # fmt: skip
def test_every_form_is_the_same_place_under_every_key(place: Any) -> None:
    def whole(at: Any) -> dict[str, Any]:
        near = [[47.41, 8.33], [47.41, 8.35], [47.4, 8.34]]
        zones = [{"center": [47.39, 8.4], "radius_m": 50}, {"polygon": [*near, [47.4, 8.33]]}]
        made = mission(start=at, via=[at]) | {"no_fly": zones}
        made["no_fly"][1]["polygon"][2] = at
        made["no_fly"].append({"center": at, "radius_m": 20, "floor_agl_m": 100})
        return made

    plain, other = load(whole([47.39708, 8.34403])), load(whole(place))
    assert repr(other.vehicles) == repr(plain.vehicles)
    assert other.inputs["zones_sha256"] == plain.inputs["zones_sha256"]
    assert other.notes == plain.notes


def test_the_origin_of_a_frame_is_a_place_too() -> None:
    local = mission(start={"east_m": 0, "north_m": 0}, goal={"east_m": 500, "north_m": 0})
    for at in ([47.5, 8.25], "47°30'N 8°15'E", {"latitude": 47.5, "longitude": 8.25}):
        frame = load(local | {"frame": {"origin": at}}).frame
        assert (frame.lat_deg, frame.lon_deg) == (47.5, 8.25)


def test_a_via_point_has_its_height_beside_any_form() -> None:
    via = [[47.397, 8.35, 80], {"lat": 47.397, "lon": 8.35, "agl_m": 80}, {"at": "47.397, 8.35", "agl_m": 80},
           {"lat": 47.397, "lon": 8.35, "agl_ft": 80 / 0.3048}]  # fmt: skip
    read = load(mission(via=via)).vehicles[0].via
    assert len({point[:2] for point in read}) == 1
    assert [point[2] for point in read] == pytest.approx([80.0] * 4)


def test_a_coarse_square_and_a_hemisphere_are_told() -> None:
    notes = load(mission(start="32TMT 4941 4983", goal="32TMT 50000 49000")).notes
    told = [note for note in notes if note.code == "place_is_a_square"]
    assert told == [Note("place_is_a_square", place="vehicles[0].start", given="32TMT 4941 4983", size="10 m")]
    assert str(told[0]) == (
        "vehicles[0].start: '32TMT 4941 4983' is a square of 10 m in MGRS; its south-west corner is taken"
    )


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"start": "147.2, 36.6"}, "start", "read as degrees: latitude and longitude look swapped"),
        ({"start": 47.4}, "start", "must be [lat, lon], {lat, lon}, or text such as 47.39708, 8.34403"),
        ({"start": [47, 39708, 8, 34403]}, "start", "decimals begin with a point"),
        ({"start": [170629, 30038]}, "start", "degrees with colons need quotes"),
        ({"start": {"lat": 47.4}}, "start.lon", "is missing"),
        ({"start": {"lat": 47.4, "latitude": 47.4, "lon": 8.3}}, "start", "lat stands twice"),
        ({"start": {"lat": 47.4, "lon": 8.3, "agl_m": 5}}, "start.agl_m", "unknown key"),
        ({"start": {"lat": "8.3 E", "lon": 8.3}}, "start.lat", "E is no letter of a latitude"),
        ({"start": {"lat": 147.4, "lon": 8.3}}, "start", "look swapped"),
        ({"via": [{"at": "x", "agl_m": 50}]}, "via[0].at", "is no place"),
        ({"via": [{"lat": 47.4, "lon": 8.3, "agl_mm": 50}]}, "via[0].agl_mm", "did you mean agl_m"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_place_has_its_key_and_line(change: dict[str, Any], key: str, words: str) -> None:
    text = yaml.safe_dump(mission(**change), allow_unicode=True)
    (found,) = problems(text)
    assert found.where == f"mission: vehicles[0].{key}"
    assert words in found.message
    number = re.search(r" \(line (\d+)\)$", found.message)
    assert number is not None
    line = text.splitlines()[int(number[1]) - 1]
    last = re.sub(r"\[\d+\]", "", key).rsplit(".", 1)
    assert any(f"{part}:" in line for part in last) or line.lstrip().startswith("- ")


def test_a_mission_without_a_text_has_no_lines() -> None:
    with pytest.raises(InputError) as caught:
        load_mission(mission(start="here"))
    assert "line" not in caught.value.problems[0].message


@pytest.mark.parametrize(
    "start",
    ["47.39708, 8.34403", "47°23'49.5\"N 8°20'38.5\"E", "[47°23'49.5\"N, 8°20'38.5\"E]", "47:23:49.5, 8:20:38.5",
     "[47:23:49.5, 8:20:38.5]", "32T 450488 5249430", "32TMT5048849430", "{lat: 47.39708, lon: 8.34403}"],
)  # fmt: skip
def test_yaml_without_quotes_is_read(start: str) -> None:
    text = yaml.safe_dump(mission(start="HERE")).replace("HERE", start)
    assert start in text
    lat, lon = load(text).vehicles[0].start_deg
    assert apart_m((lat, lon), (47.39708, 8.34403)) < 100.0


def test_one_speed_is_both_and_told() -> None:
    for one, plain in (({"speed_m_s": 8}, [8.0, 8.0]), ({"speed_kmh": 18}, [5.0, 5.0])):
        read = load(mission(**one))
        vehicle = read.vehicles[0].vehicle
        assert [vehicle.speed_min_m_s, vehicle.speed_max_m_s] == plain
        assert Note("one_speed", vehicle="a", slow_m_s=plain[0], fast_m_s=plain[0]) in read.notes
    assert not any(note.code == "one_speed" for note in load(mission(speed_m_s=[8, 8])).notes)
    (found,) = problems(mission(speed_m_s=0))
    assert found.where == "mission: vehicles[0].speed_m_s"
    assert "above 0" in found.message


def test_the_json_schema_takes_every_form() -> None:
    told = schema.VehicleKeys.model_json_schema()
    forms = told["properties"]["start"]["oneOf"]
    assert [form.get("type", form.get("$ref")) for form in forms] == [
        "array", None, "#/$defs/LocalPoint", "#/$defs/DegreePoint"
    ]  # fmt: skip
    assert forms[1]["anyOf"][0]["examples"] == list(PLACE_EXAMPLES)
    assert {"lat", "latitude", "lon", "longitude", "lng"} <= told["$defs"]["DegreePoint"]["properties"].keys()
    assert [form["type"] for form in told["properties"]["speed_m_s"]["oneOf"]] == ["number", "array"]


def test_a_vehicle_without_a_space_after_its_colon_is_told() -> None:
    whole = mission() | {"vehicles": ["name:uav1"]}
    (found,) = problems(whole)
    assert found.where == "mission: vehicles[0]"
    assert "a space is missing after the colon: `name: uav1`" in found.message
    assert "`version: 1`" in problems("version:1\n")[0].message


@pytest.mark.slow
def test_the_examples_of_the_reference_are_read() -> None:
    """Each form in the table of docs/reference/mission-file.md, near the same place."""
    page = (REPOSITORY / "docs" / "reference" / "mission-file.md").read_text(encoding="utf-8")
    rows = [
        line for line in page.split("## Places")[1].split("## Other units")[0].splitlines() if line.startswith("| ")
    ]
    examples = [example for row in rows[2:] for example in re.findall(r"`([^`]+)`", row)]
    examples = [example for example in examples if re.search(r"\d", example)]
    assert len(examples) >= 14
    for example in examples:
        at = load(mission(start=yaml.safe_load(example) if example[0] in "[{" else example)).vehicles[0].start_deg
        assert apart_m(at, (47.39708, 8.34403)) < 25_000.0
