"""How far legs moved: against brute force over both lines, and no distance where nothing moved."""

from __future__ import annotations

import time

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.check.difference import WITHIN_M, MovedLeg, PlanDifference, farthest_m
from gcsplan.notes.note import Note, note_of
from gcsplan.units import IMPERIAL, METRIC
from tests.support.effort import draws

STEPS = 4001


def brute_farthest_m(line: Floats, others: Floats) -> float:
    """The greatest of the distances of points along ``line`` from ``others``, one pair after the other."""
    points = line[0] + np.linspace(0.0, 1.0, STEPS)[:, None] * (line[1] - line[0])
    nearest = np.full(STEPS, np.inf)
    for begin, end in others:
        step = end - begin
        square = float(step @ step)
        along = np.clip((points - begin) @ step / square, 0.0, 1.0) if square else np.zeros(STEPS)
        nearest = np.minimum(nearest, np.linalg.norm(points - begin - along[:, None] * step, axis=1))
    return float(nearest.max())


@pytest.mark.slow
@pytest.mark.draws
def test_a_leg_moved_as_far_as_brute_force_over_both_lines_finds() -> None:
    rng = np.random.default_rng(7)
    for _ in range(draws(200)):
        scale = 10.0 ** rng.uniform(0.0, 4.5) * np.array([1.0, 1.0, 0.05])
        corners = np.cumsum(rng.normal(size=(int(rng.integers(2, 25)), 3)), axis=0) * scale
        if rng.random() < 0.3:
            corners[1] = corners[0]  # a leg of no length, such as a take-off onto itself
        old = np.stack([corners[:-1], corners[1:]], axis=1)
        new = old[int(rng.integers(len(old)))] + rng.normal(size=(2, 3)) * scale * rng.choice([0.0, 1e-3, 1.0])
        found, brute = farthest_m(new, old), brute_farthest_m(new, old)
        step_m = float(np.linalg.norm(new[1] - new[0])) / (STEPS - 1)
        assert brute - WITHIN_M - 1e-6 <= found <= brute + step_m + 1e-6


@pytest.mark.slow
def test_a_long_line_that_is_shifted_as_a_whole_takes_no_time() -> None:
    corners = np.cumsum(np.tile([[300.0, 40.0, 2.0]], (1500, 1)), axis=0)
    old = np.stack([corners[:-1], corners[1:]], axis=1)
    higher = old + np.array([0.0, 0.0, 20.0])
    begun_s = time.process_time()
    assert max(farthest_m(line, old) for line in higher) == pytest.approx(20.0, abs=1e-6)
    assert time.process_time() - begun_s < 10.0


def difference(**more: object) -> PlanDifference:
    figures = {"length_m": 1000.0, "min_agl_m": 60.04, "arrive_s": 100.0, "flight_energy_j": None}
    fields: dict[str, object] = {
        "name": "uav1", "since": "the last plan", "equal": False, "legs": 3, "moved": (), "left_m": 0.0,
        "before": figures, "after": figures,
    }  # fmt: skip
    return PlanDifference(**{**fields, **more})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"equal": True}, "nothing changed since the last plan"),
        ({}, "no leg moved since the last plan; items differ"),
        ({"moved": (MovedLeg(3, "cruise", 12.2),)}, "1 of 3 legs moved since the last plan, by 13 m at most"),
        ({"left_m": 80.0}, "0 of 3 legs moved since the last plan, by 80 m at most"),
        ({"moved": None, "left_m": None}, "how far the legs moved since the last plan is not measured"),
    ],
)
def test_the_headline_says_what_moved(more: dict[str, object], words: str) -> None:
    assert str(difference(**more).headline).startswith(words)


def test_figures_are_written_in_the_units_of_the_reader() -> None:
    after = {"length_m": 1250.0, "min_agl_m": 60.01, "arrive_s": 95.0, "flight_energy_j": None}
    rows = difference(after=after).rows(METRIC)
    assert rows == [
        ("length", "1000 m", "1250 m", "+250 m"),
        ("lowest above ground", "60.0 m", "60.0 m", "the same"),
        ("at its goal", "0:01:40", "0:01:35", "−0:00:05"),
    ]
    assert difference(after=after).rows(IMPERIAL)[0] == ("length", "0.621 mi", "0.777 mi", "+0.155 mi")


def test_a_note_comes_back_from_json() -> None:
    note = Note("difference_moved_legs", legs=(Note("moved_leg", 4, way="cruise", by_m=12.5),))
    assert note_of(note.as_dict()) == note
    for other in (None, {}, {"code": "of another version", "item": None, "data": {}}, {"code": "moved_leg"}):
        assert note_of(other) is None
