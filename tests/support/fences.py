"""Fences for tests: a frame, areas and circles as items, and a mission that flies past them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.path import Path as FlightPath
from gcsplan.world.world import World

FRAME = Frame(36.6, -84.3)


COPTER = Autopilot.ARDUCOPTER


metres = st.floats(-20_000, 20_000)


def corners(command: int, *places: tuple[float, float]) -> list[MissionItem]:
    """A polygon's items at (latitude, longitude) each."""
    count = (float(len(places)), 0.0, 0.0, 0.0)
    return [MissionItem(command, 0, count, round(lat * 1e7), round(lon * 1e7)) for lat, lon in places]


OVER = [[0.0, 0, 420], [3000, 0, 420], [6000, 1000, 420]]


def mission_in(where: World, craft: Vehicle) -> Mission:
    return build_mission(FlightPath(np.array(OVER)), where, craft, (36.6, -84.3), Order())
