"""The sample terrain of the benchmarks."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.bench.sample import ROUND_DEGREE_M, SAMPLE_HALF_M, SAMPLE_MIDDLE_DEG, SAMPLE_TERRAIN, sample_spec
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.terrain import load_terrain


def test_the_box_around_its_middle_has_ground_all_over() -> None:
    spec, (east, north) = sample_spec(), SAMPLE_HALF_M
    assert (spec.dem, spec.vertical_datum) == ((SAMPLE_TERRAIN["dem"],), SAMPLE_TERRAIN["vertical_datum"])
    surface = load_terrain(spec, Frame(*SAMPLE_MIDDLE_DEG), (-east, -north, east, north), where="m")
    e, n = np.meshgrid(np.linspace(-east, east, 60), np.linspace(-north, north, 60))
    ground_m = surface.ground_at(e, n)
    assert np.isfinite(ground_m).all()
    assert 200.0 < float(ground_m.min()) < float(ground_m.max()) < 1100.0


def test_a_degree_is_about_as_long_as_it_is() -> None:
    frame = Frame(*SAMPLE_MIDDLE_DEG)
    lat, lon = SAMPLE_MIDDLE_DEG
    assert float(frame.to_plane(lat + 0.1, lon)[1]) == pytest.approx(0.1 * ROUND_DEGREE_M, rel=0.005)
