"""Groups of vehicles that never meet: found by their ways, resolved alone, and joined where they meet after all."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.fleet._settle import Job, moved, settle
from gcsplan.fleet.arrival import Crew, schedule
from gcsplan.fleet.resolve import groups_of, resolve, settle_groups
from gcsplan.fleet.separation import Rules, separation
from tests.fleet.test_resolve import crew
from tests.support.flights import motions

RULES = Rules(30.0, error_m=0.25)


def clusters(seed: int, count: int = 3, each: int = 4) -> list[Crew]:
    """Clusters 5 km apart, in each of which all ways lead past one middle; the clusters take turns."""
    rng = np.random.default_rng(seed)
    crews = []
    for k in range(each):
        for cluster in range(count):
            east = 5000.0 * cluster
            turn = np.pi * k / each
            along = 500.0 * np.array([np.cos(turn), np.sin(turn)]) + rng.uniform(-40.0, 40.0, 2)
            start, goal = (east - along[0], -along[1]), (east + along[0], along[1])
            crews.append(crew(f"c{cluster}v{k}", start, goal))
    return crews


def test_groups_are_the_clusters() -> None:
    crews = clusters(1)
    plan = schedule(crews, "sequence", interval_s=1.0)
    assert sorted(map(sorted, groups_of(plan, RULES))) == [[f"c{c}v{k}" for k in range(4)] for c in range(3)]


@pytest.mark.slow
@pytest.mark.nightly_but("0", "1")
@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(4))
def test_group_by_group_is_the_same_as_all_at_once(seed: int) -> None:
    crews = clusters(seed)
    plan = schedule(crews, "sequence", interval_s=1.0)
    job = Job(crews, RULES, None, "ground", 600.0)
    found, judged, later_s = settle_groups(plan, job)
    whole = settle(plan, job)
    moved_all, moved_s = moved(whole.done)
    assert later_s == moved_s
    assert not separation(motions(plan, crews), RULES).safe
    assert not found.stuck
    assert not whole.stuck
    alone, together = ({n: c.option.slot.depart_s for n, c in s.items()} for s in (found.done, moved_all))
    assert alone == together
    assert judged is not None
    assert judged.safe


@pytest.mark.slow
def test_groups_that_meet_after_all_are_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    crews = clusters(2)
    plan = schedule(crews, "sequence", interval_s=1.0)
    assert not separation(motions(plan, crews), RULES).safe
    monkeypatch.setattr("gcsplan.fleet.resolve.groups_of", lambda plan, rules: [[name] for name in plan.order])
    found, judged, _ = settle_groups(plan, Job(crews, RULES, None, "ground", 600.0))
    assert judged is not None
    assert judged.safe
    assert set(found.done) == set(plan.order)


@pytest.mark.nightly
def test_one_that_is_stuck_is_left_out_of_its_group_alone() -> None:
    # The goal of the last lies beside that of the first of its cluster, where the first has landed.
    crews = clusters(3)
    first = next(c for c in crews if c.name == "c1v0").route.points[-1, :2]
    crews.append(crew("late", (5000.0, 3000.0), (float(first[0]) + 10.0, float(first[1]))))
    plan = schedule(crews, "sequence", interval_s=1.0)
    found = resolve(plan, crews, RULES, leave_out=True)
    [left] = found.left_out
    assert left.vehicle == "late"
    assert "c1v0" in str(left)
    assert found.schedule.order == tuple(n for n in plan.order if n != "late")
    assert separation(motions(found.schedule, crews), RULES).safe
    arrivals = {s.name: s.arrive_s for s in plan.slots}
    assert all(abs(s.arrive_s - arrivals[s.name]) < 1e-6 for s in found.schedule.slots)
