"""Kernels of lattice, optimal and profile: plain functions, marked, that run as machine code. See `gcsplan.native`."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.unit import Unit

UNIT = Unit(
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
        "optimal.navmesh.polyanya_nodes",
        "optimal.navmesh.zone_kernels",
        "profile.taut_kernels",
    ),
)

device = UNIT.device
"""A function that only kernels call; nothing is allocated in it."""

kernel = UNIT.kernel
"""What Python calls. Nothing is allocated in it: Python hands in the room and comes back with more if it is short."""
