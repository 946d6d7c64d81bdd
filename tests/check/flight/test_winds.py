"""Flights in declared winds: refusals, windows and energies, against flights in single winds of the set."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.check.battery import battery_home
from gcsplan.check.flight.ways_home import WaysHome
from gcsplan.check.flight.winds import (
    COUPLED,
    COUPLED_SMOOTH,
    UNEVEN_S,
    air_m_s,
    gust_length_m,
)
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.motion.timing import legs
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.wind.declared import DeclaredWind, FlightWind
from gcsplan.wind.window import TimeWindow
from gcsplan.world.geodesy.atmosphere import true_per_indicated
from tests.check.test_judge import ideal, mission_over
from tests.oracles import wind as oracle
from tests.support.wings import at, mission, take_off, through, wing
from tests.support.worlds import vehicle, world

THERE = [[0.0, 0, 366], [2500, -900, 366], [4000, 1500, 366]]


def blows(speed: tuple[float, float], from_deg: tuple[float, float], **more: object) -> FlightWind:
    sets = (np.array(pair, dtype=float).reshape(1, -1, 2) for pair in (speed, from_deg))
    return FlightWind(DeclaredWind(*sets, **more))  # type: ignore[arg-type]


def leaning(autopilot: Autopilot = Autopilot.ARDUCOPTER) -> Vehicle:
    lean = 40.0 if autopilot is Autopilot.ARDUCOPTER else None
    return replace(vehicle(autopilot), speed_max_m_s=12.0, lean_angle_deg=lean, leg_jerk_m_s3=4.0)


def flown(wind: FlightWind | None, craft: Vehicle | None = None, points: list[list[float]] = THERE) -> Verdict:
    mission, craft = mission_over(world(), points, craft or leaning())
    return judge(mission, craft, world(), wind=wind)


def window_of(verdict: Verdict) -> tuple[float, float]:
    window = verdict.arrive_window_s()
    assert window is not None
    return window


def ends_of(verdict: Verdict) -> TimeWindow:
    assert verdict.in_wind is not None
    assert verdict.in_wind.window is not None
    return verdict.in_wind.window


def spent_j(verdict: Verdict) -> Floats:
    return np.cumsum([leg.energy_j for leg in verdict.legs])


def test_still_air_has_no_window_and_every_figure_as_before() -> None:
    assert flown(None).arrive_window_s() is None
    assert flown(blows((0, 0), (0, 0))).legs == flown(None).legs


@pytest.mark.slow
def test_a_constant_wind_gives_one_time_and_only_what_the_lean_allows() -> None:
    still, blown = flown(None), flown(blows((6, 6), (90, 90)))
    earliest_s, latest_s = window_of(blown)
    assert latest_s == earliest_s > still.arrive_s + 60.0
    assert blown.arrive_s == still.arrive_s
    assert blown.drift is not None  # the window is one time, but another one than in still air
    assert blown.drift.moves
    unmoved = flown(blows((0.5, 0.5), (90, 90))).drift
    assert unmoved is not None
    assert not unmoved.moves
    assert window_of(flown(blows((6, 6), (270, 270))))[1] == pytest.approx(still.arrive_s, abs=1e-6)


@pytest.mark.nightly_but("arducopter")
@pytest.mark.slow
@pytest.mark.parametrize("autopilot", [Autopilot.ARDUCOPTER, Autopilot.PX4])
def test_a_set_holds_every_wind_of_it_in_window_and_energy(autopilot: Autopilot) -> None:
    craft = replace(leaning(autopilot), energy=Energy(base_w=200.0))
    whole = flown(blows((0, 7), (0, 360)), craft)
    bounds = ends_of(whole)
    for speed, from_deg in np.random.default_rng(3).uniform([0, 0], [7, 360], (12, 2)):
        one = flown(blows((speed, speed), (from_deg, from_deg)), craft)
        times = ends_of(one)
        assert (times.earliest_s >= bounds.earliest_s).all()
        assert (times.latest_s <= bounds.latest_s).all()
        assert (spent_j(one) <= spent_j(whole) + 1e-6).all()


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize("base_w", [0.0, 200.0])
def test_out_and_back_in_one_wind_counts_its_headwind_once(base_w: float) -> None:
    craft, back = replace(leaning(), energy=Energy(base_w=base_w)), [[0.0, 0, 366], [4000, 0, 366], [0.0, 0, 366]]
    whole, still = flown(blows((0, 7), (0, 360)), craft, back), flown(None, craft, back)
    ones = [spent_j(flown(blows((7, 7), (turn, turn)), craft, back)) for turn in range(0, 360, 45)]
    assert (spent_j(whole) >= np.max(ones, axis=0) - 1e-6).all()
    assert spent_j(whole)[-1] <= 1.002 * np.max(ones, axis=0)[-1]
    assert all(a.energy_j >= b.energy_j for a, b in zip(whole.legs, still.legs, strict=True))
    assert flown(blows((0, 7), (0, 360), varying=True), craft, back).energy_j > 1.2 * whole.energy_j


@pytest.mark.parametrize("craft", [leaning(), wing()], ids=["copter", "wing"])
def test_a_late_departure_widens_every_window_and_changes_no_figure(craft: Vehicle) -> None:
    way = through([(800.0, 0.0, 80.0), (3000.0, 900.0, 80.0)])
    mission = way if craft.keeps_airspeed else mission_over(world(), THERE, craft)[0]
    still, late = (judge(mission, craft, world(), wind=w) for w in (None, replace(blows((0, 0), (0, 0)), late_s=40.0)))
    earliest_s, latest_s = window_of(late)
    assert earliest_s == pytest.approx(still.arrive_s, abs=1e-6)
    assert latest_s == pytest.approx(still.arrive_s + 40.0, abs=1e-6)
    assert late.legs == still.legs
    on_time = blows((4, 4), (90, 90))
    before, after = (ends_of(judge(mission, craft, world(), wind=w)) for w in (on_time, replace(on_time, late_s=40.0)))
    assert after.latest_s - before.latest_s == pytest.approx(40.0, abs=1e-6)
    assert (after.earliest_s == before.earliest_s).all()


@pytest.mark.slow
def test_a_wind_too_strong_is_refused_with_one_that_was_tried() -> None:
    verdict = flown(blows((0, 20), (0, 360)))
    [finding] = verdict.findings
    assert (finding.kind, verdict.safe, verdict.arrive_window_s()) == ("wind", False, None)
    assert flown(blows((0, finding.limit), (0, 360), varying=True)).safe is True
    assert flown(blows((0, finding.limit + 0.2), (0, 360), varying=True)).safe is False


def test_a_vtol_keeps_an_airspeed_and_its_flight_in_winds_is_not_judged() -> None:
    vtol = replace(vehicle(Autopilot.ARDUPLANE), vtol=True)
    verdict = flown(blows((5, 5), (90, 90)), vtol)
    assert (verdict.safe, verdict.arrive_window_s()) == (None, None)
    assert "vtol_in_wind" in {note.code for note in verdict.not_judged}
    assert flown(blows((0, 0), (0, 0)), vtol).safe is True


def test_a_wing_arrives_when_the_pilots_handbook_says() -> None:
    """FAA-H-8083-25, Navigation, "Wind triangle": course 090°, wind of 40 kt from 045°, 120 kt through the air: 88 kt.

    The handbook draws it, so its figures are right to half a knot; 2.2 of its miles take 90 s.
    """
    knot_m_s, mile_m, amsl_m = 1852.0 / 3600.0, 1852.0, 380.0
    speed_m_s = 120.0 * knot_m_s / float(true_per_indicated(np.array([amsl_m]))[0])
    craft = replace(wing(), speed_min_m_s=speed_m_s, speed_max_m_s=speed_m_s)
    way = through([(800.0, 0.0, 80.0), (800.0 + 2.2 * mile_m, 0.0, 80.0)])
    verdict = judge(way, craft, world(), wind=blows((40 * knot_m_s, 40 * knot_m_s), (45, 45)))
    windows = verdict.leg_windows_s()
    assert windows is not None
    (_, begins_s), (earliest_s, latest_s) = windows[1:3]
    assert verdict.legs[2].horizontal_m == pytest.approx(2.2 * mile_m, rel=1e-3)
    assert earliest_s - begins_s == pytest.approx(90.0, rel=0.5 / 88.0)
    assert latest_s == pytest.approx(earliest_s, abs=1e-6)


def circled_s(wind_m_s: tuple[float, float], air_m_s: float, turns: int, radius_m: float, after: complex) -> float:
    """Seconds from 1,500 m west of a circle's middle, clockwise around it, and on to ``after`` when the nose is within
    10° of it (``verify_loiter_heading``); east is real. It is on the circle at once where it meets it."""
    wind, at, clock, turned, step = complex(*wind_m_s), complex(-radius_m), 0.0, 0.0, 0.02

    def speed(course: complex) -> float:
        along = wind * course.conjugate()
        return along.real + math.sqrt(air_m_s**2 - along.imag**2)

    clock = (1500.0 - radius_m) / speed(1 + 0j)
    while True:
        course = at / abs(at) * -1j
        if turned > math.tau * turns and abs(cmath.phase((after - at) / course)) < math.radians(10.0):
            break
        angle = speed(course) * step / radius_m
        at, clock, turned = at * cmath.rect(1.0, -angle), clock + step, turned + angle
    way = after - at
    return clock + abs(way) / speed(way / abs(way))


@pytest.mark.nightly_but("back")
@pytest.mark.slow
@pytest.mark.parametrize("after", [2500j, -2500j, -2500 + 200j], ids=["north", "south", "back"])
def test_a_wing_leaves_its_circles_on_its_next_heading_within_its_window(after: complex) -> None:
    last = 1.5 * after
    items = [at(cmd.WAYPOINT, 1500.0, 0.0, 80.0, 0.0, 1.0), at(cmd.LOITER_TURNS, 3000.0, 0.0, 80.0, 2.0, 0.0, 100.0),
             at(cmd.WAYPOINT, 3000.0 + after.real, after.imag, 80.0, 0.0, 1.0),
             at(cmd.LOITER_UNLIM, 3000.0 + last.real, last.imag, 80.0, 0.0, 0.0, 100.0)]  # fmt: skip
    flat, craft = mission(take_off(), *items), wing()
    for from_deg in (20.0, 140.0, 260.0):
        verdict = judge(flat, craft, world(), wind=blows((5, 5), (from_deg, from_deg)))
        seqs, ends = [leg.seq for leg in verdict.legs], ends_of(verdict)
        begin, end = (max(k for k, seq in enumerate(seqs) if seq == item) for item in (2, 4))
        blown = -5.0 * cmath.rect(1.0, math.radians(90.0 - from_deg))
        air_m_s = 20.0 * float(true_per_indicated(np.array([380.0]))[0])
        took_s = circled_s((blown.real, blown.imag), air_m_s, 2, 100.0, after)
        assert ends.earliest_s[end] - ends.earliest_s[begin] <= took_s <= ends.latest_s[end] - ends.latest_s[begin]
        circle_s = math.tau * 100.0 / air_m_s
        assert ends.latest_s[end] - ends.earliest_s[end] < 2.2 * circle_s


@pytest.mark.slow
def test_gusts_count_in_what_it_must_be_able_to_do_and_have_their_share() -> None:
    calm, gusty = window_of(flown(blows((5, 5), (90, 90)))), window_of(flown(blows((5, 5), (90, 90), gust_m_s=8.0)))
    assert gusty[1] > calm[1]
    assert flown(blows((8, 8), (90, 90), gust_m_s=14.0)).safe is False
    assert gust_length_m(30.0) < gust_length_m(200.0) < gust_length_m(400.0) == gust_length_m(900.0)


@pytest.mark.slow
def test_a_varying_wind_has_a_wider_window_than_one_that_is_constant() -> None:
    one, any_ = (window_of(flown(blows((0, 7), (0, 360), varying=v))) for v in (False, True))
    assert any_[0] <= one[0] <= one[1] < any_[1]


@pytest.mark.slow
def test_a_profile_over_height_counts_at_the_height_that_is_flown() -> None:
    levels = {"heights_m": np.array([300.0, 366.0, 500.0]), "heights": "amsl"}
    aloft = flown(blows(((0, 0), (6, 6), (30, 30)), ((90, 90),) * 3, **levels))  # type: ignore[arg-type]
    assert window_of(aloft)[1] == pytest.approx(window_of(flown(blows((6, 6), (90, 90))))[1], rel=1e-4)


def leaned_m_s(along_m_s: float, slope: float, most_m_s: float, lean_deg: float, amsl_m: float) -> float:
    """The speed over ground of a copter that leans its most on a leg with this slope, by the oracle's drag."""
    air = over_ground = most_m_s
    for _ in range(5):
        air = oracle.leaning_air_m_s(lean_deg, amsl_m, slope * over_ground / air)
        over_ground = min(along_m_s + air, most_m_s)
    return over_ground


@pytest.mark.parametrize("heights", ["amsl", "agl"])
def test_a_long_climb_through_a_profile_counts_the_wind_at_each_height(heights: str) -> None:
    craft, ground_m = replace(ideal(), speed_max_m_s=12.0, lean_angle_deg=40.0), 300.0
    nodes_m = np.array([360.0, 480.0]) - (0.0 if heights == "amsl" else ground_m)
    aloft = blows(((1, 1), (8, 8)), ((90, 90), (90, 90)), heights_m=nodes_m, heights=heights)
    verdict = flown(aloft, craft, [[0.0, 0, 360], [4000, 0, 480]])
    (_, begins_s), (earliest_s, latest_s) = (verdict.leg_windows_s() or ())[0], window_of(verdict)
    heights_m = np.linspace(367.5, 472.5, 8)
    head_m_s = np.interp(heights_m, [360.0, 480.0], [1.0, 8.0])
    seconds = [4000.0 / leaned_m_s(-w, 0.03, 12.0, 40.0, z) for w, z in zip(head_m_s, heights_m, strict=True)]
    flown_s = float(np.mean(seconds))
    assert earliest_s - begins_s <= flown_s * 1.001
    assert latest_s - begins_s >= flown_s * 0.999
    assert latest_s - earliest_s <= 0.04 * flown_s


@given(st.floats(10.0, 80.0), st.floats(-2.5, 2.5), st.floats(0.0, 2.5), st.floats(0.0, 1.0))
def test_no_airspeed_on_a_slope_between_two_is_beyond_its_bounds(
    lean_deg: float, low: float, wide: float, part: float
) -> None:
    craft = replace(vehicle(), lean_angle_deg=lean_deg)
    speed, amsl_m = np.array([12.0]), np.array([400.0])
    least, most = air_m_s(craft, speed, np.array([[low, low + wide]]), amsl_m)
    slope = low + part * wide
    found, _ = air_m_s(craft, speed, np.array([[slope, slope]]), amsl_m)
    assert least[0] <= found[0] * (1.0 + 1e-6)
    assert found[0] <= most[0] * (1.0 + 1e-6)


@pytest.mark.parametrize(("from_deg", "rise_m"), [(90, 80), (270, 80), (90, -80), (270, -80)])
def test_a_largest_lean_counts_by_the_slope_through_the_air(from_deg: int, rise_m: int) -> None:
    """Against the wind a copter climbs less steeply through the air than over ground, with it more steeply."""
    craft = replace(ideal(), speed_max_m_s=20.0, lean_angle_deg=30.0, climb_m_s=8.0, descent_m_s=8.0)
    verdict = flown(blows((6, 6), (from_deg, from_deg)), craft, [[0.0, 0, 460], [1000, 0, 460 + rise_m]])
    (_, begins_s), (earliest_s, latest_s) = (verdict.leg_windows_s() or ())[0], window_of(verdict)
    along_m_s = 6.0 if from_deg == 270 else -6.0
    flown_s = 1000.0 / leaned_m_s(along_m_s, rise_m / 1000.0, 20.0, 30.0, 460.0 + 0.5 * rise_m)
    assert (earliest_s - begins_s, latest_s - begins_s) == pytest.approx((flown_s, flown_s), rel=2e-3)


@pytest.mark.slow
def test_a_forecast_counts_in_the_hours_of_the_flight() -> None:
    hours = {"times_s": np.array([0.0, 3600.0, 7200.0])}
    speed, from_deg = np.array([[[6.0, 6.0]], [[6.0, 6.0]], [[19.0, 19.0]]]), np.full((3, 1, 2), 90.0)
    forecast = FlightWind(DeclaredWind(speed, from_deg, **hours), (0.0, 0.0))  # type: ignore[arg-type]
    found = window_of(flown(replace(forecast, declared=replace(forecast.declared, speed_m_s=np.minimum(speed, 8.0)))))
    assert found[1] == pytest.approx(window_of(flown(blows((6, 6), (90, 90))))[1], rel=1e-6)


@pytest.mark.slow
def test_the_battery_and_the_way_home_count_the_worst_wind() -> None:
    craft = replace(leaning(), energy=Energy(battery_j=2e6, hover_w=100.0))
    home = (36.6, -84.3, 300.0)

    def most_j(wind: FlightWind | None) -> float:
        found = battery_home(flown(wind, craft), craft, home, 330.0)
        assert found is not None
        return found.most_j

    any_wind = blows((0, 6), (0, 360), varying=True)
    still, east, west = (most_j(w) for w in (None, blows((6, 6), (90, 90)), blows((6, 6), (270, 270))))
    any_ = most_j(any_wind)
    assert any_ >= max(east, west) > still
    tight = replace(craft, energy=replace(craft.energy, battery_j=(flown(None, craft).energy_j + 1.0) / 0.8))
    assert flown(None, tight).safe is True
    assert [f.kind for f in flown(blows((6, 6), (90, 90)), tight).findings] == ["battery"]


def test_a_way_home_in_any_direction_costs_no_less_than_the_wind_triangle() -> None:
    craft = leaning()
    ways = WaysHome(craft, blows((6, 6), (90, 90)), (300.0, 300.0))
    for course in np.radians(np.linspace(3.0, 360.0, 23)):
        unit = np.array([math.sin(course), math.cos(course)])
        air_m, slow_m = ways.longer_m(10.0, (1000.0 * unit[0], 1000.0 * unit[1]), 0.0)
        g = 1000.0 * 10.0 / slow_m
        through = math.hypot(*(g * unit - np.array([-6.0, 0.0])))
        assert 1000.0 * max(through / g, 1.0) <= air_m + 1e-6
        assert air_m <= 1000.0 * max(through / g, 1.0) * 1.01


CRAFT: dict[str, dict[str, Any]] = {
    "rounded": {}, "curved": {"leg_jerk_m_s3": 1.0}, "sharp": {"corner_accel_m_s2": math.inf, "accel_m_s2": math.inf},
    "smoothed": {"autopilot": Autopilot.PX4, "leg_jerk_m_s3": 4.0, "accel_m_s2": 3.0},
}  # fmt: skip


@pytest.mark.nightly_but("sharp", "rounded")
@pytest.mark.first_quick
@pytest.mark.parametrize("kind", CRAFT)
@given(st.integers(1, 7), st.integers(0, 2**32 - 1))
def test_slower_legs_are_never_done_earlier_but_for_what_is_uneven(kind: str, count: int, seed: int) -> None:
    """What the bounds of times in a wind rest on (`gcsplan.wind.window`)."""
    drawn = np.random.default_rng(seed)
    sizes = 10 ** drawn.uniform(0.5, 3.3, (count, 1))
    steps = np.column_stack([drawn.normal(0, sizes, (count, 2)), drawn.normal(0, 20, count)])
    points = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    fast = drawn.uniform(2, 20, count)
    slow = fast * np.where(drawn.random(count) < 0.5, 1.0, drawn.uniform(0.3, 1.0, count))
    craft, run_m = replace(vehicle(), **CRAFT[kind]), np.hypot(*np.diff(points, axis=0)[:, :2].T)
    early, late = (
        np.cumsum(legs(points, craft, np.arange(count), ground_m_s=speeds).shares_s(1.0, count))
        for speeds in (fast, slow)
    )  # fmt: skip
    uneven_s = np.append(np.full(count - 1, 0.0 if kind in ("rounded", "sharp") else UNEVEN_S), 0.0)
    assert (early - late <= np.cumsum(uneven_s) + 1e-6).all()
    beyond = (late - np.cumsum(run_m / slow)) - (early - np.cumsum(run_m / fast))
    joints = np.cumsum((fast - slow) * (COUPLED_SMOOTH if kind == "smoothed" else COUPLED) / craft.accel_m_s2)
    assert (beyond <= np.append(joints[1:], joints[-1:]) + 2.0 * np.cumsum(uneven_s) + 1e-6).all()
