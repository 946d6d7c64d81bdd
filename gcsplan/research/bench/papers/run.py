"""The five papers' experiments run again: every scenario and algorithm, beside the printed numbers.

`scenarios` holds the experiments, `runs` the execution of a run, `printed` the papers' numbers. All algorithms get the
same seeds. Every finished run is kept in the output directory, and the same call continues from there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from gcsplan.bench.files import ready
from gcsplan.bench.measure import MOST_RUNS
from gcsplan.errors import InputError
from gcsplan.research.bench.papers.judge import MEASURES, judge
from gcsplan.research.bench.papers.printed import PRINTED, StraightFlight, faults, least_of
from gcsplan.research.bench.papers.runs import OPTIMA, PaperRun, RunRecord, Store, carry_out, code_digest, key_of
from gcsplan.research.bench.papers.scenarios import ReadyScenario, Scenario, choose, mission_text, prepare
from gcsplan.research.bench.papers.statistics import equal_evaluations, row, time_row

PAPER_RUNS_FILE = "papers-runs.jsonl"


def run(
    scenarios: Sequence[str] | None = None,
    algorithms: Sequence[str] | None = None,
    runs: int | None = None,
    seed: int = 1,
    jobs: int | None = None,
    out: Path = Path("papers"),
    cluster: str | None = None,
    done: Callable[[int, int], None] | None = None,
    *,
    missions: Path | None = None,
    readings: bool = True,
) -> dict[str, Any]:
    """Do every run that ``out`` does not hold yet, and sum up.

    Args:
        scenarios: names; None: all.
        algorithms: names of the papers' own algorithms; None: all. An optimiser that was added, by name or
            ``MODULE:FUNCTION``, searches beside them, in the space of the paper's own algorithm and for its cost.
        runs: runs of each algorithm in each scenario; None: the paper's number (30 if it names none).
        seed: seed from which the seeds of all runs are derived.
        jobs: local processes; None: one for each core. Unused with ``cluster``.
        out: directory of the runs (`PAPER_RUNS_FILE`) and the report; created if missing.
        cluster: a dask scheduler whose workers do the runs instead (`parallel.executor`).
        done: called with the number of finished runs and of all runs.
        missions: directory of the scenarios' mission files; None: the usual folders.
        readings: whether ``algorithms`` None means other readings of the papers, too.

    Returns:
        ``settings``; ``scenarios``, each with straight line, optimum, rows and printed numbers; ``claims`` and
        ``readings`` (`judge`); ``times``, with ``rows`` and ``claims``, all that a clock has measured.

    Raises:
        InputError: for what cannot be run or written, and for a cluster that does not answer.
    """
    if (runs is not None and not 1 <= runs <= MOST_RUNS) or (jobs is not None and jobs < 1) or seed < 0:
        raise InputError(
            f"give 1 to {MOST_RUNS} runs, 1 job or more and a seed of 0 or more, not {runs}, {jobs} and {seed}"
        )
    chosen = choose(scenarios, algorithms, readings=readings)
    due: dict[tuple[str, str], list[PaperRun]] = {}
    code = code_digest()
    texts = {scenario.name: mission_text(scenario.name, missions) for scenario, _ in chosen}
    for scenario, contenders in chosen:
        text, count = texts[scenario.name], runs or scenario.paper.runs
        for name in _optima(scenario):
            due[scenario.name, name] = [PaperRun(scenario.name, name, text, 0, 0, code)]
        for c in contenders:
            due[scenario.name, c.name] = [PaperRun(scenario.name, c.name, text, seed, k, code) for k in range(count)]
    ready(out)
    store = Store(out / PAPER_RUNS_FILE)
    there = store.load()
    # The references come first, so that a table that is read half way has its optimum.
    every = sorted((job for some in due.values() for job in some), key=lambda job: job.algorithm not in OPTIMA)
    todo = [job for job in every if job.key not in there]
    at = [len(every) - len(todo)]
    if done is not None:
        done(at[0], len(every))

    def keep(record: RunRecord) -> None:
        store.append(record)
        there[key_of(record)] = record
        at[0] += 1
        if done is not None:
            done(at[0], len(every))

    carry_out(todo, jobs, cluster, keep)
    found = {place: [there[job.key] for job in some] for place, some in due.items()}
    judged = judge([scenario for scenario, _ in chosen], found)
    timed = [time_row(s.name, c.name, found[s.name, c.name]) for s, contenders in chosen for c in contenders]
    return {
        "settings": {"runs": runs, "seed": seed, "code": code},
        "scenarios": [
            _summary(scenario, prepare(scenario.name, texts[scenario.name]), [c.name for c in contenders], found)
            for scenario, contenders in chosen
        ],
        "claims": judged["claims"],
        "readings": judged["readings"],
        "times": {"rows": timed, "claims": judged["times"]},
    }


def plain(result: dict[str, Any]) -> dict[str, Any]:
    """`run`'s result for JSON: without the runs and the world, and with printed numbers as printed."""
    left_out = ("set", "records", "best_path", "printed")
    scenarios = [
        {key: value for key, value in s.items() if key not in left_out}
        | {"printed": {name: {m: n.text for m, n in row.items()} for name, row in s["printed"].items()}}
        for s in result["scenarios"]
    ]
    return result | {"scenarios": scenarios}


def _optima(scenario: Scenario) -> list[str]:
    energy = "energy" in MEASURES[scenario.paper.name].values()
    return [name for name, objective in OPTIMA.items() if objective == "length" or energy]


def _summary(
    scenario: Scenario, prepared: ReadyScenario, names: Sequence[str], found: dict[tuple[str, str], list[RunRecord]]
) -> dict[str, Any]:
    """The report's data of a scenario; ``set`` and ``records`` are for its pictures."""
    readings = {c.name for c in scenario.paper.readings}
    records = {name: found[scenario.name, name] for name in names if name not in readings}
    others = {name: found[scenario.name, name] for name in names if name in readings}
    level = equal_evaluations(r for some in records.values() for r in some)
    least = StraightFlight.sum_of(prepared.least)
    energy = prepared.source.vehicles[0].vehicle.energy
    rates = (energy.vertical_j_per_m, energy.horizontal_j_per_m)
    printed = {name: PRINTED[scenario.name, name] for name in names if (scenario.name, name) in PRINTED}
    optima = {OPTIMA[name]: _optimum(found[scenario.name, name][0]) for name in _optima(scenario)}
    return {
        "name": scenario.name,
        "paper": scenario.paper.name,
        "source": f"{scenario.paper.title}, {scenario.tables}",
        "straight_m": least.length_m,
        "straight_j": least.energy_j(*rates),
        "optimum_m": optima["length"]["cost"],
        "bound_m": optima["length"]["bound"],
        "optimum_j": optima.get("energy", {}).get("cost"),
        "bound_j": optima.get("energy", {}).get("bound"),
        "optimum_refused": optima["length"]["refused"],
        "rows": [row(scenario.name, name, some, level) for name, some in records.items()],
        "reading_rows": [row(scenario.name, name, some, level) for name, some in others.items()],
        "printed": printed,
        "faults": {name: faults(printed[name], least_of(scenario.name), *rates) for name in printed},
        "equal_evaluations": level,
        "set": prepared,
        "records": records,
        "best_path": found[scenario.name, "optimal"][0].get("paths"),
    }


def _optimum(record: RunRecord) -> dict[str, Any]:
    if record["status"] != "found":
        return {"cost": None, "bound": None, "refused": record["detail"]}
    known = all(b is not None for b in record["bounds"])
    return {
        "cost": sum(record["costs"]),
        "bound": sum(record["bounds"]) if known else None,
        "refused": "",
    }
