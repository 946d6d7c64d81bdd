"""The contents of a mission file, read and checked: metres inside, degrees where input and output need them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from gcsplan.mavlink.mission.mission import AltitudeFrame
from gcsplan.mavlink.mission.return_parameters import ReturnRoute
from gcsplan.mission_file.published.times import Hours, begins_with_day
from gcsplan.notes.note import Note
from gcsplan.vehicle import MissionEnd, Vehicle
from gcsplan.wind.declared import STILL_AIR, DeclaredWind, FlightWind
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Zone
from gcsplan.world.terrain.geoid import GeoidGrid

ReturnRequirement = Literal["required", "reported"]
GatePlaces = tuple[tuple[float, float], ...]
"""Places of gates: east_m, north_m."""


@dataclass(frozen=True, slots=True)
class ArrivalRequest:
    """The fleet's arrival. ``order`` names every vehicle once; ``interval_s`` applies to a sequence.

    ``best_order``: the order is searched, and ``order`` is only the file's. ``arrive_s`` is the arrival of the
    first of a sequence, or of all together; None: by ``clock``, when the first can (``first``) or when the whole fleet
    can (``fleet``). ``hold`` is where a vehicle waits that would arrive too early: on the ground, at the gate (the top
    of take-off), or nowhere. ``window_s``: each may arrive this much earlier or later. ``pad_clear_s`` is the time
    after a landing at which the pad is free again; None: never. ``leave_out``: vehicles without a mission are left out,
    and the others are planned. ``gates``: how many times each copter waits on its way until a time of day, or where.
    """

    mode: Literal["sequence", "together", "none"]
    order: tuple[str, ...]
    interval_s: float
    separation_m: float
    best_order: bool = False
    arrive_s: float | None = None
    clock: Literal["first", "fleet"] | None = None
    hold: Literal["ground", "gate", "none"] = "ground"
    window_s: float = 0.0
    pad_clear_s: float | None = None
    leave_out: bool = False
    gates: int | GatePlaces | Literal["auto"] | None = None


@dataclass(frozen=True)
class VehicleRequest:
    """The request for one vehicle.

    ``start``, ``goal`` are east_m, north_m and the AMSL metres of the *ground* there; ``start_deg``, ``goal_deg`` are
    the same as (latitude, longitude), as written. ``start_amsl_m``, ``goal_amsl_m`` are their altitudes if they are in
    the air (local missions), else None. ``takeoff_agl_m``, ``approach_agl_m`` None mean the lowest that the limits
    allow. ``via`` holds east_m, north_m, and agl_m or None for any height. ``depart_window_s``: it may depart this much
    later than planned.
    """

    vehicle: Vehicle
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    start_deg: tuple[float, float]
    goal_deg: tuple[float, float]
    takeoff_agl_m: float | None = None
    approach_agl_m: float | None = None
    via: tuple[tuple[float, float, float | None], ...] = ()
    end: MissionEnd = "land"
    rtl_rel_home_m: float | None = None
    return_route: ReturnRoute | None = None
    takeoff_heading_deg: float | None = None
    climb_out: Literal["straight", "circles"] = "straight"
    start_amsl_m: float | None = None
    goal_amsl_m: float | None = None
    depart_window_s: float = 0.0


@dataclass(frozen=True, slots=True)
class PlannerRequest:
    """The planner and its settings; ``extras`` are the keys that only some planners have."""

    name: str = "optimal"
    objective: Literal["length", "energy", "time"] = "length"
    seed: int = 1
    gap_percent: float = 0.1
    budget_s: float = 10.0
    budget_mb: float = 1024.0
    extras: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Content:
    """The source of a mission, from which any process can read it again.

    ``where`` is its name in messages, ``given`` the mapping of keys after all ``changes``, ``text`` the text before
    them if it has one. ``options``: keys that a change has set, each with the option. ``held``: the files
    that a script gave as objects, by the names that ``given`` has for them. The others are as in `load_mission`.
    """

    file: Path
    where: str
    given: dict[str, Any]
    text: str | None
    planner_names: tuple[str, ...] | None = None
    around: tuple[tuple[float, float], ...] = ()
    departure: datetime | None = None
    at: tuple[str, ...] | None = None
    options: tuple[tuple[str, str], ...] = ()
    changes: tuple[Note, ...] = ()
    held: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MissionFile:
    """A mission file, read and checked; metres inside.

    ``airspace_scale`` is the largest scale of the plane over the loaded terrain. ``inputs`` describes the sources in
    the outputs; ``notes`` are for the user. ``wider(margin_m, most_cells)`` returns the same file with more terrain
    loaded: that far around all terminals, at least twice as far as here, or as far as there is terrain; None if that
    takes more cells, or if there is no more. ``level`` counts the widenings; the terrain of each contains that of the
    one before. ``reaching(places)`` reads the same content again, with terrain for these places (latitude, longitude)
    too. ``at_level(level)`` is the file over the terrain of that level; None if there is none. ``content`` is what
    it was read from. ``way_home``: whether a safe return is required, or only reported where it is judged. ``geoid`` is
    the grid that the terrain was converted with, if it is ellipsoidal. ``hours`` are those of the flight, if a zone was
    left out because it does not apply in them. ``wind``: the winds that may blow; `STILL_AIR` if none is declared.
    ``departure``: the mission's T+0, if it says when it is flown: the common start, or the beginning of ``at``.
    """

    name: str
    path: Path
    stem: str
    frame: Frame
    surface: Surface
    zones: tuple[Zone, ...]
    airspace_scale: float
    vehicles: tuple[VehicleRequest, ...]
    arrival: ArrivalRequest | None
    planner: PlannerRequest
    altitude_frame: AltitudeFrame
    terrain_error_m: float
    local: bool
    inputs: dict[str, object]
    notes: tuple[Note, ...]
    wider: Callable[[float, int], MissionFile | None] | None = None
    level: int = 0
    way_home: ReturnRequirement = "reported"
    reaching: Callable[[Sequence[tuple[float, float]]], MissionFile] | None = None
    geoid: GeoidGrid | None = None
    hours: Hours | None = None
    at_level: Callable[[int], MissionFile | None] | None = None
    content: Content | None = None
    wind: DeclaredWind = STILL_AIR
    departure: datetime | None = None

    def flight_wind(self, request: VehicleRequest) -> FlightWind | None:
        """The declared winds as a vehicle flies in them; None in still air with a departure on time.

        One vehicle leaves at T+0, or so late as it may; the vehicles of a fleet when their time table says.
        """
        late_s = request.depart_window_s
        if self.wind.still and not late_s:
            return None
        begins_s = 0.0 if self.departure is None else self.departure.timestamp()
        return FlightWind(self.wind, (begins_s, begins_s + late_s if len(self.vehicles) == 1 else math.inf), late_s)

    @property
    def start(self) -> datetime | None:
        """The common start that the mission states: a time of day, UTC, in whole seconds; None without one."""
        if self.departure is None or self.content is None:
            return None
        if self.content.departure is None and begins_with_day(self.content.at or self.content.given.get("at")):
            return None
        return self.departure.astimezone(UTC).replace(microsecond=0)

    @property
    def leaves_s(self) -> float | None:
        """When a vehicle that flies alone leaves the ground, seconds UTC since 1970; None: not known."""
        return None if self.start is None or len(self.vehicles) > 1 else self.start.timestamp()

    @property
    def changes(self) -> tuple[Note, ...]:
        """A note on each change of the document that was made before it was read."""
        return () if self.content is None else self.content.changes

    def __repr__(self) -> str:
        return f"<MissionFile {self.name!r}: {len(self.vehicles)} vehicles, {len(self.zones)} zones>"

    def __getstate__(self) -> dict[str, Any]:
        """Without what loads more terrain: a copy in another process has the terrain that it had here."""
        return {**self.__dict__, "wider": None, "at_level": None}
