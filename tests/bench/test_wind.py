"""The bench of flights in declared winds at its smallest."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.bench import wind
from gcsplan.errors import InputError


@pytest.mark.slow
def test_flights_in_declared_winds_are_counted_and_ones_beyond_are_named() -> None:
    result = wind.run(flights=4, beyond=2)
    assert result["flights"] == 4
    assert result["faults"] == []
    assert sum(row["inside"] for row in result["kinds"].values()) == 4
    assert sum(result["beyond_flights"].values()) == 2
    assert "4 inside their windows" in wind.report(result)


def test_missions_are_of_every_kind_and_the_same_for_a_seed(tmp_path: Path) -> None:
    made = [wind.mission_of(1, number, tmp_path) for number in range(40)]
    assert {kind for kind, _ in made} == set(wind.WIND_KINDS)
    assert {document["vehicles"][0]["name"] for _, document in made} == {"copter", "wing"}
    assert made[7] == wind.mission_of(1, 7, tmp_path)


def test_fleets_are_in_sequence_in_every_kind_of_wind(tmp_path: Path) -> None:
    made = [wind.fleet_of(1, number, tmp_path) for number in range(1, 40)]
    assert {kind.removesuffix(", gates") for kind, _ in made} == set(wind.WIND_KINDS)
    assert all(("gates" in document["arrival"]) == kind.endswith(", gates") for kind, document in made)
    assert {str(document["arrival"].get("gates")) for _, document in made} == {"None", "1", "2", "3", "auto"}
    assert {len(document["vehicles"]) for _, document in made} == set(range(2, 9))
    assert made[6] == wind.fleet_of(1, 7, tmp_path)


@pytest.mark.nightly
def test_lost_intervals_are_counted_and_only_broken_words_are_faults() -> None:
    result = wind.run_fleets(2, seed=1)
    assert sum(row["fleets"] for row in result["kinds"].values()) + sum(result["refused"].values()) == 2
    assert all(row["held"] + row["in_still_air"] >= row["fleets"] for row in result["kinds"].values())
    assert result["faults"] == []
    assert len(result["refusals"]) == sum(result["refused"].values())
    assert "kept everything" in wind.report_fleets(result)


def test_a_report_shows_some_refusals_and_how_many_more_there_are() -> None:
    why = [f"fleet {k}: too late" for k in range(wind.MOST_REASONS + 5)]
    words = wind.report_fleets({"fleets": len(why), "refused": {}, "refusals": why, "faults": [], "kinds": {}})
    assert words.count("too late") == wind.MOST_REASONS
    assert "refused: 5 more" in words


def test_a_number_out_of_range_is_refused() -> None:
    with pytest.raises(InputError, match="100000 flights"):
        wind.run(flights=0)
