"""The battery along a mission whose returns join it: what was spent so far, plus the longest way to the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.battery import BatteryHome, LegBattery
from gcsplan.check.returns.trace import MissionTrace, TraceParts
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.vehicle import Vehicle


def battery_by_mission(
    trace: MissionTrace, parts: TraceParts, back_j: Floats, verdict: Verdict, vehicle: Vehicle
) -> BatteryHome | None:
    """The energy spent so far plus the return, from every part; None if the capacity is not given."""
    energy = vehicle.energy
    if energy.battery_j is None or not verdict.legs or not len(parts):
        return None
    usable = (1.0 - energy.reserve) * energy.battery_j
    legs = [leg for leg in verdict.legs if leg.kind != "rtl"]
    along, spent, ends = _spent(legs)
    at = trace.points(parts.end)[:, 3]
    after = np.minimum(np.searchsorted(along, at + 0.01, "right"), len(along) - 1)
    run = np.maximum(along[after] - along[after - 1], 1e-9)
    share = np.clip((at - along[after - 1]) / run, 0.0, 1.0)
    lead = _lead(legs, len(along))[after]
    used = spent[after - 1] + lead + share * (spent[after] - spent[after - 1] - lead) + back_j
    begin = trace.points(parts.start)[:, 3]
    short: list[tuple[float, float]] = []
    over = np.flatnonzero(used > usable)
    for a, b in zip(begin[over].tolist(), at[over].tolist(), strict=True):
        if short and a <= short[-1][1] + 1e-6:
            short[-1] = short[-1][0], max(short[-1][1], b)
        else:
            short.append((a, b))
    most, first = int(used.argmax()), int(over[0]) if len(over) else None
    rows = []
    for leg, end_m, so_far in zip(legs, along[ends].tolist(), spent[ends].tolist(), strict=True):
        back = float(back_j[int(np.abs(at - end_m).argmin())])
        rows.append(
            LegBattery(
                leg.seq, leg.kind, leg.energy_j, so_far, back, 100.0 * so_far / energy.battery_j,
                100.0 * (so_far + back) / energy.battery_j,
            )
        )  # fmt: skip
    return BatteryHome(
        usable, energy.battery_j, float(used[most]), trace.place(float(parts.end[most])), float(at[most]),
        None if first is None else trace.place(float(parts.start[first])),
        None if first is None else float(begin[first]),
        None if first is None else int(trace.seq[parts.stretch[first]]), tuple(short), tuple(rows),
    )  # fmt: skip


def _lead(legs: Sequence[LegFigures], count: int) -> Floats:
    """(count,) `LegFigures.lead_j` of the leg that ends at each place of `_spent`; 0 where a group begins."""
    out = []
    for _, group in groupby(legs, key=lambda leg: leg.times):
        out += [0.0, *(leg.lead_j for leg in group)]
    return np.array([0.0, *out][:count])


def _spent(legs: Sequence[LegFigures]) -> tuple[Floats, Floats, list[int]]:
    """Horizontal metres along the mission, and the energy spent there at most, J; and the index of each leg's end.

    Legs that are flown several times count once along the mission: there the last round is meant.
    """
    along, spent, ends = [0.0], [0.0], []
    for times, group in groupby(legs, key=lambda leg: leg.times):
        run = list(group)
        along.append(along[-1])
        spent.append(spent[-1] + (times - 1) * math.fsum(leg.energy_j for leg in run))
        for leg in run:
            along.append(along[-1] + leg.horizontal_m)
            spent.append(spent[-1] + leg.energy_j)
            ends.append(len(along) - 1)
    return np.array(along), np.array(spent), ends
