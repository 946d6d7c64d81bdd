"""Options that change the mission for one run, and the changes of the mission document that they stand for."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcsplan.errors import UsageError

if TYPE_CHECKING:
    from gcsplan.mission_file.changes import MissionChange

AvoidOption = Annotated[
    list[str] | None,
    typer.Option(
        "--avoid", metavar="LAT,LON,RADIUS[,FLOOR-CEILING]",
        help="One more no-fly circle: radius, and floor and ceiling above ground, in metres (-CEILING: from the ground "
        "up; FLOOR-: without a ceiling). May be repeated.",
    ),
]  # fmt: skip
AvoidFileOption = Annotated[
    list[str] | None,
    typer.Option("--avoid-file", metavar="FILE", help="One more file of no-fly zones. May be repeated."),
]
ZonesInsteadOption = Annotated[
    list[str] | None,
    typer.Option("--zones", metavar="FILE", help="This file of zones in place of all of the mission's `no_fly`."),
]
MaxAglOption = Annotated[
    list[str] | None,
    typer.Option("--max-agl", metavar="[NAME=]M", help="Greatest height above ground, of all vehicles or of one."),
]
MinAglOption = Annotated[
    list[str] | None,
    typer.Option("--min-agl", metavar="[NAME=]M", help="Lowest height above ground, of all vehicles or of one."),
]
StartOption = Annotated[
    list[str] | None,
    typer.Option("--start", metavar="[NAME=]PLACE", help="Another start: LAT,LON, or text in UTM, MGRS, …"),
]
GoalOption = Annotated[list[str] | None, typer.Option("--goal", metavar="[NAME=]PLACE", help="Another goal.")]
ViaOption = Annotated[
    list[str] | None,
    typer.Option(
        "--via", metavar="[NAME=]LAT,LON[,AGL]",
        help="Points to pass, in place of the vehicle's own, in order; repeat it for each. `none`: pass none.",
    ),
]  # fmt: skip
SpeedOption = Annotated[
    list[str] | None,
    typer.Option("--speed", metavar="[NAME=]M_S|MIN-MAX", help="Cruise speed, of all vehicles or of one, in m/s."),
]
WindOption = Annotated[
    str | None,
    typer.Option(
        "--wind", metavar="WIND",
        help="Winds in place of the mission's `wind`: M_S,FROM_DEG[,GUST] (5,270,9; ranges: 3-7,250-290), "
        "up-to:M_S[,GUST] (any direction), a forecast (FILE.json), or still.",
    ),
]  # fmt: skip
SaveOption = Annotated[
    bool,
    typer.Option(
        "--save", help="Write the changes of these options into the mission file, once the plan is written; comments "
        "and all else in it stay.",
    ),
]  # fmt: skip

_FIGURES = r"\d+(?:\.\d+)?"
_BAND = re.compile(rf"({_FIGURES})?-({_FIGURES})?")
_NAMED = re.compile(r"([A-Za-z0-9_-]{1,64})=(.*)", re.DOTALL)


def changes_of(
    avoid: Sequence[str] | None, avoid_file: Sequence[str] | None, zones: Sequence[str] | None,
    limits: dict[str, Sequence[str] | None], places: dict[str, Sequence[str] | None], via: Sequence[str] | None,
    speed: Sequence[str] | None, terrain: dict[str, object], wind: str | None = None,
) -> list[MissionChange]:  # fmt: skip
    """The changes, in the order in which they are made. ``limits``, ``places``: by their keys in the mission file.

    Raises UsageError with the option, what it was given, and what it takes.
    """
    from gcsplan.mission_file.changes import MissionChange

    made = [MissionChange(f"--{key.replace('_', '-')}", "terrain", key, value) for key, value in terrain.items()]
    for i, file in enumerate(zones or []):
        made.append(MissionChange(f"--zones {file}", "zone" if i else "zones", "no_fly", {"file": file}))
    made += [MissionChange(f"--avoid-file {file}", "zone", "no_fly", {"file": file}) for file in avoid_file or []]
    made += [MissionChange(f"--avoid {text}", "zone", "no_fly", _circle(text)) for text in avoid or []]
    for key, texts in limits.items():
        option = f"--{key.removesuffix('_m').replace('_', '-')}"
        for name, text in _by_vehicle(option, texts):
            made.append(MissionChange(f"{option} {text}", "limit", key, _number(option, text), name))
    for key, texts in places.items():
        for name, text in _by_vehicle(f"--{key}", texts):
            made.append(MissionChange(f"--{key} {text}", "vehicle", key, _place(f"--{key}", text), name))
    for name, text in _by_vehicle("--speed", speed):
        made.append(MissionChange(f"--speed {text}", "vehicle", "speed_m_s", _speeds(text), name))
    points: dict[str | None, list[str]] = {}
    for name, text in _named(via):
        points.setdefault(name, []).append(text)
    for name, texts in points.items():
        given = [] if texts == ["none"] else [_via(text) for text in texts]
        made.append(MissionChange(f"--via {texts[0]}", "vehicle", "via", given, name))
    return [*made, *wind_changes(wind)]


def wind_changes(text: str | None) -> list[MissionChange]:
    """The change of a ``--wind``; none without it. Raises UsageError with what it takes."""
    from gcsplan.mission_file.changes import MissionChange

    return [] if text is None else [MissionChange(f"--wind {text}", "wind", "wind", _wind(text.strip()))]


def one_wind(text: str | None) -> tuple[float, float] | None:
    """The speed in m/s, and the direction that it comes from, of ``M_S,FROM_DEG``; None without a text.

    Raises UsageError for any other text.
    """
    if text is None:
        return None
    from gcsplan.mission_file.values.schema import MOST_DECLARED_M_S

    match = re.fullmatch(rf"\s*({_FIGURES})\s*,\s*({_FIGURES})\s*", text)
    if match is None or float(match[1]) > MOST_DECLARED_M_S or float(match[2]) > 360.0:
        raise UsageError(f"--wind {text}: give M_S,FROM_DEG (5,270), at most {MOST_DECLARED_M_S:g} m/s and 360°")
    return float(match[1]), float(match[2])


def _wind(text: str) -> dict[str, Any]:
    """The section ``wind:`` of a mission."""
    if text == "still":
        return {"up_to_m_s": 0}
    if text.lower().endswith(".json"):
        return {"forecast": text}
    most = text.removeprefix("up-to:")
    parts = [part.strip() for part in most.split(",")]
    form = ["up_to_m_s", "gust_m_s"] if most != text else ["speed_m_s", "from_deg", "gust_m_s"]
    if not len(form) - 1 <= len(parts) <= len(form):
        raise UsageError(f"--wind {text}: give M_S,FROM_DEG or M_S,FROM_DEG,GUST (5,270,9), up-to:M_S, still, or a "
                         "forecast FILE.json")  # fmt: skip
    return {key: _one_or_range("--wind", part) for key, part in zip(form, parts, strict=False)}


def _named(texts: Sequence[str] | None) -> list[tuple[str | None, str]]:
    """Each text with the vehicle's name before its ``=``, if there is one."""
    found = [(_NAMED.fullmatch(text), text) for text in texts or []]
    return [(match[1], match[2]) if match else (None, text) for match, text in found]


def _by_vehicle(option: str, texts: Sequence[str] | None) -> list[tuple[str | None, str]]:
    """As `_named`, where each vehicle, or all of them, may be given once."""
    found = _named(texts)
    names = [name for name, _ in found]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(f"{option} is given twice{f' for {name}' if name else ''}; keep one")
    return found


def _circle(text: str) -> dict[str, Any]:
    """A circle of ``no_fly``."""
    parts = [part.strip() for part in text.split(",")]
    band = _BAND.fullmatch(parts[-1]) if len(parts) > 2 else None
    if band is not None:
        parts.pop()
    few = len(parts) < 2 or (len(parts) == 2 and _numbers(parts[0], 1) is not None)  # a place may be one text
    if few or (band is not None and not any(band.groups())):
        raise UsageError(f"--avoid {text}: give LAT,LON,RADIUS in degrees and metres, or LAT,LON,RADIUS,FLOOR-CEILING: "
                         "36.61,-84.31,400 or 36.61,-84.31,60,0-100")  # fmt: skip
    zone: dict[str, Any] = {
        "center": _place("--avoid", ",".join(parts[:-1])), "radius_m": _number("--avoid", parts[-1])
    }  # fmt: skip
    floor, ceiling = (0.0, math.inf) if band is None else (float(band[1] or 0.0), float(band[2] or math.inf))
    if ceiling <= floor:
        raise UsageError(f"--avoid {text}: the ceiling must be above the floor: FLOOR-CEILING, such as 0-100")
    if floor > 0.0:
        zone["floor_agl_m"] = _plain(floor)
    if ceiling < math.inf:
        zone["ceiling_agl_m"] = _plain(ceiling)
    return zone


def _place(option: str, text: str) -> Any:
    """A place as a mission file has it: two decimal numbers as a list, else the text."""
    from gcsplan.mission_file.values.places import read_place

    try:
        read_place(text)
    except ValueError as why:
        raise UsageError(f"{option}: {why}") from None
    return _numbers(text, 2) or text.strip()


def _via(text: str) -> Any:
    """A via point: [lat, lon] or [lat, lon, agl_m], or a text."""
    return _numbers(text, 3) or _place("--via", text)


def _speeds(text: str) -> Any:
    """One speed, or [slowest, fastest]."""
    given = _one_or_range("--speed", text)
    if isinstance(given, list) and given[0] > given[1]:
        raise UsageError(f"--speed {text}: give one speed, or the slowest and the fastest: 3-15")
    return given


def _one_or_range(option: str, text: str) -> Any:
    """A number, or [from, to] of ``FROM-TO``."""
    band = _BAND.fullmatch(text.strip())
    if band is None:
        return _number(option, text)
    if band[1] is None or band[2] is None:
        raise UsageError(f"{option} {text}: give one number, or FROM-TO, such as 3-15")
    return [_plain(float(band[1])), _plain(float(band[2]))]


def _number(option: str, text: str) -> float | int:
    """A number that is not negative."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise UsageError(f"{option} {text}: give a number, such as 80")
    return _plain(value)


def _numbers(text: str, count: int) -> list[float] | None:
    """So many decimal numbers between commas; None for any other text."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return values if len(values) == count and all(map(math.isfinite, values)) else None


def _plain(value: float) -> float | int:
    """A whole number without its decimals, as people write it."""
    return int(value) if value.is_integer() else value
