"""Wind in an SITL: its parameters SIM_WIND_*, set over the link, for the vehicle there is a simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Channel, LinkSteps
from gcsplan.mavlink.link.session.parameters import decode_value, parameter_name
from gcsplan.mavlink.link.watch import VehicleState
from gcsplan.mavlink.mission.autopilots import ARDUPILOTMEGA
from gcsplan.sim.flight.wind import Weather

WIND_PARAMETERS = ("SIM_WIND_SPD", "SIM_WIND_DIR", "SIM_WIND_TURB", "SIM_WIND_T")
_SAME_AT_EVERY_HEIGHT = 1.0
PARAMETER_TRIES, PARAMETER_ANSWER_S = 5, 2.0


def wind_parameters(weather: Weather, seed: int) -> dict[str, float]:
    """The parameters for a weather; empty without wind and gusts.

    The wind is the same at every height. A direction that is not given is that of the built-in simulator's first run.
    SITL's turbulence is a vector of any direction, so that each component has 1/√2 of it; it changes faster than the
    built-in simulator's gusts.
    """
    if not (weather.wind_m_s or weather.gusts_m_s):
        return {}
    from_deg = _from_deg(weather, seed)
    values = (weather.wind_m_s, (from_deg + 180.0) % 360.0 - 180.0, math.sqrt(2.0) * weather.gusts_m_s)
    return dict(zip(WIND_PARAMETERS, (*values, _SAME_AT_EVERY_HEIGHT), strict=True))


def _from_deg(weather: Weather, seed: int) -> float:
    drawn_deg = math.degrees(np.random.default_rng((seed, 0)).uniform(0.0, 2.0 * math.pi))
    return drawn_deg if weather.from_deg is None else weather.from_deg


def wind_vector(weather: Weather, seed: int) -> tuple[float, float]:
    """East and north of the mean wind that `wind_parameters` sets, m/s."""
    come_from = math.radians(_from_deg(weather, seed))
    return -weather.wind_m_s * math.sin(come_from), -weather.wind_m_s * math.cos(come_from)


def change_steps(channel: Channel, state: VehicleState, values: Mapping[str, float]) -> LinkSteps[dict[str, float]]:
    """Set parameters of a simulator, each until it tells the new value; return what they were.

    Raises LinkError if it does not take one.
    """
    were = {}
    for name, value in values.items():
        ask = dialect.MAVLink_param_request_read_message(*state.address, name.encode("ascii"), -1)
        were[name] = yield from _until(channel, state, ask, name, None)
        want = dialect.MAVLink_param_set_message(
            *state.address, name.encode("ascii"), value, dialect.MAV_PARAM_TYPE_REAL32
        )
        yield from _until(channel, state, want, name, value)
    return were


def _until(channel: Channel, state: VehicleState, message: Any, name: str, value: float | None) -> LinkSteps[float]:
    """Send a message until the parameter has ``value`` (None: any), and return what it has."""
    clock = channel.link.clock
    for _ in range(PARAMETER_TRIES):
        channel.send(message, state.address)
        end = clock() + PARAMETER_ANSWER_S
        while clock() < end:
            yield end
            reported = _reported(channel, name)
            if not math.isnan(reported) and (
                value is None or math.isclose(reported, value, rel_tol=1e-5, abs_tol=1e-5)
            ):
                return reported
    raise LinkError(
        f"system {state.address.sysid} does not take {name}: is it an SITL with wind?", where=channel.link.url
    )


def _reported(channel: Channel, name: str) -> float:
    """The value of a parameter among the messages that came; NaN if it is not there."""
    reported = math.nan
    for heard in channel.take():
        if heard.message.get_type() == "PARAM_VALUE" and parameter_name(heard.message) == name:
            reported = decode_value(heard.message, ARDUPILOTMEGA)
    return reported
