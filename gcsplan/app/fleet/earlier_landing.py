"""An earlier landing as a change for the way home: tried where nothing else makes every return safe.

A trial plans the changed mission anew and judges its way home, so it costs as much as the plan itself. It is made for a
single vehicle only: in a fleet an earlier landing changes all arrivals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.plan.way_home import first_unsafe_m, homes_of
from gcsplan.check.motion.stretch import on_globe, place_on
from gcsplan.check.returns.proposal import ReturnProposal, best_first
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.verdict import LegFigures
from gcsplan.errors import GcsplanError
from gcsplan.mission_file.changes import MissionChange, changed
from gcsplan.mission_file.load import load_content
from gcsplan.mission_file.request import Content
from gcsplan.notes.note import Note

PARTS = (0.97, 0.8, 0.5)
"""Parts of the way to the first point without a safe return, where a landing is tried."""
LEAST_WAY_M = 200.0
"""The shortest way, m, that is worth a landing of its own."""


def best_changes(homes: Mapping[str, WayHome]) -> list[MissionChange]:
    """The best change for each way home that has one, as `--apply` makes them."""
    best = {name: _by_keys(home) for name, home in homes.items()}
    return [
        MissionChange("--apply", "vehicle", key, list(value) if isinstance(value, tuple) else value, name)
        for name, proposal in best.items()
        for key, value in (proposal.keys if proposal is not None else ())
    ]


def _by_keys(home: WayHome) -> ReturnProposal | None:
    """The best change that keys of the mission file make alone, without rally points on board."""
    return next((proposal for proposal in home.proposals if not proposal.rally), None)


def with_earlier_landing(planned: Plan, homes: Mapping[str, WayHome]) -> dict[str, WayHome]:
    """``homes``, with an earlier landing proposed to a single vehicle whose return stays unsafe in part."""
    content = planned.source.content
    if len(planned.vehicles) != 1 or content is None:
        return dict(homes)
    [v] = planned.vehicles
    home = homes.get(v.name)
    if home is None or home.safe is not False or v.request.end != "land" or not all(p.leaves_m for p in home.proposals):
        return dict(homes)
    best = _by_keys(home)  # trials are judged without rally points
    keys = () if best is None else best.keys
    bad_m = first_unsafe_m(home) if best is None else best.first_m
    if bad_m is None:
        there = _tried(planned, content, keys)
        bad_m = math.inf if there is None else first_unsafe_m(there)
    if math.isinf(bad_m):
        return dict(homes)
    whole_m = sum(leg.horizontal_m for leg in v.verdict.legs)
    for part in PARTS:
        at_m = part * bad_m
        if at_m < LEAST_WAY_M:
            break
        goal = _place(v.verdict.legs, at_m)
        tried = _tried(planned, content, (*keys, ("goal", goal), ("via", ())))
        if tried is not None and tried.safe is True:
            change = None if best is None else Note("and_that", change=best.change)
            note = Note("land_earlier", lat=goal[0], lon=goal[1], before_m=whole_m - at_m, with_change=change)
            above = best is not None and best.above_max_agl
            found = ReturnProposal(note, 0.0, (*keys, ("goal", goal), ("via", ())), above, shortens=True)
            return {**homes, v.name: replace(home, proposals=best_first([*home.proposals, found]))}
    return dict(homes)


def _tried(planned: Plan, content: Content, keys: Sequence[tuple[str, Any]]) -> WayHome | None:
    """The way home of the mission with these keys of its vehicle, planned anew; None if there is no such mission."""
    changes = [MissionChange("", "vehicle", key, list(v) if isinstance(v, tuple) else v) for key, v in keys]
    raw = changed(content.given, changes, Path(content.file).parent).raw
    try:
        source = load_content(replace(content, given=raw))
        again = plan(source, planner=planned.planner, objective=planned.objective, seed=planned.seed)
    except GcsplanError:
        return None
    [v] = again.vehicles
    return None if v.verdict.safe is not True else homes_of(again)[v.name]


def _place(legs: Sequence[LegFigures], at_m: float) -> tuple[float, float]:
    """The place, in degrees to seven decimals, that is ``at_m`` horizontal metres along the mission."""
    gone_m = 0.0
    for leg in legs:
        if leg.horizontal_m > 0.0 and gone_m + leg.horizontal_m >= at_m:
            part = (at_m - gone_m) / leg.horizontal_m
            lat, lon, _ = on_globe(place_on(leg.start, leg.end, part))
            return round(lat, 7), round(lon, 7)
        gone_m += leg.horizontal_m
    return round(legs[-1].end[0], 7), round(legs[-1].end[1], 7)
