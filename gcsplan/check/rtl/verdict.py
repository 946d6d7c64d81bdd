"""`WayHome`: the result of judging the way home, in numbers, in words and as plain values."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from gcsplan.check.battery import BatteryHome
from gcsplan.check.stretch import Place


@dataclass(frozen=True, slots=True)
class UnsafeStretch:
    """A part of the mission from which the return is not safe at the judged altitude.

    ``from_seq``, ``to_seq``: wire items that the vehicle flies to at its ends; ``start``, ``end``: where the vehicle is
    there; ``from_m``, ``to_m``: horizontal metres along the mission (equal for a column). ``why``: the reason in words;
    ``obstacle``: the highest ground in the way, if ground is the reason. ``lowest_rel_home_m``: the lowest return
    altitude that is safe from all of the stretch, None if there is none.
    """

    from_seq: int
    to_seq: int
    start: Place
    end: Place
    from_m: float
    to_m: float
    why: str
    zone: str
    obstacle: Place | None
    lowest_rel_home_m: float | None

    def as_dict(self) -> dict[str, Any]:
        """Plain values; places as [latitude, longitude, AMSL]."""
        return {
            "from_seq": self.from_seq,
            "to_seq": self.to_seq,
            "start": list(self.start),
            "end": list(self.end),
            "from_m": self.from_m,
            "to_m": self.to_m,
            "why": self.why,
            "zone": self.zone or None,
            "obstacle": None if self.obstacle is None else list(self.obstacle),
            "lowest_rel_home_m": self.lowest_rel_home_m,
        }

    @property
    def items(self) -> str:
        """``item 3`` or ``items 3 to 7``."""
        return f"item {self.from_seq}" if self.from_seq == self.to_seq else f"items {self.from_seq} to {self.to_seq}"

    def describe(self) -> str:
        """Describe it in one line."""
        cure = (
            "no return altitude is safe from there"
            if self.lowest_rel_home_m is None
            else f"{self.lowest_rel_home_m:.0f} m above home would be safe from there"
        )
        return f"on the way to {self.items} (km {self.from_m / 1e3:.2f} to {self.to_m / 1e3:.2f}): {self.why}; {cure}"


@dataclass(frozen=True, slots=True)
class RallyPoint:
    """A place to return to instead of home; ``rel_home_m`` is the altitude to be sent with it (frame 3).

    ``serves_m``: metres of the mission from which the vehicle would come here, because it is the nearest.
    """

    lat_deg: float
    lon_deg: float
    ground_amsl_m: float
    rel_home_m: float
    serves_m: float
    why: str

    def as_dict(self) -> dict[str, Any]:
        """The fields as plain values."""
        return {
            "lat": self.lat_deg,
            "lon": self.lon_deg,
            "ground_amsl_m": self.ground_amsl_m,
            "rel_home_m": self.rel_home_m,
            "serves_m": self.serves_m,
            "why": self.why,
        }


@dataclass(frozen=True, slots=True)
class ProfilePoint:
    """One part of the mission, ``from_m`` to ``to_m`` along it, and the lowest level of the return (AMSL) from there.

    ``clear_amsl_m``: the level that meets neither ground, obstacle nor zone; ``legal_amsl_m``: the level that keeps all
    limits of height; None if there is none. ``low_amsl_m``, ``high_amsl_m``: the mission's own altitude there.
    """

    from_m: float
    to_m: float
    low_amsl_m: float
    high_amsl_m: float
    clear_amsl_m: float | None
    legal_amsl_m: float | None


@dataclass(frozen=True, slots=True)
class WayHome:
    """The way home from every point of one mission.

    Two grades. *Clear*: the return, within track and altitude error, meets no ground or obstacle, keeps the horizontal
    clearance and enters no zone or its clearance. *Legal*: it also keeps min AGL, max AGL and max AMSL.

    ``parameter`` is the autopilot's name for the return altitude; ``rtl_rel_home_m`` is the altitude judged;
    ``assumed``: it was not set, so the autopilot's default was judged. ``lowest_rel_home_m`` … ``highest_rel_home_m``:
    return altitudes that are clear from every point (None: none is; highest None: no upper limit);
    ``lowest_legal_rel_home_m``: the lowest that is legal from every point. ``unsafe``: where the return is not clear;
    ``irregular``: where it is clear but not legal. ``advised_rel_home_m``: the lowest clear altitude, or, if none is
    clear from every point, one that leaves little unsafe; ``rally``: points proposed for that case, to be judged with
    it; ``left``: what stays unsafe even with them. ``profile``: in the order flown.
    """

    vehicle: str
    parameter: str
    rtl_rel_home_m: float
    assumed: bool
    home: Place
    lowest_rel_home_m: float | None
    highest_rel_home_m: float | None
    lowest_legal_rel_home_m: float | None
    unsafe: tuple[UnsafeStretch, ...]
    irregular: tuple[UnsafeStretch, ...]
    battery: BatteryHome | None
    advised_rel_home_m: float | None
    rally: tuple[RallyPoint, ...]
    left: tuple[UnsafeStretch, ...]
    profile: tuple[ProfilePoint, ...]
    not_judged: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def safe(self) -> bool | None:
        """True if the return is clear from every point and the battery is enough; None if not all of it was judged."""
        if self.unsafe or (self.battery is not None and self.battery.short):
            return False
        return None if self.not_judged else True

    @property
    def unsafe_m(self) -> float:
        """Metres of the mission from which the return is not clear."""
        return math.fsum(s.to_m - s.from_m for s in self.unsafe)

    def as_dict(self, *, profile: bool = False) -> dict[str, Any]:
        """Plain values for ``summary.json``; the profile on request."""
        out: dict[str, Any] = {
            "parameter": self.parameter,
            "rtl_rel_home_m": self.rtl_rel_home_m,
            "assumed": self.assumed,
            "safe": self.safe,
            "lowest_rel_home_m": self.lowest_rel_home_m,
            "highest_rel_home_m": self.highest_rel_home_m,
            "lowest_legal_rel_home_m": self.lowest_legal_rel_home_m,
            "unsafe": [s.as_dict() for s in self.unsafe],
            "irregular": [s.as_dict() for s in self.irregular],
            "battery": None if self.battery is None else self.battery.as_dict(),
            "advised_rel_home_m": self.advised_rel_home_m,
            "rally": [r.as_dict() for r in self.rally],
            "left": [s.as_dict() for s in self.left],
            "not_judged": list(self.not_judged),
            "notes": list(self.notes),
        }
        if profile:
            out["profile"] = [
                [p.from_m, p.to_m, p.low_amsl_m, p.high_amsl_m, p.clear_amsl_m, p.legal_amsl_m] for p in self.profile
            ]
        return out

    def rows(self) -> list[tuple[str, str]]:
        """(label, words) for a table of two columns."""
        source = "the autopilot's default" if self.assumed else "as given"
        rows = [("return altitude", f"{self.rtl_rel_home_m:g} m above home ({self.parameter}, {source})")]
        if not self.unsafe:
            rows.append(("the way home", "clear of ground and zones from everywhere on the mission"))
        else:
            rows += [("not clear", s.describe()) for s in self.unsafe]
        if self.irregular:
            first, km = self.irregular[0], math.fsum(s.to_m - s.from_m for s in self.irregular) / 1e3
            words = f"{km:.2f} km, first on the way to {first.items} (km {first.from_m / 1e3:.2f}): {first.why}"
            rows.append(("clear, but not within all limits", words))
        if self.lowest_rel_home_m is None:
            rows.append(("lowest that is clear", "none is, from everywhere"))
            if self.advised_rel_home_m is not None:
                with_points = f", with {len(self.rally)} rally points" if self.rally else ""
                left_km = math.fsum(s.to_m - s.from_m for s in self.left) / 1e3
                rows.append(
                    (
                        "least unsafe",
                        f"{self.advised_rel_home_m:.0f} m above home{with_points}: {left_km:.2f} km are left",
                    )
                )
        else:
            top = "" if self.highest_rel_home_m is None else f"; not above {self.highest_rel_home_m:.0f} m"
            rows.append(("lowest that is clear", f"{self.lowest_rel_home_m:.0f} m above home{top}"))
        if self.lowest_legal_rel_home_m is None:
            rows.append(("lowest that keeps all limits", "none does, from everywhere"))
        else:
            rows.append(("lowest that keeps all limits", f"{self.lowest_legal_rel_home_m:.0f} m above home"))
        if self.battery is not None:
            rows.append(("battery for the return", self.battery.describe()))
        for number, r in enumerate(self.rally, start=1):
            rows.append(
                (
                    f"rally point {number}",
                    f"{r.lat_deg:.7f}, {r.lon_deg:.7f}, {r.rel_home_m:.0f} m above home: {r.why}, nearest for "
                    f"{r.serves_m / 1e3:.1f} km",
                )
            )
        rows += [("left unsafe", s.describe()) for s in self.left]
        rows += [("not judged", words) for words in self.not_judged]
        return rows

    def describe(self) -> str:
        """All of `rows` and the notes, one per line."""
        lines = [f"{label}: {words}" for label, words in self.rows()] + [f"note: {words}" for words in self.notes]
        return "\n".join(lines)
