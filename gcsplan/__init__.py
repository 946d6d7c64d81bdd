"""gcsplan plans, checks, uploads and verifies MAVLink missions over real terrain.

    from gcsplan import load_mission, plan, rehearse, upload, write

    planned = plan(load_mission("sample:jacksboro"))
    for vehicle in planned.vehicles:
        print(vehicle.name, vehicle.verdict.length_m, vehicle.verdict.safe)
    write(planned, "jacksboro", report=True)
    print(rehearse(planned).safe)
    for result in upload(planned, to="sim"):
        print(result.vehicle, result.outcome, result.verified)

Every function blocks until it is done. Errors are those of `gcsplan.errors`.
"""

from __future__ import annotations

import sys
from types import ModuleType

TYPE_CHECKING = False  # as typing has it, whose import takes as long as all else before a command hears signals
if TYPE_CHECKING:
    from gcsplan.app.api import check, clear, download, fetch_dem, new, rehearse, report, upload, verify, write
    from gcsplan.app.fleet.pipeline import load_mission, plan
    from gcsplan.app.plan.model import FleetPlan, Plan, VehiclePlan
    from gcsplan.app.session import BetterPath, Planner
    from gcsplan.app.upload.job import JobResult
    from gcsplan.check.verdict import LegFigures, Verdict
    from gcsplan.errors import Cancelled, CheckFailed, GcsplanError, InputError, LinkError, NoMission, UsageError
    from gcsplan.mavlink.mission.mission import Mission, MissionItem
    from gcsplan.mission_file.request import MissionFile
    from gcsplan.notes.note import Finding
    from gcsplan.planners.problem import Problem, Progress, Refusal, Solution, Via
    from gcsplan.plugins import register_optimiser, register_output, register_planner, register_zone_reader
    from gcsplan.sim.outcome import Rehearsal
    from gcsplan.world.geometry.path import Path

__version__ = "0.2.0"

_NAMES = {
    "gcsplan.app.fleet.pipeline": ("load_mission", "plan"),
    "gcsplan.app.api": (
        "check", "clear", "download", "fetch_dem", "new", "rehearse", "report", "upload", "verify", "write",
    ),
    "gcsplan.app.plan.model": ("FleetPlan", "Plan", "VehiclePlan"),
    "gcsplan.app.upload.job": ("JobResult",),
    "gcsplan.check.verdict": ("LegFigures", "Verdict"),
    "gcsplan.app.session": ("BetterPath", "Planner"),
    "gcsplan.errors": (
        "Cancelled", "CheckFailed", "GcsplanError", "InputError", "LinkError", "NoMission", "UsageError",
    ),
    "gcsplan.mavlink.mission.mission": ("Mission", "MissionItem"),
    "gcsplan.mission_file.request": ("MissionFile",),
    "gcsplan.notes.note": ("Finding",),
    "gcsplan.planners.problem": ("Problem", "Progress", "Refusal", "Solution", "Via"),
    "gcsplan.plugins": (
        "register_optimiser", "register_output", "register_planner", "register_zone_reader",
    ),
    "gcsplan.sim.outcome": ("Rehearsal",),
    "gcsplan.world.geometry.path": ("Path",),
}  # fmt: skip
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}
"""The module of each name, which is imported at its first use, so that the command line starts fast."""

__all__ = [
    "BetterPath", "Cancelled", "CheckFailed", "Finding", "FleetPlan", "GcsplanError", "InputError", "JobResult",
    "LegFigures", "LinkError", "Mission", "MissionFile", "MissionItem", "NoMission", "Path", "Plan", "Planner",
    "Problem", "Progress", "Refusal", "Rehearsal", "Solution", "UsageError", "VehiclePlan", "Verdict", "Via",
    "__version__", "check", "clear", "download", "fetch_dem", "load_mission", "new", "plan", "register_optimiser",
    "register_output", "register_planner", "register_zone_reader", "rehearse", "report", "upload", "verify", "write",
]  # fmt: skip


def __getattr__(name: str) -> object:
    if name in _MODULE_OF:
        import importlib

        return getattr(importlib.import_module(_MODULE_OF[name]), name)
    raise AttributeError(f"module 'gcsplan' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


class _Package(ModuleType):
    """The type of this package: it keeps `check` and `report` bound to the functions.

    The packages `gcsplan.check` and `gcsplan.report` have the same names, and Python would bind the names to those
    packages as soon as one of their modules is imported. Import from the packages by their full name: ``from
    gcsplan.check import judge``, ``from gcsplan.check.verdict import Verdict``.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _MODULE_OF or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
