"""`gcsplan schema`."""

from __future__ import annotations

import json

from gcsplan.cli.process.exit import put


def schema() -> None:
    """Print the JSON Schema of a mission file, by which editors complete and check keys.

    Save it beside the mission:    gcsplan schema > gcsplan.schema.json

    and let the mission begin with:    # yaml-language-server: $schema=gcsplan.schema.json
    """
    from gcsplan.mission_file.json_schema import mission_schema

    put(json.dumps(mission_schema(), indent=1) + "\n")
