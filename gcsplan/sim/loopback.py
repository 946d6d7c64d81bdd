"""Loopback vehicles for missions: each stands at the start of its mission."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from gcsplan.mavlink.mission.mission import Mission
from gcsplan.sim.server import SimServer
from gcsplan.sim.vehicle import LoopbackVehicle


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
        )
        for mission in missions
    ]
    with SimServer(vehicles, "udpin:127.0.0.1:0") as server:
        yield server.url_for_gcs
