"""The fastest that a multicopter flies along a slope with its largest lean angle, against its drag.

The airframe is that of ArduPilot's simulated quadrotor (SIM_Frame.h: 3 kg, 15.08 m/s at 45° of lean, 593 m above sea
level), whose drag is a body's, which grows with the square of the speed through the air, and the rotors', which grows
with the speed itself. An airframe with less drag is faster. Along the body's longitudinal axis drag balances gravity,
for the thrust is across it; so down a slope, where the body leans further from its course, the same angle is slower.
"""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.vehicle import LARGEST_LEAN_DEG
from gcsplan.world.geodesy.atmosphere import density_ratio

__all__ = ["lean_needed_deg", "leaning_m_s"]

BODY, ROTORS = 0.003627, 0.02532
"""Drag at sea level per weight, of the body at 1 m/s, and of the rotors at 1 m/s with a thrust of one weight."""

_ROUNDS = 30

MEASURED_AMSL_M, SPARE = 593.0, 1.007
"""Where the drag was measured, and what a speed should be below the fastest where the altitude is not known."""


def leaning_m_s(lean_deg: float | Floats, slope_rad: Floats, amsl_m: Floats) -> Floats:
    """(N,) the fastest speeds in space along slopes (N,), climbs positive, at altitudes (N,), in still air.

    ``lean_deg``: one for all, or (N,).
    """
    thin = density_ratio(amsl_m)
    lean = np.radians(lean_deg)
    tilt = np.clip(lean + slope_rad, None, np.radians(80.0))
    thrust = np.ones_like(tilt)
    for _ in range(_ROUNDS):
        rotors = ROTORS * np.sqrt(thin * thrust)
        along = 2.0 * np.sin(lean) / (rotors + np.sqrt(rotors**2 + 4.0 * BODY * thin * np.sin(lean)))
        across = along * np.tan(tilt)
        thrust = np.maximum(np.cos(lean) + BODY * thin * across * np.abs(across) + rotors * across, 0.01)
    return np.asarray(along / np.cos(tilt))


def lean_needed_deg(speed_m_s: float, amsl_m: float | None = None) -> float:
    """The lean, in whole degrees, that level flight at a speed needs at an altitude, at most `LARGEST_LEAN_DEG` + 1.

    Without an altitude: with a little to spare, where the drag was measured.
    """
    wanted = SPARE * speed_m_s if amsl_m is None else speed_m_s * (1.0 - 1e-3)
    leans = np.arange(1.0, LARGEST_LEAN_DEG + 1.0)
    height = np.full(len(leans), MEASURED_AMSL_M if amsl_m is None else amsl_m)
    enough = np.flatnonzero(leaning_m_s(leans, np.zeros(len(leans)), height) >= wanted)
    return float(leans[enough[0]]) if len(enough) else LARGEST_LEAN_DEG + 1.0
