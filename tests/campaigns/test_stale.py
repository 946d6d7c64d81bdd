"""A short run of the campaign `stale`, and that it finds faults that are planted."""

from __future__ import annotations

import os

import pytest

from tests.campaigns import stale

pytestmark = pytest.mark.skipif(os.name != "posix", reason="kills a process that it forks")

NOTHING = {
    # the sidecars of rasters are not reported
    "gcsplan.world.terrain.raster.tell_raster": (["scaled"], lambda path: None),
    # what belongs to a Shapefile is not reported
    "gcsplan.mission_file.zones.vector.tell_file": (["shapefile"], lambda path: None),
    # outputs are not compared with their digests
    "gcsplan.app.batch.has_outputs": (["kml"], lambda folder, digests: True),
    # earlier outputs of a mission that fails now stay
    "gcsplan.app.batch.retire_outputs": (["kml"], lambda folder: []),
}


@pytest.mark.nightly_but("gcsplan.app.batch.has_outputs")
@pytest.mark.slow
@pytest.mark.parametrize("fault", NOTHING)
def test_a_planted_fault_is_found(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kinds, broken = NOTHING[fault]
    monkeypatch.setattr(fault, broken)
    monkeypatch.setattr(stale, "MISSIONS", 1)
    _, found = stale.campaign(60.0, 1, 25, kinds, kills=False)
    assert found
    assert found[0].startswith("seed ")


@pytest.mark.slow
def test_a_killed_batch_is_found_if_outputs_are_not_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    """It leaves files that differ from the record beside them."""
    monkeypatch.setattr("gcsplan.app.batch.has_outputs", lambda folder, digests: True)
    monkeypatch.setattr(stale, "MISSIONS", 1)
    monkeypatch.setattr(stale, "STEPS_OF", {stale.kill: 1})
    _, found = stale.campaign(60.0, 3, 60, ["kml"])
    assert found
    assert found[0].startswith("seed ")


@pytest.mark.nightly
def test_a_short_campaign_finds_nothing() -> None:
    count, found = stale.campaign(120.0, 1, 60)
    assert not found
    assert count.total() == 60
