"""What stays in memory between two readings of one mission whose keys change: terrain, surfaces, a forecast, zones.

Each is kept for the reading that comes next, under all that it was made of, so that a changed mission is read as if
anew, and memory does not grow with the number of changes. Files are not looked at again: what a living session plans
over is what it read first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from gcsplan.errors import Mistake
from gcsplan.mission_file.zones.draft import ZoneDraft
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box, Zone
from gcsplan.world.terrain.terrain import OpenTerrain

if TYPE_CHECKING:
    from gcsplan.mission_file.winds.forecast import Forecast

MOST_SURFACES = 4
"""Most windows of terrain that are kept: one plan widens its window a few times."""

MOST_CELLS_KEPT = 6_000_000
"""Most cells of a surface that is kept: some 50 MB for each of its heights."""

T = TypeVar("T")
Placed = tuple[list[tuple[ZoneDraft, Zone]], list[ZoneDraft]]
"""The zones of a mission in its plane, and the ones that lie too far away for it."""

ReadZones = tuple[Sequence[ZoneDraft], Sequence[Note], Sequence[Mistake]]
"""The zones of an entry of ``no_fly``, the notes on them, and the mistakes in them."""


@dataclass
class Latest(Generic[T]):
    """The values made last, each under a key that says all that it was made of; at most ``most``."""

    most: int
    known: list[tuple[Any, T]] = field(default_factory=list)

    def get(self, key: Any, make: Callable[[], T], *, keeps: Callable[[T], bool] = lambda _: True) -> T:
        """The value of ``key``, made now if it is not known, and kept if ``keeps`` says so."""
        for k, (at, value) in enumerate(self.known):
            if at == key:
                self.known.append(self.known.pop(k))
                return value
        value = make()
        if not keeps(value):
            return value
        self.known = [*self.known[1 - self.most :], (key, value)] if self.most > 1 else [(key, value)]
        return value


@dataclass(eq=False)
class KeptWorld:
    """The memory of one session; for one thread at a time."""

    terrain: Latest[OpenTerrain] = field(default_factory=lambda: Latest(1))
    forecast: Latest[Forecast] = field(default_factory=lambda: Latest(1))
    surfaces: Latest[Surface] = field(default_factory=lambda: Latest(MOST_SURFACES))
    placed: Latest[Placed] = field(default_factory=lambda: Latest(1))
    settled: Latest[Sequence[Zone]] = field(default_factory=lambda: Latest(1))
    plane: tuple[Frame, Box] | None = None
    """The plane and the first window of the reading before."""
    _before: dict[str, tuple[Any, ReadZones]] = field(default_factory=dict)
    _now: dict[str, tuple[Any, ReadZones]] = field(default_factory=dict)

    def surface(self, key: Any, make: Callable[[], Surface]) -> Surface:
        """The surface of ``key``; one of very many cells is made again the next time."""
        return self.surfaces.get(key, make, keeps=is_kept)

    def begin(self) -> None:
        """A reading begins: zones that the one before did not use are forgotten."""
        self._before, self._now = self._now or self._before, {}

    def zones(self, where: str, key: Any, make: Callable[[], ReadZones]) -> ReadZones:
        """The zones of the entry ``where``; an entry with mistakes is read again the next time."""
        known = self._before.get(where)
        found = known[1] if known is not None and known[0] == key else make()
        if not found[2]:
            self._now[where] = (key, found)
        return found


def is_kept(surface: Surface) -> bool:
    """Whether a surface has so few cells that it is kept."""
    return surface.ground_m.size <= MOST_CELLS_KEPT
