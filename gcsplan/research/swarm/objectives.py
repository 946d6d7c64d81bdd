"""The costs of the swarms, one for each of the five papers, by name, over the terms that `cost_kernels` measures.

Each is the paper's own formula plus `forbidden`, how far the path breaks limits of the mission that the paper does not
know, so that every objective ranks illegal paths too. All costs are sampled and never pass a mission. D marks a
decision of ours where a paper is silent, E a departure from its printed text.

The paths are cubic B-splines from terminal to terminal, and few way points that stay close to the curve. E: the krill
paper's eq. 11 prints the second numerator as ``u - u_{i+1}``; de Boor's is ``u_{i+k} - u``. The basis is clamped, so
that a curve begins and ends in its terminals; with two or three control points its degree is 1 or 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from gcsplan.arrays import Floats, Indices, Int64s
from gcsplan.errors import unknown_name
from gcsplan.native.signature import Held
from gcsplan.planners.problem import Problem
from gcsplan.research.swarm import cost_kernels as k
from gcsplan.research.swarm.curve_kernels import CURVE, samples_of
from gcsplan.research.swarm.encodings import Code, shares
from gcsplan.research.swarm.scene import SAMPLES, Scene
from gcsplan.research.swarm.scene_kernels import SCENE, clocks_of, nearness

SPLINE_DEGREE = 3

PENALTY = 100.0
"""Cost of a metre that is not allowed, in metres (D in all costs; C and PC of MSFOA, P of ABO, μ_obs of SSGWO are 100
too)."""

SSGWO_NODES = 30
"""SSGWO's number of nodes, at which angles and nearness are measured."""


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
    width = SPLINE_DEGREE + 1
    first = np.minimum((basis != 0.0).argmax(axis=0), max(controls - width, 0))
    begins = np.flatnonzero(np.diff(first, prepend=-1))
    spans = np.stack([begins, np.append(begins[1:], samples), first[begins]], axis=-1)
    rows = first + np.arange(width)[:, None]
    bands = np.where(rows < controls, basis[np.minimum(rows, controls - 1), np.arange(samples)], 0.0)
    return np.ascontiguousarray(bands), np.ascontiguousarray(spans, dtype=np.int64)


def _basis(controls: int, samples: int) -> Floats:
    """Values (controls, samples) of the clamped basis of degree 3, or of ``controls`` - 1 if that is less."""
    degree = min(SPLINE_DEGREE, controls - 1)
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, controls - degree + 1), np.ones(degree)])
    u = np.linspace(0.0, 1.0, samples)[:, None]
    last = controls - 1  # the interval to which u = 1 belongs
    here = (knots[:-1] <= u) & (u < knots[1:])
    here[-1, last] = True
    basis = here.astype(float)
    for order in range(1, degree + 1):
        width = knots[order:] - knots[:-order]
        share = np.divide(u - knots[:-order], width, out=np.zeros((samples, len(width))), where=width > 0.0)
        rest = np.where(width > 0.0, 1.0 - share, 0.0)
        basis = share[:, :-1] * basis[:, :-1] + rest[:, 1:] * basis[:, 1:]
    return np.ascontiguousarray(basis.T)


@dataclass(frozen=True, slots=True)
class CostReference:
    """Reference values of the weights: the terms (TERMS,) and length of the straight line, height of the flight volume,
    and the mission's objective with its energy per metre."""

    straight: Floats
    straight_m: float
    height_m: float
    energy: bool
    vertical_j_per_m: float
    horizontal_j_per_m: float


Weigh = Callable[[Floats, CostReference], Floats]


@dataclass(frozen=True, slots=True)
class PaperCost:
    """One cost. ``weigh``: from terms (n, TERMS) to costs (n,); ``groups``: bits of the optional groups of terms that
    it needs."""

    groups: int
    weigh: Weigh


BROKEN = np.array([k.BELOW, k.ABOVE, k.UNKNOWN, k.INSIDE, k.STEEP, k.SUNK, k.PROUD, k.DEEP])
"""Terms of broken limits: metres of path, then depths integrated along it (m²)."""

METRES, DEPTHS = np.array([1.0] * 5 + [0.0] * 3), np.array([0.0] * 5 + [20.0] * 3)

NOT_ABOS = np.array([0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0])
"""1 for each of `BROKEN` that ABO does not count itself."""


def forbidden(terms: Floats, straight_m: float, counts: float | Floats = 1.0) -> Floats:
    """Metres (n,) of path that break a limit, plus a measure of how deeply; 0 if no limit is broken.

    ``counts``: 0 for each of `BROKEN` that the objective counts itself, otherwise 1.
    """
    # Depths divided by the straight length rank paths through the same hill.
    return _sums(terms.take(BROKEN, axis=1) * (counts * (METRES + DEPTHS / straight_m)))


def _sums(rows: Floats) -> Floats:
    """Sums (n,) of rows (n, m), whose numbers are added one by one: a row has the same sum alone and in any array."""
    return np.asarray(np.add.accumulate(rows, axis=1)[:, -1])


def _krill(terms: Floats, unit: CostReference) -> Floats:
    """Length (eq. 12), or energy if that is the mission's objective.

    E eq. 12–13 sum four segments; here the whole curve is summed. E eq. 13 multiplies R1 by the horizontal and R2 by
    the vertical distance, the reverse of Table 1; Table 1 is used. E: free space is C minus C_obs, not their
    intersection.
    """
    bad = PENALTY * forbidden(terms, unit.straight_m)
    if unit.energy:
        r1, r2 = unit.vertical_j_per_m, unit.horizontal_j_per_m
        return np.asarray(r1 * terms[:, k.RISE] + r2 * (terms[:, k.FLAT] + bad))
    return np.asarray(terms[:, k.LENGTH] + bad)


SSGWO_WEIGHTS = (0.5, 0.2, 0.3)  # D: ρ of eq. 33, 34
MU_OBS = 100.0  # D: eq. 31


def _ssgwo(terms: Floats, unit: CostReference) -> Floats:
    """SSGWO, eq. 26–34.

    E eq. 29, 30: here in radians, wrapped, with e^|Δθ| - 1 and |φ|. E eq. 31, 32 sum over all nodes and obstacles
    before they compare with d_safe, measure the distance to a sphere's centre, and reward a node inside; here each node
    is compared with each cylinder, with d at least 0.1 m. D: plus 100 for each metre of path inside, so that infeasible
    paths are ranked.
    """
    length, angle, obstacle = SSGWO_WEIGHTS
    own = length * terms[:, k.LENGTH] + angle * (terms[:, k.YAW] + terms[:, k.PITCH])
    return np.asarray(own + obstacle * MU_OBS * terms[:, k.NEAR] + PENALTY * forbidden(terms, unit.straight_m))


PC = C = 100.0  # D: eq. 25, 26, 28, 29


def _msfoa(terms: Floats, unit: CostReference) -> Floats:
    """MSFOA, eq. 20–27; the nearness of eq. 28–30 is added by `Cost`.

    E eq. 21: here the height is above ground, max(0, AGL - h_min). E eq. 24: T_de is max(0, 1 - d/R). E eq. 25 adds the
    penalty to itself; here it is a constant for each turn above φ_max (D 45°). E eq. 26 penalises slopes inside [β, α],
    here it is slopes outside. D: JH is the path's mean height times its length, with heights as a part of the volume's
    height as in eq. 32; in metres JH would be some 50 times JL, and length would no longer count.
    """
    high = terms[:, k.HIGH] / unit.height_m * terms[:, k.LENGTH]
    limits = C * (terms[:, k.TURNS] + terms[:, k.SLOPES])
    own = high + terms[:, k.LENGTH] + terms[:, k.THREAT] + terms[:, k.BURIED] + limits
    return np.asarray(own + PENALTY * forbidden(terms, unit.straight_m))


def _abo(terms: Floats, unit: CostReference) -> Floats:
    """ABO, eq. 4–7: length, and P = 100 for each sample under ground (D: under the floor) or outside of the volume."""
    own = terms[:, k.LENGTH] + PENALTY * (terms[:, k.UNDER] + terms[:, k.OUTSIDE])
    return np.asarray(own + PENALTY * forbidden(terms, unit.straight_m, NOT_ABOS))


IB_ABC_TERMS = np.array([k.LENGTH, k.BEND, k.EXPOSED, k.SPHERE])
IB_ABC_WEIGHTS = np.array([0.4, 0.2, 0.2, 0.2])  # D: λ of eq. 6
LEAST, NONE = np.array([1.0, math.pi, 1.0, 1.0]), np.array([1e-9, 1e-3, 1e-9, 1e-9])
"""Divisor of a term of which the straight line has none, which means at most ``NONE``: float noise turns the line by
some 1e-8 rad at each node (arccos)."""


def _ib_abc(terms: Floats, unit: CostReference) -> Floats:
    """IB-ABC, eq. 2–6, each term divided by its value on the straight line (D; where that is 0, by π or one metre).

    E eq. 3: the atan of a cosine is taken as arccos, so Σ(π - α) is the sum of turns. E eq. 4 compares the length of a
    segment with d_safe; here the distance to obstacle or ground, and Z is AGL. E eq. 5 charges W_t, which is zero at
    the centre; here R_t - W_t.
    """
    straight = unit.straight[IB_ABC_TERMS]
    own = _sums(IB_ABC_WEIGHTS * terms.take(IB_ABC_TERMS, axis=1) / np.where(straight > NONE, straight, LEAST))
    return np.asarray(own + PENALTY * forbidden(terms, unit.straight_m) / unit.straight_m)


OBJECTIVES: Mapping[str, PaperCost] = MappingProxyType(
    {
        "krill": PaperCost(0, _krill),
        "ssgwo": PaperCost(k.YAWS | k.NODES_NEAR, _ssgwo),
        "msfoa": PaperCost(k.ANGLES | k.SAMPLES_NEAR | k.HEIGHTS, _msfoa),
        "abo": PaperCost(k.COUNTS, _abo),
        "ib-abc": PaperCost(k.ANGLES | k.BENDS | k.SAMPLES_NEAR | k.HIDING, _ib_abc),
    }
)


def get_objective(name: str) -> PaperCost:
    """The cost called ``name``. Raises InputError if it is unknown, with a list of the known ones."""
    found = OBJECTIVES.get(name)
    if found is None:
        raise unknown_name(f"there is no swarm cost {name!r}", name, OBJECTIVES)
    return found


@dataclass(frozen=True, slots=True)
class Earlier:
    """A vehicle that has the right of way (MSFOA, section 3.2.2): its points (Q, 3) and their times (Q,) in seconds."""

    points: Floats
    clock_s: Floats

    @classmethod
    def at_speed(cls, points: Floats, speed_m_s: float) -> Earlier:
        """A polyline (N, 3) flown at constant speed from time 0, as points no further apart than 5 m."""
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        at = np.linspace(0.0, s[-1], max(2, math.ceil(s[-1] / 5.0) + 1))
        dense = np.stack([np.interp(at, s, points[:, i]) for i in range(3)], axis=-1)
        return cls(np.ascontiguousarray(dense), np.ascontiguousarray(at / speed_m_s))


SOON_S = 0.5  # eq. 29
APART_M = 30.0


class Cost:
    """A batch objective over the unit box: (n, dim) to (n,).

    ``earlier`` vehicles count in every objective; ``speed_m_s`` is the speed of this one. A path has the same cost, to
    the bit, alone and in any population. Not thread-safe: it keeps its own working arrays.
    """

    def __init__(
        self,
        problem: Problem,
        code: Code,
        objective: PaperCost,
        *,
        earlier: Sequence[Earlier] = (),
        speed_m_s: float = 15.0,
    ) -> None:
        self.code, self.objective = code, objective
        self.earlier, self.speed_m_s = tuple(earlier), speed_m_s
        scene = code.scene
        self.curve, self.stride = sampled(scene, code.points)
        groups = objective.groups | (k.CEILING if scene.ceiling_follows_ground else 0)
        self.held = Held(
            f"{CURVE} {SCENE} i8 i8 {k.ROOM}",
            self.curve.bands, self.curve.spans, scene.heights, scene.quadratic, scene.floors, scene.floor_map,
            scene.numbers, scene.zones, scene.corners, self.stride, groups, *k.room(self.curve.basis.shape[1]),
        )  # fmt: skip
        straight = self.terms(self.straight_controls()[None])[0]
        self.unit = CostReference(
            straight,
            max(scene.straight_m, 1e-9),
            float(scene.high[2] - scene.low[2]),
            problem.objective == "energy",
            problem.vertical_j_per_m,
            problem.horizontal_j_per_m,
        )

    @property
    def dim(self) -> int:
        """Number of variables."""
        return self.code.dim

    def __call__(self, u: Floats) -> Floats:
        """Costs (n,) of ``u`` (n, dim) in the unit box."""
        return self.of_controls(self.code.controls(u))

    def of_controls(self, controls: Floats) -> Floats:
        """Costs (n,) of control points (n, N, 3)."""
        total = self.objective.weigh(self.terms(controls), self.unit)
        if self.earlier:
            # E eq. 30 prints the reciprocal, but t is a time. E eq. 29's cubic grows with the gap: here C·(0.5 - t)³.
            paths = self.curve.samples(controls)
            clocks, near = np.empty(paths.shape[:2]), np.empty(len(paths))
            clocks_of(paths, self.speed_m_s, clocks)
            for other in self.earlier:
                nearness(paths, clocks, other.points, other.clock_s, APART_M, SOON_S, near)
                total = total + PC * C * near
        return np.asarray(total)

    def terms(self, controls: Floats) -> Floats:
        """Terms (n, TERMS) of control points (n, N, 3)."""
        out = np.empty((len(controls), k.TERMS))
        k.measure(controls, self.held, out)
        return out

    def straight_cost(self) -> float:
        """JL + JH of the straight line, without penalties; MSFOA's threshold is a multiple of it (D)."""
        s = self.unit.straight
        return float(s[k.LENGTH] * (1.0 + s[k.HIGH] / self.unit.height_m))

    def straight_controls(self) -> Floats:
        """Control points (N, 3) of the straight line from terminal to terminal."""
        terminals, rows = self.code.scene.terminals, []
        for i, count in enumerate(self.code.points):
            t = np.arange(count + 1)[:, None] / (count + 1.0)
            rows.append(terminals[i] + t * (terminals[i + 1] - terminals[i]))
        return np.vstack([*rows, terminals[-1:]])


def sampled(scene: Scene, points: tuple[int, ...]) -> tuple[Curve, int]:
    """The curve with ``points`` free control points in each stage, and the number of samples from node to node."""
    stride = max(1, round(SAMPLES / (SSGWO_NODES + 1)))
    legs = shares((SSGWO_NODES + 1) * stride, np.linalg.norm(np.diff(scene.terminals, axis=0), axis=1))
    return curve(points, legs), stride
