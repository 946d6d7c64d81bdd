"""Units, directions and voids of heights, wherever a file or a key states them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from pyproj import CRS

from gcsplan.errors import InputError
from gcsplan.world.geodesy.datum import stated_datum, take_apart
from gcsplan.world.geodesy.height_unit import unit_named
from gcsplan.world.geodesy.reprojection import ToDegrees
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.voids import zero_voids
from tests.world.terrain.test_terrain import FRAME, degrees_tif, hills, load, refusal, tif

FOOT, US_FOOT = 0.3048, 1200 / 3937
UPWARDS = {  # code: metres of its unit, name
    5773: (1.0, "EGM96"), 3855: (1.0, "EGM2008"), 5703: (1.0, "NAVD88"), 6360: (US_FOOT, "NAVD88"),
    8228: (FOOT, "NAVD88"), 5702: (US_FOOT, "NGVD29"), 7837: (1.0, "DHHN2016"), 5714: (1.0, "AMSL"),
    8050: (FOOT, "AMSL"), 5798: (1.0, "EGM84"), 5711: (1.0, "AHD"), 5728: (1.0, "LN02"), 5621: (1.0, "EVRF2007"),
    6130: (FOOT, "GCVD54"),
}  # fmt: skip
DEPTHS, OTHER_ZEROS = (
    (5715, 6358, 6357, 6359, 8051, 8053, 5861, 5866),
    (5868, 5872, 5874, 5829, 5611, 8881, 5797, 5754, 7979, 7652),
)


def notes_of(surface: Surface) -> str:
    return "\n".join(map(str, notes_on(surface.info)))


def is_times(surface: Surface, heights: Any, metres: float) -> bool:
    """Whether a surface holds a part of ``heights`` times ``metres``."""
    rows, cols = surface.ground_m.shape
    return any(
        math.isclose(heights[r, c] * metres, surface.ground_m[0, 0], rel_tol=1e-9, abs_tol=1e-9)
        and np.allclose(heights[r : r + rows, c : c + cols] * metres, surface.ground_m, rtol=1e-9, atol=1e-9)
        for r in range(101 - rows)
        for c in range(101 - cols)
    )


@pytest.mark.nightly_but("6130", "5798", "5621", "7837")
@pytest.mark.slow
@pytest.mark.parametrize("code", UPWARDS)
def test_a_vertical_code_has_its_unit_wherever_it_stands(tmp_path: Path, code: int) -> None:
    metres, name = UPWARDS[code]
    heights = np.round(hills(100, 100))
    plain = degrees_tif(tmp_path / "a.tif", heights)
    compound = degrees_tif(tmp_path / "b.tif", heights, crs=f"EPSG:4326+{code}")
    for surface in (
        load(plain, vertical_datum=f"EPSG:{code}"),
        load(compound, vertical_datum=None),
        load(plain, crs=f"EPSG:4326+{code}", vertical_datum=None),
    ):
        assert is_times(surface, heights, metres)
        assert surface.info["vertical_datum"] == name
        assert ("heights are" in notes_of(surface)) == (metres != 1.0)


@pytest.mark.parametrize("code", [*DEPTHS, *OTHER_ZEROS])
def test_what_counts_down_or_from_another_zero_is_refused_by_name(tmp_path: Path, code: int) -> None:
    from pyproj import CRS

    for keys, crs in (
        ({"vertical_datum": f"EPSG:{code}"}, "EPSG:4326"),
        ({"vertical_datum": None}, f"EPSG:4326+{code}"),
    ):
        error = refusal(degrees_tif(tmp_path / f"{crs[-4:]}.tif", crs=crs), **keys)
        assert repr(CRS.from_epsg(code).name) in str(error)
        assert ("downwards" if code in DEPTHS else "mean sea level") in str(error)


@pytest.mark.slow
def test_a_datum_is_known_by_its_exact_name_too() -> None:
    datum, unit = stated_datum("NAVD88 height (ftUS)", where="m")
    assert (datum.name, unit is not None and unit.metres) == ("NAVD88", pytest.approx(US_FOOT))
    assert stated_datum("EPSG:4326+8228", where="m")[1].metres == FOOT  # type: ignore[union-attr]
    for words in ("NAVD88 heigt", "+proj=longlat", "EPSG:4326", "Newlyn"):  # Newlyn is a datum that PROJ would take
        with pytest.raises(InputError):
            stated_datum(words, where="m")


@pytest.mark.parametrize(
    ("words", "metres"),
    [("ft", FOOT), ("Feet", FOOT), ("foot (international)", FOOT), ("US survey foot", US_FOOT), ("ftUS", US_FOOT),
     ("us-ft", US_FOOT), ("Foot_US", US_FOOT), ("US Survey Feet", US_FOOT), ("survey foot", US_FOOT), ("M", 1.0),
     ("Metres", 1.0), ("decimeter", 0.1), ("cm", 0.01), ("km", 1000.0), ("fathom", None), ("degree", None),
     ("m/10", None), ("10 m", None), ("0.1 ft", None), ("m*100", None), ("m/s", None)],
)  # fmt: skip
def test_the_words_of_units(words: str, metres: float | None) -> None:
    unit = unit_named(words)
    assert (None if unit is None else unit.metres) == metres


@pytest.mark.parametrize("code", ["EPSG:9267", "EPSG:4985", "ESRI:115921", "ESRI:115908", "ESRI:115875"])
def test_ellipsoidal_heights_on_another_ellipsoid_are_refused_by_name(code: str) -> None:
    """MGI and CH1903+ are on Bessel's, tens of metres away; WGS 72 some metres."""
    with pytest.raises(InputError, match="count from another ellipsoid than WGS 84's"):
        stated_datum(code, where="m")


@pytest.mark.parametrize("code", ["EPSG:4979", "EPSG:4937", "ESRI:115700", "ESRI:115702", "EPSG:9701"])
def test_ellipsoidal_heights_of_datums_like_wgs84_are_known(code: str) -> None:
    datum, _ = stated_datum(code, where="m")
    assert datum.ellipsoidal is True


def test_a_geocentric_system_has_no_heights() -> None:
    with pytest.raises(InputError, match="has no axis of heights"):
        stated_datum("EPSG:4978", where="m")


WGS84_WKT = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)
NAVD88_SHIFTED = (
    'VERTCRS["Site",BASEVERTCRS["NAVD88 height",VDATUM["North American Vertical Datum 1988"]],'
    'DERIVINGCONVERSION["offset",METHOD["Vertical Offset"],PARAMETER["Vertical Offset",-100,LENGTHUNIT["metre",1]]],'
    'CS[vertical,1],AXIS["up",up],LENGTHUNIT["metre",1]]'
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vertical", "words"),
    [
        ('VERT_CS["Site 7",VERT_DATUM["Site 7",2005],UNIT["metre",1],AXIS["Up",UP]]', "'Site 7', which no register"),
        ('VERT_CS["unnamed",VERT_DATUM["unnamed",2005],UNIT["metre",1],AXIS["Up",UP]]', "which no register knows"),
        (NAVD88_SHIFTED, "'Site' are shifted from 'NAVD88 height'"),
    ],
)
def test_a_vertical_system_of_a_file_s_own_is_refused_by_name(vertical: str, words: str) -> None:
    if vertical.startswith("VERTCRS"):
        from pyproj import CRS

        whole = f'COMPOUNDCRS["x",{CRS.from_epsg(4326).to_wkt()},{vertical}]'
    else:
        whole = f'COMPD_CS["x",{WGS84_WKT},{vertical}]'
    with pytest.raises(InputError, match=re.escape(words)):
        take_apart(whole, where="dem")


def test_esri_s_shift_of_heights_is_not_forgotten(tmp_path: Path) -> None:
    """Libraries read the system of an .asc without the parameter."""
    esri = (
        'GEOGCS["GCS_WGS_1984",DATUM["D_WGS_1984",SPHEROID["WGS_1984",6378137.0,298.257223563]],'
        'PRIMEM["Greenwich",0.0],UNIT["Degree",0.0174532925199433]],VERTCS["EGM96_Geoid",VDATUM["EGM96_Geoid"],'
        'PARAMETER["Vertical_Shift",{}],PARAMETER["Direction",1.0],UNIT["Meter",1.0]]'
    )
    lat, lon = FRAME.lat_deg, FRAME.lon_deg
    head = f"ncols 100\nnrows 100\nxllcorner {lon - 0.05!r}\nyllcorner {lat - 0.05!r}\ncellsize 0.001\n"
    path = tmp_path / "a.asc"
    path.write_text(head + "\n".join(" ".join(["700"] * 100) for _ in range(100)))
    (tmp_path / "a.prj").write_text(esri.format("0.0"))
    assert load(path, vertical_datum=None).info["vertical_datum"] == "EGM96"
    (tmp_path / "a.prj").write_text(esri.format("100.0"))
    assert "is shifted by 100.0 (Vertical_Shift)" in str(refusal(path, vertical_datum=None))


@pytest.mark.parametrize(
    ("zunits", "metres"), [("FEET", FOOT), ("METERS", 1.0), ("1", 1.0), ("NO", 1.0), ("10", None), ("YARDS", None)]
)
def test_the_unit_of_heights_of_an_arcinfo_prj(tmp_path: Path, zunits: str, metres: float | None) -> None:
    """GDAL does not look at it."""
    lat, lon = FRAME.lat_deg, FRAME.lon_deg
    head = f"ncols 100\nnrows 100\nxllcorner {lon - 0.05!r}\nyllcorner {lat - 0.05!r}\ncellsize 0.001\n"
    path = tmp_path / "a.asc"
    path.write_text(head + "\n".join(" ".join(["700"] * 100) for _ in range(100)))
    (tmp_path / "a.prj").write_text(
        f"Projection    GEOGRAPHIC\nDatum WGS84\nZunits        {zunits}\nUnits DD\nParameters\n"
    )
    if metres is None:
        assert f"gives heights in '{zunits}', which is not known" in str(refusal(path))
    else:
        assert np.nanmax(load(path).ground_m) == pytest.approx(700.0 * metres)
        assert np.nanmax(load(path, crs="EPSG:4326").ground_m) == pytest.approx(700.0 * metres)
    assert np.nanmax(load(path, height_unit="us_ft").ground_m) == pytest.approx(700.0 * US_FOOT)


@pytest.mark.first_quick
@pytest.mark.parametrize("code", [*DEPTHS[:3], *OTHER_ZEROS[:3]])
def test_a_key_for_the_grid_does_not_change_what_the_file_says_of_heights(tmp_path: Path, code: int) -> None:
    """Depths were read as heights, with a unit "from the file"."""
    path = degrees_tif(tmp_path / "a.tif", crs=f"EPSG:4326+{code}")
    error = str(refusal(path, crs="EPSG:4326"))
    assert "counts depths" in error if code in DEPTHS else "do not count from mean sea level" in error
    assert "state both parts with `crs:`, such as EPSG:4326+5773" in error
    assert load(path, crs="EPSG:4326+5773", height_unit="m").info["vertical_datum"] == "EGM96"


@pytest.mark.nightly
def test_a_key_for_the_grid_leaves_the_file_s_datum_and_unit(tmp_path: Path) -> None:
    heights = np.round(hills(100, 100))
    ellipsoidal = degrees_tif(tmp_path / "a.tif", heights, crs="EPSG:4979")
    assert "the raster itself states WGS 84 ellipsoidal" in str(refusal(ellipsoidal, crs="EPSG:4326"))
    assert is_times(load(ellipsoidal, crs="EPSG:4326+5773"), heights, 1.0)
    feet = degrees_tif(tmp_path / "b.tif", heights, crs="EPSG:4326+6360")
    surface = load(feet, crs="EPSG:4326", vertical_datum=None)
    assert is_times(surface, heights, US_FOOT)
    assert surface.info["vertical_datum"] == "NAVD88"


@pytest.mark.nightly
def test_tiles_in_feet_do_not_lend_their_unit_to_one_that_states_none(tmp_path: Path) -> None:
    heights = np.round(hills(100, 100)) + 300.0
    a = degrees_tif(tmp_path / "a.tif", heights, units=("ft",))
    b = degrees_tif(tmp_path / "b.tif", heights)
    for order in ((a, b), (b, a)):
        said = str(refusal(order))
        assert "heights of a.tif are feet, from the file, and nothing states the unit of b.tif" in said
        assert "`height_unit: ft`" in said
        assert is_times(load(order, height_unit="ft"), heights, FOOT)
    c = degrees_tif(tmp_path / "c.tif", heights, units=("m",))
    assert "metres, from the file and metres, no unit is stated" in str(load((c, b)).info["heights_read"])
    both = load((a, c))  # each says its own
    assert both.differs


@pytest.mark.nightly
def test_a_grid_in_feet_needs_the_unit_of_its_heights(tmp_path: Path) -> None:
    heights = np.round(hills(400, 400))
    # North Carolina's grid in US survey feet, around the frame's place.
    path = tif(tmp_path / "a.tif", heights, Affine(300.0, 0.0, 880_000.0, 0.0, -300.0, 710_000.0), crs="EPSG:2264")
    from gcsplan.world.geodesy.frame import Frame

    frame = Frame(35.6, -82.5)
    error = refusal(path, frame=frame, box=(-500.0, -500.0, 500.0, 500.0), vertical_datum="NAVD88")
    assert "US survey feet" in str(error)
    assert "`height_unit: us_ft`" in str(error)
    for keys in ({"height_unit": "m"}, {"vertical_datum": "EPSG:5703"}):
        read = load(path, frame=frame, box=(-500.0, -500.0, 500.0, 500.0), **({"vertical_datum": "NAVD88"} | keys))
        assert read.info["heights_read"].startswith("metres, by ")  # type: ignore[attr-defined]


def test_the_key_counts_before_what_the_file_states_and_says_so(tmp_path: Path) -> None:
    heights = np.round(hills(100, 100))
    path = degrees_tif(tmp_path / "a.tif", heights, units=("ft",))
    surface = load(path, height_unit="m")
    assert is_times(surface, heights, 1.0)
    assert "heights are metres by height_unit, in place of feet (from the file)" in notes_of(surface)
    assert is_times(
        load(degrees_tif(tmp_path / "b.tif", heights, units=("fathom",)), height_unit="us_ft"), heights, US_FOOT
    )
    error = refusal(path, vertical_datum="EPSG:6360")
    assert "two units" in str(error)
    assert "height_unit" in str(error)


def test_one_line_says_how_heights_were_read(tmp_path: Path) -> None:
    surface = load(degrees_tif(tmp_path / "a.tif", np.full((100, 100), 1000.0), units=("US survey foot",)))
    line = surface.info["heights_read"]
    assert line == "US survey feet, from the file; EGM96; ground 304–305 m AMSL"
    below = load(degrees_tif(tmp_path / "b.tif", np.linspace(-420.0, -400.0, 10000).reshape(100, 100)))
    assert "ground -4" in str(below.info["heights_read"])
    assert " to -4" in str(below.info["heights_read"])


@pytest.mark.nightly
def test_older_geotiffs_keep_their_vertical_part(tmp_path: Path) -> None:
    heights = np.round(hills(100, 100))
    for version in ("1.0", "1.1"):
        path = degrees_tif(tmp_path / f"{version}.tif", heights, crs="EPSG:4326+8228", GEOTIFF_VERSION=version)
        assert load(path, vertical_datum=None).info["vertical_datum"] == "NAVD88"
        assert "5715" not in str(refusal(degrees_tif(tmp_path / "d.tif", heights, crs="EPSG:4326+5715",
                                                     GEOTIFF_VERSION=version)))  # fmt: skip


# -- voids ------------------------------------------------------------------------------------------------------------


def holed(value: float, beside: float = 0.0) -> Any:
    """Hills with a patch of ``value`` in the middle, and one node of its edge at ``beside`` if that is not 0."""
    heights = np.round(hills(100, 100)) + 200.0
    heights[40:60, 40:60] = value
    if beside:
        heights[60, 50] = beside
    return heights


@pytest.mark.nightly
def test_a_patch_of_zeros_without_a_shore_is_a_void_and_named(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif", holed(0.0))
    surface = load(path)
    unknown = int(np.isnan(surface.ground_m).sum())
    assert unknown > 100
    assert f"{unknown} DEM nodes of exactly 0 m" in notes_of(surface)
    assert "`nodata: none`" in notes_of(surface)
    assert not np.isnan(load(path, nodata="none").ground_m).any()
    assert np.isnan(load(path, nodata=0.0).ground_m).sum() == unknown
    assert "undeclared" not in notes_of(load(path, nodata=0.0))


@pytest.mark.nightly
def test_sea_and_lakes_with_a_shore_are_ground(tmp_path: Path) -> None:
    for beside in (5.0, -5.0, 0.3):
        assert not np.isnan(load(degrees_tif(tmp_path / "a.tif", holed(0.0, beside))).ground_m).any()
    assert np.isnan(load(degrees_tif(tmp_path / "b.tif", holed(0.0, 5.5))).ground_m).any()
    assert not np.isnan(load(degrees_tif(tmp_path / "c.tif", np.zeros((100, 100)))).ground_m).any()
    assert not np.isnan(load(degrees_tif(tmp_path / "d.tif", holed(1.0))).ground_m).any()


@pytest.mark.parametrize(("beside", "unknown"), [(0.0, True), (3.0, False)])
def test_zeros_that_fill_the_window_are_followed_beyond_it(tmp_path: Path, beside: float, unknown: bool) -> None:
    """A void of 18 km; the mission sees nothing but zeros."""
    heights = np.round(hills(400, 400)) + 300.0
    heights[100:300, 100:300] = 0.0
    heights[300, 150] = beside or 300.0
    lat, lon = FRAME.lat_deg, FRAME.lon_deg
    path = tif(tmp_path / "a.tif", heights, Affine(0.001, 0.0, lon - 0.2, 0.0, -0.001, lat + 0.2), crs="EPSG:4326")
    box = (-500.0, -500.0, 500.0, 500.0)
    if unknown:
        assert "nothing but voids" in str(refusal(path, box=box))
        assert not np.isnan(load(path, box=box, nodata="none").ground_m).any()
    else:
        surface = load(path, box=box)
        assert not surface.ground_m.any()
        assert "exactly 0" not in notes_of(surface)


def test_zeros_without_an_end_are_named(tmp_path: Path) -> None:
    sea = load(degrees_tif(tmp_path / "c.tif", np.zeros((100, 100))))
    assert "of exactly 0 m, around which nothing else is known, count as sea or ground" in notes_of(sea)


@pytest.mark.parametrize(
    ("dtype", "value", "unit"),
    [("int32", -9999, "cm"), ("int16", 32767, "cm"), ("int16", -32767, "cm"), ("uint16", 65535, "cm"),
     ("float32", -9999.0, "cm"), ("int16", -32768, "cm")],
)  # fmt: skip
def test_marks_of_voids_are_voids_in_any_unit(tmp_path: Path, dtype: str, value: float, unit: str) -> None:
    heights = np.round(hills(100, 100) % 100.0 * 100.0 + 500.0)
    heights[40:60, 40:60] = value
    surface = load(degrees_tif(tmp_path / "a.tif", heights.astype(dtype), units=(unit,)))
    assert np.isnan(surface.ground_m).sum() > 100
    assert np.nanmin(surface.ground_m) >= 5.0


@pytest.mark.parametrize(
    ("dtype", "value"), [("float32", -3.4e38), ("int16", -9999), ("float32", 77.7), ("uint8", 255)]
)
def test_another_void_is_declared_by_nodata(tmp_path: Path, dtype: str, value: float) -> None:
    heights = np.round(hills(100, 100)) % 200 + 1.0
    heights[40:60, 40:60] = value
    path = degrees_tif(tmp_path / "a.tif", heights.astype(dtype))
    assert np.isnan(load(path, nodata=value).ground_m).sum() > 100


def test_patches_of_zeros_by_brute_force() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        z = rng.choice([0.0, 0.0, 0.0, 30.0, 4.0, -50.0, np.nan], (6, 7), p=[0.2, 0.2, 0.1, 0.25, 0.05, 0.15, 0.05])
        wanted = np.zeros(z.shape, bool)
        seen = np.zeros(z.shape, bool)
        for at in zip(*np.nonzero(z == 0.0), strict=True):
            if seen[at]:
                continue
            patch, queue, beside = [], [at], []
            seen[at] = True
            while queue:
                i, j = queue.pop()
                patch.append((i, j))
                for a in range(max(i - 1, 0), min(i + 2, 6)):
                    for b in range(max(j - 1, 0), min(j + 2, 7)):
                        if z[a, b] != 0.0:
                            beside.append(abs(z[a, b]))
                        elif not seen[a, b]:
                            seen[a, b] = True
                            queue.append((a, b))
            known = [x for x in beside if x == x]
            if known and min(known) > 5.0:
                for p in patch:
                    wanted[p] = True
        assert np.array_equal(zero_voids(z)[0], wanted)


@pytest.mark.parametrize(
    "crs",
    [
        "+proj=utm +zone=33 +ellps=bessel +nadgrids=./x.gsb +units=m", "+proj=longlat +ellps=bessel +nadgrids=@x.gsb",
        "+proj=longlat +ellps=bessel +nadgrids=@null,/a/x.gsb",
        CRS("+proj=longlat +ellps=bessel +nadgrids=x.gsb").to_wkt(),
        CRS("+proj=longlat +ellps=bessel +nadgrids=x.gsb").to_json(),
    ],
)  # fmt: skip
def test_a_system_that_names_a_file_of_shifts_is_refused(crs: str) -> None:
    """PROJ would read it from wherever it finds it, and silently take none if it is not there."""
    for read in (lambda: take_apart(crs, where="terrain.crs"), lambda: ToDegrees(crs, (15.0, 46.0), where="z.shp")):
        with pytest.raises(InputError, match=r"names a file of shifts, '(\./|/a/)?x\.gsb', which is not read"):
            read()


def test_a_system_without_shifts_is_taken() -> None:
    assert take_apart("+proj=longlat +ellps=WGS84 +nadgrids=@null", where="crs").geographic
    assert take_apart("EPSG:3857", where="crs").horizontal.is_projected
