"""Parameters on board are part of the proof: what is assumed is listed, and what differs is judged again or refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from gcsplan import upload
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import parameters_of, parts_of, terms_of
from gcsplan.app.rehearse import rehearse as fly_plan
from gcsplan.app.upload.job import FleetOnBoard, JobResult
from gcsplan.app.upload.run import verify_file
from gcsplan.check.judge import judge
from gcsplan.errors import InputError, UsageError
from gcsplan.fleet.motion.ardupilot import lean_needed_deg
from gcsplan.mission_file import load_mission
from gcsplan.sim.rehearsal import rehearse
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.impatient import be_impatient
from tests.support.noted import one

LAT, LON = 46.5, 8.0


def keys(**more: Any) -> dict[str, Any]:
    return {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [LAT, LON], "goal": [LAT + 0.02, LON],
        "speed_m_s": [3, 10], "takeoff_agl_m": 60,
    } | more  # fmt: skip


def text_of(*vehicles: dict[str, Any], **more: Any) -> str:
    given = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 40, "track_error_m": 3,
             "altitude_error_m": 5, "horizontal_clearance_m": 0}, "vehicles": list(vehicles)}  # fmt: skip
    return yaml.safe_dump(given | more)


@cache
def _planned(text: str) -> Plan:
    return plan(load_mission("m.yaml", text=text))


def planned(*vehicles: dict[str, Any], **more: Any) -> Plan:
    return _planned(text_of(*(vehicles or (keys(),)), **more))


def board(autopilot: str = "arducopter", misbehave: Misbehaviour | None = None, **parameters: float) -> LoopbackVehicle:
    return LoopbackVehicle(
        1, Autopilot(autopilot), lat_deg=LAT, lon_deg=LON, amsl_m=100.0, parameters=parameters, misbehave=misbehave
    )


def sent(done: Plan, to: LoopbackVehicle, **options: Any) -> JobResult:
    with SimServer([to], "udpin:127.0.0.1:0") as server:
        [result] = upload(done, server.url_for_gcs, **options)
    assert bool(to.items()) == (result.outcome == "accepted"), result.message
    return result


@pytest.fixture(autouse=True)
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


WING = {"autopilot": "arduplane", "turn_radius_m": 100, "speed_m_s": [20, 20], "takeoff_agl_m": 80, "end": "loiter"}
CRUISE = {"AIRSPEED_CRUISE": 20.0}
CORNER = {"via": [[LAT + 0.01, LON + 0.01445]]}
ZONE = [{"name": "inside the corner", "center": [LAT + 0.01, LON + 0.01445 - 40.0 / 76_700.0], "radius_m": 20}]
RTL = {"end": "rtl", "rtl_rel_home_m": 60}


# -- silence is no default -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vehicle", "parameters", "name", "way_home"),
    [
        ({"autopilot": "px4"}, {"RTL_TYPE": 1, "RTL_RETURN_ALT": 60}, "RTL_TYPE", "required"),
        (CORNER, {"WPNAV_RADIUS": 3000}, "WPNAV_RADIUS", "reported"),
    ],
)
def test_what_was_not_answered_is_no_default(
    vehicle: dict[str, Any], parameters: dict[str, float], name: str, way_home: str
) -> None:
    done = planned(keys(rtl_rel_home_m=60, **vehicle), way_home=way_home, no_fly=ZONE)
    autopilot = vehicle.get("autopilot", "arducopter")
    never = sent(done, board(autopilot, Misbehaviour(mute=name), **parameters), timeout_s=0.6)
    assert (never.outcome, never.code, never.reason) == ("refused", 5, "parameters")
    assert f"{name} " in never.message
    assert "could not be read from the vehicle" in never.message
    lost = sent(done, board(autopilot, Misbehaviour(mute=name, mute_times=2), **parameters), timeout_s=20.0)
    assert (lost.outcome, lost.code) == ("refused", 5)  # read in the end
    assert "could not be read" not in lost.message
    assert ("inside no-fly zone" if name == "WPNAV_RADIUS" else f"{name} is {parameters[name]:g} on") in lost.message


@pytest.mark.slow
def test_a_value_that_comes_late_is_as_good(tmp_path: Any) -> None:
    done = planned()
    assert sent(done, board(misbehave=Misbehaviour(mute="WPNAV_ACCEL", mute_times=2)), timeout_s=20.0).verified


def test_verify_does_not_take_silence_for_a_default(tmp_path: Any) -> None:
    done = planned()
    (tmp_path / "uav1.plan").write_text(outputs_of(done)["uav1.plan"], encoding="utf-8")
    (tmp_path / "m.yaml").write_text(text_of(keys()), encoding="utf-8")
    vehicle = board(misbehave=Misbehaviour(mute="WPNAV_RADIUS"), WPNAV_RADIUS=3000)
    vehicle.load(done.vehicles[0].mission.wire_items())
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server:
        source = load_mission(tmp_path / "m.yaml")
        found = verify_file(str(tmp_path / "uav1.plan"), server.url_for_gcs, source=source, timeout_s=0.6)
    assert found.code == 4
    assert "WPNAV_RADIUS or WP_RADIUS_M could not be read" in found.message


# -- what differs is judged again ------------------------------------------------------------------------------------


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("vehicle", "parameters", "words"),
    [
        ({}, {"WPNAV_SPEED_UP": 60}, "WPNAV_SPEED_UP is 60 on board, and 250 is assumed"),
        ({}, {"LAND_SPEED": 30}, "LAND_SPEED is 30 on board"),
        ({"via": [[LAT + 0.01, LON + 0.0001 * i] for i in (0, 40)]}, {"WPNAV_ACCEL": 60}, "WPNAV_ACCEL is 60"),
        (RTL, {"RTL_SPEED": 500}, "RTL_SPEED is 500 on board, and 1000 is assumed (the speed of the return)"),
        (RTL, {"WPNAV_SPEED": 500}, "instead of"),
        ({"speed_m_s": [14, 14], "lean_angle_deg": 55}, {"ANGLE_MAX": 4200}, "ANGLE_MAX is 4200 on board"),
        ({"autopilot": "px4"}, {"MPC_Z_V_AUTO_UP": 1.0}, "MPC_Z_V_AUTO_UP is 1 on board"),
        ({"autopilot": "px4"} | RTL, {"MPC_XY_CRUISE": 3.0}, "MPC_XY_CRUISE is 3 on board"),
    ],
)  # fmt: skip
def test_a_flight_that_takes_another_time_is_refused_or_allowed(
    vehicle: dict[str, Any], parameters: Mapping[str, float], words: str
) -> None:
    done = planned(keys(**vehicle))
    autopilot = vehicle.get("autopilot", "arducopter")
    own = {"ANGLE_MAX": 5500.0} if "lean_angle_deg" in vehicle else {}
    assert sent(done, board(autopilot, **own)).verified
    refused = sent(done, board(autopilot, **(own | parameters)))
    assert (refused.outcome, refused.code, refused.reason) == ("refused", 5, "parameters")
    told = refused.as_dict()
    assert told["failed_check_data"]["code"] == "flight_takes_otherwise"
    assert told["message"].endswith(told["failed_check"])
    assert words in refused.message
    assert "the flight takes" in refused.message
    allowed = sent(done, board(autopilot, **(own | parameters)), allow_parameters=True)
    assert allowed.verified


@pytest.mark.parametrize(
    ("vehicle", "parameters", "words"),
    [
        ({}, {"LAND_SPEED_HIGH": 50}, "LAND_SPEED_HIGH is 50 on board, and 0 or 150 is assumed"),
        ({}, {"LAND_ALT_LOW": 5000}, "LAND_ALT_LOW is 5000 on board, and 1000 is assumed"),
        ({"autopilot": "px4"}, {"MPC_TKO_SPEED": 5}, "MPC_TKO_SPEED is 5 on board, and 1.5 is assumed"),
        ({"autopilot": "px4"}, {"MPC_LAND_ALT2": 40}, "MPC_LAND_ALT2 is 40 on board"),
    ],
)
def test_a_pace_that_cannot_be_counted_is_refused_or_allowed(
    vehicle: dict[str, Any], parameters: Mapping[str, float], words: str
) -> None:
    done, autopilot = planned(keys(**vehicle)), vehicle.get("autopilot", "arducopter")
    refused = sent(done, board(autopilot, **parameters))
    assert (refused.outcome, refused.reason) == ("refused", "parameters")
    assert words in refused.message
    assert "--allow-parameters" in refused.message
    allowed = sent(done, board(autopilot, **parameters), allow_parameters=True)
    assert allowed.verified
    assert any(words in str(line) for line in allowed.warnings)


@pytest.mark.parametrize("parameters", [{"WPNAV_SPEED_UP": -250}, {"WPNAV_ACCEL": 0}])
def test_a_number_that_no_vehicle_flies_is_not_passed_over(parameters: Mapping[str, float]) -> None:
    refused = sent(planned(), board(**parameters))
    assert (refused.outcome, refused.reason) == ("refused", "parameters")


@pytest.mark.slow
def test_a_px4_that_does_not_land_after_its_return_is_told() -> None:
    result = sent(planned(keys(autopilot="px4", **RTL)), board("px4", RTL_RETURN_ALT=60, RTL_LAND_DELAY=-1))
    assert any("RTL_LAND_DELAY is -1 on board: a return ends in a hover" in str(line) for line in result.warnings)


@pytest.mark.slow
def test_a_speed_that_an_interrupted_mission_goes_on_at_is_told() -> None:
    result = sent(planned(keys(speed_m_s=[5, 5])), board())
    assert result.verified
    assert any("WPNAV_SPEED is 1000 on board, and 500 is assumed" in str(line) for line in result.warnings)
    assert not any("is assumed" in str(line) for line in sent(planned(), board()).warnings)


# -- what cannot be judged is refused --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"ROLL_LIMIT_DEG": 15.0}, "ROLL_LIMIT_DEG is 15 on board, and at least"),
        ({"AIRSPEED_MAX": 17.0}, "AIRSPEED_MAX is 17 on board, and at least 20 is assumed"),
    ],
)
def test_a_wing_that_cannot_fly_its_turns_or_its_speed_is_refused(parameters: dict[str, float], words: str) -> None:
    done = planned(keys(**WING))
    assert sent(done, board("arduplane", **CRUISE)).verified
    refused = sent(done, board("arduplane", **(CRUISE | parameters)), allow_parameters=True)
    assert (refused.outcome, refused.reason) == ("refused", "parameters")
    assert words in refused.message


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "Q_ENABLE is 0 on board, and 1 is assumed"),
        ({"Q_ENABLE": 2.0}, "Q_ENABLE is 2 on board, and 1 is assumed"),
        ({"Q_ENABLE": 1.0, "Q_TRANS_DECEL": 1.0}, "Q_TRANS_DECEL is 1 on board, and at least 2 is assumed"),
    ],
)
def test_a_vtols_mission_goes_to_no_plane_that_flies_it_otherwise(parameters: dict[str, float], words: str) -> None:
    done = planned(keys(**(WING | {"turn_radius_m": 0, "end": "land"})))
    assert sent(done, board("arduplane", **CRUISE, Q_ENABLE=1.0)).verified
    refused = sent(done, board("arduplane", **CRUISE, **parameters), allow_parameters=True)
    assert (refused.outcome, refused.reason) == ("refused", "parameters")
    assert words in refused.message


def test_a_wings_mission_goes_to_no_plane_with_lift_motors(tmp_path: Any) -> None:
    """It would take off and land on them (quadplane.cpp, `is_vtol_takeoff`); a small board does not know Q_ENABLE."""
    done = planned(keys(**WING))
    refused = sent(done, board("arduplane", **CRUISE, Q_ENABLE=1.0), allow_parameters=True)
    assert (refused.outcome, refused.reason) == ("refused", "parameters")
    assert "Q_ENABLE is 1 on board, and 0 is assumed" in refused.message
    assert sent(done, board("arduplane", Misbehaviour(mute="Q_ENABLE"), **CRUISE), timeout_s=0.6).verified


@pytest.mark.first_quick
@pytest.mark.parametrize(
    "parameters", [{"RTL_ALT_TYPE": 1}, {"WPNAV_ACCEL": 50}, {"RTL_CLIMB_MIN": 5000}, {"RTL_CONE_SLOPE": 1.0}]
)
def test_a_required_return_is_the_one_that_was_judged(parameters: dict[str, float]) -> None:
    own = {"RTL_ALT": 6000.0}
    required = planned(keys(rtl_rel_home_m=60), way_home="required")
    assert sent(required, board(**own)).verified
    assert sent(required, board(**own, RTL_CONE_SLOPE=0.0)).verified
    refused = sent(required, board(**(own | parameters)))
    assert (refused.outcome, refused.reason) == ("refused", "parameters")
    assert next(iter(parameters)) in refused.message


@pytest.mark.slow
def test_a_required_return_that_runs_on_farther_is_judged_so_where_that_is_allowed() -> None:
    required = planned(keys(rtl_rel_home_m=60), way_home="required")
    assert sent(required, board(RTL_ALT=6000, WPNAV_ACCEL=150), allow_parameters=True).verified


# -- returns at the autopilot's own speed ----------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_return_is_timed_at_the_speed_that_arducopter_flies() -> None:
    for speed in (5, 15):
        done = planned(keys(speed_m_s=[speed, speed], lean_angle_deg=55, **RTL))
        [v] = done.vehicles
        back = [leg for leg in v.verdict.legs if leg.kind == "rtl" and leg.horizontal_m > 100.0]
        assert [round(leg.length_m / leg.time_s) for leg in back] == [10]
        motion = done.fleet.motion("uav1") if done.fleet is not None else None
        assert motion is not None
        assert motion.end_s == pytest.approx(v.verdict.time_s, abs=0.5)
        [flown] = rehearse(parts_of(done), done.world, terms_of(done)).vehicles
        assert flown.as_dict()["end_s"] == pytest.approx(motion.end_s, abs=2.0)


def test_a_wing_returns_at_its_cruise_airspeed() -> None:
    done = planned(keys(**(WING | RTL | {"speed_m_s": [15, 20], "rtl_rel_home_m": 80})))
    assert done.vehicles[0].request.vehicle.return_speed_m_s == 20.0


@pytest.mark.slow
def test_a_fleet_keeps_apart_as_its_parameters_make_it_fly() -> None:
    """``a`` returns over the way of ``c``, which comes later: at another speed it is where ``c`` is."""
    crossing = keys(name="c", sysid=2, start=[LAT + 0.01, LON - 0.02], goal=[LAT + 0.01, LON + 0.02],
                    speed_m_s=[10, 10], takeoff_agl_m=60)  # fmt: skip
    first = keys(name="a", rtl_rel_home_m=60, end="rtl", speed_m_s=[10, 10])
    done = planned(
        first, crossing, arrival={"mode": "sequence", "separation_m": 30, "interval_s": 290, "order": ["a", "c"]}
    )
    fleet = done.fleet
    assert fleet is not None
    a, c = fleet.motion("a"), fleet.motion("c")
    v = done.vehicles[0]
    met = []
    for speed in np.arange(8.0, 16.0, 0.5).tolist():
        other = replace(v.request.vehicle, return_m_s=speed)
        verdict = judge(v.mission, other, done.world, rtl_rel_home_m=60.0)
        near = FleetOnBoard(done).against("a", other, verdict)
        met.append(near is not None)
        assert near is None or "come as near as" in str(near)
    assert not met[4]  # as planned, at 10 m/s
    assert any(met)
    assert a.end_s > c.begin_s


# -- the list --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_list_stands_in_every_output() -> None:
    done = planned(keys(rtl_rel_home_m=60, speed_m_s=[14, 14], lean_angle_deg=50))
    files = outputs_of(done)
    [vehicle] = json.loads(files["summary.json"])["vehicles"]
    listed = {n["parameter"]: n["value"] for row in vehicle["parameters"] for n in row["names"]}
    lines = [line.split(",") for line in files["uav1.param"].splitlines() if not line.startswith("#")]
    assert {name: float(value) for name, value in lines} == pytest.approx(listed)
    assert listed["ANGLE_MAX"] == 5000
    assert (listed["WPNAV_SPEED"], listed["WP_SPD"], listed["RTL_SPEED"], listed["RTL_ALT_M"]) == (1400, 14, 1000, 60)
    assert all(row["why"] and row["rule"] in ("equal", "at least", "at most") for row in vehicle["parameters"])
    page = report_of(done)
    assert "Parameters of the vehicle that this was judged with" in page
    assert "WP_SPD_UP" in page
    px4 = outputs_of(planned(keys(autopilot="px4")))["uav1.params"]
    row = next(line for line in px4.splitlines() if "RTL_TYPE" in line and not line.startswith("#"))
    assert row.split("\t") == ["1", "1", "RTL_TYPE", "0", "6"]  # QGroundControl's five columns


@pytest.mark.slow
def test_a_vehicle_set_as_listed_is_taken_without_a_word() -> None:
    done = planned(keys(rtl_rel_home_m=60, speed_m_s=[14, 14], lean_angle_deg=50, climb_m_s=4, end="rtl"))
    lines = [line.split(",") for line in outputs_of(done)["uav1.param"].splitlines() if not line.startswith("#")]
    vehicle = board()
    own = {name: float(value) for name, value in lines}
    known = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=LAT, lon_deg=LON, amsl_m=100.0, parameters=own)
    result = sent(done, known)
    assert result.verified
    assert not any("is assumed" in str(line) for line in result.warnings), result.warnings
    assert vehicle.items() == ()


def test_the_lean_that_a_speed_needs_has_something_to_spare() -> None:
    assert lean_needed_deg(14.0) > 42.0  # 42° flew 13.7 m/s
    assert lean_needed_deg(15.0) == 45.0  # flown as told, 593 m above the sea
    assert lean_needed_deg(15.0, 0.0) > 45.0
    notes = planned(keys(speed_m_s=[14, 14], lean_angle_deg=50)).fleet.slots[0].notes  # type: ignore[union-attr]
    assert one("lean_to_set", notes).data["lean_deg"] == 43
    assert one("lean_counted_with", notes).data["lean_deg"] == 50


# -- a rehearsal with the vehicle's own --------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_rehearsal_flies_with_the_parameters_of_a_file_or_a_vehicle(tmp_path: Path) -> None:
    done = planned(keys(**RTL))
    file = tmp_path / "board.param"
    file.write_text("# of today\nRTL_SPEED,500\nWPNAV_SPEED_UP 250\n1\t1\tRTL_ALT\t6000\t6\n", encoding="utf-8")
    [slow] = fly_plan(done, parameters=parameters_of([str(file)], done)).vehicles
    [told] = fly_plan(done).vehicles
    assert slow.as_dict()["end_s"] - told.as_dict()["end_s"] == pytest.approx(2224.0 / 5.0 - 2224.0 / 10.0, abs=8.0)
    with SimServer([board(RTL_SPEED=500)], "udpin:127.0.0.1:0") as server:
        read = parameters_of([f"uav1={server.url_for_gcs}"], done)
    assert read["uav1"]["RTL_SPEED"] == 500.0
    with pytest.raises(UsageError, match="no vehicle 'b'"):
        parameters_of([f"b={file}"], done)
    file.write_text("RTL_SPEED;500\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"board\.param:1: each line must be NAME,VALUE"):
        parameters_of([str(file)], done)
