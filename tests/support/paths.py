"""Folders of files that tests read."""

from __future__ import annotations

from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
MISSIONS = REPOSITORY / "missions"
DATA = REPOSITORY / "tests" / "data"
