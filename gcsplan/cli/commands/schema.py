"""`gcsplan schema`."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from gcsplan.cli.process.exit import put
from gcsplan.errors import UsageError


def schema(
    of: Annotated[
        str, typer.Argument(metavar="WHAT", help="mission, or a form of output: plan, check, document.")
    ] = "mission",
) -> None:
    """Print the JSON Schema of a mission file, by which editors complete and check keys, or of an output.

    Save it beside the mission:    gcsplan schema > gcsplan.schema.json

    and let the mission begin with:    # yaml-language-server: $schema=gcsplan.schema.json

    The forms of output: `plan` is that of summary.json, upload.json and plan --json, `check` that of check --json,
    and `document` holds for the --json of every command.
    """
    from gcsplan.export.output_schema import FORMS, output_schema
    from gcsplan.mission_file.json_schema import mission_schema

    if of != "mission" and of not in FORMS:
        raise UsageError(f"schema {of}: give one of mission, {', '.join(FORMS)}")
    put(json.dumps(mission_schema() if of == "mission" else output_schema(of), indent=1) + "\n")
