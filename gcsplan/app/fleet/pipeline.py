"""The flow of the data: mission file → world → path → mission → verdict → outputs → vehicles.

Each step is one function that takes the result of the step before it. `plan` is the function of `from gcsplan import
plan`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from os import PathLike
from typing import Any

from gcsplan.app.fleet.fleet import finished
from gcsplan.app.fleet.kept_paths import KeptPaths
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.fleet.vehicle_plans import PIECE_S, plan_or_explain, planned_by
from gcsplan.app.parallel.executor import Inline, executor
from gcsplan.app.parallel.sites import world_of
from gcsplan.app.plan.arguments import require
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, Plan, PlanOptions, VehiclePlan
from gcsplan.arrays import Floats
from gcsplan.errors import InputError, NoMission, elements, unknown_name, wrong_argument
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.mission_file.source import planner_options
from gcsplan.mission_file.values.schema import MOST_SEED
from gcsplan.planners.problem import UNIT_OF, Problem, Progress, Solution
from gcsplan.planners.registry import VOLUME_KEYS, AddedEntry
from gcsplan.planners.registry import get as get_planner
from gcsplan.planners.registry import own as own_planner
from gcsplan.world.world import World

__all__ = ["load_mission", "plan", "plan_again", "world_of"]


def plan(  # noqa: PLR0913 - options by name, each with a default
    source: MissionFile | str | PathLike[str] | Mapping[str, Any],
    *,
    planner: str | Callable[[Problem], Solution] | None = None,
    objective: str | None = None,
    seed: int | None = None,
    options: Mapping[str, object] | None = None,
    gate_utc: datetime | None = None,
    progress: Callable[[str, Progress], None] | None = None,
    jobs: int | None = 1,
    cluster: Any = None,
    leave_out: bool | None = None,
    at: str | Sequence[str] | None = None,
) -> Plan:
    """Plan every vehicle of a mission; nothing is written or sent.

    ``source`` is a mission of `load_mission`, or anything that `load_mission` accepts. ``planner``, ``objective``
    (``length`` in metres or ``energy`` in joules), ``seed`` and ``options`` (keys of single planners, such as a swarm's
    ``encoding``) override the file's. ``planner`` may also be a function that gets a `Problem` and returns a
    `Solution`: its path is judged like any other, and its vehicles are planned in this process. ``gate_utc`` is the
    common start as a time of day; every ArduCopter then waits in the air until its own second, or at the gates on its
    way, if the mission's ``arrival`` has some. ``progress(vehicle, progress)`` is called from time to time.

    ``jobs`` processes of this machine plan the vehicles (None: one for each core), or the workers of ``cluster``, the
    address of a dask scheduler or a ``distributed.Client``; the plan is the same to the byte. A few vehicles are
    planned in this process, for processes take seconds to start. A script that asks for processes needs
    ``if __name__ == "__main__":``.

    ``leave_out``: a vehicle without a mission is left out, and the others are planned; ``left_out`` of the plan names
    those, and says why. Otherwise, the first such vehicle refuses the whole (None: as the mission's ``arrival`` says).

    ``at``: when it is flown, in place of the mission's own key, for a ``source`` that is not read yet.

    Returns a `Plan`, whose ``vehicles`` are in the mission's order. In each of them, ``solution.path.points`` is the
    path, (N, 3) float64: east_m and north_m in the mission's plane, and amsl_m. ``mission`` holds the items as they are
    sent, and ``verdict`` is the exact check of those items.

    Raises InputError for a bad mission, UsageError for an argument of another type, NoMission if no safe path exists or
    none was found (``reason`` states which).

    Examples:
        >>> planned = plan({
        ...     "version": 1, "terrain": {"flat_m": 100},
        ...     "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        ...     "limits": {"min_agl_m": 30},
        ...     "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
        ...                   "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 900, "north_m": 0}}],
        ... })
        >>> [uav1] = planned.vehicles
        >>> uav1.verdict.safe, round(uav1.verdict.length_m), uav1.solution.path.points.shape
        (True, 900, (2, 3))
    """
    require(
        "plan", planner=planner, objective=objective, seed=seed, options=options, gate_utc=gate_utc, progress=progress,
        jobs=jobs, cluster=cluster, leave_out=leave_out,
    )  # fmt: skip
    if not isinstance(source, MissionFile):
        source = load_mission(source, departure=gate_utc, at=at)
    elif at is not None:
        raise InputError("the mission is read already: give `at` to load_mission", where="at")
    elif gate_utc is not None and len(source.wind.times_s) > 1 and source.departure != gate_utc:
        words = "the mission is read already, with its forecast from another departure on: give `departure` to "
        raise InputError(f"{words}load_mission", where="gate_utc")
    keys = dict(elements("plan()", "options", (options or {}).items(), tuple, "a mapping of a planner's keys"))
    brief = _brief_of(source, PlanOptions(planner, objective, seed, keys), world_of(source))
    leaving = _leaving(source, leave_out)
    vehicles = _planned(brief, progress, jobs, cluster, leaving)
    return finished(brief, vehicles, progress, leaving, None if gate_utc is None else GateTime(gate_utc))


def plan_again(
    source: MissionFile,
    world: World,
    given: PlanOptions,
    kept: KeptPaths,
    progress: Callable[[str, Progress], None] | None = None,
    known: Mapping[str, Floats] | None = None,
) -> Plan:
    """`plan` for a session, which searches anew only vehicles that differ from what is ``kept``, and tries the
    ``known`` tracks of vehicles first (`Problem.known`)."""
    brief, leaving = replace(_brief_of(source, given, world), known=known or {}), _leaving(source, given.leave_out)
    plans, left_out = kept.get(brief, allowed=leaving.allowed)
    leaving.found += left_out
    try:
        vehicles = _one_by_one(brief, progress, leaving, plans)
    finally:  # a plan that is cancelled leaves what it has found to the next one
        kept.put(brief, list(plans.values()), leaving.found)
    return finished(brief, vehicles, progress, leaving)


def _leaving(source: MissionFile, leave_out: bool | None) -> LeavingOut:
    if leave_out is None:
        leave_out = source.arrival is not None and source.arrival.leave_out
    return LeavingOut(allowed=leave_out)


def _brief_of(source: MissionFile, given: PlanOptions, world: World) -> Brief:
    """The terms on which all vehicles of a mission are planned; the ``given`` options override the file's keys."""
    own = given.planner if callable(given.planner) else None
    entry = get_planner(given.planner or source.planner.name) if own is None else own_planner(own)  # type: ignore[arg-type]
    name = entry.name
    goal = given.objective or source.planner.objective
    if goal not in UNIT_OF:
        raise wrong_argument("plan()", "objective", goal, "'length', 'energy' or 'time'")
    others = None if isinstance(entry, AddedEntry) else entry.options
    merged = _options(source, name) | planner_options(given.options, others)
    if entry.warm_starts:
        _require_warm_start(source, merged)
    number = source.planner.seed if given.seed is None else given.seed
    if not 0 <= number <= MOST_SEED:
        raise wrong_argument("plan()", "seed", number, f"a whole number from 0 to {MOST_SEED}")
    return Brief(
        source, world, name, goal, number, merged, len(source.vehicles) > 1 and entry.by_priority(merged),
        own,
    )  # fmt: skip


def _planned(
    brief: Brief, progress: Callable[[str, Progress], None] | None, jobs: int | None, cluster: Any,
    leaving: LeavingOut,
) -> list[VehiclePlan]:  # fmt: skip
    """Every vehicle's own plan, in this process or by workers. By priority, or to begin around another vehicle's path,
    each vehicle needs the plans before its own;
    a planner that was added may be known in this process alone."""
    here = isinstance(get_planner(brief.planner), AddedEntry) if brief.own is None else True
    if here or brief.by_priority or _leader(brief) is not None:
        return _one_by_one(brief, progress, leaving)
    count = len(brief.source.vehicles)
    begun_s = time.perf_counter()

    def on_done(_: str, done: int) -> None:
        if progress is not None:  # without a vehicle's name, for several are planned at once
            progress("", Progress(time.perf_counter() - begun_s, None, None, f"{done} of {count} planned{watched}"))

    with executor(jobs, cluster, pieces=count, piece_s=PIECE_S) as workers:
        if isinstance(workers, Inline):
            return _one_by_one(brief, progress, leaving)
        watched = f", workers at {workers.dashboard}" if workers.dashboard else ""
        return planned_by(workers, brief, on_done, leaving)


def _one_by_one(
    brief: Brief, progress: Callable[[str, Progress], None] | None, leaving: LeavingOut,
    plans: dict[str, VehiclePlan] | None = None,
) -> list[VehiclePlan]:  # fmt: skip
    """Every vehicle's own plan, in the file's order. By priority (MSFOA), each knows the paths before it; otherwise the
    vehicle around whose path the others begin is planned first. ``plans`` are known by the vehicles' names, and get
    each one that is found; vehicles that ``leaving`` has left out already are not tried."""
    requests = {r.vehicle.name: r for r in brief.source.vehicles}
    arrival, leader = brief.source.arrival, _leader(brief)
    plans = {} if plans is None else plans
    done = {*plans, *(left.name for left in leaving.found)}
    order = list(arrival.order if brief.by_priority and arrival is not None else requests)
    if leader is not None and not brief.by_priority:
        order.sort(key=lambda name: name != leader)
    for name in order:
        if name in done:
            continue
        request = requests[name]
        report = None if progress is None else lambda what, who=name: progress(who, what)
        more: dict[str, object] = {}
        if brief.by_priority:
            earlier = tuple(plan.solution.path.points for plan in plans.values())
            more = {"earlier": earlier, "speed_m_s": request.vehicle.speed_max_m_s}
        if leader in plans:
            more["around"] = plans[leader].solution.path.points
        try:
            plans[name] = plan_or_explain(brief, request, report, options=more)
        except NoMission as why:
            leaving.leave(name, why)
    return [plans[name] for name in requests if name in plans]


def _leader(brief: Brief) -> str | None:
    """The vehicle around whose path the other vehicles' searches begin; None if there is none."""
    name = brief.options.get("warm_start")
    return next((r.vehicle.name for r in brief.source.vehicles if r.vehicle.name == name), None)


def _require_warm_start(source: MissionFile, options: Mapping[str, object]) -> None:
    """Raise InputError unless ``warm_start`` is a path that will be there."""
    given = options.get("warm_start")
    known = ("optimal", *(r.vehicle.name for r in source.vehicles))
    if given is not None and given not in known:
        raise unknown_name(
            f"warm_start is `optimal` or the name of a vehicle of the file, given {given!r}", str(given), known
        )


def _options(source: MissionFile, planner: str) -> dict[str, object]:
    """The file's options for ``planner``; if the file names another planner, only parameters in `VOLUME_KEYS` stay."""
    extras = dict(source.planner.extras)
    own = extras.get("parameters")
    if planner != source.planner.name and isinstance(own, Mapping):
        extras["parameters"] = {k: v for k, v in own.items() if k in VOLUME_KEYS}
    return extras
