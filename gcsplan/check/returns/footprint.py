"""Where returns from parts of a mission to a place are, seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.return_rules import RETURN_RULES
from gcsplan.check.motion.stopping import about_turn_m, levels_off_m
from gcsplan.check.returns.trace import TINY_M, MissionTrace, TraceParts
from gcsplan.vehicle import Vehicle
from gcsplan.world import level_lines
from gcsplan.world.geometry import hulls

TANGENT = 2.1
"""The tangents at a parabola's ends cross at twice its height; the rest allows for the cubic term of the true curve."""


@dataclass(frozen=True, slots=True)
class Target:
    """The end of a return, on ``ground_amsl_m``; ``cone_amsl_m`` is the altitude of the cone's tip."""

    east_m: float
    north_m: float
    ground_amsl_m: float
    cone_amsl_m: float

    @property
    def en(self) -> Floats:
        """(2,) east, north."""
        return np.array([self.east_m, self.north_m])


@dataclass(frozen=True, eq=False)
class ReturnPlaces:
    """Where N returns are seen from above: the convex hulls of ``regions`` (N, 9, 2), widened by ``wide_m`` (N,).

    A return begins in the hull of the first four points; the fifth is home; the others bound how far a line home may be
    bent, by ``bow_m`` (N,) at most. ``corner`` (N,): whether it may begin aside of the line through the first two.
    ``low``, ``high`` (N,): the altitudes AMSL at which it begins. ``aside_m`` (N,): how far a plane's turn about leads
    aside at its beginning; on the way home this fades to 0. ``inner`` (N, 5, 2): the same as ``regions`` for returns
    that begin at once, on the mission's own line: its ends, home, and what bounds the bend.
    """

    regions: Floats
    wide_m: Floats
    bow_m: Floats
    corner: Bools
    low: Floats
    high: Floats
    aside_m: Floats
    inner: Floats

    def lines_home(self) -> tuple[Floats, Floats, Floats, Floats]:
        """One line home for each region, widened so that it covers the region, still without `wide_m` and `aside_m`.

        Its start (N, 2); how far from there returns begin; its half width; the least distance home at which returns
        begin, all (N,).
        """
        begin, home = self.regions[:, :4], self.regions[:, 4]
        out = 0.5 * (begin[:, 0] + begin[:, 1]) - home
        far = np.hypot(*out.T)
        axis = np.divide(out, far[:, None], out=np.tile([1.0, 0.0], (len(far), 1)), where=far[:, None] > TINY_M)
        from_home = begin - home[:, None]
        along = (from_home * axis[:, None]).sum(axis=-1)
        beside = np.abs(from_home[..., 1] * axis[:, None, 0] - from_home[..., 0] * axis[:, None, 1])
        start = home + np.maximum(along.max(axis=1), 0.0)[:, None] * axis
        half = np.where(along < 0.0, np.hypot(*from_home.transpose(2, 0, 1)), beside).max(axis=1)
        reach = np.hypot(*(begin - start[:, None]).transpose(2, 0, 1)).max(axis=1)
        return np.ascontiguousarray(start), reach, half, hulls.to_points(begin, home)

    def swept(self, some: Indices, scale: float) -> level_lines.Swept:
        """The regions of some returns, which have all the same kind of beginning."""
        corner = bool(self.corner[some].any())
        wide = (self.wide_m + self.aside_m)[some] * scale
        inner = self.inner[some]
        if corner:
            return level_lines.Swept(self.regions[some], wide, begin=4, inner=inner)
        return level_lines.Swept(self.regions[some][:, STRAIGHT], wide, inner=inner)


STRAIGHT = (0, 1, 4, 5, 6)
"""The points of `ReturnPlaces.regions` that are needed if all returns begin on one line."""


def places_of_returns(trace: MissionTrace, sides: TraceParts, target: Target, vehicle: Vehicle) -> ReturnPlaces:
    """Where the returns from parts of the trace to ``target`` are.

    A return lies between the line that is straight in the plane and the one that is straight in degrees. One curves
    away from the other as a parabola, which lies within the triangle of its ends and the crossing of its tangents.
    """
    frame = trace.world.frame
    begin, levels = trace.beginnings(sides)
    every = np.concatenate([begin, trace.points(sides.end)[:, None, :2]], axis=1)
    goal = frame.to_degrees(target.east_m, target.north_m)
    tangents, bows = [], []
    for k in range(every.shape[1]):
        at = every[:, k]
        degrees = frame.to_degrees(*at.T)
        turn = (goal[1] - degrees[:, 1] + 180.0) % 360.0 - 180.0
        curved = frame.to_plane(0.5 * (degrees[:, 0] + goal[0]), degrees[:, 1] + 0.5 * turn)
        straight = 0.5 * (at + target.en)
        tangents.append(straight + TANGENT * (curved - straight))
        bows.append(TANGENT / 2.0 * np.hypot(*(curved - straight).T))
    home = np.broadcast_to(target.en, (len(sides), 1, 2))
    regions = np.concatenate([begin, home, np.stack(tangents[:-1], axis=1)], axis=1)
    inner = np.concatenate([every[:, [0, -1]], home, np.stack([tangents[0], tangents[-1]], axis=1)], axis=1)
    low, high = trace.heights(sides)
    down_m, up_m = levels_off_m(vehicle)
    aside = np.zeros(len(sides))
    if not RETURN_RULES[vehicle.autopilot].climbs_first:
        away = np.hypot(*(begin[:, 0] - target.en).T)
        speed = trace.speed_m_s[sides.stretch]
        aside = np.array([about_turn_m(vehicle, *one) for one in zip(speed, high, away, strict=True)])
    return ReturnPlaces(
        regions, trace.track_m[sides.stretch], np.max(bows, axis=0), (begin[:, 3] != begin[:, 1]).any(axis=1),
        low - down_m * levels[:, 0], high + up_m * levels[:, 1], aside, inner,
    )  # fmt: skip
