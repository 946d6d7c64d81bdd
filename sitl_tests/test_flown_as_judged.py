"""Splines and jumps: a real ArduCopter flies the curves that the check judges, and the items in the judged order."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np

from gcsplan.check.judge import judge
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.sim.outcome import RehearsalPart, Terms
from gcsplan.sim.sitl.flights import rehearse_sitl
from gcsplan.sim.sitl.instances import sitl_instances
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from sitl_tests import sitl
from tests.support.worlds import world

TRACK_ERROR_M = 3.0


@sitl.needs(Autopilot.ARDUCOPTER, program=True)
def test_a_real_arducopter_flies_splines_and_jumps_as_they_are_judged() -> None:
    where = world(half_m=1500.0)
    craft = Vehicle(
        "uav1", 1, Autopilot.ARDUCOPTER, Limits(10.0, track_error_m=TRACK_ERROR_M, altitude_error_m=5.0),
        speed_max_m_s=8.0,
    )  # fmt: skip

    def at(command: int, east: float, north: float, z: float, hold: float = 0.0) -> MissionItem:
        lat, lon = where.frame.to_degrees(east, north)
        return MissionItem(command, m.RELATIVE, (hold, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    items = (
        at(cmd.TAKEOFF, 0, 0, 40), at(cmd.WAYPOINT, 0, 120, 40), at(cmd.SPLINE_WAYPOINT, 120, 180, 50),
        at(cmd.SPLINE_WAYPOINT, 240, 60, 40), at(cmd.WAYPOINT, 120, 0, 45), at(cmd.WAYPOINT, 60, -60, 45),
        at(cmd.SPLINE_WAYPOINT, 120, -120, 45, 2.0), at(cmd.WAYPOINT, 0, -120, 45),
        MissionItem(cmd.DO_JUMP, m.NO_POSITION, (6, 1, 0, 0)), at(cmd.LAND, 0, -120, 0),
    )  # fmt: skip
    home_amsl_m = where.ground_amsl(36.6, -84.3)
    mission = Mission(Autopilot.ARDUCOPTER, m.Home.at(36.6, -84.3, home_amsl_m), items, "uav1")
    verdict = judge(mission, craft, where)
    assert verdict.safe is True, verdict.describe()
    part = RehearsalPart(craft, mission, verdict)
    binary = sitl.binary(Autopilot.ARDUCOPTER)
    assert binary is not None
    with sitl_instances(binary, [part], speedup=10.0) as seats:
        (trace,) = rehearse_sitl([part], where, Terms(), seats).flown
    judged = [seq for seq, _ in groupby(leg.seq for leg in verdict.legs)]
    order = [int(seq) for seq, _ in groupby(trace.seq.tolist())]
    assert order == judged == [1, 2, 3, 4, 5, 6, 7, 8, 6, 7, 8, 10]
    for seq in range(2, 9):
        legs = [leg for leg in verdict.legs if leg.seq == seq]
        start = _plane(where, [leg.start for leg in legs])
        way = _plane(where, [leg.end for leg in legs]) - start
        points = trace.points[1:][trace.seq == seq]
        along = ((points[:, None] - start) * way).sum(-1) / np.maximum((way**2).sum(-1), 1e-9)
        off = np.linalg.norm(points[:, None] - start - along.clip(0, 1)[..., None] * way, axis=-1).min(axis=1)
        assert off.max() < TRACK_ERROR_M, (seq, off.max())
    straight = _plane(where, [verdict.mission.items[1], verdict.mission.items[2]])
    curve = trace.points[1:][trace.seq == 3][:, :2] - straight[0, :2]
    side = straight[1, :2] - straight[0, :2]
    bulge = np.abs(curve[:, 0] * side[1] - curve[:, 1] * side[0]) / np.hypot(*side)
    assert bulge.max() > 5 * TRACK_ERROR_M  # a straight leg would be too far off


def _plane(where: Any, places: list[Any]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Metres (N, 3) of places (latitude, longitude, AMSL) or of items."""
    rows = [(p.lat_deg, p.lon_deg, p.z) if isinstance(p, MissionItem) else p for p in places]
    plane = where.frame.to_plane([r[0] for r in rows], [r[1] for r in rows])
    return np.column_stack([plane, [r[2] for r in rows]])
