"""A gate that opens at a time of day: NAV_DELAY with hour, minute and second UTC, which only ArduCopter obeys.

The vehicle waits in the air above its start until then. The command holds no date: a vehicle that reaches the gate a
moment too late waits for nearly a day (seen on a real ArduCopter). So every vehicle must be there `SLACK_S` early, and
a start time that is near or past is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from gcsplan.errors import InputError, UsageError
from gcsplan.fleet.arrival import Crew, Slot
from gcsplan.fleet.motion.timing import Course
from gcsplan.mission_file.request import MissionFile
from gcsplan.vehicle import Autopilot

if TYPE_CHECKING:
    from gcsplan.app.plan.model import Plan

NEAREST_S = 60.0
"""Seconds by which the common start must be ahead at least, when it is requested and when it is sent."""
FARTHEST_S = 20.0 * 3600.0
SLACK_S = 30.0
"""Seconds before the opening by which every vehicle must be at its gate."""


@dataclass(frozen=True, slots=True)
class GateTime:
    """The common start, T+0, in whole seconds UTC."""

    start: datetime
    where: str = "--gate-utc"

    @classmethod
    def stated(cls, source: MissionFile) -> GateTime | None:
        """The common start that a mission states: the time of day with which its ``at`` begins; None without one."""
        return None if source.start is None else cls(source.start, "at")

    @classmethod
    def require_of(cls, plan: Plan) -> None:
        """Raise UsageError unless the common start of a plan, if it has one, is ahead now: before it is handed out."""
        if plan.fleet is not None and plan.fleet.start_utc is not None:
            cls(plan.fleet.start_utc, "the common start").require_ahead(datetime.now(UTC))

    @classmethod
    def parse(cls, text: str, now: datetime) -> GateTime:
        """Parse ``18:30:00`` (today, UTC) or ``2026-11-21T18:30:00Z``.

        Raises UsageError for other text, and for a start that is near, past or too far ahead.
        """
        try:
            if re.fullmatch(r"\d{1,2}:\d{2}(:\d{2})?", text):
                hour, minute, second = (int(x) for x in (text if text.count(":") == 2 else f"{text}:00").split(":"))
                start = now.astimezone(UTC).replace(hour=hour, minute=minute, second=second, microsecond=0)
            else:
                start = datetime.fromisoformat(text)
        except ValueError:
            raise UsageError(
                f"give a time such as 18:30:00 (today) or 2026-11-21T18:30:00Z, not {text!r}", where="--gate-utc"
            ) from None
        if start.tzinfo is None:
            start = start.replace(tzinfo=UTC)
        gate = cls(start.astimezone(UTC).replace(microsecond=0))
        gate.require_ahead(now)
        return gate

    def require_ahead(self, now: datetime) -> None:
        """Raise UsageError if the common start is too near, past, or more than `FARTHEST_S` away."""
        ahead_s = (self.start - now).total_seconds()
        at = f"{self.start:%Y-%m-%d %H:%M:%S} UTC, and it is {now.astimezone(UTC):%H:%M:%S} now"
        if ahead_s < NEAREST_S:
            what = "is past" if ahead_s < 0 else "is too near"
            raise UsageError(
                f"the start {what} ({at}): it must be {NEAREST_S:g} s ahead at least, for a vehicle that misses its "
                f"gate waits for nearly a day; give a later time, with its date if it is tomorrow's",
                where=self.where,
            )
        if ahead_s > FARTHEST_S:
            raise UsageError(
                f"the start is too far away ({at}): a gate holds no date and would open a day early; "
                f"give a time {FARTHEST_S / 3600:g} hours ahead at most",
                where=self.where,
            )

    def of_day(self, after_s: int) -> tuple[int, int, int]:
        """Hour, minute, second UTC of T+``after_s``."""
        at = self.start + timedelta(seconds=after_s)
        return at.hour, at.minute, at.second


def with_start_gates(crews: Sequence[Crew], slots: Sequence[Slot]) -> list[tuple[Slot, int]]:
    """Each slot, its hold extended to a whole second `SLACK_S` or more after reaching its gate, and that second (T+ s).

    Slots and crews are in the same order. Every vehicle arrives later by the extension of its hold. Raises InputError
    for a vehicle whose autopilot has no such gate.
    """
    out = []
    for crew, slot in zip(crews, slots, strict=True):
        if crew.vehicle.autopilot is not Autopilot.ARDUCOPTER:
            raise InputError(
                f"{crew.name}: a gate at a time of day is ArduCopter's alone: {crew.vehicle.autopilot} "
                + ("knows seconds only" if crew.vehicle.autopilot is Autopilot.PX4 else "goes on at once in the air"),
                where="--gate-utc",
            )
        takeoff = Course(crew.route, crew.vehicle).takeoff
        there_s = slot.depart_s + (0.0 if takeoff is None else takeoff.time_s(slot.speed_m_s))
        opens_s = math.ceil(there_s + slot.hold_s + SLACK_S - 1e-6)
        hold_s = opens_s - there_s
        more_s = hold_s - slot.hold_s
        energy_j = slot.energy_j + crew.vehicle.energy.hold_w() * more_s
        out.append((replace(slot, hold_s=hold_s, arrive_s=slot.arrive_s + more_s, energy_j=energy_j), opens_s))
    return out
