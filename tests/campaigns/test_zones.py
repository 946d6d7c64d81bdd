"""A short run of the campaign `zones`, and that it finds a planted fault."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gcsplan.mission_file.published import volumes
from gcsplan.mission_file.zones import draft as zone_draft
from gcsplan.world.geodesy import degree_shapes
from tests.campaigns import zone_shapes, zones


@pytest.mark.slow
def test_some_inputs_of_the_campaign_find_nothing(tmp_path: Path) -> None:
    assert [zones.attack(seed, tmp_path)[2] for seed in range(400, 412)] == [[]] * 12


@pytest.mark.slow
def test_some_circles_corridors_and_projected_polygons_find_nothing(tmp_path: Path) -> None:
    assert [zone_shapes.attack(seed, tmp_path)[2] for seed in range(700, 708)] == [[]] * 8


def test_the_campaign_finds_great_circles_that_are_left_straight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(degree_shapes, "GREAT_CIRCLE_M", math.inf)
    assert any(zones.attack(seed, tmp_path)[2] for seed in (28, 33, 49))


def test_the_campaign_finds_edges_the_short_way_around(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (zone_draft, volumes):
        monkeypatch.setattr(module, "wide_fault", lambda *_, **__: "")
    monkeypatch.setattr(degree_shapes, "turned", degree_shapes.unwrapped)
    assert any(zones.attack(seed, tmp_path)[2] for seed in range(1, 25))


def test_a_great_circle_by_the_plane_through_it() -> None:
    assert zones.latitude_at(0.0, 50.0, 20.0, 50.0, 10.0, great_circles=True) == pytest.approx(50.4313, abs=1e-3)
    assert zones.latitude_at(0.0, -50.0, -20.0, -50.0, -10.0, great_circles=True) == pytest.approx(-50.4313, abs=1e-3)
    assert zones.latitude_at(0.0, 0.0, 90.0, 40.0, 45.0, great_circles=False) == 20.0
