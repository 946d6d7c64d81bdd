"""The lists that both autopilots store: their opaque ids, places in float degrees, and params that are not kept."""

from __future__ import annotations

import math

import pytest

from gcsplan.mavlink.mission.mission import FENCE, MISSION, Home, MissionItem
from gcsplan.sim.vehicle.stored_lists import NOTHING_KEPT, Board, ItemRefused, as_flag, as_sent, lost, through_float
from tests.support.loopback import waypoint


def test_a_boards_opaque_id_changes_with_its_list_alone() -> None:
    board = Board(Home(0, 0, 0.0))
    empty = board.opaque_id(MISSION)
    board.lists[MISSION] = [waypoint(1)]
    one = board.opaque_id(MISSION)
    board.lists[FENCE] = [waypoint(2)]
    assert board.opaque_id(MISSION) == one != empty
    board.lists[MISSION] = [waypoint(1, z=9.0)]
    assert board.opaque_id(MISSION) not in (one, empty)
    assert board.opaque_id(7) == 0  # a type of which there is no list


def test_an_item_in_float_degrees_is_off_by_less_than_half_a_metre() -> None:
    item = MissionItem(16, 3, (1.0, 2.0, 3.0, 4.0), 366_000_123, -843_800_077, 12.5, autocontinue=False)
    old = through_float(item)
    assert (old.x, old.y) != (item.x, item.y)
    assert (old.x, old.y) == pytest.approx((item.x, item.y), abs=45)
    assert (old.command, old.frame, old.params, old.z, old.autocontinue) == (16, 3, (1.0, 2.0, 3.0, 4.0), 12.5, False)
    assert through_float(old) == old


def test_params_read_back_as_sent_as_a_flag_or_as_nothing() -> None:
    assert [as_sent(v) for v in (-1.5, 0.0)] == [-1.5, 0.0]
    assert math.isnan(as_sent(math.nan))
    assert [as_flag(v) for v in (-1.0, 0.0, 1e-9, 7.0, math.nan)] == [0.0, 0.0, 1.0, 1.0, 0.0]
    assert [lost(v) for v in (3.0, math.nan)] == [0.0, 0.0]
    assert [keep(5.0) for keep in NOTHING_KEPT] == [0.0] * 4


def test_a_refusal_carries_its_code() -> None:
    refused = ItemRefused(13)
    assert refused.code == 13
    assert str(refused) == "MAV_MISSION_RESULT 13"
