"""A search as the governor sees it: when it applies, its worth and cost, and the method that runs it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar, Literal

from gcsplan.planners.optimal.loop.workspace import Workspace

Size = tuple[float, float]
"""Counted seconds and megabytes."""
Improves = Literal["paths", "bounds", "paths, bounds"]

FAR, WIDE, MUCH = 5e-3, 1e-2, 5e-2
"""Gaps, as parts, beyond which other sources of paths are tried; beyond which reachable altitudes are searched before
others have tried to close the gap; and beyond which small worlds are searched before time is spent on a bound."""
BAND_FAR = 2.5e-3
"""Gap under a maximum AGL up to which only the bound is weak: searches for paths gain a few thousandths of it."""
OF_REST = 0.5
"""Part of the counted work left that a search may take whose work is not known before, if a path is known."""
WORTH_AGAIN = 0.02
"""Part of the gap that a better path must have closed before a search runs once more."""


class Search(ABC):
    """One source of paths or bounds: a module of `searches`, which is named like it. It reads the incumbent and
    improves it; its memory between two runs is its own."""

    NAME: ClassVar[str]
    IMPROVES: ClassVar[Improves]
    SHARE: ClassVar[float]
    """The part of the gap that it closes on average, measured by ``gcsplan bench``; a first path counts as all."""
    AGAIN: ClassVar[bool] = False
    """Whether it may run once more after a better path was found."""
    ANEW: ClassVar[bool] = False
    """Whether it may run once more if it ran before a first path was known."""

    def __init__(self, work: Workspace) -> None:
        self.work, self.incumbent, self.problem = work, work.incumbent, work.incumbent.problem
        self.seen: float | None = None
        """Cost of the best path when the search was chosen last, inf if there was none; None: it was not chosen yet."""

    @property
    def share(self) -> float:
        """The part of the gap that it closes on average now."""
        return self.SHARE

    @property
    def nearer(self) -> bool:
        """Whether it is worth its cost even if the gap is already as small as requested; see `incumbent.NEARER`."""
        return False

    @abstractmethod
    def applies(self) -> bool:
        """Whether it may help now."""

    @abstractmethod
    def size(self) -> Size:
        """Counted seconds and megabytes that it takes."""

    @abstractmethod
    def run(self) -> None:
        """Improve the incumbent."""

    def is_open(self) -> bool:
        """Whether the search may run now."""
        if self.seen is not None:
            incumbent = self.incumbent
            better = self.seen - incumbent.cost > WORTH_AGAIN * (incumbent.cost - incumbent.bound)
            first = math.isinf(self.seen) and incumbent.best is not None
            if not ((self.AGAIN and better) or (self.ANEW and first)):
                return False
        return self.applies()

    def choose(self) -> None:
        """Note that the search was chosen, whether it then runs or is refused for its size."""
        self.seen = self.incumbent.cost

    def takes(self, seconds: float, per_zone_s: float = 0.0) -> Size:
        """The size of a search that takes seconds, and some for each zone, and has no lattices: 40 MB at most."""
        return seconds + per_zone_s * len(self.problem.airspace.zones), 40.0
