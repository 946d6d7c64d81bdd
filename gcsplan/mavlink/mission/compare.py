"""Comparison of a read-back list with the sent one, by wire integers and float32, after the autopilot's own rounding.

A number is right if it equals what the autopilot is known to store (`autopilots.stored`) or what was sent (some peers
store everything). Anything else is a `Difference`, also for unknown commands. ArduPilot's item 0 is the vehicle's own
home: a difference there is reported but excused.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.commands import command_name
from gcsplan.mavlink.mission.mission import FRAME_SYNONYMS, MISSION, MissionItem
from gcsplan.mavlink.mission.stored_ardupilot import read_back_altitudes, stored_cm
from gcsplan.mavlink.mission.stored_px4 import YAW_COMMANDS
from gcsplan.vehicle import Autopilot

YAW_TOLERANCE_DEG = 1e-3


@dataclass(frozen=True, slots=True)
class Difference:
    """One number that differs from the expected one; ``seq`` is -1 for the list as a whole.

    ``excused``: harmless and reported nevertheless (the vehicle's own home, a position within a tolerance). ``unsent``:
    nothing was sent, and ``sent`` is what the file has.
    """

    seq: int
    field: str
    sent: str
    expected: str
    read: str
    what: str = ""
    excused: bool = False
    unsent: bool = False

    def __str__(self) -> str:
        place = f"item {self.seq} ({self.what})" if self.seq >= 0 else "the list"
        if self.excused and self.field == "home":
            return f"{place}: {self.field} is the vehicle's own, {self.read}; planned {self.sent}"
        kept = "" if self.expected == self.sent else f" (kept as {self.expected})"
        within = ", within the tolerance" if self.excused else ""
        if self.unsent:
            return f"{place}: {self.field}: the file has {self.sent}{kept}, on board is {self.read}{within}"
        return f"{place}: {self.field}: sent {self.sent}{kept}, read back {self.read}{within}"


def compare(
    sent: Sequence[MissionItem], read: Sequence[MissionItem], autopilot: Autopilot, mission_type: int = MISSION
) -> list[Difference]:
    """Return every difference between a sent list and its read-back, in wire order; `faults` drops excused ones."""
    found: list[Difference] = []
    if len(sent) != len(read):
        count = str(len(sent))
        found.append(Difference(-1, "number of items", count, count, str(len(read))))
    for seq, (ours, theirs) in enumerate(zip(sent, read, strict=False)):
        if seq == 0 and autopilot.is_ardupilot and mission_type == MISSION:
            found += _home(ours, theirs)
        else:
            found += _item(seq, ours, theirs, autopilot, mission_type)
    return found


def faults(differences: Iterable[Difference]) -> tuple[Difference, ...]:
    """Return the differences that are not excused; none means that the list on board is the one that was sent."""
    return tuple(d for d in differences if not d.excused)


def _home(ours: MissionItem, theirs: MissionItem) -> list[Difference]:
    if (ours.x, ours.y) == (theirs.x, theirs.y) and theirs.z in (ours.z, *read_back_altitudes(stored_cm(ours.z))):
        return []
    planned, own = (f"{i.lat_deg:.7f}, {i.lon_deg:.7f}, {i.z:.2f} m" for i in (ours, theirs))
    return [Difference(0, "home", planned, planned, own, "home", excused=True)]


def _item(
    seq: int, ours: MissionItem, theirs: MissionItem, autopilot: Autopilot, mission_type: int
) -> list[Difference]:
    if ours.command != theirs.command:
        names = [f"{item.command} ({command_name(item.command)})" for item in (ours, theirs)]
        return [Difference(seq, "command", names[0], names[0], names[1], command_name(ours.command))]
    kept = profile_of(autopilot).stored(ours)
    found: list[Difference] = []

    def differ(field: str, sent: str, expected: str, got: str) -> None:
        found.append(Difference(seq, field, sent, expected, got, command_name(ours.command)))

    frames = [FRAME_SYNONYMS.get(item.frame, item.frame) for item in (ours, kept, theirs)]
    if frames[2] not in frames[:2]:
        differ("frame", *map(str, frames))
    for i in range(4):
        values = (ours.params[i], kept.params[i], theirs.params[i])
        turning = i == 3 and autopilot is Autopilot.PX4 and ours.command in YAW_COMMANDS
        if not (_same(values[2], values[0]) or _same(values[2], values[1]) or (turning and _same_yaw(*values[1:]))):
            differ(f"param{i + 1}", *map(_number, values))
    for field, *whole in (("latitude", ours.x, kept.x, theirs.x), ("longitude", ours.y, kept.y, theirs.y)):
        if whole[2] not in whole[:2]:
            differ(field, *(f"{value / 1e7:.7f}" for value in whole))
    if not any(_same(theirs.z, z) for z in (ours.z, *_altitudes(ours, kept, autopilot))):
        differ("altitude", _number(ours.z), _number(kept.z), _number(theirs.z))
    if mission_type == MISSION and theirs.autocontinue not in (ours.autocontinue, kept.autocontinue):
        differ("autocontinue", str(ours.autocontinue), str(kept.autocontinue), str(theirs.autocontinue))
    return found


def _altitudes(ours: MissionItem, kept: MissionItem, autopilot: Autopilot) -> tuple[float, ...]:
    """Return the float32 altitudes that may read back: ArduPilot's versions convert centimetres in two ways."""
    if autopilot.is_ardupilot and kept.z == read_back_altitudes(stored_cm(ours.z))[0]:
        return read_back_altitudes(stored_cm(ours.z))
    return (kept.z,)


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))


def _same_yaw(a: float, b: float) -> bool:
    return abs((a - b + 180.0) % 360.0 - 180.0) <= YAW_TOLERANCE_DEG  # NaN compares False


def _number(value: float) -> str:
    return f"{value:.9g}"
