"""The problems are what the benchmark says, the same for a seed; those with room have a corridor, place by place."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.terrain.pairs import TerrainPair
from gcsplan.bench.terrain.problems import (
    CORRIDOR_ASIDE,
    CORRIDOR_CONE,
    CORRIDOR_NARROW_M,
    CORRIDOR_NEAR_M,
    CORRIDOR_STEP_M,
    CORRIDOR_WIDE_M,
    REAL_ERRORS,
    Corridors,
    NamedProblem,
    key_of,
    pair_of,
    problems,
)
from gcsplan.errors import InputError
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.zones import Circle

pytestmark = pytest.mark.slow


def test_main_is_twenty_pairs_spread_from_5_to_25_km_with_0_10_and_40_zones(main: list[NamedProblem]) -> None:
    assert [len(p.problem.airspace.zones) for p in main] == [0] * 20 + [10] * 20 + [40] * 20
    ways = [math.dist(p.problem.start[:2], p.problem.goal[:2]) for p in main[:20]]
    assert all(5_000 + 1_000 * k <= way <= 6_001 + 1_000 * k for k, way in enumerate(ways))
    assert len({p.name for p in main}) == len({key_of(p.problem) for p in main}) == 60


@pytest.mark.nightly
def test_starts_and_goals_are_legal_and_as_low_as_can_be(main: list[NamedProblem]) -> None:
    for p in main:
        a, limits = p.problem.airspace, p.problem.limits
        for east, north, amsl in (p.problem.start, p.problem.goal):
            point = np.array([[east, north, amsl]] * 2)
            assert a.clear(Legs.of_path(point, limits), limits).all(), p.name
            assert 60.0 <= amsl - float(a.surface.ground_at(east, north)) < 60.1


@pytest.mark.nightly
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


@pytest.mark.nightly
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


def has_corridor(pair: TerrainPair, ceiling_m: float) -> bool:
    """Whether a corridor joins a pair's ends, by the definition, place by place: the oracle of `Corridors.open`."""
    a, b = np.array(pair.start), np.array(pair.goal)
    way = math.dist(a, b)
    count, sides = math.ceil(way / CORRIDOR_STEP_M) + 1, math.ceil(CORRIDOR_ASIDE * way / CORRIDOR_STEP_M)
    air = Airspace(pair.surface, scale=pair.scale)
    ahead = (b - a) / way
    places = {
        (i, j): a + way * i / (count - 1) * ahead + j * CORRIDOR_STEP_M * np.array([-ahead[1], ahead[0]])
        for i in range(count)
        for j in range(-sides, sides + 1)
    }
    at = np.array(list(places.values()))
    floors = dict(zip(places, air.floor_amsl(at[:, 0], at[:, 1], REAL_ERRORS).tolist(), strict=True))
    reach = REAL_ERRORS.horizontal_clearance_m + REAL_ERRORS.track_error_m
    rise = CORRIDOR_CONE * math.tan(math.radians(pair.steepest_deg))

    def open_(i: int, j: int) -> bool:
        s = way * i / (count - 1)
        half = 0.5 * (CORRIDOR_NARROW_M if min(s, way - s) < CORRIDOR_NEAR_M else CORRIDOR_WIDE_M)
        n = math.ceil(half / CORRIDOR_STEP_M)
        around = [
            (min(max(i + x, 0), count - 1), min(max(j + y, -sides), sides))
            for x in range(-n, n + 1)
            for y in range(-n, n + 1)
            if math.hypot(x, y) * CORRIDOR_STEP_M <= half + 1e-6
        ]
        if (i, j) in ((0, 0), (count - 1, 0)):
            highest = floors[i, j]
        else:
            highest = max(floors[k] for k in around)
            for end, place in (((0, 0), a), ((count - 1, 0), b)):
                far = math.dist(places[i, j], place)
                if far > 0.5 * CORRIDOR_NARROW_M and highest > floors[end] + rise * far:
                    return False
        beside = [math.dist(places[i, j], (z.shape.east_m, z.shape.north_m)) - z.shape.radius_m  # type: ignore[union-attr]
                  for z in pair.zones]  # fmt: skip
        return highest <= ceiling_m and all(d > half + reach for d in beside)

    here = {0} if open_(0, 0) else set[int]()
    for i in range(1, count):
        here = {k for j in here for k in (j - 1, j, j + 1) if abs(k) <= sides and open_(i, k)}
    return 0 in here


@pytest.mark.nightly
@pytest.mark.parametrize("number", [0, 2])
def test_a_mission_with_room_has_a_corridor_and_loses_it_below_its_ceiling(number: int) -> None:
    pair = pair_of(1, number, REAL_ERRORS, "room")
    assert pair.ceiling_m is not None
    under = pair.ceiling_m - REAL_ERRORS.altitude_error_m
    assert has_corridor(pair, under)
    corridors = Corridors.of(pair, Airspace(pair.surface, scale=pair.scale), REAL_ERRORS)
    lowest = corridors.lowest()
    assert under - 60.0 <= lowest <= under - 5.0
    assert not has_corridor(pair, lowest - 1.0)
    for ceiling in np.linspace(lowest - 5.0, under, 5):
        reach = REAL_ERRORS.horizontal_clearance_m + REAL_ERRORS.track_error_m
        assert corridors.open(ceiling, pair.zones, reach) == has_corridor(pair, ceiling)


@pytest.mark.nightly
def test_missions_with_room_are_sixty_and_their_ceiling_blocks_the_straight_track() -> None:
    named = problems("room", 1)
    assert [len(one.problem.airspace.zones) for one in named] == [0] * 20 + [10] * 20 + [20] * 20
    assert problems("room", 1, errors=True)[3].problem.start == named[3].problem.start
    for one in named[:20]:
        p = one.problem
        assert (p.limits.horizontal_clearance_m, p.limits.altitude_error_m) == (30.0, 5.0)
        t = np.linspace(0.0, 1.0, 2001)
        e, n = (p.start[k] + t * (p.goal[k] - p.start[k]) for k in (0, 1))
        assert p.limits.max_amsl_m is not None
        assert float(p.airspace.surface.top_at(e, n).max()) + 60.0 + 5.0 > p.limits.max_amsl_m - 5.0
    for one in named[40:]:
        assert all(isinstance(z.shape, Circle) for z in one.problem.airspace.zones)
