"""A random return flown by a SITL: its mission is uploaded and flown, and RTL is commanded on the way."""

from __future__ import annotations

import math
import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink import mavutil

from gcsplan.arrays import Floats
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.sim.sitl.instances import COPTER
from gcsplan.vehicle import Autopilot
from tests.campaigns.returns import HOME_AMSL_M, Found, Scene, compare, scene

COPTER_RTL, PLANE_RTL = 6, 11
SPEEDUP = 8
START_S, FLIGHT_S = 120.0, 400.0
"""Wall-clock limits for the start of a SITL and for one flight, s."""


def fly_in_sitl(seed: int, autopilot: Autopilot, binary: str, instance: int, defaults: str | None) -> Found:
    """Start a SITL, fly the mission of a scene until its return is due, and compare the return."""
    one = scene(np.random.default_rng(seed), autopilot)
    with tempfile.TemporaryDirectory(prefix="gcsplan-returns-") as directory:
        own = Path(directory)
        process = _start(one, binary, instance, defaults, own)
        link = None
        try:
            link = _connect(f"tcp:127.0.0.1:{5760 + 10 * instance}", process)
            _upload(link, one)
            points, left = _fly(link, one)
        finally:
            if link is not None:
                link.close()
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(10.0)
    return compare(one, points, one.parts(one.seq, left + 8.0, max(left - 8.0, 0.0)))


def _start(one: Scene, binary: str, instance: int, defaults: str | None, own: Path) -> subprocess.Popen[bytes]:
    plane = one.vehicle.autopilot is Autopilot.ARDUPLANE
    rtl = one.rtl_rel_home_m
    given: dict[str, float] = {"RTL_ALTITUDE": rtl, "TERRAIN_ENABLE": 0, "ARMING_CHECK": 0} if plane else dict(COPTER)
    if not plane:
        given |= {"RTL_ALT": 100.0 * rtl, "ANGLE_MAX": 4500, "RTL_LOIT_TIME": 1000}
    (own / "own.parm").write_text("".join(f"{k} {v:g}\n" for k, v in given.items()), encoding="ascii")
    files = ",".join([*([defaults] if defaults else []), str(own / "own.parm")])
    home = one.mission.home
    place = f"{home.lat_e7 / 1e7:.7f},{home.lon_e7 / 1e7:.7f},{HOME_AMSL_M:.2f},90"
    with open(own / "output.txt", "wb") as log:
        return subprocess.Popen(
            [os.path.abspath(binary), "--model", "plane" if plane else "+", "--speedup", str(SPEEDUP), "--home", place,
             "-I", str(instance), "--defaults", files],
            cwd=own, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
        )  # fmt: skip


def _connect(url: str, process: subprocess.Popen[bytes]) -> Any:
    end = time.monotonic() + START_S
    while True:
        try:
            link = mavutil.mavlink_connection(url, source_system=255, retries=0)
            break
        except OSError:
            assert process.poll() is None, "the SITL ended at once"
            assert time.monotonic() < end, "the SITL does not listen"
            time.sleep(0.2)
    link.wait_heartbeat(timeout=START_S)
    link.mav.request_data_stream_send(1, 1, mavutil.mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    for message in (mavutil.mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, mavutil.mavlink.MAVLINK_MSG_ID_MISSION_CURRENT):
        link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, message, 5e4, 0, 0, 0, 0, 0)
    while True:  # the position and home are known
        assert time.monotonic() < end, "the SITL has no position"
        m = link.recv_match(type=["GLOBAL_POSITION_INT", "EKF_STATUS_REPORT"], blocking=True, timeout=5)
        if m is not None and m.get_type() == "EKF_STATUS_REPORT" and m.flags & 0x210 == 0x210:
            return link


def _upload(link: Any, one: Scene) -> None:
    home = MissionItem(16, 0, x=one.mission.home.lat_e7, y=one.mission.home.lon_e7, z=HOME_AMSL_M)
    items = [home, *one.mission.items]
    link.mav.mission_count_send(1, 1, len(items), 0)
    end = time.monotonic() + START_S
    while True:
        assert time.monotonic() < end, "the SITL does not take the mission"
        m = link.recv_match(type=["MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"], blocking=True, timeout=5)
        if m is None:
            continue
        if m.get_type() == "MISSION_ACK":
            assert m.type == 0, m
            return
        i = items[m.seq]
        link.mav.mission_item_int_send(1, 1, m.seq, i.frame, i.command, 0, 1, *i.params, i.x, i.y, i.z, 0)


def _fly(link: Any, one: Scene) -> tuple[Floats, float]:
    """Fly to where the return is due; the places of the return until it is over home, and where it began."""
    plane = one.vehicle.autopilot is Autopilot.ARDUPLANE
    link.set_mode("AUTO" if plane else "GUIDED")
    end = time.monotonic() + START_S
    while not link.motors_armed():
        assert time.monotonic() < end, "the SITL does not arm"
        link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 21196, 0, 0, 0, 0, 0)
        for _ in range(40):
            link.recv_match(type="HEARTBEAT", blocking=True, timeout=0.05)
    link.mav.command_long_send(1, 1, mavutil.mavlink.MAV_CMD_MISSION_START, 0, 0, 0, 0, 0, 0, 0, 0)
    frame, item, sent, began = one.world.frame, 0, False, None
    points: list[tuple[float, float, float]] = []
    corner = one.place(one.seq, 0.0)[:2]
    rounds, last_bearing = 0.0, None
    end = time.monotonic() + FLIGHT_S
    while time.monotonic() < end:
        m = link.recv_match(type=["GLOBAL_POSITION_INT", "MISSION_CURRENT", "HEARTBEAT"], blocking=True, timeout=5)
        assert m is not None, "the SITL is silent"
        kind = m.get_type()
        if kind == "MISSION_CURRENT":
            item = m.seq
        elif kind == "HEARTBEAT" and began is None and sent and m.custom_mode == (PLANE_RTL if plane else COPTER_RTL):
            began = len(points)
        elif kind == "GLOBAL_POSITION_INT":
            east, north = (float(x) for x in frame.to_plane(m.lat / 1e7, m.lon / 1e7))
            points.append((east, north, m.alt / 1e3))
            left = math.dist((east, north), corner)
            speed = math.hypot(m.vx, m.vy) / 100.0
            if item == one.seq and left <= one.left_m + 0.1 * speed and not sent:
                link.mav.set_mode_send(1, 1, PLANE_RTL if plane else COPTER_RTL)
                sent = True
                points = points[-1:]
                began_left = left
            if not sent or len(points) < 30:
                continue
            away = math.hypot(east, north)
            if plane:
                bearing = math.atan2(north, east)
                if away < 400.0 and last_bearing is not None:
                    rounds += abs(math.remainder(bearing - last_bearing, math.tau))
                last_bearing = bearing
                if rounds > 2.0 * math.tau:
                    break
            elif away < 2.0 and speed < 0.5:
                break
    else:
        raise AssertionError(f"it did not come home: item {item}, return sent {sent}, began {began}, at {points[-1:]}")
    return np.array(points), began_left
