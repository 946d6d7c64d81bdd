"""The battery along a mission: what each leg uses, and whether the rest is enough for the return from every point.

The model is `gcsplan.vehicle.Energy`: a return costs R1 for its climb and its descent, R2 for the straight line home
and for what the vehicle goes on before it turns home (`motion.stopping`), the base power for no less than its time
(`return_rules.return_s`), and the power of hovering for the seconds over home. Along a straight leg the energy spent is
at most linear (`LegFigures.lead_j`), and the energy of the return is convex, because the distance to home and the climb
to the return's altitude are. So their sum exceeds a limit at most on two parts of a leg, one at each end, and bisection
finds where it crosses the limit, without sampling.

In declared winds all of this is for the worst of them, and the return for its own worst; it stays convex
(`flight.ways_home.WaysHome`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from gcsplan.check.flight.ways_home import WaysHome
from gcsplan.check.motion.return_rules import RETURN_RULES, return_s, speed_home_m_s
from gcsplan.check.motion.stopping import detour_home_m
from gcsplan.check.motion.stretch import Place, flat_m, offset_m, on_globe, place_on
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.figures import raised
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle

HALVINGS = 50
MOST_ROUNDS = 1000
"""Rounds of a jump that are judged one by one."""


@dataclass(frozen=True, slots=True)
class LegBattery:
    """One leg: its energy, the energy spent by its end, and a return from there; percent of the battery (or None)."""

    seq: int
    kind: str
    energy_j: float
    spent_j: float
    return_j: float
    used_percent: float | None
    with_return_percent: float | None


@dataclass(frozen=True, slots=True)
class BatteryHome:
    """Whether the battery is enough for the return, from every point.

    ``usable_j``: the battery less its reserve. ``most_j``: the highest sum of energy spent and return, at ``most_at``
    (``most_m`` along the mission). ``point_of_no_return``: the first place beyond which that sum exceeds ``usable_j``
    (None: there is none); ``no_return_m`` how far along; ``short``: (from_m, to_m) of all such parts.
    """

    usable_j: float
    battery_j: float
    most_j: float
    most_at: Place
    most_m: float
    point_of_no_return: Place | None
    no_return_m: float | None
    no_return_seq: int | None
    short: tuple[tuple[float, float], ...]
    legs: tuple[LegBattery, ...]

    @property
    def most_percent(self) -> float:
        """The highest use with the return included, percent of the whole battery."""
        return 100.0 * self.most_j / self.battery_j

    def as_dict(self) -> dict[str, Any]:
        """The fields as plain values."""
        return {
            "usable_j": self.usable_j,
            "most_j": self.most_j,
            "most_percent": self.most_percent,
            "most_at": list(self.most_at),
            "most_m": self.most_m,
            "point_of_no_return": None if self.point_of_no_return is None else list(self.point_of_no_return),
            "no_return_m": self.no_return_m,
            "no_return_seq": self.no_return_seq,
            "short": [list(part) for part in self.short],
        }

    @property
    def note(self) -> Note:
        """The note on the battery's use."""
        most, usable = raised(self.most_percent, 0), 100.0 * self.usable_j / self.battery_j
        if self.point_of_no_return is None or self.no_return_m is None:
            return Note("battery_enough", most_percent=most, at_m=self.most_m, usable_percent=usable)
        lat, lon, _ = self.point_of_no_return
        return Note(
            "point_of_no_return", at_m=self.no_return_m, seq=self.no_return_seq, lat=lat, lon=lon, most_percent=most,
            usable_percent=usable,
        )  # fmt: skip


def battery_home(verdict: Verdict, vehicle: Vehicle, home: Place, return_amsl_m: float) -> BatteryHome | None:
    """The energy spent so far plus the return, from every point of a flight; None if the capacity is not given."""
    energy, rule = vehicle.energy, RETURN_RULES[vehicle.autopilot]
    if energy.battery_j is None or not verdict.legs:
        return None
    usable = (1.0 - energy.reserve) * energy.battery_j
    ways = None
    if verdict.in_wind is not None and not verdict.in_wind.wind.still:
        highest_m = max(home[2], return_amsl_m, *(leg.end[2] for leg in verdict.legs))
        ways = WaysHome(vehicle, verdict.in_wind.flies_in, (home[2], highest_m))

    def back_j(at: Place, speed_m_s: float, stands: bool) -> float:
        level = rule.level_amsl_m(return_amsl_m, at[2])
        down_m = max(level - home[2], 0.0)
        past_m = 0.0 if stands else detour_home_m(vehicle, vehicle.speed_max_m_s, at[2])
        air_m = way_m = flat_m(at, home) + past_m
        wind_m_s = 0.0
        if ways is not None:
            wind_m_s = ways.wind_m_s
            air_m, way_m = ways.longer_m(speed_home_m_s(vehicle, speed_m_s), offset_m(at, home), past_m)
        waits_j = energy.hold_w(wind_m_s) * vehicle.return_waits_s
        # The metres are the same with any base power; without one the time counts nothing.
        seconds = return_s(vehicle, way_m, level - at[2], down_m, speed_m_s) if energy.base_w else math.nan
        return energy.under_way_j(abs(level - at[2]) + down_m, air_m, seconds) + waits_j

    spent = along = most = 0.0
    most_at, most_m = verdict.legs[0].start, 0.0
    rows: list[LegBattery] = []
    short: list[tuple[float, float]] = []
    first: tuple[Place, float, int] | None = None
    for leg, skipped_j, skipped_m in flown(verdict.legs):
        if leg.kind == "rtl":
            break
        spent += skipped_j
        along += skipped_m
        hold_j = leg.hold_j
        way_j = leg.energy_j - hold_j - leg.lead_j
        ahead_j = spent + leg.lead_j
        stands = rule.climbs_first and leg.horizontal_m == 0.0

        def used(
            part: float, leg: LegFigures = leg, way_j: float = way_j, ahead_j: float = ahead_j, stands: bool = stands
        ) -> float:
            return ahead_j + part * way_j + back_j(place_on(leg.start, leg.end, part), leg.speed_m_s, stands)

        ends = [(0.0, used(0.0)), (1.0, used(1.0) + hold_j)]
        for part, j in ends:
            if j > most:
                most, most_at, most_m = j, on_globe(place_on(leg.start, leg.end, part)), along + part * leg.horizontal_m
        for a, b in _above(used, usable, ends[1][1] > usable):
            if first is None:
                first = (on_globe(place_on(leg.start, leg.end, a)), along + a * leg.horizontal_m, leg.seq)
            low, high = along + a * leg.horizontal_m, along + b * leg.horizontal_m
            if short and low <= short[-1][1] + 1e-6:
                short[-1] = (short[-1][0], max(short[-1][1], high))
            else:
                short.append((low, high))
        spent += leg.energy_j
        along += leg.horizontal_m
        back = back_j(leg.end, leg.speed_m_s, stands)
        rows.append(
            LegBattery(
                leg.seq, leg.kind, leg.energy_j, spent, back, 100.0 * spent / energy.battery_j,
                100.0 * (spent + back) / energy.battery_j,
            )
        )  # fmt: skip
    place, at_m, seq = first if first else (None, None, None)
    return BatteryHome(usable, energy.battery_j, most, most_at, most_m, place, at_m, seq, tuple(short), tuple(rows))


def flown(legs: Sequence[LegFigures]) -> Iterator[tuple[LegFigures, float, float]]:
    """Yield the legs as often as they are flown: neighbours with the same count n are flown n times as one group.

    Of more than `MOST_ROUNDS` the rounds before the last are left out; what they take, J and m, comes with the first
    leg of the last round, and is 0 with all others.
    """
    for times, group in groupby(legs, key=lambda leg: leg.times):
        run = list(group)
        round_j, round_m = math.fsum(leg.energy_j for leg in run), math.fsum(leg.horizontal_m for leg in run)
        rounds = min(times, MOST_ROUNDS)
        for k in range(rounds):
            skipped = times - rounds if k == rounds - 1 else 0
            for leg in run:
                yield leg, skipped * round_j, skipped * round_m
                skipped = 0


def _above(used: Callable[[float], float], usable: float, at_end: bool) -> list[tuple[float, float]]:
    """Parts of a leg on which the convex ``used`` exceeds ``usable``; ``at_end``: it does after the hold at the end."""
    before, after = used(0.0) > usable, used(1.0) > usable
    if not before and not after:
        return [(1.0, 1.0)] if at_end else []
    low = _least(used)
    if used(low) > usable:
        return [(0.0, 1.0)]
    out = []
    if before:
        out.append((0.0, _crossing(used, usable, 0.0, low)))
    if after or at_end:
        out.append((_crossing(used, usable, 1.0, low) if after else 1.0, 1.0))
    return out


def _least(used: Callable[[float], float]) -> float:
    """Where a convex function on [0, 1] has its minimum, by ternary search."""
    a, b = 0.0, 1.0
    for _ in range(HALVINGS):
        c, d = a + (b - a) / 3.0, b - (b - a) / 3.0
        a, b = (a, d) if used(c) <= used(d) else (c, b)
    return 0.5 * (a + b)


def _crossing(used: Callable[[float], float], usable: float, above: float, below: float) -> float:
    """Where ``used`` crosses ``usable`` between ``above`` and ``below``; on the safe side, so still above it."""
    for _ in range(HALVINGS):
        middle = 0.5 * (above + below)
        above, below = (middle, below) if used(middle) > usable else (above, middle)
    return above
