"""What may stand in a mission file, key by key, and pydantic's complaints in our words.

Every section is validated on its own, so that a mistake in one vehicle does not hide those in the others, nor the
checks that need the terrain. Numbers are numbers: no text, no booleans, no NaN; every key that is not here is an
error that names the nearest one that is.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    model_validator,
)

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


class Keys(BaseModel):
    """A section of the file. What stands below a key says in the reference what it is (docs/_build_reference.py)."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)

    @property
    def given(self) -> dict[str, Any]:
        """The keys that stand in the file, with their values."""
        return {k: getattr(self, k) for k in self.model_fields_set}


class LocalPoint(Keys):
    """A point of a local frame; on the ground unless ``up_m`` or ``agl_m`` says otherwise."""

    east_m: Metres
    """East of the frame's origin."""
    north_m: Metres
    """North of the frame's origin."""
    up_m: Metres | None = None
    """Height above the frame's zero."""
    agl_m: Length | None = None
    """Height above ground."""

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
FORMS = ("[lat, lon]", "{east_m, north_m}", "one", "several")


class FrameKeys(Keys):
    """``frame:`` of a mission in local metres."""

    origin: LatLon
    """Latitude and longitude of the point 0, 0."""
    amsl_m: Metres = 0.0
    """Altitude above sea level of `up_m: 0`."""


class PeakKeys(Keys):
    """One peak, metres of the local frame."""

    center: Pair
    """East and north of its top, metres."""
    height_m: Metres
    """Height of its top above the flat ground."""
    decay_m: Annotated[list[Annotated[float, Field(ge=1e-3, le=_FAR)]], Field(min_length=2, max_length=2)]
    """East and north: at this distance from the top it has fallen to 37 % (1/e) of its height."""


def _count(value: Any) -> str:
    return "several" if isinstance(value, list) else "one"


class TerrainKeys(Keys):
    """``terrain:``."""

    dem: (
        Annotated[
            Annotated[Text, Tag("one")]
            | Annotated[Annotated[list[Text], Field(min_length=1, max_length=2000)], Tag("several")],
            Discriminator(_count),
        ]
        | None
    ) = None
    """A raster (.tif, .hgt, .asc), relative to this file, a list of tiles, or `sample:jacksboro`."""
    vertical_datum: Text | None = None
    """What heights count from: `EGM96`, `NAVD88`, `WGS84` (ellipsoidal), …; wanted where the raster does not say."""
    geoid_grid: Text | None = None
    """Geoid raster that converts ellipsoidal heights; without it they are refused."""
    crs: Text | None = None
    """Coordinate system of a raster that does not say, such as `EPSG:32617`."""
    height_unit: Literal["m", "ft", "us_ft"] | None = None
    """Of a raster that does not say."""
    flat_m: Metres | None = None
    """No raster: flat ground at this altitude. In a mission with a frame it counts above its zero."""
    peaks: Annotated[list[PeakKeys], Field(min_length=1, max_length=1000)] | None = None
    """No raster: hills on flat ground, in a mission with a frame."""
    obstacle_height_m: Length = 0.0
    """Trees and buildings, everywhere: added to the ground for `min_agl_m`, not for `max_agl_m`."""
    canopy: Text | None = None
    """A raster of heights above ground; where both are given the higher one counts."""
    canopy_nodata_m: Annotated[float, Field(ge=0.0, le=250.0)] | None = None
    """Height of canopy cells without data; not given, the ground there is unknown."""


class LimitKeys(Keys):
    """``limits:``; a vehicle may give any of them too."""

    min_agl_m: Length | None = None
    """Lowest height above ground and what stands on it; wanted, here or in every vehicle."""
    max_agl_m: Positive | None = None
    """Highest height above ground."""
    max_amsl_m: Metres | None = None
    """Highest altitude above sea level."""
    horizontal_clearance_m: Length | None = None
    """No zone is nearer than this, and no ground within it reaches flight level."""
    track_error_m: Length | None = None
    """How far the aircraft may be from its track; every check is widened by it."""
    altitude_error_m: Length | None = None
    """How far the aircraft may be from its altitude; every check is widened by it."""
    max_climb_deg: Angle | None = None
    """Steepest climb; not given: any for a multicopter, 15 for an arduplane."""
    max_descent_deg: Angle | None = None
    """Steepest descent; not given: `max_climb_deg`."""


class ZoneKeys(Keys):
    """One entry of ``no_fly:``: a circle, a polygon or a file."""

    name: Text | None = None
    """Names it in messages and reports."""
    center: Point | None = None
    """Middle of a circle; goes with `radius_m`."""
    radius_m: float | None = None
    """Radius of a circle, 100 000 at most."""
    polygon: list[Point] | None = None
    """Corners of a polygon, in order; it is closed by itself."""
    file: Text | None = None
    """Zones of a .geojson or .kml file; the other keys then stand in the file."""
    floor_agl_m: Metres | None = None
    """Lowest height above ground, point by point; not given or 0, nothing passes below."""
    ceiling_agl_m: Metres | None = None
    """Highest height above ground, point by point; no ceiling: nothing passes above."""
    floor_amsl_m: Metres | None = None
    """The same above sea level."""
    ceiling_amsl_m: Metres | None = None
    """The same above sea level."""


class EnergyKeys(Keys):
    """``energy:`` of a vehicle."""

    vertical_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 120.0
    """Energy of a metre up or down."""
    horizontal_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 100.0
    """Energy of a metre along."""
    hover_w: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    """Power of standing still; a hold costs it."""
    battery_j: Annotated[float, Field(gt=0.0, le=1e15), AfterValidator(_no_trifle)] | None = None
    """Energy of the full battery; not given, the battery is not judged."""
    reserve: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.2
    """Part of the battery that is left at the end, 0 to 1."""


class VehicleKeys(LimitKeys):
    """One entry of ``vehicles:``."""

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    """Letters, digits, _ and -; names its files."""
    sysid: Annotated[int, Field(ge=1, le=255)]
    """MAVLink system id."""
    autopilot: Literal["arducopter", "arduplane", "px4"]
    """Whose rules the mission is written for and judged by."""
    start: Point
    """Where it stands on the ground."""
    goal: Point
    """Where it flies to."""
    takeoff_agl_m: Positive | None = None
    """Top of the vertical take-off; the path begins there. Not given: the lowest that is legal."""
    approach_agl_m: Positive | None = None
    """End of the path above the goal. Not given: the lowest that is legal."""
    via: Annotated[list[ViaPoint], Field(max_length=500)] = []
    """Points to pass, in order: a place, with or without its height above ground."""
    end: Literal["land", "loiter", "rtl", "none"] = "land"
    """What follows the path: a landing, a hold or circle, the autopilot's return, or nothing."""
    rtl_rel_home_m: Positive | None = None
    """Height above home of the autopilot's own return; goes with `end: rtl`."""
    takeoff_heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | None = None
    """Launch heading of a fixed wing; not given, the planner looks for one."""
    speed_m_s: Annotated[list[Speed], Field(min_length=2, max_length=2)] = [3.0, 15.0]
    """Slowest and fastest cruise."""
    climb_m_s: Speed = 2.5
    """Fastest climb; slows steep legs."""
    descent_m_s: Speed = 1.5
    """Fastest descent; slows steep legs."""
    land_m_s: Speed = 0.5
    """Descent just above ground."""
    accel_m_s2: Accel = 1.5
    """Speeding up and braking along the path."""
    corner_accel_m_s2: Accel = 2.5
    """Bounds the speed in a corner."""
    vertical_accel_m_s2: Accel = 1.0
    """Speeding up and braking of take-off and landing."""
    leg_jerk_m_s3: Accel = 1.0
    """Of ArduPilot's S-curves, which bound the speed on a short leg."""
    turn_radius_m: Length = 0.0
    """Above 0: a fixed wing, whose corners are planned and judged as arcs."""
    energy: EnergyKeys = EnergyKeys()
    """What flying costs."""
    link: Text | None = None
    """URL for `--upload link`."""
    limits: LimitKeys | None = None
    """Limits of this vehicle alone; they may stand beside its other keys too."""


def _order_form(value: Any) -> Any:
    if value is not None and not isinstance(value, list) and value != "best":
        raise ValueError(f"must be a list of the vehicles' names, or best, given {shown(value)}")
    return value


_Order = Annotated[Annotated[Literal["best"], Tag("one")] | Annotated[list[str], Tag("several")], Discriminator(_count)]


class ArrivalKeys(Keys):
    """``arrival:``."""

    mode: Literal["sequence", "together", "none"]
    """One after the other, all at once, or as each likes."""
    order: Annotated[_Order | None, BeforeValidator(_order_form)] = None
    """Every vehicle's name once, or `best`; not given: the order of the file."""
    interval_s: Seconds | None = None
    """Between one arrival and the next; a sequence needs it."""
    arrive_s: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    """When the first is to arrive, or all together."""
    clock: Literal["first", "fleet"] | None = None
    """Who sets the time of a sequence: the first vehicle, or the whole fleet."""
    hold: Literal["ground", "gate", "none"] = "ground"
    """Where a vehicle waits that would come too early."""
    window_s: Seconds = 0.0
    """Each may arrive so much earlier or later."""
    pad_clear_s: Seconds | None = None
    """So long after a landing the pad is free again; not given: never."""
    separation_m: Length | None = None
    """Least distance of every pair, from take-off to landing."""


def _plain_values(parameters: dict[str, Any]) -> dict[str, Any]:
    for key, value in parameters.items():
        if not isinstance(value, int | float | str) or not (isinstance(value, str) or abs(value) <= _FAR):
            raise ValueError(f"{key[:80]} must be a plain number or word, given {shown(value)}")
    return parameters


class PlannerKeys(Keys):
    """``planner:``; the keys below ``budget_mb`` belong to planners that search with a swarm."""

    name: Text = "optimal"
    """One of the [planners](planners.md)."""
    objective: Literal["length", "energy"] = "length"
    """What is made least."""
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 1
    """Of everything random."""
    gap_percent: Annotated[float, Field(ge=0.0, le=100.0)] = 0.1
    """Planning stops when path and bound are that near."""
    budget_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 10.0
    """Time for what comes after the first path; a first path may take three times as long."""
    budget_mb: Annotated[float, Field(ge=64.0, le=1e6)] = 1024.0
    """Memory for the searches, above the terrain itself."""
    encoding: Encoding | None = None
    """How a swarm's numbers become a path."""
    cost: SwarmCost | None = None
    """Which paper's cost a swarm makes least."""
    points: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Way points of a swarm's path."""
    population: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Members of a swarm."""
    iterations: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    """Rounds of a swarm."""
    evaluations: Annotated[int, Field(ge=1, le=1_000_000_000)] | None = None
    """Paths that a swarm may try."""
    parameters: Annotated[dict[str, Any], AfterValidator(_plain_values)] | None = None
    """A swarm's own parameters, by their names."""


class MissionKeys(Keys):
    """The whole file. Each of its sections is read on its own."""

    version: Literal[1]
    """Version of this format."""
    name: Annotated[str, Field(min_length=1, max_length=300)] | None = None
    """Of the mission; not given: the file's own name."""
    terrain: TerrainKeys
    """The ground, and what stands on it."""
    limits: LimitKeys | None = None
    """What every vehicle is held to; a vehicle may override any of them."""
    no_fly: list[ZoneKeys] = []
    """Zones that nobody enters."""
    vehicles: Annotated[list[VehicleKeys], Field(min_length=1, max_length=255)]
    """Who flies, from where to where."""
    arrival: ArrivalKeys | None = None
    """How several vehicles arrive; not given, their separation is not judged."""
    planner: PlannerKeys = PlannerKeys()
    """Who plans, for what, how long."""
    altitude_frame: Literal["relative", "amsl", "terrain"] = "relative"
    """What the mission's altitudes count from: home, the sea, or the ground (not for px4)."""
    frame: FrameKeys | None = None
    """Makes this a mission in local metres, as the papers' worlds are."""
    terrain_error_m: Annotated[float, Field(ge=0.0, le=1000.0)] | None = None
    """With `altitude_frame: terrain`: how far the vehicle's own terrain may be off."""


TOP_KEYS = tuple(MissionKeys.model_fields)


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
