"""By how much a limit is broken: a leg that is moved by this depth keeps the limit.

The exact check resolves the ground beside a leg only as finely as a yes or no needs, so its depth of a violation is
exact to about a tenth. The depth reported here was tried: the leg, moved by it, passes, unless `TRIES` steps found
no such depth.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Indices
from gcsplan.world.airspace import Airspace, Legs, Violation
from gcsplan.world.geometry.limits import Limits

__all__ = ["enough", "rounded_up"]

UPWARD = {"min_agl": 1.0, "terrain_clearance": 1.0, "max_agl": -1.0}
"""The direction in which a leg is moved to keep a limit of height: 1 up, −1 down."""

TRIES = 8
LEAST_PART = 0.95
"""The part of a depth that suffices which is tried next, at least: the kernel's depth is mostly exact to 1 %."""

FINE_PART = 1 / 200
"""A depth that suffices is the answer if this part less of it does not."""

CENTIMETRE = 0.01


def rounded_up(by: float) -> float:
    """``by`` rounded up to whole hundredths; unchanged if it is not finite or is 1e9 or more."""
    return round(math.ceil(by * 100.0 - 1e-7) / 100.0, 2) if math.isfinite(by) and by < 1e9 else by


def enough(v: Violation, broken: Indices, legs: Legs, limits: Limits, air: Airspace) -> Violation:
    """``v`` with a ``by`` in hundredths that is enough for all of ``broken``, the legs that break the same limit."""
    if v.kind == "coverage":
        return v
    by = _lift(v, broken, legs, limits, air) if v.kind in UPWARD else rounded_up(v.by)
    below = v.kind in ("min_agl", "terrain_clearance", "zone")
    return replace(v, by=by, value=v.limit - by if below else v.limit + by)


def _lift(v: Violation, broken: Indices, legs: Legs, limits: Limits, air: Airspace) -> float:
    """The smallest sufficient move found by trial, in metres: up, or down under a ceiling."""
    alone = Limits(
        min_agl_m=limits.min_agl_m if v.kind == "min_agl" else -1e9,
        max_agl_m=limits.max_agl_m if v.kind == "max_agl" else None,
        horizontal_clearance_m=limits.horizontal_clearance_m if v.kind == "terrain_clearance" else 0.0,
    )

    def left(by: float) -> float:
        lift = np.array([0.0, 0.0, UPWARD[v.kind] * by])
        moved = Legs(
            legs.start[broken] + lift, legs.end[broken] + lift, legs.column[broken], legs.track_error_m[broken],
            legs.altitude_error_m[broken],
        )  # fmt: skip
        return air.deepest(moved, alone, v.kind)

    low, by = 0.0, rounded_up(v.by)
    for _ in range(TRIES):
        missing = left(by)
        if missing <= 0.0:
            break
        low, by = by, rounded_up(by + max(missing, CENTIMETRE))
    for _ in range(TRIES):
        less = rounded_up(max(0.5 * (low + by), LEAST_PART * by))
        if by - low <= FINE_PART * by or not low < less < by:
            break
        low, by = (low, less) if left(less) <= 0.0 else (less, by)
    return by
