"""Places of a flight: on the antimeridian it is judged as anywhere else on its latitude."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.check.judge import judge
from gcsplan.check.motion.stretch import near_lon, on_globe, place_on
from gcsplan.check.returns.way_home import way_home
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.world import World
from tests.campaigns.limit_cases import WING_RADIUS_M, WING_SPEED_M_S, WINGED, make_ground, make_mission

FAMILIES = {
    "px4": Autopilot.PX4, "vtol": Autopilot.ARDUPLANE, "terrain": Autopilot.ARDUCOPTER, "wing": Autopilot.ARDUPLANE,
    "return": Autopilot.ARDUCOPTER, "spline": Autopilot.ARDUCOPTER, "circle": Autopilot.ARDUCOPTER,
}  # fmt: skip


def test_a_place_on_a_stretch_lies_between_its_ends_and_the_ends_are_not_rounded() -> None:
    a, b = (36.1, -84.3, 412.7), (36.7, -84.9, 100.1)
    assert place_on(a, b, 0.25) == pytest.approx((36.25, -84.45, 334.55))
    assert (place_on(a, b, 0.0), place_on(a, b, -1e-9)) == (a, a)
    assert (place_on(a, b, 1.0), place_on(a, b, 1.0 + 1e-9)) == (b, b)


def test_longitudes_are_taken_from_the_nearer_side() -> None:
    assert near_lon(-179.9, 179.9) == pytest.approx(180.1)
    assert near_lon(179.9, -179.9) == pytest.approx(-180.1)
    assert near_lon(12.3456789, 100.0) == 12.3456789
    assert place_on((1.0, 179.0, 5.0), (2.0, -179.0, 7.0), 0.75) == (1.75, 180.5, 6.5)
    assert on_globe((1.75, 180.5, 6.5)) == (1.75, -179.5, 6.5)


def flown_at(family: str, lon_deg: float) -> tuple[Mission, Vehicle, World]:
    """The same mission in metres around a place on the 40th parallel south."""
    rng = np.random.default_rng(7)
    ground = make_ground(rng, 5000.0 if family in WINGED else 900.0)
    level = np.zeros_like(ground.heights)
    surface, pilot = Surface(level, level, ground.grid), FAMILIES[family]
    frame = Frame(-40.0, lon_deg - (0.006 if family in WINGED else 0.0))  # in the middle of what is flown
    mission = make_mission(rng, family, pilot, ground, surface, frame)
    radius_m, speed_m_s = (WING_RADIUS_M, WING_SPEED_M_S) if family in WINGED else (0.0, 10.0)
    craft = Vehicle(
        "uav1", 1, pilot, Limits(10.0, horizontal_clearance_m=2.0, track_error_m=1.0), speed_max_m_s=speed_m_s,
        turn_radius_m=radius_m, vtol=family == "vtol", energy=Energy(120.0, 100.0, hover_w=300.0, battery_j=1e7),
    )  # fmt: skip
    return mission, craft, World(frame, Airspace(surface, ()))


def judged_at(family: str, lon_deg: float) -> Verdict:
    mission, craft, where = flown_at(family, lon_deg)
    verdict = judge(mission, craft, where, rtl_rel_home_m=90.0, misses=True)
    if family in ("px4", "vtol", "return"):
        home = way_home(verdict, craft, where, rtl_rel_home_m=90.0)
        assert home.safe is not None
    return verdict


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_a_flight_over_the_antimeridian_is_judged_as_anywhere(family: str) -> None:
    there, here = judged_at(family, 20.0), judged_at(family, 180.0)
    assert {math.copysign(1.0, i.y) for i in here.mission.items if i.frame != m.NO_POSITION} == {-1.0, 1.0}
    assert here.safe is there.safe
    assert [f.kind for f in here.findings] == [f.kind for f in there.findings]
    assert [(leg.kind, leg.times) for leg in here.legs] == [(leg.kind, leg.times) for leg in there.legs]
    for a, b in zip(here.legs, there.legs, strict=True):
        assert a.length_m == pytest.approx(b.length_m, abs=0.1)
        assert a.energy_j == pytest.approx(b.energy_j, rel=1e-3, abs=50.0)
        assert max(abs(a.start[1]), abs(a.end[1])) <= 180.0
