"""Windows of arrival times against flights that are integrated step by step in winds of the declared set.

    python -m tests.campaigns.winds --seconds 120 [--seed 1] [--inputs N]

An input is a random mission of a copter (with even accelerations, with ArduCopter's curves, or a PX4) or of a fixed
wing, with way points at several heights, and a random wind: constant, a range of speeds and directions, up to a speed
from anywhere, a profile over height, two hours of a forecast, each also varying. The mission is judged in it. The
witnesses of `tests/oracles/wind.py` fly it: corners of the set, random winds, the earliest and the latest that a search
finds, and where the wind varies the best and the worst wind of each leg. The models of motion differ in still air by
some tenths of a second at each corner, so the differences to still air are compared.

A fault is a witness outside the window of a way point, or that takes more energy than is planned; a constant wind whose
window is more than 1 % or 2 s away; and a wind that is called too strong although no witness fails in one a quarter
stronger. Also printed: how wide windows are beside the spread of the witnesses. Exits with 1 if there is a fault;
``--seed S --inputs 1`` repeats it.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import sys
import time
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.mission_file.vehicles import in_wind
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.wind.declared import DeclaredWind, FlightWind
from tests.oracles import wind as oracle
from tests.support import wings, worlds

MAX_FOUND = 20
GROUND_M = 300.0
FLAT = worlds.world(GROUND_M)
SLACK_S, SLACK_PART = 0.3, 0.004
"""Seconds, and part of what the wind changes, by which two models of the same flight may differ."""
CONSTANT_S, CONSTANT_PART = 2.0, 0.01
KINDS = ("copter", "curves", "px4", "wing")
WINDS = ("constant", "range", "up to", "profile", "forecast")
HOUR_S = 3600.0


def declared(rng: random.Random, kind: str, most_m_s: float) -> oracle.Winds:
    """The numbers of a set of winds."""
    if kind == "up to":
        return oracle.Winds([[(0.0, rng.uniform(1.0, most_m_s))]], [[(0.0, 360.0)]])
    heights = sorted(rng.uniform(0.0, 150.0) for _ in range(rng.randint(2, 4))) if kind == "profile" else [0.0]
    times = [0.0, rng.uniform(200.0, HOUR_S)] if kind == "forecast" else [0.0]
    speeds, turns = [], []
    for _ in times:
        lows = [rng.uniform(0.0, most_m_s) for _ in heights]
        from_deg = [rng.uniform(0.0, 360.0) for _ in heights]
        wide = [0.0 if kind == "constant" else rng.uniform(0.0, most_m_s - low) for low in lows]
        turn = [0.0 if kind == "constant" else rng.choice([0.0, 20.0, 60.0, 180.0]) * rng.random() for _ in heights]
        speeds.append([(low, low + w) for low, w in zip(lows, wide, strict=True)])
        turns.append([(f, f + t) for f, t in zip(from_deg, turn, strict=True)])
    return oracle.Winds(speeds, turns, heights, rng.random() < 0.5, times)


def as_declared(winds: oracle.Winds, *, varying: bool) -> DeclaredWind:
    return DeclaredWind(
        np.array(winds.speed_m_s, float), np.array(winds.from_deg, float), np.array(winds.heights_m, float),
        "agl" if winds.above_ground else "amsl", np.array(winds.times_s, float), varying,
    )  # fmt: skip


def craft(rng: random.Random, kind: str) -> tuple[Vehicle, oracle.Craft]:
    """An aircraft, and the same for the oracle."""
    energy = Energy(vertical_j_per_m=0.0, horizontal_j_per_m=100.0, base_w=rng.choice([0.0, 150.0]))
    if kind == "wing":
        speed = rng.uniform(14.0, 25.0)
        radius = math.ceil(speed**2 / 4.0)
        one = replace(wings.wing(radius), speed_min_m_s=speed, speed_max_m_s=speed, energy=energy,
                      climb_m_s=50.0, descent_m_s=50.0)  # fmt: skip
        return one, oracle.Craft(speed, radius_m=radius, climb_m_s=50.0, descent_m_s=50.0)
    speed, lean = rng.uniform(4.0, 11.0), rng.uniform(35.0, 55.0)
    pilot = Autopilot.PX4 if kind == "px4" else Autopilot.ARDUCOPTER
    one = replace(worlds.vehicle(pilot), speed_min_m_s=3.0, speed_max_m_s=speed, energy=energy)
    if kind == "copter":
        return replace(one, lean_angle_deg=None), oracle.Craft(
            speed, air_m_s=1.2 * speed, climb_m_s=2.5, descent_m_s=1.5
        )
    one = replace(one, leg_jerk_m_s3=1.0, lean_angle_deg=lean if kind == "curves" else None)
    air = oracle.leaning_air_m_s(one.largest_lean_deg or lean, GROUND_M + 80.0)
    slopes = oracle.air_per_slope(one.largest_lean_deg or lean, GROUND_M + 80.0)
    return one, oracle.Craft(speed, air_m_s=air, climb_m_s=2.5, descent_m_s=1.5, per_slope=slopes)


def mission_of(rng: random.Random, vehicle: Vehicle) -> Mission:
    """A take-off to the east and some way points without sharp turns."""
    wing = vehicle.turn_radius_m > 0.0
    east, north, up, course = (600.0 if wing else 0.0), 0.0, 80.0, (0.0 if wing else rng.uniform(0.0, 6.0))

    def item(command: int, *params: float, z: float) -> MissionItem:
        return wings.at(command, east, north, z, *params)

    items = [item(cmd.TAKEOFF, 8.0 if wing else 0.0, z=up)]
    if not wing:
        items.append(MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1.0, vehicle.speed_max_m_s, -1.0, 0.0)))
    accept = 0.0
    for k in range(rng.randint(1, 5)):
        length = rng.uniform(500.0, 1500.0) if wing else rng.choice([120.0, 400.0, 900.0]) * rng.uniform(0.7, 1.4)
        turn = math.radians(rng.uniform(-60.0, 60.0)) if k or not wing else 0.0
        if wing and k:
            accept = math.ceil(vehicle.turn_radius_m * math.tan(0.5 * abs(turn)))
            items[-1] = replace(items[-1], params=(0.0, max(accept, 1.0), 0.0, 0.0))
        course += turn
        east, north = east + length * math.cos(course), north + length * math.sin(course)
        steepest = 0.08 if wing else 0.2
        up = min(max(up + rng.uniform(-steepest, steepest) * length * rng.choice([0.0, 1.0]), 60.0), 140.0)
        items.append(item(cmd.WAYPOINT, 0.0, 1.0 if wing else 0.0, z=up))
    if wing:
        items[-1] = replace(items[-1], command=cmd.LOITER_UNLIM, params=(0.0, 0.0, vehicle.turn_radius_m, 0.0))
    else:
        items.append(item(cmd.LAND, z=0.0))
    home = Home.at(*wings.HOME_DEG, GROUND_M) if wing else Home.at(36.6, -84.3, GROUND_M)
    return Mission(vehicle.autopilot, home, tuple(items), "uav1", 1)


def way_of(verdict: Verdict, *, wing: bool) -> tuple[list[oracle.Point], list[int]]:
    """The points of a mission in the plane, from home or the top of the take-off, and the last leg to each."""
    last = {leg.seq: k for k, leg in enumerate(verdict.legs)}
    points, ends = [], []
    for item, seq in zip(verdict.mission.items, range(verdict.mission.first_seq, 1000), strict=False):
        if item.command not in (cmd.TAKEOFF, cmd.WAYPOINT, cmd.LOITER_UNLIM):
            continue
        leg = verdict.legs[last[seq]]
        lat, lon, z = (item.lat_deg, item.lon_deg, GROUND_M + item.z) if item.command != cmd.TAKEOFF else leg.end
        east, north = (float(x) for x in FLAT.frame.to_plane(lat, lon))
        points.append((east, north, float(z)))
        ends.append(last[seq])
    if wing:
        start = verdict.legs[0].start
        east, north = (float(x) for x in FLAT.frame.to_plane(start[0], start[1]))
        points.insert(0, (east, north, float(start[2])))
        ends.insert(0, -1)
    return points, ends


@dataclass
class Outcome:
    """How an input ended, its faults, and how wide the last window is beside what the witnesses spread, s."""

    how: str
    faults: list[str]
    widths_s: tuple[float, float] | None = None


def attack(seed: int) -> Outcome:
    """Judge the input of that seed."""
    rng = random.Random(seed)
    kind, blows, varying = rng.choice(KINDS), rng.choice(WINDS), rng.random() < 0.3
    vehicle, flown = craft(rng, kind)
    most_m_s = 0.6 * (flown.speed_m_s if flown.wing else min(flown.air_m_s, 12.0))
    winds = declared(rng, blows, most_m_s)
    wind = as_declared(winds, varying=varying)
    blown = in_wind(vehicle, wind)
    assert blown is not None
    mission = mission_of(rng, vehicle)
    verdict = judge(mission, blown, FLAT, wind=FlightWind(wind))
    named = f"seed {seed} ({kind}, {blows}{', varying' if varying else ''})"
    how = f"{kind}, {blows}{', varying' if varying else ''}"
    if verdict.not_judged:
        return Outcome(f"{kind}: not judged ({verdict.not_judged[0].code})", [])
    points, ends = way_of(verdict, wing=flown.wing)
    path = oracle.path_of(points, flown)

    def ground(east: float, north: float) -> float:
        return GROUND_M

    windows = verdict.leg_windows_s()
    if windows is None:
        weak = replace(flown, air_m_s=0.8 * flown.air_m_s, speed_m_s=0.8 * flown.speed_m_s)
        stronger = [
            oracle.fly(path, weak, winds, lambda leg, part=k / 16.0: (1.0, part), ground=ground).arrive_s[-1]
            for k in range(17)
        ]
        lone = [] if any(map(math.isinf, stronger)) or varying else [f"{named}: too strong, and every witness arrives"]
        return Outcome(f"{how}: too strong", lone)
    still, clock = oracle.still(flown, path), verdict.clock_s()
    begins_s = 0.0 if flown.wing else clock[ends[0]]
    found = oracle.Extremes.of(path, flown, winds, rng, varying=varying, ground=ground, start_s=begins_s)
    faults, last = [], (0.0, 0.0)
    for k, leg in enumerate(ends):
        if leg < 0:
            continue
        differs_s = clock[leg] - still.arrive_s[k]
        early, late = found.earliest_s[k] + differs_s, found.latest_s[k] + differs_s
        spare = SLACK_S + SLACK_PART * max(abs(t - clock[leg]) for t in (early, late))
        if flown.wing is False:  # the differences of both models at corners are not the same at every speed
            spare += 0.15 * k + 0.1 * abs(differs_s - begins_s)
        earliest, latest = windows[leg]
        if early < earliest - spare or late > latest + spare:
            faults.append(
                f"{named}: way point {k}: witnesses at {early:.2f} to {late:.2f} s, window {earliest:.2f} to "
                f"{latest:.2f} s, still air {clock[leg]:.2f} s"
            )
            break
        if blows == "constant" and not varying:
            off = max(early - earliest, latest - late)
            if off > max(CONSTANT_S, CONSTANT_PART * late) + spare:
                faults.append(f"{named}: way point {k}: at {early:.2f} s, window {earliest:.2f} to {latest:.2f} s")
                break
        last = latest - earliest, late - early
    flying_j = math.fsum(leg.energy_j for leg in verdict.legs[: ends[-1] + 1])
    took_j = vehicle.energy.horizontal_j_per_m * found.most_air_m
    if took_j > flying_j * (1.0 + SLACK_PART) + 200.0:
        faults.append(f"{named}: a witness takes {took_j:.0f} J through the air alone, planned are {flying_j:.0f} J")
    return Outcome(how, faults, last)


def main() -> int:
    """Run the campaign; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=10**9)
    args = parser.parse_args()
    until, seed = time.monotonic() + args.seconds, args.seed
    found: list[str] = []
    ended: Counter[str] = Counter()
    wide: dict[str, list[float]] = {}
    while seed - args.seed < args.inputs and time.monotonic() < until and len(found) < MAX_FOUND:
        outcome = attack(seed)
        ended[outcome.how] += 1
        found += outcome.faults
        if outcome.widths_s is not None and outcome.widths_s[1] > 5.0:
            wide.setdefault(outcome.how, []).append(outcome.widths_s[0] / outcome.widths_s[1])
        seed += 1
    print(f"{seed - args.seed} inputs, {len(found)} faults")
    for how, count in sorted(ended.items()):
        ratios = wide.get(how)
        tight = f", windows {statistics.median(ratios):.2f} × the spread (most {max(ratios):.2f})" if ratios else ""
        print(f"  {how}: {count}{tight}")
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
