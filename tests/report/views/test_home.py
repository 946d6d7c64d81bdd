"""The way home on the page."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.check.returns.way_home import way_home
from gcsplan.report.page import render_page
from tests.support.pages import (
    Reader,
    small_page,
)


@pytest.mark.nightly
def test_the_way_home_is_drawn_and_told_at_the_top_where_it_is_not_safe() -> None:
    page = small_page()
    subject = page.subjects[0]
    home = way_home(subject.verdict, subject.vehicle, page.world, rtl_rel_home_m=20.0)
    assert home.safe is False
    read = Reader(render_page(replace(page, subjects=(replace(subject, home=home),))))
    assert str(home.headline) in read.text
    assert "PATH SAFE" in read.text
    assert "✓" not in read.text  # nothing is called safe above the red line
    assert str(home.unsafe[0].why) in read.text
    assert "home-0" in read.data["charts"]
    assert [a for _, a in read.elements if a.get("class") == "nohome"]
    calm = way_home(subject.verdict, subject.vehicle, page.world, rtl_rel_home_m=home.lowest_rel_home_m or 300.0)
    if calm.safe:
        read = Reader(render_page(replace(page, subjects=(replace(subject, home=calm),))))
        assert "no safe return from" not in read.text
        assert "✓ SAFE" in " ".join(read.text.split())
