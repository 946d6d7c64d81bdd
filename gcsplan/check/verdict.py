"""`Verdict`: what the check says of one mission, in numbers and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcsplan.check.misses import Miss
from gcsplan.check.stretch import Place, StretchKind
from gcsplan.mavlink.mission.mission import Mission


@dataclass(frozen=True, slots=True)
class Finding:
    """One limit broken by wire item ``seq``: at a place, by how much, in words. ``zone`` is its name or empty."""

    seq: int
    kind: str
    message: str
    lat_deg: float
    lon_deg: float
    amsl_m: float
    value: float
    limit: float
    by: float
    unit: str
    zone: str = ""


@dataclass(frozen=True, slots=True)
class LegFigures:
    """One flown stretch in numbers; NaN where the ground is unknown.

    ``min_agl_m`` counts above ground and what stands on it, on the line itself; ``agl_end_m`` above bare ground.
    ``energy_j`` holds the hold's cost too; ``hold_s`` may be infinite (a loiter without end costs nothing here).
    Figures are those of one time; ``times``: how often it is flown, where a jump leads back. ``jumped_from``: the jump
    that leads to it.
    """

    seq: int
    kind: StretchKind
    start: Place
    end: Place
    column: bool
    on_path: bool
    horizontal_m: float
    length_m: float
    climb_deg: float
    agl_end_m: float
    min_agl_m: float
    min_agl_at: tuple[float, float]
    max_agl_m: float
    zone_clearance_m: float
    nearest_zone: str
    energy_j: float
    time_s: float
    hold_s: float
    times: int = 1
    jumped_from: int | None = None


@dataclass(frozen=True, slots=True)
class Verdict:
    """``mission`` is the one that was judged, as sent; the judgement is of what the autopilot stores of it.

    ``misses``: how near it comes to each limit, on request. ``until_reserve_s``: of a mission that ends in a
    hold or a round without end, how long that may last.
    """

    mission: Mission
    legs: tuple[LegFigures, ...]
    findings: tuple[Finding, ...]
    not_judged: tuple[str, ...]
    notes: tuple[str, ...] = ()
    battery_used_percent: float | None = None
    misses: tuple[Miss, ...] = ()
    until_reserve_s: float | None = None

    @property
    def safe(self) -> bool | None:
        """True, False, or None where no limit is broken but something could not be judged."""
        if self.findings:
            return False
        return None if self.not_judged else True

    @property
    def path_legs(self) -> tuple[LegFigures, ...]:
        """The stretches that count for the path: from the top of the take-off to the approach."""
        return tuple(leg for leg in self.legs if leg.on_path)

    @property
    def length_m(self) -> float:
        """Length of the path in space."""
        return math.fsum(leg.length_m * leg.times for leg in self.path_legs)

    @property
    def path_energy_j(self) -> float:
        """Energy of the path alone, comparable with a planner's bound."""
        return math.fsum(leg.energy_j * leg.times for leg in self.path_legs)

    @property
    def energy_j(self) -> float:
        """Energy of the whole flight: columns, holds and the return included."""
        return math.fsum(leg.energy_j * leg.times for leg in self.legs)

    @property
    def time_s(self) -> float:
        """Duration of the whole flight; a loiter without end counts nothing."""
        return math.fsum(leg.time_s * leg.times for leg in self.legs)

    @property
    def arrive_s(self) -> float:
        """From leaving the ground to the end of the path (the goal at approach altitude)."""
        last = max((i for i, leg in enumerate(self.legs) if leg.on_path), default=-1)
        return math.fsum(leg.time_s * leg.times for leg in self.legs[: last + 1])

    @property
    def lowest(self) -> LegFigures | None:
        """The stretch that is lowest above ground, columns aside."""
        legs = [leg for leg in self.legs if not leg.column and not math.isnan(leg.min_agl_m)]
        return min(legs, key=lambda leg: leg.min_agl_m, default=None)

    @property
    def nearest(self) -> LegFigures | None:
        """The stretch nearest to a zone whose height band it meets; None where it meets none."""
        legs = [leg for leg in self.legs if leg.nearest_zone]
        return min(legs, key=lambda leg: leg.zone_clearance_m, default=None)

    @property
    def max_climb_deg(self) -> float:
        """The steepest stretch, up or down, columns aside."""
        return max((abs(leg.climb_deg) for leg in self.legs if not leg.column and leg.horizontal_m > 0), default=0.0)

    def describe(self) -> str:
        """All findings and all that is not judged, one a line."""
        lines = [f.message for f in self.findings] + [f"not judged: {what}" for what in self.not_judged]
        return "\n".join(lines)
