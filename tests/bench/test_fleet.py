"""The bench of large fleets: its mission, its sampled oracle, and a fleet that is planned and uploaded whole."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from gcsplan.bench.fleet import PLACES_APART_M, fleet_document, report, run, sampled
from gcsplan.errors import InputError
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Rules, separation
from gcsplan.mission_file import load_mission
from tests.fleet.test_separation import random_fleet


@pytest.mark.nightly
def test_the_mission_is_a_fleet_with_places_apart_and_each_system_id_once_on_a_link() -> None:
    document = fleet_document(1000)
    source = load_mission(document)
    assert document == fleet_document(1000)
    assert document != fleet_document(1000, seed=2)
    vehicles = [r.vehicle for r in source.vehicles]
    assert len({(v.link, v.sysid) for v in vehicles}) == 1000
    assert len({v.link for v in vehicles}) == 5
    assert max(Counter(v.sysid for v in vehicles).values()) == 5
    goals = np.array([r.goal[:2] for r in source.vehicles])
    apart = np.linalg.norm(goals[:, None] - goals[None], axis=2) + 1e9 * np.eye(1000)
    assert apart.min() > 0.99 * PLACES_APART_M
    for vehicles_, interval_s in ((1, 4.0), (2001, 4.0), (10, 0.0)):
        with pytest.raises(InputError, match="2 to 2000 vehicles"):
            fleet_document(vehicles_, interval_s=interval_s)


@pytest.mark.slow
def test_samples_find_what_is_too_near() -> None:
    def straight(name: str, north_m: float, begin_s: float) -> TimedPath:
        points = np.array([[0.0, north_m, 50.0], [1000.0, north_m, 50.0]])
        return TimedPath(name, np.array([begin_s, begin_s + 100.0]), points, begin_s + 100.0)

    assert sampled([straight("a", 0.0, 0.0), straight("b", 25.0, 0.0)], 30.0) == (pytest.approx(25.0), 1)
    assert sampled([straight("a", 0.0, 0.0), straight("b", 25.0, 2.0)], 30.0)[1] == 0  # 20 m behind
    assert sampled([straight("a", 0.0, 0.0), straight("b", 0.0, 101.0)], 30.0) == (np.inf, 0)


@pytest.mark.slow
def test_samples_and_the_exact_separation_agree() -> None:
    near = 0
    for seed in range(12):
        paths = [p for p in random_fleet(seed) if not p.ends_in_air]
        if len(paths) < 2:
            continue
        judged = separation(paths, Rules(30.0))
        least_m, pairs = sampled(paths, 30.0, step_s=0.01)
        upper = np.triu_indices(len(paths), 1)
        exact = int((judged.distance_m[upper] < 30.0).sum())
        assert pairs <= exact
        near += exact
        if judged.least is not None and judged.least.distance_m < 60.0:
            assert judged.least.distance_m <= least_m + 1e-6
    assert near > 10


@pytest.mark.nightly
def test_a_fleet_of_120_is_planned_kept_apart_and_uploaded(tmp_path: Path) -> None:
    result = run(120, tmp_path, interval_s=2.0, jobs=1, upload=True)
    assert result["placed"] >= 116
    assert set(result["left_out"]) <= {"battery"}
    assert result["placed"] + sum(result["left_out"].values()) == 120
    assert result["too_near"] == 0
    assert result["least_m"] >= 30.0
    assert result["least_m"] <= result["sampled_m"] + 1e-6
    assert result["verified"] == result["placed"]
    assert result["changed"] > 0
    assert "least separation" in report(result)
    files = {f.name for f in (tmp_path / "fleet").iterdir()}
    assert len([name for name in files if name.endswith(".plan")]) == result["placed"]
    page = (tmp_path / "fleet" / "report.html").read_text()
    assert page.count('<section id="vehicles">') == 1
    assert page.count('id="profile-') == 24
    assert page.count("data-vehicle=") >= 2 * result["placed"]
    assert len(page) < 6_000_000
