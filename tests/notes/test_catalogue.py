"""The catalogue of sentences against the code: every note has its sentence, every sentence its note."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import gcsplan
from gcsplan.notes.note import NUMBER_KINDS, TEXTS, fields_of, parts_of

ROOT = Path(gcsplan.__file__).parent

pytestmark = pytest.mark.xdist_group("catalogue")  # one process reads the modules, not three

FORMS = {*NUMBER_KINDS, "angle", "key", "reach", "seconds", "joules", "lines", "rows", "g"}


def made() -> Iterator[tuple[str, ast.Call, dict[str, list[str]]]]:
    """Every `Note(…)` of the code, with its place, and the tables of codes of its module."""
    for path in sorted(ROOT.rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if "Note(" not in source:
            continue
        tree = ast.parse(source)
        tables = dict(tables_in(tree))
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Note":
                yield f"{path.relative_to(ROOT)}:{node.lineno}", node, tables


def tables_in(tree: ast.Module) -> Iterator[tuple[str, list[str]]]:
    """The dicts of a module whose values are all strings, by name."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict) and isinstance(node.targets[0], ast.Name):
            values = [v.value for v in node.value.values if isinstance(v, ast.Constant) and isinstance(v.value, str)]
            if len(values) == len(node.value.values):
                yield node.targets[0].id, values


def codes_of(node: ast.expr, tables: dict[str, list[str]]) -> list[str]:
    """The codes that the first argument of a note may be: a literal, one of two, or one of a table of its module."""
    if isinstance(node, ast.IfExp):
        return codes_of(node.body, tables) + codes_of(node.orelse, tables)
    if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id in tables:
        return tables[node.value.id]
    assert isinstance(node, ast.Constant), f"the code of a note is written out where it is made: {ast.unparse(node)}"
    return [str(node.value)]


@cache
def coded() -> list[tuple[str, ast.Call, list[str]]]:
    """Every `Note(…)` of the code outside the catalogue, with its place and its codes."""
    return [
        (where, node, codes_of(node.args[0], tables))
        for where, node, tables in made()
        if not where.startswith("notes/note.py")
    ]


def test_every_note_has_a_sentence_with_its_data_and_no_other() -> None:
    wrong = []
    for where, node, codes in coded():
        given = {keyword.arg for keyword in node.keywords}
        for code in codes:
            if code not in TEXTS:
                wrong.append(f"{where}: the catalogue has no {code!r}")
            elif fields_of(TEXTS[code]) - given:
                wrong.append(f"{where}: {code} lacks {fields_of(TEXTS[code]) - given}")
            elif any(name == "item" for _, name, _ in parts_of(TEXTS[code])) and len(node.args) < 2:
                wrong.append(f"{where}: {code} names an item, and none is given")
    assert wrong == []


def test_every_sentence_is_said_somewhere() -> None:
    said = {code for *_, codes in coded() for code in codes}
    assert sorted(set(TEXTS) - said) == []


def test_no_code_has_two_sentences_and_all_are_plain_words() -> None:
    rooms = [path.stem for path in (ROOT / "notes").glob("*_texts.py")]
    every = [code for room in rooms for code in getattr(importlib.import_module(f"gcsplan.notes.{room}"), room.upper())]
    assert sorted(every) == sorted(TEXTS), "a room of the catalogue is missing there, or a code stands in two"
    assert [code for code in every if not code.isidentifier() or code != code.lower()] == []


def test_sentences_use_known_forms() -> None:
    unknown = []
    for code, text in TEXTS.items():
        for _, field, spec in parts_of(text):
            if field and field not in ("key", "unit", "item") and spec and "|" not in spec:
                name = spec.split()[0].partition(".")[0]
                if name not in FORMS and name.isalpha():
                    unknown.append(f"{code}: {{{field}:{spec}}} is no form of a number")
    assert unknown == []
