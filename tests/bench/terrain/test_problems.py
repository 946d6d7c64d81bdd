"""The problems are what the benchmark says, the same for a seed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.terrain.problems import NamedProblem, key_of, problems
from gcsplan.errors import InputError
from gcsplan.world.airspace import Legs

pytestmark = pytest.mark.slow


def test_main_is_twenty_pairs_spread_from_5_to_25_km_with_0_10_and_40_zones(main: list[NamedProblem]) -> None:
    assert [len(p.problem.airspace.zones) for p in main] == [0] * 20 + [10] * 20 + [40] * 20
    ways = [math.dist(p.problem.start[:2], p.problem.goal[:2]) for p in main[:20]]
    assert all(5_000 + 1_000 * k <= way <= 6_001 + 1_000 * k for k, way in enumerate(ways))
    assert len({p.name for p in main}) == len({key_of(p.problem) for p in main}) == 60


def test_starts_and_goals_are_legal_and_as_low_as_can_be(main: list[NamedProblem]) -> None:
    for p in main:
        a, limits = p.problem.airspace, p.problem.limits
        for east, north, amsl in (p.problem.start, p.problem.goal):
            point = np.array([[east, north, amsl]] * 2)
            assert a.clear(Legs.of_path(point, limits), limits).all(), p.name
            assert 60.0 <= amsl - float(a.surface.ground_at(east, north)) < 60.1


def test_everyday_missions_are_problems_too() -> None:
    few = problems("everyday", 1, count=1)
    assert {p.group for p in few} <= set(everyday_missions.EVERYDAY_KINDS) - {"vias"}
    assert len(few) >= 10
    assert not any(p.problem.via for p in few)  # over the sample, some missions have vias, too
    all_of_them = {p.name: key_of(p.problem) for p in problems("everyday", 1)}
    assert len(set(all_of_them.values())) == len(all_of_them) > 80  # polygons count in a key, too
    assert {p.name: key_of(p.problem) for p in few}.items() <= all_of_them.items()
    assert {p.problem.limits.horizontal_clearance_m for p in problems("everyday", 1, count=2)} == {0.0, 30.0}


def test_a_seed_alone_makes_the_problems() -> None:
    # Numbers of the set that figures are published for: whoever changes them makes another benchmark.
    first = problems("main", seed=1, count=1)[0]
    assert first.name == "main 1/10, 0 zones"
    assert first.problem.start == pytest.approx((220.73, 7890.06, 512.85), abs=0.02)
    assert first.problem.limits.max_amsl_m == 698.5
    other = problems("main", seed=2, count=1)[0]
    assert other.problem.start != first.problem.start


def test_the_other_kinds_are_what_they_say(main: list[NamedProblem]) -> None:
    band = problems("band", seed=1, count=2)
    assert [p.problem.limits.max_climb_deg for p in band] == [10.0] * 2 + [15.0] * 2
    assert {(p.problem.limits.min_agl_m, p.problem.limits.max_agl_m, p.problem.limits.max_amsl_m) for p in band} == {
        (60.0, 120.0, None)
    }
    turn = problems("turn", seed=1)
    assert [p.problem.turn_radius_m for p in turn] == [100.0] * 60 + [200.0] * 60
    assert [p.problem.start for p in turn[:60]] == [p.problem.start for p in main]
    energy = problems("energy", seed=1)
    assert {p.problem.objective for p in energy} == {"energy"}
    (many,) = problems("many", seed=1)
    assert len(many.problem.airspace.zones) == 1000


def test_real_errors_are_in_the_limits_and_the_ends_are_legal_under_them() -> None:
    for p in problems("main", seed=1, errors=True, count=1):
        limits = p.problem.limits
        assert (limits.horizontal_clearance_m, limits.track_error_m, limits.altitude_error_m) == (30.0, 3.0, 5.0)
        for end in (p.problem.start, p.problem.goal):
            assert p.problem.airspace.clear(Legs.of_path(np.array([end, end]), limits), limits).all()


def test_an_unknown_kind_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="main, energy, band"):
        problems("mian")


def test_the_key_tells_apart_what_bears_on_the_answer(main: list[NamedProblem]) -> None:
    p = main[45].problem
    same = replace(p, seed=7, budget_s=1.0)
    others = [
        replace(p, turn_radius_m=100.0),
        replace(p, objective="energy"),
        replace(p, limits=replace(p.limits, min_agl_m=61.0)),
        replace(p, goal=(p.goal[0], p.goal[1], p.goal[2] + 1.0)),
        replace(p, airspace=main[25].problem.airspace),
    ]
    assert key_of(same) == key_of(p)
    assert len({key_of(x) for x in [p, *others]}) == 6
