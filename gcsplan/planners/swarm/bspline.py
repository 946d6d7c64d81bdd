"""Cubic B-splines from terminal to terminal, and few way points that stay close to the curve.

E: the krill paper's eq. 11 prints the second numerator as ``u - u_{i+1}``; de Boor's is ``u_{i+k} - u``. The basis is
clamped, so that a curve begins and ends in its terminals; with two or three control points its degree is 1 or 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gcsplan.arrays import Floats, Indices, Int64s
from gcsplan.planners.swarm.curve_kernels import samples_of

DEGREE = 3


@dataclass(frozen=True, eq=False)
class Curve:
    """The map from control points (N, 3) to samples (S, 3).

    ``basis`` (N, S); ``terminals`` (M,): indices of the samples that are terminals; ``bands`` (4, S), ``spans`` (n, 3):
    the basis without its zeros, for kernels (`curve_kernels.draw`).
    """

    basis: Floats
    terminals: Indices
    bands: Floats
    spans: Int64s

    def samples(self, controls: Floats) -> Floats:
        """Samples (..., S, 3) of control points (..., N, 3)."""
        count = self.basis.shape[1]
        paths = np.ascontiguousarray(controls).reshape(-1, *controls.shape[-2:])
        out = np.empty((len(paths), count, 3))
        samples_of(paths, self.bands, self.spans, *np.empty((3, count)), out)
        return out.reshape(*controls.shape[:-2], count, 3)


@lru_cache(maxsize=64)
def curve(points: tuple[int, ...], legs: tuple[int, ...]) -> Curve:
    """The curve with ``points[i]`` free control points on stage i, sampled by ``legs[i]`` legs there; neighbouring
    stages share a terminal."""
    controls, samples = sum(points) + len(points) + 1, sum(legs) + 1
    basis = np.zeros((controls, samples))
    row = column = 0
    terminals = [0]
    for free, count in zip(points, legs, strict=True):
        part = _basis(free + 2, count + 1)
        basis[row : row + free + 2, column : column + count + 1] = part
        row, column = row + free + 1, column + count
        terminals.append(column)
    basis.setflags(write=False)
    return Curve(basis, np.array(terminals), *_bands(basis))


def _bands(basis: Floats) -> tuple[Floats, Int64s]:
    """`Curve.bands` and `Curve.spans` of a basis."""
    controls, samples = basis.shape
    width = DEGREE + 1
    first = np.minimum((basis != 0.0).argmax(axis=0), max(controls - width, 0))
    begins = np.flatnonzero(np.diff(first, prepend=-1))
    spans = np.stack([begins, np.append(begins[1:], samples), first[begins]], axis=-1)
    rows = first + np.arange(width)[:, None]
    bands = np.where(rows < controls, basis[np.minimum(rows, controls - 1), np.arange(samples)], 0.0)
    return np.ascontiguousarray(bands), np.ascontiguousarray(spans, dtype=np.int64)


def _basis(controls: int, samples: int) -> Floats:
    """Values (controls, samples) of the clamped basis of degree 3, or of ``controls`` - 1 if that is less."""
    degree = min(DEGREE, controls - 1)
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, controls - degree + 1), np.ones(degree)])
    u = np.linspace(0.0, 1.0, samples)[:, None]
    last = controls - 1  # the interval to which u = 1 belongs
    here = (knots[:-1] <= u) & (u < knots[1:])
    here[-1, last] = True
    basis = here.astype(float)
    for k in range(1, degree + 1):
        width = knots[k:] - knots[:-k]
        share = np.divide(u - knots[:-k], width, out=np.zeros((samples, len(width))), where=width > 0.0)
        rest = np.where(width > 0.0, 1.0 - share, 0.0)
        basis = share[:, :-1] * basis[:, :-1] + rest[:, 1:] * basis[:, 1:]
    return np.ascontiguousarray(basis.T)
