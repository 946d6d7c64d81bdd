"""The files of benchmarks: directories, whole files, pictures, and rows that outlive a cut."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from gcsplan.bench.files import kept_rows, png, ready, write_all
from gcsplan.errors import InputError


def test_a_directory_that_cannot_be_made_is_refused_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be made") as raised:
        ready(tmp_path / "file" / "out")
    assert raised.value.problems[0].where == str(tmp_path / "file" / "out")


def test_files_are_written_in_their_order_to_a_directory_that_is_made(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    assert write_all(out, {"z.md": "ä\r\n", "a.png": b"\x89"}) == [out / "z.md", out / "a.png"]
    assert (out / "z.md").read_bytes() == "ä\r\n".encode()
    assert (out / "a.png").read_bytes() == b"\x89"
    assert sorted(file.name for file in out.iterdir()) == ["a.png", "z.md"]


def test_a_row_that_is_cut_or_is_no_text_is_passed_over(tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    assert list(kept_rows(file)) == []
    file.write_bytes(b'{"a": 1}\n\n\xff\xfe\n[2]\n{"a": 3')
    assert list(kept_rows(file)) == [{"a": 1}, [2]]
    with pytest.raises(InputError, match="cannot be read"):
        list(kept_rows(tmp_path))


@pytest.mark.nightly
def test_a_picture_has_the_same_bytes_each_time() -> None:
    def drawn(dpi: float) -> bytes:
        figure = Figure(figsize=(2.0, 1.0))
        figure.subplots().plot([0.0, 1.0], [1.0, 0.0])
        return png(figure, dpi)

    assert drawn(50.0).startswith(b"\x89PNG")
    assert drawn(50.0) == drawn(50.0) != drawn(60.0)
