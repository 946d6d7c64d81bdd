"""The table of ``gcsplan bench swarms`` and its files."""

from __future__ import annotations

import platform
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

from rich.table import Table

from gcsplan.bench.files import write_all
from gcsplan.bench.measure import percentile
from gcsplan.export.table import csv_of

SWARM_COLUMNS = (
    "method", "encoding", "cost", "raw legal", "repaired", "refused", "solved %", "after restarts %", "over p50 %",
    "over p90 %", "over max %", "raw over p50 %", "repaired over p50 %", "search s", "repair s",
)  # fmt: skip


LENGTH_COST = "krill"
"""The cost that is the length, with penalties: that of every method unless it says otherwise."""

AttemptStatus = Literal["raw legal", "repaired", "refused"]


@dataclass(frozen=True, slots=True)
class Method:
    """A row of the table: whose optimiser (``family``: gcsplan or mealpy), its name, encoding and cost.

    ``cost`` own: that of the optimiser's paper. ``warm``: it begins around the path of `optimal`.
    """

    family: str
    name: str
    encoding: str = "offsets"
    cost: str = LENGTH_COST
    warm: bool = False

    @property
    def label(self) -> str:
        """Its name in the table."""
        return self.name if self.family == "gcsplan" else f"{self.family} {self.name}"


@dataclass(frozen=True, slots=True)
class Attempt:
    """A method on a mission. ``length_m`` is None if it was refused. Seconds are the processor's: of the search with
    the exact check of its curve, and of the repair. ``searches``: searches that the planner needs until one is legal
    or repaired, None if it refuses too."""

    mission: str
    group: str
    method: Method
    status: AttemptStatus
    length_m: float | None
    evaluations: int
    search_s: float
    repair_s: float
    searches: int | None


@dataclass(frozen=True, slots=True)
class Optimum:
    """The planner `optimal` on a mission: its length, its certified bound, its processor seconds."""

    length_m: float
    bound_m: float
    seconds: float


@dataclass(frozen=True, eq=False, slots=True)
class SwarmsResult:
    """All attempts, and the reference of each mission; ``redraws``: pairs and sets of zones drawn in vain before it."""

    seed: int
    evaluations: int
    optima: dict[str, Optimum]
    attempts: list[Attempt]
    redraws: list[tuple[int, int]]

    def over(self, attempt: Attempt) -> float | None:
        """Percent by which an attempt's path is longer than the reference's; None if it was refused."""
        if attempt.length_m is None:
            return None
        return 100.0 * (attempt.length_m / self.optima[attempt.mission].length_m - 1.0)

    def lines(self) -> list[tuple[str, ...]]:
        """A row of `SWARM_COLUMNS` for each method, in the order of their first attempts."""
        groups: dict[Method, list[Attempt]] = {}
        for attempt in self.attempts:
            groups.setdefault(attempt.method, []).append(attempt)
        return [self._line(method, found) for method, found in groups.items()]

    def _line(self, method: Method, found: Sequence[Attempt]) -> tuple[str, ...]:
        by = {status: [a for a in found if a.status == status] for status in ("raw legal", "repaired", "refused")}
        over = {status: [x for a in some if (x := self.over(a)) is not None] for status, some in by.items()}
        every = [*over["raw legal"], *over["repaired"]]
        restarted = sum(a.searches is not None for a in found)
        return (
            f"{method.label}, warm" if method.warm else method.label, method.encoding,
            {LENGTH_COST: "length", "own": "its paper's"}[method.cost],
            *(str(len(some)) for some in by.values()), f"{100.0 * len(every) / len(found):.0f}",
            "–" if method.family == "mealpy" else f"{100.0 * restarted / len(found):.0f}",
            *(_percent(percentile(every, p)) for p in (50, 90, 100)),
            _percent(percentile(over["raw legal"], 50)), _percent(percentile(over["repaired"], 50)),
            *(f"{statistics.median(s):.2f}" for s in ([a.search_s for a in found], [a.repair_s for a in found])),
        )  # fmt: skip

    @property
    def about(self) -> list[str]:
        """Lines on what was measured."""
        gap = [100.0 * (o.length_m / o.bound_m - 1.0) for o in self.optima.values()]
        took = [o.seconds for o in self.optima.values()]
        pairs, sets = (max(r[i] for r in self.redraws) for i in (0, 1))
        return [
            f"{len(self.optima)} missions over real terrain with room, seed {self.seed}; {self.evaluations:,} cost "
            f"evaluations each; gcsplan {version('gcsplan')}, mealpy {_release('mealpy')}, cma {_release('cma')}, "
            f"Python {platform.python_version()}, {platform.machine()}.",
            f"`optimal`: gap to its certified bound {statistics.median(gap):.2f} % (median), {max(gap):.2f} % at most, "
            f"{statistics.median(took):.2f} s (median). Before one mission up to {pairs} pairs and {sets} sets of "
            "zones were drawn in vain.",
            "Over: longer than the path of `optimal`, of all solved missions. Seconds are the processor's, medians; "
            "the check of the curve is in the search. After restarts: solved by the planner, which searches again with "
            "other seeds.",
        ]

    def markdown(self) -> str:
        """The table as Markdown."""
        rows = [SWARM_COLUMNS, tuple("---" for _ in SWARM_COLUMNS), *self.lines()]
        return "\n".join(
            ["# Swarms over real terrain", "", *self.about, "", *(f"| {' | '.join(r)} |" for r in rows), ""]
        )

    def table(self) -> Table:
        """The table for the terminal."""
        out = Table(title=f"swarms, seed {self.seed}")
        for k, name in enumerate(SWARM_COLUMNS):
            out.add_column(name, justify="left" if k < 3 else "right")
        for line in self.lines():
            out.add_row(*line)
        return out

    def csv(self) -> str:
        """One row for each attempt."""
        rows = [self._row(a) for a in self.attempts]
        return csv_of([list(rows[0]) if rows else [], *(row.values() for row in rows)])

    def _row(self, attempt: Attempt) -> dict[str, object]:
        row = asdict(attempt)
        method = row.pop("method")
        best = self.optima[attempt.mission]
        return {
            "mission": row.pop("mission"), "group": row.pop("group"), **method, **row,
            "over_percent": self.over(attempt), "optimal_m": best.length_m, "bound_m": best.bound_m,
        }  # fmt: skip

    def write(self, directory: Path) -> list[Path]:
        """Write ``swarms.md`` and ``swarms.csv``; returns their paths."""
        return write_all(directory, {"swarms.md": self.markdown(), "swarms.csv": self.csv()})


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _release(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
