"""`Planner`: a mission that lives in memory, is changed key by key, and is planned again without being loaded anew.

    session = Planner("mission.yaml")
    session.change({"vehicles.uav1.goal": [36.61, -84.17], "limits.max_agl_m": 120})
    planned = session.plan(on_path=show)

A plan of a session has the same bytes as the command line writes for the same mission: both read and plan by the same
functions. A session only keeps what they would read again.
"""

from __future__ import annotations

import copy
import os
import re
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gcsplan.app.fleet import pipeline
from gcsplan.app.fleet.kept_paths import KeptPaths
from gcsplan.app.parallel.sites import world_of
from gcsplan.app.plan.arguments import require
from gcsplan.app.plan.model import Plan, PlanOptions, VehiclePlan
from gcsplan.arrays import Floats
from gcsplan.errors import (
    InputError,
    UsageError,
    cancelled_by,
    elements,
    heed_cancel,
    require_kind,
    unknown_name,
    wrong_argument,
)
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.kept import KeptWorld, Latest, is_kept
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.request import Content, MissionFile
from gcsplan.mission_file.source import read_content
from gcsplan.planners.problem import Problem, Progress, Solution
from gcsplan.plugins import failing
from gcsplan.world.world import World

__all__ = ["BetterPath", "Planner"]

MissionSource = MissionFile | str | os.PathLike[str] | Mapping[str, Any]

ZONE_LISTS = ("no_fly", "keep_in")

MOST_WORLDS = 2
"""Most worlds that are kept: the mission's, and that of the drafts of one vehicle alone."""

AT_PLACE_M = 0.05
"""A way point of a path that lies so near to a via is at that place, m."""

_STEP = re.compile(r"\.?([^.\[\]]+)|\[(\d+)\]")
"""A step of a key's place: a name, or the number of an element."""


@dataclass(frozen=True, eq=False)
class BetterPath:
    """A path that is better than all before it in this plan, while the search goes on.

    ``lat_deg``, ``lon_deg``, ``amsl_m``: its way points, (N,) each. Its legs keep the limits with the planner's
    margins, but the mission made of it is not judged: only the `Plan` that is returned is proved. ``cost`` and
    ``lower_bound`` are metres, joules or seconds by the objective; ``elapsed_s`` counts from the call.
    """

    vehicle: str
    lat_deg: Floats
    lon_deg: Floats
    amsl_m: Floats
    cost: float
    lower_bound: float | None
    elapsed_s: float

    def to_geojson(self) -> dict[str, Any]:
        """The path as a Feature; the third coordinate is metres above mean sea level."""
        places = np.column_stack([self.lon_deg, self.lat_deg, self.amsl_m]).tolist()
        about = {"vehicle": self.vehicle, "cost": self.cost, "lower_bound": self.lower_bound, "judged": False}
        return {"type": "Feature", "properties": about, "geometry": {"type": "LineString", "coordinates": places}}


PathCall = Callable[[BetterPath], None]
BoundCall = Callable[[str, float], None]
"""Called with the vehicle's name and its lower bound, metres or joules."""


class Planner:
    """A mission that is changed and planned again; its terrain and zones stay in memory.

    ``mission`` is anything that `load_mission` accepts, or what it returned. The other arguments are those of `plan`,
    for every plan of the session. Files are read once: `reload` reads them again.

    All methods may be called from any thread. One plan is made at a time, the others wait; `cancel` ends them all.
    Raises InputError if the mission cannot be read.

    Examples:
        >>> from gcsplan import Planner
        >>> session = Planner({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> session.change({"vehicles.uav1.goal": {"east_m": 500, "north_m": 0}})
        >>> session.plan()
        <Plan 'mission': uav1 500 m safe>
        >>> session.plan({"limits.min_agl_m": 50}).vehicles[0].verdict.lowest.min_agl_m >= 50  # for this plan alone
        True
    """

    def __init__(
        self,
        mission: MissionSource,
        *,
        planner: str | Callable[[Problem], Solution] | None = None,
        objective: str | None = None,
        seed: int | None = None,
        options: Mapping[str, object] | None = None,
        at: str | Sequence[str] | None = None,
    ) -> None:
        require("Planner", planner=planner, objective=objective, seed=seed, options=options)
        keys = dict(elements("Planner()", "options", (options or {}).items(), tuple, "a mapping of a planner's keys"))
        self._options = PlanOptions(planner, objective, seed, keys)
        source = mission if isinstance(mission, MissionFile) else load_mission(mission, at=at)
        if source.content is None:
            raise UsageError(
                "the mission was not made by load_mission: give its file, text or mapping", where="Planner()"
            )
        # Lines of a text would be those before its changes.
        self._content: Content = replace(source.content, text=None)
        self._kept, self._paths = KeptWorld(), KeptPaths()
        self._worlds: Latest[World] = Latest(MOST_WORLDS)
        self._tracks: dict[str, Floats] = {}  # the last path of each vehicle: (N, 3) lat, lon, AMSL of its way points
        self._planning, self._state = threading.RLock(), threading.Lock()
        self._cancels = 0

    def __repr__(self) -> str:
        return f"<Planner of {self._content.where!r}>"

    @property
    def mission(self) -> dict[str, Any]:
        """A copy of the mission's keys as they are now; files that were given as objects have names in it."""
        return copy.deepcopy(self._content.given)

    def change(self, changes: Mapping[str, object]) -> None:
        """Change keys of the mission, all of them or none; nothing is planned.

        A key is named by its place, as messages name it: ``limits.max_agl_m``, ``vehicles[0].goal``,
        ``vehicles.uav1.start`` (by the vehicle's name), ``no_fly.village`` (by the zone's). The value None removes it.
        ``no_fly.NAME`` or ``keep_in.NAME`` that is not there yet adds a zone or area; so does ``no_fly[N]`` behind the
        last one. Values are those of a mission as a mapping, GeoJSON included.

        Raises InputError for a place that is not there. Whether the mission is right, the next plan says.
        """
        with self._state:
            self._content = _changed(self._content, changes)

    def restore(self, mission: Mapping[str, object]) -> None:
        """Set all keys to those of ``mission``, such as an earlier `mission` of this session.

        Raises InputError, UsageError."""
        expected = "a mapping of a mission's keys"
        require_kind("restore()", "mission", mission, Mapping, expected)
        keys = dict(elements("restore()", "mission", mission.items(), tuple, expected))
        with self._state:
            self._content = _with_keys(self._content, keys)

    def loaded(self) -> MissionFile:
        """The mission as it is now, as `load_mission` returns it; files are not read again.

        Raises InputError.
        """
        with self._planning:
            return load_content(self._content, self._kept)

    def plan(
        self,
        changes: Mapping[str, object] | None = None,
        *,
        on_path: PathCall | None = None,
        on_bound: BoundCall | None = None,
        leave_out: bool | None = None,
        alone: str | None = None,
        draft: bool = False,
    ) -> Plan:
        """Plan the mission as it is now; ``changes`` count for this plan alone.

        ``on_path(better)`` is called for each path that is better than those before, ``on_bound(vehicle, bound)`` for
        each higher lower bound, both in this thread while the search goes on; what they raise ends the plan.

        ``alone`` names a vehicle: the mission is planned as if the others were not in it. This is quick while only that
        vehicle changes, and says nothing of the others.

        ``draft``: the last path of each vehicle in this session is tried first, drawn through the places as they are
        now. If it is legal, it is the first path, some times sooner than a search finds one; so a plan need not have
        the bytes that the command line writes. For somebody who drags a point: plan without it when he lets go.

        Returns what `gcsplan.plan` returns. Raises InputError, NoMission, and Cancelled after `cancel`.
        """
        return self._planned(self._cancels, changes, on_path, on_bound, leave_out, alone, draft)

    def _planned(
        self,
        cancels: int,
        changes: Mapping[str, object] | None,
        on_path: PathCall | None,
        on_bound: BoundCall | None,
        leave_out: bool | None,
        alone: str | None = None,
        draft: bool = False,
    ) -> Plan:
        """See `plan`; a cancel after the first ``cancels`` ends it."""
        require("plan", on_path=on_path, on_bound=on_bound, leave_out=leave_out, alone=alone, draft=draft)
        begun_s = time.perf_counter()
        content = self._content if changes is None else _changed(self._content, changes)
        with cancelled_by(lambda: self._cancels != cancels), self._planning:
            heed_cancel()
            source = load_content(content if alone is None else _alone(content, alone), self._kept, stay=draft)
            listened = on_path or on_bound or draft
            heard = _Listening(source, on_path, on_bound, begun_s, self._tracks) if listened else None
            # What counts for this plan alone leaves no trace in plans that are no drafts.
            kept = self._paths if changes is None and alone is None and not draft else KeptPaths()
            known = heard.known_tracks() if heard and draft else {}
            options = replace(self._options, leave_out=leave_out)
            return pipeline.plan_again(source, self._world(source), options, kept, heard, known)

    def _world(self, source: MissionFile) -> World:
        """The world of a mission; the last one if ground and zones are the same."""
        frame, scale = source.frame, source.airspace_scale
        made_of = (source.surface, source.zones, scale, frame.lat_deg, frame.lon_deg, frame.amsl_m)
        return self._worlds.get(made_of, partial(world_of, source), keeps=lambda w: is_kept(w.airspace.surface))

    async def plan_async(
        self,
        changes: Mapping[str, object] | None = None,
        *,
        on_path: PathCall | None = None,
        on_bound: BoundCall | None = None,
        leave_out: bool | None = None,
    ) -> Plan:
        """`plan` in a thread of its own, which calls ``on_path`` and ``on_bound``. If the task is cancelled, so is the
        plan, and every other one of this session."""
        import asyncio

        given = (self._cancels, changes, on_path, on_bound, leave_out)  # a cancel counts before the thread begins, too
        try:
            return await asyncio.to_thread(self._planned, *given)
        except asyncio.CancelledError:
            self.cancel()
            raise

    def cancel(self) -> None:
        """End every plan of this session that has begun or waits; each raises Cancelled. Later plans are not affected.

        A plan ends at its next step of counted work, or within some milliseconds between them.
        """
        with self._state:
            self._cancels += 1

    def reload(self) -> None:
        """Forget what is kept of files, so that the next plan reads them as they are then."""
        with self._planning:
            self._kept, self._paths, self._worlds = KeptWorld(), KeptPaths(), Latest(MOST_WORLDS)
            self._tracks.clear()


class _Listening:
    """Turns a plan's progress into calls for better paths and bounds. A search that begins anew with larger margins
    has paths of its own, which count from the first again. ``tracks``: where the last path of each vehicle is kept."""

    def __init__(
        self, source: MissionFile, on_path: PathCall | None, on_bound: BoundCall | None, begun_s: float,
        tracks: dict[str, Floats],
    ) -> None:  # fmt: skip
        self._frame, self._on_path, self._on_bound, self._begun_s = source.frame, on_path, on_bound, begun_s
        self._tracks = tracks
        self._vias = {v.vehicle.name: np.array([p[:2] for p in v.via]).reshape(-1, 2) for v in source.vehicles}
        for name in tracks.keys() - self._vias.keys():
            del tracks[name]
        self._known: dict[str, tuple[float, float, float]] = {}  # by vehicle: cost, bound, seconds of its search

    def known_tracks(self) -> dict[str, Floats]:
        """(N, 3) east_m, north_m, amsl_m of the way points of each vehicle's last path, without its vias."""
        return {
            name: np.column_stack([self._frame.to_plane(track[:, 0], track[:, 1]), track[:, 2]])
            for name, track in self._tracks.items()
        }

    def __call__(self, vehicle: str, state: Progress) -> None:
        cost, bound, until_s = self._known.get(vehicle, (np.inf, 0.0, 0.0))
        if state.elapsed_s < until_s:
            cost, bound = np.inf, 0.0
        if state.lower_bound is not None and state.lower_bound > bound and self._on_bound is not None:
            bound = state.lower_bound
            self._on_bound(vehicle, bound)
        if state.path is not None and state.cost is not None and state.cost < cost:
            cost = state.cost
            points = state.path.points
            degrees = self._frame.to_degrees(points[:, 0], points[:, 1])
            away_m = np.linalg.norm(points[:, None, :2] - self._vias[vehicle], axis=-1).min(axis=1, initial=np.inf)
            self._tracks[vehicle] = np.column_stack([degrees, points[:, 2]])[away_m > AT_PLACE_M]
            if self._on_path is not None:
                lat, lon = degrees.T
                elapsed_s = time.perf_counter() - self._begun_s
                self._on_path(BetterPath(vehicle, lat, lon, points[:, 2].copy(), cost, state.lower_bound, elapsed_s))
        self._known[vehicle] = cost, bound, state.elapsed_s


def path_of(v: VehiclePlan, world: World, elapsed_s: float) -> BetterPath:
    """The last path of a vehicle's search."""
    points = v.solution.path.points
    lat, lon = world.frame.to_degrees(points[:, 0], points[:, 1]).T
    return BetterPath(v.name, lat, lon, points[:, 2].copy(), v.cost, v.solution.lower_bound, elapsed_s)


def _alone(content: Content, name: str) -> Content:
    """The mission with one of its vehicles, and nothing that is about others. Raises InputError."""
    vehicles = content.given.get("vehicles")
    known = _named(vehicles) if isinstance(vehicles, list) else {}
    if name not in known:
        raise unknown_name(f"alone names a vehicle of the mission, given {name[:64]!r}", name, known)
    given = {key: value for key, value in content.given.items() if key != "arrival"}
    given["vehicles"] = [vehicles[known[name]]]  # type: ignore[index]
    planner = given.get("planner")
    if isinstance(planner, dict) and planner.get("warm_start") in known.keys() - {name}:
        given["planner"] = {key: value for key, value in planner.items() if key != "warm_start"}
    return replace(content, given=given)


def _changed(content: Content, changes: Mapping[str, object]) -> Content:
    """The content with other values of some keys. Raises InputError, UsageError."""
    expected = "a mapping from keys to values, such as {'limits.min_agl_m': 40}"
    require_kind("change()", "changes", changes, Mapping, expected)
    given = dict(content.given)
    touched: set[str] = set()  # sections of which ``given`` has its own copy
    for place, value in elements("change()", "changes", changes.items(), tuple, expected):
        if not isinstance(place, str):
            raise wrong_argument("change()", "a key", place, "named by text, such as 'limits.min_agl_m'")
        first = _STEP.match(place)
        section = "" if first is None else str(first[1])
        if section in given and section not in touched:
            given[section] = copy.deepcopy(given[section])
        touched.add(section)
        with failing(f"change(): {place[:80]}"):  # a stranger's mapping
            _put(given, place, value)
    return _with_keys(content, given, touched)


def _with_keys(content: Content, keys: Mapping[str, object], touched: Collection[str] | None = None) -> Content:
    """The content with these keys alone. The sections in ``touched`` (None: all) may have arrays, GeoJSON and
    tuples, as any mapping."""
    held = dict(content.held)
    new = {section: value for section, value in keys.items() if touched is None or section in touched}
    given = dict(keys) | read_content(new, None, held=held)[2]
    text = repr(given) if held else ""
    return replace(content, given=given, held={name: data for name, data in held.items() if repr(name) in text})


def _put(whole: dict[str, Any], place: str, value: object) -> None:
    """Set, add or remove what ``place`` names. Raises InputError."""
    steps: list[str | int] = []
    at = 0
    for found in _STEP.finditer(place):
        if found.start() != at:
            break
        at = found.end()
        steps.append(found[1] if found[2] is None else int(found[2]))
    if at != len(place) or not steps:
        raise InputError(f"no key has the place {place[:80]!r}; places are such as vehicles[0].goal", where="change()")
    if steps[0] in ZONE_LISTS and len(steps) == 2 and not whole.get(steps[0]):
        whole[steps[0]] = []  # this is the first zone
    here: Any = whole
    for step in steps[:-1]:
        if isinstance(here, dict) and isinstance(step, str):
            here = here.setdefault(step, {})
            continue
        here = here[_index(here, step, place)]
    last = steps[-1]
    if isinstance(here, dict) and isinstance(last, str):
        here.pop(last, None) if value is None else here.update({last: value})
        return
    if isinstance(here, list):
        known = _named(here)
        new = last == len(here) or (isinstance(last, str) and last not in known and steps[0] in ZONE_LISTS)
        if new and value is not None:
            named = isinstance(last, str) and isinstance(value, Mapping) and "type" not in value
            here.append({"name": last, **value} if named else value)  # type: ignore[dict-item]
            return
    index = _index(here, last, place)
    if value is None:
        del here[index]
    else:
        here[index] = value


def _named(elements: list[Any]) -> dict[str, int]:
    """The numbers of elements by their names."""
    return {str(e["name"]): k for k, e in enumerate(elements) if isinstance(e, dict) and e.get("name")}


def _index(here: Any, step: str | int, place: str) -> int:
    """The number of an element that is named or counted. Raises InputError."""
    if not isinstance(here, list):
        raise InputError(f"{place[:80]} is not there: {str(step)[:40]!r} is no key of a value", where="change()")
    known = _named(here)
    if isinstance(step, str):
        if step not in known:
            raise unknown_name(f"{place[:80]} is not there: no element is named {step[:40]!r}", step, known)
        return known[step]
    if step >= len(here):
        raise InputError(f"{place[:80]} is not there: the list has {len(here)} elements", where="change()")
    return step
