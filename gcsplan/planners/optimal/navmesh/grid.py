"""The plane under a mission as a lattice of nodes, from which meshes of the free plane below an altitude cap are made.

The lattice is the terrain model's own, each cell cut into parts where a finer one is needed, because ground is bilinear
in the model's cells and in no others. A bilinear patch can be cut into two triangles along either diagonal: one gives a
surface that never lies above the patch, the other one that never lies below it. So there are two kinds of mesh: one
holds every legal track (``low``: for bounds), and in the other every track is legal but for rounding (for paths).
The values of the nodes come from the terrain model: heights for bounds and for paths, slopes, and places.

In the plane the raster's lines are not quite straight. Here they are straight between the corners of blocks, so short
that nothing moves by more than a few centimetres, or millimetres; the margins of a `Fit` make up for that.
"""

from __future__ import annotations

import math
import mmap
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gcsplan.arrays import Bools, Floats, Int32s
from gcsplan.planners.optimal.navmesh.clearance_kernels import lay, pool
from gcsplan.planners.optimal.navmesh.zone_kernels import BOTTOM, BOTTOM_2, PAIR, TOP, TOP_2, UNDER, UNDER_2
from gcsplan.planners.optimal.navmesh.zone_shapes import LOOSE, TOUCH_M, Fit, Shapes, make_shapes
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.geometry.zones import Box

NodeExtent = tuple[int, int, int, int]
"""First and last columns and rows (col0, row0, col1, row1) of a terrain model's nodes."""

HUGE_PAGE_BYTES = 1 << 22
"""Size of an array, in bytes, from which numpy requests huge pages."""

DetourEllipse = tuple[tuple[float, float], tuple[float, float], float]
"""Two places, and the largest sum of the distances to both, m: an ellipse."""


def slopes(z: Floats, x: Floats, y: Floats) -> Floats:
    """(rows, cols) the steepest slope (m per m) of the cells around each node."""
    z = np.where(np.isfinite(z), z, np.nan)
    across = math.dist((x[0, 0], y[0, 0]), (x[0, 1], y[0, 1]))
    along = math.dist((x[0, 0], y[0, 0]), (x[1, 0], y[1, 0]))
    east, north = np.abs(np.diff(z, axis=1)) / across, np.abs(np.diff(z, axis=0)) / along
    a, b = np.zeros_like(z), np.zeros_like(z)
    a[:, 1:] = east
    np.maximum(a[:, :-1], east, out=a[:, :-1])
    b[1:] = north
    np.maximum(b[:-1], north, out=b[:-1])
    return np.hypot(a, b)


def nodes(z: Floats, over: NodeExtent, parts: int, stride: int, whole: int) -> tuple[Floats, Floats]:
    """Heights at a lattice's nodes for bounds and for paths, rows going north, from the terrain model's heights ``z``;
    the lattice covers the extent ``over``. ``parts``, ``stride``, ``whole``: see `make_plane`."""
    col0, row0, col1, row1 = over
    if stride == 1 and whole == 1:
        finer = _finer(z[row0 : row1 + 1, col0 : col1 + 1][::-1], parts)
        return finer, finer
    cells = [-(-n // whole) * whole // stride for n in (row1 - row0, col1 - col0)]
    low, high = (np.empty((cells[0] + 1, cells[1] + 1)) for _ in range(2))
    pool(np.ascontiguousarray(z), np.array(over), stride, low, high)
    # Beyond the border, paths may not go; for bounds, its heights go on.
    high[(row1 - row0) // stride + 1 :] = np.inf
    high[:, (col1 - col0) // stride + 1 :] = np.inf
    return low, high


def _finer(z: Floats, parts: int) -> Floats:
    """Interpolate heights bilinearly at nodes ``parts`` times as close."""
    if parts == 1:
        return np.ascontiguousarray(z)
    u = np.arange(parts) / parts
    for _ in range(2):  # along the rows; then, transposed, along the columns
        wide = np.empty((z.shape[0], (z.shape[1] - 1) * parts + 1))
        wide[:, :-1] = (z[:, :-1, None] * (1.0 - u) + z[:, 1:, None] * u).reshape(len(z), -1)
        wide[:, ::parts] = z  # a weight of 0 must not carry an unknown neighbour's NaN over
        z = wide.T
    return np.ascontiguousarray(z)


def places(
    grid: GridMap, col0: int, row1: int, shape: tuple[int, int], parts: float, span: int,
    reach: tuple[tuple[float, float], tuple[float, float], float] | None = None,
) -> tuple[Floats, Floats, Bools]:  # fmt: skip
    """(rows, cols) x and y of a lattice's nodes, bilinear between the corners of blocks of ``span`` cells, and
    (rows - 1, cols - 1) which cells lie within ``reach``: two places, and the largest sum of distances to both, m."""
    rows, cols = shape
    step = min(span, max(rows, cols))
    c = np.arange(0, cols + step, step)
    r = np.arange(0, rows + step, step)
    corner = grid.to_plane(col0 + c[None, :] / parts, row1 - r[:, None] / parts)
    x, y, inside = np.empty(shape), np.empty(shape), np.ones((rows - 1, cols - 1), np.bool_)
    a, b, most = reach if reach is not None else ((0.0, 0.0), (0.0, 0.0), math.inf)
    corner_x, corner_y = (np.ascontiguousarray(corner[..., k]) for k in range(2))
    lay(corner_x, corner_y, step, *a, *b, most, x, y, inside)
    return x, y, inside


class Scratch:
    """Named arrays that are kept and handed out again, with what their last user left in them.

    New memory is cleared by the operating system when it is first touched, which takes longer than the work done in it.
    Of a large array only a corridor is touched, a few numbers of each row; with huge pages, all of it would be cleared.
    """

    def __init__(self) -> None:
        self._held: dict[str, NDArray[Any]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """An array of that shape with arbitrary content, free to use until the same name is requested again."""
        size = math.prod(shape)
        held = self._held.get(name)
        if held is None or held.size < size:
            self._held.pop(name, None)
            held = self._held[name] = _small_pages(size, np.dtype(dtype))
        return held[:size].reshape(shape)


def _small_pages(size: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    if size * dtype.itemsize < HUGE_PAGE_BYTES:
        return np.empty(size, dtype)
    return np.frombuffer(mmap.mmap(-1, size * dtype.itemsize), dtype)


@dataclass(eq=False, slots=True)
class Plane:
    """A lattice over a part of the terrain model: node (j, i) lies at ``x[j, i]``, ``y[j, i]``, north of (j - 1, i).

    ``col0``, ``row1``: the terrain model's column and row at node (0, 0). ``tops``, ``grounds``: two arrays (rows,
    cols) each, m AMSL, NaN where unknown, the first for bounds and the second for paths. ``inside`` (rows - 1,
    cols - 1): the cells that are looked at. A cell of the terrain model is ``parts`` cells wide and long here, or a
    cell here is ``stride`` model cells wide; nodes lie on straight lines for ``block`` cells at a time.
    """

    problem: Problem
    col0: int
    row1: int
    parts: int
    stride: int
    block: int
    x: Floats
    y: Floats
    tops: tuple[Floats, Floats]
    grounds: tuple[Floats, Floats]
    inside: Bools
    shapes: Shapes
    fit: Fit
    known: dict[tuple[float, float], tuple[float, float]] = field(default_factory=dict)
    """Places that `at` was called with, and their column and row on the lattice."""
    scratch: Scratch = field(default_factory=Scratch)
    """Buffers for meshes that are no longer needed when the next one is made."""

    def zones(self, low: bool, under: Bools | None, over: Bools | None) -> tuple[Floats, Floats]:
        """The shapes' numbers and forms, for bounds (``low``) or for paths. Where ``under`` or ``over`` (zones,) is
        false, the zone cannot be passed below its floor, or above its ceiling; None changes nothing."""
        zones, edges = self.shapes.low if low else self.shapes.high
        first, other = self.shapes.owner.T
        if under is not None or over is not None:
            zones = zones.copy()
        if under is not None:
            zones[:, UNDER] *= under[first]
            zones[:, UNDER_2] *= under[other]
        if over is not None:
            zones[~over[first], TOP] = np.inf
            zones[~over[other] & (zones[:, PAIR] > 0.0), TOP_2] = np.inf
        return zones, edges

    def reach_m(self, low: bool) -> tuple[float, float]:
        """Metres by which zones are grown, for bounds (``low``) or for paths, and a little less: between nodes that are
        within that reach for certain."""
        problem = self.problem
        reach_m = problem.airspace.beside_m(problem.bound_limits if low else problem.limits)
        return reach_m, reach_m - 2.0 * self.fit.bent_m - TOUCH_M

    def boxes(self, row: int, col: int, fineness: int, rows: int, cols: int) -> Int32s:
        """(K, 4) the shapes' boxes on a part of the lattice that begins at cell (``row``, ``col``), cut ``fineness``
        times finer, of ``rows`` x ``cols`` nodes."""
        boxes = (self.shapes.boxes - np.array([col, col, row, row])) * fineness
        boxes = boxes + np.array([0, fineness - 1, 0, fineness - 1])
        return np.asarray(boxes.clip([0, -1, 0, -1], [cols, cols - 2, rows, rows - 2]), np.int32)

    def steep(self, row: int, col: int, last_row: int, last_col: int) -> Floats:
        """The steepest slope of the cells around each node of a part of the lattice, for paths."""
        less_row, less_col = min(row, 1), min(col, 1)
        part = np.s_[row - less_row : last_row + 1, col - less_col : last_col + 1]
        around = slopes(self.tops[1][part], self.x[part], self.y[part])
        return np.ascontiguousarray(around[less_row:, less_col:][: last_row - row, : last_col - col])

    def begins(self, other: Plane) -> tuple[int, int]:
        """Row and column at which this plane begins, counted in its own cells from where the other plane begins."""
        scale = self.parts / self.stride
        return round(scale * (other.row1 - self.row1)), round(scale * (self.col0 - other.col0))

    def at(self, place: tuple[float, float]) -> tuple[float, float]:
        """Column and row of a place on this lattice, not rounded."""
        if place not in self.known:
            c, r = self.all_at(np.array([place]))[0].tolist()
            self.known[place] = c, r
        return self.known[place]

    def all_at(self, places: Floats) -> Floats:
        """(N, 2) columns and rows of places (N, 2) on this lattice, not rounded."""
        at = self.problem.airspace.surface.grid(places[:, 0], places[:, 1])
        return self.parts / self.stride * np.stack([at[:, 0] - self.col0, self.row1 - at[:, 1]], axis=-1)


def make_plane(
    problem: Problem,
    box: Box,
    parts: int = 1,
    stride: int = 1,
    whole: int = 1,
    reach: DetourEllipse | None = None,
    fit: Fit = LOOSE,
) -> Plane:
    """Make the lattice over ``box`` (west, south, east, north) as far as the terrain model goes.

    ``parts``: how many cells a side each of the terrain model's is cut into; or ``stride``: how many of them a side
    become one. The lattice is a multiple of ``whole`` cells of the terrain model wide and long. ``reach``: only cells
    whose distances to two places add up to no more than that are looked at.
    """
    return lattice(problem, extent(problem, box), parts, stride, whole, reach, fit)


def extent(problem: Problem, box: Box) -> NodeExtent:
    """First and last columns and rows of the terrain model's nodes that cover a box."""
    surface = problem.airspace.surface
    rows, cols = surface.ground_m.shape
    west, south, east, north = box
    if math.isinf(west):
        return 0, 0, cols - 1, rows - 1
    e, n = np.meshgrid(np.linspace(west, east, 5), np.linspace(south, north, 5))
    at = surface.grid(e.ravel(), n.ravel())
    low, high = at.min(axis=0).clip(-2.0, [cols, rows]), at.max(axis=0).clip(-2.0, [cols, rows])
    col0, row0 = (min(max(math.floor(v) - 1, 0), m - 2) for v, m in zip(low, (cols, rows), strict=True))
    col1, row1 = (min(math.ceil(v) + 1, m - 1) for v, m in zip(high, (cols, rows), strict=True))
    return col0, row0, max(col1, col0 + 1), max(row1, row0 + 1)


def finer_plane(plane: Plane, cells: Bools, parts: int, stride: int, fit: Fit) -> tuple[Plane, Bools]:
    """Make a finer lattice over some of a plane's ``cells``; return it and the same cells on it. See `make_plane`."""
    cols = plane.problem.airspace.surface.ground_m.shape[1]
    row, col, last_row, last_col = box_of(cells)
    span = plane.stride / plane.parts  # a cell's width, in cells of the terrain model
    col0, col1 = plane.col0 + math.floor(span * col), min(plane.col0 + math.ceil(span * last_col), cols - 1)
    row0, row1 = max(plane.row1 - math.ceil(span * last_row), 0), plane.row1 - math.floor(span * row)
    finer = lattice(plane.problem, (col0, row0, col1, row1), parts, stride, plane.stride, None, fit)
    return finer, on_finer(plane, cells, finer)


def box_of(chosen: Bools) -> tuple[int, int, int, int]:
    """First row and column that hold a true value, and the row and column after the last; (0, 0, 1, 1) if nothing is
    true."""
    rows, cols = np.flatnonzero(chosen.any(axis=1)), np.flatnonzero(chosen.any(axis=0))
    if not len(rows):
        return 0, 0, 1, 1
    return int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1


def on_finer(plane: Plane, cells: Bools, finer: Plane) -> Bools:
    """(rows - 1, cols - 1) which cells of a finer lattice lie in a plane's ``cells``, all of which it must cover."""
    ratio = plane.stride * finer.parts // (plane.parts * finer.stride)
    row, col, last_row, last_col = box_of(cells)
    first_row, first_col = (ratio * first - more for first, more in zip((row, col), finer.begins(plane), strict=True))
    small = np.repeat(np.repeat(cells[row:last_row, col:last_col], ratio, axis=0), ratio, axis=1)
    out = np.zeros((finer.x.shape[0] - 1, finer.x.shape[1] - 1), np.bool_)
    room = out[first_row:, first_col:][: small.shape[0], : small.shape[1]]
    room[:] = small[: room.shape[0], : room.shape[1]]
    return out


def lattice(
    problem: Problem, over: NodeExtent, parts: int, stride: int, whole: int, reach: DetourEllipse | None, fit: Fit
) -> Plane:
    """Make the lattice over an `extent`; the other arguments: see `make_plane`."""
    surface = problem.airspace.surface
    fit = replace(fit, spare_m=fit.spare_m + problem.bound_spare_m)
    col0, _, _, row1 = over
    grounds = nodes(surface.ground_m, over, parts, stride, whole)
    tops = grounds
    if surface.top_m is not surface.ground_m:
        tops = nodes(surface.top_m, over, parts, stride, whole)
    shape = tops[0].shape
    block = max(problem.airspace.straight_cells(fit.bent_m) * parts // stride, 1)
    x, y, looked_at = places(surface.grid, col0, row1, shape, parts / stride, block, reach)
    shapes = make_shapes(problem, x, y, fit)
    if stride > 1:
        _raise_floors(shapes, *grounds)
    return Plane(
        problem,
        col0,
        row1,
        parts,
        stride,
        block,
        x,
        y,
        tops,
        grounds,
        looked_at,
        shapes,
        fit,
    )


def _raise_floors(shapes: Shapes, low: Floats, high: Floats) -> None:
    """Raise the floors above ground of shapes for bounds, on a lattice of merged cells: they count from ``low`` ground
    (rows, cols), and the true ground may be as high as ``high``. A lower floor may shut what is free."""
    zones = shapes.low[0]
    apart, bulge = high - low, 0.25 * np.abs(low[1:, 1:] + low[:-1, :-1] - low[1:, :-1] - low[:-1, 1:])
    for bottom in (BOTTOM, BOTTOM_2):
        for k in np.flatnonzero(zones[:, bottom + 2] > 0.0):
            first, last, row, last_row = shapes.boxes[k].tolist()
            if first <= last and row <= last_row:
                here = np.s_[row : last_row + 1, first : last + 1]
                zones[k, bottom] += apart[row : last_row + 2, first : last + 2].max() + bulge[here].max()
