"""What is said of turns and landings that are not judged, in a form that can be told in each system of units."""

from __future__ import annotations

from gcsplan.units import Quantity, UnitText

UNFITTING = "what is flown there is not judged"
"""The end of what is said where arcs do not fit."""


def unread_arcs(radius_m: float, vehicle: str, autopilot: str) -> UnitText:
    """Arcs of an autopilot that begins them by its parameters."""
    return UnitText(
        "the arcs of {} that {} flies at its corners are not judged: {} begins a turn by parameters that the mission "
        "does not hold", Quantity(radius_m, "distance", None), vehicle, autopilot,
    )  # fmt: skip


def too_banked(radius_m: float, speed_m_s: float, bank_deg: float, most_deg: float) -> UnitText:
    """Turns that need more bank than the autopilot flies."""
    return UnitText(
        "turns of {} at {} need a bank of {:.0f}°, and ArduPlane's ROLL_LIMIT_DEG is {:g}°: the arcs that it flies are "
        "wider, and not judged",
        Quantity(radius_m, "distance", None), Quantity(speed_m_s, "speed", None), bank_deg, most_deg,
    )  # fmt: skip


def turns_late(seq: int, past_m: float) -> UnitText:
    """A way point that is flown past before the turn."""
    return UnitText(
        "item {}: flies {} past its way point before it turns (param3): that is not judged",
        seq, Quantity(past_m, "distance", 0),
    )  # fmt: skip


def too_tight(seqs: str, radius_m: float, both_m: float, begins_m: float, leg: tuple[int, float, float]) -> UnitText:
    """Arcs that take more of a leg (``leg``: item, length, what it may be too short by) than there is."""
    seq, long_m, spare_m = leg
    takes = UnitText("the turn begins {} before the end", Quantity(begins_m, "distance", 0))
    if both_m > long_m + spare_m:
        takes = UnitText("arcs of {} take {}", Quantity(radius_m, "distance", None), Quantity(both_m, "distance", 0))
    return UnitText(
        "item {}: {} of the leg to item {}, which is {} long: {}",
        seqs, takes, seq, Quantity(long_m, "distance", 0), UNFITTING,
    )  # fmt: skip


def takes_off_elsewhere(seq: int, away_m: float) -> UnitText:
    """A take-off of PX4 that is not at home."""
    return UnitText(
        "item {}: take-off lies {} from home: what PX4 does between is not judged",
        seq, Quantity(away_m, "distance", 0),
    )  # fmt: skip


def glides_to(seq: int, off_m: float) -> UnitText:
    """A glide that ends ``off_m`` above the ground (NaN: it is unknown)."""
    words: object = "is unknown"
    if off_m == off_m:
        words = UnitText("lies {} {} it", Quantity(abs(off_m), "height", 1), "below" if off_m > 0 else "above")
    return UnitText(
        "item {}: the glide leads to the item's altitude, and the ground there {}: it is not judged", seq, words
    )
