"""The exact check's kernels: machine code does what the plain functions say, over rough worlds with unknown ground."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.world import airspace, tube
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.kernels import neighbourhood
from gcsplan.world.kernels.entries import around, judge, pieces
from gcsplan.world.kernels.extrema import local_extrema
from tests.support.both_ways import run_both_ways

LIMITS = Limits(
    20.0, max_agl_m=120.0, max_amsl_m=260.0, horizontal_clearance_m=6.0, track_error_m=4.0, altitude_error_m=3.0,
    max_climb_deg=25.0, max_descent_deg=30.0,
)  # fmt: skip
SQUARE = np.array([[60.0, 60.0], [130.0, 70.0], [120.0, 140.0], [50.0, 110.0]])


def rough(seed: int) -> Airspace:
    rng = np.random.default_rng(seed)
    z = rng.normal(100.0, 12.0, (21, 23))
    z[rng.random(z.shape) < 0.02] = np.nan
    zones = [
        Zone("square", Polygon(SQUARE), Level(20.0, "agl"), Level(60.0, "agl")),
        Zone("disc", Circle(150.0, 60.0, 25.0), None, Level(180.0, "amsl")),
    ]
    return Airspace(Surface(z, z + 4.0, GridMap.affine(0.0, 200.0, 10.0, 10.0)), zones)


def legs(seed: int, count: int) -> Legs:
    rng = np.random.default_rng([seed, 1])
    start, end = (
        np.column_stack([rng.uniform(10.0, 190.0, (count, 2)), rng.uniform(110.0, 230.0, count)]) for _ in "ab"
    )
    return Legs(start, end, np.zeros(count, np.bool_), np.full(count, 4.0), np.full(count, 3.0))


@pytest.fixture(autouse=True)
def _as_in_kernels() -> object:
    """Plain functions divide numpy's numbers, and by zero without a word, as kernels do."""
    with np.errstate(all="ignore"):
        yield


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(3))
def test_legs_are_judged_alike_by_machine_code_and_plain_functions(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert airspace.judge is judge
    looked = run_both_ways(monkeypatch, neighbourhood, local_extrema.__name__)
    judged = run_both_ways(monkeypatch, airspace, judge.__name__)
    world = rough(seed)
    report = world.examine(legs(seed, 12), LIMITS)
    assert len({v.kind for v in report.violations}) >= 4
    assert world.clear(legs(seed, 12), LIMITS).shape == (12,)
    assert len(judged) >= 2
    assert looked


@pytest.mark.parametrize("seed", range(3))
def test_tubes_and_bounds_are_alike_by_machine_code_and_plain_functions(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    cut = run_both_ways(monkeypatch, tube, pieces.__name__)
    bounded = run_both_ways(monkeypatch, airspace, around.__name__)
    world, rng = rough(seed), np.random.default_rng([seed, 2])
    found = world.tube(rng.uniform(20.0, 180.0, (4, 2)), LIMITS)
    assert len(found.s_m) > 4
    assert len(cut) >= 1
    floor = world.floor_amsl(*rng.uniform(20.0, 180.0, (2, 9)), LIMITS)
    assert floor.shape == (9,)
    assert len(bounded) >= 1
