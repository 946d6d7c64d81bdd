"""Batches: every mission is planned once, bad ones stop nobody, and unchanged ones are kept."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app import batch as module
from gcsplan.app.batch import BatchOptions, MissionBatch, Record, exit_code, missions_of
from gcsplan.app.parallel.executor import Dask, Inline, executor
from gcsplan.app.plan.model import PlanOptions
from gcsplan.errors import GcsplanError, UsageError
from gcsplan.export.table import csv_text, parquet_bytes
from tests.support.batches import four_missions, mission


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return four_missions(tmp_path / "missions")


def ran(folder: Path, out: Path, **options: Any) -> tuple[dict[str, Record], int]:
    """The records by mission, and how many of them were planned now."""
    work = MissionBatch(missions_of([str(folder)]), out, BatchOptions(**options))
    done, todo = work.known()
    work.run(Inline(), todo, done.append)
    return {r.mission: r for r in done}, len(todo)


@pytest.mark.slow
def test_every_mission_has_its_record_and_its_outputs(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    records, planned = ran(folder, out)
    assert planned == 4
    assert {name: r.code for name, r in records.items()} == {
        "good": 0, "north/good": 0, "north/broken": 2, "shut": 2,
    }  # fmt: skip
    assert exit_code(list(records.values())) == 2
    assert {p.name for p in (out / "north" / "good").iterdir()} >= {"uav1.waypoints", "uav1.plan", "summary.json"}
    assert not (out / "shut").exists()
    told = json.loads((out / "good" / "summary.json").read_text())["vehicles"][0]
    (row,) = records["good"].rows
    assert (row["length_m"], row["gap_percent"], row["verdict"]) == (
        told["length_m"], told["gap_percent"], "path safe, return not judged",
    )  # fmt: skip
    assert "no-fly zone 'disc'" in records["shut"].rows[0]["message"]


@pytest.mark.slow
def test_what_is_unchanged_is_kept(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    before, _ = ran(folder, out)
    again, planned = ran(folder, out)
    assert planned == 0
    assert {n: (r.code, r.rows, r.tracks) for n, r in again.items()} == {
        n: (r.code, r.rows, r.tracks) for n, r in before.items()
    }
    (folder / "shut.yaml").write_text(mission())
    assert ran(folder, out)[1] == 1
    (out / "good" / "summary.json").unlink()
    assert ran(folder, out)[1] == 1
    assert ran(folder, out, plan=PlanOptions(objective="energy"))[1] == 4  # other options are another batch
    (out / "records" / "good.json").write_text("{")
    assert ran(folder, out, plan=PlanOptions(objective="energy"))[1] == 1


@pytest.mark.slow
def test_a_mission_that_fails_now_loses_its_old_outputs(folder: Path, tmp_path: Path) -> None:
    """No old mission may be flown by mistake."""
    out = tmp_path / "out"
    ran(folder, out)
    (folder / "good.yaml").write_text((folder / "shut.yaml").read_text())
    records, _ = ran(folder, out)
    assert records["good"].code == 2
    assert not (out / "good" / "uav1.plan").exists()
    assert (out / "good" / "previous" / "uav1.plan").exists()


def test_a_bug_in_one_mission_costs_only_that_mission(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(file: str, **options: Any) -> Any:
        if "north" in file:
            raise ZeroDivisionError("made")
        return plan(file, **options)

    plan = module.plan
    monkeypatch.setattr(module, "plan", fails)
    records, _ = ran(folder, tmp_path / "out")
    assert {n: r.code for n, r in records.items()} == {"good": 0, "north/good": 70, "north/broken": 70, "shut": 2}
    assert exit_code(list(records.values())) == 70
    assert "a bug in gcsplan: ZeroDivisionError: made" in records["north/good"].rows[0]["message"]


def test_names_are_paths_from_the_common_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ["good", "north/broken", "north/good", "shut"]
    assert sorted(n for n, _ in missions_of([str(folder)])) == names
    assert [n for n, _ in missions_of([str(folder / "shut.yaml"), str(folder / "shut.yaml")])] == ["shut"]
    monkeypatch.chdir(folder)
    assert [n for n, _ in missions_of(["north/*.yaml"])] == ["broken", "good"]
    assert [n for n, _ in missions_of(["sample:jacksboro"])] == ["jacksboro"]
    assert [n for n, _ in missions_of(["nothing.yaml"])] == ["nothing"]  # its record says that there is no such file
    with pytest.raises(UsageError, match="no mission file"):
        missions_of(["east/*.yaml"])
    (folder / "good.yml").write_text(mission())
    with pytest.raises(UsageError, match="differ by their suffix"):
        missions_of(["good.yaml", "good.yml"])


@pytest.mark.parametrize(("codes", "worst"), [([0, 3, 2], 3), ([0], 0), ([4, 70], 70), ([2, 4], 4), ([], 0)])
def test_the_exit_code_is_the_worst(codes: list[int], worst: int) -> None:
    assert exit_code([Record("m", "", code, ()) for code in codes]) == worst


@pytest.mark.slow
def test_rows_as_csv_and_parquet() -> None:
    rows = [{"a": 1.5, "b": "x,y"}, {"b": None}]
    assert csv_text(("a", "b"), rows) == 'a,b\n1.5,"x,y"\n,\n'
    arrow = pytest.importorskip("pyarrow.parquet")
    table = arrow.read_table(io.BytesIO(parquet_bytes(("a", "b"), rows)))
    assert table.to_pydict() == {"a": [1.5, None], "b": ["x,y", None]}


@pytest.mark.nightly
def test_processes_make_the_same_files(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    alone, shared = tmp_path / "alone", tmp_path / "shared"
    ran(folder, alone)
    work = MissionBatch(missions_of([str(folder)]), shared, BatchOptions())
    with executor(2, pieces=100, piece_s=1.0) as workers:
        assert isinstance(workers, Dask)
        work.run(workers, work.known()[1], lambda record: None)
    for file in sorted(p.relative_to(alone) for p in alone.rglob("*") if p.is_file()):
        if file.suffix in (".waypoints", ".plan", ".kml", ".geojson", ".csv"):
            assert (shared / file).read_bytes() == (alone / file).read_bytes(), file
    assert not MissionBatch(missions_of([str(folder)]), shared, BatchOptions()).known()[1]


def test_a_mission_that_no_worker_outlives_is_a_row_and_stops_nobody(folder: Path, tmp_path: Path) -> None:
    class Deadly(Inline):
        def each(self, function: Any, shared: Any, items: Any, *, lost: Any = None, finish: bool = False) -> Any:
            for number, item in enumerate(items):
                dies = item[0] == "good"
                yield number, lost(item, GcsplanError("workers died")) if dies else function(shared, item)

    work = MissionBatch(missions_of([str(folder)]), tmp_path / "out", BatchOptions())
    done: list[Record] = []
    work.run(Deadly(), work.known()[1], done.append)
    assert {r.mission: r.code for r in done} == {"good": 70, "north/good": 0, "north/broken": 2, "shut": 2}
    assert "workers died" in next(r for r in done if r.mission == "good").rows[0]["message"]
