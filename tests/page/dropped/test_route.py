"""The route of somebody's mission: each place once in a row, from its home to where it ends, the rest by name."""

from __future__ import annotations

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE, Home, Mission, MissionItem
from gcsplan.mission_file.values.schema import MOST_VIAS
from gcsplan.page.dropped.route import route_of
from gcsplan.vehicle import Autopilot

HOME = Home(465_000_000, 85_000_000, 100.0)


def at(command: int, lat_e7: int, lon_e7: int) -> MissionItem:
    return MissionItem(command, RELATIVE, x=lat_e7, y=lon_e7, z=40.0)


def mission(*items: MissionItem, home: Home = HOME) -> Mission:
    return Mission(Autopilot.ARDUCOPTER, home, items)


def test_the_places_that_are_flown_to_become_start_vias_and_goal() -> None:
    take_off, first, second = (
        at(cmd.TAKEOFF, 0, 0),
        at(cmd.WAYPOINT, 465_050_000, 85_000_000),
        (465_100_000, 85_100_000),
    )
    camera = MissionItem(cmd.DO_SET_CAM_TRIGG_DIST, NO_POSITION)
    route = route_of(
        mission(take_off, first, camera, at(cmd.SPLINE_WAYPOINT, 465_050_003, 85_000_000), camera,
                at(cmd.WAYPOINT, *second), at(cmd.LAND, *second)), "a.plan",
    )  # fmt: skip
    assert (route.start, route.via, route.goal) == ((46.5, 8.5), ((46.505, 8.5),), (46.51, 8.51))
    assert route.left_out == ("2 × camera trigger",)
    hold = MissionItem(cmd.WAYPOINT, RELATIVE, (5.0, 0.0, 0.0, 0.0), 465_050_000, 85_000_000, 40.0)
    held = route_of(mission(hold, at(cmd.LOITER_TURNS, *second)), "a.plan")
    assert (held.goal, held.left_out) == ((46.51, 8.51), ("hold", cmd.command_name(cmd.LOITER_TURNS)))


def test_a_landing_without_a_place_ends_where_the_last_item_flew_to() -> None:
    route = route_of(mission(at(cmd.WAYPOINT, 465_050_000, 85_000_000), at(cmd.LAND, 0, 0), home=Home(0, 0, 0.0)), "a")
    assert (route.start, route.via, route.goal, route.left_out) == (None, (), (46.505, 8.5), ())


def test_a_mission_to_nowhere_or_of_too_many_places_has_no_route() -> None:
    with pytest.raises(InputError, match="no item flies to a place"):
        route_of(mission(MissionItem(cmd.RTL, NO_POSITION)), "a.plan")
    many = [at(cmd.WAYPOINT, 465_000_000 + 1000 * k, 85_000_000) for k in range(MOST_VIAS + 2)]
    with pytest.raises(InputError, match=f"more than {MOST_VIAS}"):
        route_of(mission(*many), "a.plan")
