"""The altitude profile on the page."""

from __future__ import annotations

from dataclasses import replace

from gcsplan.report.page import render_page
from gcsplan.report.parts import html as markup
from gcsplan.report.parts.page_data import Subject
from gcsplan.units import AVIATION, METRIC
from tests.support.pages import (
    small_page,
    verdict_over,
)


def test_a_short_track_has_whole_feet_and_a_place_is_not_a_range() -> None:
    """A track of 1814 m was "5 951.97 ft along the track", and a landing column lay at "0.98 – 0.98 NM"."""
    made = small_page()
    craft = made.subjects[0].vehicle
    short = Subject("uav1", verdict_over(made.world, [[0.0, 0, 430], [1814, 0, 430]], craft), craft)
    for units, length in ((AVIATION, "5\u202f951\u202fft"), (METRIC, "1\u202f814\u202fm")):
        text = render_page(replace(made, subjects=(short,), units=units))
        assert f"<summary>uav1: {length} along the track" in text
        assert (units is AVIATION) == ('<span class="last" style="left:99.625%">6\u202f000</span>' in text)
    assert markup.between(1814.0, 1814.3, AVIATION.far) == "0.98\u202fNM"
    assert markup.between(1814.0, 2814.0, METRIC.far) == "1.81 – 2.81\u202fkm"
