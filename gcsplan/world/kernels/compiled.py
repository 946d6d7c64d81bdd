"""Kernels of the exact check: decorated plain functions that run as machine code; see `gcsplan.native`."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.kernel_unit import KernelUnit

WORLD_UNIT = KernelUnit(
    "world",
    Path(__file__).parents[1],
    "gcsplan.world",
    (
        "kernels.shared",
        "kernels.sweep",
        "kernels.sweep_terrain",
        "kernels.sweep_beside",
        "kernels.sweep_zones",
        "kernels.judging",
        "kernels.envelope",
        "kernels.extrema",
        "kernels.entries",
        "geometry.surface",
    ),
)

device = WORLD_UNIT.device
"""Decorator of a function that only kernels call; it allocates nothing: counting references would cost more than the
rest."""

inlined = WORLD_UNIT.inlined
"""The same for a function with one caller, into which it is copied."""

kernel = WORLD_UNIT.kernel
"""Decorator of a function that Python calls; it allocates nothing: Python passes in the arrays to work in."""

SURFACE, ONE_SURFACE = "f8[] f8[,] f8[,]", "f8[] f8[,]"
EXTREMA = "f4[,,] f4[,,] f4[,,] i1[,] i8 i8"
ZONES = "f8[,] f8[,] f8[] i8[] i8[] i8"
"""Forms of arguments that stay the same over many calls: the map with one or both surfaces, extrema, zones."""

LEGS, DEMANDS = "f8[,] f8[,] b1[] f8[] f8[]", "f8 f8 f8 f8 f8 f8 f8 f8"
"""Forms of legs (`airspace.Legs`) and of `Demands`."""

FOUND = "f8[,] f8[,,] i8[] i8[,] f8[,]"
"""Forms of the arrays into which `judge` writes its results."""

WORK = "f8[,] f8[] f8[] i8[] i8[]"
"""Forms of the arrays that `judge` works in."""
