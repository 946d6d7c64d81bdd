"""The standard atmosphere: against its published table, and its integral."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from gcsplan.world.geodesy.atmosphere import TROPOPAUSE_M, density_ratio, true_per_indicated

TABLE = {-500.0: 1.2849, 0.0: 1.2250, 1000.0: 1.1117, 2000.0: 1.0066, 5000.0: 0.7364, 8000.0: 0.5258, 11000.0: 0.3648}
"""kg/m³ at geometric altitudes, U.S. Standard Atmosphere 1976; the formula takes them for geopotential ones."""


@pytest.mark.parametrize(("amsl_m", "kg_per_m3"), TABLE.items())
def test_the_density_is_that_of_the_standard_atmosphere(amsl_m: float, kg_per_m3: float) -> None:
    assert density_ratio(amsl_m) * 1.225 == pytest.approx(kg_per_m3, rel=3e-3)
    assert true_per_indicated(amsl_m) ** 2 * kg_per_m3 == pytest.approx(1.225, rel=3e-3)


def test_above_the_tropopause_it_stays_and_pressure_is_the_weight_of_air_above() -> None:
    assert density_ratio(20_000.0) == density_ratio(TROPOPAUSE_M) > 0.0
    height = np.linspace(0.0, TROPOPAUSE_M, 100_001)
    weight = trapezoid(9.80665 * 1.225 * density_ratio(height), height)
    assert weight == pytest.approx(101_325.0 - 22_632.0, rel=1e-3)
