"""Check any `.waypoints` and `.plan` files in the world of a mission file, or in a world made from options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gcsplan.app.check.verdict_json import flat
from gcsplan.app.check.worlds import (
    NO_RETURNS,
    Checked,
    CheckSite,
    MissionSite,
    Returns,
    VerdictParts,
    at_start,
    beyond_m,
    match,
    places_of,
)
from gcsplan.app.plan.way_home import is_required, lets_fly
from gcsplan.errors import CheckFailed, GcsplanError, InputError, Mistake, UsageError, elements, worst_of
from gcsplan.figures import counted
from gcsplan.mavlink.files.file_items import MissionFileRead
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mission_file import MissionFile
from gcsplan.mission_file.changes import MissionChange, changed
from gcsplan.mission_file.load import load_content
from gcsplan.notes.note import IN_FILES, Note, Wording


@dataclass(frozen=True)
class Batch:
    """Several files: the ones that were judged, and the errors of the others.

    ``inputs`` describes the world; ``typed``: as in `worlds.Checked`.
    """

    name: str
    checked: tuple[Checked, ...]
    unreadable: tuple[tuple[str, InputError], ...] = ()
    inputs: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[Note, ...] = ()
    typed: Mapping[str, str] = field(default_factory=dict)


def check_files(source: MissionFile, arguments: Sequence[str], *, returns: Returns = NO_RETURNS) -> list[Checked]:
    """Judge each FILE or NAME=FILE in the world of ``source``. Raises InputError or UsageError for unreadable files."""
    batch = check_batch(source, arguments, returns=returns)
    if batch.unreadable:
        if len(batch.unreadable) == 1:
            raise batch.unreadable[0][1]
        raise InputError.of([p for _, error in batch.unreadable for p in error.problems])
    return list(batch.checked)


def check_batch(
    source: MissionFile,
    arguments: Sequence[str],
    *,
    returns: Returns = NO_RETURNS,
    held: Mapping[str, bytes] | None = None,
) -> Batch:
    """Judge each FILE or NAME=FILE in the world of ``source``; a file that cannot be read does not stop the others.

    ``returns``: whether the way home is judged, beside the mission file's own ``way_home``. If a file reaches beyond
    the terrain that was loaded for the mission, more terrain is loaded. ``held``: the content of files that lie on no
    disk, by their names. Raises UsageError if it is not clear which vehicle a file is for.
    """
    for argument in arguments:
        match(source, argument)
    both = replace(returns, required=is_required(source, returns.required))
    return check_at(MissionSite(source, held), source.name, arguments, VerdictParts(both))


def in_other_winds(source: MissionFile, wind: Mapping[str, object]) -> MissionFile:
    """``source`` with other winds, by the keys of a mission's `wind`.

    Raises InputError, and UsageError for a mission that `load_mission` did not make.
    """
    content = source.content
    if content is None:
        raise UsageError("the mission was not made by load_mission: give its file, text or mapping", where="check()")
    keys = dict(elements("check()", "wind", wind.items(), tuple, "a mapping of the keys of a mission's `wind`"))
    made = changed(content.given, [MissionChange("", "wind", "wind", keys)], content.file.parent)
    again = load_content(replace(content, given=made.raw, text=None))  # lines of the text are those before
    return (again.at_level(source.level) if again.at_level is not None else None) or again


def check_mission(source: MissionFile, mission: Mission, vehicle: str | None = None) -> Checked:
    """Judge mission items in the world of ``source``, for the named vehicle or else the one that the mission names.

    Raises UsageError if the mission file has no such vehicle.
    """
    argument = mission.name if vehicle is None else f"{vehicle}={mission.name}"
    request, _ = match(source, argument)
    start = Home.at(*request.start_deg, request.start[2])
    read = at_start(MissionFileRead(mission), start, request.vehicle)
    site = MissionSite(source)
    site.settle(np.array(places_of(read.mission)), 0.0, several=False)
    return site.judged(argument, read, VerdictParts())


def check_at(site: CheckSite, name: str, arguments: Sequence[str], parts: VerdictParts) -> Batch:
    """Judge each file at a site; one that cannot be read or judged does not stop the others."""
    read: list[tuple[str, MissionFileRead]] = []
    unreadable: list[tuple[str, InputError]] = []
    for argument in arguments:
        try:
            read.append((argument, site.read(argument)))
        except InputError as error:
            unreadable.append((argument, error))
    if read:
        places = [place for _, r in read for place in places_of(r.mission)]
        site.settle(np.array(places), max(beyond_m(r.mission) for _, r in read), several=len(read) > 1)
    checked: list[Checked] = []
    for argument, r in read:
        try:
            checked.append(site.judged(argument, r, parts))
        except InputError as error:
            unreadable.append((argument, error))
    inputs, notes = site.sources
    return Batch(name, tuple(checked), tuple(unreadable), inputs, notes, site.typed)


def passes(c: Checked, *, allow_unjudged: bool) -> bool:
    """Whether a checked mission may fly: it breaks no limit, and the way home lets it fly."""
    path = c.verdict.safe is True or (c.verdict.safe is None and allow_unjudged)
    return path and lets_fly(c.way_home, required=c.home_required)


def finding_lines(c: Checked, *, allow_unjudged: bool = False, wording: Wording = IN_FILES) -> list[str]:
    """One line per finding, ``file:item: kind: message``, in the format of compilers and linters.

    A way home that is only reported is one line, ``file:item: warning: way_home: message``.
    """
    lines = [f"{c.file}:{f.seq}: {f.kind}: {f.note.text(wording, placed=False)}" for f in c.verdict.findings]
    if not allow_unjudged:
        lines += [_not_judged(c, note, wording) for note in c.verdict.not_judged]
    return lines + home_lines(c, wording)


def home_lines(c: Checked, wording: Wording = IN_FILES) -> list[str]:
    """The lines of `finding_lines` on a way home that is not safe; none if it is, or was not judged at all."""
    home = c.way_home
    if home is None or home.safe is True:
        return []
    first = home.unsafe[0].from_seq if home.unsafe else 0
    battery = home.battery
    if not home.unsafe and battery is not None and battery.no_return_seq is not None:
        first = battery.no_return_seq
    headline, advice = home.headline.text(wording), home.advice
    if lets_fly(home, required=c.home_required):
        return [f"{c.file}:{first}: warning: way_home: {headline}"]
    lines = [f"{c.file}:{first}: way_home: {headline}" + ("" if advice is None else f"; {advice.text(wording)}")]
    lines += [
        f"{c.file}:{s.from_seq}: way_home: no safe return from {s.described().text(wording)}" for s in home.unsafe
    ]
    if battery is not None and battery.short:
        lines.append(f"{c.file}:{battery.no_return_seq or 0}: way_home: {battery.note.text(wording)}")
    return lines + [_not_judged(c, note, wording, "the way home: ") for note in home.not_judged]


def _not_judged(c: Checked, note: Note, wording: Wording, of: str = "") -> str:
    """The line on what was not judged of a file."""
    return f"{c.file}:{note.item or 0}: not_judged: {of}{note.text(wording, placed=False)}"


@dataclass(frozen=True, slots=True)
class Failing:
    """Why a file does not pass: exit code and reason, lines on the mission, lines on the way home, mistakes in it."""

    file: str
    code: int
    reason: str
    lines: tuple[str, ...]
    home_lines: tuple[str, ...] = ()
    problems: tuple[Mistake, ...] = ()


def failing_of(c: Checked, *, allow_unjudged: bool) -> Failing | None:
    """Why a file that was judged does not pass; None if it does."""
    if passes(c, allow_unjudged=allow_unjudged):
        return None
    broken = c.verdict.safe is False or _home_broken(c)
    lines = tuple(f"{c.vehicle.name}: {line}" for line in c.verdict.describe(c.wording()).splitlines())
    home = () if lets_fly(c.way_home, required=c.home_required) else tuple(home_lines(c, c.wording()))
    return Failing(str(c.file), CheckFailed.exit_code, "violation" if broken else "not_judged", lines, home)


def failing_to_read(argument: str, error: GcsplanError) -> Failing:
    """Why a file was not judged."""
    problems = error.problems if isinstance(error, InputError) else ()
    return Failing(argument, error.exit_code, error.reason, (str(error),), (), problems)


REASONS = ("internal", "violation", "not_judged")
"""From the worst to the best; any other is of bad input."""


def failure(failing: Sequence[Failing], more: int = 0) -> dict[str, Any] | None:
    """The ``error`` of ``check --json``: broken limits, what could not be judged, and files that cannot be read.

    None if every mission may fly. ``more``: how many further files do not pass, which are not among ``failing``.
    """
    if not failing:
        return None
    judged, others = ([f for f in failing if (f.code == CheckFailed.exit_code) is so] for so in (True, False))
    lines = [line for f in judged for line in f.lines] + [line for f in judged for line in f.home_lines]
    lines += [line for f in others for line in f.lines]
    problems = [p for f in others for p in f.problems]
    reasons = {f.reason for f in failing}
    document: dict[str, Any] = {
        "code": worst_of({f.code for f in failing}),
        "reason": next((reason for reason in REASONS if reason in reasons), InputError.default_reason),
        "message": "\n".join([*lines, *([f"… and {counted(more, 'more file')}"] if more else [])]),
        "where": ", ".join([*(f.file for f in judged), *(f.file for f in others), *(["…"] if more else [])]),
    }
    if problems:
        document["problems"] = [p.as_dict() for p in problems]
    return document


def _home_broken(c: Checked) -> bool:
    return c.home_required and c.way_home is not None and c.way_home.safe is False


def more_of(c: Checked) -> dict[str, Any]:
    """The part of ``check --json`` for one file beside its verdict: nearest misses, all legs, the file's own lists."""
    return {
        "nearest_misses": [flat(miss) for miss in c.verdict.misses],
        "time_s": c.verdict.time_s,
        "legs": [flat(leg) for leg in c.verdict.legs],
        "fence_items": len(c.fence),
        "rally_points": len(c.rally),
    } | ({"way_home": c.way_home.as_dict(c.wording())} if c.way_home is not None else {})
