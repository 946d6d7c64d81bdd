"""The papers' printed numbers, and which of them nobody can have flown."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.research.bench.papers.printed import PRINTED, PRINTED_ENDS, PrintedNumber, StraightFlight, faults, least_of
from tests.support.effort import draws


def test_a_printed_number_is_below_another_only_after_rounding() -> None:
    assert PrintedNumber("1129").below(1131.47)
    assert not PrintedNumber("1131").below(1131.47)  # 1131.47 rounds to it
    assert PrintedNumber("1131.0").below(1131.47)
    assert PrintedNumber("150.6818").below(150.682)
    assert PrintedNumber("29").above(28.4)
    assert not PrintedNumber("29").above(28.6)


def _impossible(scenario: str) -> dict[tuple[str, str], str]:
    out = {}
    for (place, algorithm), printed in PRINTED.items():
        if place == scenario:
            for measure in faults(printed, least_of(scenario), 120.0, 100.0):
                out[algorithm, measure] = printed[measure].text
    return out


def test_impossible_numbers_are_those_below_the_straight_way() -> None:
    energies = {(name, "energy_j") for name in ("aco", "abc", "krill")}
    assert set(_impossible("krill-mound")) == {("krill", "length_m"), ("abc", "length_m")} | energies
    assert set(_impossible("krill-hills")) == set(_impossible("krill-forest")) == energies
    assert {k for k in _impossible("ssgwo-table7") if "length" in k[1]} == {("ssgwo", "best_length_m")}
    assert not any("length" in k[1] for k in _impossible("ssgwo-table3"))
    assert _impossible("ib-abc-together") == {("ib-abc", "length_3_m"): "327.469"}
    assert set(_impossible("ib-abc-sequence")) == {
        ("ib-abc", "length_2_m"), ("b-abc", "length_2_m"), ("abc", "length_2_m"), ("ib-abc", "length_3_m"),
    }  # fmt: skip
    assert not _impossible("msfoa-1")


@pytest.mark.parametrize("scenario", PRINTED_ENDS)
def test_marks_follow_from_the_ends_and_not_from_a_list(scenario: str) -> None:
    near = tuple(StraightFlight.between(start, start) for start, _ in PRINTED_ENDS[scenario])
    far = tuple(StraightFlight(1e6, 1e6, 1e6) for _ in PRINTED_ENDS[scenario])
    for (place, _), printed in PRINTED.items():
        if place == scenario:
            lengths = {m for m in printed if m.endswith("_m") and "length" in m}
            assert not {m for m in faults(printed, near, 120.0, 100.0) if "length" in m or "energy" in m}
            assert lengths <= set(faults(printed, far, 120.0, 100.0))


@given(st.lists(st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5)), min_size=1, max_size=30))
@settings(max_examples=draws(60))
def test_no_path_of_even_steps_pitches_more_than_its_length_allows(steps: list[tuple[float, float]]) -> None:
    heading, pitch = np.array(steps).T
    legs = np.stack([np.cos(pitch) * np.cos(heading), np.cos(pitch) * np.sin(heading), np.sin(pitch)], axis=-1)
    least = StraightFlight.between((0.0, 0.0, 0.0), legs.sum(axis=0))
    assert np.degrees(np.abs(pitch)).mean() <= least.most_pitch_deg(float(len(steps))) + 1e-4
