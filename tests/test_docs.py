"""The documents: what is made from the code names all of it, and what is written by hand keeps up with it."""

from __future__ import annotations

import fnmatch
import importlib.util
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

import pytest
import yaml
from PIL import ExifTags, Image

import gcsplan
from gcsplan import errors
from gcsplan.app.fleet.pipeline import load_mission, world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.export.summary import ORDER
from gcsplan.mission_file.values import schema
from gcsplan.planners import registry
from gcsplan.sim.vehicle.firmware import FIRMWARE_CHANGES, KNOWN_FIRMWARE
from gcsplan.world.airspace import ViolationKind
from gcsplan.world.terrain.input_files import FENCE_ZONES, OPENAIR_ZONES, ZONE_FILES
from tests.support.paths import REPOSITORY

TOP = REPOSITORY
DOCS = TOP / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
CURE = "run python docs/_make_pictures.py"


@pytest.fixture(scope="module")
def made() -> ModuleType:
    """The hook of the build; it needs no mkdocs to make its parts."""
    spec = importlib.util.spec_from_file_location("_build_reference", DOCS / "_build_reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def kinds_of(kind: type[schema.Keys]) -> Iterator[type[schema.Keys]]:
    """Every section, however deep; found by inheritance and not by the walk that makes the page."""
    for one in kind.__subclasses__():
        yield one
        yield from kinds_of(one)


def own_keys(kind: type[schema.Keys]) -> set[str]:
    """A section's keys without inherited ones; once a schema was made, annotations hold more than keys."""
    return kind.__annotations__.keys() & kind.model_fields.keys()


def rows(table: str) -> list[list[str]]:
    """Cells of every row of every table; a pipe in code or behind a backslash divides nothing."""
    lines = [line for line in table.splitlines() if line.startswith("| ") and not line.startswith("| ---")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


# -- the reference -----------------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_the_mission_file_s_reference_names_every_key_once_and_says_what_it_is(made: ModuleType) -> None:
    keys = [cells for cells in rows(made.mission_file()) if cells[0] != "key"]
    for kind in kinds_of(schema.Keys):
        for key in own_keys(kind):
            [_, *_] = found = [cells for cells in keys if cells[0] == f"`{key}`"]
            assert all(len(cells) == 4 and all(cells) for cells in found), (kind.__name__, key, found)
    assert len(keys) == sum(len(own_keys(kind)) for kind in kinds_of(schema.Keys))


@pytest.mark.nightly
def test_units_and_defaults_are_those_of_the_code(made: ModuleType) -> None:
    told = {(cells[0], cells[3]): cells[1:3] for cells in rows(made.mission_file())}
    by_key = {key: value for (key, _), value in told.items()}
    assert by_key["`budget_s`"] == ["s, > 0, ≤ 86400", "`10`"]
    assert by_key["`min_agl_m`"] == ["m, ≥ 0", "–"]
    assert by_key["`horizontal_clearance_m`"] == ["m, ≥ 0", "`30`"]
    assert by_key["`altitude_frame`"] == ["`relative`, `amsl`, `terrain`", "`relative`"]
    assert by_key["`sysid`"] == ["whole number, 1 to 255", "**required**"]
    assert by_key["`leg_jerk_m_s3`"][0].startswith("m/s³")
    assert by_key["`via`"][0] == (
        "list of [lat, lon] or [lat, lon, agl_m] or text or [text, text] or {east_m, north_m} or {lat, lon, agl_m} "
        "or {at, agl_m}"
    )


@pytest.mark.nightly
def test_the_command_line_s_reference_names_every_command_and_option(made: ModuleType) -> None:
    import typer.main

    from gcsplan.cli.command_table import app

    text = made.command_line()
    parts = {part.split("`")[1]: part for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]}

    def look(name: str, command: Any) -> None:
        part = parts.pop(name)
        assert command.help
        for param in command.params:
            if param.param_type_name == "option" and param.name != "help":
                assert param.help, f"{name} {param.opts}: says nothing"
                for word in (*param.opts, *param.secondary_opts):
                    assert re.search(rf"`{re.escape(word)}[ `]", part), f"{name} {word}"
        for word, inner in getattr(command, "commands", {}).items():
            look(f"{name} {word}", inner)

    look("gcsplan", typer.main.get_command(app))
    assert parts == {}
    assert "| `--timeout S` | `60.0` |" in text


def test_every_exit_code_and_reason_stands_in_the_table(made: ModuleType) -> None:
    table = {cells[1]: cells for cells in rows(made.exit_codes())}
    kinds = [k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, errors.GcsplanError)]
    for kind in kinds:
        assert table[f"`{kind.__name__}`"][0] == str(kind.exit_code)
    assert {cells[0] for cells in table.values()} >= {"0", "129", "130", "143"}
    assert all(f"`{word}`" in table["`NoMission`"][4] for word in get_args(errors.NoMissionReason))
    assert "`parameters`" in table["`VehicleRefused`"][4]


def test_messages_are_read_out_of_the_code_with_what_is_only_known_later(made: ModuleType) -> None:
    texts = {message.text for message in made.messages()}
    assert "give either `dem` or `flat_m` and `peaks`" in texts  # a plain one
    assert "no vehicle is named ‹name›‹nearest›" in texts  # of a Mistake, whose second argument it is
    assert "must be text, 300 characters at most, given ‹shown›" in texts  # put into a name before
    assert len(texts) > 300
    raised = {message.raised for message in made.messages()}
    assert raised >= {"InputError", "UsageError", "Mistake", "NoMission", "Refusal", "LinkError", "VehicleRefused"}


def test_every_planner_stands_in_the_table(made: ModuleType) -> None:
    assert [cells[0] for cells in rows(made.planners())][1:] == [f"`{name}`" for name in registry.names()]


def test_every_change_of_a_firmware_stands_in_the_table(made: ModuleType) -> None:
    assert [cells[1] for cells in rows(made.firmware_changes())][1:] == [change.what for change in FIRMWARE_CHANGES]
    page = (DOCS / "reference" / "simulated-vehicles.md").read_text(encoding="utf-8")
    for versions in KNOWN_FIRMWARE.values():
        assert f"| {', '.join(sorted(f.name for f in versions))} | {versions[0].name} |" in page


def test_the_python_reference_names_all_that_the_package_offers() -> None:
    text = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    for name in set(gcsplan.__all__) - {"__version__"}:
        # mkdocstrings reads the sources: a name that a package has too is the package there, and not the function.
        is_package = (Path(gcsplan.__file__).parent / name).is_dir()
        assert f"\n::: gcsplan.{f'app.api.{name}' if is_package else name}\n" in text, name


# -- pages by hand -----------------------------------------------------------------------------------------------------


def test_the_contract_names_every_key_of_the_summary_and_every_kind_of_violation() -> None:
    text = (DOCS / "reference" / "contract.md").read_text(encoding="utf-8")
    for key in {key for keys in ORDER.values() for key in keys}:
        assert f'"{key}"' in text, key
    for kind in (*get_args(ViolationKind), "battery", "refused", "unreachable", "too_many_items"):
        assert f"`{kind}`" in text, kind


def test_every_ending_of_files_of_zones_stands_where_users_look_it_up() -> None:
    pages = "".join((DOCS / "how-to" / page).read_text(encoding="utf-8") for page in ("zones.md", "airspace.md"))
    assert [e for e in (*ZONE_FILES, *FENCE_ZONES, *OPENAIR_ZONES) if f"`{e}`" not in pages] == []


@pytest.mark.nightly
def test_the_contract_names_every_command() -> None:
    import typer.main

    from gcsplan.cli.command_table import app

    text = (DOCS / "reference" / "contract.md").read_text(encoding="utf-8").split("```")[1]
    groups: list[Any] = [typer.main.get_command(app)]
    for group in groups:
        assert [name for name in group.commands if not re.search(rf"\b{name}\b", text)] == []
        groups += [one for one in group.commands.values() if hasattr(one, "commands")]


def test_every_page_has_its_place_and_every_mark_its_part(made: ModuleType) -> None:
    text = (TOP / "mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in text
    named = set(re.findall(r": ([a-z/-]+\.md)$", text, re.MULTILINE))
    assert {page.relative_to(DOCS).as_posix() for page in PAGES} == named
    marks = {mark for page in PAGES for mark in made.MARK.findall(page.read_text(encoding="utf-8"))}
    assert marks == set(made.PARTS)


@pytest.mark.parametrize("page", [TOP / "README.md", TOP / "CONTRIBUTING.md", *PAGES], ids=lambda p: p.name)
def test_links_between_documents_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", text):
        if not target.startswith(("http:", "https:", "mailto:")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


ROOMS = ("gcsplan", "tests", "sitl_tests", "missions", "docs")


@cache
def words_of(source: Path) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", source.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def paths() -> list[str]:
    """Every file and folder that a page may name, from the top."""
    return [f"/{path.relative_to(TOP).as_posix()}" for room in ROOMS for path in (TOP / room).rglob("*")]


def named_in(page: Path) -> set[str]:
    """What a page writes as code within a line."""
    text = re.sub(r"^ *```.*?^ *```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return set(re.findall(r"`([^`\n]+)`", text))


def lacking(named: set[str], paths: list[str]) -> list[str]:
    """The names that no path ends with; they may have stars."""
    return sorted(one for one in named if not fnmatch.filter(paths, f"*/{one.rstrip('/')}"))


@pytest.mark.parametrize("page", [TOP / "README.md", TOP / "CONTRIBUTING.md", *PAGES], ids=lambda p: p.name)
def test_modules_and_folders_that_a_page_names_are_there(page: Path, paths: list[str]) -> None:
    path = re.compile(rf"(?:{'|'.join(ROOMS)})/[\w/.*-]+|[\w*-]+/[\w/*-]+\.py")
    assert lacking({one for one in named_in(page) if path.fullmatch(one)}, paths) == []


@pytest.mark.parametrize("name", ["architecture.md", "extending.md"])
def test_names_that_developers_are_sent_to_are_there(name: str, paths: list[str]) -> None:
    named = named_in(DOCS / name)
    assert lacking({one for one in named if re.fullmatch(r"[\w*-]+\.py", one)}, paths) == []
    words = {word for path in paths if path.endswith(".py") for word in words_of(TOP / path[1:])}
    names = {match[1] for one in named if (match := re.fullmatch(r"(?:\w+\.)*?(\w+)(?:\.py|\.md|\(.*\))?", one))}
    assert sorted(names - words - {Path(path).stem for path in paths}) == []


@pytest.mark.parametrize("page", [TOP / "CONTRIBUTING.md", *PAGES], ids=lambda p: p.name)
def test_names_in_brackets_behind_a_module_stand_in_it(page: Path, paths: list[str]) -> None:
    text = page.read_text(encoding="utf-8")
    for module, within in re.findall(r"`([\w/]+\.py)` \(([^()]*`\w+`[^()]*)\)", text):
        words = {word for path in paths if path.endswith(f"/{module}") for word in words_of(TOP / path[1:])}
        assert set(re.findall(r"`(\w+)`", within)) <= words, module


@pytest.mark.nightly
def test_the_tutorial_s_mission_is_one(tmp_path: Path) -> None:
    text = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    source, mission, datum = re.findall(r"^```(?:python|yaml)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)[:3]
    subprocess.run([sys.executable, "-c", source], cwd=tmp_path, check=True, timeout=120)
    whole = yaml.safe_load(mission) | yaml.safe_load(datum)
    read = gcsplan.load_mission(tmp_path / "ridge.yaml", text=yaml.safe_dump(whole))
    assert [request.vehicle.name for request in read.vehicles] == ["uav1"]
    with pytest.raises(errors.InputError, match="does not say what its heights are measured from"):
        gcsplan.load_mission(tmp_path / "ridge.yaml", text=mission)


def test_readme_is_short() -> None:
    assert len((TOP / "README.md").read_text(encoding="utf-8").splitlines()) <= 130


# -- what is built -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "foreign"),
    [
        ('<script src="https://cdn.example/x.js"></script>', True),
        ("<script async src=//cdn.example/x.js></script>", True),
        ('<link rel="stylesheet" href="https://fonts.example/css">', True),
        ('<img alt="" src="http://example/x.png">', True),
        ("@import url(https://example/x.css)", True),
        ('a { background: url("https://example/x.png") }', True),
        ('<a href="https://example/">read on</a> <img src="../pictures/a.png">', False),
        ('<script src="../assets/javascripts/bundle.js"></script><link rel="stylesheet" href="site.css">', False),
        ('<link rel="canonical" href="https://example/">', False),
    ],
)
def test_what_loads_from_elsewhere_is_seen(made: ModuleType, text: str, foreign: bool) -> None:
    assert bool(made.FOREIGN.search(text)) is foreign


@pytest.mark.nightly
def test_the_pictures_show_the_sample_mission_as_it_is_planned_today() -> None:
    (vehicle,) = gcsplan.plan(str(TOP / "missions" / "jacksboro.yaml")).vehicles
    for name in ("report.webp", "map.webp"):
        with Image.open(DOCS / "pictures" / name) as page:
            assert page.getexif()[ExifTags.Base.ImageDescription] == f"uav1: {vehicle.verdict.length_m:,.0f} m", CURE
    with Image.open(DOCS / "pictures" / "optimal.png") as proof:
        bound = f"no path is shorter than {vehicle.solution.lower_bound:,.0f} m"
        assert proof.info["Description"].startswith(bound), CURE


@pytest.mark.nightly
def test_the_picture_of_the_proof_tells_walls_room_path_and_gap_with_units() -> None:
    source = load_mission("missions/jacksboro.yaml")
    problem, _ = make_problem(source, source.vehicles[0], world_of(source), "length", 1)
    axes = runpy.run_path(str(DOCS / "_make_pictures.py"))["draw_proof"](problem).axes[0]
    assert "km" in axes.get_xlabel()
    assert "km" in axes.get_ylabel()
    legend = axes.get_legend()
    assert legend is not None
    words = [text.get_text() for text in legend.get_texts()]
    assert any("shorter path" in w for w in words)
    assert any(w.startswith("path, ") and w.endswith(" m") for w in words)
    assert "gap" in axes.get_title(loc="left")
