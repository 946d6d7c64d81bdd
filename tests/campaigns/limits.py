"""Missions at the limit: each margin is bisected to the tightest value that the check calls safe, and judged there.

Random worlds (slopes, towers, canopies, rotated grids, zones of every kind), missions of every family, and knobs that
bring them to one limit after the other. Brute force at points 0.25 m apart judges the missions that the check calls
safe.

    python -m tests.campaigns.limits --seconds 120 [--seed N] [--families copter wing …]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gcsplan.mavlink.files.plan_file import write_plan
from gcsplan.mavlink.files.waypoints_file import write_waypoints
from tests.campaigns.limit_cases import FAMILIES, Case, Knob, knobs, make_case
from tests.campaigns.limit_fleets import fleet_at_limit
from tests.campaigns.limit_oracle import ALLOWED, battery_needed_j, read_again, worst

HALVINGS = 15
KNOBS = 4
"""Knobs turned one after the other in each world, so that several limits are near at once."""

FLEETS = 5
"""One world in this many has a fleet, because planning a fleet takes seconds."""


@dataclass
class Tally:
    """Counts and findings of a campaign."""

    judged: Counter[str] = field(default_factory=Counter)
    turned: Counter[str] = field(default_factory=Counter)
    unsafe: list[str] = field(default_factory=list)
    worst: tuple[float, str] = (-np.inf, "")
    checks: int = 0

    def see(self, family: str, knob: str, seed: int, depth: float, kind: str) -> None:
        self.judged[family] += 1
        self.turned[knob] += 1
        where = f"seed {seed}, {family}, {knob}: {kind}"
        if np.isfinite(depth):
            self.worst = max(self.worst, (depth, where))
        if depth > ALLOWED:
            self.unsafe.append(f"{where}, by {depth:.3f}")

    def table(self) -> str:
        lines = [f"{family:10}{self.judged[family]:8}" for family in FAMILIES if self.judged[family]]
        lines.append(", ".join(f"{name} {count}" for name, count in self.turned.most_common()))
        depth, where = self.worst
        lines.append(f"nearest to unsafe: {depth:.4f} ({where})")
        lines.append(f"{sum(self.judged.values())} judgements, {self.checks} checks, {len(self.unsafe)} unsafe")
        return "\n".join(lines)


def attack(seed: int, family: str, tally: Tally, turns: int = KNOBS) -> None:
    """Attack one world: turn its knobs to the limit and judge it by brute force after each."""
    rng = np.random.default_rng([seed, FAMILIES.index(family)])
    if family == "fleet":
        if seed % FLEETS == 0 and (found := fleet_at_limit(rng)) is not None:
            tally.see(family, "fleet", seed, *found)
        return
    case = make_case(rng, family)
    if case is None:
        return
    turned = 0
    for knob in knobs(rng, case):
        found = at_limit(case, knob, tally)
        if found is None:
            continue
        case = found
        turned += 1
        tally.see(family, knob[0], seed, *_judged(case, rng))
        if turned == turns:
            break


def _judged(case: Case, rng: np.random.Generator) -> tuple[float, str]:
    if case.family == "battery":
        usable = (1.0 - case.vehicle.energy.reserve) * (case.vehicle.energy.battery_j or 0.0)
        needed = battery_needed_j(case)
        return (needed / usable - 1.0) * 100.0, "battery, percent"
    if rng.random() < 0.1:  # the mission read back from a file must be safe too
        plan = bool(rng.random() < 0.5)
        again = read_again(case, write_plan(case.mission) if plan else write_waypoints(case.mission), plan)
        if again.verdict().safe is not True:
            return np.inf, "read from a file it is not safe"
    return worst(case, rng)


def at_limit(case: Case, knob: Knob, tally: Tally) -> Case | None:
    """The case with the knob as tight as the check still calls safe; None if all of its range is safe, or none."""
    _, change, loose, tight = knob

    def safe(value: float) -> bool:
        tally.checks += 1
        return change(case, value).verdict().safe is True

    if not safe(loose) or safe(tight):
        return None
    for _ in range(HALVINGS):
        half = 0.5 * (loose + tight)
        loose, tight = (half, tight) if safe(half) else (loose, half)
    return change(case, loose)


def run(
    seconds: float, seed: int, families: Sequence[str] = FAMILIES, most: int | None = None, turns: int = KNOBS
) -> Tally:
    """Attack for ``seconds``, or ``most`` worlds of each family, with ``turns`` knobs turned in each."""
    tally, begun, world = Tally(), time.monotonic(), seed
    while time.monotonic() - begun < seconds and (most is None or world - seed < most):
        for family in families:
            before = len(tally.unsafe)
            attack(world, family, tally, turns)
            for line in tally.unsafe[before:]:
                print("UNSAFE", line, flush=True)
        world += 1
    return tally


def main() -> int:
    """Run the campaign from the command line; return 1 if something unsafe was called safe."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--seed", type=int, default=1, help="seed of the first world")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=FAMILIES)
    given = parser.parse_args()
    tally = run(given.seconds, given.seed, given.families)
    print(tally.table(), flush=True)
    return 1 if tally.unsafe else 0


if __name__ == "__main__":
    sys.exit(main())
