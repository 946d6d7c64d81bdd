"""The result of a rehearsal: requirements that are not kept, figures over all runs, its document; and one vehicle's
part: when its flight is late, and what a path takes of its battery.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.notes.note import Note
from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.outcome import Tally, Terms, energy_of, lateness, outside_s, percentile_95
from gcsplan.sim.rehearsal import rehearse
from gcsplan.units import METRIC
from gcsplan.vehicle import Energy
from tests.support import worlds
from tests.support.rehearsal_parts import BRAKING_S, CLIMB_S, FLAT, a_part, kinds, reached_s


@pytest.mark.slow
def test_another_order_of_arrival_is_a_violation() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (0, 300), (900, 300))]
    result = rehearse(parts, FLAT, Terms(("uav1", "uav2"), 30.0))
    assert kinds(result) == ["order"]
    lost = Note("order_lost", came=("uav2", "uav1"), planned=("uav1", "uav2"))
    assert result.breaches[0].message == lost
    [told] = result.as_dict()["violations"]
    assert (told["code"], told["data"]) == ("order_lost", lost.as_dict()["data"])
    assert told["message"] == "the order of arrival was uav2, uav1; planned was uav1, uav2"
    error = result.error()
    assert error is not None
    assert error.exit_code == 4


@pytest.mark.nightly
def test_two_that_meet_are_named_with_the_moment() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (500, -500), (500, 500))]
    result = rehearse(parts, FLAT, Terms((), 30.0))
    assert kinds(result) == ["separation"]
    assert result.breaches[0].vehicles == ("uav1", "uav2")
    assert result.closest is not None
    assert result.closest.distance_m < 1.0
    assert result.closest.time_s == pytest.approx(CLIMB_S + 50 + BRAKING_S / 2, abs=0.5)
    later = [parts[0], replace(parts[1], depart_s=10.0)]
    assert rehearse(later, FLAT, Terms((), 30.0)).safe


@pytest.mark.nightly
def test_landing_beside_one_that_stands_is_a_violation_until_the_pad_is_clear() -> None:
    parts = [a_part(1, (0, 0), (1000, 0)), a_part(2, (0, 300), (1000, 20), depart_s=200.0)]
    assert kinds(rehearse(parts, FLAT, Terms((), 30.0))) == ["separation"]
    assert rehearse(parts, FLAT, Terms((), 30.0, pad_clear_s=60.0)).safe
    assert rehearse(parts, FLAT, Terms((), 15.0)).safe


@pytest.mark.slow
def test_a_battery_that_is_flown_too_low_is_a_violation() -> None:
    vehicle = replace(worlds.vehicle(), energy=Energy(120.0, 100.0, battery_j=130_000.0, reserve=0.2))
    part = a_part(1, (0, 0), (1000, 0), vehicle=vehicle)
    passing = replace(part.verdict, findings=())  # the check found the same
    result = rehearse([replace(part, verdict=passing)], FLAT, Terms())
    assert kinds(result) == ["battery"]
    assert result.vehicles[0].battery_used_percent == pytest.approx(100 * (120 * 140 + 100 * 1000) / 130_000, rel=0.001)


@pytest.mark.slow
def test_the_document_has_its_keys_and_a_row_for_each_vehicle() -> None:
    parts = [a_part(n, (0, 200.0 * n), (500, 200.0 * n), arrive_s=reached_s(500)) for n in (1, 2)]
    result = rehearse(parts, FLAT, Terms((), 30.0), runs=9)
    document = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert document["runs"] == 1  # in still air every run is the same
    assert document["notes_data"] == [Note("runs_alike").as_dict()]
    assert document["notes"] == [str(Note("runs_alike"))]
    assert document["safe"] is True
    assert {"order_flown", "min_separation_m", "closest", "p95_error_s"} <= document["fleet"].keys()
    assert {"planned_arrive_s", "arrive_s", "error_s", "min_agl_m", "battery_used_percent"} <= document["vehicles"][
        0
    ].keys()
    assert [row["vehicle"] for row in result.rows()] == ["uav1", "uav2"]


def test_ninety_five_percent() -> None:
    assert percentile_95([]) is None
    assert percentile_95([3.0]) == 3.0
    assert percentile_95([float(x) for x in range(100)]) == 94.0


def trace(arrive_s: float, end_s: float) -> Trace:
    points = np.array([[0.0, 0.0, 300.0], [1000.0, 0.0, 370.0]])
    return Trace(
        "uav1", np.array([0.0, end_s]), points, np.zeros(1, np.bool_), np.ones(1, np.intp), arrive_s, 0.0, np.zeros(1)
    )


def test_a_flight_is_late_by_more_than_a_tenth_of_what_was_told() -> None:
    part = a_part(1, (0, 0), (1000, 0), depart_s=5.0, arrive_s=205.0)
    assert part.planned_s is not None
    arrives_s, ends_s = part.planned_s
    assert arrives_s == 200.0
    assert lateness(part, trace(5.0 + 219.0, 5.0 + ends_s)) is None
    late = lateness(part, trace(5.0 + 221.0, 5.0 + ends_s))
    assert late is not None
    assert late[1] == pytest.approx(21.0)
    assert late[0].code == "arrived_late"
    assert late[0].data["told_s"] == 200.0
    assert late[0].in_units(METRIC) == "uav1 arrived 0:00:21 late, after 0:03:41 instead of 0:03:20"


def test_the_later_of_arrival_and_end_counts() -> None:
    part = a_part(1, (0, 0), (1000, 0), arrive_s=200.0)
    assert part.planned_s is not None
    late = lateness(part, trace(230.0, part.planned_s[1] + 50.0))
    assert late is not None
    assert late[1] == pytest.approx(50.0)
    assert late[0].code == "down_late"


def test_nothing_is_late_that_never_arrives_or_has_no_plan() -> None:
    part = a_part(1, (0, 0), (1000, 0), arrive_s=100.0)
    assert lateness(part, trace(math.nan, 900.0)) is None
    assert lateness(replace(part, arrive_s=None), trace(900.0, 999.0)) is None


def test_an_arrival_is_outside_its_window_by_more_than_two_models_differ() -> None:
    window_s = 100.0, 120.0
    assert outside_s(window_s, 0.0, 110.0) == 0.0
    assert outside_s(window_s, 0.0, 120.6) == 0.0
    assert outside_s(window_s, 0.0, 121.0) == pytest.approx(1.0)
    assert outside_s(window_s, 0.0, 98.0) == pytest.approx(-2.0)
    assert outside_s((1000.0, 1000.0), 0.0, 1004.0) == 0.0
    assert outside_s(window_s, 0.0, math.nan) == 0.0
    assert outside_s(None, 0.0, 500.0) == 0.0


def test_arrivals_in_a_window_are_counted_and_one_outside_is_a_violation() -> None:
    part = replace(a_part(1, (0, 0), (1000, 0), depart_s=5.0, arrive_s=205.0), window_s=(155.0, 305.0))
    tally = Tally([part], Terms())
    for arrives_s in (160.0, 300.0, 310.0):
        tally.add([trace(arrives_s, arrives_s + 60.0)], FLAT, [0.0])
    result = tally.result("gcsplan", 1, {}, [()])
    assert result.inside_windows == (2, 3)
    assert "window" in kinds(result)
    told = next(str(b.note(3)) for b in result.breaches if b.kind == "window")
    assert told == (
        "uav1 arrived 5.0 s after its window, which is 150.0 s to 300.0 s after its departure (in 1 of 3 runs)"
    )
    row = result.as_dict()["vehicles"][0]
    assert (row["arrive_earliest_s"], row["arrive_latest_s"], row["inside_window_runs"]) == (155.0, 305.0, 2)
    assert result.rows()[0]["window"] == "0:02:35 – 0:05:05"
    assert result.error() is not None


def test_without_a_window_nothing_tells_of_one() -> None:
    tally = Tally([a_part(1, (0, 0), (1000, 0), arrive_s=205.0)], Terms())
    tally.add([trace(200.0, 260.0)], FLAT, [0.0])
    result = tally.result("gcsplan", 1, {}, [()])
    assert result.inside_windows is None
    assert "window" not in result.rows()[0]
    assert "inside_window_runs" not in result.as_dict()["vehicles"][0]


def test_the_energy_of_a_path_is_its_climb_its_metres_its_time_and_its_holds() -> None:
    energy = Energy(vertical_j_per_m=120.0, horizontal_j_per_m=100.0, hover_w=400.0)
    vehicle = replace(worlds.vehicle(), energy=energy)
    path = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [300.0, 400.0, 40.0]])
    assert energy_of(path, 0.0, vehicle) == pytest.approx(60 * 120 + 500 * 100)
    assert energy_of(path, 10.0, vehicle) == pytest.approx(60 * 120 + 500 * 100 + 4000)
    assert energy_of(path, 0.0, vehicle, air_m=450.0) == pytest.approx(60 * 120 + 450 * 100)
    based = replace(vehicle, energy=replace(energy, base_w=50.0))
    assert energy_of(path, 0.0, based, 100.0) == pytest.approx(60 * 120 + 500 * 100 + 5000)
