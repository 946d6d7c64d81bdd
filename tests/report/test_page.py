"""The report without a browser: everything stands in it, nothing reaches outside, no name breaks out of its place."""

from __future__ import annotations

import base64
import io
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from html.parser import HTMLParser
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.output.report import page_of_plan, render
from gcsplan.app.plan.model import Plan
from gcsplan.check.judge import judge
from gcsplan.check.returns.way_home import way_home
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.motion.timed_path import TimedPath
from gcsplan.fleet.separation import Rules, separation
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.notes.note import Note
from gcsplan.report.page import render_check, render_page
from gcsplan.report.parts import html as markup
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.report.parts.track_samples import distance_m, line_of, passages
from gcsplan.report.views import fleet as fleet_view
from gcsplan.report.views import tables
from gcsplan.report.views.chart import Axes, ticks
from gcsplan.report.views.picture import draw, figures
from gcsplan.report.views.scene_data import triangles, zone_meshes
from gcsplan.report.views.shaded_terrain import NO_GROUND, extent_of, relief_of
from gcsplan.units import AVIATION, METRE, METRIC, duration
from gcsplan.vehicle import Energy, Vehicle
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.world import World
from tests.fleet.test_separation import random_fleet
from tests.support.effort import draws
from tests.support.noted import saying
from tests.support.worlds import vehicle, world

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"

HOME_DEG = (36.6, -84.3)
HOSTILE = "</script><script>alert('x')</script>\"'><img src=x onerror=alert(1)>&amp;\u202egnp.exe\x00"
SQUARE = Polygon(np.array([[2500.0, -400.0], [3300.0, -400.0], [3300.0, 500.0], [2500.0, 500.0]]))
ZONES = (
    Zone("village", Circle(1500.0, -700.0, 400.0)),
    Zone("mast", Circle(1000.0, 0.0, 50.0), None, Level(40.0, "agl")),
    Zone("training area", SQUARE, Level(200.0, "agl"), Level(900.0, "amsl")),
)


@dataclass
class Reader(HTMLParser):
    """Every element with its attributes, and the words outside of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.inside: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.depth: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in {"meta", "br", "input", "image", "path", "circle", "polygon", "polyline", "img"}:
            self.depth.append(tag)
        if tag == "script":
            self.scripts.append((dict(attrs), ""))

    def handle_endtag(self, tag: str) -> None:
        if self.depth and tag in self.depth:
            while self.depth.pop() != tag:
                pass

    def handle_data(self, data: str) -> None:
        if self.depth and self.depth[-1] == "script":
            attrs, text = self.scripts[-1]
            self.scripts[-1] = (attrs, text + data)
        elif not self.depth or self.depth[-1] != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        """All words, white space of any width as one space."""
        return " ".join(" ".join(self.words).split())

    @property
    def data(self) -> dict[str, Any]:
        """What the page's script is given."""
        found: dict[str, Any] = json.loads(next(text for attrs, text in self.scripts if attrs.get("id") == "data"))
        return found


def hills(e: Any, n: Any) -> Any:
    return 300.0 + 60.0 * np.sin(e / 700.0) * np.cos(n / 900.0)


def verdict_over(where: World, points: list[list[float]], craft: Vehicle, **order: object) -> Verdict:
    mission = build_mission(Path(np.array(points)), where, craft, HOME_DEG, Order(**order))  # type: ignore[arg-type]
    return judge(mission, craft, where)


@cache
def small_page(name: str = "Over the hills", low_m: float = 430.0) -> Page:
    """One vehicle over small hills, past a village, over a mast and under a training area."""
    craft = replace(
        vehicle(horizontal_clearance_m=30.0, max_amsl_m=800.0, max_climb_deg=20.0),
        name="uav1", energy=Energy(120.0, 100.0, hover_w=400.0, battery_j=2e6),
    )  # fmt: skip
    where = world(hills, ZONES, half_m=8000.0)
    verdict = verdict_over(where, [[0.0, 0, 430], [2000, 0, low_m], [4500, 300, 430]], craft)
    inputs = {"dem_sha256": "ab" * 32, "vertical_datum": "EGM96", "resolution_m": 100, "bare_dem": True}
    return Page(name, where, (Subject("uav1", verdict, craft, notes=(saying("a note of the vehicle"),)),), inputs)


@cache
def planned() -> Plan:
    source = load_mission("missions/jacksboro.yaml")
    return plan(replace(source, planner=replace(source.planner, gap_percent=1.0)))


@cache
def planned_page() -> str:
    return render(planned())


# -- the whole page -----------------------------------------------------------------------------------------------


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


# -- verdicts -----------------------------------------------------------------------------------------------------


def test_an_item_that_is_flown_in_many_chords_is_one_row_of_the_table() -> None:
    subject = small_page().subjects[0]
    chords = []
    for leg in subject.verdict.legs:
        part = replace(leg, length_m=leg.length_m / 4.0, energy_j=leg.energy_j / 4.0, time_s=leg.time_s / 4.0)
        chords += [leg] if leg.column else [replace(part, min_agl_m=leg.min_agl_m + 5.0 * k) for k in (3, 0, 1, 2)]
    cut = replace(subject, verdict=replace(subject.verdict, legs=tuple(chords)))
    assert len(chords) > len(subject.verdict.legs)
    assert tables.legs_table(cut, METRIC) == tables.legs_table(subject, METRIC)


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


def test_what_could_not_be_judged_is_neither_safe_nor_unsafe() -> None:
    page = small_page()
    arcs = replace(page.subjects[0].verdict, not_judged=(saying("the arcs <b> of 80 m"),))
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], verdict=arcs),))))
    assert "NOT JUDGED" in read.text
    assert read.text.count("the arcs <b> of 80 m") == 3  # on the briefing, at the top and in the notes
    assert "Every metre was checked" not in read.text


def test_a_mission_that_flies_nowhere_still_has_a_report() -> None:
    page = small_page()
    nothing = replace(page.subjects[0].verdict, legs=(), not_judged=(Note("flies_nowhere"),))
    read = Reader(render_page(replace(page, subjects=(replace(page.subjects[0], verdict=nothing),))))
    assert "NOT JUDGED" in read.text
    assert read.data["lines"] == []


def test_obstacle_heights_silence_the_bare_dem_line_and_nothing_else_does() -> None:
    page = small_page()
    assert BARE_DEM in render_page(page)
    assert BARE_DEM in render_page(replace(page, inputs={}))
    assert BARE_DEM not in render_page(replace(page, inputs={"bare_dem": False}))


def test_a_surface_model_is_not_called_bare() -> None:
    shown = render_page(replace(small_page(), inputs={"bare_dem": False, "dem_kind": "surface"}))
    assert SURFACE_DEM in shown
    assert BARE_DEM not in shown
    assert "obstacle heights were given" not in shown


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
    read = Reader(render_check("two files", page.world, files, inputs=page.inputs))
    assert {line["name"] for line in read.data["lines"]} == {"a.waypoints", "b.plan"}
    assert str(Note("home_row_blank")) in read.text


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


@settings(max_examples=draws(60))
@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e5), st.integers(2, 9))
def test_ticks_lie_within_their_axis_and_are_neither_few_nor_many(low: float, span: float, wanted: int) -> None:
    found = ticks(low, low + span, wanted)
    assert ((found >= low - 1e-6 * span) & (found <= low + span * (1 + 1e-6))).all()
    assert wanted / 2.5 - 1 <= len(found) <= wanted + 1


# -- what is drawn ------------------------------------------------------------------------------------------------


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


@settings(max_examples=draws(60))
@given(st.integers(3, 40), st.integers(0, 10_000))
def test_the_lid_of_a_prism_covers_its_shape_exactly(corners: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * (np.arange(corners) + rng.uniform(0, 0.8, corners)) / corners
    star = (rng.uniform(100, 1000, corners) * np.array([np.cos(turn), np.sin(turn)])).T

    def area(p: Any) -> float:
        return 0.5 * float(np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1)))

    faces = triangles(star)
    areas = [area(star[list(f)]) for f in faces]
    assert len(faces) == corners - 2
    assert min(areas) >= -1e-6
    assert sum(areas) == pytest.approx(area(star), rel=1e-9)


def test_zones_stand_in_space_with_floors_and_ceilings_that_follow_the_ground() -> None:
    page = small_page()
    surface = page.world.airspace.surface
    subject = page.subjects[0]
    line = line_of(subject.verdict, page.world, subject.vehicle.limits)
    assert line is not None
    extent = extent_of([line], ZONES, surface)
    relief = relief_of(page.world, extent)
    meshes = {m["name"]: m for m in zone_meshes(ZONES, surface, relief, [line])}
    assert set(meshes) == {z.name for z in ZONES}

    def corners(name: str) -> Any:
        at = np.array(meshes[name]["at"]).reshape(-1, 3)
        ground = surface.ground_at(at[:, 0] + extent.west_m, at[:, 1] + extent.south_m)
        return at, ground

    at, ground = corners("mast")
    half = len(at) // 2
    assert np.allclose(at[half:, 2] - ground[half:], 40.0, atol=0.2)
    assert (at[:half, 2] < ground[:half]).all()
    at, ground = corners("training area")
    half = len(at) // 2
    assert np.allclose(at[:half, 2] - ground[:half], 200.0, atol=0.2)
    assert np.allclose(at[half:, 2], 900.0)
    assert meshes["village"]["open"] is True
    at, _ = corners("village")
    assert at[:, 2].max() > max(line.amsl_m.max(), relief.high_m)
    for mesh in meshes.values():
        assert max(mesh["faces"] + mesh["edges"]) < len(mesh["at"]) // 3  # type: ignore[operator,arg-type]


def test_the_pictures_ground_is_the_surfaces() -> None:
    page = small_page()
    extent = extent_of([], ZONES, page.world.airspace.surface)
    relief = relief_of(page.world, extent)
    image = Image.open(io.BytesIO(base64.b64decode(relief.picture.split(",", 1)[1])))
    assert image.format == "WEBP"
    assert image.width / image.height == pytest.approx(extent.width_m / extent.height_m, rel=0.03)
    grid: Any = relief.grid
    heights = grid["base"] + grid["step"] * np.frombuffer(base64.b64decode(grid["heights"]), "<u2").astype(float)
    heights = heights.reshape(grid["rows"], grid["cols"])
    west, south, east, north = grid["box"]
    e, n = np.meshgrid(np.linspace(west, east, grid["cols"]), np.linspace(north, south, grid["rows"]))
    assert np.abs(heights - page.world.airspace.surface.ground_at(e, n)).max() < 0.01
    lattice = np.array([grid["lat"], grid["lon"]]).T
    ends = page.world.frame.to_degrees(np.array([west, east]), np.array([north, south]))
    assert np.allclose(lattice[[0, -1]], ends, atol=1e-6)
    assert relief.contours.count("M") > 0


def test_flat_ground_has_no_contours_and_still_a_picture() -> None:
    where = world(300.0, half_m=3000.0)
    relief = relief_of(where, extent_of([], [], where.airspace.surface))
    assert relief.contours == ""
    assert relief.picture.startswith("data:image/webp;base64,")
    assert (relief.low_m, relief.high_m) == pytest.approx((300.0, 300.0))


def test_a_curve_is_broken_where_nothing_is_known() -> None:
    axes = Axes(0.0, 10.0, 0.0, 10.0, "x", "y", METRE, METRE)
    path = axes.line([0, 1, 2, 3, 4], [0, 5, math.nan, 5, 0], "track")
    assert path == '<path class="track" d="M0 10000L1000 5000M3000 5000L4000 10000"/>'
    assert axes.area([0, 10], [-math.inf, -math.inf], [5, 5], "below").count("L") == 3


# -- fleets, and the way home -------------------------------------------------------------------------------------


def fleet_page() -> Page:
    page = small_page()
    first = page.subjects[0]
    place = np.array([[0.0, 0, 300], [0, 0, 430], [2000, 0, 430], [4500, 300, 430], [4500, 300, 310]])
    times = np.array([0.0, 40, 200, 400, 480])
    a = TimedPath("uav1", times, place, 400.0)
    b = TimedPath("uav2", times + 30.0, place + np.array([0.0, 60.0, 0.0]), 430.0)
    second = replace(first, name="uav2", motion=b)
    return replace(
        page,
        subjects=(replace(first, motion=a), second),
        separation=separation([a, b], Rules(50.0)),
        order=("uav1", "uav2"),
    )


def many_page(count: int) -> Page:
    """The first vehicle of the fleet, many times over and behind itself: uav1 to uav…; the last is not judged."""
    page = fleet_page()
    first = page.subjects[0]
    assert first.motion is not None
    motion = first.motion
    paths = [
        TimedPath(f"uav{k}", motion.times_s + k, motion.points + np.array([0.0, 0.0, 60.0 * k]), motion.arrive_s + k)
        for k in range(1, count + 1)
    ]
    subjects = [replace(first, name=p.name, motion=p) for p in paths]
    last = subjects[-1]
    unjudged = replace(last.verdict, not_judged=(saying("the wind"),))
    subjects[-1] = replace(last, verdict=unjudged)
    return replace(
        page, subjects=tuple(subjects), separation=separation(paths, Rules(50.0)), order=tuple(p.name for p in paths),
        left_out=(("uav999", "it is <shut> in"),),
    )  # fmt: skip


@pytest.mark.slow
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
    assert "Of 130 vehicles 24 are shown" in read.text
    assert "1 without a mission, left out" in read.text
    assert "it is <shut> in" in read.text
    assert {int(n) for n in re.findall(r'<tr[^>]* data-vehicle="(\d+)"', text)} == set(range(130))
    assert len(text) < 4_000_000
    whole = render_page(many_page(100))
    assert len(set(re.findall(r'id="profile-(\d+)"', whole))) == 100
    assert "are shown: those with problems" not in whole


def test_the_nearest_two_over_time_are_those_of_all_pairs() -> None:
    for seed in range(6):
        paths = random_fleet(seed)
        times = np.linspace(min(p.begin_s for p in paths) - 5.0, max(p.end_s for p in paths) + 5.0, 300)
        pairs = [fleet_view.apart_m(a, b, times) for a, b in combinations(paths, 2)]
        brute = np.fmin.reduce(pairs)
        found = fleet_view.nearest_two_m(paths, times)
        assert np.allclose(found, brute, equal_nan=True)


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


@pytest.mark.slow
def test_each_figure_is_drawn_as_a_png_too() -> None:
    drawn = figures(page_of_plan(planned()))
    assert set(drawn) == {"report-map.png", "report-space.png", "report-profile.png"}
    for content in drawn.values():
        image = Image.open(io.BytesIO(content))
        assert image.format == "PNG"
        assert image.width > 800


def test_no_label_of_the_map_lies_on_another() -> None:
    page = page_of_plan(planned())
    figure = draw(page)
    figure.draw_without_rendering()  # type: ignore[no-untyped-call]
    labels = [(t.get_text(), t.get_window_extent()) for t in figure.axes[0].texts]
    assert {words.split("\n")[0] for words, _ in labels} >= {"relay mast", "raptor cliffs", "quarry", "airfield"}
    for (one, a), (other, b) in combinations(labels, 2):
        assert not a.padded(-1.0).overlaps(b.padded(-1.0)), (one, other)


@pytest.mark.slow
def test_the_map_has_the_reports_colours_low_ground_is_no_lake() -> None:
    drawn = figures(page_of_plan(planned()))["report-map.png"]
    pixels = np.asarray(Image.open(io.BytesIO(drawn)).convert("RGB"), np.int16)
    red, green, blue = np.moveaxis(pixels, -1, 0)
    assert float(np.mean((blue > green + 20) & (blue > red + 20))) < 0.001


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
