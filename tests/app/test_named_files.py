"""Arguments that name files: one, a folder's, a pattern's, and those that no disk can hold."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gcsplan.app.named_files import named_files, names_several
from gcsplan.errors import InputError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """b.plan, a.plan, notes.txt, deep/c.plan, and a folder that is called like a file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep" / "folder.plan").mkdir(parents=True)
    for name in ("b.plan", "a.plan", "notes.txt", "deep/c.plan"):
        (tmp_path / name).write_text("")
    return tmp_path


def test_a_folder_gives_the_files_of_the_wanted_endings_however_deep_they_lie(folder: Path) -> None:
    names = [file.relative_to(folder).as_posix() for file in named_files(str(folder), (".plan",))]
    assert names == ["a.plan", "b.plan", "deep/c.plan"]


def test_nothing_of_a_folder_is_passed_by_silently(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "d.plan").write_text("")
    (elsewhere / "round").symlink_to(folder)
    (folder / "LOUD.PLAN").write_text("")
    (folder / "broken.plan").symlink_to("nowhere")
    (folder / "deep" / "linked").symlink_to(elsewhere)
    names = [file.relative_to(folder).as_posix() for file in named_files(str(folder), (".plan",))]
    assert sorted(names) == ["LOUD.PLAN", "a.plan", "b.plan", "broken.plan", "deep/c.plan", "deep/linked/d.plan"]
    assert [file.name for file in named_files("br*", ())] == ["broken.plan"]


def test_a_folder_that_cannot_be_read_is_an_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = os.scandir

    def closed(path: str) -> object:
        if str(path).endswith("deep"):
            raise PermissionError(13, "Permission denied", path)
        return scan(path)

    monkeypatch.setattr(os, "scandir", closed)
    with pytest.raises(InputError, match="Permission denied"):
        named_files(str(folder), (".plan",))


def test_a_pattern_gives_what_it_matches_whatever_its_ending(folder: Path) -> None:
    assert [file.name for file in named_files("*.*", (".plan",))] == ["a.plan", "b.plan", "notes.txt"]
    assert named_files("none*", (".plan",)) == []
    assert [file.name for file in named_files(f"{folder}/deep/*", ())] == ["c.plan"]


def test_one_file_is_given_back_whether_it_is_there_or_not(folder: Path) -> None:
    assert named_files("notes.txt", (".plan",)) == [Path("notes.txt")]
    assert named_files("missing.plan", (".plan",)) == [Path("missing.plan")]


def test_a_file_whose_name_looks_like_a_pattern_is_one_file(folder: Path) -> None:
    (folder / "what[1].plan").write_text("")
    assert not names_several("what[1].plan")
    assert names_several("what[2].plan")
    assert names_several(str(folder))
    assert not names_several("x" * 5000)


def test_a_pattern_that_is_none_is_bad_input(folder: Path) -> None:
    with pytest.raises(InputError, match="cannot be searched for files"):
        named_files("a**/*\0", ())


def test_names_with_numbers_are_in_the_order_of_the_numbers(tmp_path: Path) -> None:
    for name in ("leg10.plan", "leg2.plan", "a9/x.plan", "a10/x.plan", "leg.plan"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("")
    found = [p.relative_to(tmp_path).as_posix() for p in named_files(str(tmp_path), [".plan"])]
    assert found == ["a9/x.plan", "a10/x.plan", "leg2.plan", "leg10.plan", "leg.plan"]
