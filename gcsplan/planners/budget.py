"""What one plan may take: counted work, counted bytes, and the clock as a last stop.

Work is counted in seconds of a plain processor, by the sizes of what is worked on (`RATES`), so that the same question
stops at the same place on every machine and beside any load. A budget in seconds buys a part of itself in counted work
(`COUNTED`): a machine that is that much slower, or that busy, still ends within it. The clock stops only a plan that is
slower yet; then the result depends on the machine and says so (``stopped_by: time``).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

RATES = {
    "node": 0.2e-6,
    "portal": 0.1e-6,
    "opened": 0.8e-6,
    "check": 1e-3,
    "leg": 0.8e-6,
    "cut": 0.11e-6,
    "cell": 0.02e-6,
    "piece": 0.3e-6,
    "place": 0.5e-6,
    "corner": 12e-6,
    "label": 12e-6,
    "pull": 80e-6,
    "sighted": 1e-6,
    "walked": 0.7e-6,
}
"""Counted seconds of a lattice's node made ready, a mesh's portal and an interval opened on one, a call of the exact
check with what is made of it, a leg under it, a piece of ground that it cuts beside a leg, a cell of terrain that the
leg crosses, a piece of a tube, a place whose
floor is read, a corner of an outline triangulated, a label of the lattice search, a point of a line that is pulled, for
each size of move, and a node that an end of a leg is looked at from, or walked to. Rounded from a fit over plans of all
kinds."""
COUNTED = 0.4
"""What part of the budget's seconds may be spent as counted work."""
FIRST, FIRST_S = 3.0, 0.5
"""How many times ``budget_s`` the search for a first path may take, and how many seconds on top."""
SPARE_S = 0.5
"""Taken off the clock's last stop, for what is under way when it comes."""


@dataclass(eq=False)
class Budget:
    """Of one plan: seconds and megabytes that are allowed, and what has been spent."""

    seconds: float
    megabytes: float
    begun_s: float = field(default_factory=time.perf_counter)
    spent: float = 0.0
    """Counted seconds so far."""
    clocked_out: bool = False
    """Whether the clock stopped something, so that another run may end elsewhere."""
    ran_out: bool = False
    """Whether counted work ran out."""
    _first_s: float | None = None
    _first_spent: float = 0.0

    def spend(self, what: str, count: float) -> None:
        """Count work: so many of what `RATES` names."""
        self.spent += RATES[what] * count

    def found_first(self) -> None:
        """From here on the budget counts for what comes after the first path."""
        if self._first_s is None:
            self._first_s, self._first_spent = time.perf_counter(), self.spent

    @property
    def elapsed_s(self) -> float:
        """Seconds by the clock since the plan began."""
        return time.perf_counter() - self.begun_s

    @property
    def left(self) -> float:
        """Counted seconds left."""
        allowed = self.seconds if self._first_s is not None else FIRST * self.seconds + FIRST_S
        return COUNTED * allowed - (self.spent - self._first_spent)

    @property
    def deadline_s(self) -> float:
        """The clock's last stop, as `time.perf_counter` gives it."""
        if self._first_s is None:
            return self.begun_s + FIRST * self.seconds + FIRST_S
        return self._first_s + max(self.seconds - SPARE_S, 0.5 * self.seconds)

    def goes_on(self, part: float = 1.0) -> bool:
        """Whether there is work and time left; ``part`` of what is allowed after the first path may be spent by now."""
        allowed = COUNTED * self.seconds
        if self.left <= (1.0 - part) * allowed:
            self.ran_out = True
            return False
        if time.perf_counter() > self.deadline_s:
            self.clocked_out = True
            return False
        return True

    def fits(self, seconds: float, megabytes: float) -> bool:
        """Whether so much counted work and memory is left."""
        return seconds <= self.left and megabytes <= self.left_mb

    @property
    def left_mb(self) -> float:
        """Megabytes that the next search may take."""
        return self.megabytes

    @classmethod
    def endless(cls) -> Budget:
        """For a problem that nobody set limits for."""
        return cls(math.inf, math.inf)
