"""Missions over every kind of file that they may read, each with its maker's files: no list of gcsplan's is used.

A `Case` has the files that the mission reads, and those that do not exist and would count if they appeared.
"""

from __future__ import annotations

import json
import struct
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
import shapely
import yaml
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from gcsplan.arrays import Floats
from gcsplan.dem.cache import Cache, TileRecord, text_of
from gcsplan.dem.dat_file import file_name, packed
from gcsplan.dem.sources import GLO30
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import PostHeights, TerrainGrid
from gcsplan.world.terrain.input_files import sha256_of
from tests.mission_file.published.made import collection, ed269, ed318, openaip, volume
from tests.support.tiles import tile

START, GOAL = [47.4, 8.4], [47.4, 8.412]
BOX = shapely.box(8.405, 47.41, 8.407, 47.412)
"""A zone beside the way."""

SCALED = '<PAMDataset><PAMRasterBand band="1"><Offset>{}</Offset><Scale>2</Scale></PAMRasterBand></PAMDataset>'
NAMING = (
    '<PAMDataset><Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">:::BASE:::far.ovr</MDI></Metadata></PAMDataset>'
)
WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]]'
)
KML = (
    "<kml><Placemark><name>a</name><Polygon><outerBoundaryIs><LinearRing><coordinates>8.405,47.41 8.407,47.41 "
    "8.407,47.412</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></kml>"
)
OPENAIR = (
    "AC R\nAN BESIDE\nAL GND\nAH FL100\n"
    "DP 47:24:36 N 008:24:18 E\nDP 47:24:36 N 008:24:25 E\nDP 47:24:43 N 008:24:25 E\n"
)


@dataclass
class Case:
    """A mission and its files; ``terrain`` and ``zones`` are its keys, ``reads`` and ``absent`` what it reads."""

    folder: Path
    terrain: dict[str, Any] = field(default_factory=lambda: {"flat_m": 400})
    zones: list[dict[str, Any]] = field(default_factory=list)
    reads: list[Path] = field(default_factory=list)
    absent: list[Path] = field(default_factory=list)

    @property
    def mission(self) -> Path:
        """The mission file."""
        return self.folder / "m.yaml"

    def file(self, name: str, content: str | bytes | None = None) -> Path:
        """A file that the mission reads, with this content unless it is written already."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if content is not None:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        self.reads.append(path)
        return path

    def without(self, *names: str) -> None:
        """Files that are not there and would be read."""
        self.absent += [self.folder / name for name in names]

    def write(self) -> Case:
        """Write the mission file."""
        self.absent = [path for path in self.absent if not path.exists()]
        vehicle = {
            "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 12], "start": START, "goal": GOAL,
        }  # fmt: skip
        whole = {"version": 1, "terrain": self.terrain, "limits": {"min_agl_m": 30}, "vehicles": [vehicle]}
        self.file("m.yaml", yaml.safe_dump(whole | ({"no_fly": self.zones} if self.zones else {})))
        return self


def hills(lat_deg: Floats, lon_deg: Floats) -> Floats:
    """Ground, metres."""
    return np.asarray(400.0 + 10.0 * np.sin(lat_deg * 300.0) * np.cos(lon_deg * 200.0))


def tif(path: Path, west: float = 8.36, cols: int = 90, *, placed: bool = True, level: float = 0.0) -> None:
    """A GeoTIFF of 0.001° cells north of 47.36°."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lon, lat = np.meshgrid(west + 0.001 * np.arange(cols), 47.44 - 0.001 * np.arange(80))
    more: dict[str, Any] = (
        {"transform": Affine(0.001, 0.0, west, 0.0, -0.001, 47.44), "crs": "EPSG:4326"} if placed else {}
    )
    _write(path, (hills(lat, lon) + level).astype("float32"), **more)


def _write(path: Path, cells: Any, **more: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        rows, cols = cells.shape
        with rasterio.open(
            path, "w", driver="GTiff", width=cols, height=rows, count=1, dtype=cells.dtype, **more
        ) as out:
            out.write(cells, 1)
            out.update_tags(INTERNAL_MASK_FLAGS_1=2)


SIDECARS = ("dem.tif.ovr", "dem.tif.msk", "dem.aux.xml", "dem_rpc.txt", "dem.tif.aux.xml")


def geotiff(case: Case) -> None:
    """A GeoTIFF, alone."""
    tif(case.file("dem.tif"))
    case.terrain = {"dem": "dem.tif", "vertical_datum": "EGM96"}
    case.without(*SIDECARS)


def scaled(case: Case) -> None:
    """A GeoTIFF whose sidecar states scale and offset."""
    geotiff(case)
    case.file("dem.tif.aux.xml", SCALED.format(10))


def naming(case: Case) -> None:
    """A GeoTIFF whose sidecar names another file as its overviews."""
    geotiff(case)
    case.file("dem.tif.aux.xml", NAMING)
    tif(case.file("far.ovr"))


def masked(case: Case) -> None:
    """A GeoTIFF with a mask in a file of its own."""
    geotiff(case)
    _write(case.file("dem.tif.msk"), np.full((80, 90), 255, "uint8"))


def world_file(case: Case) -> None:
    """A GeoTIFF that only a world file places."""
    tif(case.file("dem.tif"), placed=False)
    case.file("dem.tfw", "0.001\n0\n0\n-0.001\n8.3605\n47.4395\n")
    case.terrain = {"dem": "dem.tif", "vertical_datum": "EGM96", "crs": "EPSG:4326"}
    case.without("dem.tif.aux.xml")


def ascii_grid(case: Case) -> None:
    """An ESRI grid and its .prj."""
    rows = "\n".join(" ".join(str(400 + (i + j) % 9) for j in range(90)) for i in range(80))
    head = "ncols 90\nnrows 80\nxllcorner 8.36\nyllcorner 47.36\ncellsize 0.001\n"
    case.file("dem.asc", head + rows + "\n")
    case.file("dem.prj", WGS84)
    case.terrain = {"dem": "dem.asc", "vertical_datum": "EGM96"}
    case.without("dem.asc.aux.xml", "dem.asc.ovr")


def linked_grid(case: Case) -> None:
    """An ESRI grid by a link: what belongs to it lies beside the grid."""
    ascii_grid(case)
    (case.folder / "elsewhere").mkdir()
    case.reads.clear()
    for name in ("dem.asc", "dem.prj"):
        (case.folder / name).rename(case.folder / "elsewhere" / name)
        case.file(f"elsewhere/{name}")
    (case.folder / "dem.asc").symlink_to("elsewhere/dem.asc")
    case.absent.clear()
    case.without("elsewhere/dem.asc.aux.xml")


def _hgt() -> bytes:
    row, col = np.mgrid[0:1201, 0:1201]
    return bytes((400 + (row + col) % 7).astype(">i2").tobytes())


def hgt(case: Case) -> None:
    """An SRTM tile."""
    case.file("N47E008.hgt", _hgt())
    case.terrain = {"dem": "N47E008.hgt", "vertical_datum": "EGM96"}
    case.without("N47E008.hgt.aux.xml")


def hgt_zip(case: Case) -> None:
    """A zipped SRTM tile."""
    path = case.file("N47E008.hgt.zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N47E008.hgt", _hgt())
    case.terrain = {"dem": "N47E008.hgt.zip", "vertical_datum": "EGM96"}


def folder_of_tiles(case: Case) -> None:
    """A folder of two tiles, one with a sidecar."""
    tif(case.file("tiles/a.tif"), 8.36, 45)
    tif(case.file("tiles/b.tif"), 8.405, 45)
    case.file("tiles/b.tif.aux.xml", SCALED.format(0).replace("2", "1", 1))
    case.terrain = {"dem": "tiles", "vertical_datum": "EGM96"}
    case.without("tiles/c.tif", "tiles/a.tif.aux.xml")


def list_of_tiles(case: Case) -> None:
    """Two tiles, by name; one is a link."""
    tif(case.file("a.tif"), 8.36, 45)
    tif(case.file("elsewhere/b.tif"), 8.405, 45)
    (case.folder / "b.tif").symlink_to("elsewhere/b.tif")
    case.terrain = {"dem": ["a.tif", "b.tif"], "vertical_datum": "EGM96"}
    case.without("elsewhere/b.tif.aux.xml")


def dat_files(case: Case) -> None:
    """A folder of ArduPilot's terrain files."""
    grid = TerrainGrid()
    posts = PostHeights(grid, hills)
    south, west, north, east = (x * 1e7 for x in (47.32, 8.32, 47.48, 8.48))
    blocks = list(grid.blocks_within(south, west, north, east))
    for cell in sorted({block.cell for block in blocks}):
        case.file(f"dat/{file_name(cell)}", packed(grid, cell, {b: posts.block(b) for b in blocks if b.cell == cell}))
    case.terrain = {"dem": "dat", "vertical_datum": "EGM96"}
    case.without("dat/N48E008.DAT")


def published(case: Case) -> None:
    """A published source, out of a cache in the mission's folder."""
    kept, cell = Cache(GLO30, case.folder / "cache"), Cell(47, 8)
    kept.folder.mkdir(parents=True)
    path = case.file(f"cache/{GLO30.name}/{cell.name}.tif", tile(cell))
    record = TileRecord(
        cell.name, GLO30.name, "tile", GLO30.kind, GLO30.vertical_datum, "2026-01-01T00:00:00Z",
        bytes=path.stat().st_size, sha256=sha256_of(path),
    )  # fmt: skip
    case.file(f"cache/{GLO30.name}/{cell.name}.json", text_of(record))
    case.terrain = {"dem": GLO30.name}
    case.without(GLO30.name, f"cache/{GLO30.name}/{cell.name}.tif.aux.xml")


def geoid(case: Case) -> None:
    """Heights above the ellipsoid, and a grid of the geoid."""
    tif(case.file("dem.tif"))
    rows = np.full((5, 5), 48.0, ">f4")
    case.file("egm.gtx", struct.pack(">4d2i", 47.0, 8.0, 0.25, 0.25, 5, 5) + rows.tobytes())
    case.terrain = {"dem": "dem.tif", "vertical_datum": "WGS84", "geoid_grid": "egm.gtx"}
    case.without("egm.gtx.aux.xml")


def canopy(case: Case) -> None:
    """A raster of trees."""
    geotiff(case)
    tif(case.file("trees.tif"), level=-385.0)
    case.terrain |= {"canopy": "trees.tif"}
    case.without("trees.tif.aux.xml", "trees.tif.msk")


def _zone(case: Case, name: str, content: str | bytes | None = None) -> Path:
    case.zones = [{"file": name}]
    return case.file(name, content)


def geojson(case: Case) -> None:
    """Zones of GeoJSON."""
    one = {"type": "Feature", "properties": {"name": "a"}, "geometry": shapely.geometry.mapping(BOX)}
    _zone(case, "z.geojson", json.dumps({"type": "FeatureCollection", "features": [one]}))


def kml(case: Case) -> None:
    """Zones of KML."""
    _zone(case, "z.kml", KML)


def kmz(case: Case) -> None:
    """Zones of KMZ."""
    with zipfile.ZipFile(_zone(case, "z.kmz"), "w") as archive:
        archive.writestr("doc.kml", KML)


def table(case: Case) -> None:
    """Circles of a table."""
    _zone(case, "z.csv", "name,lat,lon,radius_m\na,47.41,8.406,50\n")


def openair(case: Case) -> None:
    """Zones of OpenAir."""
    _zone(case, "z.txt", OPENAIR)


def authority(case: Case) -> None:
    """Zones of ED-269."""
    _zone(case, "z.json", json.dumps({"features": [ed269(volume(horizontalProjection=_shape()))]}))


def authority_318(case: Case) -> None:
    """Zones of ED-318."""
    layer = {"upper": 150, "upperReference": "AGL", "lower": 0, "lowerReference": "AGL", "uom": "m"}
    _zone(case, "z.json", json.dumps(collection(ed318(_shape() | {"layer": layer}))))


def open_aip(case: Case) -> None:
    """Zones of openAIP."""
    _zone(case, "z.json", json.dumps({"items": [openaip(geometry=_shape())]}))


def _shape() -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [[[x, y] for x, y in BOX.exterior.coords]]}


def _vector(path: Path) -> None:
    import pyogrio

    shapes = shapely.to_wkb(np.array([BOX], dtype=object))
    pyogrio.raw.write(
        path,
        shapes,
        [np.array(["900 m AGL"], dtype=object)],
        ["ceiling"],
        geometry_type="Polygon",
        crs="EPSG:4326",
    )


def shapefile(case: Case) -> None:
    """Zones of a Shapefile: its ceilings are in the .dbf, its coordinate system in the .prj."""
    _vector(_zone(case, "z.shp"))
    for suffix in (".dbf", ".shx", ".prj", ".cpg"):
        case.file(f"z{suffix}")
    case.without("z.CPG")


def zipped_shapefile(case: Case) -> None:
    """A Shapefile in a zip archive."""
    (case.folder / "inside").mkdir()
    _vector(case.folder / "inside" / "z.shp")
    with zipfile.ZipFile(_zone(case, "z.zip"), "w") as archive:
        for file in sorted((case.folder / "inside").iterdir()):
            archive.write(file, file.name)


def geopackage(case: Case) -> None:
    """Zones of a GeoPackage."""
    _vector(_zone(case, "z.gpkg"))
    case.without("z.gpkg-wal", "z.gpkg-journal")


def flatgeobuf(case: Case) -> None:
    """Zones of FlatGeobuf."""
    _vector(_zone(case, "z.fgb"))


CASES: Mapping[str, Callable[[Case], None]] = {
    make.__name__: make
    for make in (
        geotiff, scaled, naming, masked, world_file, ascii_grid, hgt, hgt_zip, folder_of_tiles, list_of_tiles,
        dat_files, published, geoid, canopy, geojson, kml, kmz, table, openair, authority, authority_318, open_aip,
        linked_grid, shapefile, zipped_shapefile,
        geopackage, flatgeobuf,
    )
}  # fmt: skip


def made(kind: str, folder: Path) -> Case:
    """A case of that kind in an empty folder."""
    folder.mkdir(parents=True, exist_ok=True)
    case = Case(folder)
    CASES[kind](case)
    return case.write()
