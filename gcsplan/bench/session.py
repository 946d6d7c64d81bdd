"""A living session: time from a change to the first path and to the plan, time to cancel, memory over many changes."""

from __future__ import annotations

import gc
import math
import threading
import time
import tracemalloc
from contextlib import suppress
from typing import Any

import numpy as np

from gcsplan.app.session import BetterPath, Planner
from gcsplan.bench.sample import SAMPLE_HALF_M, SAMPLE_MIDDLE_DEG, SAMPLE_TERRAIN
from gcsplan.errors import Cancelled, GcsplanError
from gcsplan.world.geodesy.frame import Frame

SESSION_ZONES = 40
DEGREE_POSTS = 3601
"""Rows and columns of a tile of one degree with posts every 30 m."""
LEGS_M = (3_000.0, 9_000.0)
"""Lengths between which missions are drawn, m."""
MEMORY_PLANS = 20
"""One in this many changes is planned while memory is measured."""


def run(changes: int = 40, cancels: int = 40, memory_changes: int = 0, seed: int = 1) -> dict[str, Any]:
    """Measure ``changes`` of the goal on the sample with zones and on a tile of one degree, ``cancels`` at random
    moments of a plan, and the memory that ``memory_changes`` take (0: not measured)."""
    rng = np.random.default_rng(seed)
    sample = drawn_mission(SAMPLE_TERRAIN, SAMPLE_MIDDLE_DEG, SAMPLE_HALF_M, rng)
    result: dict[str, Any] = {"changes": changes, "zones": SESSION_ZONES, "seed": seed}
    result["sample"] = _first_paths(sample, SAMPLE_MIDDLE_DEG, changes, rng)
    middle = (46.5, 8.5)
    degree = drawn_mission(degree_terrain(rng), middle, (20_000.0, 20_000.0), rng)
    result["degree"] = _first_paths(degree, middle, changes, rng)
    result["cancel"] = _cancels(sample, cancels, rng)
    if memory_changes:
        result["memory"] = _memory(sample, memory_changes, rng)
    return result


def report(result: dict[str, Any]) -> str:
    """The figures in lines."""
    lines = []
    for name, one in (("sample", result["sample"]), ("degree tile", result["degree"])):
        first = f"p50 {one['first_path_p50_s'] * 1e3:.0f} ms, p95 {one['first_path_p95_s'] * 1e3:.0f} ms"
        whole = f"{one['plan_p50_s'] * 1e3:.0f} ms; {one['planned']} of {result['changes']} changes planned"
        draft = f"p50 {one['draft_p50_s'] * 1e3:.0f} ms, p95 {one['draft_p95_s'] * 1e3:.0f} ms"
        lines.append(f"{name}, by the processor: first path {first}; of a draft {draft}; plan p50 {whole}")
    cancel = result["cancel"]
    took = f"p50 {cancel['p50_s'] * 1e3:.1f} ms, largest {cancel['max_s'] * 1e3:.0f} ms of {cancel['count']}"
    lines.append(f"cancel, by the processor: {took}")
    if "memory" in result:
        memory = result["memory"]
        lines.append(f"memory: {memory['grown_bytes'] / 1e3:+.0f} kB over {memory['changes']} changes")
    return "\n".join(lines)


def degree_terrain(rng: np.random.Generator) -> dict[str, Any]:
    """A tile of one degree of hills, m AMSL, as a script hands it in."""
    x = np.linspace(0.0, 1.0, DEGREE_POSTS)
    heights = np.full((DEGREE_POSTS, DEGREE_POSTS), 900.0, np.float32)
    for waves in (9, 23, 61):
        a, b = rng.uniform(0.0, 2.0 * math.pi, 2)
        heights += (2_400.0 / waves) * np.outer(np.sin(waves * x * 6.0 + a), np.cos(waves * x * 6.0 + b)).astype("f4")
    cell = 1.0 / (DEGREE_POSTS - 1)
    transform = (cell, 0.0, 8.0 - 0.5 * cell, 0.0, -cell, 47.0 + 0.5 * cell)
    return {"dem": heights, "transform": transform, "crs": "EPSG:4326", "vertical_datum": "EGM96"}


def _place(middle: tuple[float, float], half_m: tuple[float, float], rng: np.random.Generator) -> list[float]:
    east, north = rng.uniform(-1.0, 1.0, 2) * half_m
    return [round(float(v), 6) for v in Frame(*middle).to_degrees(east, north)]


def drawn_mission(
    terrain: dict[str, Any], middle: tuple[float, float], half_m: tuple[float, float], rng: np.random.Generator,
    zones: int = SESSION_ZONES,
) -> dict[str, Any]:  # fmt: skip
    """A mission of one copter that starts in the middle, with circles around it."""
    vehicle = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": list(middle),
               "goal": drawn_goal(middle, rng)}  # fmt: skip
    circles = [
        {"name": f"zone{k}", "center": _place(middle, half_m, rng), "radius_m": round(float(rng.uniform(80, 500)), 1)}
        for k in range(zones)
    ]
    near = Frame(*middle)
    circles = [z for z in circles if np.hypot(*near.to_plane(*z["center"])) > z["radius_m"] + 150.0]  # type: ignore[misc,operator]
    return {"version": 1, "terrain": terrain, "limits": {"min_agl_m": 60}, "no_fly": circles, "vehicles": [vehicle]}


def drawn_goal(middle: tuple[float, float], rng: np.random.Generator) -> list[float]:
    """A place around the middle, latitude and longitude."""
    turn, far_m = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(*LEGS_M)
    east, north = far_m * math.cos(turn), far_m * math.sin(turn)
    return [round(float(v), 6) for v in Frame(*middle).to_degrees(east, north)]


def _first_paths(
    mission: dict[str, Any], middle: tuple[float, float], changes: int, rng: np.random.Generator
) -> dict[str, Any]:
    """Seconds of the processor from the call to the first path, and to the plan, after each change of the goal."""
    session = Planner(mission)
    firsts, wholes = [], []
    for _ in range(changes + 1):
        seen_s: list[float] = []
        begun_s = time.thread_time()

        def on_path(_: BetterPath, seen_s: list[float] = seen_s) -> None:
            seen_s.append(time.thread_time())

        try:
            session.plan({"vehicles.uav1.goal": drawn_goal(middle, rng)}, on_path=on_path)
        except GcsplanError:
            continue  # the goal lies in a zone, or no path leads to it
        wholes.append(time.thread_time() - begun_s)
        firsts.append(seen_s[0] - begun_s)
    firsts, wholes = firsts[1:], wholes[1:]  # the first plan compiles and opens
    drafts = _draft_paths(session, middle, changes, rng)
    return {
        "planned": len(firsts), "first_path_p50_s": float(np.median(firsts)),
        "first_path_p95_s": float(np.quantile(firsts, 0.95)), "plan_p50_s": float(np.median(wholes)),
        "drafts": len(drafts), "draft_p50_s": float(np.median(drafts)),
        "draft_p95_s": float(np.quantile(drafts, 0.95)),
    }  # fmt: skip


class _FirstPath(Exception):
    """A draft has its path."""


def _draft_paths(
    session: Planner, middle: tuple[float, float], changes: int, rng: np.random.Generator
) -> list[float]:  # fmt: skip
    """Seconds of the processor to the first path of drafts, which end with it."""

    def enough(_: BetterPath) -> None:
        raise _FirstPath

    took = []
    for _ in range(changes + 1):
        begun_s = time.thread_time()
        try:
            session.plan({"vehicles.uav1.goal": drawn_goal(middle, rng)}, on_path=enough, draft=True)
        except _FirstPath:
            took.append(time.thread_time() - begun_s)
        except GcsplanError:
            continue
    return took[1:]  # the first draft reads the ground


def _cancels(mission: dict[str, Any], count: int, rng: np.random.Generator) -> dict[str, Any]:
    """Seconds of the processor from `cancel` to the end of a plan, at random moments of it; by the clock where no
    thread's seconds are counted."""
    session = Planner(mission)
    counted = hasattr(time, "pthread_getcpuclockid")
    begun_s = time.perf_counter()
    session.plan()
    long_s, took = time.perf_counter() - begun_s, []
    for _ in range(count):
        ended: list[float] = []

        def work(ended: list[float] = ended) -> None:
            try:
                session.plan()
            except Cancelled:
                ended.append(time.thread_time() if counted else time.perf_counter())

        thread = threading.Thread(target=work)
        thread.start()
        time.sleep(float(rng.uniform(0.0, 0.8 * long_s)))
        begun_s = time.perf_counter()
        with suppress(OSError):  # the plan has ended
            if counted and thread.ident is not None:
                begun_s = time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
        session.cancel()
        thread.join()
        took += [at - begun_s for at in ended]
    return {"count": len(took), "p50_s": float(np.median(took)), "max_s": max(took)}


def _memory(mission: dict[str, Any], changes: int, rng: np.random.Generator) -> dict[str, Any]:
    """Bytes that Python holds more after many changes than before them."""
    session = Planner(mission)
    goals = [drawn_goal(SAMPLE_MIDDLE_DEG, rng) for _ in range(MEMORY_PLANS)]

    def change(count: int) -> None:
        for k in range(count):
            goal = goals[k // MEMORY_PLANS % len(goals)]
            session.change({"vehicles.uav1.goal": goal, "no_fly[0].radius_m": 60.0 + k % 7})
            if k % MEMORY_PLANS == 0:
                with suppress(GcsplanError):
                    session.plan()

    change(3 * MEMORY_PLANS)
    gc.collect()
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    change(changes)
    gc.collect()
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return {"changes": changes, "grown_bytes": grown}
