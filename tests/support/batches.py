"""A folder of missions for a batch: two that can be planned, and two that cannot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml


def mission(**changes: Any) -> str:
    vehicle = {
        "name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 12],
        "start": [47.0, 8.0], "goal": [47.0, 8.02],
    }  # fmt: skip
    whole = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}, "vehicles": [vehicle]}
    return yaml.safe_dump(whole | changes)


def four_missions(folder: Path) -> Path:
    """The folder with four missions: one good, one in a folder, one that is no YAML, one whose start lies in a zone."""
    (folder / "north").mkdir(parents=True)
    (folder / "good.yaml").write_text(mission())
    (folder / "north" / "good.yaml").write_text(mission(name="another"))
    (folder / "north" / "broken.yaml").write_text("version: 1\nvehicles: [\n")
    disc = {"name": "disc", "center": [47.0, 8.0], "radius_m": 200}
    (folder / "shut.yaml").write_text(mission(no_fly=[disc]))
    return folder
