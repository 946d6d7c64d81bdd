"""`DeclaredWind`: every wind that may blow during a flight, as a mission declares it.

A wind is horizontal and is the same over a whole level. A declared wind is a set: at each of its heights (and hours,
for a forecast) the speed lies between two speeds, and the direction between two directions. A *share* (speed,
direction), each from 0 to 1, chooses one wind of the set: 0 is the lower end of each range, 1 the upper one. Between
two heights, and between two hours, the vectors of one share are interpolated linearly; beyond the first and the last
the nearest counts.

- Without ``varying`` one share holds for the whole flight, at every height and hour: one unknown wind.
- With ``varying`` the share may be another one at each place and time: any wind of the set, anywhere.
- ``gust_m_s`` is the highest speed in a gust: gusts add at most what it exceeds the highest speed of the set by.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from gcsplan.arrays import Floats

WindHeights = Literal["amsl", "agl"]


@dataclass(frozen=True, eq=False, slots=True)
class DeclaredWind:
    """A set of winds. Raises ValueError for arrays of other shapes, and for ranges that do not rise.

    ``speed_m_s`` and ``from_deg`` (T, L, 2) are the lowest and highest speed, and the range of directions that the wind
    comes from, clockwise from true north; the second is at most 360 above the first. ``heights_m`` (L,) rise, above sea
    or above ground as ``heights`` says. ``times_s`` (T,) rise, seconds UTC since 1970; with one of them the wind is the
    same at all hours.
    """

    speed_m_s: Floats
    from_deg: Floats
    heights_m: Floats = field(default_factory=lambda: np.zeros(1))
    heights: WindHeights = "agl"
    times_s: Floats = field(default_factory=lambda: np.zeros(1))
    varying: bool = False
    gust_m_s: float | None = None

    def __post_init__(self) -> None:
        shape = (len(self.times_s), len(self.heights_m), 2)
        if self.speed_m_s.shape != shape or self.from_deg.shape != shape:
            raise ValueError(f"speeds {self.speed_m_s.shape} and directions {self.from_deg.shape} need shape {shape}")
        if not (self.speed_m_s[..., 0] >= 0.0).all() or not np.isfinite(self.speed_m_s).all():
            raise ValueError("speeds are finite and 0 or more")
        turns = self.from_deg[..., 1] - self.from_deg[..., 0]
        if not ((turns >= 0.0) & (turns <= 360.0)).all() or not (np.diff(self.speed_m_s) >= 0.0).all():
            raise ValueError("a range goes from its lower end to its upper one, and over at most a whole turn")
        if not (np.diff(self.heights_m) > 0.0).all() or not (np.diff(self.times_s) > 0.0).all():
            raise ValueError("heights and times rise")

    @property
    def still(self) -> bool:
        """Whether the air does not move at all."""
        return not self.most_m_s and not self.gust_m_s

    @property
    def single(self) -> bool:
        """Whether the set has one wind alone, so that every share chooses it."""
        return bool((self.speed_m_s[..., 0] == self.speed_m_s[..., 1]).all()) and bool(
            ((self.from_deg[..., 0] == self.from_deg[..., 1]) | (self.speed_m_s[..., 1] == 0.0)).all()
        )

    @property
    def key(self) -> tuple[object, ...]:
        """The same of two sets exactly if they have the same winds."""
        arrays = (self.speed_m_s, self.from_deg, self.heights_m, self.times_s)
        return (*(a.tobytes() for a in arrays), self.speed_m_s.shape, self.heights, self.varying, self.gust_m_s)

    @property
    def constant_m_s(self) -> tuple[float, float] | None:
        """The one wind that blows at all heights and hours, to east and to north, m/s; None if another one may blow."""
        if not self.single or self.speed_m_s.size != 2 or self.gusts_add_m_s:
            return None
        east, north = self._levels(np.zeros((1, 2)))[0, 0, 0].tolist()
        return east, north

    @property
    def most_m_s(self) -> float:
        """The highest speed of the set, without gusts, m/s."""
        return float(self.speed_m_s.max())

    @property
    def strongest_m_s(self) -> float:
        """The highest speed of the set, gusts included, m/s."""
        return self.most_m_s + self.gusts_add_m_s

    @property
    def gusts_add_m_s(self) -> float:
        """How much a gust adds at most to any wind of the set, m/s."""
        return max((self.gust_m_s or 0.0) - self.most_m_s, 0.0)

    def scaled(self, factor: float) -> DeclaredWind:
        """The same set with all speeds, and the gusts, times ``factor``."""
        gust_m_s = None if self.gust_m_s is None else factor * self.gust_m_s
        return replace(self, speed_m_s=factor * self.speed_m_s, gust_m_s=gust_m_s)

    def along_m_s(self, courses_rad: Floats) -> Floats:
        """(N,) the most that any wind of the set, with its gusts, blows along courses (N,), from east to north."""
        low, high = self.speed_m_s[..., 0], self.speed_m_s[..., 1]
        # A wind from 270° blows towards the east, course 0.
        first = 270.0 - self.from_deg[..., 1]
        span = np.diff(self.from_deg)[..., 0]
        past = (np.degrees(courses_rad)[:, None, None] - first) % 360.0
        off = np.minimum(np.maximum(past - span, 0.0), 360.0 - past)
        cosine = np.cos(np.radians(np.where(past <= span, 0.0, off)))
        most: Floats = np.where(cosine > 0.0, high * cosine, low * cosine).max(axis=(1, 2)) + self.gusts_add_m_s
        return most

    def vectors_m_s(self, shares: Floats, amsl_m: Floats, agl_m: Floats, at_s: Floats) -> Floats:
        """(K, N, 2) the wind's velocity, east and north, for ``shares`` (K, 2) at N heights and times.

        ``amsl_m``, ``agl_m`` (N,) are heights of the same points; ``at_s`` (N,) are seconds UTC since 1970.
        """
        return self._at(self._levels(shares), amsl_m, agl_m, at_s)

    def each_m_s(self, shares: Floats, amsl_m: Floats, agl_m: Floats, at_s: Floats) -> Floats:
        """(N, 2) as `vectors_m_s`, but ``shares`` (N, 2) has a share for each of the N heights and times."""
        return self._at(self._levels(shares), amsl_m, agl_m, at_s, np.arange(len(shares)))

    def _levels(self, shares: Floats) -> Floats:
        """(K, T, L, 2) the vectors of each share at all hours and heights of the set."""
        low, turn = self.speed_m_s[..., 0], np.radians(self.from_deg[..., 0])
        speed = low + shares[:, 0, None, None] * (self.speed_m_s[..., 1] - low)
        angle = turn + shares[:, 1, None, None] * (np.radians(self.from_deg[..., 1]) - turn)
        return np.stack([-speed * np.sin(angle), -speed * np.cos(angle)], axis=-1)  # towards where it blows

    def away_m_s(self, vector_m_s: tuple[float, float], amsl_m: float, agl_m: float, at_s: float) -> float:
        """How far a wind's vector (to east, to north) is from the nearest wind of the set at a height and an hour, m/s.

        Gusts do not count. Directions are looked at degree by degree: at 20 m/s this is 0.2 m/s too far at most.
        """
        speeds, turns = np.meshgrid(np.linspace(0.0, 1.0, 33), np.linspace(0.0, 1.0, 361))
        shares = np.column_stack([speeds.ravel(), turns.ravel()])
        winds = self.vectors_m_s(shares, np.array([amsl_m]), np.array([agl_m]), np.array([at_s]))[:, 0]
        return float(np.hypot(*(winds - np.asarray(vector_m_s)).T).min())

    def bow_m_s(self, cells: Floats, amsl_m: Floats, agl_m: Floats, at_s: Floats) -> Floats:
        """(K, N) how far winds of cells of shares lie at most beyond the quadrangle of the winds at their corners, m/s.

        ``cells`` (K, 2, 2): lower and upper share of speed, and of direction. An arc of directions lies within its
        speed times an eighth of the square of its angle of its chord, place by place.
        """
        turn = (cells[:, 1, 1] - cells[:, 1, 0])[:, None, None] * np.radians(np.diff(self.from_deg)[..., 0])
        speed = self.speed_m_s[..., 0] + cells[:, 0, 1, None, None] * np.diff(self.speed_m_s)[..., 0]
        bow = speed * np.minimum(0.125 * turn**2, 2.0)
        return self._at(bow[..., None], amsl_m, agl_m, at_s)[..., 0]

    def _at(
        self, levels: Floats, amsl_m: Floats, agl_m: Floats, at_s: Floats, rows: slice | np.ndarray = slice(None)
    ) -> Floats:
        """(K, N, C) values of ``levels`` (K, T, L, C), interpolated linearly in time and height.

        (N, C) with ``rows`` (N,): the row of ``levels`` for each point.
        """
        if self.speed_m_s.size == 2:  # the same at all heights and hours
            one = levels[:, 0, 0] + 0.0
            return np.repeat(one[:, None], len(at_s), axis=1) if isinstance(rows, slice) else one[rows]
        t0, t1, dt = _between(self.times_s, at_s)
        h0, h1, dh = _between(self.heights_m, amsl_m if self.heights == "amsl" else agl_m)
        dt, dh = dt[:, None], dh[:, None]
        early = levels[rows, t0, h0] + dh * (levels[rows, t0, h1] - levels[rows, t0, h0])
        late = levels[rows, t1, h0] + dh * (levels[rows, t1, h1] - levels[rows, t1, h0])
        at: Floats = early + dt * (late - early)
        return at


STILL_AIR = DeclaredWind(np.zeros((1, 1, 2)), np.zeros((1, 1, 2)))
"""The wind of a mission that declares none."""


def _between(nodes: Floats, x: Floats) -> tuple[np.ndarray, np.ndarray, Floats]:
    """The nodes below and above each of ``x``, and its part of the way between them; the ends count beyond them."""
    above = np.clip(np.searchsorted(nodes, x, side="right"), 1, max(len(nodes) - 1, 1))
    low, high = above - 1, np.minimum(above, len(nodes) - 1)
    width = np.where(high > low, nodes[high] - nodes[low], 1.0)
    return low, high, np.where(high > low, np.clip((x - nodes[low]) / width, 0.0, 1.0), 0.0)


@dataclass(frozen=True, eq=False, slots=True)
class FlightWind:
    """The wind of one flight, which leaves at a time between two: seconds UTC since 1970.

    ``late_s``: how much later than planned it may leave.
    """

    declared: DeclaredWind
    departs_s: tuple[float, float] = (0.0, 0.0)
    late_s: float = 0.0
