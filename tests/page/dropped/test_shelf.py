"""The shelf of dropped files: bounds before bytes, names without folders, one file at a time, nothing else replaced."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.files.file_items import MAX_FILE_BYTES
from gcsplan.page.dropped.shelf import Dropped, Shelf, endings, has_other, laid_out, most_bytes, place_in, safe_name


@pytest.mark.parametrize(
    ("given", "name"),
    [("../../etc/zones.kml", "zones.kml"), (r"C:\maps\zones.kml", "zones.kml"), (".bashrc.kml", "bashrc.kml"),
     ("Zonen München (2).kml", "Zonen_M_nchen_2_.kml"), ("", "file"), ("/", "file"), ("a\0b\n.kml", "a_b_.kml"),
     ("x" * 300 + ".kml", "x" * 92 + ".kml"), ("-rf.plan", "rf.plan"),
     ("зоны.geojson", "file.geojson"), ("地形.tif", "file.tif"), ("a." + "b" * 200, "b" * 96)],
)  # fmt: skip
def test_a_name_has_no_folder_and_plain_letters(given: str, name: str) -> None:
    assert safe_name(given) == name


@pytest.mark.parametrize("name", ["field.yaml", "run.sh", "log.bin", "zones", ".kml"])
def test_a_file_of_another_kind_is_refused_with_a_cure_before_its_bytes(name: str) -> None:
    with pytest.raises(InputError) as why:
        Shelf().receive(name, 10)
    assert len(why.value.message) > 20


def test_more_bytes_than_a_kind_may_have_are_refused_before_and_as_they_come() -> None:
    shelf = Shelf()
    assert most_bytes("A.PLAN") == MAX_FILE_BYTES
    with pytest.raises(InputError, match=f"more than {MAX_FILE_BYTES}"):
        shelf.receive("a.plan", MAX_FILE_BYTES + 1)
    coming = shelf.receive("a.plan", None)
    coming.add(b"x" * MAX_FILE_BYTES)
    with pytest.raises(InputError, match=f"more than {MAX_FILE_BYTES}"):
        coming.add(b"x")
    assert set(endings().values()) >= {MAX_FILE_BYTES}


def test_a_newer_file_supersedes_one_that_is_still_coming() -> None:
    shelf = Shelf()
    first, second = shelf.receive("a.plan", None), shelf.receive("b.kml", None)
    with pytest.raises(InputError, match="meanwhile"):
        first.add(b"{}")
    with pytest.raises(InputError, match="meanwhile"):
        shelf.put(first)
    with pytest.raises(InputError, match="drop it again"):
        _ = shelf.held
    second.add(b"<kml/>")
    shelf.put(second)
    assert shelf.held == Dropped("b.kml", "zones", b"<kml/>")
    shelf.clear()
    with pytest.raises(InputError, match="drop it again"):
        _ = shelf.held


@pytest.mark.parametrize(
    ("name", "data", "kind"),
    [("a.plan", b"{}", "mission"), ("a.txt", b"\xef\xbb\xbfQGC WPL 110\n", "mission"), ("a.txt", b"AC D\n", "zones"),
     ("a.json", b"{}", "zones"), ("a.TIF", b"II*\0", "ground"), ("N46E008.hgt", b"", "ground"),
     ("a.tif.aux.xml", b"", "ground")],
)  # fmt: skip
def test_the_kind_is_known_by_name_and_first_bytes(name: str, data: bytes, kind: str) -> None:
    shelf = Shelf()
    coming = shelf.receive(name, len(data))
    coming.add(data)
    assert shelf.put(coming).kind == kind


def test_a_file_is_written_into_the_folder_and_never_through_a_link(tmp_path: Path) -> None:
    outside, folder = tmp_path / "outside.kml", tmp_path / "missions"
    folder.mkdir()
    outside.write_text("mine")
    (folder / "z.kml").symlink_to(outside)
    assert has_other(folder / "z.kml", b"mine")
    place_in(folder, Dropped("z.kml", "zones", b"new"))
    assert (outside.read_text(), (folder / "z.kml").read_text()) == ("mine", "new")
    assert not has_other(folder / "z.kml", b"new")
    assert not has_other(folder / "other.kml", b"")
    (folder / "d.kml").mkdir()
    with pytest.raises(InputError, match="folder has this name"):
        place_in(folder, Dropped("d.kml", "zones", b""))


def test_files_of_ground_come_together_within_bounds_and_no_other_kind_joins_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("gcsplan.page.dropped.shelf.MOST_TOGETHER_BYTES", 10)
    shelf = Shelf()
    shelf.put(shelf.receive("a.prj", None))
    coming = shelf.receive("a.asc", None, more=True)
    coming.add(b"12345678")
    held = shelf.put(coming)
    assert ([one.name for one in held.all], held.rasters) == (["a.prj", "a.asc"], ["a.asc"])
    for name, size, words in (("b.asc", 3, "more than 2"), ("a.asc", 1, "different names"), ("z.kml", 1, "alone")):
        with pytest.raises(InputError, match=words):
            shelf.receive(name, size, more=True)
    shelf.put(shelf.receive("all.vrt", 0, more=True))
    assert shelf.held.rasters == ["all.vrt"]
    with laid_out(shelf.held) as folder:
        assert sorted(file.name for file in folder.iterdir()) == ["a.asc", "a.prj", "all.vrt"]
        assert folder.stat().st_mode & 0o077 == 0
    assert not folder.exists()
