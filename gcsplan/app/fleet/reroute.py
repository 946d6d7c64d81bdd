"""Other paths for a vehicle: higher above ground, around the places of conflicts, or longer for a later arrival.

The planner runs again, with tighter limits or with no-fly discs that only it sees. The resulting mission is judged in
the mission file's own world, like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.replanning import same_ends, with_bound
from gcsplan.app.plan.vehicle import plan_vehicle
from gcsplan.errors import InputError, NoMission
from gcsplan.fleet.motion.timing import Route
from gcsplan.mission_file import VehicleRequest
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import nearest_on
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World

if TYPE_CHECKING:
    from gcsplan.fleet.separation import Conflict, Rules

RADII = (1.0, 3.0, 8.0)
"""Radii of the discs around places of conflict, in needed distances; each attempt is wider than the one before."""

TEETH = (1, 2, 4, 8)
"""Numbers of teeth to try for the zigzag of a longer path."""

LONGER_BY = 1e-3
"""Part by which a longer path is made longer than requested."""

DETOUR_SPARE_M = 2.0
"""Metres by which a path is raised, or a disc widened, beyond the need: way points are rounded, corners are cut."""


class Detours:
    """Plan other paths: calling it is the ``replan`` of `fleet.resolve`, `longer` is that of `fleet.arrival`.

    `plan_of` returns the plan of a route that either of them made. ``gated`` puts the vehicle's gates on a way.
    """

    def __init__(
        self, vehicles: Sequence[VehiclePlan], brief: Brief, rules: Callable[[], Rules],
        route_of: Callable[[VehiclePlan], Route], gated: Callable[[VehiclePlan], VehiclePlan],
    ) -> None:  # fmt: skip
        self._plans, self._gated = {v.name: v for v in vehicles}, gated
        self._brief, self._rules_of, self._route_of = brief, rules, route_of
        self._found: list[tuple[Route, VehiclePlan]] = []
        self._known: dict[object, Route | None] = {}

    @cached_property
    def rules(self) -> Rules:
        """The separation of the vehicles on their first paths."""
        return self._rules_of()

    def plan_of(self, name: str, route: Route) -> VehiclePlan:
        """The plan that a route was made from: one of these detours, or the vehicle's first plan."""
        return next((plan for known, plan in self._found if known is route), self._plans[name])

    def __call__(self, name: str, avoid: Sequence[Conflict], attempt: int) -> Route | None:
        """The first route that has a mission, of the ideas from number ``attempt`` on; None if no idea has one."""
        ideas = [self._higher, *(lambda n, a, r=r: self._round(n, a, r) for r in RADII)]
        for number, idea in enumerate(ideas[attempt - 1 :], start=attempt):
            key = (name, number, () if number == 1 else tuple(c.worst.middle for c in avoid))
            if key not in self._known:
                self._known[key] = idea(name, avoid)
            route = self._known[key]
            if route is not None:
                return route
        return None

    def longer(self, name: str, length_m: float) -> Route | None:
        """A route of about ``length_m``: a zigzag over the present path and through the vehicle's own via points, the
        widest that fits; None if none does."""
        plan = self._plans[name]
        request, points = plan.request, plan.solution.path.points
        legs_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
        now_m = float(legs_m.sum())
        length_m *= 1.0 + LONGER_BY  # a slightly longer path is flown slightly faster; a shorter one cannot be used
        along_m = np.concatenate([[0.0], np.cumsum(legs_m)])
        way = points[-1, :2] - points[0, :2]
        if not np.hypot(*way) > 0.0:
            return None
        own = np.array([place[:2] for place in request.via]).reshape(-1, 2)
        passed_m = np.maximum.accumulate(nearest_on(own, points[:, :2])[1])
        aside = np.array([-way[1], way[0]]) / np.hypot(*way)
        for teeth in TEETH:  # each tooth is two equal sides of a triangle over its part of the track
            off_m = math.sqrt(max(0.0, length_m**2 - now_m**2)) / (2.0 * teeth)
            at_m = now_m * (np.arange(teeth) + 0.5) / teeth
            middle = np.column_stack([np.interp(at_m, along_m, points[:, k]) for k in (0, 1)])
            for side in (1.0, -1.0):
                turns = middle + (side * off_m * (-1.0) ** np.arange(teeth))[:, None] * aside
                teeth_via = [(float(east), float(north), None) for east, north in turns]
                row = np.argsort(np.concatenate([passed_m, at_m]), kind="stable").tolist()
                via = tuple([*request.via, *teeth_via][k] for k in row)
                route = self._planned(name, replace(request, via=via))
                if route is not None:
                    return route
        return None

    def _higher(self, name: str, avoid: Sequence[Conflict]) -> Route | None:
        request = self._plans[name].request
        limits = request.vehicle.limits
        low_m = limits.min_agl_m + self.rules.needed_m + DETOUR_SPARE_M
        if limits.max_agl_m is not None and low_m + 2.0 * limits.altitude_error_m > limits.max_agl_m:
            return None
        return self._planned(name, request, limits=replace(limits, min_agl_m=low_m))

    def _round(self, name: str, avoid: Sequence[Conflict], wider: float) -> Route | None:
        request, air = self._plans[name].request, self._brief.world.airspace
        limits = request.vehicle.limits
        radius_m = wider * self.rules.needed_m + DETOUR_SPARE_M
        reach_m = radius_m + limits.horizontal_clearance_m + limits.track_error_m
        half_m = self.rules.needed_m + limits.altitude_error_m + DETOUR_SPARE_M
        discs = []
        for i, conflict in enumerate(avoid):
            east, north, amsl = conflict.worst.middle
            ends = (request.start, request.goal)
            if conflict.kind != "air" or any(math.hypot(e[0] - east, e[1] - north) <= reach_m for e in ends):
                continue  # it starts or ends there, so no path leads around it
            levels = Level(amsl - half_m, "amsl"), Level(amsl + half_m, "amsl")
            discs.append(Zone(f"conflict {i + 1}", Circle(east, north, radius_m), *levels))
        if not discs:
            return None
        world = World(
            self._brief.world.frame,
            Airspace(air.surface, (*air.zones, *discs), scale=self._brief.source.airspace_scale),
        )
        return self._planned(name, request, searched=world)

    def _planned(
        self, name: str, request: VehicleRequest, *, limits: Limits | None = None, searched: World | None = None
    ) -> Route | None:
        if limits is not None:  # the mission file's take-off height may be below the raised limit
            request = replace(request, takeoff_agl_m=None, approach_agl_m=None)
        try:
            plan = self._gated(plan_vehicle(self._brief, request, limits=limits, searched=searched))
        except (NoMission, InputError):
            return None
        own = self._plans[name]
        # Other limits, zones or vias than the vehicle's own: only the bound of its own plan says something of it.
        bound = own.solution.lower_bound if same_ends(plan.solution, own.solution) else None
        plan = replace(plan, request=own.request, solution=with_bound(plan.solution, bound, plan.problem))
        route = self._route_of(plan)
        self._found.append((route, plan))
        return route
