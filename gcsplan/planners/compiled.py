"""Kernels of lattice, optimal and profile: decorated plain functions that run as machine code; see `gcsplan.native`."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.kernel_unit import KernelUnit

PLANNERS_UNIT = KernelUnit(
    "planners",
    Path(__file__).parent,
    "gcsplan.planners",
    (
        "lattice.pull_kernels",
        "lattice.search_kernels",
        "optimal.navmesh.clearance_kernels",
        "optimal.navmesh.climb_cones",
        "optimal.navmesh.interval_kernels",
        "optimal.navmesh.mesh_kernels",
        "optimal.navmesh.polyanya",
        "optimal.navmesh.zone_kernels",
        "optimal.plane.section_kernels",
        "profile.taut_kernels",
    ),
)

device = PLANNERS_UNIT.device
"""Decorator of a function that only kernels call; it allocates nothing."""

kernel = PLANNERS_UNIT.kernel
"""Decorator of a function that Python calls. It allocates nothing: Python passes in the arrays to work in, and calls
again with larger ones if they are too small."""
