"""Who is shown in full on a large fleet's page, and who is listed as left out."""

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
from tests.support.pages import many_page, small_page


def test_of_a_fleet_up_to_a_hundred_everything_is_shown() -> None:
    page = many_page(MOST_WHOLE)
    assert in_full(page) == frozenset(range(MOST_WHOLE))
    assert only_some(page, in_full(page)) == ""


def with_room(subject: Subject, min_agl_m: float) -> Subject:
    """The subject with another lowest place."""
    legs = tuple(replace(leg, min_agl_m=min_agl_m) for leg in subject.verdict.legs)
    return replace(subject, verdict=replace(subject.verdict, legs=legs))


@pytest.mark.nightly
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
    assert f"{MOST_FULL} of {MOST_WHOLE + 1} vehicles are shown" in only_some(page, full)
    assert [n == LIGHT_SAMPLES for n in samples_of(page, full)] == [k not in full for k in range(len(page.subjects))]


def test_who_has_no_mission_is_listed_as_text() -> None:
    page = small_page()
    assert left_out_html(replace(page, left_out=())) == ""
    html = left_out_html(replace(page, left_out=(("uav<9>", "no way & none"),)))
    assert "1 without a mission, left out" in html
    assert "<b>uav&lt;9&gt;</b>: no way &amp; none" in html
