"""The plan in space for the page: what the report's own view, and its replay, are drawn from."""

from __future__ import annotations

from typing import Any

from gcsplan.app.output.report import page_of_plan
from gcsplan.app.plan.model import Plan
from gcsplan.page.fleet.time_table import numbers_of
from gcsplan.report.parts.page_data import in_full, samples_of
from gcsplan.report.views.space import drawn, space_data
from gcsplan.units import Units

SCENE_SAMPLES, SCENE_SAMPLES_IN_ALL, LEAST_SAMPLES = 300, 3600, 24
"""Most samples of one line, of all together, and of one of very many; a few more if lines have many legs."""


def scene_answer(n: int, plan: Plan, units: Units) -> dict[str, Any]:
    """The ground, the zones, the lines and the replay of a plan; vehicles have their numbers in the mission file."""
    page, numbers = page_of_plan(plan, units=units), numbers_of(plan)
    most = min(SCENE_SAMPLES, max(LEAST_SAMPLES, SCENE_SAMPLES_IN_ALL // len(plan.vehicles)))
    seen = drawn(page, [min(samples, most) for samples in samples_of(page, in_full(page))])
    data: dict[str, Any] = space_data(page, seen)
    for line in data["lines"]:
        line["index"] = numbers[line["name"]]
    for track in data["replay"]["tracks"] if data["replay"] else ():
        track["k"] = numbers[track["name"]]
    return {"type": "scene", "n": n, "picture": seen.relief.picture, **data}
