"""Places on straight stretches."""

from __future__ import annotations

import pytest

from gcsplan.check.motion.stretch import place_on


def test_a_place_on_a_stretch_lies_between_its_ends_and_the_ends_are_not_rounded() -> None:
    a, b = (36.1, -84.3, 412.7), (36.7, -84.9, 100.1)
    assert place_on(a, b, 0.25) == pytest.approx((36.25, -84.45, 334.55))
    assert (place_on(a, b, 0.0), place_on(a, b, -1e-9)) == (a, a)
    assert (place_on(a, b, 1.0), place_on(a, b, 1.0 + 1e-9)) == (b, b)
