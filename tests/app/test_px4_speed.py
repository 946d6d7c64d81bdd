"""PX4's own limits of speed: in the plan, and held against the vehicle before an upload."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from gcsplan import upload
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.rehearse import rehearse
from gcsplan.errors import InputError
from gcsplan.mavlink.link.session.parameters import slower_words, speed_shortage
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.impatient import be_impatient


def text_of(**vehicle: Any) -> str:
    keys = {"name": "uav1", "sysid": 1, "autopilot": "px4", "start": [46.5, 8.0], "goal": [46.505, 8.0]}
    return yaml.safe_dump(
        {
            "version": 1, "name": "fast", "terrain": {"flat_m": 100, "vertical_datum": "EGM96"},
            "limits": {"min_agl_m": 40, "track_error_m": 3, "altitude_error_m": 5},
            "vehicles": [keys | {"speed_m_s": [3, 15]} | vehicle],
        }
    )  # fmt: skip


def loaded(**vehicle: Any) -> MissionFile:
    return load_mission("fast.yaml", text=text_of(**vehicle))


def test_a_px4_is_planned_no_faster_than_its_parameter_allows() -> None:
    capped, fast, slow = loaded(), loaded(mpc_xy_vel_max_m_s=20), loaded(speed_m_s=[3, 9])
    assert [f.vehicles[0].vehicle.speed_max_m_s for f in (capped, fast, slow)] == [12.0, 15.0, 9.0]
    [note] = [n for n in capped.notes if n.code == "velocity_bounds_speed"]
    assert (note.data["most_m_s"], note.data["wanted_m_s"], note.data["by_default"]) == (12.0, 15.0, True)
    assert "planned with 12 m/s, not 15" in str(note)
    assert "write mpc_xy_vel_max_m_s: 15, and set MPC_XY_VEL_MAX 15" in str(note)
    assert not any(n.code == "velocity_bounds_speed" for n in (*fast.notes, *slow.notes))
    with pytest.raises(InputError, match="is PX4's alone"):
        loaded(autopilot="arducopter", mpc_xy_vel_max_m_s=20)


def test_a_speed_that_is_not_flown_is_a_shortage_and_a_slower_vehicle_is_told() -> None:
    vehicle = loaded().vehicles[0].vehicle
    assert speed_shortage({"MPC_XY_VEL_MAX": 12.0}, vehicle, 12.0) is None
    assert speed_shortage({}, vehicle, 12.0) is None
    assert "set MPC_XY_VEL_MAX 12, or plan with speed_m_s up to 8" in str(
        speed_shortage({"MPC_XY_VEL_MAX": 8.0}, vehicle, 12.0)
    )
    stock = {
        "MPC_ACC_HOR": 3.0, "MPC_JERK_AUTO": 4.0, "MPC_XY_TRAJ_P": 0.5, "MPC_Z_V_AUTO_UP": 3.0, "MPC_Z_V_AUTO_DN": 1.5,
        "MPC_XY_CRUISE": 5.0,
    }  # fmt: skip
    assert slower_words(stock, vehicle) == slower_words({}, vehicle) == []
    [told] = slower_words(stock | {"MPC_XY_TRAJ_P": 0.3, "MPC_Z_V_AUTO_DN": 1.0}, vehicle)
    assert "MPC_XY_TRAJ_P times MPC_ACC_HOR is 0.9 on board, and 1.5 was planned with (corner_accel_m_s2)" in str(told)
    assert "MPC_Z_V_AUTO_DN is 1 on board" in str(told)


def test_a_px4_that_would_not_fly_the_speed_gets_no_mission(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)
    done = plan(loaded())
    for most, words in ((8.0, "MPC_XY_VEL_MAX is 8 on board"), (12.0, "")):
        board = LoopbackVehicle(
            1, Autopilot.PX4, lat_deg=46.5, lon_deg=8.0, amsl_m=100.0,
            parameters={"MPC_XY_VEL_MAX": most, "MPC_XY_CRUISE": 3.0},
        )  # fmt: skip
        with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
            [result] = upload(done, server.url_for_gcs)
        assert result.verified is not bool(words)
        if words:
            assert words in result.message
            assert board.items() == ()
        else:
            assert any("MPC_XY_CRUISE is 3 on board" in str(line) for line in result.warnings)


@pytest.mark.nightly
def test_the_simulated_px4_arrives_when_the_plan_says() -> None:
    zigzag = [[46.5 + 0.0012 * n, 8.0 + 0.0006 * (n % 2)] for n in range(1, 8)]
    for speed in (5, 10):
        done = plan(loaded(speed_m_s=speed, via=zigzag, goal=[46.5096, 8.0]))
        [flown] = rehearse(done).vehicles
        assert flown.planned_s is not None
        assert flown.planned_s > 1070.0 / speed + 20.0
        assert flown.errors_s[0] == pytest.approx(0.0, rel=0.0, abs=0.012 * flown.planned_s)
