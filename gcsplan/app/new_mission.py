"""A new mission file: what a vehicle tells for it over a link, and the text, read once before it is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from gcsplan.app.upload import run as uploads
from gcsplan.errors import InputError, Mistake, VehicleRefused
from gcsplan.mavlink.mission.return_parameters import return_on_board_m
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.new_file import Draft, text_of
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

if TYPE_CHECKING:
    from gcsplan.mavlink.link.watch import VehicleState

HOME_NEAR_M = 30.0
"""A home farther than this from the vehicle, m, gets a note."""

OPTIONS = {
    "terrain": "--dem", "terrain.dem": "--dem", "terrain.vertical_datum": "--vertical-datum",
    "terrain.height_unit": "--height-unit", "terrain.nodata": "--nodata",
    "terrain.flat_m": "--flat", "limits.min_agl_m": "--min-agl", "limits.max_agl_m": "--max-agl",
    "vehicles[0].start": "--start", "vehicles[0].goal": "--goal", "no_fly[0].file": "--zones",
    "vehicles[0].energy.battery_wh": "--battery-wh",
}  # fmt: skip
"""The option for each key that an option sets."""


@dataclass(frozen=True)
class Seen:
    """The reports of a vehicle: its place as text (None if it reports none), its autopilot and its settings."""

    url: str
    autopilot: Autopilot
    start: str | None
    rtl_rel_home_m: float | None
    lean_deg: float | None
    notes: tuple[Note, ...]

    def onto(self, draft: Draft) -> Draft:
        """``draft`` with the vehicle's link and settings."""
        return replace(draft, link=self.url, rtl_rel_home_m=self.rtl_rel_home_m, lean_deg=self.lean_deg)


def seen_at(url: str, sysid: int, autopilot: Autopilot | None) -> Seen:
    """The reports of the vehicle at ``url``; nothing is written to it.

    ``autopilot`` is what the user expects. Raises LinkError if nobody answers, VehicleRefused for another autopilot,
    or for one that gcsplan does not know where none is expected.
    """
    from gcsplan.mavlink.link.session import session
    from gcsplan.mavlink.link.session.parameters import lean_on_board_deg

    with uploads.open_link(url) as link:
        options = session.SessionOptions(listen_s=uploads.LISTEN_S)
        state, reported, values = session.read_vehicle(link, sysid, options=options)
        place = link.url
    if reported is None and autopilot is None:
        known = ", ".join(Autopilot)
        raise VehicleRefused(f"vehicle {sysid} calls itself {state.what}: say with --autopilot which it is ({known})")
    if reported is not None and autopilot not in (None, reported):
        words = (
            f"vehicle {sysid} is {state.what}, and --autopilot {autopilot} is given: leave it out, or give {reported}"
        )
        raise VehicleRefused(words, where=url, reason="wrong_autopilot")
    kind = reported or autopilot
    assert kind is not None
    start, notes = _start(state)
    height_m = return_on_board_m(values)
    lean_deg = lean_on_board_deg(values)
    if not values:
        notes.append(Note("parameters_not_read"))
    return Seen(
        place, kind, start,
        None if height_m is None or height_m <= 0.0 else round(height_m, 2),
        None if lean_deg is None or not 10.0 <= lean_deg <= 80.0 else round(lean_deg, 2),
        tuple(notes),
    )  # fmt: skip


def _start(state: VehicleState) -> tuple[str | None, list[Note]]:
    """Where the vehicle is, else its home, and what a user has to know about that."""
    from gcsplan.mavlink.link.session.preflight import distance_m

    home = None if state.home is None else (state.home.lat_e7 / 1e7, state.home.lon_e7 / 1e7)
    if state.lat_deg is None or state.lon_deg is None:
        if home is None:
            return None, []
        return f"{home[0]:.7f}, {home[1]:.7f}", [Note("start_at_home")]
    notes = [] if not state.armed else [Note("position_of_armed_vehicle")]
    if home is not None and (away_m := distance_m(state.lat_deg, state.lon_deg, *home)) > HOME_NEAR_M:
        notes.append(Note("start_at_vehicle", away_m=away_m))
    return f"{state.lat_deg:.7f}, {state.lon_deg:.7f}", notes


def checked_text(
    draft: Draft, file: Path, options: Mapping[str, str] = MappingProxyType(OPTIONS)
) -> tuple[str, tuple[Note, ...]]:
    """The mission file's text, and the notes of its reader. Raises InputError with the option of each mistake."""
    text = text_of(draft, file.name, file.stem)
    try:
        return text, load_mission(file, text=text).notes
    except InputError as error:
        raise InputError.of([_renamed(problem, f"{file}: ", options) for problem in error.problems]) from None


def _renamed(problem: Mistake, where: str, options: Mapping[str, str]) -> Mistake:
    """The problem at its option, without the line of a file that is not written."""
    place = problem.where.removeprefix(where)
    return replace(problem, where=options.get(place, problem.where), message=problem.message.removesuffix(problem.line))
