"""Missions below a ceiling above ground, as most laws of the air demand: a hundred for each seed.

A half is flown over the sample DEM, a half over made terrain of 30 m posts: a sum of noise of halving size. Of each
four missions, one has wings (a turn radius, and climb limits that wings have), and every fifth is planned for energy.
Floors are 30 to 60 m, ceilings 90 to 150 m above ground, climb limits 8 to 25 degrees, 0 to 40 zones, and the errors
are usual ones.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from gcsplan.arrays import Floats
from gcsplan.bench.terrain.pairs import FloorCells, TerrainPair, draw_joined_zones, place, problem_of
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import NO_SIDES, GridMap, Surface

CEILING_MISSIONS = 100
DISTANCE_M = (2_000.0, 25_000.0)
FLOOR_M, CEILING_M = (30.0, 60.0), (90.0, 150.0)
CLIMB_DEG, WING_CLIMB_DEG = (10.0, 25.0), (8.0, 12.0)
WING_TURN_M = (60.0, 150.0)
ZONE_COUNTS = (0, 3, 10, 20, 40)
USUAL_ERRORS = {"horizontal_clearance_m": 20.0, "track_error_m": 3.0, "altitude_error_m": 5.0}
POST_M, BESIDE = 30.0, 0.4
"""Metres between the posts of made terrain, and how far it reaches beyond the ends, in parts of their distance."""
WAVE_M, STEEPNESS = (4_000.0, 9_000.0), (0.02, 0.1)
"""Longest wave of made terrain; and its height as a part of that."""
ROUGHNESS = (0.35, 0.6)
"""Height of a wave of half the length, as a part."""


def mission(seed: int, number: int) -> tuple[str, Problem, tuple[int, int]]:
    """Mission ``number`` of a seed: its group, its problem, and how many pairs and sets of zones were drawn before."""
    rng = np.random.default_rng([seed, number, 4])
    wing, energy, over_sample = number % 4 == 3, number % 5 == 2, number % 2 == 0
    zones = int(ZONE_COUNTS[number % len(ZONE_COUNTS)]) if number % 3 else 0
    steepest = round(float(rng.uniform(*(WING_CLIMB_DEG if wing else CLIMB_DEG))), 1)
    limits = Limits(
        min_agl_m=float(round(rng.uniform(*FLOOR_M))),
        max_agl_m=float(round(rng.uniform(*CEILING_M))),
        max_climb_deg=steepest,
        max_descent_deg=steepest,
        **USUAL_ERRORS,
    )
    radius_m = float(round(rng.uniform(*WING_TURN_M))) if wing else 0.0
    pair, redraws = _pair(rng, number, limits, zones, over_sample=over_sample)
    problem = problem_of(pair, Airspace(pair.surface, pair.zones, scale=pair.scale), limits)
    problem = replace(problem, objective="energy" if energy else "length", turn_radius_m=radius_m)
    group = f"{'wing' if wing else 'copter'}, {problem.objective}"
    return group, problem, redraws


def _pair(
    rng: np.random.Generator, number: int, limits: Limits, zones: int, *, over_sample: bool
) -> tuple[TerrainPair, tuple[int, int]]:
    """A pair whose ends are joined past the zones of unlimited height."""
    pairs = sets = 0
    way_m = float(rng.uniform(*DISTANCE_M))
    while True:
        pair = place(rng, number, way_m, limits.max_climb_deg) if over_sample else _made(rng, number, way_m, limits)
        cells = FloorCells.of(Airspace(pair.surface, scale=pair.scale), limits)
        found, tried = draw_joined_zones(rng, pair, cells, np.isfinite(cells.floor_m), limits, zones)
        sets += tried
        if found is not None:
            return replace(pair, zones=found), (pairs, sets)
        pairs += 1


def _made(rng: np.random.Generator, number: int, way_m: float, limits: Limits) -> TerrainPair:
    """A pair over made terrain."""
    beside_m = BESIDE * way_m + 1_000.0
    turn = rng.uniform(0.0, 2.0 * math.pi)
    half = 0.5 * way_m * np.array([math.cos(turn), math.sin(turn)])
    start, goal = (tuple(np.round(side * half, 2).tolist()) for side in (-1.0, 1.0))
    reach = np.abs(half) + beside_m
    cols, rows = (math.ceil(2.0 * r / POST_M) + 1 for r in reach)
    ground = np.round(_noise(rng, rows, cols), 2)
    grid = GridMap.affine(-float(reach[0]), float(reach[1]), POST_M, POST_M)
    surface = Surface(ground, ground, grid, {"resolution_m": POST_M}, goes_on=NO_SIDES)
    return TerrainPair(
        number, Frame(0.0, 0.0), start, goal, surface, 1.0, None, limits.max_climb_deg, (), (0, 0)
    )  # fmt: skip


def _noise(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    """(rows, cols) heights: noise of `WAVE_M`, and of halves of it down to two posts, each smoothly interpolated."""
    wave_m, steepness, rough = (float(rng.uniform(*x)) for x in (WAVE_M, STEEPNESS, ROUGHNESS))
    height_m = wave_m * steepness
    ground = np.full((rows, cols), 200.0)
    while wave_m >= 2.0 * POST_M:
        fine = rng.standard_normal([math.ceil(n * POST_M / wave_m) + 4 for n in (rows, cols)])
        for axis, count in enumerate((rows, cols)):
            spline = make_interp_spline(np.arange(fine.shape[axis]), fine, axis=axis)
            fine = spline(np.arange(count) * (POST_M / wave_m) + 1.0)
        ground += 0.5 * height_m * fine
        wave_m, height_m = 0.5 * wave_m, rough * height_m
    return ground
