"""The border of the loaded terrain: the least cost of a path that crosses it, and whether any path can.

A surface is a window of the terrain that a mission knows (`Surface.goes_on`). A bound or a proof found within the
window holds for all paths if every path that crosses the border costs at least as much.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.outlines import few_corners
from gcsplan.world.geometry.path import runs_m
from gcsplan.world.geometry.zones import Circle, Zone

SIDE_PIECES = 8
"""Straight pieces that approximate one side of a window; in the plane a side is curved."""
INSET_CELLS = 1.0
"""Cells along the border that count as beyond it, in addition to the distance that paths keep from unknown ground."""
MOST_ENCLOSING_CORNERS = 2000
"""Corners of one polygon in that test; of a polygon with more, a smaller one inside it counts."""
ENCLOSING_SHRUNK_M = 0.01
"""Metres by which zones are shrunk in the test whether they enclose a place."""


def goes_on(problem: Problem) -> bool:
    """Whether the terrain goes on beyond the surface and a path there could matter to ``problem``.

    Over flat ground it does not matter if no zone lies across the border: the parts of a path beyond the border can be
    laid along it at the same altitudes and no longer, or as long as before by zigzagging beside it.
    """
    surface = problem.airspace.surface
    if not any(surface.goes_on):
        return False
    if surface.ground_m.size > 4 or surface.level_m is None:
        return True
    reach = _reach_m(problem.airspace, problem.limits)
    corners = surface.grid.to_plane([0, surface.ground_m.shape[1] - 1], [surface.ground_m.shape[0] - 1, 0])
    low, high = corners.min(axis=0) + reach, corners.max(axis=0) - reach
    terminals = np.array(terminals_of(problem))
    if not ((terminals > low) & (terminals < high)).all():
        return True
    first, last = (problem.airspace.zone_table.box_m + np.repeat([-reach, reach], 2)).reshape(-1, 2, 2).swapaxes(0, 1)
    within = ((first > low) & (last < high)).all(axis=1)
    beyond = ((first > high) | (last < low)).any(axis=1)
    return not (within | beyond).all()


def exit_cost(problem: Problem) -> float:
    """The least cost of a path that leaves the surface where the terrain goes on, in the objective's unit;
    inf if `goes_on` is false."""
    if not goes_on(problem):
        return math.inf
    lines, bow_m = border(problem)
    terminals = np.array(terminals_of(problem))
    legs = runs_m(terminals)
    more_m = min(
        _past(a, b, lines) - leg for a, b, leg in zip(terminals[:-1], terminals[1:], legs.tolist(), strict=True)
    )
    track_m = float(legs.sum()) + max(more_m - 4.0 * bow_m, 0.0)
    heights = [problem.start[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None), problem.goal[2]]
    rise_m = sum(abs(b - a) for a, b in pairwise(heights))
    return float(problem.least_cost(track_m, rise_m) * (1.0 - 1e-9))  # arithmetic is rounded


def within_m(problem: Problem) -> float:
    """Metres from the straight track to the nearest border where the terrain goes on; inf without one."""
    if not goes_on(problem):
        return math.inf
    import shapely  # needed for messages only

    lines, _ = border(problem)
    terminals = terminals_of(problem)
    way = shapely.LineString(terminals) if len(set(terminals)) > 1 else shapely.Point(terminals[0])
    return float(shapely.distance(shapely.MultiLineString(list(lines)), way))


def margin_for(problem: Problem, cost: float) -> float:
    """Metres around the terminals within which every path of at most ``cost`` lies, with the distance kept from unknown
    ground; inf if ``cost`` is infinite or metres along the track cost nothing."""
    if math.isinf(cost):
        return math.inf
    legs = [math.dist(a, b) for a, b in pairwise(terminals_of(problem))]
    straight_m, track_m = sum(legs), cost
    if problem.rates is not None:
        level, _ = problem.rates
        if level <= 0.0:
            return math.inf
        track_m = cost / level
    off_m = 0.5 * math.sqrt(max(track_m**2 - straight_m**2, 0.0))
    return off_m + 2.0 * _reach_m(problem.airspace, problem.limits) + 1.0


def border(problem: Problem) -> tuple[Floats, float]:
    """(K, 2, 2) lines that every path crosses which leaves the surface where the terrain goes on; and by how many
    metres the true, curved border may bow away from them."""
    surface, field = problem.airspace.surface, problem.airspace.field
    rows, cols = surface.ground_m.shape
    keep = _reach_m(problem.airspace, problem.bound_limits) / np.array([field.step_x, field.step_y])
    if surface.ground_m.size > 4:  # cells, not flat ground
        keep += INSET_CELLS
    c0, r0 = np.minimum(keep, 0.49 * np.array([cols - 1, rows - 1])).tolist()
    c1, r1 = cols - 1 - c0, rows - 1 - r0
    f = np.linspace(0.0, 1.0, 2 * SIDE_PIECES + 1)
    along_c, along_r, one = f * (cols - 1), f * (rows - 1), np.ones_like(f)
    sides = [(c0 * one, along_r), (along_c, r0 * one), (c1 * one, along_r), (along_c, r1 * one)]
    met = np.array([side for side, more in zip(sides, surface.goes_on, strict=True) if more])
    at = surface.grid.to_plane(met[:, 0], met[:, 1])
    lines = np.stack([at[:, :-2:2], at[:, 2::2]], axis=2)
    off_m = np.hypot(*np.moveaxis(at[:, 1::2] - lines.mean(axis=2), -1, 0)).max()
    return lines.reshape(-1, 2, 2), 1.1 * float(off_m) + surface.grid.error_m


def enclosed(problem: Problem) -> bool:
    """Whether walls separate two terminals from each other and at least one of them from the border: then no path can
    join them, not even over terrain beyond the surface.

    Walls are cells whose ground is over max AMSL, and the shapes of zones that can be passed neither over nor under.
    """
    return _by_ground(problem) or _by_zones(problem)


def _by_ground(problem: Problem) -> bool:
    """`enclosed` by cells of the raster alone. A cell is shut if its lowest corner plus min AGL is over max AMSL, or if
    a corner is unknown. Cells that touch at a corner are joined. Also true if a terminal lies in a shut cell."""
    from scipy.ndimage import label

    surface, limits = problem.airspace.surface, problem.bound_limits
    top = surface.top_m
    lowest = np.minimum(np.minimum(top[:-1, :-1], top[:-1, 1:]), np.minimum(top[1:, :-1], top[1:, 1:]))
    lowest[np.isnan(top[:-1, :-1] + top[:-1, 1:] + top[1:, :-1] + top[1:, 1:])] = np.nan
    ceiling = math.inf if limits.max_amsl_m is None else limits.max_amsl_m - limits.altitude_error_m
    is_open = lowest + limits.min_agl_m + limits.altitude_error_m <= ceiling + 1e-6
    parts, _ = label(is_open, structure=np.ones((3, 3)))
    rows, cols = top.shape
    at = surface.grid(*np.array(terminals_of(problem)).T)
    cells = np.clip(np.floor(at).astype(int), 0, [cols - 2, rows - 2])
    # Paths keep `reach` away from the border, so a strip of that width and two more cells counts as the border.
    reach_m, field = _reach_m(problem.airspace, limits), problem.airspace.field
    c, r = (min(math.ceil(reach_m / s) + 2, n - 1) for s, n in ((field.step_x, cols), (field.step_y, rows)))
    west, north, east, south = surface.goes_on
    sides = [parts[:, :c] if west else parts[:, :0], parts[:r] if north else parts[:0]]
    sides += [parts[:, -c:] if east else parts[:, :0], parts[-r:] if south else parts[:0]]
    outside = {int(k) for side in sides for k in np.unique(side)} - {0}
    numbers = {-1 if int(parts[r, c]) in outside else int(parts[r, c]) for c, r in cells}
    return 0 in numbers or len(numbers) > 1


def _by_zones(problem: Problem) -> bool:
    """`enclosed` by zones alone, over ground of any height."""
    import shapely  # needed only where no path was found

    air, limits = problem.airspace, problem.bound_limits
    top = math.inf if limits.max_amsl_m is None else limits.max_amsl_m - limits.altitude_error_m
    reach = limits.horizontal_clearance_m + limits.track_error_m - ENCLOSING_SHRUNK_M - problem.bound_spare_m
    bottoms, tops = air.zone_table.levels_m()
    # A wall reaches from the ground to above the ceiling everywhere.
    up = np.isposinf(tops) | ((tops > top) & ~air.zone_table.over_ground[:, 1])
    walls = [_shape(air.zones[k], reach) for k in np.flatnonzero(np.isneginf(bottoms) & up).tolist()]
    if not walls:
        return False
    surface = air.surface
    rows, cols = surface.ground_m.shape
    f = np.linspace(0.0, 1.0, SIDE_PIECES + 1)[:-1]
    c = np.concatenate([f, 1.0 + 0.0 * f, 1.0 - f, 0.0 * f]) * (cols - 1)
    r = np.concatenate([0.0 * f, f, 1.0 + 0.0 * f, 1.0 - f]) * (rows - 1)
    window = shapely.Polygon(surface.grid.to_plane(c, r))
    free = [p for p in shapely.get_parts(window.difference(shapely.union_all(walls))) if p.area > 0.0]
    lines = shapely.MultiLineString(list(border(problem)[0]))
    leaves = [bool(p.intersects(lines)) for p in free]
    numbers = set()
    for terminal in shapely.points(terminals_of(problem)):
        at = [k for k, p in enumerate(free) if p.intersects(terminal)]
        if not at:
            return False  # the terminal is in a wall, but only by rounding: `check_ends` has passed it
        numbers.add(-1 if any(leaves[k] for k in at) else at[0])
    return len(numbers) > 1


def _shape(zone: Zone, reach_m: float) -> Any:
    """The polygon of a zone grown by ``reach_m``; slightly too small, because chords lie inside their arcs."""
    import shapely

    if isinstance(zone.shape, Circle):
        return shapely.Point(zone.shape.east_m, zone.shape.north_m).buffer(zone.shape.radius_m + reach_m, quad_segs=64)
    few = few_corners(zone.shape.vertices, MOST_ENCLOSING_CORNERS, outward=False)
    if few is None:
        return shapely.Polygon()
    shape = shapely.Polygon(few)
    if not shapely.is_valid(shape):  # to make a valid one valid takes minutes where edges lie close to each other
        shape = shapely.make_valid(shape)
    return shape.buffer(reach_m, quad_segs=16) if reach_m > 0.0 else shape


def _reach_m(air: Airspace, limits: Limits) -> float:
    """Metres that paths keep from unknown ground, with one percent and `ENCLOSING_SHRUNK_M` added."""
    return air.beside_m(limits) * 1.01 + ENCLOSING_SHRUNK_M


def _past(a: Floats, b: Floats, lines: Floats) -> float:
    """Length of the shortest track from ``a`` via one of ``lines`` (K, 2, 2) to ``b``, by reflection at the line."""
    p, d = lines[:, 0], lines[:, 1] - lines[:, 0]
    length = np.maximum(np.hypot(*d.T), 1e-9)
    u = d / length[:, None]
    ta, tb = (((x - p) * u).sum(axis=1) for x in (a, b))
    ya, yb = (np.abs((x - p)[:, 0] * u[:, 1] - (x - p)[:, 1] * u[:, 0]) for x in (a, b))
    both = ya + yb
    t = np.where(both > 1e-9, ta + (tb - ta) * ya / np.maximum(both, 1e-9), 0.5 * (ta + tb)).clip(0.0, length)
    at = p + t[:, None] * u
    return float((np.hypot(*(at - a).T) + np.hypot(*(at - b).T)).min())
