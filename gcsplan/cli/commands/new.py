"""`gcsplan new`."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from gcsplan.cli.arguments import completion
from gcsplan.cli.arguments.options import (
    LINKS,
    DatumOption,
    HeightUnitOption,
    JsonOption,
    NodataOption,
    SysidOption,
    as_options,
    terrain_keys,
)
from gcsplan.cli.process.exit import emit, printable
from gcsplan.errors import InputError, UsageError

if TYPE_CHECKING:
    from gcsplan.app.new_mission import Seen
    from gcsplan.vehicle import Autopilot

T = TypeVar("T")
MOST_ATTEMPTS = 5
"""Answers that the command reads to one question before it gives up."""


def new(
    start: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LAT,LON",
            help="Where a vehicle takes off; also degrees with minutes, UTM, MGRS. Again for each further vehicle.",
        ),
    ] = None,
    goal: Annotated[
        list[str] | None,
        typer.Option(metavar="LAT,LON", help="Where it flies to, in the same forms; one for each --start."),
    ] = None,
    dem: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            autocompletion=completion.dems,
            help="The ground: a raster (.tif, .vrt, .hgt, .asc, …) or sample:jacksboro; repeatable.",
        ),
    ] = None,
    vertical_datum: DatumOption = None,
    height_unit: HeightUnitOption = None,
    nodata: NodataOption = None,
    flat: Annotated[
        float | None, typer.Option(metavar="M", help="No raster: flat ground, M metres above sea level, everywhere.")
    ] = None,
    min_agl: Annotated[
        float, typer.Option(metavar="M", help="Lowest height above the ground and what stands on it.")
    ] = 60.0,
    max_agl: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="The legal ceiling above ground, often 120; on a terminal the command asks for it."
        ),
    ] = None,
    zones: Annotated[
        list[str] | None, typer.Option(metavar="FILE", help="No-fly zones in any format that is read; repeatable.")
    ] = None,
    battery_wh: Annotated[
        float | None, typer.Option("--battery-wh", metavar="WH", help="The battery, in watt-hours: its use is checked.")
    ] = None,
    autopilot: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            autocompletion=completion.autopilots,
            help="arducopter, arduplane or px4 [default: arducopter]",
        ),
    ] = None,
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="URL",
            help=f"Read start, autopilot, return altitude and lean angle from a vehicle: {LINKS}",
        ),
    ] = None,
    sysid: SysidOption = 1,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="File to write, .yaml.")] = Path(
        "mission.yaml"
    ),
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it is there.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write a mission file with a comment on every key: units, defaults, and the choices that are left.

    On a terminal, the command asks for what is not given. The ground is never assumed: give --dem, or --flat with a
    height.
    The file is read and judged before it is written, and a file that is there is replaced with --force alone.
    """
    from gcsplan.app.new_mission import checked_text, seen_at
    from gcsplan.cli.output.console import remark, say, say_notes
    from gcsplan.export.durable import write_whole
    from gcsplan.mission_file.new_file import Draft
    from gcsplan.notes.note import Note, in_json
    from gcsplan.vehicle import Autopilot

    _require_file(out, force)
    if dem and flat is not None:
        raise UsageError("give --dem or --flat, not both")
    keys = terrain_keys(vertical_datum, height_unit, nodata)
    if keys and flat is not None:
        raise UsageError(f"{', '.join(as_options(keys))}: goes with --dem: --flat is above sea level, in metres")
    kind = _autopilot(autopilot)
    asks = not as_json and on_a_terminal()
    seen: Seen | None = None if source is None else seen_at(source, sysid, kind)
    starts, goals = list(start or ()), list(goal or ())
    if max(len(starts), len(goals)) > 1 and (len(starts) != len(goals) or seen is not None):
        words = "--from goes with one vehicle" if seen is not None else f"{len(starts)} --start, {len(goals)} --goal"
        raise UsageError(f"{words}: give a --start and a --goal for each vehicle")
    where_from = starts[0] if starts else seen.start if seen is not None else None
    where_to = goals[0] if goals else None
    missing = [name for name, value in (("--start", where_from), ("--goal", where_to)) if value is None]
    if not dem and flat is None:
        missing.append("--dem FILE (or --flat M: flat ground at that altitude, which is never assumed)")
    if missing and not asks:
        raise UsageError(f"give {', '.join(missing)} (see gcsplan new --help; on a terminal the command asks for them)")
    begin = _place("--start", where_from, "Start (LAT,LON)")
    end = _place("--goal", where_to, "Goal (LAT,LON)")
    others = [(_place("--start", a, ""), _place("--goal", b, "")) for a, b in zip(starts[1:], goals[1:], strict=False)]
    if not dem and flat is None:
        dem, flat = _ask("Ground (a raster, sample:jacksboro, or `flat 400` for 400 m above sea level)", _ground)
        if dem and vertical_datum is None and not dem[0].startswith("sample:"):
            words = "Vertical datum (EGM96 for SRTM; empty if the raster states it)"
            vertical_datum = _ask(words, str.strip, default="") or None
    if kind is None and seen is None and asks and missing:
        kind = _ask(f"Autopilot ({', '.join(Autopilot)})", _autopilot, default="arducopter")
    if max_agl is None and asks and missing:
        words = "Legal ceiling in metres above ground (often 120; empty: none is kept)"
        max_agl = _ask(words, _ceiling, default="")
    draft = Draft(
        start=begin, goal=end, dem=tuple(beside(d, out) for d in dem or ()), vertical_datum=vertical_datum,
        height_unit=height_unit, nodata=nodata, flat_m=flat,
        autopilot=seen.autopilot if seen else kind or Autopilot.ARDUCOPTER, sysid=sysid, min_agl_m=min_agl,
        others=tuple(others), zones=tuple(beside(zone, out) for zone in zones or ()), max_agl_m=max_agl,
        battery_wh=battery_wh,
    )  # fmt: skip
    draft = draft if seen is None else seen.onto(draft)
    text, notes = checked_text(draft, out)
    notes = (*(seen.notes if seen is not None else ()), *notes)
    if flat is not None:
        notes = (*notes, Note("ground_is_flat", flat_m=flat))
    _require_file(out, force)  # a question may have taken its time
    write_whole(out, text)
    files = [out, *_write_schema(out.parent, remark)]
    if as_json:
        emit({"files": [str(file) for file in files], "start": begin, "goal": end, **in_json("notes", notes)})
        return
    say_notes(notes)
    say(f"written: {', '.join(map(str, files))}")
    say(f"plan it: gcsplan plan {shlex.quote(str(out))}")


def on_a_terminal() -> bool:
    return all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stderr))


def _require_file(out: Path, force: bool) -> None:
    """Raise UsageError unless ``out`` can be the new file."""
    if out.suffix.lower() not in (".yaml", ".yml"):
        raise UsageError(f"-o {out}: give a name that ends in .yaml")
    if out.is_dir() or not out.parent.is_dir():
        raise UsageError(f"-o {out}: give a file in a directory that exists")
    if out.exists() and not force:
        raise UsageError(f"-o {out}: this file is there already; give another name, or --force to replace it")


def _autopilot(name: str | None) -> Autopilot | None:
    from gcsplan.vehicle import Autopilot

    if name is None:
        return None
    if name not in tuple(Autopilot):
        raise UsageError(f"--autopilot {name}: give one of {', '.join(Autopilot)}")
    return Autopilot(name)


def _place(option: str, given: str | None, question: str) -> str:
    """A place as it stands in the file; the command asks for it if it is not given."""
    from gcsplan.mission_file.new_file import place_text

    if given is None:
        return _ask(question, place_text)
    try:
        return place_text(given)
    except ValueError as why:
        raise UsageError(f"{option}: {why}") from None


def _ground(answer: str) -> tuple[list[str] | None, float | None]:
    """A raster, or the height of flat ground."""
    words = answer.split()
    if not words:
        raise ValueError("give a raster, or flat and its height above sea level in metres")
    if words[0].lower() != "flat":
        return [answer.strip()], None
    if len(words) != 2 or not re.fullmatch(r"[-+]?\d+(\.\d+)?", words[1]):
        raise ValueError("flat ground needs its height above sea level in metres: flat 400")
    return None, float(words[1])


def _ceiling(answer: str) -> float | None:
    """A height, or none."""
    words = answer.strip()
    if words and not re.fullmatch(r"\d+(\.\d+)?", words):
        raise ValueError("give metres above ground, or nothing")
    return float(words) if words else None


def _ask(question: str, read: Callable[[str], T], default: str | None = None) -> T:
    """Ask on the terminal until the answer can be read, a few times."""
    for _ in range(MOST_ATTEMPTS):
        answer = typer.prompt(question, default=default, show_default=bool(default), err=True)
        try:
            return read(str(answer))
        except (ValueError, InputError) as why:
            typer.echo(printable(str(why)), err=True)
    raise UsageError(f"{question}: no answer could be read")


def beside(dem: str, out: Path) -> str:
    """A raster of the current folder as the mission file names it; a name that is no file stays as it is."""
    if os.path.isabs(dem) or not os.path.exists(dem):
        return dem
    return Path(os.path.relpath(dem, out.parent)).as_posix()


def _write_schema(folder: Path, remark: Callable[[str], None]) -> list[Path]:
    """Write the JSON Schema that the mission's first line names, unless another's file has its name."""
    import json

    from gcsplan.export.durable import write_whole
    from gcsplan.mission_file.json_schema import FILE_NAME, SCHEMA_TITLE, mission_schema

    file = folder / FILE_NAME
    try:
        ours = not file.exists() or SCHEMA_TITLE in file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        ours = False
    if not ours:
        remark(f"note: {file} is not gcsplan's and stays as it is")
        return []
    write_whole(file, json.dumps(mission_schema(), indent=1) + "\n")
    return [file]
