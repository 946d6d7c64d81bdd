"""The files that `plan` writes, as text made from the plan alone: the same plan gives the same bytes."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from gcsplan import __version__
from gcsplan.app.check.verdict_json import arrival_window, extremes, gates_on_way
from gcsplan.app.plan.model import FleetPlan, Plan, VehiclePlan
from gcsplan.app.upload.on_board import settings_of_plan
from gcsplan.arrays import Floats
from gcsplan.check.returns.words import verdict_words
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.errors import InputError
from gcsplan.export.geojson import write_geojson
from gcsplan.export.kml import write_kml
from gcsplan.export.outdir import is_output
from gcsplan.export.profile import write_profile
from gcsplan.export.rows import FlownTrack, ItemRow, WayPoint
from gcsplan.export.summary import document, write_summary
from gcsplan.figures import floored, raised
from gcsplan.fleet.arrival import Slot
from gcsplan.mavlink.files.formats import write_plan, write_waypoints
from gcsplan.mavlink.mission.commands import command_name
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.mission.parameter_file import PARAM_ENDING, param_file
from gcsplan.notes.note import in_json
from gcsplan.plugins import OUTPUTS, failing
from gcsplan.units import METRIC, Units

if TYPE_CHECKING:
    from gcsplan.app.upload.job import JobResult
    from gcsplan.check.difference import PlanDifference
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.world.terrain.geoid import GeoidGrid

Homes: TypeAlias = "Mapping[str, WayHome]"


def outputs_of(
    plan: Plan,
    homes: Homes = MappingProxyType({}),
    fences: Mapping[str, Sequence[MissionItem]] = MappingProxyType({}),
    *,
    rally: bool = False,
) -> dict[str, str]:
    """File name to text of every file in docs/reference/contract.md except the report and the upload.

    ``homes``: vehicle name to its way home if that was judged; the summary then contains it. ``fences``: vehicle name
    to its fence items, for the `.plan`. With ``rally``, the `.plan` also contains the proposed rally points.
    """
    slots, tracks = _slots(plan), _tracks(plan, homes)
    frame, zones = plan.world.frame, plan.world.airspace.zones
    files = {}
    for v in plan.vehicles:
        files[f"{v.name}.waypoints"] = write_waypoints(v.mission)
        points = _rally_items(homes[v.name]) if rally and v.name in homes else ()
        files[f"{v.name}.plan"] = write_plan(
            v.mission, vehicle=v.request.vehicle, fence=fences.get(v.name, ()), rally=points
        )
        if settings := settings_of_plan(v, homes.get(v.name)):
            files[f"{v.name}.{PARAM_ENDING[v.mission.autopilot]}"] = param_file(
                v.name, v.mission.autopilot, v.mission.sysid, settings
            )
    start = None if plan.fleet is None else plan.fleet.start_utc
    files["mission.kml"] = write_kml(plan.source.name, tracks, zones, frame, start)
    files["mission.geojson"] = write_geojson(plan.source.name, tracks, zones, frame)
    files["profile.csv"] = write_profile(
        [row for v in plan.vehicles for row in item_rows(v.name, v.verdict, slots.get(v.name))]
    )
    files["summary.json"] = write_summary(summary_of(plan, homes=homes))
    return files | _added(plan, files)


def _added(plan: Plan, own: Mapping[str, str]) -> dict[str, str]:
    """The files of other packages. Raises InputError for one that cannot stand beside gcsplan's ``own``."""
    files: dict[str, str] = {}
    for name in OUTPUTS.names():
        where, write = f"output {name}", OUTPUTS.get(name)
        assert write is not None
        with failing(where):
            written = write(plan)
            found = dict(written) if isinstance(written, Mapping) else {"": None}
            for text in found.values():
                _ = text.encode() if isinstance(text, str) else b""  # UnicodeEncodeError: half of a character
        for file, text in found.items():
            if not isinstance(file, str) or not isinstance(text, str):
                raise InputError("an output is a mapping from file names to texts", where=where)
            if (
                file != os.path.basename(file)
                or file.startswith(".")
                or is_output(file)
                or file in own
                or file in files
            ):
                raise InputError(f"{file[:80]!r} is no free name for a file of its own in the folder", where=where)
            files[file] = text
    return files


def _slots(plan: Plan) -> dict[str, Slot]:
    return {s.name: s for s in plan.fleet.slots} if plan.fleet is not None else {}


def _tracks(plan: Plan, homes: Homes) -> list[FlownTrack]:
    slots = _slots(plan)
    return [_track(v, plan.source.geoid, slots.get(v.name), homes.get(v.name)) for v in plan.vehicles]


def document_of(plan: Plan) -> dict[str, Any]:
    """The document of ``plan --json`` as plain values."""
    return document(summary_of(plan), clocks=True)


def geojson_of(plan: Plan) -> dict[str, Any]:
    """``mission.geojson`` as plain values."""
    zones, frame = plan.world.airspace.zones, plan.world.frame
    whole: dict[str, Any] = json.loads(write_geojson(plan.source.name, _tracks(plan, {}), zones, frame))
    return whole


def sketch_of(plan: Plan) -> str:
    """Map and table as a fragment of HTML without scripts and styles."""
    from gcsplan.app.output.report import page_of_plan
    from gcsplan.report.views.sketch import sketch_html

    return sketch_html(page_of_plan(plan), [str(verdict_words(v.verdict.safe, None)) for v in plan.vehicles])


def _rally_items(home: WayHome) -> tuple[MissionItem, ...]:
    from gcsplan.check.returns.rally import rally_items

    return rally_items(home.rally)


def report_of(
    plan: Plan, results: Sequence[JobResult] = (), homes: Homes = MappingProxyType({}), units: Units = METRIC,
    differences: Sequence[PlanDifference] = (),
) -> str:  # fmt: skip
    """``report.html``: one page that needs no network."""
    from gcsplan.app.output.report import render

    return render(plan, results, homes, units, differences)


def figures_of(plan: Plan) -> dict[str, bytes]:
    """File name to PNG of each separate figure: map, profiles, and a fleet's time and separation."""
    from gcsplan.app.output.report import page_of_plan
    from gcsplan.report.views import picture

    return picture.figures(page_of_plan(plan))


def picture_of(plan: Plan, form: str = "png") -> bytes:
    """Map and profiles in one picture; ``form``: png, svg or pdf."""
    from gcsplan.app.output.report import page_of_plan
    from gcsplan.report.views import picture

    buffer = io.BytesIO()
    picture.save(page_of_plan(plan), buffer, form)
    return buffer.getvalue()


def upload_text(plan: Plan, results: Sequence[JobResult], homes: Homes = MappingProxyType({})) -> str:
    """``upload.json``: the summary with the clock readings and each vehicle's upload."""
    return write_summary(summary_of(plan, results, homes), clocks=True)


def summary_of(plan: Plan, results: Sequence[JobResult] = (), homes: Homes = MappingProxyType({})) -> dict[str, Any]:
    """The summary of docs/reference/contract.md as plain values, with the clock readings."""
    uploads = {d.vehicle: d for d in results}
    return {
        "name": plan.source.name,
        "gcsplan": __version__,
        "planner": plan.planner,
        "objective": plan.objective,
        "seed": plan.seed,
        "inputs": dict(plan.source.inputs),
        "vehicles": [
            _vehicle(v, plan.fleet, uploads.get(v.name), homes.get(v.name))
            | {"parameters": [s.as_dict() for s in settings_of_plan(v, homes.get(v.name))]}
            for v in plan.vehicles
        ],
        "fleet": _fleet(plan),
        "left_out": [v.as_dict() for v in plan.left_out],
        **in_json("notes", dict.fromkeys(plan.notes)),
    }


def _fleet(plan: Plan) -> dict[str, Any]:
    fleet, arrival = plan.fleet, plan.source.arrival
    several = fleet is not None and len(fleet.slots) > 1
    closest = fleet.closest if fleet is not None else None
    return {
        "mode": fleet.mode if fleet is not None else "none",
        "order": list(fleet.order) if fleet is not None and several else [],
        "min_separation_m": closest.distance_m if closest else None,
        "closest": {"vehicles": list(closest.vehicles), "time_s": closest.time_s} if closest else None,
        "interval_s": fleet.interval_s if fleet is not None and fleet.mode == "sequence" else None,
        "separation_m": arrival.separation_m if arrival is not None and several else None,
        **_fleet_in_wind(fleet),
    }


def _fleet_in_wind(fleet: FleetPlan | None) -> dict[str, Any]:
    """Whether the time table holds in every declared wind, and the intervals between arrivals; empty in still air with
    departures on time."""
    if fleet is None or len(fleet.slots) < 2 or (fleet.in_every_wind is None and not fleet.intervals):
        return {}
    held = {} if fleet.in_every_wind is None else {"in_every_wind": fleet.in_every_wind}
    return held | {"intervals": [asdict(one) for one in fleet.intervals]}


def _vehicle(
    v: VehiclePlan, fleet: FleetPlan | None, result: JobResult | None, home: WayHome | None
) -> dict[str, Any]:  # fmt: skip
    slot = None if fleet is None else fleet.slot(v.name)
    verdict = v.verdict
    lowest = verdict.lowest
    objective = v.problem.objective
    bound = v.solution.lower_bound
    return {
        "name": v.name,
        "items": len(v.mission.wire_items()),
        "length_m": verdict.length_m,
        "lower_bound_m": bound if objective == "length" else None,
        "gap_percent": v.gap_percent,
        "energy_j": verdict.reported_j(verdict.path_energy_j),
        "lower_bound_j": bound if objective == "energy" else None,
        **({"path_time_s": v.cost, "lower_bound_s": bound} if objective == "time" else {}),
        "flight_energy_j": verdict.reported_j(verdict.energy_j),
        "energy_figures": verdict.energy_figures,
        "battery_used_percent": verdict.battery_used_percent,
        "min_agl_m": lowest.min_agl_m if lowest else None,
        "min_agl_at": {"leg": lowest.seq, "lat": lowest.min_agl_at[0], "lon": lowest.min_agl_at[1]} if lowest else None,
        **extremes(verdict),
        "speed_m_s": v.speed_m_s,
        "depart_s": slot.depart_s if slot else 0.0,
        "arrive_s": slot.arrive_s if slot else verdict.arrive_s,
        **arrival_window(verdict, slot),
        **gates_on_way(verdict, slot),
        "planning_s": v.solution.planning_s,
        "first_path_s": v.solution.first_path_s,
        "stopped_by": v.solution.stopped_by,
        "search": [asdict(step) for step in v.solution.search],
        "safe": verdict.safe,
        **in_json("not_judged", verdict.not_judged),
        "hold_s": slot.hold_s if slot else 0.0,
        **in_json("notes", v.all_notes(fleet)),
        "upload": result.as_dict() if result else None,
        "verdict": str(verdict_words(verdict.safe, home)),
    } | _of_search(v) | ({} if home is None else {"way_home": home.as_dict()})  # fmt: skip


def _of_search(v: VehiclePlan) -> dict[str, Any]:
    """The result of a sampling search before its repair; empty for other planners."""
    if v.solution.raw_violations is None:
        return {}
    return {"raw_violations": v.solution.raw_violations, "repaired": v.solution.repaired}


def item_rows(vehicle: str, verdict: Verdict, slot: Slot | None = None) -> list[ItemRow]:
    """One row per wire item, with the figures of all stretches that are flown for it.

    Times count from the fleet's common start if ``slot`` is there; otherwise from leaving the ground.
    """
    depart_s = 0.0 if slot is None else slot.depart_s
    flown: dict[int, list[LegFigures]] = {}
    until: dict[int, float] = {}
    window: dict[int, tuple[float | None, float | None]] = {}
    windows = verdict.leg_windows_s(slot)
    for i, (leg, clock_s) in enumerate(zip(verdict.legs, verdict.clock_s(slot), strict=True)):
        flown.setdefault(leg.seq, []).append(leg)
        until[leg.seq] = depart_s + clock_s
        if windows is not None:
            window[leg.seq] = depart_s + windows[i][0], depart_s + windows[i][1]
    home = verdict.legs[0].start if verdict.legs else None
    rows, spent_j = [], 0.0
    for seq, item in enumerate(verdict.mission.wire_items()):
        name = command_name(item.command)
        legs = flown.get(seq)
        if not legs:
            at_home = seq == 0 and verdict.mission.first_seq == 1 and home is not None
            place = home if at_home and home else (None, None, None)
            rows.append(ItemRow(vehicle, seq, name, place[0], place[1], place[2], 0.0 if at_home else None))
            continue
        energy_j = math.fsum(leg.energy_j for leg in legs)
        spent_j += energy_j
        low = [leg.min_agl_m for leg in legs if not leg.column and not math.isnan(leg.min_agl_m)]
        steep = max((leg.climb_deg for leg in legs), key=abs)
        lat, lon, amsl = legs[-1].end
        rows.append(
            ItemRow(
                vehicle, seq, name, lat, lon, amsl, legs[-1].agl_end_m, min(low) if low else None,
                math.fsum(leg.length_m for leg in legs), steep, verdict.reported_j(energy_j),
                verdict.reported_j(spent_j), until[seq], *window.get(seq, (None, None)),
            )
        )  # fmt: skip
    return rows


def _track(v: VehiclePlan, geoid: GeoidGrid | None, slot: Slot | None, returns: WayHome | None) -> FlownTrack:
    legs = v.verdict.legs
    places = np.array([legs[0].start, *(leg.end for leg in legs)])
    commands = {seq: command_name(item.command) for seq, item in enumerate(v.mission.wire_items())}
    above = [None] * len(places) if geoid is None else geoid.height_m(places[:, 0], places[:, 1]).tolist()
    reached, left = _times(v.verdict, slot)
    home = 0 if v.verdict.mission.first_seq == 1 else None
    command = None if home is None else commands[0]
    points: list[WayPoint | None] = [WayPoint("home", home, command, 0.0, above[0], float(left[0]))]
    for i, leg in enumerate(legs):
        goes_on = i + 1 < len(legs) and legs[i + 1].seq == leg.seq  # on a circle, or down a column
        name = f"{leg.seq} {commands.get(leg.seq, '')}".strip()
        point = WayPoint(name, leg.seq, commands.get(leg.seq), leg.agl_end_m, above[i + 1], float(left[i + 1]))
        points.append(None if goes_on else point)
    words = _described(v.verdict, returns)
    return FlownTrack(v.name, places[:, 0], places[:, 1], places[:, 2], tuple(points), reached, left, words)


def _described(verdict: Verdict, home: WayHome | None) -> str:
    """The description of a track in a viewer: the verdict, and how low and how high above ground it is."""
    lowest, highest = verdict.lowest, verdict.highest
    words = [str(verdict_words(verdict.safe, home))]
    if lowest is not None:
        words.append(f"lowest {floored(lowest.min_agl_m, 1):.1f} m above ground")
    if highest is not None:
        words.append(f"highest {raised(highest.max_agl_m, 1):.1f} m above ground")
    return ", ".join(words)


def _times(verdict: Verdict, slot: Slot | None) -> tuple[Floats, Floats]:
    """(N + 1,) when the vehicle comes to home and to the end of each of N legs, and when it goes on, as in `item_rows`.

    The rounds of a jump come one after the other, so a planned mission, which has none, is what these are for.
    """
    depart_s = 0.0 if slot is None else slot.depart_s
    left = depart_s + np.array([0.0, *verdict.clock_s(slot)])
    flying = [leg.time_s * leg.times - (leg.hold_s if math.isfinite(leg.hold_s) else 0.0) for leg in verdict.legs]
    return np.append(left[0], np.minimum(left[1:], left[:-1] + flying)), left
