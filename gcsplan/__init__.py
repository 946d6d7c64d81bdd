"""gcsplan: plans, proves, uploads and verifies MAVLink missions over real terrain.

from gcsplan import load_mission, plan

for vehicle in plan(load_mission("missions/jacksboro.yaml")).vehicles:
    print(vehicle.name, vehicle.verdict.length_m, vehicle.verdict.safe)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcsplan.pipeline import load_mission, plan

__all__ = ["__version__", "load_mission", "plan"]
__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """The functions for scripts, imported when they are asked for: the command line must start fast."""
    if name in ("load_mission", "plan"):
        from gcsplan import pipeline

        return getattr(pipeline, name)
    raise AttributeError(f"module 'gcsplan' has no attribute {name!r}")
