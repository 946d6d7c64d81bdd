"""The outcomes of a transfer: accepted, refused, unknown, or stopped by us; and the vehicle's codes in words."""

from __future__ import annotations

from dataclasses import dataclass

ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE, INVALID = 0, 1, 2, 3, 4, 5
INVALID_SEQUENCE, DENIED, CANCELLED = 13, 14, 15
OUR_REFUSAL = -1
"""Not a MAV_MISSION_RESULT: we refuse what the vehicle announces."""

_CODES: dict[int, tuple[str, str]] = {
    ACCEPTED: ("accepted", ""),
    ERROR: ("an error that it does not explain", "look at its messages; a busy vehicle says this too: try again"),
    UNSUPPORTED_FRAME: ("the altitude frame of the item is not supported", "plan with another altitude_frame"),
    UNSUPPORTED: ("the command is not supported", "leave the command out or update the firmware"),
    NO_SPACE: (
        "no space: the list is longer than it can keep, or it is still booting",
        "wait until it reports standby and try again; else shorten the list",
    ),
    INVALID: ("a value is invalid", "look at the item"),
    6: ("param1 is invalid", "look at param1 of the item"),
    7: ("param2 is invalid", "look at param2 of the item"),
    8: ("param3 is invalid", "look at param3 of the item"),
    9: ("param4 is invalid (NaN in place of a number?)", "look at param4 of the item"),
    10: ("the latitude is invalid", "look at the item's place"),
    11: ("the longitude is invalid", "look at the item's place"),
    12: ("the altitude is invalid", "look at the item's altitude"),
    INVALID_SEQUENCE: ("an item came out of sequence", "try again"),
    DENIED: (
        "denied: another ground station is uploading to it, or has control",
        "end the other upload, or wait ten seconds, and try again",
    ),
    CANCELLED: ("it gave up the transfer", "the link is bad: come nearer or try again"),
}


def code_words(code: int) -> str:
    """Return the meaning of a MAV_MISSION_RESULT in words, without the remedy."""
    return _CODES.get(code, (f"code {code}, which MAVLink does not define", ""))[0]


def code_cure(code: int) -> str:
    """Return what the user can do about a MAV_MISSION_RESULT; empty for ACCEPTED."""
    return _CODES.get(code, ("", "update this program or the firmware"))[1]


@dataclass(frozen=True, slots=True)
class Accepted:
    """The vehicle accepted; ``opaque_id`` is its id of the list that it holds now, 0 if it sends none."""

    opaque_id: int = 0

    def __str__(self) -> str:
        return "accepted"


@dataclass(frozen=True, slots=True)
class Refused:
    """The vehicle refused: MAV_MISSION_RESULT ``code``, and ``seq`` of the item at fault where it is known.

    ``what`` replaces the standard words for the code. ``code`` is `OUR_REFUSAL` where we refused.
    """

    code: int
    seq: int | None = None
    what: str = ""

    @property
    def reason(self) -> str:
        """The code in words, with the item."""
        words = self.what or code_words(self.code)
        return words if self.seq is None else f"item {self.seq}: {words}"

    def __str__(self) -> str:
        if self.code == OUR_REFUSAL:
            return f"refused: {self.reason}"
        cure = code_cure(self.code)
        return f"refused: {self.reason} (MAV_MISSION_RESULT {self.code})" + (f"; {cure}" if cure else "")


@dataclass(frozen=True, slots=True)
class Unknown:
    """The list on the vehicle is unknown until it is read back. ``silent``: the vehicle did not answer at all."""

    why: str
    silent: bool = False

    def __str__(self) -> str:
        return f"unknown: {self.why}"


@dataclass(frozen=True, slots=True)
class Changed:
    """We stopped because the vehicle has changed since it was checked. ``reason`` is one word: armed, moved, …"""

    reason: str
    why: str

    def __str__(self) -> str:
        return f"stopped: {self.why}"


Outcome = Accepted | Refused | Unknown | Changed
