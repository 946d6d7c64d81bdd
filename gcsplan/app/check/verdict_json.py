"""A verdict as plain values, for ``check --json`` and the summary of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gcsplan.check.returns.words import verdict_words
from gcsplan.check.verdict import Verdict
from gcsplan.notes.note import IN_FILES, Wording, in_json

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.fleet.arrival import Slot


def verdict_of(name: str, verdict: Verdict, home: WayHome | None = None, wording: Wording = IN_FILES) -> dict[str, Any]:
    """A verdict as plain values, for ``check --json``; ``home``: the way home, if it was judged."""
    lowest, words = verdict.lowest, verdict_words(verdict.safe, home)
    return {
        "file": name,
        "vehicle": verdict.mission.name,
        "safe": verdict.safe,
        "verdict": words.text(wording),
        "items": len(verdict.mission.wire_items()),
        "length_m": verdict.length_m,
        "energy_j": verdict.reported_j(verdict.path_energy_j),
        "flight_energy_j": verdict.reported_j(verdict.energy_j),
        "energy_figures": verdict.energy_figures,
        "battery_used_percent": verdict.battery_used_percent,
        "min_agl_m": lowest.min_agl_m if lowest else None,
        **extremes(verdict),
        **arrival_window(verdict),
        **gates_on_way(verdict),
        "violations": [f.as_dict(wording) for f in verdict.findings],
        **in_json("not_judged", verdict.not_judged, wording),
        **in_json("notes", verdict.notes, wording),
    }


def extremes(verdict: Verdict) -> dict[str, Any]:
    """The greatest height above ground, the nearest zone beside, over or under, and the steepest angle."""
    highest, nearest, passed = verdict.highest, verdict.nearest, verdict.zone_pass
    return {
        "max_agl_m": highest.max_agl_m if highest else None,
        "min_zone_clearance_m": nearest.zone_clearance_m if nearest else None,
        "nearest_zone": nearest.nearest_zone if nearest else None,
        "min_zone_height_m": passed.height_m if passed else None,
        "zone_passed": {"zone": passed.zone, "side": passed.side, "leg": passed.seq} if passed else None,
        "max_climb_deg": verdict.max_climb_deg,
    }


def arrival_window(verdict: Verdict, slot: Slot | None = None) -> dict[str, float]:
    """The earliest and the latest arrival in the declared winds; nothing in still air."""
    window_s = verdict.arrive_window_s(slot)
    return {} if window_s is None else dict(zip(("arrive_earliest_s", "arrive_latest_s"), window_s, strict=True))


def gates_on_way(verdict: Verdict, slot: Slot | None = None) -> dict[str, Any]:
    """Each wait until a time of day; nothing if there is none. Seconds count as the windows of arrival."""
    ends, windows = verdict.clock_s(slot), verdict.leg_windows_s(slot)
    waits = [k for k, leg in enumerate(verdict.legs) if leg.until_s is not None]
    if not waits:
        return {}
    rows = []
    for k in waits:
        leg = verdict.legs[k]
        early_s, late_s = (ends[k - 1], ends[k - 1]) if windows is None else windows[k - 1]
        rows.append({
            "seq": leg.seq, "earliest_s": early_s, "latest_s": late_s, "opens_s": ends[k], "wait_s": leg.hold_s,
            "energy_j": verdict.reported_j(leg.hold_j),
        })  # fmt: skip
    return {"gates": rows}


def flat(figures: Any) -> dict[str, Any]:
    """The fields of a dataclass with slots, by name; unlike `asdict` it copies nothing."""
    return {name: getattr(figures, name) for name in figures.__slots__}
