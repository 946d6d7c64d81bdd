"""Vehicles without a mission: left out by name where that is allowed, while the others are planned as if alone."""

from __future__ import annotations

import csv
import io
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.batch import BatchOptions, record_of
from gcsplan.app.fleet import vehicle_plans
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.parallel.executor import Inline
from gcsplan.app.plan.left_out import LeavingOut, least_to_leave, refusal_of
from gcsplan.app.plan.model import Brief, Plan
from gcsplan.errors import NoMission
from gcsplan.fleet.separation import Conflict, Encounter
from gcsplan.mission_file import load_mission

# uav2 lands beside uav1, uav3 may not carry enough energy, and a fourth is walled in.
FLAT: dict[str, Any] = {
    "version": 1,
    "name": "four",
    "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "terrain": {"flat_m": 0},
    "limits": {"min_agl_m": 40},
}
WALLS = [
    {"name": f"wall {k}", "polygon": [{"east_m": e, "north_m": n} for e, n in ring]}
    for k, ring in enumerate((
        ((600, 900), (1200, 900), (1200, 950), (600, 950)), ((600, 1450), (1200, 1450), (1200, 1500), (600, 1500)),
        ((600, 900), (650, 900), (650, 1500), (600, 1500)), ((1150, 900), (1200, 900), (1200, 1500), (1150, 1500)),
    ))
]  # fmt: skip


def vehicle(number: int, north_m: float, goal: tuple[float, float], **more: Any) -> dict[str, Any]:
    return {
        "name": f"uav{number}", "sysid": number, "autopilot": "arducopter", "speed_m_s": [3, 10],
        "start": {"east_m": 0, "north_m": north_m}, "goal": {"east_m": goal[0], "north_m": goal[1]},
        "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5, **more,
    }  # fmt: skip


def mission(*vehicles: dict[str, Any], **arrival: Any) -> dict[str, Any]:
    how = {"mode": "sequence", "interval_s": 5, "separation_m": 30} | arrival
    return FLAT | {"no_fly": WALLS, "vehicles": list(vehicles), "arrival": how}


GOOD = [vehicle(1, 0, (800, 0)), vehicle(3, 400, (800, 400))]
SHUT = vehicle(2, 600, (900, 1200))
BESIDE = vehicle(4, 800, (800, 12))
WEAK = vehicle(5, -400, (800, -400), energy={"battery_j": 9000, "reserve": 0.2})


def wires(done: Plan) -> list[list[object]]:
    return [[item.wire for item in v.mission.items] for v in done.vehicles]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bad", "reason", "of"),
    [
        (SHUT, "infeasible", "wall"),
        (WEAK, "battery", "battery"),
        pytest.param(BESIDE, "separation", "uav1", marks=pytest.mark.nightly),
    ],
)
def test_one_without_a_mission_refuses_all_or_is_left_out_by_name(bad: dict[str, Any], reason: str, of: str) -> None:
    whole = mission(GOOD[0], GOOD[1], bad)
    with pytest.raises(NoMission) as refused:
        plan(whole)
    assert refused.value.reason == reason
    done = plan(whole, leave_out=True)
    assert [v.name for v in done.vehicles] == ["uav1", "uav3"]
    [left] = done.left_out
    assert (left.name, left.reason) == (bad["name"], reason)
    assert of in left.message
    assert done.fleet is not None
    assert done.fleet.order == ("uav1", "uav3")
    if reason != "separation":  # the others fly what they would fly without it, to the byte
        assert wires(done) == wires(plan(mission(*GOOD)))
    assert wires(done) == wires(plan(mission(GOOD[0], GOOD[1], bad, leave_out=True)))


@pytest.mark.nightly
def test_a_turn_of_the_sequence_stays_empty_for_one_that_is_in_the_way() -> None:
    done = plan(mission(GOOD[0], BESIDE, GOOD[1]), leave_out=True)
    assert done.fleet is not None
    arrive_s = [done.fleet.slot(name).arrive_s for name in ("uav1", "uav3")]
    assert arrive_s[1] - arrive_s[0] == pytest.approx(10.0, abs=1e-2)


@pytest.mark.slow
def test_one_that_is_late_for_a_fixed_time_is_left_out() -> None:
    far = vehicle(6, -800, (4000, -800))
    whole = mission(far, *GOOD, arrive_s=150)
    with pytest.raises(NoMission, match="cannot arrive in time"):
        plan(whole)
    done = plan(whole, leave_out=True)
    assert [(v.name, v.reason) for v in done.left_out] == [("uav6", "time")]
    assert done.fleet is not None
    assert [s.arrive_s for s in done.fleet.slots] == pytest.approx([155.0, 160.0], abs=1e-2)


def test_nothing_is_planned_if_all_are_left_out() -> None:
    with pytest.raises(NoMission, match="2 vehicles without a mission, left out: uav2, uav5"):
        plan(mission(SHUT, WEAK), leave_out=True)


def test_workers_leave_out_the_same_vehicles() -> None:
    source = load_mission(text=yaml.safe_dump(mission(WEAK, GOOD[0], SHUT, GOOD[1])))
    brief = Brief(source, vehicle_plans.world_of(source), "optimal", "length", 1, {})
    leaving = LeavingOut(allowed=True)
    found = vehicle_plans.planned_by(Inline(), brief, None, leaving)
    assert [v.name for v in found] == ["uav1", "uav3"]
    assert [v.name for v in leaving.found] == ["uav5", "uav2"]
    with pytest.raises(NoMission, match="battery"):
        vehicle_plans.planned_by(Inline(), brief)


def test_a_batch_has_a_row_for_each_that_is_left_out(tmp_path: Path) -> None:
    file = tmp_path / "four.yaml"
    file.write_text(yaml.safe_dump(mission(GOOD[0], SHUT, GOOD[1], leave_out=True)))
    record = record_of(BatchOptions(), ("four", str(file)))
    assert record.code == 3
    assert [(row["vehicle"], row["code"]) for row in record.rows] == [("uav1", 0), ("uav3", 0), ("uav2", 3)]
    assert record.files is not None
    assert "uav1.plan" in record.files
    assert len(record.tracks) == 2


def test_the_least_to_leave_ends_every_conflict() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        names = [f"v{k}" for k in range(rng.integers(2, 7))]
        pairs = [p for p in combinations(names, 2) if rng.random() < 0.4]
        place = (0.0, 0.0, 0.0)
        conflicts = [
            Conflict("air", Encounter(p, 1.0, 0.0, (0.0, 0.0), (place, place), (0, 0)), 30.0, 0.0, 1.0) for p in pairs
        ]
        leave = least_to_leave(conflicts)
        assert all(set(p) & set(leave) for p in pairs)
        assert all(name in conflict.worst.vehicles for name, conflict in leave.items())
        fewest = next(
            n for n in range(len(names) + 1) for some in combinations(names, n)
            if all(set(p) & set(some) for p in pairs)
        )  # fmt: skip
        assert len(leave) <= 2 * fewest
        assert bool(leave) == bool(pairs)


def test_a_refusal_names_all_and_explains_the_first() -> None:
    leaving = LeavingOut(allowed=True)
    for k in range(40):
        leaving.leave(f"uav{k}", NoMission(f"why {k}", reason="time"))
    words = str(refusal_of(leaving.found))
    assert all(f"uav{k}" in words for k in range(40))
    assert "why 4" in words
    assert "why 5" not in words
    assert "and 35 more" in words


@pytest.mark.slow
def test_outputs_hold_none_of_those_left_out() -> None:
    files = outputs_of(plan(mission(GOOD[0], SHUT, GOOD[1]), leave_out=True))
    assert "uav2" not in files["mission.kml"]
    assert {row["vehicle"] for row in csv.DictReader(io.StringIO(files["profile.csv"]))} == {"uav1", "uav3"}
