"""The text of a new mission file: each of its keys with what it is, its unit and default, and the choices left."""

from __future__ import annotations

import json
import re
import shlex
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, get_args, get_origin

from gcsplan.mission_file.json_schema import LATE_DEFAULTS, MODELINE, describe
from gcsplan.mission_file.values.document import word
from gcsplan.mission_file.values.keys import Keys
from gcsplan.mission_file.values.places import read_place
from gcsplan.mission_file.values.schema import (
    EnergyKeys,
    LimitKeys,
    MissionKeys,
    PlannerKeys,
    TerrainKeys,
    VehicleKeys,
)  # fmt: skip
from gcsplan.mission_file.values.units import UNIT_SYMBOLS, unit_end
from gcsplan.mission_file.zones.draft import one_line
from gcsplan.vehicle import DEFAULT_LEAN_DEG, PX4_TILT_DEG, PX4_VEL_MAX_M_S, Autopilot

COMMENT_WIDTH = 100
NEW_MIN_AGL_M = 60.0
WING_RADIUS_M = 100.0

_DECIMAL_PAIR = re.compile(r"\s*([-+]?\d+(?:\.\d+)?)\s*,\s*([-+]?\d+(?:\.\d+)?)\s*")
_FILE_HEAD = """{modeline}
# A mission of gcsplan. Plan it:  gcsplan plan {file}
# Keys carry their unit in the name. A line such as `#max_agl_m: 120` is a choice that is not made: remove its #.
# Places are [latitude, longitude] in degrees, or text in quotes: degrees with minutes and seconds, UTM, MGRS.
version: 1
name: {name}
"""
_ZONES = """
# {description} For example:
{given}
#  - {{name: village, center: [36.61, -84.31], radius_m: 400}}
#  - {{name: mast, center: [36.585, -84.29], radius_m: 60, ceiling_agl_m: 110}}
#  - {{file: zones.geojson}}
"""


@dataclass(frozen=True)
class Draft:
    """The parts of a new mission; places and files are text, as they will stand in the file.

    ``dem`` are rasters, relative to the mission file; without them the ground is flat at ``flat_m`` above sea level.
    ``rtl_rel_home_m`` (m above home) and ``lean_deg`` are a vehicle's own settings, if they were read. ``others``:
    start and goal of further vehicles, which count on from ``sysid``. ``zones``: files of no-fly zones. ``max_agl_m``
    and ``battery_wh`` are left open if they are None.
    """

    start: str
    goal: str
    dem: tuple[str, ...] = ()
    vertical_datum: str | None = None
    height_unit: str | None = None
    nodata: str | None = None
    flat_m: float | None = None
    autopilot: Autopilot = Autopilot.ARDUCOPTER
    sysid: int = 1
    min_agl_m: float = NEW_MIN_AGL_M
    rtl_rel_home_m: float | None = None
    lean_deg: float | None = None
    link: str | None = None
    others: tuple[tuple[str, str], ...] = ()
    zones: tuple[str, ...] = ()
    max_agl_m: float | None = None
    battery_wh: float | None = None


def place_text(text: str) -> str:
    """A place as it stands in the file: a list for two decimal numbers, else the text in quotes. Raises ValueError."""
    read_place(text)
    pair = _DECIMAL_PAIR.fullmatch(text)
    return f"[{pair[1]}, {pair[2]}]" if pair else json.dumps(text, ensure_ascii=False)


def text_of(draft: Draft, file: str, name: str) -> str:
    """The commented mission file of ``draft``; ``file`` is the name that it will have."""
    parts = [
        _FILE_HEAD.format(
            modeline=MODELINE, file=one_line(shlex.quote(file)), name=json.dumps(name, ensure_ascii=False)
        )
    ]
    parts += _section("terrain", _terrain(draft))
    parts += _section("limits", _limits(draft))
    given = "\n".join(["no_fly:", *(f"  - {{file: {word(zone)}}}" for zone in draft.zones)])
    parts.append(_ZONES.format(description=describe(MissionKeys, "no_fly"), given=given if draft.zones else "#no_fly:"))
    parts += _section("vehicles", _vehicle(draft), dash=True)
    for number, (start, goal) in enumerate(draft.others, start=1):
        other = replace(draft, start=start, goal=goal, sysid=draft.sysid + number, link=None, rtl_rel_home_m=None)
        made = [f"{key}: {value}" for _, key, value, is_made in _vehicle(other) if is_made]
        parts += ["", *(f"  - {line}" if i == 0 else f"    {line}" for i, line in enumerate(made))]
    parts += _section("planner", _planner())
    parts.append("")
    for key, value in (("altitude_frame", "relative"), ("way_home", "reported")):
        parts += _key(MissionKeys, key, value, "")
    parts += _key(MissionKeys, "wind", "{up_to_m_s: 5}", "", made=False)
    return "\n".join(part.rstrip("\n") if part else part for part in parts) + "\n"


KeyRow = tuple[type[Keys], str, str, bool]
"""Section, key, value, and whether the choice is made."""


def _terrain(draft: Draft) -> Iterator[KeyRow]:
    dem = ", ".join(word(d) for d in draft.dem)
    if draft.dem:
        yield TerrainKeys, "dem", dem if len(draft.dem) == 1 else f"[{dem}]", True
        datum = draft.vertical_datum
        yield TerrainKeys, "vertical_datum", "EGM96" if datum is None else word(datum), datum is not None
        for key, value in (("height_unit", draft.height_unit), ("nodata", draft.nodata)):
            if value is not None:
                yield TerrainKeys, key, value, True
    else:
        yield TerrainKeys, "flat_m", f"{draft.flat_m:g}", True
    yield TerrainKeys, "obstacle_height_m", "0", True


def _limits(draft: Draft) -> Iterator[KeyRow]:
    wing = draft.autopilot is Autopilot.ARDUPLANE
    yield LimitKeys, "min_agl_m", f"{draft.min_agl_m:g}", True
    ceiling_m = draft.max_agl_m
    yield (
        LimitKeys,
        "max_agl_m",
        f"{2.0 * draft.min_agl_m if ceiling_m is None else ceiling_m:g}",
        ceiling_m is not None,
    )
    yield LimitKeys, "max_amsl_m", "1500", False
    yield LimitKeys, "horizontal_clearance_m", "30", True
    yield LimitKeys, "vertical_clearance_m", "10", False
    yield LimitKeys, "track_error_m", "10" if wing else "3", True
    yield LimitKeys, "altitude_error_m", "8" if wing else "5", True
    yield LimitKeys, "max_climb_deg", "8" if wing else "15", True


def _vehicle(draft: Draft) -> Iterator[KeyRow]:
    wing = draft.autopilot is Autopilot.ARDUPLANE
    yield VehicleKeys, "name", f"uav{draft.sysid}", True
    yield VehicleKeys, "sysid", str(draft.sysid), True
    yield VehicleKeys, "autopilot", draft.autopilot.value, True
    yield VehicleKeys, "start", draft.start, True
    yield VehicleKeys, "goal", draft.goal, True
    yield VehicleKeys, "via", "[]", True
    yield VehicleKeys, "end", "loiter" if wing else "land", True
    height_m = draft.rtl_rel_home_m
    yield VehicleKeys, "rtl_rel_home_m", "100" if height_m is None else f"{height_m:.10g}", height_m is not None
    yield VehicleKeys, "speed_m_s", "[14, 20]" if wing else "[3, 10]", True
    px4, lean_deg = draft.autopilot is Autopilot.PX4, draft.lean_deg
    if draft.autopilot is not Autopilot.ARDUPLANE:
        default_deg = PX4_TILT_DEG if px4 else DEFAULT_LEAN_DEG
        leans_deg = default_deg if lean_deg is None else lean_deg
        yield VehicleKeys, "lean_angle_deg", f"{leans_deg:.10g}", lean_deg is not None
    if px4:
        yield VehicleKeys, "mpc_xy_vel_max_m_s", f"{PX4_VEL_MAX_M_S:g}", False
    yield VehicleKeys, "climb_m_s", "3" if px4 else "2.5", True
    yield VehicleKeys, "descent_m_s", "1.5", True
    if wing:
        yield VehicleKeys, "turn_radius_m", f"{WING_RADIUS_M:g}", True
        yield VehicleKeys, "climb_out_m_s", "5", False
        yield VehicleKeys, "climb_out_speed_m_s", "19", False
    yield VehicleKeys, "link", word(draft.link or "udpout:127.0.0.1:14560"), draft.link is not None
    battery = {key: EnergyKeys.model_fields[key].default for key in ("vertical_j_per_m", "horizontal_j_per_m")}
    values = ", ".join(f"{key}: {value:g}" for key, value in battery.items())
    wh = draft.battery_wh
    yield (
        VehicleKeys,
        "energy",
        f"{{{values}, battery_wh: {400 if wh is None else wh:g}, reserve: 0.2}}",
        wh is not None,
    )


def _planner() -> Iterator[KeyRow]:
    for key, value in (("name", "optimal"), ("objective", "length"), ("seed", "1"), ("budget_s", "10")):
        yield PlannerKeys, key, value, True


def _section(key: str, rows: Iterator[KeyRow], *, dash: bool = False) -> Iterator[str]:
    """A section with its keys; with ``dash`` it is the one entry of a list."""
    yield ""
    yield f"# {describe(MissionKeys, key)}"
    yield f"{key}:"
    for i, (kind, name, value, made) in enumerate(rows):
        indent = "    " if dash else "  "
        lines = list(_key(kind, name, value, indent, made=made))
        if dash and i == 0:
            lines[-1] = f"  - {lines[-1].lstrip()}"
        yield from lines


def _key(kind: type[Keys], key: str, value: str, indent: str, *, made: bool = True) -> Iterator[str]:
    """The comment of a key and its line."""
    field = kind.model_fields[key]
    unit = UNIT_SYMBOLS.get(unit_end(key), "")
    default = LATE_DEFAULTS.get(key, field.default)
    words = [describe(kind, key)]
    if get_origin(field.annotation) is Literal:
        words.append(f"One of {', '.join(get_args(field.annotation))}.")
    if unit:
        words.append(f"In {unit}.")
    if field.is_required():
        words.append("Required.")
    elif isinstance(default, str | int | float):
        words.append(f"Default: {default:g}." if isinstance(default, float) else f"Default: {default}.")
    elif isinstance(default, list):
        words.append(f"Default: [{', '.join(f'{x:g}' for x in default)}].")
    yield from textwrap.wrap(
        " ".join(words),
        COMMENT_WIDTH,
        initial_indent=f"{indent}# ",
        subsequent_indent=f"{indent}# ",
        break_on_hyphens=False,
    )
    yield f"{indent}{'' if made else '#'}{key}: {value}"
