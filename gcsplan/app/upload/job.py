"""An upload job (what is sent to a vehicle), the user's options, and the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gcsplan.app.upload.fleet_on_board import FleetOnBoard
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.build.fence import Fence
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.protocol.machine import TransferProgress
from gcsplan.mission_file.published.times import Hours
from gcsplan.notes.note import Note, in_json
from gcsplan.vehicle import Vehicle
from gcsplan.world.terrain.grid import GroundHeights
from gcsplan.world.world import World

SIM, LINK = "sim", "link"
ProgressCall = Callable[[str, TransferProgress], None]
"""Called with a vehicle's name and the progress of its upload. In the last call, the phase is the outcome in a word."""


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


@dataclass(frozen=True, eq=False)
class UploadJob:
    """One mission for one vehicle at one URL (`SIM` for a loopback vehicle of its own).

    ``way_home`` is None unless it was judged. ``home_required``: a vehicle that returns at another altitude is refused.
    ``ground`` is what a vehicle that flies the terrain frame is sent. ``hours``: those of the flight from its departure
    on, if a zone was left out for them. ``fleet``: the other vehicles' motions, from which this one keeps apart as its
    parameters make it fly.
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
    fleet: FleetOnBoard | None = None


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
        """The result for JSON, fixed keys first; of the others, those with a value.

        ``details`` are the session's; what was said since, in ``message`` and ``warnings``, stands in their place.
        """
        fixed = {
            "url": self.url, "outcome": self.outcome, "verified": self.verified, "simulated": self.simulated,
            "items": self.items, "seconds": self.seconds, "retries": self.retries,
        }  # fmt: skip
        said = {"message": self.message} | in_json("warnings", self.warnings)
        more = said | dict(self.details or {}) | said
        return fixed | {key: value for key, value in more.items() if value and key not in fixed}
