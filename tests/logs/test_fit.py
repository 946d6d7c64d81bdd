"""Logs into R1, R2 and hover power: found again from flights that were made with them, and not claimed where unseen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import yaml

from gcsplan.arrays import Floats
from gcsplan.logs.fit import fit_energy
from gcsplan.logs.flight_log import FlightLog
from tests.support.flight_logs import HOVER, R1, R2, Leg, flown, within


def log_of(t: Floats, place: Floats, watts: Floats) -> FlightLog:
    return FlightLog("flight", t, place[:, 0], place[:, 1], 300.0 + place[:, 2], t, watts)


@pytest.mark.parametrize("seed", range(8))
def test_a_flights_coefficients_are_found_within_2_percent_at_5_percent_noise(seed: int) -> None:
    found = fit_energy([log_of(*flown(seed=seed))])
    assert within(found)
    assert found.is_complete
    for c, true in ((found.vertical, R1), (found.horizontal, R2), (found.hover, HOVER)):
        assert c.value is not None
        assert c.half_95 is not None
        assert 0.0 < c.half_95 < 0.05 * true


@pytest.mark.nightly
def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    held = 0
    for seed in range(40):
        c = fit_energy([log_of(*flown(seed=100 + seed, hz=1.0, noise=0.15))]).horizontal
        assert c.value is not None
        assert c.half_95 is not None
        held += abs(c.value - R2) <= c.half_95
    assert held >= 32


def test_gusts_and_dropouts_do_not_move_the_numbers() -> None:
    t, place, watts = flown(seed=3)
    rng = np.random.default_rng(3)
    for k in rng.integers(0, len(t) - 30, 12).tolist():
        watts[k : k + 25] *= rng.choice([0.05, 6.0])
    assert within(fit_energy([log_of(t, place, watts)]), 0.04)


def test_power_and_places_may_come_at_other_rates_and_with_pauses() -> None:
    t, place, watts = flown(seed=4, hz=10.0)
    keep = np.abs(t - 200.0) > 8.0
    slow = np.arange(len(t)) % 5 == 0
    log = FlightLog("f", t[keep], *place[keep].T, t[slow], watts[slow])
    assert within(fit_energy([log]))


def test_standing_on_the_ground_before_and_after_counts_for_nothing() -> None:
    t, place, watts = flown(seed=5)
    ground = np.zeros((600, 3)) + place[0] * [1, 1, 0]
    rest = np.full(600, 12.0)
    t = np.arange(len(t) + 1200) / 5.0
    place = np.vstack([ground, place, ground + place[-1] * [1, 1, 0]])
    assert within(fit_energy([log_of(t, place, np.concatenate([rest, watts, rest]))]))


def test_a_level_flight_tells_nothing_of_the_vertical() -> None:
    found = fit_energy([log_of(*flown([(0, 0, 10, 5), (0, 0, 0, 60), (4000, 0, 0, 400), (0, 0, 0, 60)]))])
    assert found.vertical.value is None
    assert "few" in found.vertical.why
    assert not found.is_complete
    assert found.horizontal.value == pytest.approx(R2, rel=0.02)
    assert "# vertical_j_per_m" in found.yaml()
    assert "\n  horizontal_j_per_m: 1" in found.yaml()


def test_a_flight_that_always_climbs_alike_cannot_tell_up_from_along() -> None:
    legs: list[Leg] = [(300, 0, 60, 30), (300, 0, -60, 30)] * 8
    found = fit_energy([log_of(*flown(legs))])
    assert found.vertical.value is None
    assert found.horizontal.value is None
    assert "cannot be separated from" in found.vertical.why
    assert "proportion" in found.horizontal.why


def test_two_flights_tell_what_neither_does_alone() -> None:
    slanted = log_of(*flown([(300, 0, 60, 30), (300, 0, -60, 30)] * 6))
    level = log_of(*flown([(0, 0, 10, 5), (4000, 0, 0, 400), (0, 0, 0, 40)], seed=2))
    assert not fit_energy([slanted]).is_complete
    assert not fit_energy([level]).is_complete
    both = fit_energy([slanted, level])
    assert both.vertical.value == pytest.approx(R1, rel=0.05)
    assert both.horizontal.value == pytest.approx(R2, rel=0.02)


def test_noise_as_large_as_the_effect_is_called_uncertain() -> None:
    legs: list[Leg] = [(0, 0, 75, 50), (3000, 0, 0, 300)]
    found = fit_energy([log_of(*flown(legs, noise=1.6, hz=1.0, seed=7))])
    assert found.vertical.value is None
    assert "uncertain" in found.vertical.why
    assert found.horizontal.value is not None  # sixty steps of it


def test_climbs_that_cost_more_than_descents_are_told() -> None:
    t, place, watts = flown(seed=8)
    up = np.gradient(place[:, 2], t)
    rising = np.interp(t, t[::25], np.sign(np.add.reduceat(up, np.arange(0, len(t), 25))))
    watts = watts + 60.0 * np.where(np.abs(up) > 0, rising, 0) * np.abs(
        np.gradient(np.interp(t, t[::50], place[::50, 2]), t)
    )
    assert "up_and_down_differ" in [n.code for n in fit_energy([log_of(t, place, watts)]).notes]


BASE, PER_M, UP = 300.0, 5.0, 40.0

TWO_SPEEDS: tuple[Leg, ...] = (
    (0, 0, 60, 30), (0, 0, 0, 40), (500, 0, 0, 100), (0, 500, 0, 100), (1400, 0, 0, 100), (0, -1400, 0, 100),
    (0, 0, -40, 25), (0, 0, 40, 20), (0, 0, 0, 40), (0, 0, -50, 30),
)  # fmt: skip


def timed(legs: Sequence[Leg], seed: int, wind: tuple[float, float] = (0.0, 0.0)) -> FlightLog:
    """A flight with a base power, in a wind that blows to the east and to the north."""
    t, place, _ = flown(legs, seed=seed)
    at = np.concatenate([[0.0], np.cumsum([leg[3] for leg in legs])])
    leg = np.minimum(np.searchsorted(at, t, side="right") - 1, len(legs) - 1)
    watts = np.array(
        [
            450.0 if not (e or n or u) else BASE + UP * abs(u) / s
            + PER_M * (math.hypot(e / s - wind[0], n / s - wind[1]) if e or n else 0.0)
            for e, n, u, s in legs
        ]
    )[leg]  # fmt: skip
    watts *= 1.0 + 0.03 * np.random.default_rng(seed).standard_normal(len(t))
    blows = np.column_stack([t, np.full(len(t), wind[0]), np.full(len(t), wind[1])]) if any(wind) else np.zeros((0, 3))
    return replace(log_of(t, place, watts), wind=blows)


@pytest.mark.parametrize("wind", [(0.0, 0.0), (3.0, -2.0)])
def test_two_speeds_tell_the_base_power_and_one_does_not(wind: tuple[float, float]) -> None:
    found = fit_energy([timed(TWO_SPEEDS, 21, wind)])
    assert found.base.value == pytest.approx(BASE, rel=0.05)
    assert found.horizontal.value == pytest.approx(PER_M, abs=1.0)
    assert found.vertical.value == pytest.approx(UP, rel=0.2)
    assert found.hover.value == pytest.approx(450.0, rel=0.02)
    slow, fast = found.fitted_m_s
    assert slow < 7.0
    assert fast > 12.0
    assert any(n.code.startswith("wind_") for n in found.notes) is True


def test_a_fit_at_one_speed_predicts_that_speed_alone_and_says_so() -> None:
    legs: tuple[Leg, ...] = ((0, 0, 60, 30), (2800, 0, 0, 200), (0, 0, -40, 25), (0, 0, 40, 20), (0, 0, 0, 40))
    found = fit_energy([timed(legs, 22)])
    assert found.base.value is None
    assert found.fitted_m_s == pytest.approx((14.0, 14.0), rel=0.02)
    assert yaml.safe_load(found.yaml())["energy"]["fitted_speed_m_s"] == pytest.approx(14.0, rel=0.02)
    both = fit_energy([timed(legs, 22), timed(TWO_SPEEDS, 23)])
    slow_w = (both.base.value or 0.0) + 5.0 * (both.horizontal.value or 0.0)
    assert slow_w == pytest.approx(BASE + 5.0 * PER_M, rel=0.05)


def test_a_power_that_does_not_grow_with_speed_is_a_base_power_alone() -> None:
    t, place, _ = flown(TWO_SPEEDS, seed=24)
    watts = 320.0 * (1.0 + 0.03 * np.random.default_rng(24).standard_normal(len(t)))
    found = fit_energy([log_of(t, place, watts)])
    assert found.is_complete
    assert found.base.value == pytest.approx(320.0, rel=0.05)
    assert found.horizontal.value == pytest.approx(0.0, abs=2.0)
