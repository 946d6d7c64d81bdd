"""The rehearsal: what is stored is flown, and what is flown is judged."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.app.pipeline import plan
from gcsplan.app.rehearsing import parts_of, terms_of
from gcsplan.check.judge import judge
from gcsplan.errors import CheckFailed, InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.trace import Trace, examine, meetings
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Rehearsal, Terms, percentile_95
from gcsplan.sim.part import RehearsalPart
from gcsplan.sim.rehearsal import on_board, rehearse
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.world import World
from gcsplan.world.zones import Circle, Zone
from tests.support import worlds
from tests.support.effort import draws

GROUND_M = 300.0
FLAT = worlds.world(GROUND_M, half_m=4000.0)
CLIMB_S = 70 / 2.5 + 2.5
CRUISE_M_S = 10.0
BRAKING_S = CRUISE_M_S / 1.5
"""What starting and stopping cost beside the cruise itself."""


def at(command: int, east_m: float, north_m: float, z: float, world: World = FLAT) -> MissionItem:
    lat, lon = (float(x) for x in world.frame.to_degrees(east_m, north_m))
    return MissionItem(command, m.RELATIVE, (0, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)


def a_part(
    number: int,
    *way: tuple[float, float],
    world: World = FLAT,
    height_m: float = 70.005,
    depart_s: float = 0.0,
    arrive_s: float | None = None,
    vehicle: Vehicle | None = None,
    land: bool = True,
) -> RehearsalPart:
    """A vehicle that takes off at the first place, passes the others at 10 m/s, and lands at the last."""
    vehicle = vehicle or replace(worlds.vehicle(), speed_max_m_s=CRUISE_M_S)
    vehicle = replace(vehicle, name=f"uav{number}", sysid=number)
    lat, lon = (float(x) for x in world.frame.to_degrees(*way[0]))
    home = Home.at(lat, lon, world.ground_amsl(lat, lon))
    items = [
        at(cmd.TAKEOFF, *way[0], height_m),
        MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1.0, CRUISE_M_S, -1.0, 0.0)),
        *(at(cmd.WAYPOINT, *place, height_m) for place in way[1:]),
    ]  # fmt: skip
    if land:
        items.append(at(cmd.LAND, *way[-1], 0))
    mission = Mission(vehicle.autopilot, home, tuple(items), vehicle.name, number)
    return RehearsalPart(vehicle, mission, judge(mission, vehicle, world), depart_s, arrive_s)


def reached_s(length_m: float) -> float:
    """By hand: the climb to 70 m, and a straight way."""
    return CLIMB_S + length_m / CRUISE_M_S + BRAKING_S


def kinds(result: Rehearsal) -> list[str]:
    return sorted(b.kind for b in result.breaches)


# -- what is flown ------------------------------------------------------------------------------------------------


def test_a_fleet_flies_what_its_boards_hold_and_arrives_when_arithmetic_says() -> None:
    parts = [
        a_part(n, (0, 200.0 * n), (1000, 200.0 * n), depart_s=9.0 * n, arrive_s=reached_s(1000) + 9.0 * n)
        for n in (1, 2, 3)
    ]
    names = ("uav1", "uav2", "uav3")
    result = rehearse(parts, FLAT, Terms(names, 30.0))
    assert result.safe
    assert result.error() is None
    assert result.order_flown == names
    assert [v.p95_s for v in result.vehicles] == pytest.approx([0.0] * 3, abs=0.05)
    assert result.closest is not None
    assert result.closest.distance_m == pytest.approx(200.0, abs=0.2)
    assert [v.min_agl_m for v in result.vehicles] == pytest.approx([70.0] * 3, abs=0.1)


def test_what_is_flown_is_what_the_vehicle_stored() -> None:
    part = a_part(1, (0, 0), (500, 0), height_m=70.019)  # ArduPilot keeps centimetres
    (stored,) = on_board([part])
    assert [i.z for i in stored.items][:1] == [m.float32(70.01)]
    assert stored.items != part.mission.items
    assert [i.command for i in stored.items] == [i.command for i in part.mission.items]


def test_px4_and_planes_rehearse_too() -> None:
    copter = worlds.vehicle()
    px4 = a_part(1, (0, 0), (800, 0), vehicle=replace(copter, autopilot=Autopilot.PX4))
    result = rehearse([replace(px4, arrive_s=reached_s(800))], FLAT, Terms())
    assert result.safe
    assert result.p95_s == pytest.approx(0.0, abs=0.1)


def test_a_mission_that_breaks_a_limit_is_not_even_sent() -> None:
    part = a_part(1, (0, 0), (500, 0), height_m=40.0)
    with pytest.raises(CheckFailed, match="did not pass the check"):
        rehearse([part], FLAT, Terms())


def test_what_is_not_understood_is_named_and_is_no_pass() -> None:
    part = a_part(1, (0, 0), (500, 0))
    unknown = MissionItem(cmd.DELAY, m.NO_POSITION, (-1.0, 12.0, 0.0, 0.0))
    mission = replace(part.mission, items=(*part.mission.items[:2], unknown, *part.mission.items[2:]))
    part = replace(part, mission=mission, verdict=judge(mission, part.vehicle, FLAT))
    result = rehearse([part], FLAT, Terms())
    assert result.safe is None
    error = result.error()
    assert error is not None
    assert (error.exit_code, error.reason) == (4, "not_judged")
    assert result.error(allow_unjudged=True) is None


def test_a_mission_that_goes_nowhere_and_two_of_one_name_are_refused() -> None:
    part = a_part(1, (0, 0), (500, 0))
    with pytest.raises(InputError, match="a name of its own"):
        rehearse([part, replace(part, mission=replace(part.mission, sysid=2))], FLAT, Terms())
    still = replace(part.mission, items=part.mission.items[1:2])
    nowhere = replace(part, mission=still, verdict=judge(still, part.vehicle, FLAT))
    with pytest.raises(InputError, match="nothing to rehearse"):
        rehearse([nowhere], FLAT, Terms())


# -- what is judged -----------------------------------------------------------------------------------------------


def test_another_order_of_arrival_is_a_violation() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (0, 300), (900, 300))]
    result = rehearse(parts, FLAT, Terms(("uav1", "uav2"), 30.0))
    assert kinds(result) == ["order"]
    assert "uav2, uav1" in result.breaches[0].message
    error = result.error()
    assert error is not None
    assert error.exit_code == 4


def test_two_that_meet_are_named_with_the_moment() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (500, -500), (500, 500))]
    result = rehearse(parts, FLAT, Terms((), 30.0))
    assert kinds(result) == ["separation"]
    assert result.breaches[0].vehicles == ("uav1", "uav2")
    assert result.closest is not None
    assert result.closest.distance_m < 1.0
    assert result.closest.time_s == pytest.approx(CLIMB_S + 50 + BRAKING_S / 2, abs=0.5)
    later = [parts[0], replace(parts[1], depart_s=10.0)]
    assert rehearse(later, FLAT, Terms((), 30.0)).safe


@pytest.mark.slow
def test_one_that_lands_beside_another_that_stands_there_is_a_violation_until_the_pad_is_clear() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (0, 300), (1000, 20), depart_s=200.0)]
    assert kinds(rehearse(parts, FLAT, Terms((), 30.0))) == ["separation"]
    assert rehearse(parts, FLAT, Terms((), 30.0, pad_clear_s=60.0)).safe
    assert rehearse(parts, FLAT, Terms((), 15.0)).safe


def test_a_battery_that_is_flown_too_low_is_a_violation() -> None:
    vehicle = replace(worlds.vehicle(), energy=Energy(120.0, 100.0, battery_j=130_000.0, reserve=0.2))
    part = a_part(1, (0, 0), (1000, 0), vehicle=vehicle)
    passing = replace(part.verdict, findings=())  # the check found the same
    result = rehearse([replace(part, verdict=passing)], FLAT, Terms())
    assert kinds(result) == ["battery"]
    assert result.vehicles[0].battery_used_percent == pytest.approx(100 * (120 * 140 + 100 * 1000) / 130_000, rel=0.001)


def test_corners_cut_into_a_zone_are_found_by_the_check_and_on_the_flown_track() -> None:
    inside = Zone("mast", Circle(498.6, 498.6, 1.2))
    world = worlds.world(GROUND_M, [inside], half_m=4000.0)
    vehicle = worlds.vehicle(track_error_m=0.0)
    part = a_part(1, (0, 500), (500, 500), (500, 0), world=world, vehicle=vehicle)
    assert {f.kind for f in part.verdict.findings} == {"zone"}  # the legs themselves keep clear, the corner does not
    passing = replace(part.verdict, findings=())
    result = rehearse([replace(part, verdict=passing)], world, Terms())
    assert kinds(result) == ["zone"]
    assert "mast" in result.breaches[0].message


@pytest.mark.slow
def test_every_run_has_its_own_weather_and_the_same_seed_the_same_figures() -> None:
    parts = [a_part(1, (0, 0), (1000, 0), arrive_s=reached_s(1000)), a_part(2, (0, 300), (1000, 300))]
    weather = Weather(5.0, None, 1.0, 1.0)
    one = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=5)
    again = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=5)
    assert one.as_dict() == again.as_dict()
    assert len(set(one.vehicles[0].arrive_s)) > 5  # a wind from behind changes nothing
    assert one.separation_kept_runs == 20
    errors = [abs(e) for e in one.vehicles[0].errors_s]
    assert one.vehicles[0].p95_s == sorted(errors)[18]
    other = rehearse(parts, FLAT, Terms((), 30.0), weather=weather, runs=20, seed=6)
    assert other.vehicles[0].arrive_s != one.vehicles[0].arrive_s


@pytest.mark.slow
def test_noise_beyond_the_margin_is_counted_in_runs() -> None:
    parts = [a_part(1, (0, 0), (1500, 0), height_m=66.005)]
    result = rehearse(parts, FLAT, Terms(), weather=Weather(noise_m=3.0), runs=12, seed=2)
    assert kinds(result) == ["min_agl"]
    breach = result.breaches[0]
    assert 0 < breach.runs <= 12
    assert result.vehicles[0].min_agl_m == pytest.approx(60.0 - breach.by, abs=0.1)


@pytest.mark.slow
def test_a_wind_that_is_too_strong_leaves_a_vehicle_that_never_arrives() -> None:
    result = rehearse([a_part(1, (0, 0), (0, 1000), arrive_s=90.0)], FLAT, Terms(), weather=Weather(40.0, 0.0))
    assert kinds(result) == ["arrival"]
    assert math.isinf(result.vehicles[0].errors_s[0])
    document = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert document["vehicles"][0]["arrive_s"] is None
    assert result.rows()[0]["arrives"] == "never"


def test_the_document_has_its_keys_and_a_row_for_each_vehicle() -> None:
    parts = [a_part(n, (0, 200.0 * n), (500, 200.0 * n), arrive_s=reached_s(500)) for n in (1, 2)]
    result = rehearse(parts, FLAT, Terms((), 30.0), runs=9)
    document = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert document["runs"] == 1  # in still air every run is the same
    assert "every run is the same" in document["notes"][0]
    assert document["safe"] is True
    assert {"order_flown", "min_separation_m", "closest", "p95_error_s"} <= document["fleet"].keys()
    assert {"planned_arrive_s", "arrive_s", "error_s", "min_agl_m", "battery_used_percent"} <= document["vehicles"][
        0
    ].keys()
    assert [row["vehicle"] for row in result.rows()] == ["uav1", "uav2"]


def test_ninety_five_percent() -> None:
    assert percentile_95([]) is None
    assert percentile_95([3.0]) == 3.0
    assert percentile_95([float(x) for x in range(100)]) == 94.0


# -- traces, against brute force ----------------------------------------------------------------------------------


def a_trace(name: str, rng: np.random.Generator, *, stays: bool = False, spread_m: float = 300.0) -> Trace:
    """A random walk through the air over `FLAT`, in steps of about a quarter of a second."""
    n = int(rng.integers(40, 160))
    times = 20.0 * rng.random() + np.cumsum(rng.uniform(0.1, 0.4, n))
    points = np.cumsum(rng.normal(0, 2.0, (n, 3)), axis=0) + rng.uniform(-spread_m, spread_m, 3)
    points[:, 2] = GROUND_M + 60 + 0.2 * points[:, 2]
    column = np.zeros(n - 1, np.bool_)
    column[:5] = column[-7:] = True
    return Trace(name, times, points, column, np.ones(n - 1, np.intp), float(times[-1]), 0.0, np.zeros(n - 1), stays)


@settings(max_examples=draws(60))
@given(seed=st.integers(0, 2**32), count=st.integers(2, 5), stays=st.booleans())
def test_the_least_distance_is_that_of_brute_force_and_never_more(seed: int, count: int, stays: bool) -> None:
    rng = np.random.default_rng(seed)
    traces = [a_trace(f"uav{k}", rng, stays=stays and k == 0, spread_m=60.0) for k in range(count)]
    needed = 25.0
    found = [f for f in meetings(traces, needed, 0.05) if f.kind == "air"]
    least: dict[tuple[str, str], float] = {}
    horizon = max(t.end_s for t in traces)
    fine = np.arange(0.0, horizon, 0.005)
    for i, a in enumerate(traces):
        for b in traces[i + 1 :]:
            until = [horizon if t.stays else t.end_s for t in (a, b)]
            both = fine[(fine >= max(a.begin_s, b.begin_s)) & (fine <= min(until))]
            if len(both):
                least[a.name, b.name] = float(np.linalg.norm(a.at(both) - b.at(both), axis=1).min())
    near = {pair: d for pair, d in least.items() if d < needed - 1.0}
    assert near.keys() <= {f.names for f in found}
    for f in found:
        if f.names in least:  # brute force looks every 5 ms
            assert least[f.names] - 0.3 <= f.distance_m <= least[f.names] + 1e-6
    if least and found:
        assert found[0].distance_m <= min(least.values()) + 1e-6


CROSSING = """
version: 1
frame: {origin: [36.6, -84.3], amsl_m: 0}
terrain: {flat_m: 0}
limits: {min_agl_m: 40}
vehicles:
  - {name: uav1, sysid: 1, autopilot: px4, end: loiter, speed_m_s: [3, 12], climb_m_s: 2.5, descent_m_s: 1.5,
     start: {east_m: 90, north_m: 490}, goal: {east_m: -165, north_m: -440}}
  - {name: uav2, sysid: 2, autopilot: px4, end: loiter, speed_m_s: [3, 13], climb_m_s: 2.5, descent_m_s: 1.5,
     start: {east_m: -475, north_m: 157}, goal: {east_m: 540, north_m: -100}}
arrival: {mode: together, separation_m: 20, hold: ground}
"""


def test_two_that_keep_their_speed_are_as_far_apart_in_the_air_as_planned() -> None:
    done = plan(load_mission("mission.yaml", text=CROSSING))
    assert done.fleet is not None
    a, b = done.fleet.motions
    t = np.arange(max(a.begin_s, b.begin_s), min(a.end_s, b.end_s), 0.01)
    planned_m = float(np.linalg.norm(a.at(t) - b.at(t), axis=1).min())
    flown = rehearse(parts_of(done), done.world, terms_of(done)).closest
    assert flown is not None
    assert planned_m - 0.05 <= flown.distance_m <= planned_m + 0.05


@settings(max_examples=draws(30))
@given(seed=st.integers(0, 2**32), slack=st.sampled_from([0.0, 0.1]))
def test_the_least_height_and_every_zone_of_a_trace_are_those_of_fine_sampling(seed: int, slack: float) -> None:
    rng = np.random.default_rng(seed)
    zone = Zone("disc", Circle(0.0, 0.0, 30.0))
    world = worlds.world(lambda e, n: GROUND_M + 20 * np.sin(e / 300) * np.cos(n / 200), [zone], half_m=2000.0)
    trace = replace(a_trace("uav1", rng, spread_m=60.0), off_m=slack)
    vehicle = worlds.vehicle(min_agl_m=55.0, horizontal_clearance_m=0.0)
    judged = examine(trace, vehicle, world)
    f = np.linspace(0.0, 1.0, 41)[:-1]
    fine = trace.points[:-1, None] + f[:, None] * np.diff(trace.points, axis=0)[:, None]
    agl = fine[..., 2] - world.airspace.surface.ground_at(fine[..., 0], fine[..., 1])
    low = float(agl[~trace.column].min())
    assert low - 0.06 - 2 * slack <= judged.min_agl_m <= low + 1e-6
    found = {x.kind for x in judged.findings}
    inside = float(np.hypot(fine[..., 0], fine[..., 1]).min()) - 30.0
    if inside < -0.01:
        assert "zone" in found
    elif inside > 0.6 + slack:
        assert "zone" not in found
    if low < 55.0 - 0.01:
        assert "min_agl" in found
    elif low > 55.0 + 3.0:
        assert "min_agl" not in found
