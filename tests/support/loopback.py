"""A ground station for loopback vehicles: it sends a message, uploads and downloads, without a link."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.mavlink.mission.mission import MISSION, MissionItem, float32
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    Count,
    Item,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot

GCS = Address(255, 190)
OTHER_GCS = Address(254, 190)
COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
BOTH = pytest.mark.parametrize("autopilot", [COPTER, PX4])


def a_vehicle(autopilot: Autopilot = COPTER, trouble: str = "", **more: Any) -> LoopbackVehicle:
    order = Misbehaviour.parse(trouble)
    return LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.236, misbehave=order, **more)


def waypoint(n: int, **changes: float) -> MissionItem:
    z = changes.get("z", 60.005 + n)
    params = (changes.get("hold", 0.0), 0.0, 0.0, 0.0)
    return MissionItem(16, int(changes.get("frame", 3)), params, 366_000_000 + n, -843_800_000 - n, z)


def of_cm(cm: int) -> float:
    """Whole centimetres as ArduPilot sends them: times 0.01 in float32."""
    return float32(float32(0.01) * cm)


def a_mission(n: int) -> list[MissionItem]:
    return [waypoint(i) for i in range(n)]


def say(
    vehicle: LoopbackVehicle, message: MissionMessage, now: float = 0.0, *, source: Address = GCS, sysid: int = 1
) -> list[MissionMessage]:
    answers = vehicle.receive(Packet(source, Address(sysid, 1), message), now)
    assert all(p.source == vehicle.address and p.target == source for p in answers)
    return [p.message for p in answers]


def upload(
    vehicle: LoopbackVehicle, items: list[MissionItem], mission_type: int = MISSION, *, source: Address = GCS
) -> MissionMessage:
    """Send a list the way every ground station does; the last answer."""
    (answer,) = say(vehicle, Count(len(items), mission_type), source=source)
    while isinstance(answer, Request):
        (answer,) = say(vehicle, Item(answer.seq, items[answer.seq], mission_type), source=source)
    return answer


def download(vehicle: LoopbackVehicle, mission_type: int = MISSION) -> list[MissionItem]:
    (count,) = say(vehicle, RequestList(mission_type))
    assert isinstance(count, Count)
    items = []
    for seq in range(count.count):
        (answer,) = say(vehicle, Request(seq, mission_type))
        assert isinstance(answer, Item)
        assert (answer.seq, answer.mission_type) == (seq, mission_type)
        items.append(answer.item)
    assert say(vehicle, Ack(0, mission_type)) == []
    return items


def kept(autopilot: Autopilot, item: MissionItem) -> MissionItem | int:
    """The outcome of one mission item: as it reads back, or the code of the refusal."""
    vehicle = a_vehicle(autopilot)
    answer = upload(vehicle, [waypoint(0), item])
    assert isinstance(answer, Ack)
    return answer.code if answer.code else vehicle.items()[1]


def at(command: int, *params: float, frame: int = 3, z: float = 0.0) -> MissionItem:
    p = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, (p[0], p[1], p[2], p[3]), 366_000_000, -843_800_000, z)


def circle(radius_m: float, frame: int = 3) -> MissionItem:
    return at(5004, radius_m, 7.0, frame=frame, z=9.0)


def vertices(n: int, of: int) -> list[MissionItem]:
    return [at(5002, float(of)) for _ in range(n)]
