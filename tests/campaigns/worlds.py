"""Missions whose best path leaves the first window of the terrain: long ridges, walls of zones, edges of DEMs, tiles.

``python -m tests.campaigns.worlds --seconds 600 --seed 0`` plans one random mission after the other, prints each on
which something is wrong, and ends with figures by family. Faults are: a proof of infeasibility although a path is
known, a bound above the cost of a known path, and an illegal path. Known paths are found without the planner: over
rasters by Dijkstra's algorithm on the nodes of the whole DEM, pulled taut; on flat ground by a visibility graph.
"""

from __future__ import annotations

import argparse
import heapq
import math
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import rasterio
import yaml
from pyproj import Transformer
from scipy.ndimage import binary_erosion, gaussian_filter, maximum_filter

from gcsplan.app.fleet.pipeline import world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.arrays import Bools, Floats
from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.errors import NoMission
from gcsplan.mission_file import load_mission
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Progress, Solution
from gcsplan.world.geodesy.frame import Frame, centre_of
from gcsplan.world.geometry.path import Path as Track
from tests.campaigns import sizes

CAP_M, HIGH_M, LOW_M = 300.0, 600.0, 100.0
"""AMSL (m) of the ceiling, of the ridges, and of the ground beside them."""
WEST_M, NORTH_M = 600_000.0, 4_060_000.0
"""The DEMs' north-western node, in UTM zone 16."""
MOST_BYTES = 6 * 2**30
STEP_M = 5.0
"""Step along a path at which the ground below it is looked up."""
TO_UTM = Transformer.from_crs("EPSG:4326", "EPSG:32616", always_xy=True)


@dataclass(eq=False)
class Case:
    """A mission file's document, the cost of a known path (inf: none), and a check that names a path's fault."""

    document: dict[str, object]
    known: Callable[[Problem], float]
    illegal: Callable[[Problem, Floats], str]


@dataclass(eq=False)
class Outcome:
    """The result of one mission; ``wrong``: its faults."""

    family: str
    seed: int
    status: str
    wrong: list[str] = field(default_factory=list)
    cost: float = math.nan
    bound: float = math.nan
    known: float = math.inf
    windows: int = 1
    took_s: float = 0.0
    objective: str = "length"

    def __str__(self) -> str:
        return (
            f"{self.family} {self.seed}: {'; '.join(self.wrong) or 'holds'} ({self.status}, path {self.cost:.1f}, "
            f"bound {self.bound:.1f}, known {self.known:.1f}, {self.objective}, {self.windows} windows, "
            f"{self.took_s:.1f} s)"
        )


# -- rasters ---------------------------------------------------------------------------------------------------------


def ridge(rng: np.random.Generator, folder: Path) -> Case:
    """A ridge above the ceiling across the whole DEM, with a gap far away or none, and spurs."""
    return _over_raster(rng, folder, _ridge(rng), tiles=1)


def tiles(rng: np.random.Generator, folder: Path) -> Case:
    """A ridge over four tiles, of which one may be missing."""
    return _over_raster(rng, folder, _ridge(rng), tiles=2)


def edge(rng: np.random.Generator, folder: Path) -> Case:
    """A ridge with start and goal near the DEM's edge, and the gap towards its far side."""
    return _over_raster(rng, folder, _ridge(rng, at=float(rng.uniform(0.06, 0.12))), tiles=1)


def _ridge(rng: np.random.Generator, at: float | None = None) -> tuple[Floats, float, Floats, Floats]:
    """Heights (n, n), size of a cell (m), and start and goal as (column, row)."""
    n, cell_m = int(rng.integers(240, 340)), float(rng.uniform(80.0, 120.0))
    ground = LOW_M + 25.0 * gaussian_filter(rng.standard_normal((n, n)), 12.0) * 12.0
    ground = np.clip(ground, LOW_M - 40.0, LOW_M + 60.0)
    row, col = np.mgrid[:n, :n].astype(float)
    bend, wave = float(rng.uniform(0.0, 0.05)) * n, float(rng.uniform(0.5, 2.0))
    line = 0.5 * n + bend * np.sin(wave * 2.0 * math.pi * col / n) + float(rng.uniform(-0.1, 0.1)) * n
    wall = np.abs(row - line) <= float(rng.uniform(2.0, 5.0))
    middle = (float(rng.uniform(0.3, 0.7)) if at is None else at) * n
    kind = int(rng.integers(4))
    if kind:  # else no gap at all
        side = 1.0 if middle < 0.5 * n else -1.0
        far = float(rng.uniform(0.3, 0.55)) * n
        gap = middle + side * far if kind < 3 else (1.0 + side) * 0.5 * (n - 1)
        wall &= np.abs(col - gap) > float(rng.uniform(4.0, 10.0))
    for _ in range(int(rng.integers(3))):  # spurs across the track
        c = float(rng.uniform(0.0, n))
        wall |= (np.abs(col - c) < 3.0) & (np.abs(row - line) < float(rng.uniform(0.1, 0.3)) * n)
    ground[wall] = HIGH_M
    here = line[0, round(middle)]
    away = float(rng.uniform(900.0, 3000.0)) / cell_m
    start = np.array([middle + float(rng.uniform(-8.0, 8.0)), here - away - 6.0])
    goal = np.array([middle + float(rng.uniform(-8.0, 8.0)), here + away + 6.0])
    if rng.random() < 0.5:
        ground, start, goal = ground.T.copy(), start[::-1].copy(), goal[::-1].copy()
    for c, r in (start, goal):  # level and open
        ground[round(r) - 2 : round(r) + 3, round(c) - 2 : round(c) + 3] = LOW_M
    return ground, cell_m, start, goal


def _over_raster(
    rng: np.random.Generator, folder: Path, world: tuple[Floats, float, Floats, Floats], tiles: int
) -> Case:
    ground, cell_m, start, goal = world
    n = len(ground)
    cuts = [0, n] if tiles == 1 else [0, int(rng.integers(n // 3, 2 * n // 3)), n]
    pieces = [(slice(a, b), slice(c, d)) for a, b in pairwise(cuts)
              for c, d in pairwise(cuts)]  # fmt: skip
    if tiles > 1 and rng.random() < 0.5:
        held = [p for p in pieces if any(_in(p, x) for x in (start, goal))]
        spare = [p for p in pieces if p not in held]
        if spare:
            lost = spare[int(rng.integers(len(spare)))]
            pieces.remove(lost)
            ground[lost] = np.nan
    names = []
    for k, (rows, cols) in enumerate(pieces):
        part = ground[rows, cols]
        west, north = WEST_M + (cols.start - 0.5) * cell_m, NORTH_M - (rows.start - 0.5) * cell_m
        corner = rasterio.Affine(cell_m, 0.0, west, 0.0, -cell_m, north)
        names.append(f"tile{k}.tif")
        with rasterio.open(
            folder / names[-1], "w", driver="GTiff", width=part.shape[1], height=part.shape[0], count=1,
            dtype="float64", crs="EPSG:32616", transform=corner, nodata=-32768.0,
        ) as file:  # fmt: skip
            file.write(np.where(np.isnan(part), -32768.0, part), 1)
    margins = {} if rng.random() < 0.5 else {"horizontal_clearance_m": 0, "track_error_m": 0, "altitude_error_m": 0}
    document = _document({"dem": names, "vertical_datum": "EGM96"}, {"max_amsl_m": CAP_M, **margins},
                         [_degrees(x, cell_m) for x in (start, goal)])  # fmt: skip

    def known(problem: Problem) -> float:
        track = _around(ground, cell_m, start, goal)
        return math.inf if track is None else _flown(problem, ground, cell_m, track, frame_of(document))

    def illegal(problem: Problem, points: Floats) -> str:
        return _below_ground(ground, cell_m, points, frame_of(document))

    return Case(document, known, illegal)


def _in(piece: tuple[slice, slice], at: Floats) -> bool:
    rows, cols = piece
    return bool(cols.start - 9 <= at[0] < cols.stop + 9 and rows.start - 9 <= at[1] < rows.stop + 9)


def _degrees(at: Floats, cell_m: float) -> list[float]:
    lon, lat = TO_UTM.transform(WEST_M + at[0] * cell_m, NORTH_M - at[1] * cell_m, direction="INVERSE")
    return [round(float(lat), 7), round(float(lon), 7)]


def _document(terrain: dict[str, object], limits: dict[str, object], ends: list[list[float]]) -> dict[str, object]:
    return {
        "version": 1,
        "terrain": terrain,
        "limits": {"min_agl_m": 60, **limits},
        "vehicles": [
            {"name": "u", "sysid": 1, "autopilot": "arducopter", "start": ends[0], "goal": ends[1], "end": "land",
             "speed_m_s": [3, 15]},
        ],
    }  # fmt: skip


def frame_of(document: dict[str, object]) -> Frame:
    vehicle = document["vehicles"][0]  # type: ignore[index]
    return Frame(*centre_of(*zip(vehicle["start"], vehicle["goal"], strict=True)))


def _around(ground: Floats, cell_m: float, start: Floats, goal: Floats) -> Floats | None:
    """Rows and columns (N, 2) of a taut track over open nodes; None if there is none.

    No node within a cell of it is unknown or higher than 200 m.
    """
    free = binary_erosion(np.nan_to_num(ground, nan=HIGH_M) < LOW_M + 100.0, np.ones((3, 3)), border_value=0)
    ends = [tuple(round(float(v)) for v in x[::-1]) for x in (start, goal)]
    track = _dijkstra(free, ends[0], ends[1])
    if track is None:
        return None
    for parts in (1, 3, 5, 7):  # each step length gives other points to pull the track between
        finer = [a + (b - a) * t for a, b in pairwise(track) for t in np.linspace(0, 1, _pieces(a, b, parts))[:-1]]
        track = _pulled(free, np.array([*finer, track[-1]]))
    return np.array([start[::-1], *track[1:-1], goal[::-1]])


def _pieces(a: Floats, b: Floats, parts: int) -> int:
    return max(2, math.ceil(math.dist(a, b) / parts) + 1)


def _pulled(free: Bools, track: Floats) -> Floats:
    """The track with fewer points: each still sees the next one."""
    kept = [0]
    while kept[-1] < len(track) - 1:
        at = kept[-1]
        step = len(track) - 1 - at
        while step > 1 and not _sees(free, track[at], track[at + step]):
            step = min(step - 1, (step * 9) // 10)
        kept.append(at + max(step, 1))
    return np.asarray(track[kept])


def _flown(problem: Problem, ground: Floats, cell_m: float, track: Floats, frame: Frame) -> float:
    """The cost of flying a track at the upper convex hull of the lowest legal altitudes along it."""
    high = maximum_filter(np.nan_to_num(ground, nan=LOW_M), 5)
    parts = [a + (b - a) * np.linspace(0, 1, _pieces(a, b, 1))[:-1, None] for a, b in pairwise(track)]
    at = np.vstack([*parts, track[-1:]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))]) * cell_m
    floor = high[tuple(np.rint(at).astype(int).T)] + 60.0 + 6.0
    floor[0], floor[-1] = problem.start[2], problem.goal[2]
    hull: list[int] = []
    for k in range(len(at)):
        while len(hull) > 1 and (floor[hull[-1]] - floor[hull[-2]]) * (along[k] - along[hull[-2]]) <= (
            floor[k] - floor[hull[-2]]
        ) * (along[hull[-1]] - along[hull[-2]]):
            hull.pop()
        hull.append(k)
    lat, lon = np.array([_degrees(x[::-1], cell_m) for x in at]).T
    places = frame.to_plane(lat, lon)
    return problem.cost(Track(np.column_stack([places, np.interp(along, along[hull], floor[hull])])))


def _dijkstra(free: Bools, start: tuple[int, int], goal: tuple[int, int]) -> Floats | None:
    """Rows and columns (N, 2) of the shortest track by steps to the eight neighbours; None if there is none."""
    if not (free[start] and free[goal]):
        return None
    cost, parent = np.full(free.shape, math.inf), {}
    cost[start] = 0.0
    queue = [(0.0, start)]
    steps = [(i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    while queue:
        so_far, (r, c) = heapq.heappop(queue)
        if (r, c) == goal:
            out = [goal]
            while out[-1] != start:
                out.append(parent[out[-1]])
            return np.array(out[::-1], float)
        if so_far > cost[r, c]:
            continue
        for i, j, length in steps:
            at = r + i, c + j
            inside = 0 <= at[0] < free.shape[0] and 0 <= at[1] < free.shape[1] and free[at]
            if inside and so_far + length < cost[at] - 1e-12:
                cost[at], parent[at] = so_far + length, (r, c)
                heapq.heappush(queue, (so_far + length, at))
    return None


def _sees(free: Bools, a: Floats, b: Floats) -> bool:
    """Whether all nodes around the line from ``a`` to ``b`` are free."""
    t = np.linspace(0.0, 1.0, max(2, int(4.0 * math.dist(a, b))))[:, None]
    at = a + t * (b - a)
    r, c = np.floor(at).astype(int).T
    last = np.array(free.shape) - 1
    return all(bool(free[np.minimum(r + i, last[0]), np.minimum(c + j, last[1])].all()) for i in (0, 1) for j in (0, 1))


def _below_ground(ground: Floats, cell_m: float, points: Floats, frame: Frame) -> str:
    """The fault of a path in min AGL or ceiling, sampled every 5 m over the whole DEM; empty if there is none."""
    for a, b in pairwise(points):
        t = np.linspace(0.0, 1.0, max(2, math.ceil(math.dist(a, b) / STEP_M)))[:, None]
        at = a + t * (b - a)
        lat, lon = frame.to_degrees(at[:, 0], at[:, 1]).T
        x, y = TO_UTM.transform(lon, lat)
        c, r = (x - WEST_M) / cell_m, (NORTH_M - y) / cell_m
        i, j = np.floor(c).astype(int), np.floor(r).astype(int)
        if min(i.min(), j.min()) < 0 or max(i.max(), j.max()) >= len(ground) - 1:
            return "the path leaves the DEM"
        u, v = c - i, r - j
        z = (1 - v) * ((1 - u) * ground[j, i] + u * ground[j, i + 1])
        z += v * ((1 - u) * ground[j + 1, i] + u * ground[j + 1, i + 1])
        low = float((at[:, 2] - z).min())
        if not low >= 60.0 - 0.1:
            return f"the path comes to {low:.1f} m above ground"
        if at[:, 2].max() > CAP_M + 0.01:
            return f"the path rises to {at[:, 2].max():.1f} m"
    return ""


# -- flat ground -----------------------------------------------------------------------------------------------------


def flat(rng: np.random.Generator, folder: Path) -> Case:
    """A wall of zones between start and goal, longer than the first window, straight or with a hook at its end."""
    off_m, half_m = float(rng.uniform(400.0, 1500.0)), float(rng.uniform(3000.0, 14_000.0))
    shift, thick = float(rng.uniform(-0.7, 0.7)) * half_m, float(rng.uniform(40.0, 200.0))
    walls = [(shift - half_m, -thick, shift + half_m, thick)]
    if rng.random() < 0.5:  # a hook at the end
        side, east = float(rng.choice([-1.0, 1.0])), shift + half_m
        deep = float(rng.uniform(1500.0, 5000.0)) * side
        walls.append((east - 2.0 * thick, min(0.0, deep), east, max(0.0, deep)))
    frame = Frame(36.6, -84.3)
    here = [[float(v) for v in frame.to_degrees(0.0, north)] for north in (-off_m, off_m)]
    zones = []
    for k, (west, south, east, north) in enumerate(walls):
        ring = [frame.to_degrees(e, n) for e, n in ((west, south), (east, south), (east, north), (west, north))]
        zones.append({"name": f"wall {k}", "polygon": [[float(v) for v in p] for p in ring]})
    document = {**_document({"flat_m": 0}, {}, here), "no_fly": zones}

    def known(problem: Problem) -> float:
        air, limits = problem.airspace, problem.limits
        plane = VisibilityGraph.of(air.zones, limits.horizontal_clearance_m + limits.track_error_m, air.scale)
        try:
            track = plane.shortest([problem.start[:2], problem.goal[:2]])
        except EnclosedPlace:
            return math.inf
        track *= 1.0 + 2e-4  # chords lie inside their arcs
        rise = abs(problem.goal[2] - problem.start[2])
        if problem.objective == "energy":
            return problem.horizontal_j_per_m * track + problem.vertical_j_per_m * rise
        return math.hypot(track, rise)

    return Case(document, known, lambda problem, points: "")


FAMILIES: dict[str, Callable[[np.random.Generator, Path], Case]] = {
    "ridge": ridge, "tiles": tiles, "edge": edge, "flat": flat,
}  # fmt: skip


# -- judging ---------------------------------------------------------------------------------------------------------


def judge(
    family: str,
    seed: int,
    planner: Callable[[Problem], Solution] = plan,
    **changes: float,
) -> Outcome:
    """Plan one mission and compare the result with the known path; ``changes`` replace fields of the problem."""
    rng = np.random.default_rng([seed, *family.encode()])
    with tempfile.TemporaryDirectory() as name:
        case = FAMILIES[family](rng, Path(name))
        file = Path(name, "mission.yaml")
        file.write_text(yaml.safe_dump(case.document), encoding="utf-8")
        source = load_mission(file)
        objective = "energy" if rng.random() < 0.2 else "length"
        reports: list[Progress] = []
        problem = make_problem(source, source.vehicles[0], world_of(source), objective, 1, progress=reports.append)[0]
        windows: list[float] = []
        problem = replace(_counting(problem, windows), **changes)  # type: ignore[arg-type]
        out = Outcome(family, seed, "solved", known=case.known(problem), objective=objective)
        begun = time.perf_counter()
        try:
            found = planner(problem)
        except NoMission as refusal:
            out.took_s, out.windows = time.perf_counter() - begun, 1 + len(windows)
            out.status = refusal.reason
            proved = refusal.reason == "infeasible" or "proved" in refusal.message
            if proved and math.isfinite(out.known):
                out.wrong.append(f"called infeasible, but a path of {out.known:.0f} m is known")
            return out
        except MemoryError:
            out.status = "memory"
            return out
        out.took_s, out.windows = time.perf_counter() - begun, 1 + len(windows)
        answered = found.problem or problem
        out.cost = answered.cost(found.path)
        bounds = [found.lower_bound, *(p.lower_bound for p in reports)]
        out.bound = max(b for b in bounds if b is not None)
        if out.bound > min(out.cost, out.known) * (1.0 + 1e-8):
            out.wrong.append("the bound lies over a path that is known")
        out.wrong += [words for words in [case.illegal(answered, found.path.points)] if words]
        return out


def _counting(problem: Problem, windows: list[float]) -> Problem:
    """The same problem, which appends the margin (m) of each larger terrain window to ``windows``."""

    def counted(of: Problem) -> Problem:
        inner = of.widen

        def widen(margin_m: float, mb: float) -> Problem | None:
            wide = None if inner is None else inner(margin_m, mb)
            if wide is None:
                return None
            windows.append(margin_m)
            return counted(wide)

        return replace(of, widen=widen)

    return counted(problem)


def summary(outcomes: list[Outcome]) -> str:
    """Figures by family."""
    lines = [
        f"{'family':8}{'worlds':>8}{'solved':>8}{'proved':>8}{'lost':>6}{'wider':>7}{'wrong':>7}  gap % p50 p90 max"
    ]
    for family in dict.fromkeys(o.family for o in outcomes):
        of = [o for o in outcomes if o.family == family]
        status = Counter(o.status for o in of)
        lost = sum(o.status != "solved" and math.isfinite(o.known) for o in of)
        gaps = [100.0 * (o.cost / o.bound - 1.0) for o in of if o.status == "solved"] or [math.nan]
        p50, p90 = np.quantile(gaps, (0.5, 0.9)).tolist()
        lines.append(
            f"{family:8}{len(of):8}{status['solved']:8}{status['infeasible']:8}{lost:6}"
            f"{sum(o.windows > 1 for o in of):7}{sum(bool(o.wrong) for o in of):7}  {p50:.3f} {p90:.3f} {max(gaps):.3f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--inputs", type=int, default=10**9, help="at most this many inputs, with --sizes")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--all", action="store_true", help="print every mission")
    parser.add_argument("--sizes", action="store_true", help="large worlds instead (tests.campaigns.sizes)")
    given = parser.parse_args()
    if given.sizes:
        raise SystemExit(sizes.campaign(sizes.WORLDS, given.seconds, given.seed, given.inputs))
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    outcomes: list[Outcome] = []
    begun, seed = time.monotonic(), given.seed
    while time.monotonic() - begun < given.seconds:
        for family in given.families:
            outcomes.append(judge(family, seed))
            if outcomes[-1].wrong or given.all:
                print(outcomes[-1], flush=True)
        seed += 1
    print(summary(outcomes))
    if any(o.wrong for o in outcomes):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
