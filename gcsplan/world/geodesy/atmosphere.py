"""The standard atmosphere (ISA 1976), below the tropopause: how thin the air is at an altitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats

__all__ = ["TROPOPAUSE_M", "density_ratio", "true_per_indicated"]

TROPOPAUSE_M = 11_000.0


def density_ratio(amsl_m: ArrayLike) -> Floats:
    """Air density over that at sea level; above the tropopause the value there."""
    height = np.minimum(np.asarray(amsl_m, dtype=np.float64), TROPOPAUSE_M)
    return np.asarray((1.0 - 2.25577e-5 * height) ** 4.2559)


def true_per_indicated(amsl_m: ArrayLike) -> Floats:
    """True airspeed over the equivalent one that an airspeed sensor indicates, at an altitude (ArduPilot's EAS2TAS)."""
    return np.asarray(1.0 / np.sqrt(density_ratio(amsl_m)))
