"""The claims of the five papers, each judged once: as run here, at equal evaluations, in its twin, under each reading.

Two-sided Mann and Whitney's U on the runs, Holm-corrected over all claims of a paper within one column: the claims as
they stand, the claims at equal evaluations, the twins, and each reading are a column each. Times are judged apart,
because they differ from run to run.

`CLAIMS` has all claims, each once: "A has less of a measure than B in scenario S". A claim follows from printed numbers
(which is below which) where there are any. Claims from curves and sentences, which a paper shows without numbers, are
written out here. A scenario's twin and comparisons at equal evaluations are not claims of their own: `judge` judges
them beside the claim. Numbers of claims are stable, so one can cite them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.measure import LEAST_RUNS_TO_JUDGE, SIGNIFICANCE, compare, holm
from gcsplan.research.bench.papers.printed import PRINTED, faults, least_of
from gcsplan.research.bench.papers.runs import OPTIMA, RunRecord
from gcsplan.research.bench.papers.scenarios import SCENARIOS, Paper, Scenario, readings_of
from gcsplan.research.bench.papers.statistics import MEASURE_UNITS, equal_evaluations, values

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


HOLDS, TIE, REVERSED, IMPOSSIBLE_AS_PRINTED = "holds", "tie", "reversed", "impossible as printed"
TOO_FEW_RUNS, NO_LEGAL, NOT_RUN = "too few runs to tell", "no legal run", "not run"
CLOCKED = frozenset({"time"})
"""Measures that a clock gives."""

Comparison = dict[str, Any]
Runs = Mapping[tuple[str, str], Sequence[RunRecord]]


def judge(scenarios: Sequence[Scenario], runs: Runs) -> dict[str, list[dict[str, Any]]]:
    """``claims``, ``times`` (claims on measured time) and ``readings`` of all papers; ``runs`` by scenario and
    algorithm. Claims of which nothing was run are left out."""
    there = {scenario.name for scenario in scenarios}
    papers = dict.fromkeys(scenario.paper.name for scenario in scenarios)
    of = {scenario.paper.name: scenario.paper for scenario in scenarios}
    out: dict[str, list[dict[str, Any]]] = {"claims": [], "times": [], "readings": []}
    for name in papers:
        claims = [c for c in claims_of(of[name]) if there & {c.scenario, _twin(c.scenario)}]
        plain = [c for c in claims if c.measure not in CLOCKED]
        out["claims"] += _judged(plain, runs)
        out["times"] += _judged([c for c in claims if c.measure in CLOCKED], runs, brief=True)
        for reading in readings_of(name):
            cells = [
                (c, _cell(c, runs, c.scenario, reading.stands_for(c.low), reading.stands_for(c.high)))
                for c in plain
                if reading.changes.keys() & {c.low, c.high}
            ]
            done = [(c, cell) for c, cell in cells if cell["ranking"] != NOT_RUN]
            _correct([cell for _, cell in done])
            out["readings"] += [
                {"claim": c.number, "scenario": c.scenario, "measure": MEASURE_UNITS[c.measure],
                 "words": f"{c.low} < {c.high}", "reading": reading.name, "what": reading.what, **cell}
                for c, cell in done
            ]  # fmt: skip
    return out


def _judged(claims: Sequence[Claim], runs: Runs, *, brief: bool = False) -> list[dict[str, Any]]:
    """Rows of a table of claims; ``brief``: without equal evaluations and twins."""
    columns = {"": [_cell(c, runs, c.scenario, c.low, c.high) for c in claims]}
    if not brief:
        columns["equal_"] = [_equal(c, runs) for c in claims]
        columns["twin_"] = [_cell(c, runs, _twin(c.scenario), c.low, c.high) for c in claims]
    for cells in columns.values():
        _correct(cells)
    rows = []
    for k, c in enumerate(claims):
        beside = {prefix: column[k] for prefix, column in columns.items()}
        if all(cell["ranking"] == NOT_RUN for cell in beside.values()):
            continue
        row: dict[str, Any] = {
            "claim": c.number, "paper": c.paper, "scenario": c.scenario, "measure": MEASURE_UNITS[c.measure],
            "words": f"{c.low} < {c.high}", "source": c.source, "printed_low": c.printed[0],
            "printed_high": c.printed[1], "verdict": IMPOSSIBLE_AS_PRINTED if c.impossible else beside[""]["ranking"],
            "impossible": c.impossible,
        }  # fmt: skip
        for prefix, cell in beside.items():
            row |= {f"{prefix}{key}": value for key, value in cell.items()}
        rows.append(row)
    return rows


def _twin(scenario: str) -> str:
    """The scenario that is this one's twin; empty if it has none."""
    return next((s.name for s in SCENARIOS.values() if s.twin_of == scenario), "")


def _equal(claim: Claim, runs: Runs) -> Comparison:
    """The claim at equal evaluations: the cost after as many as the shorter of both searches has made."""
    both = [runs.get((claim.scenario, name), ()) for name in (claim.low, claim.high)]
    if claim.measure not in ("length", "cost") or not all(both):
        return _empty(NOT_RUN)
    level = equal_evaluations(r for some in both for r in some)
    if level == max((int(r.get("evaluations", 0)) for some in both for r in some), default=0):
        return _empty("")  # they are equal already
    return _compared(*(values(some, "cost, equal evaluations", level) for some in both)) | {"evaluations": level}


def _cell(claim: Claim, runs: Runs, scenario: str, low: str, high: str) -> Comparison:
    both = [runs.get((scenario, name), ()) for name in (low, high) if name not in OPTIMA]
    if not all(both):
        return _empty(NOT_RUN)
    return _compared(*(values(some, claim.measure) for some in both))


def _empty(ranking: str) -> Comparison:
    return {"runs": 0, "median_low": None, "median_high": None, "p": None, "effect": None, "ranking": ranking}


def _compared(low: Floats, high: Floats) -> Comparison:
    """A comparison with its raw p; `_correct` sets the ranking."""
    cell = _empty("")
    cell["runs"] = min(len(low), len(high))
    for key, numbers in (("median_low", low), ("median_high", high)):
        middle = float(np.median(numbers))
        cell[key] = middle if math.isfinite(middle) else None
    if cell["runs"] < LEAST_RUNS_TO_JUDGE:
        cell["ranking"] = TOO_FEW_RUNS
    elif not (np.isfinite(low).any() or np.isfinite(high).any()):
        cell["ranking"] = NO_LEGAL
    else:
        cell["p"], cell["effect"] = compare(low, high)
    return cell


def _correct(cells: Sequence[Comparison]) -> None:
    """Correct p over the column and set the rankings, in place."""
    tested = [cell for cell in cells if cell["p"] is not None]
    for cell, p in zip(tested, holm([cell["p"] for cell in tested]), strict=True):
        cell["p"] = p
        cell["ranking"] = TIE if p >= SIGNIFICANCE else HOLDS if cell["effect"] > 0.5 else REVERSED


def standing(judged: Mapping[str, Sequence[Mapping[str, Any]]], paper: str) -> Iterator[str]:
    """The standing of a paper, in sentences: each measure with the claims that hold, tie and are reversed; then the
    changes by each reading."""
    claims = {c["claim"]: c for c in judged["claims"] if c["paper"] == paper}
    ranked = [c for c in claims.values() if c["ranking"] in _RANKING_WORDS]
    if not ranked:
        yield f"Rankings are judged from {LEAST_RUNS_TO_JUDGE} runs on: too few were made."
        return
    count = Counter(c["verdict"] for c in claims.values())
    yield (
        f"{len(claims)} claims: holds {count[HOLDS]}, reversed {count[REVERSED]}, no difference {count[TIE]}, "
        f"impossible as printed {count[IMPOSSIBLE_AS_PRINTED]}."
    )
    for measure in dict.fromkeys(c["measure"] for c in ranked):
        parts = []
        for ranking, word in _RANKING_WORDS.items():
            places: dict[str, list[str]] = {}
            for c in ranked:
                if c["measure"] == measure and c["ranking"] == ranking:
                    places.setdefault(c["words"], []).append(c["scenario"].removeprefix(f"{paper}-"))
            if places:
                parts.append(f"{word}: " + "; ".join(f"{w} ({', '.join(at)})" for w, at in places.items()))
        yield f"{measure.capitalize()}, as run here. " + ". ".join(parts) + "."
    for name in dict.fromkeys(r["reading"] for r in judged["readings"] if r["claim"] in claims):
        yield _changed(name, [r for r in judged["readings"] if r["reading"] == name and r["claim"] in claims], claims)


_RANKING_WORDS = {HOLDS: "Holds", REVERSED: "Reversed", TIE: "No difference"}


def _changed(name: str, cases: Sequence[Mapping[str, Any]], claims: Mapping[str, Mapping[str, Any]]) -> str:
    """Which claims of a paper come out differently under a reading."""
    changes: dict[tuple[str, str], list[str]] = {}
    for case in cases:
        before, now = claims[case["claim"]]["ranking"], case["ranking"]
        if before != now and {before, now} <= _RANKING_WORDS.keys():
            changes.setdefault((before, now), []).append(case["claim"])
    words = "; ".join(
        f"from “{_RANKING_WORDS[before].lower()}” to “{_RANKING_WORDS[now].lower()}”: {', '.join(which)}"
        for (before, now), which in changes.items()
    )
    changed = sum(map(len, changes.values()))
    return f"The reading {name} ({cases[0]['what']}) changes {changed} of {len(cases)} claims" + (
        f", {words}." if words else "."
    )
