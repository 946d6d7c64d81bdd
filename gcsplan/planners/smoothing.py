"""Cubic B-splines from stop to stop, and few way points that stay beside the curve.

E: the krill paper's eq. 11 prints the second numerator as ``u - u_{i+1}``; de Boor's is ``u_{i+k} - u``. The basis is
scipy's, clamped, so that a curve begins and ends in its stops; with two or three control points its degree falls.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DEGREE = 3


@dataclass(frozen=True, eq=False)
class Curve:
    """Control points (N, 3) to samples (S, 3): ``basis`` (N, S); ``stops`` (M,) samples that are stops."""

    basis: Floats
    stops: NDArray[np.intp]

    def samples(self, controls: Floats) -> Floats:
        """(..., S, 3) samples of control points (..., N, 3)."""
        return np.ascontiguousarray(np.swapaxes(self.rows(controls), -1, -2))

    def rows(self, controls: Floats) -> Floats:
        """The same as (..., 3, S), which is how kernels want them."""
        return np.asarray(np.ascontiguousarray(np.swapaxes(controls, -1, -2)) @ self.basis)


@lru_cache(maxsize=64)
def curve(points: tuple[int, ...], legs: tuple[int, ...]) -> Curve:
    """The curve past ``points[i]`` free control points on stage i, sampled by ``legs[i]`` legs there; stages share
    their stops."""
    controls, samples = sum(points) + len(points) + 1, sum(legs) + 1
    basis = np.zeros((controls, samples))
    row = column = 0
    stops = [0]
    for free, count in zip(points, legs, strict=True):
        part = _basis(free + 2, count + 1)
        basis[row : row + free + 2, column : column + count + 1] = part
        row, column = row + free + 1, column + count
        stops.append(column)
    basis.setflags(write=False)
    return Curve(basis, np.array(stops))


def _basis(controls: int, samples: int) -> Floats:
    """(controls, samples) values of the clamped basis of degree 3, or less where there are too few controls."""
    from scipy.interpolate import BSpline

    degree = min(DEGREE, controls - 1)
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, controls - degree + 1), np.ones(degree)])
    matrix = BSpline.design_matrix(np.linspace(0.0, 1.0, samples), knots, degree)
    return np.ascontiguousarray(matrix.toarray().T)


def fewer(points: Floats, kept: NDArray[np.intp], corridor_m: float) -> NDArray[np.intp]:
    """Indices of a polyline (N, 3) of points (S, 3) that no point is further from than ``corridor_m``; ``kept`` stay.

    Douglas and Peucker 1973, between each two that are kept.
    """
    chosen = [int(kept[0])]
    for a, b in zip(kept[:-1].tolist(), kept[1:].tolist(), strict=True):
        stack, inside = [(a, b)], []
        while stack:
            i, j = stack.pop()
            if j - i < 2:
                continue
            off = _distances(points[i + 1 : j], points[i], points[j])
            worst = int(off.argmax())
            if off[worst] > corridor_m:
                middle = i + 1 + worst
                inside.append(middle)
                stack += [(i, middle), (middle, j)]
        chosen += [*sorted(inside), b]
    return np.array(chosen)


def _distances(points: Floats, a: Floats, b: Floats) -> Floats:
    """(N,) distances of points from the segment a–b."""
    d = b - a
    square = float(d @ d)
    t = np.clip((points - a) @ d / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - (a + t[:, None] * d), axis=1))
