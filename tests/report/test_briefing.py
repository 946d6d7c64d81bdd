"""The printed briefing: what a crew reads and signs, on two pages of A4 and Letter for a fleet of four."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from gcsplan.check.returns.verdict import RallyPoint
from gcsplan.check.returns.way_home import way_home
from gcsplan.notes.note import Note
from gcsplan.report.page import render_page
from gcsplan.report.parts import html as markup
from gcsplan.report.parts.page_data import Page, Rehearsed
from gcsplan.wind.declared import DeclaredWind
from gcsplan.wind.wording import wind_note
from gcsplan.world.geodesy.daylight import daylight
from tests.support import browser as chromium
from tests.support.noted import saying
from tests.support.pages import HOSTILE, Reader, fleet_page, small_page

PROGRAM = chromium.find()
LONG = "a vehicle with quite a long name, number "
PAPERS_IN = {"A4": (8.27, 11.69), "Letter": (8.5, 11.0)}


def briefing(page: Page) -> str:
    """The words of the briefing alone."""
    text = render_page(page)
    return Reader(text[text.index('<section class="briefing"') : text.index("<header>")]).text


def fleet_of_four(*, worst: bool) -> Page:
    """Four vehicles with ways home; at worst with long names, findings, what was not judged, and rally points."""
    told = fleet_page()
    bad = small_page(low_m=350.0).subjects[0]
    subjects = []
    for i in range(4):
        s = replace(bad if worst else told.subjects[0], name=f"{LONG if worst else 'uav'}{i + 1}")
        home = way_home(s.verdict, s.vehicle, told.world, rtl_rel_home_m=20.0 if worst else 300.0)
        if worst:
            point = RallyPoint(36.6, -84.3, 300.0, 120.0, 900.0, "a place")
            home = replace(home, rally=(point,) * 6, not_judged=(Note("mission_not_followed"),))
            s = replace(s, verdict=replace(s.verdict, not_judged=(saying("the arcs of 80 m " * 30),) * 2))
        subjects.append(replace(s, motion=told.subjects[0].motion, home=home))
    order = tuple(s.name for s in subjects)
    rehearsed = Rehearsed(False, "Flown by nobody.", (), ("a violation " * 40,) * 9) if worst else None
    title = LONG * 6 if worst else "Four"
    return replace(told, title=title, subjects=tuple(subjects), order=order, rehearsed=rehearsed)


@pytest.mark.slow
def test_the_briefing_says_what_where_and_when_and_has_lines_to_sign_on() -> None:
    page = fleet_of_four(worst=False)
    text = briefing(page)
    verdict, limits = page.subjects[0].verdict, page.subjects[0].vehicle.limits
    low, near, home = verdict.lowest, verdict.nearest, page.subjects[0].home
    assert low is not None
    assert near is not None
    assert home is not None
    for words in (
        "mission briefing", "Four", "uav1", "uav4", markup.place(*verdict.legs[0].start[:2]),
        markup.place(*verdict.legs[-1].end[:2]), f"{markup.least(low.min_agl_m, 1, 'm')}; at least",
        markup.num(limits.min_agl_m, 0, "m"), f"{markup.least(near.zone_clearance_m, 1, 'm')}, {near.nearest_zone}",
        markup.num(limits.max_amsl_m, 0, "m"), "0:08:00", str(home.headline), "RTL_ALT ", "Separation", "Bare DEM",
        "planned by", "flown by", "name", "date", "signature",
    ):  # fmt: skip
        assert " ".join(words.split()) in text, words
    assert "not on this page" not in text


@pytest.mark.slow
def test_what_a_large_fleet_leaves_out_is_said_and_the_first_to_arrive_are_shown() -> None:
    page = small_page()
    slow = [replace(page.subjects[0], name=f"uav{i}", motion=None) for i in range(9)]
    text = briefing(replace(page, subjects=tuple(slow)))
    assert "5 more vehicles are not on this page" in text
    columns = text.split("Limits, margins")[1]
    assert [i for i in range(9) if f"uav{i}" in columns] == [0, 1, 2, 3]


@pytest.mark.nightly
def test_what_is_broken_or_not_judged_is_on_the_page_that_is_signed() -> None:
    page = small_page(low_m=350.0)
    text = briefing(page)
    assert "NOT SAFE" in text
    assert page.subjects[0].verdict.findings[0].message[:80] in text
    worst = briefing(fleet_of_four(worst=True))
    assert "more, on the pages that follow" in worst
    assert "Rally points proposed: " in worst
    assert "and 20 more" in worst
    assert "what that leaves with 6 rally points on board: no safe return from " in worst
    assert all(f"a vehicle with…ame, number {i}" in worst for i in (1, 2, 3, 4))
    nothing = replace(small_page().subjects[0].verdict, legs=(), not_judged=(Note("flies_nowhere"),))
    assert "NOT JUDGED" in briefing(replace(page, subjects=(replace(page.subjects[0], verdict=nothing),)))


def test_its_map_refers_to_the_reports_own_and_repeats_no_picture() -> None:
    text = render_page(fleet_page())
    assert text.count("data:image/webp;base64,") == 1
    read = Reader(text)
    assert [a["href"] for t, a in read.elements if t == "use"] == ["#drawing"]
    assert [a["id"] for t, a in read.elements if t == "g" and a.get("id")] == ["drawing"]


@pytest.mark.slow
@pytest.mark.nightly_but("worst")
@pytest.mark.skipif(PROGRAM is None, reason="no browser is installed")
@pytest.mark.parametrize("worst", [False, True], ids=["plain", "worst"])
def test_the_briefing_of_four_vehicles_is_two_pages_of_a4_and_of_letter(tmp_path: Path, worst: bool) -> None:
    assert PROGRAM is not None
    page = fleet_of_four(worst=worst)
    file = tmp_path / "report.html"
    file.write_text(render_page(replace(page, title=HOSTILE * 2) if worst else page), encoding="utf-8")
    with chromium.browser(PROGRAM, tmp_path / "home") as made:
        made.visit(file)
        assert made.evaluate("document.getElementById('briefing').offsetHeight") == 0  # not on the screen
        made.evaluate("for (const e of [...document.body.children]) if (e.tagName !== 'SCRIPT' && "
                      "!e.id.startsWith('briefing')) e.style.display = 'none'")  # fmt: skip
        made.evaluate("document.getElementById('briefing-2').style.breakAfter = 'auto'")  # nothing follows here
        made.ask("Emulation.setEmulatedMedia", media="")
        for paper, (wide, tall) in PAPERS_IN.items():
            printed = base64.b64decode(made.ask("Page.printToPDF", paperWidth=wide, paperHeight=tall)["data"])
            assert len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) == 2, paper
        made.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        for part in ("briefing", "briefing-2"):
            high_mm = made.evaluate(f"document.getElementById('{part}').getBoundingClientRect().height") / 96 * 25.4
            assert high_mm < 279.4 - 28.0, (part, high_mm)
        assert made.complaints() == []


@pytest.mark.nightly
def test_the_second_page_has_way_points_parameters_and_failsafes() -> None:
    page = fleet_of_four(worst=False)
    text = briefing(page)
    assert "still air: times, energies and paths count no wind" in text
    assert "Way points of uav1" in text
    west = wind_note(DeclaredWind(np.full((1, 1, 2), 5.0), np.full((1, 1, 2), 270.0)))
    windy = briefing(replace(page, notes=(*page.notes, west)))
    assert "Wind: declared wind: 5.0 m/s from 270°; one wind during the whole flight. " in windy
    assert "still air" not in windy
    for leg in page.subjects[0].verdict.legs:
        assert " ".join(markup.num(leg.end[2], 0, page.units.amsl).split()) in text
    assert "Daylight is not known" in text
    light = daylight(51.4779, 0.0, datetime(2026, 6, 21, 12, tzinfo=UTC))
    assert "Daylight at the start on 2026-06-21: sunrise 03:4" in briefing(replace(page, daylight=light))
    night = daylight(78.2, 15.6, datetime(2026, 12, 21, 12, tzinfo=UTC))
    assert "on 2026-12-21: the sun does not rise." in briefing(replace(page, daylight=night))


@pytest.mark.nightly
@pytest.mark.skipif(PROGRAM is None, reason="no browser is installed")
def test_no_table_is_wider_than_the_printed_page(tmp_path: Path) -> None:
    assert PROGRAM is not None
    file = tmp_path / "report.html"
    file.write_text(render_page(fleet_of_four(worst=True)), encoding="utf-8")
    with chromium.browser(PROGRAM, tmp_path / "home") as made:
        made.visit(file)
        made.ask("Emulation.setEmulatedMedia", media="print")
        made.evaluate("for (const e of document.querySelectorAll('details')) e.open = true")
        widest = "Math.max(...[...document.querySelectorAll('table')].map((t) => t.getBoundingClientRect().width))"
        assert made.evaluate(widest) <= 180.0 / 25.4 * 96.0 + 1.0
