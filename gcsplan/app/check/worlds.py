"""The worlds in which files are checked: the world of a mission file, or one that options describe.

A site reads a file, knows the world that a number of files needs, and judges a file in it. Files are read before any is
judged, for they share one plane and one piece of terrain.
"""

from __future__ import annotations

import math
import os
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from gcsplan.app.check.fence_breaches import own_fence
from gcsplan.app.check.rally_points import own_rally
from gcsplan.app.fleet.pipeline import world_of
from gcsplan.app.plan.flight_hours import beyond_forecast, beyond_hours
from gcsplan.app.plan.way_home import home_of
from gcsplan.arrays import Floats
from gcsplan.check.flight.arc_waypoint import curve_bulge
from gcsplan.check.flight.times import DAY_S
from gcsplan.check.judge import judge
from gcsplan.check.motion.flight_state import TERRAIN_ERROR_M
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, UsageError
from gcsplan.mavlink.files.file_items import HAS_PLACE, MissionFileRead
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mavlink.mission.commands import LOITER_TIME, LOITER_TO_ALT, LOITER_TURNS, LOITER_UNLIM
from gcsplan.mavlink.mission.mission import NO_POSITION, Home, Mission, MissionItem
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.mission_file.options_world import KEY_OPTIONS, OpenWorld, WorldExtent, WorldOptions
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.vehicles import in_wind, slopes_in_wind
from gcsplan.notes.note import Note, Wording
from gcsplan.units import Units
from gcsplan.vehicle import DEFAULT_LEAN_DEG, Autopilot, Vehicle
from gcsplan.wind.declared import DeclaredWind, FlightWind
from gcsplan.world.geodesy.frame import FARTHEST_M
from gcsplan.world.world import World

HOME_MOVED_M = 1.0
"""A home row within this distance of the vehicle's start, m, counts as the start."""


CIRCLES = frozenset({LOITER_UNLIM, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALT})
DEFAULT_CIRCLE_M = 150.0
"""Radius of a circle, m, whose own radius is not stated: more than a plane's own circle needs at any altitude."""


EARLY_S = 6.0 * 3600.0
"""A departure so long before a gate is in time for it."""


@dataclass(frozen=True, slots=True)
class Checked:
    """One file, its vehicle, and the verdict in ``world``.

    ``fence`` and ``rally`` are the file's own. ``terrain_error_m`` is the error that terrain-frame legs were judged
    with. ``hours`` are those of the flight, if a zone was left out for them. ``way_home`` is None unless it was
    requested; ``home_required``: the mission flies only with a safe return. ``typed``: the options that the reader
    types, by their keys in a mission file; empty if he has one.
    """

    file: Path
    vehicle: Vehicle
    request: VehicleRequest
    mission: Mission
    verdict: Verdict
    notes: tuple[Note, ...]
    world: World
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    terrain_error_m: float = TERRAIN_ERROR_M
    way_home: WayHome | None = None
    home_required: bool = False
    hours: Hours | None = None
    typed: Mapping[str, str] = field(default_factory=dict)

    def wording(self, units: Units | None = None) -> Wording:
        """The wording for the reader, in ``units``, or in SI as files have it."""
        return Wording(units, self.typed)


@dataclass(frozen=True, slots=True)
class Returns:
    """Whether the way home is judged, and whether it must be safe, which means that it is judged too.

    ``rally``: the file's own rally points are judged, and returns lead to the nearest of home and these.
    """

    judged: bool = False
    required: bool = False
    rally: bool = True


NO_RETURNS = Returns()


@dataclass(frozen=True, slots=True)
class VerdictParts:
    """The parts that a verdict has: the way home, the nearest misses (half as much work again), and the times."""

    returns: Returns = NO_RETURNS
    misses: bool = True
    times: bool = True


class CheckSite(Protocol):
    """Where files are checked."""

    typed: Mapping[str, str]
    """The options that the reader types, by their keys in a mission file; empty if he has one."""

    def read(self, argument: str) -> MissionFileRead:
        """The mission of a FILE or NAME=FILE, as it is flown here. Raises InputError."""

    def settle(self, places: Floats, reach_m: float, *, several: bool) -> None:
        """Load the world of files that fly to ``places`` (N, 2), in degrees, and up to ``reach_m`` beyond.

        ``several``: they are of more than one file, which may lie too far apart for one world. Raises InputError.
        """

    def judged(self, argument: str, read: MissionFileRead, parts: VerdictParts) -> Checked:
        """A file that was read, judged. Raises InputError."""

    @property
    def sources(self) -> tuple[Mapping[str, object], tuple[Note, ...]]:
        """The sources of the world, and notes on them; empty before a world is loaded."""


class MissionSite:
    """The world of a mission file. Its vehicles start where the file says.

    ``held``: the content of files that lie on no disk, by their names.
    """

    def __init__(self, source: MissionFile, held: Mapping[str, bytes] | None = None) -> None:
        self.source = source
        self._held = held or {}
        self.typed: Mapping[str, str] = {}
        self._world: World | None = None

    def read(self, argument: str) -> MissionFileRead:
        """See `CheckSite.read`. Raises UsageError too, if it is not clear which vehicle the file is for."""
        request, file = match(self.source, argument)
        start = Home.at(*request.start_deg, request.start[2])
        pilot, data = request.vehicle.autopilot, self._held.get(str(file))
        return at_start(read_mission_file(file, autopilot=pilot, home_hint=start, data=data), start, request.vehicle)

    def settle(self, places: Floats, reach_m: float, *, several: bool) -> None:
        """See `CheckSite.settle`: more terrain is loaded if the files reach beyond the mission's terrain."""
        self.source, self._world = reaching(self.source, places), None

    def judged(self, argument: str, read: MissionFileRead, parts: VerdictParts) -> Checked:
        """See `CheckSite.judged`."""
        source = self.source
        request, file = match(source, argument)
        error_m = source.terrain_error_m if source.altitude_frame == "terrain" else TERRAIN_ERROR_M
        if self._world is None:
            self._world = world_of(source)
        wind = source.flight_wind(request)
        return judged(request, file, read, self._world, error_m, parts, source.hours, wind, source.leaves_s)

    @property
    def sources(self) -> tuple[Mapping[str, object], tuple[Note, ...]]:
        """See `CheckSite.sources`."""
        return self.source.inputs, (*self.source.changes, *self.source.notes)


class OptionsSite:
    """A world that options describe. Files that lie too far apart for one plane get a plane each.

    With ``autopilot`` None, a `.plan` file names its own; a `.waypoints` file names none and is judged for ArduCopter.
    """

    def __init__(self, options: WorldOptions, autopilot: Autopilot | None) -> None:
        self.options, self.autopilot = options, autopilot
        self.typed: Mapping[str, str] = KEY_OPTIONS
        self.opened = OpenWorld(options)
        self._hint = None if options.home is None else Home.at(*options.home, 0.0)
        self.extent: WorldExtent | None = None
        self._made: tuple[World, DeclaredWind] | None = None
        self._sources: tuple[Mapping[str, object], tuple[Note, ...]] = {}, ()

    def read(self, argument: str) -> MissionFileRead:
        """See `CheckSite.read`."""
        found = read_mission_file(
            Path(argument), autopilot=self.autopilot, home_hint=self._hint, otherwise=Autopilot.ARDUCOPTER
        )
        return _with_home(found, self._hint, argument)

    def settle(self, places: Floats, reach_m: float, *, several: bool) -> None:
        """See `CheckSite.settle`. Without a world for several, each gets its own as it is judged."""
        try:
            self.settle_in(self.opened.extent(places, reach_m))
        except InputError:
            if not several:
                raise
            self.extent = None

    def settle_in(self, extent: WorldExtent) -> None:
        """Load the world of an extent that another process found. Raises InputError."""
        self._made = self._over(extent)
        self.extent = extent

    def judged(self, argument: str, read: MissionFileRead, parts: VerdictParts) -> Checked:
        """See `CheckSite.judged`."""
        opened = self.opened
        made = self._made or self._over(opened.extent(places_of(read.mission), beyond_m(read.mission)))
        world, wind = made
        file = Path(argument)
        request = _request(opened, read.mission, file.stem, world, wind)
        flown = None if wind.still else FlightWind(wind, (opened.departs_s, opened.departs_s))
        error_m = self.options.terrain_error_m
        done = judged(request, file, read, world, error_m, parts, opened.hours, flown, opened.leaves_s)
        slopes = (slopes_in_wind(request.vehicle),) if request.vehicle.blows_m_s else ()
        return replace(done, typed=self.typed, notes=(*done.notes, *slopes))

    def _over(self, extent: WorldExtent) -> tuple[World, DeclaredWind]:
        """The world of an extent, and its winds; the sources of the first world stand for all of them."""
        world, inputs = self.opened.over(extent)
        if not self._sources[0]:
            notes = inputs.get("notes", ())
            self._sources = {k: v for k, v in inputs.items() if k != "notes"}, notes if isinstance(notes, tuple) else ()
        return world, self.opened.wind(extent)[0]

    @property
    def sources(self) -> tuple[Mapping[str, object], tuple[Note, ...]]:
        """See `CheckSite.sources`."""
        return self._sources


def split_name(argument: str) -> tuple[str | None, Path]:
    """Split ``uav1=FILE`` or ``FILE`` into the vehicle's name (None without one) and the file."""
    name, equals, file = argument.partition("=")
    if equals and re.fullmatch(r"[A-Za-z0-9_-]+", name) and not os.path.exists(argument):
        return name, Path(file)
    return None, Path(argument)


def match(source: MissionFile, argument: str) -> tuple[VehicleRequest, Path]:
    """The vehicle that a file is for: by name, by the file's stem, or the only one. Raises UsageError if unclear."""
    name, file = split_name(argument)
    by_name = {r.vehicle.name: r for r in source.vehicles}
    if name is not None:
        if name not in by_name:
            raise UsageError(f"{argument}: the mission file has no vehicle {name!r}; it has {', '.join(by_name)}")
        return by_name[name], file
    if file.stem in by_name:
        return by_name[file.stem], file
    if len(by_name) == 1:
        return next(iter(by_name.values())), file
    raise UsageError(
        f"{argument}: which vehicle is it for? Write NAME={shlex.quote(str(file))} with one of {', '.join(by_name)}"
    )


def at_start(read: MissionFileRead, start: Home, vehicle: Vehicle) -> MissionFileRead:
    """The mission as ``vehicle`` flies it from its start: no autopilot flies from a file's home row."""
    from gcsplan.mavlink.link.session.preflight import (
        distance_m,  # loads the MAVLink dialect, which planning does not need
    )

    mission = replace(read.mission, name=vehicle.name, sysid=vehicle.sysid)
    notes: list[Note] = list(read.notes)
    home, place = mission.home, (start.lat_e7 / 1e7, start.lon_e7 / 1e7)
    if home.lat_e7 == 0 and home.lon_e7 == 0:
        notes.append(Note("home_row_blank"))
        mission = replace(mission, home=start)
    elif distance_m(home.lat_e7 / 1e7, home.lon_e7 / 1e7, *place) > HOME_MOVED_M:
        notes.append(Note("home_row_elsewhere"))
        mission = replace(mission, home=start)
    return replace(read, mission=mission, notes=tuple(notes))


def places_of(mission: Mission) -> list[tuple[float, float]]:
    """Latitude and longitude of home and of every item that has a place."""
    home = mission.home
    placed = [i for i in mission.items if i.command in HAS_PLACE and i.frame != NO_POSITION and (i.x or i.y)]
    return [(home.lat_e7 / 1e7, home.lon_e7 / 1e7), *((i.lat_deg, i.lon_deg) for i in placed)]


def beyond_m(mission: Mission) -> float:
    """How far from its places a mission may fly, m: the radius of its widest circle plus the bulge of its curves."""
    circles = [p for i in mission.items if i.command in CIRCLES for p in i.params[1:3]]
    widest = max((min(abs(p), 3000.0) for p in circles if math.isfinite(p)), default=0.0)
    bulge = max(map(curve_bulge, mission.items), default=0.0)
    if bulge and (extent_m := _extent_m(places_of(mission))) <= 2.0 * FARTHEST_M:  # a wider mission is refused later
        widest += bulge * extent_m
    return float(widest) + DEFAULT_CIRCLE_M


def _extent_m(places: Sequence[tuple[float, float]]) -> float:
    """Upper bound of the diagonal of the box around ``places``, m. The box may cross the antimeridian."""
    lat, lon = zip(*places, strict=True)
    turned = [(x - lon[0] + 180.0) % 360.0 - 180.0 for x in lon]
    nearest = 0.0 if min(lat) < 0.0 < max(lat) else min(map(abs, lat))  # to the equator, where a degree is longest
    wide = math.cos(math.radians(nearest)) * (max(turned) - min(turned))
    return 111_700.0 * math.hypot(max(lat) - min(lat), wide)


def reaching(source: MissionFile, places: Floats | Sequence[tuple[float, float]]) -> MissionFile:
    """``source`` with terrain loaded as far as ``places``; ``source`` itself if it covers them or cannot load more."""
    world = world_of(source)
    at = np.array(places, dtype=float).reshape(-1, 2)
    at = at[(np.abs(at[:, 0]) <= 90.0) & (np.abs(at[:, 1]) <= 180.0)]
    ground = world.airspace.surface.ground_at(*world.frame.to_plane(at[:, 0], at[:, 1]).T)
    unknown = [(lat, lon) for lat, lon in at[np.isnan(ground)].tolist()]
    return source.reaching(unknown) if unknown and source.reaching is not None else source


def _with_home(read: MissionFileRead, given: Home | None, argument: str) -> MissionFileRead:
    """The mission with the home of the options, if they have one. Raises InputError if no home is known."""
    home = read.mission.home
    if given is not None:
        note = () if home == given else (Note("home_given"),)
        return replace(read, mission=replace(read.mission, home=given), notes=(*read.notes, *note))
    if home.lat_e7 == home.lon_e7 == 0:
        raise InputError(
            "the file's home is blank (0, 0), and altitudes count from it: give it with --home LAT,LON", where=argument
        )
    return read


def _request(
    opened: OpenWorld, mission: Mission, name: str, world: World, wind: DeclaredWind
) -> VehicleRequest:  # fmt: skip
    at = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
    east, north = (float(x) for x in world.frame.to_plane(*at))
    place = (east, north, world.ground_amsl(*at))
    vehicle = opened.vehicle(re.sub(r"[^A-Za-z0-9_-]", "_", name) or "file", mission.autopilot.value)
    vehicle, o = in_wind(vehicle, wind), opened.options
    if not wind.still and vehicle.autopilot is Autopilot.ARDUCOPTER:  # a mission file would say it, or mean the default
        vehicle = replace(vehicle, lean_angle_deg=DEFAULT_LEAN_DEG)
    return VehicleRequest(vehicle, place, place, at, at, rtl_rel_home_m=o.rtl_rel_home_m, return_route=o.return_route)


def judged(
    request: VehicleRequest, file: Path, read: MissionFileRead, world: World, terrain_error_m: float,
    parts: VerdictParts, hours: Hours | None = None, wind: FlightWind | None = None, leaves_s: float | None = None,
) -> Checked:  # fmt: skip
    """Judge a mission that was read from ``file``, for a vehicle in a world. Raises InputError.

    ``hours``: the hours for which zones of the world were left out, from the departure on; the part of a flight beyond
    them is not judged. ``wind``: the declared winds; None: still air. ``leaves_s``: when the vehicle leaves the ground,
    seconds UTC since 1970; None: not known, unless the mission says it.
    """
    returns, asks_home = parts.returns, parts.returns.judged or parts.returns.required
    vehicle, mission = request.vehicle, read.mission
    notes: list[Note] = list(read.notes)
    if mission.autopilot is not vehicle.autopilot:
        raise InputError(f"is for {mission.autopilot}, and {vehicle.name} is {vehicle.autopilot}", where=str(file))
    ground = world.ground_amsl(mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7)
    if not math.isnan(ground) and Note("home_given") in notes:
        mission = replace(mission, home=replace(mission.home, amsl_m=round(ground, 2)))
    mission = replace(mission, name=vehicle.name, sysid=vehicle.sysid)
    if mission.leaves_s is None:
        mission = replace(mission, leaves_s=leaves_s)
    verdict = _departing(mission, partial(
        judge, vehicle=vehicle, world=world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=terrain_error_m,
        misses=parts.misses, times=parts.times or asks_home or hours is not None, wind=wind,
    ))  # fmt: skip
    verdict, fence_notes = own_fence(read.fence, verdict, vehicle, world, request.rtl_rel_home_m)
    more = [note for note in (beyond_hours(verdict, hours), beyond_forecast(verdict)) if note]
    verdict = replace(verdict, not_judged=(*verdict.not_judged, *read.not_judged, *more))
    points = read.rally if returns.rally else ()
    verdict, rally_notes = own_rally(points, read.fence, verdict, request, world)
    notes += [*fence_notes, *rally_notes]
    loops = any(note.code == "jumps_without_end" for note in verdict.notes)
    if verdict.legs and verdict.legs[-1].kind == "cruise" and not loops:
        notes.append(Note("ends_in_the_air"))
    home: WayHome | None = None
    if asks_home:
        home = home_of(verdict, request, world, terrain_error_m, points)
        notes += home.notes
    return Checked(
        file, vehicle, request, mission, verdict, tuple(notes), world, read.fence, read.rally, terrain_error_m, home,
        returns.required, hours,
    )  # fmt: skip


def _departing(mission: Mission, judging: Callable[[Mission], Verdict]) -> Verdict:
    """The verdict on a mission that leaves the ground when it says.

    If it does not say, the verdict is on the latest departure with which it is at its first gate in time. Whether it
    leaves by then is not judged; the gates after the first do not depend on it.
    """
    opens_s = next((item.until_s for item in mission.items if item.until_s is not None), None)
    tried = mission if mission.leaves_s is not None or opens_s is None else replace(mission, leaves_s=opens_s - EARLY_S)
    verdict = judging(tried)
    gates = [leg for leg in verdict.legs if leg.until_s is not None]
    if not gates or tried.leaves_s is None:
        return verdict if tried is mission else judging(mission)
    first, opens_s = gates[0], tried.leaves_s + (gates[0].until_s or 0.0)
    if tried is mission:
        note = Note("gates_since_departure", first.seq, leaves=_of_day(tried.leaves_s))
        return replace(verdict, notes=(*verdict.notes, note))
    leaves_s = round(opens_s - verdict.gates_after_s()[0])  # as a plan rounds when a gate opens
    note = Note("gate_departure_unknown", first.seq, opens=_of_day(opens_s), leaves=_of_day(leaves_s))
    verdict = judging(replace(mission, leaves_s=leaves_s))
    return replace(verdict, mission=mission, not_judged=(*verdict.not_judged, note))


def _of_day(utc_s: float) -> str:
    return f"{datetime.fromtimestamp(utc_s % DAY_S, UTC):%H:%M:%S}"
