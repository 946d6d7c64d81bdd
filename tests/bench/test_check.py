"""The benchmark of the exact check: that it measures what it says, not how fast."""

from __future__ import annotations

import json

import pytest

from gcsplan.bench import check


def test_the_benchmark_of_the_check_runs_and_says_what_it_measured() -> None:
    result = check.run(legs=400, seed=2, repeats=1)
    assert (result["legs"], result["seed"], result["zones"], result["leg_m"]) == (400, 2, 12, 1000.0)
    assert 0.3 < result["legal_share"] < 1.0
    assert all(result[k] > 0.0 for k in ("clear_legs_per_s", "examine_legs_per_s", "examine_legal_legs_per_s"))
    assert json.loads(json.dumps(result)) == result
    assert "400 random legs of 1000 m" in check.report(result)
    assert check.run(legs=400, seed=2, repeats=1)["legal_share"] == result["legal_share"]


@pytest.mark.parametrize("wrong", [{"legs": 0}, {"repeats": 0}])
def test_no_legs_and_no_repeats_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="1 or more"):
        check.run(**wrong)
