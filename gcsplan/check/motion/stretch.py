"""The parts of a flight: its straight stretches, and what is unknown about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from gcsplan.notes.note import Note

StretchKind = Literal["takeoff", "cruise", "land", "loiter", "rtl"]
Place = tuple[float, float, float]
"""Latitude, longitude in degrees, altitude AMSL in metres."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """One straight stretch, flown on behalf of wire item ``seq``.

    ``column``: vertical take-off or landing. ``terrain``: altitude above ground is interpolated between the ends.
    ``band_m`` widens the altitude error (the altitude is known only within a band), ``reach_m`` the track error (a
    loiter's circle). ``on_path``: counts for the path's length, from the top of the take-off to the approach.
    ``rates_m_s``: of climb and descent; None: the vehicle's own. ``times``: how often it is flown, because a jump leads
    back. ``jumped_from``: the jump that led to it, for the first stretch after a jump. ``steep``: for a chord of a
    curve, the curve's steepest rise over run, up and down (negative); None: the stretch is flown straight.
    """

    seq: int
    kind: StretchKind
    start: Place
    end: Place
    speed_m_s: float
    column: bool = False
    terrain: bool = False
    band_m: float = 0.0
    reach_m: float = 0.0
    hold_s: float = 0.0
    on_path: bool = False
    rates_m_s: tuple[float, float] | None = None
    times: int = 1
    jumped_from: int | None = None
    steep: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Unreached:
    """Items ``first`` to ``last``, which are never flown because ``seq`` holds or jumps back without end."""

    seq: int
    first: int
    last: int
    loop: bool = False

    @property
    def note(self) -> Note:
        """What is said of it."""
        if self.first == self.last:
            return Note("item_unreached", self.first, by=self.seq, jumps=self.loop)
        return Note("items_unreached", self.first, last=self.last, by=self.seq, jumps=self.loop)


@dataclass(slots=True)
class Flight:
    """All stretches in order, what could not be followed, and what is assumed.

    ``instead``: stretches that another version flies in place of some of ``stretches``; they must be legal too.
    ``loop_seq``: the jump that leads back without end, None if there is none. ``apart_from``: the index of the
    DO_LAND_START or DO_RETURN_PATH_START that begins what only a return leads to, None if there is none; ``apart``:
    those flights, each from the first place after its start.
    """

    stretches: list[Stretch] = field(default_factory=list)
    instead: list[Stretch] = field(default_factory=list)
    not_judged: list[Note] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    unreached: list[Unreached] = field(default_factory=list)
    loop_seq: int | None = None
    apart_from: int | None = None
    apart: list[Flight] = field(default_factory=list)

    @property
    def others(self) -> list[Stretch]:
        """Everything that must be legal too and is not flown in the order of the items: `instead` and `apart`."""
        return [*self.instead, *(s for part in self.apart for s in (*part.stretches, *part.others))]

    def adopt(self, part: Flight) -> None:
        """Take over what is unknown and assumed about a flight ``part`` of this one."""
        for mine, more in ((self.not_judged, part.not_judged), (self.notes, part.notes)):
            mine += [words for words in more if words not in mine]
        self.unreached += [one for one in part.unreached if one not in self.unreached]
