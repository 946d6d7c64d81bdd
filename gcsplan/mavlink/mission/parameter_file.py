"""The list of parameters as a file that ground stations load.

Mission Planner and MAVProxy read NAME,VALUE lines, and so do newer versions of QGroundControl; all of its versions read
five columns with tabs: system, component, name, value, MAV_PARAM_TYPE (ParameterEditorController.cc,
`buildDiffFromFile`). All take lines that begin with # for comments.
"""

from __future__ import annotations

from collections.abc import Sequence

from gcsplan.mavlink.mission.parameter_list import Setting
from gcsplan.vehicle import Autopilot

__all__ = ["PARAM_ENDING", "param_file"]

PARAM_ENDING = {Autopilot.ARDUCOPTER: "param", Autopilot.ARDUPLANE: "param", Autopilot.PX4: "params"}
"""Mission Planner looks for .param, QGroundControl for .params."""

_WHOLE = {"RTL_TYPE", "RTL_CONE_ANG"}
_INT32, _REAL32 = 6, 9  # MAV_PARAM_TYPE


def param_file(name: str, autopilot: Autopilot, sysid: int, settings: Sequence[Setting]) -> str:
    """The text for the vehicle ``name``: rules and reasons as comments, and every name of each parameter.

    A ground station passes over the names that the vehicle's version does not have.
    """
    lines = [f"# {name}: the parameters that its mission was judged with. gcsplan writes none of them to a vehicle."]
    for s in settings:
        versions = " or ".join(f"{n.name}{f' ({n.versions})' if n.versions else ''}" for n in s.parameter.names)
        rule = "" if s.rule == "equal" else f"{s.rule} this; "
        lines.append(f"# {versions}: {rule}{s.why}")
        for n in s.parameter.names:
            value = f"{n.value(s.value):.10g}"
            kind = _INT32 if n.name in _WHOLE else _REAL32
            px4 = autopilot is Autopilot.PX4
            lines.append(f"{sysid}\t1\t{n.name}\t{value}\t{kind}" if px4 else f"{n.name},{value}")
    return "\n".join(lines) + "\n"
