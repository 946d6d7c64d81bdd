"""The list of zones of a mission file or of zone files, as they were read, before anything is planned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.load import read_no_fly
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.published.times import hours_of, texts_of
from gcsplan.mission_file.published.unused import listed
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import ZoneDraft, zone_notes
from gcsplan.mission_file.zones.file import Ignorable, OnBad
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Level

WIDEST_DEG = 160.0
"""No plane holds a zone that is wider, degrees of longitude."""

MISSIONS = (".yaml", ".yml")


@dataclass(frozen=True, slots=True)
class ListedZone:
    """One zone as it was read; ``source`` is its place in the user's file."""

    name: str
    shape: Literal["circle", "polygon", "corridor"]
    extent_m: tuple[float, float] | None
    """From its west to its east and from its south to its north end; None if it is too large for one plane."""
    radius_m: float | None
    buffer_m: float | None
    length_m: float | None
    corners: int
    floor: Level | None
    ceiling: Level | None
    source: str
    keep_in: bool = False
    """Whether it is an area to stay in, and no no-fly zone."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON: sizes in metres, floor and ceiling under the keys of a mission file."""
        levels = {
            f"{bound}_{level.datum}_m": level.value_m
            for bound, level in (("floor", self.floor), ("ceiling", self.ceiling))
            if level is not None
        }
        sizes = {"extent_m": self.extent_m, "radius_m": self.radius_m, "buffer_m": self.buffer_m,
                 "length_m": self.length_m}  # fmt: skip
        rounded = {key: np.round(value, 1).tolist() for key, value in sizes.items() if value is not None}
        kind = {"keep_in": True} if self.keep_in else {}
        return {"name": self.name, **kind, "shape": self.shape, "corners": self.corners, **rounded, **levels,
                "source": self.source}  # fmt: skip


def list_zones(
    files: Sequence[Path], at: str | None = None, *, on_bad: OnBad | None = None, ignore: Sequence[Ignorable] = ()
) -> tuple[list[ListedZone], list[Note]]:
    """The no-fly zones of mission files (.yaml) and of zone files, and the notes on them and others. Raises InputError.

    ``at``: zones that do not apply then are not listed, but named. ``on_bad`` and ``ignore`` are the rules for zone
    files; a mission file has its own.
    Zones that are too far from a mission to matter are listed, too: a mission's places are not read.
    """
    drafts: list[ZoneDraft] = []
    notes: list[Note] = []
    wrong: list[Mistake] = []
    texts = texts_of(at)
    hours = hours_of(None, None, "--at", wrong, instead=texts)
    policy = Policy(hours=hours, where="--zones", on_bad=on_bad, ignore=tuple(ignore))
    mission = next((file for file in files if file.suffix.lower() in MISSIONS), None)
    if mission is not None and (on_bad or ignore):
        option = "--on-bad" if on_bad else "--ignore"
        wrong.append(Mistake(option, f"is for files of zones; write it into {mission}, beside each `file`"))
    if wrong:
        raise InputError.of(wrong)
    for file in files:
        if file.suffix.lower() in MISSIONS:
            own, found_notes = read_no_fly(file, texts)
        else:
            found = read_zones(file, where=str(file), policy=policy)
            if found.problems:
                raise InputError.of(found.problems)
            own, found_notes = found.zones, [*found.notes]
        drafts += own
        notes += found_notes
    drafts, more = listed(drafts)
    return [_listed(draft) for draft in drafts], [*notes, *more, *zone_notes([(draft, None) for draft in drafts])]


def _listed(draft: ZoneDraft) -> ListedZone:
    shape: Literal["circle", "polygon", "corridor"] = (
        "circle" if draft.radius_m is not None else "corridor" if draft.buffer_m is not None else "polygon"
    )
    points = _in_plane(draft)
    whole = bool(np.isfinite(points).all())
    around_m = draft.radius_m or draft.buffer_m or 0.0
    east_m, north_m = np.ptp(points, axis=0) + 2.0 * around_m
    length_m = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return ListedZone(
        draft.name, shape, (float(east_m), float(north_m)) if whole else None, draft.radius_m, draft.buffer_m,
        length_m if shape == "corridor" and whole else None, len(draft.points), draft.floor, draft.ceiling, draft.where,
        draft.keep_in,
    )  # fmt: skip


def _in_plane(draft: ZoneDraft) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(N, 2) metres on a plane of the zone's own, with its middle as the origin."""
    points = np.asarray(draft.points, float)
    if draft.local:
        return points
    lat = points[:, 0]
    west, east = float(points[:, 1].min()), float(points[:, 1].max())
    if east - west > WIDEST_DEG:
        return np.full_like(points, np.nan)
    middle = min(max(0.5 * float(lat.min() + lat.max()), -85.0), 85.0), math.remainder(0.5 * (west + east), 360.0)
    return Frame(*middle).to_plane(lat, points[:, 1])
