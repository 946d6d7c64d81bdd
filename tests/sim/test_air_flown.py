"""A rehearsal's battery is that of the air flown, and a flight that comes too late is not flown as planned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.app.rehearse import rehearse
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Rehearsal
from tests.check.test_energy import ENERGY, integral_j, planned

BATTERY_J = 400 * 3600.0


def flown(weather: Weather | None = None, energy: dict[str, float] = ENERGY, runs: int = 1) -> Rehearsal:
    return rehearse(planned(energy, speed_m_s=[3, 8]), weather=weather, runs=runs, seed=3)


@pytest.mark.nightly_but("0.0-0.0")
@pytest.mark.slow
@pytest.mark.parametrize(("wind_m_s", "from_deg"), [(0.0, 0.0), (4.0, 40.0), (5.0, 220.0), (6.0, 130.0)])
def test_the_battery_is_the_integral_over_the_air_flown(wind_m_s: float, from_deg: float) -> None:
    result = flown(Weather(wind_m_s, from_deg))
    trace, [v] = result.flown[0], result.vehicles
    wind = tuple(-wind_m_s * f(math.radians(from_deg)) for f in (math.sin, math.cos))
    wanted_j = integral_j(trace.times_s, trace.points, (wind[0], wind[1]))
    assert v.battery_used_percent == pytest.approx(100 * wanted_j / BATTERY_J, rel=0.01)


@pytest.mark.nightly
def test_a_head_wind_costs_time_and_metres_and_a_late_flight_is_not_as_planned() -> None:
    calm = flown()
    assert calm.safe is True
    ahead = flown(Weather(5.0, 46.0))  # the track leads to the north-east
    kinds = {b.kind for b in ahead.breaches}
    assert "late" in kinds
    assert ahead.safe is False
    assert ahead.error() is not None
    used, told = ahead.vehicles[0].battery_used_percent, calm.vehicles[0].battery_used_percent
    assert used is not None
    assert told is not None
    later = (ahead.vehicles[0].end_s[0] - ahead.vehicles[0].depart_s) / calm.vehicles[0].end_s[0]
    assert later > 1.1
    assert used > 1.2 * told


@pytest.mark.nightly
def test_the_worst_run_counts_and_a_reserve_that_is_used_is_no_flight_as_planned() -> None:
    gusty = Weather(6.0, None, 1.5)
    result = flown(gusty, runs=4)
    each = [rehearse(planned(ENERGY, speed_m_s=[3, 8]), weather=gusty, runs=n, seed=3) for n in (1, 2)]
    most = [r.vehicles[0].battery_used_percent for r in (*each, result)]
    assert most == sorted(most, key=lambda p: p or 0.0)
    calm_j = (flown().vehicles[0].battery_used_percent or 0.0) / 100.0 * BATTERY_J
    tight = flown(Weather(6.0, 46.0), ENERGY | {"battery_wh": calm_j / 3600.0 / 0.79})
    assert "battery" in {b.kind for b in tight.breaches}
    assert np.isfinite(tight.vehicles[0].arrive_s).all()
