"""The table of commands against MAVLink's own definitions."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

import gcsplan
from gcsplan.mavlink.mission import commands

SHORT = {
    "RTL": "NAV_RETURN_TO_LAUNCH",
    "FENCE_RETURN_POINT": "NAV_FENCE_RETURN_POINT",
    "POLYGON_IN": "NAV_FENCE_POLYGON_VERTEX_INCLUSION",
    "POLYGON_OUT": "NAV_FENCE_POLYGON_VERTEX_EXCLUSION",
    "CIRCLE_IN": "NAV_FENCE_CIRCLE_INCLUSION",
    "CIRCLE_OUT": "NAV_FENCE_CIRCLE_EXCLUSION",
}
TABLE = {name: number for name, number in vars(commands).items() if isinstance(number, int)}
PACKAGE = Path(gcsplan.__file__).parent


@pytest.mark.parametrize("name", sorted(TABLE))
def test_a_number_is_that_of_its_name(name: str) -> None:
    full = SHORT.get(name, name)
    numbers = {getattr(dialect, f"MAV_CMD_{prefix}{full}", None) for prefix in ("", "NAV_")} - {None}
    assert numbers == {TABLE[name]}


def test_each_number_has_one_name() -> None:
    assert len(set(TABLE.values())) == len(TABLE)
    assert set(commands.COMMAND_WORDS) <= set(TABLE.values())


def test_the_numbers_up_to_the_last_nav_command_are_nav_commands() -> None:
    entries = {n: e.name for n, e in dialect.enums["MAV_CMD"].items() if n in TABLE.values()}
    early = {n for n, name in entries.items() if name.startswith("MAV_CMD_NAV_") and n < commands.LAST}
    assert {n for n in entries if commands.is_nav(n)} == early


def test_a_command_without_words_is_called_by_its_number() -> None:
    assert commands.command_name(commands.TAKEOFF) == "take-off"
    assert commands.command_name(65000) == "command 65000"


def typed_by_hand(source: str) -> list[int]:
    """Lines on which an item's command is compared with a number, or a number is the command of a `MissionItem`."""
    found: list[int] = []
    if "command" not in source and "MissionItem" not in source:
        return found
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare) and getattr(node.left, "attr", getattr(node.left, "id", "")) == "command":
            beside = [c for right in node.comparators for c in ast.walk(right)]
        elif isinstance(node, ast.Call) and getattr(node.func, "id", "") == "MissionItem":
            beside = [*node.args[:1], *(k.value for k in node.keywords if k.arg == "command")]
        else:
            continue
        if any(isinstance(c, ast.Constant) and isinstance(c.value, int) and c.value > 1 for c in beside):
            found.append(node.lineno)
    return found


@pytest.mark.nightly
def test_no_command_is_typed_as_a_number() -> None:
    assert typed_by_hand("x = item.command in (5001, RALLY)\ny = MissionItem(16, 3)\nz = item.command == WAYPOINT") == [
        1,
        2,
    ]
    found = {str(p.relative_to(PACKAGE)): typed_by_hand(p.read_text(encoding="utf-8")) for p in PACKAGE.rglob("*.py")}
    assert {name: lines for name, lines in found.items() if lines} == {}
