"""The wind in an SITL: its parameters, set over a link and set back."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Link, run
from gcsplan.mavlink.link.session.session import discover
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.sitl.wind_parameters import WIND_PARAMETERS, change_steps, wind_parameters
from gcsplan.sim.vehicle import telemetry
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.parameters import REAL32, Parameters, StoredParameter
from gcsplan.sim.vehicle.server import SimServer
from tests.support.sitl_parts import COPTER, LAT, LON


def test_a_weather_is_told_in_sitls_parameters() -> None:
    assert wind_parameters(Weather(), 1) == {}
    assert wind_parameters(Weather(noise_m=1.0), 1) == {}
    given = wind_parameters(Weather(6.0, 270.0, 1.0), 1)
    assert given == pytest.approx(dict(zip(WIND_PARAMETERS, (6.0, -90.0, math.sqrt(2.0), 1.0), strict=True)))
    drawn = wind_parameters(Weather(6.0), 7)
    assert drawn == wind_parameters(Weather(6.0), 7)
    assert drawn != wind_parameters(Weather(6.0), 8)
    assert -180.0 <= drawn["SIM_WIND_DIR"] <= 180.0


def test_parameters_are_set_and_told_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    class Windy(Parameters):
        def __init__(self, *of_vehicle: Any) -> None:
            super().__init__(*of_vehicle)
            self._table |= {name: StoredParameter(REAL32, 0.25) for name in WIND_PARAMETERS}

    monkeypatch.setattr(telemetry, "Parameters", Windy)
    vehicle = LoopbackVehicle(1, COPTER, lat_deg=LAT, lon_deg=LON, amsl_m=500.0)
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        state = discover(link, 1, 5.0, listen_s=0.0)
        wanted = wind_parameters(Weather(6.0, 10.0, 1.0), 1)
        assert run(link.channel(1), change_steps(link.channel(1), state, {})) == {}
        channel = link.channel(1)
        assert run(channel, change_steps(channel, state, wanted)) == dict.fromkeys(WIND_PARAMETERS, 0.25)
        assert run(channel, change_steps(channel, state, dict.fromkeys(WIND_PARAMETERS, 0.25))) == pytest.approx(wanted)


def test_what_takes_no_wind_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcsplan.sim.sitl.wind_parameters.PARAMETER_TRIES", 2)
    monkeypatch.setattr("gcsplan.sim.sitl.wind_parameters.PARAMETER_ANSWER_S", 0.05)
    vehicle = LoopbackVehicle(1, COPTER, lat_deg=LAT, lon_deg=LON, amsl_m=500.0)
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        state = discover(link, 1, 5.0, listen_s=0.0)
        channel = link.channel(1)
        with pytest.raises(LinkError, match="does not take SIM_WIND_SPD"):
            run(channel, change_steps(channel, state, wind_parameters(Weather(6.0), 1)))
