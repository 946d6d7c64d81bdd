"""This room's kernels: plain functions, marked, that run as machine code. See `gcsplan.native`."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.unit import Unit

UNIT = Unit(
    "planners",
    Path(__file__).parent,
    "gcsplan.planners",
    ("_any_angle", "_cones", "_fill", "_intervals", "_mesh", "_reach", "_stamp", "_storeys", "_string", "_taut"),
)

device = UNIT.device
"""A function that only kernels call; nothing is allocated in it."""

kernel = UNIT.kernel
"""What Python calls. Nothing is allocated in it: Python hands in the room and comes back with more if it is short."""
