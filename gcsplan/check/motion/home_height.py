"""Home where the ground has two heights: relative altitudes count from it, so all of them are uncertain together."""

from __future__ import annotations

from dataclasses import replace

from gcsplan.figures import raised
from gcsplan.mavlink.mission.mission import Home
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.world import World


def spread_at_home_m(home: Home, world: World) -> float:
    """How far the greatest ground at home lies above the least one, m; 0 where they are one or unknown."""
    return world.spread_m(home.lat_e7 / 1e7, home.lon_e7 / 1e7)


def why_unknown(home: Home, vehicle: Vehicle, world: World) -> Note | None:
    """Why altitudes above home cannot be judged: its ground is not one number within the altitude error; else None."""
    spread_m, error_m = spread_at_home_m(home, world), vehicle.limits.altitude_error_m
    if spread_m <= error_m:
        return None
    lat, lon = home.lat_e7 / 1e7, home.lon_e7 / 1e7
    low_m = world.ground_amsl(lat, lon)
    return Note(
        "home_has_two_heights", lat=lat, lon=lon, low_m=low_m, high_m=low_m + spread_m, spread_m=raised(spread_m, 1)
    )


def with_error_of_home(vehicle: Vehicle, home: Home, world: World) -> Vehicle:
    """The vehicle with an altitude error that holds the uncertainty of home's ground too.

    Home is taken for its least height: from a higher one the whole mission is flown higher.
    """
    spread_m = spread_at_home_m(home, world)
    if spread_m == 0.0:
        return vehicle
    limits = vehicle.limits
    return replace(vehicle, limits=replace(limits, altitude_error_m=limits.altitude_error_m + spread_m))
