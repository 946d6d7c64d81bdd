"""Ground out of the cache, compared with bilinear interpolation of the function that the tiles were made from."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.dem.cache import Cache, MissingTiles, TileRecord, text_of
from gcsplan.dem.sources import GLO30, SRTM, DemSource, cells_in
from gcsplan.dem.terrain import open_dem
from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.options_world import OpenWorld, WorldOptions
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.input_files import sha256_of
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.terrain import TerrainSpec
from tests.support.tiles import ROWS, height_at, heights_of, tile

BOX = (-3000.0, -3000.0, 3000.0, 3000.0)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache; whoever opens a socket fails."""
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "cache"))

    def nobody(*_: object, **__: object) -> None:
        raise AssertionError("the network was used")

    monkeypatch.setattr(socket, "socket", nobody)
    monkeypatch.setattr(socket, "create_connection", nobody)
    return tmp_path / "cache"


def hold(
    folder: Path, cell: Cell, source: DemSource = GLO30, state: str = "tile", heights: Floats | None = None
) -> None:
    """Put a tile into the cache, or a record that there is none."""
    kept = Cache(source, folder)
    kept.folder.mkdir(parents=True, exist_ok=True)
    path, size, checksum = kept.tile_path(cell), 0, ""
    if state == "tile":
        path.write_bytes(tile(cell, source, heights))
        size, checksum = path.stat().st_size, sha256_of(path)
    record = TileRecord(
        cell.name, source.name, state, source.kind, source.vertical_datum, "2026-01-01T00:00:00Z", bytes=size,  # type: ignore[arg-type]
        sha256=checksum,
    )  # fmt: skip
    kept.record_path(cell).write_text(text_of(record))


def surface_at(
    at: tuple[float, float], source: DemSource = GLO30, box: Any = BOX, **keys: Any
) -> tuple[Surface, Frame]:
    frame = Frame(*at)
    terrain = open_dem(TerrainSpec(dem=(source.name,), **keys), where="terrain")
    return terrain.around(frame, box).load(frame, box), frame


def refusal(at: tuple[float, float], **keys: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        surface_at(at, **keys)
    return caught.value


def by_hand(cell: Cell, lat_deg: Floats, lon_deg: Floats, source: DemSource = GLO30, rows: int = ROWS) -> Floats:
    """Bilinear between the nodes of the grid that a tile is a part of."""
    cols = rows * source.columns_of(cell) // 3600
    r, c = (cell.lat_deg + 1 - lat_deg) * rows, (lon_deg - cell.lon_deg) * cols
    j, i = np.floor(r), np.floor(c)
    v, u = r - j, c - i

    def z(row: Floats, col: Floats) -> Floats:
        return height_at(cell.lat_deg + 1 - row / rows, cell.lon_deg + col / cols)

    above, below = (1 - u) * z(j, i) + u * z(j, i + 1), (1 - u) * z(j + 1, i) + u * z(j + 1, i + 1)
    return np.asarray((1 - v) * above + v * below)


def places(frame: Frame, n: int = 300) -> tuple[Floats, Floats, Floats, Floats]:
    """East, north, latitude and longitude of random points in the box."""
    rng = np.random.default_rng(2)
    e, n_m = rng.uniform(-2900.0, 2900.0, (2, n))
    degrees = np.asarray(frame.to_degrees(e, n_m))
    return e, n_m, degrees[..., 0], degrees[..., 1]


@pytest.mark.first_quick
@pytest.mark.parametrize("source", [GLO30, SRTM], ids=lambda s: s.name)
def test_ground_is_that_of_the_source_with_its_datum_and_its_kind(cache: Path, source: DemSource) -> None:
    hold(cache, Cell(36, -85), source)
    surface, frame = surface_at((36.5, -84.5), source)
    e, n, lat, lon = places(frame)
    assert surface.ground_at(e, n) == pytest.approx(by_hand(Cell(36, -85), lat, lon, source), abs=0.05)
    info = surface.info
    assert info["vertical_datum"] == {"copernicus-glo30": "EGM2008", "srtm": "EGM96"}[source.name]
    assert (info["dem_source"], info["dem_kind"], info["bare_dem"]) == (source.name, "surface", False)
    assert info["dem_tiles"] == "N36W085"
    assert any(n.code == "terrain_is_a_surface" for n in notes_on(surface.info))
    assert info["dem_sha256"] == sha256_of(Cache(source, cache).tile_path(Cell(36, -85)))


def test_four_tiles_join_without_a_gap(cache: Path) -> None:
    for cell in (Cell(36, -85), Cell(36, -84), Cell(35, -85), Cell(35, -84)):
        hold(cache, cell)
    surface, frame = surface_at((36.0, -84.0))
    e, n, _, _ = places(frame)
    assert np.isfinite(surface.ground_at(e, n)).all()
    lat, lon = np.array([35.99, 36.01]), np.array([-83.99, -84.01])
    for a in lat:
        for o in lon:
            at = frame.to_plane(a, o)
            node = surface.ground_at(at[0], at[1])
            assert 200.0 < node < 400.0


@pytest.mark.slow
@pytest.mark.parametrize("south", [49, 59, 69, 79, 84, -51])
def test_tiles_with_columns_of_different_widths_join(cache: Path, south: int) -> None:
    """Each side is bilinear in its own tile; between the last row of one and the first of the other nothing is lost."""
    north, below = Cell(south + 1, 10), Cell(south, 10)
    assert len({GLO30.columns_of(north), GLO30.columns_of(below)}) == 2
    rows = 180  # of which every width of columns is a whole part
    for cell in (Cell(lat, lon) for lat in (south, south + 1) for lon in (9, 10, 11)):
        hold(cache, cell, heights=heights_of(cell, rows=rows))
    surface, frame = surface_at((south + 1.0, 10.5))
    assert not any(n.code == "nodes_unknown" for n in notes_on(surface.info))
    for cell, offset_m in ((north, 1500.0), (below, -1500.0)):  # beyond the row of cells that both share
        e = np.random.default_rng(3).uniform(-2500.0, 2500.0, 100)
        n = offset_m + np.linspace(-300.0, 300.0, 100)
        degrees = np.asarray(frame.to_degrees(e, n))
        expected = by_hand(cell, degrees[..., 0], degrees[..., 1], rows=rows)
        assert surface.ground_at(e, n) == pytest.approx(expected, abs=0.05)


def test_wide_columns_of_neighbours_join_and_their_voids_stay_unknown(cache: Path) -> None:
    holed = heights_of(Cell(50, 10))
    holed[20, 12] = np.nan
    hold(cache, Cell(50, 10), heights=holed)
    for cell in (Cell(50, 11), Cell(49, 10), Cell(49, 11)):
        hold(cache, cell)
    surface, frame = surface_at((50.4, 11.0), box=(-60_000.0, -60_000.0, 60_000.0, 60_000.0))
    east = np.linspace(-9000.0, 9000.0, 50)
    assert np.isfinite(surface.ground_at(east, np.zeros(50))).all()  # over the line between the two
    dx, dy = 1.0 / 24, 1.0 / 36
    node = 51.0 - 20 * dy, 10.0 + 12 * dx
    for off, known in ((0.0, False), (0.9, False), (-0.9, False), (1.1, True), (-1.1, True)):
        at = frame.to_plane(node[0], node[1] + off * dx)
        assert np.isfinite(surface.ground_at(at[0], at[1])) == known, off


def test_the_antimeridian_is_no_edge_of_a_source(cache: Path) -> None:
    for cell in (Cell(-18, 179), Cell(-18, -180)):
        hold(cache, cell)
    surface, _ = surface_at((-17.5, 180.0))
    assert np.isfinite(surface.ground_at(np.linspace(-2000.0, 2000.0, 9), np.zeros(9))).all()


def test_what_else_is_in_the_cache_changes_nothing(cache: Path) -> None:
    hold(cache, Cell(36, -85))
    first, _ = surface_at((36.5, -84.5))
    for cell in (Cell(37, -85), Cell(36, -84), Cell(36, -86)):
        hold(cache, cell)
    second, frame = surface_at((36.5, -84.5))
    assert second.info == first.info
    terrain = open_dem(TerrainSpec(dem=("copernicus-glo30",)), where="").around(frame, BOX)
    wide = (-200_000.0, -200_000.0, 200_000.0, 200_000.0)
    assert np.array_equal(terrain.load(frame, terrain.extent(frame, BOX)).ground_m, terrain.load(frame, wide).ground_m)


# -- what is not there -------------------------------------------------------------------------------------------------


def test_a_tile_that_is_not_cached_is_bad_input_with_the_command(cache: Path) -> None:
    error = refusal((36.99, -84.5))
    assert error.exit_code == 2
    assert "run `gcsplan dem fetch --source copernicus-glo30 --tiles N37W085,N36W085`" in error.message
    [problem] = error.problems
    assert isinstance(problem, MissingTiles)
    assert problem.cells == (Cell(37, -85), Cell(36, -85))
    hold(cache, Cell(37, -85))
    assert "1 copernicus-glo30 tile of this area is not in the cache" in refusal((36.99, -84.5)).message


def test_a_tile_that_was_changed_in_the_cache_is_not_used(cache: Path) -> None:
    hold(cache, Cell(36, -85))
    path = Cache(GLO30, cache).tile_path(Cell(36, -85))
    data = path.read_bytes()
    for bad in (data[:-1] + bytes([data[-1] ^ 1]), bytes(len(data))):
        path.write_bytes(bad)
        error = refusal((36.5, -84.5))
        assert "damaged" in error.message
        assert "--tiles N36W085" in error.message


def test_sea_is_0_m_and_is_told(cache: Path) -> None:
    hold(cache, Cell(10, 10))
    hold(cache, Cell(10, 11), state="sea")
    surface, _ = surface_at((10.5, 11.0))
    assert surface.ground_at(2000.0, 0.0) == 0.0
    assert surface.ground_at(-2900.0, 0.0) > 1.0
    assert surface.info["sea_tiles"] == "N10E011"
    assert Note("tiles_are_sea", tiles="N10E011", source="copernicus-glo30") in notes_on(surface.info)


@pytest.mark.first_quick
@pytest.mark.parametrize("source", [GLO30, SRTM], ids=lambda s: s.name)
def test_open_sea_alone_is_ground_too(cache: Path, source: DemSource) -> None:
    for cell in (Cell(10, 10), Cell(10, 11)):
        hold(cache, cell, source, state="sea")
    surface, _ = surface_at((10.5, 11.0), source)
    assert not surface.ground_m.any()


def test_a_tile_that_the_source_lacks_is_unknown_ground_and_never_0_m(cache: Path) -> None:
    hold(cache, Cell(40, 45))
    hold(cache, Cell(40, 46), state="absent")
    surface, _ = surface_at((40.5, 46.0))
    assert np.isnan(surface.ground_at(2000.0, 0.0))
    assert any("does not publish N40E046, and GLO-90 shows land there" in str(n) for n in notes_on(surface.info))
    hold(cache, Cell(40, 45), state="absent")
    assert "does not publish N40E045,N40E046" in refusal((40.5, 46.0)).message


def test_a_mission_may_say_that_it_is_sea(cache: Path) -> None:
    hold(cache, Cell(40, 45))
    hold(cache, Cell(40, 46), state="absent")
    surface, _ = surface_at((40.5, 46.0), sea=True)
    assert surface.ground_at(2000.0, 0.0) == 0.0
    assert Note("tiles_are_sea_by_mission", tiles="N40E046") in notes_on(surface.info)
    assert "not in the cache" in refusal((41.5, 46.0), sea=True).message  # nobody knows that it is not published


# -- in a mission ------------------------------------------------------------------------------------------------------


def mission(**terrain: object) -> dict[str, object]:
    return {
        "version": 1, "terrain": {"dem": "copernicus-glo30", **terrain}, "limits": {"min_agl_m": 60},
        "vehicles": [
            {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.5, -84.5], "goal": [36.51, -84.48]}
        ],
    }  # fmt: skip


def test_a_mission_names_a_source(cache: Path) -> None:
    with pytest.raises(InputError, match=r"terrain\.dem: 1 copernicus-glo30 tile .* --tiles N36W085`"):
        load_mission(mission())
    hold(cache, Cell(36, -85))
    read = load_mission(mission(vertical_datum="EGM2008", obstacle_height_m=20))
    assert read.inputs["dem_kind"] == "surface"
    assert read.inputs["vertical_datum"] == "EGM2008"
    assert read.surface.top_m[5, 5] == read.surface.ground_m[5, 5] + 20.0


@pytest.mark.parametrize(
    ("terrain", "words"),
    [
        ({"vertical_datum": "EGM96"}, "the mission states EGM96, the raster itself states EGM2008"),
        ({"crs": "EPSG:4326"}, r"terrain\.crs: copernicus-glo30 states it itself"),
        ({"height_unit": "ft"}, r"terrain\.height_unit: copernicus-glo30 states it itself"),
        ({"dem": ["copernicus-glo30", "more.tif"]}, r"terrain\.dem: copernicus-glo30 stands alone"),
        ({"dem": "copernicus-glo90"}, "copernicus-glo90 is not there"),
        ({"sea": "yes"}, r"terrain\.sea"),
    ],
)
def test_what_contradicts_a_source_is_refused(cache: Path, terrain: dict[str, object], words: str) -> None:
    hold(cache, Cell(36, -85))
    with pytest.raises(InputError, match=words):
        load_mission(mission(**terrain))


def test_a_file_that_has_the_name_of_a_source_is_that_file(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "srtm").write_bytes(tile(Cell(36, -85)))
    monkeypatch.chdir(tmp_path)
    read = load_mission(mission(dem="srtm", vertical_datum="EGM96"))
    assert "dem_source" not in read.inputs
    assert read.inputs["bare_dem"] is True


def test_a_check_without_a_mission_takes_a_source_too(cache: Path) -> None:
    world = OpenWorld(WorldOptions(terrain={"dem": ["copernicus-glo30"]}, limits={"min_agl_m": 60.0}))
    with pytest.raises(InputError, match=r"--dem: 1 copernicus-glo30 tile .* --tiles N36W085`"):
        world.around([(36.5, -84.5)])
    hold(cache, Cell(36, -85))
    _, inputs = world.around([(36.5, -84.5)])
    assert inputs["dem_source"] == "copernicus-glo30"


@pytest.mark.nightly
def test_the_tiles_of_a_mission_are_those_of_its_first_window(cache: Path) -> None:
    hold(cache, Cell(36, -85))
    read = load_mission(mission())
    assert read.wider is not None
    wide = read.wider(30_000.0, 10_000_000)
    assert wide is not None
    assert wide.inputs["dem_tiles"] == "N36W085"
    assert [c.name for c in cells_in(read.frame, (-3000.0, -3000.0, 3000.0, 3000.0), where="")] == ["N36W085"]
