"""Where a return joins the mission, and which way of several it takes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.check.judge import judge
from gcsplan.check.returns.way_home import way_home
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE
from gcsplan.mavlink.mission.mission import MissionItem as Item
from tests.check.returns.test_along_mission import PLANE, PX4, START, back, joined
from tests.check.returns.test_way_home import BARE, OVER, judged, mission, ridge
from tests.support.noted import codes
from tests.support.worlds import vehicle, world


@pytest.mark.slow
def test_a_landing_sequence_is_joined_at_its_first_place_from_everywhere() -> None:
    w, v = world(ridge), vehicle(**BARE)
    start = Item(cmd.DO_LAND_START, NO_POSITION)
    m = mission(w, OVER)
    home = joined(w, back(m, start=start), v)
    # From take-off it would fly straight to the far end of the mission, through the ridge.
    assert home.safe is False
    assert not home.along_path
    assert "joined to the mission's landing sequence (item 7)" in home.describe()
    near = [replace(i, z=150.0) for i in m.items[1:2]]
    over = joined(w, back(m, near, start), v)
    assert over.unsafe  # from behind the ridge at 40 m it climbs too late
    assert joined(world(), back(m, near, start), vehicle(**BARE)).safe is True
    two = replace(m, items=(*back(m, near, start).items, *back(m, start=start).items[len(m.items) :]))
    assert joined(world(), two, v).starts == (7, 10)


@pytest.mark.slow
def test_past_a_start_in_the_order_of_the_items_it_just_continues() -> None:
    w, v = world(ridge), vehicle(**BARE)
    whole = mission(w, OVER, land=False)
    m = back(whole, [i for i in reversed(whole.items) if i.command == cmd.WAYPOINT])
    home = joined(w, m, v)
    assert home.safe is True, home.describe()
    low = replace(m, items=(*m.items[:6], *(replace(i, z=40.0) for i in m.items[6:-1]), m.items[-1]))
    assert all(s.to_seq <= 6 for s in joined(w, low, v).unsafe)


@pytest.mark.parametrize(
    ("items", "code"),
    [
        ([], "nothing_to_join"),
        ([START, Item(cmd.LOITER_UNLIM, RELATIVE, x=366000000, y=-843000000, z=80.0)], "join_unknown_on_path"),
        ([START, Item(cmd.WAYPOINT, 10, x=366010000, y=-843000000, z=80.0)], "join_distance_unknown"),
        ([START, Item(cmd.WAYPOINT, RELATIVE, x=366010000, y=-843000000, z=80.0)], "join_without_landing"),
        ([START], "join_without_item"),
        ([START, Item(cmd.DO_JUMP, NO_POSITION, (2.0, 1.0, 0.0, 0.0))], "jump_decides_join"),
        ([Item(cmd.DO_JUMP, NO_POSITION, (7.0, 1.0, 0.0, 0.0)), START], "jump_decides_join"),
    ],
)
def test_what_is_not_known_is_not_judged(items: list[Item], code: str) -> None:
    m = mission(world(), [(0, 0, 80), (2000, 0, 80)])
    home = joined(world(), replace(m, items=(*m.items, *items)))
    assert home.safe is None
    assert code in codes(home.not_judged)


@pytest.mark.slow
def test_px4_is_not_judged_and_a_plane_needs_to_say_which_way_it_returns() -> None:
    m = back(mission(world(), [(0, 0, 80), (2000, 0, 80)], PX4))
    assert joined(world(), m).safe is None
    plane = mission(world(), [(0, 0, 150), (4000, 0, 150)], PLANE)
    held = replace(plane, items=(*plane.items, START, *reversed(plane.items[1:3]), plane.items[-1]))
    assert judged(world(), held, vehicle(PLANE), 150.0).safe is None
    v = vehicle(PLANE)
    straight = way_home(judge(held, v, world()), v, world(), rtl_rel_home_m=150.0, route="straight")
    assert straight.unsafe == (), straight.describe()  # it turns about on the return path, which is not judged
