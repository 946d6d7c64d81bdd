"""What is proposed for a way home that is not safe, an earlier landing last: each proposal is planned again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.app.fleet.earlier_landing import best_changes, with_earlier_landing
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import homes_of, warnings
from gcsplan.check.returns.proposal import ReturnProposal
from gcsplan.mission_file import load_mission

UAV1 = {
    "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10], "rtl_rel_home_m": 50,
    "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 2000, "north_m": 0},
}  # fmt: skip

HILL = {
    "version": 1, "terrain": {"flat_m": 0, "peaks": [{"center": [900, 0], "height_m": 150, "decay_m": [250, 250]}]},
    "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
    "limits": {"min_agl_m": 30, "max_climb_deg": 45, "horizontal_clearance_m": 20, "track_error_m": 2},
}  # fmt: skip


def tried(limits: dict[str, Any] | None = None, **vehicle: Any) -> tuple[Plan, list[ReturnProposal]]:
    """The proposals for a flight over a hill."""
    mission = HILL | {"limits": HILL["limits"] | (limits or {}), "vehicles": [UAV1 | vehicle]}  # type: ignore[operator]
    done = plan(load_mission(Path("hill.yaml"), text=yaml.safe_dump(mission)))
    homes = with_earlier_landing(done, homes_of(done))
    return done, list(homes["uav1"].proposals)


@pytest.mark.nightly
def test_an_altitude_within_the_limits_that_makes_all_safe_is_the_one_proposal() -> None:
    _, [altitude] = tried()
    assert (altitude.leaves_m, altitude.above_max_agl) == (0.0, False)
    ((key, height_m),) = altitude.keys
    assert key == "rtl_rel_home_m"
    done, proposals = tried(rtl_rel_home_m=height_m)
    assert homes_of(done)["uav1"].safe is True
    assert proposals == []


@pytest.mark.nightly
def test_a_return_path_goes_before_an_altitude_above_max_agl_which_says_so() -> None:
    done, proposals = tried({"max_agl_m": 90})
    assert [p.keys[0][0] for p in proposals[:2]] == ["return_route", "rtl_rel_home_m"]
    assert [p.above_max_agl for p in proposals[:2]] == [False, True]
    assert "above max_agl_m (90 m)" in str(proposals[1].note)
    home = homes_of(done)["uav1"]
    assert [p["leaves_m"] for p in home.as_dict()["proposals"]] == [p.leaves_m for p in proposals]
    assert str(proposals[0].note) in "\n".join(warnings({"uav1": home}))
    [(key, route)] = proposals[0].keys
    done, _ = tried({"max_agl_m": 90}, **{key: route})
    assert homes_of(done)["uav1"].no_return_m == proposals[0].leaves_m


@pytest.mark.nightly
def test_where_the_battery_is_short_an_earlier_landing_comes_last_and_is_safe() -> None:
    battery = {"energy": {"horizontal_j_per_m": 100, "vertical_j_per_m": 100, "battery_j": 420_000, "reserve": 0.2}}
    done, proposals = tried(**battery)
    assert len(proposals) > 1
    assert [p.shortens for p in proposals] == [*[False] * (len(proposals) - 1), True]
    assert all(0.0 < p.leaves_m < homes_of(done)["uav1"].no_return_m for p in proposals[:-1])
    changes = best_changes({"uav1": replace(homes_of(done)["uav1"], proposals=tuple(proposals[-1:]))})
    assert done.source.content is not None
    again = plan(load_mission(done.source.content.given, changes=changes))
    assert homes_of(again)["uav1"].safe is True


WALL = {
    "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [46.0, 14.0], "amsl_m": 0},
    "limits": {"min_agl_m": 30, "max_agl_m": 120},
    "no_fly": [{"name": "wall", "line": [{"east_m": 400, "north_m": n} for n in (-200, 300)], "buffer_m": 20}],
    "vehicles": [{
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": 10,
        "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 800, "north_m": 0},
    }],
}  # fmt: skip


@pytest.mark.slow
def test_rally_points_are_in_no_change_by_keys_and_no_trial() -> None:
    """Trials are judged without rally points, so that nothing is said of returns to them."""
    done = plan(load_mission(Path("wall.yaml"), text=yaml.safe_dump(WALL)))
    homes = with_earlier_landing(done, homes_of(done))
    proposals = homes["uav1"].proposals
    assert [(p.rally > 0, p.shortens) for p in proposals] == [(True, False), (False, False), (False, True)]
    assert "rally" not in str(proposals[-1].note)
    assert [(c.key, c.value) for c in best_changes(homes)] == [("return_route", "mission")]
