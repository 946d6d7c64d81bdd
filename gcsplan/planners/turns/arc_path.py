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
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.turns.kernels import CHORD_M, fill_outline, part_neighbours, tangents

Ints = NDArray[np.int64]

MOST_DEG = 100.0
"""Largest turn at one way point."""

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
    n = fill_outline(
        belt.ends, belt.radius_m, belt.centre, belt.sense, belt.pin, belt.heading, belt.turn, step, most,
        points, true_m, widen, arcs, corners, disc, pin_at,
    )  # fmt: skip
    points, turns = points[:n].copy(), int(disc[-1])
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
    gap = np.empty(1)
    tangents(belt.ends, belt.radius_m, centre, belt.sense, heading, turn, gap)
    if parted and gap[0] > 0.0:
        for _ in range(4 * ROUNDS):
            part_neighbours(belt.ends, belt.radius_m, centre, belt.sense, belt.pinned)
            tangents(belt.ends, belt.radius_m, centre, belt.sense, heading, turn, gap)
            if gap[0] == 0.0:
                break
    return replace(belt, centre=centre, heading=heading, turn=turn, gap_m=float(gap[0]))


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
