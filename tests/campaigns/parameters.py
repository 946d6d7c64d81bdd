"""Random parameter sets on board, judged by the judge of uploads, and flown in the built-in simulator.

    python -m tests.campaigns.parameters --sets 500 --seed 1
    python -m tests.campaigns.parameters --seconds 600

A flight that is accepted must take the judged time (within 1 s or 0.5 %, and the simulator's own error), run on no
farther before a return than was judged, return at the judged height and by the judged rule, and have the bank for its
turns. A set that keeps all of these limits with room to spare must not be refused. The oracle reads parameters itself:
it shares neither the table of names nor the judge's motion with the code that it tests.
"""

from __future__ import annotations

import argparse
import math
import random
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan import way_home as returns
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import parts_of
from gcsplan.app.upload.job import UploadJob
from gcsplan.app.upload.on_board import judge_on_board
from gcsplan.app.upload.run import jobs_of
from gcsplan.check.motion.stopping import braking_distance_m
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.flight.track import make_track
from gcsplan.sim.outcome import RehearsalPart
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.parameters import Parameters
from gcsplan.vehicle import Autopilot, Vehicle
from tests.oracles.px4_smoothing import fly as smoothing

LAT, LON = 46.5, 8.0
KINDS = ("copter", "copter-rtl", "copter-required", "fast", "px4", "px4-rtl", "wing", "wing-required")
SPARE_S, SPARE_PART = 0.5, 0.004
"""Largest difference of the simulator's own motion from the judged one beyond the tolerance."""

G_M_S2 = 9.80665
TOP_M = 40.0
"""From where on the missions land, at least."""

Values = Mapping[str, float]


def mission_text(kind: str) -> str:
    own: dict[str, dict[str, Any]] = {
        "copter": {}, "copter-rtl": {"end": "rtl"}, "copter-required": {},
        "fast": {"speed_m_s": [14, 14], "lean_angle_deg": 50}, "px4": {"autopilot": "px4"},
        "px4-rtl": {"autopilot": "px4", "end": "rtl"},
        "wing": {"autopilot": "arduplane", "turn_radius_m": 120, "speed_m_s": [20, 20], "end": "loiter"},
        "wing-required": {"autopilot": "arduplane", "turn_radius_m": 120, "speed_m_s": [20, 20], "end": "loiter"},
    }  # fmt: skip
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [LAT, LON], "goal": [LAT + 0.02, LON + 0.004],
        "via": [[LAT + 0.008, LON + 0.004]], "speed_m_s": [9, 9], "takeoff_agl_m": 80, "rtl_rel_home_m": 120,
    } | own[kind]  # fmt: skip
    required = {"way_home": "required"} if kind.endswith("required") else {}
    return yaml.safe_dump({
        "version": 1, "terrain": {"flat_m": 100}, "vehicles": [vehicle],
        "limits": {"min_agl_m": 40, "track_error_m": 15, "altitude_error_m": 8},
    } | required)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A plan with its upload job; ``base``: the parameters of a vehicle that is set up for it."""

    plan: Plan
    job: UploadJob
    base: dict[str, float]
    time_s: float


@cache
def case_of(kind: str) -> Case:
    done = plan(load_mission("m.yaml", text=mission_text(kind)))
    homes = returns.judged(done, home=False)
    [job] = jobs_of(done, {"uav1": "udpout:127.0.0.1:9"}, homes, bool(homes))
    vehicle = done.vehicles[0].request.vehicle
    base = {
        Autopilot.ARDUCOPTER: {"RTL_ALT": 12_000.0, "ANGLE_MAX": 5000.0 if kind == "fast" else 3000.0},
        Autopilot.PX4: {"RTL_RETURN_ALT": 120.0, "NAV_ACC_RAD": 10.0},
        Autopilot.ARDUPLANE: {"AIRSPEED_CRUISE": 20.0, "RTL_ALTITUDE": 120.0},
    }[vehicle.autopilot]
    return Case(done, job, base, flown_s(done, vehicle, {}))


def board_of(case: Case, changed: Values) -> OnBoard:
    """The vehicle's answers, as from the simulated vehicle of today's version."""
    autopilot = case.job.mission.autopilot
    table = Parameters(autopilot, 1, firmware_of(autopilot), case.base | changed)
    return OnBoard({name: table.value(name) for name in table.names()})


# -- the oracle: raw parameters by their oldest names ------------------------------------------------------------------


def kinematics(vehicle: Vehicle, raw: Values) -> tuple[Kinematics, Vehicle]:
    """The simulator's motion with raw parameters; the plan's values replace missing ones."""
    own = Kinematics.of(vehicle)
    if vehicle.autopilot is Autopilot.ARDUPLANE:
        cruise = raw.get("AIRSPEED_CRUISE", vehicle.speed_max_m_s)
        other = replace(vehicle, speed_max_m_s=cruise)
        return Kinematics.of(other), other
    if vehicle.autopilot is Autopilot.PX4:
        moved = replace(
            own, climb_m_s=raw.get("MPC_Z_V_AUTO_UP", own.climb_m_s),
            descent_m_s=raw.get("MPC_Z_V_AUTO_DN", own.descent_m_s), land_m_s=raw.get("MPC_LAND_SPEED", own.land_m_s),
            accel_m_s2=0.65 * raw.get("MPC_ACC_HOR", 3.0),
            corner_accel_m_s2=raw.get("MPC_XY_TRAJ_P", 0.5) * raw.get("MPC_ACC_HOR", 3.0),
        )  # fmt: skip
        rates = {"climb_m_s": moved.climb_m_s, "descent_m_s": moved.descent_m_s}  # a mission's stretches have them, too
        return moved, replace(vehicle, return_m_s=raw.get("MPC_XY_CRUISE", 5.0), **rates)
    accel = raw.get("WPNAV_ACCEL", 250.0) / 100.0
    moved = replace(
        own, climb_m_s=raw.get("WPNAV_SPEED_UP", 250.0) / 100.0, descent_m_s=raw.get("WPNAV_SPEED_DN", 150.0) / 100.0,
        land_m_s=raw.get("LAND_SPEED", 50.0) / 100.0, leg_accel_m_s2=accel,
        vertical_accel_m_s2=raw.get("WPNAV_ACCEL_Z", 100.0) / 100.0, leg_jerk_m_s3=raw.get("WPNAV_JERK", 1.0),
        lean_deg=raw.get("ANGLE_MAX", 100.0 * own.lean_deg) / 100.0,
    )  # fmt: skip
    back = raw.get("RTL_SPEED", 0.0) / 100.0 or raw.get("WPNAV_SPEED", 1000.0) / 100.0
    waits_s = raw.get("RTL_LOIT_TIME", 5000.0) / 1000.0
    rates = {"climb_m_s": moved.climb_m_s, "descent_m_s": moved.descent_m_s}
    return moved, replace(vehicle, return_m_s=back, return_wait_s=waits_s, **rates)


def flown_s(done: Plan, vehicle: Vehicle, raw: Values) -> float:
    """Seconds of the flight in the built-in simulator, on the motion of raw parameters.

    A PX4's legs, which the simulator flies with one even acceleration, are flown step by step instead, by the rules of
    PX4: the simulator's flight with the plan's accelerations, and the difference that the raw ones make to the legs.
    """
    [part] = parts_of(done)
    moved, other = kinematics(vehicle, raw)
    if vehicle.autopilot is Autopilot.PX4:
        own = Kinematics.of(vehicle)
        moved = replace(moved, accel_m_s2=own.accel_m_s2, corner_accel_m_s2=own.corner_accel_m_s2)
        steps_s = px4_legs_s(part.mission, vehicle, raw) - px4_legs_s(
            part.mission, vehicle, {"MPC_XY_CRUISE": raw.get("MPC_XY_CRUISE", 5.0)}
        )
        return simulated_s(done, part, moved, other) + steps_s
    high_m_s, down_m_s = raw.get("LAND_SPEED_HIGH", 0.0) / 100.0, moved.descent_m_s
    slower_s = (TOP_M - 10.0) * (1.0 / high_m_s - 1.0 / down_m_s) if high_m_s > 0.0 else 0.0
    return simulated_s(done, part, moved, other) + slower_s


def px4_legs_s(mission: Mission, vehicle: Vehicle, raw: Values) -> float:
    """Seconds of a PX4's legs, and of its return if the mission ends with one, flown step by step."""
    home = (mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7)
    east_m = 111_320.0 * math.cos(math.radians(home[0]))
    places = [(i.lat_deg, i.lon_deg) for i in mission.items if i.command == cmd.WAYPOINT]
    points = np.array([((lon - home[1]) * east_m, (lat - home[0]) * 111_320.0) for lat, lon in [home, *places]])
    points = points[np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1.0)]
    motion = {
        "accel": raw.get("MPC_ACC_HOR", 3.0), "gain": raw.get("MPC_XY_TRAJ_P", 0.5),
        "jerk": raw.get("MPC_JERK_AUTO", 4.0),
    }  # fmt: skip
    took_s = smoothing(points, mission.commanded_m_s, vehicle.acceptance_m, **motion)[0]
    if any(i.command == cmd.RTL for i in mission.items):
        back = np.array([points[-1], points[0]])
        took_s += smoothing(back, raw.get("MPC_XY_CRUISE", 5.0), vehicle.acceptance_m, **motion)[0]
    return took_s


def simulated_s(done: Plan, part: RehearsalPart, moved: Kinematics, other: Vehicle) -> float:
    """Seconds of a flight in the built-in simulator."""
    trace = trace_of(done, part, moved, other)
    return trace.arrive_s if trace.stays else trace.end_s


def trace_of(done: Plan, part: RehearsalPart, moved: Kinematics, other: Vehicle) -> Trace:
    """A flight in the built-in simulator."""
    track = make_track(part.mission, other, done.world, moved, rtl_rel_home_m=part.rtl_rel_home_m)
    return fly([track], [0.0]).trace(0, leaves=False)


@cache
def flown_extent_m(kind: str) -> tuple[float, float]:
    """How far from home, and how high above it, the simulator's flight with the plan's parameters comes."""
    done = case_of(kind).plan
    [part] = parts_of(done)
    vehicle = done.vehicles[0].request.vehicle
    trace = trace_of(done, part, Kinematics.of(vehicle), vehicle)
    home = part.mission.home
    east, north = done.world.frame.to_plane(home.lat_e7 / 1e7, home.lon_e7 / 1e7)
    away = np.hypot(trace.points[:, 0] - float(east), trace.points[:, 1] - float(north))
    return float(away.max()), float(trace.points[:, 2].max()) - home.amsl_m


def breaches(kind: str, raw: Values, spare: float) -> list[str]:
    """The fences that a flight would leave; with a ``spare`` below 1 also the fences that it nearly leaves."""
    away_m, high_m = flown_extent_m(kind)
    room = 0.0 if spare == 1.0 else 40.0
    if kind.startswith("px4"):
        acts = raw.get("GF_ACTION", 2.0) >= 2.0
        out = acts and 0.0 < raw.get("GF_MAX_HOR_DIST", 0.0) < away_m + room
        return ["leaves its fence"] if out or (acts and 0.0 < raw.get("GF_MAX_VER_DIST", 0.0) < high_m + room) else []
    on = raw.get("FENCE_ENABLE", 0.0) == 1.0 or raw.get("FENCE_AUTOENABLE", 0.0) in (1.0, 2.0, 3.0)
    kinds = int(raw.get("FENCE_TYPE", 4.0 if kind.startswith("wing") else 7.0)) if on else 0
    acts = raw.get("FENCE_ACTION", 1.0) != 0.0
    ceiling_m = raw.get("FENCE_ALT_MAX", 100.0)
    found = []
    if (kinds % 4 >= 2 and acts and raw.get("FENCE_RADIUS", 300.0) < away_m + room) or (
        kinds % 2 == 1 and acts and ceiling_m < high_m + room
    ):
        found.append("leaves its fence")
    if kinds % 2 == 1 and kind in ("copter-rtl", "copter-required") and ceiling_m - 2.0 < 120.0 + room:
        found.append("returns lower")
    return found


def faults(kind: str, case: Case, raw: Values, spare: float) -> list[str]:
    """The limits that an accepted flight with these parameters would break; ``spare``: the counted part of each
    tolerance."""
    vehicle = case.job.vehicle
    assert vehicle is not None
    found = []
    took_s = flown_s(case.plan, vehicle, raw)
    off_s = abs(took_s - case.time_s)
    if off_s > spare * max(1.0, 0.005 * case.time_s) + (SPARE_S + SPARE_PART * case.time_s if spare == 1.0 else 0.0):
        found.append(f"time {took_s - case.time_s:+.1f} s of {case.time_s:.1f}")
    found += breaches(kind, raw, spare)
    returns_too = kind.endswith(("rtl", "required"))
    if returns_too and vehicle.autopilot is Autopilot.ARDUCOPTER:
        if raw.get("RTL_ALT_TYPE", 0.0) != 0.0:
            found.append("above terrain")
        if raw.get("RTL_CLIMB_MIN", 0.0) > 0.5:
            found.append("climbs more")
        if 0.0 < raw.get("RTL_CONE_SLOPE", 3.0) < 2.95:
            found.append("lower in the cone")
    if kind == "copter-required":
        accel = raw.get("WPNAV_ACCEL", 250.0) / 100.0
        judged_m, speed = braking_distance_m(vehicle, 9.0), 9.0
        runs_m = speed**2 / (2.0 * accel) + accel / 2.0  # get_stopping_point_NE_m
        if runs_m > judged_m * 1.03 + 0.1:
            found.append(f"runs on {runs_m:.0f} m of {judged_m:.0f}")
    if returns_too and vehicle.autopilot is Autopilot.PX4 and raw.get("RTL_TYPE", 0.0) != 0.0:
        found.append("another return")
    if vehicle.autopilot is Autopilot.ARDUPLANE:
        bank_deg = math.degrees(math.atan(20.0**2 / (G_M_S2 * vehicle.turn_radius_m)))
        if raw.get("ROLL_LIMIT_DEG", 45.0) < (44.0 if kind == "wing-required" else bank_deg):
            found.append("roll")
        if raw.get("AIRSPEED_MAX", 22.0) < 19.7:
            found.append("too slow")
    return found


# -- sets ----------------------------------------------------------------------------------------------------


def random_set(kind: str, rng: random.Random) -> dict[str, float]:
    """A few parameters away from the vehicle's set-up, a little or much."""

    def near(value: float, least: float) -> float:
        factor = rng.choice([rng.uniform(0.995, 1.005), rng.uniform(0.85, 1.2), rng.uniform(0.2, 3.0)])
        return max(value * factor, least)

    copter = {
        "WPNAV_SPEED": near(1000, 100), "RTL_SPEED": rng.choice([0.0, near(1000, 100)]),
        "WPNAV_SPEED_UP": near(250, 20), "WPNAV_SPEED_DN": near(150, 20), "LAND_SPEED": round(near(50, 20)),
        "WPNAV_ACCEL": near(250, 50), "WPNAV_ACCEL_Z": near(100, 20), "WPNAV_JERK": near(1.0, 0.5),
        "ANGLE_MAX": round(near(5000 if kind == "fast" else 3000, 1000)), "RTL_LOIT_TIME": round(near(5000, 0)),
        "RTL_ALT_TYPE": rng.choice([0, 0, 1]), "RTL_CLIMB_MIN": rng.choice([0, 0, 1000]),
        "RTL_CONE_SLOPE": rng.choice([0.0, 3.0, 1.0, 5.0]),
        "LAND_SPEED_HIGH": rng.choice([0, 150, round(near(150, 20))]),
    }  # fmt: skip
    fence = {
        "FENCE_ENABLE": rng.choice([0, 1]), "FENCE_AUTOENABLE": rng.choice([0, 0, 3]),
        "FENCE_TYPE": rng.randrange(8), "FENCE_ACTION": rng.choice([0, 1, 1]),
        "FENCE_RADIUS": rng.choice([300, rng.uniform(2000, 3500)]),
        "FENCE_ALT_MAX": rng.choice([100, rng.uniform(60, 200)]),
    }  # fmt: skip
    px4 = {
        "MPC_XY_CRUISE": near(5, 1), "MPC_Z_V_AUTO_UP": near(3, 0.5), "MPC_Z_V_AUTO_DN": near(1.5, 0.5),
        "MPC_LAND_SPEED": near(0.7, 0.3), "MPC_ACC_HOR": near(3, 1), "MPC_XY_TRAJ_P": near(0.5, 0.1),
        "MPC_JERK_AUTO": near(4, 1), "GF_MAX_HOR_DIST": rng.choice([0, rng.uniform(1500, 3000)]),
        "GF_MAX_VER_DIST": rng.choice([0, rng.uniform(50, 200)]), "GF_ACTION": rng.randrange(4),
        "RTL_TYPE": rng.choice([0, 0, 1]),
    }  # fmt: skip
    wing = {
        "ROLL_LIMIT_DEG": rng.uniform(10, 60), "AIRSPEED_MAX": round(near(22, 10)), "AIRSPEED_CRUISE": near(20, 12),
    }  # fmt: skip
    table = wing if kind.startswith("wing") else px4 if kind.startswith("px4") else copter
    names = rng.sample(sorted(table), min(len(table), rng.randint(1, 3)))
    fenced = fence if not kind.startswith("px4") and rng.random() < 0.3 else {}
    return {name: float(table[name]) for name in names} | {name: float(value) for name, value in fenced.items()}


def one(seed: int) -> tuple[str, str]:
    """How one set ends: accepted, refused, or a fault; and the words."""
    rng = random.Random(seed)
    kind = KINDS[seed % len(KINDS)]
    case = case_of(kind)
    changed = random_set(kind, rng)
    judge = judge_on_board(case.job, allow_unjudged=case.job.verdict is not None and case.job.verdict.safe is None)
    assert judge is not None
    refused = judge(case.job.mission, board_of(case, changed))
    raw = case.base | changed
    if refused is None:
        broken = faults(kind, case, raw, 1.0)
        return ("fault" if broken else "accepted", f"{kind} {changed}: {'; '.join(broken)}")
    needless = not faults(kind, case, raw, 0.4)
    return ("needless" if needless else "refused", f"{kind} {changed}: {str(refused).splitlines()[-1]}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    count: Counter[str] = Counter()
    until, seed = time.monotonic() + given.seconds, given.seed
    while time.monotonic() < until and (seed < given.seed + given.sets or given.seconds < math.inf):
        end, words = one(seed)
        count[end] += 1
        if end in ("fault", "needless"):
            print(f"{seed}: {end}: {words}", flush=True)
        seed += 1
    print(f"{seed - given.seed} sets: {dict(count)}")
    return 1 if count["fault"] else 0


if __name__ == "__main__":
    raise SystemExit(main())
