"""The table of all claims of the five papers, each once: "A has less of a measure than B in scenario S".

A claim follows from printed numbers (which is below which) where there are any. Claims from curves and sentences, which
a paper shows without numbers, are written out here. A scenario's twin and comparisons at equal evaluations are not
claims of their own: `judge` judges them beside the claim. Numbers of claims are stable, so one can cite them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from gcsplan.bench.papers.printed import PRINTED, faults, least_of
from gcsplan.bench.papers.scenarios import SCENARIOS, Paper, Scenario

KRILL_J_PER_M = (120.0, 100.0)
"""Joules for each metre up or down, and along: the krill paper's Table 1."""

MEASURES: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "krill": {"length_m": "length", "energy_j": "energy", "time_s": "time"},
        "ssgwo": {"mean_length_m": "length", "collisions": "collisions", "pitch_deg": "pitch", "yaw_deg": "yaw"},
        "msfoa": {"mean_cost": "cost"},
        "abo": {},
        "ib-abc": {"length_sum_m": "length"},
    }
)
"""By paper: printed measure to the measure of gcsplan that is ranked for it."""

RANKS_ITS_BASELINES = frozenset({"krill", "ib-abc"})
"""Papers whose text ranks the baselines among each other, too."""

SAME_RULE = "with α = β = 1, the paper's own choice, its method is the parrot optimizer itself"

CLAIMS_SHOWN: tuple[tuple[str, str, str, str, str, str], ...] = (
    *(
        (scenario, "iterations", low, high, f"fig. {figure}", "")
        for scenario, figure in (("krill-mound", 14), ("krill-forest", 16), ("krill-hills", 18))
        for low, high in (("krill", "abc"), ("abc", "aco"))
    ),
    ("abo", "cost", "abo", "pso", "fig. 5", ""),
    ("abo", "cost", "abo", "abo-1-2", "fig. 6", ""),
    ("abo", "cost", "abo", "abo-2-1", "fig. 6", ""),
    ("abo", "cost", "abo", "abo-2-2", "fig. 6", ""),
    ("abo", "cost", "abo", "po", "section 1", SAME_RULE),
    ("ib-abc-together", "length", "ib-abc", "gwo", "section 4.1", ""),
    ("ib-abc-sequence", "length", "ib-abc", "gwo", "section 4.2", ""),
)
"""Claims without numbers: scenario, measure, lower, higher, source, and why it is impossible (empty: it is not)."""


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim of a paper: in ``scenario`` the algorithm ``low`` has less of ``measure`` than ``high``.

    ``number`` names it ("krill-1"). ``printed``: the printed values of both, empty if the paper shows a curve only.
    ``impossible``: why the claim cannot be true as printed; empty if it can.
    """

    number: str
    paper: str
    scenario: str
    measure: str
    low: str
    high: str
    source: str
    printed: tuple[str, str] = ("", "")
    impossible: str = ""


def claims_of(paper: Paper) -> tuple[Claim, ...]:
    """All claims of a paper, in the order of its scenarios."""
    return tuple(claim for claim in CLAIMS if claim.paper == paper.name)


def printed_measures(scenario: str, algorithm: str) -> dict[str, float]:
    """The printed numbers, and the sum of a fleet's lengths."""
    row = {measure: number.value for measure, number in PRINTED.get((scenario, algorithm), {}).items()}
    lengths = [row[f"length_{i}_m"] for i in range(1, 5) if f"length_{i}_m" in row]
    if lengths:
        row["length_sum_m"] = sum(lengths)
    return row


def _from_numbers(scenario: Scenario) -> Iterator[tuple[str, str, str, str, tuple[str, str], str]]:
    """Measure, lower, higher, source, printed values and fault of each claim of the scenario's tables."""
    own = scenario.paper.contenders[0].name
    rows = {c.name: printed_measures(scenario.name, c.name) for c in scenario.paper.contenders}
    names = [name for name, row in rows.items() if row]
    pairs = [(own, rival) for rival in names if rival != own]
    if scenario.paper.name in RANKS_ITS_BASELINES:
        pairs += [(a, b) for i, a in enumerate(names) for b in names[i + 1 :] if own not in (a, b)]
    for printed, ours in MEASURES[scenario.paper.name].items():
        for a, b in pairs:
            x, y = rows[a].get(printed), rows[b].get(printed)
            if x is None or y is None or x == y:
                continue
            low, high = (a, b) if x < y else (b, a)
            words = tuple(_words(scenario.name, name, printed, rows[name][printed]) for name in (low, high))
            bad = [f"{name}: {why}" for name in (low, high) if (why := fault_of(scenario.name, name, printed))]
            yield ours, low, high, scenario.tables, (words[0], words[1]), "; ".join(bad)


def _words(scenario: str, algorithm: str, printed: str, value: float) -> str:
    number = PRINTED[scenario, algorithm].get(printed)
    return f"{value:.2f}" if number is None else number.text


def fault_of(scenario: str, algorithm: str, printed: str) -> str:
    """Why a printed value, or a part of a fleet's sum, is impossible; empty if it is not."""
    row = PRINTED[scenario, algorithm]
    bad = faults(row, least_of(scenario), *KRILL_J_PER_M)
    parts = [f"length_{i}_m" for i in range(1, 5)] if printed == "length_sum_m" else [printed]
    return ", ".join(f"{row[part].text}, but {bad[part]}" for part in parts if part in bad)


def _all() -> Iterator[Claim]:
    count: dict[str, int] = {}
    for scenario in SCENARIOS.values():
        if scenario.twin_of:
            continue
        paper = scenario.paper.name
        shown = [
            (measure, low, high, source, ("", ""), why)
            for place, measure, low, high, source, why in CLAIMS_SHOWN
            if place == scenario.name
        ]
        for measure, low, high, source, printed, why in (*_from_numbers(scenario), *shown):
            count[paper] = count.get(paper, 0) + 1
            yield Claim(f"{paper}-{count[paper]}", paper, scenario.name, measure, low, high, source, printed, why)


CLAIMS: tuple[Claim, ...] = tuple(_all())
"""Every claim of every paper."""
