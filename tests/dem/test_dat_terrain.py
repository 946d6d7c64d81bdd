"""ArduPilot's .DAT files: written, read back, and as terrain, against a point-by-point second implementation."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.dem import dat_terrain
from gcsplan.dem.dat_file import RECORD_BYTES, crc_of, file_name, packed, read_dat
from gcsplan.dem.dat_terrain import bounds
from gcsplan.dem.terrain import open_dem
from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import GroundHeights, PostHeights, TerrainGrid
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.terrain import TerrainSpec
from tests.oracles import terrain_grid as oracle

BOX = (-2500.0, -2500.0, 2500.0, 2500.0)


def hills(lat_deg: Floats, lon_deg: Floats) -> Floats:
    return np.asarray(400.0 + 60.0 * np.sin(lat_deg * 300.0) * np.cos(lon_deg * 200.0))


def write(
    folder: Path, lat: float, lon: float, *, reach_deg: float = 0.08, grid: TerrainGrid | None = None,
    ground: GroundHeights = hills,
) -> Path:  # fmt: skip
    """Files with the blocks around a place."""
    grid = grid or TerrainGrid()
    posts = PostHeights(grid, ground)
    south, west, north, east = (x * 1e7 for x in (lat - reach_deg, lon - reach_deg, lat + reach_deg, lon + reach_deg))
    blocks = list(grid.blocks_within(south, west, north, east))
    folder.mkdir(exist_ok=True)
    for cell in sorted({block.cell for block in blocks}):
        mine = {b: posts.block(b) for b in blocks if b.cell == cell}
        (folder / file_name(cell)).write_bytes(packed(grid, cell, mine))
    return folder


def surface_of(dem: Path, lat: float, lon: float, box: Box = BOX) -> tuple[Frame, Surface]:
    frame = Frame(lat, lon)
    spec = TerrainSpec(dem=(str(dem),), vertical_datum="EGM96")
    return frame, open_dem(spec, where="terrain").around(frame, box).load(frame, box)


def interpolated(folder: Path, lat_e7: int, lon_e7: int) -> float:
    """What the autopilot reads from the files at a place, through the bytes alone; NaN where it has no data."""
    g = oracle.info_of(lat_e7, lon_e7)
    data = (folder / file_name(Cell(g.lat_degrees, g.lon_degrees))).read_bytes()
    row = oracle.blocks_a_row(g.lat_degrees, g.lon_degrees)
    at = (g.grid_idx_x * row + g.grid_idx_y) * 2048
    record = data[at : at + 2048]
    if len(record) < 2048:
        return math.nan
    bitmap, lat, lon, crc, version, spacing = struct.unpack("<QiiHHH", record[:22])
    if not bitmap:
        return math.nan
    assert abs(lat - g.grid_lat) <= 5
    assert abs(lon - g.grid_lon) <= 5
    assert (version, spacing, crc) == (1, 100, oracle.crc16(record[:16] + b"\0\0" + record[18:1821]))
    assert struct.unpack("<HHhb", record[1814:1821]) == (g.grid_idx_x, g.grid_idx_y, g.lon_degrees, g.lat_degrees)

    def post(_: int, __: int, north: int, east: int) -> float:
        x, y = north - g.grid_idx_x * 24, east - g.grid_idx_y * 28
        assert bitmap >> (x // 4 * 8 + y // 4) & 1
        return float(struct.unpack_from("<h", record, 22 + 2 * (32 * x + y))[0])

    return oracle.height(lat_e7, lon_e7, post)


@pytest.mark.parametrize(
    ("lat", "lon", "exact"),
    [
        (36.55, -84.40, True),  # inside a tile
        pytest.param(-33.45, 151.55, True, marks=pytest.mark.slow),
        (37.002, -84.005, False),  # four tiles
        pytest.param(-0.003, 0.004, False, marks=pytest.mark.slow),
        pytest.param(-36.55, -84.005, False, marks=pytest.mark.slow),
        pytest.param(60.0, 179.999, False, marks=pytest.mark.slow),  # the antimeridian
    ],
)
def test_the_surface_is_what_the_autopilot_reads_or_holds_it_between_two_heights(
    tmp_path: Path, lat: float, lon: float, exact: bool
) -> None:
    folder = write(tmp_path / "terrain", lat, lon, reach_deg=0.08)
    frame, surface = surface_of(folder, lat, lon)
    rng = np.random.default_rng(7)
    at = rng.uniform(-2400, 2400, (40, 2))
    degrees = frame.to_degrees(at[:, 0], at[:, 1])
    read = np.array([interpolated(folder, *(math.floor(x * 1e7) for x in d)) for d in degrees])
    over = surface.high_at(at[:, 0], at[:, 1]) - read
    under = read - surface.ground_at(at[:, 0], at[:, 1])
    assert np.isfinite(over).all()
    assert min(over.min(), under.min()) > -0.02  # places differ by up to 2 cm
    if exact:
        assert max(over.max(), under.max()) < 0.02
        assert not surface.differs
    else:
        mine = [(math.floor(a), math.floor(o)) == (math.floor(lat), math.floor(lon)) for a, o in degrees]
        near = np.abs((degrees + 0.5) % 1.0 - 0.5).min(axis=1) < 0.003
        assert over[np.array(mine) & ~near].max(initial=0.0) < 0.02
        assert max(over.max(), under.max()) < 30.0  # how far hills that rise by up to 1:5 are no plane


def test_a_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    folder = write(tmp_path, 36.55, -84.40, reach_deg=0.03)
    file = read_dat(folder / "N36W085.DAT", where="")
    posts = PostHeights(TerrainGrid(), hills)
    assert len(file.blocks) >= 4
    for block, heights in file.blocks.items():
        np.testing.assert_array_equal(heights, posts.block(block))
    assert file.notes == ()
    assert packed(file.grid, file.cell, file.blocks) == (folder / "N36W085.DAT").read_bytes()


def test_unknown_parts_and_missing_blocks_are_unknown_ground(tmp_path: Path) -> None:
    folder = write(tmp_path, 36.55, -84.40, reach_deg=0.03)
    path = folder / "N36W085.DAT"
    file = read_dat(path, where="")
    holed = {b: h.copy() for b, h in file.blocks.items()}
    middle = TerrainGrid().blocks_over(36.55e7, -84.40e7)[0]
    holed[middle][8:12, 8:12] = np.nan
    path.write_bytes(packed(file.grid, file.cell, holed))
    assert np.isnan(read_dat(path, where="").blocks[middle]).sum() == 16
    frame, surface = surface_of(folder, 36.55, -84.40)
    hole = file.grid.post_e7(file.cell, middle.north * 24 + 9.5, middle.east * 28 + 9.5)
    assert np.isnan(surface.ground_at(*frame.to_plane(hole[0] / 1e7, hole[1] / 1e7)))
    del holed[middle]
    path.write_bytes(packed(file.grid, file.cell, holed))
    frame, surface = surface_of(folder, 36.55, -84.40)
    assert np.isnan(surface.ground_at(*frame.to_plane(hole[0] / 1e7, hole[1] / 1e7)))


def damaged(data: bytes, change: str) -> bytes:
    """A file whose first block is spoilt in one way; its checksum is right unless that is the way."""
    out = bytearray(data)
    at = next(k for k in range(0, len(out), RECORD_BYTES) if any(out[k : k + 8]))
    record = bytearray(out[at : at + RECORD_BYTES])
    if change == "bit":
        record[500] ^= 4
    elif change == "version":
        struct.pack_into("<H", record, 18, 2)
    elif change == "spacing":
        struct.pack_into("<H", record, 20, 30)
    elif change == "corner":
        struct.pack_into("<i", record, 8, struct.unpack_from("<i", record, 8)[0] + 300)
    if change != "bit":
        struct.pack_into("<H", record, 16, crc_of(bytes(record)))
    out[at : at + RECORD_BYTES] = record
    return bytes(out)


@pytest.mark.parametrize(
    ("change", "words"),
    [("bit", "checksum"), ("version", "version 2"), ("spacing", "spacing is 30 m"), ("corner", "elsewhere")],
)
def test_a_block_that_the_autopilot_does_not_take_is_left_out_and_told(tmp_path: Path, change: str, words: str) -> None:
    path = write(tmp_path, 36.55, -84.40, reach_deg=0.03) / "N36W085.DAT"
    count = len(read_dat(path, where="").blocks)
    path.write_bytes(damaged(path.read_bytes(), change))
    file = read_dat(path, where="")
    assert len(file.blocks) == count - 1
    [note] = file.notes
    assert words in str(note)
    _, surface = surface_of(tmp_path, 36.55, -84.40)
    assert any(words in str(n) for n in notes_on(surface.info))


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("N36W085.DAT", b"\0" * 4096, "holds no block"),
        ("N36W085.DAT", b"\1" * 2000, "no terrain file of ArduPilot: 2000 bytes"),
        ("N36W085.DAT", b"\1" * 2048, "no good block of terrain: its checksum is wrong"),
        ("N36W085.DAT", b"", "is empty"),
        ("hills.DAT", b"\1" * 2048, "named after its south-west corner"),
        ("S10E010.DAT", b"\1" * 2048, "no .DAT file of this place, N36W085"),
    ],
)
def test_what_is_no_terrain_file_is_refused(tmp_path: Path, name: str, data: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=words):
        surface_of(tmp_path / name, 36.55, -84.40)


def test_a_datum_is_wanted_and_other_files_are_not_mixed_in(tmp_path: Path) -> None:
    folder = write(tmp_path / "a", 36.55, -84.40, reach_deg=0.03)
    frame = Frame(36.55, -84.40)
    with pytest.raises(InputError, match="vertical_datum"):
        open_dem(TerrainSpec(dem=(str(folder),)), where="terrain").around(frame, BOX)
    for dem, words in (
        ((str(folder), "x.tif"), "stand alone"),
        ((str(folder), str(folder)), "of one tile"),
        ((str(folder / "N37W085.DAT"),), "there is no file|no such file|not there"),
    ):
        with pytest.raises(InputError, match=words):
            open_dem(TerrainSpec(dem=dem, vertical_datum="EGM96"), where="terrain").around(frame, BOX)
    with pytest.raises(InputError, match="remove the key"):
        open_dem(TerrainSpec(dem=(str(folder),), crs="EPSG:4326"), where="terrain")


def test_files_of_two_spacings_are_refused(tmp_path: Path) -> None:
    write(tmp_path, 36.55, -84.0, reach_deg=0.03)
    write(tmp_path / "b", 36.55, -84.0, reach_deg=0.03, grid=TerrainGrid(50))
    (tmp_path / "N36W084.DAT").write_bytes((tmp_path / "b" / "N36W084.DAT").read_bytes())
    with pytest.raises(InputError, match="posts every"):
        surface_of(tmp_path, 36.55, -84.0)


def test_covers_asks_the_blocks(tmp_path: Path) -> None:
    terrain = open_dem(TerrainSpec(dem=(str(write(tmp_path, 36.55, -84.40)),), vertical_datum="EGM96"), where="t")
    assert terrain.covers(36.55, -84.40)
    assert not terrain.covers(36.9, -84.40)
    assert not terrain.covers(38.0, -84.40)


@pytest.mark.first_quick
@pytest.mark.parametrize(("lat", "lon"), [(35.9998, -84.5), (36.5, -84.0002), (46.9998, 8.5), (36.0002, -84.0002)])
@pytest.mark.parametrize("rise", [(0.5, 0.0), (0.0, 0.5), (-0.4, 0.4)], ids=["north", "east", "aslant"])
def test_a_plane_over_a_degree_line_has_one_height(
    tmp_path: Path, lat: float, lon: float, rise: tuple[float, float]
) -> None:
    """But for posts in whole metres, upwards; one row of posts beyond the line says nothing of the slope across it."""
    wide = math.cos(math.radians(lat))

    def plane(lat_deg: Floats, lon_deg: Floats) -> Floats:
        return np.asarray(2500.0 + 111_000.0 * (rise[0] * (lat_deg - lat) + rise[1] * wide * (lon_deg - lon)))

    folder = write(tmp_path / "t", lat, lon, reach_deg=0.05, ground=plane)
    _, surface = surface_of(folder, lat, lon, (-500.0, -500.0, 500.0, 500.0))
    east, north = (a.ravel() for a in np.meshgrid(np.linspace(-400.0, 400.0, 41), np.linspace(-400.0, 400.0, 41)))
    spread = surface.high_at(east, north) - surface.ground_at(east, north)
    assert float(spread.max()) < 2.1


def test_bounds_of_posts_on_a_plane_are_the_plane() -> None:
    row, col = (a.ravel() for a in np.meshgrid(np.arange(-3.0, 10.0) + 0.3, np.arange(-3.0, 12.0) - 0.4, indexing="ij"))
    heights = 100.0 + 3.0 * row - 2.0 * col
    high, low = bounds((7, 9), row, col, heights, heights)
    j, i = np.mgrid[0:7, 0:9]
    np.testing.assert_allclose(high, 100.0 + 3.0 * j - 2.0 * i)
    np.testing.assert_allclose(low, high)


@pytest.mark.parametrize("seed", range(4))
def test_bounds_hold_for_ground_that_is_bilinear_between_other_posts(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z, (down, left) = rng.normal(100.0, 10.0, (14, 16)), rng.uniform(0.0, 1.0, 2)
    row, col = (a.ravel() for a in np.meshgrid(np.arange(14) - 4.0 + down, np.arange(16) - 4.0 + left, indexing="ij"))
    high, low = bounds((6, 8), row, col, z.ravel(), z.ravel())
    y, x = rng.uniform(0.0, 5.0, 3000), rng.uniform(0.0, 7.0, 3000)

    def at(grid: Floats, r: Floats, c: Floats) -> Floats:
        j, i = np.floor(r).astype(int), np.floor(c).astype(int)
        v, u = r - j, c - i
        south = grid[j, i] * (1.0 - u) + grid[j, i + 1] * u
        return np.asarray(south * (1.0 - v) + (grid[j + 1, i] * (1.0 - u) + grid[j + 1, i + 1] * u) * v)

    true = at(z, y + 4.0 - down, x + 4.0 - left)
    assert (at(high, y, x) >= true - 1e-9).all()
    assert (at(low, y, x) <= true + 1e-9).all()
    assert np.isfinite(high).all()


def test_bounds_are_unknown_where_a_post_nearby_is() -> None:
    row, col = (a.ravel().astype(float) for a in np.mgrid[-2:9, -2:9])
    heights = np.full(len(row), 50.0)
    heights[(row == 3.0) & (col == 3.0)] = math.nan
    high, low = bounds((7, 7), row, col, heights, heights)
    assert np.isnan(high[3, 3])
    assert np.isnan(low[3, 3])
    assert high[0, 0] == low[0, 0] == 50.0


@pytest.mark.parametrize(("lat", "lon"), [(37.002, -84.005), (36.55, -84.40)])
def test_posts_that_are_joined_a_few_at_once_are_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lat: float, lon: float
) -> None:
    folder = write(tmp_path / "terrain", lat, lon, reach_deg=0.08)
    _, whole = surface_of(folder, lat, lon)
    monkeypatch.setattr(dat_terrain, "POSTS_AT_ONCE", 1)
    _, few = surface_of(folder, lat, lon)
    np.testing.assert_allclose(few.ground_m, whole.ground_m, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(few.top_m, whole.top_m, rtol=0.0, atol=1e-9)


def test_files_that_are_too_large_together_are_refused_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four files of 256 MB are a gigabyte, and took six."""
    folder = write(tmp_path / "terrain", 37.002, -84.005, reach_deg=0.03)
    sizes = sorted(f.stat().st_size for f in folder.iterdir())
    assert len(sizes) == 4
    monkeypatch.setattr(dat_terrain, "MOST_DAT_BYTES", sum(sizes))
    surface_of(folder, 37.002, -84.005)
    monkeypatch.setattr(dat_terrain, "MOST_DAT_BYTES", sum(sizes) - 1)
    with pytest.raises(InputError, match="take files of a larger TERRAIN_SPACING"):
        surface_of(folder, 37.002, -84.005)


def test_too_many_posts_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write(tmp_path / "terrain", 36.55, -84.40)
    monkeypatch.setattr(dat_terrain, "MOST_POSTS", 1000)
    with pytest.raises(InputError, match="larger TERRAIN_SPACING"):
        surface_of(folder, 36.55, -84.40)


def test_blocks_are_decoded_when_they_are_asked_for(tmp_path: Path) -> None:
    """As floats they take four times the file: 255 MB took 1.6 GB."""
    blocks = read_dat(write(tmp_path, 36.55, -84.40) / "N36W085.DAT", where="").blocks
    every = {block: blocks[block] for block in blocks}
    assert len(every) == len(blocks) == len(blocks.places)
    first, last = (100.0, 200.0), (50.0, 60.0)
    some = dict(blocks.within(first, last))
    for block, heights in some.items():
        np.testing.assert_array_equal(heights, every[block])
    held = {
        b for b in every
        if b.north * 24 <= 200 and (b.north + 1) * 24 >= 100 and b.east * 28 <= 60 and (b.east + 1) * 28 >= 50
    }  # fmt: skip
    assert set(some) == held
    assert not any(isinstance(v, np.ndarray) and v.dtype == float for v in vars(blocks).values())
