"""What was read of a mission, as values: limits and errors of each vehicle, the order of arrival, the planner."""

from __future__ import annotations

from tests.mission_file.test_load import base, fleet, load, vehicle


def test_a_start_in_the_file_is_kept_to_the_last_digit() -> None:
    mission = load(base(vehicles=[vehicle(start=[36.6000001, -84.3800001])]))
    assert mission.vehicles[0].start_deg == (36.6000001, -84.3800001)


def test_a_vehicle_overrides_the_limits_of_the_file() -> None:
    own = vehicle(min_agl_m=80, max_amsl_m=None, limits={"track_error_m": 7})
    limits = load(base(limits={"min_agl_m": 60, "max_amsl_m": 900}, vehicles=[own])).vehicles[0].vehicle.limits
    assert (limits.min_agl_m, limits.max_amsl_m, limits.track_error_m) == (80, None, 7)


def test_the_order_of_arrival_is_that_of_the_file_unless_said() -> None:
    mission = load(fleet(vehicle(), vehicle(name="uav2", sysid=2), arrival={"mode": "together"}))
    assert mission.arrival is not None
    assert mission.arrival.order == ("uav1", "uav2")
    assert load(base()).arrival is None


def test_the_planner_takes_keys_that_only_some_planners_know() -> None:
    keys = {"name": "krill", "seed": 7, "encoding": "bspline", "parameters": {"delta": 0.6}}
    planner = load(base(planner=keys)).planner
    assert (planner.name, planner.seed, planner.gap_percent) == ("krill", 7, 0.1)
    assert planner.extras == {"encoding": "bspline", "parameters": {"delta": 0.6}}


def test_terrain_frames_carry_the_vehicles_own_terrain_error() -> None:
    assert load(base()).terrain_error_m == 0.0
    assert load(base(altitude_frame="terrain")).terrain_error_m == 30.0
    assert load(base(altitude_frame="terrain", terrain_error_m=12)).terrain_error_m == 12.0
