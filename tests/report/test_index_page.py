"""The page of a batch: what files say is text, an empty map is none, and the ground is drawn where there is room."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.report.index_page import render_index
from gcsplan.report.views.shaded_terrain import GroundPatch
from gcsplan.units import METRIC
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.world import World


def test_the_page_escapes_what_files_say() -> None:
    row = {"mission": "a<b", "vehicle": "<script>", "code": 0, "verdict": "safe", "message": ""}
    bad = row | {"code": 3, "verdict": "no mission", "message": "<img src=x>", "vehicle": ""}
    page = render_index("t<", [row, bad], {0: [[47.0, 179.99], [47.01, -179.99]]}, (), METRIC, "summary.json")
    assert "<img" not in page
    assert "<script>alert" not in page
    assert "a&lt;b" in page
    assert 'href="a%3Cb/summary.json"' in page
    assert "2 missions" not in page  # one name, once
    assert 'd="M0.0' in page  # a track across 180 degrees is one short line
    assert "1.5" in page.split("the map is")[1][:12]


def test_an_empty_map_is_none() -> None:
    page = render_index("a batch", [], {}, (), METRIC, "summary.json")
    assert "<svg" not in page
    assert "a batch" in page


def ridge_at(lon: float) -> tuple[GroundPatch, list[list[float]]]:
    """The ground, 100 m in the west to 200 m in the east, under a track of 1 km at 47° north."""
    track = [[47.0, lon], [47.0, (lon + 0.013 + 180.0) % 360.0 - 180.0]]
    z = np.tile(np.linspace(100.0, 200.0, 41), (41, 1))
    made = World(Frame(47.0, lon), Airspace(Surface(z, z, GridMap.affine(-2000.0, 2000.0, 100.0, 100.0))))
    patch = GroundPatch.under(made, [track])
    assert patch is not None
    return patch, track


@pytest.mark.parametrize("lon", [8.0, 179.995])
def test_the_map_has_the_ground_around_the_missions(lon: float) -> None:
    patch, track = ridge_at(lon)
    assert patch.at(np.array([47.0]), np.array([lon]))[0, 0] == pytest.approx(150.0, abs=0.5)
    assert patch.at(np.array([47.0]), np.array([lon + 0.0065]))[0, 0] == pytest.approx(162.4, abs=0.5)
    assert np.isnan(patch.at(np.array([46.9, 47.0]), np.array([lon - 1.0, lon])))[0, 0]
    row = {"mission": "a", "vehicle": "u", "code": 0, "verdict": "safe", "message": ""}
    page = render_index("t", [row], {0: track}, [patch], METRIC, "summary.json")
    assert '<image href="data:image/webp;base64,' in page
    assert "The ground around the missions is drawn coarsely" in page


def test_missions_too_far_apart_for_terrain_say_so() -> None:
    patch, track = ridge_at(8.0)
    other, far = ridge_at(40.0)
    row = {"mission": "a", "vehicle": "u", "code": 0, "verdict": "safe", "message": ""}
    page = render_index("t", [row, row], {0: track, 1: far}, [patch, other], METRIC, "summary.json")
    assert "<image" not in page
    assert "Terrain is not drawn: the missions lie up to" in page
