"""Many tracks at once: the level reported as clear passes the exact check, and hardly any lower level does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gcsplan.world import level_lines
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry import hulls
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.random_worlds import (
    in_degrees,
    in_plane,
    random_leg,
    random_limits,
    random_zones,
    surface_of,
    turned,
)


@pytest.mark.nightly_but("in_plane-1.0", "in_plane-0.0")
@pytest.mark.slow
@pytest.mark.parametrize("step", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("make", [in_plane, turned, in_degrees])
def test_what_is_clear_of_ground_and_zones_passes_the_exact_check(make: object, step: float) -> None:
    """In pieces as short as cells, and in pieces of a part of the longest line."""
    rng, looked = np.random.default_rng(11), 0
    for _ in range(25):
        ground = make(rng)  # type: ignore[operator]
        limits = replace(random_limits(rng, ground), max_climb_deg=90.0, max_descent_deg=90.0, max_amsl_m=None)
        air = Airspace(surface_of(rng, ground), random_zones(rng, ground), scale=float(rng.choice([1.0, 1.0003])))
        ends = np.array([random_leg(rng, ground) for _ in range(9)])
        longest_m = float(np.hypot(*(ends[:, 1] - ends[:, 0])[:, :2].T).max())
        met = level_lines.over(air, ends[:, 0], ends[:, 1], limits, step_m=step * longest_m)
        for need, asked in (
            (met.clear_m, replace(limits, min_agl_m=0.0, max_agl_m=None)), (met.legal_m, limits),
        ):  # fmt: skip
            level = need + rng.choice([0.0, 5.0, 40.0], len(need))
            under = level <= met.ceiling_m if asked.max_agl_m is not None else np.ones(len(level), np.bool_)
            at = met.crossings
            hit = (level[at.line] > at.bottom_m + 1e-9) & (level[at.line] < at.top_m - 1e-9)
            fine = np.isfinite(level) & under
            fine[at.line[hit]] = False
            z = np.where(fine, level, 0.0)
            legs = Legs.between(np.column_stack([ends[:, 0], z]), np.column_stack([ends[:, 1], z]), asked)
            assert air.clear(legs, asked)[fine].all()
            looked += int(fine.sum())
    assert looked > (60, 30, 5)[(0.0, 0.2, 1.0).index(step)]


def test_lines_over_more_cells_than_the_limit_are_looked_at_by_longer_pieces() -> None:
    z = np.random.default_rng(4).uniform(0.0, 60.0, (61, 61))
    air = Airspace(Surface(z, z, GridMap.affine(0.0, 300.0, 5.0, 5.0)))
    ends = np.random.default_rng(5).uniform(30.0, 270.0, (2, 12_000, 2))
    assert level_lines.step_of(air, ends[0][:100], ends[1][:100]) == 0.0
    step_m = level_lines.step_of(air, *ends)
    met = level_lines.over(air, *ends, Limits(20.0), step_m=step_m)
    close = level_lines.over(air, *(e[:40] for e in ends), Limits(20.0))
    assert 0.0 < step_m < 20.0
    assert len(met.piece_line) <= level_lines.MOST_GROUND_PIECES + len(ends[0])
    assert (met.clear_m[:40] >= close.clear_m - 0.01).all()
    assert (met.clear_m[:40] <= z.max() + 0.1).all()


def test_what_is_needed_over_a_slope_and_where() -> None:
    z = np.tile(np.linspace(0.0, 100.0, 41), (41, 1))
    air = Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)))
    limits = Limits(20.0, max_agl_m=120.0, altitude_error_m=5.0)
    a, b = np.array([[0.0, 0.0], [2000.0, 500.0]]), np.array([[2000.0, 0.0], [2000.0, 500.0]])
    met = level_lines.over(air, a, b, limits)
    assert met.clear_m == pytest.approx([80.0, 80.0], abs=0.02)
    assert met.legal_m == pytest.approx([100.0, 100.0], abs=0.02)
    assert met.ceiling_m == pytest.approx([25.0 + 115.0, 75.0 + 115.0], abs=0.02)
    wide = level_lines.over(air, a, b, limits, 40.0)
    assert wide.clear_m == pytest.approx([81.0, 81.0], abs=0.05)
    back = level_lines.over(air, np.vstack([a, b[:1]]), np.vstack([b, a[:1]]), limits)
    assert back.piece_s_m[back.piece_line == 2].max() == pytest.approx(1900.0, abs=101.0)


def test_the_surface_within_a_clearance_is_looked_at_for_a_clearance_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is half of the work of a way home, and the level is the same without it."""
    rng = np.random.default_rng(4)
    z = rng.uniform(0.0, 60.0, (41, 41))
    air = Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)))
    ends = rng.uniform(-800.0, 2800.0, (2, 12, 2))
    asked: list[tuple[float, ...]] = []

    def pieces(*arguments: Any) -> int:
        asked.append(arguments[-4:-1])
        return real(*arguments)

    real = level_lines.pieces
    monkeypatch.setattr(level_lines, "pieces", pieces)
    none, little = (Limits(20.0, horizontal_clearance_m=clear_m) for clear_m in (0.0, 1e-9))
    met, beside = (level_lines.over(air, *ends, limits, 50.0) for limits in (none, little))
    assert [reaches[2] for reaches in asked[:1]] == [level_lines.UNUSED]
    assert asked[-1][2] > 0.0
    assert np.array_equal(met.clear_m, beside.clear_m)
    assert np.array_equal(met.piece_s_m, beside.piece_s_m)


def test_zones_are_met_where_they_are() -> None:
    square = np.array([[500.0, -100.0], [700.0, -100.0], [700.0, 100.0], [500.0, 100.0]])
    zones = [
        Zone("disc", Circle(1000.0, 0.0, 100.0), Level(50.0, "amsl"), Level(90.0, "amsl")),
        Zone("square", Polygon(square), ceiling=Level(30.0, "agl")),
        Zone("upside down", Circle(1000.0, 0.0, 100.0), Level(90.0, "amsl"), Level(50.0, "amsl")),
        Zone("far", Circle(0.0, 2500.0, 100.0)),
    ]
    z = np.full((41, 41), 10.0)
    air = Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)), zones)
    limits = Limits(20.0, horizontal_clearance_m=10.0, altitude_error_m=2.0)
    a = np.array([[0.0, 0.0], [600.0, 0.0], [1500.0, 0.0], [0.0, 300.0]])
    b = np.array([[2000.0, 0.0], [600.0, 0.0], [2000.0, 0.0], [2000.0, 300.0]])
    at = level_lines.over(air, a, b, limits).crossings
    found = {(int(w), int(k)): i for i, (w, k) in enumerate(zip(at.line, at.zone, strict=True))}
    assert set(found) == {(0, 0), (0, 1), (1, 1)}
    disc, inside = found[0, 0], found[1, 1]
    assert (at.s0_m[disc], at.s1_m[disc]) == (pytest.approx(890.0, abs=0.1), pytest.approx(1110.0, abs=0.1))
    assert (at.bottom_m[disc], at.top_m[disc]) == (48.0, 92.0)
    assert at.s0_m[inside] == at.s1_m[inside] == 0.0
    assert at.bottom_m[inside] == -np.inf
    assert at.top_m[inside] == pytest.approx(42.0, abs=0.02)


def test_nothing_demanded_still_means_not_within() -> None:
    square = np.array([[500.0, -100.0], [700.0, -100.0], [700.0, 100.0], [500.0, 100.0]])
    z = np.full((41, 41), 10.0)
    air = Airspace(Surface(z, z, GridMap.affine(-1000.0, 3000.0, 100.0, 100.0)), [Zone("square", Polygon(square))])
    a = np.array([[600.0, 0.0], [0.0, 0.0], [0.0, 101.0], [0.0, 100.0]])
    b = np.array([[600.0, 0.0], [900.0, 0.0], [900.0, 101.0], [450.0, 100.0]])
    swept = level_lines.Swept(np.stack([a, a, b], axis=1), np.zeros(4))
    met = level_lines.over(air, a, b, Limits(20.0), 0.0, swept).crossings
    assert met.line.tolist() == [0, 1]
    assert met.begins.tolist() == [True, False]


@pytest.mark.nightly
def test_distances_of_hulls_are_those_of_their_points_mixed() -> None:
    rng = np.random.default_rng(2)
    mix = rng.dirichlet(np.full(5, 0.25), 4000)
    for _ in range(20):
        regions = rng.normal(0.0, 60.0, (6, 5, 2)) * rng.choice([0.02, 1.0], (6, 1, 1)) + rng.normal(0, 60, (6, 1, 2))
        regions[0, 2:] = regions[0, 1]  # a segment
        regions[1, 1:] = regions[1, 0]  # a point
        inner = np.einsum("pk,mkd->mpd", mix, regions)
        point = rng.normal(0.0, 60.0, 2)
        sampled = np.linalg.norm(inner - point, axis=-1).min(axis=1)
        exact = hulls.to_point(regions, point)
        assert (exact <= sampled + 1e-9).all()
        assert (exact >= sampled - 9.0).all()
        turn = np.arange(6) * np.pi / 3.0 + rng.uniform(0.0, 0.9, 6)
        corners = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * rng.uniform(10.0, 60.0, (6, 1))
        filled = np.einsum("pk,kd->pd", rng.dirichlet(np.full(3, 0.5), 300), np.vstack([corners[:2], [[0.0, 0.0]]]))
        edges = corners + rng.uniform(0.0, 1.0, (40, 6, 1)) * (np.roll(corners, -1, axis=0) - corners)
        border = edges.reshape(-1, 2)
        apart = np.linalg.norm(inner[:, ::8, None] - border[None, None], axis=-1).min(axis=(1, 2))
        exact = hulls.to_polygon(regions, corners)
        assert (exact <= apart + 1e-9).all()
        outside = exact > 0.0
        assert (exact[outside] >= apart[outside] - 12.0).all()
        for m in range(6):  # a hull inside the polygon, or around it, overlaps it
            held = hulls.to_polygon(regions[m : m + 1] * 0.0 + filled[0], corners)
            assert held[0] < 0.0
        around = 1e3 * np.array([[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, 0.0]]])
        assert hulls.to_polygon(around, corners)[0] < 0.0
