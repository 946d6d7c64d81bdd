"""Arc paths: tracks of straight legs and arcs of one radius around discs, from start to goal.

Every turn follows the edge of a disc, on its left or on its right, and legs are the tangents between neighbouring
discs. So turns never overlap however close the discs are, and a turn of any size is one arc. For an autopilot each arc
is then divided into turns of at most `MOST_DEG`; the way point of a turn is where its tangents meet. The arc of a disc
with a pin passes through that point, and is divided there unless the turn is slight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.turns.kernels import CHORD_M, fill_outline, part_neighbours, tangents

MOST_DEG = 100.0
"""Largest turn at one way point, in degrees."""

ROUNDS = 12
"""Rounds in which discs are placed through their contacts again; they are pushed apart up to four times as often."""

NO_TURN = 1e-9
"""Turns up to this many radians count as none."""

DAMPED = 40
"""Further rounds in which pinned discs go half of the way to their place, if they swing to and fro."""

MISSED_M = 1e-3
"""Metres by which an arc may end before its pin, or begin behind it."""


@dataclass(frozen=True, eq=False, slots=True)
class ArcPath:
    """``ends`` (2, 2) start and goal; discs in order: ``centre`` (K, 2), ``sense`` (K,) +1 for a left turn, -1 right.

    ``pin`` (K, 2): the point that a disc must touch, NaN where free; ``pin_m`` (K,) its altitude, NaN where free.
    ``heading`` (K + 1,) of the legs, radians from east to north; ``turn`` (K,) >= 0 radians. ``gap_m``: metres by which
    neighbours are too close for a tangent, summed, or by which arcs miss their pins; where it is not 0 no such arc path
    exists, and ``heading`` and ``turn`` are meaningless.
    """

    ends: Floats
    radius_m: float
    centre: Floats
    sense: Floats
    pin: Floats
    pin_m: Floats
    heading: Floats
    turn: Floats
    gap_m: float

    @property
    def pinned(self) -> Bools:
        """Which discs (K,) have a pin."""
        return np.isfinite(self.pin[:, 0])


@dataclass(frozen=True, eq=False, slots=True)
class Outline:
    """An arc path as chords: ``points`` (N, 2), ``s_m`` (N,) metres along them.

    ``arcs`` (A, 3): for each turn the indices of its first, middle and last point; ``corners`` (A, 2) its way point;
    ``disc`` (A,) the index of its disc. ``widen_m`` (N - 1,) how far the arc may lie outside each chord; ``pins`` (P,)
    indices of pinned points, ``pin_m`` (P,) their altitudes. ``true_m`` (N,) metres along legs and arcs themselves.
    """

    points: Floats
    s_m: Floats
    true_m: Floats
    arcs: Int64s
    corners: Floats
    widen_m: Floats
    disc: Int64s
    pins: Int64s
    pin_m: Floats


def through(ends: Floats, radius_m: float, contact: Floats, sense: Floats, pinned: Bools, pin_m: Floats) -> ArcPath:
    """The arc path whose turns pass through ``contact`` (K, 2) in their middle; discs it need not touch are removed."""
    heading = _headings(np.vstack([ends[:1], contact, ends[1:]]))
    sense, centre = sense.copy(), np.zeros_like(contact)
    pin = np.where(pinned[:, None], contact, np.nan)
    arc_path = ArcPath(ends, radius_m, centre, sense, pin, pin_m, heading, np.zeros(len(sense)), 0.0)
    for _ in range(ROUNDS):
        middle = _middles(arc_path.heading)
        normal = np.stack([-np.sin(middle), np.cos(middle)], axis=-1)
        arc_path = _drawn(replace(arc_path, centre=contact + radius_m * arc_path.sense[:, None] * normal), parted=True)
        loose = (arc_path.turn <= NO_TURN) & ~arc_path.pinned
        if arc_path.gap_m == 0.0 and loose.any():
            contact, arc_path = contact[~loose], _drawn(_without(arc_path, loose))
    return tight(arc_path)


def tight(arc_path: ArcPath) -> ArcPath:
    """The arc path around its discs where they are; free discs that it need not touch are removed, pinned ones moved so
    that they touch their pins."""
    arc_path = _drawn(arc_path)
    straight = len(arc_path.sense) + ROUNDS
    for k in range(straight + DAMPED):
        loose = (arc_path.turn <= NO_TURN) & ~arc_path.pinned
        if arc_path.gap_m == 0.0 and loose.any():
            worst = np.zeros(len(loose), bool)
            worst[np.argmin(np.where(loose, arc_path.turn, np.inf))] = True
            arc_path = _drawn(_without(arc_path, worst))
            continue
        if not arc_path.pinned.any():
            break
        laid = _pins_laid(arc_path, 1.0 if k < straight else 0.5)
        if np.abs(laid.centre - arc_path.centre).max() < 1e-9:
            break
        arc_path = laid
    if arc_path.gap_m == 0.0 and arc_path.pinned.any():
        arc_path = replace(arc_path, gap_m=float(missed_m(arc_path).sum()))
    return arc_path


def moved(arc_path: ArcPath, disc: int, by: Floats) -> ArcPath:
    """The arc path with one free disc moved by ``by`` (2,) metres."""
    centre = arc_path.centre.copy()
    centre[disc] += by
    return tight(replace(arc_path, centre=centre))


def inserted(arc_path: ArcPath, at: int, contact: Floats, heading: float, sense: float) -> ArcPath:
    """The arc path with one disc more, before disc ``at``, that a track of ``heading`` touches at ``contact``."""
    normal = sense * arc_path.radius_m * np.array([-math.sin(heading), math.cos(heading)])
    return tight(
        replace(
            arc_path,
            centre=np.insert(arc_path.centre, at, contact + normal, axis=0),
            sense=np.insert(arc_path.sense, at, sense),
            pin=np.insert(arc_path.pin, at, np.nan, axis=0),
            pin_m=np.insert(arc_path.pin_m, at, np.nan),
        )
    )


def without(arc_path: ArcPath, disc: int) -> ArcPath:
    """The arc path without one disc."""
    gone = np.zeros(len(arc_path.sense), bool)
    gone[disc] = True
    return tight(_without(arc_path, gone))


def unlooped(arc_path: ArcPath) -> ArcPath:
    """The arc path without free discs around which it turns by more than 180 degrees, removed one by one."""
    while arc_path.gap_m == 0.0:
        loops = (arc_path.turn > math.pi) & ~arc_path.pinned
        if not loops.any():
            break
        arc_path = without(arc_path, int(np.argmax(np.where(loops, arc_path.turn, 0.0))))
    return arc_path


def outline(arc_path: ArcPath) -> Outline:
    """The arc path as chords; each arc lies at most `CHORD_M` outside its chord."""
    size = 2
    step = 2.0 * math.acos(max(1.0 - CHORD_M / arc_path.radius_m, 0.5))
    most = math.radians(MOST_DEG)
    for turn in arc_path.turn:
        size += 4 * (math.ceil(abs(turn) / most) + 2) + 2 * math.ceil(abs(turn) / step) + 8
    points, true_m, widen = np.empty((size, 2)), np.empty(size), np.zeros(size)
    arcs, corners = np.empty((size, 3), np.int64), np.empty((size, 2))
    disc, pin_at = np.empty(size, np.int64), np.full(len(arc_path.sense), -1, np.int64)
    n = fill_outline(
        arc_path.ends, arc_path.radius_m, arc_path.centre, arc_path.sense, arc_path.pin, arc_path.heading,
        arc_path.turn, step, most, points, true_m, widen, arcs, corners, disc, pin_at,
    )  # fmt: skip
    points, turns = points[:n].copy(), int(disc[-1])
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    touched = pin_at >= 0
    return Outline(
        points, s, true_m[:n].copy(), arcs[:turns].copy(), corners[:turns].copy(), widen[1:n].copy(),
        disc[:turns].copy(), pin_at[touched], arc_path.pin_m[touched],
    )  # fmt: skip


def lacking_m(arc_path: ArcPath) -> Floats:
    """(K + 1,) metres by which the neighbours at the ends of each leg are too close for a tangent; less than 0 where
    they are not, and -inf where they never are."""
    way = np.vstack([arc_path.ends[:1], arc_path.centre, arc_path.ends[1:]])
    side = np.concatenate([[0.0], arc_path.sense, [0.0]])
    needed = arc_path.radius_m * np.abs(np.diff(side))
    return np.asarray(np.where(needed > 0.0, needed - np.hypot(*np.diff(way, axis=0).T), -np.inf))


def missed_m(arc_path: ArcPath) -> Floats:
    """(K,) metres along each disc from its arc to its pin; 0 without a pin, and where the arc reaches it."""
    spoke = arc_path.pin - arc_path.centre
    begin = arc_path.heading[:-1] - 0.5 * math.pi * arc_path.sense
    at = arc_path.sense * (np.arctan2(spoke[:, 1], spoke[:, 0]) - begin)
    middle = 0.5 * arc_path.turn
    off = np.abs((at - middle + math.pi) % (2.0 * math.pi) - math.pi) - middle
    off_m = arc_path.radius_m * np.where(arc_path.pinned, off, 0.0)
    return np.where(off_m > MISSED_M, off_m, 0.0)


def _headings(points: Floats) -> Floats:
    d = np.diff(points, axis=0)
    return np.arctan2(d[:, 1], d[:, 0])


def _middles(heading: Floats) -> Floats:
    """Headings (K,) in the middle of the turns between K + 1 legs."""
    turn = np.diff(heading)
    return np.asarray(heading[:-1] + 0.5 * ((turn + math.pi) % (2.0 * math.pi) - math.pi))


def _without(arc_path: ArcPath, gone: Bools) -> ArcPath:
    keep = ~gone
    centre, sense, pin, pin_m = (a[keep] for a in (arc_path.centre, arc_path.sense, arc_path.pin, arc_path.pin_m))
    return replace(arc_path, centre=centre, sense=sense, pin=pin, pin_m=pin_m)


def _drawn(arc_path: ArcPath, *, parted: bool = False) -> ArcPath:
    count = len(arc_path.sense)
    heading, turn, centre = np.empty(count + 1), np.empty(count), arc_path.centre.copy()
    gap = np.empty(1)
    tangents(arc_path.ends, arc_path.radius_m, centre, arc_path.sense, heading, turn, gap)
    if parted and gap[0] > 0.0:
        for _ in range(4 * ROUNDS):
            part_neighbours(arc_path.ends, arc_path.radius_m, centre, arc_path.sense, arc_path.pinned)
            tangents(arc_path.ends, arc_path.radius_m, centre, arc_path.sense, heading, turn, gap)
            if gap[0] == 0.0:
                break
    return replace(arc_path, centre=centre, heading=heading, turn=turn, gap_m=float(gap[0]))


def _pins_laid(arc_path: ArcPath, part: float = 1.0) -> ArcPath:
    """Place pinned discs so that the middle of their turn is at the pin; on the other side if the turn is negative.

    ``part``: how far they are turned around their pins towards there; less than all of it ends a swinging to and fro.
    """
    if arc_path.gap_m > 0.0:
        return arc_path
    sense = np.where(arc_path.pinned & (arc_path.turn < 0.0), -arc_path.sense, arc_path.sense)
    # Not `_middles`: for a turn of more than 180 degrees that takes the middle of the shorter turn the other way.
    middle = arc_path.heading[:-1] + 0.5 * arc_path.sense * arc_path.turn
    if part < 1.0:
        spoke = arc_path.sense[:, None] * (arc_path.pin - arc_path.centre)
        now = np.arctan2(spoke[:, 0], -spoke[:, 1])
        middle = now + part * ((middle - now + math.pi) % (2.0 * math.pi) - math.pi)
    normal = np.stack([-np.sin(middle), np.cos(middle)], axis=-1)
    centre = np.where(
        arc_path.pinned[:, None], arc_path.pin + arc_path.radius_m * sense[:, None] * normal, arc_path.centre
    )
    return _drawn(replace(arc_path, centre=centre, sense=sense))
