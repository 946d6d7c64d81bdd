"""Pages of a report for tests: one vehicle, a fleet, a large one, a planned one; and a reader of a page's content."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from html.parser import HTMLParser
from typing import Any

import numpy as np

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.output.report import render
from gcsplan.app.plan.model import Plan
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Rules, separation
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.vehicle import Energy, Vehicle
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.world import World
from tests.support.noted import saying
from tests.support.worlds import vehicle, world

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
        """The data of the page's script."""
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
