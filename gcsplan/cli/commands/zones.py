"""``--list-zones`` of `gcsplan plan` and `gcsplan check`: a table of the zones as they were understood."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gcsplan.cli.process.exit import emit, printable

if TYPE_CHECKING:
    from gcsplan.app.output.zones import ListedZone
    from gcsplan.mission_file.zones.file import Ignorable, OnBad
    from gcsplan.units import Unit, Units
    from gcsplan.world.geometry.zones import Level


def show_zones(
    files: Sequence[Path], units: Units, *, as_json: bool, at: str | None = None, on_bad: OnBad | None = None,
    ignore: Sequence[Ignorable] = (),
) -> None:  # fmt: skip
    """Print the zones of mission files and zone files, a row for each. Raises InputError."""
    from rich.markup import escape

    from gcsplan.app.output.zones import list_zones
    from gcsplan.cli.output.console import console, new_table, say, say_notes
    from gcsplan.figures import counted
    from gcsplan.notes.note import in_json

    zones, notes = list_zones(files, at, on_bad=on_bad, ignore=ignore)
    if as_json:
        emit({"zones": [zone.as_dict() for zone in zones], **in_json("notes", notes)})
        return
    table = new_table("", [])
    for name in ("name", "shape", "size", "floor", "ceiling", "source"):
        table.add_column(name, no_wrap=name not in ("name", "source"), overflow="fold")
    for zone in zones:
        levels = _level(zone.floor, "ground", units), _level(zone.ceiling, "none", units)
        table.add_row(
            escape(printable(zone.name)),
            f"{zone.shape}, keep-in" if zone.keep_in else zone.shape,
            _size(zone, units),
            *levels,
            escape(printable(_short(zone.source))),
        )
    if zones:
        console.print(table, soft_wrap=False)
    say(counted(len(zones), "zone"))
    say_notes(notes)


def _size(zone: ListedZone, units: Units) -> str:
    """The radius of a circle, length and half-width of a corridor, the extent of a polygon from west and from south."""
    if zone.radius_m is not None:
        return f"radius {_shown(zone.radius_m, units)}"
    if zone.extent_m is None:
        return "very large"
    if zone.length_m is not None and zone.buffer_m is not None:
        return f"{_shown(zone.length_m, units)}, ±{_shown(zone.buffer_m, units)}"
    return " x ".join(_shown(side, units) for side in zone.extent_m)


def _shown(metres: float, units: Units) -> str:
    """A size with three digits, in the unit for paths where it is long."""
    unit = units.along(metres)
    return f"{_plain(unit, metres, 3)} {unit.symbol}"


def _level(level: Level | None, without: str, units: Units) -> str:
    if level is None:
        return without
    return f"{_plain(units.height, level.value_m, 5)} {units.height.symbol} {level.datum.upper()}"


def _plain(unit: Unit, metres: float, digits: int) -> str:
    value = unit.of(metres)
    return f"{value:.0f}" if abs(value) >= 10.0**digits else f"{value:.{digits}g}"


def _short(source: str) -> str:
    """The place in a file without the folders before its name."""
    file, colon, place = source.partition(": ")
    name = Path(file).name
    return place if name.lower().endswith((".yaml", ".yml")) else f"{name}{colon}{place}"
