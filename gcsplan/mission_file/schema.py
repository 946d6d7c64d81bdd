"""What may stand in a mission file, key by key, and pydantic's complaints in our words.

Every section is validated on its own, so that a mistake in one vehicle does not hide those in the others, nor the
checks that need the terrain. Numbers are numbers: no text, no booleans, no NaN; every key that is not here is an
error that names the nearest one that is.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    model_validator,
)

from gcsplan.errors import Problem

NAME_PATTERN = r"^[A-Za-z0-9_-]+$"
_FAR = 1e6

LEAST = 1e-3
"""Of speeds and accelerations, and joules of a battery: what is divided by less has no bound."""


def _no_trifle(value: float) -> float:
    if value < LEAST:
        raise ValueError(f"must be at least {LEAST:g}, given {value:g}")
    return value


Metres = Annotated[float, Field(ge=-_FAR, le=_FAR)]
Length = Annotated[float, Field(ge=0.0, le=_FAR)]
Positive = Annotated[float, Field(gt=0.0, le=_FAR)]
Angle = Annotated[float, Field(gt=0.0, le=90.0)]
Speed = Annotated[float, Field(gt=0.0, le=300.0), AfterValidator(_no_trifle)]
Accel = Annotated[float, Field(gt=0.0, le=100.0), AfterValidator(_no_trifle)]
Seconds = Annotated[float, Field(ge=0.0, le=86400.0)]
Text = Annotated[str, Field(min_length=1, max_length=300)]
Encoding = Literal["box", "sections", "polar", "bspline", "offsets"]
SwarmCost = Literal["krill", "ssgwo", "msfoa", "abo", "ib-abc"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)

    @property
    def given(self) -> dict[str, Any]:
        """The keys that stand in the file, with their values."""
        return {k: getattr(self, k) for k in self.model_fields_set}


class LocalPoint(_Section):
    """A point of a local frame; on the ground unless ``up_m`` or ``agl_m`` says otherwise."""

    east_m: Metres
    north_m: Metres
    up_m: Metres | None = None
    agl_m: Length | None = None

    @model_validator(mode="after")
    def _one_height(self) -> LocalPoint:
        if self.up_m is not None and self.agl_m is not None:
            raise ValueError("give up_m or agl_m, not both")
        return self


def _form(value: Any) -> str:
    return "{east_m, north_m}" if isinstance(value, dict | LocalPoint) else "[lat, lon]"


_Local = Annotated[LocalPoint, Tag("{east_m, north_m}")]
Pair = Annotated[list[Metres], Field(min_length=2, max_length=2)]
LatLon = Annotated[list[float], Field(min_length=2, max_length=2)]
LatLonAgl = Annotated[list[float], Field(min_length=2, max_length=3)]
Point = Annotated[Annotated[LatLon, Tag("[lat, lon]")] | _Local, Discriminator(_form)]
ViaPoint = Annotated[Annotated[LatLonAgl, Tag("[lat, lon]")] | _Local, Discriminator(_form)]
_FORMS = ("[lat, lon]", "{east_m, north_m}", "one", "several")


class FrameKeys(_Section):
    """``frame:`` of a mission in local metres."""

    origin: LatLon
    amsl_m: Metres = 0.0


class PeakKeys(_Section):
    """One peak, metres of the local frame."""

    center: Pair
    height_m: Metres
    decay_m: Annotated[list[Annotated[float, Field(ge=1e-3, le=_FAR)]], Field(min_length=2, max_length=2)]


def _count(value: Any) -> str:
    return "several" if isinstance(value, list) else "one"


class TerrainKeys(_Section):
    """``terrain:``."""

    dem: (
        Annotated[
            Annotated[Text, Tag("one")]
            | Annotated[Annotated[list[Text], Field(min_length=1, max_length=2000)], Tag("several")],
            Discriminator(_count),
        ]
        | None
    ) = None
    vertical_datum: Text | None = None
    geoid_grid: Text | None = None
    crs: Text | None = None
    height_unit: Literal["m", "ft", "us_ft"] | None = None
    flat_m: Metres | None = None
    peaks: Annotated[list[PeakKeys], Field(min_length=1, max_length=1000)] | None = None
    obstacle_height_m: Length = 0.0
    canopy: Text | None = None
    canopy_nodata_m: Annotated[float, Field(ge=0.0, le=250.0)] | None = None


class LimitKeys(_Section):
    """``limits:``; a vehicle may give any of them too."""

    min_agl_m: Length | None = None
    max_agl_m: Positive | None = None
    max_amsl_m: Metres | None = None
    horizontal_clearance_m: Length | None = None
    track_error_m: Length | None = None
    altitude_error_m: Length | None = None
    max_climb_deg: Angle | None = None
    max_descent_deg: Angle | None = None


class ZoneKeys(_Section):
    """One entry of ``no_fly:``: a circle, a polygon or a file."""

    name: Text | None = None
    center: Point | None = None
    radius_m: float | None = None
    polygon: list[Point] | None = None
    file: Text | None = None
    floor_agl_m: Metres | None = None
    ceiling_agl_m: Metres | None = None
    floor_amsl_m: Metres | None = None
    ceiling_amsl_m: Metres | None = None


class EnergyKeys(_Section):
    """``energy:`` of a vehicle."""

    vertical_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 120.0
    horizontal_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 100.0
    hover_w: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    battery_j: Annotated[float, Field(gt=0.0, le=1e15), AfterValidator(_no_trifle)] | None = None
    reserve: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.2


class VehicleKeys(LimitKeys):
    """One entry of ``vehicles:``."""

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    sysid: Annotated[int, Field(ge=1, le=255)]
    autopilot: Literal["arducopter", "arduplane", "px4"]
    start: Point
    goal: Point
    takeoff_agl_m: Positive | None = None
    approach_agl_m: Positive | None = None
    via: Annotated[list[ViaPoint], Field(max_length=500)] = []
    end: Literal["land", "loiter", "rtl", "none"] = "land"
    rtl_rel_home_m: Positive | None = None
    takeoff_heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | None = None
    speed_m_s: Annotated[list[Speed], Field(min_length=2, max_length=2)] = [3.0, 15.0]
    climb_m_s: Speed = 2.5
    descent_m_s: Speed = 1.5
    land_m_s: Speed = 0.5
    accel_m_s2: Accel = 1.5
    corner_accel_m_s2: Accel = 2.5
    vertical_accel_m_s2: Accel = 1.0
    leg_jerk_m_s3: Accel = 1.0
    turn_radius_m: Length = 0.0
    energy: EnergyKeys = EnergyKeys()
    link: Text | None = None
    limits: LimitKeys | None = None


def _order_form(value: Any) -> Any:
    if value is not None and not isinstance(value, list) and value != "best":
        raise ValueError(f"must be a list of the vehicles' names, or best, given {shown(value)}")
    return value


_Order = Annotated[Annotated[Literal["best"], Tag("one")] | Annotated[list[str], Tag("several")], Discriminator(_count)]


class ArrivalKeys(_Section):
    """``arrival:``."""

    mode: Literal["sequence", "together", "none"]
    order: Annotated[_Order | None, BeforeValidator(_order_form)] = None
    interval_s: Seconds | None = None
    arrive_s: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    clock: Literal["first", "fleet"] | None = None
    hold: Literal["ground", "gate", "none"] = "ground"
    window_s: Seconds = 0.0
    pad_clear_s: Seconds | None = None
    separation_m: Length | None = None


def _plain_values(parameters: dict[str, Any]) -> dict[str, Any]:
    for key, value in parameters.items():
        if not isinstance(value, int | float | str) or not (isinstance(value, str) or abs(value) <= _FAR):
            raise ValueError(f"{key[:80]} must be a plain number or word, given {shown(value)}")
    return parameters


class PlannerKeys(_Section):
    """``planner:``; the keys below ``budget_mb`` belong to planners that search with a swarm."""

    name: Text = "optimal"
    objective: Literal["length", "energy"] = "length"
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 1
    gap_percent: Annotated[float, Field(ge=0.0, le=100.0)] = 0.1
    budget_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 10.0
    budget_mb: Annotated[float, Field(ge=64.0, le=1e6)] = 1024.0
    encoding: Encoding | None = None
    cost: SwarmCost | None = None
    points: Annotated[int, Field(ge=1, le=1000)] | None = None
    population: Annotated[int, Field(ge=2, le=100_000)] | None = None
    iterations: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    evaluations: Annotated[int, Field(ge=1, le=1_000_000_000)] | None = None
    parameters: Annotated[dict[str, Any], AfterValidator(_plain_values)] | None = None


TOP_KEYS = (
    "version", "name", "terrain", "limits", "no_fly", "vehicles", "arrival", "planner", "altitude_frame", "frame",
    "terrain_error_m",
)  # fmt: skip

Section = TypeVar("Section", bound=_Section)


def read_section(kind: type[Section], value: Any, where: str, problems: list[Problem]) -> Section | None:
    """``value`` as a section; None, and every mistake in ``problems``, where it is not one.

    A section whose only mistakes are unknown keys is given without them.
    ``where`` is the place so far (``FILE: vehicles[1]``).
    """
    if not isinstance(value, dict):
        keys = ", ".join(list(kind.model_fields)[:6])
        problems.append(Problem(where, f"must be a mapping of keys ({keys}, …), given {shown(value)}"))
        return None
    try:
        return kind.model_validate(value)
    except ValidationError as why:
        errors = why.errors(include_url=False)
        problems += [_problem(kind, e, where) for e in errors]
        unknown = {e["loc"][0] for e in errors if e["type"] == "extra_forbidden" and len(e["loc"]) == 1}
        if len(unknown) < len(errors):
            return None
    # Nothing but unknown keys: the rest is judged too, so that its mistakes are told in the same breath.
    return kind.model_validate({k: v for k, v in value.items() if k not in unknown})


def unknown_keys(given: Iterable[str], known: Iterable[str], where: str) -> list[Problem]:
    """A problem for each key that is not known, naming the nearest one that is."""
    names = list(known)
    prefix = where if where.endswith(": ") else where + "."
    return [Problem(f"{prefix}{key[:80]}", _unknown(key, names)) for key in given if key not in names]


def shown(value: Any) -> str:
    """A value as a message shows it: short, and telling text from numbers."""
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return f"the text {value[:60]!r}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge number"
    return f"{value}"[:60]


def nearest(word: str, known: Iterable[str]) -> str:
    """`` (did you mean …?)`` or nothing."""
    close = difflib.get_close_matches(word[:80], list(known), n=1, cutoff=0.6)
    return f"; did you mean {close[0]}?" if close else ""


def key_path(where: str, loc: Iterable[int | str]) -> str:
    """``FILE: vehicles[1]`` and ("speed_m_s", 0) to ``FILE: vehicles[1].speed_m_s[0]``."""
    path = where
    for part in loc:
        if isinstance(part, int):
            path += f"[{part}]"
        elif part not in _FORMS:
            path += part[:80] if path.endswith(": ") else f".{part[:80]}"
    return path


def _unknown(key: str, known: list[str]) -> str:
    near = nearest(key, known)
    return "unknown key" + (near or f"; known are {', '.join(known)}")


def _problem(kind: type[_Section], error: Any, where: str) -> Problem:
    loc, given = error["loc"], shown(error["input"])
    path = key_path(where, loc)
    context = error.get("ctx", {})
    match error["type"]:
        case "missing":
            return Problem(path, "is missing")
        case "extra_forbidden":
            return Problem(path, _unknown(str(loc[-1]), list(_model_at(kind, loc[:-1]).model_fields)))
        case "value_error":
            return Problem(path, str(context["error"]))
        case "literal_error":
            choices = re.findall(r"'([^']*)'", context["expected"])
            near = nearest(error["input"], choices) if isinstance(error["input"], str) else ""
            return Problem(path, f"must be one of {', '.join(choices)}, given {given}{near}")
        case "string_pattern_mismatch":
            return Problem(path, f"must be made of letters, digits, _ and -, given {given}")
        case "string_type":
            return Problem(path, f"must be text (in quotes, if it looks like a number), given {given}")
        case "float_type":
            return Problem(path, f"must be a number, given {given}")
        case "int_type" | "int_from_float" | "int_parsing_size":
            return Problem(path, f"must be a whole number, given {given}")
        case "finite_number":
            return Problem(path, f"must be a finite number, given {given}")
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            word = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
            bound = next(k for k in ("gt", "ge", "lt", "le") if k in context)
            return Problem(path, f"must be {word[bound]} {context[bound]:g}, given {given}")
        case "too_short" | "too_long":
            least, most = context.get("min_length"), context.get("max_length")
            bound = f"at least {least}" if least is not None else f"at most {most}"
            given = context.get("actual_length", given)
            return Problem(path, f"must have {bound} values{_form_of(loc)}, given {given}")
        case "list_type" if _form_of(loc):
            return Problem(path, f"must be [lat, lon], or {{east_m, north_m}} in a mission with a frame, given {given}")
        case "list_type":
            return Problem(path, f"must be a list, given {given}")
        case "model_type" | "dict_type" | "model_attributes_type":
            return Problem(path, f"must be a mapping of keys, given {given}")
    return Problem(path, f"{error['msg'][:1].lower()}{error['msg'][1:]}, given {given}")


def _form_of(loc: tuple[int | str, ...]) -> str:
    return " [lat, lon]" if "[lat, lon]" in loc else ""


def _model_at(kind: type[_Section], loc: Iterable[int | str]) -> type[_Section]:
    """The section that holds the key at ``loc``, for the names that it knows."""
    for part in loc:
        if part == "{east_m, north_m}":
            kind = LocalPoint
        elif isinstance(part, str) and part in kind.model_fields:
            kind = _sections_in(kind.model_fields[part].annotation) or kind
    return kind


def _sections_in(annotation: Any) -> type[_Section] | None:
    if isinstance(annotation, type) and issubclass(annotation, _Section):
        return annotation
    return next((s for a in get_args(annotation) if (s := _sections_in(a)) is not None and s is not LocalPoint), None)
