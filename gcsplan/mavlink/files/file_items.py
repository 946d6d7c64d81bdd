"""The part that `.waypoints` and `.plan` share: one item's numbers as text, and back, without losing a bit.

Degrees are written with enough decimals to give their wire integer exactly, params and altitudes with the fewest
digits that read back as the same float32. `read_item` validates the items of both formats.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_HALF_EVEN, Decimal

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import (
    FRAME_SYNONYMS,
    GLOBAL,
    NO_POSITION,
    RELATIVE,
    TERRAIN,
    Mission,
    MissionItem,
    float32,
)
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

MAX_FILE_BYTES = 20_000_000
"""Largest mission file that is read, in bytes."""

MAX_ITEMS = 10_000
"""Most items of a mission that is read; autopilots accept 650 to a few thousand."""

FRAMES = (GLOBAL, NO_POSITION, RELATIVE, TERRAIN)

PLAIN_XY = frozenset(
    {
        cmd.DO_SET_ROI_WPNEXT_OFFSET, cmd.DO_DIGICAM_CONFIGURE, cmd.DO_DIGICAM_CONTROL,
        cmd.DO_GIMBAL_MANAGER_PITCHYAW, cmd.USER_1, cmd.USER_2, cmd.USER_3, cmd.USER_4, cmd.USER_5,
        cmd.SCRIPT_TIME, cmd.ATTITUDE_TIME,
    }
)  # fmt: skip
"""Commands whose param5 and param6 are plain numbers in every frame (common.xml, ArduPilot's AP_Mission): region of
interest offset, camera, gimbal flags, user commands, scripts, attitude."""


HAS_PLACE = frozenset(
    {
        cmd.WAYPOINT, cmd.LOITER_UNLIM, cmd.LOITER_TURNS, cmd.LOITER_TIME, cmd.LAND, cmd.TAKEOFF,
        cmd.LOITER_TO_ALT, cmd.ARC_WAYPOINT, cmd.ROI, cmd.SPLINE_WAYPOINT, cmd.VTOL_TAKEOFF, cmd.VTOL_LAND,
        cmd.PAYLOAD_PLACE, cmd.DO_SET_HOME, cmd.DO_RETURN_PATH_START, cmd.DO_LAND_START, cmd.DO_REPOSITION,
        cmd.DO_SET_ROI_LOCATION, cmd.DO_SET_ROI,
    }
)  # fmt: skip
"""Mission commands that have a location in common.xml, so that an unset location has a meaning."""


PLAIN_FLOAT = 3e38
"""Every float32 holds a number below this."""

PLAIN_PART = 0.49
"""A product that lies within this of a whole number is rounded to it in binary arithmetic too, which is off by 2e-3 at
most."""

PLACE_IS_A_HINT = (cmd.DO_RETURN_PATH_START, cmd.DO_LAND_START)
"""Files have degrees in these even in frame 2; ground stations send the whole part, and no autopilot flies there."""


@dataclass(frozen=True, slots=True)
class MissionFileRead:
    """A mission from a file, with ``notes`` for the user.

    ``fence`` and ``rally`` are the wire items of the file's other two lists, empty if it has none; ``unread_fence``
    says what of its fence could not be read, ``other_kind`` that it is for a kind of vehicle that the check does not
    know to fly.
    """

    mission: Mission
    notes: tuple[Note, ...] = ()
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    unread_fence: Note | None = None
    other_kind: Note | None = None

    @property
    def not_judged(self) -> tuple[Note, ...]:
        """What a check of the mission leaves out because of its file."""
        return tuple(note for note in (self.unread_fence, self.other_kind) if note is not None)


def vtol_taken(mission: Mission) -> Note | None:
    """Why a mission that was only taken for a multicopter's is not judged as one: it has a VTOL's items."""
    copter = mission.autopilot is not Autopilot.ARDUPLANE
    vtol = [i.command for i in mission.items if i.command in (cmd.VTOL_TAKEOFF, cmd.VTOL_LAND, cmd.DO_VTOL_TRANSITION)]
    return Note("taken_for_no_vtol", autopilot=mission.autopilot.value, command=vtol[0]) if copter and vtol else None


def in_degrees(command: int, frame: int) -> bool:
    """Whether x and y are degrees times 1e7 and not plain numbers."""
    return FRAME_SYNONYMS.get(frame, frame) != NO_POSITION and command not in PLAIN_XY


def float32_text(value: float) -> str:
    """Return the shortest decimal text that reads back as the float32 ``value``; whole numbers have no point.

    Raises ValueError for NaN and infinity, which the text formats cannot express.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} cannot be written as a number")
    for digits in range(1, 10):
        text = f"{value:.{digits}g}"
        if float32(float(text)) == float32(value):
            break
    if "e" in text and 1e-9 <= abs(value) < 1e15:
        text = f"{Decimal(text):f}"
    return text


def degrees_text(e7: int) -> str:
    """Return the wire integer ``e7`` as exact degrees with eight decimals."""
    whole, part = divmod(abs(e7), 10**7)
    return f"{'-' if e7 < 0 else ''}{whole}.{part:07d}0"


def degrees_e7_of(degrees: float) -> int:
    """Return the wire integer of degrees from a file, rounded half to even in decimal arithmetic.

    Binary arithmetic could round a decimal half the wrong way. ``degrees`` is finite and below 1e6.
    """
    binary = degrees * 1e7
    near = round(binary)
    if abs(binary - near) < PLAIN_PART:
        return near
    return int(Decimal(repr(degrees)).scaleb(7).to_integral_value(ROUND_HALF_EVEN))


@dataclass(frozen=True, slots=True)
class RawItem:
    """An item as it stands in a file: numbers in the file's own units, not yet validated. NaN means "not set"."""

    command: float
    frame: float
    params: tuple[float, float, float, float]
    x: float
    y: float
    z: float
    autocontinue: bool


def whole(value: float, low: int, high: int) -> int | None:
    """Return ``value`` as an integer if it is whole and within [low, high]; else None."""
    return int(value) if math.isfinite(value) and value == math.floor(value) and low <= value <= high else None


def read_item(raw: RawItem, problems: list[Mistake], where: str) -> MissionItem | None:
    """Return the wire item of ``raw`` with frame synonyms replaced; or None, and add every mistake to ``problems``."""
    before = len(problems)

    def bad(message: str) -> None:
        problems.append(Mistake(where, message))

    command = whole(raw.command, 0, 65535)
    if command is None:
        bad(f"the command must be a whole number from 0 to 65535, given {raw.command:g}")
    frame = whole(raw.frame, 0, 255)
    frame = FRAME_SYNONYMS.get(frame, frame) if frame is not None else None
    if frame not in FRAMES:
        bad(f"the frame must be 0 (AMSL), 2 (no place), 3 (relative to home) or 10 (terrain), given {raw.frame:g}")
    for number, value in enumerate(raw.params, start=1):
        if _too_large(value):
            bad(f"param{number} must be a number that a float32 holds, given {value:g}")
    if command is None or frame is None:
        return None
    if _too_large(raw.z) or (math.isnan(raw.z) and in_degrees(command, frame)):
        bad(f"the altitude (param7) must be a number that a float32 holds, given {raw.z:g}")
    if len(problems) > before:
        return None
    x, y = _xy(command, frame, raw, bad)
    if x is None or y is None:
        return None
    return MissionItem(command, frame, raw.params, x, y, raw.z, raw.autocontinue)


def _too_large(value: float) -> bool:
    """Whether a float32 cannot hold it. Only near the limit does this round as the wire does, which takes longer."""
    return not abs(value) < PLAIN_FLOAT and math.isinf(float32(value))


def _xy(command: int, frame: int, raw: RawItem, bad: Callable[[str], None]) -> tuple[int | None, int | None]:
    if in_degrees(command, frame):
        if not abs(raw.x) <= 90.0:
            bad(f"the latitude must lie within ±90°, given {raw.x:g}")
        elif not abs(raw.y) <= 180.0:
            bad(f"the longitude must lie within ±180°, given {raw.y:g}")
        else:
            return degrees_e7_of(raw.x), degrees_e7_of(raw.y)
        return None, None
    if command in PLACE_IS_A_HINT and abs(raw.x) <= 90.0 and abs(raw.y) <= 180.0:
        return int(raw.x), int(raw.y)
    x, y = whole(raw.x, -(2**31), 2**31 - 1), whole(raw.y, -(2**31), 2**31 - 1)
    for number, read, value in ((5, x, raw.x), (6, y, raw.y)):
        if read is None:
            bad(f"param{number} of command {command} in frame {frame} must be a whole 32-bit number, given {value:g}")
    return x, y


def check_writable(mission: Mission, *, nan: bool) -> None:
    """Raise InputError if a file cannot hold the items so that they read back the same.

    ``nan``: the format can express "not set" (.plan can, .waypoints cannot), except for an altitude.
    """
    problems: list[Mistake] = []

    def bad(message: str) -> None:
        problems.append(Mistake(mission.name, message))

    for seq, item in enumerate(mission.items, start=mission.first_seq):
        placed = in_degrees(item.command, item.frame)
        for number, value in zip((1, 2, 3, 4, 7), (*item.params, item.z), strict=True):
            if math.isinf(value) or (math.isnan(value) and (not nan or (number == 7 and placed))):
                bad(f"param{number} of item {seq} is {value:g}, which this file format cannot carry; give it a number")
        if FRAME_SYNONYMS.get(item.frame, item.frame) not in FRAMES:
            bad(f"item {seq} is in frame {item.frame}; files are written in frames 0, 2, 3 and 10")
        if placed and (abs(item.x) > 90 * 10**7 or abs(item.y) > 180 * 10**7):
            bad(f"item {seq} lies at {item.lat_deg:.7f}, {item.lon_deg:.7f}: not a place on Earth")
    home = mission.home
    if not math.isfinite(home.amsl_m):
        bad(f"the altitude of home is {home.amsl_m:g}; it must be metres AMSL")
    if abs(home.lat_e7) > 90 * 10**7 or abs(home.lon_e7) > 180 * 10**7:
        bad(f"home lies at {home.lat_e7 / 1e7:.7f}, {home.lon_e7 / 1e7:.7f}: not a place on Earth")
    if problems:
        raise InputError.of(problems)


def jumps_to_file(mission: Mission) -> tuple[MissionItem, ...]:
    """Return the items with DO_JUMP targets in the files' numbering: home is 0, the first item 1, for every autopilot.

    ArduPilot's wire numbering is the same; PX4 has no home item and counts from 0. Raises InputError for a jump to an
    item that does not exist.
    """
    first = mission.first_seq
    renumbered = {first + index: index + 1 for index in range(len(mission.items))}
    return _jumps(mission.items, renumbered, first, mission.name)


def jumps_from_file(
    items: Sequence[MissionItem], index_of: Mapping[int, int], first_seq: int, where: str
) -> tuple[MissionItem, ...]:
    """Return the items with DO_JUMP targets as wire seq; ``index_of`` maps the file's item number to the index."""
    return _jumps(items, {number: index + first_seq for number, index in index_of.items()}, first_seq, where)


def _jumps(
    items: Sequence[MissionItem], renumbered: Mapping[int, int], first_seq: int, where: str
) -> tuple[MissionItem, ...]:
    out: list[MissionItem] = []
    problems: list[Mistake] = []
    for seq, item in enumerate(items, start=first_seq):
        if item.command != cmd.DO_JUMP:
            out.append(item)
            continue
        target = whole(item.params[0], 0, 2**24)
        if target is None or target not in renumbered:
            problems.append(Mistake(where, f"item {seq} jumps to item {item.params[0]:g}, which the mission has not"))
            continue
        out.append(replace(item, params=(float(renumbered[target]), *item.params[1:])))
    if problems:
        raise InputError.of(problems)
    return tuple(out)
