"""The sample terrain over which benchmarks draw their missions."""

from __future__ import annotations

from gcsplan.world.terrain.sample import SAMPLE
from gcsplan.world.terrain.terrain import TerrainSpec

SAMPLE_TERRAIN = {"dem": SAMPLE, "vertical_datum": "EGM96"}
"""The sample DEM as a mission file names it."""

SAMPLE_MIDDLE_DEG = (36.5896, -84.2458)
SAMPLE_HALF_M = (13_000.0, 14_000.0)
"""East and north from the middle: a box well within the DEM."""

ROUND_DEGREE_M = 111_200.0
"""Metres of a degree of latitude with which places are drawn: any number near the true one serves."""


def sample_spec() -> TerrainSpec:
    """The sample DEM, opened as for a mission file that names it."""
    return TerrainSpec(dem=(SAMPLE_TERRAIN["dem"],), vertical_datum=SAMPLE_TERRAIN["vertical_datum"])
