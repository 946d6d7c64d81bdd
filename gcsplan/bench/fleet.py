"""A large fleet from its mission file to the vehicles: seconds and memory of each step, and a sampled oracle.

The missions are depots over the sample terrain whose copters fly to places around them. Each depot has rows of pads;
each pad has one copter, and each copter a place of its own, drawn around its depot. Places are drawn apart from each
other, from every pad and from zones, but without a look at heights or at the battery, which is the same for all: a
copter whose place is too far or too high for it has no mission. Arrivals are in sequence, and the depots take turns.
System ids repeat; each link has a system id once.

The oracle shares nothing with the exact separation: every `ORACLE_S` it takes the places of all vehicles that fly, and
looks for pairs that are too near with a tree of these places.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from gcsplan.app.fleet.may_fly import require_passing
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output import files as outputs
from gcsplan.app.plan.way_home import homes_of
from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.job import SIM, UploadOptions
from gcsplan.arrays import Floats
from gcsplan.bench.measure import peak_mb
from gcsplan.bench.sample import ROUND_DEGREE_M, SAMPLE_TERRAIN
from gcsplan.errors import InputError
from gcsplan.export.outdir import write_outputs, write_whole
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.mission_file import load_mission
from gcsplan.sim.vehicle.server import loopback_fleet

Timed = TypeVar("Timed")

DEPOTS_MIDDLE_DEG = (36.575, -84.255)
DEPOTS_HALF_M = 11_000.0
"""Half the side of the square of depots around `DEPOTS_MIDDLE_DEG`, m."""
REACH_M = 14_000.0
"""The same of the square of goals, which is within the sample terrain."""

PADS = 10
"""Pads in a row of a depot, and rows."""
PAD_M = 90.0
BATTERY_J, RESERVE = 6.2e5, 0.2
"""Battery of each copter, J, and the part of it that must be left: too little for about one flight in a hundred."""
NEAREST_GOAL_M, FARTHEST_GOAL_M = 1500.0, 4000.0
"""Distance of a copter's goal from the middle of its depot, m."""
PLACES_APART_M = 100.0
"""Least distance of two places, m."""
DEPOTS_APART_M = 4500.0
FLEET_ZONES = 40
ON_A_LINK = 200
"""Most vehicles that one link carries; system ids go to 255."""
FIRST_PORT = 14_600
MOST_FLEET = 2000
PLACE_DRAWS = 10_000

ORACLE_S = 0.02
BLOCK_S = 20.0
"""Seconds whose places are held at a time."""


def run(
    vehicles: int, out: Path, *, seed: int = 1, interval_s: float = 4.0, jobs: int | None = None, upload: bool = False
) -> dict[str, Any]:
    """Make the mission file, plan it with ``leave_out``, write outputs and report to ``out``, and sample the motions.

    ``upload``: also upload to simulated vehicles, on as many links as system ids need. Raises InputError for a
    number out of range, NoMission if no vehicle has a mission.
    """
    document = fleet_document(vehicles, seed, interval_s)
    steps = _Steps()
    out.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=200)
    write_whole(out / "fleet.yaml", text)
    source = steps.timed("read", lambda: load_mission(out / "fleet.yaml"))
    planned = steps.timed("plan", lambda: plan(source, jobs=jobs, leave_out=True))
    require_passing({v.name: v.verdict for v in planned.vehicles})
    files = steps.timed("outputs", lambda: outputs.outputs_of(planned))
    homes = steps.timed("way home", lambda: homes_of(planned))
    files["report.html"] = steps.timed("report", lambda: outputs.report_of(planned, (), homes))
    steps.timed("write", lambda: write_outputs(out / "fleet", files))
    fleet = planned.fleet
    assert fleet is not None
    result: dict[str, Any] = {
        "vehicles": vehicles, "seed": seed, "interval_s": interval_s, "placed": len(planned.vehicles),
        "left_out": dict(Counter(v.reason for v in planned.left_out)),
        "changed": sum(bool(slot.notes) for slot in fleet.slots),
        "least_m": None if fleet.closest is None else fleet.closest.distance_m,
        "kilobytes": {name: len(files[name]) // 1000 for name in files if not name.endswith((".plan", ".waypoints"))},
        "steps": steps.rows,
    }  # fmt: skip
    if upload:
        todo = uploads.jobs_of(planned, dict.fromkeys((v.name for v in planned.vehicles), SIM))
        done = steps.timed("upload", lambda: uploads.run_jobs(todo, UploadOptions(), simulator=loopback_fleet))
        result["verified"] = sum(d.verified for d in done)
        result["links"] = max(Counter(v.mission.sysid for v in planned.vehicles).values())
    result["sampled_m"], result["too_near"] = steps.timed("oracle", lambda: sampled(fleet.motions, 30.0))
    return result


def sampled(paths: Sequence[TimedPath], needed_m: float, step_s: float = ORACLE_S) -> tuple[float, int]:
    """The least distance of two vehicles in the air at the same moment, m, and the number of pairs below ``needed_m``.

    A pair farther apart than twice ``needed_m`` at every moment does not count for the least distance (inf).
    """
    from scipy.spatial import cKDTree

    begin, end = min(p.begin_s for p in paths), max(p.end_s for p in paths)
    least_m, near = np.inf, set[tuple[int, int]]()
    for block in count():
        times = begin + block * BLOCK_S + np.arange(round(BLOCK_S / step_s)) * step_s
        if times[0] > end:
            return float(least_m), len(near)
        flying = [k for k, p in enumerate(paths) if p.begin_s <= times[-1] and times[0] <= p.end_s]
        places = np.full((len(times), len(flying), 3), np.nan)
        for column, k in enumerate(flying):
            path = paths[k]
            up = (times >= path.begin_s) & (times <= path.end_s)
            for axis in range(3):
                places[up, column, axis] = np.interp(times[up], path.times_s, path.points[:, axis])
        for here in places:
            who = np.flatnonzero(~np.isnan(here[:, 0]))
            if len(who) < 2:
                continue
            at = here[who]
            for a, b in cKDTree(at).query_pairs(2.0 * needed_m):
                apart_m = float(np.linalg.norm(at[a] - at[b]))
                least_m = min(least_m, apart_m)
                if apart_m < needed_m:
                    near.add((flying[who[a]], flying[who[b]]))
    raise AssertionError("unreachable")


class _Steps:
    """Seconds by the clock and of this process, and the most memory so far, after each step."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def timed(self, name: str, what: Callable[[], Timed]) -> Timed:
        clock_s, busy_s = time.perf_counter(), time.process_time()
        result = what()
        self.rows.append(
            {
                "step": name, "clock_s": time.perf_counter() - clock_s, "processor_s": time.process_time() - busy_s,
                "peak_mb": peak_mb(),
            }
        )  # fmt: skip
        return result


def report(result: dict[str, Any]) -> str:
    """The result in words."""
    out = ", ".join(f"{n} {reason}" for reason, n in result["left_out"].items()) or "none"
    lines = [
        f"{result['placed']} of {result['vehicles']} vehicles planned, {result['interval_s']:g} s apart; "
        f"left out: {out}",
        f"least separation {result['least_m']:.2f} m exact, {result['sampled_m']:.2f} m sampled every {ORACLE_S:g} s; "
        f"{result['too_near']} pairs too near",
    ]
    if "verified" in result:
        lines.append(f"{result['verified']} uploads verified, over {result['links']} links")
    lines += [f"  {name:<16} {size:>8,} kB".replace(",", " ") for name, size in result["kilobytes"].items()]
    lines.append("  step        clock, s  processor, s  most memory, MB")
    lines += [
        f"  {row['step']:<10} {row['clock_s']:>9.1f} {row['processor_s']:>13.1f} {row['peak_mb']:>16.0f}"
        for row in result["steps"]
    ]
    return "\n".join(lines)


# -- the missions ------------------------------------------------------------------------------------------------------


def fleet_document(vehicles: int, seed: int = 1, interval_s: float = 4.0) -> dict[str, Any]:
    """A mission file, as read from YAML, with a number of vehicles. Raises InputError for a number out of range."""
    if not 2 <= vehicles <= MOST_FLEET or not interval_s > 0.0:
        words = f"give 2 to {MOST_FLEET} vehicles and an interval above 0 s, not {vehicles} and {interval_s:g}"
        raise InputError(words)
    rng = np.random.default_rng([seed, vehicles])
    depots = _apart(rng, math.ceil(vehicles / PADS**2), DEPOTS_APART_M)
    starts = _pads(depots, vehicles)
    zones, radius_m = (
        rng.uniform(-DEPOTS_HALF_M, DEPOTS_HALF_M, (FLEET_ZONES, 2)),
        rng.uniform(100.0, 500.0, FLEET_ZONES),
    )
    high = rng.random(FLEET_ZONES) < 0.5
    clear = np.linalg.norm(zones[:, None] - depots[None], axis=2).min(axis=1) > PADS * PAD_M + radius_m
    goals = _goals(rng, depots, starts, zones[clear], radius_m[clear] + PLACES_APART_M)
    return {
        "version": 1,
        "name": f"{vehicles} from {len(depots)} depots",
        "terrain": dict(SAMPLE_TERRAIN),
        "limits": {
            "min_agl_m": 40, "horizontal_clearance_m": 20, "track_error_m": 3, "altitude_error_m": 5,
            "max_climb_deg": 25,
        },
        "no_fly": [
            {
                "name": f"zone {k + 1}", "center": _degrees(zones[k]), "radius_m": round(float(radius_m[k])),
                **({} if high[k] else {"ceiling_agl_m": 150}),
            }
            for k in np.flatnonzero(clear).tolist()
        ],
        "vehicles": [
            {
                "name": f"uav{k + 1:04d}", "sysid": k % ON_A_LINK + 1, "autopilot": "arducopter",
                "start": _degrees(starts[k]), "goal": _degrees(goals[k]), "speed_m_s": [3, 10],
                "energy": {"battery_j": BATTERY_J, "reserve": RESERVE},
                "link": f"udpout:127.0.0.1:{FIRST_PORT + k // ON_A_LINK}",
            }
            for k in range(vehicles)
        ],
        "arrival": {"mode": "sequence", "interval_s": interval_s, "separation_m": 30},
        "planner": {"name": "optimal", "objective": "length", "seed": 1, "gap_percent": 2},
    }  # fmt: skip


def _apart(rng: np.random.Generator, count: int, apart_m: float) -> Floats:
    """Middles of depots (count, 2), metres east and north; the distance shrinks where they find no room."""
    found: list[Floats] = []
    for draw in range(PLACE_DRAWS):
        one = rng.uniform(-DEPOTS_HALF_M, DEPOTS_HALF_M, 2)
        if all(np.hypot(*(one - other)) >= apart_m * (1.0 - draw / PLACE_DRAWS) for other in found):
            found.append(one)
        if len(found) == count:
            return np.array(found)
    raise InputError(f"no room for {count} depots")


def _pads(depots: Floats, count: int) -> Floats:
    """Starts (count, 2): vehicle k stands at depot k modulo their number."""
    turn, depot = np.divmod(np.arange(count), len(depots))
    row, column = np.divmod(turn, PADS)
    return np.asarray(depots[depot] + PAD_M * (np.column_stack([column, row]) - (PADS - 1) / 2.0))


def _goals(rng: np.random.Generator, depots: Floats, starts: Floats, zones: Floats, radius_m: Floats) -> Floats:
    """A goal (count, 2) for each start, outside circles around ``zones`` (n, 2)."""
    taken = np.vstack([starts, np.full_like(starts, math.inf)])
    count = len(starts)
    for k in range(count):
        middle = depots[k % len(depots)]
        for _ in range(PLACE_DRAWS):
            far_m = math.sqrt(rng.uniform(NEAREST_GOAL_M**2, FARTHEST_GOAL_M**2))
            to = rng.uniform(0.0, 2.0 * math.pi)
            goal = middle + far_m * np.array([math.cos(to), math.sin(to)])
            outside = (np.hypot(*(zones - goal).T) >= radius_m).all()
            if outside and np.abs(goal).max() <= REACH_M and np.hypot(*(taken - goal).T).min() >= PLACES_APART_M:
                taken[count + k] = goal
                break
        else:
            raise InputError(f"no room for the goal of vehicle {k + 1}")
    return np.asarray(taken[count:])


def _degrees(place: Floats) -> list[float]:
    lat, lon = DEPOTS_MIDDLE_DEG
    east_m, north_m = (float(x) for x in place)
    per_east = ROUND_DEGREE_M * math.cos(math.radians(lat))
    return [round(lat + north_m / ROUND_DEGREE_M, 6), round(lon + east_m / per_east, 6)]
