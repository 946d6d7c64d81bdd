"""Corners that autopilots cut: legs are judged as wide as the vehicle may be off them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.check.flight.corners import round_corners
from gcsplan.check.flight.follow import follow
from gcsplan.check.judge import judge
from gcsplan.check.motion.turn_parameters import Tuning
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.build.multirotor import corner_m
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.mission_file import load_mission
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World
from tests.support.paths import DATA
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
FLAT = world(half_m=4000.0)
HOME = Home.at(36.6, -84.3, 300.0)


def at(command: int, east: float, north: float, up: float, *params: float) -> MissionItem:
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(east, north))
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, m.RELATIVE, (p1, p2, p3, p4), m.degrees_e7(lat), m.degrees_e7(lon), up)


def mission(autopilot: Autopilot, *items: MissionItem) -> Mission:
    up = at(cmd.VTOL_TAKEOFF if autopilot is PLANE else cmd.TAKEOFF, 0, 0, 100)
    return Mission(autopilot, HOME, (up, *items, at(cmd.LOITER_UNLIM, 2000, 2000, 100)), "uav1")


def around(
    autopilot: Autopilot, radius_m: float, *, hold_s: float = 0.0, corner: tuple[float, float] = (1000, 0)
) -> Mission:
    """A mission east, then north, with the given acceptance radius at the corner."""
    return mission(
        autopilot, at(cmd.WAYPOINT, *corner, 100, hold_s, radius_m), at(cmd.WAYPOINT, 1000, 1000, 100, 0, 1.0)
    )


def inside(east: float, north: float, radius_m: float, *ceiling: float) -> World:
    zone = Zone("inside", Circle(east, north, radius_m), None, Level(*ceiling, "agl") if ceiling else None)
    return World(FLAT.frame, Airspace(FLAT.airspace.surface, [zone]))


def verdict(flown: Mission, where: World, craft: Vehicle | None = None, tuning: Tuning | None = None) -> Verdict:
    craft = craft or vehicle(flown.autopilot, horizontal_clearance_m=0.0)
    return judge(flown, craft, where, **({} if tuning is None else {"tuning": tuning}))


def test_an_acceptance_radius_that_cuts_through_a_zone_is_unsafe() -> None:
    # The zone of 100 m is clear of both legs; a vehicle that turns 255 m before the corner flies through it.
    zone = inside(880.0, 130.0, 100.0)
    tight, wide = (verdict(around(PX4, r), zone) for r in (2.0, 255.0))
    assert tight.safe is True, tight.describe()
    assert {(f.kind, f.zone) for f in wide.findings} == {("zone", "inside")}
    assert {f.seq - wide.mission.first_seq for f in wide.findings} <= {1, 2}


def test_arduplane_flying_past_its_way_point_is_not_judged() -> None:
    one = mission(PLANE, at(cmd.WAYPOINT, 1000, 0, 100, 0, 5.0, 40.0), at(cmd.WAYPOINT, 1000, 1000, 100, 0, 5.0))
    found = verdict(one, FLAT)
    assert found.safe is None
    assert Note("turns_late", 2, past_m=40.0) in found.not_judged


def test_a_hold_of_px4_begins_within_the_radius_too() -> None:
    zone = inside(880.0, 130.0, 100.0)
    assert verdict(around(PX4, 255.0, hold_s=20.0), zone).safe is False


def test_a_leg_that_is_left_before_its_end_is_judged_in_height_too() -> None:
    # A descent over 400 m: a vehicle that turns 200 m before its end joins the next leg 25 m too high.
    items = (
        at(cmd.WAYPOINT, 600, 0, 150, 0, 2.0),
        at(cmd.WAYPOINT, 1000, 0, 100, 0, 200.0),
        at(cmd.WAYPOINT, 1000, 900, 100, 0, 2.0),
    )
    low = inside(1000.0, 30.0, 20.0)
    above = World(
        low.frame, type(low.airspace)(low.airspace.surface, [replace(low.airspace.zones[0], floor=Level(112.0, "agl"))])
    )
    craft = vehicle(PX4, horizontal_clearance_m=0.0, altitude_error_m=0.5)
    assert verdict(mission(PX4, *items), above, craft, Tuning(px4_height_m=30.0)).safe is False
    near = [replace(i, params=(0.0, 2.0, 0.0, 0.0)) for i in items]
    assert verdict(mission(PX4, *near), above, craft, Tuning(px4_height_m=30.0)).safe is True


def test_a_landing_of_px4_begins_beside_its_place() -> None:
    items = (at(cmd.WAYPOINT, 1000, 0, 100, 0, 2.0), at(cmd.LAND, 1000, 500, 0))
    flown = Mission(PX4, HOME, (at(cmd.TAKEOFF, 0, 0, 100), *items), "uav1")
    beside = inside(1008.0, 500.0, 2.0, 40.0)
    assert verdict(flown, beside).safe is False
    assert verdict(flown, beside, tuning=Tuning.of({"NAV_ACC_RAD": 2.0})).safe is True


@pytest.mark.parametrize("autopilot", [COPTER, PLANE])
def test_a_circle_may_be_left_anywhere(autopilot: Autopilot) -> None:
    # The leg east from the circle's northern edge meets the zone; the leg from the circle's middle does not.
    circle = at(cmd.LOITER_TURNS, 0, 1000, 100, 2.0, 0, 200.0)
    one = mission(autopilot, circle, at(cmd.WAYPOINT, 1500, 1000, 100, 0, 2.0))
    beside = inside(450.0, 1140.0, 30.0)
    assert verdict(one, beside).safe is False
    assert verdict(one, inside(1000.0, 1060.0, 5.0)).safe is False  # two thirds along, it may be 67 m beside the leg
    assert verdict(one, inside(450.0, 1400.0, 30.0)).safe is True


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_return_begins_where_the_vehicle_is_and_not_where_its_way_point_is(autopilot: Autopilot) -> None:
    items = (at(cmd.LOITER_TURNS, 0, 2000, 100, 2.0, 0, 200.0),) if autopilot is COPTER else (
        at(cmd.WAYPOINT, 1000, 1000, 100, 0, 2.0), at(cmd.WAYPOINT, 0, 2000, 100, 0, 200.0),
    )  # fmt: skip
    flown = Mission(autopilot, HOME, (at(cmd.TAKEOFF, 0, 0, 100), *items, MissionItem(cmd.RTL, m.NO_POSITION)), "uav1")
    craft = vehicle(autopilot, horizontal_clearance_m=0.0)
    post = Zone("post", Circle(70.0, 1000.0, 10.0), Level(150.0, "agl"))  # beside the middle of the return
    where = World(FLAT.frame, Airspace(FLAT.airspace.surface, [post]))
    assert judge(flown, craft, where, rtl_rel_home_m=160.0).safe is False
    assert judge(flown, craft, where, rtl_rel_home_m=120.0).safe is True


def test_a_landing_behind_a_circle_is_on_the_circle_where_it_gives_no_place() -> None:
    circle = at(cmd.LOITER_TURNS, 0, 1000, 100, 2.0, 0, 100.0)
    ways = {}
    for name, land in (("here", MissionItem(cmd.LAND, m.RELATIVE)), ("there", at(cmd.LAND, 0, 1000, 0))):
        flown = Mission(COPTER, HOME, (at(cmd.TAKEOFF, 0, 0, 100), circle, land), "uav1")
        ways[name] = verdict(flown, inside(90.0, 1000.0, 5.0, 60.0)).safe
    assert ways == {"here": False, "there": True}


@pytest.mark.parametrize("autopilot", [PX4, PLANE])
def test_a_radius_longer_than_the_leg_skips_way_points(autopilot: Autopilot) -> None:
    # It may turn before the first of three close points and fly straight to the last way point, along the hypotenuse.
    near = [at(cmd.WAYPOINT, 1000 + 20 * k, 20.0 * (k % 2), 100, 0, 100.0) for k in range(3)]
    one = mission(autopilot, *near, at(cmd.WAYPOINT, 1040, 1000, 100, 0, 2.0))
    assert verdict(one, inside(985.0, 400.0, 15.0)).safe is False


@pytest.mark.nightly_but("0", "1")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_straight_line_from_where_it_turns_leaves_what_is_judged(seed: int) -> None:
    """Zones are as wide as the check allows; the vehicle flies straight from each turn to the next."""
    rng = np.random.default_rng([7, seed])
    craft = vehicle(PX4, horizontal_clearance_m=0.0, track_error_m=0.0, altitude_error_m=0.0)
    for _ in range(5):
        count = int(rng.integers(3, 6))
        points = np.column_stack([rng.uniform(-600, 600, (count, 2)), np.full(count, 100.0)])
        radii = np.floor(rng.choice([2.0, 20.0, 80.0, 250.0], count))
        items = [at(cmd.WAYPOINT, *p, 0.0, r) for p, r in zip(points, radii, strict=True)]
        flown, here = [np.zeros(2)], np.zeros(2)
        for p, r in zip(points[:, :2], radii, strict=True):
            far = float(np.hypot(*(p - here)))
            if far > r:
                here = here + (p - here) * (far - r) / far
            flown.append(here)
        flown.append(np.array([2000.0, 2000.0]))
        track = np.concatenate([a + np.linspace(0, 1, 400)[:, None] * (b - a) for a, b in itertools.pairwise(flown)])
        middle = track[int(rng.integers(0, len(track)))] + rng.normal(0, 60.0, 2)
        low, high = 0.0, 3000.0
        for _ in range(18):
            half = 0.5 * (low + high)
            safe = verdict(mission(PX4, *items), inside(*middle, half), craft).safe
            low, high = (half, high) if safe else (low, half)
        nearest = float(np.hypot(*(track - middle).T).min())
        assert nearest >= low - 0.05, (seed, middle, points, radii)


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_a_plan_keeps_what_its_corners_take_beyond_the_track_error(autopilot: Autopilot) -> None:
    crossing = yaml.safe_load((DATA / "crossing.yaml").read_text())
    crossing["limits"]["track_error_m"] = 0.5
    crossing["vehicles"][0]["autopilot"] = str(autopilot)
    (planned,) = plan(load_mission("corner.yaml", text=yaml.safe_dump(crossing))).vehicles
    assert planned.verdict.safe is True
    # Corners are mended where they are cut: a copter's keep what is left to cut, PX4's are moved.
    kept_m = corner_m(planned.request.vehicle)
    assert kept_m == pytest.approx(0.035 if autopilot is COPTER else 0.0)
    nearest = planned.verdict.nearest
    assert nearest is None or nearest.zone_clearance_m >= 30.0 + 0.5 + (0.0 if autopilot is COPTER else kept_m)


@pytest.mark.parametrize(("limit_deg", "safe"), [(51.0, True), (49.0, False), (46.0, False)])
def test_a_leg_shorter_than_its_arcs_climbs_over_what_is_flown(limit_deg: float, safe: bool) -> None:
    # Two arcs of 0.5 m on a leg of 0.8 m, an overlap that the check allows for rounding: 50 degrees, not 44.
    turn = 2.0 * math.atan(0.5 / 40.0)
    places = [np.array([0.0, 0.0]), np.array([600.0, 0.0])]
    for k, metres in enumerate((0.8, 700.0), 1):
        places.append(places[-1] + metres * np.array([math.cos(k * turn), math.sin(k * turn)]))
    rise = 0.8 * math.tan(math.radians(50.0))
    ups = (100.0, 100.0, 100.0 + rise, 100.0 + rise)
    items = [at(cmd.WAYPOINT, *p, up, 0.0, 1.0) for p, up in zip(places[1:], ups[1:], strict=True)]
    up = at(cmd.VTOL_TAKEOFF, 0, 0, 100)
    end = at(cmd.LOITER_UNLIM, *places[-1], ups[-1])
    craft = vehicle(PLANE, horizontal_clearance_m=0.0, max_climb_deg=limit_deg)
    found = verdict(Mission(PLANE, HOME, (up, *items, end), "uav1"), FLAT, craft)
    kinds = {f.kind for f in found.findings}
    assert kinds == (set() if safe else {"climb"}), found.describe()


@pytest.mark.slow
def test_a_copters_blended_corners_lie_within_the_widened_legs() -> None:
    """Second implementation: while it turns, the copter is moved by what both legs add, half of the shorter at most."""
    craft = vehicle(COPTER, horizontal_clearance_m=0.0, track_error_m=0.0, altitude_error_m=0.0)
    s = np.linspace(0.0, 1.0, 41)[:, None]
    for seed in range(150):
        rng = np.random.default_rng(seed)
        long = rng.choice([0.05, 0.3, 3.0, 40.0, 300.0], 2) * rng.uniform(0.7, 1.3, 2)
        course = np.cumsum(rng.uniform(-3.1, 3.1, 2))
        steps = np.column_stack([np.sin(course), np.cos(course), rng.uniform(-1.2, 1.2, 2)]) * long[:, None]
        a, b, c = np.cumsum([[300.0, 200.0, 200.0], *steps], axis=0)
        flown = mission(COPTER, *(at(cmd.WAYPOINT, *p) for p in (a, b, c)))
        flight = follow(flown, craft, FLAT.ground_amsl)
        round_corners(flight, flown, craft, FLAT.frame)
        legs = [x for x in (*flight.stretches, *flight.instead) if x.seq in (flown.first_seq + 2, flown.first_seq + 3)]
        ends = np.array([[[*FLAT.frame.to_plane(*p[:2]), p[2]] for p in (x.start, x.end)] for x in legs])
        first = next(x for x in ends if abs(x[1, 2] - 300.0 - b[2]) < 0.01)
        b = first[1]
        u, v = (w / np.linalg.norm(w) for w in (b - first[0], steps[1]))
        lengths = np.linalg.norm(first[1] - first[0]), np.linalg.norm(steps[1])
        d = min(0.5 * min(lengths), 4.0 * 2.0 / max(float(np.linalg.norm(v - u)), 1e-6))
        for p in b - d * (1.0 - s) ** 2 * u + d * s**2 * v:
            inside = []
            for x, (one, two) in zip(legs, ends, strict=True):
                run = (two - one)[:2]
                t = np.clip((p - one)[:2] @ run / max(float(run @ run), 1e-12), 0.0, 1.0)
                off = np.abs(one + t * (two - one) - p)
                inside.append(math.hypot(*off[:2]) <= x.reach_m + 0.02 and off[2] <= x.band_m + 0.03)
            assert any(inside), (seed, long, p, b)


def test_a_peak_with_a_short_leg_behind_it_is_hardly_cut() -> None:
    craft = vehicle(COPTER, horizontal_clearance_m=0.0, track_error_m=0.0, altitude_error_m=0.0)

    def lowest_m(*places: tuple[float, float, float]) -> float:
        flown = mission(COPTER, *(at(cmd.WAYPOINT, *p) for p in places))
        flight = follow(flown, craft, FLAT.ground_amsl)
        round_corners(flight, flown, craft, FLAT.frame)
        return max((x.band_m for x in flight.instead if abs(x.end[2] - 500.0) < 0.01), default=0.0)

    before, peak, behind = (300.0, 0.0, 150.0), (600.0, 0.0, 200.0), (900.0, 0.0, 150.0)
    assert lowest_m(before, peak, behind) == pytest.approx(2.0)
    assert lowest_m(before, peak, (600.05, 0.0, 200.0), behind) < 0.01
