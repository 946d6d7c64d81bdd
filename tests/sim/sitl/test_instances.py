"""SITL instances: their parameters, headings and ports."""

from __future__ import annotations

import socket
from dataclasses import replace
from pathlib import Path

import pytest

from gcsplan.errors import UsageError
from gcsplan.sim.sitl import instances
from gcsplan.sim.sitl.instances import heading_of, parameters_of
from tests.support.sitl_parts import PLANE, a_part, ramp


def test_a_copter_gets_each_speed_by_its_name_before_and_since_4_7() -> None:
    part = replace(a_part(ramp(), climb_m_s=3.0, descent_m_s=2.0), rtl_rel_home_m=80.0)
    given = parameters_of(part)
    assert (given["WPNAV_SPEED"], given["WP_SPD"]) == (800.0, 8.0)
    assert (given["WPNAV_SPEED_UP"], given["WP_SPD_UP"]) == (300.0, 3.0)
    assert (given["WPNAV_SPEED_DN"], given["WP_SPD_DN"]) == (200.0, 2.0)
    assert (given["RTL_ALT"], given["RTL_ALT_M"]) == (8000.0, 80.0)
    assert (given["ARMING_CHECK"], given["ARMING_SKIPCHK"]) == (0, -1)
    assert "ANGLE_MAX" not in given
    fast = parameters_of(replace(part, vehicle=replace(part.vehicle, speed_max_m_s=15.0)))
    assert "ANGLE_MAX" not in fast  # nobody is told to set what the plan does not count with
    leans = parameters_of(replace(part, vehicle=replace(part.vehicle, lean_angle_deg=45.0)))
    assert (leans["ANGLE_MAX"], leans["ATC_ANGLE_MAX"]) == (4500.0, 45.0)


def test_a_plane_gets_its_circle_its_speeds_and_the_direction_of_its_take_off() -> None:
    part = replace(a_part(ramp(), PLANE, turn_radius_m=90.0, climb_m_s=4.0), rtl_rel_home_m=120.0)
    given = parameters_of(part)
    assert (given["WP_LOITER_RAD"], given["RTL_ALTITUDE"], given["TECS_CLMB_MAX"]) == (90.0, 120.0, 4.0)
    assert given["AIRSPEED_CRUISE"] == 8.0
    assert given["AIRSPEED_MIN"] <= 8.0 <= given["AIRSPEED_MAX"]
    assert heading_of(part) == pytest.approx(90.0, abs=0.1)
    assert heading_of(a_part(ramp())) == 0.0


def test_a_taken_port_is_passed_over_without_a_call() -> None:
    """An SITL that waits for its ground station ends when a caller leaves."""
    free = instances.free_instance(60)
    with socket.create_server(("127.0.0.1", instances.port_of(free))) as taken:
        assert instances.free_instance(free) > free
        taken.settimeout(0.05)
        with pytest.raises(TimeoutError):
            taken.accept()


def test_an_sitl_counts_its_instances_in_a_byte(tmp_path: Path) -> None:
    """Number 256 would listen at the port of number 0."""
    assert instances.LAST_INSTANCE < 256
    with (
        pytest.raises(UsageError, match="at most 236 vehicles at once, and there are 237"),
        instances.sitl_instances(tmp_path, [a_part(ramp())] * 237),
    ):
        pass


def test_a_folder_without_the_vehicles_program_is_named(tmp_path: Path) -> None:
    where = ramp()
    (tmp_path / "arduplane").touch(mode=0o755)
    with (
        pytest.raises(UsageError, match="arducopter: a program that can be run is wanted"),
        instances.sitl_instances(tmp_path, [a_part(where)]),
    ):
        pass
