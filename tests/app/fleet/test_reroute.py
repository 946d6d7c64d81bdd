"""Other paths for vehicles that would meet, or that must arrive later."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.app.output.files import summary_of
from gcsplan.notes.note import Note
from gcsplan.world.geometry.path import nearest_on
from tests.app.fleet.test_fleet import nearest_m, planned, sequence


def test_where_times_may_not_change_another_path_is_flown_and_judged_like_any_other() -> None:
    arrival = {"mode": "together", "separation_m": 30, "hold": "none", "arrive_s": 180}
    done = planned(arrival, limits={"min_agl_m": 40, "max_agl_m": 60})
    assert nearest_m(done) >= 30.0 - 1e-3
    lengths = [v.verdict.length_m for v in done.vehicles]
    assert max(lengths) > 1001.0
    assert all(v.verdict.safe is True for v in done.vehicles)
    assert done.fleet is not None
    [kept] = [note for slot in done.fleet.slots for note in slot.notes if note.code == "keeps_clear"]
    assert Note("takes_another_path") in kept.data["changes"]  # type: ignore[operator]


def test_where_nobody_may_wait_a_longer_path_makes_up_for_the_time() -> None:
    done = planned(sequence(60, hold="none"), {}, {"speed_m_s": [9, 10]})
    west, south = summary_of(done)["vehicles"]
    assert south["arrive_s"] - west["arrive_s"] == pytest.approx(60.0, abs=1e-3)
    assert (south["depart_s"], south["hold_s"]) == (0.0, 0.0)
    assert 9.0 <= south["speed_m_s"] <= 10.0
    assert south["length_m"] > 1300
    assert [note["code"] for note in south["notes_data"]].count("flies_longer") == 1
    assert done.vehicles[1].verdict.safe is True
    assert south["lower_bound_m"] == pytest.approx(1000.0, abs=0.1)  # of its own request, not of the zigzag's vias


@pytest.mark.slow
def test_a_longer_path_still_passes_its_via_points_in_their_order() -> None:
    via = [(60.0, -200.0), (-60.0, 100.0)]
    keys = [{"east_m": east, "north_m": north} for east, north in via]
    done = planned(sequence(60, hold="none"), {}, {"speed_m_s": [9, 10], "via": keys})
    assert done.fleet is not None
    assert [note.code for note in done.fleet.slots[1].notes].count("flies_longer") == 1
    points = done.vehicles[1].solution.path.points[:, :2]
    away_m, along_m = nearest_on(np.array(via), points)
    assert away_m.max() < 0.5
    assert along_m[0] < along_m[1]
    assert done.fleet.slots[1].arrive_s - done.fleet.slots[0].arrive_s == pytest.approx(60.0, abs=1e-3)
