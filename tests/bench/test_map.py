"""The measurement of the map's server: every figure is of answers that came."""

from __future__ import annotations

import pytest

pytest.importorskip("starlette", reason="the extra map is not installed")
pytest.importorskip("websockets", reason="the extra map is not installed")

from gcsplan.bench import map as bench


@pytest.mark.slow
@pytest.mark.nightly
def test_a_short_run_counts_its_paths_and_plans() -> None:
    result = bench.run(drags=1, degree=False, places=3)
    for zones in ("zones_40", "zones_200"):
        one = result[zones]
        assert one["paths"] + one["refused"] >= 3
        assert one["plans"] <= 1
    assert bench.report(result).count("pointer to path") == 2


def test_figures_without_an_answer_are_said_to_be_not_measured() -> None:
    nothing = {
        f"{name}_p{q}{end}": None
        for name in ("path", "verdict", "plan")
        for q in (50, 90)
        for end in ("_ms", "_processor_ms")
    }
    text = bench.report({"degree": {"paths": 0, "refused": 9, "plans": 0, **nothing}})
    assert "pointer to path not measured" in text
    assert "9 refused" in text
