"""Sections: where they lie, the zones on them, and where a path crosses them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.optimal.plane.sections import Sections, crossings, lay_out, lines_of, widest_spans
from gcsplan.planners.problem import Via
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import random_mission
from tests.support.searches import looked, over_flat

MOST_M = 2200.0
RING = np.array([(800.0, 800.0), (1200.0, 800.0), (1200.0, 1250.0), (1000.0, 900.0), (800.0, 1250.0)])


def sections_of(*zones: Zone, max_agl_m: float = 120.0, step_m: float = 10.0) -> Sections:
    plane = looked(over_flat(*zones, max_agl_m=max_agl_m)).plane
    lines = lines_of(plane, 100.0)
    found = lay_out(plane, lines, widest_spans(plane, lines, MOST_M), step_m, MOST_M)
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
    assert not found.shut.any()


@pytest.mark.parametrize(
    ("floor", "ceiling", "shuts"),
    [
        (None, None, True),
        (Level(0.0, "amsl"), Level(130.0, "amsl"), True),
        (Level(5.0, "agl"), Level(150.0, "agl"), True),
        (None, Level(100.0, "agl"), False),
        (Level(20.0, "amsl"), None, False),
    ],
)
def test_nodes_are_shut_only_within_zones_that_fill_the_band(
    floor: Level | None, ceiling: Level | None, shuts: bool
) -> None:
    disc, ring = Circle(1000.0, 1000.0, 150.0), Polygon(RING)
    found = sections_of(Zone("disc", disc, floor, ceiling))
    farther = np.hypot(found.x - 1000.0, np.abs(found.y - 1000.0) + found.step_m)
    assert found.shut.any() == shuts
    assert not found.shut[farther > 150.0].any()
    if shuts:
        assert found.shut[farther < 149.5].all()
    found = sections_of(Zone("ring", ring, floor, ceiling))
    if shuts:  # no slit along the seams of the convex parts
        south = (found.y > 800.0 + 2.0 * found.step_m) & (found.y < 890.0 - 2.0 * found.step_m)
        assert found.shut[south & (found.x > 810.0) & (found.x < 1190.0)].all()
    notch = (np.abs(found.x - 1000.0) < 5.0) & (found.y > 900.0)
    assert not found.shut[notch].any()


def test_neighbours_of_a_free_node_stay_open_and_differences_are_the_widest() -> None:
    found = sections_of(Zone("disc", Circle(1000.0, 1000.0, 150.0)))
    values = np.arange(len(found.x), dtype=float) ** 2
    widest = found.widest(values)
    for k in range(len(found.lines)):
        part = values[found.first[k] : found.first[k + 1]]
        for n, value in enumerate(part):
            others = [abs(value - part[m]) for m in (n - 1, n + 1) if 0 <= m < len(part)]
            assert widest[found.first[k] + n] == max(others, default=0.0)
    assert found.nearest(np.full(len(found.lines), 1e6)).tolist() == (found.first[1:] - 1).tolist()


def test_crossings_are_the_first_of_a_path_on_each_leg() -> None:
    problem = over_flat(max_agl_m=120.0)
    problem = replace(problem, via=(Via(1000.0, 1400.0),))
    plane = looked(problem).plane
    lines = lines_of(plane, 150.0)
    path = np.array([problem.start, (700.0, 1500.0, 50.0), (600.0, 1100.0, 50.0), (1000.0, 1400.0, 50.0), problem.goal])
    found = crossings(plane, lines, path)
    for line, aside_m in zip(lines, found, strict=True):
        place = np.array([line.east_m, line.north_m]) + aside_m * np.array(line.across)
        runs = [
            float(abs((b - a)[0] * (place - a)[1] - (b - a)[1] * (place - a)[0]) / math.dist(a, b))
            for a, b in zip(path[:-1, :2], path[1:, :2], strict=True)
        ]
        assert min(runs) < 1e-6
    assert found[0] == found[-1] == 0.0


def test_no_floor_of_the_exact_check_is_below_the_lines_between_nodes() -> None:
    limits = Limits(40.0, 130.0, track_error_m=12.0, altitude_error_m=5.0, max_climb_deg=20.0, max_descent_deg=20.0)
    problem = random_mission(4, limits, zones=0)
    plane = looked(problem).plane
    lines = lines_of(plane, 400.0)
    most_m = 1.1 * sum(leg.straight_m for leg in plane.legs)
    found = lay_out(plane, lines, widest_spans(plane, lines, most_m), 25.0, most_m)
    assert found is not None
    here = np.flatnonzero(found.beside)
    t = np.random.default_rng(4).uniform(0.0, 1.0, len(here))
    x, y, low = (v[here] + t * (v[here + 1] - v[here]) for v in (found.x, found.y, found.low))
    room_m = problem.airspace.floor_amsl(x, y, limits) - low
    assert room_m.min() >= 0.0
    assert np.median(room_m) < 2.0  # the highest of five places, instead of all within the track error


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
