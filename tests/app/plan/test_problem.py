"""From a request to the planner's problem, and from a solution to a judged mission."""

from __future__ import annotations

import re

import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import summary_of
from gcsplan.errors import InputError, NoMission
from gcsplan.mission_file import load_mission
from tests.app.fleet.test_pipeline import CROSSING, planned
from tests.support.batches import mission
from tests.support.noted import one
from tests.support.paths import DATA


def test_a_battery_that_is_too_small_is_named() -> None:
    with pytest.raises(NoMission, match="battery") as refused:
        planned({"energy": {"battery_j": 200_000, "reserve": 0.2}})
    assert refused.value.reason == "battery"


@pytest.mark.slow
def test_a_take_off_below_the_limits_is_bad_input_and_one_at_them_is_raised() -> None:
    with pytest.raises(InputError, match="takeoff_agl_m"):
        planned({"takeoff_agl_m": 50})
    done = planned({"takeoff_agl_m": 65})
    raised = one("takeoff_raised", done.vehicles[0].notes)
    assert raised.data["asked_m"] == 65.0
    assert raised.data["raised_m"] > 65.0  # type: ignore[operator]


@pytest.mark.nightly
def test_the_energy_objective_spends_no_more_than_the_shortest_way() -> None:
    sharp = yaml.safe_dump(CROSSING | {"planner": {"gap_percent": 0.1}})
    length, energy = (
        plan(load_mission(DATA / "crossing.yaml", text=sharp), objective=objective)
        for objective in ("length", "energy")
    )
    assert energy.vehicles[0].verdict.path_energy_j <= length.vehicles[0].verdict.path_energy_j * 1.001
    assert summary_of(energy)["vehicles"][0]["lower_bound_m"] is None


def on_a_hill(vehicle: dict[str, object], objective: str, **keys: object) -> str:
    """A mission whose straight way leads over a block that is 300 m high."""
    ring = [{"east_m": e, "north_m": n} for e, n in ((400, -300), (600, -300), (600, 300), (400, 300))]
    return yaml.safe_dump(
        {"version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, **keys,
         "limits": {"min_agl_m": 30}, "no_fly": [{"name": "block", "polygon": ring, "ceiling_amsl_m": 300}],
         "planner": {"objective": objective, "gap_percent": 1},
         "vehicles": [{"name": "a", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
                       "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 1000, "north_m": 0}, **vehicle}]}
    )  # fmt: skip


WING = {
    "autopilot": "arduplane", "turn_radius_m": 60, "speed_m_s": [14, 15], "end": "loiter", "takeoff_heading_deg": 0,
    "max_climb_deg": 10, "max_descent_deg": 10, "goal": {"east_m": 5000, "north_m": 0},
}  # fmt: skip
RATES = {"climb_m_s": 2.5, "descent_m_s": 1.5}


@pytest.mark.slow
def test_the_fastest_plan_tells_its_time_its_bound_and_the_gap() -> None:
    (fast,), (short,) = (
        summary_of(plan(on_a_hill(RATES | {"accel_m_s2": 1.5}, objective)))["vehicles"]
        for objective in ("time", "length")
    )
    assert "lower_bound_s" not in short
    assert fast["lower_bound_m"] is fast["lower_bound_j"] is None
    assert 1200.0 / 15.0 <= fast["path_time_s"] <= 1.01 * fast["lower_bound_s"]
    assert fast["gap_percent"] == pytest.approx(100.0 * (fast["path_time_s"] / fast["lower_bound_s"] - 1.0))
    assert fast["path_time_s"] < fast["arrive_s"] < short["arrive_s"] - 60.0


@pytest.mark.slow
def test_a_wings_fastest_plan_tells_its_time_in_thin_air() -> None:
    (fast,), (short,) = (summary_of(plan(on_a_hill(WING, goal)))["vehicles"] for goal in ("time", "length"))
    assert fast["lower_bound_m"] is None
    assert fast["lower_bound_s"] <= fast["path_time_s"] < fast["length_m"] / 15.0
    assert fast["gap_percent"] == pytest.approx(100.0 * (fast["path_time_s"] / fast["lower_bound_s"] - 1.0))
    assert fast["path_time_s"] <= short["length_m"] / 15.0


@pytest.mark.slow
def test_a_wings_fastest_plan_counts_the_one_declared_wind() -> None:
    behind, ahead = (
        summary_of(plan(on_a_hill(WING, "time", wind={"from_deg": side, "speed_m_s": 4})))["vehicles"][0]
        for side in (270, 90)
    )
    for each, over_m_s in ((behind, 19.0), (ahead, 11.0)):
        assert each["lower_bound_s"] <= each["path_time_s"] < 1.06 * each["lower_bound_s"]
        assert each["path_time_s"] == pytest.approx(each["length_m"] / over_m_s, rel=0.1)


@pytest.mark.parametrize(
    ("vehicle", "keys", "why"),
    [(WING, {"wind": {"up_to_m_s": 3}}, "fixed wing"), ({}, {}, "climb_m_s and descent_m_s"),
     (WING, {"wind": {"from_deg": 270, "speed_m_s": 3, "gust_m_s": 5}}, "fixed wing"),
     (WING, {"wind": {"from_deg": 270, "speed_m_s": 14.5}}, "about as fast"),
     (RATES, {"altitude_frame": "terrain"}, "altitude_frame terrain")],
)  # fmt: skip
def test_a_fastest_path_that_is_not_known_is_refused_with_its_cure(
    vehicle: dict[str, object], keys: dict[str, object], why: str
) -> None:
    with pytest.raises(InputError, match=f"{why}.*: use length") as refused:
        plan(on_a_hill(vehicle, "time", **keys))
    assert "planner.objective" in str(refused.value)


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("battery", "key"),
    [({"battery_wh": 10}, "battery_wh"), ({"battery_mah": 500, "battery_v": 22.2}, "battery_mah"),
     ({"battery_j": 9000}, "battery_j"), ({"battery_wh": 10, "endurance_min": 6}, "battery_wh"),
     ({"battery_mah": 700, "battery_v": 14.8, "endurance_s": 300}, "battery_mah")],
)  # fmt: skip
def test_a_battery_is_refused_with_one_in_its_own_unit_that_would_do(battery: dict[str, float], key: str) -> None:
    vehicle = yaml.safe_load(mission())["vehicles"][0]
    lasts = any(name.startswith("endurance") for name in battery)  # says what cruising takes
    energy = {"vertical_j_per_m": 120, "reserve": 0.25} | ({} if lasts else {"horizontal_j_per_m": 100})
    with pytest.raises(NoMission, match="battery") as refused:
        plan(mission(vehicles=[vehicle | {"energy": energy | battery}]))
    found = re.search(rf"{key}: ([0-9.]+)(?: with endurance_min: ([0-9.]+).*)? would do", str(refused.value))
    assert found is not None
    assert lasts == (found[2] is not None)
    assert refused.value.reason == "battery"
    for part, passes in ((1.0, True), (0.98, False)):
        enough = {"battery_v": battery.get("battery_v"), key: part * float(found[1])}
        if lasts:
            enough["endurance_min"] = part * float(found[2])
        try:
            plan(mission(vehicles=[vehicle | {"energy": energy | enough}]))
            assert passes
        except NoMission:
            assert not passes
