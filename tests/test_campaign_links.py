"""A short run of the campaign of links with fixed seeds; the long ones are `python -m tests.campaigns.links`."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.link.recheck import Recheck
from gcsplan.mavlink.protocol.outcome import Changed
from tests.campaigns.links import campaign, main


def test_nothing_is_found_among_adversaries() -> None:
    counts, found = campaign(range(1, 26))
    assert found == []
    assert counts["runs"] == 25
    # It is no campaign if nothing gets through, or nothing goes wrong.
    assert counts["verified"] > 5
    assert counts["exit 5"] > 8
    assert counts["exit 6"] > 3
    assert counts["changed"] > 3


def test_the_campaign_finds_an_upload_that_does_not_look_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Recheck, "gate", lambda self, now: None)
    _, found = campaign(range(14, 15))
    assert any("an announcement to one that was heard to be armed" in words for words in found)


def test_the_campaign_finds_an_upload_that_never_ends_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gate that refuses everything finds nothing, and is no success: the command line says so."""
    monkeypatch.setattr(Recheck, "gate", lambda self, now: Changed("armed", "always"))
    monkeypatch.setattr("sys.argv", ["links", "--runs", "2"])
    assert main() == 1
