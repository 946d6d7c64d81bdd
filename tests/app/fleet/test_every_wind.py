"""Time tables in declared winds, against fleets that are integrated step by step in winds of the set."""

from __future__ import annotations

import math
import random
from itertools import pairwise
from typing import Any

import pytest

from gcsplan import Plan, plan
from gcsplan.app.output.files import summary_of
from gcsplan.app.rehearse import rehearse, weather_of
from gcsplan.errors import NoMission
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from tests.oracles.fleet_wind import Flyer, Track, flown, least_m
from tests.oracles.wind import Share, Winds, leaning_air_m_s

SEPARATION_M = 40.0
WITHIN_S, WITHIN_M = 0.3, 1.0
"""By which two models of the same flight differ."""


def fan(kinds: str, wind: dict[str, Any], arrival: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A mission of copters (c) and wings (w) from one side of a field to the other, whose ways all cross."""
    vehicles = []
    for k, kind in enumerate(kinds):
        turn = math.pi * (k + 0.3) / (2.0 * len(kinds))
        out_m, in_m = (4000.0, 1800.0) if kind == "w" else (1500.0, 900.0)
        east, north = math.cos(turn), math.sin(turn)
        vehicle = {
            "name": f"{kind}{k + 1}", "sysid": k + 1, "start": {"east_m": -out_m * east, "north_m": -out_m * north},
            "goal": {"east_m": in_m * east, "north_m": in_m * north},
        }  # fmt: skip
        if kind == "w":
            vehicle |= {"autopilot": "arduplane", "turn_radius_m": 90, "speed_m_s": [16, 20], "end": "loiter"}
        else:
            vehicle |= {"autopilot": "arducopter", "speed_m_s": [4, 12], "lean_angle_deg": 30}
        vehicles.append(vehicle | more)
    return {
        "version": 1, "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
        "limits": {"min_agl_m": 60, "max_climb_deg": 10, "max_descent_deg": 10}, "vehicles": vehicles,
        "wind": wind, "arrival": {"separation_m": SEPARATION_M, **arrival},
    }  # fmt: skip


def flyers(done: Plan) -> list[Flyer]:
    assert done.fleet is not None
    found = []
    for v, motion in zip(done.vehicles, done.fleet.motions, strict=True):
        lean = v.request.vehicle.lean_angle_deg
        air_m_s = None if v.request.vehicle.keeps_airspeed else leaning_air_m_s(lean or 30.0, 60.0)
        places = [tuple(p) for p in motion.points.tolist()]
        found.append(Flyer(v.name, motion.times_s.tolist(), places, motion.arrive_s, air_m_s, opens_s(done, v.mission)))
    return found


def opens_s(done: Plan, mission: Mission) -> list[float]:
    """When the gates of a mission open, seconds after the common start, from its items alone."""
    start = done.fleet.start_utc if done.fleet is not None else None
    found = []
    for item in mission.items:
        if item.command == cmd.DELAY and start is not None:
            hour, minute, second = (int(x) for x in item.params[1:])
            at = start.replace(hour=hour, minute=minute, second=second)
            found.append((at - start).total_seconds() % 86400.0)
    return found


def drawn_tracks(done: Plan, winds: Winds, rng: random.Random, *, varying: bool) -> dict[str, Track]:
    """The fleet as it flies in a wind of the set, the same for all, or in any at each place and time."""
    share = rng.random(), rng.choice([0.0, rng.random(), 1.0])
    tracks = {}
    for one in flyers(done):
        each = [(rng.random(), rng.random()) for _ in one.times_s] if varying else [share] * len(one.times_s)
        tracks[one.name] = flown(one, winds, each.__getitem__)
    return tracks


def assert_held(done: Plan, winds: Winds, shares: list[Share], window_s: float, interval_s: float) -> list[float]:
    """Assert order, intervals and separation in winds of the set; all intervals that were flown."""
    assert done.fleet is not None
    assert done.fleet.in_every_wind is True
    spread = []
    for share in shares:
        tracks = {o.name: flown(o, winds, ([share] * len(o.times_s)).__getitem__) for o in flyers(done)}
        for (a, b), bounds in zip(pairwise(done.fleet.order), done.fleet.intervals, strict=True):
            apart_s = tracks[b].arrive_s - tracks[a].arrive_s
            spread.append(apart_s)
            assert bounds.least_s - WITHIN_S <= apart_s <= bounds.most_s + WITHIN_S
            assert abs(apart_s - interval_s) <= window_s + WITHIN_S
        assert least_m(list(tracks.values())) >= SEPARATION_M - WITHIN_M
    return spread


def some_shares(count: int, seed: int) -> list[Share]:
    rng = random.Random(seed)
    return [(a, b) for a in (0.0, 1.0) for b in (0.0, 0.5, 1.0)] + [(rng.random(), rng.random()) for _ in range(count)]


@pytest.mark.slow
def test_wings_keep_order_intervals_and_distance_in_each_wind_of_a_set() -> None:
    arrival = {"mode": "sequence", "interval_s": 120, "window_s": 20}
    done = plan(fan("www", {"speed_m_s": [4, 5], "from_deg": [250, 260]}, arrival))
    winds = Winds([[(4.0, 5.0)]], [[(250.0, 260.0)]])
    spread = assert_held(done, winds, some_shares(4, 1), 20.0, 120.0)
    widest = max(one.width_s for one in done.fleet.intervals)  # type: ignore[union-attr]
    assert widest <= 1.0 + 0.75 * (max(spread) - min(spread))  # half of the spread, were it tight
    assert summary_of(done)["fleet"]["in_every_wind"] is True


@pytest.mark.nightly
def test_a_rehearsal_judges_intervals_by_the_request_where_one_of_two_drifts() -> None:
    wind = {"speed_m_s": 6, "from_deg": 225}
    done = plan(fan("cw", wind, {"mode": "sequence", "interval_s": 60, "window_s": 1}))
    assert done.fleet is not None
    table_s = done.fleet.slots[1].arrive_s - done.fleet.slots[0].arrive_s
    assert abs(abs(table_s) - 60.0) > 5.0  # the wing drifts, the copter does not
    result = rehearse(done, weather=weather_of(done.source, None, None, 0.0, 0.0), runs=2)
    assert result.intervals_kept_runs == result.runs
    assert abs(result.interval_error_s or 0.0) < 1.5


@pytest.mark.slow
def test_a_climb_without_a_rate_takes_the_same_time_everywhere() -> None:
    mission = fan("cc", {}, {"mode": "sequence", "interval_s": 30})
    done = plan({key: value for key, value in mission.items() if key != "wind"})
    assert done.fleet is not None
    assert done.vehicles[1].speed_m_s < 9.0  # below its fastest, at which it climbs
    took_s = [slot.arrive_s - slot.depart_s for slot in done.fleet.slots]
    assert took_s == pytest.approx([v.verdict.arrive_s for v in done.vehicles], abs=1e-3)
    assert [v.errors_s[0] for v in rehearse(done).vehicles] == pytest.approx([0.0, 0.0], abs=1e-3)


@pytest.mark.slow
def test_a_rehearsal_judges_arrivals_together_and_late_windows() -> None:
    done = plan(fan("cc", {"up_to_m_s": 3}, {"mode": "together", "window_s": 5}))
    weather = weather_of(done.source, None, None, 0.0, 0.0)
    on_time, late = (rehearse(done, weather=weather, runs=2, late_s=late_s) for late_s in ({}, {"c1": 40.0}))
    assert (on_time.intervals_kept_runs, late.intervals_kept_runs) == (2, 0)
    assert late.interval_error_s == pytest.approx(40.0, abs=2.0)
    assert (on_time.safe, late.safe, late.inside_windows) == (True, True, (4, 4))
    shown = [[v.row(1)["window"] for v in one.vehicles] for one in (on_time, late)]
    assert [a == b for a, b in zip(*shown, strict=True)] == [False, True]


@pytest.mark.slow
def test_copters_give_up_speed_to_keep_their_times_in_each_wind() -> None:
    done = plan(fan("cc", {"up_to_m_s": 5}, {"mode": "sequence", "interval_s": 20}))
    assert_held(done, Winds([[(0.0, 5.0)]], [[(0.0, 360.0)]]), some_shares(2, 2), 0.0, 20.0)
    assert [n.code for n in done.notes if n.code.startswith("sp")] == ["speed_kept_in_wind"] * 2
    assert max(v.speed_m_s for v in done.vehicles) < 12.0


def random_wind(rng: random.Random) -> tuple[dict[str, Any], Winds]:
    """A set of winds of some form, and the same for the second implementation."""
    low, from_deg = rng.uniform(0.0, 4.0), rng.uniform(0.0, 360.0)
    high, turn_deg = low + rng.choice([0.0, 0.5, 2.0]), rng.choice([0.0, 10.0, 60.0])
    kind = rng.choice(["range", "up to", "levels"])
    if kind == "up to":
        return {"up_to_m_s": high}, Winds([[(0.0, high)]], [[(0.0, 360.0)]])
    speeds, turns = [(low, high)], [(from_deg, from_deg + turn_deg)]
    if kind == "range":
        return {"speed_m_s": list(speeds[0]), "from_deg": [x % 360.0 for x in turns[0]]}, Winds([speeds], [turns])
    speeds.append((low + 0.5, high + 1.0))
    turns.append((from_deg + 20.0, from_deg + 20.0 + turn_deg))
    levels = [
        {"agl_m": agl_m, "speed_m_s": list(speed), "from_deg": [x % 360.0 for x in turn]}
        for agl_m, speed, turn in zip((10, 120), speeds, turns, strict=True)
    ]  # fmt: skip
    return {"levels": levels}, Winds([speeds], [turns], (10.0, 120.0))


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(12))
def test_no_wind_that_is_drawn_breaks_a_time_table_that_holds_in_all(seed: int) -> None:
    rng = random.Random(seed)
    wind, winds = random_wind(rng)
    varying, together = rng.random() < 0.3, rng.random() < 0.2
    window_s = rng.choice([0.0, 5.0, 20.0, 40.0])
    arrival = {"mode": "together"} if together else {"mode": "sequence", "interval_s": rng.choice([30, 60, 120])}
    kinds = "".join(rng.choice("ccw") for _ in range(rng.randint(2, 4)))
    try:
        done = plan(fan(kinds, wind | {"varying": varying}, arrival | {"window_s": window_s}))
    except NoMission as why:
        assert "in the declared winds" in str(why) or "needed" in str(why)  # noqa: PT017 - what refuses is not wrong
        return
    assert done.fleet is not None
    assert done.fleet.in_every_wind is True
    bounds = {(one.first, one.second): one for one in done.fleet.intervals}
    for _ in range(12):
        tracks = drawn_tracks(done, winds, rng, varying=varying)
        for (a, b), found in bounds.items():
            apart_s = tracks[b].arrive_s - tracks[a].arrive_s
            assert found.least_s - WITHIN_S <= apart_s <= found.most_s + WITHIN_S
        assert least_m(list(tracks.values())) >= SEPARATION_M - WITHIN_M


@pytest.mark.slow
def test_goals_on_one_pad_are_refused_without_a_search_for_cures() -> None:
    mission = fan("cc", {"up_to_m_s": 3}, {"mode": "sequence", "interval_s": 30, "window_s": 10, "gates": "auto"})
    for vehicle in mission["vehicles"]:
        vehicle |= {"goal": {"east_m": 0.0, "north_m": 900.0}, "end": "land"}
    with pytest.raises(NoMission, match="put the goals at least") as refused:
        plan(mission)
    assert "what works" not in str(refused.value)
    assert "tried" not in str(refused.value)


@pytest.mark.slow
def test_where_nothing_helps_because_goals_are_too_near_a_refusal_says_so() -> None:
    mission = fan("cc", {"up_to_m_s": 5, "gust_m_s": 7}, {"mode": "sequence", "interval_s": 30})
    for vehicle in mission["vehicles"]:
        vehicle |= {"goal": {"east_m": 0.0, "north_m": 900.0}, "end": "land"}
    words = r"arrives \d+\.\d s before to .* after .* that was tried helps, for the goals of c1 and c2 .* put the goals"
    with pytest.raises(NoMission, match=words):
        plan(mission)
