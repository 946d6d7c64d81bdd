"""Figures of the page as PNG."""

from __future__ import annotations

import io
from itertools import combinations

import numpy as np
import pytest
from PIL import Image

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import picture_of
from gcsplan.app.output.report import page_of_plan
from gcsplan.report.views.picture import draw, figures
from tests.export.test_output_schema import FLAT
from tests.support.pages import (
    planned,
)


@pytest.mark.nightly
def test_each_figure_is_drawn_as_a_png_too() -> None:
    drawn = figures(page_of_plan(planned()))
    assert set(drawn) == {"report-map.png", "report-space.png", "report-profile.png"}
    for content in drawn.values():
        image = Image.open(io.BytesIO(content))
        assert image.format == "PNG"
        assert image.width > 800


@pytest.mark.nightly
def test_no_label_of_the_map_lies_on_another() -> None:
    page = page_of_plan(planned())
    figure = draw(page)
    figure.draw_without_rendering()  # type: ignore[no-untyped-call]
    labels = [(t.get_text(), t.get_window_extent()) for t in figure.axes[0].texts]
    assert {words.split("\n")[0] for words, _ in labels} >= {"relay mast", "raptor cliffs", "quarry", "airfield"}
    for (one, a), (other, b) in combinations(labels, 2):
        assert not a.padded(-1.0).overlaps(b.padded(-1.0)), (one, other)


@pytest.mark.nightly
def test_the_map_has_the_reports_colours_low_ground_is_no_lake() -> None:
    drawn = figures(page_of_plan(planned()))["report-map.png"]
    pixels = np.asarray(Image.open(io.BytesIO(drawn)).convert("RGB"), np.int16)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    assert float(np.mean((blue > green + 20) & (blue > red + 20))) < 0.001


@pytest.mark.nightly_but("svg-<?xml")
@pytest.mark.slow
@pytest.mark.parametrize(("form", "begins"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_a_picture_of_each_form_has_the_same_bytes_again(form: str, begins: bytes) -> None:
    small = plan(FLAT)
    one, other = (picture_of(small, form) for _ in range(2))
    assert one.startswith(begins)
    assert one == other
