"""A large fleet from its mission file to what is on board: seconds and memory of each step, and a sampled oracle.

The oracle shares nothing with the exact separation: every `STEP_S` it takes the places of all vehicles that fly, and
looks for pairs that are too near with a tree of these places.
"""

from __future__ import annotations

import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from gcsplan.app import outputs, uploads
from gcsplan.app.flying import require_passing
from gcsplan.app.pipeline import plan
from gcsplan.app.upload_job import SIM, UploadOptions
from gcsplan.app.way_home import homes_of
from gcsplan.bench.fleet_missions import fleet_document
from gcsplan.export.outdir import write_outputs, write_whole
from gcsplan.fleet.motion import TimedPath
from gcsplan.mission_file import load_mission
from gcsplan.sim.vehicle.server import loopback_fleet

T = TypeVar("T")

STEP_S = 0.02
BLOCK_S = 20.0
"""Seconds whose places are held at a time."""


def run(
    vehicles: int, out: Path, *, seed: int = 1, interval_s: float = 4.0, jobs: int | None = None, upload: bool = False
) -> dict[str, Any]:
    """Make the mission file, plan it with ``leave_out``, write outputs and report to ``out``, and sample the motions.

    ``upload``: also upload to simulated vehicles, on as many links as system ids ask for. Raises InputError for a
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


def sampled(paths: Sequence[TimedPath], needed_m: float, step_s: float = STEP_S) -> tuple[float, int]:
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

    def timed(self, name: str, what: Callable[[], T]) -> T:
        clock_s, busy_s = time.perf_counter(), time.process_time()
        result = what()
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
        self.rows.append(
            {
                "step": name, "clock_s": time.perf_counter() - clock_s, "processor_s": time.process_time() - busy_s,
                "peak_mb": peak,
            }
        )  # fmt: skip
        return result


def report(result: dict[str, Any]) -> str:
    """The result in words."""
    out = ", ".join(f"{n} {reason}" for reason, n in result["left_out"].items()) or "none"
    lines = [
        f"{result['placed']} of {result['vehicles']} vehicles planned, {result['interval_s']:g} s apart; "
        f"left out: {out}",
        f"least separation {result['least_m']:.2f} m exact, {result['sampled_m']:.2f} m sampled every {STEP_S:g} s; "
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
