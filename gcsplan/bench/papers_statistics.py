"""Statistics of runs: rows of the tables, the papers' rankings under a rank test, and IB-ABC's schedules.

Rankings are tested by Mann and Whitney's U on runs, one-sided, and corrected by Holm over all claims of a paper. A run
that breaks a limit under the exact check ranks behind every legal run, however short it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.papers_runs import OPTIMA, Record
from gcsplan.bench.papers_scenarios import Claim, Scenario, claims_of

LEAST_RUNS_TO_JUDGE = 30
SIGNIFICANCE = 0.05
REPRODUCED, NOT, FEW, NO_LEGAL = (
    "reproduced", "not reproduced", "too few runs to tell", "no run breaks no limit: nothing to rank"
)  # fmt: skip

UNITS = {
    "length": "length, m", "energy": "energy, J", "cost": "cost", "cost, equal evaluations": "cost, equal evaluations",
    "time": "time, s", "iterations": "iterations to within 1 %", "collisions": "legs in collision", "pitch": "pitch, °",
    "yaw": "yaw, °",
}  # fmt: skip
_PLAIN = {
    "time": "time_s",
    "iterations": "converged",
    "collisions": "collisions",
    "pitch": "pitch_deg",
    "yaw": "yaw_deg",
}
_LEGAL_FIRST = {"length": "length_m", "energy": "energy_j"}


def legal(record: Record) -> bool:
    """Whether the run found a path that passes the exact check."""
    return bool(record["status"] == "found" and record["violations"] == 0)


def values(records: Iterable[Record], measure: str, evaluations: int = 0) -> Floats:
    """A number for each run, less is better: inf for a refusal, and for an illegal run's length or energy."""
    return np.array([_value(r, measure, evaluations) for r in records], dtype=np.float64)


def _value(record: Record, measure: str, evaluations: int) -> float:
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
        found = record[_PLAIN[measure]]
    return math.inf if found is None else float(found)


def less(low: Floats, high: Floats) -> float:
    """p of "``low`` is not less than ``high``" by Mann and Whitney's U (normal approximation, corrected for ties)."""
    from scipy.stats import mannwhitneyu, rankdata

    ranks = rankdata(np.concatenate([low, high]))  # infinities tie with each other
    if np.ptp(ranks) == 0.0:
        return 1.0
    return float(mannwhitneyu(ranks[: len(low)], ranks[len(low) :], alternative="less", method="asymptotic").pvalue)


def holm(p: Sequence[float]) -> list[float]:
    """Holm's step-down correction."""
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given, kind="stable")
    steps = np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1))
    out = np.empty_like(given)
    out[order] = np.minimum(steps, 1.0)
    return [float(x) for x in out]


def equal_evaluations(records: Iterable[Record]) -> int:
    """The number of evaluations that every run has reached: the least of all runs."""
    return min((int(r["evaluations"]) for r in records if r["status"] == "found"), default=0)


def judge(scenarios: Sequence[Scenario], runs: Mapping[tuple[str, str], Sequence[Record]]) -> list[dict[str, Any]]:
    """Every claim of the papers on what was run, reproduced or not; ``runs`` by scenario and algorithm."""
    out: list[dict[str, Any]] = []
    for scenario in scenarios:
        here = {name: found for (place, name), found in runs.items() if place == scenario.name and name not in OPTIMA}
        level = equal_evaluations(r for found in here.values() for r in found)
        for claim in claims_of(scenario):
            if claim.low in here and claim.high in here:
                out.append(_case(scenario, claim, here, level))
                most = max(int(r.get("evaluations", 0)) for name in (claim.low, claim.high) for r in here[name])
                if claim.measure in ("length", "cost") and most > level:
                    again = Claim("cost, equal evaluations", claim.low, claim.high, claim.source)
                    out.append(_case(scenario, again, here, level))
    for paper in dict.fromkeys(case["paper"] for case in out):
        tested = [case for case in out if case["paper"] == paper and case["p"] is not None]
        for case, p in zip(tested, holm([case["p"] for case in tested]), strict=True):
            case["p"] = p
            case["verdict"] = REPRODUCED if p < SIGNIFICANCE else NOT
    return out


def _case(
    scenario: Scenario, claim: Claim, here: Mapping[str, Sequence[Record]], evaluations: int
) -> dict[str, Any]:  # p is corrected, and the verdict set, when all claims of the paper are there
    low, high = (values(here[name], claim.measure, evaluations) for name in (claim.low, claim.high))
    p, verdict = None, ""
    if min(len(low), len(high)) < LEAST_RUNS_TO_JUDGE:
        verdict = FEW
    elif not (np.isfinite(low).any() or np.isfinite(high).any()):
        verdict = NO_LEGAL
    else:
        p = less(low, high)
    middle = [float(np.median(x)) for x in (low, high)]
    return {
        "paper": scenario.paper.name,
        "scenario": scenario.name,
        "measure": UNITS[claim.measure],
        "claim": f"{claim.low} < {claim.high}",
        "source": claim.source,
        "runs": min(len(low), len(high)),
        "median_low": middle[0] if math.isfinite(middle[0]) else None,
        "median_high": middle[1] if math.isfinite(middle[1]) else None,
        "p": p,
        "verdict": verdict,
    }


def row(scenario: str, algorithm: str, records: Sequence[Record], evaluations: int) -> dict[str, Any]:
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
        ("length_m", "length_m"), ("cost", "cost"), ("energy_j", "energy_j"), ("time_s", "time_s"),
        ("evaluations", "evaluations"), ("pitch_deg", "pitch_deg"), ("yaw_deg", "yaw_deg"), ("nearest_m", "nearest_m"),
        ("converged", "converged"),
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
class Slot:
    """Arrival time and speed of a vehicle; ``trouble`` is empty, or the reason why it cannot."""

    time_s: float
    speed_m_s: float
    trouble: str = ""


def schedule(
    lengths_m: Sequence[float], mode: str, interval_s: float, slowest_m_s: float, fastest_m_s: float
) -> list[Slot]:
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
        out.append(Slot(t, speed, trouble))
    return out
