"""Parameters of the autopilots: their names and units, fences in force, the list of a mission, and its file."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.mission.fences import CIRCLE, FLOOR, POLYGON, SAFETY, TOP, acts, fences_in_force, is_fence
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mavlink.mission.parameter_file import PARAM_ENDING, param_file, read_param_file
from gcsplan.mavlink.mission.parameter_list import (
    FlightExtent,
    Setting,
    needed_groups,
    off,
    parameter_list,
    safety_list,
)
from gcsplan.mavlink.mission.parameter_names import PARAMETERS, Name, OnBoard, Parameter, unanswered
from gcsplan.notes.note import Note, Wording
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
RADIUS = Parameter("radius", (Name("WPNAV_RADIUS", 100.0, "to 4.6"), Name("WP_RADIUS_M", 1.0, "4.7")), 2.0, "m")


# -- names and units


def test_a_parameter_is_read_under_either_name_in_its_own_unit() -> None:
    assert RADIUS.read({"WPNAV_RADIUS": 250.0}) == RADIUS.read({"WP_RADIUS_M": 2.5}) == 2.5
    assert RADIUS.read({}) is None
    assert RADIUS.read({"WPNAV_RADIUS": math.nan, "WP_RADIUS_M": 3.0}) == 3.0
    assert RADIUS.group() == ("WPNAV_RADIUS", "WP_RADIUS_M")


def test_what_to_set_is_the_name_that_the_vehicle_has_or_every_name() -> None:
    assert RADIUS.setting(1.5) == "WPNAV_RADIUS 150 or WP_RADIUS_M 1.5"
    assert RADIUS.setting(1.5, {"WP_RADIUS_M": 9.0}) == "WP_RADIUS_M 1.5"


def test_silence_is_no_answer_and_not_to_exist_is_one() -> None:
    groups = [RADIUS.group(), ("RTL_ALT",)]
    assert unanswered({}, groups) == groups
    assert unanswered({"WP_RADIUS_M": 2.0, "RTL_ALT": math.inf}, groups) == [("RTL_ALT",)]
    assert unanswered(OnBoard({"RTL_ALT": 15.0}, absent=RADIUS.group()), groups) == []
    assert unanswered(OnBoard({"RTL_ALT": 15.0}, absent=["WPNAV_RADIUS"]), groups) == [RADIUS.group()]


def test_a_firmware_without_fences_lacks_them_and_a_silent_one_does_not() -> None:
    assert OnBoard({"RTL_ALT": 15.0}).lacks(("FENCE_ENABLE",))
    assert not OnBoard({}).lacks(("FENCE_ENABLE",))
    assert not OnBoard({"FENCE_TYPE": 7.0}).lacks(("FENCE_ENABLE",))
    assert not OnBoard({"RTL_ALT": 15.0}, absent=["FENCE_ACTION"]).lacks(("FENCE_ENABLE",))


def test_a_parameter_newer_than_the_firmware_is_lacking() -> None:
    newest = max((p for rows in PARAMETERS.values() for p in rows.values()), key=lambda p: p.since)
    assert newest.since > (4, 0)
    assert OnBoard(version=(4, 0)).too_old_for(newest.group())
    assert not OnBoard(version=newest.since).too_old_for(newest.group())
    assert not OnBoard().too_old_for(newest.group())


# -- fences in force


@pytest.mark.parametrize("autopilot", [COPTER, PLANE])
def test_an_ardupilots_fences_are_those_of_its_type_where_one_switch_is_on(autopilot: Autopilot) -> None:
    keys = {TOP: {"fence_top", "fence_margin"}, CIRCLE: {"fence_radius"}, POLYGON: set(), FLOOR: {"fence_floor"}}
    for enable, auto, kinds in itertools.product((0.0, 1.0), (0.0, 1.0, 3.0), range(16)):
        wanted = set().union(*(keys[bit] for bit in keys if kinds & bit), {"fence_action"})
        found = fences_in_force({"FENCE_ENABLE": enable, "FENCE_AUTOENABLE": auto, "FENCE_TYPE": kinds}, autopilot)
        assert found == (wanted if kinds and (enable or auto) else set())


def test_a_px4_keeps_to_a_distance_above_0_if_it_acts_at_all() -> None:
    both = {"GF_MAX_VER_DIST": 120.0, "GF_MAX_HOR_DIST": 500.0}
    assert fences_in_force({"GF_ACTION": 2.0, **both}, PX4) == {"fence_top", "fence_radius", "fence_action"}
    assert fences_in_force({"GF_ACTION": 0.0, **both}, PX4) == set()
    assert fences_in_force({"GF_ACTION": 2.0, "GF_MAX_VER_DIST": 0.0}, PX4) == set()
    low = {"GF_ACTION": 2.0, "GF_MAX_VER_DIST": 0.0}
    assert fences_in_force(low, PX4, unread_m=1.0) == {"fence_radius", "fence_action"}


def test_a_breach_that_is_only_told_changes_no_flight() -> None:
    assert [acts({"FENCE_ACTION": a}, COPTER) for a in (0.0, 1.0, 4.0)] == [False, True, True]
    assert [acts({"GF_ACTION": a}, PX4) for a in (0.0, 1.0, 2.0)] == [False, False, True]
    assert acts({}, COPTER)
    assert acts({}, PX4)


# -- the list of a mission


@pytest.mark.parametrize(
    ("rule", "within", "outside"),
    [("equal", (100.0, 0.0), (97.0, 103.0)), ("at least", (100.0, 900.0, 0.0), (97.0,)),
     ("at most", (100.0, -5.0, 0.0), (103.0,))],
)  # fmt: skip
def test_a_rule_allows_its_side_of_the_value_and_what_else_it_names(
    rule: str, within: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    setting = Setting(RADIUS, 100.0, rule, Note("assumed_circles"), "flight", (0.0,))  # type: ignore[arg-type]
    assert all(setting.allows(amount) for amount in within)
    assert not any(setting.allows(amount) for amount in outside)


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_fences_must_hold_the_whole_flight_in_whole_metres(autopilot: Autopilot) -> None:
    rows = {s.parameter.key: s for s in safety_list(autopilot, FlightExtent(80.2, -3.4, 900.1))}
    assert (rows["fence_top"].rule, rows["fence_top"].value) == ("at least", 81.0)
    assert (rows["fence_radius"].rule, rows["fence_radius"].value) == ("at least", 901.0)
    assert set(rows) <= set(SAFETY[autopilot])
    if autopilot is not PX4:
        assert (rows["fence_floor"].rule, rows["fence_floor"].value) == ("at most", -4.0)


def test_a_return_above_the_flight_lifts_the_fence_of_an_arducopter_alone() -> None:
    lists = {a: safety_list(a, FlightExtent(80.2, 0.0, 9.0), rtl_rel_home_m=100.0) for a in Autopilot}
    tops = {a: next(s.value for s in rows if s.parameter.key == "fence_top") for a, rows in lists.items()}
    assert tops == {COPTER: 102.0, PLANE: 81.0, PX4: 81.0}


def test_a_fence_counts_only_where_it_is_in_force() -> None:
    settings = safety_list(COPTER, FlightExtent(80.0, 0.0, 900.0))
    low = {"FENCE_ALT_MAX": 50.0, "FENCE_RADIUS": 300.0, "FENCE_TYPE": float(TOP), "FENCE_ACTION": 1.0}
    assert [o.name.name for o in off(settings, {**low, "FENCE_ENABLE": 1.0}, COPTER)] == ["FENCE_ALT_MAX"]
    assert off(settings, {**low, "FENCE_ENABLE": 0.0}, COPTER) == []
    assert off(settings, {**low, "FENCE_ENABLE": 1.0, "FENCE_ACTION": 0.0}, COPTER) == []
    words = str(off(settings, {**low, "FENCE_ENABLE": 1.0}, COPTER)[0].note())
    assert words.startswith("FENCE_ALT_MAX is 50 on board, and at least 80 is assumed")
    assert words.endswith("set FENCE_ALT_MAX 80")


def test_of_fences_that_are_off_no_answer_is_needed() -> None:
    settings = safety_list(COPTER, FlightExtent(80.0, 0.0, 900.0))
    assert needed_groups(settings, COPTER, {"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 0.0}) == ()
    needed = needed_groups(settings, COPTER)
    assert {("FENCE_ENABLE",), ("FENCE_ALT_MAX",), ("FENCE_RADIUS",)} <= set(needed)
    assert not any(s.parameter.group() in needed for s in settings if not is_fence(s.parameter.key))  # failsafes


# -- the file


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_file_of_parameters_is_read_as_it_was_written(tmp_path: Path, autopilot: Autopilot) -> None:
    settings = safety_list(autopilot, FlightExtent(80.2, -3.4, 900.1))
    file = tmp_path / f"uav1.{PARAM_ENDING[autopilot]}"
    file.write_text(param_file("uav1", autopilot, 3, settings), encoding="utf-8")
    assert read_param_file(file) == {n.name: n.value(s.value) for s in settings for n in s.parameter.names}
    rows = [line for line in file.read_text().splitlines() if not line.startswith("#")]
    assert all(row.startswith("3\t1\t") if autopilot is PX4 else "," in row for row in rows)


@pytest.mark.parametrize("line", ["RTL_ALT", "RTL_ALT,high", "RTL_ALT,nan", "1 1 RTL_ALT 5", "A_NAME_OF_17_LETTERS,1"])
def test_a_line_that_is_no_parameter_is_told_with_its_number(tmp_path: Path, line: str) -> None:
    file = tmp_path / "a.param"
    file.write_text(f"# mine\nFENCE_TYPE,7\n{line}\n")
    with pytest.raises(InputError) as caught:
        read_param_file(file)
    assert caught.value.where == f"{file}:3"


def test_a_file_without_parameters_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.param"
    file.write_text("# nothing\n\n")
    with pytest.raises(InputError, match="has no parameters"):
        read_param_file(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_param_file(tmp_path / "none.param")


def test_the_list_of_a_mission_allows_what_it_was_made_with() -> None:
    for autopilot in Autopilot:
        vehicle = Vehicle("uav1", 1, autopilot, Limits(30.0))
        mission = Mission(autopilot, Home.at(36.6, -84.3, 300.0), (), "uav1", 1)
        settings = parameter_list(mission, vehicle, rtl_rel_home_m=60.0, returns=True)
        assert settings
        assert all(setting.allows(setting.value) for setting in settings)
        on_board = {s.parameter.names[0].name: s.parameter.names[0].value(s.value) for s in settings}
        assert off(settings, on_board, autopilot) == []


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_why_a_parameter_matters_is_said_with_its_code_and_in_the_readers_keys(autopilot: Autopilot) -> None:
    rows = safety_list(autopilot, FlightExtent(80.2, -3.4, 900.1), rtl_rel_home_m=100.0)
    told = {s.parameter.key: s.as_dict() for s in rows}
    assert told["fence_action"]["why"] == "a breach of a fence makes it return"
    assert told["fence_action"]["why_data"]["code"] == "assumed_fence_action"
    ground = told["fs_ground"]
    assert ground["why"] == "loss of the ground station makes it return; 0 does nothing"
    assert ground["why_data"]["data"]["after"]["code"] == "after_ground_station_loss"
    climb = Note("assumed_motion", motion="climb_m_s")
    assert str(climb) == "climb_m_s, in all times"
    assert climb.text(Wording(options={"climb_m_s": "--climb"})) == "--climb, in all times"
