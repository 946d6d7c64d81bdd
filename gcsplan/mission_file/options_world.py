"""A world without a mission file: the options of a command state terrain, zones and limits by the same names.

Everything is judged by the same rules as in a mission file; a mistake is reported by its option.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats
from gcsplan.dem.terrain import open_dem
from gcsplan.errors import InputError, Mistake
from gcsplan.mavlink.mission.return_parameters import ReturnRoute
from gcsplan.mission_file.load import TERRAIN_ERROR_M
from gcsplan.mission_file.published.policy import Policy
from gcsplan.mission_file.published.times import begins_with_day, hours_of
from gcsplan.mission_file.published.unused import (
    faults_near,
    left_out_by_hours,
    not_understood_far,
    unused_notes,
    used,
)
from gcsplan.mission_file.scene import make_spec, settle_areas, settle_zones
from gcsplan.mission_file.values.errors import read_section
from gcsplan.mission_file.values.keys import FiniteMetres, Keys
from gcsplan.mission_file.values.schema import LimitKeys, TerrainKeys, VehicleKeys, WindKeys
from gcsplan.mission_file.vehicles import make_vehicle
from gcsplan.mission_file.winds.declaration import NEEDS_DEPARTURE, go_together, winds_of, winds_of_forecast
from gcsplan.mission_file.zone_reader import read_zones
from gcsplan.mission_file.zones.draft import (
    ZoneDraft,
    looks_swapped,
    place_zones,
    uniquely_named,
    zone_notes,
    zones_sha256,
)
from gcsplan.mission_file.zones.file import Ignorable, OnBad
from gcsplan.mission_file.zones.keep_in import apart, as_keep_in, outside_zones, place_keep_in
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle
from gcsplan.wind.declared import STILL_AIR, DeclaredWind
from gcsplan.wind.wording import wind_note
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame, centre_of
from gcsplan.world.geometry.zones import Box, Zone
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.terrain import OpenTerrain
from gcsplan.world.world import World

MARGIN_M, MARGIN_MOST_M = 500.0, 3000.0
"""Terrain around the mission: at least the first, m, or a tenth of its extent up to the second, m."""

KEY_OPTIONS = {
    "min_agl_m": "--min-agl", "max_agl_m": "--max-agl", "max_amsl_m": "--max-amsl", "speed_m_s": "--speed",
    "horizontal_clearance_m": "--clearance", "vertical_clearance_m": "--vertical-clearance",
     "track_error_m": "--track-error", "climb_m_s": "--climb-rate",
    "altitude_error_m": "--altitude-error", "max_climb_deg": "--max-climb", "max_descent_deg": "--max-descent",
    "descent_m_s": "--descent-rate", "dem": "--dem", "vertical_datum": "--vertical-datum", "autopilot": "--autopilot",
    "geoid_grid": "--geoid-grid", "obstacle_height_m": "--obstacle-height", "start": "--home",
    "rtl_rel_home_m": "--rtl-altitude", "return_route": "--return-route", "crs": "--crs",
    "height_unit": "--height-unit", "nodata": "--nodata", "on_bad": "--on-bad", "ignore": "--ignore",
}  # fmt: skip
"""The option for each key of a mission file."""


class _ReturnKeys(Keys):
    """The return of every file; 0 and less are altitudes of parameters, too, so a mission's bounds are not these."""

    rtl_rel_home_m: FiniteMetres | None = None


@dataclass(frozen=True)
class WorldOptions:
    """The values of the options, by the mission file's names. Paths are as written; None means not given.

    ``home`` (latitude, longitude) is the home of every file, ``at`` says when they fly, and ``notes`` say how options
    were read. ``on_bad`` and ``ignore`` are the rules for all files of zones. ``wind``: keys of `wind`.
    """

    terrain: Mapping[str, object] = field(default_factory=dict)
    zones: tuple[str, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)
    vehicle: Mapping[str, object] = field(default_factory=dict)
    home: tuple[float, float] | None = None
    rtl_rel_home_m: float | None = None
    return_route: ReturnRoute | None = None
    terrain_error_m: float = TERRAIN_ERROR_M
    notes: tuple[Note, ...] = ()
    at: tuple[str, ...] | None = None
    on_bad: OnBad | None = None
    ignore: tuple[Ignorable, ...] = ()
    keep_in: tuple[str, ...] = ()
    wind: Mapping[str, object] | None = None


@dataclass(frozen=True, slots=True)
class WorldExtent:
    """A part of the world: the middle of its plane (latitude, longitude), and a box in it, in metres."""

    centre_deg: tuple[float, float]
    box: Box


_WindOver = Callable[[WorldExtent, list[Mistake]], tuple[DeclaredWind, tuple[Note, ...]] | None]


class OpenWorld:
    """Terrain and zones of the options, opened and checked; `over` loads the part that some places need (`extent`)."""

    def __init__(self, options: WorldOptions) -> None:
        problems: list[Mistake] = []
        self.options = options
        self.notes: list[Note] = [*options.notes]
        hours = hours_of(None, None, "--at", problems, instead=options.at)
        policy = Policy(hours=hours, where="--zones", on_bad=options.on_bad, ignore=options.ignore)
        self._drafts, self._inside = apart(_drafts(options, problems, self.notes, policy), problems)
        self.hours, self._flown = hours if left_out_by_hours(self._drafts) else None, hours
        self._terrain: OpenTerrain | None = None
        self._made: dict[str, Vehicle] = {}
        keys = read_section(TerrainKeys, dict(options.terrain), "", problems)
        if keys is not None:
            self._obstacle_m = keys.obstacle_height_m
            try:
                self._terrain = open_dem(make_spec(keys, Path()), where="--dem")
            except InputError as why:
                problems += why.problems
        self._limits = read_section(LimitKeys, dict(options.limits), "", problems) or LimitKeys()
        read_section(_ReturnKeys, {"rtl_rel_home_m": options.rtl_rel_home_m}, "", problems)
        if not problems:
            self.vehicle("file", "arducopter")  # finds contradictions in the limits before any file is opened
        windy: list[Mistake] = []
        self._wind = self._read_wind(windy)
        if problems or windy:
            raise InputError.of([*(_renamed(p) for p in problems), *windy])

    @property
    def departs_s(self) -> float:
        """When each file's flight begins, seconds UTC since 1970; 0 if the options do not say."""
        return 0.0 if self._flown is None else self._flown.start.timestamp()

    @property
    def leaves_s(self) -> float | None:
        """When each file's vehicle leaves the ground, seconds UTC since 1970; None if the options give no time of
        day."""
        return None if self._flown is None or begins_with_day(self.options.at) else self.departs_s

    def wind(self, extent: WorldExtent) -> tuple[DeclaredWind, tuple[Note, ...]]:
        """The declared winds in a part of the world, still air if there are none, and notes on them. Raises InputError
        where it is too far from the place of a forecast."""
        if self._wind is None:
            return STILL_AIR, ()
        problems: list[Mistake] = []
        made = self._wind(extent, problems)
        if made is None:
            raise InputError.of(problems)
        return made

    def _read_wind(self, problems: list[Mistake]) -> _WindOver | None:
        """What makes the winds of a part of the world from ``--wind``; None without it, or if it has mistakes."""
        if self.options.wind is None:
            return None
        where = "--wind: wind"
        keys = read_section(WindKeys, dict(self.options.wind), where, problems)
        if keys is None or problems or not go_together(keys, where, problems):
            return None
        if keys.forecast is None:
            winds = winds_of(keys, where, problems)
            return None if winds is None else lambda *_: (winds, () if winds.still else (wind_note(winds),))
        hours = self._flown
        if hours is None and self.options.at is not None:
            return None
        if hours is None or begins_with_day(self.options.at):
            problems.append(Mistake("--wind", NEEDS_DEPARTURE))
            return None
        from gcsplan.mission_file.winds.forecast import read_forecast  # imported here: most checks name no forecast

        try:
            forecast = read_forecast(Path(keys.forecast), where)
            forecast.within(hours)
        except InputError as why:
            problems += why.problems
            return None

        def over(extent: WorldExtent, faults: list[Mistake]) -> tuple[DeclaredWind, tuple[Note, ...]] | None:
            west, south, east, north = extent.box
            corners, frame = [(e, n) for e in (west, east) for n in (south, north)], Frame(*extent.centre_deg)
            made = winds_of_forecast(keys, lambda: forecast, hours, frame, corners, where, faults)
            return None if made is None else (made[0], (wind_note(made[0]), made[1]))

        return over

    def vehicle(self, name: str, autopilot: str) -> Vehicle:
        """The vehicle that the options describe, for a file of that autopilot. Raises InputError."""
        if autopilot not in self._made:
            self._made[autopilot] = self._make(autopilot)
        return replace(self._made[autopilot], name=name)

    def _make(self, autopilot: str) -> Vehicle:
        """See `vehicle`."""
        problems: list[Mistake] = []
        notes: list[Note] = []
        given = {"name": "file", "sysid": 1, "autopilot": autopilot, "start": [0.0, 0.0], "goal": [0.0, 0.0]}
        keys = read_section(VehicleKeys, given | dict(self.options.vehicle), "", problems)
        made = None
        if keys is not None:
            made = make_vehicle(keys, self._limits, "", problems, notes, local=False, obstacle_m=self._obstacle_m)
        if made is None:
            raise InputError.of([_renamed(p) for p in problems])
        self.notes += [note for note in notes if note not in self.notes]
        return made

    def around(self, places: ArrayLike, reach_m: float = 0.0) -> tuple[World, dict[str, object]]:
        """The world of the `extent` of ``places``, and the description of its sources. Raises InputError."""
        return self.over(self.extent(places, reach_m))

    def extent(self, places: ArrayLike, reach_m: float = 0.0) -> WorldExtent:
        """The part of the world that holds ``places`` (N, 2), latitude and longitude.

        ``reach_m`` is how far beyond them terrain is needed, in metres; `MARGIN_M` or a tenth of their extent, and the
        clearance, are added.

        Places outside the terrain are left out, and the check reports what flies there. Raises InputError if none is
        left, or if they are too far apart for one plane.
        """
        assert self._terrain is not None
        every = np.asarray(places, float).reshape(-1, 2)
        known = every[self._terrain.covers(every[:, 0], every[:, 1])]
        if not len(known):
            turned = every[np.abs(every[:, 1]) <= 90.0]
            swapped = bool(self._terrain.covers(turned[:, 1], turned[:, 0]).any())
            hint = "; latitude and longitude look swapped" if swapped else ""
            raise InputError(f"the DEM holds none of the mission's places{hint}; add the tile", where="--dem")
        frame = Frame(*centre_of(known[:, 0], known[:, 1]))
        in_plane = frame.to_plane(known[:, 0], known[:, 1])
        if not (np.hypot(in_plane[:, 0], in_plane[:, 1]) <= FARTHEST_M).all():
            raise InputError(
                f"the places lie more than {FARTHEST_M / 1000:.0f} km from their middle: too far for one plane",
                where="--dem",
            )
        return WorldExtent((frame.lat_deg, frame.lon_deg), self._box(in_plane, reach_m))

    def over(self, extent: WorldExtent) -> tuple[World, dict[str, object]]:
        """The world of an extent, and the description of its sources. Raises InputError."""
        assert self._terrain is not None
        frame, box = Frame(*extent.centre_deg), extent.box
        drafts = used(self._drafts)
        placed, far = place_zones(drafts, frame)
        # A swapped zone would belong to the mission; as it stands it would be left out, and flown through.
        problems = [
            Mistake(draft.where, f"latitude and longitude of the zone {draft.name!r} look swapped")
            for draft in far
            if looks_swapped(draft, frame)
        ]
        problems += faults_near(placed, box)
        scale = frame.scale_at(max(math.hypot(e, n) for e in (box[0], box[2]) for n in (box[1], box[3])))
        surface = self._terrain.around(frame, box).load(frame, box)
        zones: list[Zone] = []
        for draft, zone in placed:
            own: list[Mistake] = []
            settled = settle_zones([(draft, zone)], surface, own)
            west, south, east, north = zone.bounds
            if own and not (west > box[0] and south > box[1] and east < box[2] and north < box[3]):
                settled, own = [zone], []  # under ground in the loaded part; the rest of the zone is not loaded
            zones += settled
            problems += own
        if problems:
            raise InputError.of([_renamed(p) for p in problems])
        zones += outside_zones(settle_areas(place_keep_in(self._inside, frame), surface), local=False)
        notes = [*self.notes, *notes_on(surface.info), *zone_notes(placed), *not_understood_far(placed, far, box)]
        notes += [*unused_notes(self._drafts, frame, box), *self.wind(extent)[1]]
        if far:
            notes.append(Note("zones_left_out", count=len(far)))
        inputs = {k: v for k, v in surface.info.items() if k not in ("notes", "source")}
        inputs["zones_sha256"] = zones_sha256([*drafts, *self._inside])
        inputs["notes"] = tuple(dict.fromkeys(notes))
        return World(frame, Airspace(surface, zones, scale=scale)), inputs

    def _box(self, points: Floats, reach_m: float) -> Box:
        """The box to load. A check needs no room for detours, so terrain of 1 m resolution fits a long mission."""
        low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        extent = max(high[0] - low[0], high[1] - low[1])
        near = [self._limits.horizontal_clearance_m, self._limits.track_error_m]
        margin = reach_m + max(MARGIN_M, min(0.1 * extent, MARGIN_MOST_M)) + sum(x for x in near if x is not None)
        return low[0] - margin, low[1] - margin, high[0] + margin, high[1] + margin


def _drafts(
    options: WorldOptions, problems: list[Mistake], notes: list[Note], policy: Policy
) -> list[ZoneDraft]:  # fmt: skip
    """The zones and keep-in areas of all files, each with a unique name; a zone that does not apply in the hours is not
    used."""
    drafts: list[ZoneDraft] = []
    for option, files in (("--zones", options.zones), ("--keep-in", options.keep_in)):
        for file in files:
            inside = option == "--keep-in"
            try:
                found = read_zones(Path(file), where=option, policy=replace(policy, where=option), keep_in=inside)
            except InputError as why:
                problems += why.problems
                continue
            problems += found.problems
            notes += found.notes
            drafts += as_keep_in(found.zones, option, problems) if inside else found.zones
    return uniquely_named(drafts)


def _renamed(problem: Mistake) -> Mistake:
    """The problem with its option as the place, in place of a key such as ``.min_agl_m``."""
    key = problem.where.removeprefix(".").split(".")[-1].split("[")[0]
    option = KEY_OPTIONS.get(key)
    return replace(problem, where=option) if option is not None else problem
