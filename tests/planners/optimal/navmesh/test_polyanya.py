"""Shortest tracks over meshes, compared with visibility graphs over the same free triangles, made with shapely."""

from __future__ import annotations

import math
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Bools, Floats
from gcsplan.bench.terrain.problems import problems
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal import planner as optimal
from gcsplan.planners.optimal.navmesh import polyanya, portals
from gcsplan.planners.optimal.navmesh.grid import Plane
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.navmesh.mesh_kernels import make_pieces, make_portals, sort_portals
from gcsplan.planners.optimal.navmesh.portals import Portals
from tests.support.effort import draws

Place = tuple[float, float]

PLAIN = np.array([[10.0, 0.0], [0.0, 10.0]])
FORMS = {
    "plain": PLAIN,
    "turned": np.array([[8.0, -6.0], [6.0, 8.0]]),
    "sheared": np.array([[9.0, 3.5], [-1.0, 13.0]]),
}
"""Shapes of the grid as matrices; columns: one step along a row, and one step to the next row."""
EACH_FORM = ["plain", pytest.param("turned", marks=pytest.mark.slow), "sheared"]
REACH_M = 1e-7
"""The free area is grown by this before lines are tested against it, because coordinates are rounded."""


def mesh_of(
    excess: Floats,
    diagonal: NDArray[np.int8] | None = None,
    form: Floats = PLAIN,
    own: dict[int, Floats] | None = None,
    block: int = 4,
) -> Mesh:
    """The mesh of an excess lattice; ``own``: walls (W, 4) of each cell that has its own."""
    ny, nx = excess.shape
    cells = (ny - 1) * (nx - 1)
    excess = np.ascontiguousarray(excess, np.float64)
    diagonal = np.zeros(cells, np.int8) if diagonal is None else diagonal
    of, rows = np.zeros(cells, np.int32), [np.zeros(5)]
    for k, walls in (own or {}).items():
        for wall in walls:
            rows.append(np.array([*wall, of[k]]))
            of[k] = len(rows)
    values = np.array(rows)
    i, j = np.meshgrid(np.arange(nx), np.arange(ny))
    x, y = (form[0, 0] * i + form[0, 1] * j, form[1, 0] * i + form[1, 1] * j)
    piece = np.empty((cells, 2), np.int32)
    span = np.tile(np.array([0, nx - 1], np.int32), (ny - 1, 1))
    around = np.tile(np.array([0, nx], np.int32), (ny, 1))
    count = make_pieces(excess, of, values, diagonal, around, span, piece, block, np.empty(0, np.bool_))
    room = 32 * cells + 64
    ends, names, joins = np.empty((room, 4)), np.empty((room, 2), np.int64), np.empty((room, 2), np.int32)
    n = make_portals(excess, of, values, diagonal, span, piece, x, y, ends, names, joins, np.empty(2))
    assert n <= room
    start, order = np.zeros(count + 1, np.int32), np.empty(2 * n, np.int32)
    sort_portals(joins[:n], start, order)
    inverse = np.linalg.inv(form)

    def at(place: Place) -> Place:
        c, r = inverse @ np.array(place)
        return float(c), float(r)

    plane = cast(
        Plane,
        SimpleNamespace(
            at=at,
            begins=lambda _: (0, 0),
            parts=1,
            stride=1,
            inside=np.ones((ny - 1, nx - 1), np.bool_),
            problem=SimpleNamespace(budget=Budget.endless()),
        ),
    )
    named = 8 * (nx * ny + 1)
    return Mesh(
        start, ends[:n], names[:n], joins[:n], order, named, 8, plane, 1, 0, 0, excess, excess, diagonal, span, piece
    )


def below_zero(corners: Floats, values: Floats) -> Floats:
    """The part of a triangle (3, 2) where the linear function through its corners' ``values`` is at most 0."""
    out: list[Floats] = []
    for k in range(3):
        p, q, a, b = corners[k], corners[(k + 1) % 3], values[k], values[(k + 1) % 3]
        if a <= 0.0:
            out.append(p)
        if (a < 0.0 < b) or (b < 0.0 < a):
            out.append(p + a / (a - b) * (q - p))
    return np.array(out)


def _wider(area: shapely.Geometry, by_m: float) -> shapely.Geometry:
    with np.errstate(all="ignore"):  # corners that are almost straight
        return area.buffer(by_m, join_style="mitre")


class Free:
    """The free area of an excess lattice, made from its triangles, and shortest tracks in it by brute force."""

    def __init__(
        self, excess: Floats, diagonal: NDArray[np.int8], form: Floats, own: dict[int, Floats] | None = None
    ) -> None:
        ny, nx = excess.shape
        parts = []
        for k in range((ny - 1) * (nx - 1)):
            j, i = divmod(k, nx - 1)
            node = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            walls = np.array([[excess[b, a] for a, b in node], *(own or {}).get(k, ())])
            place = np.array([form @ np.array(n, float) for n in node])
            if np.isinf(walls).any():
                continue
            if (walls <= 0.0).all():
                parts.append(shapely.Polygon(place))
                continue
            for t in ((0, 1, 2), (0, 2, 3)) if diagonal[k] == 0 else ((0, 1, 3), (1, 2, 3)):
                if all(z[list(t)].min() < 0.0 or (z <= 0.0).all() for z in walls):
                    below = [shapely.Polygon(below_zero(place[list(t)], z[list(t)])) for z in walls]
                    parts.append(shapely.intersection_all(below))
        self.hold(shapely.union_all(parts))

    def hold(self, area: shapely.Geometry) -> None:
        self.area = area
        self.grown = _wider(self.area, REACH_M)
        shapely.prepare(self.grown)
        corners = shapely.get_coordinates(self.area)
        self.corners = np.unique(corners.round(9), axis=0)

    def narrowed(self) -> Free:
        """The area without places that are less than about 2 µm wide, where cells meet only at a node."""
        out = object.__new__(Free)
        out.hold(_wider(self.grown, -10.0 * REACH_M))
        return out

    def sight(self, a: Floats, b: Floats) -> Bools:
        """Whether straight lines from (N, 2) to (N, 2) stay in the free area, (N,)."""
        return np.asarray(shapely.covers(self.grown, shapely.linestrings(np.stack([a, b], axis=1))))

    def distances(self, places: Floats, sources: int) -> Floats:
        """Shortest lengths (sources, places) from the first ``sources`` places to all; inf if there is no track."""
        nodes = np.vstack([places, self.corners])
        i, j = np.triu_indices(len(nodes), 1)
        seen = self.sight(nodes[i], nodes[j])
        i, j = i[seen], j[seen]
        # A sparse graph treats a length of 0 as no edge.
        length = np.maximum(np.hypot(*(nodes[i] - nodes[j]).T), 1e-12)
        graph = csr_array((length, (i, j)), shape=(len(nodes), len(nodes)))
        return np.asarray(dijkstra(graph, directed=False, indices=np.arange(sources)))[:, : len(places)]

    def places(self, rng: np.random.Generator, count: int, form: Floats, shape: tuple[int, int]) -> Floats:
        """Up to ``count`` random free places (count, 2) that are not near a cell's edge; fewer if little is free."""
        at = rng.uniform(0.0, 1.0, (60 * count, 2)) * (np.array(shape[::-1]) - 1.0)
        part = at % 1.0
        at = at[(np.abs(part - 0.5).max(axis=1) < 0.49) & (np.abs(part[:, 0] - part[:, 1]) > 0.01)]
        found = at @ form.T
        inner = _wider(self.area, -1e-3)
        return np.asarray(found[shapely.contains_xy(inner, found)][:count])


def hilly(rng: np.random.Generator, size: int, holes: int) -> Floats:
    """A random excess, about half above and half below 0, sometimes smoothed, with unknown nodes."""
    z = rng.normal(0.0, 1.0, (size, size))
    if rng.random() < 0.5:
        z[1:-1, 1:-1] = 0.4 * z[1:-1, 1:-1] + 0.15 * (z[2:, 1:-1] + z[:-2, 1:-1] + z[1:-1, 2:] + z[1:-1, :-2])
    z -= rng.uniform(-0.1, 0.5)
    for _ in range(holes):
        z[tuple(rng.integers(0, size, 2))] = np.inf
    return z


def steps(rng: np.random.Generator, size: int) -> Floats:
    """An excess with few values, so that saddles, edges and corners touch the cap exactly."""
    return np.asarray(rng.choice([-2.0, -1.0, 0.0, 1.0], (size, size), p=[0.25, 0.3, 0.2, 0.25]))


def own_cells(rng: np.random.Generator, excess: Floats, count: int, *, least: bool = False) -> dict[int, Floats]:
    """Random cells with one or two walls of their own, as zones make them; ``least``: none below the lattice's."""
    nx = excess.shape[1]
    out = {}
    for k in rng.choice((excess.shape[0] - 1) * (nx - 1), count, replace=False).tolist():
        j, i = divmod(k, nx - 1)
        there = np.array([excess[j, i], excess[j, i + 1], excess[j + 1, i + 1], excess[j + 1, i]])
        drawn = rng.normal(-0.3, 1.0, (int(rng.integers(1, 3)), 4))
        out[k] = np.maximum(drawn, there) if least else drawn
    return out


def turned(place: Floats) -> Place:
    return float(place[0]), float(place[1])


@pytest.mark.nightly_but("0-5-plain", "0-0-turned", "12-0-sheared", "12-5-plain", "12-5-turned")
@pytest.mark.slow
@pytest.mark.parametrize("form", EACH_FORM)
@pytest.mark.parametrize("holes", [pytest.param(0, marks=pytest.mark.slow), 5])
@pytest.mark.parametrize("zones", [0, 12])
def test_ways_are_as_long_as_the_shortest_by_visibility_there_and_back(form: str, holes: int, zones: int) -> None:
    rng = np.random.default_rng([holes, zones, *form.encode()])
    compared = shut = bent = exact = 0
    for _ in range(8):
        size = int(rng.integers(5, 10))
        excess = hilly(rng, size, holes)
        diagonal = rng.integers(0, 2, (size - 1) ** 2).astype(np.int8)
        own = own_cells(rng, excess, min(zones, (size - 1) ** 2))
        mesh = mesh_of(excess, diagonal, FORMS[form], own, block=int(rng.integers(1, 6)))
        free = Free(excess, diagonal, FORMS[form], own)
        places = free.places(rng, 6, FORMS[form], excess.shape)
        true = free.distances(places, len(places))
        # A mesh need not pass places where two cells meet only at a node; no other track may be longer.
        wide = free.narrowed().distances(places, len(places))
        for i in range(len(places)):
            for j in range(len(places)):
                if i == j:
                    continue
                way = mesh.track(turned(places[i]), turned(places[j]))
                if way is None:
                    assert math.isinf(wide[i, j])
                    shut += 1
                    continue
                assert true[i, j] * (1.0 - 1e-6) <= way.length_m <= wide[i, j] * (1.0 + 1e-6)
                exact += true[i, j] >= wide[i, j] * (1.0 - 1e-6)
                assert np.hypot(*np.diff(way.points, axis=0).T).sum() == pytest.approx(way.length_m, rel=1e-9)
                assert free.sight(way.points[:-1], way.points[1:]).all()
                assert tuple(way.points[0]) == pytest.approx(tuple(places[i]))
                assert tuple(way.points[-1]) == pytest.approx(tuple(places[j]))
                compared += 1
                bent += len(way.points) > 2
    assert compared > 45
    assert bent > 15
    assert shut > 0
    assert exact > 0.8 * compared


@pytest.mark.nightly_but("turned")
@pytest.mark.slow
@pytest.mark.parametrize("form", EACH_FORM)
def test_where_walls_touch_exactly_ways_are_legal_and_no_detours(form: str) -> None:
    """A touching point may be passed or not, but tracks beside it must be found, and no wall may be crossed."""
    rng = np.random.default_rng(list(form.encode()))
    compared = 0
    for _ in range(24):
        size = int(rng.integers(4, 9))
        excess = steps(rng, size)
        diagonal = rng.integers(0, 2, (size - 1) ** 2).astype(np.int8)
        mesh = mesh_of(excess, diagonal, FORMS[form])
        most, least = Free(excess, diagonal, FORMS[form]), Free(excess + 1e-6, diagonal, FORMS[form])
        places = least.places(rng, 5, FORMS[form], excess.shape)
        if len(places) < 2:
            continue
        lowest, highest = (f.distances(places, len(places)) for f in (most, least))
        for i in range(len(places)):
            for j in range(len(places)):
                way = mesh.track(turned(places[i]), turned(places[j])) if i != j else None
                if way is not None:
                    assert way.length_m >= lowest[i, j] * (1.0 - 1e-6)
                    assert most.sight(way.points[:-1], way.points[1:]).all()
                    compared += 1
                if i != j and math.isfinite(highest[i, j]):
                    assert way is not None
                    assert way.length_m <= highest[i, j] * (1.0 + 1e-5)
    assert compared > 150


@given(st.integers(0, 2**31), st.sampled_from(sorted(FORMS)))
@settings(max_examples=draws(40))
def test_a_way_is_never_longer_than_any_bent_line_that_is_free(seed: int, form: str) -> None:
    rng = np.random.default_rng(seed)
    excess = hilly(rng, 7, 2)
    diagonal = rng.integers(0, 2, 36).astype(np.int8)
    mesh, free = mesh_of(excess, diagonal, FORMS[form]), Free(excess, diagonal, FORMS[form])
    places = free.places(rng, 40, FORMS[form], excess.shape)
    if len(places) < 3:
        return
    # No free pair of legs over any place in between may be shorter.
    a, b = places[0], places[1]
    seen = free.sight(np.repeat(a[None], len(places), 0), places) & free.sight(
        places, np.repeat(b[None], len(places), 0)
    )
    seen[:2] = False
    for by in places[seen]:
        way = mesh.track(turned(a), turned(b))
        assert way is not None
        assert way.length_m <= (math.dist(a, by) + math.dist(by, b)) * (1.0 + 1e-9)


@pytest.mark.parametrize("corners", [(-1.0, 1.0, -1.0, 1.0), (1.0, -1.0, 1.0, -1.0)])
def test_a_saddle_is_crossed_where_its_diagonal_says_so(corners: tuple[float, ...]) -> None:
    excess = np.full((2, 2), 1.0)
    excess[0, 0], excess[0, 1], excess[1, 1], excess[1, 0] = corners
    low = 0 if corners[0] < 0.0 else 1
    a, b = ((1.0, 0.5), (9.0, 9.5)) if low == 0 else ((9.0, 0.5), (1.0, 9.5))
    for diagonal, passed in ((low, True), (1 - low, False)):
        cut = np.array([diagonal], np.int8)
        assert (mesh_of(excess, cut).track(a, b) is not None) == passed
        assert math.isfinite(Free(excess, cut, PLAIN).distances(np.array([a, b]), 1)[0, 1]) == passed


@pytest.mark.nightly
def test_starts_on_nodes_edges_and_the_rim_find_the_same_way() -> None:
    rng = np.random.default_rng(11)
    compared = 0
    for _ in range(12):
        excess = hilly(rng, 8, 0)
        diagonal = rng.integers(0, 2, 49).astype(np.int8)
        mesh, free = mesh_of(excess, diagonal), Free(excess, diagonal, PLAIN)
        j, i = np.nonzero(excess < -0.05)
        k = rng.permutation(len(i))[:5]
        places = 10.0 * np.stack([i[k], j[k]], axis=-1).astype(float)
        places[::2] += np.where(places[::2] < 65.0, 0.02, -0.02) * np.array([1.0, 0.0])
        places = places[np.array([free.grown.covers(shapely.Point(p)) for p in places], bool)]
        true = free.distances(places, len(places)) if len(places) else np.zeros((0, 0))
        for a in range(len(places)):
            for b in range(len(places)):
                way = mesh.track(turned(places[a]), turned(places[b])) if a != b else None
                if a != b and math.isfinite(true[a, b]):
                    assert way is not None
                    assert way.length_m == pytest.approx(true[a, b], rel=1e-6)
                    compared += 1
    assert compared > 60


@pytest.mark.nightly
def test_a_limit_shuts_out_all_that_is_longer_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    compared = 0
    for _ in range(20):
        excess = hilly(rng, 8, 1)
        diagonal = rng.integers(0, 2, 49).astype(np.int8)
        mesh, free = mesh_of(excess, diagonal), Free(excess, diagonal, PLAIN)
        places = free.places(rng, 2, PLAIN, excess.shape)
        if len(places) < 2:
            continue
        a, b = turned(places[0]), turned(places[1])
        way = mesh.track(a, b)
        if way is None:
            continue
        again = mesh.track(a, b, way.length_m * (1.0 + 1e-9))
        assert again is not None
        assert again.length_m == way.length_m
        assert mesh.track(a, b, way.length_m * (1.0 - 1e-9)) is None
        compared += 1
    assert compared > 8


@pytest.mark.nightly_but("plain-inf", "turned-0.5", "sheared-0.1")
@pytest.mark.slow
@pytest.mark.parametrize("slack", [0.1, 0.5, math.inf])
@pytest.mark.parametrize("form", FORMS)
def test_a_flood_says_of_no_piece_that_it_is_farther_than_it_is(slack: float, form: str) -> None:
    rng = np.random.default_rng([3, *form.encode()])
    compared = 0
    for _ in range(8):
        excess = hilly(rng, 9, 2)
        diagonal = rng.integers(0, 2, 64).astype(np.int8)
        own = own_cells(rng, excess, 6)
        mesh, free = mesh_of(excess, diagonal, FORMS[form], own), Free(excess, diagonal, FORMS[form], own)
        places = free.places(rng, 60, FORMS[form], excess.shape)
        if len(places) < 4:
            continue
        true = free.narrowed().distances(places, 2)
        a, b = turned(places[0]), turned(places[1])
        way, guide = mesh.flood(a, b, math.inf, slack)
        plain = mesh.track(a, b)
        assert (way is None) == (plain is None)
        if way is None or plain is None:
            continue
        assert way.length_m == pytest.approx(plain.length_m, rel=1e-12)
        through = true[0] + true[1]
        for k in range(2, len(places)):
            if through[k] < plain.length_m * (1.0 + slack) * (1.0 - 1e-9):
                own_pieces = mesh.pieces_at(turned(places[k]))
                assert own_pieces
                assert guide.entered[own_pieces[0]] <= true[0, k] + 1e-6
                compared += 1
    assert compared > 5


@pytest.mark.nightly_but("1-plain", "1-turned")
@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("block", [pytest.param(1, marks=pytest.mark.slow), 4])
def test_a_corridor_leaves_out_no_cell_that_a_short_way_crosses(form: str, block: int) -> None:
    """Tracks over a third place may have any length; the corridor must contain all cells that they cross."""
    rng = np.random.default_rng([17, block, *form.encode()])
    inverse = np.linalg.inv(FORMS[form])
    crossed = left_out = 0
    for _ in range(12):
        excess = hilly(rng, 10, 1) - 0.3
        diagonal = rng.integers(0, 2, 81).astype(np.int8)
        own = own_cells(rng, excess, 6)
        mesh = mesh_of(excess, diagonal, FORMS[form], own, block=block)
        places = Free(excess, diagonal, FORMS[form], own).places(rng, 24, FORMS[form], excess.shape)
        if len(places) < 6:
            continue
        a, b = turned(places[0]), turned(places[1])
        shortest = mesh.track(a, b)
        if shortest is None:
            continue
        limit = shortest.length_m * float(rng.choice([1.0 + 1e-9, 1.02, 1.1, 1.4]))
        _, left = mesh.flood(b, a, limit, math.inf)
        _, away = mesh.flood(a, b, limit, math.inf, left)
        corridor = away.between(left, limit)
        left_out += int((~corridor).sum())
        for place in [places[0], *places[2:]]:
            first, second = mesh.track(a, turned(place)), mesh.track(turned(place), b)
            if first is None or second is None or first.length_m + second.length_m >= limit:
                continue
            points = np.vstack([first.points, second.points])
            t = np.linspace(0.0, 1.0, 400)[:, None]
            on = np.vstack([p + t * (q - p) for p, q in pairwise(points)]) @ inverse.T
            inner = (np.abs(on - np.round(on)) > 1e-6).all(axis=1)  # a point on a border belongs to no single cell
            i, j = np.floor(on[inner]).astype(int).T
            assert corridor[j, i].all()
            crossed += len(set(zip(i.tolist(), j.tolist(), strict=True)))
    assert crossed > 60
    assert left_out > 60


@pytest.mark.nightly_but("0.05-plain", "0.05-sheared", "inf-turned")
@pytest.mark.slow
@pytest.mark.parametrize("form", EACH_FORM)
@pytest.mark.parametrize("slack", [0.05, math.inf])
def test_a_guide_from_a_mesh_with_more_room_never_changes_the_answer(form: str, slack: float) -> None:
    rng = np.random.default_rng([9, *form.encode()])
    compared = longer = 0
    for _ in range(30):
        excess = hilly(rng, 10, 1) - 0.3
        diagonal = rng.integers(0, 2, 81).astype(np.int8)
        roomy = mesh_of(excess, diagonal, FORMS[form])
        more = excess + rng.uniform(0.0, 0.6)
        tight = mesh_of(more, diagonal, FORMS[form], own_cells(rng, more, 8, least=True))
        free = Free(excess + 0.6, diagonal, FORMS[form])
        places = free.places(rng, 2, FORMS[form], excess.shape)
        if len(places) < 2:
            continue
        a, b = turned(places[0]), turned(places[1])
        first, guide = roomy.flood(b, a, math.inf, slack)
        if first is None:
            assert tight.track(a, b) is None
            continue
        limit = first.length_m * (1.0 + slack)
        plain, guided = tight.track(a, b, limit), tight.track(a, b, limit, guide)
        assert (plain is None) == (guided is None)
        if plain is None or guided is None:
            continue
        assert guided.length_m == pytest.approx(plain.length_m, rel=1e-9)
        compared += 1
        longer += plain.length_m > first.length_m * (1.0 + 1e-6)
    assert compared > (3 if slack < 1.0 else 10)
    assert longer > 0


@pytest.mark.slow
def test_no_search_circles_about_a_corner_along_edges_that_are_all_but_straight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On this mission two portals in line with a corner once made the search circle it for three million portals."""
    (one,) = [p for p in problems("main", 102, count=7) if p.name == "main 102/04, 10 zones"]
    given_up = []
    real = polyanya.search

    def search(*arguments: Any) -> int:
        found = int(real(*arguments))
        given_up.append(found < 0)
        return found

    monkeypatch.setattr(portals, "search", search)
    optimal.plan(one.problem)
    assert len(given_up) > 5
    assert not any(given_up)


def ring(count: int, radius_m: float = 1e5, width_m: float = 0.1) -> tuple[Portals, Floats]:
    """Three quarters of a narrow ring in ``count`` quadrangles, and the corners (count + 1, 2) of its inner wall."""
    angle = np.linspace(0.0, 1.5 * math.pi, count + 1)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    inner, outer = radius_m * way, (radius_m + width_m) * way
    k = np.arange(1, count, dtype=np.int32)  # the portals between the pieces k - 1 and k
    start = np.array([0, *range(1, 2 * count - 2, 2), 2 * count - 2], np.int32)
    ends, names = np.hstack([outer[1:-1], inner[1:-1]]), np.column_stack([2 * k, 2 * k + 1]).astype(np.int64)
    return Portals(start, ends, names, np.column_stack([k - 1, k]), np.repeat(k - 1, 2), 2 * count, 4), inner


def test_a_track_may_have_any_number_of_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(portals, "FIRST_NODES", 1)
    monkeypatch.setattr(portals, "NODES_OF_PIECE", 1)  # so that it runs out of room, and begins again
    count = 17_000
    mesh, inner = ring(count)
    begin, end = (cast(Place, tuple(inner[k].tolist())) for k in (0, -1))
    track, _ = mesh.shortest(begin, end, [0], [count - 1], 20 * count)
    assert track is not None
    assert np.allclose(track.points, inner)
    assert track.length_m == pytest.approx(float(np.linalg.norm(np.diff(inner, axis=0), axis=1).sum()), rel=1e-9)


def test_nothing_is_found_from_where_nothing_is_free() -> None:
    excess = np.full((4, 4), -1.0)
    excess[1:3, 1:3] = 5.0
    mesh: Any = mesh_of(excess)
    assert mesh.pieces_at((15.0, 15.0)) == []
    assert mesh.track((15.0, 15.0), (1.0, 1.0)) is None
    assert mesh.track((1.0, 1.0), (15.0, 15.0)) is None
    assert mesh.pieces_at((-50.0, 0.0)) == []
