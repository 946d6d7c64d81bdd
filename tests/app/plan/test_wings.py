"""Fixed wings: arcs, climb-outs and glides as they are judged, built, planned, timed and rehearsed."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gcsplan.app.check.files import check_files
from gcsplan.app.fleet.fleet import route_of
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.plan import wings
from gcsplan.app.plan.model import Plan
from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.ends import above_slant, flared, over_m, slant_shortage
from gcsplan.check.judge import judge
from gcsplan.check.motion.circles import tracking_m
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, NoMission
from gcsplan.fleet.motion.timing import Course
from gcsplan.mavlink.build.fixed_wing import accepted_m, build_wing, parted
from gcsplan.mavlink.build.order import Order, Wing
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.autopilots import stored
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mission_file import VehicleRequest, load_mission
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Problem
from gcsplan.planners.turns.ends import FlightEnd
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.track import make_track
from gcsplan.vehicle import Autopilot, ClimbOut
from gcsplan.world.geodesy.atmosphere import true_per_indicated
from gcsplan.world.geometry.fly_by import flown_m, tangents_m, thinned
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World
from tests.check.fixed_wing.test_arcs import bent
from tests.support.effort import draws
from tests.support.noted import codes, one
from tests.support.paths import MISSIONS
from tests.support.wings import FLAT, GROUND_M, HOME_DEG, RADIUS_M, SPEED_M_S, at, mission, take_off, wing
from tests.support.worlds import world

pytestmark = pytest.mark.xdist_group("wings")  # one process plans the missions, not three


"""More than the L1 controller is off in a right angle at the speed of these tests."""


# -- leaving the ground and coming back ------------------------------------------------------------------------------


def hill(east_m: float, north_m: float, high_m: float, wide_m: float = 150.0) -> World:
    def height(east: Floats, north: Floats) -> Floats:
        return GROUND_M + high_m * np.exp(-(((east - east_m) ** 2 + (north - north_m) ** 2) / wide_m**2))

    return world(height, half_m=4000.0)


def test_a_climb_out_goes_to_its_item_as_steeply_as_pitch_and_limit_allow() -> None:
    flight = bent(mission(take_off(80.0, 300.0, 300.0), at(cmd.LOITER_UNLIM, 2000, 2000, 80, 0, 0, 100)), wing())
    first = flight.stretches[0]
    east, north = FLAT.frame.to_plane(*first.end[:2])
    assert (first.kind, first.column) == ("takeoff", True)
    assert math.degrees(math.atan2(80.0, math.hypot(east, north))) == pytest.approx(8.0, abs=0.03)
    assert east == pytest.approx(north, rel=1e-3)
    shallow = replace(take_off(), params=(5.0, 0.0, 0.0, 0.0))
    far = bent(mission(shallow, at(cmd.LOITER_UNLIM, 3000, 0, 80, 0, 0, 100)), wing()).stretches[0]
    run_m = FLAT.frame.to_plane(*far.end[:2])[0]
    assert math.degrees(math.atan2(80.0, run_m)) == pytest.approx(5.0, abs=0.03)


def test_a_take_off_without_a_place_leads_towards_the_next_item_and_says_so() -> None:
    placeless = replace(take_off(), x=0, y=0)
    flight = bent(mission(placeless, at(cmd.LOITER_UNLIM, 0, 2000, 80, 0, 0, 100)), wing())
    assert FLAT.frame.to_plane(*flight.stretches[0].end[:2])[1] > 500.0
    assert "climb_out_towards_next" in codes(flight.notes)


@pytest.mark.parametrize(
    ("place", "high_m", "safe"), [((350, 0), 60.0, False), ((350, 0), 20.0, True), ((350, 600), 60.0, True)]
)
def test_a_climb_out_is_held_against_the_ground_below_it(place: tuple[int, int], high_m: float, safe: bool) -> None:
    where = hill(*place, high_m)
    items = (at(cmd.TAKEOFF, 600, 0, 160, 8, where=where), at(cmd.LOITER_UNLIM, 3000, 0, 160, 0, 0, 100, where=where))
    verdict = judge(mission(*items), wing(), where)
    assert verdict.safe is safe, verdict.describe()
    if not safe:
        assert {(f.note.code, f.note.data["glide"]) for f in verdict.findings} == {("near_ground_on_slant", False)}


def test_a_zone_in_the_climb_out_is_a_violation_though_min_agl_is_not() -> None:
    where = world(GROUND_M, [Zone("mast", Circle(300.0, 0.0, 20.0))])
    verdict = judge(mission(take_off(), at(cmd.LOITER_UNLIM, 3000, 0, 80, 0, 0, 100)), wing(), where)
    assert [(f.seq, f.kind) for f in verdict.findings] == [(1, "zone")]


def test_a_glide_is_judged_straight_and_one_that_is_too_steep_is_named() -> None:
    good = judge(mission(take_off(), at(cmd.WAYPOINT, 2000, 0, 80, 0, 1), at(cmd.LAND, 2700, 0, 0)), wing(), FLAT)
    assert good.safe is True, good.describe()
    assert [leg.kind for leg in good.legs][-1] == "land"
    steep = judge(mission(take_off(), at(cmd.WAYPOINT, 2000, 0, 80, 0, 1), at(cmd.LAND, 2400, 0, 0)), wing(), FLAT)
    assert [f.kind for f in steep.findings] == ["descent"]
    high = judge(mission(take_off(), at(cmd.WAYPOINT, 2000, 0, 80, 0, 1), at(cmd.LAND, 2700, 0, 30)), wing(), FLAT)
    assert high.safe is None
    assert Note("glide_off_ground", 3, off_m=30.0, below=True) in high.not_judged


@settings(max_examples=draws(40))
@given(st.floats(-30.0, 60.0), st.floats(100.0, 700.0), st.floats(-100.0, 100.0), st.floats(80.0, 250.0))
@example(60.0, 100.0, 100.0, 99.0)
def test_the_room_below_a_climb_out_is_what_sampling_finds(high: float, east: float, north: float, wide: float) -> None:
    where, limits = hill(east, north, high, wide), wing().limits
    ground = where.airspace.surface.ground_at(0.0, 0.0)
    line = np.array([[0.0, 0.0, float(ground)], [570.0, 0.0, float(ground) + 80.0]])
    s = np.linspace(0.0, 1.0, 400)[:, None]
    points = line[0] + s * (line[1] - line[0])
    room = np.minimum(limits.altitude_error_m, 0.5 * (points[:, 2] - line[0, 2]))
    least = math.inf
    for side in np.linspace(-3.0, 3.0, 7):
        beside = np.where(room < limits.altitude_error_m - 1e-6, 0.0, side)
        spare = points[:, 2] - room - where.airspace.surface.ground_at(points[:, 0], points[:, 1] + beside)
        least = min(least, float(spare.min()))
    found = slant_shortage(line, line[0], 0.0, limits, where.airspace)
    if least < -0.06:
        assert found is not None
        assert found[3] >= -least - 0.2  # that it is too low is told exactly, by how much to a decimetre or two
    elif least > 0.6:  # the check knows the ground within three metres all around, not only to both sides
        assert found is None


@pytest.mark.parametrize(
    ("radius_m", "speed_m_s", "flown"),
    [
        (
            100.0,
            21.0,
            {3: 1.8, 6.3: 4.3, 15: 6.5, 30: 10.4, 45: 12.9, 60: 13.8, 75: 14.7, 90: 14.3, 105: 12.6, 120: 13.8},
        ),
        (100.0, 14.6, {15: 2.9, 30: 6.2, 45: 4.9, 60: 6.4, 75: 7.2, 90: 9.5, 120: 21.5}),
        (180.0, 28.3, {15: 8.1, 30: 11.4, 45: 13.9, 60: 15.2, 75: 16.1, 90: 14.1}),
    ],
)
def test_what_the_simulated_plane_was_off_its_arcs_is_within_what_is_told(
    radius_m: float, speed_m_s: float, flown: dict[float, float]
) -> None:
    for turn_deg, off_m in flown.items():
        assert off_m <= tracking_m(radius_m, math.radians(turn_deg), speed_m_s) <= 3.0 * off_m, turn_deg


def test_a_speed_that_rounds_to_nothing_is_simulated_too() -> None:
    assert 0.0 < tracking_m(100.0, math.radians(60.0), 0.04) < math.inf
    assert tracking_m(100.0, math.radians(60.0), 0.0) == 0.0


def test_a_zone_above_the_slant_is_hit_by_one_that_climbs_steeper() -> None:
    where = world(GROUND_M, [Zone("kite", Circle(200.0, 0.0, 20.0), floor=Level(60.0, "agl"))])
    verdict = judge(mission(take_off(), at(cmd.LOITER_UNLIM, 3000, 0, 80, 0, 0, 100)), wing(), where)
    assert {(f.seq, f.kind) for f in verdict.findings} == {(1, "zone")}


def test_what_lies_above_a_slant_is_level_and_begins_within_two_errors_of_it() -> None:
    limits = wing().limits
    *found, over = above_slant((0.0, 0.0, 10.0), (100.0, 0.0, 90.0), limits, over_m(wing()))
    assert over[1][2] - over[2] == pytest.approx(90.0)
    assert over[1][2] + over[2] + limits.altitude_error_m == pytest.approx(106.0)
    for low, high, half in found:
        assert low[2] == high[2]
        assert low[2] + half == pytest.approx(90.0)
        assert 0.0 <= low[2] - half - (10.0 + 0.8 * low[0]) <= 2.0 * limits.altitude_error_m
    assert [a[1] for a in pairwise([f[0][0] for f in found])] == [f[1][0] for f in found[:-1]]


def test_a_glide_is_flown_below_its_line_before_the_flare() -> None:
    line = flared((0.0, 0.0, 80.0), (700.0, 0.0, 0.0), 700.0, 20.0)
    assert len(line) == 3
    east, _, z = line[1]
    straight = 80.0 * (1.0 - east / 700.0)
    assert 3.0 < straight - z < 6.0
    assert z == pytest.approx(2.0 * 20.0 * 80.0 / 700.0)
    slope = (80.0 - z) / east  # all on one line from the way point
    assert line[0][2] == pytest.approx(80.0 - slope * 350.0)
    assert line[2] == (700.0, 0.0, 0.0)


def test_circles_are_left_as_low_as_arduplane_calls_it_high_enough() -> None:
    items = (
        at(cmd.TAKEOFF, 213, 0, 30, 8), at(31, 213, 100, 100, 0, -100), at(cmd.LOITER_UNLIM, 1500, 100, 100, 0, 0, 100),
    )  # fmt: skip
    flight = bent(mission(*items), wing())
    leg = next(s for s in flight.stretches if s.seq == 3)
    low = min((s for s in flight.instead if s.seq == 3), key=lambda s: s.start[2])
    assert low.reach_m > 100.0
    assert leg.start[2] - low.start[2] == pytest.approx(5.0)
    assert low.start[:2] == leg.start[:2]
    where = world(GROUND_M)
    limit = wing(min_agl_m=92.0)
    assert {(f.seq, f.kind) for f in judge(mission(*items), limit, where).findings} == {(3, "min_agl")}
    assert judge(mission(*items), wing(min_agl_m=89.0), where).safe is True


def circling_up(where: World) -> Verdict:
    """A climb-out to 30 m, an anticlockwise circle to its left up to 100 m, and on."""
    items = (
        at(cmd.TAKEOFF, 213, 0, 30, 8, where=where),
        at(31, 213, 100, 100, 0, -100, where=where),
        at(cmd.WAYPOINT, 1500, 100, 100, 0, 42, where=where),
        at(cmd.LOITER_UNLIM, 2500, 1100, 100, 0, 0, 100, where=where),
    )
    return judge(mission(*items), wing(), where)


def test_a_take_off_may_go_on_in_circles_which_are_flown_and_judged() -> None:
    good = circling_up(FLAT)
    assert good.safe is True, good.describe()
    helix = [leg for leg in good.legs if leg.seq == 2 and leg.horizontal_m > 0.0]
    away = [math.dist(FLAT.frame.to_plane(*leg.end[:2]), (213.0, 100.0)) for leg in helix]
    assert away == pytest.approx([100.0] * len(helix), abs=1.0)
    assert helix[0].end[1] > helix[0].start[1]
    assert helix[0].end[0] > helix[0].start[0]
    assert sum(leg.horizontal_m for leg in helix) == pytest.approx(70.0 / math.tan(math.radians(8.0)), rel=0.02)
    assert [f.kind for f in circling_up(hill(213.0, 100.0, 60.0, 100.0)).findings][:1] == ["min_agl"]
    inside = world(GROUND_M, [Zone("mast", Circle(213.0, 100.0, 20.0))])  # nobody flies there, if all goes well
    assert {(f.seq, f.kind) for f in circling_up(inside).findings} >= {(2, "zone")}


@pytest.mark.slow
def test_out_of_a_bowl_it_climbs_in_circles() -> None:
    def bowl(east: Floats, north: Floats) -> Floats:
        return GROUND_M + 240.0 * np.exp(-(((np.hypot(east, north) - 900.0) / 230.0) ** 2))

    where = world(bowl, half_m=4000.0)
    craft, home = wing(), (0.0, 0.0, float(where.airspace.surface.ground_at(0.0, 0.0)))
    problem = Problem(where.airspace, craft.limits, (0.0, 0.0, 365.0), (3500.0, 0.0, 365.0), turn_radius_m=RADIUS_M)
    request = VehicleRequest(craft, home, (3500.0, 0.0, GROUND_M), HOME_DEG, HOME_DEG)
    sharp = np.array([[0.0, 0.0, 365.0], [3500.0, 0.0, 365.0]])
    end = next(wings.starts(problem, request, sharp))
    assert end.circle is not None
    ends = Wing(tuple(end.top), None, 100.0, tuple(end.circle), end.circle_m)
    path = Path(np.vstack([end.chain, [3500.0, 0.0, 800.0]]))
    flown = build_wing(path, where, craft, HOME_DEG, Order(end="loiter", wing=ends))
    assert [item.command for item in flown.items[:3]] == [22, 31, 178]
    verdict = judge(flown, craft, where)
    assert not [f for f in verdict.findings if f.seq <= 4], verdict.describe()
    # It climbs out at one speed, the circles included; then the path begins.
    before = verdict.legs[: next(i for i, leg in enumerate(verdict.legs) if leg.on_path)]
    places = np.array([before[0].start, *(leg.end for leg in before)])
    line = where.frame.to_plane(places[:, 0], places[:, 1])
    space_m = np.linalg.norm(np.diff(np.column_stack([line, places[:, 2]]), axis=0), axis=1)
    in_thin_air = craft.speed_max_m_s * true_per_indicated(0.5 * (places[1:, 2] + places[:-1, 2]))
    climb_s = float((space_m / in_thin_air).sum())
    assert math.fsum(leg.time_s for leg in before) == pytest.approx(climb_s, rel=1e-3)


# -- on the wire -----------------------------------------------------------------------------------------------------


def built(
    points: list[tuple[float, float, float]],
    touch: tuple[float, float, float] | None = None,
    circle_m: float = 0.0,
    **order: object,
) -> Mission:
    amsl = [(e, n, z + GROUND_M) for e, n, z in points]
    ends = Wing((570.0, 0.0, GROUND_M + 80.0), touch, circle_m)
    return build_wing(Path(np.array(amsl)), FLAT, wing(), HOME_DEG, Order(wing=ends, **order))  # type: ignore[arg-type]


CORNERS = [(1500.0, 0.0, 80.0), (2500.0, 1000.0, 90.0), (2500.0, 2500.0, 80.0)]


@pytest.mark.parametrize(
    ("end", "ends_with"), [("loiter", [17]), ("rtl", [16, 20]), ("none", [16]), ("land", [16, 21])]
)
def test_a_mission_takes_off_ahead_turns_at_its_acceptance_radii_and_ends_as_asked(
    end: str, ends_with: list[int]
) -> None:
    touch = (2500.0, 3300.0, GROUND_M) if end == "land" else None
    flown = built(CORNERS, touch, 100.0 if end == "loiter" else 0.0, end=end)
    commands = [item.command for item in flown.items]
    assert commands == [22, 178, 16, 16, *ends_with]
    assert flown.items[0].params[0] == 8.0
    assert [item.params[1] for item in flown.items[2:4]] == [math.ceil(RADIUS_M * math.tan(math.pi / 8))] * 2
    assert all(stored(item, Autopilot.ARDUPLANE).params == item.params for item in flown.items if item.command == 16)
    if end == "loiter":
        assert flown.items[-1].params[2] == 100.0


@pytest.mark.parametrize(
    ("tangent_m", "run_m", "accepted"),
    [(33.14, 900.0, 34), (33.14, 33.14, 33), (33.14, 33.9, 33), (33.14, 34.0, 34), (33.0, 33.0, 33), (0.4, 0.4, 1)],
)
def test_no_corner_is_accepted_from_before_its_leg(tangent_m: float, run_m: float, accepted: float) -> None:
    assert accepted_m(tangent_m, run_m) == accepted


def test_a_corner_with_more_acceptance_than_a_byte_holds_is_two_on_its_arc() -> None:
    craft, turn = wing(300.0), math.radians(120.0)
    points = np.array(
        [[0.0, 0.0, 300.0], [3000.0, 0.0, 400.0], [3000.0 + 3000 * math.cos(turn), 3000 * math.sin(turn), 350.0]]
    )
    two = parted(points, craft.turn_radius_m)
    assert len(two) == 4
    assert tangents_m(two, 300.0).max() < 255.0
    assert flown_m(two, 300.0).sum() == pytest.approx(flown_m(points, 300.0).sum(), abs=1e-6)
    rates = np.diff(two[:, 2]) / flown_m(two, 300.0)
    before = np.diff(points[:, 2]) / flown_m(points, 300.0)
    assert rates[[0, -1]] == pytest.approx(before)


@settings(max_examples=draws(30))
@given(st.lists(st.tuples(st.floats(-20.0, 20.0), st.floats(0.1, 500.0)), min_size=2, max_size=8))
def test_way_points_that_crowd_are_thinned_and_what_is_left_lies_on_the_same_way(
    steps: list[tuple[float, float]],
) -> None:
    heading, points = 0.0, [np.array([0.0, 0.0, 100.0])]
    for turn, length in steps:
        heading += math.radians(turn) if length > 60.0 else 0.0
        points.append(points[-1] + length * np.array([math.cos(heading), math.sin(heading), 0.01]))
    line = np.array(points)
    left = thinned(line, RADIUS_M)
    assert (left[0] == line[0]).all()
    assert (left[-1] == line[-1]).all()
    for p in line:
        away = min(_away(p[:2], a[:2], b[:2]) for a, b in pairwise(left))
        assert away <= 1.0


def _away(p: Floats, a: Floats, b: Floats) -> float:
    way = b - a
    return math.dist(p, a + np.clip((p - a) @ way / max(float(way @ way), 1e-12), 0.0, 1.0) * way)


def test_a_fixed_wing_does_not_wait_in_the_air_and_flies_no_terrain_frame() -> None:
    with pytest.raises(ValueError, match="cannot wait"):
        built(CORNERS, end="loiter", hold_s=10)
    with pytest.raises(ValueError, match="above home or sea level"):
        built(CORNERS, end="loiter", altitude_frame="terrain")


# -- mission files, plans, times ---------------------------------------------------------------------------------------


def text_of(**changes: str) -> str:
    text = (MISSIONS / "jacksboro-wing.yaml").read_text(encoding="utf-8")
    for key, value in changes.items():
        lines = [f"    {key}: {value}" if line.startswith(f"    {key}:") else line for line in text.splitlines()]
        text = "\n".join(lines) + "\n"
    return text


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"autopilot": "arducopter"}, "turn_radius_m", "a multicopter has no turn radius"),
        ({"autopilot": "px4"}, "turn_radius_m", "at a distance of its own"),
        ({"turn_radius_m": "20"}, "turn_radius_m", "give at least 41, or a lower speed"),
        ({"max_climb_deg": "60"}, "max_climb_deg", "climbs at 1 to 45°"),
        ({"end": "loiter\n    climb_out_speed_m_s: 20"}, "climb_out_m_s", "is missing"),
        ({"end": "loiter\n    climb_out_m_s: 20"}, "climb_out_m_s", "must be below the fastest speed 20"),
        ({"end": "loiter\n    climb_out_m_s: 2"}, "climb_out_m_s", "a climb of 5.7°"),
    ],
)
def test_a_mission_file_says_what_a_fixed_wing_cannot_be(changes: dict[str, str], key: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        load_mission(MISSIONS / "m.yaml", text=text_of(**changes))
    assert [(p.where.split(".")[-1], words in p.message) for p in caught.value.problems][:1] == [(key, True)]


def test_the_terrain_frame_is_refused_for_a_fixed_wing() -> None:
    text = text_of().replace("altitude_frame: relative", "altitude_frame: terrain")
    with pytest.raises(InputError, match="use altitude_frame: relative or amsl"):
        load_mission(MISSIONS / "m.yaml", text=text)


FLAT_TEXT = """
version: 1
frame: {origin: [47.0, 8.0], amsl_m: 0}
terrain: {flat_m: 100}
limits: {min_agl_m: 80, horizontal_clearance_m: 30, track_error_m: 10, altitude_error_m: 8}
no_fly: []
"""


def over_flat(*places: tuple[float, float], radius_m: float = 80.0, end: str = "loiter") -> Plan:
    """The plan of a fixed wing from the origin past all but the last of ``places``, over flat and empty ground."""
    where = [f"{{east_m: {e:.3f}, north_m: {n:.3f}}}" for e, n in places]
    speed = "[12, 15]" if radius_m < 60.0 else "[14, 18]"
    text = FLAT_TEXT + (
        f"vehicles: [{{name: uav1, sysid: 1, autopilot: arduplane, turn_radius_m: {radius_m}, end: {end}, "
        f"speed_m_s: {speed}, max_climb_deg: 8, start: {{east_m: 0, north_m: 0}}, via: [{', '.join(where[:-1])}], "
        f"goal: {where[-1]}}}]"
    )
    return plan(load_mission(MISSIONS / "m.yaml", text=text))


def assert_past_vias(found: Plan, vias: Sequence[tuple[float, float]]) -> None:
    """Assert that the mission is safe, and that its arcs and legs as judged lead through each via, in order."""
    (v,) = found.vehicles
    assert v.verdict.safe is True, v.verdict.describe()
    assert not v.verdict.not_judged
    places = np.array([leg.end for leg in v.verdict.legs])
    line = np.column_stack([*found.world.frame.to_plane(places[:, 0], places[:, 1]).T])
    passed = 0
    for via in vias:
        away = [_away(np.array(via), a, b) for a, b in pairwise(line[passed:])]
        near = next((k for k, m in enumerate(away) if m <= 0.3), None)
        assert near is not None, (via, min(away))
        passed += near


def around(seed: int, count: int, most_deg: float) -> list[tuple[float, float]]:
    """Places 800 to 2500 m apart, with turns of up to ``most_deg`` at each but the last."""
    rng = np.random.default_rng(seed)
    heading, here, places = float(rng.uniform(0.0, 2.0 * math.pi)), np.zeros(2), []
    for _ in range(count + 1):
        heading += math.radians(float(rng.uniform(-most_deg, most_deg)))
        here = here + rng.uniform(800.0, 2500.0) * np.array([math.cos(heading), math.sin(heading)])
        places.append((float(here[0]), float(here[1])))
    return places


@pytest.mark.slow
def test_two_vias_with_right_angles_are_passed_over_flat_ground() -> None:
    places = [(2000.0, 0.0), (2000.0, 1500.0), (4000.0, 1500.0)]
    assert_past_vias(over_flat(*places), places[:-1])


@pytest.mark.slow
@pytest.mark.parametrize("most_deg", [12.0, 35.0, 115.0])
@pytest.mark.parametrize("count", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (3, 4))])
def test_any_vias_far_apart_are_passed_over_flat_ground(count: int, most_deg: float) -> None:
    for seed in range(3):
        places = around(seed, count, most_deg)
        radius_m, end = (80.0, 40.0)[seed % 2], ("loiter", "loiter", "land")[seed % 3]
        assert_past_vias(over_flat(*places, radius_m=radius_m, end=end), places[:-1])


@pytest.mark.first_quick
@pytest.mark.parametrize("apart", [1.98, 2.2, 3.3, 5.0])
def test_a_survey_in_rows_of_a_few_radii_is_flown(apart: float) -> None:
    rows: list[tuple[float, float]] = []
    for k in range(4):
        row = [(900.0, k * apart * 80.0), (2100.0, k * apart * 80.0)]
        rows += row if k % 2 == 0 else row[::-1]
    assert_past_vias(over_flat(*rows, (-400.0, 3.5 * apart * 80.0)), rows)


@pytest.mark.slow
def test_a_via_nearer_than_the_climb_out_is_long_is_reached_by_a_detour() -> None:
    places = [(600.0, 0.0), (2000.0, 300.0), (3500.0, 0.0)]
    assert_past_vias(over_flat(*places), places[:-1])


@pytest.mark.parametrize(
    ("leg", "words"), [(0, "another takeoff_heading_deg"), (4, "put vias farther apart, or allow tighter turns")]
)
def test_a_refusal_says_whether_the_ends_or_the_vias_leave_no_room(
    leg: int, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wings, "unfitting_legs", lambda *_: np.array([leg]))
    with pytest.raises(NoMission, match=words):
        over_flat((2000.0, 0.0), (2000.0, 1500.0), (4000.0, 1500.0))


@pytest.fixture(scope="module")
def circling() -> Plan:
    return plan(MISSIONS / "jacksboro-wing.yaml")


@pytest.fixture(scope="module")
def landing() -> Plan:
    text = text_of(end="land", takeoff_heading_deg="60").replace("min_agl_m: 120", "min_agl_m: 60")
    return plan(load_mission(MISSIONS / "m.yaml", text=text))


def test_the_example_plans_to_a_safe_mission_near_its_bound(circling: Plan) -> None:
    (v,) = circling.vehicles
    assert v.verdict.safe is True
    assert v.gap_percent is not None
    assert v.gap_percent < 1.0
    assert v.mission.items[0].command == cmd.TAKEOFF
    assert v.mission.items[-1].command == cmd.LOITER_UNLIM
    assert "climb_out" in codes(v.notes)
    assert "flown_as_quadplane" not in codes(v.notes)


@pytest.mark.slow
def test_the_files_it_exports_pass_the_check(circling: Plan, tmp_path: FilePath) -> None:
    files = []
    for name, content in outputs_of(circling).items():
        if name in ("wing1.waypoints", "wing1.plan"):
            (tmp_path / name).write_text(content, encoding="utf-8")
            files.append(str(tmp_path / name))
    assert len(files) == 2
    for checked in check_files(circling.source, files):
        assert checked.verdict.safe is True, checked.verdict.describe()


@pytest.mark.nightly
def test_a_landing_glides_from_the_approach_and_a_wanted_heading_is_kept(landing: Plan) -> None:
    (v,) = landing.vehicles
    assert v.verdict.safe is True
    legs = v.verdict.legs
    assert legs[-1].kind == "land"
    assert legs[-1].agl_end_m == pytest.approx(0.0, abs=0.05)
    assert 4.0 < -legs[-1].climb_deg <= 8.0
    out = landing.world.frame.to_plane(*legs[0].end[:2]) - landing.world.frame.to_plane(*legs[0].start[:2])
    assert math.degrees(math.atan2(out[0], out[1])) == pytest.approx(60.0, abs=0.1)


@pytest.mark.slow
def test_the_example_can_land_where_the_ground_beside_the_pad_is_higher() -> None:
    text = (MISSIONS / "jacksboro-wing.yaml").read_text().replace("way_home: required", "way_home: reported")
    (v,) = plan(load_mission(MISSIONS / "m.yaml", text=re.sub(r"\bend: \w+", "end: land", text))).vehicles
    assert v.verdict.safe is True
    assert v.mission.items[-1].command == cmd.LAND


@pytest.mark.slow
def test_it_flies_at_one_speed_from_the_ground_to_the_goal_and_arrives_flying(landing: Plan) -> None:
    (v,) = landing.vehicles
    craft = v.request.vehicle
    route = route_of(v, landing.world)
    assert route.climb_out is not None
    assert route.glide is not None
    motion = Course(route, craft).fly(SPEED_M_S)
    space_m = np.linalg.norm(np.diff(motion.points, axis=0), axis=1)
    fast = SPEED_M_S * true_per_indicated(0.5 * (motion.points[1:, 2] + motion.points[:-1, 2]))
    assert space_m / np.diff(motion.times_s) == pytest.approx(fast, rel=2e-3)
    assert motion.points[0, 2] == pytest.approx(v.request.start[2], abs=0.01)
    assert motion.points[-1, 2] == pytest.approx(v.request.goal[2], abs=0.05)
    assert motion.arrive_s < motion.times_s[-1] - 10.0


@pytest.mark.nightly
def test_a_known_climb_out_has_one_time_in_plan_fleet_and_simulation(circling: Plan) -> None:
    text = text_of(end="loiter\n    climb_out_m_s: 9.5\n    climb_out_speed_m_s: 25")
    known = plan(load_mission(MISSIONS / "m.yaml", text=text))
    [v], [without] = known.vehicles, circling.vehicles
    craft, legs = v.request.vehicle, v.verdict.legs
    assert craft.climb_out == ClimbOut(9.5, 25.0)
    out = [leg for leg in legs if leg.kind == "takeoff"]
    assert len(out) == 3
    assert (
        sum(leg.time_s for leg in out) < sum(leg.time_s for leg in without.verdict.legs if leg.kind == "takeoff") - 3.0
    )
    course = Course(route_of(v, known.world), craft)
    assert course.takeoff is not None
    took_s = sum(leg.time_s for leg in out)
    assert course.takeoff.time_s(14.0) == pytest.approx(took_s, abs=1e-6)
    to_goal_s = course.time_to_goal_s(SPEED_M_S)
    assert to_goal_s == pytest.approx(sum(leg.time_s for leg in legs if leg.kind != "loiter"), rel=1e-3)
    on_board = replace(v.mission, items=tuple(stored(item, Autopilot.ARDUPLANE) for item in v.mission.items))
    flown = fly([make_track(on_board, craft, known.world, Kinematics.of(craft))], [0.0])
    assert flown.arrive_s[0] == pytest.approx(to_goal_s, rel=1e-3)


@pytest.mark.slow
def test_a_return_that_begins_too_low_is_refused_and_a_higher_end_cures_it() -> None:
    """Beside the ridge: a plane climbs on its way home."""

    def loaded(more: str) -> Plan:
        text = text_of(end=f"rtl{more}", goal="[36.6095, -84.3300]").replace("way_home: required", "")
        return plan(load_mission(MISSIONS / "m.yaml", text=text))

    with pytest.raises(NoMission, match="begins higher with a higher approach_agl_m"):
        loaded("")
    [v] = loaded("\n    approach_agl_m: 320").vehicles
    assert v.verdict.safe is True


@pytest.mark.slow
def test_the_simulated_aircraft_takes_as_long_as_planned(landing: Plan) -> None:
    (v,) = landing.vehicles
    craft = v.request.vehicle
    on_board = replace(v.mission, items=tuple(stored(item, Autopilot.ARDUPLANE) for item in v.mission.items))
    track = make_track(on_board, craft, landing.world, Kinematics.of(craft))
    assert track.not_flown == ()
    space_m = np.linalg.norm(np.diff(track.points, axis=0), axis=1)
    took_s = space_m / (SPEED_M_S * true_per_indicated(0.5 * (track.points[1:, 2] + track.points[:-1, 2])))
    planned = Course(route_of(v, landing.world), craft).fly(SPEED_M_S)
    assert took_s.sum() == pytest.approx(planned.times_s[-1] - planned.times_s[0], rel=1e-3)
    assert took_s[: track.goal].sum() == pytest.approx(planned.arrive_s, rel=1e-3)


@pytest.mark.slow
def test_where_no_climb_out_is_legal_on_the_wanted_heading_the_refusal_names_it() -> None:
    source = load_mission(MISSIONS / "m.yaml", text=text_of(takeoff_heading_deg="210"))
    with pytest.raises(NoMission, match="no climb-out on takeoff_heading_deg 210") as caught:
        plan(source)
    assert caught.value.reason == "not_found"  # searched in steps, with margins: not a proof
    assert str(caught.value).endswith("another heading or a steeper climb may")


@pytest.mark.slow
def test_a_climb_out_that_is_not_clear_in_declared_winds_names_them_in_a_sentence() -> None:
    text = text_of(takeoff_heading_deg="210") + "\nwind: {up_to_m_s: 3}\n"
    with pytest.raises(NoMission, match=r"the ceiling in winds and gusts of up to 3\.0 m/s at 8° \(max_climb_deg"):
        plan(load_mission(MISSIONS / "m.yaml", text=text))


@pytest.mark.slow
def test_a_climb_out_that_obstacles_close_says_so_and_what_to_do() -> None:
    forested = text_of().replace("obstacle_height_m: 0", "obstacle_height_m: 12")  # altitude_error_m is 8
    with pytest.raises(NoMission, match=r"obstacle_height_m puts them everywhere.*give `canopy`"):
        plan(load_mission(MISSIONS / "m.yaml", text=forested))


@pytest.mark.slow
def test_the_bound_of_a_wing_holds_from_the_end_of_its_climb_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not from behind the turns that this plan makes there, and not under the larger margins of a later attempt."""
    real, asked = wings.bound_between, list[tuple[Problem, FlightEnd, float]]()

    def bound_between(brief: Any, inner: Problem, points: Floats, start: FlightEnd, *more: Any) -> float:
        asked.append((inner, start, real(brief, inner, points, start, *more)))
        return asked[-1][2]

    monkeypatch.setattr(wings, "bound_between", bound_between)
    (v,) = plan(load_mission(MISSIONS / "m.yaml", text=text_of())).vehicles
    ((inner, start, bound),) = asked
    assert v.solution.lower_bound == bound <= v.verdict.length_m
    assert inner.checked == v.request.vehicle.limits
    assert inner.limits.altitude_error_m > inner.checked.altitude_error_m + 0.02
    direct = math.dist(start.leaves, inner.goal)
    assert direct < math.dist(start.leaves, start.chain[-1]) + math.dist(start.chain[-1], inner.goal)
    assert bound >= direct - 1.0
    assert "bound_with_climb_out" in codes(v.solution.notes)
    assert Note("planned_again", times=2) in v.solution.notes


@pytest.mark.slow
def test_that_margins_shut_the_way_between_a_wings_ends_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    """With margins the search is refused as proved: the answer is that of the limits of the check."""
    (v,) = plan(load_mission(MISSIONS / "m.yaml", text=text_of())).vehicles
    asked: list[Problem] = []

    def shut(_: object, problem: Problem, *__: object) -> None:
        asked.append(problem)
        raise NoMission("shut", reason="infeasible" if problem.checked is None else "not_found")

    monkeypatch.setattr(wings, "run_planner", shut)
    with pytest.raises(NoMission) as caught:
        wings.solution_between(v.brief, v.problem, v.request.vehicle, v.brief.world)
    assert caught.value.reason == "not_found"
    assert [p.checked for p in asked] == [None, v.problem.checked]


@pytest.mark.slow
def test_a_straight_climb_of_kilometres_offers_circles_which_climb_near_the_start() -> None:
    vehicle = {
        "name": "w1", "sysid": 1, "autopilot": "arduplane", "start": [47.0, 8.0], "goal": [47.0, 8.06],
        "turn_radius_m": 80, "speed_m_s": [14, 20], "end": "loiter",
    }  # fmt: skip
    whole = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 150, "max_climb_deg": 6}}
    (straight,) = plan(load_mission(whole | {"vehicles": [vehicle]})).vehicles
    (circles,) = plan(load_mission(whole | {"vehicles": [vehicle | {"climb_out": "circles"}]})).vehicles
    offer, made = one("circles_instead", straight.notes), one("climb_out_in_circles", circles.notes)
    assert one("climb_out", straight.notes).data["far_m"] > 1000.0  # type: ignore[operator]
    assert {key: made.data[key] for key in ("far_m", "circle_m")} == {
        key: offer.data[key] for key in ("far_m", "circle_m")
    }
    assert made.data["circled_m"] == offer.data["up_m"]
    assert circles.verdict.safe is True
    assert offer.data["length_m"] == pytest.approx(circles.verdict.length_m, rel=0.01)
    assert [n.code for n in circles.notes if n.code == "circles_instead"] == []
    assert "this was tried: the mission is safe" in str(offer)


@pytest.mark.slow
def test_a_climbing_circle_whose_mission_is_not_safe_is_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    real, tried = wings.built, []

    def built(*given: Any) -> Any:
        mission, verdict = real(*given)
        if given[1].climb_out != "circles":
            return mission, verdict
        tried.append(given[1].climb_out)
        return mission, replace(verdict, not_judged=(Note("limit_assumed", limit="min_agl_m", value=1.0),))

    monkeypatch.setattr(wings, "built", built)
    vehicle = {
        "name": "w1", "sysid": 1, "autopilot": "arduplane", "start": [47.0, 8.0], "goal": [47.0, 8.06],
        "turn_radius_m": 80, "speed_m_s": [14, 20], "end": "loiter",
    }  # fmt: skip
    whole = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 150, "max_climb_deg": 6}}
    (straight,) = plan(load_mission(whole | {"vehicles": [vehicle]})).vehicles
    assert one("climb_out", straight.notes).data["far_m"] > 1000.0  # type: ignore[operator]
    assert tried != []
    assert [n.code for n in straight.notes if n.code == "circles_instead"] == []
