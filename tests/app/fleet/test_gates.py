"""Gates on the way: seconds of the day that are proved to be after every arrival there, and what they buy."""

from __future__ import annotations

import random
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from gcsplan import Plan, check, plan, upload
from gcsplan.app.check.files import check_files
from gcsplan.app.output.files import summary_of
from gcsplan.app.rehearse import rehearse, weather_of
from gcsplan.app.upload.run import jobs_of_files
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, NoMission, UsageError
from gcsplan.mavlink.files.waypoints_file import write_waypoints
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mission_file import load_mission
from tests.app.fleet.test_every_wind import (
    SEPARATION_M,
    WITHIN_M,
    WITHIN_S,
    assert_held,
    drawn_tracks,
    fan,
    some_shares,
)
from tests.oracles.fleet_wind import least_m
from tests.oracles.wind import Winds

START = datetime(2026, 3, 1, 23, 59, 0, tzinfo=UTC)
UP_TO = {"up_to_m_s": 4}


def lane(gates: Any, wind: dict[str, Any] | None = None, count: int = 1, **more: Any) -> dict[str, Any]:
    """A mission of copters side by side, 2 km straight ahead; too slow a lean to keep their speed in a wind."""
    vehicles = [
        {
            "name": f"c{k + 1}", "sysid": k + 1, "autopilot": "arducopter", "speed_m_s": [7, 8], "lean_angle_deg": 25,
            "start": {"east_m": 0, "north_m": 200 * k}, "goal": {"east_m": 2000, "north_m": 200 * k},
        } | more
        for k in range(count)
    ]  # fmt: skip
    arrival = {"mode": "sequence", "interval_s": 60, "window_s": 30, "separation_m": SEPARATION_M, "gates": gates}
    return {
        "version": 1, "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
        "limits": {"min_agl_m": 60}, "vehicles": vehicles, "arrival": arrival,
    } | ({} if wind is None else {"wind": wind})  # fmt: skip


def planned(*args: Any, **more: Any) -> Plan:
    return plan(lane(*args, **more), gate_utc=START)


@pytest.mark.slow
def test_the_common_start_may_be_the_missions_own_time_of_day_but_no_day() -> None:
    mission = lane([{"east_m": 700, "north_m": 30}])
    stated = plan(mission | {"at": f"{START:%Y-%m-%dT%H:%M:%SZ}"})
    [one], [other] = stated.vehicles, plan(mission, gate_utc=START).vehicles
    assert one.mission.wire_items() == other.mission.wire_items()
    assert stated.fleet is not None
    assert stated.fleet.start_utc == START
    with pytest.raises(UsageError, match="the common start: the start is past"):  # whoever planned it, and how
        upload(stated, to="sim")
    with pytest.raises(InputError, match=r"arrival.gates: .*give the common start as the mission's `at`"):
        plan(mission | {"at": f"{START:%Y-%m-%d}"})


@pytest.mark.slow
def test_a_gate_is_a_wait_until_a_second_of_the_day_behind_its_way_point() -> None:
    done = planned([{"east_m": 700, "north_m": 30}])
    [v] = done.vehicles
    commands = [item.command for item in v.mission.items]
    at = commands.index(cmd.DELAY)
    assert commands[at - 1] == cmd.WAYPOINT
    assert commands.count(cmd.DELAY) == 1
    [gate] = summary_of(done)["vehicles"][0]["gates"]
    # 700 m at 8 m/s, and some seconds of take-off: it is there a moment before a whole second of the next day.
    assert v.mission.items[at].params[:2] == (-1.0, 0.0)
    assert 60.0 * v.mission.items[at].params[2] + v.mission.items[at].params[3] == gate["opens_s"] - 60.0
    assert gate["earliest_s"] == pytest.approx(gate["opens_s"] - gate["wait_s"])
    assert 0.5 <= gate["wait_s"] <= 3.0
    assert v.verdict.safe is True


@pytest.mark.parametrize(
    ("gates", "vehicle", "words"),
    [
        (2, {"autopilot": "px4", "lean_angle_deg": None}, "px4 reads only the seconds"),
        (40, {}, "20"),
        (12, {}, "room for 9 gates"),
        ([{"east_m": 700, "north_m": 300}], {}, "no vehicle passes"),
        ("some", {}, "must be auto, a number of gates"),
    ],
)
def test_gates_that_no_vehicle_has_are_refused(gates: Any, vehicle: dict[str, Any], words: str) -> None:
    with pytest.raises((InputError, NoMission), match=words):
        planned(gates, **vehicle)


def test_gates_need_a_common_start() -> None:
    with pytest.raises(InputError, match="--gate-utc"):
        plan(lane(1))


@pytest.mark.slow
def test_a_vehicle_that_may_come_after_its_gates_second_breaks_a_limit() -> None:
    done = planned(1, UP_TO)
    [v] = done.vehicles
    [gate] = summary_of(done)["vehicles"][0]["gates"]
    spare_s = gate["opens_s"] - gate["latest_s"]
    wind = done.source.flight_wind(v.request)
    leaves_s = v.mission.leaves_s
    assert leaves_s is not None
    kinds = {}
    for late_s in (0.0, spare_s + 0.1):
        mission = replace(v.mission, leaves_s=leaves_s + late_s)
        found = judge(mission, v.request.vehicle, done.world, wind=wind)
        kinds[late_s > 0.0] = [f.kind for f in found.findings]
    assert kinds == {False: [], True: ["gate"]}
    unknown = judge(replace(v.mission, leaves_s=None), v.request.vehicle, done.world, wind=wind)
    assert [note.code for note in unknown.not_judged] == ["waits_until_time"]


@pytest.mark.nightly
def test_a_file_with_gates_is_judged_for_its_departure_or_names_the_latest() -> None:
    [v] = planned(2, UP_TO).vehicles
    file, mission = replace(v.mission, leaves_s=None), {k: x for k, x in lane(None, UP_TO).items() if k != "arrival"}
    [gate, later] = [item for item in file.items if item.until_s is not None]

    def at(departure: datetime) -> Verdict:
        return check(file, mission | {"at": f"{departure:%Y-%m-%dT%H:%M:%SZ}"})

    [why] = check(file, mission).not_judged
    assert (why.code, why.data["opens"]) == ("gate_departure_unknown", "00:02:41")
    latest = datetime.strptime(f"2026-03-01 {why.data['leaves']}Z", "%Y-%m-%d %H:%M:%S%z")
    assert latest == START  # as the plan counts it
    assert [at(latest + timedelta(seconds=s)).safe for s in (-3600, 0, 3, 3600)] == [True, True, False, False]
    assert [n.data["leaves"] for n in at(latest).notes if n.code == "gates_since_departure"] == [why.data["leaves"]]
    other = mission["vehicles"][0] | {"name": "c2", "sysid": 2}
    fleet = {"at": f"{START:%Y-%m-%dT%H:%M:%SZ}", "vehicles": [*mission["vehicles"], other]}
    for open_departure in ({"at": f"{START:%Y-%m-%d}"}, fleet):
        assert [n.code for n in check(file, mission | open_departure).not_judged] == ["gate_departure_unknown"]
    sooner = replace(later, params=gate.params)
    early = replace(file, items=tuple(sooner if item is later else item for item in file.items))
    assert [finding.kind for finding in check(early, mission).findings] == ["gate"]  # whenever it leaves


@pytest.mark.nightly
def test_a_file_with_gates_is_uploaded_for_a_departure_that_is_ahead(tmp_path: Path) -> None:
    [v] = planned(1, UP_TO).vehicles
    (tmp_path / "c1.waypoints").write_text(write_waypoints(v.mission))
    mission = {k: x for k, x in lane(None, UP_TO).items() if k != "arrival"}
    source = load_mission(mission | {"at": f"{START:%Y-%m-%dT%H:%M:%SZ}"})
    checked = check_files(source, [str(tmp_path / "c1.waypoints")])
    assert [c.verdict.safe for c in checked] == [True]
    with pytest.raises(UsageError, match="at: the start is past"):
        jobs_of_files(source, checked, "udpout:127.0.0.1:14550")


@pytest.mark.slow
def test_behind_a_gate_the_window_begins_anew() -> None:
    widths = []
    for gates in (None, 3):
        verdict = planned(gates, UP_TO).vehicles[0].verdict
        earliest_s, latest_s = verdict.arrive_window_s() or (0.0, 0.0)
        widths.append(latest_s - earliest_s)
    assert widths[1] == pytest.approx(0.025 * widths[0], rel=0.02)  # the last 50 m of 2 km


@pytest.mark.slow
def test_the_energy_of_a_wait_is_of_the_earliest_arrival() -> None:
    energy = {"hover_w": 100, "battery_j": 1e7}
    done = planned(1, UP_TO, energy=energy)
    [gate] = summary_of(done)["vehicles"][0]["gates"]
    power_w = done.vehicles[0].request.vehicle.energy.hold_w(4.0)
    assert gate["energy_j"] == pytest.approx(power_w * (gate["opens_s"] - gate["earliest_s"]), rel=1e-3)
    [note] = [n for n in done.vehicles[0].notes if n.code == "waits_at_gates"]
    assert f"{gate['energy_j']:.0f} J" in str(note)


@pytest.mark.nightly
def test_the_least_number_of_gates_keeps_a_sequence_in_each_wind() -> None:
    done = planned("auto", UP_TO, 2)
    counts = [len(row["gates"]) for row in summary_of(done)["vehicles"]]
    assert counts == [1, 1]
    assert_held(done, Winds([[(0.0, 4.0)]], [[(0.0, 360.0)]]), some_shares(3, 5), 31.0, 60.0)
    with pytest.raises(NoMission, match="gates: 1 with a common start"):
        plan(lane(None, UP_TO, 2))


@pytest.mark.nightly
def test_a_rehearsed_vehicle_waits_at_its_gate_and_a_late_one_until_the_next_day() -> None:
    done = planned(1, UP_TO)
    weather = weather_of(done.source, None, None, 0.0, 0.0)
    flown_on_time = rehearse(done, weather=weather, runs=4, seed=2)
    assert flown_on_time.inside_windows == (4, 4)
    late = rehearse(done, weather=weather, runs=1, seed=2, late_s={"c1": 600.0})
    assert [breach.kind for breach in late.breaches if breach.kind == "arrival"] == ["arrival"]


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(8))
def test_no_wind_that_is_drawn_breaks_a_fleet_with_gates(seed: int) -> None:
    rng = random.Random(seed)
    low, from_deg, varying = rng.uniform(0.0, 3.0), rng.uniform(0.0, 360.0), rng.random() < 0.3
    high, turn_deg = low + rng.choice([0.5, 2.0]), rng.choice([10.0, 60.0, 180.0])
    wind = {"speed_m_s": [low, high], "from_deg": [from_deg, (from_deg + turn_deg) % 360.0], "varying": varying}
    window_s = rng.choice([5.0, 20.0, 40.0])
    arrival: dict[str, Any] = {
        "mode": "sequence", "interval_s": rng.choice([60, 120]), "window_s": window_s,
        "gates": rng.choice([1, 2, "auto"]),
    }  # fmt: skip
    kinds = "c" + "".join(rng.choice("ccw") for _ in range(rng.randint(1, 3)))
    document = fan(kinds, wind, arrival)
    for vehicle in document["vehicles"]:
        if vehicle["autopilot"] == "arducopter":
            vehicle |= {"speed_m_s": [7.5, 8], "lean_angle_deg": 25}
    try:
        done = plan(document, gate_utc=START)
    except NoMission as why:
        assert "in the declared winds" in str(why) or "needed" in str(why)  # noqa: PT017 - what refuses is not wrong
        return
    assert done.fleet is not None
    winds = Winds([[(low, high)]], [[(from_deg, from_deg + turn_deg)]])
    for _ in range(12):
        tracks = drawn_tracks(done, winds, rng, varying=varying)
        for found in done.fleet.intervals:
            apart_s = tracks[found.second].arrive_s - tracks[found.first].arrive_s
            assert found.least_s - WITHIN_S <= apart_s <= found.most_s + WITHIN_S
            assert abs(apart_s - arrival["interval_s"]) <= window_s + 1.0 + WITHIN_S
        assert least_m(list(tracks.values())) >= SEPARATION_M - WITHIN_M


@pytest.mark.nightly
def test_gates_come_before_vehicles_are_left_out() -> None:
    mission = lane("auto", {"up_to_m_s": 4}, 3)
    mission["arrival"] |= {"leave_out": True, "window_s": 12}
    ends = {"start": {"east_m": -2000, "north_m": 900}, "goal": {"east_m": 5000, "north_m": 900}, "end": "loiter"}
    wing = {"autopilot": "arduplane", "turn_radius_m": 90, "speed_m_s": [16, 20], "lean_angle_deg": None}
    mission["vehicles"][2] |= ends | wing
    done = plan(mission, gate_utc=START)
    assert [one.name for one in done.left_out] == ["c3"]
    assert [len(v.order.gates.at_m) for v in done.vehicles if v.order.gates is not None] == [1, 1]
    assert done.fleet is not None
    assert done.fleet.in_every_wind is True
