"""Drifts of two flights in the same wind, and what they mean for the places that both reach at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Rules, separation
from gcsplan.wind.drift import Drift, Drifts, between

# Their ways cross in the middle, which west reaches at 100 s and south at 150 s.
WEST = TimedPath("west", np.array([0.0, 200.0]), np.array([[-1000.0, 0.0, 50.0], [1000.0, 0.0, 50.0]]), 200.0)
SOUTH = TimedPath("south", np.array([50.0, 250.0]), np.array([[0.0, -1000.0, 50.0], [0.0, 1000.0, 50.0]]), 250.0)


def least_m(west_s: list[float], south_s: list[float]) -> float:
    """The least distance where each drifts by so much at each witness."""
    drifts = [Drifts(np.array([s]).T, np.array([s]).T) for s in (west_s, south_s)]
    pair = [replace(path, drifts=drift) for path, drift in zip((WEST, SOUTH), drifts, strict=True)]
    return float(separation(pair, Rules(30.0)).distance_m[0, 1])


def test_vehicles_that_drift_alike_meet_no_more_than_in_still_air() -> None:
    still_m = float(separation([WEST, SOUTH], Rules(30.0)).distance_m[0, 1])
    assert least_m([0.0, 40.0], [0.0, 40.0]) == pytest.approx(still_m)
    assert still_m == pytest.approx(500.0 / np.sqrt(2.0))


def test_vehicles_meet_where_one_wind_brings_both_to_a_place_at_once() -> None:
    assert least_m([0.0, 50.0], [0.0, 0.0]) == pytest.approx(0.0, abs=1e-6)
    assert least_m([0.0, 50.0], [0.0, 20.0]) == pytest.approx(200.0 / np.sqrt(2.0))


def leaving_late(path: TimedPath, late_s: float) -> TimedPath:
    """A path in still air, with a departure that may be so late."""
    none = np.zeros((1, 1))
    drift = Drift(np.array([1]), none, none + late_s, none, none, np.zeros(1), np.array([late_s]))
    return replace(path, pieces=np.ones(len(path.times_s) - 1, dtype=np.intp)).drifting(drift)


@pytest.mark.parametrize(("west_s", "south_s"), [(30.0, 0.0), (0.0, 30.0), (80.0, 20.0), (20.0, 20.0)])
def test_the_distance_of_late_departures_is_the_least_of_all_departures(west_s: float, south_s: float) -> None:
    pair = [leaving_late(WEST, west_s), leaving_late(SOUTH, south_s)]
    each = [
        float(separation([WEST.delayed(a), SOUTH.delayed(b)], Rules(30.0)).distance_m[0, 1])
        for a in np.arange(0.0, west_s + 1.0, 10.0) for b in np.arange(0.0, south_s + 1.0, 10.0)
    ]  # fmt: skip
    assert float(separation(pair, Rules(30.0)).distance_m[0, 1]) == pytest.approx(min(each), abs=1e-6)


def test_a_late_departure_counts_beside_one_that_lands_there() -> None:
    beside = TimedPath("beside", np.array([150.0, 300.0]), np.array([[1010.0, 0.0, 50.0], [2000.0, 0.0, 50.0]]), 300.0)

    def kinds(path: TimedPath) -> set[str]:
        return {c.kind for c in separation([WEST, path], Rules(30.0)).conflicts} - {"air"}

    assert kinds(beside) == set()
    assert kinds(leaving_late(beside, 40.0)) == set()
    assert kinds(leaving_late(beside, 60.0)) == {"take-off", "landing"}


def test_two_drifts_differ_by_no_more_than_at_one_witness() -> None:
    first = Drifts(np.array([[0.0], [9.0]]), np.array([[1.0], [10.0]]))
    second = Drifts(np.array([[2.0], [10.0]]), np.array([[3.0], [12.0]]))
    low, high = between(first, second)
    assert (float(low[0]), float(high[0])) == (0.0, 3.0)


def test_a_drift_along_a_leg_lies_between_its_ends_and_its_rates() -> None:
    rates = np.full((1, 1), 0.1)
    drift = Drift(
        np.array([1]), np.array([[4.0]]), np.array([[5.0]]), rates, np.zeros((1, 1)), np.zeros(1), np.zeros(1)
    )
    items = np.ones(4, dtype=np.intp)
    along = drift.along(np.array([0.0, 10.0, 20.0, 30.0, 50.0]), items)
    assert along.late[0].tolist() == pytest.approx([1.0, 2.0, 3.0, 5.0])
    assert along.early[0].tolist() == pytest.approx([0.0, 0.0, 1.0, 2.0])
    assert len(drift.cut(np.array([0.0, 50.0]), items[:1])) == 6
