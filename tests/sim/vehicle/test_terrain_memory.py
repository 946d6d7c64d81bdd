"""A vehicle's terrain: asked for block by block, read only where it is whole, and forgotten when there is no room."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.mavlink.mission.mission import Home
from gcsplan.sim.vehicle.terrain_memory import CACHE_BLOCKS, REQUEST_EVERY_S, TerrainMemory

LAT_E7, LON_E7 = 366_000_000, -843_800_000
PARTS = 56


def give(memory: TerrainMemory, request: mav.MAVLink_terrain_request_message, height_m: int) -> None:
    """Send all parts that a vehicle asks for, flat at a height."""
    for bit in range(PARTS):
        if request.mask >> bit & 1:
            memory.take(
                mav.MAVLink_terrain_data_message(request.lat, request.lon, request.grid_spacing, bit, [height_m] * 16)
            )


def test_a_height_is_read_once_the_block_around_it_was_given() -> None:
    memory = TerrainMemory(100)
    assert memory.read(LAT_E7, LON_E7) is None
    assert (memory.pending, memory.loaded) == (PARTS, 0)
    request = memory.request(0.0)
    assert (request.grid_spacing, request.mask) == (100, (1 << PARTS) - 1)
    give(memory, request, 371)
    assert (memory.pending, memory.loaded) == (0, PARTS)
    assert memory.read(LAT_E7, LON_E7) == 371.0
    told = memory.report(LAT_E7, LON_E7, 421.5)
    assert (told.spacing, told.terrain_height, told.current_height) == (100, 371.0, 50.5)


def test_blocks_are_asked_for_one_by_one_and_only_what_is_missing() -> None:
    memory = TerrainMemory(100)
    memory.look_around(Home(LAT_E7, LON_E7, 0.0), ())
    first = memory.request(10.0)
    assert memory.request(10.0 + REQUEST_EVERY_S - 0.01) is None
    again = memory.request(10.0 + REQUEST_EVERY_S)
    assert (again.lat, again.lon, again.mask) == (first.lat, first.lon, first.mask)
    memory.take(mav.MAVLink_terrain_data_message(first.lat, first.lon, 100, 3, [1] * 16))
    assert memory.request(20.0).mask == first.mask & ~(1 << 3)
    for now in range(30, 90, 3):
        if (request := memory.request(float(now))) is not None:
            give(memory, request, 5)
    assert memory.pending == 0
    assert memory.request(99.0) is None


@pytest.mark.parametrize(("spacing", "bit", "lat"), [(30, 0, 0), (100, 56, 0), (100, 0, 10_000_000)])
def test_data_for_another_grid_part_or_block_is_not_kept(spacing: int, bit: int, lat: int) -> None:
    memory = TerrainMemory(100)
    memory.read(LAT_E7, LON_E7)
    request = memory.request(0.0)
    memory.take(mav.MAVLink_terrain_data_message(request.lat + lat, request.lon, spacing, bit, [1] * 16))
    assert memory.loaded == 0


def test_what_falls_out_of_the_cache_is_forgotten() -> None:
    memory = TerrainMemory(100)
    memory.read(LAT_E7, LON_E7)
    give(memory, memory.request(0.0), 371)
    for k in range(1, CACHE_BLOCKS):
        memory.read(LAT_E7 + 1_000_000 * k, LON_E7)
    assert memory.read(LAT_E7, LON_E7) == 371.0
    for k in range(CACHE_BLOCKS, 2 * CACHE_BLOCKS):
        memory.read(LAT_E7 + 1_000_000 * k, LON_E7)
    assert memory.read(LAT_E7, LON_E7) is None
    assert memory.loaded == 0
