"""The terrain under a mission: the window that is loaded first, and wider ones for paths that would leave it.

Windows are numbered levels, each at least twice as wide as the one before, so that all vehicles of a file use the same
windows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from weakref import WeakValueDictionary

import numpy as np

from gcsplan.errors import InputError, Mistake, heed_cancel
from gcsplan.mission_file.kept import KeptWorld
from gcsplan.mission_file.request import MissionFile, VehicleRequest
from gcsplan.mission_file.scene import LOCAL_MARGIN_M, MARGIN_M, MissionPlace, settle_areas, settle_zones
from gcsplan.mission_file.terminals import Terminals, make_request
from gcsplan.mission_file.zones.draft import ZoneDraft
from gcsplan.mission_file.zones.keep_in import outside_zones
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box, KeepIn, Zone
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.terrain import RASTER_SPARE_M, OpenTerrain, Terrain, TerrainSpec, open_terrain

PlacedZones = Sequence[tuple[ZoneDraft, Zone]]

MOST_LEVELS = 24
"""Most windows of one mission; the last would be much wider than the frame."""


EDGE_M = 100.0
"""Metres by which the last window extends beyond the terrain's edges, whose corners are known to a few metres only."""

QUICK_CELLS = 1_000_000
"""Cells of a window that is small enough to search at once, without a smaller window first."""


def opened(spec: TerrainSpec, *, where: str) -> OpenTerrain:
    """Open the terrain that ``spec`` names; ``where`` is its place in the mission file. Raises InputError."""
    if not spec.dem and not spec.sea:
        return open_terrain(spec, where=where)
    from gcsplan.dem.terrain import open_dem  # imported here because flat ground and peaks have no files

    return open_dem(spec, where=where)


@dataclass(frozen=True, eq=False)
class GroundWindow:
    """One window: its surface, and the zones and terminals as the ground in it decides."""

    surface: Surface
    zones: tuple[Zone, ...]
    scale: float
    vehicles: tuple[VehicleRequest, ...]


@dataclass(eq=False)
class MissionPlane:
    """A mission's places in its plane.

    ``box`` (west, south, east, north) is the first window, ``areas`` are those to stay in. ``good`` are the places of
    ``terminals`` on the terrain.
    """

    terrain: Terrain
    frame: Frame
    box: Box
    placed: PlacedZones
    areas: Sequence[KeepIn]
    terminals: Sequence[Terminals]
    good: Collection[MissionPlace]
    local: bool
    kept: KeptWorld = field(default_factory=KeptWorld)
    _extent: Box | None = None
    _loaded: WeakValueDictionary[int, MissionFile] = field(default_factory=WeakValueDictionary)

    def load(self, problems: list[Mistake]) -> GroundWindow | None:
        """The first window; None, and ``problems``, if there is no terrain."""
        return self._ground(self.box, None, problems, spare_m=0.0)

    def wider(self, source: MissionFile, margin_m: float, most_cells: int) -> MissionFile | None:
        """See `MissionFile.wider`. If a window is too large, the widest one that is not is used.

        If ``margin_m`` is infinite, the widest window that is quick to search is loaded at once.
        """
        at = source.level
        if math.isinf(margin_m):
            most = min(most_cells, max(4 * source.surface.ground_m.size, QUICK_CELLS))
            return self._widest(source, MOST_LEVELS, most) or self._widest(source, at + 1, most_cells)
        return self._widest(source, self._level_for(margin_m, at), most_cells)

    def _widest(self, source: MissionFile, widest_level: int, most_cells: int) -> MissionFile | None:
        """The widest window beyond the source's, up to level ``widest_level``, that has at most ``most_cells``."""
        for level in range(widest_level, source.level, -1):
            if self._box(level) != self._box(level - 1):
                wide = self._loaded_at(source, level, most_cells)
                if wide is not None and _is_larger(wide.surface, source.surface):
                    return wide
        return None

    def at_level(self, source: MissionFile, level: int) -> MissionFile | None:
        """See `MissionFile.at_level`."""
        return source if level == source.level else self._loaded_at(source, level, None)

    def _loaded_at(self, source: MissionFile, level: int, most_cells: int | None) -> MissionFile | None:
        known = self._loaded.get(level)
        if known is not None and (most_cells is None or known.surface.ground_m.size <= most_cells):
            return known
        problems: list[Mistake] = []
        found = self._ground(self._box(level), most_cells, problems, spare_m=RASTER_SPARE_M)
        if found is None or problems:
            return None
        wide = _moved(source, found, level)
        wide = replace(wide, wider=partial(self.wider, wide))
        self._loaded[level] = wide
        return wide

    def _ground(self, box: Box, most_cells: int | None, problems: list[Mistake], spare_m: float) -> GroundWindow | None:
        heed_cancel()
        corner_m = max(math.hypot(e, n) for e in (box[0], box[2]) for n in (box[1], box[3]))
        scale = self.frame.scale_at(corner_m + spare_m)
        try:
            frame = self.frame
            made_of = (self.terrain, frame.lat_deg, frame.lon_deg, frame.amsl_m, box, most_cells)
            surface = self.kept.surface(made_of, partial(self.terrain.load, frame, box, most_cells=most_cells))
        except InputError as why:
            problems += why.problems
            return None
        heed_cancel()
        try:
            outside = outside_zones(settle_areas(self.areas, surface), local=self.local)
        except InputError as why:
            problems += why.problems
            return None
        settle = partial(settle_zones, self.placed, surface, problems)
        settled = self.kept.settled.get((self.placed, surface), settle, keeps=lambda _: not problems)
        zones = [*settled, *outside]
        requests = [make_request(s, self.frame, surface, zones, self.good, problems) for s in self.terminals]
        return GroundWindow(surface, tuple(zones), scale, tuple(r for r in requests if r is not None))

    def _level_for(self, margin_m: float, level: int) -> int:
        """The first level after ``level`` that extends ``margin_m`` beyond all terminals, or as far as the terrain."""
        east, north = zip(*(p.in_plane(self.frame) for p in self.good), strict=True)
        least, most = (min(east), min(north)), (max(east), max(north))
        need = self._clipped((*(x - margin_m for x in least), *(x + margin_m for x in most)))
        for further in range(level + 1, MOST_LEVELS):
            box = self._box(further)
            if box[0] <= need[0] and box[1] <= need[1] and box[2] >= need[2] and box[3] >= need[3]:
                return further
        return MOST_LEVELS

    def _box(self, level: int) -> Box:
        """The window of a level, within the frame.

        Over flat ground it grows until no zone crosses its border: beyond such a border a path can gain nothing.
        """
        west, south, east, north = self.box
        if level == 0:
            return self.box
        if self.terrain.is_flat:
            more = (LOCAL_MARGIN_M if self.local else MARGIN_M) * 2.0 ** (level - 1)
            return _past_zones((west - more, south - more, east + more, north + more), self.placed, more)
        more = 0.5 * max(east - west, north - south) * (2.0**level - 1.0)
        return self._clipped((west - more, south - more, east + more, north + more))

    def _clipped(self, box: Box) -> Box:
        """``box`` cut to the terrain and the frame, but not smaller than the first window."""
        if self._extent is None:
            self._extent = self.terrain.extent(self.frame, self.box)
        # The edge itself stays inside, so that the planner sees that the terrain ends here.
        w, s, e, n = self._extent
        more = EDGE_M
        held = (max(box[0], w - more), max(box[1], s - more), min(box[2], e + more), min(box[3], n + more))
        west, south, east, north = _within_frame(held)
        return (
            min(west, self.box[0]), min(south, self.box[1]), max(east, self.box[2]), max(north, self.box[3])
        )  # fmt: skip


def _past_zones(box: Box, placed: PlacedZones, spare_m: float) -> Box:
    """``box`` grown past all zones that cross its border, with ``spare_m`` beyond them."""
    grown = True
    while grown:
        grown = False
        for _, zone in placed:
            w, s, e, n = zone.bounds
            zw, zs, ze, zn = _within_frame((w - spare_m, s - spare_m, e + spare_m, n + spare_m))
            meets = zw < box[2] and ze > box[0] and zs < box[3] and zn > box[1]
            if meets and (zw < box[0] or zs < box[1] or ze > box[2] or zn > box[3]):
                box = (min(box[0], zw), min(box[1], zs), max(box[2], ze), max(box[3], zn))
                grown = True
    return _within_frame(box)


def _within_frame(box: Box) -> Box:
    low, high = -FARTHEST_M, FARTHEST_M
    return (max(box[0], low), max(box[1], low), min(box[2], high), min(box[3], high))


def _is_larger(wide: Surface, surface: Surface) -> bool:
    """Whether a window reaches farther than another, so that the border of one is not loaded again and again."""
    if wide.ground_m.shape != surface.ground_m.shape:
        return True
    far = wide.ground_m.shape[1] - 1, wide.ground_m.shape[0] - 1
    spans = [abs(s.grid.to_plane(*far) - s.grid.to_plane(0, 0)).sum() for s in (wide, surface)]
    return bool(spans[0] > spans[1] + 1.0)


def _moved(source: MissionFile, ground: GroundWindow, level: int) -> MissionFile:
    """``source`` with another window."""
    old, new = notes_on(source.surface.info), notes_on(ground.surface.info)
    inputs = {k: v for k, v in ground.surface.info.items() if k not in ("notes", "source")}
    return replace(
        source,
        surface=ground.surface,
        zones=ground.zones,
        airspace_scale=ground.scale,
        vehicles=ground.vehicles,
        inputs={**source.inputs, **inputs},
        notes=(*(n for n in source.notes if n not in old), *new),
        level=level,
    )


def known_in_plane(
    places: Sequence[tuple[float, float]], terrain: OpenTerrain, frame: Frame
) -> list[tuple[float, float]]:
    """Where in the plane those places (latitude, longitude) lie that the terrain covers and the plane holds."""
    at = np.array(places, float).reshape(-1, 2)
    at = at[terrain.covers(at[:, 0], at[:, 1])]
    plane = frame.to_plane(at[:, 0], at[:, 1])
    return [(e, n) for e, n in plane.tolist() if math.hypot(e, n) <= FARTHEST_M]
