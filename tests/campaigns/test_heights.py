"""A short run of the campaign `heights`, and tests that it finds planted errors of reading."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.terrain import TerrainSpec
from tests.campaigns.heights import Load, Tally, attempt, load, run

FOREVER_S = 1e9


def feet_as_metres(spec: TerrainSpec, frame: Frame) -> Surface:
    feet = spec.vertical_datum is not None and spec.vertical_datum.endswith(("6360", "8228", "5702", "8050", "8052"))
    return load(replace(spec, vertical_datum="AMSL") if feet else spec, frame)


def of_one_height(spec: TerrainSpec, frame: Frame) -> Surface:
    read = load(spec, frame)
    return Surface(read.high, read.top_m, read.grid, dict(read.info))


def with_zeros(spec: TerrainSpec, frame: Frame) -> Surface:
    return load(replace(spec, nodata="none" if spec.nodata is None else spec.nodata), frame)


def upside_down(spec: TerrainSpec, frame: Frame) -> Surface:
    if spec.vertical_datum is not None and spec.vertical_datum.endswith(("5715", "6357", "5861")):
        return load(replace(spec, vertical_datum="EPSG:5714"), frame)
    return load(spec, frame)


PLANTED = [(of_one_height, 1), (with_zeros, 22), (upside_down, 104), (feet_as_metres, 3)]


@pytest.mark.slow
def test_heights_are_read_as_the_files_state_them() -> None:
    tally = run(FOREVER_S, 1000, most=14)
    assert tally.faults == []
    assert tally.read > 5
    assert tally.refused.total() > 1


@pytest.mark.first_quick
@pytest.mark.parametrize(("planted", "seed"), PLANTED)
def test_the_campaign_finds_a_planted_error(planted: Load, seed: int) -> None:
    tally = Tally()
    attempt(seed, tally, planted)
    assert tally.faults
    assert tally.lines()[-1] == f"{len(tally.faults)} faults"
