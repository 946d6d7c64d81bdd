"""`.waypoints` files ("QGC WPL 110"): written for the strictest reader, read in every variant that programs write.

Written: TABs, LF, home as row 0 for every autopilot, exact numbers, no comments. Also read: spaces and commas, CRLF, a
byte order mark, blank lines and ``#`` comments (Mission Planner), six decimals and ``nan`` params (MAVProxy,
pymavlink's mavwp), the old header 120 without a home row (QGroundControl). In version 110, QGroundControl and
ArduPilot treat row 0 as home and would silently lose a real item there, so a file that begins with one is refused.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator

from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.files.file_items import (
    MAX_FILE_BYTES,
    MAX_ITEMS,
    MissionFileRead,
    RawItem,
    check_writable,
    degrees_e7_of,
    degrees_text,
    float32_text,
    in_degrees,
    jumps_from_file,
    jumps_to_file,
    read_item,
    whole,
)
from gcsplan.mavlink.mission.commands import (
    CIRCLE_IN,
    CIRCLE_OUT,
    FENCE_RETURN_POINT,
    POLYGON_IN,
    POLYGON_OUT,
    RALLY_POINT,
    WAYPOINT,
)
from gcsplan.mavlink.mission.mission import FRAME_SYNONYMS, GLOBAL, Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

HEADER = "QGC WPL 110"
ROW_COLUMNS = (
    "seq",
    "current",
    "frame",
    "command",
    "param1",
    "param2",
    "param3",
    "param4",
    "x",
    "y",
    "z",
    "autocontinue",
)
COMMANDS_OF_OTHER_LISTS = frozenset({FENCE_RETURN_POINT, POLYGON_IN, POLYGON_OUT, CIRCLE_IN, CIRCLE_OUT, RALLY_POINT})
MAX_LINE = 1000
MAX_NUMBER = 64
MAX_PROBLEMS = 20
HOME_ROW = "0 1 0 16 0 0 0 0 <lat> <lon> <AMSL> 1"

# No two parts of the pattern can match the same digits, so a long run of digits takes only one pass.
_ROW_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SPLIT = re.compile(r"[\t ,]+")
_ROW = re.compile(rf"{_ROW_NUMBER.pattern}(?:[\t ,]+{_ROW_NUMBER.pattern}){{11}}")


def write_waypoints(mission: Mission) -> str:
    """Return the text of a `.waypoints` file, from which `read_waypoints` returns the same mission.

    DO_JUMP targets are the file's own row numbers. Raises InputError for what the format cannot express, above all NaN:
    for example, a NaN yaw ("keep the heading") must be replaced by a number before.
    """
    check_writable(mission, nan=False)
    home = mission.home
    rows = [(0, 1, GLOBAL, WAYPOINT, "0", "0", "0", "0", degrees_text(home.lat_e7), degrees_text(home.lon_e7),
             _float64_text(home.amsl_m), 1)]  # fmt: skip
    for row, item in enumerate(jumps_to_file(mission), start=1):
        params = [float32_text(p) for p in item.params]
        xy = degrees_text if in_degrees(item.command, item.frame) else str
        frame = FRAME_SYNONYMS.get(item.frame, item.frame)
        rows.append(
            (row, 0, frame, item.command, params[0], params[1], params[2], params[3], xy(item.x), xy(item.y),
             float32_text(item.z), int(item.autocontinue))
        )  # fmt: skip
    return "\n".join([HEADER, *("\t".join(map(str, row)) for row in rows)]) + "\n"


def _float64_text(value: float) -> str:
    # Home's altitude is the only number of a mission that is not a float32, so all its digits are kept.
    return repr(float(value)).removesuffix(".0")


def read_waypoints(text: str, *, autopilot: Autopilot, where: str, home_hint: Home | None = None) -> Mission:
    """Return the mission in ``text``; see `parse_waypoints`."""
    return parse_waypoints(text, autopilot=autopilot, where=where, home_hint=home_hint).mission


def parse_waypoints(text: str, *, autopilot: Autopilot, where: str, home_hint: Home | None = None) -> MissionFileRead:
    """Return the mission in ``text`` with notes for the user.

    ``where`` names the file in messages. ``home_hint`` is the home for a file that has none (first seq 1, header 120,
    or a home row of zeros). Raises InputError with the first twenty mistakes, each with its line.
    """
    version, rows = _read_rows(text, where)
    return _mission(rows, version == "110", autopilot, where, home_hint)


def raw_items(text: str, where: str) -> list[tuple[int, RawItem]]:
    """The line and the item of every row in ``text``, of a list of any kind, home too; see `parse_waypoints`."""
    return [(row.line, row.raw) for row in _read_rows(text, where)[1]]


def _read_rows(text: str, where: str) -> tuple[str, list[_Row]]:
    """The version of the format, and the rows."""
    if len(text) > MAX_FILE_BYTES:
        raise InputError(f"a mission file of more than {MAX_FILE_BYTES // 10**6} MB is not read", where=where)
    lines = io.StringIO(text.removeprefix("\ufeff"), newline=None)
    header = lines.readline(MAX_LINE).split()
    if header not in (["QGC", "WPL", "110"], ["QGC", "WPL", "120"]):
        raise InputError(
            f"the first line of a .waypoints file must be '{HEADER}' (or '… 120'), given {' '.join(header)[:40]!r}",
            where=f"{where}:1",
        )
    problems: list[Mistake] = []
    rows = list(_rows(lines, where, problems))
    if problems:
        raise InputError.of(problems, headline=f"{where} is damaged" if len(problems) > 1 else "")
    return header[2], rows


class _Row:
    """One row: its line number in the file, seq, numbers, and the number of decimals of latitude and longitude."""

    __slots__ = ("decimals", "line", "raw", "seq")

    def __init__(self, line: int, seq: int, raw: RawItem, decimals: tuple[int, int]) -> None:
        self.line, self.seq, self.raw, self.decimals = line, seq, raw, decimals


def _rows(lines: io.StringIO, where: str, problems: list[Mistake]) -> Iterator[_Row]:
    number, count, expected = 1, 0, None
    while line := lines.readline(MAX_LINE):
        number += 1
        place = f"{where}:{number}"
        if len(line) >= MAX_LINE:
            problems.append(Mistake(place, f"a line of more than {MAX_LINE} characters is not one of a mission"))
            return
        line = line.strip(" \t\n,")
        if not line or line.startswith("#"):
            continue
        if (row := _row(line, number, place, problems)) is not None:
            if expected is None and row.seq > 1:
                problems.append(Mistake(place, f"the first row must be 0 (home) or 1 (no home), given {row.seq}"))
            elif expected is not None and row.seq != expected:
                what = "the same row twice" if row.seq < expected else "rows are missing"
                problems.append(Mistake(place, f"seq must be {expected} here, given {row.seq}: {what}"))
            expected = row.seq + 1
            count += 1
            yield row
        if count > MAX_ITEMS:
            problems.append(Mistake(place, f"a mission of more than {MAX_ITEMS} items is not read"))
        if len(problems) >= MAX_PROBLEMS or count > MAX_ITEMS:
            return


def _row(line: str, number: int, place: str, problems: list[Mistake]) -> _Row | None:
    fields = _SPLIT.split(line)
    if len(fields) != len(ROW_COLUMNS):
        problems.append(Mistake(place, f"a row has {len(ROW_COLUMNS)} columns, this one has {len(fields)}"))
        return None
    values = numbers_at_once(line, fields)
    for name, field in zip(ROW_COLUMNS, fields, strict=True) if not values else ():
        if name.startswith("param") and field.lower() in ("nan", "-nan"):
            values.append(math.nan)
        elif len(field) <= MAX_NUMBER and _ROW_NUMBER.fullmatch(field) and math.isfinite(float(field)):
            values.append(float(field))
        else:
            problems.append(Mistake(place, f"{name} must be a number, given {field[:40]!r}"))
            return None
    seq, autocontinue = whole(values[0], 0, 65535), whole(values[11], 0, 1)
    if seq is None or whole(values[1], 0, 255) is None or autocontinue is None:
        problems.append(
            Mistake(place, f"seq, current and autocontinue must be whole (the last 0 or 1), given {line[:50]!r}")
        )
        return None
    p1, p2, p3, p4, x, y, z = values[4:11]
    raw = RawItem(values[3], values[2], (p1, p2, p3, p4), x, y, z, bool(autocontinue))
    return _Row(number, seq, raw, (_decimals(fields[8]), _decimals(fields[9])))


def numbers_at_once(line: str, fields: list[str]) -> list[float]:
    """The numbers of a row that holds nothing but finite ones, at once; else none."""
    if _ROW.fullmatch(line) is None or max(map(len, fields)) > MAX_NUMBER:
        return []
    values = list(map(float, fields))
    return values if all(map(math.isfinite, values)) else []


def _decimals(field: str) -> int:
    return len(field.partition(".")[2]) if "e" not in field.lower() else -1


def _mission(rows: list[_Row], has_home: bool, autopilot: Autopilot, where: str, hint: Home | None) -> MissionFileRead:
    notes: list[Note] = []
    home: Home | None = None
    if has_home and rows and rows[0].seq == 0:
        home = _home(rows[0], where)
        rows = rows[1:]
        if home.lat_e7 == home.lon_e7 == 0 and hint is not None:
            notes.append(Note("home_row_without_place"))
            home = hint
        elif home.lat_e7 == home.lon_e7 == 0:
            notes.append(Note("home_row_at_zero"))
    elif hint is not None:
        notes.append(Note("home_row_missing"))
        home = hint
    if home is None and not has_home:
        raise InputError(
            f"of a file that begins with 'QGC WPL 120' no row is home; write 'QGC WPL 110' there, '{HOME_ROW}' (TABs "
            "between) as its first row if that is not home already, and count the other rows from 1 (check takes "
            "--home)",
            where=where,
        )
    if home is None:
        raise InputError(
            f"the file has no home row, and a file without one silently loses its first real item; put '{HOME_ROW}' "
            f"(TABs between) in front and count the other rows from 1",
            where=where,
        )
    problems: list[Mistake] = []
    items: list[MissionItem] = []
    for row in rows:
        item = read_item(row.raw, problems, f"{where}:{row.line}")
        if item is not None:
            items.append(item)
        if len(problems) >= MAX_PROBLEMS:
            break
    if problems:
        raise InputError.of(problems, headline=f"{where} is damaged" if len(problems) > 1 else "")
    lists = {item.command in COMMANDS_OF_OTHER_LISTS for item in items}
    if lists == {True}:
        what = "rally points" if items[0].command == RALLY_POINT else "a fence"
        raise InputError(
            f"the file holds {what} ({len(items)} items), as Mission Planner saves them, and no mission: give the "
            "mission's own file; a fence's areas are no-fly with check --zones FILE, or no_fly: [{file: FILE}]",
            where=where,
        )
    first_seq = 1 if autopilot.is_ardupilot else 0
    index_of = {row.seq: index for index, row in enumerate(rows)}
    items_tuple = jumps_from_file(items, index_of, first_seq, where)
    placed = [r for r in rows if r.raw.x != 0.0 or r.raw.y != 0.0]
    if placed and all(row.decimals == (6, 6) for row in placed):
        notes.append(Note("six_decimals"))
    return MissionFileRead(Mission(autopilot, home, items_tuple), tuple(notes))


def _home(row: _Row, where: str) -> Home:
    raw = row.raw
    place = f"{where}:{row.line}"
    # Mission Planner writes command 0 for an unknown home.
    if raw.command not in (0, WAYPOINT) or raw.frame not in (GLOBAL, 5):
        raise InputError(
            f"row 0 must be home ('{HOME_ROW}'), given command {raw.command:g} in frame {raw.frame:g}: read as home, "
            f"it would be lost; put a home row in front and count the other rows from 1",
            where=place,
        )
    if abs(raw.x) > 90.0 or abs(raw.y) > 180.0:
        raise InputError(f"home must lie within ±90°, ±180°, given {raw.x:g}, {raw.y:g}", where=place)
    return Home(degrees_e7_of(raw.x), degrees_e7_of(raw.y), raw.z)
