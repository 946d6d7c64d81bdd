"""Commands that a flight passes over, because they move nothing."""

from __future__ import annotations

from gcsplan.mavlink import mission as m

PARACHUTE, RELEASE = 208, 2.0
LOITER_TO_ALT = 31

UNMOVED = frozenset(
    {
        m.CONDITION_DELAY, 114, 115, m.DO_CHANGE_SPEED, 181, 182, 183, 184, 188, 189,
        195, 196, 197, 200, 201, 202, 203, 204, 205, 206, 207, 211, 214, 215, 216, 217,
        530, 531, 532, 534, 600, 1000, 1001, 2000, 2001, 2003, 2500, 2501,
    }
)  # fmt: skip
"""Commands that move nothing but cameras, servos, speeds and clocks (CONDITION_* delay only the next DO_ command).

Not among them, though they go nowhere themselves: DO_SET_PARAMETER 180, DO_AUTOTUNE_ENABLE 212, DO_AUX_FUNCTION 218
(which may change the mode), DO_GUIDED_LIMITS 222, DO_ENGINE_CONTROL 223, and a parachute that is released.
"""


def moves_nothing(command: int, first: float) -> bool:
    """True for a command (``first`` is its param1) after which the flight goes on as if it were not there."""
    return command in UNMOVED or (command == PARACHUTE and first != RELEASE)
