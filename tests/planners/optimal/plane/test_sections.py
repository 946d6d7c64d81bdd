"""Sections: where they lie, the altitudes and the zones on them, and what is left of them for a closer look."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.planners.optimal.plane.sections import (
    Sections,
    halved_spans,
    lay_out,
    lines_of,
    spans_within,
    widest_spans,
)
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import random_mission
from tests.support.searches import looked, over_flat

MOST_M = 2200.0
RING = np.array([(800.0, 800.0), (1200.0, 800.0), (1200.0, 1250.0), (1000.0, 900.0), (800.0, 1250.0)])


def sections_of(*zones: Zone, max_agl_m: float = 120.0, step_m: float = 10.0) -> Sections:
    plane = looked(over_flat(*zones, max_agl_m=max_agl_m)).plane
    lines = lines_of(plane, 100.0)
    found = lay_out(plane, lines, widest_spans(plane, lines, MOST_M), step_m)
    assert found is not None
    return found


def test_sections_span_the_ellipse_of_tracks_that_are_short_enough() -> None:
    found = sections_of()
    off = np.hypot(found.x - 300.0, found.y - 1000.0) + np.hypot(found.x - 1700.0, found.y - 1000.0)
    for k, line in enumerate(found.lines):
        part = slice(found.first[k], found.first[k + 1])
        if line.leg is None:
            assert found.first[k + 1] - found.first[k] == 1
            continue
        assert np.allclose(np.diff(found.aside[part]), found.step_m)
        assert np.allclose(found.x[part], line.east_m)
        assert off[part][[0, -1]].min() >= MOST_M  # all that lies within is between the outermost nodes
    assert np.all(np.diff([line.along_m for line in found.lines]) <= 100.0 + 1e-9)
    assert found.low.min() == pytest.approx(10.0 - 0.05, abs=1e-6)
    inner = slice(1, -1)
    assert found.high[inner].max() == pytest.approx(120.0 + 0.05, abs=1e-6)
    assert found.low[[0, -1]].tolist() == found.high[[0, -1]].tolist() == [50.0, 50.0]


@pytest.mark.parametrize(
    ("floor", "ceiling", "free"),
    [
        (None, None, []),
        (Level(0.0, "amsl"), Level(130.0, "amsl"), []),
        (Level(5.0, "agl"), Level(150.0, "agl"), []),
        (None, Level(100.0, "agl"), [(100.0, 120.0)]),
        (Level(20.0, "amsl"), None, [(10.0, 20.0)]),
        (Level(40.0, "agl"), Level(70.0, "amsl"), [(10.0, 40.0), (70.0, 120.0)]),
    ],
)
def test_nodes_within_a_zone_have_the_altitudes_below_and_above_it(
    floor: Level | None, ceiling: Level | None, free: list[tuple[float, float]]
) -> None:
    found = sections_of(Zone("disc", Circle(1000.0, 1000.0, 150.0), floor, ceiling))
    farther = np.hypot(found.x - 1000.0, np.abs(found.y - 1000.0) + found.step_m)
    assert np.allclose(found.low[farther > 150.0][1:-1], 9.95, atol=1e-6)
    inside = farther < 149.5
    at = found.x[inside], found.y[inside]
    altitudes = {(x, y): [] for x, y in zip(*at, strict=True)}
    for x, y, low, high in zip(*at, found.low[inside], found.high[inside], strict=True):
        altitudes[x, y].append((low, high))
    assert bool(altitudes) == bool(free)
    for some in altitudes.values():
        assert np.allclose(sorted(some), free, atol=0.06)
    found = sections_of(Zone("ring", Polygon(RING), floor, ceiling))
    south = (found.y > 800.0 + 2.0 * found.step_m) & (found.y < 890.0 - 2.0 * found.step_m)
    south &= (found.x > 810.0) & (found.x < 1190.0)
    widths = found.high[south] - found.low[south]
    assert widths.max(initial=0.0) < 51.0  # no slit along the seams of the convex parts
    notch = (np.abs(found.x - 1000.0) < 5.0) & (found.y > 900.0)
    assert np.allclose(found.high[notch] - found.low[notch], 110.1, atol=1e-3)


def test_a_closer_look_lies_over_what_is_left() -> None:
    plane = looked(over_flat(Zone("disc", Circle(1000.0, 1000.0, 150.0)), max_agl_m=120.0)).plane
    lines, finer = lines_of(plane, 200.0), lines_of(plane, 200.0, 1)
    assert [line.along_m for line in finer[::2]] == pytest.approx([line.along_m for line in lines])
    widest = widest_spans(plane, lines, MOST_M)
    found = lay_out(plane, lines, widest, 20.0)
    assert found is not None
    left = (np.abs(found.aside) > 160.0) & (np.abs(found.aside) < 260.0)
    left[[0, -1]] = True
    spans = spans_within(found.spans_of(left), widest)
    again = lay_out(plane, lines, spans, 7.0)
    assert again is not None
    assert set(np.unique(np.sign(again.aside[1:-1]))) == {-1.0, 1.0}
    assert np.abs(again.aside[1:-1]).min() >= 160.0 - 20.0 - 7.0
    for line, begin, end in zip(again.lines[1:-1], again.first[1:-2], again.first[2:-1], strict=True):
        here = again.aside[begin:end]
        for a, b in spans[again.lines.index(line)]:
            between = here[(here > a - 7.0) & (here < b + 7.0)]  # all of it lies between two neighbours
            assert between.min() <= a
            assert between.max() >= b
            assert np.allclose(np.diff(between), 7.0)
    rows = again.rows()
    assert np.all(np.diff(again.aside)[np.setdiff1d(np.arange(len(again.aside) - 1), rows[1:] - 1)] < 7.1)


@pytest.mark.parametrize("seed", range(5))
def test_no_short_path_crosses_a_line_between_two_sections_outside_its_span(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = sections_of(step_m=10.0)
    left = np.abs(found.aside) <= 40.0
    spare_m = float(rng.uniform(1.0, 30.0))
    spans = halved_spans(found, left, spare_m, 0.2)
    steepest = halved_spans(found, left, spare_m, math.inf)
    for k, gap_m in enumerate(found.gap.tolist()):
        ((low, high),) = spans[2 * k + 1]
        a, b = (rng.uniform(*(spans[m][0] if spans[m] else (0.0, 0.0)), 500) for m in (2 * k, 2 * k + 2))
        aside = rng.uniform(-400.0, 400.0, 500)
        longer = np.hypot(0.5 * gap_m, aside - a) + np.hypot(0.5 * gap_m, b - aside) - np.hypot(gap_m, b - a)
        short = longer <= spare_m
        assert np.all((aside[short] >= low) & (aside[short] <= high))
        assert high - low >= steepest[2 * k + 1][0][1] - steepest[2 * k + 1][0][0]


def test_all_legal_altitudes_of_the_exact_check_are_within_those_of_both_neighbours() -> None:
    limits = Limits(40.0, 130.0, track_error_m=12.0, altitude_error_m=5.0, max_climb_deg=20.0, max_descent_deg=20.0)
    problem = random_mission(4, limits, zones=0)
    plane = looked(problem).plane
    lines = lines_of(plane, 400.0)
    found = lay_out(plane, lines, widest_spans(plane, lines, 1.1 * sum(leg.straight_m for leg in plane.legs)), 25.0)
    assert found is not None
    here = np.flatnonzero(np.abs(np.diff(found.aside) - 25.0) < 1e-6)
    t = np.random.default_rng(4).uniform(0.0, 1.0, len(here))
    x, y = (v[here] + t * (v[here + 1] - v[here]) for v in (found.x, found.y))
    room_m = problem.airspace.floor_amsl(x, y, limits) - np.maximum(found.low[here], found.low[here + 1])
    assert room_m.min() >= 0.0
    assert np.median(room_m) < 6.0  # of the least floor between the neighbours


def test_chords_are_the_parts_of_a_line_within_the_zones() -> None:
    disc, ring = Circle(1000.0, 1000.0, 150.0), Polygon(RING)
    found = sections_of(Zone("disc", disc), Zone("ring", ring, None, Level(100.0, "agl")))
    seen = 0
    for line in found.lines:
        for (zone, *_), parts in line.chords.items():
            seen += 1
            assert sorted(parts) == parts
            for a, b in parts:
                for aside_m in np.linspace(a, b, 9):
                    east, north = line.east_m + aside_m * line.across[0], line.north_m + aside_m * line.across[1]
                    if zone == 0:
                        assert math.hypot(east - 1000.0, north - 1000.0) <= 150.0
                    else:
                        assert 800.0 <= east <= 1200.0
                        assert 800.0 <= north <= 900.0 + 1.76 * abs(east - 1000.0)
    assert seen > 4
