"""Fleets in declared winds, endings included, against flights of their missions' items in winds of the set.

Landings, circles and returns at the speeds of the autopilots' own returns count until the last vehicle is down.
"""

from __future__ import annotations

import random
from itertools import combinations, pairwise
from typing import Any

import pytest

from gcsplan import Plan, plan
from gcsplan.errors import NoMission
from gcsplan.vehicle import COPTER_RETURN_M_S, COPTER_RETURN_WAITS_S
from tests.app.fleet.test_every_wind import SEPARATION_M, WITHIN_M, fan, random_wind, some_shares
from tests.oracles.fleet_flights import Item, Ship, flown, least_m
from tests.oracles.wind import Winds, leaning_air_m_s

ORIGIN_DEG, RETURN_UP_M, WITHIN_S = (36.6, -84.3), 70.0, 1.5
"""`WITHIN_S`: two models of a flight with accelerations differ by this."""


def drawn_mission(rng: random.Random) -> tuple[dict[str, Any], Winds]:
    """A fleet whose ways cross, and whose returns cross the others' ways again, in winds of some set."""
    wind, winds = random_wind(rng)
    kinds = "".join(rng.choice("ccww") for _ in range(rng.choice([2, 2, 3, 3, 4])))
    mode, window_s = rng.choice(["sequence", "together", "none", "none"]), rng.choice([10.0, 30.0, 60.0])
    arrival: dict[str, Any] = {"mode": mode, "window_s": 0.0 if mode == "none" else window_s, "leave_out": True}
    if mode == "sequence":
        arrival["interval_s"] = 2.2 * window_s + rng.choice([60.0, 100.0])
    mission = fan(kinds, wind | {"varying": rng.random() < 0.25}, arrival, accel_m_s2=1.5)
    mission["planner"] = {"budget_s": 1}
    for v in mission["vehicles"]:
        wing = v["autopilot"] == "arduplane"
        v |= {"climb_m_s": 5.0, "descent_m_s": 5.0} if wing else {"climb_m_s": 2.5, "descent_m_s": 1.5}
        v["end"] = rng.choice(["loiter", "rtl", "rtl", "land"] if wing else ["land", "rtl", "rtl"])
        v |= {"rtl_rel_home_m": RETURN_UP_M} if v["end"] == "rtl" else {}
    return mission, winds


def ships(done: Plan) -> list[Ship]:
    assert done.fleet is not None
    found = []
    for v in done.vehicles:
        items = [Item(i.command, i.params, i.lat_deg, i.lon_deg, i.z) for i in v.mission.items]
        wing, home = v.request.vehicle.keeps_airspeed, v.mission.home
        rates = (5.0, 5.0) if wing else (2.5, 1.5)
        returns = (20.0, RETURN_UP_M, 0.0) if wing else (COPTER_RETURN_M_S, RETURN_UP_M, COPTER_RETURN_WAITS_S)
        air_m_s = None if wing else leaning_air_m_s(30.0, 60.0)
        home_deg = home.lat_e7 / 1e7, home.lon_e7 / 1e7
        departs_s = done.fleet.slot(v.name).depart_s
        found.append(Ship(v.name, items, home_deg, departs_s, 1.5, air_m_s, *returns, 90.0, *rates))
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, 3, 4])
def test_endings_keep_apart_in_each_wind_that_is_drawn(seed: int) -> None:
    rng = random.Random(seed)
    mission, winds = drawn_mission(rng)
    try:
        done = plan(mission)
    except NoMission as why:
        assert "in the declared winds" in str(why) or "needed" in str(why)  # noqa: PT017 - what refuses is not wrong
        return
    assert done.fleet is not None
    assert done.fleet.separation is not None or len(done.vehicles) < 2
    varying = mission["wind"]["varying"]
    for share in some_shares(6, seed):
        tracks = {}
        for ship in ships(done):
            each = [(rng.random(), rng.random()) for _ in range(100)] if varying else [share] * 100
            tracks[ship.name] = flown(ship, winds, each.__getitem__, ORIGIN_DEG)
        for a, b in combinations(tracks.values(), 2):
            point_m, nearest_m = least_m(a, b)
            apart = done.fleet.separation
            assert apart is not None
            planned_m = float(apart.distance_m[apart.names.index(a.name), apart.names.index(b.name)])
            assert nearest_m >= SEPARATION_M - WITHIN_M
            assert point_m >= planned_m - WITHIN_M or planned_m == float("inf")
        for one in done.fleet.intervals:
            apart_s = tracks[one.second].arrive_s - tracks[one.first].arrive_s
            assert one.least_s - WITHIN_S <= apart_s <= one.most_s + WITHIN_S
        if done.fleet.mode == "sequence":
            order = [tracks[name].arrive_s for name in done.fleet.order]
            assert all(a < b for a, b in pairwise(order))
