"""Volumes of published zones: circles and holes, heights of other datums, ceilings that nothing reaches."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.notes.note import Note
from tests.mission_file.published.made import (
    HOLE,
    RING,
    ed269,
    limits,
    read,
    remarks,
    volume,
)
from tests.mission_file.published.test_json_formats import of


def test_ed269_volumes_circles_and_holes(tmp_path: Path) -> None:
    circle = volume(
        uomDimensions="FT", lowerLimit=500, lowerVerticalReference="AMSL", upperLimit=...,
        horizontalProjection={"type": "Circle", "center": [8.2, 47.2], "radius": 1500},
    )  # fmt: skip
    hole = volume(horizontalProjection={"type": "Polygon", "coordinates": [RING, HOLE]})
    found = read(tmp_path, of(ed269(circle, hole)))
    assert not found.problems
    first, second = found.zones
    assert [z.name for z in found.zones] == ["Made zone/1", "Made zone/2"]
    assert (first.points, first.radius_m, limits(first)) == (((47.2, 8.2),), 1500.0, ("152.4 m AMSL", "unlimited"))
    assert limits(second) == ("ground", "120 m AGL")
    assert found.notes == (Note("holes_are_no_fly", file="zones.json", count=1),)


def test_heights_above_the_ellipsoid_make_a_zone_larger_never_smaller(tmp_path: Path) -> None:
    given = volume(lowerLimit=300, lowerVerticalReference="WGS84", upperLimit=500, upperVerticalReference="WGS84")
    found = read(tmp_path, of(ed269(given)))
    assert limits(found.zones[0]) == ("210 m AMSL", "610 m AMSL")  # by 90 m and 110 m, more than any geoid
    assert "above the ellipsoid are no heights above sea level" in remarks(found)


@pytest.mark.parametrize(("value", "unit"), [(99999, "M"), (99999, "FT"), (30_000, "M")])
def test_a_ceiling_that_nothing_reaches_is_none(tmp_path: Path, value: float, unit: str) -> None:
    zone = ed269(volume(upperLimit=value, uomDimensions=unit))
    assert limits(read(tmp_path, of(zone)).zones[0]) == ("ground", "unlimited")
