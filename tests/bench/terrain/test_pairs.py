"""Pairs of places: their ceilings and zones leave a way, and block the straight one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.ndimage import label

from gcsplan.bench.terrain.problems import NamedProblem
from gcsplan.world.geometry.zones import Circle

pytestmark = pytest.mark.slow


@pytest.mark.nightly
def test_the_ceiling_stands_on_half_a_metre_and_blocks_the_straight_line(main: list[NamedProblem]) -> None:
    for p in main[:20]:
        ceiling = p.problem.limits.max_amsl_m
        assert ceiling is not None
        assert ceiling % 1.0 == 0.5
        (e0, n0, _), (e1, n1, _) = p.problem.start, p.problem.goal
        t = np.linspace(0.0, 1.0, 20_001)
        ground = p.problem.airspace.surface.ground_at(e0 + t * (e1 - e0), n0 + t * (n1 - n0))
        assert ground.max() + 60.0 > ceiling


def test_ceiling_and_unlimited_zones_leave_start_and_goal_joined(main: list[NamedProblem]) -> None:
    for p in (main[8], main[27], main[43]):
        surface, ceiling = p.problem.airspace.surface, p.problem.limits.max_amsl_m
        assert ceiling is not None
        rows, cols = surface.ground_m.shape
        e, n = np.moveaxis(surface.grid.to_plane(*np.meshgrid(np.arange(cols), np.arange(rows))), -1, 0)
        free = surface.ground_m + 60.0 <= ceiling
        for zone in p.problem.airspace.zones:
            assert isinstance(zone.shape, Circle)
            if zone.floor is None and zone.ceiling is None:
                free &= np.hypot(e - zone.shape.east_m, n - zone.shape.north_m) >= zone.shape.radius_m
        piece = label(free)[0]
        at = [np.round(surface.grid(x[0], x[1])).astype(int) for x in (p.problem.start, p.problem.goal)]
        assert piece[at[0][1], at[0][0]] == piece[at[1][1], at[1][0]] != 0, p.name


def test_zones_are_a_mix_that_covers_no_start_and_no_goal(main: list[NamedProblem]) -> None:
    kinds = {"unlimited": 0, "over": 0, "under": 0}
    for p in main[40:]:
        for zone in p.problem.airspace.zones:
            assert isinstance(zone.shape, Circle)
            c = zone.shape
            assert 200.0 <= c.radius_m <= 1200.0
            assert min(math.dist((c.east_m, c.north_m), x[:2]) for x in (p.problem.start, p.problem.goal)) > c.radius_m
            kind = "under" if zone.floor is not None else "over" if zone.ceiling is not None else "unlimited"
            kinds[kind] += 1
    assert kinds == {"unlimited": 400, "over": 200, "under": 200}
    for few, many in zip(main[20:40], main[40:], strict=True):
        assert [z.shape for z in few.problem.airspace.zones] == [z.shape for z in many.problem.airspace.zones[:10]]
