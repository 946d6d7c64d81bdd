"""A track of straight legs and arcs of one radius: a belt around discs, from start to goal.

Every turn hugs a disc, on its left or on its right, and legs are the tangents between neighbours, so turns never
overlap however close the discs are, and a turn of any size is one arc. For an autopilot each arc is then cut into
turns of `MOST_DEG` at most; the way point of a turn is where its tangents meet. A disc with a pin touches that very
point, and is cut there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_DEG = 100.0
"""Largest turn at one way point."""

CHORD_M = 0.05
"""Most that an arc lies outside the chords that stand for it."""

ROUNDS = 12
"""Times that discs are laid anew through their contacts, or pushed apart, before the belt is drawn for good."""

NO_TURN = 1e-9
"""A smaller turn, in radians, is none."""


@dataclass(frozen=True, eq=False, slots=True)
class Belt:
    """``ends`` (2, 2) start and goal; discs in order: ``centre`` (K, 2), ``sense`` (K,) +1 for a left turn, -1 right.

    ``pin`` (K, 2): the point that a disc touches, NaN where free; ``pin_m`` (K,) its altitude, NaN where free.
    ``heading`` (K + 1,) radians of the legs, from east to north; ``turn`` (K,) >= 0 radians. ``gap_m``: how much too
    close neighbours are for a tangent, in all; where it is not 0 there is no such belt, and the rest is meaningless.
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
    def pinned(self) -> NDArray[np.bool_]:
        """(K,) which discs have a pin."""
        return np.isfinite(self.pin[:, 0])


@dataclass(frozen=True, eq=False, slots=True)
class Outline:
    """A belt as chords: ``points`` (N, 2), ``s_m`` (N,) along them.

    ``arcs`` (A, 3): for each turn the indices of its first, middle and last point; ``corners`` (A, 2) its way point;
    ``widen_m`` (N - 1,) how far arcs may lie outside of chords; ``disc`` (A,) whose turn it is; ``pins`` (P,) indices
    of pinned points, ``pin_m`` (P,) their altitudes. ``true_m`` (N,) metres along legs and arcs themselves.
    """

    points: Floats
    s_m: Floats
    true_m: Floats
    arcs: Ints
    corners: Floats
    widen_m: Floats
    disc: Ints
    pins: Ints
    pin_m: Floats


def through(
    ends: Floats, radius_m: float, contact: Floats, sense: Floats, pinned: NDArray[np.bool_], pin_m: Floats
) -> Belt:
    """The belt whose turns pass through ``contact`` (K, 2) in the middle; contacts it need not touch are left out."""
    heading = _headings(np.vstack([ends[:1], contact, ends[1:]]))
    sense, centre = sense.copy(), np.zeros_like(contact)
    pin = np.where(pinned[:, None], contact, np.nan)
    belt = Belt(ends, radius_m, centre, sense, pin, pin_m, heading, np.zeros(len(sense)), 0.0)
    for _ in range(ROUNDS):
        middle = _middles(belt.heading)
        normal = np.stack([-np.sin(middle), np.cos(middle)], axis=-1)
        belt = _drawn(replace(belt, centre=contact + radius_m * belt.sense[:, None] * normal), parted=True)
        loose = (belt.turn <= NO_TURN) & ~belt.pinned
        if belt.gap_m == 0.0 and loose.any():
            contact, belt = contact[~loose], _drawn(_without(belt, loose))
    return tight(belt)


def tight(belt: Belt) -> Belt:
    """The belt drawn around its discs as they lie, those that it need not touch left out, pins touched."""
    belt = _drawn(belt)
    for _ in range(len(belt.sense) + ROUNDS):
        loose = (belt.turn <= NO_TURN) & ~belt.pinned
        if belt.gap_m == 0.0 and loose.any():
            worst = np.zeros(len(loose), bool)
            worst[np.argmin(np.where(loose, belt.turn, np.inf))] = True
            belt = _drawn(_without(belt, worst))
            continue
        if not belt.pinned.any():
            break
        laid = _pins_laid(belt)
        if np.abs(laid.centre - belt.centre).max() < 1e-9:
            break
        belt = laid
    return belt


def moved(belt: Belt, disc: int, by: Floats) -> Belt:
    """The belt with one free disc moved by (2,) metres."""
    centre = belt.centre.copy()
    centre[disc] += by
    return tight(replace(belt, centre=centre))


def inserted(belt: Belt, at: int, contact: Floats, heading: float, sense: float) -> Belt:
    """The belt with a disc more, before disc ``at``, touching ``contact`` where the way there is ``heading``."""
    normal = sense * belt.radius_m * np.array([-math.sin(heading), math.cos(heading)])
    return tight(
        replace(
            belt,
            centre=np.insert(belt.centre, at, contact + normal, axis=0),
            sense=np.insert(belt.sense, at, sense),
            pin=np.insert(belt.pin, at, np.nan, axis=0),
            pin_m=np.insert(belt.pin_m, at, np.nan),
        )
    )


def without(belt: Belt, disc: int) -> Belt:
    """The belt without one disc."""
    gone = np.zeros(len(belt.sense), bool)
    gone[disc] = True
    return tight(_without(belt, gone))


def unlooped(belt: Belt) -> Belt:
    """The belt without free discs that it goes more than half round, as long as there are any."""
    while belt.gap_m == 0.0:
        loops = (belt.turn > math.pi) & ~belt.pinned
        if not loops.any():
            break
        belt = without(belt, int(np.argmax(np.where(loops, belt.turn, 0.0))))
    return belt


def outline(belt: Belt) -> Outline:
    """The belt as chords, each at most `CHORD_M` inside its arc."""
    size = 2
    step = 2.0 * math.acos(max(1.0 - CHORD_M / belt.radius_m, 0.5))
    most = math.radians(MOST_DEG)
    for turn in belt.turn:
        size += 4 * (math.ceil(abs(turn) / most) + 2) + 2 * math.ceil(abs(turn) / step) + 8
    points, true_m, widen = np.empty((size, 2)), np.empty(size), np.zeros(size)
    arcs, corners = np.empty((size, 3), np.int64), np.empty((size, 2))
    disc, pin_at = np.empty(size, np.int64), np.full(len(belt.sense), -1, np.int64)
    n, turns = _outline(
        belt.ends, belt.radius_m, belt.centre, belt.sense, belt.pin, belt.heading, belt.turn, step, most,
        points, true_m, widen, arcs, corners, disc, pin_at,
    )  # fmt: skip
    points = points[:n].copy()
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    touched = pin_at >= 0
    return Outline(
        points, s, true_m[:n].copy(), arcs[:turns].copy(), corners[:turns].copy(), widen[1:n].copy(),
        disc[:turns].copy(), pin_at[touched], belt.pin_m[touched],
    )  # fmt: skip


def _headings(points: Floats) -> Floats:
    d = np.diff(points, axis=0)
    return np.arctan2(d[:, 1], d[:, 0])


def _middles(heading: Floats) -> Floats:
    """(K,) half-way headings at the turns between K + 1 legs."""
    turn = np.diff(heading)
    return np.asarray(heading[:-1] + 0.5 * ((turn + math.pi) % (2.0 * math.pi) - math.pi))


def _without(belt: Belt, gone: NDArray[np.bool_]) -> Belt:
    keep = ~gone
    return replace(
        belt, centre=belt.centre[keep], sense=belt.sense[keep], pin=belt.pin[keep], pin_m=belt.pin_m[keep]
    )  # fmt: skip


def _drawn(belt: Belt, *, parted: bool = False) -> Belt:
    count = len(belt.sense)
    heading, turn, centre = np.empty(count + 1), np.empty(count), belt.centre.copy()
    gap = _tangents(belt.ends, belt.radius_m, centre, belt.sense, heading, turn)
    if parted and gap > 0.0:
        for _ in range(4 * ROUNDS):
            _part(belt.ends, belt.radius_m, centre, belt.sense, belt.pinned)
            gap = _tangents(belt.ends, belt.radius_m, centre, belt.sense, heading, turn)
            if gap == 0.0:
                break
    return replace(belt, centre=centre, heading=heading, turn=turn, gap_m=gap)


def _pins_laid(belt: Belt) -> Belt:
    """Pinned discs laid through their pins again, half-way between the legs; on the other side where it turns so."""
    if belt.gap_m > 0.0:
        return belt
    sense = np.where(belt.pinned & (belt.turn < 0.0), -belt.sense, belt.sense)
    # A turn of more than half a circle goes on in its own sense, so its middle is not the nearer one.
    middle = belt.heading[:-1] + 0.5 * belt.sense * belt.turn
    normal = np.stack([-np.sin(middle), np.cos(middle)], axis=-1)
    centre = np.where(belt.pinned[:, None], belt.pin + belt.radius_m * sense[:, None] * normal, belt.centre)
    return _drawn(replace(belt, centre=centre, sense=sense))


@njit(cache=True)
def _tangents(ends: Floats, radius: float, centre: Floats, sense: Floats, heading: Floats, turn: Floats) -> float:
    """Headings of the legs and turns between them, in place; how much too close neighbours are."""
    n = len(sense)
    gap = 0.0
    for k in range(n + 1):
        if k == 0:
            ax, ay, sa = ends[0, 0], ends[0, 1], 0.0
        else:
            ax, ay, sa = centre[k - 1, 0], centre[k - 1, 1], sense[k - 1]
        if k == n:
            bx, by, sb = ends[1, 0], ends[1, 1], 0.0
        else:
            bx, by, sb = centre[k, 0], centre[k, 1], sense[k]
        dx, dy = bx - ax, by - ay
        d = math.hypot(dx, dy)
        across = (sb - sa) * radius
        if abs(across) > d:
            gap += abs(across) - d
            across = math.copysign(d, across)
        heading[k] = math.atan2(dy, dx) - (math.asin(across / d) if d > 0.0 else 0.0)
    for k in range(n):
        t = sense[k] * (heading[k + 1] - heading[k])
        # Between a quarter of a circle the wrong way (the disc is not touched) and three the right way.
        turn[k] = (t + 0.5 * math.pi) % (2.0 * math.pi) - 0.5 * math.pi
    return gap


@njit(cache=True)
def _part(ends: Floats, radius: float, centre: Floats, sense: Floats, fixed: NDArray[np.bool_]) -> None:
    """Push neighbours apart that are too close for a tangent, in place."""
    n = len(sense)
    for k in range(n + 1):
        first, last = k == 0, k == n
        if first and last:
            continue
        need = radius if first or last else abs(sense[k] - sense[k - 1]) * radius
        need *= 1.0 + 1e-6
        a = ends[0] if first else centre[k - 1]
        b = ends[1] if last else centre[k]
        dx, dy = b[0] - a[0], b[1] - a[1]
        d = math.hypot(dx, dy)
        if d >= need:
            continue
        if d < 1e-6:
            dx, dy, d = 1.0, 0.0, 1.0
        by = need - d
        hold_a, hold_b = first or fixed[k - 1], last or fixed[k]
        if not hold_a:
            part = by if hold_b else 0.5 * by
            centre[k - 1, 0] -= part * dx / d
            centre[k - 1, 1] -= part * dy / d
        if not hold_b:
            part = by if hold_a else 0.5 * by
            centre[k, 0] += part * dx / d
            centre[k, 1] += part * dy / d


@njit(cache=True)
def _outline(
    ends: Floats, radius: float, centre: Floats, sense: Floats, pin: Floats, heading: Floats, turn: Floats,
    step: float, most: float, points: Floats, true_m: Floats, widen: Floats, arcs: Ints, corners: Floats,
    disc: Ints, pin_at: Ints,
) -> tuple[int, int]:  # fmt: skip
    """Fills the arrays of `Outline` (widen[i] belongs to the chord that ends in point i); points, turns."""
    points[0] = ends[0]
    true_m[0] = 0.0
    n, turns = 1, 0
    for k in range(len(sense)):
        whole = turn[k]
        if whole <= 0.0:
            continue
        # From the centre, the arc begins at this angle and runs by ``sense``.
        begin = heading[k] - sense[k] * 0.5 * math.pi
        x = centre[k, 0] + radius * math.cos(begin)
        y = centre[k, 1] + radius * math.sin(begin)
        way = math.hypot(x - points[n - 1, 0], y - points[n - 1, 1])
        if way > 1e-6:
            points[n, 0], points[n, 1] = x, y
            true_m[n] = true_m[n - 1] + way
            n += 1
        cut = -1.0
        if pin[k, 0] == pin[k, 0]:
            t = sense[k] * (math.atan2(pin[k, 1] - centre[k, 1], pin[k, 0] - centre[k, 0]) - begin)
            cut = (t + 0.5 * math.pi) % (2.0 * math.pi) - 0.5 * math.pi
            cut = min(max(cut, 0.0), whole)
        for part in range(2):
            if part == 0:
                t0, t1 = 0.0, whole if cut < 0.0 else cut
            elif cut < 0.0:
                break
            else:
                t0, t1 = cut, whole
                pin_at[k] = n - 1
            if t1 - t0 <= 1e-12:
                continue
            pieces = max(1, math.ceil((t1 - t0) / most))
            for piece in range(pieces):
                u0 = t0 + (t1 - t0) * piece / pieces
                u1 = t0 + (t1 - t0) * (piece + 1) / pieces
                half = 0.5 * (u1 - u0)
                chords = max(1, math.ceil(half / step))
                arcs[turns, 0] = n - 1
                arcs[turns, 1] = n - 1 + chords
                arcs[turns, 2] = n - 1 + 2 * chords
                for c in range(1, 2 * chords + 1):
                    at = begin + sense[k] * (u0 + half * c / chords)
                    points[n, 0] = centre[k, 0] + radius * math.cos(at)
                    points[n, 1] = centre[k, 1] + radius * math.sin(at)
                    true_m[n] = true_m[n - 1] + radius * half / chords
                    widen[n] = CHORD_M
                    n += 1
                at = begin + sense[k] * (u0 + half)
                out = radius / math.cos(half)
                corners[turns, 0] = centre[k, 0] + out * math.cos(at)
                corners[turns, 1] = centre[k, 1] + out * math.sin(at)
                disc[turns] = k
                turns += 1
        if cut >= 0.0:
            points[pin_at[k]] = pin[k]
    way = math.hypot(ends[1, 0] - points[n - 1, 0], ends[1, 1] - points[n - 1, 1])
    if way > 1e-6:
        points[n] = ends[1]
        true_m[n] = true_m[n - 1] + way
        n += 1
    else:
        points[n - 1] = ends[1]
    return n, turns
