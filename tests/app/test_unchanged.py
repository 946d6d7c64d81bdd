"""What a batch calls done and unchanged: against files whose makers know what they wrote, and against damage."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer import testing as runner

from gcsplan import load_mission
from gcsplan.app.batch import BatchOptions, MissionBatch, Record, missions_of
from gcsplan.app.parallel.executor import Inline
from gcsplan.cli.command_table import app
from gcsplan.errors import InputError
from gcsplan.export.durable import locked
from gcsplan.export.outdir import write_outputs
from gcsplan.world.terrain.input_files import reading, tell_file
from tests.support.batches import mission
from tests.support.mission_inputs import CASES, SCALED, Case, geotiff, made, naming, published, tif


def batch_of(*given: Path, out: Path) -> MissionBatch:
    return MissionBatch(missions_of([str(g) for g in given]), out, BatchOptions())


def ran(batch: MissionBatch) -> list[Record]:
    """The records of the missions that were planned now."""
    done: list[Record] = []
    batch.run(Inline(), batch.known()[1], done.append)
    return done


def spoil(path: Path, *, same_time: bool) -> None:
    """Change one byte, with a new time or with the old one."""
    before = path.stat()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    new = before.st_mtime_ns if same_time else before.st_mtime_ns + 1_000_000_000
    os.utime(path, ns=(before.st_atime_ns, new))


@pytest.mark.nightly_but("table", "dat_files", "geotiff")
@pytest.mark.first_quick
@pytest.mark.parametrize("kind", CASES)
def test_every_file_that_a_mission_reads_counts(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "w" / "cache"))
    case = made(kind, tmp_path / "w")
    batch = batch_of(case.mission, out=tmp_path / "out")
    (record,) = ran(batch)
    assert record.code == 0, record.rows
    (case.folder / "notes.txt").write_text("nobody reads this")
    assert batch.known()[1] == []
    for path in case.reads:
        kept = path.with_name("kept by the test")
        for change in (
            lambda p: spoil(p, same_time=False), lambda p: spoil(p, same_time=True), Path.unlink,
        ):  # fmt: skip
            shutil.copy2(path, kept)
            change(path)
            assert batch.known()[1] == [0], (path, change)
            shutil.copy2(kept, path)
            kept.unlink()
            assert batch.known()[1] == [], (path, "is as it was")
    for path in case.absent:
        path.write_bytes(b"new")
        assert batch.known()[1] == [0], path
        path.unlink()
        assert batch.known()[1] == [], path


def test_a_cache_at_another_place_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "w" / "cache"))
    batch = batch_of(made(published.__name__, tmp_path / "w").mission, out=tmp_path / "out")
    ran(batch)
    assert batch.known()[1] == []
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "empty"))
    assert batch.known()[1] == [0]


def test_a_file_that_a_sidecar_names_may_go_while_its_header_is_remembered(tmp_path: Path) -> None:
    """It was looked for again, and its absence ended in an internal error."""
    case = made(naming.__name__, tmp_path)
    with_it = load_mission(case.mission)
    (tmp_path / "far.ovr").unlink()
    without = load_mission(case.mission)
    assert without.inputs["dem_sha256"] != with_it.inputs["dem_sha256"]


@pytest.mark.slow
def test_a_sidecar_changes_the_ground_and_its_hash_in_one_process(tmp_path: Path) -> None:
    """Headers are remembered by process, and the hash is what workers compare."""
    case = made(geotiff.__name__, tmp_path)
    alone = load_mission(case.mission)
    sidecar = tmp_path / "dem.tif.aux.xml"
    hashes, grounds = {alone.inputs["dem_sha256"]}, {float(alone.surface.ground_m.max())}
    for offset in (10, 20):
        sidecar.write_text(SCALED.format(offset))
        now = load_mission(case.mission)
        hashes.add(now.inputs["dem_sha256"])
        grounds.add(float(now.surface.ground_m.max()))
    assert (len(hashes), len(grounds)) == (3, 3)
    sidecar.unlink()
    assert load_mission(case.mission).inputs["dem_sha256"] == alone.inputs["dem_sha256"]


@pytest.mark.slow
def test_a_geopackage_with_half_a_change_is_refused(tmp_path: Path) -> None:
    case = made("geopackage", tmp_path / "w")
    batch = batch_of(case.mission, out=tmp_path / "out")
    ran(batch)
    journal = case.folder / "z.gpkg-journal"
    journal.write_bytes(b"\0" * 28)  # of changes that are ended, as journal_mode=PERSIST leaves it
    assert [r.code for r in ran(batch)] == [0]
    journal.write_bytes(bytes.fromhex("d9d505f920a163d7") + b"\0" * 504)
    (record,) = ran(batch)
    assert record.code == 2
    assert "begun and not ended" in record.rows[0]["message"]


def test_files_above_16_mb_go_by_size_time_and_inode(tmp_path: Path) -> None:
    large = tmp_path / "large.tif"
    large.write_bytes(bytes(17 << 20))
    with reading() as found:
        tell_file(large)
    assert found.changed(found.marks) == ""
    os.utime(large, (1.0, 1.0))
    assert found.changed(found.marks) == str(large)


@pytest.fixture
def two(tmp_path: Path) -> MissionBatch:
    """A batch of two missions, done."""
    given = tmp_path / "missions"
    given.mkdir()
    (given / "a.yaml").write_text(mission())
    (given / "b.yaml").write_text(mission(limits={"min_agl_m": 50}))
    batch = batch_of(given, out=tmp_path / "out")
    assert [r.code for r in ran(batch)] == [0, 0]
    assert batch.known()[1] == []
    return batch


OUTPUT_CHANGES: list[Callable[[Path], object]] = [
    lambda out: (out / "a" / "uav1.waypoints").unlink(),
    lambda out: (out / "a" / "uav1.plan").write_text("{}"),
    lambda out: shutil.copytree(out / "b", out / "a", dirs_exist_ok=True),
    lambda out: shutil.rmtree(out / "a"),
    lambda out: write_outputs(out / "a", {"uav9.waypoints": "another plan's"}),
]


@pytest.mark.first_quick
@pytest.mark.parametrize("change", OUTPUT_CHANGES)
def test_outputs_that_are_not_the_record_s_are_made_anew(two: MissionBatch, change: Callable[[Path], object]) -> None:
    before = {p.name: p.read_bytes() for p in (two.directory / "a").iterdir() if p.is_file()}
    change(two.directory)
    assert two.known()[1] == [0]
    assert [r.mission for r in ran(two)] == ["a"]
    assert {p.name: p.read_bytes() for p in (two.directory / "a").iterdir() if p.is_file()} == before
    assert two.known()[1] == []


@pytest.mark.slow
def test_a_run_that_is_killed_after_any_step_leaves_no_record_that_holds(
    two: MissionBatch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between a record and its outputs, either way round: of a new plan, and of a mission that fails now."""
    file = two.missions[0][1]

    class Killed(BaseException):
        pass

    def killed(*_: object) -> None:
        raise Killed

    for text in (
        mission(limits={"min_agl_m": 60}),
        mission(no_fly=[{"name": "shut", "center": [47.0, 8.0], "radius_m": 200}]),
    ):
        for step in ("settle_outputs", "write_record", "write_outputs", "retire_outputs"):
            before = file.read_text()
            file.write_text(text)
            with monkeypatch.context() as patch:
                patch.setattr(f"gcsplan.app.batch.{step}", killed)
                try:
                    ran(two)
                except Killed:
                    assert two.known()[1] == [0], step
                    file.write_text(before)  # the old mission again: whatever is there is not called done unless it is
                    done = ran(replace(two, missions=two.missions[:1])) if two.known()[1] else []
                    assert (two.directory / "a" / "uav1.plan").exists() or done[0].code
                    file.write_text(text)
            ran(two)
            assert two.known()[1] == []
    assert not (two.directory / "a" / "uav1.plan").exists()


def _record(two: MissionBatch) -> Path:
    return two.directory / "records" / "a.json"


def _edited(edit: Callable[[Any], object]) -> Callable[[MissionBatch], object]:
    def apply(two: MissionBatch) -> None:
        kept = json.loads(_record(two).read_text())
        edit(kept)
        _record(two).write_text(json.dumps(kept))

    return apply


def _of_body(**changes: Any) -> Callable[[MissionBatch], object]:
    """Another body, with its right digest."""
    import hashlib

    def edit(kept: Any) -> None:
        kept["body"] = json.dumps(json.loads(kept["body"]) | changes)
        kept["sha256"] = hashlib.sha256(kept["body"].encode()).hexdigest()

    return _edited(edit)


DAMAGE: dict[str, Callable[[MissionBatch], object]] = {
    "empty": lambda two: _record(two).write_text(""),
    "cut": lambda two: os.truncate(_record(two), 300),
    "bytes": lambda two: _record(two).write_bytes(b"\xff\xfe\0"),
    "deep": lambda two: _record(two).write_text("[" * 100_000),
    "a list": lambda two: _record(two).write_text("[]"),
    "a number": lambda two: _record(two).write_text("1" * 5000),
    "other version": _edited(lambda kept: kept.update(format=2)),
    "of another mission": lambda two: shutil.copy(two.directory / "records" / "b.json", _record(two)),
    "one digit": lambda two: _record(two).write_text(_record(two).read_text().replace("1", "2", 5)),
    "no digest": _edited(lambda kept: kept.pop("sha256")),
    "no body": _edited(lambda kept: kept.pop("body")),
    "code": _of_body(code="0"), "rows": _of_body(rows=None), "row": _of_body(rows=[1]), "tracks": _of_body(tracks=5),
    "no rows": _of_body(rows=[]), "inputs": _of_body(inputs={}), "input": _of_body(inputs=[["file /etc/hosts", 1]]),
    "outputs": _of_body(outputs=7), "output": _of_body(outputs={"../a/uav1.plan": 5}),
}  # fmt: skip


@pytest.mark.slow
def test_a_record_with_anything_odd_counts_as_none(two: MissionBatch) -> None:
    whole = _record(two).read_bytes()
    for damage, apply in DAMAGE.items():
        apply(two)
        assert two.known()[1] == [0], damage
        _record(two).write_bytes(whole)
        assert two.known()[1] == []
    DAMAGE["deep"](two)
    assert [r.code for r in ran(two)] == [0]
    assert two.known()[1] == []


@pytest.mark.slow
def test_a_mission_whose_files_change_while_it_is_planned_is_no_plan(tmp_path: Path) -> None:
    """So is one that a worker of a cluster planned over other files than this process sees."""
    case = made(geotiff.__name__, tmp_path / "w")

    class Elsewhere(Inline):
        def each(self, function: Any, shared: Any, items: Any, **options: Any) -> Any:
            for number, result in super().each(function, shared, items, **options):
                tif(case.folder / "dem.tif", level=300.0)
                yield number, result

    batch, done = batch_of(case.mission, out=tmp_path / "out"), []
    batch.run(Elsewhere(), [0], done.append)
    assert done[0].code == 2
    assert "dem.tif is not what was read here" in done[0].rows[0]["message"]
    assert not (tmp_path / "out" / "m" / "uav1.plan").exists()
    assert [r.code for r in ran(batch)] == [0]


@pytest.mark.slow
def test_a_second_batch_in_one_folder_is_refused(two: MissionBatch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcsplan.export.durable.LOCK_WAIT_S", 0.1)
    with locked(two.directory):
        ended = runner.CliRunner().invoke(app, ["batch", str(two.missions[0][1]), "-o", str(two.directory)])
    assert isinstance(ended.exception, InputError)  # exit 2
    assert "another gcsplan has been writing here" in str(ended.exception)


@pytest.mark.slow
def test_names_of_the_batch_s_own_files_are_no_missions(tmp_path: Path) -> None:
    given, out = tmp_path / "missions", tmp_path / "out"
    names = ["results.csv", "index.html", "Records", "records/deep", "a", "a/summary.json", "a/previous/b", "a.json/b"]
    names.append("a/uav1.param")
    for name in names:
        (given / name).parent.mkdir(parents=True, exist_ok=True)
        (given / f"{name}.yaml").write_text(mission())
    for _ in range(2):
        ended = runner.CliRunner().invoke(app, ["batch", str(given), "-o", str(out), "--jobs", "1", "--json"])
        rows = {row["mission"]: row for row in json.loads(ended.stdout)["rows"]}
        assert ended.exit_code == 2
        assert {name: row["code"] for name, row in rows.items()} == {name: 2 * (name != "a") for name in names}
        assert "rename the mission" in rows["results.csv"]["message"]
        assert (out / "results.csv").is_file()


@pytest.mark.slow
def test_what_cannot_be_written_is_that_mission_s_failure(tmp_path: Path) -> None:
    given, out = tmp_path / "missions", tmp_path / "out"
    given.mkdir()
    out.mkdir()
    for name in "abc":
        (given / f"{name}.yaml").write_text(mission())
    (out / "b").write_text("a file where a folder must be")
    done = {r.mission: r for r in ran(batch_of(given, out=out))}
    assert {name: r.code for name, r in done.items()} == {"a": 0, "b": 2, "c": 0}
    assert "cannot be written" in done["b"].rows[0]["message"]
    (out / "b").unlink()
    again = batch_of(given, out=out)
    assert [r.mission for r in ran(again)] == ["b"]


def test_a_file_that_was_missing_and_is_there_now_counts(tmp_path: Path) -> None:
    case = Case(tmp_path)
    case.terrain = {"dem": "dem.tif", "vertical_datum": "EGM96"}
    batch = batch_of(case.write().mission, out=tmp_path / "out")
    assert [r.code for r in ran(batch)] == [2]
    assert batch.known()[1] == []
    tif(tmp_path / "dem.tif")
    assert [r.code for r in ran(batch)] == [0]
