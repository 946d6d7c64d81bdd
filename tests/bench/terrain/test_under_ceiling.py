"""Missions below a ceiling above ground: the same from the same seed, and of every sort."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.bench.terrain import under_ceiling
from gcsplan.bench.terrain.problems import key_of, problems
from gcsplan.bench.terrain.under_ceiling import mission

FIRST = range(8)


@pytest.mark.slow
def test_a_mission_is_the_same_from_its_seed_alone() -> None:
    _, problem, _ = mission(5, 4)
    mission(5, 2)
    _, again, _ = mission(5, 4)
    _, other, _ = mission(6, 4)
    assert key_of(problem) == key_of(again) != key_of(other)


@pytest.mark.nightly
def test_eight_missions_have_every_group_and_keep_the_stated_ranges() -> None:
    drawn = [mission(3, number) for number in FIRST]
    groups = {group for group, *_ in drawn}
    assert groups == {f"{kind}, {goal}" for kind in ("copter", "wing") for goal in ("length", "energy")}
    for group, problem, _ in drawn:
        limits = problem.limits
        assert 30.0 <= limits.min_agl_m <= 60.0
        assert limits.max_agl_m is not None
        assert 90.0 <= limits.max_agl_m <= 150.0
        assert limits.max_amsl_m is None
        assert 8.0 <= limits.max_climb_deg <= 25.0
        assert (problem.turn_radius_m > 0.0) == group.startswith("wing")
        assert group.endswith(problem.objective)
        assert len(problem.airspace.zones) <= 40
        assert np.isfinite(problem.airspace.surface.ground_m).all()


def test_made_terrain_has_posts_of_thirty_metres_and_hills() -> None:
    _, problem, _ = mission(3, 1)
    surface = problem.airspace.surface
    np.testing.assert_allclose(surface.grid.metres_per_cell(0.0, 0.0), 30.0, rtol=1e-9)
    assert np.ptp(surface.ground_m) > 50.0


@pytest.mark.slow
def test_the_kind_keeps_the_objectives_of_its_missions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(under_ceiling, "CEILING_MISSIONS", 3)
    found = problems("ceiling", seed=3, errors=False)
    assert [one.problem.objective for one in found] == ["length", "length", "energy"]
    assert all(one.errors and one.name.endswith(one.group) for one in found)
