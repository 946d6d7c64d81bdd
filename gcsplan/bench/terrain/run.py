"""``gcsplan bench terrain``: gcsplan's and other planners on one problem set, under the same exact check, in one run.

`problems` holds the problems; `ours` measures gcsplan's planner, `rivals` the others.
"""

from __future__ import annotations

import math
import platform
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

from gcsplan.bench.files import write_all
from gcsplan.bench.terrain import ours, report
from gcsplan.bench.terrain import rivals as others
from gcsplan.bench.terrain.outcome import OUR_LONG_METHOD, OUR_METHOD, MethodOutcome
from gcsplan.bench.terrain.problems import MOUNTAINS, PROBLEM_KINDS, NamedProblem, problems
from gcsplan.errors import InputError
from gcsplan.planners.optimal.table import require_names

ANSWERS = "rivals.jsonl"
GAP_PERCENT = 0.1
"""Certified gap to which a mission is planned by default, percent."""


@dataclass
class TerrainResult:
    """All outcomes so far, and the report's lines about the run."""

    outcomes: list[MethodOutcome] = field(default_factory=list)
    about: list[str] = field(default_factory=list)

    @property
    def lines(self) -> list[report.MethodLine]:
        """The lines by group and method."""
        return report.lines(self.outcomes)

    def write(self, directory: Path) -> list[Path]:
        """Write ``terrain.md``, ``terrain.csv`` and ``terrain.png``; returns their paths."""
        return write_all(
            directory,
            {
                "terrain.md": report.markdown(self.lines, self.outcomes, self.about),
                "terrain.csv": report.as_csv(self.outcomes),
                "terrain.png": report.figure(self.outcomes),
            },
        )


def run(
    directory: Path,
    *,
    seed: int = 1,
    kinds: Sequence[str] = MOUNTAINS,
    runs: int = 9,
    seconds: Sequence[float] = (1.0, 10.0),
    rivals: bool = True,
    swarms: bool = True,
    kept_only: bool = False,
    long: bool = False,
    errors: bool = False,
    count: int | None = None,
    planner: str = "optimal",
    gap_percent: float = GAP_PERCENT,
    without: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> TerrainResult:
    """Measure and write the report to ``directory``; ``tell`` receives messages on the progress.

    ``seconds`` are the times of OMPL's planners. ``long`` runs gcsplan's again with a minute per problem. ``errors``
    uses the clearance and errors of a real mission. ``count`` is the number of problems of each group. ``gap_percent``
    is the certified gap at which gcsplan's may stop, ``without`` are searches that it must not use. The rivals' answers
    are kept in ``directory`` and not computed again; with ``kept_only`` no others are computed. However the run ends,
    all results so far are written. Raises InputError for unknown kinds and if a rival is not installed.
    """
    for kind in kinds:
        if kind not in PROBLEM_KINDS:
            raise InputError(f"the kinds of problems are {', '.join(PROBLEM_KINDS)}, given {kind!r}")
    if runs < 1 or (count is not None and count < 1) or any(not s > 0.0 for s in seconds):
        raise InputError("runs and count must be 1 or more, seconds more than 0")
    if not (math.isfinite(gap_percent) and gap_percent >= 0.0):
        raise InputError(f"gap_percent must be 0 or more, given {gap_percent:g}")
    asked = others.rivals(seconds, swarms=swarms) if rivals else []
    if rivals and not kept_only:
        others.require(asked)
    require_names(without)
    options = {"without": tuple(without)} if without else {}
    result = TerrainResult()
    redraws: list[tuple[int, int]] = []
    warm_s = 0.0

    def write() -> None:
        result.about = _about(result.outcomes, seed, runs, warm_s, redraws, errors, asked)
        result.write(directory)

    try:
        sweep = ours.Sweep()
        compared: list[NamedProblem] = []
        for kind in kinds:
            tell(f"{kind}: making the problems")
            named = [
                replace(one, problem=replace(one.problem, gap_percent=gap_percent, options=options))
                for one in problems(kind, seed, errors=errors, count=count)
            ]
            redraws += [one.redraws for one in named]
            tell(f"{kind}: warming up")
            warm_s += ours.warm_up(named, planner)
            for one in named:
                tell(f"{OUR_METHOD}: {one.name}")
                result.outcomes.append(ours.measure(one, sweep, runs=runs, planner=planner))
                if long:
                    tell(f"{OUR_LONG_METHOD}: {one.name}")
                    result.outcomes.append(ours.measure(one, sweep, planner=planner, long=True))
            if kind in others.RIVAL_KINDS:
                compared += named
            write()
        if asked:
            kept = others.Answers(directory / ANSWERS)
            result.outcomes += others.compare(compared, asked, kept, seed, tell, kept_only=kept_only)
    finally:
        if result.outcomes:
            write()
    return result


def _about(
    outcomes: Sequence[MethodOutcome], seed: int, runs: int, warm_s: float, redraws: Sequence[tuple[int, int]],
    errors: bool, asked: Sequence[others.Rival],
) -> list[str]:  # fmt: skip
    """Lines on what was measured, and on which machine."""
    sweeps = [o.sweep_s for o in outcomes if o.sweep_s is not None]
    held = "with the clearance and errors of a real mission" if errors else "with no clearance and no errors"
    pairs, sets = (max((r[i] for r in redraws), default=0) for i in (0, 1))
    told = [
        f"Seed {seed}, {held}; gcsplan {version('gcsplan')}, Python {platform.python_version()}, {platform.machine()}.",
        "",
        f"Our times are medians of {runs} runs in process, warm (compiling and a first plan of each group took "
        f"{warm_s:.1f} s); each run starts with an airspace that nothing has been worked out for yet.",
        f"The sweep, the exact check of {ours.SWEEP_LEGS:,} one-kilometre legs, took {statistics.median(sweeps):.4f} s "
        "(median of all, one after every run); memory is the peak above what was in use before.",
        "Gaps are above the highest certified lower bound; ours above that of the same run; they may stop at a "
        f"certified gap of {_gaps_asked(outcomes)}. 'Done' is the time to the certificate of ours.",
        f"Before one problem up to {pairs} pairs and {sets} sets of zones were drawn in vain.",
    ]
    if asked:
        releases = {o.version for o in outcomes if o.version}
        told += [
            f"Others: {', '.join(sorted(releases)) or 'none yet'}; they get the same exact check of each "
            "leg, and OMPL's seconds are those of the processor without those spent between C++ and Python.",
        ]
    return told


def _gaps_asked(outcomes: Sequence[MethodOutcome]) -> str:
    """The requested gaps by method, in words."""
    asked = {(o.method, o.gap_asked_percent) for o in outcomes if o.gap_asked_percent is not None}
    return ", ".join(f"{gap:g} % ({method})" for method, gap in sorted(asked)) or "no size"
