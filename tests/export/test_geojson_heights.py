"""`mission.geojson` of whole plans: one way point for each item that is flown, AMSL and ellipsoidal heights, AGL."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet import pipeline
from gcsplan.app.output import files as outputs
from gcsplan.mission_file import load_mission
from tests.support.paths import DATA, MISSIONS

GEOID = """
version: 1
terrain: {{dem: dem.asc, crs: "EPSG:4326", height_unit: m, vertical_datum: WGS84, geoid_grid: geoid.gtx}}
limits: {{min_agl_m: 40}}
vehicles:
  - {{name: uav1, sysid: 1, autopilot: {autopilot}, start: [36.50, -84.50], goal: [36.51, -84.49]}}
"""


def geoid_m(lat: float, lon: float) -> float:
    """Linear in degrees, so that the grid's interpolation is exact."""
    return -33.0 + 4.0 * (lat - 36.5) + 2.0 * (lon + 84.5)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A DEM of 500 m above the ellipsoid everywhere, and a geoid grid."""
    rows = "\n".join(" ".join(["500"] * 100) for _ in range(100))
    (tmp_path / "dem.asc").write_text(
        f"ncols 100\nnrows 100\nxllcorner -84.6\nyllcorner 36.4\ncellsize 0.002\nNODATA_value -9999\n{rows}\n"
    )
    lat, lon = np.meshgrid(36.0 + 0.25 * np.arange(5), -85.0 + 0.25 * np.arange(5), indexing="ij")
    heights = np.vectorize(geoid_m)(lat, lon).astype(">f4")
    (tmp_path / "geoid.gtx").write_bytes(struct.pack(">4d2i", 36.0, -85.0, 0.25, 0.25, 5, 5) + heights.tobytes())
    return tmp_path


def waypoints(mission: Path) -> list[dict[str, Any]]:
    plan = pipeline.plan(load_mission(mission))
    document = json.loads(outputs.outputs_of(plan)["mission.geojson"])
    return [f for f in document["features"] if f["properties"]["kind"] == "waypoint"]


@pytest.mark.parametrize("autopilot", ["arducopter", "px4"])
def test_ellipsoidal_heights_stand_beside_amsl_where_a_geoid_is_known(folder: Path, autopilot: str) -> None:
    file = folder / "m.yaml"
    file.write_text(GEOID.format(autopilot=autopilot))
    found = waypoints(file)
    for point in found:
        lon, lat, amsl_m = point["geometry"]["coordinates"]
        about = point["properties"]
        assert amsl_m == about["amsl_m"]
        assert about["ellipsoidal_m"] == pytest.approx(amsl_m + geoid_m(lat, lon), abs=0.02)
        assert about["agl_m"] == pytest.approx(about["ellipsoidal_m"] - 500.0, abs=0.03)
    assert found[-1]["properties"]["command"] == "land"
    home = found[0]["properties"]
    assert home["name"] == "home"
    assert ("number" in home) == ("command" in home) == (autopilot == "arducopter")  # px4 has no item for it


@pytest.mark.slow
def test_without_a_geoid_there_is_no_ellipsoidal_height() -> None:
    assert not any("ellipsoidal_m" in point["properties"] for point in waypoints(DATA / "crossing.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("mission", [DATA / "crossing.yaml", MISSIONS / "jacksboro-wing.yaml"])
def test_an_item_is_one_way_point_with_the_figures_of_the_profile(mission: Path) -> None:
    plan = pipeline.plan(load_mission(mission))
    document = json.loads(outputs.outputs_of(plan)["mission.geojson"])
    points = [f["properties"] for f in document["features"] if f["properties"]["kind"] == "waypoint"]
    (v,) = plan.vehicles
    rows = {row.seq: row for row in outputs.item_rows(v.name, v.verdict)}
    assert [p["number"] for p in points] == sorted({0, *(leg.seq for leg in v.verdict.legs)})
    for point in points[1:]:
        row = rows[point["number"]]
        assert point["command"] == row.command
        assert point["amsl_m"] == pytest.approx(row.amsl_m, abs=0.006)
        assert point["agl_m"] == pytest.approx(row.agl_m, abs=0.011)
