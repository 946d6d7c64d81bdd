"""gcsplan: plans, proves, uploads and verifies MAVLink missions over real terrain.

    from gcsplan import load_mission, plan, rehearse, upload

    planned = plan(load_mission("missions/jacksboro.yaml"))
    for vehicle in planned.vehicles:
        print(vehicle.name, vehicle.verdict.length_m, vehicle.verdict.safe)
    print(rehearse(planned).safe)
    for delivery in upload(planned, to="sim"):
        print(delivery.vehicle, delivery.outcome, delivery.verified)

All of it is plain blocking calls; errors are those of `gcsplan.errors`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcsplan.app.pipeline import load_mission, plan
    from gcsplan.app.scripting import rehearse, upload

__all__ = ["__version__", "load_mission", "plan", "rehearse", "upload"]
__version__ = "0.1.0"


def __getattr__(name: str) -> object:
    """The functions for scripts, imported when they are asked for: the command line must start fast."""
    if name in ("load_mission", "plan"):
        from gcsplan.app import pipeline

        return getattr(pipeline, name)
    if name in ("rehearse", "upload"):
        from gcsplan.app import scripting

        return getattr(scripting, name)
    raise AttributeError(f"module 'gcsplan' has no attribute {name!r}")
