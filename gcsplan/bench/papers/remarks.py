"""Remarks on the papers' printed tables, each computed from the table's own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

from gcsplan.bench.papers.printed import PRINTED, PrintedNumber, PrintedRow
from gcsplan.bench.papers.scenarios import SCENARIOS, ReadyScenario
from gcsplan.bench.papers.statistics import schedule

_SAME_RATIO = 5e-4


def remarks(scenario: str) -> list[str]:
    """Sentences on the printed tables of a scenario, and on how it is run here."""
    paper = SCENARIOS[scenario].paper
    rows = {c.name: PRINTED[scenario, c.name] for c in paper.contenders if (scenario, c.name) in PRINTED}
    if paper.name == "krill":
        return _krill(rows)
    if paper.name == "ssgwo":
        twin = scenario.endswith("-tall")
        how = "unlimited, as a plan view has them" if twin else "as high as printed, so that they may be overflown"
        return [f"The cylinders are {how}. Printed collisions are of 50 runs."]
    if paper.name == "msfoa":
        return _msfoa(rows)
    if paper.name == "abo":
        return [
            "The paper prints no numbers and draws its peaks at random: these are ours. Its best choice α = β = 1 is "
            "the parrot optimizer, so abo and po do the same; abo-α-β are the other choices of its fig. 6.",
        ]
    return [
        "The terrain is not given: ours. Each vehicle is planned alone; of the arrival only the schedule's arithmetic "
        "stands here, and no separation between vehicles is planned or judged.",
    ]


def _krill(rows: dict[str, PrintedRow]) -> list[str]:
    every = [row for (_, _), row in PRINTED.items() if "energy_j" in row]
    ratios = [row["energy_j"].value / row["length_m"].value for row in every]
    common = max(ratios, key=lambda r: sum(abs(x - r) < _SAME_RATIO * r for x in ratios))
    same = sum(abs(x - common) < _SAME_RATIO * common for x in ratios)
    own = rows["krill"]["energy_j"].value
    saved = ", ".join(
        f"{100.0 * (1.0 - own / row['energy_j'].value):.1f} % against {name}"
        for name, row in rows.items()
        if name != "krill"
    )
    return [
        f"Of the paper's {len(ratios)} printed energies {same} are {common:.2f} J/m times the printed length, whatever "
        "the climb; Table 1's 120 J/m up or down and 100 J/m along give many times more even for the straight line.",
        f"Printed energy saved here by krill: {saved}.",
    ]


def _msfoa(rows: dict[str, PrintedRow]) -> list[str]:
    out = [
        "The paper shows its scenarios as pictures only: terrain, threats, starts and goal are ours, so its costs "
        "cannot be compared with ours, only rankings can. Vehicles are planned one by one in the order of priority, "
        "each keeping away from those before it within its cost; no exact check of the separation is made here.",
    ]
    sums = {
        name: round(sum(row[f"best_cost_{i}"].value for i in (1, 2, 3)), 2) for name, row in rows.items()
    }  # Table 2 is printed to 0.01
    wrong = [name for name, row in rows.items() if abs(sums[name] - row["best_cost_sum"].value) > 0.02]
    if wrong:
        words = ", ".join(f"{name} {sums[name]:.2f} (printed {rows[name]['best_cost_sum'].text})" for name in wrong)
        ranking = " < ".join(f"{name} {sums[name]:.2f}" for name in sorted(sums, key=lambda n: sums[n])[:3])
        out.append(f"Table 2's rows do not add up to its sums: {words}. By its rows the best three are {ranking}.")
    for a, b in combinations(rows, 2):
        if all(rows[a][k].text == rows[b][k].text for k in ("best_cost", "mean_cost", "median_cost")):
            out.append(f"Table 3's rows of {a} and {b} are identical.")
    return out


def schedules(summary: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows of IB-ABC's schedule, by the measured and the printed lengths; no rows for other papers."""
    header = (
        "algorithm", "vehicle", "L, m", "T, s", "v = L/T, m/s", "", "printed L, m", "its T, s", "its v, m/s",
        "printed T, s", "printed v, m/s",
    )  # fmt: skip
    ready: ReadyScenario = summary["set"]
    arrival = ready.source.arrival
    if summary["paper"] != "ib-abc" or arrival is None:
        return header, []
    vehicle = ready.source.vehicles[0].vehicle
    told = (arrival.mode, arrival.interval_s, vehicle.speed_min_m_s, vehicle.speed_max_m_s)
    out: list[tuple[str, ...]] = []
    for row in summary["rows"]:
        lengths = row["vehicle_lengths_m"]
        printed = summary["printed"].get(row["algorithm"])
        ours = None if lengths is None else schedule(lengths, *told)
        count = len(ready.problems)
        theirs = None if printed is None else [printed[f"length_{i}_m"].value for i in range(1, count + 1)]
        right = None if theirs is None else schedule(theirs, *told)
        # The printed lengths are rounded, so the results that follow from them have a tolerance.
        off_m = 0.0 if printed is None else max(printed[f"length_{i}_m"].half_unit for i in range(1, count + 1))
        off_s = off_m / vehicle.speed_max_m_s
        for i, request in enumerate(ready.source.vehicles):
            cells = [row["algorithm"], request.vehicle.name]
            if ours is None or lengths is None:
                cells += ["–", "–", "–", "refused"]
            else:
                cells += [f"{lengths[i]:.2f}", f"{ours[i].time_s:.3f}", f"{ours[i].speed_m_s:.3f}", ours[i].trouble]
            if right is None or printed is None:
                cells += ["–"] * 5
            else:
                v = right[i].speed_m_s
                cells += [
                    printed[f"length_{i + 1}_m"].text,
                    f"{right[i].time_s:.3f}",
                    f"{v:.3f}",
                    _against(printed[f"time_{i + 1}_s"], right[i].time_s, off_s),
                    _against(printed[f"speed_{i + 1}_m_s"], v, (off_m + v * off_s) / right[i].time_s),
                ]
            out.append(tuple(cells))
    return header, out


def _against(printed: PrintedNumber, right: float, tolerance: float) -> str:
    """The printed number, marked if the arithmetic does not round to it."""
    off = printed.below(right - tolerance) or printed.above(right + tolerance)
    return f"{printed.text} ≠" if off else printed.text


def legend(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """The meaning of the marks in a schedule, if it has any."""
    if not any("≠" in cell for row in rows for cell in row):
        return []
    return ["≠ not what T and v = L/T are by the paper's own rule from its own printed lengths (“its T”, “its v”)."]
