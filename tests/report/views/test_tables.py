"""Tables of the page: the legs are those of the verdict, an item is one row."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.report.views import tables
from gcsplan.units import METRIC
from tests.support.pages import (
    Reader,
    planned,
    planned_page,
    small_page,
)


def test_the_legs_of_the_table_are_those_of_the_verdict() -> None:
    page = Reader(planned_page())
    legs = planned().vehicles[0].verdict.legs
    for leg in legs:
        assert f"{leg.seq} {leg.kind}" in page.text
    line = page.data["lines"][0]
    assert [leg["seq"] for leg in line["legs"]] == [leg.seq for leg in legs]
    assert len(line["ends"]) == len(legs)
    assert len({len(line[key]) for key in ("s", "e", "n", "z", "g", "f", "c", "t", "j", "leg")}) == 1
    for end, leg in zip(line["ends"], legs, strict=True):
        assert line["z"][end] == pytest.approx(leg.end[2], abs=0.051)


def test_an_item_that_is_flown_in_many_chords_is_one_row_of_the_table() -> None:
    subject = small_page().subjects[0]
    chords = []
    for leg in subject.verdict.legs:
        part = replace(leg, length_m=leg.length_m / 4.0, energy_j=leg.energy_j / 4.0, time_s=leg.time_s / 4.0)
        chords += [leg] if leg.column else [replace(part, min_agl_m=leg.min_agl_m + 5.0 * k) for k in (3, 0, 1, 2)]
    cut = replace(subject, verdict=replace(subject.verdict, legs=tuple(chords)))
    assert len(chords) > len(subject.verdict.legs)
    assert tables.legs_table(cut, METRIC) == tables.legs_table(subject, METRIC)
