"""How near a mission comes to each limit: what is kept is never called broken."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from gcsplan.check.margins import Miss, nearest_misses
from gcsplan.world.airspace import Legs
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.worlds import vehicle, world


def test_a_zone_whose_clearance_is_kept_is_not_called_broken_for_a_bound_of_its_distance() -> None:
    # Beside a zone over ground the distance is a lower bound, here a hair below what is required.
    craft = vehicle(horizontal_clearance_m=30.0)
    limits = craft.limits
    where = world(300.0, [Zone("quarry", Circle(1000.0, 400.0, 200.0), None, Level(300.0, "agl"))])
    legs = Legs.of_path(np.array([[0.0, 0.0, 420.0], [2000.0, 0.0, 420.0]]), limits)
    report = where.airspace.examine(legs, limits)
    assert report.violations == ()
    needed = (limits.horizontal_clearance_m + limits.track_error_m) * where.airspace.scale
    close = replace(report, zone_clearance_m=np.full(1, needed - 1e-6))
    stretch: Any = SimpleNamespace(seq=3)
    (miss,) = [m for m in nearest_misses([stretch], legs, np.zeros(1, np.intp), close, craft, where) if m.zone]
    assert miss.room == 0.0
    assert ": 33.0 m of 30, 0.0 m to spare beyond the track error, item 3 (" in str(miss.note)


def test_inside_a_zone_no_negative_distance_is_told() -> None:
    miss = Miss("zone", -206.61, -173.61, 30.0, "m", 3, 36.6, -84.3, 579.7, "dam")
    words = "inside zone dam: 173.7 m from its edge, broken by 206.7 m with the track error, item 3 ("
    assert str(miss.note).startswith(words)
