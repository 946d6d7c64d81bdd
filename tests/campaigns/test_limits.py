"""A short run of the campaign `limits`, and tests that it finds planted errors of the check."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from gcsplan.check import judge as judging
from gcsplan.check.motion.project import PlaneLegs, legs_in_plane
from tests.campaigns.limit_cases import FAMILIES
from tests.campaigns.limits import run

FOREVER_S = 1e9


@pytest.mark.nightly
def test_nothing_that_is_called_safe_at_the_limit_is_unsafe() -> None:
    tally = run(FOREVER_S, 3, ("px4", "terrain", "spline", "wing", "battery"), most=1, turns=1)
    assert tally.unsafe == []
    assert sum(tally.judged.values()) >= 4


@pytest.mark.nightly_but("500156-circle", "600078-return", "600111-spline", "600036-wing")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "family"),
    [
        (
            500156,
            "circle",
        ),  # a leg from a circle smaller than the track error was judged as if it began in the circle's middle
        (600078, "return"),  # PX4 begins its return below the mission's altitude and flies all of it that low
        (700239, "spline"),  # it had the climb angle of a curve on a sphere
        (600111, "spline"),  # the steepest point of a curve that almost turns back lay between the eight samples
        (600036, "wing"),  # where two arcs overlap, the piece back from one to the next counted as climbing distance
        (5001, "frames"),  # a leg above home was judged as if it began at its altitude, after one above ground
        (5003, "frames"),  # so was a return, and a circle above ground was judged as level
        (1000092, "wing"),  # where two arcs overlap on a leg of 0.86 m, both counted as climbing distance
    ],
)
def test_what_the_campaign_found_once_is_cured(seed: int, family: str) -> None:
    tally = run(FOREVER_S, seed, (family,), most=1)
    assert tally.judged[family] == 4
    assert tally.unsafe == []


@pytest.mark.nightly
def test_no_family_is_unsafe_at_the_limit() -> None:
    tally = run(FOREVER_S, 40, most=4)
    assert tally.unsafe == []
    assert set(tally.judged) == set(FAMILIES)


@pytest.mark.slow
def test_corners_that_nobody_judges_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def sharp(*_: object) -> None:
        """Replace `round_corners`: no corner is cut."""

    monkeypatch.setattr(judging, "round_corners", sharp)
    assert run(FOREVER_S, 29, ("px4",), most=1, turns=2).unsafe


@pytest.mark.nightly
@pytest.mark.parametrize("less", ["track_error_m", "altitude_error_m"])
def test_errors_that_are_taken_too_small_are_found(monkeypatch: pytest.MonkeyPatch, less: str) -> None:
    """If the check takes an error 0.2 m too small, the campaign finds a mission that is wrongly called safe."""

    def short(error_m: float) -> Callable[..., PlaneLegs]:
        def legs(stretches, limits, world, terrain_error_m):  # type: ignore[no-untyped-def]
            return legs_in_plane(
                stretches, replace(limits, **{less: max(0.0, getattr(limits, less) - error_m)}), world, terrain_error_m
            )

        return legs

    monkeypatch.setattr(judging, "legs_in_plane", short(0.2))
    assert any(run(FOREVER_S, seed, ("copter", "terrain"), most=1).unsafe for seed in range(1, 9))
