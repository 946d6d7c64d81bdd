"""Readings of the papers' update rules, number by number from the text; nothing is shared with our own optimisers.

Each function runs a whole search and returns every point that it evaluates, in order. It draws from the generator in
the order of the text, so a rule that follows the text evaluates the same points.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Point = list[float]
Cost = Callable[[Point], float]


class Search:
    """Evaluates points, clipped to the box, and keeps them all."""

    def __init__(self, cost: Cost) -> None:
        self.cost = cost
        self.points: list[Point] = []

    def __call__(self, point: Any) -> tuple[Point, float]:
        """The clipped point and its cost."""
        inside = [min(1.0, max(0.0, float(v))) for v in point]
        self.points.append(inside)
        return inside, self.cost(inside)

    def all(self, points: Any) -> tuple[list[Point], list[float]]:
        """Clipped points and their costs."""
        both = [self(p) for p in points]
        return [p for p, _ in both], [f for _, f in both]


def first(search: Search, rng: np.random.Generator, n: int, dim: int) -> tuple[list[Point], list[float]]:
    """A population, uniform in the box."""
    return search.all(rng.random((n, dim)).tolist())


def ssgwo_all(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, trial: str) -> list[Point]:
    """SSGWO: every wolf by eq. 23 over eq. 9-11, with eq. 13 as a cosine; eq. 24 tries every wolf or α alone."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)
    temperature = float(np.std(f))
    for t in range(rounds):
        a = 1.0 + math.cos(math.pi * t / rounds)
        order = sorted(range(n), key=lambda i: f[i])
        pack = [x[k] for k in order[:3]]
        r1, r2 = rng.random((2, 3, n, dim))
        tried = []
        for i in range(n):
            near = []
            for leader in pack:
                every = [math.dist(leader, y) for y in x]
                mean = sum(every) / n
                near.append(mean / max(every[i], 1e-9 * mean))  # eq. 14-16
            place = []
            for d in range(dim):
                parts = [
                    pack[k][d] - (2.0 * a * r1[k, i, d] - a) * abs(2.0 * r2[k, i, d] * pack[k][d] - x[i][d])
                    for k in range(3)
                ]
                place.append(sum(w * p for w, p in zip(near, parts, strict=True)) / sum(near))  # eq. 20-23
            tried.append(place)
        places, costs = search.all(tried)
        chance = rng.random(n)
        for i in range(n):
            worse = costs[i] - f[i]
            takes = worse < 0.0 or chance[i] < math.exp(-worse / temperature)  # eq. 24
            if takes or (trial == "alpha" and i != order[0]):
                x[i], f[i] = places[i], costs[i]
        temperature *= 0.95  # eq. 25
    return search.points


def sogwo_published(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, span: float) -> list[Point]:
    """SOGWO with the opposition of its authors' code."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)
    best = sorted(((f[i], x[i]) for i in range(n)), key=lambda p: p[0])[:3]
    for t in range(rounds):
        a = 2.0 - 2.0 * t / rounds
        x = [list(p) for p in x]
        for i in range(3, n):
            gaps = [span * abs(x[0][d] - x[i][d]) for d in range(dim)]
            close = [d for d in range(dim) if gaps[d] < a]
            if 1.0 - 6.0 * sum(g * g for g in gaps) / (n * (n * n - 1)) <= 0.0 and close:
                x[i][close[0]] = 1.0 - x[i][close[0]]
        r1, r2 = rng.random((2, 3, n, dim))
        moved = [
            [
                sum(
                    best[k][1][d] - (2.0 * a * r1[k, i, d] - a) * abs(2.0 * r2[k, i, d] * best[k][1][d] - x[i][d])
                    for k in range(3)
                )
                / 3.0
                for d in range(dim)
            ]
            for i in range(n)
        ]
        x, f = search.all(moved)
        best = sorted(best + [(f[i], x[i]) for i in range(n)], key=lambda p: p[0])[:3]
    return search.points


def one_bee(
    cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, limit: int, group: int = 1
) -> list[Point]:
    """ABC (Karaboga 2005): each bee flies from what the bee before it left; one failure counter for each source."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)
    failures = [0] * n

    def fly(sources: list[int]) -> None:
        others, phi = rng.integers(0, n - 1, size=n), rng.uniform(-1.0, 1.0, size=(n, 1))[:, 0]
        for i, r, p, j in zip(sources, others, phi, rng.integers(0, dim // group, size=n), strict=True):
            k = [source for source in range(n) if source != i][r]
            tried = list(x[i])
            for d in range(j * group, (j + 1) * group):
                tried[d] += p * (x[i][d] - x[k][d])
            place, found = search(tried)
            if found < f[i]:
                x[i], f[i], failures[i] = place, found, 0
            else:
                failures[i] += 1

    def drawn(r: float) -> int:
        fitness = [1.0 / (1.0 + v) for v in f]
        at, total = 0, fitness[0]
        while total <= r * sum(fitness):
            at += 1
            total += fitness[at]
        return at

    for _ in range(rounds):
        fly(list(range(n)))
        fly([drawn(r) for r in rng.random(n)])  # all onlookers choose by the results of the employed bees
        spent = failures.index(max(failures))
        if failures[spent] > limit:
            x[spent], f[spent] = search(rng.random(dim))
            failures[spent] = 0
    return search.points


def ib_abc_from_zero(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> list[Point]:
    """IB-ABC with Tr from 0: φ up to 1, γ 0.5; all bees of a kind at once."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)
    count = [0.0] * n
    for _ in range(rounds):
        if sum(count) / n > max(0.5 * dim, 1.0):  # eq. 10
            best = f.index(min(f))
            chosen = rng.permutation([i for i in range(n) if i != best])[: round(0.5 * n)]
            places, costs = search.all(rng.random((len(chosen), dim)))
            for i, place, found in zip(chosen, places, costs, strict=True):
                x[i], f[i], count[i] = place, found, 1.0
        better = [False] * n
        for following in (False, True):
            one, two = rng.integers(0, n - 1, size=n), rng.integers(0, n - 2, size=n)
            phi = rng.uniform(-1.0, 1.0, size=(n, 1))[:, 0]
            element = rng.integers(0, dim, size=(n, 1))[:, 0]
            tried = []
            for i in range(n):
                k = [j for j in range(n) if j != i][one[i]]
                m = [j for j in range(n) if j not in (i, k)][two[i]]
                mu = count[i] / (count[i] + count[k]) if count[i] > 0.0 else 0.0
                place, j = list(x[i]), element[i]
                place[j] = (x[m] if following else x[i])[j] + phi[i] * (x[k][j] - x[i][j]) * mu  # eq. 7, 9
                tried.append(place)
            places, costs = search.all(tried)
            for i in range(n):
                if costs[i] < f[i]:
                    x[i], f[i], better[i] = places[i], costs[i], True
        count = [1.0 if better[i] else min(count[i] + 1.0, dim) for i in range(n)]
    return search.points


def krill(  # noqa: C901 - the paper's pseudo code, step by step
    cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, *, one: bool, printed: bool, sight: float
) -> list[Point]:
    """Krill by fig. 5-9: step 0.1, δ 0.618, T 3; one by one or all at once; the crowd by ranks or as printed."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)

    def gap(p: Point, q: Point) -> float:
        return math.dist(p, q) / math.sqrt(dim)

    def goes(food: float, crowd: int, own: float) -> bool:
        return food / crowd < 0.618 * own if printed else food < own and crowd < 0.618 * n

    def go(start: Point, target: Point, r: float) -> Point:
        long = gap(start, target) or 1.0
        return [a + r * 0.1 * (b - a) / long for a, b in zip(start, target, strict=True)]  # eq. 6

    def move(who: list[int]) -> None:
        seen = {i: [j for j in range(n) if j != i and gap(x[i], x[j]) < sight] for i in range(n)}
        targets: dict[int, Point] = {}
        for row, i in enumerate(who):
            if seen[i] and (printed or len(seen[i]) < 0.618 * n):
                centre, food = search(np.mean([x[j] for j in seen[i]], axis=0))  # eq. 8
                if goes(food, len(seen[i]), f[i]):
                    targets[row] = centre
        for row, i in enumerate(who):
            if seen[i]:
                j = min(seen[i], key=lambda j: f[j])
                if goes(f[j], max(len(seen[j]), 1), f[i]):
                    targets[len(who) + row] = x[j]
        start = [x[i] for i in who] * 2
        own = [f[i] for i in who] * 2
        out: dict[int, Point] = {}
        going = sorted(targets)
        for row, r in zip(going, rng.random((len(going), 1))[:, 0], strict=True):
            out[row] = go(start[row], targets[row], r)
        hungry = [row for row in range(2 * len(who)) if row not in targets]
        if hungry:
            for _ in range(3):
                u = rng.uniform(-1.0, 1.0, size=(len(hungry), dim))
                looks = [
                    search([a + sight * b for a, b in zip(start[row], v, strict=True)])
                    for row, v in zip(hungry, u, strict=True)
                ]  # eq. 5
                happy = [(row, place) for row, (place, food) in zip(hungry, looks, strict=True) if food < own[row]]
                for (row, place), r in zip(happy, rng.random((len(happy), 1))[:, 0], strict=True):
                    out[row] = go(start[row], place, r)
                hungry = [row for row in hungry if row not in out]
                if not hungry:
                    break
            u = rng.uniform(-1.0, 1.0, size=(len(hungry), dim))
            for row, v in zip(hungry, u, strict=True):
                out[row] = [a + 0.1 * b for a, b in zip(start[row], v, strict=True)]  # eq. 7
        places, costs = search.all([out[row] for row in range(2 * len(who))])
        for row, i in enumerate(who):
            better = row + len(who) if costs[row + len(who)] < costs[row] else row
            x[i], f[i] = places[better], costs[better]

    for _ in range(rounds):
        for group in [[i] for i in range(n)] if one else [list(range(n))]:
            move(group)
    return search.points


def parrots(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, span: float) -> list[Point]:
    """PO as its authors' code has it, on coordinates from 0 to ``span``."""
    search = Search(cost)
    points, f = first(search, rng, n, dim)
    ranked = sorted(range(n), key=lambda i: f[i])
    x = np.array([points[i] for i in ranked]) * span
    best, least = x[0], f[ranked[0]]
    power = 1.5
    above = math.gamma(1.0 + power) * math.sin(math.pi * power / 2.0)
    below = math.gamma((1.0 + power) / 2.0) * power * 2.0 ** ((power - 1.0) / 2.0)
    sigma = (above / below) ** (1.0 / power)

    def levy() -> Any:
        u, v = rng.normal(0.0, sigma, size=dim), rng.normal(0.0, 1.0, size=dim)
        return u / np.abs(v) ** (1.0 / power)

    for t in range(1, rounds + 1):
        alpha, sita = rng.random() / 5.0, rng.random() * math.pi
        left = 1.0 - t / rounds
        new, found = [], []
        for j in range(1, n + 1):
            old = x[j - 1]
            kind = int(rng.integers(0, 4))
            if kind == 0:
                r = rng.random()
                place = (old - best) * levy() + r * x.mean(axis=0) * left ** (2.0 * t / rounds)
            elif kind == 1:
                place = old + best * levy() + rng.normal() * left
            elif kind == 2 and rng.random() < 0.5:
                place = old + alpha * left * (old - x.mean(axis=0))
            elif kind == 2:
                place = old + alpha * left * math.exp(-j / (rng.random() * rounds))
            else:
                home = rng.random() * math.cos(math.pi * t / (2.0 * rounds)) * (best - old)
                place = old + home - math.cos(sita) * (t / rounds) ** (2.0 / rounds) * (old - best)
            inside, value = search(place / span)
            new.append(np.array(inside) * span)
            found.append(value)
            if value < least:
                best, least = new[-1], value
        x = np.array([new[i] for i in sorted(range(n), key=lambda i: found[i])])
    return search.points


def msfoa(
    cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, *, step: float, origin: float, swarms: int = 3
) -> list[Point]:
    """MSFOA by steps 5-19 with step 8: the step of a pair with S > 1 is drawn again; radius 0.05, coe 0.8 and 0.2."""
    search = Search(cost)
    centres, f = first(search, rng, swarms, dim)
    threshold = min(f) / 2.0
    for _ in range(rounds):

        def fly(i: int, u: Any) -> Point:
            g = i % swarms
            far = f[g] > threshold
            return [c + (step * math.sin(math.pi / 2.0 * v) if far else 0.05 * v)
                    for c, v in zip(centres[g], u[i], strict=True)]  # fmt: skip

        flies = [fly(i, u) for u in [rng.uniform(-1.0, 1.0, size=(n, dim))] for i in range(n)]
        for _again in range(50):
            out = [(i, d) for i in range(n) for d in range(0, dim, 2)
                   if math.hypot(*((v - origin) / (1.0 - origin) for v in flies[i][d : d + 2])) > 1.0]  # fmt: skip
            if not out:
                break
            u = rng.uniform(-1.0, 1.0, size=(n, dim))
            for i, d in out:
                flies[i][d : d + 2] = fly(i, u)[d : d + 2]
        places, costs = search.all(flies)
        best = [min(range(g, n, swarms), key=lambda i: costs[i]) for g in range(swarms)]
        parents = rng.integers(0, swarms, size=n)
        children, child_costs = search.all(
            [[0.8 * a + 0.2 * b for a, b in zip(places[best[p]], places[i], strict=True)]
             for i, p in enumerate(parents)]
        )  # fmt: skip
        for g in range(swarms):
            for some, of in ((places, costs), (children, child_costs)):
                lead = min(range(g, n, swarms), key=lambda i: of[i])
                if of[lead] < f[g]:
                    centres[g], f[g] = some[lead], of[lead]
    return search.points


def lshade(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, memory: int, least: int) -> list[Point]:
    """L-SHADE (Tanabe, Fukunaga 2014, algorithms 1 and 2), one member after the other, p 0.11, archive 2.6 N."""
    search = Search(cost)
    x, f = first(search, rng, n, dim)
    m_cr: list[float | None] = [0.5] * memory
    m_f = [0.5] * memory
    archive: list[Point] = []
    k = 0
    for t in range(rounds):
        size = max(least, round(n + (least - n) * t / rounds))
        order = sorted(range(len(x)), key=lambda i: f[i])
        if size < len(x):
            x, f = [x[i] for i in order[:size]], [f[i] for i in order[:size]]
            order = list(range(size))
        most = round(2.6 * size)
        if len(archive) > most:
            archive = [archive[i] for i in rng.permutation(len(archive))[:most]]
        slots = rng.integers(0, memory, size=size)
        normal = rng.normal([0.0 if m_cr[r] is None else m_cr[r] for r in slots], 0.1)
        uniform = rng.random(size)
        best = rng.integers(0, max(2, round(0.11 * size)), size=size)
        first_other = rng.integers(0, size - 1, size=size)
        second_other = rng.integers(0, size + len(archive) - 2, size=size)
        chance = rng.random((size, dim))
        forced = rng.integers(0, dim, size=size)
        tried = []
        used = []
        for i in range(size):
            rate = 0.0 if m_cr[slots[i]] is None else min(1.0, max(0.0, float(normal[i])))
            middle = m_f[slots[i]]
            lowest = 0.5 + math.atan(-middle / 0.1) / math.pi  # the share of the Cauchy distribution that is below 0
            scale = min(1.0, middle + 0.1 * math.tan(math.pi * (lowest + (1.0 - lowest) * uniform[i] - 0.5)))
            used.append((rate, scale))
            one = [j for j in range(size) if j != i][first_other[i]]
            two = [j for j in range(size + len(archive)) if j not in (i, one)][second_other[i]]
            other = x[two] if two < size else archive[two - size]
            child = []
            for d in range(dim):
                v = x[i][d] + scale * (x[order[best[i]]][d] - x[i][d] + x[one][d] - other[d])
                v = x[i][d] / 2.0 if v < 0.0 else (1.0 + x[i][d]) / 2.0 if v > 1.0 else v
                child.append(v if chance[i][d] < rate or d == forced[i] else x[i][d])
            tried.append(child)
        children, costs = search.all(tried)
        won = [i for i in range(size) if costs[i] < f[i]]
        gains = [f[i] - costs[i] for i in won]
        archive += [x[i] for i in won]
        for i in range(size):
            if costs[i] <= f[i]:
                x[i], f[i] = children[i], costs[i]
        if won:
            w = [g / sum(gains) for g in gains]
            rates, scales = [used[i][0] for i in won], [used[i][1] for i in won]
            if m_cr[k] is None or max(rates) == 0.0:
                m_cr[k] = None
            else:
                m_cr[k] = sum(a * r * r for a, r in zip(w, rates, strict=True)) / sum(
                    a * r for a, r in zip(w, rates, strict=True)
                )
            m_f[k] = sum(a * s * s for a, s in zip(w, scales, strict=True)) / sum(
                a * s for a, s in zip(w, scales, strict=True)
            )
            k = (k + 1) % memory
    return search.points
