"""The parts of a flight: its straight stretches, and what is unknown about them; and distances between their places.

Places are in degrees, and their distances need no projected plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

from gcsplan.notes.note import Note

StretchKind = Literal["takeoff", "cruise", "land", "loiter", "rtl"]
Place = tuple[float, float, float]
"""Latitude, longitude in degrees, altitude AMSL in metres. Longitudes of a flight lie within half a turn of home's,
also beyond ±180°; figures and findings have them by `on_globe`."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """One straight stretch, flown on behalf of wire item ``seq``.

    ``column``: vertical take-off or landing. ``terrain``: altitude above ground is interpolated between the ends.
    ``band_m`` widens the altitude error (the altitude is known only within a band), ``reach_m`` the track error (a
    loiter's circle). ``on_path``: counts for the path's length, from the top of the take-off to the approach.
    ``rates_m_s``: of climb and descent; None: the vehicle's own. ``times``: how often it is flown, because a jump leads
    back. ``jumped_from``: the jump that led to it, for the first stretch after a jump. ``steep``: for a chord of a
    curve, the curve's steepest rise over run, up and down (negative); None: the stretch is flown straight. ``turns``:
    its hold is of whole circles, not of seconds. ``until_s``: its hold ends at a time of day, so many seconds after
    the vehicle has left the ground; how long it holds is known when it is known how long it flies.
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
    turns: bool = False
    until_s: float | None = None


@dataclass(frozen=True, slots=True)
class Unreached:
    """Items ``first`` to ``last``, which are never flown because ``seq`` holds or jumps back without end."""

    seq: int
    first: int
    last: int
    loop: bool = False

    @property
    def note(self) -> Note:
        """The note on the items that are never reached."""
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


def near_lon(lon_deg: float, by_deg: float) -> float:
    """The same longitude within half a turn of another one: so a line between two places never goes round the globe.

    ``by_deg`` 0: as it is written, within ±180°.
    """
    return lon_deg + 360.0 * round((by_deg - lon_deg) / 360.0)


def on_globe(place: Place) -> Place:
    """A place of a flight, with its longitude as it is written."""
    return place[0], near_lon(place[1], 0.0), place[2]


SAME_PLACE_M = 0.02
"""Places nearer to each other than this count as one, m."""

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84


def degree_m(lat_deg: float) -> tuple[float, float]:
    """Metres per degree of longitude and per degree of latitude, at a latitude on the WGS84 ellipsoid."""
    lat = math.radians(lat_deg)
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    east, north = EQUATOR_M / math.sqrt(w) * math.cos(lat), EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5
    return math.radians(east), math.radians(north)


def place_on(a: Place, b: Place, part: float) -> Place:
    """The place at a ``part`` of the straight way from ``a`` to ``b``; up to 0 it is ``a``, from 1 it is ``b``."""
    if part <= 0.0 or part >= 1.0:
        return a if part <= 0.0 else b
    lon = a[1] + part * (near_lon(b[1], a[1]) - a[1])
    return a[0] + part * (b[0] - a[0]), lon, a[2] + part * (b[2] - a[2])


@lru_cache(maxsize=1024)
def offset_m(a: Place, b: Place) -> tuple[float, float]:
    """Metres east and north from ``a`` to ``b``, by the ellipsoid's radii at mid latitude: 1e-6 off over 100 km."""
    east, north = degree_m(0.5 * (a[0] + b[0]))
    return east * ((b[1] - a[1] + 180.0) % 360.0 - 180.0), north * (b[0] - a[0])


def flat_m(a: Place, b: Place) -> float:
    """Horizontal distance in metres, by `offset_m`."""
    return math.hypot(*offset_m(a, b))
