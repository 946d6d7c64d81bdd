"""The missions and hills of the benchmark of scale."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from gcsplan.bench.scale.missions import EQUATOR_DEGREE_M, make_missions, make_mosaic, mission
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.terrain import TerrainSpec, load_terrain


@pytest.mark.slow
def test_missions_are_those_of_their_seed_and_5_to_40_km_long(tmp_path: Path) -> None:
    files = make_missions(tmp_path, 60, 3, tmp_path / "tiles")
    contents = [yaml.safe_load(file.read_text(encoding="utf-8")) for file in files]
    assert contents == [mission(k, 3, tmp_path / "tiles") for k in range(60)]
    assert contents != [mission(k, 4, tmp_path / "tiles") for k in range(60)]
    lengths_m = []
    for content in contents:
        (a, b), (c, d) = content["vehicles"][0]["start"], content["vehicles"][0]["goal"]
        lengths_m.append(EQUATOR_DEGREE_M * np.hypot(c - a, (d - b) * np.cos(np.radians(a))))
    assert 4990 < min(lengths_m) < 8000
    assert 30_000 < max(lengths_m) < 40_200
    assert {c["terrain"]["dem"] for c in contents} == {"sample:jacksboro", str(tmp_path / "tiles")}


@pytest.mark.slow
def test_the_made_hills_are_the_same_however_fine_they_are(tmp_path: Path) -> None:
    heights = []
    for posts in (30, 90):
        make_mosaic(tmp_path / str(posts), 1, posts)
        spec = TerrainSpec(dem=(str(tmp_path / str(posts)),), vertical_datum="EGM96")
        surface = load_terrain(spec, Frame(46.7, 8.4), (-9000.0, -9000.0, 9000.0, 9000.0), where="m")
        at = np.linspace(-9000.0, 9000.0, 50)
        heights.append(surface.ground_at(at, -at))
    assert np.ptp(heights[0]) > 100.0
    assert np.abs(heights[0] - heights[1]).max() < 15.0
