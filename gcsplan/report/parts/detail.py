"""Which vehicles of a page have marks on the map, profiles and tables of their own: of a large fleet only some.

All vehicles are on the map, in the replay and in the tables of key figures.
"""

from __future__ import annotations

import math

from gcsplan.report.parts.html import esc
from gcsplan.report.parts.page_data import Page, Subject
from gcsplan.report.parts.track_samples import MOST_SAMPLES

MOST_WHOLE = 100
"""Most vehicles of a page that has everything of all of them."""

MOST_FULL = 24
"""Vehicles of a larger fleet that have profiles and tables of their own."""

LIGHT_SAMPLES = 12
"""Samples along the track of each other vehicle; a few more if it has many legs."""


def in_full(page: Page) -> frozenset[int]:
    """The numbers of the vehicles that have profiles and tables of their own.

    Of more than `MOST_WHOLE` vehicles: those with a finding, something not judged or no safe return, then the two that
    come nearest to each other, then those with the least room above the ground.
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
        f'<p class="note">Of {len(page.subjects)} vehicles {len(full)} are shown: those with problems first, then the '
        "two that come nearest to each other, then those with the least room above the ground. The others are on the "
        f"map and in the tables of all vehicles; <code>{command}</code> shows one of those {rest}.</p>"
    )


def left_out_html(page: Page) -> str:
    """The vehicles without a mission, and why; empty if there are none."""
    if not page.left_out:
        return ""
    listed = "".join(f"<li><b>{esc(name)}</b>: {esc(why)}</li>" for name, why in page.left_out)
    head = f"{len(page.left_out)} without a mission, left out"
    return f'<details class="left-out" open><summary>{head}</summary><ul class="findings">{listed}</ul></details>'
