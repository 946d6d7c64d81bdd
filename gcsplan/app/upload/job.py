"""An upload job: what is sent to a vehicle, the ground and the fleet that it is judged with, options and the result."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gcsplan.app.plan.model import Plan
from gcsplan.arrays import Floats
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.arrival import Slot
from gcsplan.mavlink.build.fence import Fence
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.mavlink.protocol.machine import TransferProgress
from gcsplan.mission_file import MissionFile
from gcsplan.mission_file.published.times import Hours
from gcsplan.notes.note import Note, in_json
from gcsplan.vehicle import Vehicle
from gcsplan.world.terrain.grid import GroundHeights
from gcsplan.world.world import World

SIM, LINK = "sim", "link"


def broken_off(names: Sequence[str]) -> str:
    """Words on the vehicles with which the user broke off a conversation."""
    return (
        f"interrupted while talking to {', '.join(names)}: a transfer under way was broken off, and the vehicle was "
        f"informed; its mission is now unknown: send it again, or compare with gcsplan verify"
    )


MOST_CELLS = 25_000_000
"""Cells of the widest terrain that is loaded, 400 MB."""
ProgressCall = Callable[[str, TransferProgress], None]
"""Called with a vehicle's name and the progress of its upload. In the last call, the phase is the outcome in a word and
``failed`` is set."""


@dataclass(frozen=True, slots=True)
class UploadOptions:
    """The user's permissions. ``allow_parameters``: parameters on board that are outside of the list are judged as they
    are. ``atomic``: if one upload fails, the missions that others took are cleared again.

    ``timeout_s``: the longest time without progress, see `gcsplan.mavlink.link.options`.
    """

    allow_armed: bool = False
    ignore_position: bool = False
    allow_parameters: bool = False
    unchecked: bool = False
    atomic: bool = False
    timeout_s: float = 60.0


@dataclass(eq=False)
class MissionGround:
    """Ground, m AMSL, at latitudes and longitudes; NaN where the mission's terrain does not know it."""

    source: MissionFile

    def __call__(self, lat_deg: Floats, lon_deg: Floats) -> Floats:
        """See `terrain_grid.GroundHeights`. Raises InputError if the terrain cannot be read."""
        while True:
            plane = self.source.frame.to_plane(lat_deg, lon_deg)
            heights = self.source.surface.high_at(plane[..., 0], plane[..., 1])
            unknown = np.isnan(heights)
            if not unknown.any() or not self._widened(plane[unknown]):
                return heights

    def _widened(self, plane: Floats) -> bool:
        """Load more terrain if some of these places lie beyond a side where there is more."""
        surface = self.source.surface
        rows, cols = surface.ground_m.shape
        at = surface.grid(plane[:, 0], plane[:, 1])
        beyond = (at[:, 0] < 0.0, at[:, 1] < 0.0, at[:, 0] > cols - 1, at[:, 1] > rows - 1)
        if not any(more and bool(out.any()) for more, out in zip(surface.goes_on, beyond, strict=True)):
            return False
        wide = None if self.source.wider is None else self.source.wider(0.0, MOST_CELLS)
        if wide is None:
            return False
        self.source = wide
        return True

    def degrees_box(self) -> tuple[float, float, float, float]:
        """South, west, north, east, degrees, of the terrain that is loaded; east is beyond 180 where it wraps."""
        surface, frame = self.source.surface, self.source.frame
        rows, cols = surface.ground_m.shape
        f = np.linspace(0.0, 1.0, 33)
        c, r = np.meshgrid(f * (cols - 1), f * (rows - 1))
        plane = surface.grid.to_plane(c.ravel(), r.ravel())
        degrees = frame.to_degrees(plane[:, 0], plane[:, 1])
        lon = frame.lon_deg + (degrees[:, 1] - frame.lon_deg + 180.0) % 360.0 - 180.0
        return float(degrees[:, 0].min()), float(lon.min()), float(degrees[:, 0].max()), float(lon.max())


class FleetOnBoard:
    """The motions of a plan's vehicles: as planned, until a vehicle's parameters tell that it flies another.

    The vehicles are read at the same time, in any order: the later one of each pair meets the earlier one as it flies.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        drift = {v.name: v.verdict.drift for v in plan.vehicles}
        self._motions = {} if plan.fleet is None else {m.name: m.drifting(drift[m.name]) for m in plan.fleet.motions}
        self._lock = threading.Lock()

    @property
    def keeps_apart(self) -> bool:
        """Whether there are others to keep apart from, and the file asks for it."""
        return self._plan.fleet is not None and self._plan.source.arrival is not None and len(self._motions) > 1

    def against(self, name: str, vehicle: Vehicle, verdict: Verdict) -> Note | None:
        """Why the others do not keep apart from ``name``, flown as ``vehicle`` with ``verdict``; None if they do.

        A fleet whose file has no ``arrival`` need not keep apart, nor need a single vehicle.
        """
        plan = self._plan
        if not self.keeps_apart or plan.fleet is None or plan.source.arrival is None:
            return None
        from gcsplan.app.fleet.fleet import motion_of, rules_of, too_near
        from gcsplan.fleet.separation import conflicts_of

        planned = next(v for v in plan.vehicles if v.name == name)
        flown = replace(planned, request=replace(planned.request, vehicle=vehicle), verdict=verdict)
        motion = motion_of(flown, plan.fleet.slot(name), plan.world).drifting(verdict.drift)
        with self._lock:
            others = [m for m in self._motions.values() if m.name != name]
            self._motions[name] = motion
        kept = [flown if v.name == name else v for v in plan.vehicles]
        met = conflicts_of(motion, others, rules_of(plan.source.arrival, kept, plan.world))
        return too_near(met, plan.world) if met else None


@dataclass(frozen=True, eq=False)
class UploadJob:
    """One mission for one vehicle at one URL (`SIM` for a loopback vehicle of its own).

    ``way_home`` is None unless it was judged. ``home_required``: a vehicle that returns at another altitude is refused.
    ``fence`` and ``rally`` are sent before the mission. ``own``: the lists of its file, by kind; ``unsent`` names each
    of them that is not sent. ``ground`` is sent to a vehicle that flies the terrain frame. ``hours``: the hours of the
    flight from its departure on, if a zone was left out for them; ``waits_s``: how long after T+0 that is. ``fleet``:
    the other vehicles' motions, from which this one keeps apart as its parameters make it fly.
    """

    name: str
    url: str
    mission: Mission
    verdict: Verdict | None = None
    vehicle: Vehicle | None = None
    world: World | None = None
    rtl_rel_home_m: float | None = None
    terrain_error_m: float = 0.0
    fence: Fence | None = None
    way_home: WayHome | None = None
    home_required: bool = False
    ground: GroundHeights | None = None
    hours: Hours | None = None
    waits_s: float = 0.0
    fleet: FleetOnBoard | None = None
    rally: tuple[MissionItem, ...] = ()
    own: Mapping[int, tuple[MissionItem, ...]] = field(default_factory=dict)
    unsent: tuple[Note, ...] = ()


@dataclass(frozen=True, eq=False)
class JobResult:
    """The result of one upload or comparison. ``message`` is the error in words, empty if there is none."""

    vehicle: str
    url: str
    outcome: str
    verified: bool
    items: int
    seconds: float
    retries: int = 0
    simulated: bool = False
    message: str = ""
    warnings: tuple[Note, ...] = ()
    code: int = 0
    reason: str = ""
    details: Mapping[str, Any] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The result for JSON: fixed keys first, then the other keys that have a value.

        ``details`` are the session's; the later ``message`` and ``warnings`` of this result replace the session's.
        """
        fixed = {
            "url": self.url, "outcome": self.outcome, "verified": self.verified, "simulated": self.simulated,
            "items": self.items, "seconds": self.seconds, "retries": self.retries,
        }  # fmt: skip
        latest = {"message": self.message} | in_json("warnings", self.warnings)
        more = latest | dict(self.details or {}) | latest
        return fixed | {key: value for key, value in more.items() if value and key not in fixed}


def releases(plan: Plan, results: Sequence[JobResult]) -> list[tuple[Slot, tuple[float, float] | None, bool]]:
    """When each vehicle of a fleet is started by hand, in order; none of one vehicle. Each slot with the window of its
    arrival, and whether the vehicle has its mission, by the results of an upload."""
    slots = () if plan.fleet is None or len(plan.fleet.slots) < 2 else plan.fleet.slots
    ready = {d.vehicle for d in results if d.verified and not d.code}
    verdicts = {v.name: v.verdict for v in plan.vehicles}
    return [
        (slot, verdicts[slot.name].arrive_window_s(slot), slot.name in ready)
        for slot in sorted(slots, key=lambda slot: slot.depart_s)
    ]
