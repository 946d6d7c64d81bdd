"""Update rules of all but the wolves against their equations, worked out number by number from the same stream."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.research.optimisers import classics, fruit_flies, krill, registry
from gcsplan.research.optimisers.bees import roulette
from gcsplan.research.optimisers.box import Steps
from gcsplan.research.optimisers.budgerigars import LEVY_SPREAD
from tests.support.swarm_play import Play, bowl, clip, crowd

N, D, T = 6, 3, 10


def skip(drawn: int, *taken: int) -> int:
    """The index that a draw among the others means."""
    for other in sorted(taken):
        drawn += drawn >= other
    return drawn


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("pso", classics.pso), ("de", classics.de), ("krill", krill.krill), ("foa", fruit_flies.foa),
        ("iffo", fruit_flies.iffo), ("mfoa", fruit_flies.mfoa), ("msfoa", fruit_flies.msfoa),
    ],
)  # fmt: skip
def test_a_name_of_the_table_runs_the_rule_of_its_module(name: str, rule: Callable[..., Steps]) -> None:
    entry = registry.get(name)
    assert entry.rule() is rule
    taken = inspect.signature(rule).parameters
    assert set(entry.defaults) == set(taken) - {"run"}
    assert all(taken[key].kind is inspect.Parameter.KEYWORD_ONLY for key in entry.defaults)


def test_particles_turn_to_their_own_and_the_swarms_best_and_stop_at_a_bound() -> None:
    def cost(x: Floats) -> Floats:
        return np.asarray((1.2 - x).sum(axis=1))

    x, v = crowd(N, D), np.zeros((N, D))
    own = x.copy()
    play = Play("pso", cost, x, T=T)
    stopped = 0
    for t in range(6):
        moved = play.step()
        ((r1, r2),) = play.draws()
        w = 0.9 - 0.5 * t / T
        best = own[np.argmin(cost(own))].copy()
        for i in range(N):
            for d in range(D):
                value = w * v[i, d] + 2.0 * r1[i, d] * (own[i, d] - x[i, d]) + 2.0 * r2[i, d] * (best[d] - x[i, d])
                v[i, d] = max(-0.2, min(0.2, value))
                place = x[i, d] + v[i, d]
                assert moved[i, d] == pytest.approx(clip(place), abs=1e-12)
                if not 0.0 <= place <= 1.0:
                    v[i, d] = 0.0
                    stopped += 1
        x = moved
        own = np.where((cost(x) < cost(own))[:, None], x, own)
    assert stopped > 0


def test_differential_evolution_crosses_a_mutant_of_three_others_and_reflects_it() -> None:
    x = crowd(N, D)
    play = Play("de", bowl, x, T=T)
    reflected = 0
    for _ in range(5):
        tried = play.step()
        one, two, three, scale, crossing, sure = play.draws()
        for i in range(N):
            a = skip(one[i], i)
            b = skip(two[i], i, a)
            c = skip(three[i], i, a, b)
            assert len({i, a, b, c}) == 4
            assert 0.2 <= scale[i, 0] <= 0.9
            for d in range(D):
                value = x[a, d] + scale[i, 0] * (x[b, d] - x[c, d])
                reflected += not 0.0 <= value <= 1.0
                value = -value if value < 0.0 else 2.0 - value if value > 1.0 else value
                expected = value if crossing[i, d] < 0.9 or d == sure[i] else x[i, d]
                assert tried[i, d] == pytest.approx(expected, abs=1e-12)
        x = np.where((bowl(tried) < bowl(x))[:, None], tried, x)
    assert reflected > 0


def test_bees_together_try_one_element_and_onlookers_the_fit_and_leave_spent_sources() -> None:
    group, dim, limit = 2, 5, 3
    x = crowd(N, dim)
    f = bowl(x)
    play = Play("abc", bowl, x, T=40, limit=limit, group=group, bees="together")
    failures = [0] * N
    scouts = 0
    for _ in range(12):
        for onlooking in (False, True):
            tried = play.step()
            draws = play.draws()
            if onlooking:
                fitness = [1.0 / (1.0 + v) for v in f]
                chosen = []
                for r in draws.pop(0):
                    total, i = fitness[0], 0
                    while total <= r * sum(fitness):
                        i += 1
                        total += fitness[i]
                    chosen.append(i)
            else:
                chosen = list(range(N))
            others, phi, elements = draws
            for bee, i in enumerate(chosen):
                k = skip(others[bee], i)
                for d in range(dim):
                    value = x[i, d]
                    if d // group == elements[bee, 0]:
                        value += phi[bee, 0] * (x[i, d] - x[k, d])  # eq. 3
                    assert tried[bee, d] == pytest.approx(clip(value), abs=1e-12)
            f_tried = bowl(tried)
            x, f = x.copy(), f.copy()
            for i in set(chosen):
                bees = [bee for bee in range(N) if chosen[bee] == i]
                best = min(bees, key=lambda bee: f_tried[bee])
                failures[i] += len(bees)
                if f_tried[best] < f[i]:
                    x[i], f[i], failures[i] = tried[best], f_tried[best], 0
        if max(failures) > limit:
            scouts += 1
            spent = failures.index(max(failures))
            place = play.step()
            (fresh,) = play.draws()
            assert np.array_equal(place, fresh[None])
            x[spent], f[spent], failures[spent] = fresh, bowl(place)[0], 0
    assert scouts > 2


def test_the_roulette_prefers_fitness_whatever_the_sign_of_the_cost() -> None:
    f = np.array([3.0, 1.0, -2.0])  # fitness 1/4, 1/2, 3
    counts = np.bincount(roulette(np.random.default_rng(0), f, 30_000), minlength=3)
    assert counts / 30_000 == pytest.approx(np.array([0.25, 0.5, 3.0]) / 3.75, abs=0.01)


@pytest.mark.parametrize("name", ["ib-abc", "b-abc"])
def test_ib_abc_moves_one_way_point_by_feedback_and_sends_scouts_when_all_are_stuck(name: str) -> None:
    group, dim, n = 2, 6, 8
    ways = 3  # D of the paper
    x = crowd(n, dim)
    f = bowl(x)
    count = [1] * n
    play = Play(name, bowl, x, T=40, group=group)
    scouted = unequal = 0
    for _ in range(35):
        x, f = x.copy(), f.copy()
        if sum(count) / n > 0.5 * ways:  # eq. 10
            scouted += 1
            places = play.step()
            order, fresh = play.draws()
            assert np.array_equal(places, fresh)
            scouts = list(order[: n // 2])
            assert int(np.argmin(f)) not in scouts
            for i, place in zip(scouts, places, strict=True):
                x[i], f[i], count[i] = place, bowl(place[None])[0], 1
        improved = [False] * n
        for following in (False, True):
            tried = play.step()
            one, two, phi, elements = play.draws()
            before = x.copy()
            for i in range(n):
                k = skip(one[i], i)
                m = skip(two[i], i, k)
                assert abs(phi[i, 0]) <= 1.0
                mu = count[i] / (count[i] + count[k]) if name == "ib-abc" else 1.0
                unequal += count[i] != count[k]
                for d in range(dim):
                    value = before[i, d]
                    if d // group == elements[i, 0]:
                        start = before[m, d] if following else before[i, d]  # eq. 9, eq. 7
                        value = start + phi[i, 0] * (before[k, d] - before[i, d]) * mu
                    assert tried[i, d] == pytest.approx(clip(value), abs=1e-12)
            f_tried = bowl(tried)
            for i in range(n):
                if f_tried[i] < f[i]:
                    x[i], f[i], improved[i] = tried[i], f_tried[i], True
        count = [1 if improved[i] else min(count[i] + 1, ways) for i in range(n)]
    assert scouted > 0
    assert unequal > 0


def test_one_swarm_of_flies_follows_its_best_fly_only_to_something_better() -> None:
    centre = crowd(1, D)
    play = Play("foa", bowl, centre, T=T, population=5)
    for _ in range(8):
        flies = play.step()
        (u,) = play.draws()
        for i in range(5):
            for d in range(D):
                assert flies[i, d] == pytest.approx(clip(centre[0, d] + 0.3 * u[i, d]), abs=1e-12)
        best = int(np.argmin(bowl(flies)))
        if bowl(flies)[best] < bowl(centre)[0]:
            centre = flies[best : best + 1]


def test_iffo_changes_one_dimension_within_a_radius_that_falls_exponentially() -> None:
    centre = crowd(1, D)
    play = Play("iffo", bowl, centre, T=T, population=5)
    for t in range(8):
        flies = play.step()
        which, u = play.draws()
        radius = 0.5 * math.exp(math.log(0.01 / 0.5) * t / T)
        for i in range(5):
            for d in range(D):
                value = centre[0, d] + (radius * u[i] if d == which[i] else 0.0)
                assert flies[i, d] == pytest.approx(clip(value), abs=1e-12)
        best = int(np.argmin(bowl(flies)))
        if bowl(flies)[best] < bowl(centre)[0]:
            centre = flies[best : best + 1]


def test_mfoa_searches_around_several_places_and_at_their_mean() -> None:
    centres = crowd(3, D)
    play = Play("mfoa", bowl, centres, T=T, swarms=3, population=7)
    for t in range(6):
        flies = play.step()
        (u,) = play.draws()
        reach = 0.5 * ((T - t) / T) ** 6
        for i in range(7):
            for d in range(D):
                assert flies[i, d] == pytest.approx(clip(centres[i % 3, d] + reach * u[i, d]), abs=1e-12)
        for d in range(D):
            assert flies[7, d] == pytest.approx(sum(centres[g, d] for g in range(3)) / 3.0, abs=1e-12)
        lead = int(np.argmin(bowl(centres)))
        after = centres.copy()
        for g in range(3):
            candidates = [flies[i] for i in range(7) if i % 3 == g] + ([flies[7]] if g == lead else [])
            after[g] = min([centres[g], *candidates], key=lambda p: float(bowl(p[None])[0]))
        centres = after


@pytest.mark.parametrize("threshold", [None, 0.2])
def test_msfoa_searches_far_above_the_threshold_and_near_below_and_offspring_compete(threshold: float | None) -> None:
    swarms, n = 3, 7
    centres = crowd(swarms, D, seed=8)
    f = bowl(centres)
    level = min(f) / 2.0 if threshold is None else threshold
    play = Play("msfoa", bowl, centres, T=T, swarms=swarms, population=n, threshold=threshold)
    far = near = 0
    for _ in range(8):
        flies = play.step()
        (u,) = play.draws()
        for i in range(n):
            g = i % swarms
            far, near = far + (f[g] > level), near + (f[g] <= level)
            for d in range(D):
                # Eq. 7 and 9, the steps as shares of the unit box.
                step = 0.3 * math.sin(math.pi / 2.0 * u[i, d]) if f[g] > level else 0.05 * u[i, d]
                assert flies[i, d] == pytest.approx(clip(centres[g, d] + step), abs=1e-12)
        f_flies = bowl(flies)
        old_best = [min((i for i in range(n) if i % swarms == g), key=lambda i: f_flies[i]) for g in range(swarms)]
        children = play.step()
        (parent,) = play.draws()
        for i in range(n):
            for d in range(D):
                value = 0.8 * flies[old_best[parent[i]], d] + 0.2 * flies[i, d]  # eq. 14
                assert children[i, d] == pytest.approx(clip(value), abs=1e-12)
        after = centres.copy()
        for g in range(swarms):
            mine = [i for i in range(n) if i % swarms == g]
            candidates = [centres[g], *flies[mine], *children[mine]]
            after[g] = min(candidates, key=lambda p: float(bowl(p[None])[0]))  # eq. 18-19
        centres, f = after, bowl(after)
    assert far > 0
    assert near > 0


def rms(x: Floats, y: Floats) -> float:
    return math.dist(x, y) / math.sqrt(len(x))


def advanced(x: Floats, target: Floats, rand: float, step: float) -> list[float]:
    """Eq. 6."""
    length = rms(x, target)
    return [a + rand * step * (b - a) / (length or 1.0) for a, b in zip(x, target, strict=True)]


def test_krill_avoid_enemies_cruise_or_forage_and_take_the_better_of_the_results() -> None:
    n, sight, step, crowding, attempts = 8, 0.45, 0.1, 0.618, 3
    x = crowd(n, 2, seed=21)
    f = bowl(x)
    play = Play("krill", bowl, x, T=T, sight=sight, step=step, crowding=crowding, attempts=attempts)
    kinds = dict.fromkeys(("avoids", "cruises", "forages", "wanders", "worse"), 0)
    for _ in range(6):
        seen = [[j for j in range(n) if j != i and rms(x[i], x[j]) < sight] for i in range(n)]
        roomy = [i for i in range(n) if 0 < len(seen[i]) < crowding * n]
        centre = {i: np.mean([x[j] for j in seen[i]], axis=0) for i in roomy}  # eq. 8
        if roomy:
            assert play.step() == pytest.approx(np.array([centre[i] for i in roomy]), abs=1e-12)
        target: dict[int, Floats] = {i: c for i, c in centre.items() if bowl(c[None])[0] < f[i]}
        kinds["avoids"] += len(target)
        for i in range(n):
            if seen[i]:
                j = min(seen[i], key=lambda j: f[j])
                if f[j] < f[i] and len(seen[j]) < crowding * n:
                    target[n + i] = x[j]
                    kinds["cruises"] += 1
        expected: dict[int, list[float]] = {}
        towards = sorted(target.items())  # who goes where next, by eq. 6
        hungry = [i for i in range(2 * n) if i not in target]
        for _ in range(attempts):
            if not hungry:
                break
            looks = play.step()
            parts, u = play.draws()
            for (i, goal), r in zip(towards, parts[:, 0], strict=True):
                expected[i] = advanced(x[i % n], goal, r, step)
            for row, i in enumerate(hungry):
                for d in range(2):
                    assert looks[row, d] == pytest.approx(clip(x[i % n, d] + sight * u[row, d]), abs=1e-12)  # eq. 5
            found = [bool(bowl(looks)[row] < f[i % n]) for row, i in enumerate(hungry)]
            towards = [(i, looks[row]) for row, i in enumerate(hungry) if found[row]]
            hungry = [i for row, i in enumerate(hungry) if not found[row]]
            kinds["forages"] += len(towards)
        moved = play.step()
        parts, at_random = play.draws()
        for (i, goal), r in zip(towards, parts[:, 0], strict=True):
            expected[i] = advanced(x[i % n], goal, r, step)
        for i, row_of_u in zip(hungry, at_random, strict=True):
            expected[i] = [x[i % n, d] + step * row_of_u[d] for d in range(2)]  # eq. 7
            kinds["wanders"] += 1
        for i in range(2 * n):
            assert moved[i] == pytest.approx([clip(value) for value in expected[i]], abs=1e-12)
        f_moved = bowl(moved)
        x = np.array([moved[n + i] if f_moved[n + i] < f_moved[i] else moved[i] for i in range(n)])
        kinds["worse"] += int((bowl(x) > f).sum())
        f = bowl(x)
    assert min(kinds.values()) > 0, kinds


@pytest.mark.parametrize(
    ("alpha", "beta", "origin", "talk"),
    [(1.0, 1.0, 0.0, "added"), (2.0, 1.5, 0.5, "added"), (1.0, 1.0, 0.5, "printed")],
)
def test_budgerigars_search_stay_talk_or_escape(alpha: float, beta: float, origin: float, talk: str) -> None:
    n = 12
    x = crowd(n, D)
    play = Play("abo", bowl, x, T=T, alpha=alpha, beta=beta, origin=origin, talk=talk)
    best = min(x, key=lambda p: float(bowl(p[None])[0]))
    seen = set()
    for t in range(1, T + 1):
        moved = play.step()
        behaviour, (r1, r2, coin), u, v = play.draws()
        mean = [sum(x[i, d] for i in range(n)) / n for d in range(D)]
        for i in range(n):
            seen.add((int(behaviour[i]), bool(coin[i, 0] <= 0.5)))
            r, s = r1[i, 0], r2[i, 0]
            for d in range(D):
                levy = u[i, d] / abs(v[i, d]) ** (1.0 / 1.5)  # eq. 10
                p, b, m = x[i, d] - origin, best[d] - origin, mean[d] - origin
                if behaviour[i] == 0:  # eq. 8
                    p = (p - b) * levy + r * (alpha - t / T) ** ((alpha + 1.0) * t / T) * m
                elif behaviour[i] == 1:  # eq. 11
                    p = p + b * levy + 0.01 * r
                elif behaviour[i] == 2:  # eq. 12
                    if coin[i, 0] <= 0.5:
                        term = 0.2 * r * (beta - t / T) * (p - m)
                    else:
                        term = 0.2 * r * math.exp(-t / (s * T)) * p
                    p = p + term if talk == "added" else term
                else:  # eq. 13
                    back = r * math.cos(0.5 * math.pi * t / T) * (b - p)
                    p = p + back - math.cos(s * math.pi) * (t / T) ** (2.0 / T) * (p - b)
                assert moved[i, d] == pytest.approx(clip(p + origin), abs=1e-12)
        x = moved
        best = min([best, *x], key=lambda p: float(bowl(p[None])[0]))
    assert {kind for kind, _ in seen} == {0, 1, 2, 3}


def test_levy_flights_have_mantegnas_spread() -> None:
    gamma = 1.5
    above = math.gamma(1.0 + gamma) * math.sin(math.pi * gamma / 2.0)
    below = math.gamma((1.0 + gamma) / 2.0) * gamma * 2.0 ** ((gamma - 1.0) / 2.0)
    spread = LEVY_SPREAD
    assert spread == pytest.approx((above / below) ** (1.0 / gamma))
    assert spread == pytest.approx(0.6966, abs=1e-4)
