"""OpenAir: a round trip, arcs against geodesics, published samples, and that what is not understood is named."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import shapely
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from pyproj import Geod

from gcsplan.mission_file.published.arcs import Arc, outline
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.zones.draft import ZoneDraft
from tests.mission_file.published.made import limits, outcome, read, remarks, said
from tests.support.attacks import draw_attacks
from tests.support.effort import draws
from tests.support.paths import DATA

AIRSPACE = DATA / "airspace"
EARTH = Geod(ellps="WGS84")
SQUARE = "DP 47:00:00 N 008:00:00 E\nDP 47:00:00 N 008:06:00 E\nDP 47:06:00 N 008:06:00 E\nDP 47:06:00 N 008:00:00 E\n"


def zones(folder: Path, text: str | bytes, **policy: object) -> list[ZoneDraft]:
    found = read(folder, text, "a.txt", **policy)
    assert not found.problems
    return found.zones


def zone(folder: Path, records: str) -> ZoneDraft:
    [one] = zones(folder, f"AC R\nAN one\n{records}")
    return one


# -- round trip


def place(lat: float, lon: float, style: int) -> str:
    """A place in the three ways in which OpenAir is written."""

    def angle(value: float, digits: int, sides: str) -> str:
        side, value = sides[value < 0], abs(value)
        if style == 0:
            whole, rest = divmod(round(value * 3600), 3600)
            return f"{whole:0{digits}}:{rest // 60:02}:{rest % 60:02} {side}"
        if style == 1:
            whole, thousandths = divmod(round(value * 60_000), 60_000)
            return f"{whole:0{digits}}:{thousandths / 1000:06.3f}{side}"
        return f"{value:.8f} {side}"

    return f"{angle(lat, 2, 'NS')} {angle(lon, 3, 'EW')}"


LEVELS = [
    ("GND", "2500 FT AMSL", "ground", "762 m AMSL"), ("SFC", "UNL", "ground", "unlimited"),
    ("500ft AGL", "1500m AMSL", "152.4 m AGL", "1500 m AMSL"), ("1000 FT MSL", "FL 95", "304.8 m AMSL", "unlimited"),
    ("FL65", "UNLIM", "ground", "unlimited"), ("0", "120 M GND", "ground", "120 m AGL"),
]  # fmt: skip
ONES = st.tuples(
    st.sampled_from(["A", "C", "CTR", "P", "Q", "R", "TMZ", "GP"]),
    st.sampled_from(["Zürich", "ED-R3 H24", "x"]),
    st.sampled_from(LEVELS),
    st.floats(-70, 70),
    st.floats(-179, 179),
    st.integers(0, 2),
    st.one_of(st.integers(3, 12), st.floats(0.05, 50.0)),
)


@given(st.lists(ONES, min_size=1, max_size=5))
@settings(max_examples=draws(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read(tmp_path: Path, ones: list[tuple]) -> None:  # type: ignore[type-arg]
    text, wanted = ["* written by the test"], []
    for kind, name, (low, high, floor, ceiling), lat, lon, style, shape in ones:
        text += ["", f"AC {kind}", f"AN {name}", f"AL {low}", f"AH {high}"]
        if isinstance(shape, float):
            text += [f"V X={place(lat, lon, style)}", f"DC {shape:.4f}"]
            wanted.append((name, floor, ceiling, [(lat, lon)], round(shape, 4) * 1852.0))
        else:
            ring = [
                (lat + 0.2 * math.cos(2 * math.pi * i / shape), lon + 0.2 * math.sin(2 * math.pi * i / shape))
                for i in range(shape)
            ]
            text += [f"DP {place(*p, style)}" for p in [*ring, ring[0]]]
            wanted.append((name, floor, ceiling, ring, None))
    found = zones(tmp_path, "\r\n".join(text).encode())
    assert [d.name for d in found] == [w[0] for w in wanted]
    for draft, (_, floor, ceiling, points, radius_m) in zip(found, wanted, strict=True):
        assert limits(draft) == (floor, ceiling)
        assert draft.radius_m == (None if radius_m is None else pytest.approx(radius_m))
        assert len(draft.points) == len(points)
        for (lat, lon), (wanted_lat, wanted_lon) in zip(draft.points, points, strict=True):
            assert abs(lat - wanted_lat) < 1.5e-4  # half a second, or half a thousandth of a minute
            assert abs(lon - wanted_lon) < 1.5e-4


# -- arcs


@pytest.mark.slow
@given(
    st.floats(-65, 65), st.floats(-180, 180), st.floats(300.0, 90_000.0), st.integers(0, 359), st.integers(20, 340),
    st.booleans(), st.booleans(),
)  # fmt: skip
@example(47.0, 180.0, 300.0, 0, 181, True, False)
@example(-18.0, -179.999, 5000.0, 45, 90, False, False)  # written as 180.001 and -179.999 side by side
@settings(max_examples=draws(40), deadline=None)
def test_an_arc_contains_its_zone_and_little_more(
    lat: float, lon: float, radius_m: float, start: int, turn: int, clockwise: bool, bulges: bool
) -> None:
    """A sector of a circle, or one of a ring that the arc bulges into; true arcs are geodesics from the centre."""
    end = start + turn if clockwise else start - turn
    arc = Arc.by_bearings((lat, lon), radius_m, start, end, clockwise)
    bearings = [start + (turn if clockwise else -turn) * i / 1500 for i in range(1501)]

    def at(bearing: float, distance_m: float) -> tuple[float, float]:
        east, north, _ = EARTH.fwd(lon, lat, bearing, distance_m)
        return north, east

    def polygon(ring: list[tuple[float, float]]) -> shapely.Polygon:
        """In degrees of latitude, to east and to north."""
        squeeze = math.cos(math.radians(lat))
        return shapely.Polygon([(((p[1] - lon + 180.0) % 360.0 - 180.0) * squeeze, p[0]) for p in ring]).buffer(0)

    true = [at(b, radius_m) for b in bearings]
    more = [(lat, lon)] if bulges else [at(b, 2.0 * radius_m) for b in reversed(bearings)]
    drawn, exact = polygon(outline([arc, *more])), polygon([*true, *more])
    degree = 1.0 / 111_000.0
    aside = (0.5 + radius_m**3 / (4.0 * 6.37e6**2)) * degree  # half a metre, and how far the plane bends a bearing
    assert drawn.buffer(aside).contains(exact)
    assert drawn.difference(exact.buffer(aside)).area < 25.0 * degree * exact.length


def test_an_arc_between_places_keeps_its_ends(tmp_path: Path) -> None:
    records = "V D=-\nV X=47:00:00 N 008:00:00 E\nDB 47:05:00 N 008:00:00 E, 47:00:00 N 007:52:40 E\n"
    draft = zone(tmp_path, records + "DP 47:00:00 N 008:00:00 E\n")
    for end in ((47.0 + 5 / 60, 8.0), (47.0, 7.0 + 52 / 60 + 40 / 3600)):
        assert min(math.dist(end, p) for p in draft.points) < 1e-9
    assert all(lon <= 8.0 + 1e-6 and lat >= 47.0 - 1e-6 for lat, lon in draft.points)  # the quarter in the north-west
    assert "that is no circle" in said(tmp_path, "AC R\n" + records.replace("47:05:00", "47:10:00") + SQUARE, "a.txt")


def test_centre_holds_in_the_next_zone_and_the_direction_does_not(tmp_path: Path) -> None:
    text = "AC C\nV X=39:08.2 N 121:26.2 W\nV D=-\nDC 5\nAC C\nAL 2600ft\nDA 10,0,90\nDP 39:08.2 N 121:26.2 W\n"
    circle, sector = zones(tmp_path, text)
    assert circle.points == ((39.0 + 8.2 / 60, -121.0 - 26.2 / 60),)
    assert circle.radius_m == pytest.approx(9260.0)
    assert all(lon >= -121.437 for _, lon in sector.points)  # clockwise: the north-east


# -- samples


def test_published_pieces_of_seven_states_are_read(tmp_path: Path) -> None:
    found = read(tmp_path, (AIRSPACE / "openair_openaip.txt").read_bytes(), "a.openair")
    assert not found.problems
    assert not any(z.faults for z in found.zones)
    names = {z.name: limits(z) for z in found.zones}
    assert names["ED-R3 Geesthacht H24"] == ("ground", "670.56 m AMSL")
    assert names["TMA NICE partie 3"] == ("762 m AMSL", "unlimited")
    assert names["San Rocco al Porto Corridor(ULM)"] == ("ground", "152.4 m AGL")
    assert names["22 Nord"] == ("3000 m AMSL", "unlimited")
    assert names["TMP JSDF X-12-2 till 31Mar22 Height by NOTAM"] == ("ground", "unlimited")
    assert [z.name for z in found.zones if z.unused] == ["TH-3-1"]  # class G


def test_an_airway_is_refused_by_its_line(tmp_path: Path) -> None:
    words = said(tmp_path, (AIRSPACE / "openair_airway.txt").read_bytes(), "a.txt")
    assert "a.txt: line 8: zone 'Axe 1': 'DY 44:17:00 N" in words
    assert "airways are not read" in words


# -- what records mean


def test_limits_without_unit_or_reference_are_feet_above_sea_level_and_named(tmp_path: Path) -> None:
    found = read(tmp_path, f"AC C\nAN RENO\nAL 7200 ft\nAH 8400\n{SQUARE}", "a.txt")
    assert limits(found.zones[0]) == ("2194.56 m AMSL", "2560.32 m AMSL")
    assert "in feet above sea level: AL 7200 ft" in remarks(found)
    assert "sea level: AH 8400" in remarks(found)


def test_flight_levels_limit_nothing_unless_the_mission_says_how_far_they_lie_off(tmp_path: Path) -> None:
    text = f"AC C\nAL FL 65\nAH FL195 STD\n{SQUARE}"
    [plain] = zones(tmp_path, text)
    [known] = zones(tmp_path, text, flight_level_error_m=500.0)
    assert limits(plain) == ("ground", "unlimited")
    assert limits(known) == ("1481.2 m AMSL", "6443.6 m AMSL")
    assert "as the mission says" in remarks(read(tmp_path, text, "a.txt", flight_level_error_m=500.0))


def test_an_outline_that_crosses_itself_is_no_fly_with_all_that_it_encloses(tmp_path: Path) -> None:
    bow = "DP 47:00:00 N 008:00:00 E\nDP 47:00:36 N 008:00:36 E\nDP 47:00:36 N 008:00:00 E\nDP 47:00:00 N 008:00:36 E\n"
    found = read(tmp_path, f"AC R\nAN bow\n{bow}", "a.txt")
    area = sum(shapely.Polygon(z.points).area for z in found.zones)
    assert [z.name for z in found.zones] == ["bow/1", "bow/2"]
    assert area == pytest.approx(0.00005)
    assert "cross or touch themselves" in remarks(found)


@pytest.mark.parametrize(
    ("kinds", "used"),
    [
        ("AC G", False), ("AC E", True), ("AC R", True), ("AC FFVL", True), ("AC UNC", True), ("AC UNC\nAY NONE", True),
        ("AC UNC\nAY FIS", False), ("AC G\nAY RMZ", True), ("AC UNC\nAY TRZ", False), ("AC W", True),
    ],
)  # fmt: skip
def test_all_that_restricts_is_no_fly(tmp_path: Path, kinds: str, used: bool) -> None:
    [draft] = zones(tmp_path, f"{kinds}\nAN one\n{SQUARE}")
    assert bool(draft.unused) != used


def test_terrain_labels_and_radio_are_ignored_by_name(tmp_path: Path) -> None:
    more = "AF 123.5\nAG Tower\nAX 7000\nAT 47:01:00 N 008:01:00 E\nSP 0,1,0,0,0\nSB 1,2,3\n"
    text = f"TC lake\nV X=47:00:00 N 008:00:00 E\n{SQUARE}\nAC R\nAN one\n{more}{SQUARE}\nTO river\n{SQUARE}"
    assert [z.name for z in zones(tmp_path, text)] == ["one"]


@pytest.mark.parametrize(
    ("records", "words"),
    [
        ("AH Ask on 122.8", "zone 'one': AH Ask on 122.8 cannot be read as a level: 'ASK' is not known"),
        ("AH 3500FT AMSL/1000FT AGL", "'/' is not known"),
        ("AH 1500m WGS84", "cannot be read as a level"),
        ("AH 0 FT AGL", "the zone would lie wholly under ground"),
        ("AL 2000 FT AMSL\nAH 1000 FT AMSL", "the floor must be below the ceiling"),
        ("AL UNL", "a floor needs a height"),
        ("AL GND\nAL 1000 FT AMSL", "line 4: zone 'one': 'AL 1000 FT AMSL': the zone has two AL"),
        ("DP 47:61:00 N 008:00:00 E", "minutes and seconds at most 60"),
        ("DP 91:00:00 N 008:00:00 E", "91 N is no place on Earth"),
        ("DP 47.5:30 N 008:00:00 E", "degrees and minutes are whole numbers"),
        ("DP 47:00:00 008:00:00", "it needs a place such as"),
        ("V X=nowhere\nDC 5", "has no centre"),
        ("V D=north", "the direction is + (clockwise) or -"),
        ("V Q=5", "the variable Q is not known"),
        ("V X=47:00:00 N 008:00:00 E\nDA 5,0", "a radius in nautical miles and two bearings"),
        ("V X=47:00:00 N 008:00:00 E\nDA nan,0,9", "a radius in nautical miles and two bearings"),
        ("V X=47:00:00 N 008:00:00 E\nDA -1,0,9", "its radius must be above 0"),
        ("V X=47:00:00 N 008:00:00 E\nDC 0", "its radius must be above 0"),
        ("V X=47:00:00 N 008:00:00 E\nDC 600", "given 1.1112e+06 m"),
        ("V X=89:00:00 N 008:00:00 E\nDA 5,0,90", "too near to a pole"),
        ("XY 5", "the record XY is not known"),
        ("this is no record", "'this is no record' is no record of OpenAir"),
    ],
)
def test_what_is_not_understood_is_named_with_its_line(tmp_path: Path, records: str, words: str) -> None:
    assert words in said(tmp_path, f"AC R\nAN one\n{records}\n{SQUARE}", "a.txt")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file holds no zone"),
        ("DP 47:00:00 N 008:00:00 E", "stands before the first AC"),
        ("AC R\nAN empty", "line 1 (empty): the zone has no outline (DP, DA, DB) and no circle (DC)"),
        ("hello\n" * 100_000, "'hello' is no record of OpenAir"),
        ("<kml/>", "is no record of OpenAir"),
    ],
)
def test_a_file_without_zones_is_refused_in_few_words(tmp_path: Path, text: str, words: str) -> None:
    found = said(tmp_path, text, "a.txt")
    assert words in found
    assert len(found) < 2000


@pytest.mark.parametrize("line", ["DP 50:00:00 N 008:99:00 E", "DP 47:03:00 N", "V X=here", "lost words", "DC 4000"])
def test_an_outline_that_is_not_understood_is_refused_wherever_its_rest_lies(tmp_path: Path, line: str) -> None:
    text = f"AC R\nAN far\nV X=47:00:00 N 008:00:00 E\n{SQUARE}{line}\nAC R\nAN whole\n{SQUARE}"
    found = read(tmp_path, text, "a.txt")
    assert len(found.problems) == 1
    assert "far" in str(found.problems[0])
    assert "whole" in [z.name for z in found.zones]
    assert not read(tmp_path, text.replace("AC R", "AC G", 1), "a.txt").problems or line == "DC 4000"


def test_older_letters_are_read(tmp_path: Path) -> None:
    [draft] = zones(tmp_path, f"AC R\nAN Zürich\n{SQUARE}".encode("latin-1"))
    assert draft.name == "Zürich"


RECORDS = st.sampled_from(
    ["AC R", "AC", "AN x", "AL GND", "AH FL 95", "AH 9" * 30, "V D=-", "V X=47:00:00 N 008:00:00 E", "V X=", "DC 1e9",
     "DC 1", "DA 1,0,90", "DA 1,1e308,-1e308", "DA inf,0,0", "DB 47:00:00 N 008:01:00 E,47:01:00 N 008:00:00 E",
     "DP 47:00:00 N 008:00:00 E", "DP 47:01:00 N 008:00:00 E", "DP 47:00:30 N 008:01:00 E", "DP 90:00:00 N 0:0:0 E",
     "AA NONE", "AA 2026-01-01T00:00Z/NONE", "AA x/y", "TO", "DY 1", "*"]
)  # fmt: skip


@pytest.mark.draws
def test_any_text_gives_its_zones_or_words_of_what_is_wrong(tmp_path: Path) -> None:
    def attack(data: st.DataObject) -> str:
        lines = data.draw(st.lists(st.one_of(RECORDS, st.text(max_size=20)), max_size=30))
        text = data.draw(st.sampled_from(["", f"AC R\nAN first\n{SQUARE}"])) + "\n".join(lines)
        return outcome(tmp_path, text.encode("utf-8", "surrogatepass"), "a.txt")

    assert draw_attacks(150, attack) == {"zones", "refused"}


def test_a_day_alone_as_the_end_of_an_activation_is_all_of_it(tmp_path: Path) -> None:
    text = "AC R\nAN a\nAA 2026-11-24T10:00Z/2026-11-24\nV X=47:00:00 N 008:00:00 E\nDC 1\n"
    for at, unused in (("2026-11-24T23:00Z", False), ("2026-11-25T00:01Z", True)):
        (zone,) = read(tmp_path, text, "a.openair", hours=Hours.read(at)).zones
        assert bool(zone.unused) is unused


@pytest.mark.parametrize("period", ["2026-11-24T10:00Z/2026-11-24T12:00Z;RRULE:FREQ=DAILY", "NONE;see NOTAM"])
def test_what_stands_behind_a_semicolon_belongs_to_the_activation(tmp_path: Path, period: str) -> None:
    """A comment begins with an asterisk. What may say that the zone comes back is not left out: it counts as always."""
    text = f"AC R\nAN a\nAA {period}\nV X=47:00:00 N 008:00:00 E\nDC 1\n"
    (zone,) = read(tmp_path, text, "a.openair", hours=Hours.read("2026-11-25T11:00Z")).zones
    assert not zone.unused
    plain = f"AC R\nAN a\nAA {period.split(';')[0]} * {period}\nV X=47:00:00 N 008:00:00 E\nDC 1\n"
    (zone,) = read(tmp_path, plain, "a.openair", hours=Hours.read("2026-11-25T11:00Z")).zones
    assert bool(zone.unused) is ("NONE" not in period)
