"""Arguments of the functions for scripts: a wrong type is a mistake with its place and its cure, and no bug."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from numbers import Integral, Real
from typing import Any

from gcsplan.app.parallel.executor import Workers
from gcsplan.app.plan.model import Plan
from gcsplan.errors import PATH_KINDS, require_kind

__all__ = ["require"]

FLAGS = (
    "leave_out", "report", "way_home", "atomic", "offline", "allow_unjudged", "allow_armed", "allow_parameters",
    "ignore_position", "draft",
)  # fmt: skip
NUMBER_ARGUMENTS = ("wind_m_s", "gusts_m_s", "noise_m", "from_deg", "tolerance_m", "radius_km", "flat_m", "min_agl_m")

EXPECTED: dict[str, tuple[Any, str]] = {
    "planner": ((str, Callable), "the name of a planner (`gcsplan planners` lists them), or a function that plans"),
    "objective": (str, "'length', 'energy' or 'time'"),
    "seed": (Integral, "a whole number"),
    "options": (Mapping, "a mapping of a planner's keys"),
    "gate_utc": (datetime, "a datetime"),
    "progress": (Callable, "a function"),
    "on_path": (Callable, "a function"),
    "on_bound": (Callable, "a function"),
    "jobs": (Integral, "a number of processes"),
    "cluster": ((*PATH_KINDS, Workers), "a dask scheduler's address or file, or a client or cluster of dask"),
    "planned": (Plan, "a plan, as gcsplan.plan returns it"),
    "folder": (PATH_KINDS, "the path of a folder"),
    "file": (PATH_KINDS, "the path of a file"),
    "what": (PATH_KINDS, "a plan, a mission, or the path of a .waypoints or .plan file"),
    "vehicle": (str, "the name of a vehicle"),
    "alone": (str, "the name of a vehicle"),
    "wind": (Mapping, "a mapping of the keys of a mission's `wind`, such as {'up_to_m_s': 8}"),
    "mirror": (str, "the URL of a mirror"),
    "vertical_datum": (str, "the name of a vertical datum, such as 'EGM96'"),
    "autopilot": (str, "the name of an autopilot, such as 'arducopter'"),
    "runs": (Integral, "a whole number"),
    "timeout_s": (Real, "a number of seconds"),
    "to": ((str, list, tuple, Mapping), "a URL, a list of NAME=URL, or a mapping from name to URL"),
    "url": (str, "a URL"),
    "sysid": (Integral, "the number of a vehicle, 1 to 255"),
    "around": (str, "a place, such as '36.6, -84.38'"),
    "tiles": (str, "names of tiles with commas, such as 'N36W085,N36W084'"),
    "source": (str, "the name of a published source"),
    "start": (str, "a place, such as '36.6, -84.38'"),
    "goal": (str, "a place, such as '36.6, -84.38'"),
    "kind": (str, "'mission', 'fence' or 'rally'"),
    **dict.fromkeys(FLAGS, (bool, "True or False")),
    **dict.fromkeys(NUMBER_ARGUMENTS, (Real, "a number")),
}
"""The type of each argument by its name, and what it is in words."""

NEEDED = {"planned", "folder", "what", "runs", "gusts_m_s", "noise_m", "timeout_s", "to", "url", "sysid",
          "start", "goal", "min_agl_m", "kind", "autopilot", "mirror", ("verify", "file")}  # fmt: skip
"""Arguments that cannot be None, of all functions or of one."""


def require(function: str, **given: object) -> None:
    """Raise UsageError unless each argument is of its type, or None where it may be; True and False are no numbers."""
    for name, value in given.items():
        kind, expected = EXPECTED[name]
        if value is not None or name in NEEDED or (function, name) in NEEDED:
            require_kind(f"{function}()", name, value, kind, expected)
