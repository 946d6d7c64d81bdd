"""How heights are read, as keys and as options, in what `plan`, `check` and `new` say."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.dem.test_dat_terrain import write as write_dat
from tests.world.terrain.test_terrain import degrees_tif

MISSION = """version: 1
terrain: {{dem: {dem}, {keys}}}
limits: {{min_agl_m: 60, max_climb_deg: 20}}
vehicles:
  - {{name: uav1, sysid: 1, autopilot: arducopter, start: [36.5, -84.5], goal: [36.51, -84.49]}}
"""
FEET = np.full((100, 100), 1000.0)


def mission(folder: Path, keys: str, dem: str = "a.tif") -> str:
    (folder / "m.yaml").write_text(MISSION.format(dem=dem, keys=keys), encoding="utf-8")
    return "m.yaml"


@pytest.fixture
def tiles(tmp_path: Path) -> Path:
    degrees_tif(tmp_path / "a.tif", FEET, units=("ft",))
    west, east = FEET.copy(), FEET + 60.0
    degrees_tif(tmp_path / "b.tif", west)
    degrees_tif(tmp_path / "c.tif", east)
    return tmp_path


@pytest.mark.slow
def test_plan_check_and_report_say_it_in_one_line(run: Any, tiles: Path) -> None:
    line = "heights: feet, from the file; EGM96; ground 304–305 m AMSL"
    code, _, err = run("plan", mission(tiles, "vertical_datum: EGM96"), "-o", "o", "--report")
    assert (code, err.count(line)) == (0, 1)
    assert "note: a.tif: heights are feet, from the file" in err
    assert line.removeprefix("heights: ") in (tiles / "o" / "report.html").read_text(encoding="utf-8")
    assert json.loads((tiles / "o" / "summary.json").read_text())["inputs"]["heights_read"] == line.removeprefix(
        "heights: "
    )
    assert line in run("check", "m.yaml", "o/uav1.plan")[2]
    options = ("--dem", "a.tif", "--vertical-datum", "EGM96", "--min-agl", "60")
    assert line in run("check", "o/uav1.plan", *options)[2]
    told = json.loads(run("check", "o/uav1.plan", *options, "--json")[1])
    assert told["inputs"]["heights_read"] == line.removeprefix("heights: ")


@pytest.mark.slow
def test_the_options_count_before_the_mission_and_the_file(run: Any, tiles: Path) -> None:
    plain = mission(tiles, "vertical_datum: EGM96")
    code, _, err = run("plan", plain, "-o", "o", "--height-unit", "m", "--vertical-datum", "NAVD88")
    assert code == 0
    assert "heights: metres, by height_unit; NAVD88; ground 1000 m AMSL" in err
    assert "in place of feet (from the file)" in err
    assert run("check", plain, "o/uav1.plan", "--height-unit", "m")[0] == 0
    assert "ground 304–305 m" in run("check", plain, "o/uav1.plan")[2]
    _, _, err = run(
        "check", "o/uav1.plan", "--dem", "a.tif", "--vertical-datum", "EPSG:5773", "--min-agl", "60",
        "--height-unit", "us_ft", "--nodata", "none",
    )  # fmt: skip
    assert "heights: US survey feet, by height_unit; EGM96" in err
    for option, value, said in (("--height-unit", "yd", "m, ft or us_ft"), ("--nodata", "blue", "a number, or none")):
        code, _, err = run("plan", plain, option, value)
        assert code == 2
        assert said in err


def test_new_writes_them_into_the_mission(run: Any, tiles: Path) -> None:
    places = ("--start", "36.5,-84.5", "--goal", "36.51,-84.49")
    code, _, _ = run(
        "new", *places, "--dem", "a.tif", "--vertical-datum", "EGM96", "--height-unit", "ft", "--nodata", "0"
    )
    assert code == 0
    text = (tiles / "mission.yaml").read_text(encoding="utf-8")
    assert "\n  height_unit: ft\n" in text
    assert "\n  nodata: 0\n" in text


@pytest.mark.slow
def test_a_void_of_zeros_is_named_where_it_leaves_no_mission(run: Any, tiles: Path) -> None:
    heights = FEET.copy()
    heights[:, 58:60] = 0.0
    degrees_tif(tiles / "a.tif", heights)
    (tiles / "w.yaml").write_text(
        MISSION.format(dem="a.tif", keys="vertical_datum: EGM96").replace("[36.51, -84.49]", "[36.5, -84.46]"),
        encoding="utf-8",
    )
    code, _, err = run("plan", "w.yaml", "-o", "o")
    assert code == 3
    assert "exactly 0 m" in err
    assert "`nodata: none`" in err
    assert run("plan", "w.yaml", "-o", "o", "--nodata", "none")[0] in (0, 3)


@pytest.mark.slow
def test_a_home_over_tiles_that_differ_is_refused_and_not_judged(run: Any, tiles: Path) -> None:
    assert run("plan", mission(tiles, "vertical_datum: EGM96", "b.tif"), "-o", "o")[0] == 0
    code, _, err = run("plan", mission(tiles, "vertical_datum: EGM96", "[b.tif, c.tif]"), "-o", "both")
    assert code == 2
    assert "vehicles.uav1.start: the ground at home (36.5000000, -84.5000000) is not one number" in err
    assert "between 1000.0 m AMSL and 1060.0 m AMSL" in err
    assert "altitude_error_m of 60.0 m" in err
    code, out, _ = run("check", "m.yaml", "o/uav1.plan")
    assert code == 4
    assert "the ground at home" in out
    code, out, _ = run(
        "check", "o/uav1.plan", "--dem", "b.tif", "--dem", "c.tif", "--vertical-datum", "EGM96", "--min-agl", "60"
    )
    assert code == 4
    assert "the ground at home" in out
    assert "--altitude-error" in out


DAT_MISSION = """version: 1
terrain: {{dem: {dem}, vertical_datum: EGM96}}
limits: {{min_agl_m: 60, altitude_error_m: 3, track_error_m: 3}}
vehicles:
  - {{name: uav1, sysid: 1, autopilot: arducopter, start: [{lat}, -84.5], goal: [{lat}, -84.49]}}
"""


def slope(lat_deg: Any, lon_deg: Any) -> Any:
    """27° of slope, whose height at 36° N is 1500 m."""
    return 1500.0 + 0.5095 * 110_960.0 * (np.asarray(lat_deg) - 36.0) + 0.0 * np.asarray(lon_deg)


def rough(lat_deg: Any, lon_deg: Any) -> Any:
    """The slope with waves of 45 m in every 280 m."""
    return slope(lat_deg, lon_deg) + 45.0 * np.sin(np.asarray(lat_deg) * 2500.0) * np.cos(np.asarray(lon_deg) * 2500.0)


def dat_mission(folder: Path, dem: str, lat: float) -> str:
    (folder / f"{dem}.yaml").write_text(DAT_MISSION.format(dem=dem, lat=lat), encoding="utf-8")
    return f"{dem}.yaml"


@pytest.mark.parametrize("lat", [35.9998, 36.0002])
def test_dat_files_across_a_degree_line_on_a_slope_put_home_where_it_is(run: Any, tmp_path: Path, lat: float) -> None:
    """Both sides of the line have posts of their own, and the vehicle's items count from home's ground."""
    write_dat(tmp_path / "plain", lat, -84.5, reach_deg=0.06, ground=slope)
    assert run("plan", dat_mission(tmp_path, "plain", lat), "-o", "o")[0] == 0
    home, *items = [row.split("\t") for row in (tmp_path / "o" / "uav1.waypoints").read_text().splitlines()[1:]]
    true_m = float(slope(lat, -84.5))
    assert abs(float(home[10]) - true_m) < 1.5  # posts are whole metres, upwards
    flown = [row for row in items if row[3] == "16"]
    assert flown
    for row in flown:
        assert true_m + float(row[10]) - float(slope(float(row[8]), float(row[9]))) > 60.0
    assert run("check", "plain.yaml", "o/uav1.waypoints")[0] == 0


@pytest.mark.slow
def test_dat_files_without_one_height_at_home_are_refused_and_not_judged(run: Any, tmp_path: Path) -> None:
    lat = 35.9998
    for name, ground in (("plain", slope), ("rough", rough)):
        write_dat(tmp_path / name, lat, -84.5, reach_deg=0.06, ground=ground)
    assert run("plan", dat_mission(tmp_path, "plain", lat), "-o", "o")[0] == 0
    code, _, err = run("plan", dat_mission(tmp_path, "rough", lat), "-o", "r")
    assert code == 2
    assert "vehicles.uav1.start: the ground at home (35.9998000, -84.5000000) is not one number" in err
    assert not (tmp_path / "r").exists()
    code, out, _ = run("check", "rough.yaml", "o/uav1.waypoints")
    assert code == 4
    assert "not judged: the ground at home" in out
    assert "what helps is a home away from where they differ" in out
    away = lat - 0.01
    assert run("plan", dat_mission(tmp_path, "rough", away), "-o", "r")[0] == 0
