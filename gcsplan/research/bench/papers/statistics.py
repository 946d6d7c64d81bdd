"""Statistics of runs: rows of the tables, the rank test with its effect size, and IB-ABC's schedules.

In length and energy a run that breaks a limit under the exact check ranks behind every legal run, however short it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.research.bench.papers.runs import RunRecord

MEASURE_UNITS = {
    "length": "length, m", "energy": "energy, J", "cost": "cost", "cost, equal evaluations": "cost, equal evaluations",
    "time": "time, s", "iterations": "iterations to within 1 %", "collisions": "legs in collision", "pitch": "pitch, °",
    "yaw": "yaw, °",
}  # fmt: skip
_RECORD_KEYS = {
    "time": "time_s",
    "iterations": "converged",
    "collisions": "collisions",
    "pitch": "pitch_deg",
    "yaw": "yaw_deg",
}
_LEGAL_FIRST = {"length": "length_m", "energy": "energy_j"}


def legal(record: RunRecord) -> bool:
    """Whether the run found a path that passes the exact check."""
    return bool(record["status"] == "found" and record["violations"] == 0)


def values(records: Iterable[RunRecord], measure: str, evaluations: int = 0) -> Floats:
    """A number for each run, less is better: inf for a refusal, and for an illegal run's length or energy."""
    return np.array([_value(r, measure, evaluations) for r in records], dtype=np.float64)


def _value(record: RunRecord, measure: str, evaluations: int) -> float:
    if record["status"] != "found":
        return math.inf
    if measure == "cost, equal evaluations":
        history = record["history"]
        place = int(np.searchsorted(history["evaluations"], evaluations, side="right")) - 1
        found = None if place < 0 else history["cost"][place]
    elif measure == "cost":
        found = record["cost"]
    elif measure in _LEGAL_FIRST:
        found = record[_LEGAL_FIRST[measure]] if legal(record) else None
    else:
        found = record[_RECORD_KEYS[measure]]
    return math.inf if found is None else float(found)


def equal_evaluations(records: Iterable[RunRecord]) -> int:
    """The number of evaluations that every run has reached: the least of all runs."""
    return min((int(r["evaluations"]) for r in records if r["status"] == "found"), default=0)


def row(scenario: str, algorithm: str, records: Sequence[RunRecord], evaluations: int) -> dict[str, Any]:
    """A row of the table. Lengths, pitch, yaw and energy cover all runs, legal or not, as in the papers."""
    found = [r for r in records if r["status"] == "found"]
    out: dict[str, Any] = {
        "scenario": scenario,
        "algorithm": algorithm,
        "runs": len(records),
        "refused": len(records) - len(found),
        "legal": sum(map(legal, records)),
        "collided": sum(r["collisions"] > 0 for r in found),
        "collisions": sum(r["collisions"] for r in found),
    }
    for name, key in (
        ("length_m", "length_m"), ("cost", "cost"), ("energy_j", "energy_j"), ("evaluations", "evaluations"),
        ("pitch_deg", "pitch_deg"), ("yaw_deg", "yaw_deg"), ("nearest_m", "nearest_m"), ("converged", "converged"),
    ):  # fmt: skip
        numbers = np.array([r[key] for r in found if r[key] is not None], dtype=np.float64)
        out |= {f"{what}_{name}": value for what, value in _spread(numbers).items()}
    level = values(found, "cost, equal evaluations", evaluations)
    level = level[np.isfinite(level)]
    out["equal_evaluations"] = evaluations
    out["mean_cost_at_equal_evaluations"] = float(level.mean()) if len(level) else None
    out["best_legal_length_m"] = min((r["length_m"] for r in found if legal(r)), default=None)
    out["best_legal_energy_j"] = min((r["energy_j"] for r in found if legal(r)), default=None)
    parts = [r["lengths_m"] for r in found]
    out["vehicle_lengths_m"] = np.mean(parts, axis=0).tolist() if parts and len(parts[0]) > 1 else None
    return out


def time_row(scenario: str, algorithm: str, records: Sequence[RunRecord]) -> dict[str, Any]:
    """The processor's seconds of an algorithm's runs: the only numbers that differ from one benchmark to the next."""
    numbers = np.array([r["time_s"] for r in records if r["status"] == "found"], dtype=np.float64)
    spread = {f"{what}_time_s": value for what, value in _spread(numbers).items()}
    return {"scenario": scenario, "algorithm": algorithm, "runs": len(records), **spread}


def _spread(numbers: Floats) -> dict[str, float | None]:
    if not len(numbers):
        return dict.fromkeys(("best", "mean", "std", "median"))
    return {
        "best": float(numbers.min()),
        "mean": float(numbers.mean()),
        "std": float(numbers.std(ddof=1)) if len(numbers) > 1 else None,
        "median": float(np.median(numbers)),
    }


@dataclass(frozen=True, slots=True)
class ScheduleSlot:
    """Arrival time and speed of a vehicle; ``trouble`` is empty, or the reason why it cannot."""

    time_s: float
    speed_m_s: float
    trouble: str = ""


def schedule(
    lengths_m: Sequence[float], mode: str, interval_s: float, slowest_m_s: float, fastest_m_s: float
) -> list[ScheduleSlot]:
    """IB-ABC's arithmetic: v_i = L_i / T_i.

    ``together``: T is the longest path at full speed. ``sequence``: T_1 = L_1 / v_max, T_i = T_1 + interval·(i - 1).
    """
    if mode == "together":
        times = [max(lengths_m) / fastest_m_s] * len(lengths_m)
    else:
        times = [lengths_m[0] / fastest_m_s + interval_s * i for i in range(len(lengths_m))]
    out = []
    for length, t in zip(lengths_m, times, strict=True):
        speed = length / t
        trouble = ""
        if speed > fastest_m_s * (1.0 + 1e-9):
            trouble = f"faster than {fastest_m_s:g} m/s: the first must wait"
        elif speed < slowest_m_s:
            trouble = f"slower than {slowest_m_s:g} m/s"
        out.append(ScheduleSlot(t, speed, trouble))
    return out
