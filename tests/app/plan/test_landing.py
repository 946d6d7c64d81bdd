"""On which heading a fixed wing lands: into the declared wind, and uphill."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import VehiclePlan
from gcsplan.mission_file import load_mission

WING: dict[str, Any] = {
    "version": 1, "name": "landing", "terrain": {"flat_m": 300},
    "limits": {"min_agl_m": 40, "track_error_m": 8, "altitude_error_m": 8},
    "vehicles": [{"name": "w1", "sysid": 1, "autopilot": "arduplane", "start": [36.6, -84.3], "goal": [36.63, -84.3],
                  "speed_m_s": [18, 20], "turn_radius_m": 110}],
}  # fmt: skip


def landed(**more: Any) -> tuple[VehiclePlan, float, list[str]]:
    """The plan, its landing heading, and the codes of its notes."""
    planned = plan(load_mission(WING | more)).vehicles[0]
    heading_deg = next(n for n in planned.notes if n.code == "approach").data["heading_deg"]
    assert isinstance(heading_deg, float)
    return planned, heading_deg, [n.code for n in planned.notes]


def apart_deg(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


@pytest.mark.slow
@pytest.mark.parametrize("from_deg", [90, 200])
def test_it_lands_within_45_degrees_of_the_declared_wind_and_says_so(from_deg: int) -> None:
    planned, heading_deg, codes = landed(wind={"speed_m_s": 5, "from_deg": from_deg})
    assert planned.verdict.findings == ()
    assert apart_deg(heading_deg, from_deg) <= 46.0
    assert "approach_into_wind" in codes


@pytest.mark.slow
def test_without_a_direction_it_lands_the_natural_way() -> None:
    for wind in ({}, {"wind": {"up_to_m_s": 4}}):
        _, heading_deg, codes = landed(**wind)
        assert apart_deg(heading_deg, 0.0) <= 1.0
        assert not {"approach_into_wind", "approach_uphill"} & set(codes)
