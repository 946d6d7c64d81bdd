"""An ArduCopter's lean angle bounds its speed: in the plan, in what the plan says, and before an upload."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from gcsplan import upload
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of
from gcsplan.app.plan.model import Plan
from gcsplan.app.upload.job import JobResult, UploadJob
from gcsplan.app.upload.on_board import judge_on_board
from gcsplan.errors import InputError
from gcsplan.mavlink.link.session.parameters import judge_parameters, lean_shortage
from gcsplan.mavlink.mission.parameter_list import parameter_list
from gcsplan.mission_file import load_mission
from gcsplan.sim.sitl.instances import parameters_of
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot, Vehicle, lean_for_deg
from tests.support.impatient import be_impatient
from tests.support.paths import MISSIONS

START = [36.6175, -84.3892]
BOTH = ("ATC_ANGLE_MAX 45 (degrees, since ArduPilot 4.7)", "ANGLE_MAX 4500 (hundredths of a degree, before)")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


def text_of(**vehicle: Any) -> str:
    keys = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": START, "goal": [36.6230, -84.3860]}
    return yaml.safe_dump(
        {
            "version": 1, "name": "fast", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
            "limits": {"min_agl_m": 60, "horizontal_clearance_m": 30, "track_error_m": 3, "altitude_error_m": 5,
                       "max_climb_deg": 15},
            "vehicles": [keys | {"speed_m_s": [3, 15]} | vehicle],
        }
    )  # fmt: skip


@cache
def _planned(text: str) -> Plan:
    return plan(load_mission("fast.yaml", text=text))


def planned(**vehicle: Any) -> Plan:
    return _planned(text_of(**vehicle))


def said(done: Plan) -> str:
    summary = json.loads(outputs_of(done)["summary.json"])
    return "\n".join([*summary["notes"], *summary["vehicles"][0]["notes"]])


def commanded(done: Plan) -> list[float]:
    """The speeds on the wire."""
    return [item.params[1] for item in done.vehicles[0].mission.items if item.command == 178]


@pytest.mark.slow
def test_without_a_lean_angle_a_copter_is_planned_at_what_the_default_allows() -> None:
    done = planned()
    assert commanded(done) == [10.0]
    assert done.vehicles[0].speed_m_s == 10.0
    assert "planned with 10 m/s, not 15" in said(done)
    assert "write lean_angle_deg: 45" in said(done)
    page = report_of(done)
    for words in BOTH:
        assert words in said(done)
        assert words in page
    assert "needs a lean" not in said(done)  # what is flown needs no more than the default
    slow = planned(speed_m_s=[3, 10])
    assert commanded(slow) == [10.0]
    assert "lean" not in said(slow)


def test_a_slowest_speed_above_what_the_default_allows_is_no_reason_to_refuse() -> None:
    done = planned(speed_m_s=[12, 15])
    assert commanded(done) == [10.0]
    assert done.vehicles[0].request.vehicle.speed_min_m_s == 10.0


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize(("lean_deg", "speed_m_s"), [(45, 15.0), (80, 15.0), (36, 12.0), (10, 10.0 / 3.0)])
def test_a_lean_angle_of_the_file_bounds_the_speed(lean_deg: float, speed_m_s: float) -> None:
    done = planned(lean_angle_deg=lean_deg)
    assert commanded(done) == [pytest.approx(speed_m_s, rel=1e-6)]
    assert ("planned with" in said(done)) == (speed_m_s < 15.0)
    assert ("needs a lean of about" in said(done)) == (speed_m_s > 10.0)
    if speed_m_s == 15.0:
        page = report_of(done)
        assert all(words in said(done) and words in page for words in BOTH)


def test_a_plane_has_no_such_key() -> None:
    assert load_mission(text=text_of(autopilot="arduplane")).vehicles[0].vehicle.speed_max_m_s == 15.0
    with pytest.raises(InputError, match=r"vehicles\[0\].lean_angle_deg: is a multicopter's alone"):
        load_mission(text=text_of(autopilot="arduplane", lean_angle_deg=45))


def px4(wind: dict[str, float] | None = None, **keys: Any) -> Vehicle:
    mission = yaml.safe_load(text_of(autopilot="px4", **keys)) | ({"wind": wind} if wind else {})
    vehicle = load_mission(text=yaml.safe_dump(mission)).vehicles[0].vehicle
    assert vehicle is not None
    return vehicle


def test_the_largest_lean_of_a_px4_bounds_its_speed_where_it_is_given() -> None:
    assert px4().speed_max_m_s == 12.0  # MPC_XY_VEL_MAX
    assert px4().lean_angle_deg is None
    assert px4(lean_angle_deg=20).speed_max_m_s == pytest.approx(20.0 / 3.0)


@pytest.mark.parametrize(("keys", "wind", "least_deg"), [
    ({}, None, None), ({}, {"up_to_m_s": 5.0}, 45.0), ({"lean_angle_deg": 36}, None, 36.0),
])  # fmt: skip
def test_what_a_px4_leans_stands_in_the_list_of_its_parameters(
    keys: dict[str, float], wind: dict[str, float] | None, least_deg: float | None
) -> None:
    vehicle = px4(wind, **keys)
    listed = {s.parameter.names[0].name: s.value for s in parameter_list(planned().vehicles[0].mission, vehicle)}
    assert listed.get("MPC_TILTMAX_AIR") == least_deg


@pytest.mark.parametrize("lean_deg", [9.9, 80.1, "45", True])
def test_a_lean_angle_that_arducopter_does_not_take_is_a_mistake(lean_deg: object) -> None:
    with pytest.raises(InputError, match="lean_angle_deg"):
        load_mission(text=text_of(lean_angle_deg=lean_deg))


@pytest.mark.slow
def test_the_shipped_missions_lean_as_far_as_their_speeds_need() -> None:
    for file in MISSIONS.glob("*.yaml"):
        wanted = {v["name"]: v["speed_m_s"][1] for v in yaml.safe_load(file.read_text())["vehicles"]}
        source = load_mission(file)
        assert {r.vehicle.name: r.vehicle.speed_max_m_s for r in source.vehicles} == wanted
        assert not any("bounds_speed" in note.code for note in source.notes)


# -- before an upload ---------------------------------------------------------------------------------------------


def uploaded(done: Plan, parameters: Mapping[str, float]) -> JobResult:
    v = done.vehicles[0]
    board = LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=START[0], lon_deg=START[1], amsl_m=v.mission.home.amsl_m,
        parameters=parameters,
    )  # fmt: skip
    with SimServer([board], "udpin:127.0.0.1:0") as server:
        [result] = upload(done, server.url_for_gcs)
    assert bool(board.items()) == (result.outcome == "accepted")
    return result


@pytest.mark.slow
def test_a_vehicle_that_leans_less_than_the_plan_needs_is_refused_and_gets_nothing() -> None:
    done = planned(lean_angle_deg=45)
    refused = uploaded(done, {})
    assert (refused.verified, refused.reason) == (False, "parameters")
    assert "ANGLE_MAX is 3000 on board" in refused.message
    assert "set ANGLE_MAX 4500, or plan with lean_angle_deg: 30" in refused.message
    assert uploaded(done, {"ANGLE_MAX": 4500.0}).verified
    assert uploaded(planned(lean_angle_deg=45, speed_m_s=[3, 10]), {}).verified  # it needs less than the file allows
    assert not uploaded(planned(), {"ANGLE_MAX": 2500.0}).verified


@pytest.mark.slow
def test_simulated_vehicles_lean_as_far_as_their_missions_need() -> None:
    [result] = upload(planned(lean_angle_deg=45), "sim")
    assert result.verified
    [flown] = planned(lean_angle_deg=60).vehicles
    vehicle, mission = flown.request.vehicle, flown.mission
    assert parameters_of(SimpleNamespace(vehicle=vehicle, mission=mission, rtl_rel_home_m=None))["ANGLE_MAX"] == 6000.0  # type: ignore[arg-type]
    leans = replace(vehicle, lean_angle_deg=30.0)  # no more than it was planned with
    assert parameters_of(SimpleNamespace(vehicle=leans, mission=mission, rtl_rel_home_m=None))["ANGLE_MAX"] == 3000.0  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"ATC_ANGLE_MAX": 30.0}, "ATC_ANGLE_MAX is 30 on board: it leans by 30° at most, which allows about 10.0 m/s"),
        ({"ATC_ANGLE_MAX": 44.0}, "set ATC_ANGLE_MAX 45, or plan with lean_angle_deg: 44"),
        ({"ANGLE_MAX": 4400.0}, "set ANGLE_MAX 4500, or plan with lean_angle_deg: 44"),
        ({"ATC_ANGLE_MAX": 45.0}, ""), ({"ANGLE_MAX": 4500.0}, ""), ({"ANGLE_MAX": 8000.0}, ""),
        ({}, ""), ({"ANGLE_MAX": float("nan")}, ""),
    ],
)  # fmt: skip
def test_the_parameter_is_named_and_scaled_as_the_vehicles_version_does(values: dict[str, float], words: str) -> None:
    short = lean_shortage(values, 15.0)
    found = str(short or "")
    assert words in found
    assert bool(words) == bool(found)
    done = planned(lean_angle_deg=45)
    v = done.vehicles[0]
    job = UploadJob("uav1", "sim", v.mission, v.verdict, v.request.vehicle, done.world)
    again = judge_on_board(job, allow_unjudged=False)
    assert again is not None
    assert again(v.mission, values) == short


def test_what_could_not_be_read_is_told() -> None:
    fast, slow = planned(lean_angle_deg=45).vehicles[0].mission, planned().vehicles[0].mission
    words = "the largest lean angle on board could not be read: 15.0 m/s need about 45°"
    assert words in map(str, judge_parameters({"RTL_ALT": 1500.0}, fast))
    assert not any("lean" in note.code for note in judge_parameters({"RTL_ALT": 1500.0}, slow))
    assert lean_for_deg(15.0) == 45.0
