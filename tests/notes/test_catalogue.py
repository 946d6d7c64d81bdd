"""The catalogue of sentences against the code: every note has its sentence, every sentence its note."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import gcsplan
from gcsplan.notes.catalogue import TEXTS
from gcsplan.notes.note import KINDS, fields_of, parts_of

ROOT = Path(gcsplan.__file__).parent
FORMS = {*KINDS, "reach", "seconds", "joules", "lines", "g"}


def made() -> Iterator[tuple[str, ast.Call]]:
    """Every `Note(…)` of the code, with its place."""
    for path in sorted(ROOT.rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if "Note(" not in source:
            continue
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Note":
                yield f"{path.relative_to(ROOT)}:{node.lineno}", node


MADE = [(where, node) for where, node in made() if not where.startswith("notes/note.py")]


def codes(node: ast.expr) -> list[str]:
    """The codes that the first argument of a note may be: a literal, or one of two."""
    if isinstance(node, ast.IfExp):
        return codes(node.body) + codes(node.orelse)
    assert isinstance(node, ast.Constant), f"the code of a note is written out where it is made: {ast.unparse(node)}"
    return [str(node.value)]


def test_every_note_has_a_sentence_with_its_data_and_no_other() -> None:
    wrong = []
    for where, node in MADE:
        given = {keyword.arg for keyword in node.keywords}
        for code in codes(node.args[0]):
            if code not in TEXTS:
                wrong.append(f"{where}: the catalogue has no {code!r}")
            elif fields_of(TEXTS[code]) - given:
                wrong.append(f"{where}: {code} lacks {fields_of(TEXTS[code]) - given}")
            elif any(name == "item" for _, name, _ in parts_of(TEXTS[code])) and len(node.args) < 2:
                wrong.append(f"{where}: {code} names an item, and none is given")
    assert wrong == []


def test_every_sentence_is_said_somewhere() -> None:
    said = {code for _, node in MADE for code in codes(node.args[0])}
    assert sorted(set(TEXTS) - said) == []


def test_no_code_has_two_sentences_and_all_are_plain_words() -> None:
    rooms = [importlib.import_module(f"gcsplan.notes.{path.stem}") for path in (ROOT / "notes").glob("*_texts.py")]
    every = [code for room in rooms for code in room.TEXTS]
    assert sorted(every) == sorted(TEXTS), "a room of the catalogue is missing there, or a code stands in two"
    assert [code for code in every if not code.isidentifier() or code != code.lower()] == []


@pytest.mark.parametrize("code", sorted(TEXTS))
def test_a_sentence_uses_known_forms(code: str) -> None:
    for _, field, spec in parts_of(TEXTS[code]):
        if field and field not in ("key", "unit", "item") and spec and "|" not in spec:
            name = spec.split()[0].partition(".")[0]
            assert name in FORMS or not name.isalpha(), f"{{{field}:{spec}}} is no form of a number"
