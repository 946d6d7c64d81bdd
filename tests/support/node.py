"""The page's scripts in Node, without a browser: what they compute, not what they draw."""

from __future__ import annotations

import json
import shutil
import subprocess
from importlib import resources
from typing import Any

from gcsplan.units import METRIC

PROGRAM = shutil.which("node")
ANSWER_S = 30.0
GRID = {
    "box": [0, 0, 1, 1],
    "heights": "",
    "cols": 0,
    "rows": 0,
    "base": 0,
    "step": 1,
    "lat": [],
    "lon": [],
    "lattice": 0,
}
PAGE = f"""
const window = {{ addEventListener() {{}} }};
const found = {json.dumps(json.dumps({"grid": GRID, "lines": [], "units": METRIC.as_dict()}))};
const document = {{ getElementById: () => ({{ textContent: found }}) }};
"""
"""The page that `base.js` finds: no figure, no ground, no vehicle."""


def ask(assets: tuple[str, ...], expression: str, given: object = None) -> Any:
    """The value of a JavaScript expression after ``assets``; it may use ``given``."""
    assert PROGRAM is not None
    folder = resources.files("gcsplan.report").joinpath("assets")
    parts = [folder.joinpath(name).read_text(encoding="utf-8") for name in assets]
    text = f"'use strict';\nconst given = {json.dumps(given)};\n{PAGE}\n" + "\n".join(parts)
    text += f"\nprocess.stdout.write(JSON.stringify({expression}));\n"
    done = subprocess.run([PROGRAM, "-"], input=text, capture_output=True, text=True, timeout=ANSWER_S, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
