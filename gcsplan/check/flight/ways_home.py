"""The winds on straight ways home: the metres through the air and the seconds that they take at most."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.check.flight.winds import air_m_s
from gcsplan.vehicle import Vehicle
from gcsplan.wind.ability import ADVANCES_M_S, Ability, WindsAlong, winds_within
from gcsplan.wind.declared import FlightWind
from gcsplan.wind.window import cover

_RAYS = 64
_RAY_RAD = 2.0 * math.pi / _RAYS


class WaysHome:
    """What straight ways home take at most, in any wind of a set, between two altitudes ``amsl_m``.

    ``agl_m``: no way is higher above ground.
    The metres through the air and the seconds of a way are convex in the way over ground, with any wind. They are known
    in some directions; between two of these they are no more than in proportion, which is convex too.
    """

    def __init__(
        self, vehicle: Vehicle, wind: FlightWind, amsl_m: tuple[float, float], agl_m: float = math.inf
    ) -> None:  # fmt: skip
        self._vehicle, self._wind, self._amsl_m, self._agl_m = vehicle, wind, amsl_m, agl_m
        self._costs: dict[float, tuple[list[float], list[float]]] = {}
        self.wind_m_s = float(self._winds(1.0).strongest_m_s(cover(wind.declared)).max())
        """The highest speed of the wind."""

    def longer_m(self, speed_m_s: float, way_m: tuple[float, float], past_m: float) -> tuple[float, float]:
        """The metres through the air of a way (east, north), and as many as take as long in still air, at a commanded
        speed; with ``past_m`` more metres in any direction. Neither is less than the way."""
        air, seconds = self._rays(speed_m_s)
        long_m = math.hypot(*way_m)
        at = math.atan2(way_m[1], way_m[0]) % (2.0 * math.pi) / _RAY_RAD
        first = min(int(at), _RAYS - 1)
        after, scale = (first + 1) % _RAYS, long_m / math.sin(_RAY_RAD)
        a, b = scale * math.sin((first + 1 - at) * _RAY_RAD), scale * math.sin((at - first) * _RAY_RAD)
        air_m, took_s = (
            math.fsum(m * cost for m, cost in ((a, c[first]), (b, c[after]), (past_m, max(c))) if m > 0.0)
            for c in (air, seconds)
        )
        return air_m, took_s * speed_m_s

    def advances(self, speed_m_s: float) -> bool:
        """Whether the vehicle advances in every direction, in every wind of the set with its gusts."""
        declared = self._wind.declared
        slow, _ = self._winds(speed_m_s).speeds_m_s(cover(declared), declared.gusts_add_m_s)
        return bool((slow >= ADVANCES_M_S).all())

    def worst(self, speed_m_s: float) -> tuple[float, float]:
        """Metres through the air and seconds of a metre in the worst direction."""
        air, seconds = self._rays(speed_m_s)
        return max(air), max(seconds)

    def _rays(self, speed_m_s: float) -> tuple[list[float], list[float]]:
        """Metres through the air and seconds for a metre over ground in each direction."""
        if speed_m_s not in self._costs:
            found = self._winds(speed_m_s).costs(cover(self._wind.declared))
            air, seconds = (np.where(cost > 0.0, cost, math.inf).max(axis=0) for cost in found)
            rays = np.maximum(air, 1.0).tolist(), np.maximum(seconds, 1.0 / speed_m_s).tolist()
            self._costs[speed_m_s] = rays
        return self._costs[speed_m_s]

    def _winds(self, speed_m_s: float) -> WindsAlong:
        angle = _RAY_RAD * np.arange(_RAYS)
        none, speed, one = np.zeros(_RAYS), np.full(_RAYS, speed_m_s), np.ones((_RAYS, 1))
        least, most = air_m_s(self._vehicle, speed, np.zeros((_RAYS, 2)), np.full(_RAYS, self._amsl_m[0]))
        bound = np.full(_RAYS, math.inf) if self._vehicle.keeps_airspeed else speed
        ability = Ability(np.column_stack([np.cos(angle), np.sin(angle)]), none, least, most, bound)
        departs_s = self._wind.departs_s[0]
        return winds_within(
            self._wind.declared, ability, one * self._amsl_m, np.tile([0.0, self._agl_m], (_RAYS, 1)),
            one * [departs_s, math.inf],
        )  # fmt: skip
