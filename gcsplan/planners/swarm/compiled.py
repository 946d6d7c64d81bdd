"""The kernels of swarm costs, ants and repair: as `gcsplan.planners.compiled`, but cut to vectors when shipped."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.unit import Unit

UNIT = Unit(
    "swarm",
    Path(__file__).parent,
    "gcsplan.planners.swarm",
    ("scene_kernels", "curve_kernels", "cost_kernels"),
    vectors=True,
)

device = UNIT.device
"""A function that only kernels call; nothing is allocated in it."""

kernel = UNIT.kernel
"""What Python calls. Nothing is allocated in it: Python hands in the room."""
