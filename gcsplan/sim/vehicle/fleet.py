"""Loopback vehicles for missions: each stands at the start of its mission."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mavlink.mission.parameter_list import parameter_list
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import DEFAULT_LEAN_DEG, LARGEST_LEAN_DEG, Autopilot, Vehicle, lean_for_deg


def set_up(vehicle: Vehicle, home: Home) -> dict[str, float]:
    """The parameters of a simulated vehicle that is set up as its mission file says, by their first names."""
    listed = parameter_list(Mission(vehicle.autopilot, home, ()), vehicle)
    return {s.parameter.names[0].name: s.parameter.names[0].value(s.value) for s in listed}


def _set_up(mission: Mission) -> dict[str, float]:
    """The parameters that a copter of this mission has: it leans as far as its speed needs."""
    if mission.autopilot is not Autopilot.ARDUCOPTER:
        return {}
    lean_deg = min(max(DEFAULT_LEAN_DEG, math.ceil(lean_for_deg(mission.commanded_m_s))), LARGEST_LEAN_DEG)
    return {"ANGLE_MAX": 100.0 * lean_deg}


@contextmanager
def loopback_fleet(missions: Sequence[Mission]) -> Iterator[str]:
    """Serve a vehicle for each mission on one free port of this machine; yield the URL at which all of them answer."""
    vehicles = [
        LoopbackVehicle(
            mission.sysid,
            mission.autopilot,
            lat_deg=mission.home.lat_e7 / 1e7,
            lon_deg=mission.home.lon_e7 / 1e7,
            amsl_m=mission.home.amsl_m,
            name=mission.name,
            parameters=_set_up(mission),
        )
        for mission in missions
    ]
    with SimServer(vehicles, "udpin:127.0.0.1:0") as server:
        yield server.url_for_gcs
