"""The modules that a unit of kernels must list: each that marks a function of it, and all whose constants they take."""

from __future__ import annotations

import ast
from pathlib import Path
from types import ModuleType

import gcsplan
from gcsplan.native.kernel_unit import KernelUnit

ROOT = Path(gcsplan.__file__).parent
HARMLESS = {"gcsplan.arrays", "gcsplan.world.geometry.limits"}
"""Types alone: no machine code depends on them."""


def imported_by(path: Path) -> set[str]:
    """The modules of gcsplan that a file imports names from."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    named = {n.module or "" for n in nodes if isinstance(n, ast.ImportFrom)}
    return {name for name in named if name.startswith("gcsplan.")}


def faults(compiled: ModuleType, unit: KernelUnit) -> list[str]:
    """The modules that the list of ``unit``, made in ``compiled``, lacks, or has too much."""
    listed = {path.resolve() for path in unit.sources}
    modules = {".".join(("gcsplan", *p.resolve().relative_to(ROOT).with_suffix("").parts)) for p in listed}
    texts = {path: path.read_text(encoding="utf-8") for path in ROOT.rglob("*.py")}
    named = [path for path, text in texts.items() if compiled.__name__ in text]  # the others need no parser
    marked = {path for path in named if compiled.__name__ in imported_by(path)}
    markers = {path for path in marked if any(word in texts[path] for word in ("@kernel", "@device"))}
    found = [f"{path.name} marks kernels and is not listed" for path in sorted(markers - listed)]
    for path in sorted(listed):
        others = imported_by(path) - modules - HARMLESS - {compiled.__name__}
        found += [f"{path.name} takes names from {other}, which is not listed" for other in sorted(others)]
    return found
