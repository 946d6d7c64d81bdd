"""How near a mission comes to each limit: what is kept is never called broken.

Highest heights above ground and heights over or under zones are held against brute force along the line. The depth that
a finding tells was tried: it suffices, and hardly any less does.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.check.margins import CENTIMETRE, FINE_PART, Miss, enough, nearest_misses
from gcsplan.mission_file import load_mission
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.noted import codes
from tests.support.worlds import vehicle, world


def test_a_zone_whose_clearance_is_kept_is_not_broken_for_a_bound_of_distance() -> None:
    # Beside a zone over ground the distance is a lower bound, here a hair below what is required.
    craft = vehicle(horizontal_clearance_m=30.0)
    limits = craft.limits
    where = world(300.0, [Zone("quarry", Circle(1000.0, 400.0, 200.0), None, Level(300.0, "agl"))])
    legs = Legs.of_path(np.array([[0.0, 0.0, 420.0], [2000.0, 0.0, 420.0]]), limits)
    report = where.airspace.examine(legs, limits)
    assert report.violations == ()
    needed = (limits.horizontal_clearance_m + limits.track_error_m) * where.airspace.scale
    close = replace(report, zone_clearance_m=np.full(1, needed - 1e-6))
    stretch: Any = SimpleNamespace(seq=3)
    (miss,) = [m for m in nearest_misses([stretch], legs, np.zeros(1, np.intp), close, craft, where) if m.zone]
    assert miss.room == 0.0
    assert ": 33.0 m of 30, 0.0 m to spare beyond the track error, item 3 (" in str(miss.note)


def test_inside_a_zone_no_negative_distance_is_told() -> None:
    miss = Miss("zone", -206.61, -173.61, 30.0, "m", 3, 36.6, -84.3, 579.7, "dam")
    words = "inside zone dam: 173.7 m from its edge, broken by 206.7 m with the track error, item 3 ("
    assert str(miss.note).startswith(words)


WIDE = {"max_climb_deg": 60}


def crossing(zones: list[dict[str, Any]], agl_m: float, **limits: float) -> Any:
    return plan(
        load_mission(
            {
                "version": 1, "name": "over", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
                "limits": {
                    "min_agl_m": 30, "track_error_m": 1, "altitude_error_m": 1, "horizontal_clearance_m": 5,
                } | limits,
                "no_fly": zones,
                "vehicles": [
                    {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.60, -84.38],
                     "goal": [36.596, -84.355], "takeoff_agl_m": agl_m, "approach_agl_m": agl_m, "max_climb_deg": 60},
                ],
            }
        )
    )  # fmt: skip


def brute(done: Any) -> tuple[float, list[tuple[float, float]]]:
    """The greatest height above ground, and place and altitude of every metre flown."""
    frame, surface, [v] = done.world.frame, done.world.airspace.surface, done.vehicles
    most, places = 0.0, []
    for leg in v.verdict.legs:
        ends = np.array([[*np.ravel(frame.to_plane(*p[:2])), p[2]] for p in (leg.start, leg.end)])
        for t in np.linspace(0.0, 1.0, 3000):
            e, n, z = (1 - t) * ends[0] + t * ends[1]
            most = max(most, z - float(surface.ground_at(e, n)))
            places.append((e, n, z))
    return most, places


@pytest.mark.slow
@pytest.mark.nightly_but("zone0-over", "zone2-under")
@pytest.mark.parametrize(
    ("zone", "side"),
    [
        ({"radius_m": 200, "ceiling_agl_m": 60}, "over"),
        ({"radius_m": 200, "ceiling_amsl_m": 600}, "over"),
        ({"radius_m": 200, "floor_agl_m": 300}, "under"),
        ({"radius_m": 200, "floor_amsl_m": 900, "ceiling_amsl_m": 1200}, "under"),
    ],
)
def test_heights_over_and_under_a_zone_are_the_least_of_every_metre(zone: dict[str, float], side: str) -> None:
    done = crossing([{"name": "there", "center": [36.598, -84.3675], **zone}], 120.0)
    [v] = done.vehicles
    highest, places = brute(done)
    assert v.verdict.highest.max_agl_m == pytest.approx(highest, abs=0.3)
    assert v.verdict.highest.max_agl_m >= highest - 1e-6
    frame, surface, shape = done.world.frame, done.world.airspace.surface, done.world.airspace.zones[0].shape
    inside = [(e, n, z) for e, n, z in places if np.hypot(e - shape.east_m, n - shape.north_m) < shape.radius_m]
    assert inside, "the path leads over or under the zone"
    ground = [float(surface.ground_at(e, n)) for e, n, _ in inside]
    level = zone.get("ceiling_agl_m" if side == "over" else "floor_agl_m")
    amsl = zone.get("ceiling_amsl_m" if side == "over" else "floor_amsl_m")
    limit = [g + level if level is not None else amsl for g in ground]
    sign = 1.0 if side == "over" else -1.0
    least = min(sign * (z - h) for (_, _, z), h in zip(inside, limit, strict=True))
    passed = v.verdict.zone_pass
    assert (passed.zone, passed.side) == ("there", side)
    assert least - 1.0 <= passed.height_m <= least + 0.01
    told = summary_of(done)["vehicles"][0]
    assert (told["min_zone_height_m"], told["zone_passed"]["side"]) == (passed.height_m, side)
    assert told["max_agl_m"] == v.verdict.highest.max_agl_m
    assert "m above ground" in outputs_of(done)["mission.kml"].split("<description>")[1].split("</description>")[0]
    assert frame is not None


@pytest.mark.slow
def test_a_zone_that_is_passed_beside_is_not_passed_over() -> None:
    [v] = crossing([{"name": "there", "center": [36.598, -84.3675], "radius_m": 200}], 120.0).vehicles
    assert v.verdict.nearest.nearest_zone == "there"
    assert v.verdict.zone_pass is None


@pytest.mark.slow
def test_a_mission_without_a_greatest_height_says_so() -> None:
    for limits, said in (({}, True), ({"max_agl_m": 400}, False)):
        notes = crossing([], 120.0, **limits).vehicles[0].verdict.notes
        assert ("no_ceiling" in codes(notes)) is said


OFF = {"min_agl": 1.0, "terrain_clearance": 1.0, "max_agl": -1.0}
MOST_OVER = 2.0 * FINE_PART


@pytest.mark.parametrize("kind", sorted(OFF))
@pytest.mark.parametrize("seed", range(12))
def test_the_depth_suffices_and_hardly_less_does(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    (a, b), (c, d) = rng.uniform(2e-4, 4e-3, (2, 2))
    where = world(lambda e, n: 300.0 + 60.0 * np.sin(a * e + b * n) + 25.0 * np.cos(c * e + d * n))
    limits = vehicle(
        min_agl_m=60.0 if kind == "min_agl" else 0.0,
        max_agl_m=90.0 if kind == "max_agl" else None,
        horizontal_clearance_m=40.0 if kind == "terrain_clearance" else 0.0,
    ).limits
    height_m = {"min_agl": 380.0, "terrain_clearance": 330.0, "max_agl": 420.0}[kind] + rng.uniform(-25.0, 25.0)
    ends = np.column_stack([rng.uniform(-4000.0, 4000.0, (5, 2)), np.full(5, height_m)])
    legs = Legs.of_path(ends, limits)

    def broken(by: float) -> list[Violation]:
        lift = np.array([0.0, 0.0, OFF[kind] * by])
        moved = replace(legs, start=legs.start + lift, end=legs.end + lift)
        return [v for v in where.airspace.examine(moved, limits).violations if v.kind == kind]

    found = broken(0.0)
    assert found, "the legs are too high to break anything"
    worst = max(found, key=lambda v: v.by)
    depth = enough(worst, np.array(sorted({v.leg for v in found})), legs, limits, where.airspace).by
    assert depth == round(depth, 2)
    assert not broken(depth)
    assert broken((1.0 - MOST_OVER) * depth - 2.0 * CENTIMETRE)
