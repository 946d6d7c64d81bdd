"""Missions with room have a corridor, by a definition applied place by place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.bench.terrain.pairs import TerrainPair
from gcsplan.bench.terrain.problems import REAL_ERRORS, pair_of, problems
from gcsplan.bench.terrain.room import (
    CORRIDOR_ASIDE,
    CORRIDOR_CONE,
    CORRIDOR_NARROW_M,
    CORRIDOR_NEAR_M,
    CORRIDOR_STEP_M,
    CORRIDOR_WIDE_M,
    Corridors,
)
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.zones import Circle


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


@pytest.mark.slow
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


@pytest.mark.slow
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
