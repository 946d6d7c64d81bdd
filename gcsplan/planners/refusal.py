"""Why there is no path: the binding constraint in words, with a place and a number that would do.

Only what is proved is called infeasible: an end that breaks a limit by itself, or ground (and zones over it) that
shuts start from goal even where every cell of the raster is given the benefit of its lowest corner. Everything
else was not found on a grid; which limit would open a way is then tried out, one limit at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.errors import NoMission, NoMissionReason
from gcsplan.planners.border import enclosed, goes_on, within_m
from gcsplan.planners.lattice.lattice import levels_of, near_zone, terminals
from gcsplan.planners.lattice.routes import Level, Router
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import Obstruction
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from gcsplan.world.zones import Circle, Zone

Floats = NDArray[np.float64]

LEVEL = Level(math.inf, 40_000)
"""Lattice on which limits are lifted one at a time: coarse, for these are words, not paths."""
NAMES = 5


class Refusal(NoMission):
    """No mission, and where: ``east_m``, ``north_m`` of the binding place, None where there is no one place."""

    def __init__(self, message: str, *, reason: NoMissionReason, place: tuple[float, float] | None = None) -> None:
        super().__init__(message, reason=reason)
        self.east_m = None if place is None else float(place[0])
        self.north_m = None if place is None else float(place[1])


class Unexplained(Refusal):
    """The refusal of a problem that is ``terse``: ``explained()`` is the one that says why."""

    def __init__(self, reason: NoMissionReason, explained: Callable[[], Refusal]) -> None:
        super().__init__("no mission over the terrain that was looked at", reason=reason)
        self.explained = explained


def check_ends(problem: Problem) -> None:
    """Raise Refusal if start, a via or the goal breaks a limit by itself."""
    stops = terminals(problem)
    heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
    names = ["the start", *(f"via point {k + 1}" for k in range(len(problem.via))), "the goal"]
    for name, place, amsl in zip(names, stops, heights, strict=True):
        _check_end(problem, name, place, amsl)
    one_place = all(math.dist(stops[0], x) < 1e-3 for x in stops)
    if one_place and not problem.via and abs(problem.start[2] - problem.goal[2]) > 1e-3:
        return  # a climb on the spot, in laps
    if one_place:
        raise Refusal("start and goal are the same place: there is nothing to fly", reason="infeasible", place=stops[0])
    for k, (a, b) in enumerate(pairwise(stops)):
        z0, z1 = heights[k], heights[k + 1]
        if math.dist(a, b) < 1e-3 and z0 is not None and z1 is not None and abs(z1 - z0) > 1e-3:
            raise Refusal(
                f"no mission: {names[k]} and {names[k + 1]} are one place, {abs(z1 - z0):.1f} m apart in height, and a "
                f"climb on the spot is planned only from a start to a goal above or below it: move one of them",
                reason="infeasible",
                place=a,
            )


def _check_end(problem: Problem, name: str, place: tuple[float, float], amsl: float | None) -> None:
    air, limits = problem.airspace, problem.limits
    low = float(air.floor_amsl(*place, limits))
    high = float(air.ceiling_amsl(*place, limits))

    def refuse(words: str) -> Refusal:
        return Refusal(f"no mission: {words}", reason="infeasible", place=place)

    if not math.isfinite(low):
        raise refuse(f"the ground at {name}, or within reach of it, is unknown to the terrain model")
    if low > high + 1e-6:
        raise refuse(
            f"at {name} the lowest legal altitude, {low:.1f} m AMSL ({_floor_words(limits)}), is over the highest, "
            f"{high:.1f} m ({_ceiling_words(limits, air, place)}): raise that limit by at least {low - high:.1f} m, "
            f"or move {name}"
        )
    if amsl is not None and amsl < low - 1e-6:
        raise refuse(
            f"{name} at {amsl:.1f} m AMSL is under the lowest legal altitude there, {low:.1f} m "
            f"({_floor_words(limits)})"
        )
    if amsl is not None and amsl > high + 1e-6:
        raise refuse(
            f"{name} at {amsl:.1f} m AMSL is over the highest legal altitude there, {high:.1f} m "
            f"({_ceiling_words(limits, air, place)})"
        )
    here, reach = np.array([place]), air.beside_m(limits)
    for zone in air.zones:
        if not near_zone(here, here, zone, reach, air.scale)[0]:
            continue
        bottom, top, *over_ground = levels_of(limits, zone).tolist()
        ground = float(air.surface.ground_at(*place)) if any(over_ground) else 0.0
        # Where the ground is unknown a level over it is no way past.
        if over_ground[0]:
            bottom = -math.inf if math.isnan(ground) else bottom + ground
        if over_ground[1]:
            top = math.inf if math.isnan(ground) else top + ground
        at = amsl is not None and bottom + 1e-6 < amsl < top - 1e-6
        if at or (amsl is None and bottom < low and (top > high or math.isinf(top))):
            raise refuse(
                f"{name} lies in no-fly zone {zone.name!r} or within {reach:.1f} m of it "
                f"(horizontal_clearance_m + track_error_m): move {name}, or shrink the zone"
            )


def _floor_words(limits: Limits) -> str:
    words = f"ground + min_agl_m {limits.min_agl_m:g}"
    if limits.horizontal_clearance_m:
        words += f", terrain clearance {limits.horizontal_clearance_m:g} m"
    return words + (f", altitude error {limits.altitude_error_m:g} m" if limits.altitude_error_m else "")


def _ceiling_words(limits: Limits, air: Airspace, place: tuple[float, float]) -> str:
    amsl = math.inf if limits.max_amsl_m is None else limits.max_amsl_m
    agl = math.inf if limits.max_agl_m is None else float(air.surface.ground_at(*place)) + limits.max_agl_m
    words = f"max_amsl_m {limits.max_amsl_m:g}" if amsl <= agl else f"ground + max_agl_m {limits.max_agl_m:g}"
    return words + (f", altitude error {limits.altitude_error_m:g} m" if limits.altitude_error_m else "")


def explain(problem: Problem, router: Router | None = None, *, proved: bool | None = None) -> Refusal:
    """The refusal for a problem whose ends are legal and for which no route was found.

    ``proved``: that there is none is known already; None: see whether the raster's cells prove it. Where the terrain
    goes on beyond the surface, it is proved only if no path can get there from both ends.
    """
    reason: NoMissionReason
    if problem.terse:
        proved = _proved_shut(problem) if proved is None else proved
        reason = "infeasible" if proved else "not_found"
        return Unexplained(reason, lambda: explain(replace(problem, terse=False), router, proved=proved))
    beyond = ""
    if goes_on(problem):
        proved = enclosed(problem)
        beyond = "" if proved else f"; not found within {within_m(problem) / 1000.0:.1f} km of the straight way"
    elif proved is None:
        proved = _proved_shut(problem)
    reason = "infeasible" if proved else "not_found"
    place = None if router is None or router.last_place is None else (router.last_place[0], router.last_place[1])
    grid = "" if proved or router is None else f" (searched on a grid of {router.lattice.step_m:.0f} m)"
    if not proved and router is not None and router.last is not None and _finds(problem)[1] is not None:
        return Refusal(
            f"no mission: ways that the search saw{grid} did not pass the exact test, the last one because of "
            f"{_blocked_words(problem, router.last)}{beyond}",
            reason=reason,
            place=place,
        )
    for reading in (_ceiling, _climb, _zones, _band, lambda p: _ceiling(p, over_zones=True)):
        found = reading(problem)
        if found is not None:
            words, place = found
            sure = "; that there is none is proved" if proved else ""
            return Refusal(f"no mission: {words}{grid}{sure}{beyond}", reason=reason, place=place)
    return Refusal(
        f"no mission: no way from start to goal was found{grid}, nor with any one limit lifted: limits, zones and the "
        f"edge of the known terrain bind together{beyond}",
        reason=reason,
        place=place,
    )


def _blocked_words(problem: Problem, why: Obstruction) -> str:
    if why.kind == "zone":
        return f"no-fly zone {problem.airspace.zones[why.zone].name!r}"
    if why.kind == "pinched":
        return f"ground that leaves no room under the ceiling ({why.by:.1f} m too little)"
    limit = problem.limits.max_climb_deg if why.kind == "climb" else problem.limits.max_descent_deg
    run = why.s1_m - why.s0_m
    return f"a {why.kind} steeper than max_{why.kind}_deg {limit:g} ({why.by:.1f} m too much in {run:.0f} m)"


def _with(problem: Problem, limits: Limits | None = None, zones: tuple[Zone, ...] | None = None) -> Problem:
    air = problem.airspace
    if zones is not None:
        air = Airspace(air.surface, zones, scale=air.scale)
    return replace(problem, airspace=air, limits=limits or problem.limits, progress=None)


def _finds(problem: Problem) -> tuple[Router, Floats | None]:
    router = Router.at(problem, LEVEL)
    return router, router.way()


Reading = tuple[str, tuple[float, float] | None] | None


def _ceiling(problem: Problem, over_zones: bool = False) -> Reading:
    """Would a higher max AMSL do? Which, and where is the pass. Only with ``over_zones`` by flying over zones."""
    limits = problem.limits
    if limits.max_amsl_m is None:
        return None
    router, way = _finds(_with(problem, replace(limits, max_amsl_m=None)))
    if way is None:
        return None
    needed = _least(lambda cap: router.way(cap) is not None, limits.max_amsl_m - limits.altitude_error_m, 9500.0, 0.25)
    way = router.way(needed)
    assert way is not None
    pass_m, place = _highest(router, way)
    if needed > pass_m + 5.0 and not over_zones and _crossed(problem, way):
        return None
    # The lattice knows the floor by samples; along the way it is known better.
    enough = math.ceil(max(needed, pass_m) + limits.altitude_error_m)
    return (
        f"no way below max_amsl_m {limits.max_amsl_m:g} ({limits.max_amsl_m - limits.altitude_error_m:g} m with the "
        f"altitude error): the lowest pass between start and goal that was found needs "
        f"{pass_m:.1f} m AMSL ({_floor_words(limits)}); max_amsl_m {enough} would do"
    ), place


def _highest(router: Router, way: Floats) -> tuple[float, tuple[float, float]]:
    """Highest floor along a way, and where."""
    step = 0.25 * router.lattice.step_m
    points = [way[:1]]
    for a, b in pairwise(way):
        n = max(1, math.ceil(math.dist(a, b) / step))
        points.append(a + np.linspace(0.0, 1.0, n + 1)[1:, None] * (b - a))
    at = np.vstack(points)
    floor = np.asarray(router.problem.airspace.floor_amsl(at[:, 0], at[:, 1], router.problem.limits))
    k = int(np.argmax(floor))
    return float(floor[k]), (float(at[k, 0]), float(at[k, 1]))


def _climb(problem: Problem) -> Reading:
    """Would a steeper climb do? How steep, and where."""
    limits = problem.limits
    steepest = min(limits.max_climb_deg, limits.max_descent_deg)
    if steepest >= 90.0:
        return None
    free = replace(limits, max_climb_deg=90.0, max_descent_deg=90.0)
    router, way = _finds(_with(problem, free))
    if way is None:
        return None

    def does(angle: float) -> bool:
        tried = replace(
            limits, max_climb_deg=max(angle, limits.max_climb_deg), max_descent_deg=max(angle, limits.max_descent_deg)
        )
        router.problem = _with(problem, tried)
        return router.way() is not None

    needed = _least(does, steepest, 89.0, 0.25)
    which = "max_climb_deg" if limits.max_climb_deg <= limits.max_descent_deg else "max_descent_deg"
    return (
        f"{which} {steepest:g} is too tight: no way is that gentle between floor and ceiling; about "
        f"{needed:.1f} degrees would do",
        None,
    )


def _least(does: Callable[[float], bool], low: float, high: float, within: float) -> float:
    """Smallest value in (low, high] that does, to ``within``; ``high`` does."""
    while high - low > within:
        middle = 0.5 * (low + high)
        if does(middle):
            high = middle
        else:
            low = middle
    return high


def _zones(problem: Problem) -> Reading:
    """Would fewer zones do? Which one alone, or else all that stand in the way."""
    zones = problem.airspace.zones
    if not zones:
        return None
    _, way = _finds(_with(problem, zones=()))
    if way is None:
        return None
    crossed = _crossed(problem, way)
    place = None
    single = []
    for k in crossed[:12]:
        if _finds(_with(problem, zones=zones[:k] + zones[k + 1 :]))[1] is not None:
            single.append(k)
    named = single or crossed
    if named:
        place = _middle(zones[named[0]])
    words = ", ".join(repr(zones[k].name) for k in named[:NAMES]) + (" and others" if len(named) > NAMES else "")
    if single:
        if len(single) > 1:
            return f"no-fly zones {words} shut every way; with any one of them lifted there is one", place
        return f"no-fly zone {words} shuts every way; with it lifted there is one", place
    return f"no-fly zones {words} together shut every way; without zones there is one", place


def _crossed(problem: Problem, way: Floats) -> list[int]:
    """Zones that a way comes near, at whatever height."""
    air, reach = problem.airspace, problem.airspace.beside_m(problem.limits)
    return [k for k, zone in enumerate(air.zones) if near_zone(way[:-1], way[1:], zone, reach, air.scale).any()]


def _middle(zone: Zone) -> tuple[float, float]:
    if isinstance(zone.shape, Circle):
        return zone.shape.east_m, zone.shape.north_m
    west, south, east, north = zone.bounds
    return 0.5 * (west + east), 0.5 * (south + north)


def _band(problem: Problem) -> Reading:
    """Would a higher max AGL do, alone or with steeper climbs?"""
    limits = problem.limits
    if limits.max_agl_m is None:
        return None
    if _finds(_with(problem, replace(limits, max_agl_m=None)))[1] is None:
        return None
    return (
        f"between min_agl_m {limits.min_agl_m:g} and max_agl_m {limits.max_agl_m:g} there is no way; without "
        f"max_agl_m there is one",
        None,
    )


def _proved_shut(problem: Problem) -> bool:
    """True if no path whatever exists: flood the raster's cells, each as low as its lowest corner.

    A cell is shut if even that corner with min AGL is over max AMSL, if a corner is unknown, or if a circle
    of unlimited height covers it. Cells that touch at a corner count as joined.
    """
    from scipy.ndimage import label

    air, limits = problem.airspace, problem.limits
    top = air.surface.top_m
    corners = np.stack([top[:-1, :-1], top[:-1, 1:], top[1:, :-1], top[1:, 1:]])
    lowest = corners.min(axis=0)  # NaN where any corner is unknown
    ceiling = math.inf if limits.max_amsl_m is None else limits.max_amsl_m - limits.altitude_error_m
    # A hair of room, for the grid's map to the plane is a fit.
    is_open = ~np.isnan(lowest) & (lowest + limits.min_agl_m + limits.altitude_error_m <= ceiling + 1e-6)
    rows, cols = top.shape
    for zone in air.zones:
        if isinstance(zone.shape, Circle) and zone.floor is None and zone.ceiling is None:
            c = zone.shape
            box = air.surface.grid(
                np.array([zone.bounds[0], zone.bounds[0], zone.bounds[2], zone.bounds[2]]),
                np.array([zone.bounds[1], zone.bounds[3], zone.bounds[1], zone.bounds[3]]),
            )
            c0, r0 = np.clip(np.floor(box.min(axis=0)).astype(int) - 1, 0, [cols - 1, rows - 1])
            c1, r1 = np.clip(np.ceil(box.max(axis=0)).astype(int) + 1, 0, [cols - 1, rows - 1])
            if c1 <= c0 or r1 <= r0:
                continue
            rr, cc = np.mgrid[r0 : r1 + 1, c0 : c1 + 1]
            at = air.surface.grid.to_plane(cc, rr)
            # A metre for the bow of a cell's edge in the plane.
            inside = np.hypot(at[..., 0] - c.east_m, at[..., 1] - c.north_m) < c.radius_m - 1.0
            covered = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, :-1] & inside[1:, 1:]
            is_open[r0:r1, c0:c1] &= ~covered
    parts, _ = label(is_open, structure=np.ones((3, 3)))
    at = air.surface.grid(*np.array(terminals(problem)).T)
    cells = np.clip(np.floor(at).astype(int), 0, [cols - 2, rows - 2])
    numbers = {int(parts[r, c]) for c, r in cells}
    return 0 in numbers or len(numbers) > 1
