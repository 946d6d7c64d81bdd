"""The searches are the files of their folder; the documents name the same, and how to add one."""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import gcsplan
from gcsplan.errors import InputError
from gcsplan.planners.optimal import searches
from gcsplan.planners.optimal.loop.governor import govern
from gcsplan.planners.optimal.loop.search import Search
from gcsplan.planners.optimal.table import NAMES, all_searches, kinds, left_out
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import faults, ground
from tests.support.searches import work_of

DOCS = Path(__file__).parents[3] / "docs"
AROUND = Problem(
    Airspace(ground(0.0), [Zone("disc", Circle(1000.0, 1000.0, 100.0))]), Limits(10.0), (300.0, 1000.0, 50.0),
    (1700.0, 1000.0, 50.0),
)  # fmt: skip


def test_each_module_of_the_folder_has_one_search_of_its_name() -> None:
    assert [kind.NAME for kind in kinds()] == list(NAMES)
    assert all(kind.__module__.endswith(f".{kind.NAME}") for kind in kinds())
    assert all(0.0 < kind.SHARE <= 1.0 for kind in kinds())


def test_the_page_of_the_planner_has_the_same_searches_and_what_they_improve() -> None:
    rows = re.findall(r"^\| `(\w+)` \|.*\| ([a-z, ]+) \|$", (DOCS / "planner.md").read_text(), re.MULTILINE)
    assert dict(rows) == {kind.NAME: kind.IMPROVES for kind in kinds()}


def test_searches_that_options_leave_out_are_not_made_and_unknown_names_are_refused() -> None:
    without = replace(AROUND, options={"without": ("outlines", "bound")})
    assert left_out(without) == ("outlines", "bound")
    left = {search.NAME for search in all_searches(work_of(without))}
    assert left == set(NAMES) - {"outlines", "bound"}
    with pytest.raises(InputError, match=rf"the searches are {', '.join(NAMES)}; given outline$"):
        all_searches(work_of(replace(AROUND, options={"without": "outline"})))


@pytest.mark.slow
def test_a_search_sets_no_attribute_of_another_and_keeps_its_own() -> None:
    """A `Layer` and a `Narrow` are made by the search itself."""
    for path in sorted(Path(searches.__path__[0]).glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            for target in targets:
                if isinstance(target, ast.Attribute):
                    base = target.value
                    own = isinstance(base, ast.Name) and base.id in ("self", "layer", "narrow")
                    assert own, f"{path.name}:{node.lineno} sets {ast.unparse(target)}"


def test_the_search_that_the_documents_show_runs_and_finds_a_path() -> None:
    page = (DOCS / "extending.md").read_text()
    (code,) = re.findall(r"```python\n(\"\"\"Two legs by way.*?)```", page, re.DOTALL)
    room: dict[str, Any] = {}
    exec(code, room)
    aside: Search = room["Aside"](work_of(AROUND))
    assert not aside.applies()  # no path is known
    govern(aside.incumbent, [aside])
    assert aside.incumbent.steps == []
    aside.run()
    assert aside.incumbent.best is not None
    assert faults(AROUND, gcsplan.Path(aside.incumbent.best)) == []
    assert 1400.0 < aside.incumbent.cost < 1500.0
