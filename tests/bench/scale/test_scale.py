"""The benchmark of scale: missions from a seed; a small batch by one process, by two, and with one of them killed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app import executor
from gcsplan.bench.scale import run as scale
from gcsplan.bench.scale.missions import EQUATOR_DEGREE_M, make_missions, make_mosaic, mission
from gcsplan.errors import UsageError
from gcsplan.world.frame import Frame
from gcsplan.world.terrain import TerrainSpec, load_terrain


def test_missions_are_those_of_their_seed_and_5_to_40_km_long(tmp_path: Path) -> None:
    files = make_missions(tmp_path, 60, 3, tmp_path / "tiles")
    contents = [yaml.safe_load(file.read_text(encoding="utf-8")) for file in files]
    assert contents == [mission(k, 3, tmp_path / "tiles") for k in range(60)]
    assert contents != [mission(k, 4, tmp_path / "tiles") for k in range(60)]
    lengths_m = []
    for content in contents:
        (a, b), (c, d) = content["vehicles"][0]["start"], content["vehicles"][0]["goal"]
        lengths_m.append(EQUATOR_DEGREE_M * np.hypot(c - a, (d - b) * np.cos(np.radians(a))))
    assert 4990 < min(lengths_m) < 8000
    assert 30_000 < max(lengths_m) < 40_200
    assert {c["terrain"]["dem"] for c in contents} == {"sample:jacksboro", str(tmp_path / "tiles")}


def test_the_made_hills_are_the_same_however_fine_they_are(tmp_path: Path) -> None:
    heights = []
    for posts in (30, 90):
        make_mosaic(tmp_path / str(posts), 1, posts)
        spec = TerrainSpec(dem=(str(tmp_path / str(posts)),), vertical_datum="EGM96")
        surface = load_terrain(spec, Frame(46.7, 8.4), (-9000.0, -9000.0, 9000.0, 9000.0), where="m")
        at = np.linspace(-9000.0, 9000.0, 50)
        heights.append(surface.ground_at(at, -at))
    assert np.ptp(heights[0]) > 100.0
    assert np.abs(heights[0] - heights[1]).max() < 15.0


@pytest.mark.parametrize("change", [{"axes": ["planets"]}, {"axes": []}, {"missions": 3}, {"workers": 1}])
def test_what_cannot_be_measured_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        scale.run(**change)


def test_a_cluster_is_bounded_by_the_process_that_writes() -> None:
    alone = {"cpu_s": 100.0, "result_bytes": 5e4}
    shared = {"missions": 100, "worker_cpu_s": [49.0, 51.0], "own_cpu_s": 2.0, "scheduler_ms": 5.0, "item_bytes": 60.0}
    found = scale.cluster_of(alone, shared)
    assert [round(c["missions_per_s"], 9) for c in found["cores"]] == [1.0, 10.0, 50.0, 50.0]
    assert [c["bound"] for c in found["cores"]] == ["work", "work", "writer", "writer"]
    assert found["serial_part"] == pytest.approx(0.02 / 1.02)


@pytest.mark.slow
def test_a_batch_by_two_processes_has_the_same_bytes_and_a_killed_one_costs_its_own_missions(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    result = scale.run(["workers", "zones"], 30, 2, 2, kill=True)
    alone, two, killed = (row for row in result["rows"] if row["axis"] == "workers")
    assert alone["planned"] + alone["refused"] == 30
    assert alone["planned"] >= 25
    assert two["same_bytes"]
    assert killed["same_bytes"]
    assert (two["done_again"], two["killed"]) == (0, 0)
    assert killed["killed"] == 1
    # What was handed out and not yet fetched: begun, or done with its result still at the worker.
    assert killed["done_again"] <= executor.AHEAD * 2
    files = scale.write(result, tmp_path)
    assert {file.name for file in files} == {"scale.json", "scale.csv", "scale.md", "scale.png"}
    assert json.loads((tmp_path / "scale.json").read_text())["rows"][0]["axis"] == "zones"
    assert "| cores |" in (tmp_path / "scale.md").read_text()
