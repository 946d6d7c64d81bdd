"""What a mission is read from: a file, a text, a sample found by its name from anywhere, and what is none of them."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import yaml

from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission, source
from gcsplan.mission_file.source import sample_names
from tests.mission_file.test_load import PLANNERS, base, problems
from tests.support.paths import MISSIONS, REPOSITORY


@pytest.mark.nightly
def test_a_sample_is_the_mission_file_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("fleet-4", "papers/abo"):
        of_sample, of_file = load_mission(f"sample:{name}"), load_mission(MISSIONS / f"{name}.yaml")
        assert (of_sample.name, of_sample.stem, of_sample.path) == (of_file.name, Path(name).stem, of_file.path)
        assert of_sample.inputs == of_file.inputs
    assert load_mission(Path("sample:fleet-4")).stem == "fleet-4"


def test_every_mission_of_the_repository_is_in_the_wheel_once() -> None:
    build = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    inside = build["targets"]["wheel"]["force-include"]
    assert all(target == f"gcsplan/{source}" for source, target in inside.items())
    wheel = {
        file.relative_to(REPOSITORY).as_posix()
        for source in inside
        for file in ((REPOSITORY / source).rglob("*.yaml") if (REPOSITORY / source).is_dir() else [REPOSITORY / source])
    }
    assert wheel == {f"missions/{name}.yaml" for name in sample_names()}
    assert wheel == {file.relative_to(REPOSITORY).as_posix() for file in MISSIONS.rglob("*.yaml")}


def test_the_files_within_the_package_count_before_a_folder_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inside, beside = tmp_path / "gcsplan" / "missions", tmp_path / "missions"
    monkeypatch.setattr(source, "SAMPLE_FOLDERS", (inside, beside))
    assert sample_names() == []
    for folder, name in ((beside, "other"), (inside, "own")):
        folder.mkdir(parents=True)
        (folder / f"{name}.yaml").write_text("version: 1\n")
    assert sample_names() == ["own"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("sample:jaksboro", "did you mean jacksboro? There are: fleet-100, fleet-4, jacksboro, "),
        ("sample:jacksboro.yaml", "did you mean jacksboro? There are: "),
        ("sample:", "there is no such sample. There are: fleet-100, "),
        ("sample:../missions/jacksboro", "there is no such sample; did you mean jacksboro? There are: "),
        ("sample:/etc/passwd", "there is no such sample. There are: "),
        ("jacksboro.yaml", "there is no such file; did you mean sample:jacksboro?"),
        ("nowhere.yaml", "there is no such file"),
    ],
)
def test_an_unknown_sample_lists_those_that_there_are(
    name: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as raised:
        load_mission(name)
    assert str(raised.value).startswith(f"{name}: ")
    assert said in str(raised.value)
    assert ("papers/abo" in str(raised.value)) is name.startswith("sample:")


def test_a_file_that_is_called_like_a_sample_keeps_its_meaning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (MISSIONS / "fleet-4.yaml").read_text(encoding="utf-8")
    (tmp_path / "sample:jacksboro").write_text(text, encoding="utf-8")
    assert load_mission("sample:jacksboro").name == "Four to the plateau"
    # A text that is given with its path is that text.
    assert load_mission("sample:fleet-100", text=text).name == "Four to the plateau"


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9")
    (tmp_path / "big.yaml").write_bytes(b"#" * 5_000_001)
    cases = {
        "none.yaml": "no such file",
        "": "folder",
        "latin.yaml": "UTF-8",
        "big.yaml": "at most",
        "a\0b": "source is a path",
    }
    for name, words in cases.items():
        with pytest.raises(InputError, match=words):
            load_mission(tmp_path / name if name else tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"), ("- 1", "keys"), ("5", "keys"), ("a", "keys"), ("version: 1\nversion: 1", "stands twice"),
        ("\tversion: 1", "tab"), ("version: 1\n  x: [", "line 2"),
    ],
)  # fmt: skip
def test_text_that_is_no_mission_is_told(text: str, words: str) -> None:
    (problem,) = problems(text)
    assert words in problem.message


def test_a_byte_order_mark_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + yaml.safe_dump(base()).encode())
    assert load_mission(path, planner_names=PLANNERS).stem == "m"
