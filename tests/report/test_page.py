"""The report without a browser: everything stands in it, nothing reaches outside, no name breaks out of its place."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.app.output.report import render
from gcsplan.check.verdict import Verdict
from gcsplan.notes.note import Note
from gcsplan.report.page import render_page
from gcsplan.report.parts import html as markup
from gcsplan.report.parts.page_data import Page, page_of_check
from gcsplan.report.views.shaded_terrain import NO_GROUND
from gcsplan.units import AVIATION, duration
from gcsplan.vehicle import Vehicle
from tests.support.effort import draws
from tests.support.noted import saying
from tests.support.pages import (
    HOSTILE,
    ZONES,
    Reader,
    hills,
    planned,
    planned_page,
    small_page,
    verdict_over,
)
from tests.support.worlds import world

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"


# -- the whole page -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_plans_report_says_what_the_pilot_must_know() -> None:
    text = Reader(planned_page()).text
    verdict = planned().vehicles[0].verdict
    lowest, nearest = verdict.lowest, verdict.nearest
    assert lowest is not None
    assert nearest is not None
    assert "SAFE" in text
    assert "NOT SAFE" not in text
    assert BARE_DEM in text
    for words in (
        markup.num(verdict.length_m, 0, "m"), markup.least(lowest.min_agl_m, 1, "m"), nearest.nearest_zone,
        markup.place(*lowest.min_agl_at), str(planned().source.inputs["dem_sha256"]), "EGM96", "no path is below",
        "Nothing was sent",
    ):  # fmt: skip
        assert " ".join(words.split()) in text, words


def test_the_report_is_small_and_reaches_nowhere() -> None:
    text = planned_page()
    assert len(text.encode()) < 2_000_000
    page = Reader(text)
    for tag, attrs in page.elements:
        for key in ("src", "href", "xlink:href", "action", "data", "poster", "srcset"):
            value = attrs.get(key)
            assert value is None or value.startswith(("#", "data:image/webp;base64,")), (tag, key, value[:40])
    assert not re.search(r"(?:https?:)?//(?!www\.w3\.org/)[a-z0-9-]+\.[a-z]", re.sub(r"base64,[\w+/=]+", "", text))
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|WebSocket|sendBeacon|importScripts", text)
    policy = next(a["content"] for t, a in page.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none'; img-src data:;")


@pytest.mark.nightly
def test_the_same_plan_gives_the_same_bytes() -> None:
    assert render(planned()) == planned_page()


def test_the_policy_lets_only_the_pages_own_script_run() -> None:
    import hashlib

    page = Reader(planned_page())
    run = [text for attrs, text in page.scripts if attrs.get("type") != "application/json"]
    assert len(run) == 1
    digest = base64.b64encode(hashlib.sha256(run[0].encode()).digest()).decode()
    assert f"script-src &#x27;sha256-{digest}&#x27;" in planned_page() or f"'sha256-{digest}'" in planned_page()
    assert not [a for _, attrs in page.elements for a in attrs if a.startswith("on")]


def test_every_figure_and_table_can_be_read_by_somebody_who_sees_none_of_it() -> None:
    page = Reader(planned_page())
    drawings = [attrs for tag, attrs in page.elements if tag == "svg" or attrs.get("role") == "img"]
    assert len(drawings) >= 3
    assert all(attrs.get("aria-label") for attrs in drawings)
    tags = [tag for tag, _ in page.elements]
    assert tags.count("caption") == tags.count("table") >= 4
    assert all(attrs.get("scope") in ("row", "col") for tag, attrs in page.elements if tag == "th")
    assert all(attrs.get("aria-label") for tag, attrs in page.elements if tag == "button")
    ids = [attrs["id"] for _, attrs in page.elements if attrs.get("id")]
    assert len(set(ids)) == len(ids)


# -- verdicts -----------------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_broken_limit_is_told_at_the_top_and_marked_where_it_is() -> None:
    page = small_page(low_m=350.0)
    verdict = page.subjects[0].verdict
    assert verdict.safe is False
    text = render_page(page)
    read = Reader(text)
    assert "NOT SAFE" in read.text
    for finding in verdict.findings:
        assert finding.message in read.text
    broken = [a for _, a in read.elements if "broken" in (a.get("class") or "").split()]
    assert len(broken) == 2 * len(verdict.findings)  # on the map and in the profile
    assert any(a.get("class") == "bad" for t, a in read.elements if t == "tr")


@pytest.mark.nightly
def test_what_could_not_be_judged_is_neither_safe_nor_unsafe() -> None:
    page = small_page()
    arcs = replace(page.subjects[0].verdict, not_judged=(saying("the arcs <b> of 80 m"),))
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], verdict=arcs),))))
    assert "NOT JUDGED" in read.text
    assert read.text.count("the arcs <b> of 80 m") == 3  # on the briefing, at the top and in the notes
    assert "Every metre was checked" not in read.text


@pytest.mark.nightly
def test_a_mission_that_flies_nowhere_still_has_a_report() -> None:
    page = small_page()
    nothing = replace(page.subjects[0].verdict, legs=(), not_judged=(Note("flies_nowhere"),))
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], verdict=nothing),))))
    assert "NOT JUDGED" in read.text
    assert read.data["lines"] == []


@pytest.mark.slow
def test_obstacle_heights_silence_the_bare_dem_line_and_nothing_else_does() -> None:
    page = small_page()
    assert BARE_DEM in render_page(page)
    assert BARE_DEM in render_page(replace(page, inputs={}))
    assert BARE_DEM not in render_page(replace(page, inputs={"bare_dem": False}))


@pytest.mark.nightly
def test_a_surface_model_is_not_called_bare() -> None:
    shown = render_page(replace(small_page(), inputs={"bare_dem": False, "dem_kind": "surface"}))
    assert SURFACE_DEM in shown
    assert BARE_DEM not in shown
    assert "obstacle heights were given" not in shown


@pytest.mark.nightly
def test_unknown_ground_is_left_out_of_the_heights_and_told() -> None:
    page = small_page()
    where = world(lambda e, n: np.where(e > 3000, np.nan, hills(e, n)), half_m=8000.0)
    verdict = verdict_over(where, [[0.0, 0, 430], [4500, 300, 430]], page.subjects[0].vehicle)
    read = Reader(render_page(replace(page, world=where, subjects=(replace(page.subjects[0], verdict=verdict),))))
    grid = read.data["grid"]
    heights = np.frombuffer(base64.b64decode(grid["heights"]), "<u2")
    assert (heights == NO_GROUND).any()
    assert "ground unknown" in read.text
    assert None in read.data["lines"][0]["g"]


@pytest.mark.nightly
def test_a_checked_file_is_named_by_itself_where_one_vehicle_has_several() -> None:
    @dataclass
    class Checked:
        file: str
        vehicle: Vehicle
        verdict: Verdict
        notes: tuple[Note, ...] = ()
        typed: Mapping[str, str] = field(default_factory=dict)

    page = small_page()
    craft, verdict = page.subjects[0].vehicle, page.subjects[0].verdict
    files = [Checked("a.waypoints", craft, verdict, (Note("home_row_blank"),)), Checked("b.plan", craft, verdict)]
    read = Reader(render_page(page_of_check("two files", page.world, files, inputs=page.inputs)))
    assert {line["name"] for line in read.data["lines"]} == {"a.waypoints", "b.plan"}
    assert str(Note("home_row_blank")) in read.text


@pytest.mark.slow
def test_the_uploads_end_is_told() -> None:
    page = small_page()
    sent = {"url": "udpout:10.0.0.2:14550", "items": 7, "outcome": "accepted", "verified": True, "seconds": 1.25}
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], upload=sent),))))
    assert "read back the same" in read.text
    assert "udpout:10.0.0.2:14550" in read.text
    assert "Nothing was sent" not in read.text
    bad = sent | {"verified": False, "outcome": "refused", "simulated": True}
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], upload=bad),))))
    assert "not verified" in read.text
    assert "(simulated)" in read.text
    warned = replace(
        page.subjects[0], upload=sent, warnings=(Note("positions_shifted", items=1, most_m=3.048, safe=True),)
    )
    read = Reader(render_page(replace(page, subjects=(warned,), units=AVIATION)))
    assert "1 item differs by 10.000 ft; judged again: safe" in read.text


# -- hostile names ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_hostile_name_is_words_and_nothing_else() -> None:
    page = small_page()
    zones = tuple(replace(z, name=HOSTILE) for z in ZONES)
    where = world(hills, zones, half_m=8000.0)
    subject = page.subjects[0]
    verdict = verdict_over(where, [[0.0, 0, 350], [4500, 300, 430]], replace(subject.vehicle, name="uav1"))
    hostile = replace(
        subject, name=HOSTILE, verdict=verdict, notes=(saying(HOSTILE),), upload={"url": HOSTILE, "message": HOSTILE}
    )
    evil = Page(HOSTILE, where, (hostile,), {"vertical_datum": HOSTILE, HOSTILE: HOSTILE}, ((HOSTILE, HOSTILE),))
    text, tame = render_page(evil), render_page(replace(page, subjects=(replace(subject, verdict=verdict),)))
    read = Reader(text)
    assert text.count("<script") == tame.count("<script") == 2
    assert not [tag for tag, _ in read.elements if tag == "img"]
    assert not [a for _, attrs in read.elements for a in attrs if a.startswith("on")]
    assert "\u202e" not in text
    assert "\x00" not in text
    assert read.data["lines"][0]["name"].startswith("</script><script>alert")
    assert "</script><script>alert('x')</script>\"'><img src=x onerror=alert(1)>&amp;gnp.exe" in read.text


@pytest.mark.slow
@settings(max_examples=draws(60))
@given(st.text(max_size=40))
def test_any_words_survive_escaping_and_the_data_block(words: str) -> None:
    read = Reader(f'<p title="{markup.esc(words)}">{markup.esc(words)}</p>{markup.data_block("data", [words])}')
    assert read.elements[0][1]["title"] == markup.plain(words)
    if "\r" not in words:
        assert "".join(read.words) == markup.plain(words)
    assert json.loads(read.scripts[0][1]) == [words]
    assert [tag for tag, _ in read.elements] == ["p", "script"]


# -- numbers ------------------------------------------------------------------------------------------------------


@settings(max_examples=draws(100))
@given(st.floats(-1e6, 1e6), st.integers(0, 3))
def test_room_that_is_left_is_never_told_larger_than_it_is(value: float, decimals: int) -> None:
    told = float(markup.least(value, decimals).replace(markup.THIN, ""))
    assert told <= value + 2e-3
    assert value - told <= 10.0**-decimals + 1e-9


def test_numbers_have_no_negative_zero_and_a_dash_where_there_is_none() -> None:
    assert markup.num(-0.0004, 2, "m") == "0.00\u202fm"
    assert [markup.num(x, 1) for x in (None, math.nan, math.inf)] == ["–"] * 3
    assert markup.num(1234567.0) == "1\u202f234\u202f567"
    assert markup.least(65.2499999999, 2) == "65.25"
    assert duration(3725.2) == "1:02:05"
    assert duration(59.44, 1) == "0:00:59.4"
