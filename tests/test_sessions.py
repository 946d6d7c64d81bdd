"""The sessions of noxfile.py, and all that calls them by name: the workflows, `.ci/run`, the documents."""

from __future__ import annotations

import ast
import re
import tomllib
from itertools import product
from typing import Any

import pytest
import yaml

from tests.support.paths import REPOSITORY

WORKFLOWS = sorted((REPOSITORY / ".github" / "workflows").glob("*.yml"))
NOXFILE = ast.parse((REPOSITORY / "noxfile.py").read_text(encoding="utf-8"))


def constant(name: str) -> Any:
    """The value of a constant of noxfile.py; nox itself is not among the libraries of the tests."""
    for node in NOXFILE.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return ast.literal_eval(node.value)
    raise KeyError(name)


def sessions() -> dict[str, list[str]]:
    """Names of sessions with the Pythons that each is made for; none where nox's own Python runs it."""
    found: dict[str, list[str]] = {}
    for node in NOXFILE.body:
        for mark in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            if ast.unparse(mark).startswith("nox.session"):
                keys = mark.keywords if isinstance(mark, ast.Call) else []
                given = next((key.value for key in keys if key.arg == "python"), ast.List([]))
                found[node.name] = list(constant(given.id) if isinstance(given, ast.Name) else ast.literal_eval(given))
    return found


def names() -> set[str]:
    """All that may follow ``nox --session``."""
    return set(sessions()) | {f"{name}-{python}" for name, pythons in sessions().items() for python in pythons}


def commands(job: dict[str, Any]) -> list[str]:
    """The commands of a job, once for each combination of its matrix."""
    matrix = dict(job.get("strategy", {}).get("matrix", {}))
    more = matrix.pop("include", [])
    filled = [dict(zip(matrix, values, strict=True)) for values in product(*matrix.values())] + more
    found = []
    for values in filled:
        for step in job["steps"]:
            command = step.get("run", "")
            for key, value in values.items():
                command = command.replace(f"${{{{ matrix.{key} }}}}", value)
            found.append(command)
    return found


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_calls_sessions_that_exist(path: Any) -> None:
    jobs = yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"]
    for name, job in jobs.items():
        called = [re.findall(r"nox --session (\S+)", command) for command in commands(job)]
        assert any(called), f"{name} runs no session"
        assert {one for some in called for one in some} <= names(), name
        assert job["timeout-minutes"] <= 120


def test_the_workflows_run_every_session_on_every_python() -> None:
    called = {
        name
        for path in WORKFLOWS
        for job in yaml.safe_load(path.read_text(encoding="utf-8"))["jobs"].values()
        for command in commands(job)
        for name in re.findall(r"nox --session (\S+)", command)
    }
    alone = {name for name, pythons in sessions().items() if not pythons}
    assert called == alone | (names() - set(sessions()))


def test_a_clean_clone_runs_sessions_that_exist() -> None:
    text = (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    called = re.findall(r"^session (\w+)", text, re.MULTILINE)
    assert len(called) >= 5
    assert set(called) <= set(sessions())


def test_every_campaign_is_a_module() -> None:
    missing = [n for n in constant("CAMPAIGNS") if not (REPOSITORY / "tests" / "campaigns" / f"{n}.py").is_file()]
    assert missing == []


def test_both_lines_of_the_readme_are_found_as_the_sessions_look_for_them() -> None:
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    for name in ("run", "test"):
        assert len(re.findall(rf"^<!-- ci:{name} -->\n```sh\n(.+)\n```$", text, re.MULTILINE)) == 1


def test_the_oldest_python_is_the_one_that_is_required() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == f">={constant('PYTHONS')[0]}"


def test_every_dependency_has_its_reason() -> None:
    text = (REPOSITORY / "pyproject.toml").read_text(encoding="utf-8")
    listed = text[text.index("\ndependencies = [") : text.index("\n[project.scripts]")].splitlines()
    bare = [line for line in listed if re.match(r'    "(?!gcsplan\[)', line) and not re.search(r'",\s+# \w', line)]
    assert bare == []
    assert sum(line.startswith('    "') for line in listed) > 30
