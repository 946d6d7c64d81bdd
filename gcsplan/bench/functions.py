"""SSGWO's tables 1 and 2 run again: nine functions, five kinds of grey wolf, beside the printed numbers.

There are two settings. *Middle*: the optimum is in the middle of the box, and the wolves' rule is bound to the same
point (origin 0.5), which is what table 2 measured. *Shifted*: the same rule with the optimum moved, so that a rule
loses what it owes to the middle. A result of 0 in the middle is less than the unit box resolves near 0.5, where doubles
are 1e−16 apart: about 1e−26 on f1. Rankings of such values count neither as reproduced nor as not reproduced.

Every algorithm starts from the same population in the same run, so runs are compared in pairs.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.app.executor import executor
from gcsplan.arrays import Floats
from gcsplan.bench.functions_printed import PRINTED, RUNS, WOLVES, Printed
from gcsplan.errors import InputError
from gcsplan.export.outdir import write_whole
from gcsplan.export.table import csv_of
from gcsplan.optimisers.driver import minimise
from gcsplan.optimisers.functions import FUNCTIONS
from gcsplan.optimisers.registry import get

CLAIMED = "ssgwo"  # the paper claims that it has the least mean, alone or shared, on every function
SETTINGS = ("middle", "shifted")
DIM, POPULATION, ITERATIONS = 30, 30, 500  # table 1 and section 5.1
MOST_RUNS = 10_000
PART_S = 2.0
"""Seconds that ten runs take, about."""

LEAST_RUNS_TO_JUDGE = 30
SIGNIFICANCE = 0.05
VERDICTS = {True: "reproduced", False: "not reproduced", None: "too small to tell"}


@dataclass(frozen=True, slots=True)
class _Job:
    function: str
    algorithm: str
    setting: str
    runs: tuple[int, ...]
    seed: int
    dim: int
    population: int
    iterations: int


def run(
    runs: int = RUNS,
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
        raise InputError(f"1 to {MOST_RUNS} runs are wanted, given {runs}")
    unknown = [name for name in functions if name not in FUNCTIONS]
    if unknown or not functions or not algorithms:
        raise InputError(f"functions must be of {', '.join(FUNCTIONS)}, given {', '.join(unknown) or 'none'}")
    for name in algorithms:
        get(name)
    parts = [
        _Job(function, algorithm, setting, tuple(chunk), seed, dim, population, iterations)
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
        "claims": _claims(costs_of, functions, algorithms, runs, dim),
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


def ready(out: Path) -> None:
    """Create the output directory before the long run. Raises InputError if that fails."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made: {error.strerror or error}", where=str(out)) from error


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write ``functions.csv`` (a row per function, algorithm and setting), ``functions-runs.csv`` and ``functions.md``.

    Each file is written whole or not at all. Raises InputError if one cannot be written.
    """
    ready(out)
    names = list(result["rows"][0])
    lines = [names, *([row.get(name) for name in names] for row in result["rows"])]
    runs = [
        ["function", "algorithm", "setting", "run", "cost"],
        *([*key.split("/"), k, repr(v)] for key, values in result["costs"].items() for k, v in enumerate(values)),
    ]
    files = {
        out / "functions.csv": csv_of(lines, end="\r\n"),
        out / "functions-runs.csv": csv_of(runs, end="\r\n"),
        out / "functions.md": "\n".join(_markdown(result)) + "\n",
    }
    for path, content in files.items():
        write_whole(path, content)
    return list(files)


def _chunks(count: int, size: int) -> Iterator[range]:
    return (range(first, min(first + size, count)) for first in range(0, count, size))


def _work(_: None, job: _Job) -> list[tuple[float, int]]:
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
    printed = PRINTED.get((function, algorithm))
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


def _fields(printed: Printed | None) -> dict[str, float | None]:
    return asdict(printed) if printed else {"mean": None, "std": None, "best": None}


def _claims(
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
        level = [PRINTED[f, CLAIMED].mean == PRINTED[f, rival].mean for f, rival in cases]
        p = _holm(
            _signed_rank(costs[f, CLAIMED, setting], costs[f, rival, setting], two_sided=tie)
            for (f, rival), tie in zip(cases, level, strict=True)
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


def _holm(p: Iterable[float]) -> list[float]:
    """Holm's step-down correction."""
    values = np.array(list(p))
    order = np.argsort(values)
    steps = np.maximum.accumulate(values[order] * (len(values) - np.arange(len(values))))
    out = np.empty_like(values)
    out[order] = np.minimum(steps, 1.0)
    return [float(x) for x in out]


def _experiment(s: Mapping[str, Any]) -> str:
    return f"D {s['dim']}, population {s['population']}, {s['iterations']} iterations, {s['runs']} runs"


def _pairs(rows: list[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    return zip(rows[0::2], rows[1::2], strict=True)


def _remarks(result: dict[str, Any]) -> list[str]:
    lines = []
    if any(row["mean"] == 0.0 for row in result["rows"]):
        lines.append("0 of ours: less than the unit box can tell apart about its middle, 1e−26 on f1.")
    if any(row["printed_fault"] for row in result["rows"]):
        lines.append(f"‡ no {RUNS} values can have the mean, standard deviation and best that the paper prints.")
    for setting in SETTINGS:
        claims = [claim for claim in result["claims"] if claim["setting"] == setting]
        if claims:
            count = [sum(claim["reproduced"] is verdict for claim in claims) for verdict in VERDICTS]
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
            verdict = VERDICTS[claim["reproduced"]]
            yield f"| {claim['setting']} | {claim['function']} | {claim['claim']} | {claim['p']:.2g} | {verdict} |"
