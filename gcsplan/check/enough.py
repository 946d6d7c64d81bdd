"""By how much a limit is broken, so that who moves by that much keeps it.

The exact check resolves the ground beside a leg as finely as it needs to say yes or no; how deep it is broken it gives
to a tenth. What is told is what was tried: the leg, moved by it, passes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.world.airspace import Airspace, Legs, Violation
from gcsplan.world.limits import Limits

__all__ = ["enough", "rounded_up"]

UPWARD = {"min_agl": 1.0, "terrain_clearance": 1.0, "max_agl": -1.0}
"""Which way a leg is moved to keep a limit of height."""

TRIES = 8
CENTIMETRE = 0.01


def rounded_up(by: float) -> float:
    """``by`` in whole hundredths, never less."""
    return round(math.ceil(by * 100.0 - 1e-7) / 100.0, 2) if math.isfinite(by) and by < 1e9 else by


def enough(v: Violation, mine: NDArray[np.intp], legs: Legs, limits: Limits, air: Airspace) -> Violation:
    """``v`` with a ``by`` in hundredths that is enough for all of the legs ``mine``, which are one stretch's."""
    by = rounded_up(v.by)
    if v.kind in UPWARD:
        by = _lift(v, by, mine, legs, limits, air)
    if v.kind == "coverage":
        return v
    below = v.kind in ("min_agl", "terrain_clearance", "zone")
    return replace(v, by=by, value=v.limit - by if below else v.limit + by)


def _lift(v: Violation, by: float, mine: NDArray[np.intp], legs: Legs, limits: Limits, air: Airspace) -> float:
    alone = Limits(
        min_agl_m=limits.min_agl_m if v.kind == "min_agl" else -1e9,
        max_agl_m=limits.max_agl_m if v.kind == "max_agl" else None,
        horizontal_clearance_m=limits.horizontal_clearance_m if v.kind == "terrain_clearance" else 0.0,
    )
    for _ in range(TRIES):
        lift = np.array([0.0, 0.0, UPWARD[v.kind] * by])
        moved = Legs(
            legs.start[mine] + lift, legs.end[mine] + lift, legs.column[mine], legs.track_error_m[mine],
            legs.altitude_error_m[mine],
        )  # fmt: skip
        left = [w.by for w in air.examine(moved, alone).violations if w.kind == v.kind]
        if not left:
            break
        by = rounded_up(by + max(max(left), CENTIMETRE))
    return by
