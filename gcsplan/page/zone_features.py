"""The zones of a mission's document as GeoJSON for the map, whatever is wrong elsewhere in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from gcsplan.errors import InputError
from gcsplan.export.geojson import area_geometry
from gcsplan.export.rows import outlines_deg
from gcsplan.mission_file.zones.draft import ZoneDraft, place_zones
from gcsplan.page.history import EditedDocument
from gcsplan.report.views.plan import zone_heights
from gcsplan.units import Units
from gcsplan.world.geodesy.frame import Frame

ZONE_BOUNDS = ("floor", "ceiling")


OutlineAndLevels = tuple[dict[str, Any], str]
"""The outline of a zone as GeoJSON, and its heights in words."""


class DrawnZones:
    """The zones of one page's mission; a zone that stays the same is not drawn anew for each state."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, int], tuple[ZoneDraft, tuple[object, ...], OutlineAndLevels | None]] = {}

    def geojson(
        self, document: EditedDocument, entries: Mapping[str, Sequence[ZoneDraft]], frame: Frame | None, units: Units
    ) -> dict[str, Any]:
        """A FeatureCollection: each zone with the key of its entry, and what the page needs to edit it.

        ``entries`` as of `zones_by_entry`; ``frame`` is that of a mission in local metres.
        """
        features = []
        now: dict[tuple[str, int], tuple[ZoneDraft, tuple[object, ...], OutlineAndLevels | None]] = {}
        by = units.name, None if frame is None else (frame.lat_deg, frame.lon_deg)
        for key, number, draft in (
            (key, k, draft) for key, drafts in entries.items() for k, draft in enumerate(drafts)
        ):
            known = self._known.get((key, number))
            same = known is not None and known[0] is draft and known[1] == by
            drawn = known[2] if known is not None and same else _drawn(draft, frame, units)
            now[key, number] = draft, by, drawn
            if drawn is not None:
                about = _about(key, entry_of(document, key), draft, drawn[1])
                features.append({"type": "Feature", "geometry": drawn[0], "properties": about})
        self._known = now
        return {"type": "FeatureCollection", "features": features}


def _drawn(draft: ZoneDraft, frame: Frame | None, units: Units) -> OutlineAndLevels | None:
    """The zone for the map; None if it cannot be drawn: its mistake is among the mission's problems."""
    if draft.local and frame is None:
        return None
    plane = frame or Frame(*_middle(draft))
    try:
        placed, _ = place_zones([replace(draft, keep_in=False, holes=(), unused=None)], plane)
    except InputError:
        return None
    zones = [zone for _, zone in placed]
    rings = outlines_deg(zones, plane)
    return (area_geometry(rings), zone_heights(zones[0], units)) if rings else None


def _middle(draft: ZoneDraft) -> tuple[float, float]:
    lat = [p[0] for p in draft.points]
    lon = [p[1] for p in draft.points]
    return 0.5 * (min(lat) + max(lat)), (0.5 * (min(lon) + max(lon)) + 180.0) % 360.0 - 180.0


def entry_of(document: EditedDocument, key: str) -> Any:
    """The value of an entry such as ``no_fly[3]``."""
    name, _, number = key.rstrip("]").partition("[")
    return document[name][int(number)]


def _about(key: str, entry: Any, draft: ZoneDraft, levels: str) -> dict[str, Any]:
    """The properties of a zone: its entry's values if the entry is the zone itself, and no file of several."""
    own = isinstance(entry, dict) and "file" not in entry and not draft.local
    shape = "file"
    if own:
        shape = "circle" if "center" in entry else "polygon" if "polygon" in entry else "line"
    return {
        "key": key, "name": draft.name, "kind": "keep_in" if draft.keep_in else "no_fly",
        "editable": bool(own and shape in ("circle", "polygon")), "shape": shape, "levels": levels,
        "center": list(draft.points[0]) if shape == "circle" else None,
        "radius_m": draft.radius_m if shape == "circle" else None,
        "polygon": [list(p) for p in draft.points] if shape == "polygon" else None,
        **{bound: _bound(entry, bound) if own else None for bound in ZONE_BOUNDS},
    }  # fmt: skip


def _bound(entry: dict[str, Any], bound: str) -> dict[str, Any] | None:
    return {key: value for key, value in entry.items() if str(key).startswith(f"{bound}_")} or None
