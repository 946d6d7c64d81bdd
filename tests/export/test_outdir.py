"""The output directory: whole or not at all, and never at the cost of somebody's file."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.export import outdir
from gcsplan.export.outdir import MANIFEST, PREVIOUS, add_output, retire_outputs, write_outputs

FIRST = {"uav1.waypoints": "one\n", "uav1.plan": b"{}\n", "mission.kml": "<kml/>\n"}
SECOND = {"uav2.waypoints": "two\n", "mission.kml": "<kml>2</kml>\n", "summary.json": "{}\n"}


def tree(root: Path) -> dict[str, bytes | None]:
    """Everything under ``root``: file contents, None for directories."""
    return {str(p.relative_to(root)): None if p.is_dir() else p.read_bytes() for p in sorted(root.rglob("*"))}


def files(root: Path) -> dict[str, bytes]:
    """What is there for people: no manifests, no directories."""
    return {k: v for k, v in tree(root).items() if v is not None and not k.endswith(MANIFEST)}


def test_files_are_written_with_their_bytes_into_a_new_directory(tmp_path: Path) -> None:
    write_outputs(tmp_path / "a" / "b", {"x.plan": "grün\n", "y.csv": b"\x00\r\n"})
    assert files(tmp_path) == {"a/b/x.plan": "grün\n".encode(), "a/b/y.csv": b"\x00\r\n"}


def test_no_temporary_file_stays_behind(tmp_path: Path) -> None:
    for _ in range(3):
        write_outputs(tmp_path, FIRST)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*FIRST, MANIFEST])


def test_the_same_outputs_give_the_same_bytes_everywhere(tmp_path: Path) -> None:
    write_outputs(tmp_path / "a", FIRST)
    write_outputs(tmp_path / "b", SECOND)
    write_outputs(tmp_path / "b", dict(reversed(FIRST.items())))
    assert tree(tmp_path / "a") == tree(tmp_path / "b")


def test_earlier_outputs_that_are_no_longer_made_go(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    write_outputs(tmp_path, SECOND)
    assert files(tmp_path) == {k: v.encode() for k, v in SECOND.items()}


def test_files_of_others_stay_where_they_are(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "old.waypoints").write_text("mine too")
    write_outputs(tmp_path, FIRST)
    write_outputs(tmp_path, SECOND)
    retire_outputs(tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "old.waypoints").read_text() == "mine too"


def test_a_file_of_others_in_the_way_is_moved_and_not_lost(tmp_path: Path) -> None:
    for text in ("mine 1", "mine 2", "mine 3"):
        (tmp_path / "mission.kml").write_text(text)
        write_outputs(tmp_path, FIRST)
        assert (tmp_path / "mission.kml").read_text() == FIRST["mission.kml"]
    kept = [(tmp_path / PREVIOUS / n).read_text() for n in ("mission.kml", "mission.1.kml", "mission.2.kml")]
    assert kept == ["mine 1", "mine 2", "mine 3"]


def test_an_output_that_somebody_edited_is_moved_and_not_lost(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    (tmp_path / "uav1.waypoints").write_text("edited")
    write_outputs(tmp_path, SECOND)
    assert not (tmp_path / "uav1.waypoints").exists()
    assert (tmp_path / PREVIOUS / "uav1.waypoints").read_text() == "edited"


def test_a_link_in_the_way_is_moved_and_what_it_points_to_is_left(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("precious")
    out = tmp_path / "out"
    out.mkdir()
    (out / "mission.kml").symlink_to(precious)
    write_outputs(out, FIRST)
    assert precious.read_text() == "precious"
    assert (out / PREVIOUS / "mission.kml").is_symlink()
    assert (out / "mission.kml").read_text() == FIRST["mission.kml"]


def test_an_added_output_leaves_the_others_and_goes_with_them(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    add_output(tmp_path, "upload.json", "{}")
    add_output(tmp_path, "upload.json", "{1}")
    assert set(files(tmp_path)) == {*FIRST, "upload.json"}
    assert (tmp_path / "upload.json").read_text() == "{1}"
    write_outputs(tmp_path, FIRST)
    assert set(files(tmp_path)) == set(FIRST)


# -- retirement ---------------------------------------------------------------------------------------------------


def test_retired_outputs_stand_in_previous_and_replace_those_before(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    assert retire_outputs(tmp_path) == sorted(FIRST)
    assert files(tmp_path) == {f"{PREVIOUS}/{k}": v if isinstance(v, bytes) else v.encode() for k, v in FIRST.items()}
    write_outputs(tmp_path, SECOND)
    assert retire_outputs(tmp_path) == sorted(SECOND)
    assert files(tmp_path) == {f"{PREVIOUS}/{k}": v.encode() for k, v in SECOND.items()}
    assert retire_outputs(tmp_path) == []
    assert not (tmp_path / MANIFEST).exists()


def test_retirement_keeps_what_others_left_in_previous(tmp_path: Path) -> None:
    (tmp_path / PREVIOUS).mkdir()
    (tmp_path / PREVIOUS / "mission.kml").write_text("mine")
    (tmp_path / PREVIOUS / "diary").write_text("mine")
    write_outputs(tmp_path, FIRST)
    retire_outputs(tmp_path)
    (tmp_path / PREVIOUS / "uav1.plan").write_text("edited in previous")
    write_outputs(tmp_path, FIRST)
    retire_outputs(tmp_path)
    previous = {k: v.decode() for k, v in files(tmp_path / PREVIOUS).items()}
    assert previous["mission.1.kml"] == previous["diary"] == "mine"
    assert previous["uav1.1.plan"] == "edited in previous"
    assert previous["mission.kml"] == FIRST["mission.kml"]


def test_retirement_takes_an_edited_output_along_and_never_deletes_it(tmp_path: Path) -> None:
    write_outputs(tmp_path, FIRST)
    (tmp_path / "uav1.waypoints").write_text("edited")
    assert "uav1.waypoints" in retire_outputs(tmp_path)
    write_outputs(tmp_path, FIRST)
    retire_outputs(tmp_path)
    assert (tmp_path / PREVIOUS / "uav1.1.waypoints").read_text() == "edited"


def test_nothing_to_retire_changes_nothing(tmp_path: Path) -> None:
    assert retire_outputs(tmp_path / "absent") == []
    (tmp_path / "uav1.waypoints").write_text("mine")
    before = tree(tmp_path)
    assert retire_outputs(tmp_path) == []
    assert tree(tmp_path) == before


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b'{"outputs": 3}', b"\xff", b"[" * 100_000])
def test_with_a_damaged_manifest_outputs_are_told_by_their_names_and_kept(tmp_path: Path, damage: bytes) -> None:
    first = FIRST | {"uav1.param": "RTL_ALT 6000\n"}
    write_outputs(tmp_path, first)
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / MANIFEST).write_bytes(damage)
    assert retire_outputs(tmp_path) == sorted(first)
    assert set(files(tmp_path)) == {"notes.txt", *(f"{PREVIOUS}/{name}" for name in first)}
    write_outputs(tmp_path, SECOND)
    (tmp_path / MANIFEST).write_bytes(damage)
    write_outputs(tmp_path, FIRST)
    assert (tmp_path / PREVIOUS / "uav2.waypoints").read_text() == "two\n"


def test_a_manifest_cannot_reach_outside_its_directory(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_outputs(out, FIRST)
    (tmp_path / "victim").write_text("mine")
    (out / MANIFEST).write_text('{"outputs": {"../victim": "0", "previous": "0", ".gcsplan": "0"}}')
    assert retire_outputs(out) == []
    write_outputs(out, FIRST)
    assert (tmp_path / "victim").read_text() == "mine"


# -- failures -----------------------------------------------------------------------------------------------------


def prepared(root: Path) -> Path:
    """A directory with our outputs, one of them edited, and files of others, some in the way of `SECOND`."""
    out = root / "out"
    write_outputs(out, FIRST)
    retire_outputs(out)
    write_outputs(out, FIRST)
    (out / "uav1.plan").write_text("edited")
    (out / "summary.json").write_text("mine")
    (out / PREVIOUS / "mission.kml").write_text("also mine")
    return out


@pytest.mark.parametrize("action", [lambda out: write_outputs(out, SECOND), retire_outputs])
def test_a_move_that_fails_leaves_everything_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, action: Callable[[Path], object]
) -> None:
    real = os.replace
    failures = 0
    for failing in range(40):
        out = prepared(tmp_path / str(failing))
        before = tree(out)
        calls = 0

        def replace(source: Path, target: Path, failing: int = failing) -> None:
            nonlocal calls
            calls += 1
            if calls - 1 == failing:
                raise OSError(errno.EIO, "Input/output error", str(source))
            real(source, target)

        said = ""
        monkeypatch.setattr(outdir.os, "replace", replace)
        try:
            action(out)
        except InputError as error:
            said = str(error)
        monkeypatch.setattr(outdir.os, "replace", real)
        if calls <= failing:
            break  # more than the moves that there are
        assert "Input/output error" in said
        assert tree(out) == before
        failures += 1
    assert failures >= 8


def test_a_full_disk_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = prepared(tmp_path)
    before = tree(tmp_path)

    def write(handle: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(outdir.os, "write", write)
    for target in (out, tmp_path / "new" / "deeper"):
        with pytest.raises(InputError, match="No space left on device"):
            write_outputs(target, SECOND)
    assert tree(tmp_path) == before


def test_an_interruption_leaves_everything_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = prepared(tmp_path)
    before = tree(out)
    real = os.replace

    def replace(source: Path, target: Path) -> None:
        real(source, target)
        if target.name == "mission.kml":
            monkeypatch.setattr(outdir.os, "replace", real)
            raise KeyboardInterrupt

    monkeypatch.setattr(outdir.os, "replace", replace)
    with pytest.raises(KeyboardInterrupt):
        write_outputs(out, SECOND)
    assert tree(out) == before


def test_where_even_the_way_back_fails_the_earlier_files_are_kept_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = prepared(tmp_path)
    before = set(files(out).values())
    real, calls = os.replace, 0

    def replace(source: Path, target: Path) -> None:
        nonlocal calls
        calls += 1
        if calls > 3:
            raise OSError(errno.EIO, "Input/output error", str(source))
        real(source, target)

    monkeypatch.setattr(outdir.os, "replace", replace)
    with pytest.raises(InputError, match="could not be brought back") as caught:
        write_outputs(out, SECOND)
    assert "earlier files are in" in caught.value.message
    assert before <= set(files(out).values())


@pytest.mark.parametrize("place", ["", "file/below", PREVIOUS, MANIFEST])
def test_a_file_in_the_place_of_a_directory_is_named_and_left(tmp_path: Path, place: str) -> None:
    out = tmp_path / "out"
    if place == "":
        out.write_text("mine")
    elif place == "file/below":
        (tmp_path / "file").write_text("mine")
        out = tmp_path / "file" / "below"
    elif place == PREVIOUS:
        out.mkdir()
        (out / PREVIOUS).write_text("mine")
        (out / "mission.kml").write_text("mine, in the way")
    else:
        (out / MANIFEST).mkdir(parents=True)
        (out / MANIFEST / "inside").write_text("mine")
    before = tree(tmp_path)
    with pytest.raises(InputError, match="nothing was changed") as caught:
        write_outputs(out, FIRST)
    assert caught.value.where == str(out)
    assert tree(tmp_path) == before


def test_names_that_are_no_plain_file_names_are_refused(tmp_path: Path) -> None:
    for name in ("../x", "a/b", "", ".", "..", ".hidden", PREVIOUS, MANIFEST, "a\0", "a b"):
        with pytest.raises(ValueError, match="plain file name"):
            write_outputs(tmp_path / "out", {name: ""})
    with pytest.raises(InputError, match="upper and lower case"):
        write_outputs(tmp_path / "out", {"UAV.plan": "", "uav.plan": ""})
    assert not (tmp_path / "out").exists()
