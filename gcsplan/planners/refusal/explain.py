"""Why there is no path: terminals that break a limit by themselves, and the refusal after a search without success.

A planner's own refusal states only whether it is proved that there is no path, or that none was found; `suggestions`
then tries out cures.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcsplan.planners.border import enclosed, goes_on, within_m
from gcsplan.planners.problem import Problem, Refusal, terminals_of
from gcsplan.planners.refusal.suggestions import FILLED, floor_words, rounded_up
from gcsplan.world.airspace import Airspace, Legs, Violation
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Zone

TOUCH_M, CLIFF_M = 1e-6, 1.0
"""Metres by which a terminal must break a limit for that to be proved: rounding; and what ground may rise within the
rounding of its place."""
FAR_M = 20_000.0
"""Metres above and below the ground at which all limits of height are broken."""


class NoPath(Refusal):
    """A search found no path over the loaded terrain; over more terrain there may be one."""


def explain(problem: Problem, *, proved: bool | None = None) -> Refusal:
    """The refusal for a problem whose terminals are legal and for which no path was found.

    ``proved``: whether it is proved that there is none; where the terrain goes on beyond the surface, `enclosed`
    decides that instead. The caller may add what would help, see `with_cures`.
    """
    words = "no path was found"
    if goes_on(problem):
        proved = enclosed(problem)
        words = f"a path is not found within {within_m(problem) / 1000.0:.1f} km of the straight track"
    if proved:
        over = " over ground that the terrain model knows" if problem.airspace.surface.has_unknown else ""
        words = f"there is no path within the limits{over}, which is proved"
    return NoPath(f"no mission: {words}", reason="infeasible" if proved else "not_found", untried=True)


def check_ends(problem: Problem) -> None:
    """Raise Refusal if start, a via or the goal breaks a limit by itself, or if all are one place with nothing to fly,
    or if two in a row are one place at different altitudes (except a climb from start to goal without vias)."""
    terminals = terminals_of(problem)
    heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
    names = ["the start", *(f"via point {k + 1}" for k in range(len(problem.via))), "the goal"]
    for name, place, amsl in zip(names, terminals, heights, strict=True):
        _check_end(problem, name, place, amsl)
    one_place = all(math.dist(terminals[0], x) < 1e-3 for x in terminals)
    if one_place and not problem.via and abs(problem.start[2] - problem.goal[2]) > 1e-3:
        return  # a climb on the spot, in laps
    if one_place:
        raise Refusal(
            "start and goal are the same place: there is nothing to fly", reason="infeasible", place=terminals[0]
        )
    for k, (a, b) in enumerate(pairwise(terminals)):
        z0, z1 = heights[k], heights[k + 1]
        if math.dist(a, b) < 1e-3 and z0 is not None and z1 is not None and abs(z1 - z0) > 1e-3:
            raise Refusal(
                f"no mission: {names[k]} and {names[k + 1]} are one place, {abs(z1 - z0):.1f} m apart in height, and a "
                f"climb on the spot is planned only from a start to a goal above or below it: move one of them aside "
                "by a centimetre or more",
                reason="not_found",
                place=a,
            )


def _check_end(problem: Problem, name: str, place: tuple[float, float], amsl: float | None) -> None:
    try:
        _require_legal(problem, name, place, amsl)
    except Refusal as wrong:
        if _proved(problem, place, amsl):
            raise
        raise Refusal(
            f"{wrong.message}; only with the planner's own margins is that certain", reason="not_found", place=place,
            place_of=name, untried=wrong.untried,
        ) from None  # fmt: skip


def _require_legal(problem: Problem, name: str, place: tuple[float, float], amsl: float | None) -> None:
    """Raise Refusal if a terminal breaks a limit that paths keep; proved or not, see `_proved`."""
    air, limits = problem.airspace, problem.limits
    low = float(air.floor_amsl(*place, limits))
    high = float(air.ceiling_amsl(*place, limits))

    def refuse(words: str, *, untried: bool = False) -> Refusal:
        return Refusal(f"no mission: {words}", reason="infeasible", place=place, place_of=name, untried=untried)

    if not math.isfinite(low):
        raise refuse(f"the ground at {name}, or within reach of it, is unknown to the terrain model: {FILLED}")
    lowest, highest = f"{rounded_up(low):.1f} m", f"{-rounded_up(-high):.1f} m"
    if low > high + 1e-6:
        raise refuse(
            f"at {name} the lowest legal altitude, {lowest} AMSL ({floor_words(limits)}), is over the highest, "
            f"{highest} ({_ceiling_words(limits, air, place)}): raise that limit, or move {name}",
            untried=True,
        )
    broken = () if amsl is None else _broken(problem, (*place, amsl))
    # `low` is a bound, which lies above the lowest legal altitude by up to some decimetres beside steep ground.
    if amsl is not None and amsl < low - 1e-6 and any(v.kind in ("min_agl", "terrain_clearance") for v in broken):
        raise refuse(
            f"{name} at {amsl:.1f} m AMSL is under the lowest legal altitude there, {lowest} ({floor_words(limits)})"
        )
    if amsl is not None and amsl > high + 1e-6:
        raise refuse(
            f"{name} at {amsl:.1f} m AMSL is over the highest legal altitude there, {highest} "
            f"({_ceiling_words(limits, air, place)}): raise that limit, or lower {name}",
            untried=True,
        )
    reach = air.beside_m(limits)
    shut = [air.zones[v.zone] for v in broken if v.zone >= 0]
    if amsl is None:
        shut = _shut_by(problem, place, low, high)
    if shut:
        where, cure = (
            (f"in {shut[0].title} or within {reach:.1f} m of it", "shrink the zone")
            if shut[0].outside is None
            else (f"outside of {shut[0].title} or within {reach:.1f} m of the edge", "draw it larger")
        )
        if shut[0].outside is not None and not (shut[0].floor is None and shut[0].ceiling is None):
            where = f"{limits.over_zone_m:g} m or less below the ceiling, or above the floor, of {shut[0].title}"
            raise refuse(f"{name} lies {where} (altitude_error_m + vertical_clearance_m): {cure}, or lower the limits")
        raise refuse(f"{name} lies {where} (horizontal_clearance_m + track_error_m): move {name}, or {cure}")


def _proved(problem: Problem, place: tuple[float, float], amsl: float | None) -> bool:
    """Whether a terminal is illegal as the check applies the limits, with all that it may lie beside its place."""
    aside_m, off_m = problem.rounding_m
    checked = problem.limits if problem.checked is None else problem.checked
    limits = replace(
        checked,
        track_error_m=max(checked.track_error_m - aside_m, 0.0),
        altitude_error_m=max(checked.altitude_error_m - off_m, 0.0),
    )
    bare = replace(problem, limits=limits, checked=None, rounding_m=(0.0, 0.0))
    # The errors, less that rounding, hold all places that the terminal may be at; where they are smaller, a cliff may
    # begin within the rounding.
    hold = checked.track_error_m >= aside_m and problem.limits.altitude_error_m >= off_m
    least_m = TOUCH_M if hold else CLIFF_M
    if amsl is not None:
        return any(v.by > least_m for v in _broken(bare, (*place, amsl)))
    ground = bare.airspace.surface.ground_at(*place)
    middle = float(ground) if np.isfinite(ground) else 0.0
    below, above = (_broken(bare, (*place, middle + off)) for off in (-FAR_M, FAR_M))
    if any(v.kind == "coverage" and v.by > least_m for v in below):
        return True
    low = middle - FAR_M + max((v.by for v in below if v.kind in ("min_agl", "terrain_clearance")), default=0.0)
    high = middle + FAR_M - max((v.by for v in above if v.kind in ("max_agl", "max_amsl")), default=-math.inf)
    return low > high + least_m or bool(_shut_by(bare, place, low + least_m, high - least_m))


def _broken(problem: Problem, place: tuple[float, float, float]) -> tuple[Violation, ...]:
    """The finding of the exact check at a place."""
    here = np.array([place])
    return problem.airspace.examine(Legs.between(here, here, problem.limits), problem.limits).violations


def _shut_by(problem: Problem, place: tuple[float, float], low: float, high: float) -> list[Zone]:
    """The zones that shut all altitudes from ``low`` to ``high`` at a place, each by itself. Zones with a level over
    ground count only inside their shape: beside it, ground elsewhere decides."""
    air, limits, here = problem.airspace, problem.limits, np.array([place])
    table = air.zone_table
    bottoms, tops = table.levels_m(limits.over_zone_m, float(air.surface.ground_at(*place)))
    # Over unknown ground, a zone's floor or ceiling AGL cannot be evaluated, so the zone has no open side there.
    bottoms, tops = np.where(np.isnan(bottoms), -math.inf, bottoms), np.where(np.isnan(tops), math.inf, tops)
    return [
        zone
        for k, zone in enumerate(air.zones)
        if bottoms[k] < low
        and (tops[k] > high or math.isinf(tops[k]))
        and (table.holds(k, here) if zone.follows_ground else table.near(k, here, here, air.beside_m(limits)))[0]
    ]


def _ceiling_words(limits: Limits, air: Airspace, place: tuple[float, float]) -> str:
    amsl = math.inf if limits.max_amsl_m is None else limits.max_amsl_m
    agl = math.inf if limits.max_agl_m is None else float(air.surface.ground_at(*place)) + limits.max_agl_m
    words = f"max_amsl_m {limits.max_amsl_m:g}" if amsl <= agl else f"ground + max_agl_m {limits.max_agl_m:g}"
    return words + (f", altitude error {limits.altitude_error_m:g} m" if limits.altitude_error_m else "")
