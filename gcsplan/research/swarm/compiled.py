"""The unit of machine code for swarm costs, ants and repair: like `gcsplan.planners.compiled`, but vectorised."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.kernel_unit import KernelUnit

SWARM_UNIT = KernelUnit(
    "swarm",
    Path(__file__).parent,
    "gcsplan.research.swarm",
    ("scene_kernels", "curve_kernels", "cost_kernels"),
    vectors=True,
)

device = SWARM_UNIT.device
"""Marks a function that only kernels call; it allocates nothing."""

kernel = SWARM_UNIT.kernel
"""Marks a function that Python calls. It allocates nothing: its caller passes all arrays."""
