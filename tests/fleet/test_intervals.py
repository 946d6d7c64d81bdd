"""Intervals between arrivals over all winds, and the departures that centre them."""

from __future__ import annotations

from itertools import pairwise, permutations

import numpy as np
import pytest

from gcsplan.fleet.arrival import Mode, Schedule, Slot
from gcsplan.fleet.intervals import Interval, centred, intervals, steadiest
from gcsplan.fleet.motion.timing import Route
from gcsplan.wind.drift import Drifts, between


def schedule(*arrivals: float, mode: Mode = "sequence") -> Schedule:
    """Vehicles a, b, … that fly for 100 s each."""
    ends = np.array([[0.0, 0.0, 30.0], [1000.0, 0.0, 30.0]])
    slots = tuple(
        Slot(name, at - 100.0, 0.0, 10.0, at, 0.0, Route(name, ends)) for name, at in zip("ab", arrivals, strict=True)
    )
    return Schedule(mode, ("a", "b"), slots, 60.0)


def drifts(**ends: tuple[list[float], list[float]]) -> dict[str, Drifts]:
    """Early and late drifts of each arrival at every corner of the winds."""
    return {name: Drifts(np.array(early)[:, None], np.array(late)[:, None]) for name, (early, late) in ends.items()}


def test_a_wind_that_delays_both_alike_keeps_their_interval() -> None:
    wanted = schedule(100.0, 160.0)
    both = [0.0, 20.0, 40.0, 10.0]
    [found] = intervals(wanted, wanted.slots, drifts(a=(both, both), b=(both, both)))
    assert (found.first, found.second, found.requested_s, found.least_s, found.most_s) == ("a", "b", 60.0, 60.0, 60.0)
    assert found.kept("sequence", 0.0)


def test_winds_that_delay_one_of_two_move_their_interval() -> None:
    wanted = schedule(100.0, 160.0)
    still, late = [0.0] * 4, [0.0, 30.0, 0.0, 10.0]
    [found] = intervals(wanted, wanted.slots, drifts(a=(still, still), b=(late, late)))
    assert (found.least_s, found.most_s, found.off_s, found.width_s) == (60.0, 90.0, 30.0, 15.0)
    assert not found.kept("sequence", 29.0)
    assert found.kept("sequence", 30.0)
    [moved] = intervals(wanted, centred(wanted, wanted, drifts(a=(still, still), b=(late, late))).slots,
                        drifts(a=(still, still), b=(late, late)))  # fmt: skip
    assert (moved.least_s, moved.most_s) == pytest.approx((45.0, 75.0))
    assert moved.kept("sequence", moved.width_s)


def test_an_order_that_a_wind_turns_is_not_kept_within_any_window() -> None:
    found = Interval("a", "b", 10.0, -1.0, 21.0)
    assert not found.kept("sequence", 60.0)
    assert found.kept("together", 60.0)


def test_all_leave_later_where_one_would_leave_before_the_start() -> None:
    wanted = schedule(100.0, 100.0, mode="together")
    late = [50.0] * 4
    plan = centred(wanted, wanted, drifts(a=([0.0] * 4, [0.0] * 4), b=(late, late)))
    assert [slot.depart_s for slot in plan.slots] == [50.0, 0.0]
    assert [slot.arrive_s for slot in plan.slots] == [150.0, 100.0]


def test_the_order_found_has_the_least_of_the_widest_windows() -> None:
    rng = np.random.default_rng(3)
    for count in (2, 3, 5, 6):
        names = [f"v{k}" for k in range(count)]
        found = {name: Drifts(-rng.uniform(0.0, 9.0, (8, 1)), rng.uniform(0.0, 9.0, (8, 1))) for name in names}
        width = {
            (a, b): 0.5 * float(high[0] - low[0])
            for a, b in permutations(names, 2) for low, high in [between(found[a], found[b])]
        }  # fmt: skip
        least = min(max(width[two] for two in pairwise(order)) for order in permutations(names))
        order = steadiest(names, found, 0.0)
        assert sorted(order) == names
        assert max(width[two] for two in pairwise(order)) == least
        assert steadiest(names, found, 99.0) == names
