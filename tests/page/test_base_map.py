"""The map below a mission: an MBTiles file or an address."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

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
    for file in (tmp_path / "a.mbtiles", tmp_path / "b.mbtiles", vector):
        with pytest.raises(InputError):
            BaseMap(str(file))
