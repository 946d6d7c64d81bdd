"""Zones in space: lids that cover their shapes, floors and ceilings that follow the ground."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.report.parts.track_samples import line_of
from gcsplan.report.views.scene_data import triangles, zone_meshes
from gcsplan.report.views.shaded_terrain import extent_of, relief_of
from tests.support.effort import draws
from tests.support.pages import (
    ZONES,
    small_page,
)


@settings(max_examples=draws(60))
@given(st.integers(3, 40), st.integers(0, 10_000))
def test_the_lid_of_a_prism_covers_its_shape_exactly(corners: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.8, corners)) / corners
    star = (rng.uniform(100, 1000, corners) * np.array([np.cos(turn), np.sin(turn)])).T

    def area(p: Any) -> float:
        return 0.5 * float(np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1)))

    faces = triangles(star)
    areas = [area(star[list(f)]) for f in faces]
    assert len(faces) == corners - 2
    assert min(areas) >= -1e-6
    assert sum(areas) == pytest.approx(area(star), rel=1e-9)


def test_zones_stand_in_space_with_floors_and_ceilings_that_follow_the_ground() -> None:
    page = small_page()
    surface = page.world.airspace.surface
    subject = page.subjects[0]
    line = line_of(subject.verdict, page.world, subject.vehicle.limits)
    assert line is not None
    extent = extent_of([line], ZONES, surface)
    relief = relief_of(page.world, extent)
    meshes = {m["name"]: m for m in zone_meshes(ZONES, surface, relief, [line])}
    assert set(meshes) == {z.name for z in ZONES}

    def corners(name: str) -> Any:
        at = np.array(meshes[name]["at"]).reshape(-1, 3)
        ground = surface.ground_at(at[:, 0] + extent.west_m, at[:, 1] + extent.south_m)
        return at, ground

    at, ground = corners("mast")
    half = len(at) // 2
    assert np.allclose(at[half:, 2] - ground[half:], 40.0, atol=0.2)
    assert (at[:half, 2] < ground[:half]).all()
    at, ground = corners("training area")
    half = len(at) // 2
    assert np.allclose(at[:half, 2] - ground[:half], 200.0, atol=0.2)
    assert np.allclose(at[half:, 2], 900.0)
    assert meshes["village"]["open"] is True
    at, _ = corners("village")
    assert at[:, 2].max() > max(line.amsl_m.max(), relief.high_m)
    for mesh in meshes.values():
        assert max(mesh["faces"] + mesh["edges"]) < len(mesh["at"]) // 3  # type: ignore[operator,arg-type]
