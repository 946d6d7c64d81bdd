"""Corners that an ArduCopter would cut too near to ground or zones are mended where they are, in height, too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.corners import moved, sharpened
from gcsplan.bench.everyday.missions import draw
from gcsplan.mavlink.build.multirotor import SHORT_LEG_M
from gcsplan.mission_file import load_mission
from tests.support.noted import codes


@pytest.mark.slow
@pytest.mark.parametrize(("number", "most_m"), [(64, 5425.0), pytest.param(38, 702.0, marks=pytest.mark.nightly)])
def test_a_mission_over_hills_without_errors_is_planned_once(number: int, most_m: float) -> None:
    # Planned again with the margins of its short legs' climbs, 64 took 5,501 m and 38 took 714.
    one = draw(11, number)
    (found,) = plan(load_mission(Path(f"{one.kind}.yaml"), text=yaml.safe_dump(one.document))).vehicles
    assert found.verdict.safe is True
    assert found.cost < most_m
    assert "planned_again" not in codes(found.solution.notes)


def test_the_leg_behind_a_corner_is_no_steeper_than_the_next_whatever_is_rounded() -> None:
    points = np.array([[0.0, 0.0, 100.0], [500.0, 0.0, 200.0], [1000.0, 0.0, 330.0]])
    mended = sharpened(points, {1})
    assert len(mended) == 4
    run, rise = mended[2, 0] - mended[1, 0], mended[2, 2] - mended[1, 2]
    assert run == pytest.approx(SHORT_LEG_M)
    assert 0.0 <= rise <= max(0.26 * SHORT_LEG_M - 0.01, 0.0)


def test_a_moved_corner_is_turned_before_beyond_the_old_next_leg() -> None:
    """From where the turn begins, straight to the end of the next leg: nowhere inside the old corner."""
    for degrees in (5.0, 30.0, 60.0, 90.0, 120.0):
        turn = np.radians(degrees)
        old = np.array([[0.0, 0.0, 50.0], [100.0, 0.0, 50.0], [100.0 + 80 * np.cos(turn), 80 * np.sin(turn), 50.0]])
        new = moved(old, {1}, 1.0)
        assert np.array_equal(new[[0, 2]], old[[0, 2]])
        way = (new[1] - new[0])[:2] / np.hypot(*(new[1] - new[0])[:2])
        begun, end = new[1, :2] - way, old[2, :2]
        inside = np.array([-np.sin(turn), np.cos(turn)])  # of the old next leg
        flown = begun + np.linspace(0.0, 1.0, 50)[:, None] * (end - begun)
        beyond = (flown[:, 0] - 100.0) * np.cos(turn) + flown[:, 1] * np.sin(turn) >= 0.0
        assert ((flown - old[1, :2]) @ inside)[beyond].max() <= 1e-9
    straight = np.array([[0.0, 0.0, 50.0], [100.0, 0.0, 50.0], [200.0, 0.0, 50.0]])
    assert np.array_equal(moved(straight, {1}, 1.0), straight)


@pytest.mark.slow
def test_paths_keep_of_the_climb_limit_what_rounding_takes_and_no_more() -> None:
    """One lap at the limit between two ends: with a margin of 0.2 % its gap was 0.29 %."""
    one = draw(12, 25)
    (found,) = plan(load_mission(Path(f"{one.kind}.yaml"), text=yaml.safe_dump(one.document))).vehicles
    assert found.verdict.safe is True
    assert "planned_again" not in codes(found.solution.notes)
    assert found.gap_percent is not None
    assert found.gap_percent < 0.2
