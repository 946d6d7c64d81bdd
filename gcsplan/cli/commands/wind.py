"""`gcsplan wind`: the winds that a mission declares, as they are understood."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from gcsplan.cli.arguments.changes import WindOption, wind_changes
from gcsplan.cli.arguments.options import AtOption, JsonOption, MissionArgument, UnitsChoice, UnitsOption
from gcsplan.cli.process.exit import emit

if TYPE_CHECKING:
    from gcsplan.units import Units
    from gcsplan.wind.declared import DeclaredWind

MOST_WIND_ROWS = 60
"""Heights and hours that are printed at most; JSON has all."""

NOTED = ("wind_declared", "wind_of_forecast", "wind_not_counted")
"""The notes of a mission that are on its winds."""


def wind(
    mission: MissionArgument,
    wind: WindOption = None,
    at: AtOption = None,
    units: UnitsOption = UnitsChoice.METRIC,
    as_json: JsonOption = False,
) -> None:
    """Show the winds that a mission declares, as they are understood: speeds and directions by height and hour.

    Nothing is planned. Directions are those that the wind comes from, clockwise from true north.
    """
    from gcsplan.cli.output.console import say, say_notes
    from gcsplan.mission_file import load_mission
    from gcsplan.notes.note import Wording, in_json
    from gcsplan.units import units_of
    from gcsplan.wind.wording import as_dict, wind_note

    system = units_of(units)
    source = load_mission(mission, at=at, changes=wind_changes(wind))
    options = dict(() if source.content is None else source.content.options)
    declared = source.content is not None and source.content.given.get("wind") is not None
    by = options.get("wind", "the key `wind`") if declared else None
    notes = [note for note in source.notes if note.code in NOTED]
    if as_json:
        departure = None if source.departure is None else source.departure.isoformat()
        emit({"wind": as_dict(source.wind), "source": by, "departure": departure, **in_json("notes", notes)})
        return
    wording = Wording(system)
    if not source.wind.still:
        _print(source.wind, system)
    say(wind_note(source.wind).text(wording))
    say(f"declared by {by}" if by is not None else "the mission has no key `wind`")
    say_notes([note for note in notes if note.code != "wind_declared"], wording)


def _print(winds: DeclaredWind, units: Units) -> None:
    """Print a row for each hour and height."""
    from gcsplan.cli.output.console import console, new_table, remark
    from gcsplan.notes.note import Wording
    from gcsplan.wind.wording import directions_note, speeds_note

    several, wording = len(winds.times_s) > 1, Wording(units)
    height = units.amsl if winds.heights == "amsl" else units.height
    zero = "" if winds.heights == "amsl" else " above ground"
    columns = [("hour (UTC)", False), (f"{height.symbol}{zero}", True), ("speed", True), ("from", True)]
    table = new_table("", columns if several else columns[1:])
    rows = [(t, h) for t in range(len(winds.times_s)) for h in range(len(winds.heights_m))]
    for t, h in rows[:MOST_WIND_ROWS]:
        hour = f"{datetime.fromtimestamp(float(winds.times_s[t]), UTC):%Y-%m-%d %H:%M}"
        at = f"{height.of(float(winds.heights_m[h])):.0f}" if len(winds.heights_m) > 1 else "any"
        cells = speeds_note(winds.speed_m_s[t, h]), directions_note(winds.from_deg[t, h])
        table.add_row(*([hour] if several else []), at, *(cell.text(wording) for cell in cells))
    console.print(table, soft_wrap=False)
    if len(rows) > MOST_WIND_ROWS:
        remark(f"and {len(rows) - MOST_WIND_ROWS} more: --json has all")
