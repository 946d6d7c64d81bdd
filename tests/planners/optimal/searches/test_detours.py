"""Tracks around each zone on the finer lattice: better paths, when one is known."""

from __future__ import annotations

from gcsplan.planners.optimal.searches.detours import FineDetours
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.searches import looked, over_flat, work_of

ROW = [Zone(f"disc {k}", Circle(1000.0, 800.0 + 200.0 * k, 80.0)) for k in range(3)]


def test_it_applies_once_a_path_is_known_and_not_under_a_maximum_agl() -> None:
    assert not FineDetours(work_of(over_flat(*ROW))).applies()
    assert FineDetours(looked(over_flat(*ROW))).applies()
    under = looked(over_flat(*ROW, max_agl_m=120.0))
    assert not FineDetours(under).applies()


def test_a_path_never_becomes_longer_and_stays_above_the_bound() -> None:
    work = looked(over_flat(*ROW))
    before = work.incumbent.cost
    FineDetours(work).run()
    assert work.incumbent.bound <= work.incumbent.cost <= before
    assert work.incumbent.cost < 1420.0  # between two discs of the row
