"""Prices support the cost of every leg, and are that of a leg's own slope where nothing is smoothed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.planners.optimal.plane.section_prices import LEVEL_SLOPE, RAMP, Prices, numbers, prices_of, slants
from gcsplan.planners.optimal.plane.sections import lay_out, lines_of, widest_spans
from gcsplan.planners.problem import Objective, Problem
from tests.support.searches import looked, over_flat


def limited(objective: Objective, climb_deg: float, descent_deg: float = 90.0) -> Problem:
    """A problem with these climb limits."""
    problem = over_flat(max_agl_m=120.0, objective=objective)
    return replace(problem, limits=replace(problem.limits, max_climb_deg=climb_deg, max_descent_deg=descent_deg))


def cost_of(problem: Problem, run: float, rise: float) -> float:
    """The cost of the shortest path over ``run`` metres of track that rises ``rise`` metres within the climb limits."""
    limits = problem.limits
    slope = limits.max_climb_slope if rise > 0.0 else limits.max_descent_slope
    longer = max(run, abs(rise) / slope)
    if problem.objective == "energy":
        return problem.horizontal_j_per_m * longer + problem.vertical_j_per_m * abs(rise)
    return math.hypot(longer, rise)


@given(
    st.sampled_from(["length", "energy"]), st.floats(5.0, 90.0), st.floats(5.0, 90.0), st.floats(-3.0, 3.0),
    st.floats(0.0, 500.0), st.floats(-500.0, 500.0),
)  # fmt: skip
def test_no_leg_is_cheaper_than_a_price_and_its_slant_say(
    objective: Objective, climb_deg: float, descent_deg: float, slope: float, run: float, rise: float
) -> None:
    problem = limited(objective, climb_deg, descent_deg)
    price = prices_of(problem, np.array([slope]))
    slant = slants(problem, price)
    assert slant[0] >= 0.0
    assert slant[0] * run + price[0] * rise <= cost_of(problem, run, rise) * (1.0 + 1e-6) + 1e-9


@pytest.mark.parametrize("objective", ["length", "energy"])
def test_the_price_of_a_legal_slope_gives_the_whole_cost_of_its_legs(objective: Objective) -> None:
    problem = limited(objective, 20.0)
    steepest = problem.limits.max_climb_slope
    for slope in (
        -0.9,
        -0.2,
        -LEVEL_SLOPE,
        LEVEL_SLOPE,
        0.1,
        steepest * (1.0 - RAMP) - 1e-6,
    ):
        price = prices_of(problem, np.array([slope]))
        found = float(slants(problem, price)[0] + price[0] * slope)
        assert found == pytest.approx(cost_of(problem, 1.0, slope), rel=1e-6)


def test_slants_change_no_faster_with_the_price_than_is_stated() -> None:
    for problem in (limited("length", 12.0, 30.0), limited("energy", 12.0, 30.0), limited("length", 80.0)):
        _, greatest, sway = numbers(problem)
        most = float(np.abs(prices_of(problem, np.linspace(-2.0, 2.0, 400))).max())
        price = np.linspace(-most, most, 4001)
        slant = slants(problem, price)
        assert slant.max() <= greatest
        assert np.abs(np.diff(slant) / np.diff(price)).max() <= sway * (1.0 + 1e-6)


def test_prices_are_mixed_and_the_nearest_track_counts_most() -> None:
    plane = looked(over_flat(max_agl_m=120.0)).plane
    lines = lines_of(plane, 200.0)
    sections = lay_out(plane, lines, widest_spans(plane, lines, 1600.0), 50.0, 1600.0)
    assert sections is not None
    here, there = np.full(len(lines), -300.0), np.full(len(lines), 300.0)
    prices = Prices()
    prices.add(here, np.full(len(lines), 0.1))
    assert prices.at(sections) == pytest.approx(0.1)
    prices.add(there, np.full(len(lines), 0.3))
    found = prices.at(sections)
    assert found[sections.aside == 0.0] == pytest.approx(0.2)
    assert 0.1 < found[sections.aside < -200.0].max() < 0.15
