"""Labels of the report's figures: on no other label, on no symbol, inside the figure; computed by the page's script."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support import node

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


def test_the_better_label_stays_and_one_that_is_alone_stands_above_its_symbol() -> None:
    one = {"x": 300, "y": 200, "r": 4, "w": 60, "h": 15, "inside": False}
    ring = {"x": 301, "y": 201, "r": 9, "w": 0, "h": 0, "inside": False}
    assert node.ask(("labels.js",), "layLabels([given], 700, 400, [])", one) == [[270, 179]]
    both = node.ask(("labels.js",), "layLabels(given, 700, 400, [])", [one, ring])
    assert both[1] is None
    assert both[0][1] + 15 <= 201 - 9  # above the larger symbol that lies over its own
    full = [[0, 0, 700, 400]]
    assert node.ask(("labels.js",), f"layLabels([given], 700, 400, {full})", one) == [None]
