"""`Finding`: one limit that a mission breaks, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gcsplan.notes.note import IN_FILES, Note, Wording


@dataclass(frozen=True, slots=True)
class Finding:
    """One limit broken by wire item ``seq``: what is said of it, the place, and by how much.

    ``zone`` is the zone's name or empty.
    """

    seq: int
    kind: str
    note: Note
    lat_deg: float
    lon_deg: float
    amsl_m: float
    value: float
    limit: float
    by: float
    unit: str
    zone: str = ""

    @property
    def message(self) -> str:
        """What is said of it, in SI."""
        return str(self.note)

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """The finding for programs: its fields with the message, and the note's code and data."""
        fields = {name: getattr(self, name) for name in self.__slots__ if name != "note"}
        said = self.note.as_dict()
        begins = {"seq": fields.pop("seq"), "kind": fields.pop("kind"), "message": self.note.text(wording)}
        return begins | fields | {"code": said["code"], "data": said["data"]}
