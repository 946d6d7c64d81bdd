"""The missions of ``gcsplan bench everyday``: typical missions of a working day, drawn from a seed.

Each mission is a mission file (a mapping, as read from YAML), on flat ground unless stated otherwise. Kinds:

- ``leg``: nothing in the way, 30 m to 8 km; ``tiny``: 20 to 150 m, with up to two small zones;
- ``wall``: one long thin zone across the line; ``detour``: a wall two to four times as long as the straight line;
- ``hook``, ``comb``, ``ring``: an L or U around the start or goal, walls with gaps on alternate sides, a C around the
  goal (or the start) with an opening in any direction;
- ``discs``, ``blocks``: 1 to 300 circles or polygons; ``vias``: one to four points to pass among circles;
- ``levels``: circles and polygons with floors and ceilings above ground;
- ``peaks``, ``sample``: zones among Gaussian hills, and over the sample DEM.

Half of the missions have the default clearance and errors, half have none. A mission is drawn again only if its start,
goal or a via lies in a zone. This module uses no planner.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from gcsplan.arrays import Floats
from gcsplan.bench.sample import ROUND_DEGREE_M, SAMPLE_TERRAIN

MissionDocument = dict[str, Any]

EVERYDAY_KINDS = (
    "leg", "tiny", "wall", "detour", "hook", "comb", "ring", "discs", "blocks", "vias", "levels", "peaks", "sample",
)  # fmt: skip
SHORTEST_WAY_M, LONGEST_WAY_M = 400.0, 8000.0
CLEARANCE_M, TRACK_ERROR_M, ALTITUDE_ERROR_M = 30.0, 3.0, 5.0
"""Defaults of a mission file, m."""
PLACE_SPARE_M = 2.0
"""Metres that places keep from zones beyond the margins, for a plan's own margins for rounding."""
FLAT_MIN_AGL_M = 30.0
SAMPLE_MIN_AGL_M = 60.0
MISSION_DRAWS = 1000


@dataclass(frozen=True, eq=False, slots=True)
class Everyday:
    """One mission: name (seed/number), kind, content of the mission file, and number of illegal draws before it."""

    name: str
    kind: str
    document: MissionDocument
    redraws: int


@dataclass(slots=True)
class _Draft:
    """A mission in metres east and north of its middle: places, zones as rings (N, 2) or (east, north, radius)."""

    start: Floats
    goal: Floats
    vias: list[Floats]
    rings: list[Floats]
    discs: list[tuple[float, float, float]]
    levels: list[tuple[float | None, float | None]]
    peaks: list[dict[str, Any]]


def draw(seed: int, number: int) -> Everyday:
    """Mission ``number`` of a seed. Raises RuntimeError if no legal one is found in `MISSION_DRAWS` draws."""
    kind = EVERYDAY_KINDS[number % len(EVERYDAY_KINDS)]
    rng = np.random.default_rng([seed, number])
    margins = bool((number // len(EVERYDAY_KINDS)) % 2)
    reach_m = CLEARANCE_M + TRACK_ERROR_M if margins else 0.0
    for redraws in range(MISSION_DRAWS):
        draft = _MAKERS[kind](rng)
        if _legal(draft, reach_m + PLACE_SPARE_M):
            document = _document(draft, kind, f"{kind} {seed}/{number}", rng, margins=margins)
            return Everyday(f"{seed}/{number:03d}", kind, document, redraws)
    raise RuntimeError(f"no legal mission of kind {kind} in {MISSION_DRAWS} draws of seed {seed}, number {number}")


def _legal(draft: _Draft, reach_m: float) -> bool:
    """Whether start, goal and vias keep ``reach_m`` from every zone."""
    places = shapely.points(np.array([draft.start, draft.goal, *draft.vias]))
    shapes = [shapely.Polygon(ring) for ring in draft.rings]
    shapes += [shapely.Point(e, n).buffer(r, quad_segs=32) for e, n, r in draft.discs]
    return not any(shapely.dwithin(shape, places, reach_m * 1.01).any() for shape in shapes)


def _document(draft: _Draft, kind: str, name: str, rng: np.random.Generator, *, margins: bool) -> MissionDocument:
    lat0, lon0 = (36.58, -84.28) if kind == "sample" else (47.0, 8.0)
    scale = ROUND_DEGREE_M * np.array([1.0, math.cos(math.radians(lat0))])

    def point(place: Floats) -> list[float] | MissionDocument:
        if draft.peaks:  # peaks are in local metres
            return {"east_m": round(float(place[0]), 2), "north_m": round(float(place[1]), 2)}
        return [round(float(x), 7) for x in np.array([lat0, lon0]) + np.asarray(place)[::-1] / scale]

    agl_m = SAMPLE_MIN_AGL_M if kind == "sample" else FLAT_MIN_AGL_M
    zones: list[MissionDocument] = [
        {"name": f"ring {k}", "polygon": [point(p) for p in ring]} for k, ring in enumerate(draft.rings)
    ]
    zones += [
        {"name": f"disc {k}", "center": point(np.array([e, n])), "radius_m": round(r, 2)}
        for k, (e, n, r) in enumerate(draft.discs)
    ]
    for zone, (floor, ceiling) in zip(zones, draft.levels, strict=False):
        zone |= {key: v for key, v in (("floor_agl_m", floor), ("ceiling_agl_m", ceiling)) if v is not None}
    errors = (CLEARANCE_M, TRACK_ERROR_M, ALTITUDE_ERROR_M) if margins else (0.0, 0.0, 0.0)
    keys = ("horizontal_clearance_m", "track_error_m", "altitude_error_m")
    limits: MissionDocument = {"min_agl_m": agl_m, **dict(zip(keys, errors, strict=True))}
    vehicle: MissionDocument = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter",
        "start": point(draft.start), "goal": point(draft.goal), "via": [point(v) for v in draft.vias],
        "max_climb_deg": float(rng.choice([10.0, 15.0, 30.0])),
    }  # fmt: skip
    terrain: MissionDocument = {"flat_m": 0}
    if kind == "sample":
        terrain = dict(SAMPLE_TERRAIN)
    elif draft.peaks:
        terrain["peaks"] = [{**p, "center": [round(float(x), 2) for x in p["center"]]} for p in draft.peaks]
    frame = {"frame": {"origin": [lat0, lon0], "amsl_m": 0}} if draft.peaks else {}
    return {
        "version": 1, "name": name, **frame, "terrain": terrain, "limits": limits, "no_fly": zones,
        "vehicles": [vehicle],
    }  # fmt: skip


# ------------------------------------------------------------------------------------------------ the kinds


def _ends(
    rng: np.random.Generator, low: float = SHORTEST_WAY_M, high: float = LONGEST_WAY_M
) -> tuple[Floats, Floats, Floats]:
    """Start, goal, and the unit vector from start to goal; the middle is the origin."""
    length = math.exp(rng.uniform(math.log(low), math.log(high)))
    turn = rng.uniform(0.0, 2.0 * math.pi)
    along = np.array([math.cos(turn), math.sin(turn)])
    return -0.5 * length * along, 0.5 * length * along, along


def _plain(start: Floats, goal: Floats, rings: list[Floats] | None = None) -> _Draft:
    return _Draft(start, goal, [], rings or [], [], [], [])


def _left(along: Floats) -> Floats:
    return np.array([-along[1], along[0]])


def _thick(line: Floats, width: float) -> Floats:
    """The ring (N, 2) around a line (M, 2), with flat ends."""
    shape = shapely.LineString(line).buffer(0.5 * width, cap_style="flat", join_style="mitre")
    return np.asarray(shapely.remove_repeated_points(shape, 1e-3).exterior.coords)[:-1]


def _leg(rng: np.random.Generator) -> _Draft:
    start, goal, _ = _ends(rng, 30.0, LONGEST_WAY_M)
    return _plain(start, goal)


def _tiny(rng: np.random.Generator) -> _Draft:
    start, goal, along = _ends(rng, 20.0, 150.0)
    draft, size = _plain(start, goal), float(np.hypot(*(goal - start)))
    for _ in range(rng.integers(0, 3)):
        at = start + rng.uniform(0.2, 0.8) * (goal - start) + rng.uniform(-0.5, 0.5) * size * _left(along)
        draft.discs.append((*at.tolist(), rng.uniform(0.02, 0.15) * size + 0.5))
    return draft


def _wall(rng: np.random.Generator, low: float = 0.3, high: float = 2.0) -> _Draft:
    start, goal, along = _ends(rng)
    size = float(np.hypot(*(goal - start)))
    lean = rng.uniform(-0.9, 0.9)
    across = math.cos(lean) * _left(along) + math.sin(lean) * along
    length, at = rng.uniform(low, high) * size, rng.uniform(0.2, 0.8)
    middle = start + at * (goal - start) + rng.uniform(-0.4, 0.4) * length * across
    ends = np.stack([middle - 0.5 * length * across, middle + 0.5 * length * across])
    return _plain(start, goal, [_thick(ends, rng.uniform(0.005, 0.05) * size + 2.0)])


def _detour(rng: np.random.Generator) -> _Draft:
    return _wall(rng, 2.0, 4.0)


def _hook(rng: np.random.Generator) -> _Draft:
    start, goal, along = _ends(rng)
    size = float(np.hypot(*(goal - start)))
    if rng.random() < 0.5:
        start, goal, along = goal, start, -along
    a, b, c = rng.uniform(0.1, 0.8, 3) * size
    left = _left(along) * rng.choice([-1.0, 1.0])
    base = goal - rng.uniform(0.1, 0.5) * size * along
    line = [base + a * left, base - b * left, base - b * left + c * along]
    if rng.random() < 0.5:
        line.append(line[-1] + 0.6 * b * left)
    return _plain(start, goal, [_thick(np.array(line), rng.uniform(0.01, 0.05) * size + 2.0)])


def _comb(rng: np.random.Generator) -> _Draft:
    start, goal, along = _ends(rng)
    size, teeth = float(np.hypot(*(goal - start))), int(rng.integers(2, 8))
    left, rings = _left(along), []
    long, short = rng.uniform(0.2, 1.0) * size, rng.uniform(0.02, 0.15) * size
    for k in range(teeth):
        at = start + (k + 1) / (teeth + 1) * (goal - start)
        side = left if k % 2 else -left
        tooth = np.stack([at - long * side, at + short * side + rng.uniform(-0.1, 0.1) * size * along / teeth])
        rings.append(_thick(tooth, rng.uniform(0.1, 0.3) * size / teeth))
    return _plain(start, goal, rings)


def _ring(rng: np.random.Generator) -> _Draft:
    start, goal, _ = _ends(rng)
    if rng.random() < 0.3:
        start, goal = goal, start
    size = float(np.hypot(*(goal - start)))
    radius, opening = rng.uniform(0.15, 0.6) * size, rng.uniform(0.2, 1.2)
    first = rng.uniform(0.0, 2.0 * math.pi)
    angle = np.linspace(first + 0.5 * opening, first + 2.0 * math.pi - 0.5 * opening, int(rng.integers(10, 40)))
    line = goal + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return _plain(start, goal, [_thick(line, rng.uniform(0.02, 0.15) * radius + 1.0)])


def _count(rng: np.random.Generator) -> int:
    return round(math.exp(rng.uniform(0.0, math.log(300.0))))


def _scatter(rng: np.random.Generator, start: Floats, goal: Floats, count: int) -> tuple[Floats, Floats]:
    """Places (count, 2) around the line, and sizes (count,) that leave some room between them."""
    size = float(np.hypot(*(goal - start)))
    at = rng.uniform(-0.6, 0.6, (count, 2)) * size
    return at, rng.uniform(0.3, 1.0, count) * size * 0.25 / math.sqrt(count + 1.0)


def _discs(rng: np.random.Generator) -> _Draft:
    start, goal, _ = _ends(rng)
    draft = _plain(start, goal)
    for (east, north), radius in zip(*_scatter(rng, start, goal, _count(rng)), strict=True):
        draft.discs.append((float(east), float(north), float(radius)))
    return draft


def _blocks(rng: np.random.Generator) -> _Draft:
    start, goal, _ = _ends(rng)
    rings = []
    for at, radius in zip(*_scatter(rng, start, goal, _count(rng)), strict=True):
        angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(3, 9))))
        reach = radius * rng.uniform(0.4, 1.0, len(angle))[:, None]
        ring = at + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        if shapely.Polygon(ring).is_valid and shapely.Polygon(ring).area > 1e-3 * radius**2:
            rings.append(ring)
    return _plain(start, goal, rings)


def _vias(rng: np.random.Generator) -> _Draft:
    draft = _discs(rng)
    size = float(np.hypot(*(draft.goal - draft.start)))
    draft.discs = draft.discs[:60]
    draft.vias = [rng.uniform(-0.5, 0.5, 2) * size for _ in range(rng.integers(1, 5))]
    return draft


def _levels(rng: np.random.Generator) -> _Draft:
    draft = _discs(rng) if rng.random() < 0.5 else _wall(rng)
    draft.discs = draft.discs[:60]
    for _ in range(len(draft.rings) + len(draft.discs)):
        ceiling = float(round(rng.uniform(40.0, 200.0)))
        floor = float(round(rng.uniform(0.0, 0.8 * ceiling)))
        draft.levels.append([(None, ceiling), (floor, ceiling), (floor, None), (None, None)][rng.integers(0, 4)])
    return draft


def _peaks(rng: np.random.Generator) -> _Draft:
    draft = _discs(rng) if rng.random() < 0.5 else _wall(rng)
    draft.discs = draft.discs[:40]
    size = float(np.hypot(*(draft.goal - draft.start)))
    for _ in range(rng.integers(1, 7)):
        width = rng.uniform(0.05, 0.2, 2) * size
        height = float(rng.uniform(0.1, 0.6) * width.min())
        draft.peaks.append({
            "center": rng.uniform(-0.5, 0.5, 2) * size,
            "height_m": round(height, 2),
            "decay_m": [round(float(w), 2) for w in width],
        })  # fmt: skip
    return draft


def _sample(rng: np.random.Generator) -> _Draft:
    make = (_wall, _hook, _comb, _ring, _discs, _blocks, _vias, _leg)[rng.integers(0, 8)]
    draft = make(rng)
    draft.rings, draft.discs = draft.rings[:60], draft.discs[:60]
    offset = rng.uniform(-3000.0, 3000.0, 2)
    draft.start, draft.goal = draft.start + offset, draft.goal + offset
    draft.vias = [v + offset for v in draft.vias]
    draft.rings = [ring + offset for ring in draft.rings]
    draft.discs = [(e + float(offset[0]), n + float(offset[1]), r) for e, n, r in draft.discs]
    return draft


_MAKERS: dict[str, Callable[[np.random.Generator], _Draft]] = {
    "leg": _leg, "tiny": _tiny, "wall": _wall, "detour": _detour, "hook": _hook, "comb": _comb, "ring": _ring,
    "discs": _discs, "blocks": _blocks, "vias": _vias, "levels": _levels, "peaks": _peaks, "sample": _sample,
}  # fmt: skip
