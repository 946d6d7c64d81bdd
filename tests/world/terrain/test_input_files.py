"""Files that a mission reads: a change of any is seen, and nothing else is."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gcsplan.world.terrain.input_files import (
    FileReading,
    absent,
    beside,
    path_of,
    reading,
    tell_file,
    tell_folder,
    tell_setting,
)


@pytest.fixture
def marks(tmp_path: Path) -> dict[str, str]:
    """What was reported of a file, one that is not there, and a folder's .kml files."""
    (tmp_path / "a.yaml").write_text("one")
    (tmp_path / "z.kml").write_text("zone")
    with reading() as found:
        tell_file(tmp_path / "a.yaml")
        tell_file(tmp_path / "later.yaml")
        tell_folder(tmp_path, (".kml",))
    return found.marks


def test_what_stays_as_it_is_has_not_changed(tmp_path: Path, marks: dict[str, str]) -> None:
    assert len(marks) == 3
    (tmp_path / "other.txt").write_text("nobody reads it")
    os.utime(tmp_path / "a.yaml", (1, 1))  # the content counts, not the time
    assert FileReading.changed(marks) == ""


@pytest.mark.parametrize("change", ["content", "appears", "gone", "another in the folder"])
def test_a_change_is_told_by_its_path(tmp_path: Path, marks: dict[str, str], change: str) -> None:
    name = {"content": "a.yaml", "appears": "later.yaml", "gone": "a.yaml", "another in the folder": "y.KML"}[change]
    if change == "gone":
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_text("two")
    wanted = tmp_path if change == "another in the folder" else tmp_path / name
    assert FileReading.changed(marks) == str(wanted)


def test_outside_of_reading_nothing_is_kept_and_inner_ones_are_their_own(tmp_path: Path) -> None:
    tell_file(tmp_path / "a")
    with reading() as outer:
        tell_file(tmp_path / "b")
        with reading() as inner:
            tell_file(tmp_path / "c")
        tell_setting("GCSPLAN_NO_SUCH")
    assert [path_of(key) for key in outer.marks] == [str(tmp_path / "b"), "GCSPLAN_NO_SUCH"]
    assert [path_of(key) for key in inner.marks] == [str(tmp_path / "c")]


def test_a_setting_that_changes_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GCSPLAN_TEST", raising=False)
    with reading() as found:
        tell_setting("GCSPLAN_TEST")
    assert FileReading.changed(found.marks) == ""
    monkeypatch.setenv("GCSPLAN_TEST", "elsewhere")
    assert FileReading.changed(found.marks) == "GCSPLAN_TEST"


def test_the_files_beside_a_raster_begin_with_its_name_in_any_case(tmp_path: Path) -> None:
    for name in ("a.tif", "a.tfw", "A.TIF.aux.xml", "a.prj", "b.tfw", "ab.tif"):
        (tmp_path / name).touch()
    assert {p.name for p in beside(tmp_path / "a.tif")} >= {"a.tfw", "A.TIF.aux.xml", "a.prj"}
    assert "b.tfw" not in {p.name for p in beside(tmp_path / "a.tif")}


def test_the_name_that_an_absent_file_may_have_meant_belongs_to_what_was_read(tmp_path: Path) -> None:
    (tmp_path / "zones.geojson").write_text("{}")
    with reading() as read:
        words = absent(tmp_path / "zone.geojson")
    assert "did you mean" in words
    assert not FileReading.changed(read.marks)
    (tmp_path / "another.txt").write_text("")
    assert not FileReading.changed(read.marks), "a name that is not near changes nothing"
    (tmp_path / "zones.geojson").unlink()
    assert FileReading.changed(read.marks) == str(tmp_path / "zone.geojson")
