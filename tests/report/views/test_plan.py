"""The map's parts by themselves: heights of zones, the bar of the scale."""

from __future__ import annotations

import pytest

from gcsplan.report.views.plan import scale_bar, zone_heights
from gcsplan.units import AVIATION, METRIC
from gcsplan.world.geometry.zones import Circle, Level, Zone


@pytest.mark.parametrize("about_m", [3.0, 47.0, 950.0, 12_345.0])
@pytest.mark.parametrize("units", [METRIC, AVIATION], ids=lambda u: u.name)
def test_the_bar_of_the_scale_is_as_long_as_it_says_and_near_what_is_asked(about_m: float, units: object) -> None:
    metres, words = scale_bar(about_m, units)  # type: ignore[arg-type]
    number, symbol = words.replace("\u202f", " ").rsplit(" ", 1)
    unit = {"m": 1.0, "km": 1000.0, "ft": 0.3048, "NM": 1852.0}[symbol]
    assert float(number.replace(" ", "")) * unit == pytest.approx(metres, rel=1e-9)
    assert number.strip("0.")[:1] in "125"
    assert 0.3 * about_m <= metres <= 2.5 * about_m


def test_a_zones_heights_are_both_levels_with_their_datum() -> None:
    shape = Circle(0.0, 0.0, 50.0)
    both = zone_heights(Zone("z", shape, Level(30.0, "agl"), Level(450.0, "amsl")), METRIC)
    assert "30" in both
    assert "AGL" in both
    assert "450" in both
    assert "AMSL" in both
    whole = zone_heights(Zone("z", shape, None, None), METRIC)
    assert "30" not in whole
    assert whole != both
