"""From a plan to its rehearsal: the command, the fleet's terms, and the way with autopilots that fly by themselves."""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.parallel.executor import Inline
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import late_of, parts_of, rehearse, rehearse_in_sitl, seats_of, terms_of, weather_of
from gcsplan.errors import CheckFailed, LinkError, UsageError, VehicleRefused
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.mission_flight import fly
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import RehearsalPart, Terms
from gcsplan.sim.rehearsal import track_of
from gcsplan.sim.sitl import flights
from gcsplan.sim.sitl.flights import rehearse_sitl, require_here
from gcsplan.sim.sitl.instances import parameters_of, sitl_instances
from gcsplan.sim.vehicle import hub, telemetry
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.parameters import REAL32, Parameters, StoredParameter
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.sim.vehicle.telemetry import Telemetry

FLEET = """
version: 1
name: Three in the valley
terrain: {dem: "sample:jacksboro", vertical_datum: EGM96}
limits: {min_agl_m: 60, horizontal_clearance_m: 30, track_error_m: 3, altitude_error_m: 5, max_climb_deg: 15}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.6175, -84.3892], goal: [36.6230, -84.3860]}
  - {name: uav2, sysid: 2, autopilot: arducopter, start: [36.6190, -84.3920], goal: [36.6240, -84.3880]}
  - {name: uav3, sysid: 3, autopilot: arducopter, start: [36.6205, -84.3950], goal: [36.6250, -84.3900]}
arrival: {mode: sequence, order: [uav3, uav1, uav2], interval_s: 8, separation_m: 30}
planner: {name: optimal, objective: length, seed: 1}
altitude_frame: relative
"""


WINDY = {
    "version": 1, "name": "windy", "terrain": {"flat_m": 300}, "limits": {"min_agl_m": 30},
    "wind": {"speed_m_s": [2, 6], "from_deg": [250, 300], "gust_m_s": 8},
    "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.6, -84.3],
                  "goal": [36.605, -84.3], "speed_m_s": [3, 10], "lean_angle_deg": 45}],
}  # fmt: skip


def test_runs_draw_from_the_declared_winds_unless_a_wind_is_given() -> None:
    source = load_mission(WINDY)
    assert weather_of(source, None, None, 0.0, 0.5) == Weather(noise_m=0.5, declared=source.wind)
    assert weather_of(source, 3.0, None, 0.0, 0.0) == Weather(3.0)
    assert weather_of(source, 0.0, None, 0.0, 0.0) == Weather()
    assert weather_of(source, None, None, 2.0, 0.0) == Weather(gusts_m_s=2.0)
    still = load_mission({key: value for key, value in WINDY.items() if key != "wind"})
    assert weather_of(still, None, None, 0.0, 0.0) == Weather()
    hour = "2026-11-24T10:00Z"
    assert weather_of(load_mission(WINDY | {"at": hour}), None, None, 0.0, 0.0).start_s == 1795514400.0


@pytest.mark.slow
def test_a_drawn_wind_is_told_in_the_document() -> None:
    planned = plan(load_mission(WINDY))
    result = rehearse(planned, weather=weather_of(planned.source, None, None, 0.0, 0.0), runs=2)
    assert result.runs == 2
    assert result.as_dict()["weather"]["drawn_from"] == {"most_m_s": 6.0, "gust_m_s": 8.0, "varying": False}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rehearsing") / "fleet.yaml"
    path.write_text(FLEET, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def planned(file: Path) -> Plan:
    return plan(load_mission(file))


# -- the built-in simulator -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_planned_fleet_arrives_within_half_a_second_of_its_plan_in_order_and_apart(planned: Plan) -> None:
    terms = terms_of(planned)
    assert (terms.order, terms.separation_m) == (("uav3", "uav1", "uav2"), 30.0)
    result = rehearse(planned)
    assert result.safe
    assert result.order_flown == terms.order
    assert result.intervals_kept_runs == 1
    assert abs(result.interval_error_s or 0.0) < 0.5
    assert all(abs(v.errors_s[0]) < 0.5 for v in result.vehicles)
    arrivals = [dict(zip([v.name for v in result.vehicles], result.vehicles, strict=True))[n] for n in terms.order]
    gaps = [b.arrive_s[0] - a.arrive_s[0] for a, b in pairwise(arrivals)]
    assert gaps == pytest.approx([8.0, 8.0], abs=0.5)
    assert result.closest is not None
    assert result.closest.distance_m > 30.0


@pytest.mark.nightly
def test_a_late_vehicle_is_judged_by_its_own_departure_and_the_fleet_by_its_plan(planned: Plan) -> None:
    late = rehearse(planned, late_s={"uav1": 5.0})
    assert (late.intervals_kept_runs, late.order_kept_runs) == (0, 1)
    assert abs(late.interval_error_s or 0.0) == pytest.approx(5.0, abs=0.5)
    assert [v.errors_s[0] for v in late.vehicles] == pytest.approx([5.0, 0.0, 0.0], abs=0.5)
    assert late.as_dict()["vehicles"][0]["late_s"] == 5.0
    lost = rehearse(planned, late_s={"uav1": 20.0})
    assert "order" in {breach.kind for breach in lost.breaches}
    assert "late" not in {breach.kind for breach in lost.breaches}


@pytest.mark.slow
def test_a_departure_within_its_window_is_drawn_in_each_run_and_arrives_inside() -> None:
    late = WINDY | {"vehicles": [WINDY["vehicles"][0] | {"depart_window_s": 30}]}  # type: ignore[index]
    planned = plan(load_mission({key: value for key, value in late.items() if key != "wind"}))
    result = rehearse(planned, runs=4)
    assert result.inside_windows == (4, 4)
    errors_s = result.vehicles[0].errors_s
    assert 0.0 < min(errors_s) < max(errors_s) < 30.5


def test_late_departures_are_read_by_name() -> None:
    assert late_of(["uav2=40", "uav1=0.5"], ["uav1", "uav2"]) == {"uav1": 0.5, "uav2": 40.0}
    for words in (["uav3=1"], ["uav1=-1"], ["uav1=nan"], ["40"], ["uav1=1", "uav1=2"]):
        with pytest.raises(UsageError, match="--late"):
            late_of(words, ["uav1", "uav2"])


# -- autopilots that fly by themselves --------------------------------------------------------------------------------


def test_seats_are_read_by_name_and_a_lone_vehicle_needs_none() -> None:
    assert seats_of(["a=tcp:127.0.0.1:5760", "b=udpin:127.0.0.1:14550"], ["a", "b"]) == {
        "a": "tcp:127.0.0.1:5760",
        "b": "udpin:127.0.0.1:14550",
    }
    assert seats_of(["tcp:127.0.0.1:5760"], ["a"]) == {"a": "tcp:127.0.0.1:5760"}
    for words in (["tcp:127.0.0.1:5760"], ["c=tcp:127.0.0.1:5760"], ["a=tcp:127.0.0.1:1", "a=tcp:127.0.0.1:2"]):
        with pytest.raises(UsageError):
            seats_of(words, ["a", "b"])


@pytest.mark.parametrize("url", ["tcp:192.0.2.7:5760", "udpin:0.0.0.0:14550", "/dev/ttyUSB0,57600", "udpout:host:1"])
def test_links_that_may_lead_to_a_real_aircraft_are_refused(url: str) -> None:
    with pytest.raises(UsageError, match="--i-know"):
        require_here([url])
    require_here(["tcp:127.0.0.1:5760", "udpin:localhost:14550"])


@pytest.mark.slow
def test_an_instance_is_given_the_vehicles_own_speeds(planned: Plan) -> None:
    part = parts_of(planned)[0]
    given = parameters_of(part)
    assert given["WPNAV_SPEED"] == pytest.approx(100.0 * part.mission.commanded_m_s, abs=0.01)
    assert (given["RTL_SPEED"], given["WPNAV_SPEED_UP"], given["WPNAV_SPEED_DN"]) == (1000.0, 250.0, 150.0)
    assert given["ANGLE_MAX"] == 3000  # as far as it was planned with
    free = replace(part, vehicle=replace(part.vehicle, lean_angle_deg=None))
    assert "ANGLE_MAX" not in parameters_of(free)  # no more than a pilot is told to set
    slow = replace(free, vehicle=replace(free.vehicle, speed_max_m_s=8.0), rtl_rel_home_m=80.0)
    assert parameters_of(slow)["RTL_ALT"] == 8000.0


def test_a_program_that_ends_or_is_none_is_named(planned: Plan, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a program that can be run"):
        rehearse_in_sitl(planned, binary=tmp_path / "nothing")
    with (
        pytest.raises(LinkError, match="ended at once with code 1"),
        sitl_instances(Path("/bin/false"), parts_of(planned)),
    ):
        pass


SPEEDUP = 40.0


@contextmanager
def flying(
    parts: list[RehearsalPart],
    planned: Plan,
    monkeypatch: pytest.MonkeyPatch,
    *,
    simulator: bool = True,
    arms: bool = True,
) -> Iterator[dict[str, str]]:
    """Loopback vehicles that fly as our own simulator does, their clocks faster than ours: peers as an SITL is one."""
    flown = fly([track_of(p, p.mission, planned.world, None) for p in parts], [0.0] * len(parts))
    traces = {p.vehicle.sysid: flown.trace(i) for i, p in enumerate(parts)}

    class Flying(Telemetry):
        def __init__(self, vehicle: LoopbackVehicle) -> None:
            super().__init__(vehicle)
            self._trace, self._started = traces[vehicle.sysid], math.inf

        def _carry_out(self, message: Any, now: float) -> tuple[int, list[Any]]:
            if message.command == mav.MAV_CMD_COMPONENT_ARM_DISARM and not arms:
                return 4, [mav.MAVLink_statustext_message(6, b"Arm: no")]
            if message.command == mav.MAV_CMD_MISSION_START:
                self._started = now
            return super()._carry_out(message, now)

        def each_second(self, now: float) -> list[Any]:
            said = [m for m in super().each_second(now) if m.get_type() != "GLOBAL_POSITION_INT"]
            if not said:
                return []
            if now - self._started > self._trace.end_s + 2.0:
                self._vehicle.armed = False
            return [self._place(now - 1.0 + k / 10.0) for k in range(1, 11)] + said

        def _place(self, now: float) -> Any:
            t = max(0.0, now - self._started)
            (place,), (after,) = self._trace.at([t]), self._trace.at([t + 0.05])  # type: ignore[arg-type]
            lat, lon = (float(x) for x in planned.world.frame.to_degrees(place[0], place[1]))
            v = [round(float(x) * 2000.0) for x in after - place]
            return mav.MAVLink_global_position_int_message(
                self._boot_ms(now), round(lat * 1e7), round(lon * 1e7), round(place[2] * 1000), 0, v[1], v[0], -v[2], 0
            )

        def _mission_current(self, now: float) -> Any:
            t = now - self._started
            piece = min(int((self._trace.times_s <= t).sum()) - 1, len(self._trace.seq) - 1)
            return mav.MAVLink_mission_current_message(int(self._trace.seq[piece]) if t >= 0 else 0)

    class Simulators(Parameters):
        def __init__(self, *of_vehicle: Any) -> None:
            super().__init__(*of_vehicle)
            self._table["SIM_SPEEDUP"] = StoredParameter(REAL32, 1.0)

    monkeypatch.setattr(hub, "Telemetry", Flying)
    if simulator:
        monkeypatch.setattr(telemetry, "Parameters", Simulators)
    with ExitStack() as stack:
        seats = {}
        for p in parts:
            home = p.mission.home
            vehicle = LoopbackVehicle(
                p.vehicle.sysid, p.vehicle.autopilot, lat_deg=home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7,
                amsl_m=home.amsl_m,
            )  # fmt: skip
            server = stack.enter_context(SimServer([vehicle], "tcpin:127.0.0.1:0", speedup=SPEEDUP))
            seats[p.vehicle.name] = server.url_for_gcs
        yield seats


@pytest.mark.nightly
def test_vehicles_that_fly_by_themselves_are_armed_released_watched_and_judged(
    planned: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    parts = parts_of(planned)
    said: list[tuple[str, str]] = []
    with flying(parts, planned, monkeypatch) as seats:
        result = rehearse_sitl(
            parts, planned.world, terms_of(planned), seats, report=lambda name, what: said.append((name, what))
        )
    assert result.simulator == "sitl"
    assert result.breaches == ()
    # They leave at once. Their clock runs 40 times as fast as ours, so when they are released is less certain.
    assert [v.errors_s[0] for v in result.vehicles] == pytest.approx([-flights.LIFT_S] * 3, abs=3.0)
    assert all(v.min_agl_m > 60.0 for v in result.vehicles)  # 65 is flown; on a busy machine it is seen seldom
    assert result.closest is not None
    assert {"waits for its position", "arms", "flies", "flies item 3"} <= {what for _, what in said}


def one(planned: Plan) -> list[RehearsalPart]:
    return parts_of(planned)[:1]


@pytest.mark.slow
def test_what_is_no_simulator_is_never_armed(planned: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = one(planned)
    with (
        flying(parts, planned, monkeypatch, simulator=False) as seats,
        pytest.raises(VehicleRefused, match="no simulator"),
    ):
        rehearse_sitl(parts, planned.world, Terms(), seats)


@pytest.mark.slow
def test_a_vehicle_that_will_not_arm_is_given_up_with_its_own_words(
    planned: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flights, "ARM_S", 0.3)
    parts = one(planned)
    with (
        flying(parts, planned, monkeypatch, arms=False) as seats,
        pytest.raises(VehicleRefused, match="does not take command 400"),
    ):
        rehearse_sitl(parts, planned.world, Terms(), seats)


@pytest.mark.slow
def test_a_vehicle_that_falls_silent_in_the_air_is_a_dead_link(planned: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flights, "SILENT_S", 0.3)
    parts = one(planned)
    with flying(parts, planned, monkeypatch) as seats:
        monkeypatch.setattr(
            "gcsplan.sim.vehicle.loopback.LoopbackVehicle.flying_mission", property(lambda _: True, _go_silent)
        )
        with pytest.raises(LinkError, match="silent"):
            rehearse_sitl(parts, planned.world, Terms(), seats)


def _go_silent(vehicle: LoopbackVehicle, value: bool) -> None:
    if vehicle.armed and vehicle.mode == 3:  # AUTO
        vehicle.misbehave = Misbehaviour(silent_after=0)


def test_vehicles_without_an_address_and_other_autopilots_are_refused(planned: Plan) -> None:
    parts = parts_of(planned)
    with pytest.raises(UsageError, match="uav1 has no address"):
        rehearse_sitl(parts, planned.world, Terms(), {})
    px4 = replace(parts[0], vehicle=replace(parts[0].vehicle, autopilot="px4"))
    with pytest.raises(UsageError, match="flies ArduCopter"):
        rehearse_sitl([px4], planned.world, Terms(), {"uav1": "tcp:127.0.0.1:5760"})


@pytest.mark.slow
def test_a_mission_that_did_not_pass_is_not_sent_to_them(planned: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    part = one(planned)[0]
    bad = replace(part, mission=replace(part.mission, items=part.mission.items[:-1]))
    with flying([part], planned, monkeypatch) as seats, pytest.raises(CheckFailed, match="another mission"):
        rehearse_sitl([bad], planned.world, Terms(), seats)


# -- an executor --------------------------------------------------------------------------------------------------


class TwoAtOnce(Inline):
    """Two workers that are this process; pieces come back in the wrong order, through pickle."""

    count = 2  # type: ignore[assignment]

    def each(self, function: Any, shared: Any, items: Any, **_: Any) -> Any:
        for number in reversed(range(len(items))):
            sent = pickle.loads(pickle.dumps((function, shared, items[number])))
            yield number, pickle.loads(pickle.dumps(sent[0](*sent[1:])))


@pytest.mark.slow
@pytest.mark.nightly_but("2")
@pytest.mark.parametrize("runs", [2, 7])
def test_whoever_flies_the_runs_the_result_is_the_same(planned: Plan, monkeypatch: Any, runs: int) -> None:
    """Strong noise, so that limits are broken in some runs and the order is lost in some."""
    asked: dict[str, Any] = {"weather": Weather(3.0, None, 2.0, 15.0), "runs": runs, "seed": 4}
    alone = rehearse(planned, **asked)
    assert not alone.safe

    @contextmanager
    def two(*_: Any, **__: Any) -> Iterator[TwoAtOnce]:
        yield TwoAtOnce()

    monkeypatch.setattr("gcsplan.app.rehearse.executor", two)
    monkeypatch.setattr("gcsplan.app.rehearse.Inline", ())
    told: list[int] = []
    shared = rehearse(planned, **asked, progress=lambda done, _: told.append(done))
    assert json.dumps(shared.as_dict()) == json.dumps(alone.as_dict())
    assert shared.breaches == alone.breaches
    assert [t.points.tolist() for t in shared.flown] == [t.points.tolist() for t in alone.flown]
    assert told[-1] == runs
    assert len(told) == 2
