"""Energy over a mission, against integrals of the definition: E = base · s + R2 · metres of air + R1 · metres up."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.problem import least_horizontal_j_per_m
from gcsplan.app.plan.way_home import homes_of
from gcsplan.arrays import Floats
from gcsplan.check.motion.return_rules import return_s
from gcsplan.fleet.motion.timing import Course, Route
from gcsplan.mission_file import load_mission
from gcsplan.vehicle import Autopilot

BASE, R2, R1, HOVER = 300.0, 20.0, 60.0, 450.0
ENERGY = {"base_w": BASE, "horizontal_j_per_m": R2, "vertical_j_per_m": R1, "hover_w": HOVER, "battery_wh": 400}


def mission(energy: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [46.0, 14.0], "goal": [46.02, 14.03],
        "via": [[46.015, 14.0, 90]], "speed_m_s": [3, 10],
    }  # fmt: skip
    if energy is not None:
        vehicle["energy"] = energy
    top = {key: more.pop(key) for key in ("planner", "arrival") if key in more}
    return {
        "version": 1, "name": "energy", "terrain": {"flat_m": 300}, "limits": {"min_agl_m": 50, "max_agl_m": 200},
        "vehicles": [vehicle | more], **top,
    }  # fmt: skip


def planned(energy: dict[str, Any] | None = None, **more: Any) -> Plan:
    return plan(load_mission(mission(energy, **more)))


def integral_j(times: Floats, points: Floats, wind: tuple[float, float] = (0.0, 0.0)) -> float:
    """The definition, piece by piece: a piece that does not move is a hold."""
    joules = 0.0
    for dt, (e, n, up) in zip(np.diff(times).tolist(), np.diff(points, axis=0).tolist(), strict=True):
        air_m = math.hypot(e - wind[0] * dt, n - wind[1] * dt)
        held = max(abs(e), abs(n), abs(up)) < 1e-9
        joules += max(HOVER * dt, BASE * dt + R2 * air_m) if held else BASE * dt + R2 * air_m + R1 * abs(up)
    return joules


@pytest.mark.slow
def test_the_energy_of_a_plan_is_the_integral_over_its_time_table() -> None:
    done = planned(ENERGY)
    [v], motion = done.vehicles, done.fleet.motions[0]
    wanted = integral_j(motion.times_s, motion.points)
    assert v.verdict.energy_j == pytest.approx(wanted, rel=3e-3)
    assert done.fleet.slots[0].energy_j == pytest.approx(wanted, rel=3e-3)
    slow = planned(ENERGY, speed_m_s=[5, 5]).vehicles[0].verdict
    more_s = slow.time_s - v.verdict.time_s
    assert slow.energy_j - v.verdict.energy_j == pytest.approx(
        BASE * more_s, rel=1e-3
    )  # the same metres, twice the time


def test_a_hold_takes_the_whole_power_of_hovering_and_never_less_than_the_base() -> None:
    arrival = {"mode": "sequence", "interval_s": 1, "arrive_s": 1200, "hold": "gate"}
    for hover_w, power_w in ((HOVER, HOVER), (0.0, BASE)):
        done = planned(ENERGY | {"hover_w": hover_w}, arrival=arrival, speed_m_s=[9, 10])
        [slot], [v] = done.fleet.slots, done.vehicles
        assert slot.hold_s > 100
        held = [leg for leg in v.verdict.legs if leg.hold_s > 0]
        assert math.fsum(leg.hold_j for leg in held) == pytest.approx(power_w * slot.hold_s)
        assert slot.energy_j == pytest.approx(v.verdict.energy_j, rel=3e-3)


def test_the_papers_model_has_no_time() -> None:
    [v] = planned({"vertical_j_per_m": 120, "horizontal_j_per_m": 100}).vehicles
    legs = v.verdict.legs
    up_m = math.fsum(abs(leg.end[2] - leg.start[2]) for leg in legs)
    assert v.verdict.energy_j == pytest.approx(100 * math.fsum(leg.horizontal_m for leg in legs) + 120 * up_m, rel=1e-9)
    assert all(leg.lead_j == 0.0 for leg in legs)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_spent_on_the_way_is_never_more_than_the_battery_counts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    via = [[46.0 + 0.03 * a, 14.0 + 0.03 * b, float(60 + 100 * c)] for a, b, c in rng.random((6, 3)).round(4)]
    done = planned(ENERGY | {"battery_wh": 4000}, via=via, rtl_rel_home_m=120)
    [v], motion = done.vehicles, done.fleet.motions[0]
    ends = np.cumsum([leg.time_s for leg in v.verdict.legs])
    for leg, end_s in zip(v.verdict.legs, ends.tolist(), strict=True):
        begin_s = end_s - leg.time_s
        for part in (0.1, 0.5, 0.9):
            at_s = np.interp(part * leg.horizontal_m, *distance_by_time(motion.times_s, motion.points, begin_s, end_s))
            counted = leg.lead_j + part * (leg.energy_j - leg.hold_j - leg.lead_j)
            spent = BASE * (at_s - begin_s) + part * (leg.energy_j - leg.hold_j - BASE * leg.time_s)
            assert leg.column or spent <= counted + 0.02 * leg.energy_j


def distance_by_time(times: Floats, points: Floats, begin_s: float, end_s: float) -> tuple[Floats, Floats]:
    t = np.linspace(begin_s, end_s, 60)
    at = np.column_stack([np.interp(t, times, points[:, k]) for k in (0, 1)])
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))]), t


@pytest.mark.slow
def test_the_way_home_counts_its_time() -> None:
    least = {}
    for base_w in (0.0, BASE):
        [home] = homes_of(planned(ENERGY | {"base_w": base_w}, rtl_rel_home_m=120)).values()
        last = home.battery.legs[-2]
        least[base_w] = last.return_j
    far_m = 111_195 * math.hypot(0.02, 0.03 * math.cos(math.radians(46.0)))
    assert least[BASE] - least[0.0] >= BASE * far_m / 10.0  # at 10 m/s, and the climb and the landing are slower


@pytest.mark.parametrize("autopilot", [Autopilot.ARDUCOPTER, Autopilot.PX4])
def test_a_return_never_takes_longer_than_the_battery_counts(autopilot: Autopilot) -> None:
    rng = np.random.default_rng(5)
    own = load_mission(mission(ENERGY)).vehicles[0].vehicle
    for _ in range(40):
        up, down, accel = rng.uniform(1.0, 4.0, 3).tolist()
        craft = replace(own, autopilot=autopilot, climb_m_s=up, descent_m_s=down, accel_m_s2=accel)
        away_m, high_m = rng.uniform((0.0, 5.0), (4000.0, 300.0)).tolist()
        low_m = rng.uniform(0.0, high_m)
        points = np.array([[0.0, 0.0, high_m], [away_m, 0.0, low_m], [away_m + 1e-3, 0.0, low_m]])
        course, speed = Course(Route("r", points, 0.0, None, "rtl", high_m), craft), rng.uniform(3.0, 10.0)
        took_s = math.fsum(part.time_s(speed) for part in course.after)
        assert took_s <= return_s(craft, away_m, high_m - low_m, high_m, speed) + 1e-6


@pytest.mark.parametrize("autopilot", ["arducopter", "px4"])
def test_the_least_energy_that_is_proved_is_below_what_the_flight_takes(autopilot: str) -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        zones = [
            {"center": [46.0 + 0.02 * a, 14.0 + 0.03 * b], "radius_m": 250} for a, b in rng.uniform(0.3, 0.7, (3, 2))
        ]
        raw = mission(ENERGY, autopilot=autopilot, via=[], planner={"objective": "energy"}) | {"no_fly": zones}
        [v] = plan(load_mission(raw)).vehicles
        assert v.solution.lower_bound is not None
        assert 0.9 * v.verdict.path_energy_j < v.solution.lower_bound <= v.verdict.path_energy_j
        per_m = least_horizontal_j_per_m(v.request.vehicle, 46.0)
        assert R2 + 0.9 * BASE / 10.0 < per_m <= R2 + BASE / 10.0


@pytest.mark.slow
def test_a_speed_that_the_model_was_not_fitted_to_is_told() -> None:
    for fitted, told in (([9, 10], False), (8.5, False), (7, True), ([13, 15], True)):
        notes = planned(ENERGY | {"fitted_speed_m_s": fitted}).vehicles[0].verdict.notes
        speeds = [n.data["speed_m_s"] for n in notes if n.code == "energy_fitted_elsewhere"]
        assert speeds == [10.0] * told, fitted
