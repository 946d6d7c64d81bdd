"""Circles of ArduPlane in thin air: what is told is what a real one flew, and what is judged holds it."""

from __future__ import annotations

import math

import pytest

from gcsplan.check.motion.circles import circle_growth, circle_off_m, circle_widened, l1_off_m

FLOWN_M = [(100.0, 1799.0, 122.0, 122.6), (100.0, 1199.0, 113.6, 116.2), (150.0, 499.0, 155.3, 157.3)]
"""Radius asked, altitude AMSL, least and largest radius flown by ArduPlane 4.7.0-dev (SITL) at 20 m/s indicated."""


@pytest.mark.parametrize(("radius_m", "amsl_m", "least_m", "most_m"), FLOWN_M)
def test_a_circle_is_told_and_judged_as_wide_as_a_real_plane_flew_it(
    radius_m: float, amsl_m: float, least_m: float, most_m: float
) -> None:
    note = circle_widened(7, radius_m, amsl_m)
    assert note is not None
    assert (note.item, note.data["radius_m"]) == (7, radius_m)
    told, judged = note.data["flown_m"], note.data["judged_m"]
    assert isinstance(told, float)
    assert least_m - 4.0 < told < most_m + 4.0  # the L1 controller is a few metres off its circle
    assert judged == radius_m * circle_growth(amsl_m) > most_m
    assert f"it is judged with {math.ceil(judged)} m" in str(note)


def test_near_sea_level_nothing_is_told() -> None:
    assert circle_widened(7, 60.0, 100.0) is None
    assert circle_widened(7, 100.0, -50.0) is None


@pytest.mark.parametrize(
    ("radius_m", "turn_deg", "speed_m_s", "off_m"), [(40.0, 86.0, 18.0, 12.011), (100.0, 120.0, 20.0, 26.598)]
)
def test_turns_in_calm_air_lie_off_their_arcs_as_they_did_before_winds_were_declared(
    radius_m: float, turn_deg: float, speed_m_s: float, off_m: float
) -> None:
    assert l1_off_m(radius_m, math.radians(turn_deg), speed_m_s) == pytest.approx(off_m, abs=1e-3)


def test_a_circle_reaches_no_less_far_in_a_stronger_wind_and_no_farther_in_none() -> None:
    off_m = [circle_off_m(60.0, 18.0, 0.5 * k) for k in range(20)]
    assert off_m == sorted(off_m)
    assert (off_m[0], off_m[1] < 0.5) == (0.0, True)
