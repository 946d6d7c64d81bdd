"""Corners as a fixed wing flies them, against a track that is made point by point as the definition has it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.arcs import REMAINS, SAG_M, SETTLES_S, bend
from gcsplan.check.flight.follow import follow
from gcsplan.check.judge import judge
from gcsplan.check.motion.circles import l1_off_m, tracking_m
from gcsplan.check.motion.stretch import Flight, Stretch
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.fly_by import flown_m, tangents_m
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.world import World
from tests.support.effort import draws
from tests.support.noted import coded, codes, within
from tests.support.wings import FLAT, GROUND_M, HOME_DEG, RADIUS_M, through, wing
from tests.support.worlds import world


def bent(flown: Mission, craft: Vehicle, where: World = FLAT) -> Flight:
    flight = follow(flown, craft, where.ground_amsl)
    bend(flight, flown, craft, where.frame)
    return flight


def sampled(points: Floats, step_m: float = 2.0) -> Iterator[tuple[float, float, int, float, float]]:
    """(east, north, leg, part of the flown leg, part along the straight leg) of the track with arcs, densely."""
    way = np.diff(points[:, :2], axis=0)
    unit = way / np.hypot(*way.T)[:, None]
    tangent = tangents_m(points, RADIUS_M)
    for k in range(len(way)):
        a, b, u = points[k, :2], points[k + 1, :2], unit[k]
        track: list[Floats] = []
        if k and tangent[k] > 0:
            arc = _arc(a, unit[k - 1], u, step_m)
            track += arc[len(arc) // 2 :]
        begin, end = a + tangent[k] * u, b - tangent[k + 1] * u
        count = max(2, math.ceil(float(np.hypot(*(end - begin))) / step_m))
        track += [begin + f * (end - begin) for f in np.linspace(0.0, 1.0, count)]
        if k + 1 < len(way) and tangent[k + 1] > 0:
            arc = _arc(b, u, unit[k + 1], step_m)
            track += arc[: len(arc) // 2 + 1]
        line = np.array(track)
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        length = float(np.hypot(*way[k]))
        for p, flown in zip(line, s / s[-1], strict=True):
            yield float(p[0]), float(p[1]), k, float(flown), float((p - a) @ u) / length


def _arc(corner: Floats, u: Floats, v: Floats, step_m: float) -> list[Floats]:
    """The circle of the turn radius that touches both legs, from its centre."""
    turn = math.atan2(u[0] * v[1] - u[1] * v[0], float(u @ v))
    begin = corner - RADIUS_M * math.tan(0.5 * abs(turn)) * u
    centre = begin + math.copysign(RADIUS_M, turn) * np.array([-u[1], u[0]])
    count = 2 * max(1, math.ceil(RADIUS_M * abs(turn) / step_m / 2)) + 1
    spoke = begin - centre
    turned = [
        np.array([[math.cos(t), -math.sin(t)], [math.sin(t), math.cos(t)]]) for t in np.linspace(0.0, turn, count)
    ]
    return [centre + r @ spoke for r in turned]


def covered(east: float, north: float, amsl: float, stretches: list[Stretch], where: World) -> bool:
    """Whether some stretch, widened by its reach and band, holds a point."""
    for s in stretches:
        a = np.array([*where.frame.to_plane(*s.start[:2]), s.start[2]])
        b = np.array([*where.frame.to_plane(*s.end[:2]), s.end[2]])
        way = b[:2] - a[:2]
        f = float(np.clip(((np.array([east, north]) - a[:2]) @ way) / max(float(way @ way), 1e-12), 0.0, 1.0))
        near = math.dist((east, north), a[:2] + f * way) <= s.reach_m + 0.05
        if near and abs(amsl - (a[2] + f * (b[2] - a[2]))) <= s.band_m + 0.05:
            return True
    return False


corners = st.lists(
    st.tuples(st.floats(-100.0, 100.0), st.floats(700.0, 1500.0), st.floats(-40.0, 40.0)), min_size=2, max_size=4
)


def path_of(turns: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    east, north, up, heading = 1500.0, 0.0, 80.0, 0.0
    points = [(east, north, up)]
    for turn, length, rise in turns:
        heading += math.radians(turn)
        east, north, up = east + length * math.cos(heading), north + length * math.sin(heading), max(up + rise, 70.0)
        points.append((east, north, up))
    return points


@settings(max_examples=draws(12))
@given(corners)
@pytest.mark.nightly
def test_the_judged_pieces_hold_the_flown_track_in_every_frame_of_altitude(
    turns: list[tuple[float, float, float]],
) -> None:
    points = path_of(turns)
    flight = bent(through(points), wing())
    assert not flight.not_judged
    cruise = [s for s in flight.stretches if s.kind == "cruise"]
    begins = FLAT.frame.to_plane(*cruise[0].start[:2])
    line = np.array([(*begins, 80.0), *points])
    for east, north, leg, flown, along in list(sampled(line))[::23]:
        z0, z1 = line[leg, 2] + GROUND_M, line[leg + 1, 2] + GROUND_M
        even = z0 + flown * (z1 - z0)
        assert covered(east, north, even, cruise, FLAT)
        by_projection = z0 + float(np.clip(along, 0.0, 1.0)) * (z1 - z0)
        assert covered(east, north, by_projection, cruise + flight.instead, FLAT)
        tangent = tangents_m(line, RADIUS_M)[leg + 1]
        if tangent > 0.0 and (1.0 - along) * math.dist(line[leg, :2], line[leg + 1, :2]) < tangent - 0.5:
            assert covered(east, north, z1, cruise + flight.instead, FLAT)  # the turn has begun: the next leg's


def test_chords_follow_one_another_and_add_up_to_the_length_of_legs_and_arcs() -> None:
    points = [(1500.0, 0.0, 80.0), (2500.0, 1000.0, 80.0), (2500.0, 2500.0, 80.0)]
    flown = through(points)
    flight = bent(flown, wing())
    for a, b in pairwise(flight.stretches):
        assert math.dist(a.end, b.start) < 1e-9
    verdict = judge(flown, wing(), FLAT)
    begins = FLAT.frame.to_plane(*next(s for s in flight.stretches if s.kind == "cruise").start[:2])
    line = np.array([(*begins, 80.0), *points])
    assert verdict.length_m == pytest.approx(float(flown_m(line, RADIUS_M).sum()), abs=0.3)
    assert verdict.length_m < float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum()) - 5.0


def test_a_verdict_on_arcs_can_be_safe_and_says_what_it_assumes() -> None:
    verdict = judge(through([(1500.0, 0.0, 80.0), (2500.0, 1000.0, 80.0), (2500.0, 2500.0, 80.0)]), wing(), FLAT)
    assert verdict.safe is True, verdict.describe()
    arcs, climb = coded(verdict.notes, "turns_as_arcs"), coded(verdict.notes, "climb_out_straight")
    assert (arcs.data["radius_m"], climb.data["heading_deg"]) == (100.0, pytest.approx(90.0, abs=0.1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_the_lowest_height_above_ground_is_what_sampling_the_flown_track_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0.0, 6.0, 2)

    def waves(east: Floats, north: Floats) -> Floats:
        return np.asarray(GROUND_M + 15.0 * np.sin(east / 400.0 + phase[0]) * np.cos(north / 300.0 + phase[1]))

    where = world(waves, half_m=6000.0)
    turns = [
        (float(rng.uniform(-90, 90)), float(rng.uniform(700, 1200)), float(rng.uniform(-30, 30))) for _ in range(3)
    ]
    points = [(e, n, z + 30.0) for e, n, z in path_of(turns)]
    flown = through(points)
    ground = where.ground_amsl(*HOME_DEG)
    verdict = judge(replace(flown, home=Home.at(*HOME_DEG, ground)), wing(), where)
    begins = next(leg for leg in verdict.legs if leg.kind == "cruise").start
    line = np.array([(*where.frame.to_plane(*begins[:2]), 80.0), *points])
    least = math.inf
    for east, north, leg, part, _ in sampled(line):
        z = ground + line[leg, 2] + part * (line[leg + 1, 2] - line[leg, 2])
        least = min(least, z - float(where.airspace.surface.ground_at(east, north)))
    found = min(leg.min_agl_m for leg in verdict.legs if leg.kind == "cruise")
    assert found == pytest.approx(least, abs=0.1)


ERROR_M = 15.0


def judged_with_disc(east: float, north: float, radius_m: float, turn: list[float] | None = None) -> Verdict:
    zone = Zone("disc", Circle(east, north, radius_m))
    points = [(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)]
    return judge(through(points, turn), wing(track_error_m=ERROR_M), world(GROUND_M, [zone]))


def test_a_zone_at_the_corner_is_passed_inside_and_one_inside_the_corner_is_hit() -> None:
    apex = (1500.0, 0.0)
    missed = RADIUS_M * (math.sqrt(2.0) - 1.0)  # from the corner to the middle of the arc
    assert judged_with_disc(*apex, missed - ERROR_M - SAG_M - 1.2).safe is True
    assert judged_with_disc(*apex, missed - ERROR_M + 1.0).safe is False
    inside = (apex[0] - missed / math.sqrt(2.0) - 10.0, apex[1] + missed / math.sqrt(2.0) + 10.0)
    assert {f.kind for f in judged_with_disc(*inside, 13.0).findings} == {"zone"}


@pytest.mark.slow
def test_a_turn_that_begins_early_or_late_widens_its_arc_and_the_leg_behind_it() -> None:
    beside = (1500.0 - 30.0, 300.0)  # 30 m inside of the leg behind the corner
    assert judged_with_disc(*beside, 14.0).safe is True
    assert judged_with_disc(*beside, 14.0, [60.0, 1.0]).safe is False  # 40 m late
    assert judged_with_disc(*beside, 14.0, [140.0, 1.0]).safe is False  # 40 m early
    later = (beside[0], 900.0)  # there it is back on the leg
    assert judged_with_disc(*later, 13.0, [60.0, 1.0]).safe is True
    assert judged_with_disc(*later, 15.0, [60.0, 1.0]).safe is False


@pytest.mark.parametrize("off_m", [2.0, 10.0, 40.0, 100.0])
@pytest.mark.parametrize("damping", [0.6, 0.75, 1.0])
def test_an_aircraft_beside_its_leg_settles_as_soon_and_as_near_as_is_judged(off_m: float, damping: float) -> None:
    for speed, period in ((12.0, 17.0), (20.0, 25.0), (30.0, 5.0)):
        tuning = replace(DEFAULTS, l1_period_s=period, l1_damping=damping)
        settled = SETTLES_S * tuning.l1_slower * speed + off_m
        later = [abs(y) for x, y in back_on_a_leg(off_m, speed, period, damping) if x >= settled]
        assert max(later) <= REMAINS * off_m


def back_on_a_leg(off_m: float, speed: float, period: float, damping: float) -> list[tuple[float, float]]:
    """Metres along a leg and beside it, ten times a second, from ``off_m`` beside it (AP_L1_Control.cpp)."""
    x, y, heading, bank, seen = 0.0, off_m, 0.0, 0.0, []
    for _ in range(700):
        to_leg = math.asin(min(max(-y / (damping * period * speed / math.pi), -math.sqrt(0.5)), math.sqrt(0.5)))
        push = 4.0 * math.pi * damping * speed / period * math.sin(to_leg - heading)
        bank += (min(max(math.atan(push / 9.80665), -math.pi / 4), math.pi / 4) - bank) * 0.1 / 0.5
        heading += 9.80665 * math.tan(bank) / speed * 0.1
        x, y = x + 0.1 * speed * math.cos(heading), y + 0.1 * speed * math.sin(heading)
        seen.append((x, y))
    return seen


def test_without_an_acceptance_radius_the_default_is_taken_and_said() -> None:
    flown = through([(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)])
    bare = replace(flown.items[1], params=(0.0, 0.0, 0.0, 0.0))
    verdict = judge(replace(flown, items=(flown.items[0], bare, *flown.items[2:])), wing(), FLAT)
    assert verdict.safe is True
    assert coded(verdict.notes, "arc_begun_by_default").data["radius_m"] == 90.0


@pytest.mark.parametrize(
    ("points", "code"),
    [
        ([(1500.0, 0.0, 80.0), (1500.0, 150.0, 80.0), (3000.0, 150.0, 80.0)], "arcs_too_long"),
        ([(1500.0, 0.0, 80.0), (700.0, 20.0, 80.0)], "corner_turns_back"),
    ],
)
def test_corners_whose_arcs_do_not_fit_are_named_as_not_judged(
    points: list[tuple[float, float, float]], code: str
) -> None:
    verdict = judge(through(points, [100.0] * len(points)), wing(), FLAT)
    assert verdict.safe is None
    assert code in codes(verdict.not_judged)


def test_a_turn_that_needs_too_much_bank_is_not_judged() -> None:
    slow = judge(through([(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)]), wing(), FLAT)
    fast = judge(
        through([(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)]), replace(wing(), speed_max_m_s=40.0), FLAT
    )  # fmt: skip
    assert slow.safe is True
    assert coded(fast.not_judged, "arcs_too_banked").data["bank_deg"] == pytest.approx(58.0, abs=0.5)


def test_px4_begins_its_turns_where_it_likes_so_its_arcs_are_not_judged() -> None:
    craft = replace(wing(), autopilot=Autopilot.PX4)
    flown = replace(through([(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)]), autopilot=Autopilot.PX4)
    assert "arcs_unread" in codes(judge(flown, craft, FLAT).not_judged)


def test_a_slower_l1_controller_is_judged_wider() -> None:
    for radius_m, turn_deg, speed_m_s in ((100.0, 60.0, 21.0), (180.0, 90.0, 28.0), (100.0, 15.0, 14.6)):
        turn = math.radians(turn_deg)
        usual, slow = (tracking_m(radius_m, turn, speed_m_s, Tuning(l1_period_s=s)) for s in (17.0, 30.0))
        assert usual == tracking_m(radius_m, turn, speed_m_s)
        assert slow >= 30.0 / 17.0 * usual * 0.9


def test_a_turn_that_the_l1_law_cuts_short_is_judged_wider_than_its_arc() -> None:
    assert l1_off_m(100.0, math.radians(60.0), 20.0) < 6.0
    assert l1_off_m(300.0, math.radians(90.0), 20.0) > 50.0  # it turns at 45° to the leg at once
    points = [(1500.0, 0.0, 80.0), (1500.0, 2500.0, 80.0)]
    wide = bent(through(points, [255.0, 1.0]), wing(250.0))
    assert max(s.reach_m for s in wide.stretches if s.kind == "cruise") > 20.0
    assert [n.data["wider"] for n in within(coded(wide.notes, "turns_as_arcs")) if n.code == "turns_off_arcs"] == [True]


def test_a_pass_by_distance_is_not_judged() -> None:
    flown = through([(1500.0, 0.0, 80.0), (1500.0, 2000.0, 80.0)])
    beyond = replace(flown.items[1], params=(0.0, 100.0, 50.0, 0.0))
    verdict = judge(replace(flown, items=(flown.items[0], beyond, *flown.items[2:])), wing(), FLAT)
    assert verdict.safe is None
    assert coded(verdict.not_judged, "turns_late").data["past_m"] == 50.0
