"""The map below a mission: an MBTiles or PMTiles file, or an address."""

from __future__ import annotations

import random
import sqlite3
from pathlib import Path

import pytest
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import write

from gcsplan.errors import InputError, UsageError
from gcsplan.page.base_map import BaseMap


def mbtiles(file: Path, form: str = "png") -> Path:
    with sqlite3.connect(file) as made:
        made.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        made.execute("CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)")
        made.executemany("INSERT INTO metadata VALUES (?, ?)", [("format", form), ("attribution", "© <b>someone</b>")])
        made.execute("INSERT INTO tiles VALUES (3, 4, 5, ?)", (b"picture",))
    made.close()
    return file


def pmtiles(file: Path, kind: TileType = TileType.PNG) -> Path:
    with write(str(file)) as made:
        made.write_tile(zxy_to_tileid(3, 4, 2), b"picture")
        made.finalize(
            {"tile_type": kind, "tile_compression": Compression.NONE, "min_zoom": 3, "max_zoom": 3},
            {"attribution": "© <b>someone</b>"},
        )
    return file


def test_tiles_of_a_pmtiles_file_are_served(tmp_path: Path) -> None:
    base = BaseMap(str(pmtiles(tmp_path / "a.pmtiles")))
    assert base.tile(3, 4, 2) == b"picture"
    assert base.tile(3, 4, 5) is base.tile(3, 99, 0) is base.tile(99, 10**30, 0) is None
    assert base.media_type == "image/png"
    assert base.as_dict() == {
        "tiles": "base/{z}/{x}/{y}", "minzoom": 3, "maxzoom": 3, "attribution": "© someone"
    }  # fmt: skip


def test_no_broken_pmtiles_file_ends_the_page(tmp_path: Path) -> None:
    whole = pmtiles(tmp_path / "a.pmtiles").read_bytes()
    draw, served, refused = random.Random(5), 0, 0
    for k in range(60):
        broken = tmp_path / f"{k}.pmtiles"
        damaged = bytearray(whole[: draw.randrange(len(whole))] if k % 2 else whole)
        for _ in range(draw.randrange(4) if damaged else 0):
            damaged[draw.randrange(len(damaged))] = draw.randrange(256)
        broken.write_bytes(damaged)
        try:
            BaseMap(str(broken)).tile(3, 4, 2)
            served += 1
        except InputError:
            refused += 1
    assert min(served, refused) > 5


def test_rows_of_a_file_count_from_the_south(tmp_path: Path) -> None:
    base = BaseMap(str(mbtiles(tmp_path / "a.mbtiles")))
    assert base.tile(3, 4, 2) == b"picture"
    assert base.tile(3, 4, 5) is None
    assert base.tile(99, 10**30, 0) is None
    assert base.tile(3, 10**30, 0) is None
    assert base.media_type == "image/png"
    assert base.as_dict() == {
        "tiles": "base/{z}/{x}/{y}", "minzoom": 3, "maxzoom": 3, "attribution": "© someone"
    }  # fmt: skip


def test_an_address_is_the_only_host_beside_our_own() -> None:
    base = BaseMap("https://tiles.example:8443/a/{z}/{x}/{y}.png")
    assert base.host == "https://tiles.example:8443"
    assert base.tile(0, 0, 0) is None


@pytest.mark.parametrize(
    "address", ["https://tiles.example/{z}/{x}.png", "ftp://a/{z}/{x}/{y}", "https://a b/{z}/{x}/{y}",
                "https://a/{z}/{x}/{y}; script-src *", "javascript://x/{z}/{x}/{y}", "https://a'/{z}/{x}/{y}"],
)  # fmt: skip
def test_an_address_that_could_change_the_policy_is_refused(address: str) -> None:
    with pytest.raises(UsageError):
        BaseMap(address)


def test_a_file_that_is_none_or_holds_no_pictures_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "b.mbtiles").write_text("nothing")
    vector = mbtiles(tmp_path / "c.mbtiles", "pbf")
    (tmp_path / "b.pmtiles").write_text("nothing")
    drawn = pmtiles(tmp_path / "c.pmtiles", TileType.MVT)
    for file in (tmp_path / "a.mbtiles", tmp_path / "b.mbtiles", vector, tmp_path / "b.pmtiles", drawn):
        with pytest.raises(InputError):
            BaseMap(str(file))


def test_a_file_of_another_kind_is_a_wrong_use(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"give an \.mbtiles or \.pmtiles file"):
        BaseMap(str(tmp_path / "map.png"))
