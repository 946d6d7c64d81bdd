"""Curves of missions, splines and arcs, take as long in the built-in simulator as the check tells."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.check.judge import judge
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.track import make_track
from gcsplan.vehicle import Autopilot
from tests.support.worlds import vehicle, world

FLAT = world(half_m=4000.0)


def at(command: int, east: float, north: float = 0.0, up: float = 100.0, p1: float = 0.0) -> MissionItem:
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(east, north))
    return MissionItem(command, m.RELATIVE, (p1, 0.0, 0.0, 0.0), m.degrees_e7(lat), m.degrees_e7(lon), up)


@pytest.mark.nightly_but("left-5.0", "half-15.0", "climbing-5.0", "spline-15.0")
@pytest.mark.slow
@pytest.mark.parametrize("speed_m_s", [5.0, pytest.param(15.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "curve",
    [
        pytest.param(at(cmd.ARC_WAYPOINT, 1500, p1=180.0), id="half", marks=pytest.mark.slow),
        pytest.param(at(cmd.ARC_WAYPOINT, 1500, p1=-60.0), id="left"),
        pytest.param(at(cmd.ARC_WAYPOINT, 1500, p1=300.0), id="long", marks=pytest.mark.slow),
        pytest.param(at(cmd.ARC_WAYPOINT, 1200, 300, 160.0, 90.0), id="climbing", marks=pytest.mark.slow),
        pytest.param(at(cmd.SPLINE_WAYPOINT, 1200, 300), id="spline"),
        pytest.param(at(cmd.WAYPOINT, 1200, 300), id="straight", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_curve_takes_as_long_as_told(curve: MissionItem, speed_m_s: float) -> None:
    """Two models that share no code; a curve is one leg of the autopilot, however many chords stand for it."""
    copter = replace(vehicle(Autopilot.ARDUCOPTER), speed_max_m_s=speed_m_s, leg_jerk_m_s3=1.0, lean_angle_deg=45.0)
    items = (at(cmd.TAKEOFF, 0), at(cmd.WAYPOINT, 500), curve, at(cmd.WAYPOINT, 2000), at(cmd.LAND, 2000, 0, 0))
    mission = Mission(Autopilot.ARDUCOPTER, Home.at(36.6, -84.3, 300.0), items)
    told = judge(mission, copter, FLAT)
    flown = fly([make_track(mission, copter, FLAT, Kinematics.of(copter))], [0.0])
    assert told.time_s == pytest.approx(float(flown.times_s[-1]), rel=4e-3)
