"""Planned fleets whose conflicts are resolved to just the requested separation: sampled, and flown in simulated time.

Two or three vehicles cross flat ground or hills, with or without zones in the middle, in sequence or together, waiting
on the ground, at gates in the air or not at all, each early or late within its window. Planned motions are sampled
every 10 ms, each pair shifted in time by up to both windows; the stored missions are also flown by the simulated
autopilots with departures up to a window early or late. The planner resolves a conflict to exactly the limit, so this
family needs no bisection.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import parts_of, terms_of
from gcsplan.errors import NoMission
from gcsplan.mission_file import load_mission
from gcsplan.sim.rehearsal import rehearse

STEP_S = 0.01
SHIFTS = 9


def fleet_at_limit(rng: np.random.Generator) -> tuple[float, str] | None:
    """By how much (m) a random planned fleet falls below its separation, and how it was found; None if no plan exists.

    Negative if the separation is kept.
    """
    mission, separation_m = _drawn_fleet(rng), float(rng.uniform(5.0, 60.0))
    text = yaml.safe_dump(mission | {"arrival": mission["arrival"] | {"separation_m": separation_m}})
    try:
        done = plan(load_mission("fleet.yaml", text=text))
    except NoMission:
        return None
    window_s = float(mission["arrival"]["window_s"])
    sampled = separation_m - _nearest_m(done, window_s)
    flown = _flown_short_m(done, window_s, separation_m, rng)
    return max((sampled, "separation, sampled"), (flown, "separation, flown"))


def _drawn_fleet(rng: np.random.Generator) -> dict[str, Any]:
    count = int(rng.integers(2, 4))
    angles = rng.uniform(0.0, 2.0 * np.pi) + np.arange(count) * rng.uniform(0.5, 1.5)
    vehicles = []
    for k, a in enumerate(angles):
        out = 500.0 * np.array([math.cos(a), math.sin(a)])
        aside = rng.uniform(-80.0, 80.0, 2)
        vehicles.append(
            {
                "name": f"uav{k + 1}", "sysid": k + 1, "autopilot": str(rng.choice(["arducopter", "px4"])),
                "speed_m_s": [3, float(rng.uniform(6.0, 14.0))], "end": str(rng.choice(["land", "loiter"])),
                "start": {"east_m": float(out[0]), "north_m": float(out[1])},
                "goal": {"east_m": float(aside[0] - out[0]), "north_m": float(aside[1] - out[1])},
                "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5,
            }
        )  # fmt: skip
    arrival: dict[str, Any] = {
        "mode": str(rng.choice(["sequence", "together"])), "order": [v["name"] for v in vehicles],
        "hold": str(rng.choice(["ground", "gate", "none"])), "window_s": float(rng.choice([0.0, 0.5, 2.0])),
    }  # fmt: skip
    if arrival["mode"] == "sequence":
        arrival["interval_s"] = float(rng.uniform(0.0, 25.0))
    mission: dict[str, Any] = {
        "version": 1, "name": "fleet", "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": _ground(rng),
        "limits": {"min_agl_m": 40, "max_climb_deg": 30}, "vehicles": vehicles, "arrival": arrival,
    }  # fmt: skip
    if rng.random() < 0.4:
        mission["no_fly"] = [
            {"center": {"east_m": float(x), "north_m": float(y)}, "radius_m": float(r)}
            for x, y, r in zip(*rng.uniform(-150.0, 150.0, (2, 2)), rng.uniform(20.0, 90.0, 2), strict=True)
        ]
    return mission


def _ground(rng: np.random.Generator) -> dict[str, Any]:
    """Terrain keys: flat, or hills that paths climb over, which changes speeds along the track and so the times."""
    if rng.random() < 0.4:
        return {"flat_m": 0}
    return {
        "peaks": [
            {
                "center": [float(x), float(y)], "height_m": float(height_m),
                "decay_m": [float(d) for d in rng.uniform(120.0, 400.0, 2)],
            }
            for x, y, height_m in zip(*rng.uniform(-600.0, 600.0, (2, 4)), rng.uniform(10.0, 90.0, 4), strict=True)
        ]
    }  # fmt: skip


def _nearest_m(done: Plan, window_s: float) -> float:
    """The least distance (m) of any two vehicles in the air, each up to the window early or late."""
    assert done.fleet is not None
    least = math.inf
    for a, b in combinations(done.fleet.motions, 2):
        for shift in np.linspace(-2.0 * window_s, 2.0 * window_s, SHIFTS if window_s else 1):
            first, last = max(a.begin_s, b.begin_s + shift), min(a.end_s, b.end_s + shift)
            t = np.arange(first, last, STEP_S)
            if len(t):
                least = min(least, float(np.linalg.norm(a.at(t) - b.at(t - shift), axis=1).min()))
    return least


def _flown_short_m(done: Plan, window_s: float, separation_m: float, rng: np.random.Generator) -> float:
    """By how much (m) the simulated flight falls below the separation."""
    early = float(min(p.depart_s for p in parts_of(done)))
    parts = [
        replace(p, depart_s=p.depart_s + (float(rng.choice([-1.0, 1.0])) * window_s if early >= window_s else 0.0))
        for p in parts_of(done)
    ]
    result = rehearse(parts, done.world, terms_of(done))
    apart = [b for b in result.breaches if b.kind == "separation"]
    if not apart:
        return -math.inf if result.closest is None else separation_m - result.closest.distance_m
    return max(b.by for b in apart)
