"""`WayHome`: the result of judging the way home, in numbers, in words and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gcsplan.check.battery import BatteryHome
from gcsplan.check.rtl.words import NO_RETURN, NOT_JUDGED, STILL_NO_RETURN, together_m, verdict_words
from gcsplan.check.stretch import Place
from gcsplan.figures import counted
from gcsplan.mavlink.mission.return_altitude import setting, settings
from gcsplan.mavlink.mission.return_route import Route, route_setting
from gcsplan.units import Quantity, Reach, Symbol, UnitText, joined
from gcsplan.vehicle import Autopilot


@dataclass(frozen=True, slots=True)
class UnsafeStretch:
    """A part of the mission from which the return is not safe at the judged altitude.

    ``from_seq``, ``to_seq``: wire items that the vehicle flies to at its ends; ``start``, ``end``: where the vehicle is
    there; ``from_m``, ``to_m``: horizontal metres along the mission (equal for a column). ``why``: the reason in words;
    ``obstacle``: the highest ground in the way, if ground is the reason. ``lowest_rel_home_m``: the lowest return
    altitude that is safe from all of the stretch, None if there is none; ``because``: why there is none, if ``why``
    does not say so.
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
    because: str = ""

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

    @property
    def place_and_why(self) -> UnitText:
        """``km 1.49 to 3.45 (items 4 to 9): the return meets …``."""
        ends = [self.from_m, *([self.to_m] if self.to_m - self.from_m >= 5.0 else [])]
        numbers = joined(" to ", [UnitText("{}", Quantity(at_m, "far", 2, bare=True)) for at_m in ends])
        return UnitText("{} {} ({}): {}", Symbol("far"), numbers, self.items, self.why)

    def describe(self, good: str = "safe") -> UnitText:
        """Where, why, and which altitude would help; ``good``: what the return is at that altitude."""
        if self.lowest_rel_home_m is None:
            why: str = UnitText(": {}", self.because) if self.because else ""
            return UnitText("{}; no return altitude is {} from there{}", self.place_and_why, good, why)
        lowest = _at_least(self.lowest_rel_home_m)
        return UnitText("{}; {} from there at {} above home", self.place_and_why, good, lowest)


def worst_first(stretches: Sequence[UnsafeStretch]) -> list[UnsafeStretch]:
    """Stretches by reason: the reason with the worst stretch first, and of one reason the worst first.

    A stretch from which no altitude helps is worse than any other; then the longer one is.
    """

    def bad(s: UnsafeStretch) -> tuple[bool, float]:
        return s.lowest_rel_home_m is None, s.to_m - s.from_m

    by_reason: dict[tuple[str, bool], list[UnsafeStretch]] = {}
    for s in stretches:
        by_reason.setdefault((s.zone, s.obstacle is not None), []).append(s)
    groups = [sorted(group, key=bad, reverse=True) for group in by_reason.values()]
    return [s for group in sorted(groups, key=lambda group: bad(group[0]), reverse=True) for s in group]


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
class LowestAgl:
    """The lowest height above ground of all returns; the return begins ``at_m`` along the mission, on item ``seq``."""

    agl_m: float
    at_m: float
    seq: int


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
    it; ``left``: what stays unsafe even with them. ``profile``: in the order flown. ``lowest``: how near to the ground
    the returns come at the judged altitude, None where that is unknown.

    ``path_safe`` is the verdict on the path itself. ``set_rel_home_m``: the altitude to set on the vehicle (with
    ``rally``, if there are any): the judged one if nothing is better, else one that is legal, or clear, from every
    point; None if nothing could be judged. ``set_leaves_m``: metres of the path that it leaves without a safe return.

    ``route``: whether the returns were judged straight home, or to where they join the mission, behind the wire items
    ``starts``; ``along_path``: along a return path, else to a landing sequence. Altitudes say nothing then.
    ``path_back``: what a return path along the mission's own track would do, where no altitude is enough; mostly empty.
    ``max_agl_m``: the limit on heights above ground, which a return at a greater altitude breaks over home at least.
    """

    vehicle: str
    autopilot: Autopilot
    path_safe: bool | None
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
    set_rel_home_m: float | None
    set_leaves_m: float | None
    rally: tuple[RallyPoint, ...]
    left: tuple[UnsafeStretch, ...]
    profile: tuple[ProfilePoint, ...]
    lowest: LowestAgl | None
    not_judged: tuple[str, ...]
    notes: tuple[str, ...]
    route: Route = "straight"
    starts: tuple[int, ...] = ()
    along_path: bool = False
    path_back: str = ""
    max_agl_m: float | None = None

    @property
    def safe(self) -> bool | None:
        """True if the return is clear from every point and the battery is enough; None if not all of it was judged."""
        if self.unsafe or (self.battery is not None and self.battery.short):
            return False
        return None if self.not_judged else True

    @property
    def no_return_m(self) -> float:
        """Metres of the mission from which the return is not clear, or the battery is not enough for it."""
        short = self.battery.short if self.battery is not None else ()
        return together_m([*((s.from_m, s.to_m) for s in self.unsafe), *short])

    @property
    def headline(self) -> UnitText:
        """Both truths in one line: ``path safe; no safe return from 9.5 km of it``."""
        return UnitText("{}{}", verdict_words(self.path_safe, self), self._more())

    def _more(self) -> str:
        """What follows the verdict's words: why it was not judged, where, or for want of what."""
        if self.safe is True:
            return ""
        if self.safe is None:
            return f": {'; '.join(self.not_judged)}"
        short = self.battery.short if self.battery is not None else ()
        if self.no_return_m < 0.5:
            seq = self.unsafe[0].from_seq if self.unsafe else 0 if self.battery is None else self.battery.no_return_seq
            return f", at item {seq}"
        if not short:
            return ""
        return UnitText(" (battery: from {})", Reach(together_m(short))) if self.unsafe else " (battery)"

    @property
    def advice(self) -> str:
        """The parameter and value to set, and what that leaves; empty if there is no value to name."""
        if self.route == "mission":
            return f"set {route_setting(self.autopilot, path=self.along_path)}" if self.starts else ""
        if self.set_rel_home_m is None:
            return ""
        with_points = f", with {counted(len(self.rally), 'rally point')} on board (--rally)" if self.rally else ""
        return UnitText("set {}{}: then {}", setting(self.autopilot, self.set_rel_home_m), with_points, self.then)

    @property
    def then(self) -> str:
        """What the value to set leaves, with the rally points if there are any; empty if there is no value to name."""
        if self.set_rel_home_m is None:
            return ""
        left = self.set_leaves_m or 0.0
        then: str = "safe return from all of it"
        but: list[str] = []
        if left:
            then = UnitText(
                "no safe return from {} of it{}", Reach(left), "" if self.rally or self.left else " (battery)"
            )
        elif self.lowest_legal_rel_home_m is not None and self.set_rel_home_m >= self.lowest_legal_rel_home_m:
            but.append(", within all limits")
        if self.set_above_max_agl and self.max_agl_m is not None:
            but.append(UnitText(", but above max_agl_m ({}) over home", Quantity(self.max_agl_m, "height", None)))
        if self.rally and self.battery is not None:
            but.append(", the battery not counted")
        if self.not_judged:
            but.append(", as far as it was judged")
        return UnitText("{}{}", then, joined("", but))

    @property
    def set_above_max_agl(self) -> bool:
        """Whether a return at the altitude to set is higher above home than the mission may fly above ground."""
        return None not in (self.max_agl_m, self.set_rel_home_m) and self.set_rel_home_m > self.max_agl_m  # type: ignore[operator]

    def as_dict(self, *, profile: bool = False) -> dict[str, Any]:
        """Plain values for ``summary.json``; the profile on request."""
        out: dict[str, Any] = {
            "parameter": self.parameter,
            "route": self.route,
            "joins": list(self.starts),
            "path_back": self.path_back or None,
            "rtl_rel_home_m": self.rtl_rel_home_m,
            "assumed": self.assumed,
            "safe": self.safe,
            "headline": self.headline,
            "no_return_m": self.no_return_m,
            "set_rel_home_m": self.set_rel_home_m,
            "set": [] if self.set_rel_home_m is None else settings(self.autopilot, self.set_rel_home_m),
            "set_leaves_m": self.set_leaves_m,
            "set_above_max_agl": self.set_above_max_agl,
            "lowest_rel_home_m": self.lowest_rel_home_m,
            "highest_rel_home_m": self.highest_rel_home_m,
            "lowest_legal_rel_home_m": self.lowest_legal_rel_home_m,
            "unsafe": [s.as_dict() for s in self.unsafe],
            "irregular": [s.as_dict() for s in self.irregular],
            "battery": None if self.battery is None else self.battery.as_dict(),
            "lowest_agl_m": None if self.lowest is None else self.lowest.agl_m,
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
        """(label, words) for a table of two columns, below the headline."""
        if self.route == "mission":
            return self._rows_of_mission()
        source = "the autopilot's default" if self.assumed else "as given"
        judged_at = UnitText("{} above home, {}", Quantity(self.rtl_rel_home_m, "height", None), source)
        out: list[tuple[str, str]] = [("judged at", judged_at)]
        if self.advice:
            out.append(("on the vehicle", self.advice))
        if self.path_back:
            out.append(("instead", self.path_back))
        out += [(NO_RETURN, UnitText("from {}", s.describe())) for s in worst_first(self.unsafe)]
        if self.irregular:
            first, length = self.irregular[0], together_m((s.from_m, s.to_m) for s in self.irregular)
            where = UnitText("from {} of the path", Reach(length)) if length >= 0.5 else "from a point of the path"
            words = "{} the return hits nothing but breaks a limit; first from {}"
            out.append(("outside a limit", UnitText(words, where, first.describe("within all limits"))))
        if self.not_judged and not self.unsafe and self.lowest_rel_home_m is None:
            return out + self._battery() + [(NOT_JUDGED, words) for words in self.not_judged]
        out += [
            ("clear of ground and zones", _altitudes(self.lowest_rel_home_m, self.highest_rel_home_m)),
            ("within all limits too", _altitudes(self.lowest_legal_rel_home_m, None)),
            *self._lowest(),
            *self._battery(),
        ]
        out += [
            (
                f"rally point {number}",
                UnitText(
                    "{:.7f}, {:.7f}, {} above home: {}; nearest for {}",
                    r.lat_deg, r.lon_deg, Quantity(r.rel_home_m, "height", 0, "up"), r.why, Reach(r.serves_m),
                ),
            )
            for number, r in enumerate(self.rally, start=1)
        ]  # fmt: skip
        out += [(STILL_NO_RETURN, UnitText("from {}", s.place_and_why)) for s in worst_first(self.left)]
        out += [(NOT_JUDGED, words) for words in self.not_judged]
        return out

    def _rows_of_mission(self) -> list[tuple[str, str]]:
        what = "return path" if self.along_path else "landing sequence"
        out: list[tuple[str, str]] = []
        if self.starts:
            items = f"item {self.starts[0]}" + "".join(f", {k}" for k in self.starts[1:])
            out.append(("judged as", f"joined to the mission's {what} ({items})"))
        if self.advice:
            out.append(("on the vehicle", self.advice))
        out += [(NO_RETURN, UnitText("from {}", s.place_and_why)) for s in worst_first(self.unsafe)]
        if self.irregular:
            length = together_m((s.from_m, s.to_m) for s in self.irregular)
            words = "from {} of the path the return hits nothing but breaks a limit; first from {}"
            out.append(("outside a limit", UnitText(words, Reach(length), self.irregular[0].place_and_why)))
        return out + self._battery() + [(NOT_JUDGED, words) for words in self.not_judged]

    def _lowest(self) -> list[tuple[str, str]]:
        if self.lowest is None:
            return []
        below = self.lowest.agl_m < 0.0
        agl = Quantity(abs(self.lowest.agl_m), "height", 0, "up" if below else "down")
        at = Quantity(self.lowest.at_m, "far", 2, bare=True)
        words = "{} {} ground, on the return from {} {} (item {})"
        side = "below" if below else "above"
        return [("lowest on a return", UnitText(words, agl, side, Symbol("far"), at, self.lowest.seq))]

    def _battery(self) -> list[tuple[str, str]]:
        return [] if self.battery is None else [("battery for the return", self.battery.describe())]

    def describe(self) -> str:
        """All of `rows` and the notes, one per line."""
        lines = [f"{label}: {text}" for label, text in self.rows()] + [f"note: {text}" for text in self.notes]
        return "\n".join(lines)


def _altitudes(lowest: float | None, highest: float | None) -> str:
    if lowest is None:
        return "no single return altitude is, from all of the path"
    upper: str = " or more"
    if highest is not None:
        upper = UnitText(" to {}", Quantity(highest, "height", 1, "down", trimmed=True))
    return UnitText("from all of the path at {}{} above home", _at_least(lowest), upper)


def _at_least(rel_home_m: float) -> Quantity:
    """A return altitude that must at least be set."""
    return Quantity(rel_home_m, "height", 1, "up", trimmed=True)
