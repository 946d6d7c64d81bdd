"""The exact least distances between the vehicles of a fleet, in space and time, from take-off to landing.

Motions are piecewise linear, so the distance of two vehicles is the root of a quadratic on every pair of overlapping
pieces. Time is cut into slices, and a bound for each slice shows which pieces need no exact look (`_sweep`). Nothing is
sampled.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError
from gcsplan.fleet._sweep import Fleet, Least, below, nearest
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.notes.note import Note
from gcsplan.wind.drift import between

AirPlace = tuple[float, float, float]
Where = Callable[[AirPlace], Note]
"""Names the place of east_m, north_m, amsl_m. Callers that know degrees pass their own function."""

ConflictKind = Literal["air", "take-off", "landing"]

TOLERANCE_M = 1e-6
"""Allowance for rounding, m: a distance equal to the separation is legal."""


def in_metres(place: AirPlace) -> Note:
    """A place in the plane, the default if the caller knows no degrees."""
    return Note("place_in_plane", east_m=place[0], north_m=place[1], amsl_m=place[2])


@dataclass(frozen=True, slots=True)
class Rules:
    """The requested separation and the errors of the motions.

    ``separation_m`` holds between any two vehicles. Each of them may be ``error_m`` away from its modelled position,
    and up to ``window_s`` early or late, independently of the others; a motion that drifts may also be as early or late
    as the declared winds make it. A landed vehicle stays where it landed for ``pad_clear_s`` (inf: for good).
    Vehicles in ``leaving`` fly away where their motion ends, so they stand nowhere.
    """

    separation_m: float
    error_m: float = 0.0
    window_s: float = 0.0
    pad_clear_s: float = math.inf
    leaving: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for name in ("separation_m", "error_m", "window_s", "pad_clear_s"):
            value = getattr(self, name)
            if math.isnan(value) or value < 0.0 or (math.isinf(value) and name != "pad_clear_s"):
                raise InputError(f"{name} must be a number of at least 0, given {value:g}")

    @property
    def needed_m(self) -> float:
        """Distance in the model that ensures the separation in the air, m."""
        return self.separation_m + 2.0 * self.error_m


@dataclass(frozen=True, slots=True)
class Encounter:
    """The nearest approach of two vehicles: names, distance, time, places and piece numbers.

    ``times_s`` is when each is there by its own plan, ``time_s`` the middle of the two (they differ only with a
    window). ``pieces`` is the number of each one's piece (-1: none).
    """

    vehicles: tuple[str, str]
    distance_m: float
    time_s: float
    times_s: tuple[float, float]
    places: tuple[AirPlace, AirPlace]
    pieces: tuple[int, int]

    @property
    def middle(self) -> AirPlace:
        """The middle between the two."""
        a, b = self.places
        return 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])


@dataclass(frozen=True, slots=True)
class Conflict:
    """Two vehicles nearer than ``needed_m`` from ``from_s`` until ``until_s`` (inf: for good), and the worst moment.

    ``kind``: both are in the ``air``; or the *first* takes off or lands beside the second, which stands on the ground.
    With a window the time span covers the pieces that may meet, rounded outward.
    """

    kind: ConflictKind
    worst: Encounter
    needed_m: float
    from_s: float
    until_s: float

    def note(self, where: Where = in_metres) -> Note:
        """Which vehicles, how near, when, and where."""
        worst = self.worst
        return Note(
            "come_near" if self.kind == "air" else "takes_off_beside" if self.kind == "take-off" else "lands_beside",
            first=worst.vehicles[0], second=worst.vehicles[1], distance_m=worst.distance_m, needed_m=self.needed_m,
            time_s=worst.time_s, place=where(worst.middle),
        )  # fmt: skip


@dataclass(frozen=True, eq=False, slots=True)
class Separation:
    """The result: ``distance_m`` (V, V) is the exact least distance of every pair while both are in the air.

    It is inf for a pair that never is. ``least`` is the nearest approach of all, ``conflicts`` are sorted by time,
    ``notes`` are for the user.
    """

    rules: Rules
    names: tuple[str, ...]
    distance_m: Floats
    least: Encounter | None
    conflicts: tuple[Conflict, ...]
    notes: tuple[Note, ...]
    _pairs: Pairs = field(repr=False)

    @property
    def safe(self) -> bool:
        """Whether every pair keeps the separation."""
        return not self.conflicts

    def between(self, a: str, b: str) -> Encounter | None:
        """The nearest approach of two vehicles; None if they are never both in the air."""
        return self._pairs.encounter(self.names.index(a), self.names.index(b))


@dataclass(frozen=True, eq=False, slots=True)
class Pairs:
    """Pairs ``i``, ``j`` (M,) of a fleet's vehicles, and the least distance of each."""

    fleet: Fleet
    i: Indices
    j: Indices
    least: Least

    def encounter(self, a: int, b: int) -> Encounter | None:
        """The nearest approach of two vehicles by number, in this order; None if they are never both in the air."""
        rows = np.flatnonzero(((self.i == a) & (self.j == b)) | ((self.i == b) & (self.j == a)))
        if not len(rows) or not math.isfinite(self.least.distance_m[rows[0]]):
            return None
        m = int(rows[0])
        found = encounter(
            self.fleet, (int(self.i[m]), int(self.j[m])), float(self.least.distance_m[m]),
            (float(self.least.first_s[m]), float(self.least.second_s[m])),
            (int(self.least.pieces[m, 0]), int(self.least.pieces[m, 1])),
        )  # fmt: skip
        return found if self.i[m] == a else swapped(found)


def separation(paths: Sequence[TimedPath], rules: Rules) -> Separation:
    """Judge a fleet: every pair's exact least distance (within 1e-6 m, never optimistic beyond it), every conflict.

    Pairs are judged while both are in the air (a vehicle that ends in the air stays there for good). Then the pads are
    judged: a vehicle conflicts if it takes off or lands nearer than ``rules.needed_m`` (horizontally) to a landed
    vehicle, or lands that near to a waiting one. Waiting vehicles are not judged against each other, nor against one
    that takes off beside them; a note states it. A vehicle that flies over one on the ground is not judged against it,
    because min AGL covers that. Raises InputError for two vehicles of one name.
    """
    names = tuple(p.name for p in paths)
    if len(set(names)) != len(names):
        raise InputError(f"every vehicle needs a name of its own, given {', '.join(names)}")
    distance = np.full((len(paths), len(paths)), np.inf)
    if len(paths) < 2:
        fleet = Fleet.of(paths, rules.window_s) if paths else None
        none = np.zeros(0, dtype=np.intp)
        if fleet is None:
            raise InputError("give at least one vehicle to judge the separation of")
        return Separation(rules, names, distance, None, (), (), Pairs(fleet, none, none, Least.none(0)))
    fleet = Fleet.of(paths, rules.window_s)
    i, j = (index.astype(np.intp) for index in np.triu_indices(len(paths), 1))
    pairs = Pairs(fleet, i, j, fleet.least(i, j))
    distance[i, j] = distance[j, i] = pairs.least.distance_m
    best = int(pairs.least.distance_m.argmin())
    conflicts = [*in_the_air(pairs, rules), *on_the_pads(paths, rules)]
    conflicts.sort(key=lambda c: (c.from_s, c.worst.vehicles))
    return Separation(
        rules, names, distance, pairs.encounter(int(i[best]), int(j[best])), tuple(conflicts),
        waiting_note(paths, rules), pairs,
    )  # fmt: skip


def conflicts_of(path: TimedPath, others: Sequence[TimedPath], rules: Rules) -> list[Conflict]:
    """The conflicts of a motion with others, by time, as `separation` finds them; the others are not judged against
    each other."""
    paths = [path, *others]
    fleet, count = Fleet.of(paths, rules.window_s), len(others)
    i, j = np.zeros(count, dtype=np.intp), np.arange(1, count + 1, dtype=np.intp)
    found = in_the_air(Pairs(fleet, i, j, fleet.least(i, j, rules.needed_m)), rules)
    found += [c for c in on_the_pads(paths, rules) if path.name in c.worst.vehicles]
    return sorted(found, key=lambda c: (c.from_s, c.worst.vehicles))


def in_the_air(pairs: Pairs, rules: Rules) -> list[Conflict]:
    """Every time span in which a pair is nearer than needed, with its worst moment."""
    needed = rules.needed_m - TOLERANCE_M
    bad = np.flatnonzero(pairs.least.distance_m < needed)
    found: list[Conflict] = []
    fleet, w = pairs.fleet, float(pairs.fleet.reach_s.max())
    for m in bad.tolist():
        i, j = pairs.i[m : m + 1], pairs.j[m : m + 1]
        bound, _ = fleet.bounds(i, j)
        k = np.flatnonzero(bound[0] < needed)
        near = np.full(len(k), needed)
        spans: list[tuple[float, float, float, float, float, int, int]] = []
        for _, a, b, apart in fleet.rows(np.repeat(i, len(k)), np.repeat(j, len(k)), k, near):
            pa, pb = fleet.pieces.take(a), fleet.pieces.take(b)
            distance, t1, t2 = nearest(pa, pb, apart)
            if w > 0.0:
                first, last = np.maximum(pa.from_s, pb.from_s) - w, np.minimum(pa.to_s, pb.to_s) + w
                close = distance < needed
            else:
                first, last = below(pa, pb, rules.needed_m)
                close = (first <= last) & (distance < needed)
            rows = (x[close].tolist() for x in (first, last, distance, t1, t2, a, b))
            spans.extend(zip(*rows, strict=True))
        for group in _merged(sorted(set(spans))):
            worst = min(group, key=lambda s: (s[2], s[3]))
            met = encounter(
                fleet, (int(i[0]), int(j[0])), worst[2], (worst[3], worst[4]), (int(worst[5]), int(worst[6]))
            )
            until = max(s[1] for s in group)
            until = math.inf if until > fleet.horizon_s + w + 1.0 else until
            found.append(Conflict("air", met, rules.needed_m, group[0][0], until))
    return found


Span = tuple[float, float, float, float, float, int, int]


def _merged(spans: list[Span]) -> list[list[Span]]:
    """Group the spans that touch."""
    groups: list[list[Span]] = []
    end = -math.inf
    for span in spans:
        if not groups or span[0] > end + 1e-6:
            groups.append([])
            end = -math.inf
        groups[-1].append(span)
        end = max(end, span[1])
    return groups


def on_the_pads(paths: Sequence[TimedPath], rules: Rules) -> list[Conflict]:
    """Conflicts of vehicles that take off or land beside one that stands on the ground."""
    begins, ends = np.array([p.begin_s for p in paths]), np.array([p.end_s for p in paths])
    starts, goals = np.array([p.points[0] for p in paths]), np.array([p.points[-1] for p in paths])
    landing = np.array([not p.ends_in_air and p.name not in rules.leaving for p in paths])
    needed, wide = rules.needed_m - TOLERANCE_M, 2.0 * rules.window_s
    # A landing's drift counts beside a take-off's, which depends on no wind, and beside another landing's in the same.
    early, late = np.array([(p.end_drifts.early.min(), p.end_drifts.late.max()) for p in paths]).T
    latest = begins + np.array([p.begin_drifts.late.max() for p in paths])
    early, late = (np.minimum(early, -wide), np.maximum(late, wide)) if wide else (early, late)

    def near(a: Floats, b: Floats) -> Bools:
        d = a[:, None, :2] - b[None, :, :2]
        out = np.asarray(np.hypot(d[..., 0], d[..., 1]) < needed)
        np.fill_diagonal(out, False)
        return out

    cleared = ends + rules.pad_clear_s
    # [y, x]: vehicle y moves, vehicle x stands.
    stands = landing[None, :] & (latest[:, None] >= (ends + early)[None, :])
    leaves_beside = near(starts, goals) & stands & (begins[:, None] < (cleared + late)[None])
    later = ends[:, None] - ends[None, :]
    order = np.arange(len(paths))
    second = (later > 0.0) | ((later == 0.0) & (order[:, None] > order[None, :]))
    lands_beside = near(goals, goals) & landing[None, :] & landing[:, None] & second
    for y, x in np.argwhere(lands_beside).tolist():
        most_s = float(between(paths[y].end_drifts, paths[x].end_drifts)[1][0])
        lands_beside[y, x] = ends[y] < cleared[x] + (max(most_s, wide) if wide else most_s)
    lands_before = near(goals, starts) & landing[:, None] & ((ends + early)[:, None] <= latest[None, :])

    def conflict(
        kind: ConflictKind, y: int, x: int, place: Floats, stand: Floats, time_s: float, until: float
    ) -> Conflict:
        here, there = (float(place[0]), float(place[1]), float(place[2])), (
            float(stand[0]), float(stand[1]), float(stand[2]))  # fmt: skip
        apart_m = math.hypot(here[0] - there[0], here[1] - there[1])
        number = _number(paths[y], 0 if kind == "take-off" else -1)
        other = _number(paths[x], 0 if stand is starts[x] else -1)
        names = (paths[y].name, paths[x].name)
        met = Encounter(names, apart_m, time_s, (time_s, time_s), (here, there), (number, other))
        return Conflict(kind, met, rules.needed_m, time_s, until)

    found: list[Conflict] = []
    for y, x in np.argwhere(leaves_beside).tolist():
        found.append(conflict("take-off", y, x, starts[y], goals[x], float(begins[y]), float(begins[y])))
    for y, x in np.argwhere(lands_beside).tolist():
        found.append(conflict("landing", y, x, goals[y], goals[x], float(ends[y]), float(cleared[x])))
    for y, x in np.argwhere(lands_before).tolist():
        found.append(conflict("landing", y, x, goals[y], starts[x], float(ends[y]), float(begins[x])))
    return found


def waiting_note(paths: Sequence[TimedPath], rules: Rules) -> tuple[Note, ...]:
    """A note on start places that are nearer to each other than needed."""
    starts = np.array([p.points[0, :2] for p in paths])
    i, j = np.triu_indices(len(paths), 1)
    apart = np.hypot(*(starts[i] - starts[j]).T)
    near = apart < rules.needed_m - TOLERANCE_M
    if not near.any():
        return ()
    m = int(apart.argmin())
    first, second = paths[i[m]].name, paths[j[m]].name
    pairs, apart_m = int(near.sum()), float(apart[m])
    return (
        Note(
            "starts_within_separation", pairs=pairs, needed_m=rules.needed_m, first=first, second=second,
            apart_m=apart_m,
        ),
    )  # fmt: skip


def encounter(
    fleet: Fleet, pair: tuple[int, int], distance_m: float, times_s: tuple[float, float], pieces: tuple[int, int]
) -> Encounter:
    """The Encounter of two vehicles at two times, on two pieces numbered over all vehicles."""
    a, b = pair
    places = [np.asarray(fleet.paths[v].at(t)[0]).tolist() for v, t in zip(pair, times_s, strict=True)]
    numbers = [_number(fleet.paths[v], piece - int(fleet.offset[v])) for v, piece in zip(pair, pieces, strict=True)]
    return Encounter(
        (fleet.paths[a].name, fleet.paths[b].name), distance_m, 0.5 * (times_s[0] + times_s[1]), times_s,
        (tuple(places[0]), tuple(places[1])), (numbers[0], numbers[1]),
    )  # fmt: skip


def swapped(met: Encounter) -> Encounter:
    """The same encounter with the two vehicles in the other order."""
    return Encounter(
        met.vehicles[::-1], met.distance_m, met.time_s, met.times_s[::-1], met.places[::-1], met.pieces[::-1]
    )


def _number(path: TimedPath, piece: int) -> int:
    """The caller's number of a piece; the piece that stays in the air has the number of the last one."""
    if path.pieces is None:
        return -1
    return int(path.pieces[min(piece, len(path.pieces) - 1)])
