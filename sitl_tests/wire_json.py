"""Mission items as JSON between the tests and the MAVSDK processes, floats as hexadecimal so that no bit is lost.

Scripts that run on their own import this module, so it uses nothing of gcsplan.
"""

from __future__ import annotations

from typing import Any

Row = list[Any]
"""seq, frame, command, current, autocontinue, param1 … param4, x, y, z, mission_type."""

_FLOATS = (5, 6, 7, 8, 11)


def row_of(item: Any) -> Row:
    """A row from an object with MISSION_ITEM_INT's fields (MAVSDK's MissionItem)."""
    params = (item.param1, item.param2, item.param3, item.param4)
    return [
        item.seq,
        item.frame,
        item.command,
        item.current,
        item.autocontinue,
        *(float(p).hex() for p in params),
        item.x,
        item.y,
        float(item.z).hex(),
        item.mission_type,
    ]


def numbers_of(row: Row) -> tuple[Any, ...]:
    """A row's numbers in the order that MAVSDK's MissionItem takes them."""
    return tuple(float.fromhex(value) if i in _FLOATS else value for i, value in enumerate(row))
