"""The rules of returns: the pieces that each autopilot flies, by hand; and the sweep agrees with single returns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.check.circles import circle_growth
from gcsplan.check.geodesy import flat_m
from gcsplan.check.rtl.model import RULES, Piece, about_turn_m, at_home_m, return_pieces
from gcsplan.check.rtl.sweep import Target, obstacles_of_returns
from gcsplan.check.rtl.trace import MissionTrace
from gcsplan.check.stretch import Place
from gcsplan.vehicle import Autopilot
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
HOME: Place = (36.6, -84.3, 300.0)


def away(metres: float, amsl_m: float) -> Place:
    """The place that many metres north of home on the ellipsoid."""
    degrees = metres / flat_m(HOME, (36.601, -84.3, 0.0)) * 0.001
    place = (36.6 + degrees, -84.3, amsl_m)
    assert flat_m(HOME, place) == pytest.approx(metres, rel=1e-5)
    return place


def spans(pieces: list[Piece]) -> list[tuple[float, float]]:
    """Lowest and highest altitude of each piece that leads home."""
    return [
        (p.start[2] - p.band_m, p.start[2] + p.band_m)
        for p in pieces
        if p.start[:2] != p.end[:2] and not p.column
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("autopilot", "metres", "amsl_m", "expected"),
    [
        (COPTER, 1000.0, 310.0, [(360.0, 360.0)]),  # outside of the cone, which reaches 60 m at 20 m from home
        (COPTER, 10.0, 310.0, [(330.0, 360.0), (360.0, 360.0)]),  # 10 m from home the cone is 30 m high
        (COPTER, 10.0, 345.0, [(345.0, 360.0), (360.0, 360.0)]),  # in the cone, above its surface
        (COPTER, 10.0, 400.0, [(400.0, 400.0)]),  # it never descends before it is over home
        (PX4, 1000.0, 310.0, [(360.0, 360.0)]),
        (PX4, 50.0, 310.0, [(310.0, 360.0), (360.0, 360.0)]),  # versions differ: any altitude from its own up
        (PX4, 50.0, 400.0, [(400.0, 400.0)]),
        (PLANE, 1000.0, 310.0, [(310.0, 360.0)]),  # climbs on the way
        (PLANE, 1000.0, 400.0, [(360.0, 400.0)]),  # descends on the way
    ],
)
def test_the_altitudes_of_the_way_home(
    autopilot: Autopilot, metres: float, amsl_m: float, expected: list[tuple[float, float]]
) -> None:
    pieces = return_pieces(RULES[autopilot], away(metres, amsl_m), HOME, 360.0, about_m=8.0)
    for found, want in zip(spans(pieces), expected, strict=True):
        assert found == pytest.approx(want, abs=1e-3)


def test_a_copter_ends_on_the_ground_and_a_plane_on_a_circle() -> None:
    assert return_pieces(RULES[COPTER], away(500.0, 320.0), HOME, 360.0, about_m=8.0)[-1].end == HOME
    about, _, circle = return_pieces(RULES[PLANE], away(500.0, 320.0), HOME, 360.0, about_m=8.0)
    assert (about.reach_m, about.instead) == (8.0, True)
    assert circle.reach_m == pytest.approx(60.0 * 1.1 / (1.0 - 2.25577e-5 * 360.0) ** 4.2559)
    assert math.isinf(circle.hold_s)
    assert circle_growth(-50.0) == pytest.approx(1.1)


def test_a_turn_about_takes_twice_the_larger_of_track_error_and_radius() -> None:
    v = vehicle(PLANE, track_error_m=7.0)
    assert about_turn_m(v) == 14.0
    assert about_turn_m(replace(v, turn_radius_m=50.0)) == 100.0
    assert at_home_m(v.limits) == 7.0
    assert at_home_m(replace(v.limits, track_error_m=1.0)) == 5.0


@pytest.mark.parametrize("metres", [8.0, 15.0, 40.0, 300.0])
@pytest.mark.parametrize("amsl_m", [305.0, 330.0, 352.0])
def test_the_sweep_has_the_cone_of_a_single_return(metres: float, amsl_m: float) -> None:
    w, v = world(300.0), vehicle(COPTER, track_error_m=0.0, altitude_error_m=0.0)
    u, one, none = np.array([0.0, 0.0]), np.zeros(2), np.zeros(1)
    trace = MissionTrace(
        u, one, one + metres, one + amsl_m, one, none, none, np.zeros(1, np.intp), none, none, w, 1
    )  # fmt: skip
    met = obstacles_of_returns(trace, trace.cut(1.0), Target(0.0, 0.0, 300.0, 300.0), v, whole=True).clear
    (base,), (limit,) = met.base[:1], met.limit[:1]
    lowest = max(base, min(max(345.0, amsl_m), limit))
    pieces = return_pieces(RULES[COPTER], away(metres, amsl_m), HOME, 345.0, about_m=0.0)
    assert lowest == pytest.approx(min(low for low, _ in spans(pieces)), abs=0.01)
