"""The replay: few places, a stated error, the times and distances of the time table; on the page and in its script."""

from __future__ import annotations

import base64
import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.report.page import render_page
from gcsplan.report.parts.page_data import Page
from gcsplan.report.views.replay import FINE_M, MOST_PLACES, replay_data, replay_of, thin
from tests.support import node
from tests.support.effort import draws
from tests.support.pages import Reader, fleet_page, small_page

in_node = pytest.mark.skipif(node.PROGRAM is None, reason="no Node is installed")
SCRIPTS = ("numbers.js", "base.js", "flight.js")


def wavy(seed: int, moments: int, name: str = "uav") -> TimedPath:
    """A motion that turns at random."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0.0, (20.0, 20.0, 3.0), (moments, 3)), axis=0) + np.array([0.0, 0.0, 500.0])
    return TimedPath(name, np.cumsum(rng.uniform(0.2, 5.0, moments)) + 10.0 * seed, points, 20.0)


def page_with(motions: list[TimedPath]) -> Page:
    page = small_page()
    subjects = [replace(page.subjects[0], name=m.name, motion=m) for m in motions]
    return replace(page, subjects=tuple(subjects))


def decoded(track: dict[str, Any]) -> Any:
    return np.frombuffer(base64.b64decode(track["places"]), "<f4").reshape(-1, 5)


# -- what is on the page ------------------------------------------------------------------------------------------


@settings(max_examples=draws(40))
@given(st.integers(0, 10_000), st.integers(2, 60), st.integers(1, 4), st.integers(2, 120))
def test_thinned_places_are_no_farther_from_the_motion_than_is_said(
    seed: int, moments: int, tracks: int, most: int
) -> None:
    rng = np.random.default_rng(seed)
    given = [
        np.column_stack([np.cumsum(rng.uniform(0.1, 3.0, moments)), rng.normal(0.0, 5.0, (moments, 4))])
        for _ in range(tracks)
    ]
    always = [np.array([0, moments - 1], dtype=np.intp)] * tracks
    kept, error_m = thin(given, always, most)
    assert sum(map(len, kept)) <= max(most, 2 * tracks)
    worst = 0.0
    for places, rows in zip(given, kept, strict=True):
        assert {0, moments - 1} <= set(rows.tolist())
        off = np.column_stack(
            [np.interp(places[:, 0], places[rows, 0], places[rows, k]) - places[:, k] for k in (1, 2, 3, 4)]
        )
        worst = max(worst, float(np.linalg.norm(off[:, :3], axis=1).max()), float(np.abs(off[:, 3]).max()))
    assert worst == pytest.approx(error_m, abs=1e-9)
    assert error_m <= FINE_M or sum(map(len, kept)) >= most


@pytest.mark.nightly
def test_a_hundred_vehicles_planned_and_flown_stay_within_the_pages_bound() -> None:
    page = page_with([wavy(k, 150, f"uav{k}") for k in range(100)])
    page = replace(page, subjects=tuple(replace(s, flown=s.motion) for s in page.subjects))
    replay = replay_of(page)
    assert replay is not None
    tracks: Any = replay_data(replay, page)["tracks"]
    assert len(tracks) == 200
    assert sum(len(t["places"]) for t in tracks) <= 1.34 * 20 * MOST_PLACES + 200 * 4
    for track, one in zip(replay.tracks, tracks, strict=True):
        places = decoded(one).astype(float)
        own = track.motion
        drawn = np.column_stack([np.interp(own.times_s, places[:, 0], places[:, k]) for k in (1, 2, 3)])
        assert np.linalg.norm(drawn - own.points, axis=1).max() <= replay.within_m + 0.05


def test_heights_above_ground_are_those_of_the_surface_and_the_arrival_is_kept() -> None:
    page = fleet_page()
    replay = replay_of(page)
    assert replay is not None
    assert replay.within_m <= FINE_M
    for track in replay.tracks:
        t, e, n, z, agl = track.places.T
        assert np.allclose(agl, z - page.world.airspace.surface.top_at(e, n))
        for needed in (track.motion.begin_s, track.motion.arrive_s, track.motion.end_s):
            assert needed in t


@pytest.mark.slow
def test_a_checked_file_has_no_replay_and_one_vehicle_has_one() -> None:
    read = Reader(render_page(small_page()))
    assert read.data["replay"] is None
    assert not [a for _, a in read.elements if a.get("id") == "replay"]
    lone = replace(small_page(), subjects=(fleet_page().subjects[0],))
    read = Reader(render_page(lone))
    assert len(read.data["replay"]["tracks"]) == 1
    assert "The fleet in time" not in read.text
    box = next(a for _, a in read.elements if a.get("id") == "replay")
    chosen = [a["value"] for t, a in read.elements if t == "option" and "selected" in a]
    assert chosen == ["10"]  # 480 s
    assert "hidden" in box  # without a script there is nothing to move
    assert [a.get("min") for t, a in read.elements if t == "input" and a.get("type") == "range"].count("0") == 1


# -- what its script computes -------------------------------------------------------------------------------------


@pytest.mark.nightly
@in_node
def test_the_script_finds_every_vehicle_where_its_motion_is_and_the_nearest_other() -> None:
    motions = [wavy(k, 40, f"uav{k}") for k in range(4)]
    motions[1] = replace(motions[1], ends_in_air=True)
    page = page_with(motions)
    page = replace(page, subjects=(*page.subjects[:3], replace(page.subjects[3], leaves=True)))
    replay = replay_of(page)
    assert replay is not None
    times = np.random.default_rng(3).uniform(-5.0, max(m.end_s for m in motions) + 20.0, 200).tolist()
    answer = node.ask(
        SCRIPTS,
        "(() => { const tracks = given.data.tracks.map(trackOf); return given.times.map((t) => { "
        "const places = tracks.map((one) => placeAt(one, t)); "
        "return places.map((p, i) => [p, nearestOther(tracks, places, i)]); }); })()",
        {"data": replay_data(replay, page), "times": times},
    )
    for t, found in zip(times, answer, strict=True):
        air = [m.begin_s <= t and (t < m.end_s or m.ends_in_air) for m in motions]
        at = np.array([m.at(t)[0] for m in motions])
        for i, (place, other) in enumerate(found):
            m = motions[i]
            if i == 3 and t > m.end_s:
                assert place is None
                continue
            assert np.linalg.norm(at[i] - (place["e"], place["n"], place["z"])) <= replay.within_m + 0.01
            state = "waits" if t < m.begin_s else "flies" if t < m.end_s else "stays in the air" if i == 1 else "landed"
            assert place["state"] == state
            away = [float(np.linalg.norm(at[i] - at[j])) if air[j] and j != i else math.inf for j in range(4)]
            if not air[i] or not np.isfinite(away).any():
                assert other is None
            else:
                assert other[1] == pytest.approx(min(away), abs=2 * replay.within_m + 0.02)


@in_node
def test_at_the_closest_approach_the_script_has_the_exact_least_distance() -> None:
    page = fleet_page()
    assert page.separation is not None
    least = page.separation.least
    assert least is not None
    replay = replay_of(page)
    assert replay is not None
    away = node.ask(
        SCRIPTS,
        "(() => { const [a, b] = given.tracks.map(trackOf); "
        "return apart(placeAt(a, given.closest), placeAt(b, given.closest)); })()",
        replay_data(replay, page),
    )
    assert away == pytest.approx(least.distance_m, abs=0.01)


@in_node
def test_times_heights_and_distances_are_told_as_everywhere_on_the_page() -> None:
    words = node.ask(
        SCRIPTS,
        "[...[0, 59.9, 60, 999.4, 3600, 36061].map(clockWords), metres(65.98), metres(-0.2), metres(NaN), "
        "metres(1234.5, 'AMSL')]",
    )
    assert words == [
        "T+0:00:00", "T+0:00:59", "T+0:01:00", "T+0:16:39", "T+1:00:00", "T+10:01:01",
        "65\u202fm", "-1\u202fm", "–", "1\u202f235\u202fm AMSL",
    ]  # fmt: skip


@pytest.mark.slow
@in_node
def test_a_place_that_is_passed_twice_is_found_by_its_time() -> None:
    there = list(range(0, 1001, 10))
    run = there + there[-2::-1]
    line = {
        "s": run,
        "e": run,
        "n": [0] * len(run),
        "z": [100] * len(run),
        "t": [0.1 * k * 10 for k in range(len(run))],
    }
    for since, e in ((30.0, 300.0), (170.0, 300.0), (100.0, 1000.0)):
        found = node.ask(SCRIPTS, f"sampleAt(given, {{e: {e}, n: 0, z: 100}}, {since})", line)
        assert found == round(since)


@pytest.mark.nightly
@in_node
def test_the_pointer_finds_the_nearest_track_between_its_samples_too() -> None:
    rng = np.random.default_rng(5)
    lines = [np.cumsum(rng.normal(0.0, 300.0, (30, 2)), axis=0) for _ in range(4)]
    lines[2][7] = lines[2][6]  # a column: two samples at one place
    data = [{"s": [0] * 30, "e": xy[:, 0].tolist(), "n": xy[:, 1].tolist()} for xy in lines]
    places = rng.uniform(-2000.0, 2000.0, (60, 2))
    script = "given.places.map(([e, n]) => nearestTrack(given.lines, e, n))"
    t = np.linspace(0.0, 1.0, 400)[:, None]
    dense = [np.concatenate([a + t * (b - a) for a, b in pairwise(xy)]) for xy in lines]
    for place, found in zip(places, node.ask(SCRIPTS, script, {"lines": data, "places": places.tolist()}), strict=True):
        away = [float(np.hypot(*(xy - place).T).min()) for xy in dense]
        assert found["away"] == pytest.approx(min(away), abs=2.0)
        assert away[found["k"]] == pytest.approx(min(away), abs=2.0)
        corner = lines[found["k"]][found["i"]]
        assert np.hypot(*(corner - place)) >= found["away"] - 1e-6
    assert node.ask(SCRIPTS, "nearestTrack([], 0, 0)") is None
