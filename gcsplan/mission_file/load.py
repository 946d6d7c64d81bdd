"""Reads the parts of a mission file in order and reports every mistake at once.

Each mistake has its file, its key path, the given value and the required one. The parts are in `schema` (keys),
`vehicles` and `terminals` (vehicles, limits, start, via points and goal), and `scene` (points, terrain, zones).
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import MAXYEAR, MINYEAR, datetime
from functools import partial
from itertools import chain
from typing import Any, get_args

from gcsplan.errors import InputError, Mistake, elements, heed_cancel, require_kind, wrong_argument
from gcsplan.mavlink.mission.mission import AltitudeFrame
from gcsplan.mission_file.changes import MissionChange, changed
from gcsplan.mission_file.kept import KeptWorld, ReadZones
from gcsplan.mission_file.published.times import Hours, begins_with_day, hours_of, texts_of
from gcsplan.mission_file.published.unused import (
    faults_near,
    left_out_by_hours,
    not_understood_far,
    unused_notes,
    used,
)
from gcsplan.mission_file.request import (
    ArrivalRequest,
    Content,
    MissionFile,
    PlannerRequest,
    ReturnRequirement,
    VehicleRequest,
)
from gcsplan.mission_file.scene import (
    MissionPlace,
    covered,
    make_box,
    make_frame,
    make_place,
    make_places,
    make_spec,
    make_zones,
    place_notes,
    plane_again,
)  # fmt: skip
from gcsplan.mission_file.source import read_content
from gcsplan.mission_file.terminals import Terminals
from gcsplan.mission_file.values.errors import (
    MOST_OF_A_SECTION,
    few,
    listed_once,
    read_section,
    unknown_keys,
    with_lines,
)
from gcsplan.mission_file.values.schema import (
    PLAIN_PLANNER_KEYS,
    TOP_KEYS,
    ArrivalKeys,
    FrameKeys,
    LimitKeys,
    PlannerKeys,
    TerrainKeys,
    VehicleKeys,
    WindKeys,
    ZoneKeys,
    nearest,
    shown,
)  # fmt: skip
from gcsplan.mission_file.values.units import in_own_units
from gcsplan.mission_file.vehicles import (
    check_unique,
    in_wind,
    make_arrival,
    make_vehicle,
    one_speed,
    slopes_in_wind,
    unbounded_motion,
    within_lean,
    within_vel_max,
)
from gcsplan.mission_file.window import GroundWindow, MissionPlane, known_in_plane, opened
from gcsplan.mission_file.winds.declaration import NEEDS_DEPARTURE, go_together, winds_of, winds_of_forecast
from gcsplan.mission_file.zones.draft import (
    ZoneDraft,
    looks_swapped,
    one_line,
    place_zones,
    uniquely_named,
    zone_notes,
    zones_sha256,
)
from gcsplan.mission_file.zones.keep_in import apart, as_keep_in, place_keep_in
from gcsplan.notes.note import Note
from gcsplan.wind.declared import STILL_AIR, DeclaredWind
from gcsplan.wind.wording import wind_note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import KeepIn
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.terrain import OpenTerrain, Terrain, TerrainSpec

_log = logging.getLogger(__name__)

__all__ = ["ArrivalRequest", "MissionFile", "PlannerRequest", "VehicleRequest", "load_mission"]

REQUIRED_KEYS = {
    "version": "write `version: 1`",
    "terrain": "write `terrain: {dem: FILE}`, or for flat ground its altitude: `terrain: {flat_m: 300}`",
    "vehicles": "write a list with name, sysid, autopilot, start and goal of each",
}
"""The keys that every mission has, and what to write where one is absent."""

MOST_VEHICLES_OF_FILE = 2000
"""Most vehicles of one file: more than are flown together anywhere, and few enough for a table of all pairs."""

TERRAIN_ERROR_M = 30.0
"""Metres by which a vehicle's own terrain may be shifted to its altitude at arming (ArduPilot's TERRAIN_OFS_MAX)."""


def load_mission(
    source: str | os.PathLike[str] | Mapping[str, Any] | None = None,
    *,
    text: str | None = None,
    planner_names: Collection[str] | None = None,
    around: Sequence[tuple[float, float]] = (),
    departure: datetime | None = None,
    at: str | Sequence[str] | None = None,
    terrain: Mapping[str, object] | None = None,
    changes: Sequence[MissionChange] = (),
) -> MissionFile:
    """Read and judge a mission; nothing is planned yet.

    ``source`` is one of: the path of a mission file (a ``str`` without a line break, or a path object), or
    ``sample:NAME`` for one that comes with gcsplan (``sample:jacksboro``); the YAML text of one (a ``str`` with a line
    break); a mapping of the same keys, which may contain lists, tuples and numpy numbers. In a mapping,
    ``terrain["dem"]`` may be an array of heights with its ``transform`` and ``crs``, an open rasterio dataset or a
    rioxarray DataArray, or a list of the last two, and ``no_fly`` may be or contain GeoJSON (as mappings, by
    ``__geo_interface__``, or a GeoDataFrame); so may the ``file`` of one of its entries.
    With ``text``, that is the content, and ``source`` is the path that it would have (or None). Files that a mission
    names are found relative to its own path, or else to the current folder.

    ``planner_names`` replaces the table of planners. ``around`` are places (latitude, longitude) in degrees, besides
    the mission's own, for which terrain is loaded too if it covers them. ``departure`` is when the mission begins, if
    it does not say so itself (``at``). The argument ``at`` counts in place of that key. ``terrain``: keys of its
    section that count before the mission's own. They, and then the ``changes``, are set in the document before it is
    read; ``content.changes`` has a note on each of the latter.

    Returns a `MissionFile`: vehicles, zones and terrain in metres. Raises InputError with every problem that was found,
    each with its place (file and key, such as ``vehicles[1].speed_m_s``; a mission without a file is called
    ``mission``), and UsageError if ``source`` is none of these.

    Examples:
        >>> mission = load_mission({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> [request.vehicle.name for request in mission.vehicles]
        ['uav1']
    """
    file, where, raw, written, held = read_content(source, text)
    if "version" in raw and (raw["version"] != 1 or isinstance(raw["version"], bool | float)):
        words = f"this gcsplan reads version 1, given {shown(raw['version'])}; write `version: 1`, or update gcsplan"
        raise InputError(words, where=f"{where}: version")
    of = "load_mission()"
    names = None if planner_names is None else elements(of, "planner_names", planner_names, str, "names of planners")
    made_by_caller = elements(of, "changes", changes, MissionChange, "a list of MissionChange")
    if departure is not None:
        require_kind(of, "departure", departure, datetime, "a datetime")
        if not MINYEAR < departure.year < MAXYEAR:
            raise wrong_argument(of, "departure", departure, "a datetime with room for the hours around it")
    if terrain is not None:
        require_kind(of, "terrain", terrain, Mapping, "a mapping of keys of the section terrain")
    section = read_content({"terrain": terrain or {}}, None, held)[2]["terrain"]
    keys = [MissionChange("", "terrain", key, value) for key, value in section.items()]
    made = changed(raw, [*keys, *made_by_caller], file.parent)
    return load_content(
        Content(
            file,
            where,
            made.raw,
            written,
            names,
            _places(around),
            departure,
            texts_of(at),
            made.options,
            made.notes,
            held,
        )
    )


def _places(around: Any) -> tuple[tuple[float, float], ...]:
    """The places of ``around``. Raises UsageError."""
    expected = "places as pairs of latitude and longitude in degrees"
    pairs = elements("load_mission()", "around", around, object, expected)
    with suppress(Exception):  # a stranger's numbers
        found = tuple((float(lat), float(lon)) for lat, lon in pairs)
        if all(map(math.isfinite, chain.from_iterable(found))):
            return found
    raise wrong_argument("load_mission()", "around", around, expected)


def load_content(content: Content, kept: KeptWorld | None = None, *, stay: bool = False) -> MissionFile:
    """Read a mission again from what it was read from before. ``kept``: what the reading before kept, and this one
    keeps. ``stay``: use the plane and the window of terrain of the reading before, as long as the mission's places lie
    well within them; nothing of the terrain is then read or fitted anew. Raises InputError."""
    return _MissionReading(content, kept or KeptWorld(), stay=stay).mission()


def _reaching(content: Content, places: Sequence[tuple[float, float]]) -> MissionFile:
    """See `MissionFile.reaching`."""
    return load_content(replace(content, around=tuple(places)))


def read_no_fly(source: str | os.PathLike[str], at: Sequence[str] | None = None) -> tuple[list[ZoneDraft], list[Note]]:
    """All zones of a mission file, used or not, and the notes on them, whatever else is wrong. Raises InputError."""
    file, where, raw, written, _ = read_content(source, None)
    return _MissionReading(Content(file, where, raw, written, at=texts_of(at)), KeptWorld()).zones_alone()


def zones_by_entry(content: Content, kept: KeptWorld) -> dict[str, Sequence[ZoneDraft]]:
    """The zones of each entry of ``no_fly`` and ``keep_in``, by its place such as ``no_fly[3]``; mistakes are left for
    `load_content` to refuse. ``kept``: see there."""
    return _MissionReading(content, kept).zones_by_entry()


class _MissionReading:
    """One pass over one file: the steps in order, and the problems found so far."""

    def __init__(self, content: Content, kept: KeptWorld, *, stay: bool = False) -> None:
        self.content, self.file, self.text, self.stay = content, content.file, content.text, stay
        self.kept = kept
        kept.begin()
        self.where = f"{content.where}: "
        self.units = in_own_units(content.given, self.where)
        self.raw = self.units.raw
        self.problems: list[Mistake] = [*self.units.problems]
        self.notes: list[Note] = [*self.units.notes]
        self.local = content.given.get("frame") is not None

    def mission(self) -> MissionFile:
        raw, problems = self.raw, self.problems
        problems += unknown_keys(raw, TOP_KEYS, self.where)
        problems += [
            Mistake(self.where + key, f"is missing; {cure}", "missing")
            for key, cure in REQUIRED_KEYS.items()
            if raw.get(key) is None
        ]
        name = self._name()
        altitude_frame: AltitudeFrame = self._choice("altitude_frame", get_args(AltitudeFrame), "relative")
        terrain_error_m = self._terrain_error(altitude_frame)
        way_home: ReturnRequirement = self._choice("way_home", get_args(ReturnRequirement), "reported")
        frame_keys = self._section(FrameKeys, "frame")
        terrain_keys = self._section(TerrainKeys, "terrain")
        if frame_keys is not None:
            self.notes += place_notes(frame_keys.origin, f"{self.where}frame.origin")
        planner = self._planner()
        terminals = self._vehicles(terrain_keys, altitude_frame)
        names = check_unique(self._list("vehicles"), f"{self.where}vehicles", problems)
        arrival_keys = self._section(ArrivalKeys, "arrival")
        arrival = make_arrival(arrival_keys, names, f"{self.where}arrival", problems)
        gates = self._gates(arrival_keys)
        hours = self._hours()
        published, inside = self._zones(hours)
        drafts = used(published)

        spec = None if terrain_keys is None else make_spec(terrain_keys, self.file.parent, self.content.held)
        terrain = None if spec is None else self._open(spec)
        places = [p for s in terminals for p in s.all]
        if terrain is not None:
            places = covered(places, terrain, problems)
        frame: Frame | None = None
        if places and (frame_keys is not None or not self.local):
            frame = make_frame(places, frame_keys, problems, self.where)
        stays = plane_again(self.kept.plane, places, frame, local=self.local) if self.stay else None
        frame = stays[0] if stays else frame
        departure = self.content.departure or (None if hours is None else hours.start)
        wind = self._wind(hours, frame, places)
        if wind is not None:
            terminals = [replace(t, vehicle=t.vehicle and in_wind(t.vehicle, wind)) for t in terminals]
            self.notes += [slopes_in_wind(t.vehicle) for t in terminals if t.vehicle and t.vehicle.blows_m_s]
        site: MissionPlane | None = None
        ground: GroundWindow | None = None
        if frame is not None and terrain is not None:
            plane = frame.lat_deg, frame.lon_deg
            placed, far = self.kept.placed.get((drafts, plane), partial(place_zones, drafts, frame))
            self._far(far, frame)
            self.notes += zone_notes(placed)
            others = known_in_plane(self.content.around, terrain, frame)
            points = [*(p.in_plane(frame) for p in places), *others]
            box = stays[1] if stays else make_box(points, [z for _, z in placed], local=self.local)
            self.kept.plane = frame, box
            here = self._around(terrain, frame, box)
            if here is not None:
                problems += faults_near(placed, box)
                self.notes += not_understood_far(placed, far, box)
                self.notes += unused_notes(published, frame, box)
                areas = self._areas(inside, frame)
                site = MissionPlane(here, frame, box, placed, areas, terminals, set(places), self.local, self.kept)
                ground = site.load(problems)
        if problems or frame is None or site is None or ground is None or wind is None:
            raise self._refusal(problems)
        if gates and arrival is not None:
            arrival = replace(arrival, gates=tuple(p.in_plane(frame) for p in gates if p is not None))
        info = ground.surface.info
        self.notes += notes_on(info)
        inputs = {k: v for k, v in info.items() if k not in ("notes", "source")}
        inputs["zones_sha256"] = zones_sha256([*drafts, *inside])
        source = MissionFile(
            name=name, path=self.file, stem=self.file.stem, frame=frame, surface=ground.surface, zones=ground.zones,
            airspace_scale=ground.scale, vehicles=ground.vehicles, arrival=arrival, planner=planner,
            altitude_frame=altitude_frame, terrain_error_m=terrain_error_m, local=self.local, inputs=inputs,
            notes=tuple(dict.fromkeys(self.notes)), way_home=way_home, geoid=site.terrain.geoid,
            hours=hours if left_out_by_hours(published) else None,
            reaching=partial(_reaching, self.content), content=self.content, wind=wind, departure=departure,
        )  # fmt: skip
        _log.info("%s: %d vehicles, %d zones", self.content.where, len(source.vehicles), len(source.zones))
        return replace(source, wider=partial(site.wider, source), at_level=partial(site.at_level, source))

    def _gates(self, arrival: ArrivalKeys | None) -> list[MissionPlace | None]:
        """The gates that are given by their places."""
        given = arrival.gates if arrival is not None and isinstance(arrival.gates, list) else []
        return make_places(given, f"{self.where}arrival.gates", self.problems, self.notes, local=self.local)

    def zones_by_entry(self) -> dict[str, Sequence[ZoneDraft]]:
        """The zones of each entry that can be read, whatever is wrong with others."""
        return {entry: found for entry, (found, _, _) in self.entries(self._hours())}

    def zones_alone(self) -> tuple[list[ZoneDraft], list[Note]]:
        """All zones, far ones and those that are not used too, and the notes on them. Raises InputError."""
        keys = (f"{self.where}no_fly", f"{self.where}keep_in")
        self.problems = [p for p in self.problems if p.where.startswith(keys)]
        self.notes = []
        published, inside = self._zones(self._hours())
        if self.problems:
            raise self._refusal(self.problems)
        return [*published, *inside], list(dict.fromkeys(self.notes))

    def _refusal(self, problems: list[Mistake]) -> InputError:
        """All problems as the user wrote the keys, with their lines if the mission was a text."""
        listed = listed_once(few(problems, self.where.removesuffix(": "), 10 * MOST_OF_A_SECTION))
        listed = [self._by_option(self.units.as_written(p)) for p in listed]
        return InputError.of(listed if self.text is None else with_lines(listed, self.text, self.where))

    def _by_option(self, problem: Mistake) -> Mistake:
        """The problem at the option that set its key, or else a limit that its key breaks, if one did."""
        path = problem.where.removeprefix(self.where)
        for key, option in self.content.options:
            rest = path.removeprefix(key)
            if rest != path and rest[:1] in ("", "[", "."):
                return replace(problem, where=f"{option}: {path}")
        for key, option in self.content.options:
            section, _, name = key.rpartition(".")
            if name in problem.by and (section == "limits" or path.startswith(f"{section.removesuffix('.limits')}.")):
                return replace(problem, where=f"{option}: {path}")
        return problem

    # -- the plain keys ------------------------------------------------------------------------------------------

    def _name(self) -> str:
        value = self.raw.get("name")
        if value is None:
            return self.file.stem
        if not isinstance(value, str) or not value.strip() or len(value) > 300:
            words = f"must be text, 300 characters at most, given {shown(value)}"
            self.problems.append(Mistake(f"{self.where}name", words))
            return self.file.stem
        return one_line(value)

    def _choice(self, key: str, choices: tuple[str, ...], default: str) -> Any:
        value = self.raw.get(key)
        if value is None or value in choices:
            return value or default
        near = nearest(value, choices) if isinstance(value, str) else ""
        self.problems.append(
            Mistake(self.where + key, f"must be one of {', '.join(choices)}, given {shown(value)}{near}")
        )
        return default

    def _terrain_error(self, altitude_frame: AltitudeFrame) -> float:
        value = self.raw.get("terrain_error_m")
        if value is None:
            return TERRAIN_ERROR_M if altitude_frame == "terrain" else 0.0
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1000.0:
            self.problems.append(
                Mistake(f"{self.where}terrain_error_m", f"must be a number from 0 to 1000, given {shown(value)}")
            )
            return TERRAIN_ERROR_M
        if altitude_frame != "terrain":
            self.notes.append(Note("terrain_error_without_frame"))
            return 0.0
        return float(value)

    def _section(self, kind: type[Any], key: str) -> Any:
        value = self.raw.get(key)
        return None if value is None else read_section(kind, value, self.where + key, self.problems)

    def _list(self, key: str) -> list[Any]:
        value = self.raw.get(key)
        return value if isinstance(value, list) else []

    # -- the sections --------------------------------------------------------------------------------------------

    def _planner(self) -> PlannerRequest:
        keys: PlannerKeys = self._section(PlannerKeys, "planner") or PlannerKeys()
        known = self.content.planner_names
        if known is None:
            from gcsplan.planners.registry import PLANNER_PACKAGES, names

            known = tuple(PLANNER_PACKAGES) if keys.name in PLANNER_PACKAGES else names()
        if keys.name not in known:
            near = nearest(keys.name, known) or f"; known are {', '.join(known)}"
            self.problems.append(Mistake(f"{self.where}planner.name", f"no planner is named {keys.name[:64]!r}{near}"))
        extras = {k: v for k, v in keys.given.items() if k not in PLAIN_PLANNER_KEYS and v is not None}
        return PlannerRequest(
            keys.name, keys.objective, keys.seed, keys.gap_percent, keys.budget_s, keys.budget_mb, extras
        )

    def _vehicles(self, terrain: TerrainKeys | None, altitude_frame: AltitudeFrame) -> list[Terminals]:
        where = f"{self.where}vehicles"
        value = self.raw.get("vehicles")
        if value is not None and (not isinstance(value, list) or not 1 <= len(value) <= MOST_VEHICLES_OF_FILE):
            dash = "; begin each vehicle with a dash: `- name: …`" if isinstance(value, dict) else ""
            words = f"must be a list of 1 to {MOST_VEHICLES_OF_FILE} vehicles, given {shown(value)}{dash}"
            self.problems.append(Mistake(where, words))
            return []
        shared = self._section(LimitKeys, "limits") or LimitKeys()
        # If the shared limits are broken, a vehicle's complaint about a missing limit would only repeat that.
        broken = any(p.where.startswith(f"{self.where}limits") for p in self.problems)
        if broken and shared.min_agl_m is None:
            shared = LimitKeys(min_agl_m=0.0)
        terminals = []
        for i, one in enumerate(self._list("vehicles")):
            at = f"{where}[{i}]"
            keys = read_section(VehicleKeys, one, at, self.problems)
            if keys is None:
                continue
            obstacle_m = 0.0 if terrain is None else terrain.obstacle_height_m
            own: list[Note] = []
            vehicle = make_vehicle(keys, shared, at, self.problems, own, local=self.local, obstacle_m=obstacle_m)
            if free := unbounded_motion(keys, local=self.local):
                self.notes.append(Note("motion_unbounded", keys=free))
            if vehicle is not None:
                for within in (within_lean, within_vel_max):
                    vehicle = within(vehicle, keys, at, self.problems, own, local=self.local)
                vehicle = replace(vehicle, energy=self.units.with_battery_key(vehicle.energy, f"{at}.energy.battery_j"))
            if altitude_frame == "terrain" and keys.autopilot == "px4":
                self.problems.append(
                    Mistake(f"{at}.autopilot", "px4 flies no terrain frame; use altitude_frame: relative or amsl")
                )
            if altitude_frame == "terrain" and keys.autopilot == "arduplane":
                words = "an arduplane's turns are planned above home or sea level: use altitude_frame: relative or amsl"
                self.problems.append(Mistake(f"{at}.autopilot", words))
            start = make_place(keys.start, f"{at}.start", self.problems, self.notes, local=self.local)
            goal = make_place(keys.goal, f"{at}.goal", self.problems, self.notes, local=self.local)
            via = make_places(keys.via, f"{at}.via", self.problems, self.notes, local=self.local)
            self.notes += [note.of(vehicle=keys.name) for note in (*own, *one_speed(one, keys))]
            terminals.append(Terminals(keys, vehicle, start, goal, tuple(via)))
        return terminals

    def _hours(self) -> Hours | None:
        given, content = self.raw.get("at"), self.content
        return hours_of(given, content.departure, f"{self.where}at", self.problems, instead=content.at)

    def _wind(self, hours: Hours | None, frame: Frame | None, places: Sequence[MissionPlace]) -> DeclaredWind | None:
        """The declared winds, still air if there are none; None if they have mistakes."""
        if self.raw.get("wind") is None:
            return STILL_AIR
        before = len(self.problems)
        keys: WindKeys | None = self._section(WindKeys, "wind")
        where = f"{self.where}wind"
        if keys is None or len(self.problems) > before or not go_together(keys, where, self.problems):
            return None
        if keys.forecast is None:
            wind = winds_of(keys, where, self.problems)
        else:
            wind = self._forecast(keys, hours, frame, places)
        if wind is not None and not wind.still:
            self.notes.append(wind_note(wind))
        return wind

    def _forecast(
        self, keys: WindKeys, hours: Hours | None, frame: Frame | None, places: Sequence[MissionPlace]
    ) -> DeclaredWind | None:
        """The winds of a forecast; None if it has mistakes, or its hours or places have."""
        at, departure = self.content.at or self.raw.get("at"), self.content.departure
        if hours is None and at is not None:
            return None
        if hours is None or (departure is None and begins_with_day(at)):
            self.problems.append(Mistake(f"{self.where}wind.forecast", NEEDS_DEPARTURE))
            return None
        if frame is None:
            return None
        if departure is not None:
            common = Hours.around(departure)
            hours = Hours(min(hours.start, common.start), max(hours.end, common.end))
        from gcsplan.mission_file.winds.forecast import read_forecast  # imported here: most missions name no forecast

        path = self.file.parent / str(keys.forecast)
        read = partial(self.kept.forecast.get, path, partial(read_forecast, path, f"{self.where}wind.forecast"))
        in_plane = [place.in_plane(frame) for place in places]
        made = winds_of_forecast(keys, read, hours, frame, in_plane, f"{self.where}wind", self.problems)
        if made is None:
            return None
        self.notes.append(made[1])
        return made[0]

    def _zones(self, hours: Hours | None) -> tuple[list[ZoneDraft], list[ZoneDraft]]:
        """The no-fly zones, and the areas to stay in. A file of ``no_fly`` may have areas, too: a world with holes."""
        drafts: list[ZoneDraft] = []
        for _, (found, notes, problems) in self.entries(hours):
            drafts += found
            self.notes += notes
            self.problems += problems
        return apart(uniquely_named(drafts), self.problems)

    def entries(self, hours: Hours | None) -> Iterator[tuple[str, ReadZones]]:
        """Each entry of ``no_fly`` and ``keep_in``: its place, its zones, notes on them, and mistakes."""
        inline: dict[str, str] = {}
        for key, what in (("no_fly", "zones"), ("keep_in", "areas")):
            value = self.raw.get(key)
            if value is not None and (not isinstance(value, list) or (key == "keep_in" and not value)):
                dash = f"; begin each {what[:-1]} with a dash: `- name: …`" if isinstance(value, dict) else ""
                empty = "; leave the key out if a flight may be anywhere" if value == [] else ""
                words = f"must be a list of {what}, given {shown(value)}{dash}{empty}"
                self.problems.append(Mistake(self.where + key, words))
            for i, one in enumerate(self._list(key)):
                heed_cancel()
                at, entry = f"{self.where}{key}[{i}]", f"{key}[{i}]"
                keys = read_section(ZoneKeys, one, at, self.problems)
                if keys is None:
                    continue
                if keys.name is not None and (first := inline.setdefault(keys.name, entry)) != entry:
                    words = f"{keys.name[:64]!r} is the name of {first} already; change one"
                    self.problems.append(Mistake(f"{at}.name", words))
                made_of = (one, hours, self.local, self.content.held.get(keys.file or ""))
                made = partial(self._entry, keys, at, entry, hours, keep_in=key == "keep_in")
                yield entry, self.kept.zones(at, made_of, made)

    def _areas(self, inside: Sequence[ZoneDraft], frame: Frame) -> tuple[KeepIn, ...]:
        try:
            return place_keep_in(inside, frame)
        except InputError as why:
            self.problems += why.problems
            return ()

    def _entry(self, keys: ZoneKeys, at: str, entry: str, hours: Hours | None, *, keep_in: bool) -> ReadZones:
        """The zones of one entry of ``no_fly`` or ``keep_in``, notes on them and mistakes."""
        notes: list[Note] = []
        problems: list[Mistake] = []
        found = make_zones(
            keys, at, self.file.parent, entry, problems, notes, local=self.local, hours=hours, keep_in=keep_in,
            held=self.content.held,
        )  # fmt: skip
        return as_keep_in(found, at, problems) if keep_in else found, notes, problems

    def _far(self, far: list[ZoneDraft], frame: Frame) -> None:
        """Report zones too far away to matter: a mistake in this file, but normal in a zone file of a whole country."""
        left_out = 0
        for draft in far:
            if looks_swapped(draft, frame):
                words = f"latitude and longitude of the zone {draft.name!r} look swapped"
                self.problems.append(Mistake(draft.where, words))
            elif draft.where.startswith(self.where):
                words = f"the zone {draft.name!r} lies too far from the mission to matter; is it the right place?"
                self.problems.append(Mistake(draft.where, words))
            else:
                left_out += 1
        if left_out:
            self.notes.append(Note("zones_left_out", count=left_out))

    def _open(self, spec: TerrainSpec) -> OpenTerrain | None:
        where = f"{self.where}terrain"
        if spec.peaks and not self.local:
            self.problems.append(
                Mistake(f"{where}.peaks", "peaks are in local metres: add `frame: {origin: [lat, lon], amsl_m: 0}`")
            )
            return None
        try:
            return self.kept.terrain.get((spec, where), partial(opened, spec, where=where))
        except InputError as why:
            self.problems += why.problems
            return None

    def _around(self, terrain: OpenTerrain, frame: Frame, box: tuple[float, float, float, float]) -> Terrain | None:
        try:
            return terrain.around(frame, box)
        except InputError as why:
            self.problems += why.problems
            return None
