"""Wind, gusts and position error of a simulated flight, all drawn from one seed.

A lane is one vehicle in one run. The wind is either the given one, with gusts as exponentially correlated processes
(Ornstein-Uhlenbeck), or each run draws one of the winds that the mission declares, with gusts of the Dryden form. The
position error is exponentially correlated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.sim.flight.track import CommandedTrack
from gcsplan.wind.declared import DeclaredWind

GUST_MEMORY_S = 4.0
"""Correlation time of gusts, s: near the ground, turbulence of some tens of metres drifts past at about 10 m/s."""
NOISE_MEMORY_S = 20.0
"""Correlation time of the position error, s: a position fix drifts, it does not jump between messages."""
PUSH_S = 0.1
"""Metres per m/s by which a gust pushes a multicopter off its track before its position control corrects it."""
PUSH_LAG_S = 1.0
VARIES_S = 60.0
"""A wind that varies changes from one wind of its set to another in this time."""
GUST_SIGMAS = 3.0
"""The highest gust that a mission declares is this many standard deviations of the turbulence at `LOW_FT`."""
LOW_FT, HIGH_FT = 20.0, 1000.0
"""Heights between which MIL-F-8785C lets the turbulence near the ground depend on the height."""
METRES_PER_FT = 0.3048
MOST_WEATHER = 1e5
"""Largest wind and gust, m/s, and position error, m: no weather has these, and squares of larger ones overflow."""
SLOWEST_M_S = 1.0
"""Turbulence drifts past at least at this speed."""


@dataclass(frozen=True, slots=True)
class Weather:
    """Mean wind ``wind_m_s`` from ``from_deg`` (None: a random direction in each run), gusts and position error.

    ``gusts_m_s``, ``noise_m``: standard deviation of each component of the gusts and of the position error.
    ``declared``: the set that each run draws its wind from, in place of these winds and gusts; ``start_s``: when the
    first vehicle may leave, seconds UTC since 1970, for a wind that depends on the hour. Raises InputError for a number
    that is negative, above `MOST_WEATHER` or not finite, and for a wind beside a declared one."""

    wind_m_s: float = 0.0
    from_deg: float | None = None
    gusts_m_s: float = 0.0
    noise_m: float = 0.0
    declared: DeclaredWind | None = None
    start_s: float = 0.0

    def __post_init__(self) -> None:
        if self.declared is not None and (self.wind_m_s or self.gusts_m_s):
            raise InputError("give a wind with its gusts, or a set of winds to draw from, not both")
        for name in ("wind_m_s", "gusts_m_s", "noise_m"):
            value = getattr(self, name)
            if not 0.0 <= value <= MOST_WEATHER:
                raise InputError(f"{name} must be a number from 0 to {MOST_WEATHER:g}, given {float(value):g}")
        if self.from_deg is not None and not math.isfinite(self.from_deg):
            raise InputError(f"from_deg must be a direction in degrees, given {self.from_deg:g}")

    @property
    def calm(self) -> bool:
        """Whether there is no wind, no gust and no position error."""
        declared = self.declared is not None and not self.declared.still
        return not (declared or self.wind_m_s or self.gusts_m_s or self.noise_m)

    def as_dict(self) -> dict[str, Any]:
        """Return a dict for JSON."""
        given = {
            "wind_m_s": self.wind_m_s, "from_deg": self.from_deg, "gusts_m_s": self.gusts_m_s, "noise_m": self.noise_m
        }  # fmt: skip
        wind = self.declared
        if wind is None:
            return given
        declared = {"most_m_s": wind.most_m_s, "gust_m_s": wind.gust_m_s, "varying": wind.varying}
        return given | {"drawn_from": declared}

    def steady(self, seed: int) -> Weather:
        """For a simulator with one wind at every height: the first run's, at the height where it is strongest."""
        if self.declared is None:
            return self
        heights_m = self.declared.heights_m
        share = np.repeat(_stream(seed, 0, 1).random((1, 2)), len(heights_m), axis=0)
        blows = self.declared.each_m_s(share, heights_m, heights_m, np.full(len(heights_m), self.start_s))
        east, north = blows[np.hypot(*blows.T).argmax()]
        come_from = math.degrees(math.atan2(-east, -north)) % 360.0
        gusts_m_s = self.declared.gusts_add_m_s / GUST_SIGMAS
        return Weather(float(math.hypot(east, north)), come_from, gusts_m_s, self.noise_m)

    def blowing(self, vehicles: int, runs: int, first_run: int, seed: int) -> GivenWind | DrawnWind:
        """The wind and the gusts of all lanes, from the run ``first_run`` on."""
        kind = GivenWind if self.declared is None else DrawnWind
        return kind(self, vehicles, range(first_run, first_run + runs), seed)


class GivenWind:
    """One wind and its gusts, which depend on the time alone. ``mean``, ``gust`` (lanes, 2): east and north, m/s."""

    def __init__(self, weather: Weather, vehicles: int, runs: range, seed: int) -> None:
        self._gusts_m_s = weather.gusts_m_s
        self.mean = np.zeros((len(runs) * vehicles, 2))
        self.gust = np.zeros_like(self.mean)
        for r, run in enumerate(runs):
            drawn = _stream(seed, run).uniform(0.0, 2.0 * math.pi)
            come_from = drawn if weather.from_deg is None else math.radians(weather.from_deg)
            away = (-math.sin(come_from), -math.cos(come_from))
            self.mean[r * vehicles : (r + 1) * vehicles] = np.multiply(weather.wind_m_s, away)

    def begin(self, drawn: Floats, _places: Places) -> None:
        """Set the gusts at the start from standard normal numbers (lanes, 2)."""
        self.gust = self._gusts_m_s * drawn

    def step(self, step_s: float, drawn: Floats, _places: Places) -> None:
        """Advance by ``step_s`` seconds with standard normal numbers (lanes, 2)."""
        keep = math.exp(-step_s / GUST_MEMORY_S)
        self.gust = keep * self.gust + self._gusts_m_s * math.sqrt(1.0 - keep**2) * drawn


class DrawnWind:
    """Winds of the set that a mission declares, and gusts of Dryden's form. ``mean``, ``gust`` as in `GivenWind`.

    Each run has one wind of the set; where the wind varies, each lane goes from one to another, every `VARIES_S`.

    Gusts follow MIL-F-8785C (and MIL-HDBK-1797) near the ground: with the height h in feet, the length of the
    turbulence is h / (0.177 + 0.000823 h)^1.2, and its intensity falls with (0.177 + 0.000823 h)^0.4. The spectrum
    along the wind has one pole, that across has two and a zero. The intensity at `LOW_FT` is such that the highest gust
    of the mission is `GUST_SIGMAS` of it; no gust is stronger than that. Above `HIGH_FT` all stays as there. Gusts are
    horizontal, as the wind is.
    """

    def __init__(self, weather: Weather, vehicles: int, runs: range, seed: int) -> None:
        assert weather.declared is not None
        self._wind, self._start_s, self._vehicles = weather.declared, weather.start_s, vehicles
        self._streams = [_stream(seed, run, 1) for run in runs]
        self._until_s, self._shares, self._next = 0.0, self._draw(), self._draw()
        lanes = len(runs) * vehicles
        self.mean, self.gust = np.zeros((lanes, 2)), np.zeros((lanes, 2))
        self._poles = np.zeros((lanes, 3))

    def _draw(self) -> Floats:
        """(lanes, 2) a share for each lane."""
        if self._wind.varying:
            return np.concatenate([stream.random((self._vehicles, 2)) for stream in self._streams])
        return np.repeat([stream.random(2) for stream in self._streams], self._vehicles, axis=0)

    def begin(self, drawn: Floats, places: Places) -> None:
        """Set the wind at the start, and the gusts from standard normal numbers (lanes, 2)."""
        along, across = drawn.T
        # The second of two poles in a row begins with its mean for the first.
        self._poles = np.column_stack([along, across, 0.5 * across])
        self._blow(places)

    def step(self, step_s: float, drawn: Floats, places: Places) -> None:
        """Advance by ``step_s`` seconds, to ``places``, with standard normal numbers (lanes, 2)."""
        length_m, _ = _turbulence(places.agl_m)
        drifts = np.maximum(np.maximum(places.airspeed_m_s, np.hypot(*self.mean.T)), SLOWEST_M_S)
        keep = np.exp(-step_s * drifts / length_m)
        fresh = np.sqrt(1.0 - keep**2)
        along, across, behind = self._poles.T
        along, across = keep * along + fresh * drawn[:, 0], keep * across + fresh * drawn[:, 1]
        self._poles = np.column_stack([along, across, keep * behind + (1.0 - keep) * self._poles[:, 1]])
        self._blow(places)

    def _blow(self, places: Places) -> None:
        """Set wind and gusts from the lanes' places and the states of the filters."""
        while self._wind.varying and places.at_s >= self._until_s + VARIES_S:
            self._until_s += VARIES_S
            self._shares, self._next = self._next, self._draw()
        part = (places.at_s - self._until_s) / VARIES_S if self._wind.varying else 0.0
        shares = self._shares + part * (self._next - self._shares)
        at_s = np.full(len(shares), self._start_s + places.at_s)
        self.mean = self._wind.each_m_s(shares, places.amsl_m, places.agl_m, at_s)
        speed = np.hypot(*self.mean.T)
        ahead = np.where((speed > 0.0)[:, None], self.mean, [1.0, 0.0]) / np.where(speed > 0.0, speed, 1.0)[:, None]
        along, across, behind = self._poles.T
        _, strength = _turbulence(places.agl_m)
        most_m_s = self._wind.gusts_add_m_s
        sigma = most_m_s / GUST_SIGMAS * strength
        aside = (math.sqrt(3.0) * across + (1.0 - math.sqrt(3.0)) * behind) / math.sqrt(2.0)
        gust = sigma[:, None] * (along[:, None] * ahead + aside[:, None] * np.column_stack([-ahead[:, 1], ahead[:, 0]]))
        size = np.hypot(*gust.T)
        self.gust = gust * np.minimum(1.0, most_m_s / np.maximum(size, 1e-9))[:, None]


def _turbulence(agl_m: Floats) -> tuple[Floats, Floats]:
    """The length of the turbulence at each height, m, and its intensity per that at `LOW_FT`."""
    feet = np.clip(agl_m / METRES_PER_FT, LOW_FT, HIGH_FT)
    rises = 0.177 + 0.000823 * feet
    return METRES_PER_FT * feet / rises**1.2, ((0.177 + 0.000823 * LOW_FT) / rises) ** 0.4


def _stream(seed: int, run: int, *more: int) -> np.random.Generator:
    """The random numbers of a run, which do not depend on the other runs."""
    return np.random.default_rng((seed, run, *more))


@dataclass(frozen=True, eq=False, slots=True)
class Places:
    """Where the lanes are: seconds since the fleet's start, heights above sea and ground, and airspeeds (lanes,)."""

    at_s: float
    amsl_m: Floats
    agl_m: Floats
    airspeed_m_s: Floats

    @classmethod
    def on(cls, tracks: Sequence[CommandedTrack], at_s: float, along_m: Floats, airspeed_m_s: Floats) -> Places:
        """The places of lanes that have come ``along_m`` (lanes,) along their tracks."""
        ways = [track.heights_m(along_m[k :: len(tracks)]) for k, track in enumerate(tracks)]
        amsl_m, agl_m = (np.column_stack(each).ravel() for each in zip(*ways, strict=True))
        return cls(at_s, amsl_m, agl_m, airspeed_m_s)


class Air:
    """The effect of the weather on each lane. ``lanes`` = runs × tracks: lane ``r · tracks + v``.

    After `step`, ``wind`` (lanes, 2) is the velocity of the air, east and north, m/s; ``offset`` (lanes, 3) is the
    vehicle's true position minus its position on the track, metres.
    """

    def __init__(
        self, weather: Weather, tracks: Sequence[CommandedTrack], runs: int, seed: int, first_run: int = 0
    ) -> None:
        self._weather, self._tracks = weather, tracks
        self._blowing = weather.blowing(len(tracks), runs, first_run, seed)
        self._streams = [_stream(seed, first_run + r) for r in range(runs)]
        for stream in self._streams:
            stream.uniform()  # the direction of the wind
        start, lanes = self._draw(5), runs * len(tracks)
        self._blowing.begin(start[:, :2], self._places(0.0, np.zeros(lanes), np.zeros(lanes)))
        self._noise = weather.noise_m * start[:, 2:]
        self._push = np.zeros((lanes, 2))
        self.offset = self._noise.copy()

    @property
    def wind(self) -> Floats:
        """(lanes, 2) the velocity of the air, m/s."""
        return self._blowing.mean + self._blowing.gust

    def _draw(self, columns: int) -> Floats:
        """(lanes, columns) standard normal numbers."""
        return np.concatenate([stream.standard_normal((len(self._tracks), columns)) for stream in self._streams])

    def _places(self, at_s: float, along_m: Floats, airspeed_m_s: Floats) -> Places:
        if self._weather.declared is None:
            return Places(at_s, along_m, along_m, airspeed_m_s)
        return Places.on(self._tracks, at_s, along_m, airspeed_m_s)

    def step(self, step_s: float, at_s: float, along_m: Floats, airspeed_m_s: Floats) -> None:
        """Advance by ``step_s`` seconds to the time ``at_s``; ``along_m``, ``airspeed_m_s`` (lanes,) are the lanes'."""
        weather = self._weather
        if weather.calm or not (weather.gusts_m_s or weather.noise_m or weather.declared):
            return
        keep = math.exp(-step_s / NOISE_MEMORY_S)
        drawn = self._draw(5)
        self._blowing.step(step_s, drawn[:, :2], self._places(at_s, along_m, airspeed_m_s))
        self._noise = keep * self._noise + weather.noise_m * math.sqrt(1.0 - keep**2) * drawn[:, 2:]
        self._push += (1.0 - math.exp(-step_s / PUSH_LAG_S)) * (PUSH_S * self._blowing.gust - self._push)
        self.offset = self._noise.copy()
        self.offset[:, :2] += self._push
