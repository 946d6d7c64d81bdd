"""The house: what each package may import, who may know a degree, who may open a socket; held over the syntax tree.

`python -m tests.test_house` prints packages, arrows, circles, the longest modules and functions.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

import gcsplan
from tests.support.paths import REPOSITORY

ROOT = Path(gcsplan.__file__).parent
MODULES = sorted(ROOT.rglob("*.py"))

pytestmark = pytest.mark.xdist_group("house")  # one process reads the modules, not three

# The packages from the bottom up. Each may import what stands in its set, and itself; a module in none is a mistake.
WORLD = {"arrays", "errors", "figures", "native", "notes", "units", "world"}
TERRAIN = WORLD | {"dem"}
VEHICLE = WORLD | {"vehicle"}
MISSION = VEHICLE | {"mavlink.mission"}
MAVLINK = {"mavlink.mission", "mavlink.build", "mavlink.files", "mavlink.protocol", "mavlink.link"}
ABOVE = VEHICLE | MAVLINK | {"planners", "fleet", "check", "wind"}
OUTWARD = ABOVE | {"export", "plugins", "report", "sim"}
APP = OUTWARD | {"dem", "mission_file", "app"}

MAY_IMPORT: dict[str, set[str]] = {
    "arrays": set(),
    "errors": set(),
    "figures": set(),
    "plugins": {"errors"},
    "native": set(),
    "units": {"errors", "figures"},
    "notes": {"figures", "units"},
    "world": {"arrays", "errors", "figures", "native", "notes", "units"},
    "dem": WORLD,
    "vehicle": WORLD,
    "logs": {"arrays", "errors", "figures", "notes"},
    "planners": WORLD | {"plugins"},
    "wind": VEHICLE,
    "fleet": VEHICLE | {"wind"},
    "mavlink.mission": VEHICLE,
    "mavlink.build": MISSION | {"mavlink.files"},
    "mavlink.files": MISSION,
    # The protocol knows no socket and no clock, and nobody who has them.
    "mavlink.protocol": MISSION,
    "mavlink.link": MISSION | {"mavlink.protocol"},
    # The mission and how each autopilot stores it: never the transfer, never a link.
    # How long a flight takes is the fleet's model of motion.
    "check": MISSION | {"fleet", "wind"},
    "export": ABOVE,
    "report": ABOVE | {"export"},
    # The dem package writes the terrain files that SITL reads.
    "sim": VEHICLE | MAVLINK | {"check", "dem", "wind"},
    "mission_file": OUTWARD | TERRAIN,
    "app": OUTWARD | {"dem", "mission_file"},
    "page": APP,
    "bench": APP | {"page"},
    # Research imports the product, and only the command line imports research.
    "research.optimisers": {"arrays", "errors", "plugins"},
    "research.swarm": WORLD | {"planners", "research.optimisers"},
    "research.bench": APP | {"bench", "page", "research.optimisers", "research.swarm"},
    "cli": APP | {"bench", "dem", "logs", "page", "research.bench"},
    "__main__": {"cli"},
}

ROOMS = {"mavlink", "research"}
"""Folders without modules of their own; each folder in them is a package."""

PROJECTION = {
    "world/geodesy/frame.py",
    "world/geodesy/datum.py",
    "world/geodesy/grids.py",
    "world/geodesy/reprojection.py",
    "world/terrain/terrain.py",
}
SOCKETS = {
    "dem/download.py",
    "mavlink/link/link.py",
    "mavlink/link/transport.py",
    "page/server.py",
    "sim/vehicle/server.py",
}
NETWORK = {"socket", "socketserver", "select", "selectors", "asyncio", "ssl", "http", "urllib", "serial"}
DEGREES = ("lat_deg", "lon_deg", "lat_e7", "lon_e7")
MOST_LINES = 600  # of a module
MOST_LINES_OF_FUNCTION = 80

TABLES = {
    "cli/commands/plan.py",
    "cli/commands/check.py",
    "cli/commands/rehearse.py",
    "cli/commands/vehicles.py",
    "cli/commands/sim.py",
    "cli/commands/bench.py",
    "cli/commands/new.py",
    "cli/commands/terrain.py",
}
"""A command's arguments are the table of its options, and its docstring is its help: its body alone counts."""

LONG = {
    "planners/optimal/navmesh/polyanya.py": {"search"},
    "planners/optimal/navmesh/mesh_kernels.py": {"make_portals"},
    "planners/lattice/search_kernels.py": {"reach"},
    "planners/lattice/pull_kernels.py": {"pull"},
    "world/kernels/sweep_terrain.py": {"sweep"},
    "world/kernels/sweep_zones.py": {"nearest_conflict"},
    "world/kernels/envelope.py": {"pieces"},
}
"""Kernels whose one loop keeps its numbers in registers: a call in it would cost time, or carry all of them along."""


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def module_of(path: Path) -> str:
    """The dotted name of a module or package."""
    parts = ("gcsplan", *path.relative_to(ROOT).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {module_of(path) for path in MODULES}


def package_of(module: str) -> str:
    """The package of the table that a module belongs to; empty for the front door."""
    parts = module.split(".")[1:]
    return ".".join(parts[: 2 if parts[:1] in ([room] for room in ROOMS) else 1])


def knows_metres_alone(path: Path) -> bool:
    """The packages that may know no latitude: planners, optimisers, fleet, and the airspace with all its parts."""
    parts = path.relative_to(ROOT).parts
    if parts[0] == "world":
        return parts[1] == "kernels" or path.stem in ("airspace", "tube")
    return parts[0] in ("planners", "fleet") or parts[:2] in (("research", "optimisers"), ("research", "swarm"))


@cache
def nodes_of(path: Path) -> list[ast.AST]:
    """All nodes of a module. Reading them takes most of these tests' time, so it is done once."""
    return list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def imported(nodes: Iterable[ast.AST], package: tuple[str, ...]) -> Iterator[str]:
    """Dotted names of all that ``nodes`` import, inside functions and for types alone, too."""
    for node in nodes:
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
    return frozenset(imported(nodes_of(path), package))


def own(name: str) -> str | None:
    """The module of gcsplan's own that an imported name is, or stands in; None for others, and for the front door."""
    parts = name.split(".")
    found = next((".".join(parts[:k]) for k in range(len(parts), 0, -1) if ".".join(parts[:k]) in NAMES), None)
    return None if found == "gcsplan" else found


@cache
def own_imports(path: Path) -> frozenset[str]:
    return frozenset(module for name in imports_of(path) if (module := own(name)) is not None)


def identifiers(nodes: Iterable[ast.AST]) -> Iterator[str]:
    for node in nodes:
        for key in ("id", "attr", "arg", "name", "asname"):
            value = getattr(node, key, None)
            if isinstance(value, str):
                yield value


def test_every_module_has_its_package_in_the_table() -> None:
    assert {package_of(name) for name in NAMES} - {"", *ROOMS} == set(MAY_IMPORT)


def test_a_package_imports_only_what_it_may() -> None:
    wrong = {}
    for path in MODULES:
        where = package_of(module_of(path))
        if where in ("", *ROOMS):
            continue  # the front door; what it offers, it imports when it is asked for
        found = {package_of(module) for module in own_imports(path)} - {where}
        if found - MAY_IMPORT[where]:
            wrong[name_of(path)] = sorted(found - MAY_IMPORT[where])
    assert wrong == {}, "these modules may not import these packages"


def test_the_table_allows_no_more_than_the_documents_say() -> None:
    """A row of docs/architecture.md allows the packages that it names, and what these may import."""
    page = (REPOSITORY / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w.]+)` \| .* \| ([^|]+) \|$", page.partition("## Packages")[2], re.MULTILINE)
    said: dict[str, set[str]] = {}
    for package, words in rows:
        names = {*said} if words in ("all above", "everything") else {*re.findall(r"[\w.]+", words.split(" (")[0])}
        said[package] = names.union(*(said[name] for name in names))
    assert {*said, "__main__"} == {*MAY_IMPORT}
    assert {package: MAY_IMPORT[package] - names - {package} for package, names in said.items()} == {
        package: set() for package in said
    }


def test_the_table_has_no_circle() -> None:
    for name, below in MAY_IMPORT.items():
        assert [other for other in below if name in MAY_IMPORT.get(other, ())] == [], name


def circles(arrows: dict[str, set[str]]) -> list[list[str]]:
    """Those that reach themselves, each with all that it shares a circle with."""

    def reached(first: str) -> set[str]:
        seen: set[str] = set()
        left = list(arrows.get(first, ()))
        while left:
            here = left.pop()
            if here not in seen:
                seen.add(here)
                left.extend(arrows.get(here, ()))
        return seen

    reach = {name: reached(name) for name in arrows}
    return sorted({tuple(sorted(b for b in reach[a] if a in reach.get(b, ()))) for a in arrows if a in reach[a]})


FILE_ENDINGS = {"geojson", "kml", "plan", "py"}


def test_a_name_that_a_docstring_sends_to_stands_in_its_module() -> None:
    """`module.name`: the name stands in a module of this name, or is a module in a package of this name."""
    texts = {path: path.read_text(encoding="utf-8") for path in MODULES}
    places: dict[str, list[str]] = {}  # what stands in a module or package, by its name
    for path, text in texts.items():
        *packages, last = module_of(path).split(".")
        places.setdefault(last, []).append(text)
        for package, inner in pairwise([*packages, last]):
            places.setdefault(package, []).append(inner)
    lacking = [
        f"{name_of(path)}: `{module}.{name}`"
        for path, text in texts.items()
        for module, name in re.findall(r"(?<!`)`(?:\w+\.)*?(\w+)\.(\w+)`", text)
        if module in places and name not in FILE_ENDINGS
        if not any(re.search(rf"\b{name}\b", place) for place in places[module])
    ]
    assert lacking == []


def test_the_table_of_a_package_s_docstring_names_its_modules() -> None:
    for path in (p for p in MODULES if p.name == "__init__.py"):
        rows = re.findall(r"^`(\w+)` {2,}", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert {*rows} <= {inner.stem for inner in path.parent.iterdir()}, name_of(path)


def test_no_files_import_each_other_in_a_circle() -> None:
    arrows = {module_of(p): set(own_imports(p)) for p in MODULES if module_of(p) != "gcsplan"}
    assert circles(arrows) == []


def test_circles_are_seen() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == [("a", "b", "c")]
    assert circles({"a": {"b"}, "b": {"c"}, "c": set()}) == []


def test_the_front_door_opens_without_the_heavy_rooms() -> None:
    tree = ast.parse((ROOT / "__init__.py").read_text(encoding="utf-8"))
    roots = {name.split(".")[0] for name in imported(tree.body, ("gcsplan",))}
    assert roots <= set(sys.stdlib_module_names) | {"__future__"}


def test_planners_and_airspace_know_metres_alone() -> None:
    degrees = {}
    for path in (p for p in MODULES if knows_metres_alone(p)):
        roots = {module.split(".")[0] for module in imports_of(path)}
        names = {n for n in identifiers(nodes_of(path)) if any(word in n.lower() for word in DEGREES)}
        if found := sorted(names | roots & {"pyproj", "rasterio", "pymavlink"}):
            degrees[name_of(path)] = found
    assert degrees == {}


def test_only_the_door_projects() -> None:
    users = {name_of(p) for p in MODULES if any(m.split(".")[0] == "pyproj" for m in imports_of(p))}
    assert users <= PROJECTION


def test_optimisers_are_numpy_alone() -> None:
    allowed = set(sys.stdlib_module_names) | {"numpy", "gcsplan"}
    for path in (p for p in MODULES if package_of(module_of(p)) == "research.optimisers"):
        assert {m.split(".")[0] for m in imports_of(path)} <= allowed, name_of(path)


def test_sockets_are_opened_by_the_link_and_the_simulated_vehicles_server_alone() -> None:
    used = {name_of(p): NETWORK & {m.split(".")[0] for m in imports_of(p)} for p in MODULES}
    assert used.pop("app/session.py") == {"asyncio"}  # to await a plan in a thread of its own, without a socket
    assert {name for name, network in used.items() if network} <= SOCKETS


def test_terrain_is_fetched_by_its_own_command_alone() -> None:
    network = {"gcsplan.dem.download", "gcsplan.dem.fetch"}
    users = {name_of(p) for p in MODULES if own_imports(p) & network}
    assert users == {"dem/fetch.py", "cli/commands/dem.py", "app/api.py"}  # `fetch_dem` is the command for scripts
    for file in ("cli/commands/dem.py", "app/api.py"):
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        outside = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
        assert not {own(name) for name in imported(outside, ("gcsplan", file.partition("/")[0]))} & network, file


def test_research_is_imported_by_the_benches_that_are_called_alone() -> None:
    def of_research(names: Iterable[str]) -> set[str]:
        return {name for name in names if name.startswith("gcsplan.research")}

    users = {name_of(p) for p in MODULES if of_research(imports_of(p)) and not name_of(p).startswith("research/")}
    assert users == {"cli/commands/bench.py"}
    tree = ast.parse((ROOT / "cli/commands/bench.py").read_text(encoding="utf-8"))
    outside = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
    assert not of_research(imported(outside, ("gcsplan", "cli"))), "other commands import it too"


def test_no_module_has_grown_into_two() -> None:
    lines = {name_of(p): len(p.read_text(encoding="utf-8").splitlines()) for p in MODULES}
    assert {name: n for name, n in lines.items() if n > MOST_LINES} == {}


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Every function of a module, methods and inner ones too, with its lines; of a command those of its body."""
    for node in nodes_of(path):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            begins = node.body[min(1, len(node.body) - 1)] if name_of(path) in TABLES else node
            yield node.name, (node.end_lineno or 0) - begins.lineno + 1


def test_a_function_fits_on_a_screen() -> None:
    found = {name_of(p): {name for name, n in functions(p) if n > MOST_LINES_OF_FUNCTION} for p in MODULES}
    assert {name: long for name, long in found.items() if long} == LONG


# -- the house in figures -----------------------------------------------------------------------------------------

MOST_IN_A_FOLDER = 15

MOST = {
    "modules": 504,
    "statements": 74_247,
    "type names with two meanings": 0,
    "constants with two values": 0,
    "folders with more than 15 modules": 0,
    "folders in a circle": 0,
    "names of another module that begin with _": 0,
}
"""What is left to do, at most: a figure that falls is written down here, and none may rise."""


def names_with_two_meanings() -> dict[str, list[str]]:
    """Names of classes and of types that are defined more than once, each with the modules that define it."""
    found: dict[str, list[str]] = {}
    for path in MODULES:
        name, nodes = name_of(path), nodes_of(path)
        for node in nodes:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(name)
        for target, _ in assignments(nodes):
            if target.lstrip("_")[:1].isupper() and not target.isupper():
                found.setdefault(target, []).append(name)
    return {name: where for name, where in sorted(found.items()) if len(where) > 1}


def constants_with_two_values() -> dict[str, list[str]]:
    """Constants whose name has another value elsewhere, each with the modules that define it."""
    found: dict[str, dict[str, list[str]]] = {}
    for path in MODULES:
        for target, value in assignments(nodes_of(path)):
            if target.isupper():
                found.setdefault(target, {}).setdefault(value, []).append(name_of(path))
    return {
        name: [module for modules in values.values() for module in modules]
        for name, values in sorted(found.items())
        if len(values) > 1
    }


def assignments(nodes: Sequence[ast.AST]) -> Iterator[tuple[str, str]]:
    """The names that a module, whose nodes these are, gives values to, with the values as they are written."""
    module = nodes[0]
    assert isinstance(module, ast.Module)
    for node in module.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from ((t.id, ast.unparse(node.value)) for t in targets if isinstance(t, ast.Name))


def folder_of(module: str) -> str:
    """The folder that a module lies in, as a dotted name; a package lies in itself."""
    return module if (ROOT / "/".join(module.split(".")[1:]) / "__init__.py").exists() else module.rpartition(".")[0]


def arrows_between_folders() -> dict[str, set[str]]:
    """Folder to the folders that its modules import; the front door and the top's own modules stand apart."""
    arrows: dict[str, set[str]] = {}
    for path in MODULES:
        here = folder_of(module_of(path))
        arrows.setdefault(here, set()).update({folder_of(m) for m in own_imports(path)} - {here, "gcsplan"})
    arrows.pop("gcsplan", None)
    return arrows


OTHERS = {"_replace", "_exit", "_timestamp", "_getvalue", "_repr_html_"}
"""Names of other libraries that begin with _, and of named tuples."""


def reached_through() -> list[str]:
    """Names that begin with _ and are not the module's own: imported, or looked up in something of another's."""
    return [
        f"{name_of(path)}:{line}: {name}"
        for path in MODULES
        for line, name in private(nodes_of(path), names_of(nodes_of(path)))
    ]


def names_of(nodes: Sequence[ast.AST]) -> set[str]:
    """The functions, classes and attributes that a module defines itself."""
    found = {n.name for n in nodes if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    found |= {n.attr for n in nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    return found | {n.target.id for n in nodes if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")


def private(nodes: Sequence[ast.AST], mine: set[str]) -> Iterator[tuple[int, str]]:
    """Line and name of each private name that a module uses and that is none of ``mine``."""
    for node in nodes:
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            its_own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            if not its_own and node.attr not in mine | OTHERS:
                yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gcsplan"):
            names = [a.name for a in node.names if is_private(a.name)]
            yield from ((node.lineno, f"{node.module}.{n}") for n in names if f"{node.module}.{n}" not in NAMES)


# -- the tests of the house -------------------------------------------------------------------------------------------

TESTS = Path(__file__).parent
LONGEST_NAME = 80  # of a test

PATCHING = {"setattr", "getattr", "delattr", "hasattr"}


@cache
def files_of_tests() -> dict[Path, list[ast.AST]]:
    """All modules of tests, each with its nodes."""
    files = [*TESTS.rglob("*.py"), *(TESTS.parent / "sitl_tests").rglob("*.py")]
    return {path: list(ast.walk(ast.parse(path.read_text(encoding="utf-8")))) for path in sorted(files)}


def place_of_test(module: Path) -> Path:
    """Where one looks for the test of a module first."""
    return TESTS / module.relative_to(ROOT).parent / f"test_{module.stem.strip('_')}.py"


def without_a_test_at_their_place() -> list[str]:
    """Modules that have no test of their name in the folder of tests like theirs, and that no other test there names.

    A package's own file counts with its modules.
    """
    named: dict[Path, set[str]] = {}
    for path, nodes in files_of_tests().items():
        if path.name.startswith("test_"):
            found = {own(name) for name in imported(nodes, ("tests", *path.relative_to(TESTS.parent).parts[1:-1]))}
            named.setdefault(path.parent, set()).update(name for name in found if name is not None)
    return [
        name_of(path)
        for path in MODULES
        if path.name != "__init__.py"
        and not place_of_test(path).exists()
        and module_of(path) not in named.get(place_of_test(path).parent, set())
    ]


def without_a_test_of_their_name() -> list[str]:
    """Modules whose tests stand under another name."""
    return [name_of(path) for path in MODULES if path.name != "__init__.py" and not place_of_test(path).exists()]


def private_in_tests() -> list[str]:
    """Names of gcsplan that begin with _ and that tests import, look up, or patch by a text."""
    found = []
    for path, nodes in files_of_tests().items():
        where, mine = path.relative_to(TESTS.parent).as_posix(), names_of(nodes)
        for node in nodes:
            if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in PATCHING:
                texts = [a.value for a in node.args[:2] if isinstance(a, ast.Constant) and isinstance(a.value, str)]
                parts = [part for text in texts for part in text.split(".")]
                found += [f"{where}:{node.lineno}: {part}" for part in parts if is_private(part)]
        found += [f"{where}:{line}: {name}" for line, name in private(nodes, mine)]
    return found


def without_an_assertion() -> list[str]:
    """Tests that can only fail by an error: they assert nothing, expect no error, and call nobody who does."""
    helpers = {
        node.name
        for nodes in files_of_tests().values()
        for node in nodes
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("test_") and asserts(node, set())
    }
    return [
        f"{path.relative_to(TESTS.parent).as_posix()}:{node.lineno}: {node.name}"
        for path, nodes in files_of_tests().items()
        for node in nodes
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_") and path.name.startswith("test_")
        if not asserts(node, helpers)
    ]


def asserts(function: ast.FunctionDef, helpers: set[str]) -> bool:
    """Whether a function asserts or expects an error itself, or calls one of ``helpers``, which do."""
    for node in ast.walk(function):
        if isinstance(node, ast.Assert):
            return True
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in {"raises", "warns", "fail"} | helpers or called.startswith("assert_"):
                return True
    return False


def long_names() -> list[str]:
    """Tests whose names are too long to read at once."""
    return [
        node.name
        for path, nodes in files_of_tests().items()
        for node in nodes
        if isinstance(node, ast.FunctionDef) and path.name.startswith("test_")
        if node.name.startswith("test_") and len(node.name) > LONGEST_NAME
    ]


TIDY_TESTS: dict[str, Callable[[], list[str]]] = {
    "modules without a test where one looks for it": without_a_test_at_their_place,
    "modules without a test of their name": without_a_test_of_their_name,
    "private names in tests": private_in_tests,
    "tests without an assertion": without_an_assertion,
    f"names of tests with more than {LONGEST_NAME} characters": long_names,
}


@pytest.mark.slow
def test_every_module_has_a_test_where_one_looks_for_it() -> None:
    assert without_a_test_at_their_place() == []


@pytest.mark.slow
def test_tests_use_no_private_names_of_modules() -> None:
    assert private_in_tests() == []


@pytest.mark.slow
def test_every_test_asserts_something() -> None:
    assert without_an_assertion() == []


@pytest.mark.slow
def test_names_of_tests_are_short() -> None:
    assert long_names() == []


@cache
def figures() -> dict[str, list[str] | int]:
    """What is counted of the house, by name: how many, or which."""
    modules = [p for p in MODULES if p.name != "__init__.py"]
    folders = {str(p.parent.relative_to(ROOT)) for p in modules}
    crowded = [f for f in sorted(folders) if sum(p.parent == ROOT / f for p in modules) > MOST_IN_A_FOLDER]
    return {
        "modules": len(modules),
        "statements": sum(isinstance(n, ast.stmt) for path in MODULES for n in nodes_of(path)),
        "type names with two meanings": list(names_with_two_meanings()),
        "constants with two values": list(constants_with_two_values()),
        "folders with more than 15 modules": crowded,
        "folders in a circle": sorted({f for circle in circles(arrows_between_folders()) for f in circle}),
        "names of another module that begin with _": reached_through(),
    }


@pytest.mark.parametrize("what", MOST)
def test_the_house_does_not_grow_untidier(what: str) -> None:
    found = figures()[what]
    count = found if isinstance(found, int) else len(found)
    assert count <= MOST[what], f"{count} {what}, at most {MOST[what]}: {found}"


def arrows_between_packages() -> dict[str, set[str]]:
    """Package to the packages that its modules import."""
    arrows: dict[str, set[str]] = {}
    for path in MODULES:
        if here := package_of(module_of(path)):
            arrows.setdefault(here, set()).update({package_of(m) for m in own_imports(path)} - {here, ""})
    return arrows


def describe(longest: int = 12, *, tests: bool = True) -> str:
    """Packages with their modules, lines and arrows; circles; the longest modules and functions.

    ``tests``: with the figures of the tests, which take seconds to read.
    """
    lines = {name_of(p): len(p.read_text(encoding="utf-8").splitlines()) for p in MODULES}
    said = ["package            modules  lines  imports"]
    for package, below in sorted(arrows_between_packages().items()):
        mine = [name_of(p) for p in MODULES if package_of(module_of(p)) == package]
        said.append(f"{package:18} {len(mine):7} {sum(lines[m] for m in mine):6}  {', '.join(sorted(below)) or '-'}")
    files = {module_of(p): set(own_imports(p)) for p in MODULES if module_of(p) != "gcsplan"}
    said += ["", f"circles of modules: {circles(files) or 'none'}"]
    said += [f"circles of packages: {circles(arrows_between_packages()) or 'none'}", "", "longest modules"]
    said += [f"{n:6}  {name}" for name, n in sorted(lines.items(), key=lambda item: -item[1])[:longest]]
    every = [(n, f"{name_of(p)}: {name}") for p in MODULES for name, n in functions(p)]
    counted = {what: found if isinstance(found, int) else len(found) for what, found in figures().items()}
    counted |= {what: len(found()) for what, found in TIDY_TESTS.items()} if tests else {}
    said += ["", "in figures", *(f"{count:6}  {what}" for what, count in counted.items())]
    said += ["", "longest functions", *(f"{n:6}  {name}" for n, name in sorted(every, reverse=True)[:longest])]
    return "\n".join(said)


def test_the_house_is_described() -> None:
    text = describe(tests=False)
    assert all(f"\n{package} " in text for package in MAY_IMPORT)
    assert "circles of modules: none" in text
    assert "circles of packages: none" in text


# -- the reader of imports itself ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import gcsplan.mavlink.link.link", {"gcsplan.mavlink.link.link"}),
        ("from gcsplan.mavlink import link", {"gcsplan.mavlink.link"}),
        ("from gcsplan import cli as c", {"gcsplan.cli"}),
        ("from .mission import Mission", {"gcsplan.mavlink.mission.Mission"}),
        ("from . import link", {"gcsplan.mavlink.link"}),
        ("from ..world.geodesy.frame import Frame", {"gcsplan.world.geodesy.frame.Frame"}),
        ("def f():\n    import socket", {"socket"}),
        ("if TYPE_CHECKING:\n    import a\nelse:\n    import b\nimport c", {"a", "b", "c"}),
    ],
)
def test_imports_are_seen_however_they_are_written(source: str, found: set[str]) -> None:
    assert set(imported(ast.walk(ast.parse(source)), ("gcsplan", "mavlink"))) == found


def test_own_modules_are_told_from_names_and_from_others() -> None:
    assert own("gcsplan.mavlink.mission.mission.Mission") == "gcsplan.mavlink.mission.mission"
    assert own("gcsplan.errors.InputError") == "gcsplan.errors"
    assert own("gcsplan.__version__") is None
    assert own("numpy.typing") is None
    assert package_of("gcsplan.mavlink.link.url") == "mavlink.link"
    assert package_of("gcsplan.check.motion.return_rules") == "check"


def test_degrees_are_seen_in_every_kind_of_name() -> None:
    for source in ("lat_deg = 1", "x.home_lat_e7", "def f(lon_deg): pass", "f(lat_deg=1)", "def lon_e7(): pass"):
        assert any(word in name for name in identifiers(ast.walk(ast.parse(source))) for word in DEGREES), source


if __name__ == "__main__":
    print(describe())
