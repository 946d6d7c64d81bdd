"""Fences and failsafes on board: a fence that the mission would breach is refused, another failsafe is told."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from gcsplan.app.output.files import outputs_of
from gcsplan.app.rehearse import rehearse
from gcsplan.app.upload.on_board import settings_of_plan
from gcsplan.check.motion.stretch import flat_m
from gcsplan.mavlink.link.session.parameters import judge_fence_parameters
from gcsplan.mavlink.mission.fences import fences_in_force
from gcsplan.mavlink.mission.parameter_list import needed_groups
from gcsplan.mavlink.mission.parameter_names import OnBoard, unanswered
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot
from tests.app.test_parameters import CRUISE, LAT, LON, WING, board, keys, planned, sent
from tests.support.impatient import be_impatient

AWAY_M = flat_m((LAT, LON, 0.0), (LAT + 0.02, LON, 0.0))  # of the goal
ON = {"FENCE_ENABLE": 1.0, "FENCE_RADIUS": 3000.0}
KEPT = {"RTL_ALT": 6000.0}


@pytest.fixture(autouse=True)
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"FENCE_ENABLE": 1}, "FENCE_RADIUS is 300 on board, and at least 2227 is assumed (the farthest place"),
        ({"FENCE_AUTOENABLE": 3}, "FENCE_RADIUS is 300 on board"),
        (ON | {"FENCE_ALT_MAX": 64}, "FENCE_ALT_MAX is 64 on board, and at least 65 is assumed"),
        (ON | {"FENCE_TYPE": 8, "FENCE_ALT_MIN": 1}, "FENCE_ALT_MIN is 1 on board, and at most -5 is assumed"),
        (ON | {"FENCE_TYPE": 15}, ""),
        (ON, ""),
        ({"FENCE_ENABLE": 1, "FENCE_TYPE": 4}, ""),
        ({"FENCE_ENABLE": 1, "FENCE_ACTION": 0}, ""),  # it only tells
        ({"FENCE_ENABLE": 0}, ""),
    ],
)
def test_a_fence_that_the_mission_would_breach_is_refused(parameters: dict[str, float], words: str) -> None:
    result = sent(planned(), board(**parameters), allow_parameters=True)
    assert (result.outcome, result.reason) == (("refused", "parameters") if words else ("accepted", "")), result.message
    assert words in result.message


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (ON | {"FENCE_ALT_MAX": 63}, "FENCE_ALT_MAX is 63 on board"),
        (ON | {"FENCE_ALT_MAX": 63, "FENCE_ACTION": 0}, "FENCE_ALT_MAX is 63 on board"),
        (ON | {"FENCE_ALT_MAX": 66, "FENCE_MARGIN": 9}, "FENCE_MARGIN is 9 on board, and at most 2 is assumed"),
        (ON | {"FENCE_ALT_MAX": 66}, ""),
    ],
)
def test_arducopter_returns_no_higher_than_its_fence(parameters: dict[str, float], words: str) -> None:
    done = planned(keys(rtl_rel_home_m=60), way_home="required")
    result = sent(done, board(**KEPT, **parameters), allow_parameters=True)
    assert result.outcome == ("refused" if words else "accepted"), result.message
    assert words in result.message


@pytest.mark.slow
def test_a_return_above_the_flight_needs_the_ceiling_and_its_margin() -> None:
    done = planned(keys(rtl_rel_home_m=80), way_home="required")
    high = board(RTL_ALT=8000.0, **ON, FENCE_ALT_MAX=81)
    assert (
        "FENCE_ALT_MAX is 81 on board, and at least 82 is assumed (a return at 80 m keeps" in sent(done, high).message
    )
    assert sent(done, board(RTL_ALT=8000.0, **ON, FENCE_ALT_MAX=82)).verified


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"GF_MAX_HOR_DIST": 500}, "GF_MAX_HOR_DIST is 500 on board, and at least 2227 is assumed"),
        ({"GF_MAX_VER_DIST": 60}, "GF_MAX_VER_DIST is 60 on board, and at least 65 is assumed"),
        ({"GF_MAX_HOR_DIST": 500, "GF_ACTION": 1}, ""),  # it only warns
        ({"GF_MAX_HOR_DIST": 2300, "GF_MAX_VER_DIST": 70, "GF_ACTION": 3}, ""),
    ],
)
def test_px4_has_two_distances(parameters: dict[str, float], words: str) -> None:
    result = sent(planned(keys(autopilot="px4")), board("px4", **parameters))
    assert result.outcome == ("refused" if words else "accepted"), result.message
    assert words in result.message


@pytest.mark.slow
def test_a_wing_levels_off_late_under_its_fence() -> None:
    done = planned(keys(**WING))
    extent = done.vehicles[0].verdict.extent
    assert extent is not None
    assert extent.top_rel_home_m == pytest.approx(80.0 + 16.0, abs=0.1)
    assert extent.reach_m > AWAY_M + 60.0  # its circle at the goal
    fenced = CRUISE | {"FENCE_ENABLE": 1, "FENCE_TYPE": 1}
    assert sent(done, board("arduplane", **fenced)).verified
    assert "FENCE_ALT_MAX is 90" in sent(done, board("arduplane", **fenced, FENCE_ALT_MAX=90)).message


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("mute", "parameters", "autopilot", "refused"),
    [
        ("FENCE_RADIUS", {"FENCE_ENABLE": 1}, "arducopter", True),
        ("FENCE_ENABLE", {"FENCE_ENABLE": 1}, "arducopter", True),
        ("FENCE_TYPE", {"FENCE_ENABLE": 1, "FENCE_TYPE": 2}, "arducopter", True),
        ("FENCE_AUTOENABLE", {"FENCE_AUTOENABLE": 3}, "arducopter", True),
        ("FENCE_RADIUS", {}, "arducopter", False),  # it is off
        ("GF_MAX_HOR_DIST", {"GF_MAX_HOR_DIST": 50}, "px4", True),
        ("GF_MAX_HOR_DIST", {"GF_ACTION": 0}, "px4", False),
    ],
)
def test_a_fence_that_was_not_read_is_not_off(
    mute: str, parameters: dict[str, float], autopilot: str, *, refused: bool
) -> None:
    vehicle = board(autopilot, Misbehaviour(mute=mute), **parameters)
    result = sent(planned(keys(autopilot=autopilot)), vehicle, timeout_s=0.6)
    assert result.outcome == ("refused" if refused else "accepted"), result.message
    assert (f"{mute} could not be read" in result.message) == refused


def test_a_firmware_without_any_fence_is_no_missing_answer() -> None:
    settings = settings_of_plan(planned().vehicles[0], None)
    groups = needed_groups(settings, Autopilot.ARDUCOPTER)
    assert ("FENCE_ENABLE",) in groups
    assert not unanswered(OnBoard({"WPNAV_SPEED": 1000.0}), [("FENCE_ENABLE",)])
    assert unanswered(OnBoard({"FENCE_TYPE": 7.0}), [("FENCE_ENABLE",)])
    assert unanswered(OnBoard(), [("FENCE_ENABLE",)])  # nothing at all was answered


@pytest.mark.parametrize(
    ("autopilot", "parameters", "words"),
    [
        ("arducopter", {"FS_THR_ENABLE": 3}, "FS_THR_ENABLE is 3 on board, and 1 or 0 or 2 is assumed (loss of radio"),
        ("arducopter", {"FS_GCS_ENABLE": 5}, "FS_GCS_ENABLE is 5 on board"),
        ("arducopter", {"BATT_FS_LOW_ACT": 1}, "BATT_FS_LOW_ACT is 1 on board, and 2 or 0 is assumed"),
        ("arducopter", {"BATT_FS_CRT_ACT": 5}, "BATT_FS_CRT_ACT is 5 on board"),
        ("arducopter", {"FS_EKF_ACTION": 2}, "FS_EKF_ACTION is 2 on board"),
        ("arducopter", ON | {"FENCE_ACTION": 2}, "FENCE_ACTION is 2 on board"),
        ("arduplane", CRUISE | {"FS_LONG_ACTN": 2}, "FS_LONG_ACTN is 2 on board"),
        ("px4", {"NAV_RCL_ACT": 3}, "NAV_RCL_ACT is 3 on board, and 2 or 0 is assumed"),
        ("px4", {"NAV_DLL_ACT": 5}, "NAV_DLL_ACT is 5 on board"),
        ("px4", {"COM_LOW_BAT_ACT": 2}, "COM_LOW_BAT_ACT is 2 on board, and 3 or 0 is assumed"),
    ],
)
def test_a_failsafe_that_ends_elsewhere_is_told(autopilot: str, parameters: dict[str, float], words: str) -> None:
    done = planned(keys(**(WING if autopilot == "arduplane" else {"autopilot": autopilot})))
    result = sent(done, board(autopilot, **parameters))
    assert result.verified
    assert words in " / ".join(map(str, result.warnings))


def test_the_list_has_fences_and_failsafes() -> None:
    for autopilot, wanted in (
        ("arducopter", {"FENCE_ALT_MAX": 65, "FENCE_RADIUS": 2227, "FENCE_ALT_MIN": -5, "FENCE_ACTION": 1,
                        "FS_THR_ENABLE": 1, "FS_GCS_ENABLE": 1, "BATT_FS_LOW_ACT": 2, "BATT_FS_CRT_ACT": 2,
                        "FS_EKF_ACTION": 1}),
        ("px4", {"GF_MAX_VER_DIST": 65, "GF_MAX_HOR_DIST": 2227, "GF_ACTION": 3, "NAV_RCL_ACT": 2, "NAV_DLL_ACT": 2,
                 "COM_LOW_BAT_ACT": 3}),
    ):  # fmt: skip
        files = outputs_of(planned(keys(autopilot=autopilot)))
        [vehicle] = json.loads(files["summary.json"])["vehicles"]
        rows = {row["names"][0]["parameter"]: row for row in vehicle["parameters"]}
        assert {name: rows[name]["value"] for name in wanted} == wanted
        lines = files["uav1.param" if autopilot == "arducopter" else "uav1.params"].splitlines()
        assert any("at least this" in line for line in lines if "FENCE_RADIUS" in line or "GF_MAX_HOR" in line)
        if autopilot == "px4":
            whole = [line.split("\t")[4] for line in lines if not line.startswith("#") and "_ACT" in line]
            assert whole == ["6"] * 4  # GF_ACTION and the failsafes are INT32


def oracle_in_force(raw: dict[str, float]) -> set[str]:
    """ArduPilot's fences by their bits, written down anew."""
    if raw["FENCE_ENABLE"] == 0 and raw["FENCE_AUTOENABLE"] not in (1, 2, 3):
        return set()
    found = set()
    for n, name in enumerate(("top", "radius", "", "floor")):
        if name and math.floor(raw["FENCE_TYPE"] / 2**n) % 2 == 1:
            found.add(f"fence_{name}")
    return found


def test_every_kind_of_fence_is_in_force_by_its_bit() -> None:
    for kinds in range(16):
        for enable in (0, 1):
            for itself in range(4):
                raw: dict[str, float] = {
                    "FENCE_ENABLE": enable, "FENCE_AUTOENABLE": itself, "FENCE_TYPE": kinds
                }  # fmt: skip
                found = fences_in_force(raw, Autopilot.ARDUCOPTER) - {"fence_action", "fence_margin"}
                assert found == oracle_in_force(raw), raw


def test_a_fence_that_enables_itself_is_told() -> None:
    values: dict[str, Any] = {"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 3.0, "FENCE_TYPE": 6.0, "FENCE_RADIUS": 300.0}
    [told] = judge_fence_parameters(values)
    assert str(told) == (
        "FENCE_AUTOENABLE is 3 on board: the fence is enforced from arming on; enabling it also puts into force the "
        "circle of 300 m around home (FENCE_RADIUS; FENCE_TYPE 6)"
    )


@pytest.mark.nightly
def test_a_rehearsal_tells_what_it_does_not_fly() -> None:
    done = planned(keys(end="rtl", rtl_rel_home_m=60))
    values = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0, "FENCE_RADIUS": 300.0, "FS_THR_ENABLE": 3.0, "RTL_ALT_TYPE": 1.0}
    flown = rehearse(done, parameters={"uav1": values})
    assert flown.safe is None
    assert [str(note).split(" is ")[0] for note in flown.not_judged] == ["uav1: RTL_ALT_TYPE", "uav1: FENCE_RADIUS"]
    assert any("FS_THR_ENABLE is 3 on board" in str(note) for note in flown.notes)
    assert rehearse(done, parameters={"uav1": {"FENCE_ENABLE": 0.0, "FENCE_TYPE": 7.0}}).safe is True
