"""Layouts in which states publish the members of ED-318, brought to the standard's own.

ENAIRE (Spain) publishes two: ``UASZone`` and ``verticalLayer`` beside each other, and one flat table. In both, an empty
text means that there is no value.
"""

from __future__ import annotations

from typing import Any

ZONE, LAYER = "UASZone", "verticalLayer"
_LIMITS = ("lower", "lowerReference", "upper", "upperReference", "uom", "UOM")
_PERIOD = ("startDateTime", "endDateTime")
_DAILY = ("day", "startTime", "startEvent", "endTime", "endEvent")
_AUTHORITY = ("purpose", "intervalBefore", "service", "contactName", "siteURL", "email", "phone")


def standard_properties(given: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The properties of a feature as ED-318 has them, and its layer of limits if that stands among them."""
    zone = given.get(ZONE)
    whole = {k: v for k, v in given.items() if k != ZONE} | zone if isinstance(zone, dict) else dict(given)
    layer = whole.pop(LAYER) if isinstance(whole.get(LAYER), dict) else _group(whole, _LIMITS)
    if layer is not None:
        layer = {k.lower() if k == "UOM" else k: v for k, v in layer.items() if not _empty(v)}
    if "limitedApplicability" not in whole and (daily := _group(whole, _DAILY)) is not None:
        whole["limitedApplicability"] = [(_group(whole, _PERIOD) or {}) | {"schedule": [daily]}]
    if "zoneAuthority" not in whole and (authority := _group(whole, _AUTHORITY)) is not None:
        whole["zoneAuthority"] = [authority | {"name": whole.get("name_authority")}]
    return whole, layer


def _group(whole: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any] | None:
    found = {k: whole[k] for k in keys if k in whole}
    return found or None


def _empty(given: Any) -> bool:
    return isinstance(given, str) and not given.strip()
