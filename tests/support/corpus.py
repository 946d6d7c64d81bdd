"""Mission files as other programs write them, generated on demand: clean ones, and ones with a single fault each.

The world: ground at 400 m with a hill of 300 m in its middle, a tower in the east without height limits, and a wood in
the west up to 80 m above ground. Places are metres east and north of the middle.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio.transform import Affine

LAT, LON = 47.0, 8.0
NORTH_M, EAST_M = 111_177.0, 76_056.0  # metres per degree at this place
GROUND_M = 400.0
HOME = (-4000.0, -2000.0)
HALF_DEG = 0.06
OPTIONS: dict[str, float] = {
    "min_agl_m": 60.0, "max_amsl_m": 750.0, "horizontal_clearance_m": 30.0, "track_error_m": 3.0,
    "altitude_error_m": 5.0, "max_climb_deg": 20.0,
}  # fmt: skip
RTL_M = 150.0

TAKEOFF, WAYPOINT, LOITER_UNLIM, TURNS, LOITER_TIME, RTL, LAND, SPLINE = 22, 16, 17, 18, 19, 20, 21, 82
DELAY, JUMP, SPEED, ROI, CAMERA, CONDITION = 93, 177, 178, 195, 206, 112


@dataclass(frozen=True)
class Item:
    """One item. ``east_m`` None: it has no position; ``target``: index of the item that a jump leads to."""

    command: int
    east_m: float | None = None
    north_m: float = 0.0
    z: float = 0.0
    frame: int = 3
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    target: int | None = None

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude; 0, 0 for an item without a position."""
        return (0.0, 0.0) if self.east_m is None else degrees(self.east_m, self.north_m)


@dataclass(frozen=True)
class Case:
    """A mission. ``kinds``: its expected findings (empty: it is clean); ``at``: indices of the items at fault."""

    name: str
    items: tuple[Item, ...]
    kinds: frozenset[str] = frozenset()
    at: frozenset[int] = frozenset()
    only: str = ""


def degrees(east_m: float, north_m: float) -> tuple[float, float]:
    """Latitude and longitude of a place in metres."""
    return LAT + north_m / NORTH_M, LON + east_m / EAST_M


def to(east: float, north: float, z: float = 120.0, command: int = WAYPOINT, **more: Any) -> Item:
    """An item at a place; a way point unless another command is named."""
    return Item(command, east, north, z, **more)


UP = to(*HOME, 100.0, TAKEOFF)
A, B, C, D, E, F, G = (
    to(-2000, -2000), to(0, -2000), to(2500, -1000), to(4000, 0), to(2500, 1000), to(0, 2000), to(-2000, 2000),
)  # fmt: skip
DOWN = to(-2000, 2000, 0.0, LAND)


def write_world(folder: Path) -> tuple[str, str]:
    """Write the DEM and the file of zones; return their names."""
    n = 161
    axis = np.linspace(-HALF_DEG, HALF_DEG, n)
    east, north = np.meshgrid(axis * EAST_M, axis[::-1] * NORTH_M)
    heights = GROUND_M + 300.0 * np.exp(-(east**2 + north**2) / (2 * 400.0**2))
    step = axis[1] - axis[0]
    dem = folder / "dem.tif"
    with rasterio.open(
        dem, "w", driver="GTiff", width=n, height=n, count=1, dtype="float32", crs="EPSG:4326",
        transform=Affine(step, 0, LON - HALF_DEG - step / 2, 0, -step, LAT + HALF_DEG + step / 2),
    ) as raster:  # fmt: skip
        raster.write(heights.astype("float32"), 1)
    lat, lon = degrees(2500, 0)
    wood = [degrees(e, n)[::-1] for e, n in ((-3000, -500), (-2000, -500), (-2000, 500), (-3000, 500), (-3000, -500))]
    features = [
        {"type": "Feature", "properties": {"name": "tower", "radius_m": 200},
         "geometry": {"type": "Point", "coordinates": [lon, lat]}},
        {"type": "Feature", "properties": {"name": "wood", "ceiling_agl_m": 80},
         "geometry": {"type": "Polygon", "coordinates": [wood]}},
    ]  # fmt: skip
    zones = folder / "zones.geojson"
    zones.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return str(dem), str(zones)


def cases() -> list[Case]:
    """Clean missions, then missions with one planted fault each."""
    round_it = (UP, A, B, C, D, E, F, G, DOWN)

    def planted(name: str, items: tuple[Item, ...], kinds: str, *at: int, only: str = "") -> Case:
        return Case(name, items, frozenset(kinds.split()), frozenset(at), only)

    def jump(target: int, rounds: float) -> Item:
        return Item(JUMP, frame=2, params=(0.0, rounds, 0.0, 0.0), target=target)

    def turns(radius: float) -> tuple[Item, ...]:
        circle = to(2500, -600, 120.0, TURNS, params=(2.0, 0.0, radius, 0.0))
        return (UP, A, B, C, circle, C, D, E, F, G, DOWN)

    def spline(hold: float) -> tuple[Item, ...]:
        south, corner = to(2500, -2000), to(2500, -400, params=(hold, 0.0, 0.0, 0.0))
        return (UP, A, south, corner, to(3500, -400, 120.0, SPLINE), to(4500, -400), D, E, F, G, DOWN)

    servants = (
        Item(SPEED, frame=2, params=(1.0, 8.0, -1.0, 0.0)), Item(CAMERA, frame=2, params=(25.0, 0.0, 0.0, 0.0)),
        Item(CONDITION, frame=2, params=(5.0, 0.0, 0.0, 0.0)), to(0, 0, 0.0, ROI, frame=0),
        Item(DELAY, frame=2, params=(10.0, -1.0, -1.0, -1.0)),
    )  # fmt: skip
    home = Item(RTL, frame=2)
    many = tuple(to(-2000 + 3 * i, -2000) for i in range(690))
    return [
        Case("round", round_it),
        Case("servants", (UP, A, *servants, B, C, D, E, F, G, DOWN)),
        Case("holds", (UP, replace(A, params=(5.0, 0.0, 0.0, 0.0)), B, replace(C, command=LOITER_TIME,
             params=(30.0, 0.0, 0.0, 0.0)), D, E, F, G, DOWN)),
        Case("here_and_as_high", (UP, A, replace(B, z=0.0), Item(LOITER_TIME, z=0.0, params=(9.0, 0.0, 0.0, 0.0)), C, D,
             E, F, G, DOWN), only="copter"),
        Case("unlimited", (UP, A, B, replace(C, command=LOITER_UNLIM))),
        Case("sea_level", (UP, A, B, C, D, E, replace(F, frame=0, z=520.0), G, DOWN)),
        Case("above_terrain", (UP, A, B, C, D, E, replace(F, frame=10, z=130.0), G, DOWN), only="copter"),
        Case("jump", (UP, A, B, C, D, jump(3, 3.0), E, F, G, DOWN)),
        Case("circle", turns(300.0), only="copter"),
        Case("spline", spline(5.0), only="copter"),
        Case("home", (UP, A, B, C, D, E, F, G, home)),
        Case("seven_hundred", (UP, *many, B, C, D, E, F, G, DOWN), only="px4"),
        planted("too_many", (UP, *many, B, C, D, E, F, G, DOWN), "too_many_items", -1, only="copter"),
        planted("hill_between", (UP, A, B, F, G, DOWN), "min_agl terrain_clearance", 3),
        planted("through_zone", (UP, A, B, C, E, F, G, DOWN), "zone", 4),
        planted("low_over_wood", (UP, to(-2500, -1000, 65.0), to(-2500, 1000, 65.0), DOWN), "zone min_agl", 1, 2, 3),
        planted("too_high", (UP, A, B, C, replace(D, z=380.0), E, F, G, DOWN), "max_amsl", 4, 5),
        planted("too_steep", (UP, A, B, C, to(2600, -1000, 220.0), D, E, F, G, DOWN), "climb", 4),
        planted("outside", (UP, A, B, C, to(9000, 0), E, F, G, DOWN), "coverage", 4, 5),
        planted("low_above_sea", (UP, A, B, C, D, E, replace(F, frame=0, z=440.0), G, DOWN), "min_agl", 6, 7),
        planted("low_above_terrain", (UP, A, B, C, D, E, replace(F, frame=10, z=90.0), G, DOWN), "min_agl", 6, 7,
                only="copter"),
        planted("jump_through_zone", (UP, A, B, C, D, E, jump(3, 1.0), F, G, DOWN), "zone", 3),
        planted("jump_for_ever", (UP, A, B, C, D, E, jump(3, -1.0), F, G, DOWN), "zone unreachable", 3, 7,
                only="copter"),
        planted("circle_into_zone", turns(400.0), "zone", 4, 5, only="copter"),  # it may leave the circle at any point
        planted("curve_into_zone", spline(0.0), "zone", 4, only="copter"),
        planted("home_over_hill", (UP, A, B, C, D, to(4000, 2000), home), "min_agl terrain_clearance", 6),
        planted("low_take_off", (to(*HOME, 50.0, TAKEOFF), A, B, C, D, E, F, G, DOWN), "min_agl", 1),
    ]  # fmt: skip


# -- writers: one for each program's file style -----------------------------------------------------------------------


def _rows(items: tuple[Item, ...], first: int) -> list[tuple[int, Item, tuple[float, float, float, float]]]:
    rows = []
    for index, item in enumerate(items):
        params = item.params if item.target is None else (float(item.target + first), *item.params[1:])
        rows.append((first + index, item, params))
    return rows


def _text(items: tuple[Item, ...], home: str | None, number: Callable[[float], str], header: str = "110") -> list[str]:
    lines = [f"QGC WPL {header}"] + ([home] if home is not None else [])
    for seq, item, params in _rows(items, 1 if home is not None else 0):
        lat, lon = item.place
        numbers = "\t".join(number(v) for v in (*params, lat, lon, item.z))
        lines.append(f"{seq}\t{int(home is None and seq == 0)}\t{item.frame}\t{item.command}\t{numbers}\t1")
    return lines


def _home_row(number: Callable[[float], str]) -> str:
    lat, lon = degrees(*HOME)
    return "\t".join(["0", "1", "0", "16", *(number(v) for v in (0, 0, 0, 0, lat, lon, GROUND_M)), "1"])


def qgroundcontrol(items: tuple[Item, ...]) -> str:
    """QGroundControl's style: TABs, LF, home first, many decimals."""
    return "\n".join(_text(items, _home_row("{:.15g}".format), "{:.15g}".format)) + "\n"


def qgroundcontrol_120(items: tuple[Item, ...]) -> str:
    """QGroundControl's style with the version 120 header, without a home."""
    return "\n".join(_text(items, None, "{:.12g}".format, "120")) + "\n"


def mission_planner(items: tuple[Item, ...]) -> str:
    """Mission Planner's style: a home of zeros, comments, blank lines, eight decimals, CRLF."""
    lines = _text(items, "0\t1\t0\t0\t0\t0\t0\t0\t0.000000\t0.000000\t0.000000\t1", "{:.8f}".format)
    return "\r\n".join([lines[0], "# saved by hand", *lines[1:3], "", "# and on", *lines[3:], ""])


def mavproxy(items: tuple[Item, ...]) -> str:
    """MAVProxy's style: six decimals."""
    return "\n".join(_text(items, _home_row("{:f}".format), "{:f}".format)) + "\n"


def spaces_and_a_mark(items: tuple[Item, ...]) -> str:
    """A byte order mark, spaces for TABs, CRLF: the result of saving from an editor or a spreadsheet."""
    return "\ufeff" + qgroundcontrol(items).replace("\t", "  ").replace("\n", "\r\n")


def plan(items: tuple[Item, ...], firmware: int = 3, *, survey: bool = False) -> str:
    """QGroundControl's JSON: null for missing numbers, altitudes twice; ``survey``: way points in a complex item."""
    entries: list[dict[str, Any]] = []
    for number, item, params in _rows(items, 1):
        lat, lon = item.place
        placed = item.east_m is not None
        yaw = None if placed and item.command in (WAYPOINT, TAKEOFF, LAND) else params[3]
        entry: dict[str, Any] = {
            "AMSLAltAboveTerrain": None, "Altitude": item.z, "AltitudeMode": 1, "autoContinue": True,
            "command": item.command, "doJumpId": number, "frame": item.frame,
            "params": [*params[:3], yaw, lat, lon, item.z], "type": "SimpleItem",
        }  # fmt: skip
        if not placed:
            for key in ("AMSLAltAboveTerrain", "Altitude", "AltitudeMode"):
                del entry[key]
        entries.append(entry)
    if survey:  # the items between the first way point and the last three items
        inner = entries[2:-3]
        style = {"CameraCalc": {"version": 1}, "Items": inner, "version": 1, "Refly90Degrees": False}
        entries[2:-3] = [
            {"TransectStyleComplexItem": style, "complexItemType": "survey", "type": "ComplexItem", "version": 5}
        ]
    lat, lon = degrees(*HOME)
    return json.dumps(
        {
            "fileType": "Plan", "geoFence": {"circles": [], "polygons": [], "version": 2},
            "groundStation": "QGroundControl",
            "mission": {
                "cruiseSpeed": 15, "firmwareType": firmware, "globalPlanAltitudeMode": 1, "hoverSpeed": 5,
                "items": entries, "plannedHomePosition": [lat, lon, GROUND_M], "vehicleType": 2, "version": 2,
            },
            "rallyPoints": {"points": [], "version": 2}, "version": 1,
        },
        indent=4,
    )  # fmt: skip


WITH_HOME: dict[str, tuple[str, Callable[[tuple[Item, ...]], str]]] = {
    "qgc": ("waypoints", qgroundcontrol),
    "mavproxy": ("waypoints", mavproxy),
    "editor": ("txt", spaces_and_a_mark),
    "plan": ("plan", plan),
    "survey": ("plan", lambda items: plan(items, survey=True)),
}
WITHOUT_HOME: dict[str, tuple[str, Callable[[tuple[Item, ...]], str]]] = {
    "qgc120": ("waypoints", qgroundcontrol_120),
    "planner": ("waypoints", mission_planner),
}
PX4: dict[str, tuple[str, Callable[[tuple[Item, ...]], str]]] = {"px4": ("plan", lambda items: plan(items, 12))}


def write(folder: Path, manners: dict[str, tuple[str, Callable[[tuple[Item, ...]], str]]]) -> dict[str, Case]:
    """Write a file for each case in each style that can express it; return path to case."""
    written: dict[str, Case] = {}
    for manner, (ending, text) in manners.items():
        for case in cases():
            if case.only not in ("", "px4" if manner == "px4" else "copter"):
                continue
            if manner == "survey" and (len(case.items) < 8 or any(i.command == JUMP for i in case.items)):
                continue  # too few items for a survey, or a jump: items inside a survey have no number to jump to
            file = folder / f"{manner}-{case.name}.{ending}"
            file.write_bytes(text(case.items).encode())
            written[str(file)] = case
    return written
