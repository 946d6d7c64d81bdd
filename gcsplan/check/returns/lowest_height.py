"""The lowest height above ground of the returns from a mission, at one return altitude.

It counts from the ground and what stands on it, within the track error of where a return is, at the altitudes that the
autopilot may fly; the altitude error is not taken off. The descent over home, the climb on the spot and the mission
itself do not count. Parts of the mission are split where the lowest height is until it is known.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.motion.return_rules import ASIDE, RULES, at_home_m
from gcsplan.check.motion.stopping import circle_home_m
from gcsplan.check.returns.footprint import Target, places_of_returns
from gcsplan.check.returns.obstacles_met import CIRCLE_ABOVE_M, alike_in_width
from gcsplan.check.returns.refinement import SMALLEST_M
from gcsplan.check.returns.trace import TINY_M, MissionTrace, TraceParts
from gcsplan.check.returns.verdict import LowestAgl
from gcsplan.vehicle import Vehicle
from gcsplan.world import level_lines

ENOUGH_M = 1.0
"""The lowest height is known to within this, m, or less."""

ROUNDS, PIECES, AT_ONCE = 12, 4, 64
"""How often the parts with the lowest heights are split, into how many, and how many at once."""


def lowest_agl(
    trace: MissionTrace, parts: TraceParts, target: Target, vehicle: Vehicle, level_amsl_m: float
) -> LowestAgl | None:
    """The lowest height of the returns from ``parts`` at the return altitude; None over unknown ground."""
    agl = heights_agl(trace, parts, target, vehicle, level_amsl_m)
    for _ in range(ROUNDS):
        lowest = np.argsort(agl, kind="stable")[:AT_ONCE]
        few = parts.take(lowest)
        middle = TraceParts(few.middle, few.middle, few.stretch)
        known = float(heights_agl(trace, middle, target, vehicle, level_amsl_m).min())
        open_ = lowest[(agl[lowest] < known - ENOUGH_M) & (few.size > SMALLEST_M)]
        if not len(open_):
            break
        new = parts.take(open_).split(PIECES)
        kept = np.ones(len(parts), np.bool_)
        kept[open_] = False
        old = parts.take(kept)
        parts = TraceParts(
            np.append(old.start, new.start), np.append(old.end, new.end), np.append(old.stretch, new.stretch)
        )
        agl = np.append(agl[kept], heights_agl(trace, new, target, vehicle, level_amsl_m))
    k = int(agl.argmin())
    if not np.isfinite(agl[k]):
        return None
    at_m = float(np.interp(parts.middle[k], trace.u, trace.along))
    return LowestAgl(float(agl[k]), at_m, int(trace.seq[parts.stretch[k]]))


def heights_agl(
    trace: MissionTrace, parts: TraceParts, target: Target, vehicle: Vehicle, level_amsl_m: float
) -> Floats:
    """(N,) a lower bound of the height above ground of the returns from all of each part; -inf over unknown ground."""
    rule, air, n = RULES[vehicle.autopilot], trace.world.airspace, len(parts)
    limits = replace(vehicle.limits, min_agl_m=0.0, max_agl_m=None, horizontal_clearance_m=0.0, altitude_error_m=0.0)
    places = places_of_returns(trace, parts, target, vehicle)
    start, reach, half, nearest = places.lines_home()
    end = np.tile(target.en, (n, 1))
    wide = places.wide_m * air.scale
    extra, aside = half + wide + places.bow_m * air.scale, places.aside_m * air.scale
    out = np.full(n, np.inf)

    def ground(a: Floats, b: Floats, width: Floats) -> level_lines.LevelLines:
        return level_lines.over(air, a, b, limits, float(width.max(initial=0.0)))

    if rule.climbs_first:
        there_m = at_home_m(limits)
        away = np.flatnonzero(np.hypot(*(end - start).T) > there_m)
        cone = rule.cone_amsl_m(target.cone_amsl_m, np.maximum(nearest, there_m))
        level = np.maximum(places.low, np.minimum(level_amsl_m, cone))
        for i in alike_in_width(extra, away):
            out[i] = level[i] - ground(start[i], end[i], extra[i]).clear_m
        begin = places.regions[:, :4]
        beside = np.hypot(*(begin[:, 2:] - begin[:, 1:2]).transpose(2, 0, 1)).max(axis=1) + wide
        runs = np.flatnonzero(np.hypot(*(begin[:, 1] - begin[:, 0]).T) > TINY_M)
        for i in alike_in_width(beside, runs):
            met = ground(np.ascontiguousarray(begin[i, 0]), np.ascontiguousarray(begin[i, 1]), beside[i])
            out[i] = np.minimum(out[i], places.low[i] - met.clear_m)
        return out
    climb = vehicle.climb_m_s / vehicle.speed_max_m_s if np.isfinite(vehicle.climb_m_s) else 1.0
    for i in alike_in_width(extra + aside, np.arange(n)):
        met = ground(start[i], start[i], (reach + wide + aside)[i])
        out[i] = np.minimum(level_amsl_m, places.low[i]) - met.clear_m
        step = end[i] - start[i]
        length = np.hypot(*step.T)
        for a, b in pairwise(ASIDE):
            met = ground(start[i] + a * step, start[i] + b * step, (extra + (1.0 - a) * aside)[i])
            flown = np.maximum(met.piece_s_m + (a * length - reach[i] - aside[i])[met.piece_line], 0.0)
            reached = np.minimum(level_amsl_m, places.low[i][met.piece_line] + climb * flown)
            np.minimum.at(out, i[met.piece_line], reached - met.piece_clear_m)
    high = target.ground_amsl_m + CIRCLE_ABOVE_M
    circle = circle_home_m(rule.circle_m(high), vehicle, high)
    over = ground(target.en[None], target.en[None], np.array([circle * air.scale]))
    return np.asarray(np.minimum(out, level_amsl_m - over.clear_m[0]))
