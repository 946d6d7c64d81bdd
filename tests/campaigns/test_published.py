"""A short run of the campaign `published`, and that it finds planted faults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gcsplan.mission_file.published import volumes
from gcsplan.mission_file.zones import csv
from gcsplan.mission_file.zones.file import ZoneFile
from tests.campaigns import published


@pytest.mark.parametrize("form", published.FORMATS)
def test_some_spoilt_files_of_each_format_vanish_nowhere(tmp_path: Path, form: str) -> None:
    ended = [published.attack(form, seed, tmp_path) for seed in range(100, 120)]
    assert [faults for _, faults in ended] == [[]] * 20
    assert {how for how, _ in ended} == {"read", "refused"}


def found(folder: Path, form: str, count: int = 60) -> str:
    return "\n".join(fault for seed in range(count) for fault in published.attack(form, seed, folder)[1])


@pytest.mark.nightly
def test_the_campaign_finds_shapes_that_are_left_out_without_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ZoneFile, "give_sizes", lambda *_, **__: None)
    assert "is no zone and not named" in found(tmp_path, "geojson")


def test_the_campaign_finds_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv, "read_place", lambda text: 1 / 0)
    assert "ZeroDivisionError" in found(tmp_path, "csv")


@pytest.mark.slow
def test_the_campaign_finds_a_zone_that_moves_with_another_s_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    right, count = volumes.outline_of, iter(range(10**9))

    def moved(ring: Any) -> Any:
        outline, why = right(ring)
        return [(lat + 1e-6 * next(count), lon) for lat, lon in outline], why

    monkeypatch.setattr(volumes, "outline_of", moved)
    assert ", in the whole file" in found(tmp_path, "openair")
