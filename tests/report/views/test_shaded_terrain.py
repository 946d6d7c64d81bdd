"""The ground as a picture is the surface's."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from gcsplan.report.views.shaded_terrain import extent_of, relief_of
from tests.support.pages import (
    ZONES,
    small_page,
)
from tests.support.worlds import world


def test_the_pictures_ground_is_the_surfaces() -> None:
    page = small_page()
    extent = extent_of([], ZONES, page.world.airspace.surface)
    relief = relief_of(page.world, extent)
    image = Image.open(io.BytesIO(base64.b64decode(relief.picture.split(",", 1)[1])))
    assert image.format == "WEBP"
    assert image.width / image.height == pytest.approx(extent.width_m / extent.height_m, rel=0.03)
    grid: Any = relief.grid
    heights = grid["base"] + grid["step"] * np.frombuffer(base64.b64decode(grid["heights"]), "<u2").astype(float)
    heights = heights.reshape(grid["rows"], grid["cols"])
    west, south, east, north = grid["box"]
    e, n = np.meshgrid(np.linspace(west, east, grid["cols"]), np.linspace(north, south, grid["rows"]))
    assert np.abs(heights - page.world.airspace.surface.ground_at(e, n)).max() < 0.01
    lattice = np.array([grid["lat"], grid["lon"]]).T
    ends = page.world.frame.to_degrees(np.array([west, east]), np.array([north, south]))
    assert np.allclose(lattice[[0, -1]], ends, atol=1e-6)
    assert relief.contours.count("M") > 0


def test_flat_ground_has_no_contours_and_still_a_picture() -> None:
    where = world(300.0, half_m=3000.0)
    relief = relief_of(where, extent_of([], [], where.airspace.surface))
    assert relief.contours == ""
    assert relief.picture.startswith("data:image/webp;base64,")
    assert (relief.low_m, relief.high_m) == pytest.approx((300.0, 300.0))
