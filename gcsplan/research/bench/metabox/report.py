"""Tables of `gcsplan bench metabox`: a row for each optimiser over all instances, and its files."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.files import write_all
from gcsplan.bench.measure import compare, holm
from gcsplan.export.table import csv_of
from gcsplan.research.bench.metabox.run import THEIRS

METABOX_COLUMNS = ("optimiser", "of", "place, %", "p", "over the best, %", "clear", "remarks")


def rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    """A row for each optimiser, best mean place first.

    ``place_percent``: mean place of its runs among all runs on an instance, by cost, from 0 (best) to 100. ``p``:
    probability of its places if they do not differ from the first row's (Mann and Whitney's U, Holm over the
    optimisers). ``over_percent``: median cost over the least cost that any run found on the instance, median over the
    instances; None if half of the runs found nothing. ``clear``: part of the runs whose best path has no penalty.
    ``outside``: part of its evaluated points that lie out of the box. ``medians``: median cost by instance; None as
    above.
    """
    settings = result["settings"]
    names, count, runs = settings["algorithms"], settings["instances"], settings["runs"]
    costs = np.full((count, len(names), runs), np.inf)
    tally = {name: np.zeros(4) for name in names}  # clear, outside, evaluated, failed
    for record in result["runs"]:
        cost = np.inf if record["cost"] is None else record["cost"]
        costs[record["instance"], names.index(record["algorithm"]), record["run"]] = cost
        tally[record["algorithm"]] += record["clear"], record["outside"], record["evaluations"], bool(record["failed"])
    medians, places = np.median(costs, axis=2), _places(costs)
    over = 100.0 * np.median(medians / costs.min(axis=(1, 2))[:, None] - 1.0, axis=0)
    best = places[int(places.mean(axis=1).argmin())]
    p = holm([compare(one, best)[0] for one in places])
    out = [
        {
            "optimiser": name, "of": "MetaEvoBox" if name in THEIRS else "gcsplan",
            "place_percent": float(places[a].mean()), "p": p[a], "over_percent": _finite(over[a]),
            "clear": float(tally[name][0] / (count * runs)), "outside": float(tally[name][1] / tally[name][2]),
            "failed": int(tally[name][3]), "medians": [_finite(m) for m in medians[:, a]],
        }
        for a, name in enumerate(names)
    ]  # fmt: skip
    return sorted(out, key=lambda row: (row["place_percent"], row["optimiser"]))


def report(result: dict[str, Any]) -> str:
    """The table as Markdown, which reads well on a terminal too."""
    return "\n".join(_markdown(result)) + "\n"


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write ``metabox.json``, ``metabox.md`` and ``metabox-runs.csv``, each whole or not at all.

    Raises InputError if one cannot be written.
    """
    names = list(result["runs"][0])
    table = [names, *([run.get(name) for name in names] for run in result["runs"])]
    return write_all(
        out,
        {
            "metabox.json": json.dumps(result | {"rows": rows(result)}, indent=1) + "\n",
            "metabox.md": report(result),
            "metabox-runs.csv": csv_of(table, end="\r\n"),
        },
    )


def _finite(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


def _places(costs: Floats) -> Floats:
    """Places (optimisers, instances × runs) of ``costs`` (instances, optimisers, runs) among its instance's costs."""
    from scipy.stats import rankdata

    ranks = np.array([rankdata(one).reshape(one.shape) for one in costs])
    return np.asarray(100.0 * (ranks - 0.5) / costs[0].size).transpose(1, 0, 2).reshape(costs.shape[1], -1)


def _markdown(result: dict[str, Any]) -> Iterator[str]:
    settings = result["settings"]
    threats = ", ".join(map(str, settings["threats"]))
    yield (
        f"{settings['instances']} generated instances of MetaEvoBox's UAV family (threats: {threats}), seed "
        f"{settings['seed']}, {settings['evaluations']} evaluations, {settings['runs']} runs; its published instances "
        "are others."
    )
    yield ""
    yield f"| {' | '.join(METABOX_COLUMNS)} |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | --- |"
    for row in rows(result):
        remarks = []
        if row["outside"] >= 0.0005:
            remarks.append(f"{100.0 * row['outside']:.1f} % of its points are out of the box")
        if row["failed"]:
            remarks.append(f"{row['failed']} runs failed")
        over = "–" if row["over_percent"] is None else f"{row['over_percent']:.1f}"
        yield (
            f"| {row['optimiser']} | {row['of']} | {row['place_percent']:.0f} | {row['p']:.2g} | "
            f"{over} | {100.0 * row['clear']:.0f} % | {'; '.join(remarks) or '–'} |"
        )
    yield ""
    yield "Versions: " + ", ".join(f"{name} {number}" for name, number in result["versions"].items()) + "."
