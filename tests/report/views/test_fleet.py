"""A fleet over time on the page."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from gcsplan.report.page import render_page
from gcsplan.report.views import fleet as fleet_view
from tests.fleet.test_separation import random_fleet
from tests.support.pages import (
    Reader,
    fleet_page,
    many_page,
    planned_page,
    small_page,
)


@pytest.mark.nightly
def test_of_a_large_fleet_all_are_on_the_map_and_some_have_profiles() -> None:
    page = many_page(130)
    text = render_page(page)
    read = Reader(text)
    assert len(read.data["lines"]) == 130
    assert text.count('<polyline class="track ') == 130
    profiles = set(re.findall(r'<figure class="[^"]*" id="profile-(\d+)"', text))
    assert len(profiles) == 24
    assert "129" in profiles  # the one with a problem
    least = page.separation.least if page.separation is not None else None
    assert least is not None
    assert {str(int(name[3:]) - 1) for name in least.vehicles} <= profiles
    assert "24 of 130 vehicles are shown" in read.text
    assert "1 without a mission, left out" in read.text
    assert "it is <shut> in" in read.text
    assert {int(n) for n in re.findall(r'<tr[^>]* data-vehicle="(\d+)"', text)} == set(range(130))
    assert len(text) < 4_000_000
    whole = render_page(many_page(100))
    assert len(set(re.findall(r'id="profile-(\d+)"', whole))) == 100
    assert "vehicles are shown: first" not in whole


def test_the_nearest_two_over_time_are_those_of_all_pairs() -> None:
    for seed in range(6):
        paths = random_fleet(seed)
        times = np.linspace(min(p.begin_s for p in paths) - 5.0, max(p.end_s for p in paths) + 5.0, 300)
        pairs = [fleet_view.apart_m(a, b, times) for a, b in combinations(paths, 2)]
        brute = np.fmin.reduce(pairs)
        found = fleet_view.nearest_two_m(paths, times)
        assert np.allclose(found, brute, equal_nan=True)


@pytest.mark.nightly
def test_a_fleets_report_tells_the_exact_separation_and_draws_it_over_time() -> None:
    page = fleet_page()
    read = Reader(render_page(page))
    found = page.separation
    assert found is not None
    assert found.least is not None
    assert "Schedule" in read.text
    assert " ".join(fleet_view.separation_words(page).split()) in read.text
    charts = read.data["charts"]
    assert set(charts) == {"distance", "separation"}
    drawn = [y for y in charts["separation"]["series"][0]["y"] if y is not None]
    assert min(drawn) >= found.least.distance_m - 0.06
    assert min(drawn) == pytest.approx(found.least.distance_m, abs=3.0)
    assert {s["name"] for s in charts["distance"]["series"]} == {"uav1", "uav2"}


@pytest.mark.nightly
def test_the_key_figures_of_a_large_fleet_stand_in_one_table() -> None:
    page = small_page()
    first = page.subjects[0]
    bad = replace(small_page(low_m=350.0).subjects[0], name="uav7")
    many = tuple(replace(first, name=f"uav{i}") for i in range(7))
    read = Reader(render_page(replace(page, subjects=(*many, bad))))
    assert "Key figures" in read.text
    assert not [a for t, a in read.elements if t == "article"]
    assert read.text.count("! path safe, return not judged") == 7
    assert read.text.count("✕ path UNSAFE, return not judged") == 1
    assert "NOT SAFE" in read.text


def test_a_vehicle_alone_has_no_fleet_on_its_page() -> None:
    read = Reader(planned_page())
    assert "The fleet in time" not in read.text
    assert read.data["charts"] == {}
