"""A path's lengths, climbs and energy by hand, and what is no path."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.world.geometry.path import Path, distances_m, nearest_on, runs_m, track_length_m

POINTS = np.array([[0.0, 0.0, 10.0], [3.0, 4.0, 10.0], [3.0, 4.0, 22.0], [8.0, 16.0, 8.0]])


def test_lengths_climbs_and_energy_are_those_of_its_legs() -> None:
    path = Path(POINTS)
    last_m = math.hypot(13.0, 14.0)
    assert path.leg_horizontal_m.tolist() == [5.0, 0.0, 13.0]
    assert path.leg_length_m == pytest.approx([5.0, 12.0, last_m])
    assert path.length_m == pytest.approx(17.0 + last_m)
    assert path.vertical_m == 12.0 + 14.0
    assert path.energy_j(120.0, 100.0) == pytest.approx(120.0 * 26.0 + 100.0 * 18.0)


@pytest.mark.parametrize("columns", [2, 3])
def test_lengths_along_a_track_are_horizontal(columns: int) -> None:
    points = POINTS[:, :columns]
    assert runs_m(points).tolist() == [5.0, 0.0, 13.0]
    assert distances_m(points).tolist() == [0.0, 5.0, 5.0, 18.0]
    assert track_length_m(points) == 18.0


def test_its_points_are_its_own_and_do_not_change() -> None:
    given = POINTS.astype(np.float32)
    path = Path(given)
    given[0] = 99.0
    assert np.array_equal(path.points, POINTS)
    with pytest.raises(ValueError, match="read-only"):
        path.points[0, 0] = 1.0


@pytest.mark.parametrize(
    "points", [POINTS[:1], POINTS[:, :2], POINTS[0], np.full((3, 3), np.nan), np.full((2, 3), np.inf)]
)
def test_what_is_no_path_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"\(N, 3\) finite metres"):
        Path(points)


places = st.lists(st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0)), min_size=2, max_size=6, unique=True)


@given(places, places)
def test_the_nearest_place_of_a_track_is_as_near_as_any(some: list[tuple[float, float]], track: object) -> None:
    line = np.array(track, dtype=float)
    away, where = nearest_on(np.array(some), line)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    t = np.linspace(0.0, s[-1], 2001)
    dense = np.stack([np.interp(t, s, line[:, k]) for k in range(2)], axis=-1)
    for place, far, at in zip(some, away, where, strict=True):
        assert far <= np.hypot(*(dense - place).T).min() + 1e-6
        there = [np.interp(at, s, line[:, k]) for k in range(2)]
        assert math.dist(there, place) == pytest.approx(far, abs=1e-6)
