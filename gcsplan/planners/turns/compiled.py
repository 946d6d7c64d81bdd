"""The unit of machine code for fixed-wing tracks, separate from `gcsplan.planners.compiled`."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.kernel_unit import KernelUnit

TURNS_UNIT = KernelUnit("turns", Path(__file__).parent, "gcsplan.planners.turns", ("kernels",))

device = TURNS_UNIT.device
"""Marks a function that only kernels call."""

kernel = TURNS_UNIT.kernel
"""Marks a function that Python calls. It allocates nothing: its caller passes all arrays."""
