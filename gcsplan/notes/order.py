"""The order in which people read the notes on a plan: what changes the flight first, how it was planned last.

A list for programs keeps the order in which the notes were made, and has each of them; here defaults share a line.
"""

from __future__ import annotations

from collections.abc import Iterable

from gcsplan.notes.note import Note

FLIGHT = (
    "climb_out", "climb_out_in_circles", "circles_instead", "climb_out_straight", "climb_out_circles",
    "climb_out_drifts", "climb_out_blown", "turns_early", "approach", "approach_into_wind", "approach_uphill",
    "glide_straight", "lands_downhill", "lands_fast", "waits_on_ground", "holds_at_gate", "holds_and_waits",
    "waits_at_gates",
    "leaves_later", "leaves_earlier", "flies_at", "keeps_clear", "lean_bounds_speed", "lean_bounds_speed_curably",
    "velocity_bounds_speed", "lean_to_set", "lean_counted_with", "takeoff_raised", "approach_raised", "via_moved",
    "returns_by_itself", "return_leads_to_landing", "battery_until_reserve", "ends_in_the_air",
)  # fmt: skip
"""What the crew does, sets or expects, in this order."""
PLANNING = (
    "planned_again", "bound_of_farther_paths", "bound_ignores_turns", "bound_by_cells", "bound_with_climb_out",
    "searches_failed", "curve_pushed", "curve_lifted", "curve_thinned", "paper_energy_minimised",
)  # fmt: skip
"""How the plan was found: nothing of it changes the flight."""
_RANKS = {code: rank for rank, code in enumerate(FLIGHT, start=-len(FLIGHT))} | dict.fromkeys(PLANNING, 1)


def for_people(notes: Iterable[tuple[str, Note]]) -> list[tuple[str, Note]]:
    """Notes with the vehicle that each is on (empty: on the mission), each once, in the order for people.

    The flight's come first, then others in their order, the planning's, and last one with all defaults of a vehicle.
    """
    named = [(name or str(note.data.get("vehicle", "")), _without_vehicle(note)) for name, note in notes]
    defaults: dict[str, list[Note]] = {}
    others: list[tuple[str, Note]] = []
    for name, note in dict.fromkeys(named):
        default = _default(note)
        if default is None:
            others.append((name, note))
        else:
            defaults.setdefault(name, []).append(default)
    others.sort(key=lambda row: _RANKS.get(row[1].code, 0))
    return others + [(name, Note("defaults_taken", defaults=tuple(taken))) for name, taken in defaults.items()]


def _without_vehicle(note: Note) -> Note:
    return note.without("vehicle") if "vehicle" in note.data else note


def _default(note: Note) -> Note | None:
    """A note on a default as a part of the line that all of them share; None for any other note."""
    data = note.data
    match note.code:
        case "limit_assumed":
            return Note("default_of_limit", limit=data["limit"], value=data["value"])
        case "plane_climb_assumed":
            return Note("default_of_climb", climb_deg=data["climb_deg"])
        case "one_speed":
            return Note("default_of_speed", speed_m_s=data["slow_m_s"])
    return None
