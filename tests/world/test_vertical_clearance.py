"""The clearance above and below zones: as if each zone were higher and deeper by it, for check, home and plans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan import load_mission, plan
from gcsplan.world import level_lines
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.worlds import surface

LIMITS = Limits(min_agl_m=-1e6, horizontal_clearance_m=20.0, track_error_m=3.0, altitude_error_m=4.0)


def zones(more_m: float) -> list[Zone]:
    """Zones of all kinds of levels, grown up and down by ``more_m``."""
    ring = np.array([[-50.0, 300.0], [50.0, 300.0], [50.0, 400.0], [-50.0, 400.0]])
    return [
        Zone("low", Circle(0, 0, 60), None, Level(400.0 + more_m, "amsl")),
        Zone("band", Polygon(ring), Level(350.0 - more_m, "amsl"), Level(380.0 + more_m, "amsl")),
        Zone("agl", Circle(0, 800, 60), Level(80.0 - more_m, "agl"), Level(120.0 + more_m, "agl")),
    ]


def test_the_check_is_that_of_taller_zones() -> None:
    rng = np.random.default_rng(3)
    ground = surface(lambda e, n: 300.0 + 0.02 * e + 0.01 * n, half_m=3000.0)
    start = rng.uniform((-400, -300, 330), (400, 1100, 460), (400, 3))
    end = start + rng.uniform((-300, -300, -30), (300, 300, 30), (400, 3))
    error = np.full(400, 4.0)
    legs = Legs(start, end, np.zeros(400, np.bool_), np.full(400, 3.0), error)
    tall = Airspace(ground, zones(7.5)).examine(legs, LIMITS)
    kept = Airspace(ground, zones(0.0)).examine(legs, replace(LIMITS, vertical_clearance_m=7.5))
    bare = Airspace(ground, zones(0.0)).examine(legs, LIMITS)
    assert {(v.leg, v.zone) for v in kept.violations} == {(v.leg, v.zone) for v in tall.violations}
    assert len(kept.violations) > len(bare.violations)
    assert [v.by for v in kept.violations] == pytest.approx([v.by for v in tall.violations], abs=0.02)
    np.testing.assert_allclose(kept.zone_clearance_m, tall.zone_clearance_m, atol=0.02)


def test_it_is_kept_to_a_micrometre_over_a_level_above_the_sea() -> None:
    air = Airspace(surface(300.0), zones(0.0))
    legs = Legs.of_path([(-200.0, 0.0, 410.0), (200.0, 0.0, 410.0)], LIMITS)
    assert air.clear(legs, replace(LIMITS, vertical_clearance_m=6.0)).all()
    assert not air.clear(legs, replace(LIMITS, vertical_clearance_m=6.00001)).any()


def test_tubes_and_level_lines_are_those_of_taller_zones() -> None:
    ground = surface(300.0, half_m=3000.0)
    tall, low = Airspace(ground, zones(7.5)), Airspace(ground, zones(0.0))
    kept = replace(LIMITS, vertical_clearance_m=7.5)
    track = np.array([[0.0, -500.0], [0.0, 1500.0]])
    for a, b in zip(tall.tube(track, LIMITS).bands, low.tube(track, kept).bands, strict=True):
        np.testing.assert_allclose(a.top_m, b.top_m)
        np.testing.assert_allclose(a.bottom_m, b.bottom_m)
    one = level_lines.over(tall, track[:1], track[1:], LIMITS).crossings
    two = level_lines.over(low, track[:1], track[1:], kept).crossings
    np.testing.assert_allclose(one.top_m, two.top_m)
    np.testing.assert_allclose(one.bottom_m, two.bottom_m)


@pytest.mark.nightly_but("optimal-agl")
@pytest.mark.slow
@pytest.mark.parametrize(("planner", "datum"), [("optimal", "amsl"), ("optimal", "agl")])
def test_plans_are_those_past_taller_zones(planner: str, datum: str) -> None:
    def cost(more_m: float, clearance_m: float) -> tuple[float, float]:
        zero = 100.0 if datum == "amsl" else 0.0
        wall = {"name": "wall", "polygon": [[46.005, 13.9], [46.005, 14.1], [46.0052, 14.1], [46.0052, 13.9]]}
        made = plan(load_mission({
            "version": 1, "terrain": {"flat_m": 100}, "planner": {"name": planner, "budget_s": 2.0},
            "limits": {"min_agl_m": 30, "max_climb_deg": 30, "vertical_clearance_m": clearance_m},
            "no_fly": [wall | {f"ceiling_{datum}_m": zero + 60.0 + more_m}],
            "vehicles": [{"name": "a", "sysid": 1, "autopilot": "arducopter", "start": [46.0, 14.0],
                          "goal": [46.01, 14.0]}],
        }))  # fmt: skip
        (vehicle,) = made.vehicles
        assert not vehicle.verdict.findings
        return vehicle.solution.lower_bound, vehicle.cost

    kept = cost(0.0, 12.0)
    assert kept == pytest.approx(cost(12.0, 0.0), rel=1e-6)
    assert kept[1] > cost(0.0, 0.0)[1] + 0.01
