"""Formats of terrain files beside GeoTIFF: each is read as the same heights, and a .vrt leads nowhere else."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from rasterio.shutil import copy

from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.raster import open_raster
from gcsplan.world.terrain.terrain import TerrainSpec, load_terrain

FRAME, BOX = Frame(46.5, 14.5), (-500.0, -500.0, 500.0, 500.0)
DRIVERS = {
    "N46E014.hgt": "SRTMHGT", "a.dt1": "DTED", "a.img": "HFA", "a.nc": "netCDF", "a.vrt": "VRT", "a.xyz": "XYZ",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same heights in every format that the installed library writes."""
    made = tmp_path_factory.mktemp("formats")
    posts, cell = 1201, 1.0 / 1200.0
    z = (300.0 + np.add.outer(np.arange(posts) * 0.05, np.arange(posts) * 0.1)).astype("int16")
    at = Affine(cell, 0.0, 14.0 - cell / 2, 0.0, -cell, 47.0 + cell / 2)
    with rasterio.open(made / "N46E014.tif", "w", driver="GTiff", width=posts, height=posts, count=1, dtype="int16",
                       crs="EPSG:4326", transform=at, nodata=-32768) as out:  # fmt: skip
        out.write(z, 1)
    for name, driver in DRIVERS.items():
        if driver == "XYZ":  # 1.4 million lines take seconds
            copy(str(made / "small.tif"), str(made / name), driver=driver)
            continue
        if driver == "VRT":
            small = Affine(0.001, 0.0, 14.48, 0.0, -0.001, 46.52)
            with rasterio.open(made / "small.tif", "w", driver="GTiff", width=40, height=40, count=1, dtype="int16",
                               crs="EPSG:4326", transform=small) as out:  # fmt: skip
                out.write(z[:40, :40], 1)
        copy(str(made / "N46E014.tif"), str(made / name), driver=driver)
    with gzip.open(made / "N46E014.hgt.gz", "wb") as packed:
        packed.write((made / "N46E014.hgt").read_bytes())
    return made


def surface(file: Path, **keys: str) -> Surface:
    return load_terrain(TerrainSpec(dem=(str(file),), vertical_datum="EGM96", **keys), FRAME, BOX, where="m")


@pytest.mark.parametrize("name", [*(n for n in DRIVERS if n != "a.xyz"), "N46E014.hgt.gz"])
def test_every_format_of_the_installed_library_has_the_same_ground(folder: Path, name: str) -> None:
    before = sorted(folder.iterdir())
    assert surface(folder / name).ground_at(10.0, 20.0) == pytest.approx(
        surface(folder / "N46E014.tif").ground_at(10.0, 20.0)
    )
    assert sorted(folder.iterdir()) == before  # GDAL leaves nothing behind


def test_a_list_of_points_needs_its_coordinate_system(folder: Path) -> None:
    with pytest.raises(InputError, match="does not state its coordinate system"):
        surface(folder / "a.xyz")
    same = surface(folder / "small.tif").ground_at(10.0, 20.0)
    assert surface(folder / "a.xyz", crs="EPSG:4326").ground_at(10.0, 20.0) == pytest.approx(same)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("N46E014.tif", "/vsicurl/http://127.0.0.1:1/a.tif", "names a raster that is not there"),
        ("N46E014.tif", "request.xml", "which is no GeoTIFF: `rio convert"),
        ("<VRTRasterBand", '<VRTRasterBand subClass="VRTDerivedRasterBand"', "VRTDerivedRasterBand"),
        ("<SimpleSource>", "<SimpleSource><OpenOptions/>", "OpenOptions"),
        ("<VRTDataset", "<!DOCTYPE a><VRTDataset", "cannot be read"),
    ],
)
def test_a_vrt_that_leads_elsewhere_is_refused(folder: Path, tmp_path: Path, old: str, new: str, words: str) -> None:
    (tmp_path / "N46E014.tif").write_bytes((folder / "N46E014.tif").read_bytes())
    (tmp_path / "request.xml").write_text("<GDAL_WMS></GDAL_WMS>")
    file = tmp_path / "a.vrt"
    file.write_text((folder / "a.vrt").read_text().replace(old, new))
    with pytest.raises(InputError, match=words):
        open_raster(file, where="m")


@pytest.mark.nightly
def test_a_packed_tile_that_unpacks_to_more_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "N46E014.hgt.gz"
    with gzip.open(file, "wb") as packed:
        packed.write(bytes(30_000_000))
    with pytest.raises(InputError, match="unpacks to more"):
        open_raster(file, where="m")
