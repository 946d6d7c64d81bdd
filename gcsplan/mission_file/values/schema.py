"""The keys of a mission file, and the values that each may have.

Every section is validated separately, so that a mistake in one vehicle does not hide those in the others, nor the
checks that need the terrain. Numbers must be numbers: no text, no booleans, no NaN. A key that is not here is an error
that names the nearest known one.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
)

from gcsplan.mission_file.values.keys import LARGEST_KEY_M, FiniteMetres, Keys, Length, with_error
from gcsplan.mission_file.values.point_keys import POINT_FORMS, LatLon, Point, ViaPoint, in_own_brackets

NAME_PATTERN = r"^[A-Za-z0-9_-]+$"

LEAST_POSITIVE = 1e-3
"""Smallest speed, acceleration, or battery capacity in J: a division by less has no useful bound."""


MOST_VOLTS = 10_000.0

MOST_VIAS = 500
"""Most vias of a vehicle."""

MOST_DECLARED_M_S = 75.0
"""Fastest wind that a mission may declare: faster than any gust in which an aircraft of these kinds has flown."""


def _no_trifle(value: float) -> float:
    if value < LEAST_POSITIVE:
        raise ValueError(f"must be at least {LEAST_POSITIVE:g}, given {value:g}")
    return value


Points = Annotated[list[Point], BeforeValidator(in_own_brackets)]
MOST_SEED = 2**32 - 1
Positive = Annotated[float, Field(gt=0.0, le=LARGEST_KEY_M)]
Angle = Annotated[float, Field(gt=0.0, le=90.0)]
Speed = Annotated[float, Field(gt=0.0, le=300.0), AfterValidator(_no_trifle)]
Accel = Annotated[float, Field(gt=0.0, le=100.0), AfterValidator(_no_trifle)]
DaySeconds = Annotated[float, Field(ge=0.0, le=86400.0)]
Text = Annotated[str, Field(min_length=1, max_length=300)]
EncodingName = Literal["paper", "box", "sections", "sections-whole", "polar", "polar-signed", "bspline", "offsets"]
SwarmCost = Literal["krill", "ssgwo", "msfoa", "abo", "ib-abc"]


def _count(value: Any) -> str:
    return "several" if isinstance(value, list) else "one"


def _same(value: float) -> list[float]:
    return [value, value]


def _one_or_range(kind: Any) -> Any:
    """A number, which becomes two, or a list of two."""
    one = Annotated[kind, AfterValidator(_same), Tag("one")]
    several = Annotated[list[kind], Field(min_length=2, max_length=2), Tag("several")]
    return Annotated[one | several, Discriminator(_count)]


MetrePair = Annotated[list[FiniteMetres], Field(min_length=2, max_length=2)]
if TYPE_CHECKING:
    SpeedRange = list[float]
else:
    SpeedRange = _one_or_range(Speed)


def _speeds_with_error(value: Any) -> Any:
    """A text such as ``5 ± 2`` as the range of its speeds, which begins at 0 at the lowest."""
    parts = with_error(value)
    return value if parts is None else [max(parts[0] - parts[1], 0.0), parts[0] + parts[1]]


def _directions_with_error(value: Any) -> Any:
    """A text such as ``270 ± 20`` as the range of its directions; an error of 180 and more is any direction."""
    parts = with_error(value)
    if parts is None or parts[0] > 360.0:
        return value
    return [0.0, 360.0] if parts[1] >= 180.0 else [(parts[0] - parts[1]) % 360.0, (parts[0] + parts[1]) % 360.0]


def _rising(speeds_m_s: list[float]) -> list[float]:
    if speeds_m_s[0] > speeds_m_s[1]:
        raise ValueError(f"must be [lowest, highest], given [{speeds_m_s[0]:g}, {speeds_m_s[1]:g}]")
    return speeds_m_s


def _clockwise(from_deg: list[float]) -> list[float]:
    """A range whose end is above its beginning: one that crosses north ends above 360."""
    return [from_deg[0], from_deg[1] + 360.0 * (from_deg[1] < from_deg[0])]


def _number_range_or_text(most: float, example: str) -> WithJsonSchema:
    number = {"type": "number", "minimum": 0.0, "maximum": most}
    pair = {"type": "array", "items": number, "minItems": 2, "maxItems": 2}
    return WithJsonSchema({"anyOf": [number, pair, {"type": "string", "examples": [example]}]})


if TYPE_CHECKING:
    WindSpeeds = list[float]
    WindDirections = list[float]
else:
    _WindSpeed = Annotated[float, Field(ge=0.0, le=MOST_DECLARED_M_S)]
    _Bearing = Annotated[float, Field(ge=0.0, le=360.0)]
    WindSpeeds = Annotated[
        _one_or_range(_WindSpeed),
        BeforeValidator(_speeds_with_error), AfterValidator(_rising), _number_range_or_text(MOST_DECLARED_M_S, "5 ± 2"),
    ]  # fmt: skip
    WindDirections = Annotated[
        _one_or_range(_Bearing),
        BeforeValidator(_directions_with_error), AfterValidator(_clockwise), _number_range_or_text(360.0, "270 ± 20"),
    ]  # fmt: skip
POINT_FORM_NAMES = ("[lat, lon]", "text", *POINT_FORMS, "one", "several")
"""The tags of unions, which are no part of a key's place."""


class FrameKeys(Keys):
    """``frame:`` of a mission in local metres."""

    origin: LatLon
    """Latitude and longitude of the point 0, 0."""
    amsl_m: FiniteMetres = 0.0
    """Altitude of `up_m: 0` above sea level."""


class PeakKeys(Keys):
    """One peak, metres of the local frame."""

    center: MetrePair
    """East and north of its top, metres."""
    height_m: FiniteMetres
    """Height of its top above the flat ground."""
    decay_m: Annotated[list[Annotated[float, Field(ge=1e-3, le=LARGEST_KEY_M)]], Field(min_length=2, max_length=2)]
    """East and north distance from the top at which the height has fallen to 37 % (1/e)."""


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
    """A raster, ArduPilot's .DAT (a file or folder), a list of which the finest counts, a sample or a source."""
    vertical_datum: Text | None = None
    """The zero of heights: `EGM96`, `NAVD88`, `WGS84` (ellipsoidal), …; required if the raster does not state it."""
    geoid_grid: Text | None = None
    """Geoid raster that converts ellipsoidal heights; without it they are refused."""
    crs: Text | None = None
    """Coordinate system of a raster that does not state it, such as `EPSG:32617`."""
    height_unit: Literal["m", "ft", "us_ft"] | None = None
    """Unit of heights in a raster; it counts before the unit that the file or the datum states."""
    nodata: Annotated[float, Field(allow_inf_nan=False)] | Literal["none"] | None = None
    """A number of the raster that stands for no height, such as `0`; `none`: exact zeros are ground or sea."""
    flat_m: FiniteMetres | None = None
    """No raster: flat ground at this altitude; in a mission with a frame it counts above the frame's zero."""
    peaks: Annotated[list[PeakKeys], Field(min_length=1, max_length=1000)] | None = None
    """No raster: hills on flat ground, in a mission with a frame."""
    obstacle_height_m: Length = 0.0
    """Height of trees and buildings everywhere: added to the ground for `min_agl_m`, not for `max_agl_m`."""
    canopy: Text | None = None
    """A raster of heights above ground; together with `obstacle_height_m` the higher one counts."""
    canopy_nodata_m: Annotated[float, Field(ge=0.0, le=250.0)] | None = None
    """Height of canopy cells without data; if absent, the ground there is unknown."""
    sea: bool = False
    """Ground that no tile knows is sea at 0 m: tiles that a source has not, or what your own tiles do not know."""


class LimitKeys(Keys):
    """``limits:``; a vehicle may have any of them too."""

    min_agl_m: Length | None = None
    """Lowest height above the ground and what stands on it; required here or in every vehicle."""
    max_agl_m: Positive | None = None
    """Greatest height above ground."""
    max_amsl_m: FiniteMetres | None = None
    """Greatest altitude above sea level."""
    horizontal_clearance_m: Length | None = None
    """Least distance to every zone, and to ground that reaches flight level."""
    vertical_clearance_m: Length | None = None
    """Least height over the ceiling and under the floor of every zone; if absent, 0."""
    track_error_m: Length | None = None
    """Largest distance of the aircraft from its track; every check is widened by it."""
    altitude_error_m: Length | None = None
    """Largest error of the aircraft's altitude; every check is widened by it."""
    max_climb_deg: Angle | None = None
    """Steepest climb; if absent, any for a multicopter, 15 for an arduplane."""
    max_descent_deg: Angle | None = None
    """Steepest descent; if absent, `max_climb_deg`."""


class ZoneKeys(Keys):
    """One entry of ``no_fly:`` or ``keep_in:``: a circle, a polygon, a line (of ``no_fly``) or a file."""

    name: Text | None = None
    """Name of the zone in messages and reports."""
    center: Point | None = None
    """Centre of a circle; needs `radius_m`."""
    radius_m: float | None = None
    """Radius of a circle, at most 100 000; with `file` that of its points that have none of their own."""
    polygon: Points | None = None
    """Corners of a polygon, in order; it is closed automatically."""
    line: Points | None = None
    """Points of a line, such as a power line; needs `buffer_m`."""
    buffer_m: float | None = None
    """Half the width of a corridor around a line, at most 20 000; with `file` that of its lines that have none."""
    file: Text | None = None
    """Zones: .geojson, .kml, .kmz, .gpkg, .shp, .fgb, .zip, .csv, .fen, .poly, OpenAir, ED-269, ED-318 or openAIP."""
    layer: Text | None = None
    """With `file`: the only layer of a .gpkg to be read; if absent, every one."""
    on_bad: Literal["refuse", "strict", "skip"] | None = None
    """With `file`: what zones do that are not understood; if absent, own files refuse, authorities' are strict."""
    ignore: Annotated[list[Literal["points", "lines", "empty"]], Field(max_length=10)] = []
    """With a file of your own: shapes beside zones, without a size of their own, that are left out by name."""
    kinds: Annotated[list[Text], Field(min_length=1, max_length=100)] | None = None
    """With an authority's file: the kinds of zones that are no-fly; if absent, all that restrict."""
    authorised: Annotated[list[Text], Field(max_length=1000)] = []
    """With an authority's file: the identifiers or names of zones that the mission is authorised to enter."""
    flight_level_error_m: Length | None = None
    """With an authority's file: how far flight levels may be from heights above sea level; else they limit nothing."""
    floor_agl_m: FiniteMetres | None = None
    """Floor of the zone above ground, point by point; if absent or 0, nothing passes below."""
    ceiling_agl_m: FiniteMetres | None = None
    """Ceiling of the zone above ground, point by point; without a ceiling, nothing passes above."""
    floor_amsl_m: FiniteMetres | None = None
    """Floor of the zone above sea level."""
    ceiling_amsl_m: FiniteMetres | None = None
    """Ceiling of the zone above sea level."""


class EnergyKeys(Keys):
    """``energy:`` of a vehicle."""

    vertical_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 120.0
    """Energy per metre up or down."""
    horizontal_j_per_m: Annotated[float, Field(ge=0.0, le=1e9)] = 100.0
    """Energy per horizontal metre through the air."""
    base_w: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    """Power that flying takes beside that of its metres, however fast it is."""
    hover_w: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    """The whole power of hovering, which counts during a hold; at least `base_w`."""
    cruise_w: Annotated[float, Field(gt=0.0, le=1e9)] | None = None
    """Power in cruise, instead of `base_w` and `horizontal_j_per_m`: read as `base_w`, with no energy per metre."""
    endurance_s: Annotated[float, Field(ge=1.0, le=1e7)] | None = None
    """How long a full battery lasts in flight, instead of `cruise_w`; mostly written `endurance_min`."""
    fitted_speed_m_s: SpeedRange | None = None
    """Airspeed of the flights that these numbers are fitted to, or slowest and fastest; for others there is a note."""
    battery_j: Annotated[float, Field(gt=0.0, le=1e15), AfterValidator(_no_trifle)] | None = None
    """Energy of the full battery; if absent, the battery is not judged."""
    battery_v: Annotated[float, Field(gt=0.0, le=MOST_VOLTS)] | None = None
    """Nominal voltage of the battery: a capacity in mAh needs it, and with it energies are shown in mAh, too."""
    reserve: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.2
    """Part of the battery that must be left at the end, 0 to 1."""


class VehicleKeys(LimitKeys):
    """One entry of ``vehicles:``."""

    name: Annotated[str, Field(pattern=NAME_PATTERN, max_length=64)]
    """Name of the vehicle and of its files: letters, digits, _ and -."""
    sysid: Annotated[int, Field(ge=1, le=255)]
    """MAVLink system id."""
    autopilot: Literal["arducopter", "arduplane", "px4"]
    """The autopilot that the mission is written for and judged by."""
    start: Point
    """Place of the take-off, on the ground."""
    goal: Point
    """Place to fly to."""
    takeoff_agl_m: Positive | None = None
    """Top of the vertical take-off, where the path begins; if absent, the lowest legal height."""
    approach_agl_m: Positive | None = None
    """End of the path above the goal; if absent, the lowest legal height."""
    via: Annotated[list[ViaPoint], Field(max_length=MOST_VIAS), BeforeValidator(in_own_brackets)] = []
    """Points to pass, in order: a place, with or without its height above ground."""
    end: Literal["land", "loiter", "rtl", "none"] = "land"
    """What follows the path: a landing, a hold or circle, the autopilot's return, or nothing."""
    rtl_rel_home_m: Positive | None = None
    """Height above home of the autopilot's own return; needed with `end: rtl`."""
    return_route: Literal["straight", "mission"] | None = None
    """How it returns: straight home, or by the mission's return path or landing sequence; if absent, straight home."""
    takeoff_heading_deg: Annotated[float, Field(ge=0.0, le=360.0)] | None = None
    """Launch heading of a fixed wing; if absent, the planner chooses one."""
    climb_out: Literal["straight", "circles"] = "straight"
    """How a fixed wing climbs after its launch: straight ahead, while that is clear, or in circles near its start."""
    depart_window_s: DaySeconds = 0.0
    """It may depart this much later than planned; its windows of arrival count that."""
    speed_m_s: SpeedRange = [3.0, 15.0]
    """Slowest and fastest cruise speed; one number is both. A fixed wing's is the airspeed that it indicates."""
    lean_angle_deg: Annotated[float, Field(ge=10.0, le=80.0)] | None = None
    """Largest lean: ArduCopter's `ATC_ANGLE_MAX`, 3° for each m/s of cruise; if absent 30, so 10 m/s at most. PX4's
    `MPC_TILTMAX_AIR`; if absent 45, in wind alone."""
    mpc_xy_vel_max_m_s: Speed | None = None
    """PX4's `MPC_XY_VEL_MAX`, the fastest cruise that it flies; if absent 12."""
    climb_m_s: Speed = 2.5
    """Fastest climb rate; slows steep legs. On PX4, if absent, 3 (`MPC_Z_V_AUTO_UP`)."""
    descent_m_s: Speed = 1.5
    """Fastest descent rate; slows steep legs."""
    land_m_s: Speed = 0.5
    """Descent rate just above the ground. On PX4, if absent, 0.7 (`MPC_LAND_SPEED`)."""
    accel_m_s2: Accel = 1.5
    """Acceleration and braking along the path; ArduPilot peaks at 5/3 of it. On PX4, if absent, 3 (`MPC_ACC_HOR`)."""
    corner_accel_m_s2: Accel = 2.5
    """Acceleration that bounds the speed in a corner; ArduPilot has twice that. On PX4, if absent, 1.5 (half of 3)."""
    vertical_accel_m_s2: Accel = 1.0
    """Acceleration and braking in take-off and landing."""
    leg_jerk_m_s3: Accel = 1.0
    """Jerk of ArduPilot's S-curves (WPNAV_JERK). On PX4, if absent, 4 (`MPC_JERK_AUTO`)."""
    turn_radius_m: Length = 0.0
    """An arduplane's corners are planned and judged as arcs of it. Above 0: a fixed wing; if absent, a VTOL's at 30°
    of bank."""
    vtol: bool | None = None
    """Whether an arduplane takes off and lands vertically; if absent, where no `turn_radius_m` is given."""
    climb_out_m_s: Speed | None = None
    """Climb rate of a fixed wing's take-off, mean from leaving the ground to its altitude; if absent, not counted."""
    climb_out_speed_m_s: Speed | None = None
    """Its mean speed over ground meanwhile, in still air; if absent, what the fastest cruise speed leaves."""
    energy: EnergyKeys = EnergyKeys()
    """Energy that flying takes."""
    link: Text | None = None
    """URL for `--upload link`."""
    limits: LimitKeys | None = None
    """Limits of this vehicle alone; they may also be written beside its other keys."""


def _order_form(value: Any) -> Any:
    if value is not None and not isinstance(value, list) and value != "best":
        raise ValueError(f"must be a list of the vehicles' names, or best, given {shown(value)}")
    return value


_Order = Annotated[Annotated[Literal["best"], Tag("one")] | Annotated[list[str], Tag("several")], Discriminator(_count)]


MOST_GATES = 20
"""Most gates of a vehicle."""


def _gates_kind(value: Any) -> str:
    return "places" if isinstance(value, list) else "auto" if isinstance(value, str) else "count"


def _gates_form(value: Any) -> Any:
    if isinstance(value, list):
        return in_own_brackets(value)
    if value is not None and value != "auto" and (isinstance(value, bool) or not isinstance(value, int)):
        raise ValueError(f"must be auto, a number of gates, or a list of places, given {shown(value)}")
    return value


_Gates = Annotated[
    Annotated[Literal["auto"], Tag("auto")]
    | Annotated[Annotated[int, Field(ge=1, le=MOST_GATES)], Tag("count")]
    | Annotated[Annotated[list[Point], Field(min_length=1, max_length=MOST_GATES)], Tag("places")],
    Discriminator(_gates_kind),
]


class ArrivalKeys(Keys):
    """``arrival:``."""

    mode: Literal["sequence", "together", "none"]
    """One after the other, all at the same time, or without a rule."""
    order: Annotated[_Order | None, BeforeValidator(_order_form)] = None
    """Every vehicle's name once, or `best`; if absent, the order of the file."""
    interval_s: DaySeconds | None = None
    """Time between one arrival and the next; required for a sequence."""
    arrive_s: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    """Arrival time of the first of a sequence, or of all together."""
    clock: Literal["first", "fleet"] | None = None
    """Whose fastest flight sets the time of a sequence: the first vehicle's, or the whole fleet's."""
    hold: Literal["ground", "gate", "none"] = "ground"
    """Where a vehicle waits that would arrive too early."""
    window_s: DaySeconds = 0.0
    """Each vehicle may arrive this much earlier or later."""
    pad_clear_s: DaySeconds | None = None
    """Time after a landing at which the pad is free again; if absent, never."""
    separation_m: Length | None = None
    """Least distance between any two vehicles, from take-off to landing."""
    gates: Annotated[_Gates | None, BeforeValidator(_gates_form)] = None
    """How often each ArduCopter waits on its way until a second of the day: `auto`, a number, or a list of places."""
    leave_out: bool = False
    """Whether a vehicle without a mission is left out, by name, and the others planned; otherwise it refuses all."""


def _plain_values(parameters: dict[str, Any]) -> dict[str, Any]:
    for key, value in parameters.items():
        if not isinstance(value, int | float | str) or not (isinstance(value, str) or abs(value) <= LARGEST_KEY_M):
            raise ValueError(f"{key[:80]} must be a plain number or word, given {shown(value)}")
    return parameters


class WindLevelKeys(Keys):
    """One entry of ``levels:`` of ``wind:``."""

    agl_m: Length | None = None
    """Height above ground."""
    amsl_m: FiniteMetres | None = None
    """Altitude above sea level, in place of `agl_m`; all levels count from the same."""
    speed_m_s: WindSpeeds
    """Speed at this height, or [lowest, highest], or `5 ± 2`."""
    from_deg: WindDirections
    """Direction it comes from at this height, or a range clockwise, or `270 ± 20`."""


class WindKeys(Keys):
    """``wind:``: one of `speed_m_s`, `up_to_m_s`, `levels` and `forecast`. Without it the air is still."""

    speed_m_s: WindSpeeds | None = None
    """Speed of the wind, at every height; a range [lowest, highest], also as `5 ± 2`, is one unknown wind in it."""
    from_deg: WindDirections | None = None
    """Direction it comes from, clockwise from true north; or a range clockwise ([350, 20]), also as `270 ± 20`."""
    up_to_m_s: Annotated[float, Field(ge=0.0, le=MOST_DECLARED_M_S)] | None = None
    """One unknown wind of at most this speed, from any direction."""
    levels: Annotated[list[WindLevelKeys], Field(min_length=1, max_length=100)] | None = None
    """The wind by height, upwards: linear between two levels, and as the nearest level below and above all."""
    forecast: Text | None = None
    """A file as Open-Meteo's forecast API returns it (JSON, hourly wind); `at` must say when the flight begins."""
    speed_error_m_s: Annotated[float, Field(ge=0.0, le=MOST_DECLARED_M_S)] | None = None
    """With `forecast`: how much faster or slower the wind may be; if absent, 0."""
    from_error_deg: Annotated[float, Field(ge=0.0, le=180.0)] | None = None
    """With `forecast`: how far to either side of the forecast's direction it may come from; if absent, 0."""
    gust_m_s: Annotated[float, Field(ge=0.0, le=MOST_DECLARED_M_S)] | None = None
    """Highest speed in a gust, at least that of the wind; if absent, no gusts, or a forecast's own."""
    varying: bool = False
    """Whether the wind may be any of these at each place and time, instead of one during the whole flight."""


class PlannerKeys(Keys):
    """``planner:``; the keys below ``budget_mb`` belong to planners that search with a swarm."""

    name: Text = "optimal"
    """One of the [planners](planners.md)."""
    objective: Literal["length", "energy", "time"] = "length"
    """The quantity to minimise."""
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 1
    """Seed of all random numbers."""
    gap_percent: Annotated[float, Field(ge=0.0, le=100.0)] = 0.1
    """Planning stops when path and bound are this near to each other."""
    budget_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 10.0
    """Time for the search after the first path; a first path may take three times as long."""
    budget_mb: Annotated[float, Field(ge=64.0, le=1e6)] = 1024.0
    """Memory for the searches, in addition to the terrain itself."""
    encoding: EncodingName | None = None
    """How the numbers of a swarm become a path; `paper` is the encoding of the planner's own paper."""
    cost: SwarmCost | None = None
    """The paper whose cost a swarm minimises."""
    points: Annotated[int, Field(ge=1, le=1000)] | None = None
    """Number of way points of a swarm's path."""
    population: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Number of members of a swarm."""
    iterations: Annotated[int, Field(ge=1, le=10_000_000)] | None = None
    """Number of iterations of a swarm."""
    evaluations: Annotated[int, Field(ge=1, le=1_000_000_000)] | None = None
    """Most paths that a swarm may try."""
    warm_start: Text | None = None
    """A swarm begins around this path: `optimal`, the path of the default planner, or the name of another vehicle."""
    parameters: Annotated[dict[str, Any], AfterValidator(_plain_values)] | None = None
    """A swarm's own parameters, by name."""


PLAIN_PLANNER_KEYS = ("name", "objective", "seed", "gap_percent", "budget_s", "budget_mb")
"""Keys of ``planner:`` that count for every planner."""


class MissionKeys(Keys):
    """The whole file. Each of its sections is read separately."""

    version: Literal[1]
    """Version of this format."""
    name: Annotated[str, Field(min_length=1, max_length=300)] | None = None
    """Name of the mission; if absent, the file's own name."""
    terrain: TerrainKeys
    """The ground, and what stands on it."""
    limits: LimitKeys | None = None
    """Limits of every vehicle; a vehicle may override any of them."""
    no_fly: list[ZoneKeys] = []
    """Zones that no vehicle enters."""
    keep_in: list[ZoneKeys] = []
    """Areas, from floor to ceiling, whose union every flight stays in with all its errors."""
    at: Text | Annotated[list[Text], Field(min_length=2, max_length=2)] | None = None
    """When it is flown: a time, a day, or [from, to]; published zones that do not apply then are left out."""
    wind: WindKeys | None = None
    """The winds that may blow during the flight; if absent, still air."""
    vehicles: Annotated[list[VehicleKeys], Field(min_length=1, max_length=255)]
    """The vehicles, with their starts and goals."""
    arrival: ArrivalKeys | None = None
    """How several vehicles arrive; if absent, their separation is not judged."""
    way_home: Literal["required", "reported"] = "reported"
    """A return that is unsafe or not judged: refused with exit code 4, or a warning where the return is judged."""
    planner: PlannerKeys = PlannerKeys()
    """The planner, its objective and its budget."""
    altitude_frame: Literal["relative", "amsl", "terrain"] = "relative"
    """What the mission's altitudes count from: home, sea level, or the ground (not for px4)."""
    frame: FrameKeys | None = None
    """Makes this a mission in local metres, like the papers' worlds."""
    terrain_error_m: Annotated[float, Field(ge=0.0, le=1000.0)] | None = None
    """With `altitude_frame: terrain`: largest error of the vehicle's terrain; at an upload the vehicle decides."""


TOP_KEYS = tuple(MissionKeys.model_fields)


@cache
def text_keys() -> frozenset[str]:
    """The keys of all sections whose values are, or may be, text."""

    def takes_text(kind: Any) -> bool:
        return kind is str or any(map(takes_text, get_args(kind)))

    kinds = [Keys]
    for kind in kinds:
        kinds += kind.__subclasses__()
    return frozenset(key for kind in kinds for key, field in kind.model_fields.items() if takes_text(field.annotation))


def shown(value: Any) -> str:
    """A value in the words of a message: short, with text distinguished from numbers."""
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


def nearest(word: str, known: Iterable[str], most: int = 1) -> str:
    """``; did you mean …?`` with the nearest known words, ``most`` of them, or an empty text."""
    close = difflib.get_close_matches(word[:80], list(known), n=most, cutoff=0.6)
    return f"; did you mean {' or '.join(close)}?" if close else ""
