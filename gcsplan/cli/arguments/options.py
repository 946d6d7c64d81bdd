"""Options and arguments that several commands share, with their help texts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from gcsplan.cli.arguments import completion
from gcsplan.errors import UsageError
from gcsplan.units import AVIATION, IMPERIAL, METRIC

LINKS = "udpout:HOST:PORT sends (,LOCAL: from that port), udpin:HOST:PORT listens, tcp:HOST:PORT, /dev/ttyUSB0,57600."
MISBEHAVIOURS = (
    "drop, duplicate, reorder, delay (probabilities), delay_s, corrupt (an item), corrupt_field, silent_after "
    "(messages), reboot_at (an item), reboot_s, reboot_loses, edit (an item), stray_sysid, stale_type, answer_sysid, "
    "refuse (an item), refuse_code, no_space, mute (a parameter), mute_times, armed, seed"
)


class UnitsChoice(StrEnum):
    """The values of ``--units``."""

    METRIC = METRIC.name
    IMPERIAL = IMPERIAL.name
    AVIATION = AVIATION.name


UnitsOption = Annotated[
    UnitsChoice,
    typer.Option(
        "--units",
        envvar="GCSPLAN_UNITS",
        metavar="NAME",
        help="Units of tables, findings, notes and report: metric, imperial (ft, mi, mph) or aviation (ft, NM, kt). "
        "Other files and JSON stay in SI.",
    ),
]
MissionArgument = Annotated[
    Path,
    typer.Argument(
        metavar="MISSION.yaml", autocompletion=completion.missions, help="The mission file, or sample:NAME."
    ),
]
DatumOption = Annotated[
    str | None,
    typer.Option("--vertical-datum", metavar="NAME", help="Zero of the terrain's heights: EGM96, NAVD88, EPSG:6360, …"),
]
HeightUnitOption = Annotated[
    str | None,
    typer.Option(
        "--height-unit",
        metavar="UNIT",
        autocompletion=completion.words("m", "ft", "us_ft"),
        help="Unit of the terrain's heights, before the one that the file states: m, ft or us_ft.",
    ),
]
NodataOption = Annotated[
    str | None,
    typer.Option(
        "--nodata", metavar="N|none", help="The terrain's number for no height; none: exact zeros are ground or sea."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON document on standard output.")]
ListZonesOption = Annotated[
    bool,
    typer.Option(
        "--list-zones", help="Show each zone as it was read: shape, size, floor, ceiling. Nothing else is done."
    ),
]
OnBadOption = Annotated[
    str | None,
    typer.Option(
        "--on-bad",
        metavar="RULE",
        autocompletion=completion.words("refuse", "strict", "skip"),
        help="Zones that are not understood: refuse; strict (they count as large as they may be); skip (left out by "
        "name). If absent, own files refuse, an authority's are strict.",
    ),
]
IgnoreOption = Annotated[
    list[str] | None,
    typer.Option(
        "--ignore",
        metavar="WHAT",
        autocompletion=completion.words("points", "lines", "empty"),
        help="Shapes beside zones to leave out by name: points and lines without a size, empty; may be repeated.",
    ),
]
AtOption = Annotated[
    str | None,
    typer.Option(
        "--at", metavar="WHEN",
        help="When it is flown, in place of the mission file's `at`: 2026-11-24T10:00Z, a day, or FROM/TO. Zones that "
        "do not apply then are left out, and named; a flight beyond is not judged.",
    ),
]  # fmt: skip
PlannerOption = Annotated[
    str | None,
    typer.Option(
        "--planner", metavar="NAME", autocompletion=completion.planners, help="A name from `gcsplan planners`."
    ),
]
ObjectiveOption = Annotated[
    str | None,
    typer.Option(
        "--objective",
        metavar="WHAT",
        autocompletion=completion.words("length", "energy", "time"),
        help="length, energy or time.",
    ),
]
SeedOption = Annotated[int | None, typer.Option("--seed", metavar="N", min=0, help="Seed of everything random.")]
JobsOption = Annotated[
    int | None,
    typer.Option(
        "--jobs", metavar="N", help="Processes that share the work [default: one for each core, where that pays]."
    ),
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="ADDRESS", help="A dask scheduler whose workers do the work: tcp://HOST:PORT or its file."
    ),
]
LeaveOutOption = Annotated[
    bool,
    typer.Option(
        "--leave-out",
        help="Leave out, by name, each vehicle that has no mission, and plan the others; ends with 3 if there is one.",
    ),
]
UnjudgedOption = Annotated[
    bool, typer.Option("--allow-unjudged", help="Accept a mission of which something could not be judged.")
]
SysidOption = Annotated[
    int, typer.Option("--sysid", metavar="N", min=1, max=255, help="System id of the vehicle, 1 to 255.")
]
WayHomeOption = Annotated[
    bool, typer.Option("--way-home", help="Judge the return (RTL) from every point: terrain, zones, battery.")
]
RequireWayHomeOption = Annotated[
    bool,
    typer.Option(
        "--require-way-home",
        help="Judge the return, and refuse the mission unless it is safe from every point, as `way_home: required` "
        "in the mission file does.",
    ),
]
ToOption = Annotated[str, typer.Option("--to", metavar="URL", help=f"Where the vehicle is: {LINKS}")]
FilesArgument = Annotated[
    list[str], typer.Argument(metavar="FILE...", help="FILE or NAME=FILE (the vehicle's name); .waypoints or .plan.")
]
TypeOption = Annotated[
    str,
    typer.Option(
        "--type",
        metavar="KIND",
        autocompletion=completion.words("mission", "fence", "rally"),
        help="mission, fence or rally.",
    ),
]
ArmedOption = Annotated[bool, typer.Option("--allow-armed", help="Send to an armed vehicle.")]
AtomicOption = Annotated[
    bool, typer.Option("--atomic", help="All or nothing: if one upload fails, clear what the other vehicles took.")
]
FenceOption = Annotated[
    bool,
    typer.Option(
        "--fence",
        help="First send the zones and the file's own fence as a fence. Zones with a floor or a ceiling stay out.",
    ),
]
RallyOption = Annotated[bool, typer.Option("--rally", help="First send the file's own rally points.")]
FenceInfiniteOption = Annotated[
    bool, typer.Option("--fence-infinite", help="As --fence, with zones that have a height as if they had none.")
]
TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout", metavar="S", min=1.0, max=3600.0,
        help="The longest time without progress, in seconds; 2 s an item more for the whole.",
    ),
]  # fmt: skip
PlaceOption = Annotated[bool, typer.Option("--ignore-position", help="Send wherever the vehicle stands.")]
ParametersOption = Annotated[
    bool,
    typer.Option("--allow-parameters", help="Judge with the parameters on board, also outside of the mission's list."),
]

UncheckedSysidOption = Annotated[
    int | None,
    typer.Option("--sysid", metavar="N", min=1, max=255, help="With --unchecked: its system id [default: 1]"),
]
UnlessMissionSysidOption = Annotated[
    int | None,
    typer.Option("--sysid", metavar="N", min=1, max=255, help="Without --mission: its system id [default: 1]"),
]
ListenOption = Annotated[
    str, typer.Option(metavar="URL", help="udpin:HOST:PORT or tcpin:HOST:PORT listens, udpout:HOST:PORT speaks first.")
]
AutopilotOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        autocompletion=completion.autopilots,
        help="Without a mission file: arducopter, arduplane or px4 [default: arducopter]",
    ),
]
FirmwareOption = Annotated[
    str | None,
    typer.Option(
        metavar="VERSION",
        autocompletion=completion.words("4.6", "4.7", "1.16", "1.17", "1.18"),
        help="Behave like this version: 4.6 or 4.7 of ArduPilot, 1.16, 1.17 or 1.18 of PX4 [default: 4.6, 1.17]",
    ),
]
SimSysidOption = Annotated[
    int | None,
    typer.Option("--sysid", metavar="N", min=1, max=255, help="Without a mission file: system id [default: 1]"),
]
MisbehaveOption = Annotated[
    str, typer.Option(metavar="HOW", help=f"Trouble, for example drop=0.1,corrupt=7,seed=3. Known: {MISBEHAVIOURS}.")
]


def terrain_keys(datum: str | None, unit: str | None, nodata: str | None) -> dict[str, object]:
    """The keys of ``terrain:`` that these options give. Raises UsageError."""
    if unit not in (None, "m", "ft", "us_ft"):
        raise UsageError(f"--height-unit {unit}: give m, ft or us_ft")
    number: object = nodata
    if nodata not in (None, "none"):
        try:
            number = float(str(nodata))
        except ValueError:
            number = math.nan
        if not math.isfinite(float(str(number))):
            raise UsageError(f"--nodata {nodata}: give a number, or none")
    given = {"vertical_datum": datum, "height_unit": unit, "nodata": number}
    return {key: value for key, value in given.items() if value is not None}


def as_options(keys: Mapping[str, object]) -> dict[str, object]:
    """The same by the names of the options."""
    return {f"--{key.replace('_', '-')}": value for key, value in keys.items()}


def require_html(file: Path | None) -> None:
    """Raise UsageError unless ``file``, the page that is to be written, is None or can be one."""
    if file is not None and (file.suffix.lower() not in (".html", ".htm") or not file.parent.is_dir()):
        raise UsageError(f"--report {file}: give a name that ends in .html, in a directory that exists")
