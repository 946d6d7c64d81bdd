"""The ground under an SITL is the mission's, as ArduPilot reads it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from gcsplan.dem.dat_file import read_dat
from gcsplan.errors import InputError
from gcsplan.mavlink.mission import mission as m
from gcsplan.sim.sitl import terrain_files
from gcsplan.sim.sitl.terrain_files import write_ground
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import Block
from tests.oracles import terrain_grid as oracle
from tests.support.sitl_parts import a_part, ramp
from tests.support.worlds import world


def test_the_autopilot_reads_the_missions_ground_within_a_metre_about_the_flight(
    tmp_path: Path,
) -> None:
    where = ramp()
    given = write_ground(a_part(where), where, tmp_path)
    assert given == {"TERRAIN_ENABLE": 1, "TERRAIN_SPACING": 30, "SIM_TERRAIN": 1}
    (file,) = (tmp_path / "terrain").iterdir()
    assert file.name == "N36W085.DAT"
    found = read_dat(file, where="test")

    def post(lat_degrees: int, lon_degrees: int, north: int, east: int) -> float:
        block = Block(Cell(lat_degrees, lon_degrees), north // 24, east // 28)
        return float(found.blocks[block][north % 24, east % 28])

    along = np.linspace(-900.0, 2400.0, 60)
    for beside in (-900.0, 0.0, 900.0):
        places = where.frame.to_degrees(along, np.full(60, beside))
        for (lat, lon), east in zip(places, along, strict=True):
            read_m = oracle.height(round(1e7 * lat), round(1e7 * lon), post, 30)
            assert -0.01 < read_m - (500.0 - 0.1 * east) < 1.01


def test_a_mission_in_terrain_frame_has_the_grid_that_it_is_judged_with(tmp_path: Path) -> None:
    where = ramp()
    given = write_ground(a_part(where, frame=m.TERRAIN), where, tmp_path)
    assert given["TERRAIN_SPACING"] == 100


def test_a_long_flight_gets_posts_farther_apart_and_too_long_a_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = ramp()
    part = a_part(where)
    monkeypatch.setattr(terrain_files, "MOST_IN_FILES", 8)
    assert 30 < write_ground(part, where, tmp_path)["TERRAIN_SPACING"] < 500
    monkeypatch.setattr(terrain_files, "MOST_IN_FILES", 0)
    with pytest.raises(InputError, match="uav1: its flight is too long"):
        write_ground(part, where, tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_no_terrain_is_written_where_none_is_known(tmp_path: Path) -> None:
    where = ramp()
    unknown = world(lambda e, n: math.nan * e, half_m=3000.0)
    assert write_ground(a_part(where), unknown, tmp_path) == {"TERRAIN_ENABLE": 0, "SIM_TERRAIN": 0}
    assert list(tmp_path.iterdir()) == []
