"""What a mission file asks for, read and found good: metres inside, degrees where the door needs them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from gcsplan.vehicle import Vehicle
from gcsplan.world.frame import Frame
from gcsplan.world.surface import Surface
from gcsplan.world.zones import Zone

AltitudeFrame = Literal["relative", "amsl", "terrain"]
End = Literal["land", "loiter", "rtl", "none"]


@dataclass(frozen=True, slots=True)
class ArrivalRequest:
    """How the fleet arrives; ``order`` names every vehicle once; ``interval_s`` holds for a sequence.

    ``best_order``: the order is looked for, ``order`` is only that of the file. ``arrive_s``: when the first of a
    sequence, or all together, are to be there; None: as ``clock`` has it, when the first can (``first``) or when the
    whole fleet can (``fleet``). ``hold``: how a vehicle waits that would come too early: on the ground, at the gate
    (the top of take-off), or not. ``window_s``: each may arrive this much earlier or later. ``pad_clear_s``: so long
    after landing the pad is free again; None: never.
    """

    mode: Literal["sequence", "together", "none"]
    order: tuple[str, ...]
    interval_s: float
    separation_m: float
    best_order: bool = False
    arrive_s: float | None = None
    clock: Literal["first", "fleet"] | None = None
    hold: Literal["ground", "gate", "none"] = "ground"
    window_s: float = 0.0
    pad_clear_s: float | None = None


@dataclass(frozen=True, eq=False)
class VehicleRequest:
    """What one vehicle shall do.

    ``start``, ``goal``: east_m, north_m and the *ground* there, AMSL metres; ``start_deg``, ``goal_deg`` the same as
    (latitude, longitude), as written. ``start_amsl_m``, ``goal_amsl_m``: where they hang in the air instead (local
    missions), else None. ``takeoff_agl_m``, ``approach_agl_m`` None: the lowest that the limits allow. ``via``:
    east_m, north_m, agl_m or None for any height.
    """

    vehicle: Vehicle
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    start_deg: tuple[float, float]
    goal_deg: tuple[float, float]
    takeoff_agl_m: float | None = None
    approach_agl_m: float | None = None
    via: tuple[tuple[float, float, float | None], ...] = ()
    end: End = "land"
    rtl_rel_home_m: float | None = None
    takeoff_heading_deg: float | None = None
    start_amsl_m: float | None = None
    goal_amsl_m: float | None = None


@dataclass(frozen=True, slots=True)
class PlannerRequest:
    """Which planner, and how; ``extras`` are the keys that only some planners know."""

    name: str = "optimal"
    objective: Literal["length", "energy"] = "length"
    seed: int = 1
    gap_percent: float = 0.1
    budget_s: float = 10.0
    budget_mb: float = 1024.0
    extras: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class MissionFile:
    """A mission file, read and found good; metres inside.

    ``airspace_scale``: largest scale of the plane over the terrain that was loaded. ``inputs`` is what the outputs say
    of the sources; ``notes`` are said to the user. ``wider(margin_m, most_cells)``: the same file with more terrain
    loaded, so far around all terminals or at least twice as far as here, or what there is of it; None where that would
    take more cells, or there is no more. ``level`` counts the times that it was: the terrain of each holds that of the
    one before. ``reaching(places)``: the same content read again, with terrain for these places (latitude, longitude),
    too."""

    name: str
    path: Path
    stem: str
    frame: Frame
    surface: Surface
    zones: tuple[Zone, ...]
    airspace_scale: float
    vehicles: tuple[VehicleRequest, ...]
    arrival: ArrivalRequest | None
    planner: PlannerRequest
    altitude_frame: AltitudeFrame
    terrain_error_m: float
    local: bool
    inputs: dict[str, object]
    notes: tuple[str, ...]
    wider: Callable[[float, int], MissionFile | None] | None = None
    level: int = 0
    reaching: Callable[[Sequence[tuple[float, float]]], MissionFile] | None = None
