"""The exact check of whole paths, memory and rank tests: what all benchmarks measure with."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.bench.measure import Memory, compare, flown, holm, passes
from gcsplan.bench.terrain.problems import NamedProblem
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.zones import Circle
from tests.bench.terrain.made import easy, straight
from tests.support.effort import draws


@pytest.mark.slow
def test_only_a_whole_legal_path_passes(main: list[NamedProblem]) -> None:
    p = main[8].problem
    assert not passes(p, straight(p))  # through a hill
    assert not passes(p, [p.start])
    assert not passes(p, [p.start, p.start])  # legal, but it leads nowhere
    assert passes(replace(p, goal=p.start), [p.start, p.start])


def test_corners_are_flown_as_tangent_arcs_that_do_not_overlap() -> None:
    square = np.array([[0.0, 0.0, 10.0], [1000.0, 0.0, 20.0], [1000.0, 1000.0, 30.0]])
    track = flown(square, 100.0)
    assert track is not None
    arc, chord = track
    assert not chord[[0, -1]].any()
    assert chord[1:-1].all()
    assert np.hypot(*np.diff(arc[:, :2], axis=0).T).sum() == pytest.approx(1800.0 + 50.0 * math.pi, abs=0.1)
    away = np.hypot(arc[1:-1, 0] - 900.0, arc[1:-1, 1] - 100.0)
    assert away == pytest.approx(100.0, abs=1e-6)
    middle = np.argmin(np.abs(arc[:, 0] - 1000.0 + arc[:, 1]))
    assert arc[middle, 2] == pytest.approx(20.0)
    right = flown(square * [1.0, -1.0, 1.0], 100.0)
    assert right is not None
    assert right[0][:, :2] * [1.0, -1.0] == pytest.approx(arc[:, :2])
    assert flown(square, 1001.0) is None
    assert flown(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), 10.0) is None


def test_a_way_point_without_a_turn_adds_no_leg_that_is_too_short_for_an_angle() -> None:
    straight_on = np.array([[0.1, 0.2, 10.0], [333.3, 444.4, 20.0], [999.9, 1333.0, 40.0], [1700.0, 900.0, 55.0]])
    track = flown(straight_on, 100.0)
    assert track is not None
    arc, chord = track
    steps = np.hypot(*np.diff(arc[:, :2], axis=0).T)
    assert steps.min() > 1e-3
    assert (np.diff(arc[:, 2]) / steps).max() < 0.03
    assert tuple(arc[0]) == tuple(straight_on[0])
    assert tuple(arc[-1]) == tuple(straight_on[-1])
    assert chord.sum() > 5
    twice = np.array([[0.0, 0.0, 10.0], [500.0, 0.0, 20.0], [500.0 + 1e-7, 0.0, 20.0], [1000.0, 0.0, 30.0]])
    merged = flown(twice, 100.0)
    assert merged is not None
    assert merged[0] == pytest.approx(twice[[0, 1, 3]])
    assert not merged[1].any()
    jump = flown(np.array([[0.0, 0.0, 10.0], [500.0, 0.0, 20.0], [500.0 + 1e-7, 0.0, 60.0]]), 100.0)
    assert jump is not None
    assert jump[0][:, 2] == pytest.approx([10.0, 20.0, 60.0])  # a climb on the spot is not smoothed away


@pytest.mark.slow
def test_only_chords_are_widened_by_what_they_cut_off(main: list[NamedProblem]) -> None:
    p = easy(main).problem
    a, b = np.array(p.start), np.array(p.goal)
    across = np.array([a[1] - b[1], b[0] - a[0], 0.0]) / math.hypot(*(b - a)[:2])
    path = np.array([a, 0.5 * (a + b) + 400.0 * across, b])
    radius = 200.0
    track = flown(path, radius)
    assert track is not None
    beside_leg = 0.5 * (track[0][0] + track[0][1])
    ahead = (track[0][1] - track[0][0])[:2] / math.hypot(*(track[0][1] - track[0][0])[:2])
    aside = np.array([-ahead[1], ahead[0]])

    def among(centre: np.ndarray, distance_m: float) -> Problem:
        """With a cylinder so far to the side of the nearest part of the track."""
        at = centre + (50.0 + distance_m) * aside
        zone = replace(main[45].problem.airspace.zones[0], shape=Circle(*at.tolist(), 50.0), floor=None, ceiling=None)
        return replace(p, airspace=Airspace(p.airspace.surface, [zone]), turn_radius_m=radius)

    assert passes(among(beside_leg[:2], 0.02), path)
    assert not passes(among(beside_leg[:2], -0.02), path)
    chord_middle = 0.5 * (track[0][2] + track[0][3])[:2]
    ahead = (track[0][3] - track[0][2])[:2] / math.hypot(*(track[0][3] - track[0][2])[:2])
    aside = np.array([-ahead[1], ahead[0]])
    assert not passes(among(chord_middle, 0.04), path)
    assert passes(among(chord_middle, 0.5), path)


@pytest.mark.slow
def test_a_path_with_a_corner_too_sharp_for_the_turn_radius_does_not_pass(main: list[NamedProblem]) -> None:
    p = easy(main).problem
    a, b = np.array(p.start), np.array(p.goal)
    across = np.array([a[1] - b[1], b[0] - a[0], 0.0]) / math.dist(a, b)
    zigzag = [a, 0.5 * (a + b) + 150.0 * across, 0.5 * (a + b) - 150.0 * across, b]
    assert passes(p, zigzag)
    assert passes(replace(p, turn_radius_m=100.0), zigzag)
    assert not passes(replace(p, turn_radius_m=200.0), zigzag)


@pytest.mark.slow
def test_peak_memory_is_that_of_the_block() -> None:
    memory = Memory()
    with memory.peak():
        block = np.ones(8_000_000)
        del block
    if memory.peak_mb is None:
        pytest.skip("the system does not tell")
    assert 55.0 < memory.peak_mb < 120.0


@pytest.mark.slow
def test_the_rank_test_is_scipys_on_made_runs() -> None:
    from scipy.stats import mannwhitneyu  # slow to import, for every process that collects

    rng = np.random.default_rng(3)
    for shift in (-0.5, 0.0, 0.5, 2.0):
        a, b = rng.normal(0.0, 1.0, 35), rng.normal(shift, 1.0, 40)
        p, effect = compare(a, b)
        assert p == pytest.approx(mannwhitneyu(a, b, alternative="two-sided", method="asymptotic").pvalue)
        assert effect == pytest.approx(np.mean([(x < y) + 0.5 * (x == y) for x in a for y in b]))
    same = np.full(30, 7.0)
    assert compare(same, same) == (1.0, 0.5)
    # Infinities rank last and tie.
    a, b = np.array([1.0, 2.0, math.inf]), np.array([3.0, math.inf, math.inf])
    finite = [np.where(np.isinf(x), 99.0, x) for x in (a, b)]
    p, effect = compare(a, b)
    assert p == pytest.approx(mannwhitneyu(*finite, alternative="two-sided", method="asymptotic").pvalue)
    assert effect == pytest.approx((3.0 + 3.0 + 0.0 + 2 * 0.5) / 9.0)


@pytest.mark.slow
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
@settings(max_examples=draws(60))
def test_holms_correction_lies_between_the_raw_values_and_bonferronis(p: list[float]) -> None:
    from scipy.stats import false_discovery_control  # slow to import, for every process that collects

    out = holm(p)
    order = np.argsort(p, kind="stable")
    assert (np.diff(np.array(out)[order]) >= 0.0).all()
    assert out[order[0]] == pytest.approx(min(1.0, len(p) * p[order[0]]))
    for raw, fixed, mild in zip(p, out, false_discovery_control(p), strict=True):
        assert raw <= fixed + 1e-15
        assert fixed <= min(1.0, len(p) * raw) + 1e-12
        assert mild <= fixed + 1e-12


def test_holms_correction_steps_down_and_never_falls() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
