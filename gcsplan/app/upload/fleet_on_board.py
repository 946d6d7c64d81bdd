"""The separation of a fleet, judged again with the parameters that were read from its vehicles."""

from __future__ import annotations

import threading
from dataclasses import replace

from gcsplan.app.plan.model import Plan
from gcsplan.check.verdict import Verdict
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle

__all__ = ["FleetOnBoard"]


class FleetOnBoard:
    """The motions of a plan's vehicles: as planned, until a vehicle's parameters tell that it flies another.

    The vehicles are read at the same time, in any order: the later one of each pair meets the earlier one as it flies.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._motions = {} if plan.fleet is None else {m.name: m for m in plan.fleet.motions}
        self._lock = threading.Lock()

    @property
    def keeps_apart(self) -> bool:
        """Whether there are others to keep apart from, and the file asks for it."""
        return self._plan.fleet is not None and self._plan.source.arrival is not None and len(self._motions) > 1

    def against(self, name: str, vehicle: Vehicle, verdict: Verdict) -> Note | None:
        """Why the others do not keep apart from ``name``, flown as ``vehicle`` with ``verdict``; None if they do.

        Nothing is asked of a fleet whose file says no ``arrival``, nor of a single vehicle.
        """
        plan = self._plan
        if not self.keeps_apart or plan.fleet is None or plan.source.arrival is None:
            return None
        from gcsplan.app.fleet.fleet import motion_of, rules_of, too_near
        from gcsplan.fleet.separation import separation

        planned = next(v for v in plan.vehicles if v.name == name)
        flown = replace(planned, request=replace(planned.request, vehicle=vehicle), verdict=verdict)
        motion = motion_of(flown, plan.fleet.slot(name), plan.world)
        with self._lock:
            others = [m for m in self._motions.values() if m.name != name]
            self._motions[name] = motion
        kept = [flown if v.name == name else v for v in plan.vehicles]
        found = separation([motion, *others], rules_of(plan.source.arrival, kept))
        met = [c for c in found.conflicts if name in c.worst.vehicles]
        return too_near(met, plan.world) if met else None
