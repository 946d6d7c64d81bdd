"""Tables of the page: the legs are those of the verdict, an item is one row, what was flown stands beside the plan."""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.output.report import page_of_plan, render_rehearsal
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import Rehearsal, rehearse
from gcsplan.report.parts.page_data import Compared, Rehearsed
from gcsplan.report.views import tables
from gcsplan.report.views.tables import rehearsal_html
from gcsplan.sim.flight.wind import Weather
from gcsplan.units import METRIC, duration, in_units
from tests.app.fleet.test_fleet import CROSS
from tests.cli.conftest import run
from tests.cli.test_fleet import ARRIVAL, LIMITS, write
from tests.support import pages
from tests.support.pages import (
    Reader,
    planned_page,
    small_page,
)


@pytest.mark.nightly
def test_the_legs_of_the_table_are_those_of_the_verdict() -> None:
    page = Reader(planned_page())
    legs = pages.planned().vehicles[0].verdict.legs
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


__all__ = ["run"]


@cache
def planned(folder: Path) -> Plan:
    file = folder / "cross.yaml"
    file.write_text(yaml.safe_dump(CROSS | {"limits": LIMITS, "arrival": ARRIVAL}))
    return plan(load_mission(file))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rehearsal")


def flown(folder: Path, **more: Any) -> Rehearsal:
    """A rehearsal in a wind that the vehicles cannot fly against at their speed, with noise."""
    return rehearse(planned(folder), weather=Weather(6.0, 90.0, 0.5, 0.5), airspeed_m_s=10.0, **more)


def table(read: Reader) -> list[str]:
    """The words of the section, from its heading to the next one."""
    return read.text.split("Flown beside planned")[1].split("In space")[0].split()


@pytest.mark.nightly
def test_flown_figures_come_from_the_tracks_and_stand_beside_the_plans(
    folder: Path,
) -> None:
    made, result = planned(folder), flown(folder)
    read = Reader(render_rehearsal(made, result))
    words = " ".join(table(read))
    for v, trace in zip(made.vehicles, result.flown, strict=True):
        assert trace.name == v.name
        assert made.fleet is not None
        plan_s = made.fleet.slot(v.name).arrive_s
        late_s = trace.arrive_s - plan_s
        assert abs(late_s) > 1.0  # what was flown differs, and is shown as it is
        late = f"{'+' if late_s > 0 else '−'}{abs(late_s):.2f} s"
        assert f"{v.name} at its goal {duration(plan_s, 1)} {duration(trace.arrive_s, 1)} {late}" in words
        lowest = v.verdict.lowest
        assert lowest is not None
        surface = made.world.airspace.surface
        free = ~np.append(trace.column, True) & ~np.append(True, trace.column)
        agl = (trace.points[:, 2] - surface.top_at(trace.points[:, 0], trace.points[:, 1]))[free]
        row = words.split(f"{v.name} lowest above ground ")[1].split(" m ")
        assert float(row[0]) == pytest.approx(lowest.min_agl_m, abs=0.1)
        assert float(row[1]) == pytest.approx(agl.min(), abs=0.5)
        assert float(row[1]) != float(row[0])
    assert made.fleet is not None
    assert made.fleet.closest is not None
    assert result.closest is not None
    assert "fleet least separation" in words


@pytest.mark.nightly
def test_the_replay_holds_the_plan_and_the_flight_each_from_its_own_source(folder: Path) -> None:
    made, result = planned(folder), flown(folder)
    tracks = Reader(render_rehearsal(made, result)).data["replay"]["tracks"]
    assert [(t["name"], t["flown"]) for t in tracks] == [
        (name, flown) for name in ("west", "south") for flown in (False, True)
    ]
    for track in tracks:
        places = np.frombuffer(base64.b64decode(track["places"]), "<f4").reshape(-1, 5).astype(float)
        assert made.fleet is not None
        own = next(t for t in result.flown if t.name == track["name"]) if track["flown"] else \
            made.fleet.motion(track["name"])  # fmt: skip
        drawn = np.column_stack([np.interp(own.times_s, places[:, 0], places[:, k]) for k in (1, 2, 3)])
        assert np.linalg.norm(drawn - own.points, axis=1).max() < 0.25


@pytest.mark.nightly
def test_the_first_of_several_runs_is_shown_and_said(folder: Path) -> None:
    one, several = flown(folder, seed=4), flown(folder, seed=4, runs=3)
    assert [np.array_equal(a.points, b.points) for a, b in zip(one.flown, several.flown, strict=True)] == [True, True]
    read = Reader(render_rehearsal(planned(folder), several))
    assert "3 runs: flown times are the medians" in read.text
    assert "replay show the first run" in read.text


@pytest.mark.nightly
def test_a_rehearsal_that_went_wrong_is_the_headline(folder: Path) -> None:
    made, result = planned(folder), flown(folder)
    terms = replace(result.terms, order=())
    calm = replace(result, breaches=(), terms=terms)
    assert "NOT AS PLANNED" not in Reader(render_rehearsal(made, calm)).text
    assert result.breaches  # 10 m/s through the air against a wind of 6 m/s: late, in another order
    read = Reader(render_rehearsal(made, result))
    assert "NOT AS PLANNED" in read.text
    assert "✓ SAFE" not in " ".join(read.text.split())
    for breach in result.breaches:
        assert in_units(breach.message, METRIC) in read.text


@pytest.mark.nightly
def test_rehearse_writes_the_page_even_where_it_finds_violations(run: Any, tmp_path: Path) -> None:
    file = write(tmp_path)
    assert run("rehearse", file, "--report", "page.pdf")[0] == 2
    code, _, err = run("rehearse", file, "--report", "page.html")
    assert code == 0, err
    assert "Flown beside planned" in (tmp_path / "page.html").read_text()
    code, _, _ = run("rehearse", file, "--report", "windy.html", "--wind", "6", "--wind-from", "90", "--airspeed", "10")
    assert code == 4
    assert "NOT AS PLANNED" in (tmp_path / "windy.html").read_text()


@pytest.mark.parametrize(
    ("before", "flown", "kind", "words"),
    [
        (91.4, 91.38, "height", "91.4 m 91.3 m −0.1 m"), (74.65, 74.64, "distance", "74.6 m 74.6 m +0.0 m"),
        (20.0, 21.26, "percent", "20.0 % 21.3 % +1.3 %"), (None, 5.0, "height", "– 5.0 m –"),
        (5.0, math.inf, "distance", "5.0 m never –"), (60.0, 58.751, "time", "0:01:00.0 0:00:58.8 −1.25 s"),
    ],
)  # fmt: skip
def test_a_difference_is_that_of_the_two_values_beside_it(
    folder: Path, before: float | None, flown: float, kind: Any, words: str
) -> None:
    one = Compared(None, "fleet", "figure", before, flown, kind)
    text = rehearsal_html(replace(page_of_plan(planned(folder)), rehearsed=Rehearsed(True, "Flown.", (one,))))
    assert f"fleet figure {words}" in " ".join(Reader(text).text.split())
