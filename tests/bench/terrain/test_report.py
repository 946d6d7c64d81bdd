"""The table counts, and measures against the certified bound."""

from __future__ import annotations

import pytest

from gcsplan.bench.terrain import report as terrain_report
from tests.bench.terrain.made import several


def test_the_table_counts_and_measures_against_the_certified_bound() -> None:
    ours, theirs = terrain_report.lines(several())
    assert (ours.solved, ours.infeasible, ours.problems, ours.memory_mb) == (2, 1, 3, 20.0)
    assert ours.gaps == pytest.approx((1.0, 2.0))
    assert ours.ratio == pytest.approx(4.0)
    assert theirs.gaps == pytest.approx((10.0, 1.0))
    assert (theirs.solved, theirs.shorter, ours.shorter) == (2, 1, 0)
    assert terrain_report.beaten_by(several()) == ["p b: OMPL RRT* 1 s 202.00 against 204.00"]
    assert terrain_report.unsolved(several()) == ["p c: infeasible, no way"]
