"""Check any `.waypoints` and `.plan` files in the world of a mission file, or in a world made from options."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.app.fencing import own_fence
from gcsplan.app.option_words import all_in_options, home_in_options, verdict_in_options
from gcsplan.app.pipeline import world_of
from gcsplan.app.way_home import home_of, is_required, lets_fly
from gcsplan.check.arc_waypoint import curve_bulge
from gcsplan.check.judge import TERRAIN_ERROR_M, judge
from gcsplan.check.rtl.verdict import WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, InputError, Problem, UsageError
from gcsplan.mavlink.files.file_items import HAS_PLACE, MissionFileRead
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mavlink.mission.commands import (
    LOITER_TIME,
    LOITER_TO_ALT,
    LOITER_TURNS,
    LOITER_UNLIM,
)
from gcsplan.mavlink.mission.mission import NO_POSITION, Home, Mission, MissionItem
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.mission_file.from_options import OpenWorld, WorldOptions
from gcsplan.units import METRIC, Units, UnitText, in_units
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.frame import FARTHEST_M
from gcsplan.world.world import World

SAME_PLACE_M = 1.0
"""A home row within this distance of the vehicle's start, m, counts as the start."""


CIRCLES = frozenset({LOITER_UNLIM, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALT})
DEFAULT_CIRCLE_M = 150.0
"""Radius of a circle, m, whose own radius is not stated: more than a plane's own circle needs at any altitude."""

"""A spline's two tangents together are at most four times its length, so it bulges by at most 16/27 of its length."""


@dataclass(frozen=True, slots=True)
class Checked:
    """One file, its vehicle, and the verdict in ``world``.

    ``fence`` and ``rally`` are the file's own. ``terrain_error_m`` is the error that terrain-frame legs were judged
    with. ``way_home`` is None unless it was requested; ``home_required``: the mission flies only with a safe return.
    """

    file: Path
    vehicle: Vehicle
    request: VehicleRequest
    mission: Mission
    verdict: Verdict
    notes: tuple[str, ...]
    world: World
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    terrain_error_m: float = TERRAIN_ERROR_M
    way_home: WayHome | None = None
    home_required: bool = False


@dataclass(frozen=True, slots=True)
class Returns:
    """Whether the way home is judged, and whether it must be safe, which means that it is judged too."""

    judged: bool = False
    required: bool = False


@dataclass(frozen=True)
class Batch:
    """Several files: those that were judged, and the errors of the others. ``inputs`` describes the world."""

    name: str
    checked: tuple[Checked, ...]
    unreadable: tuple[tuple[str, InputError], ...] = ()
    inputs: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


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
    raise UsageError(f"{argument}: which vehicle is it for? Write NAME={file} with one of {', '.join(by_name)}")


def check_files(source: MissionFile, arguments: Sequence[str], *, returns: Returns = Returns()) -> list[Checked]:
    """Judge each FILE or NAME=FILE in the world of ``source``. Raises InputError or UsageError for unreadable files."""
    batch = check_batch(source, arguments, returns=returns)
    if batch.unreadable:
        if len(batch.unreadable) == 1:
            raise batch.unreadable[0][1]
        raise InputError.of([p for _, error in batch.unreadable for p in error.problems])
    return list(batch.checked)


def check_batch(source: MissionFile, arguments: Sequence[str], *, returns: Returns = Returns()) -> Batch:
    """Judge each FILE or NAME=FILE in the world of ``source``; a file that cannot be read does not stop the others.

    ``returns``: what of the way home is asked for, beside the mission file's own ``way_home``. If a file reaches beyond
    the terrain that was loaded for the mission, more terrain is loaded. Raises UsageError if it is not clear which
    vehicle a file is for.
    """
    requests = [match(source, argument) for argument in arguments]
    read: list[tuple[VehicleRequest, Path, MissionFileRead]] = []
    unreadable = []
    for argument, (request, file) in zip(arguments, requests, strict=True):
        try:
            start = Home.at(*request.start_deg, request.start[2])
            found = read_mission_file(file, autopilot=request.vehicle.autopilot, home_hint=start)
            read.append((request, file, _at_start(found, start, request.vehicle)))
        except InputError as error:
            unreadable.append((argument, error))
    source = _reaching(source, [place for _, _, r in read for place in places_of(r.mission)])
    world = world_of(source)
    error_m = source.terrain_error_m if source.altitude_frame == "terrain" else TERRAIN_ERROR_M
    returns = Returns(returns.judged, is_required(source, returns.required))
    checked = [_judged(request, file, r, world, error_m, returns) for request, file, r in read]
    return Batch(source.name, tuple(checked), tuple(unreadable), source.inputs, source.notes)


def check_mission(source: MissionFile, mission: Mission, vehicle: str | None = None) -> Checked:
    """Judge mission items in the world of ``source``, for the named vehicle or else the one that the mission names.

    Raises UsageError if the mission file has no such vehicle.
    """
    request, file = match(source, mission.name if vehicle is None else f"{vehicle}={mission.name}")
    start = Home.at(*request.start_deg, request.start[2])
    read = _at_start(MissionFileRead(mission), start, request.vehicle)
    source = _reaching(source, places_of(read.mission))
    error_m = source.terrain_error_m if source.altitude_frame == "terrain" else TERRAIN_ERROR_M
    return _judged(request, file, read, world_of(source), error_m, Returns())


def _at_start(read: MissionFileRead, start: Home, vehicle: Vehicle) -> MissionFileRead:
    """The mission as ``vehicle`` flies it from its start: no autopilot flies from a file's home row."""
    from gcsplan.mavlink.link.preflight import distance_m  # loads the MAVLink dialect, which planning does not need

    mission, notes = replace(read.mission, name=vehicle.name, sysid=vehicle.sysid), list(read.notes)
    home, place = mission.home, (start.lat_e7 / 1e7, start.lon_e7 / 1e7)
    if home.lat_e7 == 0 and home.lon_e7 == 0:
        notes.append("the file's home row is blank: the vehicle's start in the mission file was taken for home")
        mission = replace(mission, home=start)
    elif distance_m(home.lat_e7 / 1e7, home.lon_e7 / 1e7, *place) > SAME_PLACE_M:
        notes.append("the file's home row lies elsewhere: the vehicle's start in the mission file was taken for home")
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


def _reaching(source: MissionFile, places: Sequence[tuple[float, float]]) -> MissionFile:
    """``source`` with terrain loaded as far as ``places``; ``source`` itself if it covers them or cannot load more."""
    world = world_of(source)
    at = np.array(places, dtype=float).reshape(-1, 2)
    at = at[(np.abs(at[:, 0]) <= 90.0) & (np.abs(at[:, 1]) <= 180.0)]
    ground = world.airspace.surface.ground_at(*world.frame.to_plane(at[:, 0], at[:, 1]).T)
    unknown = [(lat, lon) for lat, lon in at[np.isnan(ground)].tolist()]
    return source.reaching(unknown) if unknown and source.reaching is not None else source


def check_with_options(
    options: WorldOptions, autopilot: Autopilot | None, arguments: Sequence[str], *, returns: Returns = Returns()
) -> Batch:
    """Judge each FILE in the world that ``options`` describe.

    With ``autopilot`` None, a `.plan` file names its own; a `.waypoints` file names none and is judged for ArduCopter.
    Files that lie too far apart for one plane get a plane each. ``returns``: what of the way home is asked for.
    Raises InputError if the options are wrong.
    """
    opened = OpenWorld(options)
    hint = None if options.home is None else Home.at(*options.home, 0.0)
    read: list[tuple[str, Path, MissionFileRead]] = []
    unreadable: list[tuple[str, InputError]] = []
    for argument in arguments:
        file = Path(argument)
        try:
            found = read_mission_file(file, autopilot=autopilot, home_hint=hint, otherwise=Autopilot.ARDUCOPTER)
            read.append((argument, file, _with_home(found, hint, argument)))
        except InputError as error:
            unreadable.append((argument, error))
    every = [place for _, _, r in read for place in places_of(r.mission)]
    shared: tuple[World, dict[str, object]] | None = None
    if read:
        try:
            shared = opened.around(every, max(beyond_m(r.mission) for _, _, r in read))
        except InputError:
            if len(read) == 1:
                raise
    checked: list[Checked] = []
    inputs: dict[str, object] = dict(shared[1]) if shared is not None else {}
    for argument, file, r in read:
        try:
            world, described = (
                shared if shared is not None else opened.around(places_of(r.mission), beyond_m(r.mission))
            )
            inputs = inputs or dict(described)
            request = _request(opened, r.mission, file.stem, world)
            done = _judged(request, file, r, world, options.terrain_error_m, returns)
            verdict, home = verdict_in_options(done.verdict), home_in_options(done.way_home)
            checked.append(replace(done, verdict=verdict, way_home=home, notes=all_in_options(done.notes)))
        except InputError as error:
            unreadable.append((argument, error))
    notes = inputs.pop("notes", ())
    said = all_in_options(notes) if isinstance(notes, tuple) else ()
    return Batch("check", tuple(checked), tuple(unreadable), inputs, said)


def _with_home(read: MissionFileRead, given: Home | None, argument: str) -> MissionFileRead:
    """The mission with the home of the options, if they have one. Raises InputError if no home is known."""
    home = read.mission.home
    if given is not None:
        note = () if home == given else ("--home was taken for the file's home",)
        return replace(read, mission=replace(read.mission, home=given), notes=(*read.notes, *note))
    if home.lat_e7 == home.lon_e7 == 0:
        raise InputError(
            "the file's home is blank (0, 0), and altitudes count from it: give it with --home LAT,LON", where=argument
        )
    return read


def _request(opened: OpenWorld, mission: Mission, name: str, world: World) -> VehicleRequest:
    at = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
    east, north = (float(x) for x in world.frame.to_plane(*at))
    place = (east, north, world.ground_amsl(*at))
    vehicle = opened.vehicle(re.sub(r"[^A-Za-z0-9_-]", "_", name) or "file", mission.autopilot.value)
    o = opened.options
    return VehicleRequest(vehicle, place, place, at, at, rtl_rel_home_m=o.rtl_rel_home_m, return_route=o.return_route)


def _judged(
    request: VehicleRequest, file: Path, read: MissionFileRead, world: World, terrain_error_m: float, returns: Returns
) -> Checked:
    vehicle, mission, notes = request.vehicle, read.mission, list(read.notes)
    if mission.autopilot is not vehicle.autopilot:
        raise InputError(f"is for {mission.autopilot}, and {vehicle.name} is {vehicle.autopilot}", where=str(file))
    ground = world.ground_amsl(mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7)
    if not math.isnan(ground) and "--home was taken for the file's home" in notes:
        mission = replace(mission, home=replace(mission.home, amsl_m=round(ground, 2)))
    mission = replace(mission, name=vehicle.name, sysid=vehicle.sysid)
    verdict = judge(
        mission, vehicle, world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=terrain_error_m, misses=True
    )
    verdict, fence_notes = own_fence(read.fence, verdict, vehicle, world)
    notes += fence_notes
    if verdict.legs and verdict.legs[-1].kind == "cruise" and not any("without end" in n for n in verdict.notes):
        notes.append("the mission ends in the air: what becomes of the vehicle after its last item is not in it")
    home: WayHome | None = None
    if returns.judged or returns.required:
        home = home_of(verdict, request, world, terrain_error_m)
        notes += home.notes
    return Checked(
        file, vehicle, request, mission, verdict, tuple(notes), world, read.fence, read.rally, terrain_error_m, home,
        returns.required,
    )  # fmt: skip


def passes(c: Checked, *, allow_unjudged: bool) -> bool:
    """Whether a checked mission may fly: it breaks no limit, and the way home lets it fly."""
    path = c.verdict.safe is True or (c.verdict.safe is None and allow_unjudged)
    return path and lets_fly(c.way_home, required=c.home_required)


def finding_lines(c: Checked, *, allow_unjudged: bool = False, units: Units = METRIC) -> list[str]:
    """One line per finding, ``file:item: kind: message``, in the format of compilers and linters.

    A way home that is only reported is one line, ``file:item: warning: way_home: message``.
    """
    lines = [f"{c.file}:{f.seq}: {f.kind}: {_without_item(in_units(f.message, units))}" for f in c.verdict.findings]
    if not allow_unjudged:
        lines += [f"{c.file}:{_item_in(w)}: not_judged: {_without_item(w)}" for w in c.verdict.not_judged]
    return lines + [in_units(line, units) for line in home_lines(c)]


def home_lines(c: Checked) -> list[str]:
    """The lines of `finding_lines` on a way home that is not safe; none if it is, or was not judged at all."""
    home = c.way_home
    if home is None or home.safe is True:
        return []
    first = home.unsafe[0].from_seq if home.unsafe else 0
    battery = home.battery
    if not home.unsafe and battery is not None and battery.no_return_seq is not None:
        first = battery.no_return_seq
    if lets_fly(home, required=c.home_required):
        return [UnitText("{}:{}: warning: way_home: {}", c.file, first, home.headline)]
    advice = UnitText("; {}", home.advice) if home.advice else ""
    lines: list[str] = [UnitText("{}:{}: way_home: {}{}", c.file, first, home.headline, advice)]
    lines += [
        UnitText("{}:{}: way_home: no safe return from {}", c.file, s.from_seq, s.describe()) for s in home.unsafe
    ]  # fmt: skip
    if battery is not None and battery.short:
        lines.append(UnitText("{}:{}: way_home: {}", c.file, battery.no_return_seq or 0, battery.describe()))
    lines += [f"{c.file}:{_item_in(w)}: not_judged: the way home: {_without_item(w)}" for w in home.not_judged]
    return lines


def _item_in(words: str) -> int:
    found = re.match(r"item (\d+)", words)
    return int(found[1]) if found else 0


def _without_item(words: str) -> str:
    return re.sub(r"^item \d+(?:[ :]+|$)(?:\((\w+)\): )?", "", words)


def failure(
    checked: Iterable[Checked], *, allow_unjudged: bool, unreadable: Sequence[tuple[str, InputError]] = ()
) -> dict[str, Any] | None:
    """The ``error`` of ``check --json``: unreadable files, broken limits, or what could not be judged.

    None if every mission may fly.
    """
    bad = [c for c in checked if not passes(c, allow_unjudged=allow_unjudged)]
    if not bad and not unreadable:
        return None
    broken = any(c.verdict.safe is False or _home_broken(c) for c in bad)
    lines = [f"{c.vehicle.name}: {line}" for c in bad for line in c.verdict.describe().splitlines()]
    lines += [line for c in bad if not lets_fly(c.way_home, required=c.home_required) for line in home_lines(c)]
    lines += [str(error) for _, error in unreadable]
    reason = "bad_input" if unreadable else "violation" if broken else "not_judged"
    problems: list[Problem] = [p for _, error in unreadable for p in error.problems]
    document: dict[str, Any] = {
        "code": InputError.exit_code if unreadable else CheckFailed.exit_code,
        "reason": reason,
        "message": "\n".join(lines),
        "where": ", ".join([*(str(c.file) for c in bad), *(name for name, _ in unreadable)]),
    }
    if problems:
        document["problems"] = [p.as_dict() for p in problems]
    return document


def _home_broken(c: Checked) -> bool:
    return c.home_required and c.way_home is not None and c.way_home.safe is False


def more_of(c: Checked) -> dict[str, Any]:
    """The part of ``check --json`` for one file beside its verdict: nearest misses, all legs, the file's own lists."""
    return {
        "nearest_misses": [asdict(miss) for miss in c.verdict.misses],
        "time_s": c.verdict.time_s,
        "legs": [asdict(leg) for leg in c.verdict.legs],
        "fence_items": len(c.fence),
        "rally_points": len(c.rally),
    } | ({"way_home": c.way_home.as_dict()} if c.way_home is not None else {})
