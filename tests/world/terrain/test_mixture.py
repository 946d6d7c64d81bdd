"""Layers of terrain as one surface: the finer counts, seams lie between two heights, `sea` fills what is unknown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.terrain.mixture import TerrainLayer, cell_m, finest_first, mixed
from gcsplan.world.terrain.mosaic import Window
from gcsplan.world.terrain.terrain import TerrainSpec, load_terrain, open_terrain
from tests.campaigns.layers import BOX_M, LAT, LON, Layout, hills, layouts, run

NAMES = [layout.name for layout in layouts(1)]


def grid(cell: float, z: np.ndarray, west: float = 0.0, north: float = 0.0) -> Window:
    rows, cols = z.shape
    return Window(z, GridMap.affine(west, north, cell, cell), np.arange(cols), np.arange(rows), ())


def layer(cell: float, z: np.ndarray, **at: float) -> TerrainLayer:
    window = grid(cell, z, **at)
    return TerrainLayer(window, cell_m(window), f"{cell:g} m")


@pytest.mark.nightly_but("at a sea")
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES[0:1] + NAMES[3:4] + NAMES[5:6] + NAMES[7:8] + NAMES[9:])
def test_no_ground_lies_outside_the_two_heights_of_layers(name: str, tmp_path: Path) -> None:
    wider = 2.0 if name == "equally fine" else 6.0  # and still finer than the file beside them
    layout = next(one for one in layouts(7, wider) if one.name == name)
    outcome = run(layout, tmp_path, 1500, 7)
    assert outcome.wrong == 0, outcome
    assert outcome.known > 1200


@pytest.mark.nightly
@pytest.mark.parametrize("name", NAMES)
def test_no_ground_lies_outside_the_two_heights_at_twenty_thousand_places(name: str, tmp_path: Path) -> None:
    layout = next(one for one in layouts(11) if one.name == name)
    assert run(layout, tmp_path, 20_000, 11).wrong == 0


@pytest.mark.nightly
def test_the_oracle_sees_a_seam_that_is_judged_by_one_height(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The finest heights alone, as a merge would keep them, lie below the ground beside a seam."""
    layout = next(one for one in layouts(7, 4.0) if one.name == "a cliff of forty metres")
    flat = Layout(layout.name, [replace(f) for f in layout.files])

    def as_merged(spec: TerrainSpec, frame: Frame, box: tuple[float, float, float, float], *, where: str) -> object:
        surface = load_terrain(spec, frame, box, where=where)
        return replace(surface, high_m=surface.ground_m, top_m=surface.ground_m)

    monkeypatch.setattr("tests.campaigns.layers.load_terrain", as_merged)
    assert run(flat, tmp_path, 3000, 7).wrong > 20


def test_the_finer_layer_counts_where_it_is_known_and_the_coarser_beside_it() -> None:
    fine = np.full((9, 9), np.nan)
    fine[2:7, 2:7] = 50.0
    coarse = np.full((4, 4), 10.0)
    found = mixed([layer(10.0, fine), layer(40.0, coarse, west=-20.0, north=20.0)])
    assert found.low_m is not None
    assert (found.heights_m[3:6, 3:6] == 50.0).all()
    assert (found.low_m[3:6, 3:6] == 50.0).all()
    assert (found.heights_m[2, 2:7] == 50.0).all()  # a seam: between both
    assert found.low_m[2, 2:7] == pytest.approx(10.0)
    assert found.heights_m[0] == pytest.approx(10.0)
    assert not np.isnan(found.heights_m).any()
    (note,) = found.notes
    assert note.code == "terrain_of_layers"


def test_ground_that_no_layer_knows_all_over_a_cell_is_unknown() -> None:
    fine = np.full((9, 9), np.nan)
    fine[:, :4] = 50.0
    coarse = np.full((4, 4), 10.0)
    coarse[1, 2] = np.nan  # its patches from column 1 on are unknown
    found = mixed([layer(10.0, fine), layer(40.0, coarse)])
    assert np.isnan(found.heights_m[:, 4:]).all()
    assert (found.heights_m[:, :3] == 50.0).all()


@pytest.mark.nightly
def test_sea_is_ground_at_zero_where_no_tile_knows_any_but_not_beside_cliffs(tmp_path: Path) -> None:
    layout = next(one for one in layouts(3, 4.0) if one.name == "at a sea")
    low = replace(layout.files[0], ground=hills(3, 0.02, 1.0), half_m=600.0, holes=[(0.0, 0.0, 90.0)])
    high = replace(low, name="crest", ground=hills(3, 0.2, 300.0), half_m=3000.0)
    for file, sea_m in ((low, 0.0), (high, np.nan)):
        file.write(tmp_path)
        spec = TerrainSpec(dem=(str(file.path),), vertical_datum="EGM96", sea=True)
        surface = load_terrain(spec, Frame(LAT, LON), (-BOX_M, -BOX_M, BOX_M, BOX_M), where="m")
        assert float(surface.high_at(0.0, 0.0)) == pytest.approx(sea_m, nan_ok=True)
    assert any(note.code.startswith("zeros_are_voids") for note in surface.info["notes"])


def test_the_finest_comes_first_and_cells_that_are_much_too_long_are_refused() -> None:
    z = np.zeros((40, 40))
    a, b = layer(5.0, z), layer(2.0, z)
    assert finest_first([a, b]) == [b, a]
    long = Window(z, GridMap.affine(0.0, 0.0, 30.0, 0.05), np.arange(40), np.arange(40), ())
    z[0, 0] = np.nan
    with pytest.raises(InputError, match="much longer than wide"):
        mixed([b, TerrainLayer(long, 30.0, "strips")])


@pytest.mark.nightly
def test_files_on_too_many_grids_are_refused_with_a_cure(tmp_path: Path) -> None:
    file = replace(layouts(1)[0].files[0], half_m=100.0)
    paths = []
    for number in range(22):
        one = replace(file, name=f"f{number}", cell=(file.cell[0] * (1.0 + 0.0137 * number), file.cell[1]))
        one.write(tmp_path)
        paths.append(str(one.path))
    with pytest.raises(InputError, match="lie on 22 grids, more than 20: bring them together"):
        open_terrain(TerrainSpec(dem=tuple(paths), vertical_datum="EGM96"), where="m")
