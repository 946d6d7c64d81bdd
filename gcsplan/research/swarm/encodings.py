"""Encodings: seven mappings, by name, from a vector in the unit box to the control points of a path, and back.

Each encodes one stage, from a terminal to the next; a path with via points is its stages one after the other. The
variables of one way point are adjacent, so that an optimiser can change them together (its parameter ``group``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import unknown_name
from gcsplan.research.swarm.scene import Scene

LATERAL = 0.5
"""Reach of a section to either side, as a part of the stage's horizontal distance (IB-ABC, section 2.2)."""

OFFSET = 0.25
"""The same for the encoding ``offsets``."""

Decode = Callable[[Scene, Floats, Floats, Floats, Floats], None]
"""Arguments: scene, from (3,), to (3,), u (n, K, variables); points are written to the last argument (n, K, 3)."""


Encode = Callable[[Scene, Floats, Floats, Floats], Floats]
"""Arguments: scene, from (3,), to (3,), points (K, 3); returns numbers (K, variables), outside of [0, 1] if the
encoding does not reach a point."""


@dataclass(frozen=True, slots=True)
class Encoding:
    """``variables``: number for each way point; ``points``: default number of way points; ``decode`` maps one stage,
    ``encode`` is its inverse; ``fixed``: way points stay at their stations along the track."""

    variables: int
    points: int
    decode: Decode
    encode: Encode
    fixed: bool = False

    def stations(self, count: int) -> Floats | None:
        """The parts of the track (count,) at which way points stay; None if they can move along it."""
        return _stations(count) if self.fixed else None


def _box(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    np.multiply(u, scene.high - scene.low, out=out)
    out += scene.low


def _from_box(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    return (points - scene.low) / (scene.high - scene.low)


def _polar(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    # E: MSFOA's eq. 31 has d = 1 … 3D, its eq. 32 k = 2 … D + 1. S > 1 is set to 1.
    pairs = u.reshape(*u.shape[:2], 3, 2)
    _box(scene, a, b, np.minimum(np.hypot(pairs[..., 0], pairs[..., 1]), 1.0), out)


def _polar_signed(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    # Eq. 31 has the square root of a sum of squares, and no line of the paper keeps X and Y positive.
    _polar(scene, a, b, np.abs(2.0 * u - 1.0), out)


def _from_polar(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    # Two equal hidden variables, out of all pairs with this radius.
    return np.repeat(np.clip(_from_box(scene, a, b, points), 0.0, 1.0) / np.sqrt(2.0), 2, axis=-1)


def _from_polar_signed(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    return 0.5 * (1.0 + _from_polar(scene, a, b, points))


def _frame(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """The vector from a to b in the plane, and the same rotated left by 90 degrees."""
    ahead = b[:2] - a[:2]
    if not ahead.any():
        ahead = np.array([1.0, 0.0])
    return ahead, np.array([-ahead[1], ahead[0]])


def along_and_aside(a: Floats, b: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Parts of the track from ``a`` to ``b`` at which points (..., 2 or more) are, along it and to its left."""
    ahead, left = _frame(a, b)
    square, d = float(ahead @ ahead), points[..., :2] - a[:2]
    return d @ ahead / square, d @ left / square


def _flat(scene: Scene, a: Floats, b: Floats, along: Floats, aside: Floats, out: Floats) -> None:
    """Write points, from their parts along the track and to its left, to ``out`` (n, K, 2 or more); clipped to the
    map."""
    ahead, left = _frame(a, b)
    flat = a[:2] + along[..., None] * ahead + aside[..., None] * left
    flat.clip(scene.low[:2], scene.high[:2], out=out[..., :2])


def _altitude(scene: Scene, u: Floats, out: Floats) -> None:
    """Write altitudes, from 0 at the bottom to 1 at the top of the flight volume, to ``out`` (n, K, 3)."""
    out[..., 2] = scene.low[2] + u * (scene.high[2] - scene.low[2])


def _of_altitude(scene: Scene, points: Floats) -> Floats:
    return np.asarray((points[..., 2] - scene.low[2]) / (scene.high[2] - scene.low[2]))


def _stations(count: int) -> Floats:
    return np.arange(1, count + 1) / (count + 1.0)


def _sections(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    _flat(scene, a, b, _stations(u.shape[1]), 2.0 * LATERAL * (u[..., 0] - 0.5), out)
    low, high = scene.room(out)
    out[..., 2] = low + u[..., 1] * (high - low)


def _from_sections(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    aside = along_and_aside(a, b, points)[1]
    low, high = scene.room(points)
    up = np.divide(points[..., 2] - low, high - low, out=np.zeros_like(low), where=high > low)
    return np.stack([0.5 + aside / (2.0 * LATERAL), up], axis=-1)


def _sections_whole(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    # IB-ABC, section 2.2: "points composed of three integers".
    _sections(scene, a, b, u, out)
    np.rint(out, out=out)


def _offsets(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    _flat(scene, a, b, _stations(u.shape[1]), 2.0 * OFFSET * (u[..., 0] - 0.5), out)
    _altitude(scene, u[..., 1], out)


def _from_offsets(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    aside = along_and_aside(a, b, points)[1]
    return np.stack([0.5 + aside / (2.0 * OFFSET), _of_altitude(scene, points)], axis=-1)


def _bspline(scene: Scene, a: Floats, b: Floats, u: Floats, out: Floats) -> None:
    count = u.shape[1]
    along = _stations(count) + 2.0 * (u[..., 0] - 0.5) / (count + 1.0)
    _flat(scene, a, b, along, 2.0 * LATERAL * (u[..., 1] - 0.5), out)
    _altitude(scene, u[..., 2], out)


def _from_bspline(scene: Scene, a: Floats, b: Floats, points: Floats) -> Floats:
    count = len(points)
    along, aside = along_and_aside(a, b, points)
    moved = 0.5 + (along - _stations(count)) * (count + 1.0) / 2.0
    return np.stack([moved, 0.5 + aside / (2.0 * LATERAL), _of_altitude(scene, points)], axis=-1)


ENCODINGS: Mapping[str, Encoding] = MappingProxyType(
    {
        # Each point anywhere in the flight volume.
        "box": Encoding(3, 5, _box, _from_box),
        # A point on each of K planes across the track, floor to ceiling.
        "sections": Encoding(2, 10, _sections, _from_sections, fixed=True),
        # The same, with each coordinate a whole metre.
        "sections-whole": Encoding(2, 10, _sections_whole, _from_sections, fixed=True),
        # A box whose coordinates are the radii of two hidden variables.
        "polar": Encoding(6, 5, _polar, _from_polar),
        # The same, where the hidden variables may be negative.
        "polar-signed": Encoding(6, 5, _polar_signed, _from_polar_signed),
        # Few points, each about its own station of the track.
        "bspline": Encoding(3, 8, _bspline, _from_bspline),
        # At each of K stations the offset to the side and the altitude.
        "offsets": Encoding(2, 5, _offsets, _from_offsets, fixed=True),
    }
)


def get_encoding(name: str) -> Encoding:
    """The encoding called ``name``. Raises InputError if it is unknown, with a list of the known ones."""
    found = ENCODINGS.get(name)
    if found is None:
        raise unknown_name(f"there is no encoding {name!r}", name, ENCODINGS)
    return found


@dataclass(frozen=True, eq=False)
class Code:
    """An encoding on a scene, from ``dim`` variables to control points with terminals; ``points`` of each stage."""

    encoding: Encoding
    scene: Scene
    points: tuple[int, ...]

    @classmethod
    def of(cls, name: str, scene: Scene, points: int | None = None) -> Code:
        """The code with ``points`` way points (default: the encoding's own), distributed by the stages' lengths."""
        encoding = get_encoding(name)
        stages = len(scene.terminals) - 1
        count = max(encoding.points if points is None else points, stages)
        lengths = np.linalg.norm(np.diff(scene.terminals, axis=0), axis=1)
        return cls(encoding, scene, shares(count, lengths))

    @property
    def dim(self) -> int:
        """Number of variables."""
        return self.encoding.variables * sum(self.points)

    def controls(self, u: Floats) -> Floats:
        """Control points (n, N, 3), terminals included, of ``u`` (n, dim) in the unit box."""
        terminals, n, v = self.scene.terminals, len(u), self.encoding.variables
        out = np.empty((n, sum(self.points) + len(terminals), 3))
        at = row = 0
        for i, count in enumerate(self.points):
            out[:, row] = terminals[i]
            part = u[:, at : at + v * count].reshape(n, count, v)
            self.encoding.decode(self.scene, terminals[i], terminals[i + 1], part, out[:, row + 1 : row + 1 + count])
            at, row = at + v * count, row + count + 1
        out[:, row] = terminals[-1]
        return out


def shares(total: int, weights: Floats) -> tuple[int, ...]:
    """Distribute ``total`` items over places by weight, at least one each; the largest remainders are rounded up."""
    weights = np.asarray(weights, float)
    even = np.full(len(weights), 1.0 / len(weights))
    exact = (total - len(weights)) * (weights / weights.sum() if weights.sum() > 0 else even)
    whole = np.floor(exact).astype(int)
    order = np.argsort(whole - exact, kind="stable")
    whole[order[: total - len(weights) - int(whole.sum())]] += 1
    return tuple(int(x) + 1 for x in whole)
