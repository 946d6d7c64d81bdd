"""What other packages add: the package of the documents, installed and run, and what a stranger's code may not do."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import gcsplan
from gcsplan.app.api import write
from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.errors import InputError, NoMission, UsageError
from gcsplan.planners import registry
from gcsplan.planners.problem import Problem, Refusal, Solution
from gcsplan.plugins import OPTIMISERS_ADDED, OUTPUTS, PLANNERS, ZONE_READERS, Added, function_at
from gcsplan.research.optimisers import registry as optimisers
from gcsplan.research.optimisers.driver import minimise
from tests.export.test_output_schema import FLAT

DOCUMENT = Path(__file__).parents[1] / "docs" / "extending.md"


@pytest.fixture(autouse=True)
def nothing_added() -> Iterator[None]:
    """Registered names are the process's: each test begins with none, and leaves none."""
    added = (PLANNERS, OUTPUTS, ZONE_READERS, OPTIMISERS_ADDED)
    yield
    for one in added:
        one.forget()


def straight(problem: Problem) -> Solution:
    """Straight on."""
    return Solution(gcsplan.Path(np.array([problem.start, problem.goal])), lower_bound=899.0, stopped_by="gap")


def installed(folder: Path) -> None:
    """The package of the documents, as an installer leaves it."""
    text = DOCUMENT.read_text(encoding="utf-8").partition("## A package of your own")[2]
    project, module = (re.search(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("toml", "python"))
    assert project is not None
    assert module is not None
    about = tomllib.loads(project[1])["project"]
    (folder / "gcsplan_over.py").write_text(module[1], encoding="utf-8")
    info = folder / "gcsplan_over-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n")
    points = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in named.items())
        for group, named in about["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(points), encoding="utf-8")


@pytest.mark.slow
def test_the_package_of_the_documents_is_found_and_run(tmp_path: Path) -> None:
    installed(tmp_path)
    (tmp_path / "some.discs").write_text("36.6 -84.2955 60\n", encoding="utf-8")
    mission = FLAT | {"planner": {"name": "over"}, "no_fly": [{"file": "some.discs"}]}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(mission), encoding="utf-8")
    code = (
        "import sys; sys.path.insert(0, '.')\n"
        "import gcsplan\n"
        "p = gcsplan.plan('m.yaml')\n"
        "gcsplan.write(p, 'out', allow_unjudged=True)\n"
        "print(p.planner, p.vehicles[0].verdict.safe, [z.name for z in p.source.zones], p.vehicles[0].gap_percent)\n"
        "print(open('out/lengths.txt').read())\n"
    )
    limits = mission["limits"] | {"max_amsl_m": 900}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(mission | {"no_fly": [
        {"file": "some.discs"}], "limits": limits}), encoding="utf-8")  # fmt: skip
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    blocked = "no legal altitude" in done.stderr  # a zone without a ceiling is not flown over
    assert blocked, done.stderr[-500:]
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(mission | {"no_fly": []}), encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == "over True [] None\nuav1 900 m\n\n", done.stderr[-500:]


def test_a_function_plans_and_its_claims_are_not_taken_over() -> None:
    planned = plan(FLAT, planner=straight)
    (one,) = planned.vehicles
    assert planned.planner == "straight"
    assert one.verdict.safe
    assert one.solution.lower_bound is None
    assert one.solution.stopped_by == "exhausted"
    assert plan(FLAT, planner="tests.test_plugins:straight").vehicles[0].verdict.safe


def test_a_plan_by_a_function_of_a_script_can_be_pickled() -> None:
    planned = plan(FLAT, planner=lambda problem: straight(problem))
    again = pickle.loads(pickle.dumps(planned))
    assert gcsplan.check(again)["uav1"].safe


def test_a_path_through_a_zone_is_refused_whoever_drew_it() -> None:
    zone = {"name": "mast", "center": {"east_m": 450, "north_m": 0}, "radius_m": 60}
    with pytest.raises(NoMission, match="breaks limits"):
        plan(FLAT | {"no_fly": [zone]}, planner=straight)


def proves(problem: Problem) -> Solution:
    raise Refusal("shut on all sides", reason="infeasible")


def fails(problem: Problem) -> Solution:
    return problem.nothing  # type: ignore[attr-defined,no-any-return]


def answers(value: object) -> Callable[[Problem], Any]:
    return lambda problem: value


def aside(problem: Problem) -> Solution:
    return Solution(gcsplan.Path(np.array([problem.start, np.add(problem.goal, 1.0)])))


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (answers(None), "returns a Solution, given NoneType"), (fails, "planner fails: failed with AttributeError"),
        (answers(Solution(gcsplan.Path(np.zeros((2, 3))))), "by .* m at an end"), (aside, "by 1.000 m at an end"),
        (answers(Solution(None)), "array \\(N, 3\\)"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_what_is_no_path_of_the_problem_is_told_with_the_planners_name(function: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        plan(FLAT, planner=function)


def test_a_proof_of_a_stranger_counts_as_not_found() -> None:
    with pytest.raises(NoMission, match="nothing proves it") as refused:
        plan(FLAT, planner=proves)
    assert refused.value.reason == "not_found"


def test_a_registered_planner_is_known_by_name_and_own_names_count_first(tmp_path: Path) -> None:
    gcsplan.register_planner("ours", straight)
    gcsplan.register_planner("optimal", fails)
    assert plan(FLAT | {"planner": {"name": "ours"}}).planner == "ours"
    assert plan(FLAT).vehicles[0].gap_percent is not None
    assert registry.names()[0] == "optimal"
    assert "ours" in registry.names()
    assert any(row.name == "ours" and row.summary == "Straight on." for row in registry.rows())
    with pytest.raises(InputError, match="no planner is named"):
        load_mission(FLAT | {"planner": {"name": "tests.test_plugins:straight"}})


@pytest.mark.parametrize(("name", "function"), [("", straight), ("a/b", straight), (7, straight), ("x", None)])
def test_a_bad_name_or_no_function_is_a_mistake_of_the_script(name: Any, function: Any) -> None:
    for register in (gcsplan.register_planner, gcsplan.register_output, gcsplan.register_optimiser):
        with pytest.raises(UsageError):
            register(name, function)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        ({"summary.json": "x"}, "no free name"), ({"a/b.txt": "x"}, "no free name"), ({".hidden": "x"}, "no free name"),
        ({"a.txt": b"x"}, "from file names to texts"), (7, "from file names to texts"),
    ],
)  # fmt: skip
def test_an_output_has_a_free_name_and_a_text(made: Any, words: str, tmp_path: Path) -> None:
    planned = plan(FLAT)
    gcsplan.register_output("mine", lambda _: made)
    with pytest.raises(InputError, match=words):
        write(planned, tmp_path)


def test_outputs_are_written_and_removed_with_the_others(tmp_path: Path) -> None:
    planned = plan(FLAT)
    gcsplan.register_output("mine", lambda p: {"mine.txt": p.source.name})
    write(planned, tmp_path)
    assert (tmp_path / "mine.txt").read_text(encoding="utf-8") == "mission"
    OUTPUTS.forget()
    write(planned, tmp_path)
    assert not (tmp_path / "mine.txt").exists()


def test_a_readers_geojson_has_all_checks_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.zon").write_bytes(b"36.6 -84.3 50")
    entry = {"file": str(tmp_path / "a.zon")}
    with pytest.raises(InputError, match="zones are read from"):
        load_mission(FLAT | {"no_fly": [entry]})
    for made, words in (
        ({"type": "Polygon"}, "a list of rings"),
        (None, "holds one object"),
        (b"", "its reader: GeoJSON holds"),
    ):
        gcsplan.register_zone_reader(".zon", lambda _, made=made: made)
        with pytest.raises(InputError, match=words):
            load_mission(FLAT | {"no_fly": [entry]})


def gaussian(run: Any) -> Any:
    """Steps that shrink."""
    x = run.first()
    f = yield x
    for k in run.cycles():
        tried = np.clip(x + 0.3 / (k + 1) * run.rng.standard_normal(x.shape), 0.0, 1.0)
        g = yield tried
        better = g < f
        x[better], f[better] = tried[better], g[better]


def test_an_optimiser_of_a_script_runs_like_ours() -> None:
    gcsplan.register_optimiser("gaussian", gaussian)
    for name in ("gaussian", "tests.test_plugins:gaussian"):
        entry = optimisers.get(name)
        found = minimise(entry, lambda x: ((x - 0.3) ** 2).sum(axis=1), 3, population=10, iterations=40, seed=1)
        assert found.cost < 0.01


def test_a_module_or_function_that_is_not_there_is_told() -> None:
    for place in ("no_such_module:plan", "gcsplan.plugins:nothing", "gcsplan.plugins:__all__"):
        with pytest.raises(InputError):
            function_at(place, "planner")
    assert Added("gcsplan.planners").get("nobody") is None
