"""Vehicles with the parameters of real firmware: what a version does not have is no missing answer."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.mavlink.mission.parameter_names import PARAMETERS
from gcsplan.sim.vehicle import telemetry
from gcsplan.sim.vehicle.firmware import ARDUPILOT_FAMILY, PX4_FAMILY, Firmware
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.parameters import Parameters, StoredParameter
from gcsplan.vehicle import Autopilot
from tests.app.test_parameters import CORNER, CRUISE, LAT, LON, WING, keys, planned, sent
from tests.support.impatient import be_impatient

OLD_COPTER = """
    WPNAV_SPEED WPNAV_SPEED_UP WPNAV_SPEED_DN WPNAV_ACCEL WPNAV_ACCEL_Z WPNAV_JERK WPNAV_RADIUS ANGLE_MAX LAND_SPEED
    LAND_SPEED_HIGH LAND_ALT_LOW WPNAV_TER_MARGIN
    RTL_SPEED RTL_ALT RTL_ALT_TYPE RTL_ALT_FINAL RTL_CLIMB_MIN RTL_CONE_SLOPE RTL_LOIT_TIME
    TERRAIN_ENABLE TERRAIN_SPACING TERRAIN_OFS_MAX
"""
PLANE = "WP_RADIUS WP_LOITER_RAD RTL_RADIUS NAVL1_PERIOD NAVL1_DAMPING TECS_CLMB_MAX TECS_SINK_MAX TECS_PITCH_MAX "
MULTICOPTER = """
    MPC_XY_VEL_MAX MPC_XY_CRUISE MPC_Z_V_AUTO_UP MPC_Z_V_AUTO_DN MPC_LAND_SPEED MPC_ACC_HOR MPC_JERK_AUTO MPC_XY_TRAJ_P
    MPC_LAND_ALT1 MPC_LAND_ALT2 MPC_TKO_SPEED NAV_ACC_RAD NAV_MC_ALT_RAD RTL_RETURN_ALT
    RTL_TYPE RTL_CONE_ANG RTL_LAND_DELAY
"""
RENAMED = {
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", 100.0), "AIRSPEED_MAX": ("ARSPD_FBW_MAX", 1.0),
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", 1.0), "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", 100.0),
    "RTL_ALTITUDE": ("ALT_HOLD_RTL", 100.0),
}  # fmt: skip
NEW_PLANE = PLANE + " ".join(RENAMED)
OLD_PLANE = PLANE + " ".join(name for name, _ in RENAMED.values())
NAMES: dict[tuple[Autopilot, tuple[int, int]], str] = {
    (Autopilot.ARDUCOPTER, (4, 3)): OLD_COPTER,
    (Autopilot.ARDUCOPTER, (4, 4)): OLD_COPTER + "WPNAV_ACCEL_C",
    (Autopilot.ARDUCOPTER, (4, 5)): OLD_COPTER + "WPNAV_ACCEL_C",
    (Autopilot.ARDUCOPTER, (4, 6)): OLD_COPTER + "WPNAV_ACCEL_C",
    (Autopilot.ARDUPLANE, (4, 3)): OLD_PLANE,
    (Autopilot.ARDUPLANE, (4, 5)): NEW_PLANE,
    (Autopilot.ARDUPLANE, (4, 6)): NEW_PLANE,
    (Autopilot.PX4, (1, 14)): MULTICOPTER,
    (Autopilot.PX4, (1, 16)): MULTICOPTER,
}
"""Names that decide, in ArduPilot's own parameter lists of those versions; none of them has a PARAM_ERROR."""


def board_of(
    monkeypatch: pytest.MonkeyPatch, autopilot: Autopilot, version: tuple[int, int], mute: str = "", **given: float
) -> LoopbackVehicle:
    """A vehicle that has exactly those deciding parameters of its version, and says nothing to other names."""
    deciding = {name for p in PARAMETERS[autopilot].values() for name in p.group()}

    class Known(Parameters):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            table = dict(self._table)
            for new, (old, per_unit) in RENAMED.items():
                if new in table:
                    table[old] = StoredParameter(9, per_unit * table[new].value)
            wanted = set(NAMES[autopilot, version].split())
            assert wanted <= set(table), wanted - set(table)
            self._table = {name: table[name] for name in sorted(table) if name in wanted or name not in deciding}

    monkeypatch.setattr(telemetry, "Parameters", Known)
    firmware = Firmware(PX4_FAMILY if autopilot is Autopilot.PX4 else ARDUPILOT_FAMILY, version)
    return LoopbackVehicle(
        1, autopilot, lat_deg=LAT, lon_deg=LON, amsl_m=100.0, parameters=given, firmware=firmware,
        misbehave=Misbehaviour(mute=mute),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


@pytest.mark.first_quick
@pytest.mark.parametrize(("autopilot", "version"), NAMES)
def test_an_ordinary_vehicle_of_each_version_is_accepted(
    monkeypatch: pytest.MonkeyPatch, autopilot: Autopilot, version: tuple[int, int]
) -> None:
    wing = autopilot is Autopilot.ARDUPLANE
    own = WING if wing else CORNER | {"autopilot": autopilot.value, "rtl_rel_home_m": 60}
    given = {Autopilot.ARDUPLANE: CRUISE, Autopilot.PX4: {"RTL_RETURN_ALT": 60.0}}.get(autopilot, {"RTL_ALT": 6000.0})
    done = planned(keys(**own), **({} if wing else {"way_home": "required"}))
    result = sent(done, board_of(monkeypatch, autopilot, version, **given), timeout_s=2.0)
    assert (result.outcome, result.code) == ("accepted", 0), result.message


def test_what_the_firmware_has_and_does_not_answer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    vehicle = board_of(monkeypatch, Autopilot.ARDUCOPTER, (4, 4), mute="WPNAV_ACCEL_C")
    result = sent(planned(keys()), vehicle, timeout_s=0.6)
    assert (result.outcome, result.reason) == ("refused", "parameters")
    assert "WPNAV_ACCEL_C or WP_ACC_CNR could not be read" in result.message
