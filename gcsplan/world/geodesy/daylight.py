"""Sunrise and sunset at a place, to a minute or two below the polar circles: NOAA's solar equations, after Meeus."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

ZENITH_DEG = 90.833
"""The sun's middle when its upper edge appears: it is below the horizon, by refraction and its radius."""
SUN_ROUNDS = 3
"""The sun moves between noon and its rise, so each time is found from the sun's place at the time before."""
_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Daylight:
    """Sunrise and sunset, UTC, around the solar noon that is nearest to a time; both None where there is neither.

    ``up``: then, whether the sun stays up.
    """

    noon: datetime
    sunrise: datetime | None
    sunset: datetime | None
    up: bool


def daylight(lat_deg: float, lon_deg: float, at: datetime) -> Daylight:
    """The daylight of the solar day that holds ``at``, a time with a zone."""
    noon = at
    for _ in range(SUN_ROUNDS):  # the noon nearest to ``at``: at most half a day away
        minutes = 720.0 - 4.0 * lon_deg - sun(noon)[1]
        midnight = noon.astimezone(UTC).replace(hour=0, minute=0, second=0, microsecond=0)
        noon = midnight + timedelta(minutes=minutes)
        noon += timedelta(days=round((at - noon) / timedelta(days=1)))
    times: list[datetime] = []
    for side in (-1.0, 1.0):
        when = noon
        for _ in range(SUN_ROUNDS):
            declination_deg, equation_min = sun(when)
            angle_deg = hour_angle_deg(lat_deg, declination_deg)
            if angle_deg is None:
                return Daylight(noon, None, None, lat_deg * declination_deg > 0.0)
            drift = timedelta(minutes=sun(noon)[1] - equation_min)
            when = noon + drift + timedelta(minutes=side * 4.0 * angle_deg)
        times.append(when)
    return Daylight(noon, times[0], times[1], True)


def hour_angle_deg(lat_deg: float, declination_deg: float) -> float | None:
    """The sun's way from its rise to noon, degrees; None if it neither rises nor sets."""
    lat, declination = math.radians(lat_deg), math.radians(declination_deg)
    below = math.cos(lat) * math.cos(declination)
    if below <= 1e-12:
        return None
    cosine = (math.cos(math.radians(ZENITH_DEG)) - math.sin(lat) * math.sin(declination)) / below
    return math.degrees(math.acos(cosine)) if abs(cosine) <= 1.0 else None


def sun(when: datetime) -> tuple[float, float]:
    """The sun's declination, degrees, and the equation of time, minutes."""
    t = (when - _J2000) / timedelta(days=36525)
    mean_deg = (280.46646 + t * (36000.76983 + t * 0.0003032)) % 360.0
    anomaly = math.radians(357.52911 + t * (35999.05029 - 0.0001537 * t))
    eccentricity = 0.016708634 - t * (0.000042037 + 0.0000001267 * t)
    centre_deg = (
        math.sin(anomaly) * (1.914602 - t * (0.004817 + 0.000014 * t))
        + math.sin(2.0 * anomaly) * (0.019993 - 0.000101 * t)
        + math.sin(3.0 * anomaly) * 0.000289
    )
    node = math.radians(125.04 - 1934.136 * t)
    apparent = math.radians(mean_deg + centre_deg - 0.00569 - 0.00478 * math.sin(node))
    oblique = math.radians(23.4392911 - t * (0.0130042 + t * (1.64e-7 - 5.04e-7 * t)) + 0.00256 * math.cos(node))
    y, mean = math.tan(oblique / 2.0) ** 2, math.radians(mean_deg)
    equation = (
        y * math.sin(2.0 * mean)
        - 2.0 * eccentricity * math.sin(anomaly)
        + 4.0 * eccentricity * y * math.sin(anomaly) * math.cos(2.0 * mean)
        - 0.5 * y * y * math.sin(4.0 * mean)
        - 1.25 * eccentricity**2 * math.sin(2.0 * anomaly)
    )
    return math.degrees(math.asin(math.sin(oblique) * math.sin(apparent))), 4.0 * math.degrees(equation)
