"""The limits of one plan: counted work, counted bytes, and the clock as a last stop.

Work is counted in seconds of a plain processor, computed from the sizes of the processed data (`RATES`). So the same
problem stops at the same point on every machine and under any load. A budget in seconds allows only a part of itself as
counted work (`COUNTED`), so a machine that is slower or busier by that factor still finishes in time. The clock stops
only a plan that is slower still; the result then depends on the machine, and names that (``stopped_by: time``).
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from gcsplan.errors import heed_cancel

RATES = {
    "node": 0.06e-6,
    "portal": 0.07e-6,
    "opened": 0.25e-6,
    "check": 0.4e-3,
    "leg": 0.1e-6,
    "cut": 0.1e-6,
    "cell": 0.02e-6,
    "piece": 1e-6,
    "place": 0.3e-6,
    "corner": 12e-6,
    "label": 2.4e-6,
    "interval": 1.1e-6,
    "section": 2e-8,
    "read": 0.025e-6,
    "pull": 50e-6,
    "sighted": 0.35e-6,
    "walked": 0.5e-6,
    "drawn": 15e-6,
    "mend": 0.1,
}
"""Counted seconds of each unit of work, rounded from a fit over plans of all kinds: ``node`` prepared of a lattice,
``portal`` of a mesh, interval ``opened`` on a portal, call of the exact ``check`` with the use of its result, ``leg``
checked, piece of ground ``cut`` beside a leg, ``cell`` of terrain that a leg crosses, ``piece`` of a tube, ``place``
whose floor is read, ``corner`` of an outline triangulated, ``label`` of the lattice search, altitude ``interval``
examined for one track length, leg between nodes of two ``section`` lines, cell of a zone's own ground ``read`` for a
cell beside it, point of a line to ``pull`` (for each size of move), node ``sighted`` from an end of a leg, node
``walked`` to from there, path ``drawn`` by a swarm, and curve to ``mend``."""
COUNTED = 0.4
"""Part of the budget's seconds that may be spent as counted work."""
FIRST, FIRST_S = 3.0, 0.5
"""The search for a first path may take this many times ``budget_s``, and this many seconds more."""
SPARE_S = 0.5
"""Seconds subtracted from the clock's last stop, for the work in progress when it comes."""


def clock_stops_plans() -> bool:
    """Whether the clock stops plans that leave ``clocked`` open: unless the environment has GCSPLAN_CLOCK=off."""
    return os.environ.get("GCSPLAN_CLOCK") != "off"


@dataclass(eq=False)
class Budget:
    """Seconds that one plan may take, megabytes that each of its searches may take, and the counted work so far.

    ``clocked``: whether the clock stops it too; if not, counted work alone does. ``until_s``: the latest stop by the
    clock, whatever the other numbers allow. ``clock``: seconds, from any beginning.
    """

    seconds: float
    megabytes: float
    clocked: bool = field(default_factory=clock_stops_plans)
    until_s: float = math.inf
    clock: Callable[[], float] = time.perf_counter
    spent: float = 0.0
    """Counted seconds so far."""
    clocked_out: bool = False
    """Whether the clock stopped a search, so that another run may end differently."""
    ran_out: bool = False
    """Whether counted work ran out."""
    begun_s: float = field(init=False)
    """When it began, by its clock."""
    _first_s: float | None = None
    _first_spent: float = 0.0
    _kept: float = 0.0
    """Counted seconds that the search in progress may not spend, see `allow`."""

    def __post_init__(self) -> None:
        self.begun_s = self.clock()

    def spend(self, what: str, count: float) -> None:
        """Count ``count`` units of the work ``what``, a key of `RATES`. Raises Cancelled."""
        heed_cancel()
        self.spent += RATES[what] * count

    def found_first(self) -> None:
        """Start the budget for improvements: call when the first path is found; later calls do nothing."""
        if self._first_s is None:
            self._first_s, self._first_spent = self.clock(), self.spent

    @property
    def elapsed_s(self) -> float:
        """Seconds by the clock since the plan began."""
        return self.clock() - self.begun_s

    @property
    def left(self) -> float:
        """Counted seconds left."""
        allowed = self.seconds if self._first_s is not None else FIRST * self.seconds + FIRST_S
        return COUNTED * allowed - (self.spent - self._first_spent) - self._kept

    @property
    def deadline_s(self) -> float:
        """The clock's last stop."""
        if not self.clocked:
            return math.inf
        if self._first_s is None:
            return min(self.begun_s + FIRST * self.seconds + FIRST_S, self.until_s)
        return min(self._first_s + max(self.seconds - SPARE_S, 0.5 * self.seconds), self.until_s)

    def goes_on(self) -> bool:
        """Whether counted work and time are left; records which of them ran out. Raises Cancelled."""
        heed_cancel()
        if self.left <= 0.0:
            self.ran_out = self.ran_out or self._kept == 0.0
            return False
        if self.clock() > self.deadline_s:
            self.clocked_out = True
            return False
        return True

    @contextmanager
    def allow(self, part: float) -> Iterator[None]:
        """Let what runs within spend ``part`` of the counted work left now: it takes that for all there is."""
        kept = self._kept
        if math.isfinite(self.left):
            self._kept += (1.0 - part) * max(self.left, 0.0)
        try:
            yield
        finally:
            self._kept = kept

    @property
    def stopped_by(self) -> str:
        """The cause of the plan's stop: time, budget, or exhausted where neither stopped it."""
        return "time" if self.clocked_out else "budget" if self.ran_out else "exhausted"

    def fits(self, seconds: float, megabytes: float) -> bool:
        """Whether that many counted seconds and megabytes are left."""
        return seconds <= self.left and megabytes <= self.megabytes

    def anew(self, seconds: float, megabytes: float) -> Budget:
        """A budget that begins now, with the same stops by the clock as this one."""
        return Budget(seconds, megabytes, self.clocked, self.until_s, self.clock)

    @classmethod
    def endless(
        cls, *, clocked: bool | None = None, until_s: float = math.inf, clock: Callable[[], float] = time.perf_counter
    ) -> Budget:
        """A budget without limits. A problem that carries one without ``clocked`` is planned without a clock.

        ``clocked``: None for the value of `clock_stops_plans`.
        """
        return cls(math.inf, math.inf, clock_stops_plans() if clocked is None else clocked, until_s, clock)
