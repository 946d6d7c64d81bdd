"""The keys of a mission file against the code that uses them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import gcsplan
from gcsplan.mission_file.values import schema
from gcsplan.mission_file.values.keys import Keys

ROOT = Path(gcsplan.__file__).parent


def sections(kind: type[Keys] = Keys) -> Iterator[type[Keys]]:
    """Every section of the schema."""
    for one in kind.__subclasses__():
        yield one
        yield from sections(one)


@pytest.fixture(scope="module")
def used() -> set[str]:
    """The attributes, and the names written as text, in the code that reads, plans and checks missions."""
    others = [path for path in ROOT.rglob("*.py") if path != Path(schema.__file__)]
    text = "\n".join(path.read_text(encoding="utf-8") for path in others if path.name != "new_file.py")
    return set(re.findall(r"\.(\w+)", text)) | set(re.findall(r"\"(\w+)\"", text))


@pytest.mark.parametrize("section", list(sections()), ids=lambda one: one.__name__)
def test_every_key_is_used_and_not_only_read(section: type[Keys], used: set[str]) -> None:
    assert sorted(set(section.__annotations__) - used) == []
