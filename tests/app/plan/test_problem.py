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


def test_a_take_off_below_the_limits_is_bad_input_and_one_at_them_is_raised() -> None:
    with pytest.raises(InputError, match="takeoff_agl_m"):
        planned({"takeoff_agl_m": 50})
    done = planned({"takeoff_agl_m": 65})
    raised = one("takeoff_raised", done.vehicles[0].notes)
    assert raised.data["asked_m"] == 65.0
    assert raised.data["raised_m"] > 65.0  # type: ignore[operator]


@pytest.mark.slow
def test_the_energy_objective_spends_no_more_than_the_shortest_way() -> None:
    sharp = yaml.safe_dump(CROSSING | {"planner": {"gap_percent": 0.1}})
    length, energy = (
        plan(load_mission(DATA / "crossing.yaml", text=sharp), objective=objective)
        for objective in ("length", "energy")
    )
    assert energy.vehicles[0].verdict.path_energy_j <= length.vehicles[0].verdict.path_energy_j * 1.001
    assert summary_of(energy)["vehicles"][0]["lower_bound_m"] is None


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
