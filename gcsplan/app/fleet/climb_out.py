"""The parts of a fixed wing's flight that a time table needs besides the path: climb-out, glide and final circle."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gcsplan.app.plan.model import VehiclePlan
from gcsplan.arrays import Floats
from gcsplan.check.motion.circles import PLANE_LOITER_RADIUS_M, circle_growth
from gcsplan.check.verdict import LegFigures
from gcsplan.world.world import World

__all__ = ["circling_m", "climb_out_and_glide", "climb_out_m_s"]


def climb_out_and_glide(v: VehiclePlan, world: World) -> tuple[Floats | None, Floats | None]:
    """The climb-out and the glide of a fixed wing, (K, 3) metres each; None where the flight has no such part."""
    if v.order.wing is None:
        return None, None
    legs = v.verdict.legs
    first = next(i for i, leg in enumerate(legs) if leg.on_path)
    down = [leg for leg in legs[first:] if leg.kind == "land"]
    return _line(legs[:first], world), _line(down, world) if down else None


def climb_out_m_s(v: VehiclePlan) -> Floats | None:
    """Speeds (K - 1,) of the parts of the climb-out, m/s; None: those of any leg, also for what is not a fixed wing."""
    if v.order.wing is None or v.request.vehicle.climb_out is None:
        return None
    legs = v.verdict.legs
    first = next(i for i, leg in enumerate(legs) if leg.on_path)
    return np.array([leg.length_m / leg.time_s if leg.time_s > 0.0 else 1.0 for leg in legs[:first]])


def circling_m(v: VehiclePlan) -> float:
    """Distance from its last point, m, that a vehicle may have while it circles there for good; 0 for any other end."""
    wing = v.order.wing
    if wing is None or v.request.end not in ("loiter", "rtl"):
        return 0.0  # circles for climbing are part of the motion
    highest = max(leg.end[2] for leg in v.verdict.legs)
    radius = wing.circle_m if v.request.end == "loiter" else PLANE_LOITER_RADIUS_M
    return max(radius, math.ceil(v.request.vehicle.turn_radius_m)) * circle_growth(highest)


def _line(legs: Sequence[LegFigures], world: World) -> Floats:
    places = np.array([legs[0].start, *(leg.end for leg in legs)])
    return np.column_stack([world.frame.to_plane(places[:, 0], places[:, 1]), places[:, 2]])
