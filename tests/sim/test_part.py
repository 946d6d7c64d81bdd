"""One vehicle's part in a rehearsal: when its flight is late, and what a path takes of its battery."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.sim.flight.trace import Trace
from gcsplan.sim.part import energy_of, lateness
from gcsplan.units import METRIC
from gcsplan.vehicle import Energy
from tests.support import worlds
from tests.support.rehearsal_parts import a_part


def trace(arrive_s: float, end_s: float) -> Trace:
    points = np.array([[0.0, 0.0, 300.0], [1000.0, 0.0, 370.0]])
    return Trace(
        "uav1", np.array([0.0, end_s]), points, np.zeros(1, np.bool_), np.ones(1, np.intp), arrive_s, 0.0, np.zeros(1)
    )


def test_a_flight_is_late_by_more_than_a_tenth_of_what_was_told() -> None:
    part = a_part(1, (0, 0), (1000, 0), depart_s=5.0, arrive_s=205.0)
    assert part.told_s is not None
    arrives_s, ends_s = part.told_s
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
    assert part.told_s is not None
    late = lateness(part, trace(230.0, part.told_s[1] + 50.0))
    assert late is not None
    assert late[1] == pytest.approx(50.0)
    assert late[0].code == "down_late"


def test_nothing_is_late_that_never_arrives_or_has_no_plan() -> None:
    part = a_part(1, (0, 0), (1000, 0), arrive_s=100.0)
    assert lateness(part, trace(math.nan, 900.0)) is None
    assert lateness(replace(part, arrive_s=None), trace(900.0, 999.0)) is None


def test_the_energy_of_a_path_is_its_climb_its_metres_its_time_and_its_holds() -> None:
    energy = Energy(vertical_j_per_m=120.0, horizontal_j_per_m=100.0, hover_w=400.0)
    vehicle = replace(worlds.vehicle(), energy=energy)
    path = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 50.0], [300.0, 400.0, 40.0]])
    assert energy_of(path, 0.0, vehicle) == pytest.approx(60 * 120 + 500 * 100)
    assert energy_of(path, 10.0, vehicle) == pytest.approx(60 * 120 + 500 * 100 + 4000)
    assert energy_of(path, 0.0, vehicle, air_m=450.0) == pytest.approx(60 * 120 + 450 * 100)
    based = replace(vehicle, energy=replace(energy, base_w=50.0))
    assert energy_of(path, 0.0, based, 100.0) == pytest.approx(60 * 120 + 500 * 100 + 5000)
