"""Altitudes in whole centimetres, so that rounding makes no leg of a mission steeper than its limit.

A leg of some metres that climbs at the limit is made too steep by a centimetre. So all way points are rounded together:
to the nearest centimetre, unless a leg beside one is too steep then.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats

MOVED_CM = (0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 10.0, 15.0, 25.0)
"""How far altitudes may be moved, tried in turn; beyond what the planner keeps for rounding the check decides."""
MOST_CM = 1e9
"""More than any leg climbs."""
SPARE_CM = 0.05
"""Kept from each limit: PX4 stores altitudes as single-precision metres, and the check adds what is below home."""


def most_cm(run_m: Floats, slope: float) -> Floats:
    """(N,) centimetres that legs of ``run_m`` (N,) over the ground may rise at ``slope`` (rise over run, or inf)."""
    if np.isinf(slope):
        return np.full(len(run_m), np.inf)
    return np.asarray(np.maximum(100.0 * slope * run_m - SPARE_CM, 0.0))


def whole_cm(wanted_cm: Floats, up_cm: Floats, down_cm: Floats, fixed: Bools) -> NDArray[np.int_]:
    """(N,) whole centimetres near ``wanted_cm`` (N,), of which leg k climbs at most ``up_cm[k]`` and descends at most
    ``down_cm[k]`` (N - 1,), inf for no limit. The first, the last and ``fixed`` (N,) ones are the nearest centimetre.

    No altitude is moved farther than one of them must be, in steps of `MOVED_CM`. Where no such altitudes are found,
    all are the nearest centimetre.
    """
    near = np.rint(wanted_cm).astype(int)
    rise = np.diff(near)
    if not ((rise > up_cm) | (-rise > down_cm)).any():
        return near
    fixed = fixed.copy()
    fixed[[0, -1]] = True
    up, down = (np.floor(np.minimum(most, MOST_CM)).astype(int) for most in (up_cm, down_cm))
    for moved in MOVED_CM:
        low = np.where(fixed, near, np.minimum(near, np.ceil(wanted_cm - moved).astype(int)))
        high = np.where(fixed, near, np.maximum(near, np.floor(wanted_cm + moved).astype(int)))
        found = _between(near, low, high, up, down)
        if found is not None:
            return found
    return near


def _between(
    near: NDArray[np.int_], low: NDArray[np.int_], high: NDArray[np.int_], up: NDArray[np.int_], down: NDArray[np.int_]
) -> NDArray[np.int_] | None:
    """Altitudes near ``near`` between ``low`` and ``high`` (N,) with legs that climb and descend by no more than ``up``
    and ``down`` (N - 1,); None if there are none."""
    low, high = low.copy(), high.copy()  # narrowed to those that can be reached from the first one
    for i in range(1, len(near)):
        low[i], high[i] = max(low[i], low[i - 1] - down[i - 1]), min(high[i], high[i - 1] + up[i - 1])
        if low[i] > high[i]:
            return None
    found = near.copy()
    for i in range(len(near) - 2, -1, -1):
        found[i] = min(max(found[i], low[i], found[i + 1] - up[i]), high[i], found[i + 1] + down[i])
    return found
