"""A second implementation of each family's rule as decided, individual by individual, in NumPy; shares no code.

Each draws numbers as it needs them, in another order than `gcsplan.research.optimisers`, so runs of one seed differ and
only their distributions can be compared. A rule receives a batch cost over the unit box, the size of the swarm, the
number of variables, the number of rounds, and a generator. Equation numbers follow the papers.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Cost = Callable[[Floats], Floats]
Rule = Callable[[Cost, int, int, int, np.random.Generator], None]


def box(x: Floats) -> Floats:
    return np.minimum(1.0, np.maximum(0.0, x))


def one(cost: Cost, x: Floats) -> float:
    return float(cost(x[None])[0])


def pso(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Shi and Eberhart: inertia from 0.9 to 0.4, both pulls 2, top speed 0.2; a particle stops at a bound."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    own, f_own, v = x.copy(), f.copy(), np.zeros((n, dim))
    for t in range(rounds):
        swarm = own[np.argmin(f_own)].copy()
        for i in range(n):
            pulls = 2.0 * rng.uniform(size=dim) * (own[i] - x[i]) + 2.0 * rng.uniform(size=dim) * (swarm - x[i])
            v[i] = np.maximum(-0.2, np.minimum(0.2, (0.9 - 0.5 * t / rounds) * v[i] + pulls))
            place = x[i] + v[i]
            v[i] = np.where((place > 1.0) | (place < 0.0), 0.0, v[i])
            x[i] = box(place)
        f = cost(x)
        for i in np.flatnonzero(f < f_own).tolist():
            own[i], f_own[i] = x[i], f[i]


def de(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Storn and Price rand/1/bin: F uniform in [0.2, 0.9] for each individual, CR 0.9, reflected at a bound."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    for _ in range(rounds):
        tried = x.copy()
        for i in range(n):
            a, b, c = rng.choice([j for j in range(n) if j != i], 3, replace=False)
            mutant = x[a] + rng.uniform(0.2, 0.9) * (x[b] - x[c])
            sure = rng.integers(dim)
            for d in range(dim):
                if d == sure or rng.uniform() < 0.9:
                    low = abs(mutant[d])
                    tried[i, d] = min(1.0, max(0.0, 2.0 - low if low > 1.0 else low))
        costs = cost(tried)
        better = costs < f
        x, f = np.where(better[:, None], tried, x), np.where(better, costs, f)


def led(leaders: Floats, wolf: Floats, a: float, rng: np.random.Generator) -> Floats:
    """Where each leader sends a wolf, eq. 3, 4, 6-11 of SSGWO's paper: X_k − A·|C·X_k − X|."""
    return np.array(
        [
            k - (2.0 * a * rng.uniform(size=len(wolf)) - a) * np.abs(2.0 * rng.uniform(size=len(wolf)) * k - wolf)
            for k in leaders
        ]
    )


def three(x: Floats, f: Floats) -> tuple[Floats, Floats]:
    best = np.argsort(f, kind="stable")[:3]
    return x[best].copy(), f[best].copy()


def gwo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, opposition: bool = False) -> None:
    """Mirjalili's wolves, eq. 1-12; with ``opposition`` SOGWO (Dhargupta), Spearman over the dimensions' ranks."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    leaders, best = three(x, f)
    for t in range(rounds):
        a = 2.0 * (1.0 - t / rounds)
        if opposition:
            x = opposed(x, f, leaders[0], a)
        x = np.array([box(led(leaders, wolf, a, rng).mean(axis=0)) for wolf in x])
        f = cost(x)
        leaders, best = three(np.concatenate([leaders, x]), np.concatenate([best, f]))


def opposed(x: Floats, f: Floats, alpha: Floats, a: float) -> Floats:
    out = x.copy()
    dim = len(alpha)
    for i in sorted(range(len(x)), key=lambda i: f[i])[3:]:
        places = [sorted(range(dim), key=lambda d, v=v: v[d]) for v in (x[i], alpha)]  # type: ignore[misc]
        squares = sum((places[0].index(d) - places[1].index(d)) ** 2 for d in range(dim))
        close = [d for d in range(dim) if abs(x[i, d] - alpha[d]) < a / 4.0]
        if 1.0 - 6.0 * squares / (dim * (dim * dim - 1)) <= 0.0 and len(close) >= dim / 2:
            for d in close:
                out[i, d] = 1.0 - x[i, d]
    return out


def sogwo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    gwo(cost, n, dim, rounds, rng, opposition=True)


def mgwo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """The three parts that SSGWO's paper names: exponential factor, weights of leaders, greedy moves."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    for t in range(rounds):
        leaders, best = three(x, f)
        a = 2.0 - 2.0 * (math.exp(t / rounds) - 1.0) / (math.e - 1.0)
        weight = 1.0 / (best - best[0] + abs(best[2] - best[0]) + 1e-12)
        tried = np.array([box(np.average(led(leaders, wolf, a, rng), axis=0, weights=weight)) for wolf in x])
        costs = cost(tried)
        better = costs < f
        x, f = np.where(better[:, None], tried, x), np.where(better, costs, f)


def igwo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Nadimi-Shahraki's wolves, eq. 10-13, with the bounds and the permutation of their published code."""

    def inside(tried: Floats, old: Floats) -> Floats:
        return np.where(tried < 0.0, old / 2.0, np.where(tried > 1.0, (1.0 + old) / 2.0, tried))

    x = rng.uniform(size=(n, dim))
    f = cost(x)
    for t in range(rounds):
        leaders, _ = three(x, f)
        a = 2.0 - 2.0 * t / rounds
        order = rng.permutation(n)
        moved, learnt = np.empty_like(x), np.empty_like(x)
        for i in range(n):
            moved[i] = inside(led(leaders, x[i], a, rng).mean(axis=0), x[i])
            radius = np.linalg.norm(x[i] - moved[i])
            near = [j for j in range(n) if np.linalg.norm(x[i] - x[j]) <= radius]
            learnt[i] = x[i]
            for d in range(dim):
                learnt[i, d] += rng.uniform() * (x[rng.choice(near), d] - x[order[i], d])
            learnt[i] = inside(learnt[i], x[i])
        f_moved, f_learnt = cost(moved), cost(learnt)
        for i in range(n):
            place, found = (moved[i], f_moved[i]) if f_moved[i] <= f_learnt[i] else (learnt[i], f_learnt[i])
            if found < f[i]:
                x[i], f[i] = place, found


def ssgwo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Feng's wolves: each by eq. 23 over eq. 9-11, annealing by eq. 24 and 25."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    temperature = math.sqrt(sum((v - f.mean()) ** 2 for v in f) / n)
    for t in range(rounds):
        a = 1.0 + math.cos(math.pi * t / rounds)
        leaders = x[sorted(range(n), key=lambda i: f[i])[:3]]
        means = [np.mean([np.linalg.norm(k - y) for y in x]) for k in leaders]
        tried = x.copy()
        for i in range(n):
            near = np.array(
                [m / max(np.linalg.norm(k - x[i]), 1e-9 * m) for k, m in zip(leaders, means, strict=True)]
            )  # eq. 14-16
            tried[i] = near @ led(leaders, x[i], a, rng) / near.sum()
        tried = box(tried)
        costs = cost(tried)
        for i in range(n):
            worse = costs[i] - f[i]
            if worse < 0.0 or rng.uniform() < math.exp(-worse / temperature):
                x[i], f[i] = tried[i], costs[i]
        temperature *= 0.95


def foa(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Pan's flies around one place, step 0.3."""
    place = rng.uniform(size=dim)
    found = one(cost, place)
    for _ in range(rounds):
        flies = np.array([box(place + rng.uniform(-0.3, 0.3, size=dim)) for _ in range(n)])
        costs = cost(flies)
        if costs.min() < found:
            place, found = flies[costs.argmin()], costs.min()


def iffo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """One variable a fly, radius from 0.5 to 0.01 as λ_max·exp(ln(λ_min/λ_max)·t/T)."""
    place = rng.uniform(size=dim)
    found = one(cost, place)
    for t in range(rounds):
        radius = 0.5 * (0.01 / 0.5) ** (t / rounds)
        flies = np.tile(place, (n, 1))
        for fly in flies:
            d = rng.integers(dim)
            fly[d] = min(1.0, max(0.0, fly[d] + rng.uniform(-radius, radius)))
        costs = cost(flies)
        if costs.min() < found:
            place, found = flies[costs.argmin()], costs.min()


def mfoa(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Five swarms, radius 0.5·(1 − t/T)^6; the mean of their places replaces the best place if it is better."""
    places = rng.uniform(size=(5, dim))
    found = cost(places)
    for t in range(rounds):
        radius = 0.5 * ((rounds - t) / rounds) ** 6
        flies = np.array([box(places[i % 5] + rng.uniform(-radius, radius, size=dim)) for i in range(n)])
        costs, mean = cost(flies), places.mean(axis=0)
        whole, best = one(cost, mean), int(found.argmin())
        for g in range(5):
            tries = [(costs[i], flies[i]) for i in range(g, n, 5)]
            if g == best:
                tries.append((whole, mean))
            least, place = min(tries, key=lambda p: p[0])
            if least < found[g]:
                places[g], found[g] = place, least


def msfoa(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Five swarms, eq. 7-19: global steps 0.3·sin(π/2·u), local steps 0.05·u, offspring with coe 0.8 and 0.2."""
    places = rng.uniform(size=(5, dim))
    found = cost(places)
    threshold = found.min() - abs(found.min()) / 2.0
    for _ in range(rounds):
        flies = np.empty((n, dim))
        for i in range(n):
            u = rng.uniform(-1.0, 1.0, size=dim)
            flies[i] = box(places[i % 5] + (0.3 * np.sin(0.5 * np.pi * u) if found[i % 5] > threshold else 0.05 * u))
        costs = cost(flies)
        leads = [min(range(g, n, 5), key=lambda i: costs[i]) for g in range(5)]
        children = np.array([0.8 * flies[leads[rng.integers(5)]] + 0.2 * fly for fly in flies])
        born = cost(children)
        for g in range(5):
            for some, of in ((flies, costs), (children, born)):
                i = min(range(g, n, 5), key=lambda i: of[i])
                if of[i] < found[g]:
                    places[g], found[g] = some[i], of[i]


def krill(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Fig. 5-9, all at once: sight 0.3, step 0.1, δ 0.618, T 10; the better of two results replaces the krill."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)

    def gap(p: Floats, q: Floats) -> float:
        return math.sqrt(float(np.mean((p - q) ** 2)))

    def step_to(p: Floats, q: Floats) -> Floats:
        return p + rng.uniform() * 0.1 * (q - p) / (gap(p, q) or 1.0)  # eq. 6

    def forage(i: int) -> Floats:
        for _ in range(10):
            look = box(x[i] + 0.3 * rng.uniform(-1.0, 1.0, size=dim))  # eq. 5
            if one(cost, look) < f[i]:
                return step_to(x[i], look)
        return np.asarray(x[i] + rng.uniform(-0.1, 0.1, size=dim))  # eq. 7

    for _ in range(rounds):
        seen = [[j for j in range(n) if j != i and gap(x[i], x[j]) < 0.3] for i in range(n)]
        ways: list[list[Floats]] = [[], []]
        for i in range(n):
            avoided = cruised = None
            if seen[i]:
                centre = x[seen[i]].mean(axis=0)  # eq. 8
                if len(seen[i]) < 0.618 * n and one(cost, centre) < f[i]:
                    avoided = step_to(x[i], centre)
                lead = min(seen[i], key=lambda j: f[j])
                if f[lead] < f[i] and len(seen[lead]) < 0.618 * n:
                    cruised = step_to(x[i], x[lead])
            ways[0].append(box(forage(i) if avoided is None else avoided))
            ways[1].append(box(forage(i) if cruised is None else cruised))
        both = [np.array(way) for way in ways]
        costs = [cost(way) for way in both]
        second = costs[1] < costs[0]
        x, f = np.where(second[:, None], both[1], both[0]), np.where(second, costs[1], costs[0])


def abc(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Karaboga's bees, one by one, limit 20, one scout a round."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    failures = [0] * n
    for _ in range(rounds):
        for onlooking in (False, True):
            fitness = np.where(f >= 0.0, 1.0 / (1.0 + np.abs(f)), 1.0 + np.abs(f))
            bees = rng.choice(n, size=n, p=fitness / fitness.sum()) if onlooking else np.arange(n)
            for i in bees:
                d, k = rng.integers(dim), rng.choice([j for j in range(n) if j != i])
                tried = x[i].copy()
                tried[d] = min(1.0, max(0.0, x[i, d] + rng.uniform(-1.0, 1.0) * (x[i, d] - x[k, d])))
                failures[i] += 1
                if (found := one(cost, tried)) < f[i]:
                    x[i], f[i], failures[i] = tried, found, 0
        spent = failures.index(max(failures))
        if failures[spent] > 20:
            x[spent], failures[spent] = rng.uniform(size=dim), 0
            f[spent] = one(cost, x[spent])


def ib_abc(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator, feedback: bool = True) -> None:
    """Tan's bees, eq. 7-10: φ up to 1, γ 0.5, counts from 1 to D; without feedback B-ABC."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    count = np.ones(n)
    for _ in range(rounds):
        if count.mean() > max(0.5 * dim, 1.0):
            for i in rng.choice([i for i in range(n) if i != f.argmin()], max(1, round(0.5 * n)), replace=False):
                x[i], count[i] = rng.uniform(size=dim), 1.0
                f[i] = one(cost, x[i])
        better = np.zeros(n, dtype=bool)
        for following in (False, True):
            tried = x.copy()
            for i in range(n):
                k, m = rng.choice([j for j in range(n) if j != i], 2, replace=False)
                d, phi = rng.integers(dim), rng.uniform(-1.0, 1.0)
                mu = count[i] / (count[i] + count[k]) if feedback else 1.0
                tried[i, d] = min(1.0, max(0.0, x[m if following else i, d] + phi * (x[k, d] - x[i, d]) * mu))
            costs = cost(tried)
            for i in np.flatnonzero(costs < f):
                x[i], f[i], better[i] = tried[i], costs[i], True
        count = np.where(better, 1.0, np.minimum(count + 1.0, dim))


def b_abc(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    ib_abc(cost, n, dim, rounds, rng, feedback=False)


def abo(cost: Cost, n: int, dim: int, rounds: int, rng: np.random.Generator) -> None:
    """Li's budgerigars, eq. 8-13, α = β = 1, staying up to 0.01, eq. 12's small term added to the place."""
    x = rng.uniform(size=(n, dim))
    f = cost(x)
    best, least = x[f.argmin()].copy(), f.min()
    top = math.gamma(2.5) * math.sin(0.75 * math.pi)
    sigma = (top / (math.gamma(1.25) * 1.5 * 2.0**0.25)) ** (2.0 / 3.0)

    def flight() -> Floats:
        return rng.normal(0.0, sigma, size=dim) / np.abs(rng.normal(size=dim)) ** (2.0 / 3.0)  # eq. 10

    for t in range(1, rounds + 1):
        share, mean, moved = t / rounds, x.mean(axis=0), x.copy()
        for i in range(n):
            kind, r = rng.integers(1, 5), rng.uniform()
            if kind == 1:
                moved[i] = (x[i] - best) * flight() + r * (1.0 - share) ** (2.0 * share) * mean
            elif kind == 2:
                moved[i] = x[i] + best * flight() + 0.01 * r
            elif kind == 3 and rng.uniform() <= 0.5:
                moved[i] = x[i] + 0.2 * r * (1.0 - share) * (x[i] - mean)
            elif kind == 3:
                moved[i] = x[i] + 0.2 * r * math.exp(-share / max(rng.uniform(), 1e-300)) * x[i]
            else:
                home = r * math.cos(0.5 * math.pi * share) * (best - x[i])
                moved[i] = x[i] + home - math.cos(math.pi * rng.uniform()) * share ** (2.0 / rounds) * (x[i] - best)
        x = box(moved)
        f = cost(x)
        if f.min() < least:
            best, least = x[f.argmin()].copy(), f.min()


FAMILIES: dict[str, Rule] = {
    "krill": krill, "abc": abc, "b-abc": b_abc, "ib-abc": ib_abc, "gwo": gwo, "mgwo": mgwo, "igwo": igwo,
    "sogwo": sogwo, "ssgwo": ssgwo, "foa": foa, "iffo": iffo, "mfoa": mfoa, "msfoa": msfoa, "pso": pso, "de": de,
    "abo": abo,
}  # fmt: skip
"""By the name of our optimiser, with its row's own parameters."""
