"""`python docs/_make_pictures.py`: the pictures of README and documents, made from the sample mission.

They lie in `missions/`. Each holds the path's length in its description, which a test compares with a plan.
"""

from __future__ import annotations

import io
from pathlib import Path

from gcsplan.app.fleet.pipeline import load_mission, plan, world_of
from gcsplan.app.output.files import figures_of, picture_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.report.views import proof_picture as idea

MISSIONS = Path(__file__).parents[1] / "missions"


def main() -> None:
    """Write the three pictures."""
    source = load_mission(MISSIONS / "jacksboro.yaml")
    planned = plan(source)
    problem, _ = make_problem(source, source.vehicles[0], world_of(source), source.planner.objective, 1)
    proof = io.BytesIO()
    idea.save(problem, proof)
    for name, content in (
        ("jacksboro.png", picture_of(planned)),
        ("jacksboro-space.png", figures_of(planned)["report-space.png"]),
        ("optimal.png", proof.getvalue()),
    ):
        (MISSIONS / name).write_bytes(content)
        print(f"{MISSIONS / name}: {len(content):,} bytes")


if __name__ == "__main__":
    main()
