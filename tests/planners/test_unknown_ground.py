"""Unknown ground: a void is never level, never ground, never a proof, and a refusal says that it is in the way."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gcsplan.planners.optimal.navmesh.grid import nodes
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.searches import bound_corridor
from gcsplan.planners.problem import Problem, Refusal, Solution
from gcsplan.planners.refusal.suggestions import with_cures
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from tests.support.planner_worlds import Floats, ground

BAND = Limits(min_agl_m=30.0, max_agl_m=90.0)


def hill(east: Floats, north: Floats) -> Floats:
    return 200.0 * np.exp(-(((east - 1000.0) / 200.0) ** 2))


def without(surface: Surface, *nodes: object) -> Surface:
    """The surface with some nodes (indices of rows and columns) unknown."""
    z = surface.ground_m.copy()
    for at in nodes:
        z[at] = np.nan  # type: ignore[index]
    return replace(surface, ground_m=z, top_m=z)


def mission(surface: Surface, limits: Limits) -> Problem:
    return Problem(Airspace(surface), limits, (200.0, 1000.0, 40.0), (1800.0, 1000.0, 40.0))


@cache
def whole_hill() -> Solution:
    return plan(mission(ground(hill), BAND))


@pytest.mark.first_quick
@pytest.mark.parametrize("void", [(3, 3), (0, 0), (90, 50)])
def test_hills_with_one_unknown_node_are_not_level(void: tuple[int, int]) -> None:
    """They were flown under a ceiling AMSL, that of one node: there was no path over the hill, which was proved."""
    whole, holed = whole_hill(), plan(mission(without(ground(hill), void), BAND))
    assert holed.lower_bound is not None
    assert holed.lower_bound <= whole.path.length_m
    assert holed.path.length_m == pytest.approx(whole.path.length_m, rel=1e-3)


def test_level_ground_with_a_void_has_no_one_altitude() -> None:
    assert ground(7.0).level_m == 7.0
    assert not ground(7.0).has_unknown
    assert without(ground(7.0), (5, 5)).level_m is None
    assert without(ground(7.0), (0, 0)).has_unknown


@pytest.mark.parametrize("limits", [Limits(min_agl_m=30.0, max_amsl_m=500.0), BAND])
def test_a_refusal_that_stems_from_unknown_ground_says_so_and_where(limits: Limits) -> None:
    p = replace(mission(without(ground(hill), np.s_[:, 70]), limits), budget_s=30.0)
    with pytest.raises(Refusal) as caught:
        plan(p)
    e = with_cures(p, caught.value, plan)
    assert e.reason == "infeasible"  # voids are shut to the check
    assert "over ground that the terrain model knows, which is proved" in e.message
    assert "unknown ground is in the way" in e.message
    assert "dem fetch" in e.message
    assert (e.east_m, e.north_m) == (pytest.approx(1400.0, abs=25.0), pytest.approx(1000.0, abs=400.0))
    assert e.place_of == "that ground"


@pytest.mark.slow
def test_a_way_past_a_void_is_found_without_a_warning() -> None:
    """A floor and a ceiling that are both infinite have no difference."""
    found: Solution = plan(mission(without(ground(0.0), np.s_[10:, 70:74]), Limits(min_agl_m=30.0, max_climb_deg=20.0)))
    assert found.lower_bound is not None
    assert found.lower_bound <= found.path.length_m <= 1.002 * found.lower_bound


def test_a_stretch_over_unknown_ground_is_shut() -> None:
    over = np.subtract([10.0, np.inf, np.inf, 10.0], [90.0, -np.inf, 90.0, 90.0])
    assert bound_corridor.shut_stretches(over) == [(0, 3)]


def test_a_side_of_a_merged_cell_between_known_nodes_lies_on_the_ground() -> None:
    """Both cells beside it have an unknown node: the side was as high as its ends, over the pass between them."""
    z = np.full((9, 9), 100.0)
    z[4, 1:4] = 0.0  # a pass between two nodes of the merged lattice, 4 cells apart
    z[0, 0] = z[8, 0] = np.nan
    low, high = nodes(z, (0, 0, 8, 8), 1, 4, 4)
    middle = 0.5 * (low[1, 0] + low[1, 1])
    assert middle <= 0.0
    assert np.isinf(high[0, 0])
