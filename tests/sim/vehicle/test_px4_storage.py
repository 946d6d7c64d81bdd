"""What PX4 keeps of an item and what it refuses, beside what its sources say."""

from __future__ import annotations

import math

import pytest

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, MissionItem
from gcsplan.mavlink.protocol.messages import (
    Ack,
)
from gcsplan.sim.vehicle.px4_storage import keep_item, most_items
from gcsplan.sim.vehicle.stored_lists import ItemRefused
from tests.support.loopback import PX4, a_vehicle, at, circle, kept, upload, vertices


@pytest.mark.parametrize(
    ("sent", "back"),
    [
        (at(16, 1.9, 5.5, 6.0, math.nan, z=17.13), at(16, 1.9, 5.5, 0.0, math.nan, frame=6, z=17.13)),
        (at(16, frame=0), at(16, frame=5)),
        (at(22, 15.0, 0, 0, math.nan), at(22, 0, 0, 0, math.nan, frame=6)),
        (at(21, 5.0, 2.0, 0, 0), at(21, 0, 2.0, 0, 0, frame=6)),
        (at(16, 0, 0, 0, 0.0), at(16, frame=6)),
        (MissionItem(178, 2, (1.0, 4.37, -1.0, 9.0)), MissionItem(178, 2, (1.0, 4.37, -1.0, 9.0))),
        (MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0)), MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0))),
        (MissionItem(20, 2), MissionItem(20, 2)),
    ],
)
def test_px4_keeps(sent: MissionItem, back: MissionItem) -> None:
    got = kept(PX4, sent)
    assert isinstance(got, MissionItem)
    assert got.wire == back.wire


def test_px4_wraps_headings() -> None:
    for sent, back in ((-90.0, 270.0), (90.0, 90.0), (450.0, 90.0)):
        got = kept(PX4, at(16, 0, 0, 0, sent))
        assert isinstance(got, MissionItem)
        assert got.params[3] == pytest.approx(back, abs=1e-4)


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        (at(16, frame=10), 2),
        (at(16, frame=11), 2),
        (at(16, frame=2), 3),
        (at(178, frame=3), 3),
        (at(93, frame=0), 3),
        (at(20, frame=3), 3),
        (at(5004, 50.0), 1),
        (MissionItem(201, 2, (3.0, 0.0, 0.0, 0.0)), 6),
    ],
)
def test_px4_refuses(sent: MissionItem, code: int) -> None:
    assert kept(PX4, sent) == code


def test_px4_keeps_fences_without_their_frame_and_wants_three_vertices() -> None:
    vehicle = a_vehicle(PX4)
    ack = upload(vehicle, [circle(50.5), *vertices(3, 3)], FENCE)
    assert isinstance(ack, Ack)
    assert (ack.code, ack.mission_type) == (0, FENCE)
    place = {"x": 366_000_000, "y": -843_800_000, "z": 9.0}
    assert vehicle.items(FENCE)[0] == MissionItem(5004, 5, (50.5, 0.0, 0.0, 0.0), **place, autocontinue=False)
    assert upload(vehicle, vertices(2, 2), FENCE) == Ack(1, FENCE)


def test_the_most_items_of_each_list() -> None:
    assert [most_items(kind) for kind in (MISSION, FENCE, RALLY)] == [2000, 64, 32]


def test_a_command_that_a_version_does_not_know_is_refused() -> None:
    arm = MissionItem(400, 2, (1.0, 0.0, 0.0, 0.0))
    assert keep_item(arm, MISSION).params == (1.0, 0.0, 0.0, 0.0)
    with pytest.raises(ItemRefused) as refused:
        keep_item(arm, MISSION, unknown={400})
    assert refused.value.code == 3


def test_a_region_of_interest_reads_back_under_its_newer_name() -> None:
    assert keep_item(MissionItem(80, 2), MISSION).command == 201
    assert keep_item(MissionItem(80, 3, (3.0, 0.0, 0.0, 0.0)), MISSION).params == (0.0, 0.0, 0.0, 0.0)
