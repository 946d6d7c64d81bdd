"""The vehicle's estimate of the wind beside the declared winds: what is among them, and what an upload says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.upload.job import UploadJob, UploadOptions
from gcsplan.app.upload.run import jobs_of, run_jobs
from gcsplan.app.upload.wind_on_board import wind_judge
from gcsplan.mavlink.link.watch import STANDBY, VehicleState, WindEstimate
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.parameters import set_up
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.wind.declared import DeclaredWind


def job(autopilot: str = "arducopter", url: str = "udpout:127.0.0.1:9", **keys: Any) -> UploadJob:
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": autopilot, "speed_m_s": [3, 10], "start": [36.6, -84.3],
        "goal": [36.6, -84.297],
    }  # fmt: skip
    planned = plan(
        {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}, "vehicles": [vehicle]} | keys
    )
    [found] = jobs_of(planned, {"uav1": url})
    return found


def said(of: UploadJob, speed_m_s: float, from_deg: float, deviation_m_s: float = 0.0) -> str | None:
    """The code of the note on an estimate; None for none, as for no estimate at speed 0."""
    to = np.radians(from_deg)
    wind = WindEstimate(float(-speed_m_s * np.sin(to)), float(-speed_m_s * np.cos(to)), deviation_m_s)
    state = VehicleState(Address(1, 1), 3, 2, armed=False, system_status=STANDBY, lat_deg=36.6, lon_deg=-84.3,
                         amsl_m=100.0, wind=wind if speed_m_s else None)  # fmt: skip
    judge = wind_judge(of)
    assert judge is not None
    note = judge(state)
    return None if note is None else note.code


AMONG, BEYOND = "wind_as_declared", "wind_not_as_declared"


@pytest.mark.slow
def test_an_estimate_is_held_beside_all_winds_of_the_set() -> None:
    span = job(wind={"speed_m_s": [3, 7], "from_deg": [250, 290]})
    assert said(span, 7.9, 290.0) == said(span, 2.1, 250.0) == said(span, 5.0, 270.0) == AMONG
    assert said(span, 8.1, 270.0) == said(span, 1.9, 270.0) == said(span, 5.0, 310.0) == BEYOND
    assert said(span, 9.9, 270.0, 1.5) == AMONG  # 2.9 m/s beyond, within twice the deviation
    assert said(job(wind={"speed_m_s": 5, "from_deg": 270, "gust_m_s": 9}), 9.9, 270.0) == AMONG
    assert said(job(wind={"up_to_m_s": 8}), 6.0, 123.4) == AMONG


@pytest.mark.slow
def test_still_air_is_declared_too_and_no_estimate_is_said_where_winds_are() -> None:
    still = job()
    assert (said(still, 0.9, 10.0), said(still, 1.1, 10.0), said(still, 0.0, 0.0)) == (AMONG, BEYOND, None)
    assert said(job(wind={"up_to_m_s": 8}), 0.0, 0.0) == "wind_not_estimated"


@pytest.mark.parametrize("seed", range(3))
def test_the_distance_to_a_set_is_that_to_the_nearest_of_many_winds_of_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    speeds, turns = np.sort(rng.uniform(0.0, 20.0, 2)), np.sort(rng.uniform(0.0, 360.0, 2))
    wind = DeclaredWind(speeds[None, None], turns[None, None])
    drawn_m_s, drawn_rad = (
        rng.uniform(speeds[0], speeds[1], 200_000),
        np.radians(rng.uniform(turns[0], turns[1], 200_000)),
    )
    vector = rng.uniform(-25.0, 25.0, 2)
    nearest = np.hypot(vector[0] + drawn_m_s * np.sin(drawn_rad), vector[1] + drawn_m_s * np.cos(drawn_rad)).min()
    assert wind.away_m_s((float(vector[0]), float(vector[1])), 0.0, 0.0, 0.0) == pytest.approx(nearest, abs=0.2)


@pytest.mark.nightly
@pytest.mark.parametrize("autopilot", ["arducopter", "arduplane", "px4"])
@pytest.mark.parametrize(("speed_m_s", "code"), [(5.2, AMONG), (9.0, BEYOND), (0.0, "wind_not_estimated")])
def test_each_autopilots_message_is_asked_for_before_an_upload(autopilot: str, speed_m_s: float, code: str) -> None:
    made = job(autopilot, wind={"speed_m_s": 5, "from_deg": 270})
    assert made.vehicle is not None
    vehicle = LoopbackVehicle.for_mission(made.mission, set_up(made.vehicle, made.mission.home))
    vehicle.wind = (speed_m_s, 270.0)
    server = SimServer([vehicle], "udpin:127.0.0.1:0").start()
    try:
        there = job(autopilot, server.url_for_gcs, wind={"speed_m_s": 5, "from_deg": 270})
        [result] = run_jobs([there], UploadOptions())
    finally:
        server.stop()
    assert result.verified
    assert [w.code for w in result.warnings if w.code.startswith("wind_")] == [code]
