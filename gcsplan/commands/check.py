"""`gcsplan check`."""

from __future__ import annotations

import typer

from gcsplan.commands.ending import emit
from gcsplan.commands.options import FilesArgument, JsonOption, MissionArgument, UnjudgedOption
from gcsplan.errors import CheckFailed


def check(
    mission: MissionArgument,
    files: FilesArgument,
    allow_unjudged: UnjudgedOption = False,
    as_json: JsonOption = False,
) -> None:
    """Does this .waypoints or .plan (anybody's) fly safely in this mission's world?

    The file's name (uav1.plan) or NAME= says which vehicle of the mission it is for.
    """
    from gcsplan import checking, outputs, pipeline
    from gcsplan.console import say_notes, verdict_table

    source = pipeline.load_mission(mission)
    checked = checking.check_files(source, files)
    if as_json:
        verdicts = [outputs.verdict_of(str(c.file), c.verdict) for c in checked]
        emit({"name": source.name, "verdicts": verdicts}, checking.failure(checked, allow_unjudged=allow_unjudged))
    else:
        for c in checked:
            say_notes(c.notes)
            verdict_table(f"{c.file} as {c.vehicle.name}", c.verdict)
    raise typer.Exit(CheckFailed.exit_code if checking.failure(checked, allow_unjudged=allow_unjudged) else 0)
