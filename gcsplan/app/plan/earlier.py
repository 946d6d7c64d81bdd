"""Earlier missions of a plan's vehicles, in its folder or on board, and the difference of the new plan to them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.check.difference import PlanDifference, figures_of, moved_legs
from gcsplan.check.judge import judge
from gcsplan.errors import InputError
from gcsplan.export.outdir import outputs_in
from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.notes.note import Note, note_of

MOST_SUMMARY_BYTES = 100_000_000
LAST_PLAN = "the last plan"


@dataclass(frozen=True, slots=True)
class EarlierMission:
    """A mission that a vehicle had before; ``since`` names it.

    ``arrive_s`` and ``notes`` are those that its plan gave it, None where no plan of it is known.
    """

    since: str
    mission: Mission
    arrive_s: float | None = None
    notes: Sequence[Note] | None = None


def last_plan(source: MissionFile, directory: Path) -> tuple[dict[str, EarlierMission], list[Note]]:
    """The missions of the last plan in ``directory`` by vehicle, and a note on each that cannot be read."""
    files = set(outputs_in(directory))
    rows = _rows(directory / "summary.json") if "summary.json" in files else {}
    found: dict[str, EarlierMission] = {}
    notes: list[Note] = []
    for request in source.vehicles:
        file = f"{request.vehicle.name}.waypoints"
        if file not in files:
            continue
        try:
            read = read_mission_file(directory / file, autopilot=request.vehicle.autopilot, home_hint=_start(request))
        except InputError as why:
            notes.append(Note("last_plan_unread", vehicle=request.vehicle.name, why=str(why)))
            continue
        row = rows.get(request.vehicle.name, {})
        noted = [note for data in row.get("notes_data", []) if (note := note_of(data)) is not None]
        found[request.vehicle.name] = EarlierMission(
            LAST_PLAN, read.mission, row.get("arrive_s"), noted if row else None
        )
    return found, notes


def differences(plan: Plan, earlier: Mapping[str, EarlierMission]) -> dict[str, PlanDifference]:
    """The difference of each vehicle of ``plan`` to its earlier mission, if it has one."""
    return {v.name: _difference(plan, v, earlier[v.name]) for v in plan.vehicles if v.name in earlier}


def _difference(plan: Plan, v: VehiclePlan, earlier: EarlierMission) -> PlanDifference:
    """The earlier mission is judged anew, in the plan's own world and for its vehicle."""
    request, source = v.request, plan.source
    before = judge(
        earlier.mission, request.vehicle, plan.world, rtl_rel_home_m=request.rtl_rel_home_m,
        terrain_error_m=source.terrain_error_m, wind=source.flight_wind(request),
    )  # fmt: skip
    slot = None if plan.fleet is None else plan.fleet.slot(v.name)
    if earlier.notes is None:
        now, was = v.verdict.notes, before.notes
    else:
        now, was = v.all_notes(plan.fleet), tuple(earlier.notes)
    moved, left_m = moved_legs(before, v.verdict, plan.world.frame)
    equal = not faults(compare(v.mission.wire_items(), earlier.mission.wire_items(), v.mission.autopilot))
    timed = slot is not None and earlier.arrive_s is not None
    return PlanDifference(
        v.name, earlier.since, equal, len(v.verdict.legs), moved, left_m, figures_of(before, earlier.arrive_s),
        figures_of(v.verdict, slot.arrive_s if slot is not None and timed else None),
        _lacking(now, was), _lacking(was, now), tuple(f.note for f in before.findings) + before.not_judged,
    )  # fmt: skip


def _lacking(notes: Sequence[Note], others: Sequence[Note]) -> tuple[Note, ...]:
    """The notes that are not among the others, whatever item they are on: items are counted anew in each mission."""
    known = {note.of_no_item() for note in others}
    return tuple(note for note in notes if note.of_no_item() not in known)


def _rows(file: Path) -> dict[str, dict[str, Any]]:
    """The vehicles of a summary by name; none if it is not one."""
    try:
        if file.stat().st_size > MOST_SUMMARY_BYTES:
            return {}
        vehicles = json.loads(file.read_text(encoding="utf-8"))["vehicles"]
        return {row["name"]: row for row in vehicles}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _start(request: VehicleRequest) -> Home:
    return Home.at(*request.start_deg, request.start[2])
