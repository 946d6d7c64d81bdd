"""The kernels of the lattice: machine code finds the labels and pulls the tracks that the plain functions do."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.lattice import pull_kernels, search_kernels
from gcsplan.planners.lattice.corridor_raster import line_of, make_guide
from gcsplan.planners.lattice.routes import LatticeSize, Router
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.both_ways import run_both_ways
from tests.support.planner_worlds import Floats, ground


def hill(east_m: Floats, north_m: Floats) -> Floats:
    """A hill 60 m high in the middle."""
    return np.asarray(60.0 * np.exp(-((east_m - 1000.0) ** 2 + (north_m - 1000.0) ** 2) / 250.0**2))


def over_a_hill() -> Problem:
    gentle = Limits(10.0, max_agl_m=60.0, max_climb_deg=12.0, max_descent_deg=12.0)
    zone = Zone("disc", Circle(700.0, 1050.0, 120.0), Level(0.0, "agl"), Level(300.0, "amsl"))
    return Problem(Airspace(ground(hill), [zone]), gentle, (400.0, 1000.0, 30.0), (1600.0, 1000.0, 30.0))


def test_the_search_finds_the_same_labels_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    searched = run_both_ways(monkeypatch, search_kernels, "reach")
    with np.errstate(all="ignore"):
        way = Router.at(over_a_hill(), LatticeSize(1.3, 400)).way()
    assert way is not None
    assert searched[-1] == search_kernels.DONE


def test_a_track_is_pulled_to_the_same_line_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = over_a_hill()
    track = np.array([[400.0, 1000.0], [700.0, 1250.0], [1000.0, 1300.0], [1300.0, 1250.0], [1600.0, 1000.0]])
    guide = make_guide(problem, [track], 300.0, {})
    ends, free = np.array([True, False, False, False, True]), np.full(5, np.nan)
    pulled = run_both_ways(monkeypatch, pull_kernels, "pull")
    with np.errstate(all="ignore"):
        line = guide.pull(line_of(track, ends, free), np.array([40.0]), 0.01, rounds=0)
        shorter = guide.pull(line_of(track, ends, free), np.array([40.0, 10.0]), 0.01, rounds=2)
    assert len(pulled) == 2
    assert shorter.value < line.value
    assert np.array_equal(shorter.points[[0, -1]], track[[0, -1]])
