"""The page's frame and the marks over its figures: nothing from elsewhere, no foreign script, no label on another."""

from __future__ import annotations

import base64
import hashlib
import itertools
import re

import numpy as np
import pytest

from gcsplan.report.parts.html import LETTER_PX, LINE_PX, Mark, document, marks_html
from tests.support import node


@pytest.fixture(scope="module")
def page() -> str:
    return document(
        "</title><b>&", "<p>body</p>", "<i>data</i>", scripts=["base.js", "start.js"], what="mission report"
    )


def test_the_only_script_that_may_run_is_the_pages_own(page: str) -> None:
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert f"script-src 'sha256-{digest}';" in policy
    assert policy.startswith("default-src 'none';")
    assert "unsafe-inline" not in policy.split("script-src")[1]


def test_a_title_is_text_and_nothing_is_loaded(page: str) -> None:
    assert "<title>&lt;/title&gt;&lt;b&gt;&amp; – mission report</title>" in page
    assert page.count("</title>") == 1
    assert not re.search(r"<(link|img|iframe|script)\b[^>]*\b(src|href)=", page)
    assert "@import" not in page
    assert re.search(r"<body><p>body</p>.*<i>data</i><script>", page, re.DOTALL)


def test_a_mark_stands_at_its_part_of_the_figure_and_its_words_are_text() -> None:
    html = marks_html([Mark(0.25, 0.5, "home", "<a>", 'say "b"', 1)], ratio=0.5)
    assert 'class="mark home"' in html
    assert "left:25.000%;top:50.000%" in html
    assert "<b>&lt;a&gt;</b>" in html
    assert 'title="say &quot;b&quot;"' in html


def boxes_of(marks: list[Mark], ratio: float, width_px: float) -> list[tuple[float, float, float, float]]:
    """West, north, east, south of each label, above its mark."""
    found = []
    for m in marks:
        lines = m.label.split("\n")
        half = 0.5 * LETTER_PX * max(map(len, lines)) + 3.0
        x, y = m.x * width_px, m.y * width_px * ratio
        found.append((x - half, y - LINE_PX * len(lines), x + half, y))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_labels_that_are_shown_never_overlap_and_a_mute_one_would_a_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    marks = [
        Mark(*rng.random(2).tolist(), "vehicle", "x" * int(rng.integers(1, 9)), "", int(rank))
        for rank in rng.permutation(40)
    ]
    html = marks_html(marks, 0.6, 500.0)
    mute = ["mute" in span for span in re.findall(r'class="([^"]*)"', html)]
    boxes = boxes_of(marks, 0.6, 500.0)

    def meet(i: int, j: int) -> bool:
        a, b = boxes[i], boxes[j]
        return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]

    shown = [i for i, m in enumerate(mute) if not m]
    assert 0 < len(shown) < len(marks)
    assert not any(meet(i, j) for i, j in itertools.combinations(shown, 2))
    for i in np.flatnonzero(mute).tolist():
        assert any(meet(i, j) for j in shown if marks[j].rank < marks[i].rank)


pytestmark = pytest.mark.skipif(node.PROGRAM is None, reason="no Node is installed")
SIZE = (700.0, 400.0)


def crowd(seed: int) -> list[dict[str, float | bool]]:
    """Symbols in a crowd, some at the same place, with labels of many sizes."""
    rng = np.random.default_rng(seed)
    places = rng.uniform((0, 0), SIZE, (40, 2))
    places[::4] = places[1::4] + rng.uniform(-3, 3, (10, 2))
    return [
        {"x": float(x), "y": float(y), "r": float(rng.choice([0.0, 3.5, 6.5, 8.5])), "w": float(rng.uniform(8, 120)),
         "h": float(rng.choice([15.0, 30.0])), "inside": bool(rng.random() < 0.2)}
        for x, y in places
    ]  # fmt: skip


@pytest.mark.nightly
def test_no_label_lies_on_a_label_a_symbol_or_the_rim() -> None:
    crowds = [crowd(seed) for seed in range(20)]
    corner = [0.0, 0.0, 60.0, 40.0]
    expression = f"given.map((one) => layLabels(one, {SIZE[0]}, {SIZE[1]}, [{corner}]))"
    placed = 0
    for things, found in zip(crowds, node.ask(("labels.js",), expression, crowds), strict=True):
        boxes = [corner] + [[t["x"] - t["r"], t["y"] - t["r"], t["x"] + t["r"], t["y"] + t["r"]] for t in things]
        for thing, at in zip(things, found, strict=True):
            if at is None:
                continue
            left, top, right, bottom = *at, at[0] + thing["w"], at[1] + thing["h"]
            assert left >= 0.0 <= top
            assert right <= SIZE[0]
            assert bottom <= SIZE[1]
            for b in boxes:
                empty = b[0] == b[2]
                assert empty or right <= b[0] or b[2] <= left or bottom <= b[1] or b[3] <= top, (thing, b)
            boxes.append([left, top, right, bottom])
            placed += 1
    assert placed > 20 * 20  # half of a crowd at least


@pytest.mark.slow
def test_the_better_label_stays_and_one_that_is_alone_stands_above_its_symbol() -> None:
    one = {"x": 300, "y": 200, "r": 4, "w": 60, "h": 15, "inside": False}
    ring = {"x": 301, "y": 201, "r": 9, "w": 0, "h": 0, "inside": False}
    assert node.ask(("labels.js",), "layLabels([given], 700, 400, [])", one) == [[270, 179]]
    both = node.ask(("labels.js",), "layLabels(given, 700, 400, [])", [one, ring])
    assert both[1] is None
    assert both[0][1] + 15 <= 201 - 9  # above the larger symbol that lies over its own
    full = [[0, 0, 700, 400]]
    assert node.ask(("labels.js",), f"layLabels([given], 700, 400, {full})", one) == [None]
