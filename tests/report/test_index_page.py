"""The page of a batch: what files say is text, and an empty map is none."""

from __future__ import annotations

from gcsplan.report.index_page import render_index
from gcsplan.units import METRIC


def test_the_page_escapes_what_files_say() -> None:
    row = {"mission": "a<b", "vehicle": "<script>", "code": 0, "verdict": "safe", "message": ""}
    bad = row | {"code": 3, "verdict": "no mission", "message": "<img src=x>", "vehicle": ""}
    page = render_index("t<", [row, bad], {0: [[47.0, 179.99], [47.01, -179.99]]}, METRIC, "summary.json")
    assert "<img" not in page
    assert "<script>alert" not in page
    assert "a&lt;b" in page
    assert 'href="a%3Cb/summary.json"' in page
    assert "2 missions" not in page  # one name, once
    assert 'd="M0.0' in page  # a track across 180 degrees is one short line
    assert "1.5" in page.split("the map is")[1][:12]


def test_an_empty_map_is_none() -> None:
    page = render_index("a batch", [], {}, METRIC, "summary.json")
    assert "<svg" not in page
    assert "a batch" in page
