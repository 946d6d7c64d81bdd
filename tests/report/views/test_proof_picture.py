"""The picture of how the default planner knows."""

from __future__ import annotations

from gcsplan.app.fleet.pipeline import load_mission, world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.report.views.proof_picture import draw


def test_picture_tells_walls_room_path_and_gap_with_units() -> None:
    source = load_mission("missions/jacksboro.yaml")
    problem, _ = make_problem(source, source.vehicles[0], world_of(source), "length", 1)
    axes = draw(problem).axes[0]
    assert "km" in axes.get_xlabel()
    assert "km" in axes.get_ylabel()
    legend = axes.get_legend()
    assert legend is not None
    words = [text.get_text() for text in legend.get_texts()]
    assert any("shorter path" in w for w in words)
    assert any(w.startswith("path, ") and w.endswith(" m") for w in words)
    assert "gap" in axes.get_title(loc="left")
