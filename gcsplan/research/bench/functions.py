"""SSGWO's tables 1 and 2 run again: nine functions, five kinds of grey wolf, beside the printed numbers.

There are two settings. *Middle*: the optimum is in the middle of the box, and the wolves' rule is bound to the same
point (origin 0.5), which is what table 2 measured. *Shifted*: the same rule with the optimum moved, so that a rule
loses that advantage. A result of 0 in the middle is less than the unit box resolves near 0.5, where doubles
are 1e−16 apart: about 1e−26 on f1. Rankings of such values count neither as reproduced nor as not reproduced.

Every algorithm starts from the same population in the same run, so runs are compared in pairs.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.app.parallel.executor import executor
from gcsplan.arrays import Floats
from gcsplan.bench.files import write_all
from gcsplan.bench.measure import LEAST_RUNS_TO_JUDGE, MOST_RUNS, SIGNIFICANCE, holm
from gcsplan.errors import InputError
from gcsplan.export.table import csv_of
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.optimisers.functions import FUNCTIONS
from gcsplan.research.optimisers.registry import get

WOLVES = ("gwo", "mgwo", "igwo", "sogwo", "ssgwo")
PAPER_RUNS = 50

# Table 2 of Feng et al. 2024 (Electronics 13, 68) as printed; columns in the order of WOLVES.
_TABLE_2 = """
f1 mean  3.2532e-26 3.5394e-196  2.8327e-28  3.3227e-76           0
f1 std   1.3267e-26 2.8467e-198  3.2597e-29 2.79548e-78 2.6741e-199
f1 best  4.4327e-30           0  1.3879e-32  1.3261e-80 1.1349e-199
f2 mean  3.2671e-13  1.5371e-77  3.1679e-19  1.8342e-65  1.1463e-85
f2 std   3.2481e-14  2.6137e-78  3.2467e-20  2.8643e-68  2.7239e-86
f2 best  2.2738e-15  1.3367e-80  3.2497e-23  2.1973e-70  1.2371e-87
f3 mean   2.8237e01   2.7136e01   2.4837e01   2.5197e01   2.0637e01
f3 std   2.2537e-01  6.2276e-01  2.6927e-01  2.4977e-01  4.1876e-02
f3 best  2.6192e-01  4.7431e-01  4.4293e-01  2.3291e-01  2.4037e-02
f4 mean  2.6217e-06  5.2739e-90  3.3392e-46  3.5731e-96           0
f4 std   3.5127e-06  3.2267e-90  1.9643e-45  4.3797e-98           0
f4 best  6.1837e-07  1.6239e-91  1.7234e-48 2.7944e-101           0
f5 mean  2.7945e-07 3.3754e-160  2.2738e-04 1.7322e-106 2.7254e-178
f5 std   2.8153e-06 4.7687e-161  3.7327e-04 2.7528e-107 3.3784e-180
f5 best  4.1687e-08           0  1.7822e-06 4.2975e-109 4.8374e-181
f6 mean  1.4687e-03  1.7225e-04  1.2769e-04  3.6728e-04  2.9271e-05
f6 std   1.3573e-03  1.2539e-04  1.2677e-04  3.7392e-05  3.2795e-05
f6 best  2.6874e-04  7.1783e-05  2.5723e-05  1.5973e-05  5.3764e-06
f7 mean  2.1733e-09           0  4.3651e-12  1.8327e-45           0
f7 std   4.2734e-08           0  5.7532e-13  4.3687e-46           0
f7 best           0           0           0           0           0
f8 mean  1.2764e-13  3.9763e-15  2.3715e-14  3.7941e-18           0
f8 std   1.4791e-14  5.7219e-15  3.7912e-15  2.7646e-18           0
f8 best  2.5794e-14  2.4564e-16  1.3741e-14           0           0
f9 mean  3.7911e-04           0  7.7497e-04           0           0
f9 std   2.3257e-03           0  5.4259e-04           0           0
f9 best           0           0  2.7491e-05           0           0
"""


@dataclass(frozen=True, slots=True)
class PrintedWolf:
    """Mean, standard deviation and best of 50 runs, as printed."""

    mean: float
    std: float
    best: float

    @property
    def fault(self) -> str:
        """The reason why no 50 values, none negative, can have these three numbers; empty if some can."""
        if self.mean < self.best:
            return "the mean is below the best"
        # One value is mean − best below the mean; the spread is least if the other values make up for it evenly.
        if self.std < 0.999 * (self.mean - self.best) / math.sqrt(PAPER_RUNS - 1):
            return "the spread is too small for this mean and best"
        # The spread is largest if one value holds the whole sum.
        if self.std > 1.001 * self.mean * math.sqrt(PAPER_RUNS):
            return "the spread is too large for this mean"
        return ""


def _printed() -> dict[tuple[str, str], PrintedWolf]:
    numbers = {(row[0], row[1]): row[2:] for row in map(str.split, _TABLE_2.strip().splitlines())}
    return {
        (function, wolf): PrintedWolf(*(float(numbers[function, what][k]) for what in ("mean", "std", "best")))
        for function, _ in numbers
        for k, wolf in enumerate(WOLVES)
    }


WOLVES_PRINTED = _printed()
"""Table 2, by function and algorithm."""

CLAIMED = "ssgwo"  # the paper claims that it has the least mean, alone or shared, on every function
SETTINGS = ("middle", "shifted")
DIM, POPULATION, ITERATIONS = 30, 30, 500  # table 1 and section 5.1
PART_S = 2.0
"""Seconds that ten runs take, about."""

VERDICT_WORDS = {True: "reproduced", False: "not reproduced", None: "too small to tell"}


@dataclass(frozen=True, slots=True)
class _FunctionRuns:
    function: str
    algorithm: str
    setting: str
    runs: tuple[int, ...]
    seed: int
    dim: int
    population: int
    iterations: int


def run(
    runs: int = PAPER_RUNS,
    seed: int = 1,
    jobs: int | None = None,
    *,
    algorithms: Sequence[str] = WOLVES,
    functions: Sequence[str] = tuple(FUNCTIONS),
    dim: int = DIM,
    population: int = POPULATION,
    iterations: int = ITERATIONS,
    done: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Run every algorithm on every function in both settings, ``runs`` times each; same seed, same numbers.

    ``jobs`` processes do the work (None: one for each core, where that pays). ``done`` is called with the number of
    finished parts and of all parts. The result has ``settings`` of the experiment, ``rows`` (mean, std, median, best of
    each, with table 2's), ``costs`` (of each run), and ``claims`` (table 2's rankings, each reproduced or not). Raises
    InputError for invalid arguments.
    """
    if not 1 <= runs <= MOST_RUNS:
        raise InputError(f"give 1 to {MOST_RUNS} runs, not {runs}")
    unknown = [name for name in functions if name not in FUNCTIONS]
    if unknown or not functions or not algorithms:
        raise InputError(f"functions must be of {', '.join(FUNCTIONS)}, given {', '.join(unknown) or 'none'}")
    for name in algorithms:
        get(name)
    parts = [
        _FunctionRuns(function, algorithm, setting, tuple(chunk), seed, dim, population, iterations)
        for function in functions
        for algorithm in algorithms
        for setting in SETTINGS
        for chunk in _chunks(runs, 10)
    ]
    found: dict[tuple[str, str, str], dict[int, tuple[float, int]]] = {}
    with executor(jobs, pieces=len(parts), piece_s=PART_S) as workers:
        for count, (number, costs) in enumerate(workers.each(_work, None, parts), start=1):
            part = parts[number]
            kept = found.setdefault((part.function, part.algorithm, part.setting), {})
            kept.update(zip(part.runs, costs, strict=True))
            if done is not None:
                done(count, len(parts))
    costs_of = {key: np.array([kept[k][0] for k in range(runs)]) for key, kept in found.items()}
    evaluations = {key: max(kept[k][1] for k in range(runs)) for key, kept in found.items()}
    order = [(f, a, s) for f in functions for a in algorithms for s in SETTINGS]
    return {
        "settings": {
            "runs": runs,
            "seed": seed,
            "dim": dim,
            "population": population,
            "iterations": iterations,
            "functions": list(functions),
            "algorithms": list(algorithms),
        },
        "rows": [_row(key, costs_of[key], evaluations[key]) for key in order],
        "costs": {"/".join(key): costs_of[key].tolist() for key in order},
        "claims": claims_of(costs_of, functions, algorithms, runs, dim),
    }


def report(result: dict[str, Any]) -> str:
    """The table as plain text: the printed mean, the measured mean in its setting, and with the optimum moved."""
    from rich.console import Console
    from rich.table import Table

    s = result["settings"]
    table = Table(
        title=_experiment(s) + ": mean (best)",
        title_justify="left",
        box=None,
        padding=(0, 2, 0, 0),
    )
    for column, right in (
        ("function", False),
        ("algorithm", False),
        ("evaluations", True),
        ("printed", True),
        ("ours, origin 0.5, optimum there", True),
        ("ours, optimum moved", True),
    ):
        table.add_column(column, justify="right" if right else "left", no_wrap=True)
    for middle, shifted in _pairs(result["rows"]):
        printed = "–" if middle["printed_mean"] is None else f"{middle['printed_mean']:.2e}"
        printed += " ‡" if middle["printed_fault"] else ""
        table.add_row(
            f"{middle['function']} {FUNCTIONS[middle['function']].title}",
            middle["algorithm"],
            f"{middle['evaluations']:,}",
            printed,
            f"{middle['mean']:.2e} ({middle['best']:.1e})",
            f"{shifted['mean']:.2e} ({shifted['best']:.1e})",
        )
    page = io.StringIO()
    Console(file=page, width=140, color_system=None).print(table)
    lines = [line.rstrip() for line in page.getvalue().splitlines()]
    return "\n".join(lines + _remarks(result)) + "\n"


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write ``functions.csv`` (a row per function, algorithm and setting), ``functions-runs.csv`` and ``functions.md``.

    Each file is written whole or not at all. Raises InputError if one cannot be written.
    """
    names = list(result["rows"][0])
    lines = [names, *([row.get(name) for name in names] for row in result["rows"])]
    runs = [
        ["function", "algorithm", "setting", "run", "cost"],
        *([*key.split("/"), k, repr(v)] for key, values in result["costs"].items() for k, v in enumerate(values)),
    ]
    return write_all(
        out,
        {
            "functions.csv": csv_of(lines, end="\r\n"),
            "functions-runs.csv": csv_of(runs, end="\r\n"),
            "functions.md": "\n".join(_markdown(result)) + "\n",
        },
    )


def _chunks(count: int, size: int) -> Iterator[range]:
    return (range(first, min(first + size, count)) for first in range(0, count, size))


def _work(_: None, job: _FunctionRuns) -> list[tuple[float, int]]:
    """Cost and evaluations of each run of a job."""
    function = FUNCTIONS[job.function]
    place = tuple(FUNCTIONS).index(job.function)
    entry = get(job.algorithm)
    found = []
    for k in job.runs:
        result = minimise(
            entry,
            function.on_unit_box(
                job.dim, shifted=job.setting == "shifted", noise=np.random.default_rng([job.seed, place, k, 1])
            ),
            job.dim,
            population=job.population,
            iterations=job.iterations,
            seed=np.random.default_rng([job.seed, place, k, 0]),
            parameters={"origin": 0.5} if "origin" in entry.defaults else None,
        )
        found.append((result.cost, result.evaluations))
    return found


def _row(key: tuple[str, str, str], costs: Floats, evaluations: int) -> dict[str, Any]:
    function, algorithm, setting = key
    printed = WOLVES_PRINTED.get((function, algorithm))
    return {
        "function": function,
        "algorithm": algorithm,
        "setting": setting,
        "evaluations": evaluations,
        "mean": float(costs.mean()),
        "std": float(costs.std(ddof=1)) if len(costs) > 1 else 0.0,
        "median": float(np.median(costs)),
        "best": float(costs.min()),
        **{f"printed_{name}": value for name, value in _fields(printed).items()},
        "printed_fault": printed.fault if printed else "",
    }


def _fields(printed: PrintedWolf | None) -> dict[str, float | None]:
    return asdict(printed) if printed else {"mean": None, "std": None, "best": None}


def claims_of(
    costs: Mapping[tuple[str, str, str], Floats],
    functions: Sequence[str],
    algorithms: Sequence[str],
    runs: int,
    dim: int,
) -> list[dict[str, Any]]:
    """Table 2's ranking of SSGWO against each rival on each function, by Wilcoxon's signed ranks, Holm-corrected.

    A printed tie counts as reproduced if no difference is significant. A ranking of values that double precision cannot
    distinguish is None: neither reproduced nor not.
    """
    rivals = [name for name in algorithms if name in WOLVES and name != CLAIMED]
    if CLAIMED not in algorithms or runs < LEAST_RUNS_TO_JUDGE:
        return []

    def blurred(function: str, rival: str, setting: str) -> bool:
        least = FUNCTIONS[function].resolution(dim, shifted=setting == "shifted")
        return all(np.median(costs[function, name, setting]) <= least for name in (CLAIMED, rival))

    out = []
    for setting in SETTINGS:
        cases = [(f, rival) for f in functions for rival in rivals]
        level = [WOLVES_PRINTED[f, CLAIMED].mean == WOLVES_PRINTED[f, rival].mean for f, rival in cases]
        p = holm(
            [
                _signed_rank(costs[f, CLAIMED, setting], costs[f, rival, setting], two_sided=tie)
                for (f, rival), tie in zip(cases, level, strict=True)
            ]
        )
        for (f, rival), tie, value in zip(cases, level, p, strict=True):
            differs = value < SIGNIFICANCE
            out.append(
                {
                    "setting": setting,
                    "function": f,
                    "claim": f"ssgwo {'=' if tie else '<'} {rival}",
                    "p": value,
                    "reproduced": not differs if tie else None if blurred(f, rival, setting) else differs,
                }
            )
    return out


def _signed_rank(ours: Floats, theirs: Floats, *, two_sided: bool) -> float:
    """p of "no difference" against "ours is less", or "they differ"; 1 if all pairs are equal."""
    from scipy.stats import wilcoxon

    if np.array_equal(ours, theirs):
        return 1.0
    if two_sided:
        return float(wilcoxon(ours, theirs, alternative="two-sided").pvalue)
    return float(wilcoxon(ours, theirs, alternative="less").pvalue)


def _experiment(s: Mapping[str, Any]) -> str:
    return f"D {s['dim']}, population {s['population']}, {s['iterations']} iterations, {s['runs']} runs"


def _pairs(rows: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    return zip(rows[0::2], rows[1::2], strict=True)


def _remarks(result: dict[str, Any]) -> list[str]:
    lines = []
    if any(row["mean"] == 0.0 for row in result["rows"]):
        lines.append("0 of ours: below the resolution of the unit box about its middle, 1e−26 on f1.")
    if any(row["printed_fault"] for row in result["rows"]):
        lines.append(f"‡ no {PAPER_RUNS} values can have the mean, standard deviation and best that the paper prints.")
    for setting in SETTINGS:
        claims = [claim for claim in result["claims"] if claim["setting"] == setting]
        if claims:
            count = [sum(claim["reproduced"] is verdict for claim in claims) for verdict in VERDICT_WORDS]
            lines.append(
                f"{setting}: of {len(claims)} rankings of SSGWO in table 2, {count[0]} reproduced, {count[1]} not "
                f"reproduced, {count[2]} too small to tell (Wilcoxon signed ranks, Holm, {SIGNIFICANCE:g})."
            )
    if not result["claims"]:
        lines.append(f"Rankings are judged with SSGWO among the algorithms and {LEAST_RUNS_TO_JUDGE} runs or more.")
    return lines


def _markdown(result: dict[str, Any]) -> Iterator[str]:
    s = result["settings"]
    yield "# The nine functions of SSGWO's tables 1 and 2"
    yield ""
    yield (
        f"{_experiment(s)}, seed {s['seed']}; mean ± standard deviation (best). *Middle*: the optimum in the middle "
        "of the box, rules bound to that point (origin 0.5), as table 2 has it. *Shifted*: the same, the optimum moved."
    )
    yield ""
    yield "| function | algorithm | evaluations | printed | ours, middle | ours, shifted |"
    yield "| --- | --- | ---: | ---: | ---: | ---: |"
    for middle, shifted in _pairs(result["rows"]):
        printed = "–"
        if middle["printed_mean"] is not None:
            printed = "{printed_mean:.2e} ± {printed_std:.1e} ({printed_best:.1e})".format(**middle)
            printed += " ‡" if middle["printed_fault"] else ""
        ours = ["{mean:.2e} ± {std:.1e} ({best:.1e})".format(**row) for row in (middle, shifted)]
        title = f"{middle['function']} {FUNCTIONS[middle['function']].title}"
        yield f"| {title} | {middle['algorithm']} | {middle['evaluations']:,} | {printed} | {' | '.join(ours)} |"
    yield ""
    for line in _remarks(result):
        yield line
        yield ""
    for row in result["rows"]:
        if row["printed_fault"] and row["setting"] == SETTINGS[0]:
            yield f"- {row['function']} {row['algorithm']}: {row['printed_fault']}"
    if result["claims"]:
        yield ""
        yield "| setting | function | claim of table 2 | p | |"
        yield "| --- | --- | --- | ---: | --- |"
        for claim in result["claims"]:
            verdict = VERDICT_WORDS[claim["reproduced"]]
            yield f"| {claim['setting']} | {claim['function']} | {claim['claim']} | {claim['p']:.2g} | {verdict} |"
