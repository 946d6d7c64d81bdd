"""A rehearsal with real ArduCopters: they arm, fly their missions, and arrive at the planned times.

Needs the path of an arducopter binary, because each instance must start where its mission starts.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import parts_of, rehearse, rehearse_in_sitl
from gcsplan.errors import LinkError, UsageError
from gcsplan.mavlink.mission.commands import WAYPOINT
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.sitl.instances import sitl_instances
from gcsplan.vehicle import Autopilot
from sitl_tests import sitl

FLEET = """
version: 1
name: Two up the valley
terrain: {dem: "sample:jacksboro", vertical_datum: EGM96}
limits: {min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5, max_climb_deg: 15}
# It is rounded in legs of 15 to 18 m, which an ArduCopter flies at 3.6 to 4.1 m/s of its 9: 13 s of the flight.
no_fly:
  - {name: mast, center: [36.6238, -84.3848], radius_m: 150}
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    speed_m_s: [3, 9]
    start: [36.6175, -84.3892]
    goal: [36.6300, -84.3800]
  - name: uav2
    sysid: 2
    autopilot: arducopter
    speed_m_s: [3, 9]
    start: [36.6195, -84.3925]
    goal: [36.6300, -84.3830]
arrival: {mode: sequence, order: [uav2, uav1], interval_s: 10, separation_m: 30}
planner: {name: optimal, objective: length, seed: 1}
altitude_frame: relative
"""

WITHIN_S = 2.0
"""Most seconds that an arrival may differ from the plan."""


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    file = tmp_path_factory.mktemp("rehearsal") / "fleet.yaml"
    file.write_text(FLEET, encoding="utf-8")
    return plan(load_mission(file))


@sitl.needs(Autopilot.ARDUCOPTER, program=True)
def test_two_real_arducopters_arrive_as_planned_and_as_the_built_in_simulator(planned: Plan) -> None:
    reports: list[tuple[str, str]] = []
    result = rehearse_in_sitl(
        planned,
        binary=sitl.binary(Autopilot.ARDUCOPTER),
        speedup=10.0,
        report=lambda name, what: reports.append((name, what)),
    )
    assert result.simulator == "sitl"
    assert result.breaches == ()
    assert result.order_flown == ("uav2", "uav1")
    errors = [v.errors_s[0] for v in result.vehicles]
    assert errors == pytest.approx([0.0, 0.0], abs=WITHIN_S), f"arrival errors {errors}"
    ours = rehearse(planned)
    assert [v.arrive_s[0] for v in result.vehicles] == pytest.approx(
        [v.arrive_s[0] for v in ours.vehicles], abs=WITHIN_S
    )
    assert all(v.min_agl_m >= 60.0 for v in result.vehicles)
    assert result.closest is not None
    assert ours.closest is not None
    assert result.closest.distance_m == pytest.approx(ours.closest.distance_m, abs=25.0)
    assert {name for name, what in reports if what == "flies"} == {"uav1", "uav2"}


BELOW = """
version: 1
name: Down from the ridge
terrain: {dem: "sample:jacksboro", vertical_datum: EGM96}
limits: {min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5, max_climb_deg: 15}
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    speed_m_s: [3, 9]
    start: [36.6130, -84.2650]
    goal: [36.6180, -84.2560]
planner: {name: optimal, objective: length, seed: 1}
altitude_frame: relative
"""


@pytest.fixture(scope="module")
def below(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    file = tmp_path_factory.mktemp("below") / "below.yaml"
    file.write_text(BELOW, encoding="utf-8")
    planned = plan(load_mission(file))
    home_m = planned.vehicles[0].mission.home.amsl_m
    assert min(i.z for i in planned.vehicles[0].mission.items if i.command == WAYPOINT) < -40.0
    assert planned.world.ground_amsl(36.6180, -84.2560) < home_m - 100.0
    return planned


@sitl.needs(Autopilot.ARDUCOPTER, program=True)
@pytest.mark.parametrize("weather", [None, Weather(6.0, 270.0, 1.0)], ids=["calm", "wind"])
def test_it_flies_and_lands_below_home_over_the_missions_terrain(below: Plan, weather: Weather | None) -> None:
    result = rehearse_in_sitl(
        below, binary=sitl.binary(Autopilot.ARDUCOPTER), speedup=10.0, weather=weather, seed=3
    )  # fmt: skip
    assert result.breaches == ()
    (flown,) = result.vehicles
    assert flown.errors_s[0] == pytest.approx(0.0, abs=WITHIN_S)
    assert flown.min_agl_m >= 60.0
    goal_m = below.world.ground_amsl(36.6180, -84.2560)
    assert result.flown[0].points[-1, 2] == pytest.approx(goal_m, abs=2.0)
    assert result.weather == ({} if weather is None else weather.as_dict())
    # From the 65 m of the approach down to 10 m at full rate, from there slowly.
    assert flown.end_s[0] - flown.arrive_s[0] == pytest.approx(55.0 / 1.5 + 10.0 / 0.5, abs=8.0)


@sitl.needs(Autopilot.ARDUCOPTER, program=True)
def test_it_lands_slowly_above_home(tmp_path: Path) -> None:
    text = BELOW.replace("start: [36.6130, -84.2650]", "start: [36.6180, -84.2560]")
    file = tmp_path / "above.yaml"
    file.write_text(text.replace("goal: [36.6180, -84.2560]", "goal: [36.6150, -84.2610]"), encoding="utf-8")
    result = rehearse_in_sitl(plan(load_mission(file)), binary=sitl.binary(Autopilot.ARDUCOPTER), speedup=10.0)
    assert result.breaches == ()
    points, times = result.flown[0].points, result.flown[0].times_s
    low = points[:, 2] < points[-1, 2] + 4.0
    low &= times > result.vehicles[0].arrive_s[0]
    assert np.ptp(points[low, 2]) / np.ptp(times[low]) < 0.7


@sitl.needs(Autopilot.ARDUCOPTER, program=True)
def test_over_flat_ground_it_hits_that_and_reports_it(below: Plan) -> None:
    binary = sitl.binary(Autopilot.ARDUCOPTER)
    assert binary is not None
    with sitl_instances(binary, parts_of(below), speedup=10.0) as addresses:
        result = rehearse_in_sitl(below, addresses=addresses)
    (breach,) = [b for b in result.breaches if b.kind == "arrival"]
    assert "it hit the ground at 1." in str(breach.message)
    assert "m above the mission's ground: without terrain an SITL's ground is flat" in str(breach.message)


@pytest.mark.slow
def test_addresses_off_this_machine_are_refused_before_anything_is_opened(planned: Plan) -> None:
    with pytest.raises(UsageError, match="--i-know"):
        rehearse_in_sitl(planned, addresses={"uav1": "tcp:192.0.2.1:5760", "uav2": "tcp:127.0.0.1:5760"})


def test_a_program_that_is_no_autopilot_is_named(planned: Plan) -> None:
    with pytest.raises(LinkError, match="ended at once with code"):
        rehearse_in_sitl(planned, binary=Path("/bin/false"))
