"""A short run of the campaign `heights`, and tests that it finds planted errors of reading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.world.frame import Frame
from gcsplan.world.surface import Surface
from gcsplan.world.terrain import TerrainSpec
from tests.campaigns.heights import Load, Tally, load, run

FOREVER_S = 1e9


def in_another_unit(spec: TerrainSpec, frame: Frame) -> Surface:
    return load(replace(spec, height_unit="ft" if spec.height_unit == "us_ft" else spec.height_unit), frame)


def of_one_height(spec: TerrainSpec, frame: Frame) -> Surface:
    read = load(spec, frame)
    return Surface(read.high, read.top_m, read.grid, dict(read.info))


def with_zeros(spec: TerrainSpec, frame: Frame) -> Surface:
    return load(replace(spec, nodata="none" if spec.nodata is None else spec.nodata), frame)


def upside_down(spec: TerrainSpec, frame: Frame) -> Surface:
    if spec.vertical_datum is not None and spec.vertical_datum.endswith(("5715", "6357", "5861")):
        return load(replace(spec, vertical_datum="EPSG:5714"), frame)
    return load(spec, frame)


def test_what_is_read_is_what_the_files_say() -> None:
    tally = run(FOREVER_S, 400, most=30)
    assert tally.faults == []
    assert tally.read > 10
    assert tally.refused.total() > 4


@pytest.mark.slow
@pytest.mark.parametrize("planted", [in_another_unit, of_one_height, with_zeros, upside_down])
def test_the_campaign_finds_a_planted_error(planted: Load) -> None:
    tally = Tally()
    for seed in range(0, 400, 40):
        tally = run(FOREVER_S, seed, most=40, reader=planted)
        if tally.faults:
            break
    assert tally.faults


def test_a_surface_of_the_greatest_heights_alone_is_found() -> None:
    faults = run(FOREVER_S, 1, most=20, reader=of_one_height).faults
    assert any("least" in fault or "home" in fault for fault in faults)
    assert np.isfinite(len(faults))
