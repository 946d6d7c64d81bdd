"""A fixed wing's landing: what is told where the ground slopes along it."""

from __future__ import annotations

import pytest

from gcsplan.check.judge import judge
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.noted import coded, codes
from tests.support.worlds import world


def notes(slope: float, error_m: float = 8.0) -> list[Note]:
    """Of a landing towards the north on a place 2 km north of home; the ground there falls by ``slope`` northwards."""
    where = world(lambda east, north: 300.0 - slope * (north - 2000.0))

    def at(command: int, north: float, z: float, pitch: float = 0.0) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(0.0, north))
        return MissionItem(command, m.GLOBAL, (pitch, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), z)

    limits = Limits(40.0, track_error_m=10.0, altitude_error_m=error_m, max_climb_deg=8.0, max_descent_deg=8.0)
    craft = Vehicle(
        "wing1", 1, Autopilot.ARDUPLANE, limits, speed_max_m_s=20.0, climb_m_s=2.8, descent_m_s=2.8, turn_radius_m=100.0
    )
    home_m = 300.0 + slope * 2000.0
    items = (
        at(cmd.TAKEOFF, 600.0, home_m + 80.0, 8.0), at(cmd.WAYPOINT, 1500.0, 370.0), at(cmd.LAND, 2000.0, 300.0)
    )  # fmt: skip
    return list(judge(Mission(Autopilot.ARDUPLANE, Home.at(36.6, -84.3, home_m), items), craft, where).notes)


@pytest.mark.parametrize("slope", [0.0, -0.05, 0.005])
def test_a_landing_on_the_level_or_uphill_is_not_told(slope: float) -> None:
    told = codes(notes(slope))
    assert "lands_downhill" not in told
    assert "climb_out_straight" in told  # it was judged


def test_a_landing_downhill_is_told_with_where_it_touches_down() -> None:
    told = coded(notes(0.06), "lands_downhill")
    # 70 m over 500 m are 14 %: at 100 m it is 14 m high, and within 8 m of the 6 m of ground there.
    assert told.item == 3
    assert told.data["slope_percent"] == pytest.approx(6.0, abs=0.1)
    assert (told.data["early_m"], coded(notes(0.06, 2.0), "lands_downhill").data["early_m"]) == (100.0, 20.0)
    assert told.data["uphill_deg"] == pytest.approx(180.0, abs=0.1)
