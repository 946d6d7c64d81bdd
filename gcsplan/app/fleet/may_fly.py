"""Whether a planned mission may fly: every command that writes or sends a plan asks `flyable` before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.app.fleet.fleet import without
from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import homes_of, is_required, judged, require
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome

__all__ = ["flyable", "require_passing"]


def flyable(
    plan: Plan, *, allow_unjudged: bool = False, home: bool = False, require_way_home: bool = False
) -> tuple[Plan, dict[str, WayHome]]:
    """The plan, and the way home of each vehicle if ``home`` or the mission requires it; else none.

    A mission does not fly if it breaks a limit, if something in it could not be judged (unless ``allow_unjudged``), or
    if a safe return is required and there is none. One that does not fly refuses the plan; where vehicles may be left
    out of it, the plan that is returned is that of the others.

    Raises CheckFailed if the plan is refused, NoMission if all vehicles are left out.
    """
    if not plan.leaves_out:
        require_passing({v.name: v.verdict for v in plan.vehicles}, allow_unjudged=allow_unjudged)
        return plan, judged(plan, home=home, option=require_way_home)
    required = is_required(plan.source, require_way_home)
    homes = homes_of(plan) if home or required else {}
    leaving = LeavingOut(allowed=True, found=plan.left_out)
    for v in plan.vehicles:
        try:
            require_passing({v.name: v.verdict}, allow_unjudged=allow_unjudged)
            require({v.name: homes[v.name]} if homes else {}, required=required)
        except CheckFailed as why:
            leaving.leave(v.name, why)
    gone = {v.name for v in leaving.found}
    vehicles = tuple(v for v in plan.vehicles if v.name not in gone)
    if len(vehicles) == len(plan.vehicles):
        return plan, homes
    leaving.require_some(vehicles)
    fleet = None if plan.fleet is None else without(plan.fleet, vehicles, plan.source.arrival, plan.world)
    homes = {name: home for name, home in homes.items() if name not in gone}
    return replace(plan, vehicles=vehicles, fleet=fleet, left_out=tuple(leaving.found)), homes


def require_passing(verdicts: Mapping[str, Verdict], *, allow_unjudged: bool = False) -> None:
    """Raise CheckFailed unless every verdict is safe (or not judged, if that is allowed)."""
    bad = {name: v for name, v in verdicts.items() if v.safe is False or (v.safe is None and not allow_unjudged)}
    if bad:
        broken = any(v.safe is False for v in bad.values())
        raise CheckFailed(
            "limits are broken" if broken else "not everything could be judged",
            lines=[f"{name}:\n  " + v.describe().replace("\n", "\n  ") for name, v in bad.items()],
            reason="violation" if broken else "not_judged",
        )
