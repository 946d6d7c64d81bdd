"""Power in cruise and endurance as keys of ``energy:``: read as a base power, refused where they contradict others."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.notes.note import Note
from tests.check.test_energy import mission


def energy_of(keys: dict[str, Any]) -> tuple[Any, tuple[Note, ...]]:
    source = load_mission(mission(keys))
    return source.vehicles[0].vehicle.energy, source.notes


def test_power_in_cruise_and_endurance_become_a_base_power_with_a_note() -> None:
    energy, notes = energy_of({"cruise_w": 320})
    assert (energy.base_w, energy.horizontal_j_per_m, energy.hold_w()) == (320.0, 0.0, 320.0)
    assert Note("cruise_is_base_power_climb_of_paper", vehicle="uav1", given_key="cruise_w", given=320.0, base_w=320.0,
                vertical_j_per_m=120.0) in notes  # fmt: skip
    energy, notes = energy_of({"battery_wh": 100, "endurance_min": 30, "vertical_j_per_m": 40})
    assert energy.base_w == pytest.approx(200.0)
    codes = {n.code: n.data for n in notes}
    assert codes["value_converted"]["place"] == "vehicles[0].energy.endurance_min"
    assert "cruise_is_base_power" in codes
    assert "cruise_is_base_power_climb_of_paper" not in codes


@pytest.mark.parametrize(
    ("keys", "where", "cure"),
    [
        ({"cruise_w": 300, "horizontal_j_per_m": 50}, "energy.cruise_w", "keep one"),
        ({"cruise_w": 300, "endurance_min": 20, "battery_wh": 90}, "energy.endurance_min", "keep one"),
        ({"base_w": 300, "endurance_min": 20, "battery_wh": 90}, "energy.endurance_min", "keep one"),
        ({"endurance_min": 20}, "energy.endurance_min", "give battery_wh"),
        ({"fitted_speed_m_s": [9, 5]}, "energy.fitted_speed_m_s", "slowest"),
    ],
)
def test_keys_that_contradict_each_other_are_refused_with_a_cure(keys: dict[str, Any], where: str, cure: str) -> None:
    with pytest.raises(InputError) as refused:
        energy_of(keys)
    [problem] = refused.value.problems
    assert problem.where.endswith(where)
    assert cure in problem.message


def test_without_a_key_the_energy_is_not_stated() -> None:
    assert energy_of({})[0].stated is False
    assert energy_of({"hover_w": 100})[0].stated is True


def test_a_hover_that_takes_less_than_flying_is_told() -> None:
    energy, notes = energy_of({"base_w": 300, "horizontal_j_per_m": 10, "vertical_j_per_m": 40, "hover_w": 200})
    assert energy.hold_w() == 300.0
    assert Note("hover_below_base_power", vehicle="uav1", hover_w=200.0, base_w=300.0) in notes
    assert not any(n.code == "hover_below_base_power" for n in energy_of({"base_w": 300, "hover_w": 350})[1])
    assert not any(n.code == "hover_below_base_power" for n in energy_of({"base_w": 300})[1])


@pytest.mark.parametrize(
    ("keys", "papers", "noted"),
    [
        ({"battery_wh": 90}, True, {}),
        ({"battery_wh": 90, "hover_w": 300, "reserve": 0.3}, True, {}),
        ({"battery_wh": 90, "horizontal_j_per_m": 50}, False, {"vertical_j_per_m": 120.0}),
        ({"base_w": 200}, False, {"vertical_j_per_m": 120.0, "horizontal_j_per_m": 100.0}),
        ({"cruise_w": 200}, False, {}),
        ({"horizontal_j_per_m": 50, "vertical_j_per_m": 40}, False, {}),
    ],
)
def test_what_counts_as_in_the_paper_is_marked(keys: dict[str, Any], papers: bool, noted: dict[str, float]) -> None:
    energy, notes = energy_of(keys)
    assert energy.papers is papers
    costs = tuple(Note("key_and_value", name=key, value=value) for key, value in noted.items())
    told = [n for n in notes if n.code == "energy_in_part_of_paper"]
    assert told == ([Note("energy_in_part_of_paper", vehicle="uav1", costs=costs)] if noted else [])
