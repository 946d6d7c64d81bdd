"""`WayHome`: the result of judging the way home, in numbers, in words and as plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gcsplan.check.battery import BatteryHome
from gcsplan.check.motion.stretch import Place
from gcsplan.check.returns.proposal import ReturnProposal
from gcsplan.check.returns.words import ReturnRow, listed, together_m, verdict_words
from gcsplan.mavlink.mission.return_parameters import ReturnRoute, route_setting, setting, settings
from gcsplan.notes.note import IN_FILES, Note, Wording, in_json
from gcsplan.vehicle import Autopilot


@dataclass(frozen=True, slots=True)
class UnsafeStretch:
    """A part of the mission from which the return is not safe at the judged altitude.

    ``from_seq``, ``to_seq``: wire items that the vehicle flies to at its ends; ``start``, ``end``: where the vehicle is
    there; ``from_m``, ``to_m``: horizontal metres along the mission (equal for a column). ``why``: the reason;
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
    why: Note
    zone: str
    obstacle: Place | None
    lowest_rel_home_m: float | None
    because: Note | None = None

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """Plain values; places as [latitude, longitude, AMSL]."""
        return {
            "from_seq": self.from_seq,
            "to_seq": self.to_seq,
            "start": list(self.start),
            "end": list(self.end),
            "from_m": self.from_m,
            "to_m": self.to_m,
            "why": self.why.text(wording),
            "why_data": self.why.as_dict(),
            "zone": self.zone or None,
            "obstacle": None if self.obstacle is None else list(self.obstacle),
            "lowest_rel_home_m": self.lowest_rel_home_m,
        }

    @property
    def items(self) -> Note:
        """``item 3`` or ``items 3 to 7``."""
        if self.from_seq == self.to_seq:
            return Note("one_item", seq=self.from_seq)
        return Note("several_items", first=self.from_seq, last=self.to_seq)

    @property
    def place_and_why(self) -> Note:
        """``km 1.49 to 3.45 (items 4 to 9): the return meets …``."""
        if self.to_m - self.from_m < 5.0:
            return Note("from_one_place", from_m=self.from_m, items=self.items, why=self.why)
        return Note("from_part", from_m=self.from_m, to_m=self.to_m, items=self.items, why=self.why)

    def described(self, *, legal: bool = False) -> Note:
        """Where, why, and which altitude would help; ``legal``: to keep all limits, else to be safe."""
        stretch = self.place_and_why
        if self.lowest_rel_home_m is not None:
            return Note("altitude_helps", stretch=stretch, legal=legal, lowest_m=self.lowest_rel_home_m)
        if self.because is not None:
            return Note("no_altitude_helps_because", stretch=stretch, legal=legal, because=self.because)
        return Note("no_altitude_helps", stretch=stretch, legal=legal)


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
    why: Note

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """The fields as plain values."""
        return {
            "lat": self.lat_deg,
            "lon": self.lon_deg,
            "ground_amsl_m": self.ground_amsl_m,
            "rel_home_m": self.rel_home_m,
            "serves_m": self.serves_m,
            "why": self.why.text(wording),
            "why_data": self.why.as_dict(),
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
    it; ``left``: what stays unsafe even with them. ``profile``: in the order flown; empty if no other altitude than the
    judged one was looked at. ``lowest``: how near to the ground
    the returns come at the judged altitude, None where that is unknown.

    ``path_safe`` is the verdict on the path itself. ``set_rel_home_m``: the altitude to set on the vehicle (with
    ``rally``, if there are any): the judged one if nothing is better, else one that is legal, or clear, from every
    point; None if nothing could be judged. ``set_leaves_m``: metres of the path that it leaves without a safe return.

    ``route``: whether the returns were judged straight home, or to where they join the mission, behind the wire items
    ``starts``; ``along_path``: along a return path, else to a landing sequence. Altitudes say nothing then.
    ``path_back``: what a return path along the mission's own track would do, where no altitude is enough; mostly None.
    ``max_agl_m``: the limit on heights above ground, which a return at a greater altitude breaks over home at least.
    ``proposals``: changes that were tried and leave less unsafe, the best first.
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
    not_judged: tuple[Note, ...]
    notes: tuple[Note, ...]
    route: ReturnRoute = "straight"
    starts: tuple[int, ...] = ()
    along_path: bool = False
    path_back: Note | None = None
    max_agl_m: float | None = None
    proposals: tuple[ReturnProposal, ...] = ()

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
    def headline(self) -> Note:
        """Both truths in one line: ``path safe; no safe return from 9.5 km of it``, and what is missing for more."""
        verdict = verdict_words(self.path_safe, self)
        if self.safe is True:
            return verdict
        if self.safe is None:
            return Note("why_not_judged", verdict=verdict, why=listed(self.not_judged))
        short = self.battery.short if self.battery is not None else ()
        if self.no_return_m < 0.5:
            seq = self.unsafe[0].from_seq if self.unsafe else 0 if self.battery is None else self.battery.no_return_seq
            return Note("no_return_at_item", verdict=verdict, seq=seq)
        if not short:
            return verdict
        if not self.unsafe:
            return Note("no_return_for_battery", verdict=verdict)
        return Note("no_return_for_battery_from", verdict=verdict, short_m=together_m(short))

    @property
    def advice(self) -> Note | None:
        """The parameter and value to set, and what that leaves; None if there is no value to name."""
        if self.route == "mission":
            route = route_setting(self.autopilot, path=self.along_path)
            return Note("set_route", setting=route) if self.starts else None
        then = self.then
        if self.set_rel_home_m is None or then is None:
            return None
        value = setting(self.autopilot, self.set_rel_home_m)
        if self.rally:
            return Note("set_with_rally_points", setting=value, count=len(self.rally), then=then)
        return Note("set_altitude", setting=value, then=then)

    @property
    def then(self) -> Note | None:
        """The verdict with the value to set, and the rally points if there are any; None without a value to set."""
        if self.set_rel_home_m is None:
            return None
        left, legal_m = self.set_leaves_m or 0.0, self.lowest_legal_rel_home_m
        above = Note("above_max_agl", max_agl_m=self.max_agl_m) if self.set_above_max_agl else None
        rally, part = bool(self.rally and self.battery is not None), bool(self.not_judged)
        if left:
            battery = not (self.rally or self.left)
            return Note("then_no_return", left_m=left, battery=battery, above=above, rally=rally, part=part)
        legal = legal_m is not None and self.set_rel_home_m >= legal_m
        return Note("then_return_safe", legal=legal, above=above, rally=rally, part=part)

    @property
    def set_above_max_agl(self) -> bool:
        """Whether a return at the altitude to set is higher above home than the mission may fly above ground."""
        return None not in (self.max_agl_m, self.set_rel_home_m) and self.set_rel_home_m > self.max_agl_m  # type: ignore[operator]

    def as_dict(self, wording: Wording = IN_FILES, *, profile: bool = False) -> dict[str, Any]:
        """Plain values for ``summary.json``; the profile on request."""
        back = self.path_back
        out: dict[str, Any] = {
            "parameter": self.parameter,
            "route": self.route,
            "joins": list(self.starts),
            "path_back": None if back is None else back.text(wording),
            "path_back_data": None if back is None else back.as_dict(),
            "rtl_rel_home_m": self.rtl_rel_home_m,
            "assumed": self.assumed,
            "safe": self.safe,
            "headline": self.headline.text(wording),
            "headline_data": self.headline.as_dict(),
            "no_return_m": self.no_return_m,
            "set_rel_home_m": self.set_rel_home_m,
            "set": [] if self.set_rel_home_m is None else settings(self.autopilot, self.set_rel_home_m),
            "set_leaves_m": self.set_leaves_m,
            "set_above_max_agl": self.set_above_max_agl,
            "lowest_rel_home_m": self.lowest_rel_home_m,
            "highest_rel_home_m": self.highest_rel_home_m,
            "lowest_legal_rel_home_m": self.lowest_legal_rel_home_m,
            "unsafe": [s.as_dict(wording) for s in self.unsafe],
            "irregular": [s.as_dict(wording) for s in self.irregular],
            "battery": None if self.battery is None else self.battery.as_dict(),
            "lowest_agl_m": None if self.lowest is None else self.lowest.agl_m,
            "advised_rel_home_m": self.advised_rel_home_m,
            "proposals": [p.as_dict(wording) for p in self.proposals],
            "rally": [r.as_dict(wording) for r in self.rally],
            "left": [s.as_dict(wording) for s in self.left],
            **in_json("not_judged", self.not_judged, wording),
            **in_json("notes", self.notes, wording),
        }
        if profile:
            out["profile"] = [
                [p.from_m, p.to_m, p.low_amsl_m, p.high_amsl_m, p.clear_amsl_m, p.legal_amsl_m] for p in self.profile
            ]
        return out

    def rows(self) -> list[ReturnRow]:
        """The rows of a table of two columns, below the headline."""
        if self.route == "mission":
            return self._rows_of_mission()
        out = [ReturnRow("judged_at", Note("judged_at", rel_home_m=self.rtl_rel_home_m, assumed=self.assumed))]
        if self.advice is not None:
            out.append(ReturnRow("set", self.advice))
        if self.path_back is not None:
            out.append(ReturnRow("path_back", self.path_back))
        out += [ReturnRow("proposal", p.note) for p in self.proposals if len(self.proposals) > 1]
        out += [ReturnRow("no_return", Note("from_stretch", stretch=s.described())) for s in worst_first(self.unsafe)]
        if self.irregular:
            first, length = self.irregular[0].described(legal=True), self._irregular_m
            from_part = Note("outside_limit_from", length_m=length, first=first)
            out.append(ReturnRow("irregular", from_part if length >= 0.5 else Note("outside_limit_at", first=first)))
        if self.not_judged and not self.unsafe and self.lowest_rel_home_m is None:
            return out + self._last_rows()
        if self.profile:  # else no other altitude was looked for
            out += [
                ReturnRow("clear", _altitudes(self.lowest_rel_home_m, self.highest_rel_home_m)),
                ReturnRow("legal", _altitudes(self.lowest_legal_rel_home_m, None)),
            ]
        out += [
            *self._lowest(),
            *self._battery(),
        ]
        out += [
            ReturnRow(
                "rally",
                Note(
                    "rally_point", lat=r.lat_deg, lon=r.lon_deg, rel_home_m=r.rel_home_m, why=r.why,
                    serves_m=r.serves_m,
                ),
                number,
            )
            for number, r in enumerate(self.rally, start=1)
        ]  # fmt: skip
        left = [Note("from_stretch", stretch=s.place_and_why) for s in worst_first(self.left)]
        return out + [ReturnRow("still_no_return", note) for note in left] + self._last_rows(battery=False)

    def _rows_of_mission(self) -> list[ReturnRow]:
        out: list[ReturnRow] = []
        if self.starts:
            out.append(
                ReturnRow(
                    "judged_as", Note("joined_to_path" if self.along_path else "joined_to_landing", items=self.starts)
                )
            )
        if self.advice is not None:
            out.append(ReturnRow("set", self.advice))
        out += [ReturnRow("no_return", Note("from_stretch", stretch=s.place_and_why)) for s in worst_first(self.unsafe)]
        if self.irregular:
            first = self.irregular[0].place_and_why
            out.append(ReturnRow("irregular", Note("outside_limit_from", length_m=self._irregular_m, first=first)))
        return out + self._last_rows()

    @property
    def _irregular_m(self) -> float:
        return together_m((s.from_m, s.to_m) for s in self.irregular)

    def _last_rows(self, *, battery: bool = True) -> list[ReturnRow]:
        return (self._battery() if battery else []) + [ReturnRow("not_judged", note) for note in self.not_judged]

    def _lowest(self) -> list[ReturnRow]:
        if self.lowest is None:
            return []
        agl_m, at_m, seq = self.lowest.agl_m, self.lowest.at_m, self.lowest.seq
        if agl_m < 0.0:
            return [ReturnRow("lowest", Note("lowest_below_ground", below_m=-agl_m, at_m=at_m, seq=seq))]
        return [ReturnRow("lowest", Note("lowest_on_return", agl_m=agl_m, at_m=at_m, seq=seq))]

    def _battery(self) -> list[ReturnRow]:
        return [] if self.battery is None else [ReturnRow("battery", self.battery.note)]

    def describe(self, wording: Wording = IN_FILES) -> str:
        """All of `rows` and the notes, one per line."""
        lines = [f"{row.label}: {row.note.text(wording)}" for row in self.rows()]
        return "\n".join(lines + [f"note: {note.text(wording)}" for note in self.notes])


def _altitudes(lowest_m: float | None, highest_m: float | None) -> Note:
    if lowest_m is None:
        return Note("no_single_altitude")
    if highest_m is None:
        return Note("from_altitude", lowest_m=lowest_m)
    return Note("between_altitudes", lowest_m=lowest_m, highest_m=highest_m)
