"""The table of all searches of the default planner, and the worlds that they work on."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.errors import InputError
from gcsplan.planners.lattice.planner import cheaper, plan_band
from gcsplan.planners.lattice.routes import LatticeSize, Router, climbing_weight
from gcsplan.planners.optimal.bounds.shorter import bound_by_caps, halve
from gcsplan.planners.optimal.governor import Search, Size
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.plane.corridor import PinnedTrack
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.plane_search import SLACKS, PlaneSearch, above_all, in_window
from gcsplan.planners.optimal.searches.bound_corridor import follow
from gcsplan.planners.optimal.searches.section_dp import tightened
from gcsplan.planners.problem import Problem, Refusal, straight_way_m, terminals_of
from gcsplan.planners.profile.track import Obstruction, fly, make_track
from gcsplan.world.geometry.path import runs_m

if TYPE_CHECKING:
    from gcsplan.planners.optimal.searches.outline_tracks import OutlineTracks

FAR, WIDE, MUCH = 5e-3, 1e-2, 5e-2
"""Gaps, as parts, beyond which other sources of paths are tried; beyond which reachable altitudes are searched before
others have tried to close the gap; and beyond which small worlds are searched before time is spent on a bound."""
REFINED = 1.75
"""Times the wanted gap beyond which cells are cut finer, which takes as long as all other searches together."""
PAST_FINE, ROUNDS = 9, 2
"""Most tracks past obstacles that are tried on the finer lattice at once, and how often that is repeated."""
FINER = 2
"""Parts a side into which cells are cut once more, for walls and zones that the first lattice rounds off."""
OF_REST, EARLY_OF_REST = 0.5, 0.25
"""Part of the counted work left that bound corridor, roadmap and lattice may take if a path is known: what they take
is not known before; and the part for the lattice before others have tried to close a large gap."""
INTERVAL_S, REFINED_S = 0.7e-6, 4e-6
"""Counted seconds for each cell of the finer lattice near short tracks: what altitude intervals take on average, and
the least that refinement takes in nine of ten missions. Refinement raises bounds even if it ends with the budget."""
NEARLY_ALL = 0.9
"""Part of the counted work left that the bound corridor may take beyond a gap of `MUCH`."""
MOST_CORRIDOR_CELLS = 50_000
"""Most cells of all corridors for which altitude intervals are computed."""
ASLANT_NODES = 60_000
"""Nodes of the lattice on which tracks climb a slope aslant, about."""

NAMES = (
    "straight", "outlines", "outline_bound", "track_bound", "cap_search", "corridor_first", "lattice_first",
    "roadmap_first", "roadmap_near", "fine_tracks", "detours", "bound_corridor", "section_descent", "contour_climb",
    "lattice", "local_roadmap", "cap_pairs", "energy_bound", "length_bound", "altitude_intervals", "refinement",
)  # fmt: skip
"""The names of all searches; which of them a mission has depends on its objective and limits."""


def left_out(problem: Problem) -> tuple[str, ...]:
    """The searches that a problem's options leave out. Raises InputError for an unknown name."""
    asked = problem.options.get("without", ())
    names = tuple(str(n) for n in asked) if isinstance(asked, tuple | list) else (str(asked),)
    require_names(names)
    return names


def require_names(names: Sequence[str]) -> None:
    """Raise InputError for a name that no search has."""
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        raise InputError(f"the searches are {', '.join(NAMES)}; given {', '.join(unknown)}")


class Searches:
    """The searches of one problem; each reads the incumbent and improves it."""

    def __init__(self, incumbent: Incumbent) -> None:
        self.incumbent, self.problem = incumbent, incumbent.problem
        self._straight: Obstruction | None = None
        self._outlines: OutlineTracks | None = None

    @cached_property
    def plane(self) -> PlaneSearch:
        """The lattices of the legs, made at first use."""
        return PlaneSearch(self.incumbent, in_window(self.incumbent))

    def table(self) -> list[Search]:
        """All searches: name, share of the gap that each closes, when it applies, its size, and what runs it."""
        band = self.problem.limits.max_agl_m is not None
        energy = self.problem.objective == "energy"
        i = self.incumbent

        def gap(beyond: float) -> Callable[[], bool]:
            return lambda: i.best is not None and i.gap > beyond

        def missing() -> bool:
            return i.best is None

        def known() -> bool:
            return i.best is not None

        def small(beyond: float) -> Callable[[], bool]:
            return lambda: i.best is not None and i.gap > beyond and (self.plane.is_small or i.is_steep)

        def on(run: Callable[[PlaneSearch], object]) -> Callable[[], object]:
            return self._over(lambda: run(self.plane))

        def near(cell_s: float) -> Callable[[], Size]:
            return lambda: self.plane.size_nearby(cell_s)

        nodes, of, far = self._nodes, self._of, gap(FAR)
        rows = [
            Search("straight", 1.0, lambda: self._straight is None, of(2e-3, 0.0), self._fly_straight),
            Search("outlines", 1.0, self._has_outlines, of(1.3e-3, 0.8e-3), self._look_at_outlines),
            Search(
                "outline_bound", 0.9, self._has_ceilings, self._size_of_overflights, self._bound_overflights, again=True
            ),
        ]
        if band:
            rows += [
                Search("track_bound", 1.0, lambda: i.bound < i.cost, nodes(1.0), self._bound_tracks),
                Search("lattice", 0.9, lambda: True, of(0.5, 0.0), self._search_lattice),
            ]
        else:
            rows += [
                Search("cap_search", 1.0, missing, nodes(1.0), self._look_first),
                Search("corridor_first", 0.5, missing, nodes(4.0), on(follow)),
                Search("lattice_first", 0.5, missing, of(1.0, 0.0), self._search_lattice),
                Search("roadmap_first", 0.6, self._small_lacks, of(1.0, 0.0), self._search_small),
                Search("roadmap_near", 0.5, small(MUCH), of(0.5, 0.0), self._search_small),
                Search("fine_tracks", 0.9, known, nodes(0.5), self._over(self._look_finely), nearer=True),
                Search("bound_corridor", 0.2, known, nodes(3.0), on(self._follow_bound)),
                Search("contour_climb", 0.075, self._is_slanted, nodes(8.0), self._over(self._climb_aslant)),
                # Where path and bound are far apart it finds other valleys; else it gains little, and takes long.
                Search("lattice", lambda x: 0.25 if x > WIDE else 0.02, far, of(0.3, 0.0), self._search_lattice),
                Search("local_roadmap", 0.01, small(FAR), of(0.5, 0.0), self._search_small),
                # Under a maximum AGL it takes twice as long as all others together, for a tenth or two of the gap.
                Search("refinement", 0.04, gap(REFINED * i.wanted), near(REFINED_S), self._over(self._refine)),
            ]
            if energy:
                rows += [
                    Search("cap_pairs", 0.5, known, nodes(3.0), on(bound_by_caps), again=True),
                    Search("detours", 0.3, far, nodes(4.0), on(lambda plane: plane.past(PAST_FINE, fine=True))),
                ]
            else:
                rows.append(Search("detours", 0.3, known, nodes(4.0), self._over(self._past_finely)))
        name, share = ("energy_bound", 0.5) if energy else ("length_bound", 0.9)
        return [
            *rows,
            Search("section_descent", 0.9 if band else 0.1, known, of(0.1, 0.0), self._tighten, again=True),
            Search(name, share, known, nodes(1.0), on(halve), again=True, nearer=not energy),
            Search(
                "altitude_intervals", 0.08, self._has_intervals, near(INTERVAL_S), self._over(self._bound_by_intervals)
            ),
        ]

    def _over(self, run: Callable[[], object]) -> Callable[[], object]:
        """A search over the legs' lattices, which are first widened to all tracks no longer than the best path."""
        return lambda: self.plane.reach_longest() and run()

    # -------------------------------------------------------------------- sizes

    def _of(self, seconds: float, per_zone_s: float) -> Callable[[], Size]:
        zones = len(self.problem.airspace.zones)
        return lambda: (seconds + per_zone_s * zones, 40.0)

    def _nodes(self, looks: float) -> Callable[[], Size]:
        """The size of that many passes over the lattices of all legs."""
        return lambda: self.plane.size(looks)

    # -------------------------------------------------------------------- first paths

    def _fly_straight(self) -> None:
        p, incumbent = self.problem, self.incumbent
        places = np.array(terminals_of(p))
        apart = np.concatenate([[True], runs_m(places) > 1e-3])
        pin_m = np.array([math.nan, *(math.nan if v.amsl_m is None else v.amsl_m for v in p.via), math.nan])[apart]
        track = make_track(p, places[apart], np.ones(int(apart.sum()), np.bool_), pin_m)
        flown = fly(p, track)
        if isinstance(flown, Obstruction):
            self._straight = flown
            return
        self._straight = Obstruction("zone", 0.0, 0.0, 0.0)  # if the path is not the best, zones make it dearer
        found = incumbent.exact(track, flown)
        if found is not None:
            incumbent.take(*found)

    def _has_outlines(self) -> bool:
        """Whether zones may obstruct the straight track or make a path over it dearer."""
        air = self.problem.airspace
        if self._straight is None or not air.zones:
            return False
        far = self.incumbent.best is not None and self.incumbent.gap > FAR
        return far or self._straight.kind != "pinched"

    def _look_at_outlines(self) -> None:
        from gcsplan.planners.optimal.searches.outline_tracks import OutlineTracks  # shapely: many missions need none

        limits = self.problem.bound_limits
        highest_m = float(np.nanmax(self.problem.airspace.surface.ground_m))
        most_m = [*([] if limits.max_amsl_m is None else [limits.max_amsl_m]),
                  *([] if limits.max_agl_m is None else [highest_m + limits.max_agl_m])]  # fmt: skip
        top_m = min(most_m) - limits.altitude_error_m if most_m else above_all(self.problem)
        self._outlines = OutlineTracks(self.incumbent, top_m)
        self._outlines.look()

    def _has_ceilings(self) -> bool:
        """Whether there are zones that can be passed over, and not under."""
        outlines = self._outlines
        return (
            self.incumbent.best is not None and outlines is not None and bool((outlines.over & ~outlines.under).any())
        )

    def _size_of_overflights(self) -> Size:
        from gcsplan.planners.optimal.bounds.overflight import MOST_CASES

        assert self._outlines is not None
        zones = int((self._outlines.over & ~self._outlines.under).sum())
        return 5e-3 * (1 + min(zones, MOST_CASES)), 60.0

    def _bound_overflights(self) -> None:
        from gcsplan.planners.optimal.bounds.overflight import Overflight  # shapely, as above

        assert self._outlines is not None
        with contextlib.suppress(Exhausted):
            Overflight(self.incumbent, self._outlines).look()

    def _bound_tracks(self) -> None:
        if self.plane.flood(SLACKS[0]):
            self.plane.raise_tracks()

    def _look_first(self) -> None:
        for _ in self.plane.first_looks():
            if not self.incumbent.budget.goes_on():
                break

    def _search_lattice(self) -> None:
        incumbent = self.incumbent
        if incumbent.best is not None:
            with incumbent.budget.allow(OF_REST if incumbent.gap <= WIDE else EARLY_OF_REST):
                found = cheaper(self.problem, incumbent.tell, incumbent.best, self.plane.longest())
            if found is not None:
                incumbent.take(found)
            return
        # A line that is pulled to climb less may become illegal where a shorter one is not.
        energy = self.problem.objective == "energy"
        for problem in [self.problem, *([replace(self.problem, objective="length")] if energy else [])]:
            try:
                found = plan_band(problem, incumbent.tell)
            except Refusal:
                continue
            incumbent.take(found)
            return

    # -------------------------------------------------------------------- better paths, and bounds

    def _small_lacks(self) -> bool:
        return self.incumbent.best is None and self.plane.is_small

    def _search_small(self) -> None:
        from gcsplan.planners.optimal.searches.local_roadmap import small_path  # most missions do not need it

        incumbent = self.incumbent
        with incumbent.budget.allow(1.0 if incumbent.best is None else OF_REST):
            found = small_path(self.problem, incumbent.best)
        incumbent.offer(found)

    def _look_finely(self) -> None:
        self.plane.look_finely()

    def _follow_bound(self, plane: PlaneSearch) -> None:
        # Where path and bound are that far apart, a slit is open that nothing else finds.
        with self.incumbent.budget.allow(NEARLY_ALL if self.incumbent.gap > MUCH else OF_REST):
            follow(plane)

    def _tighten(self) -> None:
        incumbent = self.incumbent
        assert incumbent.best is not None
        points, pinned = tightened(self.problem, incumbent.best)
        incumbent.take_simpler(points, pinned, fine=True, longer=False)

    def _past_finely(self) -> None:
        for _ in range(ROUNDS):
            if not self.incumbent.goes_on() or not self.plane.past(PAST_FINE, fine=True):
                break

    def _is_slanted(self) -> bool:
        incumbent = self.incumbent
        return incumbent.best is not None and incumbent.gap > FAR and incumbent.climbs

    def _climb_aslant(self) -> None:
        found = traverse(self.problem, self.plane.longest())
        if found is not None:
            self.incumbent.take_longer(found, fine=True)

    def _has_intervals(self) -> bool:
        incumbent = self.incumbent
        return incumbent.best is not None and incumbent.climbs

    def _bound_by_intervals(self) -> None:
        plane = self.plane
        cells = sum(int(leg.corridor(plane.limit(leg)).cells.sum()) for leg in plane.legs)
        plane.by_intervals = cells <= MOST_CORRIDOR_CELLS
        if plane.by_intervals:
            halve(plane)

    def _refine(self) -> None:
        plane = self.plane
        cut = 2 if self.incumbent.gap > FAR else 1
        if sum(leg.refine(plane.limit(leg), FINER, cut) for leg in plane.legs):
            halve(plane, far=True)


def traverse(problem: Problem, longest_m: float) -> PinnedTrack | None:
    """The best track that climbs a slope aslant, where a path must follow ground that is steeper than the climb limit.

    Under a zone whose floor is a few metres over the lowest legal altitude, nothing else is possible. The shortest
    track in the plane ignores this, because whether a slope can be climbed depends on the direction. So where a gap
    remains between path and bound, the lattice of reachable altitudes (`routes`) is searched. It covers only tracks of
    up to about ``longest_m`` metres, which may still be shorter than the best path's, so its nodes are dense. None if
    there is no track.
    """
    router = Router.at(problem, LatticeSize(max(longest_m / straight_way_m(problem), 1.0), ASLANT_NODES))
    way = router.way(weight=climbing_weight(problem), briefly=True)
    if way is None:
        return None
    track = router.track_of(way)
    return track.points, track.pinned, track.pin_m
