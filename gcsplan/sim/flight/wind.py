"""Wind, gusts and position error of a simulated flight, all drawn from one seed.

Gusts and position error are exponentially correlated processes (Ornstein-Uhlenbeck), one for each lane; a lane is one
vehicle in one run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError

GUST_MEMORY_S = 4.0
"""Correlation time of gusts, s: near the ground, turbulence of some tens of metres drifts past at about 10 m/s."""
NOISE_MEMORY_S = 20.0
"""Correlation time of the position error, s: a position fix drifts, it does not jump between messages."""
PUSH_S = 0.1
"""Metres per m/s by which a gust pushes a multicopter off its track before its position control corrects it."""
PUSH_LAG_S = 1.0


@dataclass(frozen=True, slots=True)
class Weather:
    """Mean wind ``wind_m_s`` from ``from_deg`` (None: a random direction in each run), gusts and position error.

    ``gusts_m_s``, ``noise_m``: standard deviation of each component of the gusts and of the position error. Raises
    InputError for a number that is negative or not finite."""

    wind_m_s: float = 0.0
    from_deg: float | None = None
    gusts_m_s: float = 0.0
    noise_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("wind_m_s", "gusts_m_s", "noise_m"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name} must be a number of 0 or more, given {float(value):g}")
        if self.from_deg is not None and not math.isfinite(self.from_deg):
            raise InputError(f"from_deg must be a direction in degrees, given {self.from_deg:g}")

    @property
    def calm(self) -> bool:
        """Whether there is no wind, no gust and no position error."""
        return not (self.wind_m_s or self.gusts_m_s or self.noise_m)

    def as_dict(self) -> dict[str, float | None]:
        """Return a dict for JSON."""
        return {
            "wind_m_s": self.wind_m_s, "from_deg": self.from_deg, "gusts_m_s": self.gusts_m_s, "noise_m": self.noise_m
        }  # fmt: skip


class Air:
    """The effect of the weather on each lane. ``lanes`` = runs × ``vehicles``: lane ``r · vehicles + v``.

    After `step`, ``wind`` (lanes, 2) is the velocity of the air, east and north, m/s; ``offset`` (lanes, 3) is the
    vehicle's true position minus its position on the track, metres.
    """

    def __init__(self, weather: Weather, vehicles: int, runs: int, seed: int, first_run: int = 0) -> None:
        self._weather = weather
        # One random stream for each run, so that a run does not depend on the other runs.
        self._streams = [np.random.default_rng((seed, first_run + r)) for r in range(runs)]
        self._vehicles = vehicles
        lanes = runs * vehicles
        self._mean = np.zeros((lanes, 2))
        for r, stream in enumerate(self._streams):
            drawn = stream.uniform(0.0, 2.0 * math.pi)
            come_from = drawn if weather.from_deg is None else math.radians(weather.from_deg)
            away = (-math.sin(come_from), -math.cos(come_from))
            self._mean[r * vehicles : (r + 1) * vehicles] = np.multiply(weather.wind_m_s, away)
        start = self._draw(5)
        self._gust = weather.gusts_m_s * start[:, :2]
        self._noise = weather.noise_m * start[:, 2:]
        self._push = np.zeros((lanes, 2))
        self.wind = self._mean + self._gust
        self.offset = self._noise.copy()

    def _draw(self, columns: int) -> Floats:
        """(lanes, columns) standard normal numbers."""
        return np.concatenate([stream.standard_normal((self._vehicles, columns)) for stream in self._streams])

    def step(self, step_s: float) -> None:
        """Advance by ``step_s`` seconds."""
        weather = self._weather
        if weather.calm or not (weather.gusts_m_s or weather.noise_m):
            return
        keep_gust, keep_noise = math.exp(-step_s / GUST_MEMORY_S), math.exp(-step_s / NOISE_MEMORY_S)
        drawn = self._draw(5)
        self._gust = keep_gust * self._gust + weather.gusts_m_s * math.sqrt(1.0 - keep_gust**2) * drawn[:, :2]
        self._noise = keep_noise * self._noise + weather.noise_m * math.sqrt(1.0 - keep_noise**2) * drawn[:, 2:]
        self._push += (1.0 - math.exp(-step_s / PUSH_LAG_S)) * (PUSH_S * self._gust - self._push)
        self.wind = self._mean + self._gust
        self.offset = self._noise.copy()
        self.offset[:, :2] += self._push
