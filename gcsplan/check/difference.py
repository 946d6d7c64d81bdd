"""The difference of two missions of one vehicle: how far legs moved, what else changed, what the earlier one breaks.

Both are verdicts of the same world, so that a limit or a zone that is new shows in the earlier mission, too. A leg has
moved by the distance of its farthest point from the line that the earlier mission flies, in space.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.notes.note import IN_FILES, Note, Wording, in_json
from gcsplan.units import Joules, Quantity, Seconds, Units
from gcsplan.world.geodesy.frame import Frame

UNMOVED_M = 0.5
"""A leg within this distance of the earlier line, m, has not moved."""
WITHIN_M = 0.05
"""How exactly the distance of a leg is found, m."""
MOST_MEASURED = 50_000_000
"""Most pairs of moved stretches of both missions that are measured, which takes some seconds."""


MOST_MOVED = 8
"""Most moved legs, and most faults of the earlier mission, that are named."""

FIGURES: tuple[tuple[str, str, Callable[[float], Quantity | Seconds | Joules]], ...] = (
    ("length", "length_m", lambda value: Quantity(value, "path", 0)),
    ("lowest above ground", "min_agl_m", lambda value: Quantity(value, "height", 1, "down")),
    ("highest above ground", "max_agl_m", lambda value: Quantity(value, "height", 1, "up")),
    ("nearest zone", "zone_clearance_m", lambda value: Quantity(value, "distance", 1, "down")),
    ("at its goal", "arrive_s", Seconds),
    ("energy of the flight", "flight_energy_j", Joules),
)
"""Each figure that is compared: its name, its key, and how it is written."""


@dataclass(frozen=True, slots=True)
class MovedLeg:
    """A leg, by its wire item, that moved by ``by_m``, metres."""

    seq: int
    kind: str
    by_m: float


@dataclass(frozen=True, slots=True)
class PlanDifference:
    """What changed for one vehicle since an earlier mission, which ``since`` names.

    ``moved``: the legs of the new mission that moved; None if they are too many to measure. ``left_m``: how far the
    earlier line is from the new one at most. ``before`` and ``after`` have figures by name, in SI, None where there is
    none. ``new`` and ``gone`` are notes; ``breaks`` says what the earlier mission breaks now.
    """

    name: str
    since: str
    equal: bool
    legs: int
    moved: tuple[MovedLeg, ...] | None
    left_m: float | None
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]
    new: tuple[Note, ...] = ()
    gone: tuple[Note, ...] = ()
    breaks: tuple[Note, ...] = ()

    @property
    def headline(self) -> Note:
        """What moved, in a sentence."""
        if self.equal:
            return Note("difference_none", since=self.since)
        if self.moved is None or self.left_m is None:
            return Note("difference_not_measured", since=self.since)
        most_m = max([self.left_m, *(leg.by_m for leg in self.moved)])
        if most_m <= UNMOVED_M:
            return Note("difference_of_items", since=self.since)
        return Note("difference_of_path", since=self.since, moved=len(self.moved), legs=self.legs, most_m=most_m)

    def rows(self, units: Units) -> list[tuple[str, str, str, str]]:
        """The figures for people: name, before, now and change, each with its unit; without figures that both lack."""
        rows = []
        for name, figure, words in FIGURES:
            before, after = self.before.get(figure), self.after.get(figure)
            if before is None and after is None:
                continue
            known = [None if value is None else words(value).text(units) for value in (before, after)]
            change = ""
            if before is not None and after is not None:
                by = words(abs(after - before)).text(units)
                change = "the same" if known[0] == known[1] else f"{'+' if after > before else '−'}{by}"
            rows.append((name, known[0] or "–", known[1] or "–", change))
        return rows

    def remarks(self) -> list[Note]:
        """What the table does not say: the legs that moved farthest, new and gone notes, what the earlier breaks."""
        moved = sorted(self.moved or (), key=lambda leg: leg.by_m, reverse=True)
        legs = [Note("moved_leg", leg.seq, way=leg.kind, by_m=leg.by_m) for leg in moved[:MOST_MOVED]]
        if len(moved) > MOST_MOVED:
            legs.append(Note("more_moved_legs", count=len(moved) - MOST_MOVED))
        return [
            *([Note("difference_moved_legs", legs=tuple(legs))] if legs else []),
            *(Note("difference_new_note", note=note) for note in self.new),
            *(Note("difference_gone_note", note=note) for note in self.gone),
            *(Note("difference_earlier_breaks", since=self.since, note=note) for note in self.breaks[:MOST_MOVED]),
        ]

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """The difference for programs, in SI."""
        return {
            "since": self.since,
            "headline": self.headline.text(wording),
            "equal": self.equal,
            "legs": self.legs,
            "moved": None
            if self.moved is None
            else [{"seq": leg.seq, "kind": leg.kind, "by_m": leg.by_m} for leg in self.moved],
            "left_m": self.left_m,
            "before": dict(self.before),
            "after": dict(self.after),
            **in_json("new_notes", self.new, wording),
            **in_json("gone_notes", self.gone, wording),
            **in_json("earlier_breaks", self.breaks, wording),
        }


def figures_of(verdict: Verdict, arrive_s: float | None = None) -> dict[str, float | None]:
    """The figures that are compared, by name; ``arrive_s``: where a time table decides it."""
    lowest, highest, nearest = verdict.lowest, verdict.highest, verdict.nearest
    return {
        "length_m": verdict.length_m,
        "min_agl_m": None if lowest is None else lowest.min_agl_m,
        "max_agl_m": None if highest is None else highest.max_agl_m,
        "zone_clearance_m": None if nearest is None else nearest.zone_clearance_m,
        "arrive_s": verdict.arrive_s if arrive_s is None else arrive_s,
        "flight_energy_j": verdict.reported_j(verdict.energy_j),
    }


def moved_legs(before: Verdict, after: Verdict, frame: Frame) -> tuple[tuple[MovedLeg, ...] | None, float | None]:
    """The legs of ``after`` that moved, and how far the line of ``before`` is from that of ``after`` at most, metres.

    None for both where one flies nothing, or where more than `MOST_MEASURED` would have to be measured.
    """
    old, new = lines_of(before.legs, frame), lines_of(after.legs, frame)
    if not len(old) or not len(new):
        return None, None
    kept, left = _in(new, old), _in(old, new)
    if int((~kept).sum()) * len(old) + int((~left).sum()) * len(new) > MOST_MEASURED:
        return None, None
    away_m = np.zeros(len(new))
    away_m[~kept] = [farthest_m(line, old) for line in new[~kept]]
    by_item: dict[tuple[int, str], float] = {}
    for leg, by_m in zip(after.legs, away_m.tolist(), strict=True):
        by_item[leg.seq, leg.kind] = max(by_m, by_item.get((leg.seq, leg.kind), 0.0))
    moved = tuple(MovedLeg(seq, kind, by_m) for (seq, kind), by_m in by_item.items() if by_m > UNMOVED_M)
    return moved, max((farthest_m(line, new) for line in old[~left]), default=0.0)


def lines_of(legs: Sequence[LegFigures], frame: Frame) -> Floats:
    """The stretches (N, 2, 3): begin and end of each, east, north and AMSL metres."""
    places = np.array([[leg.start, leg.end] for leg in legs], float).reshape(-1, 2, 3)
    plane = frame.to_plane(places[..., 0].ravel(), places[..., 1].ravel()).reshape(-1, 2, 2)
    return np.concatenate([plane, places[..., 2:]], axis=-1)


def farthest_m(line: Floats, others: Floats) -> float:
    """The greatest distance of a point of ``line`` (2, 3) from the nearest of ``others`` (N, 2, 3), within `WITHIN_M`.

    The distance from one straight line is convex along another one: over a part of ``line`` it is greatest at an end.
    So no point of the part is farther from all of ``others`` than the least of these. A part that can hold no better
    point than the best so far is left; of the others only those go on that may be nearest to a point of the part.
    """
    begin, step = line[0], line[1] - line[0]
    length_m = float(np.linalg.norm(step))
    low_m, high_m = distances_m(begin, others), distances_m(line[1], others)
    best_m = max(float(low_m.min()), float(high_m.min()))
    parts = [(0.0, 1.0, others, low_m, high_m)]
    while parts:
        low, high, near, low_m, high_m = parts.pop()
        if float(np.maximum(low_m, high_m).min()) <= best_m + WITHIN_M:
            continue
        middle, half_m = 0.5 * (low + high), 0.5 * (high - low) * length_m
        middle_m = distances_m(begin + middle * step, near)
        here_m = float(middle_m.min())
        best_m = max(best_m, here_m)
        if half_m > WITHIN_M:
            kept = middle_m <= here_m + 2.0 * half_m
            near, middle_m = near[kept], middle_m[kept]
            parts += [(low, middle, near, low_m[kept], middle_m), (middle, high, near, middle_m, high_m[kept])]
    return best_m


def distances_m(point: Floats, lines: Floats) -> Floats:
    """The distance of ``point`` (3,) from each of the straight ``lines`` (N, 2, 3)."""
    begin, step = lines[:, 0], lines[:, 1] - lines[:, 0]
    square = np.einsum("ij,ij->i", step, step)
    along = np.einsum("ij,ij->i", point - begin, step) / np.where(square > 0.0, square, 1.0)
    foot = begin + np.clip(along, 0.0, 1.0)[:, None] * step
    return np.asarray(np.linalg.norm(point - foot, axis=1))


def _in(lines: Floats, others: Floats) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Which of ``lines`` are among ``others``, to a centimetre: most legs of a plan that is changed stay."""
    known = {key.tobytes() for key in np.round(others * 100.0).astype(np.int64)}
    return np.array([key.tobytes() in known for key in np.round(lines * 100.0).astype(np.int64)], bool)
