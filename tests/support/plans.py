"""Missions of every kind, planned, written and flown once for each process of the tests; and the tables of a report."""

from __future__ import annotations

import html
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of, report_of
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import Rehearsal, rehearse
from gcsplan.mission_file import load_mission
from tests.support.paths import MISSIONS


def _craft(name: str, sysid: int, **more: Any) -> dict[str, Any]:
    energy = {"vertical_j_per_m": 120, "horizontal_j_per_m": 100}
    return {"name": name, "sysid": sysid, "autopilot": "arducopter", "speed_m_s": [3, 10], "energy": energy} | more


FLAT: dict[str, Any] = {
    "version": 1, "name": "times", "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "terrain": {"flat_m": 0},
    "limits": {"min_agl_m": 40, "max_climb_deg": 30},
}  # fmt: skip
MOTION = {"climb_m_s": 2.5, "descent_m_s": 1.5, "accel_m_s2": 1.5, "leg_jerk_m_s3": 1.0, "corner_accel_m_s2": 2.5}
VALLEY: dict[str, Any] = {
    "version": 1, "name": "valley", "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
    "limits": {"min_agl_m": 60, "horizontal_clearance_m": 30, "track_error_m": 3, "altitude_error_m": 5,
               "max_climb_deg": 15},
}  # fmt: skip
UP = {"start": [36.6175, -84.3892], "goal": [36.6250, -84.3800]}

CASES: dict[str, Any] = {
    "jacksboro": MISSIONS / "jacksboro.yaml",
    "jacksboro-wing": MISSIONS / "jacksboro-wing.yaml",
    "fleet-4": MISSIONS / "fleet-4.yaml",
    "a hold at the gate": FLAT | {
        "vehicles": [
            _craft("west", 1, start={"east_m": -500, "north_m": 0}, goal={"east_m": 500, "north_m": 0}, **MOTION),
            _craft("south", 2, start={"east_m": 0, "north_m": -500}, goal={"east_m": 0, "north_m": 500}, **MOTION,
                   energy={"hover_w": 400}),
        ],
        "arrival": {"mode": "sequence", "order": ["west", "south"], "interval_s": 300, "separation_m": 30,
                    "hold": "gate"},
    },
    "one that leaves later": FLAT | {
        "vehicles": [
            _craft("late", 1, start={"east_m": 0, "north_m": 0}, goal={"east_m": 300, "north_m": 0},
                   via=[{"east_m": 150, "north_m": 60}], **MOTION),
        ],
        "arrival": {"mode": "together", "arrive_s": 400, "separation_m": 30},
    },
    "terrain frame and return": VALLEY | {
        "vehicles": [_craft("over", 1, end="rtl", rtl_rel_home_m=300, max_climb_deg=60, **UP)],
        "altitude_frame": "terrain",
    },
    "px4 that stays": VALLEY | {"vehicles": [_craft("px4", 1, autopilot="px4", end="loiter", **UP)]},
    "a wing slower than it can": FLAT | {
        "limits": {"min_agl_m": 40, "max_climb_deg": 10, "track_error_m": 10},
        "vehicles": [
            _craft("wing", 1, autopilot="arduplane", speed_m_s=[12, 20], turn_radius_m=100, end="land",
                   start={"east_m": 0, "north_m": 0}, goal={"east_m": 3000, "north_m": 0},
                   via=[{"east_m": 1500, "north_m": 800}]),
        ],
        "arrival": {"mode": "together", "arrive_s": 260, "separation_m": 30},
    },
    "a wing that returns": FLAT | {
        "limits": {"min_agl_m": 40, "max_climb_deg": 10, "track_error_m": 10},
        "vehicles": [
            _craft("back", 1, autopilot="arduplane", speed_m_s=[12, 20], turn_radius_m=100, end="rtl",
                   rtl_rel_home_m=150, start={"east_m": 0, "north_m": 0}, goal={"east_m": 3000, "north_m": 0}),
        ],
    },
    "jacksboro-high": MISSIONS / "jacksboro-high.yaml",
    "one leg": {
        "version": 1, "name": "one leg", "terrain": {"flat_m": 300}, "limits": {"min_agl_m": 30},
        "vehicles": [
            {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [47.0, 8.0], "goal": [47.002, 8.0],
             "energy": {"vertical_j_per_m": 120}},
        ],
    },
    "below 120 m": FLAT | {
        "limits": {"min_agl_m": 40, "max_agl_m": 120, "max_climb_deg": 30, "track_error_m": 3, "altitude_error_m": 5},
        "no_fly": [
            {"name": "works", "center": {"east_m": 500, "north_m": 20}, "radius_m": 90, "ceiling_agl_m": 60},
            {"name": "hospital", "center": {"east_m": 900, "north_m": -40}, "radius_m": 100},
        ],
        "vehicles": [
            _craft("copter", 1, start={"east_m": 0, "north_m": 0}, goal={"east_m": 1400, "north_m": 0}, **MOTION,
                   energy={"battery_wh": 90, "battery_v": 22.2}),
        ],
    },
    "a paper's": MISSIONS / "papers" / "ib-abc-sequence.yaml",
}  # fmt: skip

SLOW = {"fleet-4", "a paper's"}
FLOWN_LONG = {*SLOW, "jacksboro", "jacksboro-high"}
"""Cases whose rehearsal takes seconds."""


@cache
def planned(case: str) -> tuple[Any, Plan]:
    mission = CASES[case]
    text = None if isinstance(mission, Path) else yaml.safe_dump(mission)
    source = load_mission(mission if isinstance(mission, Path) else "times.yaml", text=text)
    return source, plan(source)


@cache
def written(case: str) -> dict[str, str]:
    """The files of the plan of a case, by name."""
    return outputs_of(planned(case)[1])


@cache
def reported(case: str) -> str:
    """The page of the plan of a case."""
    return report_of(planned(case)[1])


@cache
def flown(case: str) -> Rehearsal:
    """The rehearsal of the plan of a case: one run without wind."""
    return rehearse(planned(case)[1])


cases = pytest.mark.parametrize(
    "case", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in CASES]
)


def text_rows(page: str, title: str) -> list[list[str]]:
    """The cells of each row of the table with ``title``, as text."""
    table = page[page.index(f"<caption>{title}") :].split("</table>")[0]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", table, re.DOTALL)
    cells = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row, re.DOTALL) for row in rows]
    return [[html.unescape(re.sub(r"<[^>]+>", "", cell)) for cell in row] for row in cells[1:]]
