"""A point of the benchmark of scale, measured here, and the digest that tells whether outputs are the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.bench.scale import point


def test_the_digest_is_that_of_names_and_contents_whatever_else_a_directory_has(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name / "sub").mkdir(parents=True)
        (tmp_path / name / "sub" / "a.plan").write_bytes(b"x")
    (tmp_path / "two" / "empty").mkdir()
    assert point.digest_of(tmp_path / "one") == point.digest_of(tmp_path / "two")
    (tmp_path / "two" / "sub" / "a.plan").rename(tmp_path / "two" / "sub" / "b.plan")
    renamed = point.digest_of(tmp_path / "two")
    (tmp_path / "two" / "sub" / "b.plan").write_bytes(b"y")
    assert len({point.digest_of(tmp_path / "one"), renamed, point.digest_of(tmp_path / "two")}) == 3


@pytest.mark.slow
def test_points_of_zones_plan_as_many_missions_as_asked_and_tell_their_cost() -> None:
    found = point.POINT_KINDS["zones"](zones=3, seed=1, tiles="", missions=1)
    assert (found["zones"], found["planned"]) == (3, 1)
    assert found["cells"] > 1000
    assert 0.0 < found["cpu_s"] < 60.0
    assert found["peak_mb"] > 50.0
