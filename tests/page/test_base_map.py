"""The map below a mission: an MBTiles or PMTiles file, or an address."""

from __future__ import annotations

import gzip
import random
import sqlite3
import time
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


def packed(*entries: int) -> bytes:
    """A directory of a PMTiles file: its numbers, seven bits a byte."""
    out = bytearray()
    for number in entries:
        while number > 0x7F:
            out.append(number & 0x7F | 0x80)
            number >>= 7
        out.append(number)
    return gzip.compress(bytes(out))


LEAF_OF_ITSELF = packed(1, 0, 0, 60, 1)
"""Of all tiles, the entries lie in a directory of 60 bytes where the leaves begin."""


@pytest.mark.parametrize(
    "root",
    [
        gzip.compress(bytes(2**21)), gzip.compress(bytes(2**20 - 9)) * 2, gzip.compress(b"\xff" * 2**19),
        packed(2**60), packed(1, 0, 1, 2**62, 1), packed(1, 0, 1, 7, 2**63), packed(1, 0, 1, 7, 0), LEAF_OF_ITSELF,
    ],
    ids=["bomb", "two members", "long number", "many", "large", "far", "before the file", "deep"],
)  # fmt: skip
def test_a_hostile_directory_of_a_pmtiles_file_holds_no_tile(tmp_path: Path, root: bytes) -> None:
    file = pmtiles(tmp_path / "a.pmtiles")
    data = file.read_bytes()
    header = bytearray(data[:127])
    for at, number in ((8, len(data)), (16, len(root)), (40, len(data))):
        header[at : at + 8] = number.to_bytes(8, "little")
    file.write_bytes(bytes(header) + data[127:] + root)
    begun_s = time.process_time()
    assert not BaseMap(str(file)).tile(3, 4, 2)
    assert time.process_time() - begun_s < 1.0


@pytest.mark.parametrize("about", [b"[" * 100_000, b"{" + b" " * 2**21 + b"}"], ids=["deep", "large"])
def test_hostile_metadata_of_a_pmtiles_file_is_bad_input(tmp_path: Path, about: bytes) -> None:
    file = pmtiles(tmp_path / "a.pmtiles")
    data, about = file.read_bytes(), gzip.compress(about)
    header = bytearray(data[:127])
    for at, number in ((24, len(data)), (32, len(about))):
        header[at : at + 8] = number.to_bytes(8, "little")
    file.write_bytes(bytes(header) + data[127:] + about)
    with pytest.raises(InputError, match="no PMTiles file"):
        BaseMap(str(file))


def changed(file: Path, *statements: str) -> Path:
    with sqlite3.connect(file) as made:
        for statement in statements:
            made.execute(statement)
    made.close()
    return file


def test_a_value_of_an_mbtiles_file_that_is_too_large_is_no_tile(tmp_path: Path) -> None:
    file = changed(mbtiles(tmp_path / "a.mbtiles"), "UPDATE tiles SET tile_data = zeroblob(5000000)")
    assert BaseMap(str(file)).tile(3, 4, 2) is None


def test_words_of_an_mbtiles_file_that_are_no_text_are_bad_input(tmp_path: Path) -> None:
    file = changed(mbtiles(tmp_path / "a.mbtiles"), "UPDATE metadata SET value = CAST(x'ff' AS TEXT)")
    with pytest.raises(InputError, match="no MBTiles file"):
        BaseMap(str(file))


@pytest.mark.parametrize("zoom", ["'top'", "-1", "99", "1e400", "x'00'"])
def test_zooms_that_are_none_are_bad_input(tmp_path: Path, zoom: str) -> None:
    file = changed(mbtiles(tmp_path / "a.mbtiles"), f"UPDATE tiles SET zoom_level = {zoom}")
    with pytest.raises(InputError, match="zooms from"):
        BaseMap(str(file))


@pytest.mark.nightly
@pytest.mark.slow
def test_an_mbtiles_file_that_never_answers_is_bad_input(tmp_path: Path) -> None:
    numbers = "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n)"
    view = f"CREATE VIEW tiles AS {numbers} SELECT i AS zoom_level, 0 AS tile_column, 0 AS tile_row FROM n"
    file = changed(mbtiles(tmp_path / "a.mbtiles"), "DROP TABLE tiles", view)
    with pytest.raises(InputError, match="does not answer within 5 s"):
        BaseMap(str(file))


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
