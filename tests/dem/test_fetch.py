"""Filling the cache: every tile ends whole with its record, or an error names it and the cache holds nothing of it."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import random
import re
import signal
import time
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import numpy as np
import pytest

from gcsplan.dem.cache import Cache, cache_folder
from gcsplan.dem.download import DownloadPatience
from gcsplan.dem.fetch import Fetch, Fetched
from gcsplan.dem.sources import GLO30, GLO90, SRTM, DemSource, cells_in
from gcsplan.errors import InputError, LinkError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.cell import Cell, cell_of
from tests.support.tiles import Served, heights_of, send, serving, tile

QUICK = DownloadPatience(stall_s=10.0, whole_s=60.0, tries=4, pause_s=0.001)
FOUR = (Cell(36, -85), Cell(36, -84), Cell(35, -85), Cell(35, -84))
SEA = Cell(10, 10)
LACKING = Cell(40, 45)


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with serving(Served()) as server:
        for cell in FOUR:
            server.put_tile(cell)
        server.put_lists(land=FOUR, lacking=[LACKING])
        yield server


def fetch(served: Served, folder: Path, *cells: Cell, source: DemSource = GLO30) -> list[Fetched]:
    return Fetch(Cache(source, folder), mirror=served.url, patience=QUICK).run(cells)


def refusal(served: Served, folder: Path, *cells: Cell, source: DemSource = GLO30) -> str:
    with pytest.raises(LinkError) as caught:
        fetch(served, folder, *cells, source=source)
    return str(caught.value)


def is_in_order(folder: Path, source: DemSource = GLO30) -> set[str]:
    """Names of the tiles in a cache, each as its record says; nothing else counts as one."""
    cache = Cache(source, folder)
    found = set()
    for path in sorted((folder / source.name).glob("*.tif")):
        cell = cell_of(path.stem)
        assert cell is not None
        record = cache.find(cell)
        assert record is not None, path
        assert hashlib.sha256(path.read_bytes()).hexdigest() == record.sha256
        found.add(cell.name)
    return found


def parts(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*.part*"))


# -- tiles -------------------------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_tiles_come_with_their_records_and_once_only(served: Served, tmp_path: Path) -> None:
    first = fetch(served, tmp_path, *FOUR)
    assert [f.cached for f in first] == [False] * 4
    record = json.loads((tmp_path / "copernicus-glo30" / "N36W085.json").read_text())
    data = served.objects[f"/{GLO30.bucket}/{GLO30.object_of(FOUR[0])}"]
    assert (tmp_path / "copernicus-glo30" / "N36W085.tif").read_bytes() == data
    assert record["kind"] == "surface"
    assert record["vertical_datum"] == "EGM2008"
    assert record["sha256"] == hashlib.sha256(data).hexdigest()
    assert record["url"] == f"{served.url}/copernicus-dem-30m/{GLO30.object_of(FOUR[0])}"
    asked = len(served.requests)
    assert [f.cached for f in fetch(served, tmp_path, *FOUR)] == [True] * 4
    assert len(served.requests) == asked
    assert parts(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_four_tiles_over_a_lossy_server_end_right_or_with_a_clear_error(
    served: Served, tmp_path: Path, seed: int
) -> None:
    rng = random.Random(seed)

    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        data = served.objects[path]
        what = rng.choice(["right", "cut", "cut", "busy", "gone", "wrong", "silent"])
        if what == "cut":
            send(request, data, cut=rng.randrange(len(data)))
        elif what == "busy":
            request.send_error(rng.choice([500, 503, 429]))
        elif what == "wrong":
            send(request, data[:-9] + b"\0" * 9, etag=f'"{hashlib.md5(data).hexdigest()}"')
        elif what == "silent":
            time.sleep(0.02)
        return what not in ("right", "gone") or (what == "gone" and request.connection.close() is None)

    served.trouble = trouble
    said: list[str] = []
    for _ in range(40):
        try:
            fetch(served, tmp_path, *FOUR)
            break
        except LinkError as why:
            said.append(str(why))
            is_in_order(tmp_path)
    assert all("could not be downloaded" in words for words in said)
    assert is_in_order(tmp_path) == {cell.name for cell in FOUR}


def test_a_tile_that_fails_does_not_cost_the_others(served: Served, tmp_path: Path) -> None:
    del served.objects[f"/{GLO30.bucket}/{GLO30.object_of(FOUR[1])}"]
    said = refusal(served, tmp_path, *FOUR)
    assert "1 of 4 tiles could not be downloaded" in said
    assert f"N36W084: {served.url}" in said
    assert "answers 404" in said
    assert is_in_order(tmp_path) == {FOUR[0].name, FOUR[2].name, FOUR[3].name}


def damaged(data: bytes) -> bytes:
    """Heights that cannot be unpacked: without the marks of zlib."""
    return re.sub(rb"\x78[\x01\x5e\x9c\xda]", b"\0\0", data)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: b"<html>welcome to the hotel</html>", "no GeoTIFF"),
        (lambda: tile(FOUR[0])[:2000], "cannot be read"),
        (lambda: damaged(tile(FOUR[0])), "cannot be read"),
        (lambda: tile(FOUR[1]), "covers one degree from 37, -85"),
        (lambda: tile(FOUR[0], heights=np.full((36, 36), -9999.0)), "nothing but voids"),
        (lambda: tile(FOUR[0], SRTM), "covers 1.0277"),
    ],
    ids=["a page", "cut off", "damaged", "another place", "voids", "another source"],
)
def test_what_is_no_such_tile_is_removed(served: Served, tmp_path: Path, make: Callable[[], bytes], words: str) -> None:
    served.put(GLO30, GLO30.object_of(FOUR[0]), make())
    said = refusal(served, tmp_path, FOUR[0])
    assert "the server's file is not this tile, and was removed" in said
    assert words in said
    assert parts(tmp_path) == []
    assert is_in_order(tmp_path) == set()


@pytest.mark.nightly
def test_a_tile_damaged_in_the_cache_is_brought_again(served: Served, tmp_path: Path) -> None:
    fetch(served, tmp_path, FOUR[0])
    path = tmp_path / "copernicus-glo30" / "N36W085.tif"
    data = path.read_bytes()
    for bad in (data[:-1], data[:-1] + b"!"):
        path.write_bytes(bad)
        assert not fetch(served, tmp_path, FOUR[0])[0].cached
        assert path.read_bytes() == data


@pytest.mark.first_quick
@pytest.mark.parametrize(
    "text", ["{", "", "[]", '{"format": 2}', '{"format": 1, "tile": "N36W085"}', "\0", '{"format": 1, "x": 3}']
)
def test_a_record_that_is_none_counts_as_nothing(served: Served, tmp_path: Path, text: str) -> None:
    fetch(served, tmp_path, FOUR[0])
    cache = Cache(GLO30, tmp_path)
    cache.record_path(FOUR[0]).write_text(text)
    assert cache.find(FOUR[0]) is None
    fetch(served, tmp_path, FOUR[0])
    assert cache.find(FOUR[0]) is not None


def test_a_record_of_another_kind_of_heights_does_not_count(served: Served, tmp_path: Path) -> None:
    fetch(served, tmp_path, FOUR[0])
    cache = Cache(GLO30, tmp_path)
    path = cache.record_path(FOUR[0])
    path.write_text(path.read_text().replace("EGM2008", "EGM96"))
    assert cache.find(FOUR[0]) is None


# -- sea ---------------------------------------------------------------------------------------------------------------


def state(served: Served, folder: Path, cell: Cell, source: DemSource = GLO30) -> str:
    return fetch(served, folder, cell, source=source)[0].record.state


@pytest.mark.nightly
def test_sea_is_what_neither_list_has(served: Served, tmp_path: Path) -> None:
    assert state(served, tmp_path, SEA) == "sea"
    assert state(served, tmp_path, LACKING) == "absent"
    record = Cache(GLO30, tmp_path).find(SEA)
    assert record is not None
    assert [line.split()[0] for line in record.lists] == [
        f"{served.url}/copernicus-dem-30m/tileList.txt", f"{served.url}/copernicus-dem-90m/tileList.txt"
    ]  # fmt: skip
    assert served.paths() == []


@pytest.mark.nightly
def test_srtm_has_a_list_and_a_datum_of_its_own(served: Served, tmp_path: Path) -> None:
    served.put_lists(land=FOUR, lacking=[LACKING], source=SRTM)
    served.put_tile(FOUR[0], SRTM)
    [found] = fetch(served, tmp_path, FOUR[0], source=SRTM)
    assert found.record.vertical_datum == "EGM96"
    assert found.record.url == f"{served.url}/raster/SRTM_GL1/SRTM_GL1_srtm/N36W085.tif"
    assert state(served, tmp_path, SEA, SRTM) == "sea"
    assert state(served, tmp_path, LACKING, SRTM) == "absent"


@pytest.mark.slow
@pytest.mark.parametrize("which", [GLO90, GLO30], ids=lambda s: s.name)
@pytest.mark.parametrize("how", ["short", "gone", "cut off", "cut in its last line", "another page", "silent"])
def test_without_both_whole_lists_nothing_is_sea(served: Served, tmp_path: Path, which: DemSource, how: str) -> None:
    path = f"/{which.bucket}/{which.listing}"
    data = served.objects[path]

    def trouble(request: BaseHTTPRequestHandler, asked: str, number: int) -> bool:
        if asked != path:
            return False
        if how == "gone":
            request.send_error(404)
        elif how == "silent":
            request.connection.close()
        else:
            bad = {
                "cut off": data[: len(data) // 2],
                "cut in its last line": data[:-10],
                "short": data[:-100_000],
                "another page": b"<html></html>",
            }
            send(request, bad[how] + (b"_DEM\r\n" if how == "short" else b""))
        return True

    served.trouble = trouble
    refusal(served, tmp_path, SEA)
    assert Cache(GLO30, tmp_path).find(SEA) is None
    served.trouble = lambda request, path, number: False
    assert state(served, tmp_path, SEA) == "sea"


@pytest.mark.slow
def test_lists_are_kept_and_asked_for_anew_when_they_are_old(served: Served, tmp_path: Path) -> None:
    state(served, tmp_path, SEA)
    state(served, tmp_path, Cell(10, 11))
    assert len(served.paths(".txt")) == 2
    for path in (tmp_path / "lists").iterdir():
        os.utime(path, (0, 0))
    state(served, tmp_path, Cell(10, 12))
    assert len(served.paths(".txt")) == 4


@pytest.mark.slow
def test_a_tile_that_was_not_there_is_asked_for_again_after_a_while(served: Served, tmp_path: Path) -> None:
    state(served, tmp_path, LACKING)
    served.put_lists(land=[LACKING])
    served.put_tile(LACKING)
    assert state(served, tmp_path, LACKING) == "absent"
    lists, record = list((tmp_path / "lists").iterdir()), Cache(GLO30, tmp_path).record_path(LACKING)
    for path in (*lists, record):
        os.utime(path, (0, 0))
    trouble, served.trouble = served.trouble, lambda request, path, number: request.send_error(404) is None
    assert state(served, tmp_path, LACKING) == "absent"
    served.trouble = trouble
    assert state(served, tmp_path, LACKING) == "tile"


# -- processes and the disk --------------------------------------------------------------------------------------------


def _fetch_in_a_process(url: str, folder: Path) -> None:
    Fetch(Cache(GLO30, folder), mirror=url, patience=QUICK).run(FOUR)


@pytest.mark.nightly
def test_processes_at_once_do_not_harm_each_other(served: Served, tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    workers = [context.Process(target=_fetch_in_a_process, args=(served.url, tmp_path)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
        assert worker.exitcode == 0
    assert is_in_order(tmp_path) == {cell.name for cell in FOUR}
    assert len(served.paths()) == 4  # each tile is brought by one of them
    assert parts(tmp_path) == []


@pytest.mark.slow
def test_a_process_that_is_killed_leaves_no_tile_and_the_next_one_goes_on(served: Served, tmp_path: Path) -> None:
    url = f"/{GLO30.bucket}/{GLO30.object_of(FOUR[2])}"
    data = served.objects[url]

    def trouble(request: BaseHTTPRequestHandler, path: str, number: int) -> bool:
        if path != url or number > 1:
            return False
        request.send_response(200)
        request.send_header("ETag", f'"{hashlib.md5(data).hexdigest()}"')
        request.send_header("Content-Length", str(len(data)))
        request.end_headers()
        request.wfile.write(data[:1000])
        request.wfile.flush()
        time.sleep(5.0)
        return True

    served.trouble = trouble
    worker = multiprocessing.get_context("spawn").Process(target=_fetch_in_a_process, args=(served.url, tmp_path))
    worker.start()
    until = time.monotonic() + 60.0
    while url not in served.paths() and time.monotonic() < until:
        time.sleep(0.01)
    time.sleep(0.1)
    assert worker.pid is not None
    os.kill(worker.pid, signal.SIGKILL)
    worker.join(10)
    assert is_in_order(tmp_path) == {FOUR[0].name, FOUR[1].name}
    fetch(served, tmp_path, *FOUR)
    assert is_in_order(tmp_path) == {cell.name for cell in FOUR}


@pytest.mark.nightly
def test_an_interruption_in_the_middle_keeps_what_is_right(served: Served, tmp_path: Path) -> None:
    def stop(name: str, have: int, whole: int | None) -> None:
        if name == FOUR[1].name:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Fetch(Cache(GLO30, tmp_path), mirror=served.url, patience=QUICK, progress=stop).run(FOUR)
    assert is_in_order(tmp_path) == {FOUR[0].name}
    fetch(served, tmp_path, *FOUR)
    assert is_in_order(tmp_path) == {cell.name for cell in FOUR}


def test_a_cache_that_cannot_be_written_is_one_message(served: Served, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    assert "the cache cannot be written" in refusal(served, file, FOUR[0])


def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own"
    monkeypatch.delenv("GCSPLAN_DEM_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "gcsplan" / "dem"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # which the specification says to ignore
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home" / ".cache" / "gcsplan" / "dem"


# -- names and areas ---------------------------------------------------------------------------------------------------


def test_objects_have_the_published_names() -> None:
    name = "Copernicus_DSM_COG_10_S14_00_W172_00_DEM"
    assert GLO30.object_of(Cell(-14, -172)) == f"{name}/{name}.tif"
    assert GLO90.object_of(Cell(0, 6)).startswith("Copernicus_DSM_COG_30_N00_00_E006_00_DEM/")
    assert SRTM.object_of(Cell(28, 76)) == "SRTM_GL1/SRTM_GL1_srtm/N28E076.tif"
    assert [cell_of(n) for n in ("N36W085", "S01E000", "N36W185", "N90E000", "S00E001", "n36w085", "N3W85")] == [
        Cell(36, -85), Cell(-1, 0), None, None, None, None, None
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("south", "columns"), [(0, 3600), (49, 3600), (50, 2400), (59, 2400), (60, 1800), (70, 1200), (80, 720), (85, 360)]
)
def test_columns_widen_alike_on_both_halves_of_the_globe(south: int, columns: int) -> None:
    assert GLO30.columns_of(Cell(south, 0)) == GLO30.columns_of(Cell(-south - 1, 0)) == columns
    assert heights_of(Cell(south, 0)).shape == (36, columns // 100)


@pytest.mark.parametrize(
    ("at", "wanted"),
    [
        ((36.5, -84.5), ["N36W085"]),
        ((36.99, -84.01), ["N37W085", "N37W084", "N36W085", "N36W084"]),
        ((0.0, 0.0), ["N00W001", "N00E000", "S01W001", "S01E000"]),
        ((-17.5, 179.99), ["S18E179", "S18W180"]),
        ((-17.5, -179.99), ["S18E179", "S18W180"]),
    ],
)
def test_an_area_needs_the_tiles_that_it_touches(at: tuple[float, float], wanted: list[str]) -> None:
    cells = cells_in(Frame(*at), (-1000.0, -1000.0, 1000.0, 1000.0), where="here")
    assert [cell.name for cell in cells] == wanted


def test_too_large_an_area_is_refused() -> None:
    with pytest.raises(InputError, match=r"needs .* tiles of one degree, more than 100"):
        cells_in(Frame(70.0, 10.0), (-300_000.0, -300_000.0, 300_000.0, 300_000.0), where="here")
