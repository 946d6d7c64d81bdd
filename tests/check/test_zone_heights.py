"""The highest height above ground and the height over or under zones, against brute force along the line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, summary_of
from gcsplan.mission_file import load_mission
from tests.support.noted import codes

WIDE = {"max_climb_deg": 60}


def crossing(zones: list[dict[str, Any]], agl_m: float, **limits: float) -> Any:
    return plan(
        load_mission(
            {
                "version": 1, "name": "over", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
                "limits": {
                    "min_agl_m": 30, "track_error_m": 1, "altitude_error_m": 1, "horizontal_clearance_m": 5,
                } | limits,
                "no_fly": zones,
                "vehicles": [
                    {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.60, -84.38],
                     "goal": [36.596, -84.355], "takeoff_agl_m": agl_m, "approach_agl_m": agl_m, "max_climb_deg": 60},
                ],
            }
        )
    )  # fmt: skip


def brute(done: Any) -> tuple[float, list[tuple[float, float]]]:
    """The greatest height above ground, and place and altitude of every metre flown."""
    frame, surface, [v] = done.world.frame, done.world.airspace.surface, done.vehicles
    most, places = 0.0, []
    for leg in v.verdict.legs:
        ends = np.array([[*np.ravel(frame.to_plane(*p[:2])), p[2]] for p in (leg.start, leg.end)])
        for t in np.linspace(0.0, 1.0, 3000):
            e, n, z = (1 - t) * ends[0] + t * ends[1]
            most = max(most, z - float(surface.ground_at(e, n)))
            places.append((e, n, z))
    return most, places


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("zone", "side"),
    [
        ({"radius_m": 200, "ceiling_agl_m": 60}, "over"),
        ({"radius_m": 200, "ceiling_amsl_m": 600}, "over"),
        ({"radius_m": 200, "floor_agl_m": 300}, "under"),
        ({"radius_m": 200, "floor_amsl_m": 900, "ceiling_amsl_m": 1200}, "under"),
    ],
)
def test_heights_over_and_under_a_zone_are_the_least_of_every_metre(zone: dict[str, float], side: str) -> None:
    done = crossing([{"name": "there", "center": [36.598, -84.3675], **zone}], 120.0)
    [v] = done.vehicles
    highest, places = brute(done)
    assert v.verdict.highest.max_agl_m == pytest.approx(highest, abs=0.3)
    assert v.verdict.highest.max_agl_m >= highest - 1e-6
    frame, surface, shape = done.world.frame, done.world.airspace.surface, done.world.airspace.zones[0].shape
    inside = [(e, n, z) for e, n, z in places if np.hypot(e - shape.east_m, n - shape.north_m) < shape.radius_m]
    assert inside, "the path leads over or under the zone"
    ground = [float(surface.ground_at(e, n)) for e, n, _ in inside]
    level = zone.get("ceiling_agl_m" if side == "over" else "floor_agl_m")
    amsl = zone.get("ceiling_amsl_m" if side == "over" else "floor_amsl_m")
    limit = [g + level if level is not None else amsl for g in ground]
    sign = 1.0 if side == "over" else -1.0
    least = min(sign * (z - h) for (_, _, z), h in zip(inside, limit, strict=True))
    passed = v.verdict.zone_pass
    assert (passed.zone, passed.side) == ("there", side)
    assert least - 1.0 <= passed.height_m <= least + 0.01
    told = summary_of(done)["vehicles"][0]
    assert (told["min_zone_height_m"], told["zone_passed"]["side"]) == (passed.height_m, side)
    assert told["max_agl_m"] == v.verdict.highest.max_agl_m
    assert "m above ground" in outputs_of(done)["mission.kml"].split("<description>")[1].split("</description>")[0]
    assert frame is not None


def test_a_zone_that_is_passed_beside_is_not_passed_over() -> None:
    [v] = crossing([{"name": "there", "center": [36.598, -84.3675], "radius_m": 200}], 120.0).vehicles
    assert v.verdict.nearest.nearest_zone == "there"
    assert v.verdict.zone_pass is None


def test_a_mission_without_a_greatest_height_says_so() -> None:
    for limits, said in (({}, True), ({"max_agl_m": 400}, False)):
        notes = crossing([], 120.0, **limits).vehicles[0].verdict.notes
        assert ("no_ceiling" in codes(notes)) is said
