"""Terrain that does not fit into a gigabyte is refused by name before it is read, and by what it would need."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan.world.terrain import mosaic, terrain, voids
from gcsplan.world.terrain.raster import MAX_CELLS
from tests.campaigns import sizes
from tests.support.paths import REPOSITORY
from tests.world.terrain.test_terrain import degrees_tif, hills, load, refusal

HELD = {"obstacle_height_m": 2, "canopy": 4}
"""Arrays of the window that are held at once."""


def most_cells(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    for module in (mosaic, terrain, voids):
        monkeypatch.setattr(module, "MAX_CELLS", count)


def cells_around(path: str) -> int:
    return int(load(path).ground_m.size)


@pytest.mark.parametrize("key", HELD)
def test_what_stands_on_the_ground_counts(key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = degrees_tif(tmp_path / "a.tif")
    canopy = degrees_tif(tmp_path / "c.tif", hills(100, 100) * 0.0 + 9.0)
    stands: dict[str, Any] = {key: canopy if key == "canopy" else 9.0}
    held, count = HELD[key], cells_around(path)
    most_cells(monkeypatch, 2 * held * count)  # the canopy is read a little farther than the ground
    load(path, **stands)
    most_cells(monkeypatch, held * count - 1)
    assert "use a coarser DEM (gdalwarp -tr) or a smaller mission" in str(refusal(path, **stands))


def test_two_heights_of_each_node_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [degrees_tif(tmp_path / "a.tif"), degrees_tif(tmp_path / "b.tif", hills(100, 100) + 1.0)]
    count = cells_around(paths[0])
    most_cells(monkeypatch, 2 * count)
    load(paths)
    most_cells(monkeypatch, 2 * count - 1)
    said = str(refusal(paths))
    assert "tiles differ where they overlap, and two heights of" in said
    assert "gdal_merge.py" in said


def test_zeros_that_may_be_voids_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heights = hills(100, 100)
    heights[50, 50] = 0.0
    path = degrees_tif(tmp_path / "a.tif", heights)
    count = cells_around(path)
    most_cells(monkeypatch, 2 * count)
    load(path)
    most_cells(monkeypatch, 2 * count - 1)
    assert "If each 0 is ground or sea, state `nodata: none`" in str(refusal(path))
    assert np.isfinite(load(path, nodata="none").ground_m).all()


PROC = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="getrusage counts the parent's memory, too")


def held_mb(folder: Path, million: float, *more: str) -> tuple[int, float, str]:
    """Exit code, most megabytes and message of a plan over that many million cells, in a process of its own."""
    arguments = sizes.write("cells", million)  # in the current folder
    words = (
        "import sys\nfrom gcsplan.cli.main import main\n"
        "try: main()\nexcept SystemExit as end: code = end.code\n"
        "status = open('/proc/self/status').read()\n"
        "print(status.split('VmHWM:')[1].split()[0], file=sys.stderr)\nsys.exit(code)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", words, *arguments, *more], cwd=folder, env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    *said, most = ended.stderr.splitlines()
    return ended.returncode, int(most) / 1024.0, "\n".join(said)


@pytest.mark.nightly
@PROC
def test_too_many_cells_are_refused_before_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, most, said = held_mb(tmp_path, 1.02 * MAX_CELLS / 1e6)
    assert (code, "gdalwarp -tr" in said) == (2, True)
    assert most < 300.0


@pytest.mark.slow
@PROC
@pytest.mark.parametrize("more", [(), pytest.param(("--report",), marks=pytest.mark.nightly)])
def test_as_many_cells_as_are_taken_need_a_gigabyte_at_most(
    more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, most, said = held_mb(tmp_path, 0.98 * MAX_CELLS / 1e6, *more)
    assert code == 0, said
    assert most < 1000.0
