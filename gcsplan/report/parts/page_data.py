"""The data of a report: one `Page` with a `Subject` for each vehicle; made here from checked files.

All vehicles are on the map, in the replay and in the tables of key figures. Of a large fleet only some (`in_full`) have
marks on the map, profiles and tables of their own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

from gcsplan.check.difference import PlanDifference
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.returns.words import verdict_words
from gcsplan.check.verdict import Verdict
from gcsplan.fleet.arrival import Slot
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import Separation
from gcsplan.mavlink.mission.parameter_list import Setting
from gcsplan.notes.note import Note, Wording
from gcsplan.report.parts.html import esc
from gcsplan.report.parts.track_samples import MOST_SAMPLES
from gcsplan.units import METRIC, Units, span
from gcsplan.vehicle import Vehicle
from gcsplan.world.geodesy.daylight import Daylight
from gcsplan.world.world import World


@dataclass(frozen=True, eq=False)
class Certificate:
    """The quality of the path: ``bound`` and ``cost`` in ``unit`` (m, J or s), and why the search stopped."""

    objective: str
    unit: str
    cost: float
    bound: float | None
    gap_percent: float | None
    stopped_by: str


@dataclass(frozen=True, eq=False)
class Subject:
    """One vehicle, or one checked file: its verdict, and other data on it.

    ``slot`` is its part of the time table, None for a checked file, and so is ``motion``, the whole flight over time.
    ``flown`` is its flight in a rehearsal, from that track alone. ``leaves``: it is gone where its motion ends.
    ``home`` is the way home from every point, if it was judged. ``upload`` holds the keys of ``upload.json``, None if
    nothing was sent, ``warnings`` the upload's. ``settings``: the parameters that its mission was judged with.
    ``typed``: the options that the reader types, by their keys in a mission file; empty if he has one.
    """

    name: str
    verdict: Verdict
    vehicle: Vehicle
    certificate: Certificate | None = None
    notes: tuple[Note, ...] = ()
    motion: TimedPath | None = None
    slot: Slot | None = None
    home: WayHome | None = None
    upload: Mapping[str, object] | None = None
    warnings: tuple[Note, ...] = ()
    flown: TimedPath | None = None
    leaves: bool = False
    settings: tuple[Setting, ...] = ()
    typed: Mapping[str, str] = field(default_factory=dict)

    def wording(self, units: Units | None = None) -> Wording:
        """The wording for the reader, in ``units``, or in SI."""
        return Wording(units, self.typed)

    @property
    def depart_s(self) -> float:
        """Seconds from the start until it leaves the ground."""
        return self.slot.depart_s if self.slot is not None else 0.0

    @property
    def arrive_s(self) -> float:
        """Seconds to the goal: from the start of the time table, or from the mission's beginning without one."""
        return self.slot.arrive_s if self.slot is not None else self.verdict.arrive_s

    @property
    def window_s(self) -> tuple[float, float] | None:
        """The earliest and latest arrival, counted as `arrive_s`; None in still air with a departure on time."""
        return self.verdict.arrive_window_s(self.slot)

    def window_words(self, decimals: int) -> str:
        """The window behind the arrival, in brackets; empty in still air."""
        return "" if self.window_s is None else f" (within {span(self.window_s, decimals)})"

    @property
    def homeless(self) -> bool:
        """Whether the return is not safe, or not judged."""
        return self.home is None or self.home.safe is not True

    @property
    def words(self) -> Note:
        """The verdict in a sentence."""
        return verdict_words(self.verdict.safe, self.home)


@dataclass(frozen=True, slots=True)
class Compared:
    """One figure in SI, planned and flown; None if there is none, infinite: never.

    ``subject``: the vehicle's number on the page, None for the fleet. Heights and distances are least values.
    """

    subject: int | None
    vehicle: str
    what: str
    planned: float | None
    flown: float | None
    kind: Literal["time", "percent", "height", "distance"]


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """The result of a rehearsal. ``how``: who flew, how often and in which weather, in a sentence."""

    safe: bool | None
    how: str
    compared: tuple[Compared, ...]
    violations: tuple[Note, ...] = ()
    not_flown: tuple[Note, ...] = ()


@dataclass(frozen=True, eq=False)
class Page:
    """Everything that one report shows. ``facts`` are names and values of what was requested, in the order shown.

    ``left_out`` are names of vehicles without a mission, and why. ``units`` are those of all numbers on the page.
    ``daylight`` is that of the first start, None if it is not known when the mission is flown.
    """

    title: str
    world: World
    subjects: tuple[Subject, ...]
    inputs: Mapping[str, object]
    facts: tuple[tuple[str, str], ...] = ()
    notes: tuple[Note, ...] = ()
    separation: Separation | None = None
    order: tuple[str, ...] = ()
    units: Units = METRIC
    rehearsed: Rehearsed | None = None
    left_out: tuple[tuple[str, str], ...] = ()
    differences: tuple[PlanDifference, ...] = ()
    daylight: Daylight | None = None

    @property
    def wind(self) -> Note:
        """The note on the winds that the mission declares, or that the air is still."""
        return next((note for note in self.notes if note.code == "wind_declared"), Note("still_air"))

    @property
    def time_decimals(self) -> int:
        """Decimals of the arrivals: tenths in a fleet, whose order may hang on them."""
        return 1 if sum(s.slot is not None for s in self.subjects) > 1 else 0

    @property
    def homeless(self) -> bool:
        """Whether the return of any subject is not safe, or not judged."""
        return any(s.homeless for s in self.subjects)

    @property
    def safe(self) -> bool | None:
        """False if any subject breaks a limit, None if something could not be judged (or there is no subject)."""
        verdicts = [s.verdict.safe for s in self.subjects]
        return False if False in verdicts else None if None in verdicts or not verdicts else True


class CheckedFile(Protocol):
    """The result of a check of one file (`gcsplan.app.check.files.Checked`)."""

    @property
    def file(self) -> object: ...
    @property
    def vehicle(self) -> Vehicle: ...
    @property
    def verdict(self) -> Verdict: ...
    @property
    def notes(self) -> tuple[Note, ...]: ...
    @property
    def typed(self) -> Mapping[str, str]: ...


def page_of_check(
    title: str,
    world: World,
    checked: Sequence[CheckedFile],
    *,
    inputs: Mapping[str, object],
    notes: Sequence[Note] = (),
    homes: Sequence[WayHome | None] = (),
    units: Units = METRIC,
) -> Page:
    """The page of files that were checked in ``world``; subjects are named by file if one vehicle has several files.

    ``inputs`` are those of a mission file, or a surface's ``info``; if ``bare_dem`` is true, the page says so.
    ``homes`` are the ways home of ``checked``, in the same order, None if not judged.
    """
    names = [c.vehicle.name for c in checked]
    subjects = tuple(
        Subject(
            c.vehicle.name if names.count(c.vehicle.name) == 1 else str(c.file),
            c.verdict, c.vehicle, None, tuple(dict.fromkeys((*c.notes, *c.verdict.notes))),
            home=homes[i] if i < len(homes) else None, typed=c.typed,
        )
        for i, c in enumerate(checked)
    )  # fmt: skip
    facts = tuple((f"file of {s.name}", str(c.file)) for s, c in zip(subjects, checked, strict=True))
    return Page(title, world, subjects, dict(inputs), facts, tuple(dict.fromkeys(notes)), units=units)


MOST_WHOLE = 100
"""Most vehicles of a page that has everything of all of them."""

MOST_FULL = 24
"""Vehicles of a larger fleet that have profiles and tables of their own."""

LIGHT_SAMPLES = 12
"""Samples along the track of each other vehicle; a few more if it has many legs."""


def in_full(page: Page) -> frozenset[int]:
    """The numbers of the vehicles that have profiles and tables of their own.

    Above `MOST_WHOLE` vehicles, they are the ones with a finding, something not judged or no safe return, then the two
    that come nearest to each other, then vehicles with the least room above the ground.
    """
    if len(page.subjects) <= MOST_WHOLE:
        return frozenset(range(len(page.subjects)))
    least = page.separation.least if page.separation is not None else None
    near = () if least is None else least.vehicles

    def rank(number: int) -> tuple[bool, bool, bool, bool, float, int]:
        s = page.subjects[number]
        good = s.verdict.safe
        return good is not False, good is True, not s.homeless, s.name not in near, _room_m(s), number

    return frozenset(sorted(range(len(page.subjects)), key=rank)[:MOST_FULL])


def _room_m(subject: Subject) -> float:
    """Metres by which a vehicle's lowest point is above its min AGL."""
    low = subject.verdict.lowest
    return math.inf if low is None else low.min_agl_m - subject.vehicle.limits.min_agl_m


def samples_of(page: Page, full: frozenset[int]) -> list[int]:
    """How many samples each vehicle's line has."""
    many = max(150, min(1200, MOST_SAMPLES // max(len(full), 1)))
    return [many if i in full else LIGHT_SAMPLES for i in range(len(page.subjects))]


def only_some(page: Page, full: frozenset[int]) -> str:
    """A note in HTML that says of whom there is no more; empty if there is everything of all."""
    rest = len(page.subjects) - len(full)
    if not rest:
        return ""
    command = "gcsplan check MISSION.yaml VEHICLE.plan --report FILE.html"
    return (
        f'<p class="note">{len(full)} of {len(page.subjects)} vehicles are shown: first those with problems, then '
        "the two that come nearest to each other, then vehicles with the least height over ground. The others are on "
        f"the map and in the tables of all vehicles; <code>{command}</code> shows one of the other {rest}.</p>"
    )


def left_out_html(page: Page) -> str:
    """The vehicles without a mission, and why; empty if there are none."""
    if not page.left_out:
        return ""
    listed = "".join(f"<li><b>{esc(name)}</b>: {esc(why)}</li>" for name, why in page.left_out)
    head = f"{len(page.left_out)} without a mission, left out"
    return f'<details class="left-out" open><summary>{head}</summary><ul class="findings">{listed}</ul></details>'
