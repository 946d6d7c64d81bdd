"""A fixed wing with power to spare: it turns before its climb-out ends, and rises above its altitude."""

from __future__ import annotations

import pytest

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.limits import Limits
from gcsplan.world.zones import Circle, Zone
from tests.support.worlds import world

TOP_M = 80.0


def verdict(
    east_m: float, north_m: float, *zones: tuple[float, float, float], max_agl_m: float | None = None
) -> Verdict:
    """Take-off to the north over 569 m at 8°, then to a place; zones are (east, north, radius)."""
    forbidden = [Zone("mast", Circle(e, n, r)) for e, n, r in zones]
    where = world(zones=forbidden, half_m=6000.0)

    def at(command: int, east: float, north: float, pitch: float = 0.0) -> MissionItem:
        lat, lon = (float(x) for x in where.frame.to_degrees(east, north))
        return MissionItem(command, m.RELATIVE, (pitch, 0, 0, 0), m.degrees_e7(lat), m.degrees_e7(lon), TOP_M)

    limits = Limits(
        40.0, max_agl_m=max_agl_m, track_error_m=10.0, altitude_error_m=8.0, max_climb_deg=8.0, max_descent_deg=8.0
    )
    craft = Vehicle(
        "wing1", 1, Autopilot.ARDUPLANE, limits, speed_min_m_s=14.0, speed_max_m_s=20.0, climb_m_s=2.8, descent_m_s=2.8,
        turn_radius_m=100.0,
    )  # fmt: skip
    items = (
        at(cmd.TAKEOFF, 0, 569, 8.0), at(cmd.WAYPOINT, east_m, north_m), at(cmd.WAYPOINT, 2.0 * east_m, 2.0 * north_m),
        at(cmd.LOITER_UNLIM, 3.0 * east_m, 3.0 * north_m),
    )  # fmt: skip
    return judge(Mission(Autopilot.ARDUPLANE, Home.at(36.6, -84.3, 300.0), items), craft, where)


@pytest.mark.parametrize(("east_m", "north_m"), [(148.0, 394.0), (710.0, 501.0)])
def test_a_zone_where_an_arduplane_flew_after_an_early_turn_is_met(east_m: float, north_m: float) -> None:
    """ArduPlane in SITL flew over these places on its way to (1000, 560); the leg lies 170 and 63 m north of them."""
    found = verdict(1000.0, 560.0, (east_m, north_m, 8.0))
    assert {f.kind for f in found.findings} == {"zone"}


def test_a_zone_beside_all_ways_to_the_next_item_is_not_met() -> None:
    assert verdict(1000.0, 560.0, (500.0, 150.0, 20.0)).findings == ()
    assert verdict(1000.0, 560.0, (-150.0, 300.0, 20.0)).findings == ()


def test_ahead_nothing_is_added() -> None:
    ahead = verdict(0.0, 1500.0, (200.0, 569.0, 20.0), (-200.0, 300.0, 20.0))
    assert ahead.findings == ()
    assert not any("as soon as it is high enough" in note for note in ahead.notes)


def test_a_ceiling_is_kept_by_an_aircraft_that_levels_off_late() -> None:
    """It flew 16 m above its take-off's altitude; 8 m are the altitude error."""
    assert [f.kind for f in verdict(0.0, 1500.0, max_agl_m=95.0).findings] == ["max_agl"]
    assert verdict(0.0, 1500.0, max_agl_m=97.0).findings == ()
