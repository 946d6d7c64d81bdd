"""Positions on board that lie a little beside those of a file: how far, which programs write them so, and a tolerance.

Programs that hold degrees as fractions cut them to the wire's 1e-7° where gcsplan rounds, so that some positions are
1 cm away. A tolerance takes such a mission for the file's only if the mission on board was judged as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gcsplan.errors import UsageError
from gcsplan.mavlink.files.file_items import HAS_PLACE, in_degrees
from gcsplan.mavlink.link.session.preflight import distance_m
from gcsplan.mavlink.link.session.results import UploadResult
from gcsplan.mavlink.mission.compare import Difference
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note

CUTTING = "MAVProxy and Mission Planner"
"""Programs that cut degrees: MAVProxy's `wp_to_mission_item_int`, Mission Planner's `setWP`."""

LARGEST_TOLERANCE_M = 10.0
"""A larger tolerance, m, would take one mission for another."""


@dataclass(frozen=True, slots=True)
class Shift:
    """Items whose positions alone differ, how far the farthest is away, m, and the programs that write them so."""

    items: int
    most_m: float
    sender: str = ""

    def __str__(self) -> str:
        far = f"{self.most_m * 100:.2g} cm" if self.most_m < 0.995 else f"{self.most_m:.4g} m"
        differ = f"{self.items} items differ by up to" if self.items != 1 else "1 item differs by"
        return f"{differ} {far}" + (f", as {self.sender} write positions" if self.sender else "")


def require_tolerance(tolerance_m: float | None, *, judged: bool) -> None:
    """Refuse a tolerance that cannot be used. Raises UsageError."""
    if tolerance_m is None:
        return
    if not 0.0 < tolerance_m <= LARGEST_TOLERANCE_M:
        raise UsageError(
            f"--tolerance-m {tolerance_m:g}: give more than 0 and at most {LARGEST_TOLERANCE_M:g} m; to judge "
            "another mission that is on board, download it and check that file"
        )
    if not judged:
        raise UsageError(
            "--tolerance-m takes a mission that is not the file's, and only if it is judged safe as it is on board: "
            "give --mission MISSION.yaml, in whose world it is judged"
        )


def shift_of(sent: Mission, read: Sequence[MissionItem], faults: Sequence[Difference]) -> Shift | None:
    """How far positions are away if nothing else differs; None if something else does, or nothing."""
    ours = sent.wire_items()
    if not faults or any(f.field not in ("latitude", "longitude", "altitude") for f in faults):
        return None
    higher = {f.seq for f in faults if f.field == "altitude"}
    moved = sorted({f.seq for f in faults})
    if not all(_placed(ours[seq]) and _placed(read[seq]) for seq in moved):
        return None
    away_m = [
        math.hypot(
            distance_m(ours[seq].lat_deg, ours[seq].lon_deg, read[seq].lat_deg, read[seq].lon_deg),
            read[seq].z - ours[seq].z if seq in higher else 0.0,
        )
        for seq in moved
    ]
    if not all(map(math.isfinite, away_m)):
        return None
    pairs = list(zip(ours, read, strict=True))[sent.first_seq :]
    cut = not higher and all((b.x, b.y) == (_cut(a.x), _cut(a.y)) for a, b in pairs if _placed(a))
    return Shift(len(moved), max(away_m), CUTTING if cut else "")


def within(result: UploadResult, sent: Mission, tolerance_m: float | None) -> tuple[UploadResult, Note | None, str]:
    """The result where a shift of at most ``tolerance_m`` is excused, with a note, and what to add to an error.

    The caller's check must have judged what was read back: its failure stays one.
    """
    shift = shift_of(sent, result.read_back or (), result.faults)
    if shift is None:
        only = "; --tolerance-m is for positions alone" if tolerance_m is not None and result.faults else ""
        return result, None, only
    if tolerance_m is None:
        if shift.most_m > LARGEST_TOLERANCE_M:
            return result, None, ""
        enough_m = min(math.ceil(shift.most_m * 100.0 + 0.1) / 100.0, LARGEST_TOLERANCE_M)
        cure = f"--mission MISSION.yaml --tolerance-m {enough_m:g} judges what is on board, and takes it if it is safe"
        return result, None, f". {shift}: {cure}"
    if shift.most_m > tolerance_m:
        return result, None, f". {shift}, more than --tolerance-m {tolerance_m:g}"
    excused = tuple(replace(d, excused=True) for d in result.differences)
    result = replace(result, differences=excused, verified=result.outcome == "accepted" and result.failed_check is None)
    note = Note("positions_shifted", items=shift.items, most_m=shift.most_m, safe=result.verified)
    if shift.sender:
        note = Note("positions_cut", items=shift.items, most_m=shift.most_m, sender=shift.sender, safe=result.verified)
    return result, note, ""


def _placed(item: MissionItem) -> bool:
    """Whether the item has a position; 0, 0 stands for the place where the vehicle then is."""
    on_earth = abs(item.x) <= 900_000_000 and abs(item.y) <= 1_800_000_000
    return item.command in HAS_PLACE and in_degrees(item.command, item.frame) and bool(item.x or item.y) and on_earth


def _cut(degrees_e7: int) -> int:
    """The wire's number of a position whose degrees were cut, not rounded."""
    return int(degrees_e7 / 1e7 * 1e7)
