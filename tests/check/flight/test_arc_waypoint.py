"""Arc way points: their circle, compared with a turn that is flown step by step; what is judged, and what is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.check.flight.arc_waypoint import DEGREE_M, arc_chords, arc_speed_m_s
from gcsplan.check.judge import judge
from gcsplan.check.motion.stretch import Place
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.world import World
from tests.support.effort import seeds
from tests.support.noted import codes
from tests.support.worlds import vehicle, world

COPTER, PLANE = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE
HOME: Place = (36.6, -84.3, 300.0)
STEPS = 20_000


def turned(start: Place, end: Place, angle_deg: float) -> np.ndarray:
    """(N, 2) north, east of a vehicle that turns evenly by ``angle_deg``, step by step, and ends at ``end``.

    It leaves at half the angle to the other side of the chord; its steps are as long as it takes to arrive.
    """
    scale = [DEGREE_M * math.cos(math.radians(0.5 * (p[0] + HOME[0]))) for p in (start, end)]
    a = np.array([DEGREE_M * (start[0] - HOME[0]), scale[0] * (start[1] - HOME[1])])
    b = np.array([DEGREE_M * (end[0] - HOME[0]), scale[1] * (end[1] - HOME[1])])
    bearing = math.atan2(b[1] - a[1], b[0] - a[0])
    middle = (np.arange(STEPS) + 0.5) / STEPS - 0.5
    heading = bearing + math.radians(angle_deg) * middle
    way = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    way *= math.dist(a, b) / math.hypot(*way[-1])
    return np.vstack([a, a + way])


@pytest.mark.nightly_but("2--180.0", "2-200.0", "0-1.5")
@pytest.mark.first_quick
@pytest.mark.parametrize("angle_deg", [1.5, 30.0, 90.0, 180.0, 200.0, 300.0, 350.0, -45.0, -180.0, -270.0])
@pytest.mark.parametrize("seed", seeds(1, 3, 3))
def test_the_chords_follow_an_even_turn(angle_deg: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lat, lon, amsl = rng.uniform([[-0.01] * 2, [-0.01] * 2, [400.0] * 2], [[0.01] * 2, [0.01] * 2, [500.0] * 2])
    start, end = ((HOME[0] + float(lat[k]), HOME[1] + float(lon[k]), float(amsl[k])) for k in (0, 1))
    places, bulge_m, radius_m = arc_chords(start, end, angle_deg, HOME)
    assert (places[0], places[-1]) == (start, end)
    exact = turned(start, end, angle_deg)
    scale = np.array([DEGREE_M * math.cos(math.radians(0.5 * (p[0] + HOME[0]))) for p in places])
    chords = np.stack([[DEGREE_M * (p[0] - HOME[0]) for p in places], scale * [p[1] - HOME[1] for p in places]], axis=1)
    step = float(np.linalg.norm(np.diff(exact, axis=0), axis=1).max())
    for p in chords:
        assert np.linalg.norm(exact - p, axis=1).min() <= step + 1e-3
    a, way = chords[:-1], np.diff(chords, axis=0)
    for p in exact[:: STEPS // 400]:  # no place of the turn lies farther from the chords than is said
        part = np.clip(((p - a) * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
        assert np.linalg.norm(p - (a + part[:, None] * way), axis=1).min() <= bulge_m + 0.02
    long_m = step * STEPS
    assert long_m == pytest.approx(radius_m * math.radians(abs(angle_deg)), rel=1e-3)
    rises = np.diff([p[2] for p in places])
    assert rises == pytest.approx(np.full(len(rises), (end[2] - start[2]) / len(rises)))


def test_an_angle_below_a_degree_is_a_straight_leg() -> None:
    end = (36.61, -84.29, 320.0)
    assert arc_chords(HOME, end, 0.9, HOME) == ([HOME, end], 0.0, math.inf)


# ── judged ───────────────────────────────────────────────────────────────────────────────────────────────────────


def at(
    command: int, east: float, north: float = 0.0, up: float = 100.0, p1: float = 0.0, frame: int = 3
) -> MissionItem:
    lat, lon = (float(x) for x in world().frame.to_degrees(east, north))
    return MissionItem(command, frame, (p1, 0.0, 0.0, 0.0), m.degrees_e7(lat), m.degrees_e7(lon), up)


A, B, DOWN = at(cmd.WAYPOINT, 500), at(cmd.WAYPOINT, 2000), at(cmd.LAND, 2000, 0, 0)


def flown(*items: MissionItem, w: World | None = None, autopilot: Autopilot = COPTER) -> Verdict:
    up = at(cmd.VTOL_TAKEOFF if autopilot is PLANE else cmd.TAKEOFF, 0)
    home = Home.at(36.6, -84.3, 300.0)
    return judge(Mission(autopilot, home, (up, *items), "uav1"), vehicle(autopilot), w or world(half_m=4000.0))


def test_a_positive_angle_turns_right_and_a_negative_one_left() -> None:
    """Half a circle of 500 m, from (500, 0) to (1500, 0): clockwise it passes (1000, 500), else (1000, -500)."""
    for angle, north in ((180.0, 500.0), (-180.0, -500.0)):
        there = world(300.0, [Zone("there", Circle(1000.0, north, 30.0))], half_m=4000.0)
        other = world(300.0, [Zone("other", Circle(1000.0, -north, 400.0))], half_m=4000.0)
        arc = at(cmd.ARC_WAYPOINT, 1500, p1=angle)
        assert {(f.seq, f.zone) for f in flown(A, arc, B, DOWN, w=there).findings} == {(3, "there")}
        assert flown(A, arc, B, DOWN, w=other).safe is True


def test_its_length_speed_and_slope_are_those_of_the_arc() -> None:
    arc = at(cmd.ARC_WAYPOINT, 1500, up=150.0, p1=180.0)
    verdict = flown(A, arc, B, DOWN)
    assert verdict.safe is True, verdict.describe()
    legs = [leg for leg in verdict.legs if leg.seq == 3]
    long_m = math.fsum(leg.horizontal_m for leg in legs)
    assert long_m == pytest.approx(500.0 * math.pi, rel=5e-3)
    assert max(leg.climb_deg for leg in legs) == pytest.approx(math.degrees(math.atan(50.0 / long_m)), rel=1e-2)
    tight = flown(A, at(cmd.ARC_WAYPOINT, 540, p1=180.0), B, DOWN)
    seconds = math.fsum(leg.time_s for leg in tight.legs if leg.seq == 3)
    assert seconds >= 20.0 * math.pi / arc_speed_m_s(20.0)  # 10 m/s, not 15
    assert "arcs_by_version" in codes(verdict.notes)


@pytest.mark.parametrize(
    "items",
    [
        [A, at(cmd.ARC_WAYPOINT, 1500, p1=math.nan), B, DOWN], [A, at(cmd.ARC_WAYPOINT, 1500, p1=400.0), B, DOWN],
        [A, at(cmd.ARC_WAYPOINT, 1500, p1=90.0, frame=10), B, DOWN],
        [A, at(cmd.ARC_WAYPOINT, 1500, p1=90.0), replace(B, command=cmd.SPLINE_WAYPOINT), DOWN],
        [A, at(cmd.SPLINE_WAYPOINT, 1000), at(cmd.ARC_WAYPOINT, 1500, p1=90.0), B, DOWN],
        [at(cmd.LOITER_TURNS, 500, p1=2.0), at(cmd.ARC_WAYPOINT, 1500, p1=90.0), B, DOWN],
    ],
)  # fmt: skip
def test_an_arc_that_is_not_known_is_not_judged(items: list[MissionItem]) -> None:
    verdict = flown(*items)
    assert verdict.safe is not True
    assert verdict.not_judged or verdict.findings


def test_only_a_copter_flies_arcs() -> None:
    arc = at(cmd.ARC_WAYPOINT, 1500, p1=90.0)
    for autopilot in (PLANE, Autopilot.PX4):
        verdict = flown(replace(A, params=(0, 5.0, 0, 0)), arc, B, autopilot=autopilot)
        assert verdict.safe is not True
        assert any(note.item == 3 for note in verdict.not_judged) or verdict.findings
