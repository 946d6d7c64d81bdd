"""Messages of ground stations to a hub of loopback vehicles, and its answers, without sockets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.mavlink.link.frames import FrameParser, FrameWriter
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.sim.vehicle.hub import Client, Hub
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot

GCS = Address(255, 190)
COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4


def a_vehicle(sysid: int = 1, autopilot: Autopilot = COPTER, trouble: str = "", **more: Any) -> LoopbackVehicle:
    order = Misbehaviour.parse(trouble)
    return LoopbackVehicle(sysid, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.25, misbehave=order, **more)


def frame(message: Any, source: Address = GCS) -> bytes:
    return FrameWriter(source).pack(message)


def command(number: int, *params: float, sysid: int = 1) -> Any:
    seven = (*params, *[0.0] * 7)[:7]
    return mav.MAVLink_command_long_message(sysid, 1, number, 0, *seven)


def messages(data: Iterable[bytes]) -> list[Any]:
    parser = FrameParser()
    return [m for piece in data for m in parser.feed(piece)]


def ask(hub: Hub, message: Any, now: float = 0.0, *, client: Client = "a", source: Address = GCS) -> list[Any]:
    """Send one message to the hub; return the answers to this client."""
    return messages(data for to, data in hub.take(client, frame(message, source), now) if to == client)
