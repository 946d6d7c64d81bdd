"""Files of parameters as ground stations load and save them: the list of a plan, and what a vehicle has.

Mission Planner and MAVProxy read NAME,VALUE lines, and so do newer versions of QGroundControl; all of its versions read
five columns with tabs: system, component, name, value, MAV_PARAM_TYPE (ParameterEditorController.cc,
`buildDiffFromFile`). All take lines that begin with # for comments.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.mavlink.mission.parameter_list import Setting
from gcsplan.vehicle import Autopilot

__all__ = ["PARAM_ENDING", "param_file", "read_param_file"]

PARAM_ENDING = {Autopilot.ARDUCOPTER: "param", Autopilot.ARDUPLANE: "param", Autopilot.PX4: "params"}
"""Mission Planner looks for .param, QGroundControl for .params."""

_WHOLE_NUMBERS = {"RTL_TYPE", "RTL_CONE_ANG", "GF_ACTION", "NAV_RCL_ACT", "NAV_DLL_ACT", "COM_LOW_BAT_ACT"}
_INT32, _REAL32 = 6, 9  # MAV_PARAM_TYPE
_MOST_BYTES, _MOST_LETTERS = 4_000_000, 16
"""Largest file that is read, and the longest name that MAVLink has."""


def param_file(name: str, autopilot: Autopilot, sysid: int, settings: Sequence[Setting]) -> str:
    """The text for the vehicle ``name``: rules and reasons as comments, and every name of each parameter.

    A ground station passes over the names that the vehicle's version does not have.
    """
    lines = [f"# {name}: the parameters that its mission was judged with. gcsplan writes none of them to a vehicle."]
    for s in settings:
        versions = " or ".join(f"{n.name}{f' ({n.versions})' if n.versions else ''}" for n in s.parameter.names)
        rule = "" if s.rule == "equal" else f"{s.rule} this; "
        if s.also:
            rule += f"{' and '.join(f'{amount:g}' for amount in s.also)} too; "
        lines.append(f"# {versions}: {rule}{s.why}")
        for n in s.parameter.names:
            value = f"{n.value(s.value):.10g}"
            kind = _INT32 if n.name in _WHOLE_NUMBERS else _REAL32
            px4 = autopilot is Autopilot.PX4
            lines.append(f"{sysid}\t1\t{n.name}\t{value}\t{kind}" if px4 else f"{n.name},{value}")
    return "\n".join(lines) + "\n"


def read_param_file(file: Path) -> dict[str, float]:
    """Parameters by name from a file in either form. Raises InputError with the line that is in neither."""
    try:
        with file.open("rb") as opened:
            raw = opened.read(_MOST_BYTES + 1)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", where=str(file)) from None
    if len(raw) > _MOST_BYTES:
        raise InputError(f"is larger than {_MOST_BYTES} bytes: no list of parameters is", where=str(file))
    values: dict[str, float] = {}
    for number, line in enumerate(raw.decode("utf-8-sig", "replace").splitlines(), 1):
        words = re.split(r"[\t ,]+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        name, value = (words[2:4] if len(words) == 5 else words) if len(words) in (2, 5) else ("", "")
        try:
            amount = float(value)
        except ValueError:
            amount = math.nan
        if not name or len(name) > _MOST_LETTERS or not math.isfinite(amount):
            raise InputError(
                f"each line must be NAME,VALUE or QGroundControl's five columns, given {line.strip()[:60]!r}",
                where=f"{file}:{number}",
            )
        values[name] = amount
    if not values:
        raise InputError("has no parameters: give lines NAME,VALUE", where=str(file))
    return values
