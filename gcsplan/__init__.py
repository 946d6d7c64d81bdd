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
    from gcsplan.app.api import check, rehearse, report, upload, write
    from gcsplan.app.fleet.pipeline import load_mission, plan

__all__ = ["__version__", "check", "load_mission", "plan", "rehearse", "report", "upload", "write"]
__version__ = "0.2.0"

_MODULE_OF = {
    "load_mission": "gcsplan.app.fleet.pipeline",
    "plan": "gcsplan.app.fleet.pipeline",
    "check": "gcsplan.app.api",
    "rehearse": "gcsplan.app.api",
    "report": "gcsplan.app.api",
    "upload": "gcsplan.app.api",
    "write": "gcsplan.app.api",
}
"""The module of each function, which is imported at its first use, so that the command line starts fast."""


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
