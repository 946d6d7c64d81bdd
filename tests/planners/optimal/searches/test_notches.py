"""Notches in a ridge that are open by centimetres, with a track error that includes the terrain beside the track."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.optimal import planner as optimal
from gcsplan.planners.optimal.searches import bound_corridor, fine_tracks
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.support.planner_worlds import Floats, faults, ground

SIZE_M = 1800.0
MIDDLE_M = 0.5 * SIZE_M
STRAIGHT_M, ROUND_M = 1250.0, 1500.0
"""A path through the notch is shorter than the first, and one around the ridge is longer than the second."""


def ridge(over_m: float, askew: float, half_m: float, ends: bool) -> Problem:
    """A mission across a ridge with a notch that the ceiling leaves open by ``over_m``.

    ``askew``: by how much the ridge leans, metres east per metre north; ``half_m``: half the notch's width; ``ends``:
    whether the ridge ends, far from the notch.
    """

    def height(east: Floats, north: Floats) -> Floats:
        across = np.abs(east - MIDDLE_M - askew * (north - MIDDLE_M))
        notch = 40.0 * np.clip(1.0 - np.abs(north - MIDDLE_M - 7.0) / half_m, 0.0, 1.0)
        return np.asarray(np.where(ends & (north > 1700.0), 0.0, np.maximum(100.0 - notch - across / 3.0, 0.0)))

    airspace = Airspace(ground(height, size_m=SIZE_M, step_m=30.0))
    limits = Limits(min_agl_m=60.0, track_error_m=3.0)
    # The lowest floor at each easting, and the highest of those: no track through the notch can stay lower.
    east, north = np.meshgrid(MIDDLE_M + np.arange(-15.0, 15.0, 0.25), MIDDLE_M + np.arange(-40.0, 50.0, 0.25))
    open_m = float(airspace.floor_amsl(east.ravel(), north.ravel(), limits).reshape(east.shape).min(axis=0).max())
    limits = Limits(min_agl_m=60.0, track_error_m=3.0, max_amsl_m=open_m + over_m)
    return Problem(airspace, limits, (300.0, MIDDLE_M, 80.0), (1500.0, MIDDLE_M, 80.0))


CASES = [(0.1, 0.0, 120.0), (0.05, 0.0, 60.0), (0.2, 0.5, 40.0), (0.1, 0.2, 80.0)]


@pytest.mark.nightly
@pytest.mark.parametrize(("over_m", "askew", "half_m"), CASES)
def test_a_path_leads_through_what_is_open_by_centimetres(
    over_m: float, askew: float, half_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = ridge(over_m, askew, half_m, True)
    found = optimal.plan(problem)
    assert problem.cost(found.path) < STRAIGHT_M
    assert found.lower_bound is not None
    assert problem.cost(found.path) < 1.003 * found.lower_bound
    assert faults(problem, found.path) == []
    for module in (fine_tracks, bound_corridor):
        monkeypatch.setattr(module, "narrow_passage", lambda plane: False)
    monkeypatch.setattr(bound_corridor, "over_pass", lambda problem, cap_m, track: track)
    assert problem.cost(optimal.plan(problem).path) > ROUND_M, "the notch is too wide to show anything"


@pytest.mark.slow
@pytest.mark.nightly_but("0.1-0.2-80.0", "0.1-0.0-120.0")
@pytest.mark.first_quick
@pytest.mark.parametrize(("over_m", "askew", "half_m"), CASES)
def test_the_first_path_leads_through_it_where_there_is_no_other(over_m: float, askew: float, half_m: float) -> None:
    problem = ridge(over_m, askew, half_m, False)
    found = optimal.plan(problem)
    assert problem.cost(found.path) < STRAIGHT_M
    assert faults(problem, found.path) == []


@pytest.mark.nightly
def test_no_path_leads_through_a_notch_that_is_shut() -> None:
    problem = ridge(-0.3, 0.0, 60.0, True)
    found = optimal.plan(problem)
    assert problem.cost(found.path) > ROUND_M
    assert faults(problem, found.path) == []
