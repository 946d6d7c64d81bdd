"""Archives: files are judged as each would be, whatever executor does it, and none stops the others."""

from __future__ import annotations

import gc
import json
import pickle
import re
import sys
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.check import many as module
from gcsplan.app.check import worlds as check_sites
from gcsplan.app.check.files import check_at, check_batch, finding_lines
from gcsplan.app.check.many import Archive, FileResult, Form, Shown, Summary
from gcsplan.app.check.worlds import NO_RETURNS, OptionsSite, Returns, VerdictParts
from gcsplan.app.parallel.executor import Executor, Inline, executor
from gcsplan.cli import main as cli
from gcsplan.errors import InputError, UsageError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.options_world import WorldOptions
from tests.support import corpus

MIXED = {**{k: corpus.WITH_HOME[k] for k in ("qgc", "mavproxy", "plan")}, **corpus.WITHOUT_HOME, **corpus.PX4}
"""QGroundControl's files and plans, MAVProxy's, Mission Planner's (without a home), and plans for PX4."""


class Scattered:
    """Each piece as if by another process, the later before the earlier."""

    def each(self, function: Callable[[Any, Any], Any], shared: Any, items: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        for number in reversed(range(len(items))):
            module.sites.clear()
            given = pickle.loads(pickle.dumps((function, shared, items[number])))
            yield number, pickle.loads(pickle.dumps(given[0](*given[1:])))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("archive")


@pytest.fixture(scope="module")
def options(folder: Path) -> WorldOptions:
    dem, zones = corpus.write_world(folder)
    return WorldOptions(
        {"dem": [dem], "vertical_datum": "EGM96"}, (zones,), corpus.OPTIONS, rtl_rel_home_m=corpus.RTL_M
    )


@pytest.fixture(scope="module")
def files(folder: Path) -> list[str]:
    """Some files in every manner, good and bad, and two that cannot be read."""
    names = ("round", "hill_between", "through_zone", "outside", "servants", "home", "low_above_terrain")
    found = [file for file, case in corpus.write(folder, MIXED).items() if case.name in names]
    for k, text in ((7, "{}"), (20, "QGC WPL 110\n0\t1\n")):
        broken = folder / f"broken{k}.plan"
        broken.write_text(text)
        found.insert(k, str(broken))
    return found


def results(
    options: WorldOptions, files: Sequence[str], workers: Executor, form: Form = "lines", returns: Returns = NO_RETURNS
) -> tuple[list[FileResult], Archive]:
    archive = Archive.with_options(options, None, files, returns, Shown(form))
    archive.read(workers)
    return list(archive.judged(workers)), archive


@pytest.mark.slow
def test_an_archive_is_judged_as_its_files_are_together(options: WorldOptions, files: list[str]) -> None:
    batch = check_at(OptionsSite(options, None), "check", files, VerdictParts())
    told, archive = results(options, files, Inline())
    assert [t.file for t in told] == files
    by_file = {t.file: t for t in told}
    for c in batch.checked:
        assert list(by_file[str(c.file)].lines) == finding_lines(c)
        assert by_file[str(c.file)].code == (0 if c.verdict.safe else 4)
    for argument, error in batch.unreadable:
        assert str(by_file[argument].error) == str(error)
    assert archive.sources == (batch.inputs, batch.notes)
    assert {t.code for t in told} == {0, 2, 4}


@pytest.mark.nightly_but("lines")
@pytest.mark.slow
@pytest.mark.parametrize("form", ["lines", "row", "whole"])
def test_results_do_not_depend_on_who_works_nor_on_what_is_kept(
    options: WorldOptions, files: list[str], form: Form, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PIECE", 5)
    alone, archive = results(options, files, Inline(), form)
    assert archive.work[0] == -(-len(files) // 5)
    other, _ = results(options, files, Scattered(), form)
    assert [told_without_error(t) for t in other] == [told_without_error(t) for t in alone]
    monkeypatch.setattr(module, "KEPT_READ_BYTES", 0)
    again, archive = results(options, files, Inline(), form)
    assert not archive.packed
    assert [told_without_error(t) for t in again] == [told_without_error(t) for t in alone]


@pytest.mark.nightly
def test_the_world_of_a_mission_is_the_same_everywhere(
    folder: Path, options: WorldOptions, files: list[str], tmp_path: Path
) -> None:
    (lat, lon), (near_lat, near_lon) = corpus.degrees(*corpus.HOME), corpus.degrees(-3900, -1900)
    mission = folder / "corner.yaml"  # in one corner of the terrain; the files go round it
    mission.write_text(
        f"""
version: 1
terrain: {{dem: dem.tif, vertical_datum: EGM96}}
limits: {{min_agl_m: 60, max_amsl_m: 750, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5}}
no_fly: [{{file: zones.geojson}}]
way_home: required
vehicles:
  - {{name: uav1, sysid: 1, autopilot: arducopter, start: [{lat}, {lon}], goal: [{near_lat}, {near_lon}]}}
"""
    )
    source = load_mission(mission)
    some = [f for f in files if "px4" not in f and ("round" in f or "outside" in f or "broken" in f)]
    batch = check_batch(source, some)
    judged = {str(c.file): c for c in batch.checked}
    found = []
    for workers in (Inline(), Scattered()):
        archive = Archive.in_mission(source, some, NO_RETURNS, Shown("row"))
        assert archive.request.returns.required
        archive.read(workers)
        found.append([told_without_error(t) for t in archive.judged(workers)])
        assert archive.sources == (batch.inputs, batch.notes)
    assert found[0] == found[1]
    for file, code, _, lines, *_ in found[0]:
        assert (file in judged) == (code != 2)
        assert lines == (tuple(finding_lines(judged[str(file)])) if file in judged else ())


def told_without_error(told: FileResult) -> tuple[object, ...]:
    return told.file, told.code, told.kinds, told.lines, str(told.error), told.text, told.failing


@pytest.mark.slow
def test_the_way_home_is_told_too(options: WorldOptions, files: list[str]) -> None:
    some = [f for f in files if "qgc-round" in f or "qgc-through" in f]
    told, archive = results(options, some, Scattered(), "row", Returns(judged=True, required=True))
    assert archive.work == (1, pytest.approx(2.0))
    rows = [json.loads(t.text) for t in told]
    assert all("way_home" in row for row in rows)
    unsafe = [row["way_home"]["safe"] is not True for row in rows]
    assert any(unsafe)
    assert [t.kinds.get("way_home", 0) for t in told] == [int(x) for x in unsafe]


@pytest.mark.slow
def test_a_bug_in_one_file_is_told_and_the_others_are_judged(
    options: WorldOptions, files: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    judge = check_sites.judge

    def stumbles(mission: Any, vehicle: Any, *more: Any, **options: Any) -> Any:
        if vehicle.name == "qgc-round":
            raise ZeroDivisionError("nought")
        return judge(mission, vehicle, *more, **options)

    before, _ = results(options, files, Inline())
    monkeypatch.setattr(check_sites, "judge", stumbles)
    told, _ = results(options, files, Inline())
    [(was, bad)] = [(a, b) for a, b in zip(before, told, strict=True) if told_without_error(a) != told_without_error(b)]
    assert (was.code, bad.code, bad.kinds) == (0, 70, {"internal": 1})
    assert "ZeroDivisionError: nought" in str(bad.error)
    summary = Summary()
    for t in told:
        summary.add(t)
    assert summary.code == 70


@pytest.mark.slow
def test_files_too_far_apart_for_one_plane_have_a_world_each(
    folder: Path, options: WorldOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    near = [f for f, case in corpus.write(folder, {"qgc": corpus.WITH_HOME["qgc"]}).items() if case.name == "round"]
    monkeypatch.setattr(corpus, "LON", corpus.LON + 8000 * (2 * corpus.HALF_DEG / 160))  # on the same grid of heights
    dem, _ = corpus.write_world(tmp_path)
    far = [f for f, case in corpus.write(tmp_path, {"qgc": corpus.WITH_HOME["qgc"]}).items() if case.name == "outside"]
    both = WorldOptions({"dem": [*options.terrain["dem"], dem], "vertical_datum": "EGM96"}, (), corpus.OPTIONS)  # type: ignore[misc]
    told, archive = results(both, [*near, *far, *near], Scattered())
    assert archive.request.extent is None
    assert [t.code for t in told] == [0, 4, 0]
    assert set(told[1].kinds) == {"coverage"}
    assert archive.sources[0]["vertical_datum"] == "EGM96"


def test_too_many_files_are_refused(options: WorldOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_FILES", 3)
    with pytest.raises(UsageError, match="at most 3 files are checked in one call, given 4"):
        Archive.with_options(options, None, ["x"] * 4, NO_RETURNS, Shown())


@pytest.mark.slow
def test_other_terrain_at_a_worker_is_an_error(options: WorldOptions, files: list[str]) -> None:
    archive = Archive.with_options(options, None, files[:2], NO_RETURNS, Shown())
    archive.read(Inline())
    archive.request = module.replace(archive.request, inputs={"dem_sha256": "another"})
    with pytest.raises(InputError, match=r"a worker reads other terrain or zones .*dem_sha256"):
        list(archive.judged(Inline()))


# -- the command --------------------------------------------------------------------------------------------------


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Any:
    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", "check", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return call


@pytest.fixture(scope="module")
def world(folder: Path, options: WorldOptions) -> list[object]:
    dem, zones = folder / "dem.tif", folder / "zones.geojson"
    return ["--dem", dem, "--vertical-datum", "EGM96", "--zones", zones, "--min-agl", 60, "--max-amsl", 750,
            "--max-climb", 20, "--rtl-altitude", corpus.RTL_M]  # fmt: skip


@pytest.mark.slow
def test_many_files_are_lines_and_a_summary(run: Any, files: list[str], world: list[object]) -> None:
    code, out, err = run(*files, *world)
    lines = out.splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith(f"{len(files)} files: "))
    findings, summary = lines[:head], lines[head:]
    _, quiet, _ = run(*files, *world, "-q")
    assert quiet.splitlines() == findings
    kinds = Counter(re.match(r".*?:-?\d+: (\w+): ", line)[1] for line in findings)  # type: ignore[index]
    for line in summary[1:]:
        kind, of_files, of_findings = re.match(r"  (\w+) +in (\d+) files?, (\d+) findings?$", line).groups()  # type: ignore[union-attr]
        if kind != "unreadable":
            assert int(of_findings) == kinds.pop(kind)
            assert int(of_files) == len({x.split(":")[0] for x in findings if f": {kind}: " in x})
    assert not kinds
    assert "cannot be read" in summary[0]
    assert "broken7.plan" in err
    assert code == 4  # worse than the 2 of files that cannot be read


@pytest.mark.slow
def test_json_lines_are_a_row_for_each_file_and_the_summary(run: Any, files: list[str], world: list[object]) -> None:
    code, out, _ = run(*files, *world, "--json-lines")
    *rows, last = map(json.loads, out.splitlines())
    assert [row["file"] for row in rows] == files
    assert code == last["error"]["code"] == 4
    assert last["summary"]["files"] == len(files)
    assert last["summary"]["codes"] == {str(c): n for c, n in sorted(Counter(row["code"] for row in rows).items())}
    assert last["inputs"]["vertical_datum"] == "EGM96"
    _, out, _ = run(*files, *world, "--json")
    document = json.loads(out)
    assert document["summary"] == last["summary"]
    whole = {v["file"]: v for v in document["verdicts"]}
    for row in rows:
        if row["code"] == 2:
            assert row["file"] not in whole
            assert row["error"]["reason"] == "bad_input"
            continue
        del row["code"]
        assert row == {key: whole[row["file"]][key] for key in row}
        assert not {"legs", "nearest_misses", "time_s"} & set(row)


@pytest.mark.slow
def test_the_document_is_written_as_one_would_be(run: Any, files: list[str], world: list[object]) -> None:
    for some in (files, files[:1], files[7:8]):
        _, out, _ = run(*some, *world, "--json")
        assert json.dumps(json.loads(out), indent=2, ensure_ascii=False) + "\n" == out
    assert list(json.loads(out)) == ["schema", "name", "inputs", "notes", "notes_data", "verdicts", "summary", "error"]


@pytest.mark.parametrize("option", ["--json", "--json-lines", "-q"])
def test_an_interruption_leaves_what_is_done(
    run: Any, files: list[str], world: list[object], option: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    judge, left = check_sites.judge, [4]

    def stops(*given: Any, **more: Any) -> Any:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return judge(*given, **more)

    monkeypatch.setattr(module, "PIECE", 2)
    monkeypatch.setattr(check_sites, "judge", stops)
    code, out, err = run(*files, *world, option)
    assert code == 130
    assert err.count("interrupted") == 1
    if option == "-q":
        return
    last = json.loads(out) if option == "--json" else json.loads(out.splitlines()[-1])
    assert last["error"]["code"] == 130
    assert last["summary"]["files"] == 4


@pytest.mark.slow
def test_folders_and_patterns_name_files(run: Any, tmp_path: Path, folder: Path, world: list[object]) -> None:
    (tmp_path / "deep").mkdir()
    good = [f for f, case in corpus.write(folder, MIXED).items() if case.name == "round" and "plan" in f]
    for k, file in enumerate(good):
        (tmp_path / "deep" / f"{k}{Path(file).suffix}").write_bytes(Path(file).read_bytes())
    (tmp_path / "deep" / "notes.txt").write_text("no mission")
    names = sorted(p.name for p in (tmp_path / "deep").iterdir() if p.suffix != ".txt")
    for argument in (tmp_path, tmp_path / "deep", str(tmp_path / "*" / "*[np]*s")):
        code, out, _ = run(argument, *world, "--json-lines")
        found = [Path(json.loads(line)["file"]).name for line in out.splitlines()[:-1]]
        assert found == [n for n in names if "*" not in str(argument) or n.endswith("waypoints")]
    (tmp_path / "empty").mkdir()
    code, _, err = run(tmp_path / "empty", *world)
    assert (code, "holds no .waypoints or .plan file" in err) == (2, True)


def test_two_kinds_of_json_are_too_many(run: Any, world: list[object]) -> None:
    code, _, err = run("x.plan", *world, "--json", "--json-lines")
    assert (code, "give one of them" in err) == (2, True)


@pytest.mark.slow
def test_the_error_of_a_document_stays_short(
    run: Any, files: list[str], world: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gcsplan.cli.output.check_output.MOST_FAILING", 3)
    _, out, _ = run(*files, *world, "--json")
    document = json.loads(out)
    bad = sum(n for code, n in document["summary"]["codes"].items() if code != "0")
    assert document["error"]["message"].splitlines()[-1] == f"… and {bad - 3} more files"
    assert len(document["error"]["where"].split(", ")) == 4


# -- thousands ----------------------------------------------------------------------------------------------------


def many(folder: Path, count: int) -> list[str]:
    """As many files, in turn in every manner that names a home."""
    texts = [(f"{manner}-{c.name}.{ending}", text(c.items).encode())
             for manner, (ending, text) in {k: MIXED[k] for k in ("qgc", "mavproxy", "plan")}.items()
             for c in corpus.cases() if c.only != "px4" and len(c.items) < 20]  # fmt: skip
    folder.mkdir()
    names = []
    for k in range(count):
        name, text = texts[k % len(texts)]
        (folder / f"{k:05d}-{name}").write_bytes(text if k % 100 != 50 else b"{")
        names.append(str(folder / f"{k:05d}-{name}"))
    return names


@pytest.fixture
def garbage_soon() -> Iterator[None]:
    """Garbage is searched for as in any process; a command that another test ran here lets 20 MB of it gather."""
    before = gc.get_threshold()
    gc.set_threshold(700, 10, 10)
    yield
    gc.set_threshold(*before)


@pytest.mark.nightly
@pytest.mark.usefixtures("garbage_soon")
def test_memory_does_not_grow_with_the_files(
    options: WorldOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "KEPT_READ_BYTES", 70_000)
    names = many(tmp_path / "many", 450)
    peaks = []
    for count in (20, 150, 450):
        archive = Archive.with_options(options, None, names[:count], NO_RETURNS, Shown("whole"))
        tracemalloc.start()
        archive.read(Inline())
        assert sum(1 for _ in archive.judged(Inline())) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] - peaks[1] < 300 * 1500  # names, and the places of ten items; a whole text has 10,000 characters


@pytest.mark.nightly
def test_a_thousand_files_by_processes_are_the_same(options: WorldOptions, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    names = many(tmp_path / "many", 1000)
    alone, _ = results(options, names, Inline(), "row")
    with executor(2, pieces=1000, piece_s=1.0) as two:
        assert not isinstance(two, Inline)
        both, _ = results(options, names, two, "row")
    assert [told_without_error(t) for t in both] == [told_without_error(t) for t in alone]
    summary = Summary()
    for told in both:
        summary.add(told)
    assert summary.files == 1000
    assert summary.codes[2] == 10
    assert summary.code == 4
