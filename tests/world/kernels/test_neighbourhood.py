"""Local extrema around each cell: against every cell computed by itself, and tile by tile against all at once."""

from __future__ import annotations

import pickle
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.kernels import neighbourhood as _neighbourhood
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.neighbourhood import LineBatch, Neighbourhood, Neighbourhoods, extrema_around
from gcsplan.world.kernels.shared import MASK, SHIFT, LocalExtrema, steps_of


def legs_of(start: Floats, end: Floats) -> Legs:
    n = len(start)
    return Legs(start, end, np.zeros(n, np.bool_), np.full(n, 3.0), np.full(n, 2.0))


def rough(rng: np.random.Generator, shape: tuple[int, int], unknown: float) -> Floats:
    z = np.asarray(rng.normal(300.0, 100.0, shape))
    z[rng.random(shape) < unknown] = np.nan
    return z


def by_hand(field: Field, z: Floats, extrema: LocalExtrema) -> tuple[Floats, Floats, Floats]:
    """Slope, highest and lowest height around every cell, in plain numpy and double precision."""
    corners = np.stack([z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]])
    across = np.maximum(abs(corners[1] - corners[0]), abs(corners[3] - corners[2])) / field.step_x
    down = np.maximum(abs(corners[2] - corners[0]), abs(corners[3] - corners[1])) / field.step_y
    steep = np.hypot(across, down)
    slope, high, low = (np.empty(steep.shape) for _ in range(3))
    rows, cols = steep.shape
    for r in range(rows):
        for c in range(cols):
            box = np.s_[
                max(r - extrema.rows, 0) : r + extrema.rows + 1, max(c - extrema.cols, 0) : c + extrema.cols + 1
            ]
            known = ~np.isnan(steep[box])
            beyond = known.size < (2 * extrema.rows + 1) * (2 * extrema.cols + 1)
            slope[r, c] = steep[box][known].max(initial=0.0) * (-1.0 if beyond or not known.all() else 1.0)
            high[r, c] = corners[:, *box][:, known].max(initial=-np.inf)
            low[r, c] = corners[:, *box][:, known].min(initial=np.inf)
            if np.isnan(steep[r, c]):
                slope[r, c] = np.inf
    return slope, high, low


def in_rows(extrema: LocalExtrema, z: Floats) -> tuple[Floats, Floats, Floats]:
    """Slope, highest and lowest height, (rows - 1, cols - 1), out of the strips."""
    n, m = z.shape[0] - 1, z.shape[1] - 1
    slope, high, low = (np.swapaxes(a, 0, 1).reshape(n, -1)[:, :m] for a in extrema[:3])
    return slope, high, low


@pytest.mark.nightly_but("10", "5")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_it_bounds_all_that_is_around_and_hardly_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    most = 60, 60 if seed % 3 else 400  # beyond a strip
    z = rough(rng, (int(rng.integers(2, most[0])), int(rng.integers(2, most[1]))), float(rng.choice([0.0, 0.002, 0.1])))
    grid = GridMap.affine(0.0, 0.0, float(rng.uniform(1.0, 30.0)), float(rng.uniform(1.0, 30.0)))
    field = Field.of(grid)
    extrema = extrema_around(field, z, float(rng.choice([0.0, 1.0, 10.0, 90.0])))
    slope, high, low = by_hand(field, z, extrema)
    of_slope, of_high, of_low = in_rows(extrema, z)
    assert np.array_equal(np.isinf(of_slope), np.isinf(slope))
    known = np.isfinite(slope)
    assert np.array_equal(np.signbit(of_slope[known]), np.signbit(slope[known]))
    for ours, theirs, sign in ((abs(of_slope), abs(slope), 1.0), (of_high, high, 1.0), (of_low, low, -1.0)):
        a, b = sign * ours[known].astype(float), sign * theirs[known]
        assert (a >= b).all()
        assert (a <= b + 1e-3 + 3e-6 * abs(b)).all()


def test_a_reach_beyond_the_surface_takes_no_more_room_than_one_as_large() -> None:
    """A clearance of 1000 km asked for 28 GB around 160 by 160 posts."""
    z = rough(np.random.default_rng(1), (60, 45), 0.01)
    field = Field.of(GridMap.affine(0.0, 0.0, 20.0, 30.0))
    whole = extrema_around(field, z, 1800.0)
    tracemalloc.start()
    beyond = extrema_around(field, z, 1e6)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4e6
    assert all(np.array_equal(a, b) for a, b in zip(beyond[:3], whole[:3], strict=True))


def test_a_reach_that_takes_too_much_room_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    z = np.zeros((400, 400))
    field = Field.of(GridMap.affine(0.0, 0.0, 1.0, 1.0))
    extrema_around(field, z, 100.0)
    monkeypatch.setattr(_neighbourhood, "MOST_ROOM_BYTES", z.nbytes + 4 * 4 * (399 + 2 * 100) ** 2 - 1)
    with pytest.raises(InputError, match="a reach of 100 m, of clearances and errors together, is 100 cells"):
        extrema_around(field, z, 100.0)
    extrema_around(field, z, 99.0)


def same_where_seen(part: LocalExtrema, whole: LocalExtrema, rows: NDArray[np.intp], cols: NDArray[np.intp]) -> bool:
    at = cols >> SHIFT, rows, cols & MASK
    return all(np.array_equal(a[at], b[at]) for a, b in zip(part[:3], whole[:3], strict=True))


@pytest.mark.nightly_but("0.0")
@pytest.mark.slow
@pytest.mark.parametrize("reach_m", [0.0, 4.0, 70.0])
def test_lines_find_all_that_they_meet_looked_at_and_little_else(
    reach_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    z = rough(rng, (900, 1100), 1e-4)
    grid = GridMap.affine(0.0, 0.0, 5.0, 4.0)
    field = Field.of(grid)
    whole = extrema_around(field, z, reach_m)
    monkeypatch.setattr(_neighbourhood, "LARGE_WINDOW", 1000)
    for _ in range(20):
        ours = Neighbourhood(grid, field, z, reach_m)
        assert not ours.extrema.slope.any()
        start, end = np.stack([rng.uniform(-200.0, 5700.0, (2, 3)), -rng.uniform(-200.0, 3800.0, (2, 3))], axis=-1)
        ours.along(LineBatch(start, end))
        t = np.linspace(0.0, 1.0, 20_000)[:, None, None]
        cells = np.floor(grid(*(start + t * (end - start)).reshape(-1, 2).T)).astype(np.intp)
        cells = cells[((cells >= 0) & (cells < [1099, 899])).all(axis=1)]
        assert same_where_seen(ours.extrema, whole, cells[:, 1], cells[:, 0])
        assert not ours.seen.all()
    copy = pickle.loads(pickle.dumps(ours))
    copy.along(LineBatch(start, end))
    assert same_where_seen(copy.extrema, whole, cells[:, 1], cells[:, 0])


@pytest.mark.parametrize("in_order", [True, False])
def test_places_of_a_raster_have_all_their_cells_looked_at(in_order: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    z = rough(rng, (300, 400), 1e-4)
    grid = GridMap.affine(0.0, 0.0, 5.0, 4.0)
    field = Field.of(grid)
    whole = extrema_around(field, z, 4.0)
    monkeypatch.setattr(_neighbourhood, "LARGE_WINDOW", 1000)
    ours = Neighbourhood(grid, field, z, 4.0)
    x, y = np.meshgrid(np.arange(60.0, 1900.0, 6.0), -np.arange(10.0, 500.0, 6.0))
    places = np.stack([x.ravel(), y.ravel()], axis=-1)
    places = places if in_order else rng.permutation(places)
    ours.along(LineBatch(places, places))
    cells = np.floor(grid(*places.T)).astype(np.intp)
    assert same_where_seen(ours.extrema, whole, cells[:, 1], cells[:, 0])
    assert not ours.seen.all()
    ours.along(LineBatch(places[:0], places[:0]))


@pytest.mark.nightly
def test_what_is_looked_at_in_part_judges_as_what_is_looked_at_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(8)
    z = np.cumsum(np.cumsum(rng.normal(0.0, 0.4, (700, 800)), axis=0), axis=1)
    z = 200.0 + 60.0 * z / abs(z).max()
    surface = Surface(z, z, GridMap.affine(0.0, 0.0, 6.0, 6.0), {})
    limits = Limits(min_agl_m=30.0, max_agl_m=150.0, horizontal_clearance_m=20.0, track_error_m=3.0)
    start, end = (
        np.stack([rng.uniform(20.0, 4700.0, 300), -rng.uniform(20.0, 4100.0, 300), rng.uniform(180.0, 420.0, 300)], -1)
        for _ in range(2)
    )
    end = start + (end - start) * rng.uniform(0.0, 1.0, (300, 1)) ** 3
    legs = legs_of(start, end)
    whole = Airspace(surface)
    clear, report = whole.clear(legs, limits), whole.examine(legs, limits)
    floor, ceiling = whole.floor_amsl(*start[:, :2].T, limits), whole.ceiling_amsl(*start[:, :2].T, limits)
    tubes = [whole.tube(np.stack([a[:2], b[:2]]), limits) for a, b in zip(start, end, strict=True)]
    monkeypatch.setattr(_neighbourhood, "LARGE_WINDOW", 1000)
    assert clear.any()
    assert not clear.all()
    # One leg at a time in a new airspace, so that only its own tiles have been examined.
    for k in range(0, 300, 10):
        assert Airspace(surface).clear(legs_of(start[k : k + 1], end[k : k + 1]), limits)[0] == clear[k]
    part = Airspace(surface)
    assert np.array_equal(part.floor_amsl(*start[:, :2].T, limits), floor)
    assert np.array_equal(part.ceiling_amsl(*start[:, :2].T, limits), ceiling)
    for a, b, tube in zip(start, end, tubes, strict=True):
        again = Airspace(surface).tube(np.stack([a[:2], b[:2]]), limits)
        assert np.array_equal(again.floor_m, tube.floor_m)
        assert np.array_equal(again.ceiling_m, tube.ceiling_m)
    assert np.array_equal(part.clear(legs, limits), clear)
    assert part.examine(legs, limits).violations == report.violations


def test_what_was_not_looked_at_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel that reaches a tile that was not examined must not treat it as flat ground."""
    monkeypatch.setattr(_neighbourhood, "LARGE_WINDOW", 100)
    monkeypatch.setattr(LineBatch, "tiles", lambda self, grid, field, shape: np.zeros(shape, np.bool_))
    z = np.full((50, 50), 100.0)
    blind = Airspace(Surface(z, z, GridMap.affine(0.0, 0.0, 10.0, 10.0), {}))
    limits = Limits(min_agl_m=30.0, max_agl_m=500.0, horizontal_clearance_m=20.0, track_error_m=3.0)
    a, b = np.array([[100.0, -100.0, 200.0]]), np.array([[300.0, -250.0, 200.0]])
    assert not blind.clear(legs_of(a, b), limits)[0]
    assert blind.examine(legs_of(a, b), limits).violations
    assert np.isinf(blind.floor_amsl(a[:, 0], a[:, 1], limits)).all()
    assert np.isinf(blind.tube(np.concatenate([a, b])[:, :2], limits).floor_m).all()


@pytest.mark.nightly
def test_neighbourhoods_forget_those_asked_for_least_lately_and_judge_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """A way home asks for many reaches: those of 40 million cells took 4 GB."""
    rng = np.random.default_rng(5)
    z = rough(rng, (500, 900), 1e-5)
    grid = GridMap.affine(0.0, 0.0, 5.0, 5.0)
    field = Field.of(grid)
    monkeypatch.setattr(_neighbourhood, "LARGE_WINDOW", 1000)
    tile = _neighbourhood.TILE**2 * _neighbourhood.CELL_BYTES
    monkeypatch.setattr(_neighbourhood, "MOST_EXAMINED_BYTES", 30 * tile)
    kept = Neighbourhoods(grid, field)
    reaches = [5.0 * k for k in (1, 2, 3, 4, 5, 6)]
    whole = {reach_m: extrema_around(field, z, reach_m) for reach_m in reaches}
    for _ in range(60):
        reach_m = float(rng.choice(reaches))
        start, end = np.stack([rng.uniform(0.0, 4490.0, (2, 2)), -rng.uniform(0.0, 2490.0, (2, 2))], axis=-1)
        kept.along(False, z, reach_m, LineBatch(start, end))
        extrema = next(reversed(kept.kept.values())).extrema
        t = np.linspace(0.0, 1.0, 2000)[:, None, None]
        cells = np.floor(grid(*(start + t * (end - start)).reshape(-1, 2).T)).astype(np.intp)
        cells = cells[((cells >= 0) & (cells < [899, 499])).all(axis=1)]
        assert same_where_seen(extrema, whole[reach_m], cells[:, 1], cells[:, 0])
        held = [one.examined_bytes for one in kept.kept.values()]
        assert sum(held) <= 30 * tile or len(held) <= _neighbourhood.AT_ONCE
    assert pickle.loads(pickle.dumps(kept)).kept == {}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the memory that is held as Linux tells it")
def test_a_line_across_a_large_surface_takes_memory_for_its_tiles_alone() -> None:
    """A page of 4 kB for every row of every tile, or of 2 MB, were ten and a hundred times as much."""

    def held_bytes() -> int:
        words = Path("/proc/self/status").read_text().split()
        return 1024 * int(words[words.index("VmRSS:") + 1])

    z = np.full((6000, 6000), 100.0)
    grid = GridMap.affine(0.0, 0.0, 5.0, 5.0)
    field = Field.of(grid)
    line = LineBatch(np.array([[2500.0, 0.0]]), np.array([[27_000.0, -29_990.0]]))
    before = held_bytes()
    ours = Neighbourhood(grid, field, z, 5.0)
    ours.along(line)
    assert ours.examined_bytes < 20_000_000
    assert held_bytes() - before < ours.examined_bytes + 10_000_000


def test_the_bounds_of_a_map_are_its_least_steps_and_its_largest_bend() -> None:
    frame = Frame(60.0, 10.0)
    grid = GridMap.fit(lambda e, n: tuple(frame.to_degrees(e, n).T[::-1] * 3600.0), (-4e4, -4e4, 4e4, 4e4))
    field, at = Field.of(grid), np.random.default_rng(1).uniform(-4e4, 4e4, (300, 2))
    inverse = [np.linalg.inv(grid.jacobian(*place)) for place in at.tolist()]
    x, y = np.array([steps_of(*m.ravel().tolist()) for m in inverse]).T
    assert 0.997 * x.min() < field.step_x <= x.min()
    assert 0.99 * y.min() < field.step_y <= y.min()
    turns = []
    for place, cells, angle in zip(at.tolist(), inverse, np.linspace(0.0, 2.0 * np.pi, len(at)), strict=True):
        ahead = 10.0 * np.array([np.cos(angle), np.sin(angle)])
        before, here, behind = (grid(*(place + s * ahead)) for s in (-1.0, 0.0, 1.0))
        turns.append(np.linalg.norm(cells @ (before - 2.0 * here + behind)) / 100.0)
    assert 0.5 * field.bend < max(turns) <= field.bend
