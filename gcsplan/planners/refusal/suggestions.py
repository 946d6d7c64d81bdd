"""Cures where there is no path: change one limit at a time and plan the changed problem.

`Trials` plans the changed versions, bounded in number and time. There are two kinds of plan. A quick one stops at its
first path: it shows that there is one, and which changes are worth more. A whole one has the budget and the requested
gap of the problem, and every reason to refuse a plan, such as the battery: only a whole plan shows that a value would
do. So a limit's value is reported to do only if a whole plan with it has a mission.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import CheckFailed, GcsplanError, InputError, LimitValues, NoMission
from gcsplan.planners.lattice.routes import LatticeSize, Router
from gcsplan.planners.problem import PlanFunction, Problem, Progress, Refusal
from gcsplan.planners.profile.track import denser
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import runs_m
from gcsplan.world.geometry.zones import Circle, Zone, keep_in_of, no_fly_of

MOST_TRIALS = 32
"""Most plans of changed problems."""
SHARE, LEAST_S = 0.3, 1.0
"""No plan begins after this part of ``budget_s``, or after this many seconds if that is more."""
GRACE_S = 1.0
"""A plan that runs this many seconds beyond that time is stopped at its next progress report."""
WHOLE_SHARE = 2.0
"""No whole plan begins after whole plans took this many times ``budget_s``, and none runs on after once more of it."""
BUDGET_PARTS = 12
"""The ``budget_s`` of one plan is that time divided by this number."""
VALUES, WHOLE = 9, 3
"""Most values of one limit that are tried quickly, and that are planned whole."""
LACKS = {
    "battery": "the battery is too small",
    "time": "the arrival time is not kept",
    "too_many_items": "the mission has too many items",
}
"""Words for a plan that found a path, and no mission, by the reason of its refusal."""
ANY_PERCENT = 1e6
"""Requested gap so large that the first path is good enough."""
HIGHEST_M, LEAST_DEG = 9500.0, 0.05
"""The highest ceiling, metres, and the smallest climb limit, degrees, that are tried."""


FILLED = "give a terrain model that knows it (`gcsplan dem fetch` gets one), or fill its voids (nodata)"
"""Advice for unknown ground."""
NAMES, SINGLES = 5, 8
"""Most no-fly zones that are named in a message, and that are removed one at a time."""
STEEPEST_DEG, STEEPEST_TURNING_DEG = 90.0, 45.0
"""Climb angle that means no limit; and the largest that the mission file allows a fixed wing."""
ROUNDED_M = 0.05
"""Metres that rounding way points to whole centimetres may cost below a ceiling; generous."""
LEVEL = LatticeSize(math.inf, 40_000)
"""Lattice on which the altitude of the lowest pass is estimated."""


class Trials:
    """Plans of changed versions of one problem: at most `MOST_TRIALS` quick ones, none of them begun after ``share_s``
    seconds, and whole ones, bounded by `WHOLE_SHARE`.

    ``plan`` returns a solution or raises NoMission; ``whole`` is the same with every requirement of the caller on a
    plan, and may also raise CheckFailed.
    """

    def __init__(self, problem: Problem, plan: PlanFunction, whole: PlanFunction | None = None) -> None:
        self.problem, self._plan, self._whole = problem, plan, whole or plan
        self.share_s = max(SHARE * problem.budget_s, LEAST_S)
        self._begun_s = time.perf_counter()
        self._whole_s = 0.0
        self._left = MOST_TRIALS
        self.stopped = False
        """Whether the last quick plan was stopped, so that it is not known whether its problem has a path."""
        self.lacks = ""
        """The lack of the last plan without a mission, in words."""

    @property
    def _now_s(self) -> float:
        return time.perf_counter() - self._begun_s

    @property
    def spent(self) -> bool:
        """Whether no further quick plan is to be begun."""
        return self.stopped or self._left <= 0 or self._now_s - self._whole_s >= self.share_s

    def path(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of a path of a changed problem, found quickly; None if the planner refuses. ``what`` names the
        change in progress reports."""
        self._left -= 1
        until_s = self.share_s + GRACE_S + self._whole_s

        def watch(progress: Progress) -> None:
            if self._now_s > until_s:
                self.stopped = True
                raise Refusal("no mission: no path was found in the time for it", reason="not_found")

        budget_s = min(self.problem.budget_s, self.share_s / BUDGET_PARTS)
        quick = replace(changed, gap_percent=ANY_PERCENT, budget_s=budget_s, progress=watch)
        return self._points(self._plan, quick, what)

    def whole(self, changed: Problem, what: str) -> Floats | None:
        """(N, 3) points of the path of a whole plan of a changed problem; None if it is refused, or stopped: then
        ``lacks`` is empty."""
        begun_s, stopped = self._now_s, self._whole_s >= WHOLE_SHARE * self.problem.budget_s
        until_s = begun_s + (WHOLE_SHARE + 1.0) * self.problem.budget_s - self._whole_s

        def watch(progress: Progress) -> None:
            nonlocal stopped
            if self._now_s > until_s:
                stopped = True
                raise Refusal("no mission: no path was found in the time for it", reason="not_found")

        points = (
            None if stopped else self._points(self._whole, replace(changed, progress=watch), f"the whole of {what}")
        )
        self._whole_s += self._now_s - begun_s
        if stopped:
            self.lacks = ""
        return points

    def _points(self, plan: PlanFunction, changed: Problem, what: str) -> Floats | None:
        if self.problem.progress is not None:
            self.problem.progress(Progress(self._now_s, None, None, f"no path; tries {what}"))
        try:
            return plan(changed).path.points
        except (NoMission, InputError, CheckFailed) as refused:
            self.lacks = _lacks(refused)
            return None

    def least(
        self, name: str, at: Callable[[float], Problem], given: float, enough: float, values: Values
    ) -> LeastValue:
        """The least value over ``given`` with which a mission was planned; ``at(value)`` is the problem with it.

        The first value tried is ``enough``, which need not suffice; ``name`` of the limit, for progress reports. Values
        with a path are found quickly; of them the lowest are planned whole, and at last the highest: the result is the
        first of these that has a mission.
        """
        bad, good, found, open_ = given, enough, LeastValue(), list[float]()
        for _ in range(VALUES):
            value = values.between(bad, good) if open_ else good
            if self.spent or not bad < value <= values.most or (open_ and value >= good):
                break
            if self.path(at(value), f"{name} {value:g}") is not None:
                good = value
                open_.append(value)
            elif not self.stopped:
                bad = value
                found.failed(value, self.lacks)
                if not open_:
                    good = min(values.beyond(given, value), values.most)
        for left in reversed(range(WHOLE)):
            if not open_:
                break
            value = open_.pop(-1 if left else 0)
            found.path = self.whole(at(value), f"{name} {value:g}")
            if found.path is not None:
                found.value = value
                break
            if not self.lacks:  # stopped
                found.untried = value
                break
            found.failed(value, self.lacks)
            beyond = min(values.beyond(given, value), values.most)
            if not open_ and beyond > value:
                open_.append(beyond)
        return found


def _lacks(refused: GcsplanError) -> str:
    """The lack of a plan that was refused, in words that follow ``with VALUE``."""
    if isinstance(refused, CheckFailed):
        return refused.headline
    if isinstance(refused, InputError):
        return "the mission file is refused"
    return LACKS.get(refused.reason or "", "none is found")


@dataclass(slots=True)
class LeastValue:
    """The least value with which a whole plan has a mission, its path, and the largest value below it without one, and
    what that lacks; a value with a path whose whole plan was not tried. NaN and None where there is none."""

    value: float = math.nan
    path: Floats | None = None
    in_vain: float = math.nan
    lacks: str = ""
    untried: float = math.nan

    def failed(self, value: float, lacks: str) -> None:
        """Note that a value does not suffice."""
        self.in_vain, self.lacks = value, lacks

    def words(self, given: str) -> str:
        """The bracketed words of a message: the value that was ``given``, and the one that does not suffice."""
        return f"({given}" + ("" if math.isnan(self.in_vain) else f", with {self.in_vain:g} {self.lacks}") + ")"

    @property
    def no_value(self) -> str:
        """The words behind ``there is a path`` where no value is known to do."""
        words = "" if math.isnan(self.in_vain) else f", but with {self.in_vain:g} {self.lacks}"
        if not math.isnan(self.untried):
            words += f", and with {self.untried:g}, whose whole mission was not tried in time"
        return words


@dataclass(frozen=True, slots=True)
class Values:
    """The next values of a limit to try: ``between(bad, good)`` after an insufficient and a sufficient one, or
    ``beyond(given, value)`` after ``value`` was insufficient and none has sufficed; never more than ``most``."""

    between: Callable[[float, float], float]
    beyond: Callable[[float, float], float]
    most: float


def metres_from(guess: float) -> Values:
    """Values in whole metres: none lower than ``guess``, and a quarter of the interval above the insufficient value
    instead of half-way; ``guess`` 0: unknown."""
    part = 0.25 if guess > 0.0 else 0.5
    return Values(
        between=lambda bad, good: float(max(math.floor(bad + part * (good - bad)), math.floor(bad) + 1, guess)),
        beyond=lambda given, value: float(math.ceil(given + 3.0 * (value - given))),
        most=HIGHEST_M,
    )


# Climb limits are approached from the sufficient side: planners take longest to refuse values just over the given one.
DEGREES = Values(
    between=lambda bad, good: bad if good <= 1.1 * bad else two_digits(max(0.5 * good, math.sqrt(bad * good))),
    beyond=lambda given, value: two_digits(2.0 * value),
    most=89.0,
)


def two_digits(value: float) -> float:
    """``value`` rounded up to two significant digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return round(math.ceil(value / unit - 1e-9) * unit, 9)


def with_cures(
    problem: Problem, bare: Refusal, plan: PlanFunction, whole: PlanFunction | None = None, but: str = ""
) -> Refusal:
    """The refusal ``bare`` of ``problem``, extended by what would help; every cure is planned before it is reported.

    ``plan`` returns a solution of a changed problem or raises NoMission; ``whole`` (None: the same) also refuses for
    every other reason, and ``but`` names the reasons that it leaves out. The clock is read between two plans and
    whenever a plan reports progress, so the whole stays short if the planner keeps ``budget_s``.
    """
    if not bare.untried:
        return bare
    trials = Trials(problem, plan, whole)
    # The searches in the plane can prove that ceilings and zones shut every path; they know little of climb limits.
    order = LIFTS if bare.reason == "infeasible" else LIFTS[::-1]
    lifts = [lift for lift in order if lift.binds(problem)]
    cures: list[Cure] = []
    in_vain: list[Lift] = []
    for lift in lifts:
        if trials.spent:
            break
        path = trials.path(lift.lifted(problem), f"without {lift.name}")
        if path is not None:
            cures.append(lift.cure(trials, path))
        elif not trials.stopped:
            in_vain.append(lift)
    untried = lifts[len(cures) + len(in_vain) :]
    words = [bare.message, *(cure.words for cure in cures), *([but] if but and any(c.sets for c in cures) else [])]
    if not cures and not untried:
        cures = [_together(trials, lifts)]
        words.append(cures[0].words)
    elif in_vain:
        words.append(f"without {_list([lift.name for lift in in_vain], 'or')} alone none is found")
    if untried:
        words.append(f"not tried in {trials.share_s:.0f} s: without {_list([lift.name for lift in untried], 'or')}")
    shown = next((cure for cure in cures if cure.place is not None), None)
    if bare.east_m is not None and bare.north_m is not None:  # the place that stopped the search itself comes first
        shown = Cure("", (bare.east_m, bare.north_m), bare.place_of)
    return Refusal(
        "; ".join(words),
        reason="infeasible" if bare.reason == "infeasible" else "not_found",
        place=None if shown is None else shown.place,
        place_of="" if shown is None else shown.place_of,
        cures=tuple(cure.sets for cure in cures if cure.sets),
    )


# -- limits that may be lifted --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Cure:
    """A change that helps, in words for the message, and its place; ``sets``: limits with which a whole plan was
    made."""

    words: str
    place: tuple[float, float] | None = None
    place_of: str = ""
    sets: LimitValues = ()


NO_FLY = "the no-fly zones"


@dataclass(frozen=True, slots=True)
class Lift:
    """A limit, or all zones: whether it ``binds`` in a problem at all, the problem without it, the cure to report."""

    name: str
    binds: Callable[[Problem], bool]
    lifted: Callable[[Problem], Problem]
    cure: Callable[[Trials, Floats], Cure]
    """From a path (N, 3) without the limit: finds the least change of it that suffices."""


def _limited(problem: Problem, **changed: float | None) -> Problem:
    return replace(problem, limits=replace(problem.limits, **changed))  # type: ignore[arg-type]


def _zoned(problem: Problem, zones: Sequence[Zone]) -> Problem:
    air = problem.airspace
    return replace(problem, airspace=Airspace(air.surface, zones, scale=air.scale))


def _ceiling(trials: Trials, path: Floats) -> Cure:
    problem, limits = trials.problem, trials.problem.limits
    given = limits.max_amsl_m
    assert given is not None
    enough = _metres_over(given, float(path[:, 2].max()) + limits.altitude_error_m)
    values = metres_from(_lowest_pass(problem, enough))
    found = trials.least("max_amsl_m", lambda m: _limited(problem, max_amsl_m=m), given, enough, values)
    if found.path is None:
        return Cure(f"without max_amsl_m there is a path{found.no_value}")
    amsl_m, place = _over_highest_ground(problem, found.path)
    return Cure(
        f"max_amsl_m {found.value:g} would do {found.words(f'{given:g} is given')}: the path crosses its highest "
        f"ground at {amsl_m:.1f} m AMSL ({floor_words(limits)})",
        place,
        "that ground",
        sets=(("max_amsl_m", found.value),),
    )


def _lowest_pass(problem: Problem, enough: float) -> float:
    """Estimate the lowest max_amsl_m that would do, in whole metres and at most about ``enough``: the lowest one under
    which a coarse lattice without climb limits has a route."""
    free = _limited(problem, max_amsl_m=None, max_climb_deg=STEEPEST_DEG, max_descent_deg=STEEPEST_DEG)
    router = Router.at(free, LEVEL)
    low = max(float(problem.limits.max_amsl_m or 0.0) - problem.limits.altitude_error_m, 0.0)
    high = enough
    while high - low > 0.5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if router.way(middle) is not None else (middle, high)
    return float(math.ceil(high + problem.limits.altitude_error_m + ROUNDED_M))


def _climbing(trials: Trials, path: Floats) -> Cure:
    problem, limits = trials.problem, trials.problem.limits
    up, down = limits.max_climb_deg, limits.max_descent_deg

    def at(angle: float) -> Problem:
        return _limited(problem, max_climb_deg=max(up, angle), max_descent_deg=max(down, angle))

    run = runs_m(path)
    steep = float(np.degrees(np.arctan2(np.abs(np.diff(path[:, 2])), run)).max())
    given = min(up, down)
    values = replace(DEGREES, most=min(DEGREES.most, _steepest_deg(problem)))
    enough = min(two_digits(max(steep, 1.1 * given, LEAST_DEG)), values.most)
    found = trials.least("max_climb_deg", at, given, enough, values)
    if found.path is None:
        return Cure(f"without max_climb_deg and max_descent_deg there is a path{found.no_value}")
    raised = [(key, was) for key, was in (("max_climb_deg", up), ("max_descent_deg", down)) if was < found.value]
    would = " and ".join(f"{key} {found.value:g}" for key, _ in raised)
    was = " and ".join(f"{was:g}" for was in dict.fromkeys(was for _, was in raised))
    return Cure(
        f"{would} would do {found.words(f'{was} is given')}", sets=tuple((key, found.value) for key, _ in raised)
    )


def _steepest_deg(problem: Problem) -> float:
    return STEEPEST_TURNING_DEG if problem.turn_radius_m > 0.0 else STEEPEST_DEG


def _metres_over(given: float, needed_m: float) -> float:
    """The least whole metres that are at least ``needed_m`` (plus `ROUNDED_M`) and more than ``given``."""
    return float(max(math.ceil(needed_m + ROUNDED_M), math.floor(given) + 1))


def _above_ground(trials: Trials, path: Floats) -> Cure:
    problem, limits = trials.problem, trials.problem.limits
    given = limits.max_agl_m
    assert given is not None
    report = problem.airspace.examine(Legs.of_path(path, limits), limits)
    enough = _metres_over(given, float(np.nanmax(report.max_agl_m)) + limits.altitude_error_m)
    values = metres_from(0.0)
    found = trials.least("max_agl_m", lambda m: _limited(problem, max_agl_m=m), given, enough, values)
    if found.path is None:
        return Cure(f"without max_agl_m there is a path{found.no_value}")
    return Cure(
        f"max_agl_m {found.value:g} would do {found.words(f'{given:g} is given')}", sets=(("max_agl_m", found.value),)
    )


def _fewer_zones(trials: Trials, path: Floats) -> Cure:
    """Find which zones must go, among the zones that a path planned without zones enters: one of them alone, or else
    all of them."""
    problem, zones = trials.problem, trials.problem.airspace.zones
    broken = problem.airspace.examine(Legs.of_path(path, problem.limits), problem.limits).violations
    crossed = sorted({v.zone for v in broken if v.zone >= 0 and zones[v.zone].outside is None})
    alone = []
    for k in crossed[:SINGLES]:
        if trials.spent:
            break
        if trials.path(_zoned(problem, zones[:k] + zones[k + 1 :]), f"without zone {zones[k].name}") is not None:
            alone.append(k)
    first = zones[(alone or crossed or [0])[0]]
    at = _middle(first), repr(first.name)
    if len(alone) == 1:
        return Cure(f"without no-fly zone {zones[alone[0]].name!r} there is a path", *at)
    if alone:
        words = _list([repr(zones[k].name) for k in alone], "or")
        return Cure(f"without any one of the no-fly zones {words} there is a path", *at)
    kept = [zone for k, zone in enumerate(zones) if k not in crossed]
    if crossed and kept and not trials.spent and trials.path(_zoned(problem, kept), "without several zones") is None:
        crossed = []
    if not crossed:
        return Cure(f"without {NO_FLY} there is a path")
    words = _list([repr(zones[k].name) for k in crossed])
    return Cure(f"without the no-fly zones {words} together there is a path", *at)


def _wider_areas(trials: Trials, path: Floats) -> Cure:
    """Name the keep-in areas without which a path was found, and where it leaves them first."""
    problem, zones = trials.problem, trials.problem.airspace.zones
    broken = problem.airspace.examine(Legs.of_path(path, problem.limits), problem.limits).violations
    left = min((v for v in broken if v.zone >= 0), key=lambda v: (v.leg, v.fraction), default=None)
    title = next(zone.title for zone in zones if zone.outside is not None)
    if left is None:
        return Cure(f"without the {title} there is a path")
    return Cure(f"without the {title} there is a path", (left.east_m, left.north_m), "which leaves it first")


def _known(problem: Problem) -> Problem:
    """The problem with unknown ground filled: each unknown node is as high as the nearest known one."""
    air, surface = problem.airspace, problem.airspace.surface
    ground = _filled(surface.ground_m)
    top = ground if surface.top_m is surface.ground_m else _filled(surface.top_m)
    return replace(problem, airspace=Airspace(replace(surface, ground_m=ground, top_m=top), air.zones, scale=air.scale))


def _filled(z: Floats) -> Floats:
    from scipy.ndimage import distance_transform_edt  # only where no path was found over ground with voids

    unknown = np.isnan(z)
    if unknown.all() or not unknown.any():
        return z
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)])


def _over_unknown(trials: Trials, path: Floats) -> Cure:
    """Name the unknown ground that a path leads over which was found with that ground filled."""
    problem = trials.problem
    found = problem.airspace.examine(Legs.of_path(path, problem.limits), problem.limits).violations
    void = min((v for v in found if v.kind == "coverage"), key=lambda v: (v.leg, v.fraction), default=None)
    if void is None:  # the path that was found avoids it: another search may find it without help
        return Cure("with the unknown ground of the terrain model filled there is a path")
    return Cure(
        f"unknown ground is in the way: with it as high as the ground around it there is a path over it. {FILLED}",
        (void.east_m, void.north_m),
        "that ground",
    )


def _together(trials: Trials, lifts: Sequence[Lift]) -> Cure:
    """Find which limits must be lifted together where lifting any one of them alone does not help."""
    names = _list([lift.name for lift in lifts], "or")
    if not lifts:
        return Cure("no limit and no zone is in the way: unknown ground, or the edge of the known terrain, is")
    if len(lifts) == 1:
        return Cure(f"without {names} none is found either")

    def opens(some: Sequence[Lift]) -> bool:
        problem = trials.problem
        for lift in some:
            problem = lift.lifted(problem)
        return trials.path(problem, f"without {_list([lift.name for lift in some])}") is not None

    alone = f"without {names} alone none is found"
    if trials.spent:
        return Cure(alone)
    if not opens(lifts):
        return Cure(alone if trials.stopped else f"{alone}, nor without all of them together")
    needed = list(lifts)
    for lift in lifts:
        fewer = [other for other in needed if other is not lift]
        if len(fewer) > 1 and not trials.spent and opens(fewer):
            needed = fewer
    return Cure(f"{alone}; without {_list([lift.name for lift in needed])} together there is a path")


LIFTS = (
    Lift("unknown ground", lambda p: p.airspace.surface.has_unknown, _known, _over_unknown),
    Lift("max_amsl_m", lambda p: p.limits.max_amsl_m is not None, lambda p: _limited(p, max_amsl_m=None), _ceiling),
    Lift(
        NO_FLY,
        lambda p: len(no_fly_of(p.airspace.zones)) > 0,
        lambda p: _zoned(p, [zone for zone in p.airspace.zones if zone.outside is not None]),
        _fewer_zones,
    ),
    Lift(
        "the keep-in areas",
        lambda p: len(keep_in_of(p.airspace.zones)) > 0,
        lambda p: _zoned(p, no_fly_of(p.airspace.zones)),
        _wider_areas,
    ),
    Lift("max_agl_m", lambda p: p.limits.max_agl_m is not None, lambda p: _limited(p, max_agl_m=None), _above_ground),
    Lift(
        "max_climb_deg and max_descent_deg",
        lambda p: min(p.limits.max_climb_deg, p.limits.max_descent_deg) < _steepest_deg(p),
        lambda p: _limited(p, max_climb_deg=_steepest_deg(p), max_descent_deg=_steepest_deg(p)),
        _climbing,
    ),
)
"""The limits that are lifted: in this order where it is proved that there is no path, else from last to first."""


# -- words ---------------------------------------------------------------------------------------------------------


def floor_words(limits: Limits) -> str:
    words = f"ground + min_agl_m {limits.min_agl_m:g}"
    if limits.horizontal_clearance_m:
        words += f", terrain clearance {limits.horizontal_clearance_m:g} m"
    return words + (f", altitude error {limits.altitude_error_m:g} m" if limits.altitude_error_m else "")


def rounded_up(metres: float) -> float:
    """``metres`` rounded up to a tenth, never down: a limit that is set to the reported value must do."""
    return float(np.ceil(metres * 10.0 - 1e-6)) / 10.0


def _list(names: Sequence[str], last: str = "and") -> str:
    """The names as ``a, b and c``; if they are many, the first `NAMES` and how many more."""
    shown = [*names[:NAMES], f"{len(names) - NAMES} more"] if len(names) > NAMES + 1 else list(names)
    return f" {last} ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def _over_highest_ground(problem: Problem, path: Floats) -> tuple[float, tuple[float, float]]:
    """The path's altitude AMSL over the highest ground under it, and that place (east_m, north_m)."""
    step_m = 0.25 * float(problem.airspace.surface.grid.metres_per_cell(*problem.start[:2]).min())
    at = denser(path, step_m)
    k = int(np.nanargmax(problem.airspace.surface.ground_at(at[:, 0], at[:, 1])))
    return float(at[k, 2]), (float(at[k, 0]), float(at[k, 1]))


def _middle(zone: Zone) -> tuple[float, float]:
    if isinstance(zone.shape, Circle):
        return zone.shape.east_m, zone.shape.north_m
    west, south, east, north = zone.bounds
    return 0.5 * (west + east), 0.5 * (south + north)
