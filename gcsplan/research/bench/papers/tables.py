"""Tables of the papers' reports, plain cells under a heading: claims, readings, times; and in words what stands."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gcsplan.bench.measure import LEAST_RUNS_TO_JUDGE, SIGNIFICANCE
from gcsplan.research.bench.papers.judge import (
    HOLDS,
    IMPOSSIBLE_AS_PRINTED,
    NO_LEGAL,
    NOT_RUN,
    REVERSED,
    TIE,
    TOO_FEW_RUNS,
    standing,
)
from gcsplan.research.bench.papers.printed import PRINTED
from gcsplan.research.bench.papers.scenarios import SCENARIOS

ClaimRows = Sequence[Mapping[str, Any]]
METHOD = (
    "Two-sided Mann and Whitney's U, Holm-corrected over all claims of a paper within each column (as run, at equal "
    f"evaluations, twin, each reading); {HOLDS} and {REVERSED} need p < {SIGNIFICANCE:g}, {TIE} means that no "
    "difference is shown. A is the probability that a run of the claim's better one is really better, with 0.5 for "
    "a tie: 0.5 is no difference, 1 is always. Runs that break a limit rank last in length and energy (“illegal”: half "
    "of the runs or more)."
)
IMPOSSIBLE_MEANS = (
    f"“{IMPOSSIBLE_AS_PRINTED}”: a printed number that the claim rests on is below the physical minimum, or the two "
    "methods are one; how the ranking comes out here stands beside it."
)


@dataclass(frozen=True, slots=True)
class PaperTable:
    """Plain cells under a heading, with notes."""

    heading: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]]
    notes: list[str] = field(default_factory=list)

    def markdown(self) -> Iterator[str]:
        """The cells and notes as lines of Markdown, without the heading."""
        yield f"| {' | '.join(self.header)} |"
        yield f"| {' | '.join('---' if k == 0 else '---:' for k in range(len(self.header)))} |"
        for row in self.rows:
            yield f"| {' | '.join(row)} |"
        yield ""
        for note in self.notes:
            yield f"- {note}"
        yield ""

    def html(self) -> Iterator[str]:
        """The cells and notes as lines of HTML, without the heading."""
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.header)
        yield f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>'
        for row in self.rows:
            yield f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>"
        yield "</tbody></table></div><ul>"
        for note in self.notes:
            yield f"<li>{html.escape(note)}</li>"
        yield "</ul>"


def significant(value: float | None) -> str:
    """A number with five digits or more, so that a cost of any size can be read."""
    if value is None:
        return "–"
    whole = len(str(int(abs(value)))) if abs(value) >= 1.0 else 0
    return f"{value:,.{max(0, 5 - whole)}f}"


def _median(value: float | None) -> str:
    return "illegal" if value is None else significant(value)


def _p(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}"


def _effect(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _numbers(case: Mapping[str, Any]) -> tuple[str, ...]:
    medians = (case["median_low"], case["median_high"])
    return (*map(_median, medians), _p(case["p"]), _effect(case["effect"]))


def claims_table(claims: ClaimRows, heading: str = "Claims") -> PaperTable:
    """Every claim once, with its verdict; at equal evaluations and in the twin where there is one."""
    header = ["claim", "scenario", "printed in", "measure", "says", "printed", "median", "against", "p", "A", "here",
              "verdict"]  # fmt: skip
    wide = any("equal_ranking" in c for c in claims)
    header += ["equal evaluations", "twin"] if wide else []
    rows = []
    for c in claims:
        printed = f"{c['printed_low']} < {c['printed_high']}" if c["printed_low"] else "a curve"
        cells = (c["claim"], c["scenario"], c["source"], c["measure"], c["words"], printed, *_numbers(c), c["ranking"])
        beside = (_beside(c, "equal_"), _beside(c, "twin_")) if wide else ()
        rows.append((*cells, c["verdict"], *beside))
    bad = [f"{c['claim']}: {c['impossible']}." for c in claims if c["impossible"]]
    return PaperTable(heading, tuple(header), rows, [METHOD, IMPOSSIBLE_MEANS, *counts(claims), *bad])


def _beside(claim: Mapping[str, Any], prefix: str) -> str:
    ranking = claim[f"{prefix}ranking"]
    if ranking in ("", NOT_RUN):
        return "–"
    p = claim[f"{prefix}p"]
    return ranking if p is None else f"{ranking} (p {p:.2g}, A {claim[f'{prefix}effect']:.2f})"


def readings_table(readings: ClaimRows) -> PaperTable:
    """Claims judged once more under each reading that changes one of their algorithms."""
    header = ("claim", "scenario", "measure", "says", "reading", "median", "against", "p", "A", "here")
    rows = [
        (r["claim"], r["scenario"], r["measure"], r["words"], r["reading"], *_numbers(r), r["ranking"])
        for r in readings
    ]
    what = dict.fromkeys(f"{r['reading']}: {r['what']}." for r in readings)
    return PaperTable("Readings", header, rows, list(what))


def times_tables(times: Mapping[str, ClaimRows]) -> Iterator[PaperTable]:
    """All that a clock has measured: seconds of each algorithm, and the claims on time."""
    rows = []
    for row in times["rows"]:
        printed = PRINTED.get((row["scenario"], row["algorithm"]), {}).get("time_s")
        words = tuple("–" if row[f"{k}_time_s"] is None else f"{row[f'{k}_time_s']:.3f}" for k in ("median", "mean"))
        rows.append((row["scenario"], row["algorithm"], *words, "–" if printed is None else printed.text))
    header = ("scenario", "algorithm", "median, CPU s", "mean, CPU s", "printed, s")
    yield PaperTable("Times", header, rows, ["These numbers, and no others, differ from one benchmark to the next."])
    if times["claims"]:
        yield claims_table(times["claims"], "Claims on time")


def counts(claims: ClaimRows) -> list[str]:
    """How many claims of each paper have which verdict, in words."""
    out = []
    order = (HOLDS, TIE, REVERSED, IMPOSSIBLE_AS_PRINTED, NO_LEGAL, TOO_FEW_RUNS, NOT_RUN)
    for paper in dict.fromkeys(c["paper"] for c in claims):
        count = Counter(c["verdict"] for c in claims if c["paper"] == paper)
        verdicts = ", ".join(f"{count[verdict]} {verdict}" for verdict in order if count[verdict])
        total = sum(count.values())
        out.append(f"{paper}: {total} claim{'' if total == 1 else 's'}, {verdicts}.")
    if any(c.get(f"{prefix}ranking") == TOO_FEW_RUNS for c in claims for prefix in ("", "equal_", "twin_")):
        out.append(f"Rankings are judged from {LEAST_RUNS_TO_JUDGE} runs on.")
    return out


def stands(result: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Title of each paper, and its standing in sentences."""
    titles = {s.paper.name: s.paper.title for s in SCENARIOS.values()}
    for paper in dict.fromkeys(s["paper"] for s in result["scenarios"]):
        yield f"{paper}: {titles[paper]}", list(standing(result, paper))
