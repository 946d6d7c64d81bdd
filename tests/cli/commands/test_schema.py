"""`gcsplan schema`."""

from __future__ import annotations

import json
from typing import Any

from gcsplan.mission_file.json_schema import mission_schema


def test_schema_prints_the_json_schema_in_plain_ascii(run: Any) -> None:
    code, out, err = run("schema")
    assert (code, err) == (0, "")
    assert out.isascii()
    assert json.loads(out) == mission_schema()
