"""The numbers that the papers' pictures draw."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.research.bench.papers.pictures import distances, draw_fleet, spread, stepwise
from gcsplan.research.bench.papers.scenarios import mission_text, prepare
from tests.research.bench.papers.made import record


def test_stepwise_curves_hold_their_last_value() -> None:
    got = stepwise([10, 20, 30], [None, 5.0, 4.0], np.array([0.0, 10.0, 19.9, 20.0, 35.0]))
    assert got.tolist() == [math.inf, math.inf, math.inf, 5.0, 4.0]


def test_distances_of_a_fleet_are_those_of_points_that_fly_evenly() -> None:
    one = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [30.0, 70.0, 0.0]])
    other = np.array([[0.0, 10.0, 0.0], [0.0, 10.0, 50.0]])
    t, gap = distances(one, 10.0, other, 20.0)  # 10 m/s and 2.5 m/s
    assert (t[0], t[-1]) == (0.0, 10.0)
    for moment, found in zip(t, gap, strict=True):
        first = (10.0 * moment, 0.0, 0.0) if moment <= 3.0 else (30.0, 10.0 * moment - 30.0, 0.0)
        assert found == pytest.approx(math.dist(first, (0.0, 10.0, 2.5 * moment)))


def test_box_plots_show_costs_of_all_runs_and_lengths_of_legal_ones() -> None:
    records = [record("gwo", k, x, k % 2) for k, x in enumerate((1140.0, 1132.0, 1160.0))]
    records.append({"status": "refused"})
    assert spread(records, "cost").tolist() == [1140.0, 1232.0, 1160.0]
    assert spread(records, "length_m").tolist() == [1140.0, 1160.0]


@pytest.mark.nightly
def test_a_fleet_has_its_distances_drawn_and_one_vehicle_none(finished: tuple[dict[str, Any], Path]) -> None:
    assert draw_fleet(finished[0]["scenarios"][0]) is None
    for name, paths in (("msfoa-1", 3), ("ib-abc-sequence", 4)):
        ready = prepare(name, mission_text(name))
        ends = [[list(p.start), list(p.goal)] for p in ready.problems]
        assert len(ends) == paths
        summary = {"name": name, "set": ready, "records": {"own": [record("own", 0, 1.0, paths=ends)]}}
        picture = draw_fleet(summary)
        assert picture is not None
        assert picture.startswith(b"\x89PNG")
        assert draw_fleet(summary) == picture
