"""A small table of parameters that simulated vehicles report, with each autopilot's names, types and defaults.

Sources: parameter lists of ArduCopter 4.6, ArduPlane 4.6 and PX4 1.15 (defaults of a quadrotor), and ArduPilot's list
of the names that 4.7 changed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass

from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mavlink.mission.parameter_list import parameter_list
from gcsplan.sim.vehicle.firmware import NAMES_UNITS, Firmware
from gcsplan.vehicle import DEFAULT_LEAN_DEG, LARGEST_LEAN_DEG, Autopilot, Vehicle, lean_for_deg

INT32, REAL32 = 6, 9  # MAV_PARAM_TYPE
INT8, INT16 = 2, 4
_WHOLE_RANGES = {INT8: (-(2**7), 2**7 - 1), INT16: (-(2**15), 2**15 - 1), INT32: (-(2**31), 2**31 - 1)}


@dataclass(frozen=True, slots=True)
class StoredParameter:
    """One value with its MAV_PARAM_TYPE."""

    kind: int
    value: float


def _r(value: float) -> StoredParameter:
    return StoredParameter(REAL32, value)


def _i(value: int, kind: int = INT32) -> StoredParameter:
    return StoredParameter(kind, value)


_ARDUPILOT = {
    "ARMING_CHECK": _i(1),
    "BATT_FS_CRT_ACT": _i(0, INT8),
    "BATT_FS_LOW_ACT": _i(0, INT8),
    "FENCE_ACTION": _i(1, INT8),
    "FENCE_ALT_MAX": _r(100.0),
    "FENCE_ALT_MIN": _r(-10.0),
    "FENCE_AUTOENABLE": _i(0, INT8),
    "FENCE_ENABLE": _i(0, INT8),
    "FENCE_MARGIN": _r(2.0),
    "FENCE_RADIUS": _r(300.0),
    "FENCE_TOTAL": _i(0, INT8),
    "MIS_OPTIONS": _i(0, INT16),
    "MIS_RESTART": _i(0, INT8),
    "MIS_TOTAL": _i(0, INT16),
    "RALLY_TOTAL": _i(0, INT8),
    "SYSID_MYGCS": _i(255, INT16),
    "TERRAIN_ENABLE": _i(1, INT8),
    "TERRAIN_OFS_MAX": _r(30.0),
    "TERRAIN_SPACING": _i(100, INT16),
}

PARAMETER_TABLES: dict[Autopilot, dict[str, StoredParameter]] = {
    Autopilot.ARDUCOPTER: {
        **_ARDUPILOT,
        "ANGLE_MAX": _i(3000, INT16),
        "DISARM_DELAY": _i(10, INT8),
        "FENCE_TYPE": _i(7, INT8),
        "FS_EKF_ACTION": _i(1, INT8),
        "FS_GCS_ENABLE": _i(0, INT8),
        "FS_THR_ENABLE": _i(1, INT8),
        "LAND_ALT_LOW": _i(1000, INT16),
        "LAND_SPEED": _i(50, INT16),
        "LAND_SPEED_HIGH": _i(0, INT16),
        "RTL_ALT": _i(1500),
        "RTL_ALT_FINAL": _i(0),
        "RTL_ALT_TYPE": _i(0, INT8),
        "RTL_CLIMB_MIN": _i(0, INT16),
        "RTL_CONE_SLOPE": _r(3.0),
        "RTL_LOIT_TIME": _i(5000),
        "RTL_SPEED": _i(0),
        "WPNAV_ACCEL": _r(250.0),
        "WPNAV_ACCEL_C": _r(0.0),
        "WPNAV_ACCEL_Z": _r(100.0),
        "WPNAV_JERK": _r(1.0),
        "WPNAV_RADIUS": _r(200.0),
        "WPNAV_SPEED": _r(1000.0),
        "WPNAV_SPEED_DN": _r(150.0),
        "WPNAV_SPEED_UP": _r(250.0),
        "WPNAV_TER_MARGIN": _r(10.0),
        "WP_NAVALT_MIN": _r(0.0),
    },
    Autopilot.ARDUPLANE: {
        **_ARDUPILOT,
        "AIRSPEED_CRUISE": _r(22.0),
        "AIRSPEED_MAX": _i(22, INT16),
        "AIRSPEED_MIN": _i(9, INT16),
        "FENCE_TYPE": _i(4, INT8),
        "FS_GCS_ENABL": _i(0, INT8),
        "FS_LONG_ACTN": _i(0, INT8),
        "Q_ENABLE": _i(0, INT8),
        "Q_TRANS_DECEL": _r(2.0),
        "ROLL_LIMIT_DEG": _r(45.0),
        "RTL_ALTITUDE": _r(100.0),
        "RTL_AUTOLAND": _i(0, INT8),
        "RTL_RADIUS": _i(0, INT16),
        "TECS_CLMB_MAX": _r(5.0),
        "TECS_SINK_MAX": _r(5.0),
        "TERRAIN_FOLLOW": _i(0),
        "THR_FAILSAFE": _i(1, INT8),
        "WP_LOITER_RAD": _i(60, INT16),
        "NAVL1_DAMPING": _r(0.75),
        "NAVL1_PERIOD": _r(17.0),
        "TECS_PITCH_MAX": _i(15, INT8),
        "WP_RADIUS": _i(90, INT16),
    },
    Autopilot.PX4: {
        "COM_DL_LOSS_T": _i(10),
        "COM_LOW_BAT_ACT": _i(0),
        "GF_ACTION": _i(2),
        "GF_MAX_HOR_DIST": _r(0.0),
        "GF_MAX_VER_DIST": _r(0.0),
        "MAV_SYS_ID": _i(1),
        "MIS_TAKEOFF_ALT": _r(2.5),
        "MIS_YAW_TMT": _r(-1.0),
        "MPC_ACC_HOR": _r(3.0),
        "MPC_JERK_AUTO": _r(4.0),
        "MPC_LAND_ALT1": _r(10.0),
        "MPC_LAND_ALT2": _r(5.0),
        "MPC_LAND_SPEED": _r(0.7),
        "MPC_TILTMAX_AIR": _r(45.0),
        "MPC_TKO_SPEED": _r(1.5),
        "MPC_XY_CRUISE": _r(5.0),
        "MPC_XY_TRAJ_P": _r(0.5),
        "MPC_XY_VEL_MAX": _r(12.0),
        "MPC_Z_V_AUTO_DN": _r(1.5),
        "MPC_Z_V_AUTO_UP": _r(3.0),
        "MPC_Z_VEL_MAX_DN": _r(1.5),
        "MPC_Z_VEL_MAX_UP": _r(3.0),
        "NAV_ACC_RAD": _r(2.0),
        "NAV_MC_ALT_RAD": _r(0.8),
        "NAV_DLL_ACT": _i(0),
        "NAV_RCL_ACT": _i(2),
        "RTL_CONE_ANG": _i(45),
        "RTL_DESCEND_ALT": _r(10.0),
        "RTL_LAND_DELAY": _r(0.0),
        "RTL_MIN_DIST": _r(10.0),
        "RTL_RETURN_ALT": _r(30.0),
        "RTL_TYPE": _i(0),
    },
}


_RENAMED_IN_4_7 = {
    "ANGLE_MAX": ("ATC_ANGLE_MAX", 0.01), "LAND_ALT_LOW": ("LAND_ALT_LOW_M", 0.01),
    "LAND_SPEED": ("LAND_SPD_MS", 0.01), "LAND_SPEED_HIGH": ("LAND_SPD_HIGH_MS", 0.01), "RTL_ALT": ("RTL_ALT_M", 0.01),
    "RTL_ALT_FINAL": ("RTL_ALT_FINAL_M", 0.01), "RTL_CLIMB_MIN": ("RTL_CLIMB_MIN_M", 0.01),
    "RTL_SPEED": ("RTL_SPEED_MS", 0.01), "WPNAV_ACCEL": ("WP_ACC", 0.01), "WPNAV_ACCEL_C": ("WP_ACC_CNR", 0.01),
    "WPNAV_ACCEL_Z": ("WP_ACC_Z", 0.01), "WPNAV_JERK": ("WP_JERK", 1.0), "WPNAV_RADIUS": ("WP_RADIUS_M", 0.01),
    "WPNAV_SPEED": ("WP_SPD", 0.01), "WPNAV_SPEED_DN": ("WP_SPD_DN", 0.01), "WPNAV_SPEED_UP": ("WP_SPD_UP", 0.01),
    "WPNAV_TER_MARGIN": ("WP_TER_MARGIN", 1.0),
    "SYSID_THISMAV": ("MAV_SYSID", 1.0), "SYSID_MYGCS": ("MAV_GCS_SYSID", 1.0),
}  # fmt: skip
"""Names of 4.6 with the name in 4.7 and the factor of the value; those in another unit are floats in 4.7."""


def _in_4_7(table: dict[str, StoredParameter]) -> dict[str, StoredParameter]:
    """Return a table of 4.6 with the names and units of 4.7."""
    renamed = {}
    for old, parameter in table.items():
        name, factor = _RENAMED_IN_4_7.get(old, (old, 1.0))
        # Hundredths are decimals: 1500 * 0.01 is not 15.
        renamed[name] = parameter if factor == 1.0 else _r(parameter.value / round(1.0 / factor))
    if "ARMING_CHECK" in renamed:  # a mask of the checks to skip, no longer of those to make
        del renamed["ARMING_CHECK"]
        renamed["ARMING_SKIPCHK"] = _i(0)
    return renamed


class Parameters:
    """The parameters of one vehicle, in alphabetical order, as autopilots list them.

    ``given``: values that differ from the defaults, by the oldest name and in its unit.
    """

    def __init__(
        self, autopilot: Autopilot, sysid: int, firmware: Firmware, given: Mapping[str, float] | None = None
    ) -> None:
        own_id = {} if autopilot is Autopilot.PX4 else {"SYSID_THISMAV": _i(sysid, INT16)}
        self._table = dict(sorted({**PARAMETER_TABLES[autopilot], **own_id}.items()))
        if autopilot is Autopilot.PX4:
            self._table["MAV_SYS_ID"] = _i(sysid)
        # PX4 stores an integer's bytes in the float field, ArduPilot its value.
        self._bytewise = autopilot is Autopilot.PX4
        for name, value in (given or {}).items():
            self._set(name, value)
        if firmware.has(NAMES_UNITS):
            self._table = dict(sorted(_in_4_7(self._table).items()))

    def __len__(self) -> int:
        return len(self._table)

    def names(self) -> list[str]:
        """Return all names in order: a parameter's index is its place in this list."""
        return list(self._table)

    def value(self, name: str) -> float:
        """Return a parameter's value. Raises KeyError for an unknown name."""
        return self._table[name].value

    def on_wire(self, name: str) -> tuple[float, int]:
        """Return ``(param_value, param_type)`` as in PARAM_VALUE."""
        parameter = self._table[name]
        if self._bytewise and parameter.kind != REAL32:
            return float(struct.unpack("<f", struct.pack("<i", int(parameter.value)))[0]), parameter.kind
        return parameter.value, parameter.kind

    def set_from_wire(self, name: str, wire: float) -> bool:
        """Apply the value of a PARAM_SET; return False if the name is unknown or the value does not fit."""
        parameter = self._table.get(name)
        if parameter is None:
            return False
        value = wire
        if self._bytewise and parameter.kind != REAL32:
            value = float(struct.unpack("<i", struct.pack("<f", wire))[0])
        return self._set(name, value)

    def _set(self, name: str, value: float) -> bool:
        parameter = self._table.get(name)
        if parameter is None:
            return False
        if not -3.5e38 < value < 3.5e38:  # NaN and infinities
            return False
        if parameter.kind != REAL32:
            low, high = _WHOLE_RANGES[parameter.kind]
            value = float(int(value))
            if not low <= value <= high:
                return False
        self._table[name] = StoredParameter(parameter.kind, value)
        return True


def set_up(vehicle: Vehicle, home: Home) -> dict[str, float]:
    """The parameters of a simulated vehicle that is set up as its mission file says, by their first names."""
    listed = parameter_list(Mission(vehicle.autopilot, home, ()), vehicle)
    return {s.parameter.names[0].name: s.parameter.names[0].value(s.value) for s in listed}


def lean_parameters(mission: Mission) -> dict[str, float]:
    """The parameters that a copter of this mission has: it leans as far as its speed needs."""
    if mission.autopilot is not Autopilot.ARDUCOPTER:
        return {}
    lean_deg = min(max(DEFAULT_LEAN_DEG, math.ceil(lean_for_deg(mission.commanded_m_s))), LARGEST_LEAN_DEG)
    return {"ANGLE_MAX": 100.0 * lean_deg}
