"""What the page is sent of steps: a look at vehicles, an upload and its end, live vehicles, missions on board."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gcsplan.app.output.handout import Handout
from gcsplan.app.plan.earlier import EarlierMission, differences
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.app.upload.on_board import settings_of
from gcsplan.check.judge import judge
from gcsplan.check.returns.words import verdict_words
from gcsplan.errors import GcsplanError
from gcsplan.mavlink.mission.autopilots import sent_for
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_list import off
from gcsplan.notes.note import Note, Wording
from gcsplan.page.answers import flown_line
from gcsplan.page.steps.live_vehicles import is_silent
from gcsplan.units import Quantity, Units

if TYPE_CHECKING:
    from gcsplan.app.upload.job import JobResult, UploadJob
    from gcsplan.mavlink.link.session.jobs import Readied
    from gcsplan.mavlink.link.watch import VehicleState

WIND_BEYOND = "wind_not_as_declared"
WIND_NOTES = (WIND_BEYOND, "wind_as_declared", "wind_not_estimated")
ON_BOARD = "the mission on board"
MOST_NOTES, MOST_PARAMETERS = 50, 60
"""Most notes, and most parameters, of one vehicle."""


def look_of(handed: Handout, job: UploadJob, seen: Readied | GcsplanError, units: Units) -> dict[str, Any]:
    """One vehicle of the dialogue: its link, the verdict, what an upload would meet, and what is on board."""
    wording = Wording(units)
    plan = next(v for v in handed.plan.vehicles if v.name == job.name)
    found = {
        "name": job.name, "url": job.url, "items": len(job.mission.wire_items()),
        "verdict": verdict_words(plan.verdict.safe, handed.homes.get(job.name)).text(wording),
        "safe": plan.verdict.safe is True, "notes": [], "parameters": _parameters(job, {}, wording),
    }  # fmt: skip
    if isinstance(seen, GcsplanError):
        return found | {"found": False, "against": str(seen), "what": "", "on_board": None, "wind": "", "beyond": False}
    against = "" if seen.against is None else str(seen.against)
    wind = next((note for note in seen.warnings if note.code in WIND_NOTES), None)
    in_table = ("parameter_not_assumed", *WIND_NOTES)
    notes = [note.text(wording) for note in dict.fromkeys(seen.warnings) if note.code not in in_table]
    return found | {
        "wind": "" if wind is None else wind.text(wording), "beyond": wind is not None and wind.code == WIND_BEYOND,
        "found": True, "what": "" if seen.state is None else seen.state.what, "against": against,
        "notes": notes[:MOST_NOTES], "parameters": _parameters(job, seen.values, wording),
        "on_board": None if seen.mission is None else on_board_of(handed.plan, plan, seen.mission, units),
    }  # fmt: skip


def _parameters(job: UploadJob, values: Mapping[str, float], wording: Wording) -> list[dict[str, Any]]:
    """The parameters that the proof assumes; ``off``: why the value on board is not within its rule."""
    settings = settings_of(job)
    wrong = {o.setting.parameter.key: o.note().text(wording) for o in off(settings, values, job.mission.autopilot)}
    rows = []
    for setting in settings:
        name = setting.parameter.on_board(values) or setting.parameter.names[0]
        rows.append({
            "name": name.name, "value": f"{name.value(setting.value):.6g}", "rule": setting.rule,
            "on_board": f"{values[name.name]:.6g}" if name.name in values else "",
            "why": setting.why.text(wording), "off": wrong.get(setting.parameter.key, ""),
        })  # fmt: skip
    rows.sort(key=lambda row: not row["off"])
    return rows[:MOST_PARAMETERS]


def on_board_of(plan: Plan, v: VehiclePlan, mission: Mission, units: Units) -> dict[str, Any]:
    """The mission on board beside the plan: its line, its verdict in the plan's world, and the difference in words."""
    if not mission.items:
        return {"line": [], "verdict": "", "headline": "there is no mission on board", "rows": [], "remarks": []}
    wording = Wording(units)
    verdict = judge(
        replace(sent_for(mission), leaves_s=v.mission.leaves_s), v.request.vehicle, plan.world,
        rtl_rel_home_m=v.request.rtl_rel_home_m,
        terrain_error_m=plan.source.terrain_error_m, wind=plan.source.flight_wind(v.request),
    )  # fmt: skip
    [difference] = differences(plan, {v.name: EarlierMission(ON_BOARD, mission)}).values()
    return {
        "line": flown_line(verdict), "verdict": verdict_words(verdict.safe, None).text(wording),
        "headline": difference.headline.text(wording), "rows": difference.rows(units),
        "remarks": [note.text(wording) for note in difference.remarks()[:MOST_NOTES]],
    }  # fmt: skip


def result_of(result: JobResult, units: Units) -> dict[str, Any]:
    """How the upload of one vehicle ended, as in ``--json``, with its notes in the user's units."""
    wording = Wording(units)
    notes = [note.text(wording) for note in dict.fromkeys(result.warnings)]
    keys = ("url", "outcome", "verified", "simulated", "items", "seconds", "retries")
    done = result.as_dict()
    return {
        "name": result.vehicle, **{key: done[key] for key in keys}, "message": result.message, "code": result.code,
        "notes": notes[:MOST_NOTES],
    }  # fmt: skip


def live_of(
    name: str, number: int, url: str, state: VehicleState | None, age_s: float, beside: Note | None, units: Units
) -> dict[str, Any]:
    """One vehicle as it is heard now."""
    found: dict[str, Any] = {"name": name, "vehicle": number, "url": url, "heard": state is not None}
    if state is None:
        return found | {"at": None, "text": "nothing is heard yet", "silent": True, "armed": False, "wind": ""}
    wording, words = Wording(units), [state.what, "armed" if state.armed else "disarmed"]
    if state.amsl_m is not None:
        words.append(f"{Quantity(state.amsl_m, 'height', 0).text(units)} AMSL")
    silent = is_silent(age_s)
    if silent:
        words.append(f"silent for {age_s:.0f} s")
    wind = "" if beside is None else beside.text(wording)
    if state.wind is not None and beside is None:
        speed = Quantity(state.wind.speed_m_s, "speed", 1).text(units)
        wind = f"the vehicle estimates a wind of {speed} from {state.wind.from_deg:.0f}°"
    at = [state.lat_deg, state.lon_deg] if state.located else None
    return found | {
        "at": at, "text": ", ".join(words), "silent": silent, "armed": state.armed, "wind": wind,
        "beyond": beside is not None and beside.code == WIND_BEYOND,
    }  # fmt: skip
