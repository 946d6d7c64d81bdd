"""Planning where a maximum AGL or the climb limit binds: between a floor and a ceiling that both follow the ground.

The cap search of the plane planner does not apply here: whether ground can be crossed depends on the direction, and a
steep slope is climbed aslant. So tracks are searched on a lattice with the altitudes that can be reached (`routes`),
then pulled tight on samples of floor and ceiling around them (`corridor_raster`) until they are legal, and checked
exactly (`profile.exact`). Cheaper tracks are found by closing parts of the first one, and by kicks that move a line out
of its local optimum; a track that others found is pulled in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.lattice.corridor_raster import CorridorRaster, GuidedTrack, line_of, make_guide
from gcsplan.planners.lattice.routes import LATTICE_SIZES, LatticeSize, Router, climbing_weight
from gcsplan.planners.problem import Problem, Refusal, straight_way_m
from gcsplan.planners.profile.climb_laps import pins_of, with_climbs
from gcsplan.planners.profile.exact import LegJudge, Unsettled, settle
from gcsplan.planners.profile.track import Obstruction, make_track
from gcsplan.world.geometry.path import Path, distances_m, track_length_m

Tell = Callable[[str, float | None], None]

COARSE_STEPS = (0.03, 0.015, 0.007, 0.0035)
FINE_STEPS = (0.01, 0.004, 0.0015, 0.0006)
"""Sizes of the moves of a pull, as parts of the straight track."""
COARSE_GAIN, FINE_GAIN = 5e-5, 1e-5
"""Least gain of a coarse and a fine move, as parts of the straight track."""
CORRIDOR, CORRIDOR_STEPS = 0.08, 8.0
"""Half the width of the corridor around a track: as a part of the straight track, and at least in lattice steps."""
NARROW, FINE_M = 0.02, 12.0
"""The same around a nearly finished line, as a part of the straight track; spacing of the raster there, in metres."""
COARSE_MENDS, MENDS, SEARCHES = 4, 6, 6
"""Most exact checks of one line, with a repair after each refusal, on a coarse and on a fine guide; most searches on
one lattice for a legal track."""
CLOSER, LEAST_DETOUR = 15_000, 1.02
"""If a path is known: about how many nodes the lattice has, and the least detour that it holds."""
MOST_OPENED = 200_000
"""Labels expanded on one lattice after which it is given up; such searches wind up and down to gain height."""
DETOURS, DETOUR_STEPS, DETOUR_PART = (0.2, 0.4, 0.6, 0.8), 4.0, 0.03
"""Where along the first track a disc is closed to find other tracks, as parts; its radius, in lattice steps, and at
least as a part of the straight track."""
ASIDE = 0.03
"""Half the width of the corridor around a track that is pulled alone, as a part of the straight track."""
BETTER = 0.5
"""Part of the work left that other tracks and kicks may take once there is a path."""
LINE_KICKS = 20
KICK_PARTS = (0.02, 0.05)


def plan_band(problem: Problem, tell: Tell, *, climbs: bool = True) -> Floats:
    """Way points (N, 3) of a path under a maximum AGL and the climb limit that `Airspace.examine` passes.

    Start, goal and vias must be legal by themselves, and not all at one place. ``tell(phase, cost)`` reports progress.
    ``climbs``: laps over start and goal are allowed. Raises Refusal if no path is found.
    """
    way = straight_way_m(problem)
    best: Floats | None = None
    router: Router | None = None
    for level in LATTICE_SIZES if climbs else LATTICE_SIZES[:2]:
        if best is None and not problem.budget.goes_on():
            break
        tell("search", None if best is None else problem.cost(Path(best)))
        work = _Work(problem, Router.at(problem, level), way)
        router = work.router
        cut = router.cut_off() if climbs else (False, False)
        found = None if any(cut) else work.first()
        if found is None and climbs and best is None and (any(cut) or level is LATTICE_SIZES[0]):
            ends = cut if any(cut) else (True, True)
            found = with_climbs(problem, ends, lambda p: plan_band(p, tell, climbs=False))
        if found is not None:
            best = found if best is None else min(best, found, key=lambda p: problem.cost(Path(p)))
        # A path longer than the detours that this lattice holds may have a shorter rival outside it: try the next one.
        if best is not None and (work.line is None or track_length_m(best) <= level.detour * way):
            break
    if best is None:
        raise _not_found(problem, router)
    tell("done", problem.cost(Path(best)))
    return best


def cheaper(problem: Problem, tell: Tell, known: Floats, longest_m: float) -> Floats | None:
    """Way points (N, 3) of a path that is cheaper than a ``known`` one (N, 3); None if none is found.

    The lattice holds tracks of up to about ``longest_m`` metres. ``tell``: as in `plan_band`.
    """
    way_m, cost = straight_way_m(problem), problem.cost(Path(known))
    tell("search", cost)
    size = LatticeSize(max(longest_m / way_m, LEAST_DETOUR), CLOSER)
    work = _Work(problem, Router.at(problem, size), way_m, climbing_weight(problem))
    work.begin_anew()
    if work.line is None or work.line.value > cost:
        work.begin(known)
    found = work.improve(tell)
    return None if found is None or problem.cost(Path(found)) >= cost else found


def pulled(
    problem: Problem, judge: LegJudge, points: Floats, pinned: Bools, pin_m: Floats
) -> tuple[Floats, Bools] | None:
    """Way points (M, 3) over the track of a chain (N, 3) pulled tight, and (M,) which must stay; None if they are not
    legal. While it is pulled, zones are passed over or under as the chain does; ``pinned``, ``pin_m`` (N,): see
    `GuidedTrack`."""
    way_m, over = straight_way_m(problem), sides_to_pass(problem, points, pinned, pin_m)
    points = np.ascontiguousarray(points[:, :2])
    guide = make_guide(problem, [points], ASIDE * way_m, over)
    line = guide.pull(line_of(points, pinned, pin_m), np.array(FINE_STEPS) * way_m, COARSE_GAIN * way_m, rounds=2)
    found = _mended(problem, judge, line, over, way_m)[0]
    return None if isinstance(found, Unsettled) else found


def _mended(
    problem: Problem, judge: LegJudge, line: GuidedTrack, over: dict[int, bool], way_m: float
) -> tuple[tuple[Floats, Bools] | Unsettled, GuidedTrack]:
    """Make way points of a line; after each refusal by the exact check, correct the guide and pull the line again.

    Return the way points, or why there are none, and the line as last pulled.
    """
    guide = make_guide(problem, [line.points], NARROW * way_m, over, FINE_M)
    line = guide.pull(line, np.array(FINE_STEPS) * way_m, FINE_GAIN * way_m, rounds=3)
    return _settled(problem, judge, guide, line, way_m, MENDS)


def _settled(
    problem: Problem, judge: LegJudge, guide: CorridorRaster, line: GuidedTrack, way_m: float, mends: int
) -> tuple[tuple[Floats, Bools] | Unsettled, GuidedTrack]:
    """`_mended` of a line that was pulled in ``guide``, which is corrected; ``mends``: most exact checks."""
    found: tuple[Floats, Bools] | Unsettled
    for attempt in range(mends):
        found = settle(problem, judge, line.points, line.pinned, line.pin_m)
        if not isinstance(found, Unsettled):
            break
        guide.learn(found.samples)
        why = found.past or found
        if why.kind == "pinched" and math.isfinite(why.by):
            guide.narrow(why.place, 0.5 * why.by + 0.3)
            guide.narrow(why.place, 0.5 * why.by + 0.3, ceiling=True)
        elif why.kind in ("pinched", "zone"):
            guide.narrow(why.place, 1e4)
        elif attempt:
            guide.strict(why.by)
        line = guide.pull(line, np.array(FINE_STEPS if attempt < 3 else COARSE_STEPS) * way_m, COARSE_GAIN * way_m)
        if not problem.budget.goes_on():
            break
    return found, line


def _not_found(problem: Problem, router: Router | None) -> Refusal:
    """The refusal after the last lattice: its spacing, and the reason and the place of the last track's stop."""
    words, place, at = "", None, ""
    if router is not None:
        words = f" on a grid of {router.lattice.step_m:.0f} m"
    if router is not None and router.last is not None and router.last_place is not None:
        words += f"; the last track that was looked at is stopped by {_stopped_by(problem, router.last)}"
        place, at = (float(router.last_place[0]), float(router.last_place[1])), "stopped"
    return Refusal(f"no mission: no path was found{words}", reason="not_found", place=place, place_of=at, untried=True)


def _stopped_by(problem: Problem, why: Obstruction) -> str:
    if why.kind == "zone":
        return problem.airspace.zones[why.zone].title
    if why.kind == "pinched":
        return f"ground that comes too near to the ceiling, by {why.by:.1f} m"
    run_m = why.s1_m - why.s0_m
    return f"a {why.kind} steeper than max_{why.kind}_deg, by {why.by:.1f} m of height in {run_m:.0f} m"


def sides_to_pass(problem: Problem, points: Floats, pinned: Bools, pin_m: Floats) -> dict[int, bool]:
    """For each zone within reach of a path, by index: whether the path passes over it."""
    track = make_track(problem, points[:, :2], pinned, pin_m)
    s = distances_m(points)  # of all points: a track keeps one of two that are less than a millimetre apart
    over: dict[int, bool] = {}
    for band in track.tube.bands:
        at = 0.5 * (band.s_m[:-1] + band.s_m[1:]) * (s[-1] / track.tube.s_m[-1])
        height = np.interp(at, s, points[:, 2])
        over[band.zone] = bool((height >= band.top_m.mean(axis=1)).mean() > 0.5)
    return over


class _Work:
    """One lattice, the tracks found on it, and the lines pulled from them."""

    def __init__(self, problem: Problem, router: Router, way_m: float, weight: float = 0.0) -> None:
        self.problem = problem
        self.weight = weight
        """The price of climbing for the first track: metres of track for each metre of height."""
        self.router = router
        self.way_m = way_m
        self.guide: CorridorRaster | None = None
        self.line: GuidedTrack | None = None
        self.judge = LegJudge(problem)
        self.over: dict[int, bool] = {}
        """Zones known to be passed over (True) or under (False), by index."""

    def first(self) -> Floats | None:
        """Way points of the first track that can be made legal, of `SEARCHES` at most; None if none can.

        After each failure the lattice is corrected.
        """
        for _ in range(SEARCHES):
            if self.router.opened > MOST_OPENED or not self.problem.budget.goes_on():
                return None
            way = self.router.way(weight=self.weight)
            if way is None:
                return None
            line = self._line(way)
            self.guide = self._guide([line.points])
            line = self.guide.pull(line, self._steps(COARSE_STEPS), COARSE_GAIN * self.way_m, rounds=2)
            # Most lines are legal after a mend or two on the coarse guide, which takes a third of the fine one's time.
            found, settled = _settled(self.problem, self.judge, self.guide, line, self.way_m, COARSE_MENDS)
            if isinstance(found, Unsettled):
                found, settled = self._mended(line)
            if not isinstance(found, Unsettled):
                self.line = settled
                return found[0]
            self.router.last_place = found.place
            self.router.last = Obstruction(found.kind, 0.0, found.span_m, found.by, found.zone)
            why = found.past or found
            if why.kind == "pinched":
                self.router.lattice.raise_floor(why.place, why.by + 0.5)
            elif why.kind == "zone":
                self.router.lattice.raise_floor(why.place, math.inf)
            else:
                self.router.climb_factor *= 0.95
        return None

    def begin_anew(self) -> None:
        """Take the line pulled from the best track over the lattice, if there is one; it need not be legal."""
        way = self.router.way(weight=self.weight, briefly=True)
        if way is not None:
            self.guide = self._guide([way])
            line = self.guide.pull(self._line(way), self._steps(COARSE_STEPS), COARSE_GAIN * self.way_m, rounds=2)
            self.line = self.guide.pull(line, self._steps(FINE_STEPS), FINE_GAIN * self.way_m, rounds=3)

    def begin(self, points: Floats) -> None:
        """Take the line pulled from the track of a path (N, 3). Zones are passed over or under as that path does."""
        pinned, pin_m = pins_of(self.problem, points)
        self.over = sides_to_pass(self.problem, points, pinned, pin_m)
        flat = np.ascontiguousarray(points[:, :2])
        self.guide = self._guide([flat])
        self.line = self.guide.pull(line_of(flat, pinned, pin_m), self._steps(FINE_STEPS), FINE_GAIN * self.way_m)

    def improve(self, tell: Tell) -> Floats | None:
        """Way points of the best line from several tracks and kicks; None if it is not legal."""
        with self.problem.budget.allow(BETTER):
            best = self._best_line(tell)
        found, self.line = self._mended(best)
        return None if isinstance(found, Unsettled) else found[0]

    def _best_line(self, tell: Tell) -> GuidedTrack:
        """The best line of several tracks, after kicks."""
        assert self.line is not None
        assert self.guide is not None
        budget = self.problem.budget
        ways = self._others()
        if ways:
            self.guide = self._guide([self.line.points, *ways])
        guide = self.guide
        lines = [self.line]
        for way in ways:
            line = guide.pull(self._line(way), self._steps(COARSE_STEPS), COARSE_GAIN * self.way_m)
            if line.missing <= 0.0:
                lines.append(line)
            if not budget.goes_on():
                break
        lines.sort(key=lambda line: line.cost)
        best = lines[0]
        tell("polish", best.cost)
        rng = np.random.default_rng(self.problem.seed)
        for line in lines[:2]:
            for _ in range(LINE_KICKS):
                if not budget.goes_on():
                    break
                kicked = guide.pull(self._kicked(line, rng), self._steps(FINE_STEPS), COARSE_GAIN * self.way_m)
                if kicked.missing <= 0.0 and kicked.cost < line.cost:
                    line = kicked
            line = guide.pull(line, self._steps(FINE_STEPS), FINE_GAIN * self.way_m)
            if line.value < best.value:
                best = line
        return best

    def _line(self, way: Floats) -> GuidedTrack:
        track = self.router.track_of(way)
        return line_of(track.points, track.pinned, track.pin_m)

    def _guide(self, ways: list[Floats]) -> CorridorRaster:
        radius = max(CORRIDOR * self.way_m, CORRIDOR_STEPS * self.router.lattice.step_m)
        return make_guide(self.problem, ways, radius, self.over)

    def _steps(self, parts: tuple[float, ...]) -> Floats:
        return np.array(parts) * self.way_m

    def _mended(self, line: GuidedTrack) -> tuple[tuple[Floats, Bools] | Unsettled, GuidedTrack]:
        return _mended(self.problem, self.judge, line, self.over, self.way_m)

    def _others(self) -> list[Floats]:
        """Other tracks over the lattice: around discs closed on the first."""
        assert self.line is not None
        router, p, ways = self.router, self.problem, list[Floats]()
        s, floor = distances_m(self.line.points), router.lattice.floor_m
        for f in DETOURS:
            if not p.budget.goes_on() or router.opened > MOST_OPENED // 4:
                break
            place = [np.interp(f * s[-1], s, self.line.points[:, k]) for k in range(2)]
            router.lattice.floor_m = floor.copy()
            router.lattice.shut(np.array(place), max(DETOUR_STEPS * router.lattice.step_m, DETOUR_PART * self.way_m))
            way = router.way(weight=self.weight, briefly=True)
            if way is not None:
                ways.append(way)
        router.lattice.floor_m = floor
        return ways

    def _kicked(self, line: GuidedTrack, rng: np.random.Generator) -> GuidedTrack:
        """The line with a random bump to one side."""
        s = distances_m(line.points)
        at, side = rng.uniform(0.05, 0.95) * s[-1], rng.choice([-1.0, 1.0]) * rng.uniform(*KICK_PARTS) * self.way_m
        half = rng.uniform(0.04, 0.15) * s[-1]
        i = int(np.clip(np.searchsorted(s, at, "right") - 1, 0, len(s) - 2))
        along = (line.points[i + 1] - line.points[i]) / max(s[i + 1] - s[i], 1e-9)
        across = np.array([-along[1], along[0]])
        bump = np.maximum(0.0, 1.0 - np.abs(s - at) / half) * ~line.pinned
        points = line.points + bump[:, None] * (side * across)
        middle = np.array([np.interp(at, s, line.points[:, k]) for k in range(2)]) + side * across
        return GuidedTrack(
            np.insert(points, i + 1, middle, axis=0),
            np.insert(line.pinned, i + 1, False),
            np.insert(line.pin_m, i + 1, math.nan),
            np.insert(line.amsl_m, i + 1, 0.0),
            math.inf,
            math.inf,
        )
