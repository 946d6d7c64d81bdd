"""The house: which room may import which, who may know a degree, who may open a socket; held over the syntax tree."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import gcsplan

ROOT = Path(gcsplan.__file__).parent
MODULES = sorted(ROOT.rglob("*.py"))
TOPS = {path.relative_to(ROOT).with_suffix("").parts[0] for path in MODULES}

# The rooms from the bottom up. Each may import what stands in its set, and itself; a module in none is a mistake.
WORLD = {"errors", "native", "world"}
VEHICLE = WORLD | {"vehicle"}
ABOVE = VEHICLE | {"swarm", "planners", "fleet", "mavlink", "check", "way_home"}
OUTWARD = ABOVE | {"export", "report"}
EVERYTHING = OUTWARD | {"mission_file", "pipeline", "sim", "rehearsing", "bench", "console", "logs"}

MAY_IMPORT: dict[str, set[str]] = {
    "errors": set(),
    "native": set(),
    "world": {"errors", "native"},
    "vehicle": WORLD,
    "logs": {"errors"},
    "swarm": {"errors"},
    "planners": VEHICLE | {"swarm"},
    "fleet": VEHICLE,
    "mavlink": VEHICLE,
    # The mission and how each autopilot stores it: never the transfer, never a link.
    "check": VEHICLE | {"mavlink.mission", "mavlink.autopilots"},
    "way_home": VEHICLE | {"mavlink.mission", "mavlink.autopilots", "check"},
    "export": ABOVE,
    "report": ABOVE | {"export"},
    "mission_file": OUTWARD,
    "pipeline": OUTWARD | {"mission_file"},
    "sim": VEHICLE | {"mavlink", "check"},
    "bench": OUTWARD | {"mission_file", "pipeline", "sim"},
    "rehearsing": OUTWARD | {"mission_file", "pipeline", "sim"},
    "scripting": OUTWARD | {"mission_file", "pipeline", "sim", "rehearsing"},
    "console": EVERYTHING,
    "cli": EVERYTHING,
}

# Folders that belong to a room: the steps of the way of the data, and the commands of the command line.
STEPS = {"steps"}
COMMAND_LINE = {"commands"}

PROJECTION = {"world/frame.py", "world/datum.py", "world/terrain.py"}
SOCKETS = {"mavlink/link.py", "mavlink/transport.py", "sim/server.py", "sim/sockets.py"}
NETWORK = {"socket", "socketserver", "select", "selectors", "asyncio", "ssl", "http", "urllib", "serial"}
DEGREES = ("lat_deg", "lon_deg", "lat_e7", "lon_e7")
MOST_LINES = 420  # 400 is the aim


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def room_of(path: Path) -> str:
    return room(path.relative_to(ROOT).with_suffix("").parts[0])


def room(top: str) -> str:
    """The room of a module or folder that stands directly in the package."""
    return "pipeline" if top in STEPS else "cli" if top in COMMAND_LINE else top


def knows_metres_alone(path: Path) -> bool:
    """The rooms that may know no latitude: planners, swarm, fleet, and the airspace with all its parts."""
    parts = path.relative_to(ROOT).parts
    if parts[0] == "world":
        return path.stem.startswith(("airspace", "_", "tube")) and path.stem != "__init__"
    return parts[0] in ("planners", "swarm", "fleet")


def imported(tree: ast.AST, package: tuple[str, ...]) -> Iterator[str]:
    """Dotted names of all modules imported anywhere in ``tree``, lazily too, but for those that only types need."""
    skipped: set[ast.AST] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            skipped.update(inner for statement in node.body for inner in ast.walk(statement))
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = list(package[: len(package) - node.level + 1]) if node.level else []
            base += node.module.split(".") if node.module else []
            # `from gcsplan.mavlink import link` imports a module although it looks like a name.
            yield from (".".join([*base, alias.name]) for alias in node.names)


@cache
def imports_of(path: Path) -> frozenset[str]:
    package = ("gcsplan", *path.relative_to(ROOT).parts[:-1])
    return frozenset(imported(ast.parse(path.read_text(encoding="utf-8")), package))


def own(module: str) -> str | None:
    """``room.module`` of an imported module of gcsplan's own; None for others and for names of the package itself."""
    first, *rest = module.split(".")
    if first != "gcsplan" or not rest or rest[0] not in TOPS:
        return None
    return ".".join(rest[:2]) if rest[0] not in COMMAND_LINE | STEPS and (ROOT / rest[0]).is_dir() else room(rest[0])


def identifiers(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        for key in ("id", "attr", "arg", "name", "asname"):
            value = getattr(node, key, None)
            if isinstance(value, str):
                yield value


def test_every_module_has_its_room_in_the_table() -> None:
    rooms = {room_of(path) for path in MODULES} - {"__init__"}
    assert rooms - set(MAY_IMPORT) == set()


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_a_room_imports_only_what_it_may(path: Path) -> None:
    where = room_of(path)
    if where == "__init__":
        return  # the package's own front door; what it offers, it imports when it is asked for
    found = {name for module in imports_of(path) if (name := own(module)) is not None}
    allowed = MAY_IMPORT[where] | {where}
    wrong = {name for name in found if name not in allowed and name.split(".")[0] not in allowed}
    assert wrong == set(), f"{name_of(path)} may not import {sorted(wrong)}"


def test_nothing_imports_the_command_line() -> None:
    assert [name_of(p) for p in MODULES if "cli" in {own(m) for m in imports_of(p)} and room_of(p) != "cli"] == []


def test_the_front_door_opens_without_the_heavy_rooms() -> None:
    tree = ast.parse((ROOT / "__init__.py").read_text(encoding="utf-8"))
    at_once = ast.Module([n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)], [])
    roots = {name.split(".")[0] for name in imported(at_once, ("gcsplan",))}
    assert roots <= set(sys.stdlib_module_names) | {"__future__"}


@pytest.mark.parametrize("path", [p for p in MODULES if knows_metres_alone(p)], ids=name_of)
def test_planners_and_airspace_know_metres_alone(path: Path) -> None:
    roots = {module.split(".")[0] for module in imports_of(path)}
    assert roots & {"pyproj", "rasterio", "pymavlink"} == set()
    names = set(identifiers(ast.parse(path.read_text(encoding="utf-8"))))
    assert sorted(n for n in names if any(word in n.lower() for word in DEGREES)) == []


def test_only_the_door_projects() -> None:
    users = {name_of(p) for p in MODULES if any(m.split(".")[0] == "pyproj" for m in imports_of(p))}
    assert users <= PROJECTION


def test_swarm_is_numpy_alone() -> None:
    allowed = set(sys.stdlib_module_names) | {"numpy", "gcsplan"}
    for path in (p for p in MODULES if room_of(p) == "swarm"):
        assert {m.split(".")[0] for m in imports_of(path)} <= allowed, name_of(path)


def test_sockets_are_opened_by_the_link_and_the_simulated_vehicles_server_alone() -> None:
    users = {name_of(p) for p in MODULES if NETWORK & {m.split(".")[0] for m in imports_of(p)}}
    assert users <= SOCKETS


def test_no_module_has_grown_into_two() -> None:
    lines = {name_of(p): len(p.read_text(encoding="utf-8").splitlines()) for p in MODULES}
    assert {name: n for name, n in lines.items() if n > MOST_LINES} == {}


# -- the reader of imports itself ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import gcsplan.mavlink.link", {"gcsplan.mavlink.link"}),
        ("from gcsplan.mavlink import link", {"gcsplan.mavlink.link"}),
        ("from gcsplan import cli as c", {"gcsplan.cli"}),
        ("from .mission import Mission", {"gcsplan.mavlink.mission.Mission"}),
        ("from . import link", {"gcsplan.mavlink.link"}),
        ("from ..world.frame import Frame", {"gcsplan.world.frame.Frame"}),
        ("def f():\n    import socket", {"socket"}),
        ("if TYPE_CHECKING:\n    import a\nelse:\n    import b\nimport c", {"b", "c"}),
        ("if typing.TYPE_CHECKING:\n    import a", set()),
    ],
)
def test_imports_are_seen_however_they_are_written(source: str, found: set[str]) -> None:
    assert set(imported(ast.parse(source), ("gcsplan", "mavlink"))) == found


def test_own_modules_are_told_from_names_and_from_others() -> None:
    assert own("gcsplan.mavlink.mission.Mission") == "mavlink.mission"
    assert own("gcsplan.errors.InputError") == "errors"
    assert own("gcsplan.__version__") is None
    assert own("numpy.typing") is None


def test_degrees_are_seen_in_every_kind_of_name() -> None:
    for source in ("lat_deg = 1", "x.home_lat_e7", "def f(lon_deg): pass", "f(lat_deg=1)", "def lon_e7(): pass"):
        assert any(word in name for name in identifiers(ast.parse(source)) for word in DEGREES), source
