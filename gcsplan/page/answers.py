"""What the page is sent of a plan: paths and bounds while it is made, its certificate, the way home, or the refusal."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.app.plan.way_home import is_required, lets_fly
from gcsplan.app.session import BetterPath
from gcsplan.arrays import Floats
from gcsplan.check.returns.verdict import WayHome
from gcsplan.check.returns.words import listed, verdict_words
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.errors import GcsplanError, InputError, NoMission
from gcsplan.notes.note import Note, Wording
from gcsplan.page.fleet.crew_changes import attempts
from gcsplan.page.fleet.time_table import numbers_of, time_table
from gcsplan.page.form import cure_changes
from gcsplan.page.history import EditedDocument
from gcsplan.planners.problem import gap_percent
from gcsplan.report.parts.track_samples import TrackLine, line_of
from gcsplan.units import Joules, Quantity, Seconds, Units, in_units
from gcsplan.world.geodesy.frame import Frame

PROFILE_SAMPLES = 400
"""Samples of a profile; a few more if there are many legs."""

MOST_PROFILES = 12
"""Most vehicles of a plan whose profiles are all sent; of more, the chosen one's alone: the page draws one."""

MOST_ON_PAGE = 50
"""Most findings and most notes of one vehicle."""

PLACE_DECIMALS, HEIGHT_DECIMALS = 7, 2


def path_answer(n: int, vehicle: int, found: BetterPath, *, live: bool, first: bool) -> dict[str, Any]:
    """A path that the planner found, not judged yet."""
    return {
        "type": "path", "n": n, "live": live, "vehicle": vehicle,
        "line": _line(found.lat_deg, found.lon_deg, found.amsl_m), "cost": found.cost, "bound": found.lower_bound,
        "gap_percent": gap_percent(found.cost, found.lower_bound), "first": first,
        "elapsed_ms": round(found.elapsed_s * 1e3, 1),
    }  # fmt: skip


def bound_answer(n: int, vehicle: int, bound: float, cost: float | None) -> dict[str, Any]:
    """A higher lower bound; the gap to the best path so far."""
    return {"type": "bound", "n": n, "vehicle": vehicle, "bound": bound, "gap_percent": gap_percent(cost, bound)}


def plan_answer(
    n: int, plan: Plan, homes: Mapping[str, WayHome], units: Units, elapsed_s: float, chosen: int = 0
) -> dict[str, Any]:
    """The judged mission: the certificate of each vehicle, its figures, its profile (of many, the ``chosen`` one's)."""
    wording = Wording(units)
    verdicts = [_flies(v, plan, homes.get(v.name)) for v in plan.vehicles]
    safe = False if False in verdicts else None if None in verdicts or plan.left_out else True
    notes, numbers = [note.text(wording) for note in dict.fromkeys(plan.notes)], numbers_of(plan)
    return {
        "type": "plan", "n": n, "verdict": verdict_word(safe), "headline": _headline(plan, homes, wording),
        "elapsed_ms": round(elapsed_s * 1e3, 1),
        "vehicles": [
            _vehicle(k, v, plan, homes.get(v.name), units,
                     with_profile=k == chosen or len(plan.vehicles) <= MOST_PROFILES)
            for v in plan.vehicles for k in (numbers[v.name],)
        ],
        "fleet": time_table(plan, units),
        "left_out": [{"name": left.name, "message": left.message} for left in plan.left_out],
        "notes": notes[:MOST_ON_PAGE],
    }  # fmt: skip


def verdict_word(safe: bool | None) -> str:
    """The protocol's word for a verdict."""
    return {True: "safe", False: "violations", None: "not judged"}[safe]


def _flies(v: VehiclePlan, plan: Plan, home: WayHome | None) -> bool | None:
    """Whether a mission may fly, as every command decides it: a required way home counts, too."""
    if v.verdict.safe is True and not lets_fly(home, required=is_required(plan.source, option=False)):
        return None if home is None else home.safe
    return v.verdict.safe


class _Returns(NamedTuple):
    """The ways home of several vehicles with the same verdict, and the metres without a safe return of all."""

    safe: bool | None
    no_return_m: float


def _headline(plan: Plan, homes: Mapping[str, WayHome], wording: Wording) -> str:
    """The verdict of the only vehicle, or of each; of many how many have the same, the worst first."""
    if len(plan.vehicles) <= MOST_PROFILES:
        words = [(v.name, verdict_words(v.verdict.safe, homes.get(v.name)).text(wording)) for v in plan.vehicles]
        return words[0][1] if len(words) == 1 else "; ".join(f"{name}: {text}" for name, text in words)
    found = defaultdict[tuple[bool | None, bool | None], list[float]](list)
    for v in plan.vehicles:
        home = homes.get(v.name)
        found[v.verdict.safe, None if home is None else home.safe].append(0.0 if home is None else home.no_return_m)
    some = sorted(found.items(), key=lambda one: [value is True for value in one[0]])
    return listed(
        Note("verdict_of_some", count=len(each_m), verdict=verdict_words(path, _Returns(home_safe, sum(each_m))))
        for (path, home_safe), each_m in some
    ).text(wording)


def profile_answer(n: int, plan: Plan, vehicle: int) -> dict[str, Any] | None:
    """The profile of one vehicle of many, once it is chosen; None if it came with the plan, or does not fly."""
    v = next((v for v in plan.vehicles if numbers_of(plan)[v.name] == vehicle), None)
    if v is None or len(plan.vehicles) <= MOST_PROFILES:
        return None
    line = _line_of(v, plan)
    profile = None if line is None else profile_of(line, plan.world.frame)
    return {"type": "profile", "n": n, "vehicle": vehicle, "profile": profile}


def _line_of(v: VehiclePlan, plan: Plan) -> TrackLine | None:
    return line_of(v.verdict, plan.world, v.request.vehicle.limits, samples=PROFILE_SAMPLES)


def _vehicle(
    number: int, v: VehiclePlan, plan: Plan, home: WayHome | None, units: Units, *, with_profile: bool
) -> dict[str, Any]:
    wording, verdict = Wording(units), v.verdict
    line = _line_of(v, plan) if with_profile or home is not None else None
    notes = [note.text(wording) for note in v.all_notes(plan.fleet)]
    return {
        "vehicle": number, "name": v.name, "verdict": verdict_word(_flies(v, plan, home)), "line": flown_line(verdict),
        "cost": v.cost, "bound": v.solution.lower_bound, "gap_percent": v.gap_percent, "length_m": verdict.length_m,
        "time_s": verdict.time_s, "energy_j": verdict.reported_j(verdict.energy_j),
        "figures": figures(v, home, units),
        "way_home": None if home is None or line is None else _way_home(home, line, plan.world.frame, wording),
        "profile": profile_of(line, plan.world.frame) if with_profile and line is not None else None,
        "findings": [f.note.text(wording) for f in verdict.findings[:MOST_ON_PAGE]],
        "not_judged": [note.text(wording) for note in verdict.not_judged[:MOST_ON_PAGE]],
        "notes": notes[:MOST_ON_PAGE],
    }  # fmt: skip


def home_answer(n: int, plan: Plan, homes: Mapping[str, WayHome], units: Units) -> dict[str, Any]:
    """The way home of each vehicle, which takes longer than its plan."""
    wording, vehicles, numbers = Wording(units), [], numbers_of(plan)
    for v in plan.vehicles:
        line = _line_of(v, plan)
        home = homes.get(v.name)
        if home is None or line is None:
            continue
        vehicles.append({
            "vehicle": numbers[v.name], "figure": _home_figure(home, wording),
            "way_home": _way_home(home, line, plan.world.frame, wording),
        })  # fmt: skip
    return {"type": "home", "n": n, "headline": _headline(plan, homes, wording), "vehicles": vehicles}


def refused_answer(n: int, why: NoMission, document: EditedDocument, units: Units, *, live: bool) -> dict[str, Any]:
    """No mission: the reason, the place that binds, and limits that would do, each as a change to send back."""
    cures = []
    for cure in why.cures:
        changes = cure_changes(document, why.vehicle, cure)
        cures.append({"label": ", ".join(f"{key}: {value:g}" for key, value in changes.items()), "changes": changes})
    return {
        "type": "refused", "n": n, "live": live, "reason": why.reason, "message": in_units(str(why), units),
        "at": None if why.at is None else list(why.at), "vehicle": why.vehicle or None, "cures": cures,
        "attempts": attempts(document, why),
    }  # fmt: skip


def error_answer(n: int, why: GcsplanError, code: str) -> dict[str, Any]:
    """An error in words."""
    problems = why.problems if isinstance(why, InputError) else ()
    where = problems[0].key if problems else ""
    lines = [  # of text that is no YAML, the line is the whole place
        {
            "line": p.in_line,
            "where": p.key if p.line or not p.in_line else "",
            "message": p.message.removesuffix(p.line),
        }
        for p in problems[:MOST_ON_PAGE]
    ]
    return {"type": "error", "n": n, "code": code, "message": mistakes_text(why), "where": where, "problems": lines}


def mistakes_text(why: GcsplanError) -> str:
    """The mistakes of the mission, one a line, each with its key; the error's own words where it lists none."""
    problems = why.problems if isinstance(why, InputError) else ()
    return "\n".join(str(replace(p, where=p.key)) for p in problems[:MOST_ON_PAGE]) or str(why)


def figures(v: VehiclePlan, home: WayHome | None, units: Units) -> list[dict[str, Any]]:
    """The rows of the page's table, in the user's units."""
    verdict, limits = v.verdict, v.request.vehicle.limits
    low, high, near = verdict.lowest, verdict.highest, verdict.nearest
    gap = v.gap_percent
    rows = [
        _figure("verdict", "Verdict", verdict_word(verdict.safe), bad=verdict.safe is not True),
        _figure("gap", "Longer than the shortest possible by at most", "no bound" if gap is None else f"{gap:.2f} %"),
        _figure("least_agl", "Least height above ground", _height(low, "min_agl_m", "down", units),
                at=None if low is None else low.min_agl_at, bad=low is not None and low.min_agl_m < limits.min_agl_m),
        _figure("highest_agl", "Greatest height above ground", _height(high, "max_agl_m", "up", units)),
        _figure("nearest_zone", "Nearest zone", "none" if near is None else
                f"{Quantity(near.zone_clearance_m, 'distance', 0, 'down').text(units)}, {near.nearest_zone}"),
        _figure("length", "Length of the path", Quantity(verdict.length_m, "path", 0).text(units)),
        _figure("time", "Duration", Seconds(verdict.time_s).text(units)),
        _figure("energy", "Energy", _energy(verdict, units)),
    ]  # fmt: skip
    return [*rows, *([] if home is None else [_home_figure(home, Wording(units))])]


def _figure(key: str, label: str, text: str, *, at: Sequence[float] | None = None, bad: bool = False) -> dict[str, Any]:
    place = None if at is None or not all(map(math.isfinite, at)) else list(at)
    return {"key": key, "label": label, "text": text, "at": place, "bad": bad}


def _height(leg: LegFigures | None, field: str, rounding: Any, units: Units) -> str:
    return "unknown" if leg is None else Quantity(getattr(leg, field), "height", 1, rounding).text(units)


def _energy(verdict: Verdict, units: Units) -> str:
    joules = verdict.reported_j(verdict.energy_j)
    if joules is None:
        return "not given"
    used = verdict.battery_used_percent
    return Joules(joules).text(units) + ("" if used is None else f", {used:.0f} % of the battery") + verdict.energy_mark


def _home_figure(home: WayHome, wording: Wording) -> dict[str, Any]:
    return _figure("way_home", "Way home", home.headline.text(wording), bad=home.safe is not True)


def _way_home(home: WayHome, line: TrackLine, frame: Frame, wording: Wording) -> dict[str, Any]:
    unsafe = []
    for s in home.unsafe:
        inner = (line.run_m > s.from_m) & (line.run_m < s.to_m)
        between = frame.to_degrees(line.east_m[inner], line.north_m[inner])
        places = np.vstack([np.array([s.start[:2]]), between.reshape(-1, 2), np.array([s.end[:2]])])
        unsafe.append(np.round(places, PLACE_DECIMALS).ravel().tolist())
    rows = [{"label": row.label, "text": row.note.text(wording)} for row in home.rows()]
    return {"safe": home.safe, "unsafe": unsafe, "text": home.headline.text(wording), "rows": rows[:MOST_ON_PAGE]}


def profile_of(line: TrackLine, frame: Frame) -> dict[str, Any]:
    """The samples of a line as lists of equal length."""
    degrees = frame.to_degrees(line.east_m, line.north_m)
    return {
        "distance_m": _numbers(line.run_m, 1), "lat": _numbers(degrees[:, 0], PLACE_DECIMALS),
        "lon": _numbers(degrees[:, 1], PLACE_DECIMALS), "ground_m": _numbers(line.ground_m, HEIGHT_DECIMALS),
        "lowest_m": _numbers(line.floor_m, HEIGHT_DECIMALS), "highest_m": _numbers(line.ceiling_m, HEIGHT_DECIMALS),
        "path_m": _numbers(line.amsl_m, HEIGHT_DECIMALS), "time_s": _numbers(line.time_s, 1),
    }  # fmt: skip


def _numbers(values: Floats, decimals: int) -> list[float | None]:
    return [round(v, decimals) if math.isfinite(v) else None for v in values.tolist()]


def flown_line(verdict: Verdict) -> list[float]:
    """The line of a mission as it is flown: latitude, longitude, metres AMSL, again and again."""
    if not verdict.legs:
        return []
    places = np.array([verdict.legs[0].start, *(leg.end for leg in verdict.legs)])
    return _line(places[:, 0], places[:, 1], places[:, 2])


def _line(lat_deg: Floats, lon_deg: Floats, amsl_m: Floats) -> list[float]:
    """[lat, lon, amsl, lat, …]"""
    columns = np.round(lat_deg, PLACE_DECIMALS), np.round(lon_deg, PLACE_DECIMALS), np.round(amsl_m, HEIGHT_DECIMALS)
    return [float(x) for x in np.stack(columns, axis=-1).ravel()]
