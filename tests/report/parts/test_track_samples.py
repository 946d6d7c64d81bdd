"""Samples of a mission's line, the zones that it passes, and its distance from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.report.page import render_page
from gcsplan.report.parts.track_samples import distance_m, line_of, passages
from gcsplan.world.geometry.zones import Polygon, Zone
from tests.support.effort import draws
from tests.support.pages import (
    ZONES,
    Reader,
    small_page,
)


def test_samples_stand_on_the_line_and_hold_the_end_of_every_leg() -> None:
    page = small_page()
    subject = page.subjects[0]
    line = line_of(subject.verdict, page.world, subject.vehicle.limits)
    assert line is not None
    assert line.end.sum() == len(subject.verdict.legs)
    assert (np.diff(line.run_m) >= 0).all()
    assert line.length_m == pytest.approx(sum(leg.horizontal_m for leg in subject.verdict.legs))
    assert line.used_j[-1] == pytest.approx(subject.verdict.energy_j)
    assert line.time_s[-1] == pytest.approx(subject.verdict.time_s)
    for i, leg in enumerate(subject.verdict.legs):
        mine = line.leg == i
        assert line.amsl_m[mine][-1] == pytest.approx(leg.end[2])
        if not leg.column:
            assert np.nanmin(line.amsl_m[mine] - line.top_m[mine]) >= leg.min_agl_m - 1e-6
            assert np.nanmin(line.amsl_m[mine] - line.top_m[mine]) == pytest.approx(leg.min_agl_m, abs=1.0)
    flown = ~np.array([leg.column for leg in subject.verdict.legs])[line.leg]
    assert (line.amsl_m[flown] > line.floor_m[flown]).all()


@pytest.mark.nightly
def test_zones_are_passed_over_and_under_and_the_far_one_is_not_passed() -> None:
    page = small_page()
    subject = page.subjects[0]
    line = line_of(subject.verdict, page.world, subject.vehicle.limits)
    assert line is not None
    found = {p.zone.name: p for p in passages(line, ZONES, 33.0)}
    assert set(found) == {"mast", "training area"}
    mast, area = found["mast"], found["training area"]
    assert mast.over_m is not None
    assert mast.under_m is None
    assert area.over_m is None
    assert area.under_m is not None
    part = slice(mast.first, mast.last + 1)
    assert mast.over_m == pytest.approx(float((line.amsl_m - line.ground_m - 40.0)[part].min()))
    text = Reader(render_page(page)).text
    assert "above its ceiling" in text
    assert "below its floor" in text


@settings(max_examples=draws(80))
@given(st.lists(st.tuples(st.floats(-900, 900), st.floats(-900, 900)), min_size=1, max_size=8), st.integers(3, 9))
def test_the_distance_from_a_polygon_is_that_of_its_densely_sampled_rim(
    places: list[tuple[float, float]], corners: int
) -> None:
    rng = np.random.default_rng(corners)
    turn = 2 * np.pi * np.arange(corners) / corners
    star = (rng.uniform(150, 500, corners) * np.array([np.cos(turn), np.sin(turn)])).T
    at = np.array(places)
    t = np.linspace(0, 1, 400)[:, None]
    rim = np.concatenate([a + t * (b - a) for a, b in zip(star, np.roll(star, -1, axis=0), strict=True)])
    away = np.hypot(*(at[:, None] - rim[None]).transpose(2, 0, 1)).min(axis=1)
    found = distance_m(Zone("z", Polygon(star)), at[:, 0], at[:, 1])
    assert np.abs(np.abs(found) - away).max() < 3.0
    angle = np.unwrap(np.arctan2(*(np.concatenate([rim, rim[:1]])[None] - at[:, None]).transpose(2, 0, 1)[::-1]))
    inside = np.abs(angle[:, -1] - angle[:, 0]) > np.pi
    clear = away > 5.0
    assert ((found < 0) == inside)[clear].all()
