"""The ground under an SITL: the mission's terrain as ArduPilot's own files, which an instance reads from ./terrain.

Without them its ground is flat at the altitude of home: what flies below home hits it, and what lands above home sinks
into the hill. SITL takes the ground at a place as home's altitude and the difference of the terrain there to that at
home (SIM_TERRAIN, with TERRAIN_ENABLE), so its ground at home is right whatever the datum of the terrain is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.dem.dat_file import file_name, packed
from gcsplan.errors import InputError
from gcsplan.mavlink.mission.mission import TERRAIN
from gcsplan.sim.part import RehearsalPart
from gcsplan.world.terrain.grid import SPACING_M, Block, PostHeights, TerrainGrid, known_parts
from gcsplan.world.world import World

FINE_SPACING_M = 30
"""Posts are so near each other, m, where no leg is flown in terrain frame: the ground is then nearly the mission's."""
COARSER_SPACING = 1.5
MOST_IN_FILES = 3000
"""Blocks of one vehicle, of 2 KB each and 0.6 km² at 30 m; a longer mission gets posts farther apart."""
COARSEST_SPACING_M = 500
ALONG_STEP_M, BESIDE_FLIGHT_M = 250.0, 1000.0
"""Steps along the flight, and how far beside it there is ground, m: SITL also looks up the blocks around."""


def write_ground(part: RehearsalPart, world: World, directory: Path) -> dict[str, float]:
    """Write the terrain around a vehicle's flight into ``directory``/terrain; return the parameters that use it.

    Raises InputError for a flight so long that its terrain would be too coarse.
    """
    grid, blocks = _blocks(part, world)
    posts = PostHeights(grid, lambda lat, lon: _ground(world, lat, lon))
    known = {block: heights for block in blocks if known_parts(heights := posts.block(block))}
    if not known:
        return {"TERRAIN_ENABLE": 0, "SIM_TERRAIN": 0}
    folder = directory / "terrain"
    folder.mkdir()
    for cell in dict.fromkeys(block.cell for block in known):
        mine = {block: heights for block, heights in known.items() if block.cell == cell}
        (folder / file_name(cell)).write_bytes(packed(grid, cell, mine))
    return {"TERRAIN_ENABLE": 1, "TERRAIN_SPACING": grid.spacing_m, "SIM_TERRAIN": 1}


def _ground(world: World, lat_deg: Floats, lon_deg: Floats) -> Floats:
    plane = world.frame.to_plane(lat_deg, lon_deg)
    return np.asarray(world.airspace.surface.ground_at(plane[..., 0], plane[..., 1]), float)


def _blocks(part: RehearsalPart, world: World) -> tuple[TerrainGrid, Sequence[Block]]:
    """The blocks around the flight, of the finest grid of which there are not too many."""
    lat, lon = _around(part, world)
    in_terrain = any(item.frame == TERRAIN for item in part.mission.items)
    spacing_m = SPACING_M if in_terrain else FINE_SPACING_M
    while spacing_m <= COARSEST_SPACING_M:
        grid = TerrainGrid(spacing_m)
        blocks = grid.blocks_over(1e7 * lat, 1e7 * lon)
        if len(blocks) <= MOST_IN_FILES:
            return grid, blocks
        if in_terrain:  # the heights that it flies depend on the grid
            break
        spacing_m = math.ceil(spacing_m * COARSER_SPACING)
    raise InputError(
        f"{part.vehicle.name}: its flight is too long for an SITL's terrain: more than {MOST_IN_FILES} blocks with "
        f"posts every {min(spacing_m, COARSEST_SPACING_M)} m"
    )


def _around(part: RehearsalPart, world: World) -> tuple[Floats, Floats]:
    """Latitudes and longitudes, degrees, in steps along the flight and beside it."""
    home = part.mission.home
    places = [(home.lat_e7 / 1e7, home.lon_e7 / 1e7)]
    places += [place[:2] for leg in part.verdict.legs for place in (leg.start, leg.end)]
    plane = world.frame.to_plane([p[0] for p in places], [p[1] for p in places])
    track = np.concatenate([plane[:1], *(_steps(a, b) for a, b in pairwise(plane))])
    aside = np.arange(-BESIDE_FLIGHT_M, BESIDE_FLIGHT_M + 1.0, 0.5 * BESIDE_FLIGHT_M)
    spread = np.array([(east, north) for east in aside for north in aside])
    points = (track[:, None, :] + spread).reshape(-1, 2)
    degrees = world.frame.to_degrees(points[:, 0], points[:, 1])
    return degrees[:, 0], degrees[:, 1]


def _steps(a: Floats, b: Floats) -> Floats:
    count = max(1, math.ceil(float(np.hypot(*(b - a))) / ALONG_STEP_M))
    return np.linspace(a, b, count + 1)
