"""The figures of an item out of those of its stretches."""

from __future__ import annotations

import math
from typing import Any

from gcsplan.check.verdict import LegFigures, by_item


def leg(seq: int, **more: Any) -> LegFigures:
    plain: dict[str, Any] = {
        "kind": "cruise", "start": (0.0, 0.0, 100.0), "end": (0.0, 1.0, 110.0), "column": False, "on_path": True,
        "horizontal_m": 10.0, "length_m": 11.0, "climb_deg": 5.0, "agl_end_m": 60.0, "min_agl_m": 50.0,
        "min_agl_at": (0.0, 0.0), "max_agl_m": 70.0, "zone_clearance_m": math.inf, "nearest_zone": "",
        "energy_j": 3.0, "time_s": 2.0, "hold_s": 0.0,
    }  # fmt: skip
    return LegFigures(seq, **plain | more)


def test_chords_are_added_and_the_worst_of_them_counts() -> None:
    chords = [
        leg(4, min_agl_m=51.0, climb_deg=-7.0, zone_clearance_m=40.0, nearest_zone="a"),
        leg(4, min_agl_m=math.nan, zone_clearance_m=30.0, nearest_zone="b"),
        leg(4, min_agl_m=49.0, agl_end_m=61.0, end=(1.0, 1.0, 120.0)),
    ]
    [(item, count)] = by_item(chords)
    assert count == 3
    assert (item.seq, item.length_m, item.energy_j, item.time_s) == (4, 33.0, 9.0, 6.0)
    assert (item.min_agl_m, item.climb_deg, item.agl_end_m, item.end) == (49.0, -7.0, 61.0, (1.0, 1.0, 120.0))
    assert (item.zone_clearance_m, item.nearest_zone) == (30.0, "b")


def test_what_an_item_begins_with_and_what_adds_up_is_that_of_all_its_stretches() -> None:
    chords = [leg(4, start=(0.0, 9.0, 90.0), jumped_from=6, min_agl_m=40.0, min_agl_at=(0.0, 9.5)), leg(4, hold_s=5.0)]
    [(item, _)] = by_item(chords)
    assert (item.start, item.jumped_from, item.min_agl_at) == ((0.0, 9.0, 90.0), 6, (0.0, 9.5))
    assert (item.horizontal_m, item.hold_s) == (20.0, 5.0)


def test_a_track_and_its_landing_are_one_item_whose_column_does_not_count() -> None:
    column = leg(5, kind="land", column=True, climb_deg=-90.0, min_agl_m=0.0, agl_end_m=0.0)
    [(item, _)] = by_item([leg(5), column])
    assert (item.kind, item.climb_deg, item.min_agl_m, item.agl_end_m) == ("land", 5.0, 50.0, 0.0)
    [(alone, _)] = by_item([column])
    assert math.isnan(alone.min_agl_m)
    assert alone.climb_deg == -90.0


def test_an_item_that_a_jump_leads_back_to_comes_again() -> None:
    flown = [leg(3), leg(4), leg(3, jumped_from=5), leg(4), leg(4, jumped_from=6)]
    assert [item.seq for item, _ in by_item(flown)] == [3, 4, 3, 4, 4]
    assert list(by_item([])) == []
