"""Fleets from a mission file: arrivals on time, missions with their speeds and gates, separation, other paths."""

from __future__ import annotations

import csv
import io
import json
import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan.app.fleet.fleet import route_of
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import rehearse, weather_of
from gcsplan.errors import InputError, NoMission
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mission_file import load_mission
from tests.support.noted import one
from tests.support.paths import MISSIONS

# Two vehicles across flat ground whose straight ways cross in the middle at right angles, 1000 m each.
CROSS: dict[str, Any] = {
    "version": 1,
    "name": "a cross",
    "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "terrain": {"flat_m": 0},
    "limits": {"min_agl_m": 40, "max_climb_deg": 30},
    "vehicles": [
        {
            "name": "west", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10],
            "start": {"east_m": -500, "north_m": 0}, "goal": {"east_m": 500, "north_m": 0},
            "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5,
        },
        {
            "name": "south", "sysid": 2, "autopilot": "arducopter", "speed_m_s": [3, 10],
            "start": {"east_m": 0, "north_m": -500}, "goal": {"east_m": 0, "north_m": 500},
            "climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5,
        },
    ],
}  # fmt: skip


@lru_cache(maxsize=32)
def _planned(text: str) -> Plan:
    return plan(load_mission("fleet.yaml", text=text))


def planned(arrival: dict[str, Any] | None, *vehicles: dict[str, Any], **more: Any) -> Plan:
    """The cross with an arrival, changes to each vehicle, and to the file."""
    asked = CROSS | more
    changes = [*vehicles, *[{}] * len(CROSS["vehicles"])]
    asked["vehicles"] = [v | c for v, c in zip(CROSS["vehicles"], changes, strict=False)]
    if arrival is not None:
        asked["arrival"] = arrival
    return _planned(yaml.safe_dump(asked))


def sequence(interval_s: float, **more: Any) -> dict[str, Any]:
    return {"mode": "sequence", "order": ["west", "south"], "interval_s": interval_s, "separation_m": 30} | more


def nearest_m(done: Plan, step_s: float = 0.01) -> float:
    """The least distance of the first two, sampled: while both fly."""
    assert done.fleet is not None
    a, b = done.fleet.motions[:2]
    t = np.arange(max(a.begin_s, b.begin_s), min(a.end_s, b.end_s), step_s)
    return float(np.linalg.norm(a.at(t) - b.at(t), axis=1).min())


def speeds_of(done: Plan) -> list[float]:
    """What each mission commands, off its wire."""
    commanded = [i for v in done.vehicles for i in v.mission.items if i.command == cmd.DO_CHANGE_SPEED]
    return [item.params[1] for item in commanded]


# -- arrivals -----------------------------------------------------------------------------------------------------


def test_a_sequence_arrives_at_its_intervals_at_the_commanded_speeds() -> None:
    done = planned(sequence(20))
    summary = summary_of(done)
    west, south = summary["vehicles"]
    assert south["arrive_s"] - west["arrive_s"] == pytest.approx(20.0, abs=1e-4)
    assert speeds_of(done) == [west["speed_m_s"], south["speed_m_s"]]
    assert west["speed_m_s"] == 10.0
    assert south["speed_m_s"] < 10.0
    assert summary["fleet"]["order"] == ["west", "south"]
    assert done.fleet is not None
    for v, motion in zip(done.vehicles, done.fleet.motions, strict=True):
        goal = done.world.frame.to_plane(*v.request.goal_deg)
        assert np.hypot(*(motion.at([motion.arrive_s])[0, :2] - goal)) < 0.05
        assert v.verdict.mission == v.mission


def test_speeds_are_commanded_in_the_metres_that_ardupilot_counts() -> None:
    """At 36.6 degrees a metre of its own is 1.2 mm more of the ellipsoid eastwards, and 3.1 mm less northwards."""
    real: dict[str, Any] = {"leg_jerk_m_s3": 1.0}
    done = planned(sequence(20), real, real)
    for v, east_or_north, pace in zip(done.vehicles, (0, 1), (1.00119, 0.99688), strict=True):
        route = route_of(v, done.world)
        assert route.pace is not None
        assert route.pace == pytest.approx(pace, abs=2e-5)  # the way home has the same course
        assert done.fleet is not None
        motion = done.fleet.motion(v.name)
        middle = motion.at([motion.arrive_s - 60.0, motion.arrive_s - 50.0])[:, east_or_north]
        assert (middle[1] - middle[0]) / 10.0 == pytest.approx(speeds_of(done)[east_or_north] * pace, rel=5e-5)
    plain = planned(sequence(20))
    assert all(route_of(v, plain.world).pace is None for v in plain.vehicles)


def test_together_all_are_at_their_goals_at_the_same_moment() -> None:
    done = planned({"mode": "together", "separation_m": 30}, {"start": {"east_m": -800, "north_m": 0}})
    arrivals = [v["arrive_s"] for v in summary_of(done)["vehicles"]]
    assert arrivals[0] == pytest.approx(arrivals[1], abs=1e-4)
    assert summary_of(done)["vehicles"][0]["speed_m_s"] == 10.0


def test_a_first_that_would_leave_others_behind_waits_unless_its_clock_is_set() -> None:
    far = {"start": {"east_m": 0, "north_m": -2500}}
    done = planned(sequence(9), {}, far)
    west, south = summary_of(done)["vehicles"]
    assert south["speed_m_s"] == 10.0
    assert south["arrive_s"] - west["arrive_s"] == pytest.approx(9.0, abs=1e-4)
    assert one("clock_of_fleet", done.notes).data["interval_s"] == 9.0
    with pytest.raises(NoMission, match="interval_s") as refused:
        planned(sequence(9, clock="first"), {}, far)
    assert refused.value.reason == "time"


def test_a_single_vehicle_arrives_by_the_same_model_of_time() -> None:
    done = _planned(yaml.safe_dump(CROSS | {"vehicles": CROSS["vehicles"][:1]}))
    (only,) = summary_of(done)["vehicles"]
    # A column of 40 m at 2.5 m/s and 1000 m at 10 m/s with 1.5 m/s² at both ends; the column's own is not bounded here.
    assert only["arrive_s"] == pytest.approx(40 / 2.5 + 1000 / 10 + 10 / 1.5, abs=0.2)
    assert only["depart_s"] == 0.0
    assert summary_of(done)["fleet"] == {
        "mode": "none", "order": [], "min_separation_m": None, "closest": None, "interval_s": None,
        "separation_m": None,
    }  # fmt: skip


# -- separation ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_that_would_meet_are_kept_apart_and_their_arrivals_stay() -> None:
    done = planned({"mode": "together", "separation_m": 30})
    summary = summary_of(done)
    assert summary["fleet"]["min_separation_m"] >= 30.0
    assert nearest_m(done) >= 30.0 - 1e-3
    assert nearest_m(done) == pytest.approx(summary["fleet"]["min_separation_m"], abs=0.05)
    arrivals = [v["arrive_s"] for v in summary["vehicles"]]
    assert arrivals[0] == pytest.approx(arrivals[1], abs=1e-3)
    told = [note["code"] for v in summary["vehicles"] for note in v["notes_data"]]
    assert "keeps_clear" in told


def test_without_an_arrival_nothing_is_changed_and_a_meeting_is_told() -> None:
    done = planned(None)
    assert [v["depart_s"] for v in summary_of(done)["vehicles"]] == [0.0, 0.0]
    assert speeds_of(done) == [10.0, 10.0]
    apart = one("nothing_keeps_apart", done.notes)
    assert str(apart).startswith("the file asks for no `arrival`, so nothing keeps the vehicles apart; released")
    assert "\n  west and south come as near as" in str(apart)


def test_a_goal_for_two_is_refused_with_the_distance_that_works() -> None:
    with pytest.raises(NoMission, match=r"at least 30\.\d m apart") as refused:
        planned(sequence(20), {}, {"goal": {"east_m": 500, "north_m": 10}})
    assert refused.value.reason == "separation"
    assert "36.6" in str(refused.value)  # the place in degrees


# -- gates --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("autopilot", ["arducopter", "px4"])
def test_a_hold_at_the_gate_comes_before_the_speed_and_costs_hover_power(autopilot: str) -> None:
    slow = {"speed_m_s": [9, 10], "energy": {"hover_w": 500}, "autopilot": autopilot}
    done = planned(sequence(60, hold="gate"), {}, slow)
    south = done.vehicles[1]
    commands = [item.command for item in south.mission.items]
    gate = commands.index(cmd.DELAY)
    assert commands[gate - 1] == cmd.TAKEOFF
    assert commands[gate + 1] == cmd.DO_CHANGE_SPEED
    told = summary_of(done)["vehicles"][1]
    assert told["hold_s"] > 0
    assert south.mission.items[gate].params[0] == told["hold_s"] == int(told["hold_s"])
    assert told["depart_s"] < 1.0
    west = summary_of(done)["vehicles"][0]
    assert told["arrive_s"] - west["arrive_s"] == pytest.approx(60.0, abs=1e-3)
    assert south.verdict.energy_j > done.vehicles[0].verdict.energy_j + 500 * told["hold_s"] - 1.0
    rows = [r for r in csv.DictReader(io.StringIO(outputs_of(done)["profile.csv"])) if r["vehicle"] == "south"]
    times = [float(r["time_s"]) for r in rows if r["time_s"]]
    assert times == sorted(times)
    assert float(rows[-2]["time_s"]) == pytest.approx(told["arrive_s"], abs=0.01)


def test_what_cannot_hold_in_the_air_leaves_later_instead() -> None:
    slow = {"speed_m_s": [9, 10], "autopilot": "arduplane", "max_climb_deg": 30, "end": "none"}
    done = planned(sequence(60), {}, slow)
    told = summary_of(done)["vehicles"][1]
    assert told["depart_s"] > 10.0
    assert told["hold_s"] == 0.0
    assert cmd.DELAY not in [item.command for item in done.vehicles[1].mission.items]


# -- routes, outputs, papers --------------------------------------------------------------------------------------


def test_a_route_is_what_the_mission_flies_in_metres() -> None:
    done = planned(sequence(20))
    route = route_of(done.vehicles[0], done.world)
    assert route.points[0] == pytest.approx([-500, 0, 40], abs=0.1)
    assert route.points[-1] == pytest.approx([500, 0, 40], abs=0.1)
    assert route.start_ground_amsl_m == pytest.approx(0.0, abs=1e-6)
    assert route.goal_ground_amsl_m == pytest.approx(0.0, abs=1e-6)
    assert route.length_m == pytest.approx(done.vehicles[0].verdict.length_m, rel=1e-9)
    assert route.items is not None
    wire = done.vehicles[0].mission.wire_items()
    assert wire[route.items[0]].command == cmd.TAKEOFF
    assert wire[route.items[-1]].command == cmd.LAND
    assert all(wire[k].command == cmd.WAYPOINT for k in route.items[1:-1])


@pytest.mark.nightly
def test_in_the_terrain_frame_a_vehicle_is_where_the_ground_has_it() -> None:
    hill = {"peaks": [{"center": [0, 200], "height_m": 60, "decay_m": [120, 120]}]}
    limits = {"min_agl_m": 40, "max_climb_deg": 45}
    done = planned(
        {"mode": "none", "separation_m": 30}, terrain=hill, limits=limits, altitude_frame="terrain", terrain_error_m=0
    )
    assert done.fleet is not None
    surface = done.world.airspace.surface
    for v, motion in zip(done.vehicles, done.fleet.motions, strict=True):
        assert v.verdict.lowest is not None
        t = np.linspace(motion.begin_s + 25.0, motion.arrive_s, 500)
        at = motion.at(t)
        agl = at[:, 2] - surface.ground_at(at[:, 0], at[:, 1])
        assert agl.min() >= v.verdict.lowest.min_agl_m - 1.5
        flown = route_of(v, done.world)
        assert len(flown.points) > 30
        assert flown.items is not None
        assert len(flown.items) == len(flown.points) + 1


@pytest.mark.nightly
def test_the_papers_sequence_and_together_arrive_by_their_ideal_arithmetic() -> None:
    done = plan(load_mission(MISSIONS / "papers" / "ib-abc-sequence.yaml"))
    told = summary_of(done)["vehicles"]
    first_s = told[0]["length_m"] / 30.0
    for i, v in enumerate(told):
        assert v["arrive_s"] == pytest.approx(first_s + 9.0 * i, abs=1e-3)
        assert v["speed_m_s"] == pytest.approx(v["length_m"] / v["arrive_s"], rel=1e-4)
        assert v["depart_s"] == pytest.approx(0.0, abs=1e-3)
    together = plan(load_mission(MISSIONS / "papers" / "ib-abc-together.yaml"))
    told = summary_of(together)["vehicles"]
    longest_m = max(v["length_m"] for v in told)
    for v in told:
        assert v["arrive_s"] == pytest.approx(longest_m / 30.0, abs=1e-3)
        assert v["speed_m_s"] == pytest.approx(30.0 * v["length_m"] / longest_m, rel=1e-4)


@pytest.mark.nightly
def test_msfoa_plans_by_priority_with_those_before_in_view(monkeypatch: pytest.MonkeyPatch) -> None:
    from gcsplan.research.swarm import planner as swarm_planner

    seen: list[int] = []
    search = swarm_planner.search

    def counting(problem: Any, optimiser: str, settings: Any) -> Any:
        seen.append(len(settings.earlier))
        return search(problem, optimiser, settings)

    monkeypatch.setattr(swarm_planner, "search", counting)
    text = (MISSIONS / "papers" / "msfoa-1.yaml").read_text().replace("iterations: 200", "iterations: 40")
    done = plan(load_mission("msfoa-1.yaml", text=text))
    assert seen[:3] == [0, 1, 2]
    assert done.fleet is not None
    assert done.fleet.separation is not None
    assert done.fleet.separation.safe
    assert all(v.verdict.safe is True for v in done.vehicles)
    # The first gives way to nobody.
    assert done.fleet.slot("uav1").depart_s == 0.0


@pytest.mark.slow
def test_the_fleet_of_four_arrives_in_its_order_and_keeps_apart() -> None:
    text = (MISSIONS / "fleet-4.yaml").read_text().replace("gap_percent: 0.1", "gap_percent: 2")
    done = plan(load_mission("fleet-4.yaml", text=text))
    told = json.loads(outputs_of(done)["summary.json"])
    arrivals = {v["name"]: v["arrive_s"] for v in told["vehicles"]}
    assert sorted(arrivals, key=arrivals.__getitem__) == told["fleet"]["order"] == ["uav2", "uav4", "uav1", "uav3"]
    assert np.diff([arrivals[n] for n in told["fleet"]["order"]]) == pytest.approx([12, 12, 12], abs=2e-3)
    assert told["fleet"]["min_separation_m"] >= 30
    assert all(v["safe"] is True and 10_000 < v["length_m"] < 20_000 for v in told["vehicles"])
    assert math.isfinite(told["fleet"]["closest"]["time_s"])


@pytest.mark.slow
def test_the_file_of_a_hundred_is_a_fleet_of_a_hundred() -> None:
    source = load_mission(MISSIONS / "fleet-100.yaml")
    assert len(source.vehicles) == 100
    goals = np.array([r.goal[:2] for r in source.vehicles])
    apart = np.linalg.norm(goals[:, None] - goals[None], axis=-1) + 1e9 * np.eye(100)
    assert apart.min() > 80.0
    asked = yaml.safe_load((MISSIONS / "fleet-100.yaml").read_text())
    asked["vehicles"] = asked["vehicles"][:6]
    done = plan(load_mission("fleet-6.yaml", text=yaml.safe_dump(asked)))
    told = summary_of(done)
    arrivals = [v["arrive_s"] for v in told["vehicles"]]
    assert np.diff(arrivals) == pytest.approx([5.0] * 5, abs=1e-3)
    assert told["fleet"]["min_separation_m"] >= 30.0
    assert all(v["safe"] is True for v in told["vehicles"])


def test_bad_arrivals_are_input_errors() -> None:
    with pytest.raises(InputError, match="interval_s"):
        planned({"mode": "sequence"})


@pytest.mark.first_quick
@pytest.mark.parametrize(("lean_deg", "slower"), [(45, 0), (30, 2)])
def test_copters_give_up_speed_only_where_a_declared_wind_changes_a_time(lean_deg: int, slower: int) -> None:
    lean = {"lean_angle_deg": lean_deg}
    done = planned(sequence(20), lean, lean, wind={"up_to_m_s": 4})
    codes = [n.code for n in done.notes]
    assert codes.count("speed_kept_in_wind") == slower
    assert "schedule_in_every_wind" in codes
    widths = [np.diff(v.verdict.leg_windows_s() or ((0.0, math.inf),)).max() for v in done.vehicles]
    assert max(widths) < 1e-6
    assert [round(one["least_s"], 3) for one in summary_of(done)["fleet"]["intervals"]] == [20.0]


@pytest.mark.nightly
def test_a_fleet_that_asks_for_no_arrival_is_timed_in_still_air() -> None:
    done = planned(None, {"lean_angle_deg": 30}, {"lean_angle_deg": 30}, wind={"up_to_m_s": 4})
    assert "schedule_in_still_air" in [n.code for n in done.notes]
    assert summary_of(done)["fleet"]["in_every_wind"] is False


def test_departures_alone_say_nothing_of_declared_winds() -> None:
    late = {"depart_window_s": 20}
    done = planned(sequence(20, window_s=20), late, late)
    assert all(v.verdict.in_wind is not None for v in done.vehicles)  # which has the windows
    assert not [n.code for n in done.notes if n.code.startswith("schedule_")]
    fleet = summary_of(done)["fleet"]
    assert "in_every_wind" not in fleet
    assert [(round(one["least_s"], 3), round(one["most_s"], 3)) for one in fleet["intervals"]] == [(0.0, 40.0)]


@pytest.mark.slow
def test_a_window_narrower_than_the_departures_is_refused_with_what_works() -> None:
    late = {"depart_window_s": 20}
    with pytest.raises(NoMission, match=r"departures up to 20 s late .* arrives 0\.0 to 40\.0 s after") as refused:
        planned(sequence(20, window_s=10), late, late)
    assert "what works: window_s: 20" in str(refused.value)
    assert "depart_window_s: 10 at most" in str(refused.value)


@pytest.mark.nightly
def test_drawn_late_departures_keep_a_sequence_that_counts_them() -> None:
    done = planned(sequence(40, window_s=15), {"depart_window_s": 20}, {"depart_window_s": 5}, wind={"up_to_m_s": 4})
    assert [round(one["most_s"] - one["least_s"], 3) for one in summary_of(done)["fleet"]["intervals"]] == [25.0]
    flown = rehearse(done, weather=weather_of(done.source, None, None, 0.0, 0.0), runs=30, seed=1)
    assert flown.order_kept_runs == flown.intervals_kept_runs == flown.separation_kept_runs == 30
