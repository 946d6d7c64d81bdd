"""Small worlds for tests: flat ground, a slope, a hill, all in a real frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Zone
from gcsplan.world.world import World

Height = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


def surface(height: Height | float, *, half_m: float = 12_000.0, step_m: float = 100.0) -> Surface:
    """A square grid of ``height(east_m, north_m)``, ``half_m`` from the origin to each side."""
    n = 2 * round(half_m / step_m) + 1
    axis = np.linspace(-half_m, half_m, n)
    east, north = np.meshgrid(axis, axis[::-1])
    ground = np.full((n, n), float(height)) if isinstance(height, float | int) else height(east, north)
    return Surface(ground, ground, GridMap.affine(-half_m, half_m, step_m, step_m))


def world(
    height: Height | float = 300.0, zones: Sequence[Zone] = (), *, lat_deg: float = 36.6, half_m: float = 12_000.0
) -> World:
    """A world around latitude ``lat_deg`` and longitude -84.3."""
    return World(Frame(lat_deg, -84.3), Airspace(surface(height, half_m=half_m), zones, scale=1.0))


def vehicle(autopilot: Autopilot = Autopilot.ARDUCOPTER, **limits: Any) -> Vehicle:
    """A vehicle with min AGL 60 m, track error 3 m and altitude error 5 m unless ``limits`` change them; an ArduPlane
    turns with 40 m."""
    given = {"min_agl_m": 60.0, "track_error_m": 3.0, "altitude_error_m": 5.0}
    return Vehicle(
        "uav1",
        1,
        autopilot,
        Limits(**(given | limits)),
        energy=Energy(120.0, 100.0, hover_w=400.0),
        turn_radius_m=40.0 if autopilot is Autopilot.ARDUPLANE else 0.0,
    )
