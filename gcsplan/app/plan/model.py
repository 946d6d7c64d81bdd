"""The result of planning: a `Plan` of a mission file, with a `VehiclePlan` per vehicle and the `FleetPlan`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from gcsplan.app.plan.left_out import LeftOut
from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.errors import GcsplanError, require_kind, unknown_name
from gcsplan.fleet.arrival import Slot
from gcsplan.fleet.intervals import Interval
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.mission_file.kept import Latest
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Problem, Solution, gap_percent
from gcsplan.planners.registry import get as get_planner
from gcsplan.planners.registry import own as own_planner
from gcsplan.world.world import World

if TYPE_CHECKING:
    from gcsplan.fleet.separation import Encounter, Separation


Named = TypeVar("Named", Slot, TimedPath)

OUTPUTS = "gcsplan.app.output.files"
"""The module that makes documents of a plan, named as the table of planners names theirs: it is imported at need."""

MOST_BUILT = 6
"""Most missions of one path that are kept: a time table tries a few speeds, in a session again and again."""

MOST_VEHICLES_SHOWN = 4
"""Most vehicles that a plan's ``repr`` names."""

TOUCH_M, TOUCH = 1e-3, 1e-7
"""Metres, and part of the bound, by which rounding may put the cost of a plan below its bound."""


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """Options that replace a mission file's own keys, by the names of `plan`'s arguments; None: the file's key counts.

    ``options``: keys of single planners. ``at``: when it is flown. ``leave_out``: vehicles without a mission are left
    out.
    """

    planner: str | Callable[[Problem], Solution] | None = None
    objective: str | None = None
    seed: int | None = None
    options: Mapping[str, object] = field(default_factory=dict)
    at: str | Sequence[str] | None = None
    leave_out: bool | None = None


@dataclass(frozen=True, eq=False)
class Brief:
    """How all vehicles of a mission file are planned: by which planner, with ``options`` that only it knows.

    ``by_priority``: each vehicle is planned with knowledge of those before it, and gives way to them. ``own``: the
    planner, if it is a script's function. ``known``: `Problem.known` by the vehicles' names.
    """

    source: MissionFile
    world: World
    planner: str
    objective: str
    seed: int
    options: Mapping[str, object]
    by_priority: bool = False
    own: Callable[[Problem], Solution] | None = None
    known: Mapping[str, Floats] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<Brief: {self.planner}, {self.objective}, seed {self.seed}>"

    def __getstate__(self) -> dict[str, Any]:
        """Without a script's function, which another process may not have."""
        return {**self.__dict__, "own": None}

    @property
    def run(self) -> Callable[[Problem], Solution]:
        """The planner."""
        return get_planner(self.planner).plan if self.own is None else own_planner(self.own).plan

    def packed(self) -> Brief:
        """The brief without mission and world, for another process, which has read both: `over` puts them in again."""
        return replace(self, source=None, world=None)  # type: ignore[arg-type]

    def over(self, source: MissionFile, world: World) -> Brief:
        """The same for a mission over other terrain."""
        return replace(self, source=source, world=world)


@dataclass(frozen=True, eq=False)
class VehiclePlan:
    """One vehicle's request and all results for it. ``brief`` holds the terrain that it was planned over.

    ``built_last``: the missions of its path that were built and judged last, shared by all plans made from this one.
    """

    request: VehicleRequest
    problem: Problem
    solution: Solution
    mission: Mission
    verdict: Verdict
    speed_m_s: float
    notes: tuple[Note, ...] = ()
    order: Order = field(default_factory=Order)
    brief: Brief | None = None
    built_last: Latest[tuple[Mission, Verdict]] = field(default_factory=lambda: Latest(MOST_BUILT))

    def __post_init__(self) -> None:
        """Raise GcsplanError where a mission that passes costs less than its lower bound: then one of both is wrong."""
        bound = self.solution.lower_bound
        if bound is None or self.verdict.findings:
            return
        per_m = max(1.0, self.problem.horizontal_j_per_m) if self.problem.objective == "energy" else 1.0
        if self.problem.objective == "time":
            per_m = max(float(self.problem.slope_costs(*leg)) for leg in ((1.0, 0.0), (0.0, 1.0), (0.0, -1.0)))
        if self.cost < bound - TOUCH_M * per_m - TOUCH * bound:
            raise GcsplanError(
                f"{self.name}: a bug of gcsplan: the plan costs {self.cost:.3f}, less than its own lower bound of "
                f"{bound:.3f}; nothing is written"
            )

    def __repr__(self) -> str:
        gap = "no bound" if self.gap_percent is None else f"gap {self.gap_percent:.2f} %"
        return f"<VehiclePlan {self.name!r}: {self.verdict.length_m:.0f} m, {gap}, {self.verdict.word}>"

    @property
    def name(self) -> str:
        """The vehicle's name."""
        return str(self.request.vehicle.name)

    @property
    def cost(self) -> float:
        """Cost of the path as it is flown: metres, or joules if the objective is energy; if it is time, seconds at full
        speed, without what corners, speeding up and braking take."""
        if self.problem.objective == "time":
            legs = self.verdict.path_legs
            amsl_m = np.array([(leg.start[2], leg.end[2]) for leg in legs]).reshape(-1, 2)
            run_m, times = np.array([(leg.horizontal_m, leg.times) for leg in legs]).reshape(-1, 2).T
            way_m = np.array([leg.way_m for leg in legs]).reshape(-1, 2)
            seconds = self.problem.slope_costs(run_m, np.diff(amsl_m)[:, 0], amsl_m.mean(axis=1), way_m)
            return math.fsum((seconds * times).tolist())
        return self.verdict.path_energy_j if self.problem.objective == "energy" else self.verdict.length_m

    @property
    def gap_percent(self) -> float | None:
        """How far the flown path may be above the best one, in percent of the lower bound; None without a bound."""
        return gap_percent(self.cost, self.solution.lower_bound)

    def packed(self) -> VehiclePlan:
        """The plan without its terrain, for another process; `restored` is the way back."""
        problem = replace(self.problem, airspace=None, widen=None, progress=None)  # type: ignore[arg-type]
        solution, unknown = replace(self.solution, problem=None), Latest[tuple[Mission, Verdict]](MOST_BUILT)
        return replace(self, problem=problem, solution=solution, brief=None, built_last=unknown)

    def restored(self, over: Brief) -> VehiclePlan:
        """A `packed` plan over the terrain of ``over``, under which it was made."""
        return replace(self, problem=replace(self.problem, airspace=over.world.airspace), brief=over)

    def all_notes(self, fleet: FleetPlan | None) -> tuple[Note, ...]:
        """All notes on this vehicle: on its request, its search, its mission, and its part of the time table."""
        slot = () if fleet is None else fleet.slot(self.name).notes
        return tuple(dict.fromkeys((*self.notes, *self.solution.notes, *self.verdict.notes, *slot)))


@dataclass(frozen=True, eq=False)
class FleetPlan:
    """The time table of all vehicles. ``slots`` and ``motions`` are in the order of the plan's vehicles.

    ``order`` is the order of arrival. ``separation`` is None for a single vehicle; it counts every declared wind, as
    ``intervals`` do, which are those between arrivals (none in still air). ``start_utc``: the common start, if it is a
    time of day. ``in_every_wind``: whether all of it holds in every declared wind; None in still air.
    """

    mode: str
    order: tuple[str, ...]
    interval_s: float
    slots: tuple[Slot, ...]
    motions: tuple[TimedPath, ...]
    separation: Separation | None = None
    notes: tuple[Note, ...] = ()
    start_utc: datetime | None = None
    intervals: tuple[Interval, ...] = ()
    in_every_wind: bool | None = None

    def __repr__(self) -> str:
        return f"<FleetPlan {self.mode}: {len(self.slots)} vehicles>"

    def slot(self, name: str) -> Slot:
        """The slot of a vehicle. Raises InputError, UsageError."""
        return _of_name("slot()", name, self.slots)

    def motion(self, name: str) -> TimedPath:
        """The motion of a vehicle. Raises InputError, UsageError."""
        return _of_name("motion()", name, self.motions)

    @property
    def closest(self) -> Encounter | None:
        """The pair that comes nearest to each other in the air; None if no two ever fly at the same time."""
        return None if self.separation is None else self.separation.least


def _of_name(where: str, name: str, all_of: Sequence[Named]) -> Named:
    require_kind(where, "name", name, str, "the name of a vehicle")
    found = next((one for one in all_of if one.name == name), None)
    if found is None:
        raise unknown_name(f"{where} takes the name of a vehicle, given {name[:64]!r}", name, (v.name for v in all_of))
    return found


@dataclass(frozen=True, eq=False)
class Plan:
    """A planned mission file.

    ``planner`` is the one that was used, ``left_out`` are vehicles without a mission; ``leaves_out``: they are allowed.
    """

    source: MissionFile
    world: World
    planner: str
    objective: str
    seed: int
    vehicles: tuple[VehiclePlan, ...]
    notes: tuple[Note, ...] = ()
    fleet: FleetPlan | None = None
    left_out: tuple[LeftOut, ...] = ()
    leaves_out: bool = False

    def __repr__(self) -> str:
        shown, more = self.vehicles[:MOST_VEHICLES_SHOWN], len(self.vehicles) - MOST_VEHICLES_SHOWN
        found = [f"{v.name} {v.verdict.length_m:.0f} m {v.verdict.word}" for v in shown]
        return f"<Plan {self.source.name!r}: {', '.join([*found, *([f'{more} more'] if more > 0 else [])])}>"

    def to_dict(self) -> dict[str, Any]:
        """The document of ``plan --json``, as plain values that `json` takes; the contract describes its keys."""
        return cast(dict[str, Any], import_module(OUTPUTS).document_of(self))

    def to_geojson(self) -> dict[str, Any]:
        """Tracks, way points and zones: the FeatureCollection of ``mission.geojson``, as plain values.

        Positions are longitude and latitude in degrees, and altitude in metres above mean sea level.
        """
        return cast(dict[str, Any], import_module(OUTPUTS).geojson_of(self))

    def _repr_html_(self) -> str:
        """Map and table for a notebook, or for a web page: no script, no style, nothing from elsewhere."""
        return cast(str, import_module(OUTPUTS).sketch_of(self))
