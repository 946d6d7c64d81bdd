"""Vehicles added, renamed and removed on the page, and how they arrive: what follows from each change."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.errors import InputError, NoMission
from gcsplan.fleet.arrival import NoSchedule
from gcsplan.page.fleet.crew_changes import arrival_of, attempts, is_crew_key, with_crew

UAV1: dict[str, Any] = {"name": "uav1", "sysid": 1, "autopilot": "px4", "start": [46.5, 8.5], "goal": [46.51, 8.51],
                        "via": [[46.505, 8.5]], "link": "udpout:127.0.0.1:14550", "speed_m_s": [3, 9]}  # fmt: skip
UAV3 = UAV1 | {"name": "uav3", "sysid": 2}
PAIR: dict[str, Any] = {"vehicles": [UAV1, UAV3], "arrival": {"mode": "sequence", "order": ["uav3", "uav1"],
                                                              "interval_min": 0.5, "clock": "fleet"}}  # fmt: skip
ENDS = {"start": [46.52, 8.5], "goal": [46.53, 8.5]}


def test_a_new_vehicle_has_the_settings_of_another_and_a_name_of_its_own() -> None:
    made = with_crew(PAIR, {"vehicles[2]": ENDS | {"like": 0}})
    assert made["vehicles[2]"] == {"name": "uav4", "sysid": 3, "autopilot": "px4", "speed_m_s": [3, 9], **ENDS}
    assert made["arrival.order"] == ["uav3", "uav1", "uav4"]
    assert UAV1["via"]  # the vehicle that it is like stays


@pytest.mark.parametrize(("changes", "order"), [({"vehicles[1]": None}, ["uav1"]),
                                                ({"vehicles[1].name": "north"}, ["north", "uav1"])])  # fmt: skip
def test_the_order_of_arrival_follows_the_vehicles(changes: dict[str, object], order: list[str]) -> None:
    assert with_crew(PAIR, changes) == {**changes, "arrival.order": order}


@pytest.mark.parametrize(
    "changes",
    [{"vehicles[0]": None, "vehicles[1]": None}, {"vehicles[3]": ENDS}, {"vehicles[2]": {"start": [46.5, 8.5]}},
     {"vehicles[2]": ENDS | {"like": 2}}, {"vehicles[2]": ENDS | {"like": True}}],
)  # fmt: skip
def test_a_vehicle_that_cannot_come_or_go_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(InputError):
        with_crew(PAIR, changes)
    with pytest.raises(InputError):
        with_crew({"vehicles": [UAV1]}, {"vehicles[0]": None})


def test_keys_of_the_arrival_that_do_not_go_together_give_way() -> None:
    assert with_crew(PAIR, {"arrival.interval_s": 20}) == {"arrival.interval_min": None, "arrival.interval_s": 20}
    assert with_crew(PAIR, {"arrival.mode": "together"}) == {"arrival.clock": None, "arrival.mode": "together"}
    assert with_crew(PAIR, {"arrival.arrive_s": 90}) == {"arrival.clock": None, "arrival.arrive_s": 90}
    assert with_crew(PAIR, {"arrival.hold": "none"}) == {"arrival.hold": "none"}
    assert arrival_of(PAIR) == {"mode": "sequence", "order": ["uav3", "uav1"], "interval_s": 30, "clock": "fleet"}


@pytest.mark.parametrize(
    ("place", "value", "good"),
    [("vehicles[1]", None, True), ("vehicles[1]", ENDS, True), ("vehicles[1]", {"link": "x"}, False),
     ("vehicles[1]", 3, False), ("arrival.order", [], True), ("arrival", None, True), ("arrival", {}, False),
     ("arrival.file", "x", False), ("arrival.mode.x", 1, False)],
)  # fmt: skip
def test_a_change_of_the_fleet_names_no_file_and_no_link(place: str, value: object, good: bool) -> None:
    assert is_crew_key(place, value) is good


def test_a_refused_schedule_offers_its_own_times_and_to_leave_the_vehicle_out() -> None:
    late = NoSchedule("uav1 is late", vehicle="uav1", interval_s=12.3456, arrive_s=None)
    changes = [found["changes"] for found in attempts(PAIR, late)]
    assert changes == [{"arrival.interval_s": 12.346}, {"arrival.leave_out": True}]
    lone = NoMission("no path", reason="not_found", vehicle="uav1")
    assert attempts({"vehicles": [UAV1]}, lone) == []
    assert attempts({**PAIR, "arrival": {"mode": "none", "leave_out": True}}, lone) == []
