"""The ground as one bilinear surface on its raster's own grid, with a map to it from the plane without degrees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats

Sides = tuple[bool, bool, bool, bool]
NO_SIDES: Sides = (False, False, False, False)
DEGREE = 6
POWERS = tuple((i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i))
_IN_U, _IN_V = np.array(POWERS).T
_UP_TO = np.arange(DEGREE + 1)
MAPPED_AT_ONCE = 4096
"""Points that are mapped to the grid at once: their powers fit into a cache, and one core multiplies them."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """The map from the plane to the grid as one polynomial: (east_m, north_m) -> (col, row), 0 at the first node.

    ``coefficients`` (TERMS, 2) over ``u^i v^j`` with ``u = (east_m - centre[0]) / scale_m`` and ``v`` likewise.
    ``error_m`` bounds its distance from the true projection inside the fitted box.
    """

    coefficients: Floats
    centre: tuple[float, float]
    scale_m: float
    error_m: float

    @classmethod
    def fit(
        cls, exact: Callable[[Floats, Floats], tuple[Floats, Floats]], box: tuple[float, float, float, float]
    ) -> GridMap:
        """Fit ``exact(east_m, north_m) -> (col, row)`` over ``box`` (west, south, east, north)."""
        west, south, east, north = box
        centre = (0.5 * (west + east), 0.5 * (south + north))
        scale_m = max(0.5 * (east - west), 0.5 * (north - south), 1.0)
        t = np.cos(np.pi * (np.arange(17) + 0.5) / 17)
        e, n = (a.ravel() for a in np.meshgrid(centre[0] + scale_m * t, centre[1] + scale_m * t))
        col, row = exact(e, n)
        square = polyvander2d((e - centre[0]) / scale_m, (n - centre[1]) / scale_m, (DEGREE, DEGREE))
        basis = square.reshape(len(e), DEGREE + 1, DEGREE + 1)[:, _IN_U, _IN_V]
        coefficients, *_ = np.linalg.lstsq(basis, np.stack([col, row], axis=-1), rcond=None)
        fitted = cls(np.ascontiguousarray(coefficients), centre, scale_m, 0.0)
        # Bound the residual on a lattice that shares no point with the fit's nodes, and double it.
        f = np.linspace(-1.0, 1.0, 40)
        e, n = (a.ravel() for a in np.meshgrid(centre[0] + scale_m * f, centre[1] + scale_m * f))
        col, row = exact(e, n)
        off = fitted(e, n) - np.stack([col, row], axis=-1)
        metres = fitted.metres_per_cell(*centre)
        return cls(fitted.coefficients, centre, scale_m, 2.0 * float(np.hypot(*(np.abs(off).max(axis=0) * metres))))

    @classmethod
    def affine(cls, west_m: float, north_m: float, dx_m: float, dy_m: float) -> GridMap:
        """A grid in the plane itself: node (0, 0) at (west_m, north_m), rows going south."""
        coefficients = np.zeros((len(POWERS), 2))
        coefficients[POWERS.index((1, 0)), 0] = 1.0 / dx_m
        coefficients[POWERS.index((0, 1)), 1] = -1.0 / dy_m
        return cls(coefficients, (west_m, north_m), 1.0, 0.0)

    def mapped(self, back: Floats) -> GridMap:
        """The map from another plane, whose places (..., 2) times ``back`` (2, 2) are those of this one."""
        forth = np.linalg.inv(back)
        east_m, north_m = (np.array(self.centre) @ forth).tolist()
        half_m = self.scale_m * float(np.abs(forth).sum(axis=0).max())  # the box holds all of the fitted square

        def exact(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            col, row = self(*(np.column_stack([east_m, north_m]) @ back).T).T
            return col, row

        fitted = GridMap.fit(exact, (east_m - half_m, north_m - half_m, east_m + half_m, north_m + half_m))
        degrees = _IN_U + _IN_V
        most = degrees[self.coefficients.any(axis=1)].max(initial=0)  # a linear map keeps the degree
        error_m = fitted.error_m + self.error_m * float(np.linalg.norm(forth, 2))
        return replace(fitted, coefficients=fitted.coefficients * (degrees <= most)[:, None], error_m=error_m)

    def __call__(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """(..., 2) col, row of points in the plane; not finite for points that are infinitely far away.

        The shapes are broadcast: the points of a lattice cost least as a row of eastings and a column of northings.
        """
        east, north = np.asarray(east_m, float), np.asarray(north_m, float)
        if east.shape == north.shape and east.size > MAPPED_AT_ONCE:
            parts = (np.array_split(of.ravel(), -(-of.size // MAPPED_AT_ONCE)) for of in (east, north))
            return np.concatenate(list(map(self, *parts))).reshape(*east.shape, 2)
        u, v = (east - self.centre[0]) / self.scale_m, (north - self.centre[1]) / self.scale_m
        v = v.reshape((1,) * (u.ndim - v.ndim) + v.shape)  # of_u has its axes before the axes of v
        with np.errstate(over="ignore", invalid="ignore"):
            powers = np.ones((len(self._square), v.size))
            for power in range(len(powers) - 1):
                np.multiply(powers[power], v.ravel(), out=powers[power + 1])
            # The coefficient of each power of u at each v.
            of_u = (self._square.reshape(-1, len(powers)) @ powers).reshape(len(powers), 2, *v.shape)
            value = of_u[-1]
            for power in reversed(range(len(powers) - 1)):
                value = value * u + of_u[power]
        return np.stack([value[0], value[1]], axis=-1)

    @cached_property
    def _square(self) -> Floats:
        """(D + 1, 2, D + 1) the coefficients of each power of u, of column and row, and of each power of v; 0 if none.
        D: the highest power that any has."""
        square = np.zeros((DEGREE + 1, 2, DEGREE + 1))
        square[_IN_U, :, _IN_V] = self.coefficients
        most = max(1, *np.argwhere(square).max(axis=0, initial=0)[[0, 2]].tolist())
        return square[: most + 1, :, : most + 1].copy()

    def jacobian(self, east_m: float, north_m: float) -> Floats:
        """(2, 2) d(col, row) / d(east_m, north_m) at a point."""
        u, v = (east_m - self.centre[0]) / self.scale_m, (north_m - self.centre[1]) / self.scale_m
        in_u, in_v = u**_UP_TO, v**_UP_TO
        du = _IN_U * in_u[np.maximum(_IN_U - 1, 0)] * in_v[_IN_V] / self.scale_m
        dv = _IN_V * in_u[_IN_U] * in_v[np.maximum(_IN_V - 1, 0)] / self.scale_m
        return np.stack([du @ self.coefficients, dv @ self.coefficients], axis=-1)

    def metres_per_cell(self, east_m: float, north_m: float) -> Floats:
        """(2,) length of one column step and of one row step, metres, at a point."""
        return np.asarray(np.linalg.norm(np.linalg.inv(self.jacobian(east_m, north_m)), axis=0))

    def to_plane(self, col: ArrayLike, row: ArrayLike) -> Floats:
        """(..., 2) east_m, north_m of grid points, by Newton's method on the polynomial."""
        target = np.stack(np.broadcast_arrays(np.asarray(col, float), np.asarray(row, float)), axis=-1)
        inverse = np.linalg.inv(self.jacobian(*self.centre))
        plane = np.asarray(self.centre) + (target - self(*self.centre)) @ inverse.T
        for _ in range(9):
            off = (target - self(plane[..., 0], plane[..., 1])) @ inverse.T
            plane = plane + off
            if not np.abs(off).max(initial=0.0) > 1e-9:  # a nanometre
                break
        return np.asarray(plane)


@dataclass(frozen=True, eq=False)
class Surface:
    """Ground and the obstacles on it.

    ``ground_m`` (rows, cols): least height of each node, metres AMSL; NaN is unknown, never ground; bilinear between
    nodes. ``high_m``: greatest height of the ground, the same array unless sources differ somewhere; the true ground
    lies between both. ``top_m``: greatest ground plus obstacles (trees, buildings), the array ``high_m`` if there are
    none. ``top_m`` counts for min AGL and clearance, ``ground_m`` for max AGL and for zones' levels above ground.
    ``grid`` maps the plane to nodes. ``info`` describes the source in the outputs (``dem_sha256``, ``vertical_datum``,
    ``resolution_m``, ``bare_dem``). ``goes_on``: beyond which sides (first column, first row, last column, last row)
    the terrain is known too, but not loaded here.
    """

    ground_m: Floats
    top_m: Floats
    grid: GridMap
    info: dict[str, object] = field(default_factory=dict)
    goes_on: Sides = NO_SIDES
    high_m: Floats | None = None

    def __post_init__(self) -> None:
        same = self.high_m is None or self.high_m is self.ground_m
        for name in ("ground_m", "top_m", "high_m"):
            given = self.ground_m if name == "high_m" and same else getattr(self, name)
            a = np.ascontiguousarray(given, dtype=np.float64)
            if a.ndim != 2 or min(a.shape) < 2:
                raise ValueError(f"{name} must be (rows >= 2, cols >= 2), given {a.shape}")
            a.setflags(write=False)
            object.__setattr__(self, name, a)
        if not self.ground_m.shape == self.top_m.shape == self.high.shape:
            raise ValueError(f"ground {self.ground_m.shape} and top {self.top_m.shape} differ in shape")

    def __reduce__(self) -> tuple[type[Surface], tuple[object, ...]]:
        # Made anew, so that its arrays are read-only there, too.
        return Surface, (self.ground_m, self.top_m, self.grid, self.info, self.goes_on, self.high_m)

    def __repr__(self) -> str:
        rows, cols = self.ground_m.shape
        return f"<Surface: {rows} × {cols} nodes>"

    @property
    def high(self) -> Floats:
        """``high_m``, which is never None once the surface is made."""
        assert self.high_m is not None
        return self.high_m

    @property
    def differs(self) -> bool:
        """Whether the ground has two heights anywhere."""
        return self.high_m is not self.ground_m

    def high_at(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """Greatest ground, metres AMSL, at points of the plane; NaN where unknown."""
        return _bilinear(self.high, self.grid(east_m, north_m))

    def spread_m(self, rows: slice, cols: slice) -> float:
        """The largest difference between the two heights of a node of a part; 0 if none is known."""
        if not self.differs:
            return 0.0
        return float(np.nanmax(self.high[rows, cols] - self.ground_m[rows, cols], initial=0.0))

    @property
    def level_m(self) -> float | None:
        """Altitude AMSL of the ground if it is level, and so is the top of its obstacles; else None.

        A surface with an unknown node is not level, for a void may be anything; nor is one with two heights.
        """
        level = all(float(z.min()) == float(z.max()) for z in (self.ground_m, self.top_m))  # NaN is not equal to NaN
        level = level and not self.differs
        return float(self.ground_m[0, 0]) if level else None

    @property
    def has_unknown(self) -> bool:
        """Whether some node of ground or top is unknown."""
        return bool(np.isnan(self.ground_m.sum() + self.top_m.sum()))

    def ground_at(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """Least ground, metres AMSL, at points of the plane; NaN where unknown."""
        return _bilinear(self.ground_m, self.grid(east_m, north_m))

    def top_at(self, east_m: ArrayLike, north_m: ArrayLike) -> Floats:
        """Ground plus obstacles, metres AMSL, at points of the plane; NaN where unknown."""
        return _bilinear(self.top_m, self.grid(east_m, north_m))


def _bilinear(z: Floats, at: Floats) -> Floats:
    rows, cols = z.shape
    c, r = at[..., 0], at[..., 1]
    inside = (c >= 0) & (c <= cols - 1) & (r >= 0) & (r <= rows - 1)
    c, r = np.where(inside, c, 0.0), np.where(inside, r, 0.0)
    i = np.clip(np.floor(c).astype(np.intp), 0, cols - 2)
    j = np.clip(np.floor(r).astype(np.intp), 0, rows - 2)
    u, v = c - i, r - j

    # A weight of zero must remove an unknown neighbour, but 0 · NaN is NaN.
    def part(weight: Floats, height: Floats) -> Floats:
        return np.where(weight == 0.0, 0.0, weight * height)

    value = (
        part((1 - u) * (1 - v), z[j, i]) + part(u * (1 - v), z[j, i + 1])
        + part((1 - u) * v, z[j + 1, i]) + part(u * v, z[j + 1, i + 1])
    )  # fmt: skip
    return np.asarray(np.where(inside, value, np.nan))
