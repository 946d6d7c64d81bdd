"""Parts of the page by themselves: heights of zones, the bar of the scale, who is shown in full, lists of zones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.report.parts.page_data import (
    LIGHT_SAMPLES,
    MOST_FULL,
    MOST_WHOLE,
    Subject,
    in_full,
    left_out_html,
    only_some,
    samples_of,
)
from gcsplan.report.views.plan import scale_bar, zone_heights
from gcsplan.units import AVIATION, METRIC
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.report.test_page import many_page, small_page


@pytest.mark.parametrize("about_m", [3.0, 47.0, 950.0, 12_345.0])
@pytest.mark.parametrize("units", [METRIC, AVIATION], ids=lambda u: u.name)
def test_the_bar_of_the_scale_is_as_long_as_it_says_and_near_what_is_asked(about_m: float, units: object) -> None:
    metres, words = scale_bar(about_m, units)  # type: ignore[arg-type]
    number, symbol = words.replace("\u202f", " ").rsplit(" ", 1)
    unit = {"m": 1.0, "km": 1000.0, "ft": 0.3048, "NM": 1852.0}[symbol]
    assert float(number.replace(" ", "")) * unit == pytest.approx(metres, rel=1e-9)
    assert number.strip("0.")[:1] in "125"
    assert 0.3 * about_m <= metres <= 2.5 * about_m


def test_a_zones_heights_are_both_levels_with_their_datum() -> None:
    shape = Circle(0.0, 0.0, 50.0)
    both = zone_heights(Zone("z", shape, Level(30.0, "agl"), Level(450.0, "amsl")), METRIC)
    assert "30" in both
    assert "AGL" in both
    assert "450" in both
    assert "AMSL" in both
    whole = zone_heights(Zone("z", shape, None, None), METRIC)
    assert "30" not in whole
    assert whole != both


def test_of_a_fleet_up_to_a_hundred_everything_is_shown() -> None:
    page = many_page(MOST_WHOLE)
    assert in_full(page) == frozenset(range(MOST_WHOLE))
    assert only_some(page, in_full(page)) == ""


def with_room(subject: Subject, min_agl_m: float) -> Subject:
    """The subject with another lowest place."""
    legs = tuple(replace(leg, min_agl_m=min_agl_m) for leg in subject.verdict.legs)
    return replace(subject, verdict=replace(subject.verdict, legs=legs))


def test_of_a_larger_fleet_those_with_problems_and_least_room_are_shown() -> None:
    page = many_page(MOST_WHOLE + 1)
    rng = np.random.default_rng(1)
    page = replace(page, subjects=tuple(with_room(s, float(rng.uniform(1.0, 90.0))) for s in page.subjects))
    full = in_full(page)
    assert len(full) == MOST_FULL
    unsafe = {k for k, s in enumerate(page.subjects) if s.verdict.safe is not True}
    assert unsafe == {MOST_WHOLE}
    assert len({s.homeless for s in page.subjects}) == 1  # nobody comes first for that
    least = page.separation.least if page.separation is not None else None
    near = {k for k, s in enumerate(page.subjects) if least is not None and s.name in least.vehicles}
    assert unsafe | near <= full
    room = {k: s.verdict.lowest.min_agl_m for k, s in enumerate(page.subjects) if s.verdict.lowest is not None}
    rest = full - unsafe - near
    assert max(room[k] for k in rest) <= min(room[k] for k in range(len(page.subjects)) if k not in full)
    assert f"Of {MOST_WHOLE + 1} vehicles {MOST_FULL} are shown" in only_some(page, full)
    assert [n == LIGHT_SAMPLES for n in samples_of(page, full)] == [k not in full for k in range(len(page.subjects))]


def test_who_has_no_mission_is_listed_as_text() -> None:
    page = small_page()
    assert left_out_html(replace(page, left_out=())) == ""
    html = left_out_html(replace(page, left_out=(("uav<9>", "no way & none"),)))
    assert "1 without a mission, left out" in html
    assert "<b>uav&lt;9&gt;</b>: no way &amp; none" in html
