"""The altitude profile in text: the ground and the path of a plan, cell by cell against samples of both."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.app.fleet import pipeline
from gcsplan.check.verdict import Verdict
from gcsplan.export.profile import BOTH, GROUND, TRACK, UNKNOWN, profile_lines
from gcsplan.units import AVIATION, METRIC
from gcsplan.world.airspace import Airspace
from gcsplan.world.world import World
from tests.support.paths import DATA


@pytest.fixture(scope="module")
def flown() -> tuple[Verdict, World]:
    mission = pipeline.load_mission(DATA / "crossing.yaml")
    (vehicle,) = pipeline.plan(mission).vehicles
    return vehicle.verdict, World(mission.frame, vehicle.problem.airspace)


@pytest.mark.slow
def test_each_column_has_its_ground_filled_and_the_path_drawn(flown: tuple[Verdict, World]) -> None:
    verdict, world = flown
    *rows, foot = profile_lines(verdict, world, columns=40, rows=12)
    assert len(rows) == 12
    middles = [float(row[:7]) for row in rows]
    step_m = (middles[0] - middles[-1]) / 11.0
    assert all(a - b == pytest.approx(step_m, abs=1.01) for a, b in pairwise(middles))
    cells = [row[8:].ljust(40) for row in rows]
    legs = [leg for leg in verdict.legs if not leg.column]
    length_m = sum(leg.horizontal_m for leg in legs)
    assert foot.startswith(f"{METRIC.amsl.symbol:>7} 0")
    assert foot.endswith(f"{length_m / 1000.0:.2f} km")
    for column in range(40):
        filled = [row[column] in (GROUND, BOTH) for row in cells]
        assert filled == sorted(filled)  # from below to the top of the ground, without a gap
        assert any(row[column] in (TRACK, BOTH) for row in cells)
    # The row of the path at its ends is that of its altitude there.
    for column, amsl_m in ((0, legs[0].start[2]), (39, legs[-1].end[2])):
        at = [m for m, row in zip(middles, cells, strict=True) if row[column] in (TRACK, BOTH)]
        assert min(abs(m - amsl_m) for m in at) <= 0.5 * step_m + 1.0


def test_unknown_ground_is_a_question_mark_at_the_bottom(flown: tuple[Verdict, World]) -> None:
    verdict, world = flown
    surface = world.airspace.surface
    void = np.full_like(surface.ground_m, np.nan)
    nowhere = replace(world, airspace=Airspace(replace(surface, ground_m=void, high_m=void)))
    *above, last = (line[8:] for line in profile_lines(verdict, nowhere, columns=30, rows=6)[:-1])
    assert set(last) <= {UNKNOWN, TRACK}
    assert UNKNOWN in last
    assert GROUND not in "".join(above)


def test_other_units_change_the_numbers_alone(flown: tuple[Verdict, World]) -> None:
    verdict, world = flown
    metres, feet = profile_lines(verdict, world), profile_lines(verdict, world, AVIATION)
    assert [a[7:] for a in metres[:-1]] == [b[7:] for b in feet[:-1]]
    for a, b in zip(metres[:-1], feet[:-1], strict=True):
        assert float(b[:7]) * 0.3048 == pytest.approx(float(a[:7]), abs=0.8)


def test_without_a_flown_leg_there_is_nothing_to_draw(flown: tuple[Verdict, World]) -> None:
    verdict, world = flown
    assert profile_lines(replace(verdict, legs=()), world) == []
    assert math.isfinite(sum(leg.horizontal_m for leg in verdict.legs))
