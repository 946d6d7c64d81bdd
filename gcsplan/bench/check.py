"""Legs per second of the exact check, on one core, over the sample DEM."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from gcsplan.arrays import Indices
from gcsplan.bench.sample import SAMPLE_HALF_M, SAMPLE_MIDDLE_DEG, sample_spec
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.terrain.terrain import load_terrain

LEG_M = 1000.0
AGL_M = (70.0, 200.0)  # range of the random heights of both ends of a leg
LIMITS = Limits(
    min_agl_m=60.0,
    horizontal_clearance_m=30.0,
    track_error_m=3.0,
    altitude_error_m=5.0,
    max_climb_deg=15.0,
    max_descent_deg=15.0,
)


def run(legs: int = 200_000, seed: int = 1, repeats: int = 5) -> dict[str, Any]:
    """Judge ``legs`` random one-kilometre legs ``repeats`` times; medians, in legs per second.

    Each leg is judged for min AGL, terrain clearance, climb angle and a dozen zones, with track and altitude error.
    ``clear`` answers yes or no, ``examine`` finds every number and every violation; ``examine_legal`` is ``examine`` on
    the legs that are clear. ``first_call_s`` is the time of the first call, with compilation if numba's cache is cold.
    """
    if legs < 1 or repeats < 1:
        raise ValueError(f"legs and repeats must be 1 or more, given {legs} and {repeats}")
    airspace, some = scene(legs, seed)
    began = time.perf_counter()
    airspace.clear(_part(some, np.arange(min(legs, 2))), LIMITS)
    first_call_s = time.perf_counter() - began
    legal = airspace.clear(some, LIMITS)
    kept = _part(some, np.nonzero(legal)[0])
    return {
        "legs": legs,
        "leg_m": LEG_M,
        "seed": seed,
        "repeats": repeats,
        "dem_cells": [int(n) for n in airspace.surface.ground_m.shape],
        "zones": len(airspace.zones),
        "legal_share": float(legal.mean()),
        "clear_legs_per_s": legs / _median_s(lambda: airspace.clear(some, LIMITS), repeats),
        "examine_legs_per_s": legs / _median_s(lambda: airspace.examine(some, LIMITS), repeats),
        "examine_legal_legs_per_s": len(kept) / _median_s(lambda: airspace.examine(kept, LIMITS), repeats),
        "first_call_s": first_call_s,
    }


def scene(legs: int, seed: int) -> tuple[Airspace, Legs]:
    """The sample DEM with a dozen zones, and random one-kilometre legs over it, made from a seed."""
    frame = Frame(*SAMPLE_MIDDLE_DEG)
    box = (-SAMPLE_HALF_M[0] - LEG_M, -SAMPLE_HALF_M[1] - LEG_M, SAMPLE_HALF_M[0] + LEG_M, SAMPLE_HALF_M[1] + LEG_M)
    surface = load_terrain(sample_spec(), frame, box, where="the benchmark's terrain")
    rng = np.random.default_rng(seed)
    airspace = Airspace(surface, _zones(rng), scale=frame.scale_at(float(np.hypot(*SAMPLE_HALF_M)) + LEG_M))
    return airspace, _legs(rng, surface, legs)


def report(result: dict[str, Any]) -> str:
    """The figures of `run` in words."""
    rows, cols = result["dem_cells"]
    return (
        f"{result['legs']:,} random legs of {result['leg_m']:g} m over the sample DEM ({rows} × {cols} nodes) and "
        f"{result['zones']} zones,\nheld to min AGL {LIMITS.min_agl_m:g} m, clearance "
        f"{LIMITS.horizontal_clearance_m:g} m, track error {LIMITS.track_error_m:g} m, altitude error "
        f"{LIMITS.altitude_error_m:g} m; {100 * result['legal_share']:.0f} % are legal.\n"
        f"  yes or no          {result['clear_legs_per_s']:12,.0f} legs/s\n"
        f"  all numbers        {result['examine_legs_per_s']:12,.0f} legs/s\n"
        f"  all, legal legs    {result['examine_legal_legs_per_s']:12,.0f} legs/s\n"
        f"One core, median of {result['repeats']}; the first call took {result['first_call_s']:.2f} s."
    )


def _median_s(work: Callable[[], object], repeats: int) -> float:
    """Median duration of ``work`` over ``repeats``, after one run that does not count."""
    work()
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        took.append(time.perf_counter() - began)
    return statistics.median(took)


def _zones(rng: np.random.Generator) -> list[Zone]:
    """Twelve zones: cylinders and prisms, some from the ground up, some with a floor."""
    levels = [
        (None, None),
        (None, Level(100.0, "agl")),
        (Level(0.0, "agl"), Level(300.0, "agl")),
        (Level(500.0, "amsl"), Level(900.0, "amsl")),
    ]
    out = []
    for k in range(12):
        east, north = rng.uniform(-1.0, 1.0, 2) * SAMPLE_HALF_M
        turn, radius = np.sort(rng.uniform(0.0, 2.0 * np.pi, 8)), rng.uniform(300.0, 900.0, 8)
        corners = np.stack([east + radius * np.cos(turn), north + radius * np.sin(turn)], axis=-1)
        shape = Polygon(corners) if k % 3 == 2 else Circle(float(east), float(north), float(radius[0]))
        out.append(Zone(f"zone {k + 1}", shape, *levels[k % 4]))
    return out


def _legs(rng: np.random.Generator, surface: Surface, count: int) -> Legs:
    """Legs at random places and in random directions, with both ends at random heights above their own ground."""
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    a = rng.uniform(-1.0, 1.0, (count, 2)) * SAMPLE_HALF_M
    b = a + LEG_M * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    heights = [surface.top_at(p[:, 0], p[:, 1]) + rng.uniform(*AGL_M, count) for p in (a, b)]
    return Legs(
        np.column_stack([a, heights[0]]),
        np.column_stack([b, heights[1]]),
        np.zeros(count, np.bool_),
        np.full(count, LIMITS.track_error_m),
        np.full(count, LIMITS.altitude_error_m),
    )


def _part(legs: Legs, which: Indices) -> Legs:
    return Legs(
        legs.start[which], legs.end[which], legs.column[which], legs.track_error_m[which], legs.altitude_error_m[which]
    )
