"""Polygons that are wide, across the antimeridian or at a pole, in every format: never the other side of the globe."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.published.unused import used
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import zone_notes
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from tests.campaigns.zones import answered
from tests.support.zone_files import WRITERS, Ring

INLINE = "mission file"
FORMATS = [*WRITERS, INLINE]
ZONE_LESS = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}}


def band(west: float, east: float, south: float, north: float, pieces: int = 1) -> list[tuple[float, float]]:
    along = [west + (east - west) * i / pieces for i in range(pieces + 1)]
    return [(x, south) for x in along] + [(x, north) for x in reversed(along)]


def inline(ring: Ring, lon: float, lat: float) -> dict[str, Any]:
    vehicle = {"name": "u", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15], "start": [lat, lon],
               "goal": [lat + 0.01, lon]}  # fmt: skip
    return ZONE_LESS | {"vehicles": [vehicle], "no_fly": [{"name": "z", "polygon": [[y, x] for x, y in ring]}]}


def verdict(folder: Path, form: str, lon: float, lat: float, *rings: Ring) -> str:
    """``inside``, ``free``, or why a mission at the place is refused."""
    try:
        if form == INLINE:
            source = inline(rings[0], lon, lat)
            return "inside" if load_mission(source).zones else "free"
        found = read_zones(WRITERS[form](folder, [[ring] for ring in rings]), where="zones")
    except InputError as why:
        if why.problems[0].message.startswith("the start lies inside the no-fly zone 'z'"):
            return "inside"
        return "\n".join(p.message for p in why.problems)
    if found.problems:
        return found.problems[0].message
    answer = answered(used(found.zones), Frame(lat, lon), lon, lat)
    faults = [fault.message for draft in found.zones for fault in draft.faults]
    return (faults[0] if faults else "on the other side") if answer is None else "inside" if answer else "free"


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("ring", [band(-170.0, 170.0, 30.0, 60.0), band(-95.0, 95.0, 30.0, 60.0)], ids=["340", "190"])
def test_an_edge_of_half_a_turn_is_refused_and_says_what_to_write(tmp_path: Path, form: str, ring: Ring) -> None:
    said = verdict(tmp_path, form, 14.49, 46.03, ring)
    assert "of longitude, and from 180° on it may run on either side of the globe" in said
    assert form == "mercator" or f"write {ring[0][0] + 360.0:g} for {ring[0][0]:g}" in said


@pytest.mark.parametrize("form", FORMATS)
def test_a_wide_polygon_with_corners_between_is_read_as_drawn(tmp_path: Path, form: str) -> None:
    ring = band(-170.0, 170.0, 30.0, 60.0, 4)
    assert verdict(tmp_path, form, 14.49, 46.03, ring) == "inside"
    if form != INLINE:  # where a zone so far away is a mistake
        assert verdict(tmp_path, form, 176.0, 46.03, ring) == "free"


@pytest.mark.parametrize("form", [form for form in WRITERS if form != "openair"])
@pytest.mark.parametrize("pieces", [1, 3])
def test_a_world_with_a_hole_is_called_a_keep_in_area(tmp_path: Path, form: str, pieces: int) -> None:
    outer, hole = band(-180.0, 180.0, -85.0, 85.0, pieces), band(14.0, 15.0, 45.5, 46.5)
    found = read_zones(WRITERS[form](tmp_path, [[outer, hole]]), where="zones")
    if form not in ("ed269", "ed318", "openaip"):  # no authority's: the hole is read as what it is
        assert not found.problems
        assert [draft.keep_in for draft in found.zones] == [True]
        return
    said = [*found.problems, *(fault for draft in found.zones for fault in draft.faults)]
    assert "is a keep-in area" in said[0].message
    assert "zone 'z'" in said[0].message
    if found.zones:  # an authority's file: a mission anywhere in it is refused
        assert answered(found.zones, Frame(46.0, 14.5), 14.5, 46.0) is None


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("turn", [0.0, 360.0, -360.0])
def test_longitudes_of_either_convention_are_read(tmp_path: Path, form: str, turn: float) -> None:
    if (turn and form == "mercator") or (turn < 0.0 and form == "openair"):
        pytest.skip("metres of Web Mercator have no turns, and OpenAir no longitudes below -180°")
    lon = -20.0 if turn > 0.0 else 20.0
    ring = [(x + turn, y) for x, y in band(lon - 0.05, lon + 0.05, 46.0, 46.1)]
    assert verdict(tmp_path, form, lon, 46.05, ring) == "inside"


@pytest.mark.first_quick
@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("lon", [179.96, -179.96])
def test_across_the_antimeridian(tmp_path: Path, form: str, lon: float) -> None:
    """Past it, split at it, or as an edge from 179.9 to -179.9."""
    past, south, north = band(179.9, 180.1, -16.1, -16.0), -16.1, -16.0
    assert form == "mercator" or verdict(tmp_path, form, lon, -16.05, past) == "inside"
    if form != INLINE:
        split = band(179.9, 180.0, south, north), band(-180.0, -179.9, south, north)
        assert verdict(tmp_path, form, lon, -16.05, *split) == "inside"
    if form != "mercator":
        written = [(x - 360.0 if x > 180.0 else x, y) for x, y in past]
        assert verdict(tmp_path, form, lon, -16.05, written) == "inside"
        if form != INLINE:
            assert verdict(tmp_path, form, 14.0, -16.05, written) == "on the other side"
            assert verdict(tmp_path, form, 14.0, 46.0, written) == "free"


def test_a_polygon_read_as_across_the_antimeridian_says_so(tmp_path: Path) -> None:
    ring = [(179.9, -16.1), (-179.9, -16.1), (-179.9, -16.0), (179.9, -16.0)]
    found = read_zones(WRITERS["geojson"](tmp_path, [[ring]]), where="zones")
    (note,) = zone_notes([(draft, None) for draft in found.zones])
    assert note == Note("zone_across_the_antimeridian", file="z.geojson", zones=("z",))


@pytest.mark.parametrize("form", FORMATS)
def test_a_mask_that_leaves_out_the_antimeridian_is_no_strip_across_it(tmp_path: Path, form: str) -> None:
    assert "180" in verdict(tmp_path, form, 179.0, 10.0, band(-179.9, 179.9, -60.0, 60.0)) or form == "mercator"


@pytest.mark.parametrize("form", [form for form in FORMATS if form != "mercator"])
def test_a_zone_around_a_pole(tmp_path: Path, form: str) -> None:
    """It goes to the pole, or is refused: without the pole it may be either cap."""
    lons = [-180.0 + 60.0 * i for i in range(7)]
    cap = [*((x, 70.0) for x in lons), (180.0, 90.0), (-180.0, 90.0)]
    assert verdict(tmp_path, form, 14.0, 80.0, cap) == "inside"
    said = verdict(tmp_path, form, 14.0, 80.0, [(x, 70.0) for x in lons[:-1]])
    assert "has corners at the pole" in said


@pytest.mark.parametrize("form", ["kml", "openair", "ed269"])
def test_formats_without_straight_edges_hold_great_circles_too(tmp_path: Path, form: str) -> None:
    """Between 0 and 20 degrees east the great circle along 50° N is 0.43° farther north in its middle."""
    ring = band(0.0, 20.0, 48.0, 50.0)
    assert verdict(tmp_path, form, 10.0, 50.4, ring) == "inside"
    assert verdict(tmp_path, form, 10.0, 48.1, ring) == "inside"  # straight: its southern edge bends, too
    assert verdict(tmp_path, form, 10.0, 50.5, ring) == "free"
    assert verdict(tmp_path, "geojson", 10.0, 50.4, ring) == "free"


@pytest.mark.parametrize("form", ["kml", "openair", "ed269"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_great_circles_to_a_pole_are_meridians(tmp_path: Path, form: str, sign: float) -> None:
    """A sector of 80° whose tip is at the pole, with one corner there: along meridians it is as wide everywhere."""
    sector = [(-40.0, sign * 60.0), (40.0, sign * 60.0), (0.0, sign * 90.0)]
    assert [verdict(tmp_path, form, lon, sign * 80.0, sector) for lon in (0.0, 35.0, 41.0)] == [
        "inside", "inside", "free"
    ]  # fmt: skip
    assert verdict(tmp_path, "geojson", 35.0, sign * 80.0, sector) == "free"


@pytest.mark.parametrize("form", ["openair", "ed269"])
def test_an_outline_that_crosses_itself_encloses_what_its_great_circles_do(tmp_path: Path, form: str) -> None:
    """Its crossing along great circles is elsewhere: the long edge passes 94.39° E at 45.29° S, not at 45.24° S."""
    ring = [(97.74168, -45.46888), (95.50235, -45.3459), (91.69018, -44.53826), (91.98307, -45.07078)]
    assert verdict(tmp_path, form, 94.392409, -45.259130, ring) == "inside"
    assert verdict(tmp_path, form, 94.392409, -45.32, ring) == "free"


@pytest.mark.parametrize("form", ["openair", "ed269"])
def test_an_authority_s_edge_of_half_a_turn_refuses_no_mission_far_from_it(tmp_path: Path, form: str) -> None:
    """Great circles between its corners, 20° apart by the shorter way, reach 30.4° N."""
    ring = band(-170.0, 170.0, 20.0, 30.0)
    assert "spans 340° of longitude" in verdict(tmp_path, form, 14.49, 30.3, ring)
    assert verdict(tmp_path, form, 14.49, 46.03, ring) == "free"
    assert verdict(tmp_path, form, 14.49, 10.0, ring) == "free"


@pytest.mark.parametrize("crs", ["EPSG:3413", "EPSG:3995", "EPSG:3031", "EPSG:32661"])
def test_a_polygon_around_a_pole_in_a_polar_system_is_refused_by_name(tmp_path: Path, crs: str) -> None:
    import pyogrio
    import shapely
    from pyproj import Transformer

    pole = -90.0 if crs == "EPSG:3031" else 90.0
    x, y = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(0.0, pole)
    square = shapely.box(x - 1e6, y - 1e6, x + 1e6, y + 1e6)
    pyogrio.raw.write(
        tmp_path / "z.gpkg", shapely.to_wkb(np.array([square], dtype=object)), [np.array(["cap"], dtype=object)],
        ["name"], geometry_type="Polygon", crs=crs,
    )  # fmt: skip
    (problem,) = read_zones(tmp_path / "z.gpkg", where="zones").problems
    assert problem.message == "zone 'cap': the outline goes around a pole: cut the zone there in two"


@pytest.mark.parametrize("form", [form for form in WRITERS if form != "openair"])
def test_rings_in_the_wrong_order_are_no_small_zone(tmp_path: Path, form: str) -> None:
    """A hole before its outline: read as it stands, the zone would be as small as the hole."""
    outline, hole = band(14.0, 15.0, 45.5, 46.5), band(14.4, 14.6, 45.9, 46.1)
    assert verdict_of(tmp_path, form, [outline, hole], 14.2, 46.0) == "inside"
    swapped = verdict_of(tmp_path, form, [hole, outline], 14.2, 46.0)
    assert "put the outline first and holes after it" in swapped or (form, swapped) == ("shp", "inside")  # GDAL sorts
    west = [[(x - 194.5, y) for x, y in ring] for ring in (outline, hole)]  # across the 180° meridian
    turned = [west[0], [(x + 360.0, y) for x, y in west[1]]]
    if form not in ("mercator", "nad83", "gpkg", "shp"):
        assert verdict_of(tmp_path, form, turned, 179.8, 46.0) == "inside"


def verdict_of(folder: Path, form: str, part: Sequence[Ring], lon: float, lat: float) -> str:
    """As `verdict`, of one polygon with its rings."""
    try:
        found = read_zones(WRITERS[form](folder, [part]), where="zones")
    except InputError as why:
        return str(why)
    if found.problems:
        return found.problems[0].message
    answer = answered(used(found.zones), Frame(lat, lon), lon, lat)
    return "refused" if answer is None else "inside" if answer else "free"


def test_a_line_has_no_edge_of_half_a_turn_either(tmp_path: Path) -> None:
    path = tmp_path / "z.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[-95, 46], [95, 46]]}')
    (problem,) = read_zones(path, where="zones", buffer_m=50.0).problems or [None]
    assert problem is not None
    assert "spans 190° of longitude" in problem.message
