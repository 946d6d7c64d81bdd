"""The exact check of single legs, as fast per leg as of many legs: for planners that check one leg at a time.

For a single leg, `Airspace.clear` spends a hundred times the kernel's own time on entering compiled code. Here
everything but the leg's ends is kept in an object that is compiled around the same kernel, which leaves about 1.5
microseconds.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.experimental import jitclass  # type: ignore[attr-defined]

from gcsplan.world._compiled import UNIT
from gcsplan.world._entries import judge
from gcsplan.world._field import Field
from gcsplan.world._neighbourhood import extrema_around
from gcsplan.world._shared import BOW_M, Demands
from gcsplan.world._zone_arrays import zones_as_arrays
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits

OneLeg = Callable[[float, float, float, float, float, float], bool]
"""``clear(east0_m, north0_m, amsl0_m, east1_m, north1_m, amsl1_m)``."""

NAMES = tuple(inspect.signature(judge).parameters)
"""Names of the kernel's arguments, in its order."""

_classes: dict[tuple[Any, ...], Any] = {}


def one_leg(airspace: Airspace, limits: Limits) -> OneLeg:
    """A function with the answer of ``airspace.clear`` for one leg with the errors of ``limits``.

    The first one in a process takes half a minute to compile.
    """
    arguments = _arguments(airspace, limits)
    types = tuple(numba.typeof(a) for a in arguments)  # type: ignore[no-untyped-call]
    if types not in _classes:
        _classes[types] = _compiled(types)
    checker = _classes[types](*arguments)
    clear: OneLeg = checker.clear
    return clear


def _arguments(airspace: Airspace, limits: Limits) -> tuple[Any, ...]:
    """The arguments that `Airspace.clear` passes to the kernel, for one leg."""
    surface, scale = airspace.surface, airspace.scale
    field = Field.of(surface.grid)
    zones = zones_as_arrays(airspace.zones, surface, field, scale)
    near_m = limits.track_error_m * scale + (0.0 if field.affine else BOW_M + field.error_m)
    near = extrema_around(field, surface.top_m, near_m)
    far = extrema_around(field, surface.top_m, near_m + limits.horizontal_clearance_m * scale)
    over = extrema_around(field, surface.ground_m, near_m)
    nothing = np.zeros((0, 4)), np.zeros((0, 7, 2)), np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 2))
    return (
        field.packed, surface.ground_m, surface.top_m, *near, *far, *over, *zones,
        np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1, np.bool_), np.full(1, limits.track_error_m),
        np.full(1, limits.altitude_error_m), *Demands.of(limits, scale), False, np.zeros(1, np.bool_), *nothing,
        np.empty((256, 8)), np.zeros(12), np.empty(2 * zones.most_corners), np.full(len(airspace.zones), -1),
        np.arange(len(airspace.zones)),
    )  # fmt: skip


def _compiled(types: tuple[Any, ...]) -> Any:
    """A class with a field for each of the kernel's arguments, from source text, since numba takes no list of them."""
    source = "\n".join(
        [
            "class OneLeg:",
            f"    def __init__(self, {', '.join(NAMES)}):",
            *(f"        self.{n} = {n}" for n in NAMES),
            "    def clear(self, e0, n0, h0, e1, n1, h1):",
            "        start, end = self.start, self.end",
            "        start[0, 0], start[0, 1], start[0, 2] = e0, n0, h0",
            "        end[0, 0], end[0, 1], end[0, 2] = e1, n1, h1",
            "        self.out[:] = 0.0",
            "        self.seen[:] = -1",
            f"        judge({', '.join('self.' + n for n in NAMES)})",
            "        return self.ok[0]",
        ]
    )
    scope = {"judge": UNIT.with_numba()["judge"]}
    exec(source, scope)
    return jitclass(list(zip(NAMES, types, strict=True)))(scope["OneLeg"])
