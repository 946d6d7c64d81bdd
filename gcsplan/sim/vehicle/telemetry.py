"""A vehicle's messages outside the mission protocol: heartbeats, position, parameters, and answers to commands.

They suffice for ground stations to treat it as a vehicle. Messages in, messages out; time is an argument, and nothing
is sent here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.sim.vehicle.firmware import TELLS_MISSION_STATE
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.parameters import Parameters
from gcsplan.sim.vehicle.terrain_memory import TerrainMemory
from gcsplan.vehicle import Autopilot

Message: TypeAlias = Any  # a MAVLink_message; pymavlink carries no types

_ACCEPTED, _TEMPORARILY_REJECTED, _DENIED, _UNSUPPORTED = 0, 1, 2, 3  # MAV_RESULT
_BOOT, _STANDBY, _ACTIVE = 1, 3, 4  # MAV_STATE
_MAGIC_FORCE = 21196  # param2 of arm/disarm: override the arming checks

# Custom modes in which the mission is flown: ArduCopter and ArduPlane AUTO, PX4 AUTO.MISSION.
_MISSION_MODE = {Autopilot.ARDUCOPTER: 3, Autopilot.ARDUPLANE: 10, Autopilot.PX4: (4 << 16) | (4 << 24)}
_FIRST_MODE = {Autopilot.ARDUCOPTER: 0, Autopilot.ARDUPLANE: 0, Autopilot.PX4: 3 << 16}

_COMMON_CAPABILITIES = (
    mav.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mav.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mav.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mav.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)


class Telemetry:
    """One vehicle's telemetry. ``now`` is the time of `LoopbackVehicle`'s clock, seconds."""

    def __init__(self, vehicle: LoopbackVehicle) -> None:
        self._vehicle = vehicle
        self.parameters = Parameters(vehicle.autopilot, vehicle.sysid, vehicle.firmware, vehicle.parameters)
        vehicle.mode = _FIRST_MODE[vehicle.autopilot]
        self._began: float | None = None
        self._muted = 0
        self._terrain: TerrainMemory | None = None
        self._tells_terrain = False
        self._by_id: dict[int, Callable[[float], Message]] = {
            mav.MAVLINK_MSG_ID_HEARTBEAT: self.heartbeat,
            mav.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mav.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw_int,
            mav.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mav.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position_int,
            mav.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mav.MAVLINK_MSG_ID_HOME_POSITION: self._home_position,
            mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_sys_state,
            mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._autopilot_version,
        }
        if vehicle.wind is not None:
            kind = mav.MAVLINK_MSG_ID_WIND if vehicle.autopilot.is_ardupilot else mav.MAVLINK_MSG_ID_WIND_COV
            self._by_id[kind] = self._wind
        if vehicle.autopilot.is_ardupilot:
            self._by_id[mav.MAVLINK_MSG_ID_TERRAIN_REPORT] = self._terrain_report

    def _boot_ms(self, now: float) -> int:
        if self._began is None:
            self._began = now
        return int((now - self._began) * 1000) % 2**32

    # sent without a request

    def each_second(self, now: float) -> list[Message]:
        """Return the messages sent once a second: only the heartbeat while booting, none while it is unreachable."""
        if not self._vehicle.reachable(now):
            return []
        if self._vehicle.booting(now):
            return [self.heartbeat(now)]
        return [
            self.heartbeat(now),
            self._sys_status(now),
            self._gps_raw_int(now),
            self._attitude(now),
            self._global_position_int(now),
            self._mission_current(now),
            self._home_position(now),
            self._extended_sys_state(now),
            *self._terrain_messages(now),
        ]

    def heartbeat(self, now: float) -> Message:
        """Return HEARTBEAT with the vehicle's type, autopilot, mode and state."""
        vehicle = self._vehicle
        plane = vehicle.autopilot is Autopilot.ARDUPLANE
        base_mode = (
            mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            | mav.MAV_MODE_FLAG_STABILIZE_ENABLED
            | mav.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
            | (mav.MAV_MODE_FLAG_AUTO_ENABLED if vehicle.mode == _MISSION_MODE[vehicle.autopilot] else 0)
            | (mav.MAV_MODE_FLAG_SAFETY_ARMED if vehicle.armed else 0)
        )
        return mav.MAVLink_heartbeat_message(
            mav.MAV_TYPE_FIXED_WING if plane else mav.MAV_TYPE_QUADROTOR,
            mav.MAV_AUTOPILOT_ARDUPILOTMEGA if vehicle.autopilot.is_ardupilot else mav.MAV_AUTOPILOT_PX4,
            base_mode,
            vehicle.mode,
            _BOOT if vehicle.booting(now) else _ACTIVE if vehicle.armed else _STANDBY,
            3,
        )

    def _sys_status(self, now: float) -> Message:
        sensors = (
            mav.MAV_SYS_STATUS_SENSOR_3D_GYRO
            | mav.MAV_SYS_STATUS_SENSOR_3D_ACCEL
            | mav.MAV_SYS_STATUS_SENSOR_3D_MAG
            | mav.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
            | mav.MAV_SYS_STATUS_SENSOR_GPS
            | mav.MAV_SYS_STATUS_PREARM_CHECK
        )
        fence = mav.MAV_SYS_STATUS_GEOFENCE  # present and healthy, not enabled
        return mav.MAVLink_sys_status_message(
            sensors | fence, sensors, sensors | fence, 100, 12600, 50, 98, 0, 0, 0, 0, 0, 0
        )

    def _gps_raw_int(self, now: float) -> Message:
        home = self._vehicle.home
        return mav.MAVLink_gps_raw_int_message(
            int(now * 1e6) % 2**64, 3, home.lat_e7, home.lon_e7, self._amsl_mm(), 80, 120, 0, 0, 12
        )

    def _attitude(self, now: float) -> Message:
        return mav.MAVLink_attitude_message(self._boot_ms(now), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def _global_position_int(self, now: float) -> Message:
        home = self._vehicle.home
        return mav.MAVLink_global_position_int_message(
            self._boot_ms(now), home.lat_e7, home.lon_e7, self._amsl_mm(), 0, 0, 0, 0, 0
        )

    def _amsl_mm(self) -> int:
        return max(-(2**31), min(2**31 - 1, round(self._vehicle.home.amsl_m * 1000)))

    def _mission_current(self, now: float) -> Message:
        vehicle = self._vehicle
        items, flying = len(vehicle.items()), vehicle.flying_mission
        if vehicle.autopilot.is_ardupilot:  # home is not counted
            items = max(0, items - 1)
            return mav.MAVLink_mission_current_message(0, items, _mission_state(items, flying), int(flying))
        if not vehicle.firmware.has(TELLS_MISSION_STATE):
            return mav.MAVLink_mission_current_message(0, items or 65535, 0, 0)
        return mav.MAVLink_mission_current_message(0, items or 65535, _mission_state(items, flying), 1 if flying else 2)

    def _home_position(self, now: float) -> Message:
        home = self._vehicle.home
        quaternion = [1.0, 0.0, 0.0, 0.0]
        return mav.MAVLink_home_position_message(
            home.lat_e7, home.lon_e7, self._amsl_mm(), 0.0, 0.0, 0.0, quaternion, 0.0, 0.0, 0.0, int(now * 1e6) % 2**64
        )

    def _extended_sys_state(self, now: float) -> Message:
        return mav.MAVLink_extended_sys_state_message(0, 1)  # no VTOL; on the ground

    def _autopilot_version(self, now: float) -> Message:
        terrain = mav.MAV_PROTOCOL_CAPABILITY_TERRAIN
        if self._vehicle.autopilot.is_ardupilot:
            capabilities = _COMMON_CAPABILITIES | terrain | mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        else:
            capabilities = _COMMON_CAPABILITIES | mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        nothing, version = [0] * 8, self._vehicle.firmware.flight_sw_version
        return mav.MAVLink_autopilot_version_message(
            capabilities, version, 0, 0, 0, nothing, nothing, nothing, 0, 0, self._vehicle.sysid
        )

    @property
    def terrain(self) -> TerrainMemory | None:
        """The terrain on board; None with TERRAIN_ENABLE 0, and for PX4."""
        if not self._vehicle.autopilot.is_ardupilot or not self.parameters.value("TERRAIN_ENABLE"):
            return None
        spacing_m = int(self.parameters.value("TERRAIN_SPACING"))
        if self._terrain is None or self._terrain.grid.spacing_m != spacing_m:
            self._terrain = TerrainMemory(spacing_m)
        return self._terrain

    def _wind(self, now: float) -> Message:
        speed_m_s, from_deg = self._vehicle.wind or (0.0, 0.0)
        if self._vehicle.autopilot.is_ardupilot:
            return mav.MAVLink_wind_message(from_deg, speed_m_s, 0.0)
        from_rad, alt_m = math.radians(from_deg), self._vehicle.home.amsl_m
        north_m_s, east_m_s = -speed_m_s * math.cos(from_rad), -speed_m_s * math.sin(from_rad)
        return mav.MAVLink_wind_cov_message(int(now * 1e6), north_m_s, east_m_s, 0.0, 0.1, 0.0, alt_m, 0.0, 0.0)

    def _terrain_report(self, now: float) -> Message:
        home, terrain = self._vehicle.home, self.terrain
        if terrain is None:
            return mav.MAVLink_terrain_report_message(home.lat_e7, home.lon_e7, 0, 0.0, 0.0, 0, 0)
        return terrain.report(home.lat_e7, home.lon_e7, home.amsl_m)

    def _terrain_messages(self, now: float) -> list[Message]:
        """The messages of the stream of terrain, which a link carries on request alone."""
        terrain = self.terrain if self._tells_terrain else None
        if terrain is None:
            return []
        terrain.look_around(self._vehicle.home, self._vehicle.items())
        request = terrain.request(now)
        return [self._terrain_report(now), *([] if request is None else [request])]

    def _terrain_data(self, message: Message, now: float) -> list[Message]:
        if self.terrain is not None:
            self.terrain.take(message)
        return []

    def _terrain_check(self, message: Message, now: float) -> list[Message]:
        terrain = self.terrain
        return [] if terrain is None else [terrain.report(message.lat, message.lon, self._vehicle.home.amsl_m)]

    # sent on request

    def answer(self, message: Message, now: float) -> list[Message]:
        """Return the answers to a message outside the mission protocol; none if it is not understood."""
        if not self._vehicle.reachable(now) or not self._is_for_us(message):
            return []
        handlers: dict[str, Callable[[Message, float], list[Message]]] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "PARAM_REQUEST_LIST": self._param_list,
            "PARAM_REQUEST_READ": self._param_read,
            "PARAM_SET": self._param_set,
            "SET_MODE": self._set_mode,
            "TIMESYNC": self._timesync,
            "PING": self._ping,
            "TERRAIN_DATA": self._terrain_data,
            "TERRAIN_CHECK": self._terrain_check,
            "AUTOPILOT_VERSION_REQUEST": lambda _, at: [self._autopilot_version(at)],
        }
        handler = handlers.get(message.get_type())
        return handler(message, now) if handler else []

    def _is_for_us(self, message: Message) -> bool:
        sysid, compid = getattr(message, "target_system", 0), getattr(message, "target_component", 0)
        return sysid in (0, self._vehicle.sysid) and compid in (0, self._vehicle.compid)

    def _command(self, message: Message, now: float) -> list[Message]:
        source = (message.get_srcSystem(), message.get_srcComponent())
        result, more = self._carry_out(message, now)
        ack = mav.MAVLink_command_ack_message(message.command, result, 0, 0, *source)
        return [ack, *more]

    def _carry_out(self, message: Message, now: float) -> tuple[int, list[Message]]:
        vehicle, command = self._vehicle, message.command
        if command == mav.MAV_CMD_COMPONENT_ARM_DISARM:
            if message.param1 not in (0.0, 1.0):
                return _DENIED, []
            if message.param1 == 1.0 and vehicle.booting(now) and message.param2 != _MAGIC_FORCE:
                return _TEMPORARILY_REJECTED, []
            vehicle.armed = message.param1 == 1.0
            self._update_flying()
            return _ACCEPTED, []
        if command == mav.MAV_CMD_DO_SET_MODE:
            main, sub = _whole(message.param2), _whole(message.param3)
            vehicle.mode = main if vehicle.autopilot.is_ardupilot else (main % 256 << 16) | (sub % 256 << 24)
            self._update_flying()
            return _ACCEPTED, []
        if command == mav.MAV_CMD_MISSION_START:
            if not vehicle.items():
                return _DENIED, []
            vehicle.mode = _MISSION_MODE[vehicle.autopilot]
            self._update_flying()
            return _ACCEPTED, []
        if command == mav.MAV_CMD_REQUEST_MESSAGE:
            build = self._by_id.get(_whole(message.param1))
            return (_ACCEPTED, [build(now)]) if build else (_UNSUPPORTED, [])
        if command == mav.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
            return _ACCEPTED, [self._autopilot_version(now)]
        if command == mav.MAV_CMD_GET_HOME_POSITION:
            return _ACCEPTED, [self._home_position(now)]
        if command == mav.MAV_CMD_SET_MESSAGE_INTERVAL:  # accepted, but everything is still sent once a second
            requested = _whole(message.param1)
            if requested == mav.MAVLINK_MSG_ID_TERRAIN_REQUEST and vehicle.autopilot.is_ardupilot:
                self._tells_terrain = message.param2 > 0.0
                return _ACCEPTED, []
            return (_ACCEPTED if requested in self._by_id else _DENIED), []
        return _UNSUPPORTED, []

    def _update_flying(self) -> None:
        vehicle = self._vehicle
        vehicle.flying_mission = vehicle.armed and vehicle.mode == _MISSION_MODE[vehicle.autopilot]

    def _set_mode(self, message: Message, now: float) -> list[Message]:
        if message.base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            self._vehicle.mode = message.custom_mode
            self._update_flying()
        return []

    def _param_list(self, message: Message, now: float) -> list[Message]:
        return list(self._param_values(self.parameters.names()))

    def _param_read(self, message: Message, now: float) -> list[Message]:
        names = self.parameters.names()
        if message.param_index >= 0:
            requested = names[message.param_index : message.param_index + 1]
        else:
            requested = [name for name in names if name == _text(message.param_id)]
            order = self._vehicle.misbehave
            if order.mute in requested and (order.mute_times is None or self._muted < order.mute_times):
                self._muted += 1
                return []
        return list(self._param_values(requested))

    def _param_set(self, message: Message, now: float) -> list[Message]:
        name = _text(message.param_id)
        if name not in self.parameters.names():
            return []
        self.parameters.set_from_wire(name, message.param_value)
        return list(self._param_values([name]))

    def _param_values(self, requested: list[str]) -> Iterator[Message]:
        names = self.parameters.names()
        for name in requested:
            value, kind = self.parameters.on_wire(name)
            yield mav.MAVLink_param_value_message(name.encode(), value, kind, len(names), names.index(name))

    def _timesync(self, message: Message, now: float) -> list[Message]:
        if message.tc1 != 0:
            return []
        return [mav.MAVLink_timesync_message(int(now * 1e9) % 2**63, message.ts1)]

    def _ping(self, message: Message, now: float) -> list[Message]:
        if message.target_system != 0:
            return []
        return [
            mav.MAVLink_ping_message(
                message.time_usec, message.seq, message.get_srcSystem(), message.get_srcComponent()
            )
        ]


def _mission_state(items: int, flying: bool) -> int:
    """Return a MISSION_STATE: none, active, not started."""
    return 1 if items == 0 else 3 if flying else 2


def _whole(value: float) -> int:
    """Return a command's param as a whole number; −1 if it is negative, not finite or too large."""
    return int(value) if math.isfinite(value) and 0 <= value < 2**32 else -1


def _text(param_id: str | bytes) -> str:
    return param_id if isinstance(param_id, str) else param_id.split(b"\0")[0].decode("ascii", "replace")
