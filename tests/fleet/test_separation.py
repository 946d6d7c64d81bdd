"""The least distance in space and time, held against sampling by brute force; pads, windows, spans, and size."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.fleet._sweep import Fleet, Pieces, nearest, pieces_of
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Conflict, Rules, conflicts_of, in_metres, separation
from gcsplan.notes.note import Note
from gcsplan.wind.drift import Drifts
from tests.support.effort import draws

FLEETS = [range(60), pytest.param(range(60, 1000), marks=pytest.mark.nightly)]
SAMPLE_S = 1e-3


def motion(name: str, *rows: tuple[float, float, float, float], air: bool = False) -> TimedPath:
    """A motion out of (time, east, north, amsl)."""
    table = np.array(rows, dtype=np.float64)
    return TimedPath(name, table[:, 0], table[:, 1:], float(table[-1, 0]), air)


def random_motion(rng: np.random.Generator, name: str, corner: Floats) -> TimedPath:
    """A few pieces in a box of 60 m: slow and fast ones, hovering, straight up, whole and odd seconds."""
    count = int(rng.integers(1, 7))
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 1.5, count))]) + rng.uniform(0.0, 3.0)
    if rng.random() < 0.3:
        times = np.arange(count + 1) + float(rng.integers(0, 3))
    points = rng.uniform(0.0, 60.0, (count + 1, 3)) * (1.0, 1.0, 0.5)
    for i in range(count):
        odd = rng.random()
        if odd < 0.15:
            points[i + 1] = points[i]
        elif odd < 0.3:
            points[i + 1, :2] = points[i, :2]
    return TimedPath(name, times, corner + points, float(times[-1]), bool(rng.random() < 0.2))


def random_fleet(seed: int) -> list[TimedPath]:
    rng = np.random.default_rng(seed)
    corner = rng.choice([0.0, 5e4, 4e6]) * np.array([1.0, -1.0, 0.0])
    fleet = [random_motion(rng, f"uav{i}", corner) for i in range(int(rng.integers(2, 5)))]
    if rng.random() < 0.2:  # the same way in formation
        first = fleet[0]
        points = first.points + np.array([9.0, 0.0, 0.0])
        fleet[1] = TimedPath("uav1", first.times_s, points, first.arrive_s, first.ends_in_air)
    return fleet


def drifting_fleet(seed: int) -> list[TimedPath]:
    """A random fleet, some of whose pieces are early or late by themselves in each of three winds."""
    rng, fleet = np.random.default_rng(seed), random_fleet(seed)
    for k in np.flatnonzero(rng.random(len(fleet)) < 0.7).tolist():
        count = len(fleet[k].times_s) - 1
        early = rng.uniform(-3.0, 2.0, (3, count)) * (rng.random(count) < 0.7)
        fleet[k] = replace(fleet[k], drifts=Drifts(early, early + rng.uniform(0.0, 0.5, (3, count))))
    return fleet


def least_of_all_pieces_m(a: TimedPath, b: TimedPath, window_s: float) -> float:
    """The least distance on any two pieces, each looked at."""
    first, second = pieces_of(a), pieces_of(b)
    i, j = (index.ravel() for index in np.indices((len(first.from_s), len(second.from_s))))
    least_s, most_s = (np.zeros(len(i)) + s for s in first.apart_s(i, second, j, window_s))
    x, y = first.take(i), second.take(j)
    meet = (x.from_s <= y.to_s + most_s) & (y.from_s <= x.to_s - least_s)
    x, y = x.take(np.flatnonzero(meet)), y.take(np.flatnonzero(meet))
    return float(nearest(x, y, (least_s[meet], most_s[meet]))[0].min(initial=math.inf))


def sampled(a: TimedPath, b: TimedPath, until_s: float) -> tuple[float, float]:
    """Least distance at moments 1 ms apart while both are in the air, and what lies between two samples at most."""
    begin = max(a.begin_s, b.begin_s)
    end = min(until_s if a.ends_in_air else a.end_s, until_s if b.ends_in_air else b.end_s)
    if begin > end:
        return math.inf, 0.0
    t = np.append(np.arange(begin, end, SAMPLE_S), end)
    fastest = sum(float((np.linalg.norm(np.diff(p.points, axis=0), axis=1) / np.diff(p.times_s)).max()) for p in (a, b))
    return float(np.linalg.norm(a.at(t) - b.at(t), axis=1).min()), fastest * SAMPLE_S


@pytest.mark.slow
@pytest.mark.parametrize("seeds", FLEETS, ids=lambda seeds: f"{len(seeds)}")
def test_the_least_distance_is_that_of_a_thousand_sampled_fleets_and_never_more(seeds: range) -> None:
    pairs = 0
    for seed in seeds:
        fleet = random_fleet(seed)
        until = max(p.end_s for p in fleet) + 1.0
        found = separation(fleet, Rules(20.0))
        least = math.inf
        for i, j in combinations(range(len(fleet)), 2):
            brute, between = sampled(fleet[i], fleet[j], until)
            exact = float(found.distance_m[i, j])
            assert exact == found.distance_m[j, i]
            assert (exact == math.inf) == (brute == math.inf), f"seed {seed}"
            if brute < math.inf:
                assert exact <= brute + 1e-6, f"seed {seed}: {exact} is more than {brute} of uav{i} and uav{j}"
                assert exact >= brute - between - 1e-6, f"seed {seed}: {exact} of uav{i} and uav{j}, sampled {brute}"
                pairs += 1
            least = min(least, brute)
        assert (found.least is None) == (least == math.inf)
        assert {c.worst.vehicles for c in found.conflicts if c.kind == "air"} == {
            (fleet[i].name, fleet[j].name)
            for i, j in combinations(range(len(fleet)), 2)
            if found.distance_m[i, j] < 20.0 - 1e-6
        }
    assert pairs > len(seeds)


@pytest.mark.draws
def test_the_moment_and_the_places_told_are_those_of_the_least_distance() -> None:
    for seed in range(draws(100)):
        fleet = random_fleet(seed)
        by_name = {p.name: p for p in fleet}
        found = separation(fleet, Rules(15.0))
        met = [e for a, b in combinations(by_name, 2) if (e := found.between(a, b)) is not None]
        for e in met + [c.worst for c in found.conflicts if c.kind == "air"]:
            places = [by_name[n].at(t)[0] for n, t in zip(e.vehicles, e.times_s, strict=True)]
            assert np.allclose(places, e.places, atol=1e-6)
            assert math.isclose(float(np.linalg.norm(places[0] - places[1])), e.distance_m, abs_tol=1e-6)


@pytest.mark.slow
@pytest.mark.draws
def test_spans_of_conflict_are_those_of_samples() -> None:
    spans = 0
    for seed in range(draws(200)):
        fleet = random_fleet(seed)
        found = separation(fleet, Rules(12.0))
        for i, j in combinations(range(len(fleet)), 2):
            a, b = fleet[i], fleet[j]
            own = [c for c in found.conflicts if c.kind == "air" and c.worst.vehicles == (a.name, b.name)]
            until = max(p.end_s for p in fleet) + 1.0
            end = min(until if p.ends_in_air else p.end_s for p in (a, b))
            t = np.arange(max(a.begin_s, b.begin_s), end, 1e-3)
            near = np.linalg.norm(a.at(t) - b.at(t), axis=1) < 12.0
            told = np.zeros(len(t), dtype=bool)
            for c in own:
                told |= (t >= c.from_s - 1e-6) & (t <= c.until_s + 1e-6)
                assert c.from_s - 1e-9 <= c.worst.time_s <= c.until_s + 1e-9
                spans += 1
            changes = np.flatnonzero(near != told)
            edges = [x for c in own for x in (c.from_s, c.until_s)]
            assert all(min(abs(t[k] - x) for x in edges) < 3e-3 for k in changes), f"seed {seed}"
            assert all(x.until_s < y.from_s for x, y in pairwise(own))
    assert spans > draws(200) / 2


# -- windows ------------------------------------------------------------------------------------------------------


def sampled_window(a: TimedPath, b: TimedPath, window_s: float, until_s: float) -> tuple[float, float]:
    """Least distance over both moments, each on a grid, no further apart than two windows."""
    step = 0.01
    times = []
    for p in (a, b):
        times.append(np.append(np.arange(p.begin_s, until_s if p.ends_in_air else p.end_s, step), p.end_s))
    gaps = np.linalg.norm(a.at(times[0])[:, None] - b.at(times[1])[None], axis=2)
    gaps[np.abs(times[0][:, None] - times[1][None]) > 2.0 * window_s + 1e-9] = np.inf
    fastest = sum(float((np.linalg.norm(np.diff(p.points, axis=0), axis=1) / np.diff(p.times_s)).max()) for p in (a, b))
    return float(gaps.min()), fastest * step


@pytest.mark.draws
def test_with_a_window_the_least_distance_is_that_over_all_shifts() -> None:
    met = 0
    for seed in range(draws(45)):
        fleet = random_fleet(seed)[:2]
        window = float(np.random.default_rng(seed).choice([0.05, 0.4, 1.5, 6.0]))
        until = max(p.end_s for p in fleet) + 2.0 * window
        brute, between = sampled_window(fleet[0], fleet[1], window, until)
        exact = float(separation(fleet, Rules(20.0, window_s=window)).distance_m[0, 1])
        assert exact <= brute + 1e-6, f"seed {seed}"
        if brute < math.inf:
            assert exact >= brute - between - 1e-6, f"seed {seed}: {exact}, sampled {brute}"
            met += 1
    assert met > draws(45) * 2 / 3


@pytest.mark.slow
@pytest.mark.draws
def test_the_least_distance_of_motions_that_drift_is_that_of_all_their_pieces() -> None:
    met = 0
    for seed in range(draws(60)):
        fleet, window_s = drifting_fleet(seed), float(np.random.default_rng(seed).choice([0.0, 0.5]))
        found = separation(fleet, Rules(20.0, window_s=window_s))
        for a, b in combinations(range(len(fleet)), 2):
            brute_m = least_of_all_pieces_m(fleet[a], fleet[b], window_s)
            assert found.distance_m[a, b] == pytest.approx(brute_m, abs=1e-6), f"seed {seed}"
            met += math.isfinite(brute_m)
        mine = [c for c in found.conflicts if "uav1" in c.worst.vehicles]
        alone = conflicts_of(fleet[1], [path for path in fleet if path.name != "uav1"], found.rules)
        assert [(c.kind, c.from_s, {*c.worst.vehicles}) for c in alone] == [
            (c.kind, c.from_s, {*c.worst.vehicles}) for c in mine
        ], f"seed {seed}"
    assert met > draws(60)


@pytest.mark.slow
@settings(max_examples=draws(40))
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 3.0))
def test_a_wider_window_never_shows_more_distance(seed: int, window_s: float) -> None:
    fleet = random_fleet(seed)
    narrow = separation(fleet, Rules(10.0, window_s=window_s)).distance_m
    wide = separation(fleet, Rules(10.0, window_s=1.3 * window_s)).distance_m
    assert (wide <= narrow + 1e-6).all()
    assert (narrow <= separation(fleet, Rules(10.0)).distance_m + 1e-6).all()


@pytest.mark.slow
@pytest.mark.draws
def test_every_shift_within_the_window_keeps_at_least_what_was_told() -> None:
    for seed in range(draws(40)):
        rng = np.random.default_rng(seed)
        fleet = random_fleet(seed)
        told = separation(fleet, Rules(10.0, window_s=0.7)).distance_m
        for _ in range(4):
            moved = [p.delayed(float(s)) for p, s in zip(fleet, rng.uniform(-0.7, 0.7, len(fleet)), strict=True)]
            assert (separation(moved, Rules(10.0)).distance_m >= told - 1e-6).all(), f"seed {seed}"


@settings(max_examples=draws(60))
@given(st.integers(0, 2**32 - 1))
def test_two_straight_pieces_come_no_nearer_on_any_grid_than_in_closed_form(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def piece(still: bool) -> Pieces:
        begin = rng.uniform(0.0, 3.0, 1)
        velocity = np.zeros((1, 3)) if still else rng.normal(0.0, 8.0, (1, 3))
        return Pieces(begin, begin + rng.uniform(0.0, 3.0, 1), rng.uniform(-9.0, 9.0, (1, 3)), velocity)

    a, b = piece(rng.random() < 0.2), piece(rng.random() < 0.2)
    if rng.random() < 0.3:
        b = Pieces(b.from_s, b.to_s, b.places, a.velocity * rng.choice([1.0, -1.0, 0.5]))
    w = float(rng.uniform(0.0, 2.0))
    t1, t2 = np.meshgrid(np.linspace(a.from_s[0], a.to_s[0], 301), np.linspace(b.from_s[0], b.to_s[0], 301))
    ok = np.abs(t1 - t2) <= w
    if not ok.any():
        return
    at_a = a.places[0] + (t1[ok] - a.from_s[0])[:, None] * a.velocity[0]
    at_b = b.places[0] + (t2[ok] - b.from_s[0])[:, None] * b.velocity[0]
    brute = float(np.linalg.norm(at_a - at_b, axis=1).min())
    least, s1, s2 = nearest(a, b, (-w, w))
    between = float(np.linalg.norm(a.velocity) + np.linalg.norm(b.velocity)) * 3.0 / 300.0
    assert brute - 2.0 * between - 1e-9 <= least[0] <= brute + 1e-9
    assert abs(s1[0] - s2[0]) <= w + 1e-9
    assert a.from_s[0] - 1e-9 <= s1[0] <= a.to_s[0] + 1e-9
    assert b.from_s[0] - 1e-9 <= s2[0] <= b.to_s[0] + 1e-9


# -- what is judged -----------------------------------------------------------------------------------------------


def test_two_that_cross_are_told_with_moment_place_and_span() -> None:
    a = motion("a", (0, -100, 0, 50), (20, 100, 0, 50))
    b = motion("b", (1, 0, -90, 60), (19, 0, 90, 60))
    found = separation([a, b], Rules(30.0))
    (only,) = found.conflicts
    assert math.isclose(only.worst.distance_m, 10.0)
    assert math.isclose(only.worst.time_s, 10.0)
    assert np.allclose(only.worst.middle, (0.0, 0.0, 55.0))
    half = math.sqrt(30.0**2 - 10.0**2) / math.hypot(10.0, 10.0)
    assert math.isclose(only.from_s, 10.0 - half)
    assert math.isclose(only.until_s, 10.0 + half)
    assert not found.safe
    assert found.least == only.worst
    met = only.note()
    assert met.code == "come_near"
    assert (
        met.data["place"]
        == in_metres(only.worst.middle)
        == Note("place_in_plane", east_m=0.0, north_m=0.0, amsl_m=55.0)
    )
    assert str(met) == (
        "a and b come as near as 10.0 m, needed 30 m, at 10.0 s (east 0 m, north 0 m, 55 m above sea level)"
    )


def test_touching_the_separation_is_legal_and_errors_widen_it() -> None:
    a = motion("a", (0, 0, 0, 50), (10, 100, 0, 50), (20, 200, 0, 50))
    b = motion("b", (0, 0, 30, 50), (10, 100, 30, 50), (15, 100, 300, 50))
    assert separation([a, b], Rules(30.0)).safe
    wider = separation([a, b], Rules(30.0, error_m=0.1))
    assert [c.needed_m for c in wider.conflicts] == [30.2]
    assert (wider.conflicts[0].from_s, wider.conflicts[0].until_s) == (0.0, pytest.approx(10.0, abs=0.2))


def test_vehicles_that_are_never_both_in_the_air_have_no_distance() -> None:
    a = motion("a", (0, 0, 0, 0), (10, 0, 0, 50), (20, 200, 0, 0))
    b = motion("b", (21, 100, 0, 0), (30, 100, 0, 50), (40, 100, 200, 0))
    found = separation([a, b], Rules(30.0))
    assert found.safe
    assert found.least is None
    assert found.between("a", "b") is None
    assert found.distance_m[0, 1] == math.inf
    # A window lets them meet.
    assert separation([a, b], Rules(30.0, window_s=2.0)).distance_m[0, 1] < math.inf


def test_one_that_ends_in_the_air_is_there_for_good() -> None:
    a = motion("a", (0, 0, 0, 0), (10, 0, 0, 50), air=True)
    b = motion("b", (100, 200, 0, 0), (120, 200, 0, 50), (140, 5, 0, 50), air=True)
    (only,) = separation([a, b], Rules(30.0)).conflicts
    assert only.until_s == math.inf
    assert math.isclose(only.worst.distance_m, 5.0)
    assert math.isclose(only.from_s, 120.0 + 20.0 * 170.0 / 195.0)
    landed = TimedPath("a", a.times_s, a.points, a.arrive_s)
    assert [c.kind for c in separation([landed, b], Rules(30.0)).conflicts] == []


def flight(name: str, begin_s: float, start: tuple[float, float], goal: tuple[float, float]) -> TimedPath:
    """Ten seconds up, twenty across at 100 m, ten down."""
    return motion(
        name, (begin_s, *start, 0), (begin_s + 10, *start, 100), (begin_s + 30, *goal, 100), (begin_s + 40, *goal, 0)
    )


def kinds(found: tuple[Conflict, ...]) -> list[tuple[str, str, str]]:
    return [(c.kind, *c.worst.vehicles) for c in found]


def test_landing_beside_one_that_has_landed_is_a_conflict_until_its_pad_is_clear() -> None:
    a, b = flight("a", 0, (0, 0), (500, 0)), flight("b", 60, (0, 200), (520, 0))
    assert kinds(separation([a, b], Rules(30.0)).conflicts) == [("landing", "b", "a")]
    assert kinds(separation([b, a], Rules(30.0)).conflicts) == [("landing", "b", "a")]
    assert kinds(separation([a, b], Rules(30.0, pad_clear_s=61.0)).conflicts) == [("landing", "b", "a")]
    assert separation([a, b], Rules(30.0, pad_clear_s=59.0)).safe
    assert not separation([a, b], Rules(30.0, pad_clear_s=59.0, window_s=1.0)).safe
    assert separation([a, b], Rules(30.0, leaving=frozenset({"a"}))).safe
    assert separation([a, b], Rules(30.0, leaving=frozenset({"b"}))).safe
    (only,) = separation([a, b], Rules(30.0)).conflicts
    assert math.isclose(only.worst.distance_m, 20.0)
    assert only.from_s == 100.0
    assert only.until_s == math.inf
    assert "b lands at a place 20.0 m, needed 30 m from where a stands" in str(only.note())


def test_taking_off_beside_one_that_has_landed_is_a_conflict() -> None:
    a, b = flight("a", 0, (0, 0), (500, 0)), flight("b", 60, (510, 0), (0, 300))
    # b also stands there, waiting, when a lands.
    assert kinds(separation([a, b], Rules(30.0)).conflicts) == [("landing", "a", "b"), ("take-off", "b", "a")]
    assert kinds(separation([a, b], Rules(30.0, pad_clear_s=5.0)).conflicts) == [("landing", "a", "b")]


def test_vehicles_that_wait_side_by_side_are_told_and_not_judged() -> None:
    a, b = flight("a", 0, (0, 0), (500, 0)), flight("b", 60, (10, 0), (500, 300))
    found = separation([a, b], Rules(30.0))
    assert found.safe
    assert found.notes == (
        Note("starts_within_separation", pairs=1, needed_m=30.0, first="a", second="b", apart_m=10.0),
    )
    # Both in the air at once they are.
    assert not separation([a, b.delayed(-60.0)], Rules(30.0)).safe


def test_bad_questions_are_refused() -> None:
    a = flight("a", 0, (0, 0), (500, 0))
    with pytest.raises(InputError, match="name of its own"):
        separation([a, a], Rules(30.0))
    with pytest.raises(InputError, match="window_s"):
        Rules(30.0, window_s=math.nan)
    with pytest.raises(InputError, match="separation_m"):
        Rules(-1.0)
    with pytest.raises(InputError, match="at least one vehicle"):
        separation([], Rules(30.0))
    alone = separation([a], Rules(30.0))
    assert alone.safe
    assert alone.least is None


def test_the_numbers_of_pieces_are_the_callers_own() -> None:
    a = motion("a", (0, -100, 0, 50), (9, -10, 0, 50), (20, 100, 0, 50))
    b = motion("b", (0, 0, -100, 50), (8, 0, -20, 50), (20, 0, 100, 50))
    numbered = TimedPath("a", a.times_s, a.points, a.arrive_s, False, np.array([3, 7]))
    met = separation([numbered, b], Rules(30.0)).least
    assert met is not None
    assert met.pieces == (7, -1)


# -- size ---------------------------------------------------------------------------------------------------------


def large_fleet(count: int, pieces: int, side_m: float) -> list[TimedPath]:
    rng = np.random.default_rng(5)
    fleet = []
    for v in range(count):
        points = rng.uniform(0.0, side_m, 3) * (1.0, 1.0, 0.02) + np.cumsum(
            rng.normal(0.0, 1.0, (pieces + 1, 3)) * (12.0, 12.0, 1.0) + (15.0, 8.0, 0.0), axis=0
        )
        speed = rng.uniform(8.0, 14.0)
        times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) / speed)])
        fleet.append(TimedPath(f"uav{v}", times + rng.uniform(0.0, 60.0), points, float(times[-1])))
    return fleet


def test_a_fleet_spread_over_a_day_is_cut_where_it_flies() -> None:
    fleet = [p.delayed(850.0 * i) for i, p in enumerate(large_fleet(8, 300, 500.0))]
    late = fleet[0].delayed(86_000.0)
    fleet += [TimedPath("late", late.times_s, late.points, late.arrive_s)]
    cut = Fleet.of(fleet)
    assert len(cut.edges_s) < 600
    assert (np.diff(cut.edges_s) > 0.0).all()
    for path in fleet:
        within = (cut.edges_s > path.begin_s) & (cut.edges_s < path.end_s)
        assert within.sum() > 10
    found = separation(fleet, Rules(30.0))
    assert found.distance_m[0, 8] == math.inf


@pytest.mark.slow
def test_of_a_hundred_vehicles_few_pieces_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    fleet = large_fleet(100, 300, 5000.0)
    looked = [0]
    rows = Fleet.rows

    def counted(self: Fleet, *args: NDArray[np.intp]):  # type: ignore[no-untyped-def]
        for block in rows(self, *args):
            looked[0] += len(block[0])
            yield block

    monkeypatch.setattr(Fleet, "rows", counted)
    found = separation(fleet, Rules(30.0))
    every = 4950 * 600  # pairs of overlapping pieces, about
    assert looked[0] < every / 5
    assert found.least is not None
    # Every pair, against both motions drawn at all their break points at once.
    rng = np.random.default_rng(0)
    for i, j in rng.integers(0, 100, (60, 2)).tolist():
        if i == j:
            continue
        a, b = fleet[i], fleet[j]
        t = np.unique(np.concatenate([a.times_s, b.times_s]))
        t = t[(t >= max(a.begin_s, b.begin_s)) & (t <= min(a.end_s, b.end_s))]
        gap = a.at(t) - b.at(t)
        change = np.diff(gap, axis=0)
        part = np.clip(-(gap[:-1] * change).sum(1) / np.maximum((change**2).sum(1), 1e-300), 0.0, 1.0)
        exact = float(np.linalg.norm(gap[:-1] + part[:, None] * change, axis=1).min())
        assert math.isclose(float(found.distance_m[i, j]), exact, abs_tol=1e-6)
