"""The outside of keep-in areas as zones: shared edges, levels, gaps between its parts, names."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.outside import MOST_PIECES, outside_of
from gcsplan.world.geometry.zones import AreaPart, KeepIn, Level, keep_in_of, no_fly_of, on_map
from tests.support.worlds import surface

FAR_M = 5000.0
FREE = Limits(min_agl_m=-1e6)


def box(west: float, south: float, east: float, north: float, *holes: AreaPart) -> AreaPart:
    ring = np.array([(west, south), (east, south), (east, north), (west, north)], float)
    return AreaPart(ring, tuple(hole.outline for hole in holes))


def area(name: str, part: AreaPart, floor: Level | None = None, ceiling: Level | None = None) -> KeepIn:
    return KeepIn(name, (part,), floor, ceiling)


def passes(
    areas: list[KeepIn], *way: tuple[float, float, float], track_m: float = 0.0, altitude_m: float = 0.0,
    slit_m: float = 0.0,
) -> bool:  # fmt: skip
    air = Airspace(surface(0.0, half_m=6000.0, step_m=1000.0), outside_of(areas, FAR_M, slit_m=slit_m))
    points = np.array(way)
    n = len(points) - 1
    legs = Legs(points[:-1], points[1:], np.zeros(n, np.bool_), np.full(n, track_m), np.full(n, altitude_m))
    return bool(air.clear(legs, FREE).all())


WEST, EAST = area("west", box(-500, -500, 0, 500)), area("east", box(0, -500, 700, 500))


def test_no_areas_have_no_outside() -> None:
    assert outside_of([], FAR_M) == ()


def test_a_flight_crosses_an_edge_that_two_areas_share() -> None:
    assert passes([WEST, EAST], (-400, 0, 50), (600, 0, 50), track_m=99.9)
    assert not passes([WEST], (-400, 0, 50), (600, 0, 50))


def test_errors_that_reach_over_the_edge_are_outside_by_micrometres() -> None:
    assert passes([WEST], (-400, 0, 50), (-300, 0, 50), track_m=100.0)
    assert not passes([WEST], (-400, 0, 50), (-300, 0, 50), track_m=100.00001)


def test_a_flight_does_not_cross_a_gap_and_a_slit_counts_as_one_without_allowance() -> None:
    apart = area("east", box(0.06, -500, 700, 500))
    assert not passes([WEST, apart], (-400, 0, 50), (600, 0, 50))
    assert passes([WEST, apart], (-400, 0, 50), (600, 0, 50), track_m=90.0, slit_m=0.05)
    wide = area("east", box(0.2, -500, 700, 500))
    assert not passes([WEST, wide], (-400, 0, 50), (600, 0, 50), slit_m=0.05)


def test_a_closed_slit_adds_nothing_beyond_the_edges_of_the_areas() -> None:
    areas = [WEST, area("east", box(0.06, -500, 700, 500))]
    assert passes(areas, (-50, 450, 50), (50, 450, 50), track_m=49.97, slit_m=0.05)
    assert not passes(areas, (-50, 450, 50), (50, 450, 50), track_m=50.001, slit_m=0.05)


def test_a_hole_is_outside_unless_another_area_covers_it() -> None:
    hole = box(-100, -100, 100, 100)
    ring = area("ring", box(-500, -500, 500, 500, hole))
    assert not passes([ring], (-400, 0, 50), (400, 0, 50))
    assert passes([ring, area("lid", hole)], (-400, 0, 50), (400, 0, 50))


def test_no_line_is_left_free_where_the_outside_is_cut() -> None:
    """Cuts run through the middles of areas: a flight without errors along each of them, outside, is stopped."""
    areas = [area("a", box(-10, -10, 10, 10)), area("b", box(200, 90, 260, 130)), area("c", box(-300, 300, -299, 380))]
    x = np.concatenate([np.linspace(-320, 320, 641), [0.2, -0.2, 1.0, -1.0, 231.0, 229.0, -299.5]])
    near, far, up = np.full(len(x), 1000.0), np.full(len(x), 1500.0), np.full(len(x), 50.0)
    start = np.concatenate([np.column_stack([x, near, up]), np.column_stack([near, x, up])])
    end = np.concatenate([np.column_stack([x, far, up]), np.column_stack([far, x, up])])
    air = Airspace(surface(0.0, half_m=6000.0, step_m=1000.0), outside_of(areas, FAR_M))
    assert not air.clear(Legs.between(start, end, FREE), FREE).any()


def test_the_highest_ceiling_of_areas_counts_where_they_overlap() -> None:
    low = area("low", box(-500, -500, 100, 500), None, Level(100.0, "amsl"))
    high = area("high", box(0, -500, 500, 500), None, Level(200.0, "amsl"))
    assert passes([low, high], (50, 0, 150), (400, 0, 150), altitude_m=50.0, track_m=50.0)
    assert not passes([low, high], (50, 0, 150), (400, 0, 150), altitude_m=50.001)
    assert not passes([low, high], (-50, 0, 150), (400, 0, 150))
    assert passes([low, high], (-50, 0, 50), (400, 0, 50), altitude_m=50.0)


def test_areas_above_each_other_are_one_and_no_level_is_left_free_outside() -> None:
    lower = area("lower", box(-500, -500, 500, 500), None, Level(100.0, "amsl"))
    upper = area("upper", box(-500, -500, 0, 500), Level(100.0, "amsl"), Level(200.0, "amsl"))
    assert passes([lower, upper], (-250, 0, 10), (-250, 0, 190), altitude_m=9.0, track_m=200.0)
    for level in (100.0, 200.0, 150.0):  # along the levels themselves, without errors
        assert not passes([lower, upper], (-2000, 0, level), (-1000, 0, level))
    assert passes([lower, upper], (250, 0, 100.0), (300, 0, 100.0))
    assert not passes([lower, upper], (250, 0, 100.001), (300, 0, 100.001))
    thin = [area("a", box(-500, -500, 500, 500), Level(50.0, "amsl"), Level(100.0, "amsl")),
            area("b", box(-50, -50, 50, 50), Level(150.0, "amsl"), Level(200.0, "amsl"))]  # fmt: skip
    for level in (100.0, 125.0, 150.0):
        assert passes(thin, (300, 0, level), (400, 0, level)) is (level == 100.0)
    assert not passes(thin, (300, 0, 150.0), (400, 0, 150.0))


@pytest.mark.parametrize("datums", [("amsl", "agl"), ("agl", "amsl"), ("agl", "agl")])
def test_levels_of_both_datums_count_each_in_its_own_area(datums: tuple[str, str]) -> None:
    first = area("first", box(-500, -500, 0, 500), None, Level(100.0, datums[0]))  # type: ignore[arg-type]
    second = area("second", box(0, -500, 500, 500), None, Level(80.0, datums[1]))  # type: ignore[arg-type]
    assert passes([first, second], (-400, 0, 60), (400, 0, 60), track_m=90.0, altitude_m=19.9)
    assert not passes([first, second], (-400, 0, 60), (400, 0, 60), altitude_m=20.1)
    assert passes([first, second], (-400, 0, 60), (-100, 0, 60), altitude_m=39.9)
    for x in (0.0, 0.0005, -0.0005):  # along the edge between both, above both
        assert not passes([first, second], (x, -100, 101.0), (x, 100, 101.0))


def test_an_area_with_a_level_of_each_datum_has_both() -> None:
    both = [area("both", box(-500, -500, 500, 500), Level(30.0, "amsl"), Level(120.0, "agl"))]
    assert passes(both, (-400, 0, 75), (400, 0, 75), altitude_m=44.9)
    assert not passes(both, (-400, 0, 75), (400, 0, 75), altitude_m=45.1)


def test_areas_that_are_all_far_away_shut_everything() -> None:
    assert not passes([KeepIn("far", ())], (0, 0, 50), (10, 0, 50))


def test_a_convex_area_has_few_simple_polygons_around_it() -> None:
    (one, two) = outside_of([WEST], FAR_M)
    assert len(one.edges) == len(two.edges) == 8
    assert one.name == two.name == "outside of 'west'"
    assert keep_in_of([one]) == (WEST,)
    assert no_fly_of([one, two]) == ()
    capped = outside_of([area("a", box(0, 0, 10, 10), None, Level(9.0, "agl"))], FAR_M)
    assert len(on_map(capped)) == 2
    assert len(capped) == 3


def test_many_names_are_shortened_and_the_nearest_area_is_named() -> None:
    areas = [area(f"a{k}", box(100 * k, 0, 100 * k + 50, 50)) for k in range(6)]
    zone = outside_of(areas, FAR_M)[0]
    assert zone.name == "outside of 'a0', 'a1', 'a2' and 3 more"
    assert zone.title == "keep-in areas 'a0', 'a1', 'a2' and 3 more"
    assert zone.name_at(380.0, 100.0) == "a3" or zone.name_at(380.0, 100.0) == "a4"
    assert zone.name_at(590.0, 20.0) == "a5"


@pytest.mark.nightly
def test_more_pieces_than_are_taken_are_refused() -> None:
    areas = [area(f"{k}", box(10 * k, 10 * (k % 7), 10 * k + 5, 10 * (k % 7) + 5)) for k in range(-205, 205)]
    with pytest.raises(InputError, match=f"more than {MOST_PIECES} pieces"):
        outside_of(areas, 50_000.0)
