"""Attack lower bounds, gaps and proofs: missions at the check's limit that must not be below a bound.

Random worlds (walls, slits with centimetres of room, zones to pass over or under, climbs, hills, ground with voids,
vias, fleets, fixed wings, return paths, the terrain frame, zones that are not convex) are planned through the public
functions alone. Then a second implementation draws missions from the plan's own take-off top to its approach, each
judged by the check. A fault is

- undercut: a safe mission costs less than the bound, by more than 1 mm + 1e-7 of it (or the joules of this length);
- proved: a mission is safe where the plan was refused as proved;
- own cost: a plan costs less than its own bound;
- silent: a refusal that stems from unknown ground does not name it (with the voids filled there is a plan);
- not safe: the check does not pass the plan's own mission;
- crash: anything but a plan or a refusal;
- flown: a plan for the least time (`climbs+time` …) is flown faster than its bound.

    python -m tests.campaigns.bounds --seconds 120 [--seed N] [--families walls holes …] [--keep DIR]

Ctrl-C and SIGTERM end it after the world at hand, with the report. ``--keep DIR`` stores each fault's mission file,
terrain and witness, so that ``gcsplan plan`` and ``gcsplan check`` show it.
"""

from __future__ import annotations

import argparse
import math
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gcsplan import load_mission, plan
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.errors import GcsplanError, InputError, NoMission
from gcsplan.mavlink.files.waypoints_file import write_waypoints
from gcsplan.planners.problem import UNIT_OF
from tests.campaigns.bound_witnesses import Budget, Route, Witness, draw
from tests.campaigns.bound_worlds import FAMILIES, TIMED, Case, make

ALLOWED_M, ALLOWED = 1e-3, 1e-7
"""A witness may be below a bound by this many metres plus this part of it."""
WORLD_S, WITNESSES = 12.0, 160
"""Time and judged missions of one vehicle's plan at most."""
BEATEN = 1.01
"""A plan that costs this many times a witness is counted as beaten; that is no fault."""
SAYS_UNKNOWN = re.compile(r"unknown|void|not known|no data|does not know", re.IGNORECASE)
Planner = Callable[[Path], Plan]


@dataclass(frozen=True)
class Fault:
    """One fault; ``again`` is the command that shows it again."""

    kind: str
    family: str
    seed: int
    words: str

    @property
    def again(self) -> str:
        return f"python -m tests.campaigns.bounds --families {self.family} --seed {self.seed} --worlds 1"

    def __str__(self) -> str:
        return f"{self.kind}: {self.family} {self.seed}: {self.words} [{self.again}]"


@dataclass
class Tally:
    """The counts and faults of a campaign."""

    worlds: Counter[str] = field(default_factory=Counter)
    planned: Counter[str] = field(default_factory=Counter)
    bounded: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    missed: Counter[str] = field(default_factory=Counter)
    drawn: Counter[str] = field(default_factory=Counter)
    safe: Counter[str] = field(default_factory=Counter)
    nearest: dict[str, tuple[float, int, str]] = field(default_factory=dict)
    beaten: Counter[str] = field(default_factory=Counter)
    faults: list[Fault] = field(default_factory=list)

    def fault(self, kind: str, case: Case, words: str) -> None:
        found = Fault(kind, case.family, case.seed, words)
        self.faults.append(found)
        print("FAULT", found, flush=True)

    def count(self, family: str, seen: Sequence[Witness]) -> None:
        self.drawn[family] += len(seen)
        self.safe[family] += sum(w.safe for w in seen)

    def table(self) -> str:
        heads = ("worlds", "planned", "refused", "missed", "beaten", "witnesses", "safe", "faults")
        lines = [f"{'family':11}" + "".join(f"{h:>10}" for h in heads) + "  nearest to a bound, relative"]
        for family in [*self.worlds, "all"]:
            of = list(self.worlds) if family == "all" else [family]
            row = [sum(c[f] for f in of) for c in (self.worlds, self.planned, self._refused, self.missed, self.beaten,
                                                   self.drawn, self.safe)]  # fmt: skip
            near = min((self.nearest[f] for f in of if f in self.nearest), default=None)
            words = "-" if near is None else f"{near[0]:+.2e} (seed {near[1]}, {near[2]})"
            faults = sum(f.family in of for f in self.faults)
            lines.append(f"{family:11}" + "".join(f"{n:>10}" for n in (*row, faults)) + f"  {words}")
        lines.append("refused: " + (", ".join(f"{k} {n}" for k, n in self.refused.most_common()) or "none"))
        lines.append("faults: " + (", ".join(f"{k} {n}" for k, n in self._kinds.most_common()) or "none"))
        lines.append(
            f"{sum(self.worlds.values())} worlds, {self.bounded} bounds, {sum(self.drawn.values())} witnesses, "
            f"{sum(self.safe.values())} of them safe, {len(self.faults)} faults"
        )
        return "\n".join(lines)

    @property
    def _kinds(self) -> Counter[str]:
        return Counter(f.kind for f in self.faults)

    @property
    def _refused(self) -> Counter[str]:
        return Counter({f: self.worlds[f] - self.planned[f] for f in self.worlds})


def attack(
    family: str, seed: int, tally: Tally, planner: Planner | None = None, keep: Path | None = None,
    most: int = WITNESSES, world_s: float = WORLD_S,
) -> None:  # fmt: skip
    """Plan one world and draw witnesses against every bound and proof in it."""
    case = make(family, seed)
    rng = np.random.default_rng([seed, 1, *family.encode()])
    tally.worlds[family] += 1
    before = len(tally.faults)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = case.write(folder)
        worst: Witness | None = None
        try:
            planned = (planner or _plan)(file)
        except NoMission as refusal:
            worst = _refused(case, folder, refusal, tally, rng, most, world_s)
        except InputError as wrong:
            tally.refused[f"input: {str(wrong).splitlines()[0].split(':')[-1].strip()[:60]}"] += 1
        except (GcsplanError, ArithmeticError, AssertionError, LookupError, RuntimeError, TypeError, ValueError) as bug:
            tally.fault("crash", case, f"{type(bug).__name__}: {bug}"[:300])
        else:
            tally.planned[family] += 1
            for v in planned.vehicles:
                worst = _bounded(case, planned, v, tally, rng, most, world_s) or worst
        if keep is not None and len(tally.faults) > before:
            _kept(keep / f"{family}-{seed}", folder, worst, tally.faults[before:])


def _plan(file: Path) -> Plan:
    return plan(load_mission(file))


def _bounded(
    case: Case, planned: Plan, v: VehiclePlan, tally: Tally, rng: np.random.Generator, most: int, world_s: float
) -> Witness | None:
    """Attack one vehicle's bound; return the witness of a fault."""
    unit = UNIT_OF[v.problem.objective]
    route = Route(case, planned, v, Budget(time.monotonic() + world_s, most))
    if route.verdict(v.mission).safe is not True:
        tally.fault("not safe", case, f"{v.name}: the check does not pass the plan's own mission")
    bound = v.solution.lower_bound
    if bound is None:
        return None
    tally.bounded += 1
    per_m = 1.0
    if case.objective == "energy":
        per_m = max(v.request.vehicle.energy.horizontal_j_per_m, v.request.vehicle.energy.vertical_j_per_m)
    if case.objective == "time":
        fast = float(case.vehicles[0]["speed_m_s"][1])  # type: ignore[index]
        per_m = 1.0 / min(fast, v.problem.climb_m_s, v.problem.descent_m_s)
        flown_s = math.fsum((leg.time_s - leg.hold_s) * leg.times for leg in v.verdict.path_legs)
        if flown_s < bound:
            tally.fault("flown", case, f"{v.name} is flown in {flown_s:.3f} s, and no path is below {bound:.3f} s")
    allowed = ALLOWED_M * per_m + ALLOWED * bound
    if v.cost < bound - allowed:
        tally.fault("own cost", case, f"{v.name} costs {v.cost:.4f} {unit}, and no path is below {bound:.4f} {unit}")
    draw(route, rng)
    tally.count(case.family, route.seen)
    best = route.best
    if best is None:
        return None
    near = best.cost / bound - 1.0
    tally.nearest[case.family] = min(tally.nearest.get(case.family, (math.inf, 0, "")), (near, case.seed, best.how))
    tally.beaten[case.family] += v.cost > best.cost * BEATEN
    if best.cost >= bound - allowed:
        return None
    tally.fault(
        "undercut", case, f"{v.name}: safe with {best.cost:.4f} {unit} ({best.how}), and no path is below "
        f"{bound:.4f} {unit} ({100.0 * near:+.4f} %){', replanned' if _replanned(v) else ''}",
    )  # fmt: skip
    return best


def _replanned(v: VehiclePlan) -> bool:
    return any(note.code == "planned_again" for note in v.solution.notes)


def _refused(
    case: Case, folder: Path, refusal: NoMission, tally: Tally, rng: np.random.Generator, most: int, world_s: float
) -> Witness | None:
    """Attack a refusal: a safe mission from the ends of a plan without zones, or over other ground."""
    outcome = f"{refusal.reason}{' (proved)' if _proved(refusal) else ''}"
    words = " ".join(str(refusal).split())[:160]
    tally.refused[outcome] += 1
    holed = case.terrain is not None and np.isnan(case.terrain.heights).any()
    searched = refusal.reason in ("infeasible", "not_found") and "a path was found" not in str(refusal)
    if holed and searched and not SAYS_UNKNOWN.search(str(refusal)):
        try:
            _plan(folder / "filled.yaml")
            tally.fault("silent", case, f"with its voids filled there is a plan, and the refusal is: {words}")
        except GcsplanError:
            pass
    for name in ("open", "bare"):
        try:
            ends = _plan(folder / f"{name}.yaml")
            break
        except GcsplanError:
            continue
    else:
        return None
    source = load_mission(folder / "mission.yaml")
    for v in ends.vehicles:
        if v.request.vehicle.turn_radius_m > 0.0:
            continue
        route = Route(case, ends, v, Budget(time.monotonic() + world_s, most), source)
        route.try_points(route.points, "its plan without zones", "stop")
        draw(route, rng)
        tally.count(case.family, route.seen)
        if route.best is None:
            continue
        if _proved(refusal) and len(case.vehicles) == 1:
            tally.fault("proved", case, f"safe with {route.best.cost:.2f} ({route.best.how}); the refusal: {words}")
            return route.best
        tally.missed[case.family] += 1
    return None


def _proved(refusal: NoMission) -> bool:
    return refusal.reason == "infeasible" or "proved" in str(refusal)


def _kept(to: Path, folder: Path, witness: Witness | None, faults: Sequence[Fault]) -> None:
    to.mkdir(parents=True, exist_ok=True)
    for file in folder.iterdir():
        if file.stem in ("mission", "ground"):
            shutil.copy(file, to / file.name)
    (to / "fault.txt").write_text("".join(f"{f}\n" for f in faults), encoding="utf-8")
    if witness is not None:
        name = witness.mission.name
        (to / f"{name}.waypoints").write_text(write_waypoints(witness.mission), encoding="utf-8")


def run(
    seconds: float,
    seed: int,
    families: Sequence[str] = tuple(FAMILIES),
    *,
    worlds: int | None = None,
    witnesses: int | None = None,
    keep: Path | None = None,
    planner: Planner | None = None,
    stopped: Callable[[], bool] = lambda: False,
    most: int = WITNESSES,
    world_s: float = WORLD_S,
) -> Tally:
    """Attack for ``seconds``, ``worlds`` seeds or until ``witnesses`` are drawn; every family on one seed, then on the
    next, and each world for ``world_s``."""
    tally, begun, number = Tally(), time.monotonic(), seed
    while worlds is None or number - seed < worlds:
        for family in families:
            if time.monotonic() - begun > seconds or stopped():
                return tally
            if witnesses is not None and sum(tally.drawn.values()) >= witnesses:
                return tally
            attack(family, number, tally, planner, keep, most, world_s)
        number += 1
    return tally


def main() -> int:
    """Run the campaign from the command line; return 1 if there are faults."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1, help="seed of the first world of each family")
    parser.add_argument("--worlds", type=int, help="seeds at most")
    parser.add_argument("--witnesses", type=int, help="stop after this many")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=[*FAMILIES, *TIMED])
    parser.add_argument("--keep", type=Path, help="folder for the mission files and witnesses of faults")
    given = parser.parse_args()
    signals: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda which, _: signals.append(which))
    tally = run(
        given.seconds, given.seed, given.families, worlds=given.worlds, witnesses=given.witnesses, keep=given.keep,
        stopped=lambda: bool(signals),
    )  # fmt: skip
    if signals:
        print("stopped by a signal", flush=True)
    print(tally.table(), flush=True)
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
