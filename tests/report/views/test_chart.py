"""Charts: their ticks, and curves that are broken where nothing is known."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.report.views.chart import Axes, ticks
from gcsplan.units import METRE
from tests.support.effort import draws


@settings(max_examples=draws(60))
@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e5), st.integers(2, 9))
def test_ticks_lie_within_their_axis_and_are_neither_few_nor_many(low: float, span: float, wanted: int) -> None:
    found = ticks(low, low + span, wanted)
    assert ((found >= low - 1e-6 * span) & (found <= low + span * (1 + 1e-6))).all()
    assert wanted / 2.5 - 1 <= len(found) <= wanted + 1


def test_a_curve_is_broken_where_nothing_is_known() -> None:
    axes = Axes(0.0, 10.0, 0.0, 10.0, "x", "y", METRE, METRE)
    path = axes.line([0, 1, 2, 3, 4], [0, 5, math.nan, 5, 0], "track")
    assert path == '<path class="track" d="M0 10000L1000 5000M3000 5000L4000 10000"/>'
    assert axes.area([0, 10], [-math.inf, -math.inf], [5, 5], "below").count("L") == 3
