"""The kernels of fixed wings' tracks, as `gcsplan.planners.compiled`; they change when those rules do."""

from __future__ import annotations

from pathlib import Path

from gcsplan.native.unit import Unit

UNIT = Unit("turns", Path(__file__).parent, "gcsplan.planners.turns", ("kernels",))

kernel = UNIT.kernel
"""What Python calls. Nothing is allocated in it: Python hands in the room."""
