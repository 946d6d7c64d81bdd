"""Sunrise and sunset: against almanacs, and against the sun's height by another formula, minute by minute."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

import pytest

from gcsplan.world.geodesy.daylight import daylight

MINUTE = timedelta(minutes=1)


def height_deg(lat_deg: float, lon_deg: float, when: datetime) -> float:
    """The height of the sun's middle: the Astronomical Almanac's low-precision formula, by sidereal time."""
    n = (when - datetime(2000, 1, 1, 12, tzinfo=UTC)) / timedelta(days=1)
    mean, g = 280.460 + 0.9856474 * n, math.radians(357.528 + 0.9856003 * n)
    lon = math.radians(mean + 1.915 * math.sin(g) + 0.020 * math.sin(2.0 * g))
    tilt = math.radians(23.439 - 4e-7 * n)
    right = math.atan2(math.cos(tilt) * math.sin(lon), math.cos(lon))
    declination = math.asin(math.sin(tilt) * math.sin(lon))
    sidereal = math.radians((280.46061837 + 360.98564736629 * n + lon_deg) % 360.0)
    lat = math.radians(lat_deg)
    return math.degrees(
        math.asin(
            math.sin(lat) * math.sin(declination) + math.cos(lat) * math.cos(declination) * math.cos(sidereal - right)
        )
    )


@pytest.mark.parametrize("lat_deg", [-62.0, -33.9, 0.0, 36.6, 51.48, 64.0])
@pytest.mark.parametrize("lon_deg", [-179.5, -84.3, 0.0, 151.2])
def test_the_sun_is_at_the_horizon_at_its_rise_and_set(lat_deg: float, lon_deg: float) -> None:
    for day in (3, 80, 172, 266, 355):
        at = datetime(2026, 1, 1, 6, tzinfo=UTC) + timedelta(days=day)
        found = daylight(lat_deg, lon_deg, at)
        assert found.sunrise is not None
        assert found.sunset is not None
        assert found.sunrise < found.noon < found.sunset
        assert abs(found.noon - at) <= timedelta(hours=12, minutes=1)
        for when, rises in ((found.sunrise, 1.0), (found.sunset, -1.0)):
            before, after = (height_deg(lat_deg, lon_deg, when + k * 2 * MINUTE) for k in (-1, 1))
            assert rises * before < rises * -0.833 < rises * after, (day, when)


@pytest.mark.parametrize(("day", "up"), [(172, True), (355, False)])
def test_beyond_the_polar_circle_it_may_neither_rise_nor_set(day: int, up: bool) -> None:
    found = daylight(78.2, 15.6, datetime(2026, 1, 1, tzinfo=UTC) + timedelta(days=day))
    assert (found.sunrise, found.sunset, found.up) == (None, None, up)
    assert daylight(90.0, 0.0, datetime(2026, 6, 21, tzinfo=UTC)).up


def test_the_times_are_those_of_an_almanac() -> None:
    # Greenwich, 21 June 2026: 03:43 and 20:22 UTC, as almanacs print them.
    found = daylight(51.4779, 0.0, datetime(2026, 6, 21, 12, tzinfo=UTC))
    assert found.sunrise is not None
    assert found.sunset is not None
    for when, printed in ((found.sunrise, (3, 43)), (found.sunset, (20, 22))):
        assert abs(when - datetime(2026, 6, 21, *printed, tzinfo=UTC)) <= 2 * MINUTE
