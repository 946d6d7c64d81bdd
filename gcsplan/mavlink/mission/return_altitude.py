"""The parameter that holds the return altitude: its name and unit in each version of each autopilot.

ArduCopter 4.7 renamed RTL_ALT (cm) to RTL_ALT_M (m); ArduPlane 4.5 renamed ALT_HOLD_RTL (cm) to RTL_ALTITUDE (m).
A vehicle answers to one of the names, which tells its version; without a vehicle both are named.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass

from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot


@dataclass(frozen=True, slots=True)
class ReturnParameter:
    """One name of the return altitude above home. ``per_m``: its units in a metre; ``versions``: who has it."""

    name: str
    unit: str
    per_m: float
    versions: str = ""

    def metres(self, value: float) -> float:
        """The altitude above home, m, of a value on board."""
        return value / self.per_m

    def value(self, rel_home_m: float) -> float:
        """The value for an altitude above home, rounded up to a centimetre: the older names hold whole ones."""
        return math.ceil(round(100.0 * rel_home_m, 6)) / (100.0 / self.per_m)

    def setting(self, rel_home_m: float) -> str:
        """``RTL_ALT 35300 (cm)``."""
        return f"{self.name} {self.value(rel_home_m):.10g} ({self.unit})"


RETURN_PARAMETERS: dict[Autopilot, tuple[ReturnParameter, ...]] = {
    Autopilot.ARDUCOPTER: (
        ReturnParameter("RTL_ALT", "cm", 100.0, "before ArduPilot 4.7"),
        ReturnParameter("RTL_ALT_M", "m", 1.0, "since ArduPilot 4.7"),
    ),
    Autopilot.ARDUPLANE: (
        ReturnParameter("RTL_ALTITUDE", "m", 1.0, "since ArduPilot 4.5"),
        ReturnParameter("ALT_HOLD_RTL", "cm", 100.0, "before ArduPilot 4.5"),
    ),
    Autopilot.PX4: (ReturnParameter("RTL_RETURN_ALT", "m", 1.0),),
}
"""In the order in which they are named and asked for."""

PX4_CONE_DEG = 45.0
"""RTL_CONE_ANG, default: the half-angle of the cone around home in which PX4 returns lower."""


def on_board(names: Container[str]) -> ReturnParameter | None:
    """The parameter that a vehicle has, by the names that it answered to; None if it answered to none."""
    return next((p for known in RETURN_PARAMETERS.values() for p in known if p.name in names), None)


def return_on_board_m(values: Mapping[str, float]) -> float | None:
    """The return altitude above home, m, of parameters that were read; None if it was not read, or is no altitude.

    ArduPlane's -1 keeps the altitude at which the return begins.
    """
    parameter = on_board(values)
    height_m = math.nan if parameter is None else parameter.metres(values[parameter.name])
    return height_m if math.isfinite(height_m) and height_m >= 0.0 else None


def returns_otherwise(values: Mapping[str, float]) -> Note | None:
    """Why a vehicle with these parameters returns otherwise than straight home; None if it does not.

    Only PX4 has such parameters: RTL_TYPE above 0 returns along the mission, to its landing or to rally points alone,
    and RTL_CONE_ANG above 45° returns lower near home than is judged.
    """
    kind, cone_deg = values.get("RTL_TYPE", 0.0), values.get("RTL_CONE_ANG", 0.0)
    if kind != 0.0:
        return Note("return_type_not_judged", value=kind)
    if cone_deg > PX4_CONE_DEG:
        return Note("return_cone_not_judged", value=cone_deg, judged_deg=PX4_CONE_DEG)
    return None


def setting(autopilot: Autopilot, rel_home_m: float) -> str:
    """What to set for a return at ``rel_home_m`` on a vehicle of unknown version: every name, its value and unit."""
    first, *others = RETURN_PARAMETERS[autopilot]
    return first.setting(rel_home_m) + "".join(f" or, {p.versions}, {p.setting(rel_home_m)}" for p in others)


def settings(autopilot: Autopilot, rel_home_m: float) -> list[dict[str, str | float]]:
    """The same as plain values."""
    return [
        {"parameter": p.name, "value": p.value(rel_home_m), "unit": p.unit, "versions": p.versions or "all"}
        for p in RETURN_PARAMETERS[autopilot]
    ]
