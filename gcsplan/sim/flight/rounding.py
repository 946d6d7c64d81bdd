"""A corner of a simulated track, rounded as the vehicle flies it."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.true_speeds import SAME_M

SAG_M = 0.02
"""Metres by which the chords of a rounded corner may lie off its arc."""
FAST_M_S = 60.0
"""m/s: a corner that allows more than this, and is cut by at most half of `SAG_M`, is not rounded."""


def rounded(corner: Floats, kinematics: Kinematics) -> tuple[Floats, float]:
    """Return the nodes of a rounded corner, an odd number, and the speed that it allows.

    ``corner`` (3, 3): the way point between its neighbours. If there is no turn, the way point is the only node.
    """
    before, here, after = corner
    into, out = here - before, after - here
    run_in, run_out = math.hypot(into[0], into[1]), math.hypot(out[0], out[1])
    sharp = here[None, :]
    if min(run_in, run_out) <= SAME_M:
        return sharp, math.inf
    cross, dot = into[0] * out[1] - into[1] * out[0], into[0] * out[0] + into[1] * out[1]
    turn = min(abs(math.atan2(cross, dot)), math.pi - 1e-3)
    radius = kinematics.corner_radius_m(turn, min(run_in, run_out))
    corner_m_s = kinematics.corner_m_s(radius)
    straight = radius * (1.0 / math.cos(0.5 * turn) - 1.0) <= 0.5 * SAG_M and corner_m_s > FAST_M_S
    if straight or radius <= 0.0:
        return sharp, math.inf
    tangent = radius * math.tan(0.5 * turn)
    begin, end = here - into * (tangent / run_in), here + out * (tangent / run_out)
    side = math.copysign(1.0, cross)
    normal = side * np.array([-into[1], into[0]]) / run_in
    centre = begin[:2] + radius * normal
    parts = 2 * max(1, math.ceil(0.5 * turn / math.sqrt(8.0 * SAG_M / radius)))
    u = np.arange(parts + 1) / parts
    angle = side * turn * u
    spoke = begin[:2] - centre
    turned = np.column_stack(
        [spoke[0] * np.cos(angle) - spoke[1] * np.sin(angle), spoke[0] * np.sin(angle) + spoke[1] * np.cos(angle)]
    )
    height = np.interp(u, [0.0, 0.5, 1.0], [begin[2], here[2], end[2]])  # a change of slope is not rounded
    return np.column_stack([centre + turned, height]), corner_m_s
