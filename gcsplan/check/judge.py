"""`judge`: judge a mission, decoded as the autopilot stores it, against a world and a vehicle's limits.

The check judges what is flown: wire numbers rounded as on board, and every leg along its whole length, widened by the
track and altitude errors and by the bow between the line straight in the plane and the line straight in degrees.
`extent_of` is what a fence on board must hold of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.check.fixed_wing.ends import is_wing, slant_findings
from gcsplan.check.flight.corners import round_corners
from gcsplan.check.flight.follow import follow_in
from gcsplan.check.flight.times import FlightTimes, spare_s
from gcsplan.check.flight.winds import Costs, FlightInWind
from gcsplan.check.margins import enough, nearest_misses, nearest_pass
from gcsplan.check.motion.flight_state import TERRAIN_ERROR_M
from gcsplan.check.motion.project import PlaneLegs, legs_in_plane, steep_report, why_unknown, with_error_of_home
from gcsplan.check.motion.stretch import Flight, Stretch, degree_m, on_globe
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.mavlink.mission.autopilots import needs_straight, profile_of
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.mavlink.mission.parameter_list import FlightExtent
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.wind.declared import FlightWind
from gcsplan.wind.wording import gusts_note
from gcsplan.world.airspace import LegReport, Legs, Violation
from gcsplan.world.geodesy.frame import EARTH_RADIUS_M, FARTHEST_M
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.world import World

NEAR_DEG = FARTHEST_M / 111_700.0
"""Degrees of latitude, or of longitude anywhere, that are surely no more than `FARTHEST_M`."""

HIGHEST_JUDGED_M = 20_000.0
"""Above any aircraft that gcsplan plans for, m; keeps absurd numbers out of the exact check."""

MEETS_M = 1e-6
"""Altitudes of two pieces of a leg that differ by no more are one, m."""


def judge(
    mission: Mission,
    vehicle: Vehicle,
    world: World,
    *,
    rtl_rel_home_m: float | None = None,
    terrain_error_m: float = TERRAIN_ERROR_M,
    misses: bool = False,
    times: bool = True,
    tuning: Tuning = DEFAULTS,
    wind: FlightWind | None = None,
) -> Verdict:
    """Judge ``mission`` for ``vehicle`` in ``world``; never raises for a mission that is merely unsafe.

    ``misses``: also report how near it comes to each limit (half as much work again). ``times``: without them the legs'
    ``time_s`` are NaN, unless a limit hangs on them; a third of the work. ``tuning``: the parameters that
    decide where the autopilot turns, if they were read from the vehicle. ``wind``: the declared winds, in which it must
    be able to fly, and whose worst counts for its energy; None: still air.
    """
    table = profile_of(mission.autopilot)
    stored = replace(mission, items=tuple(table.stored(item) for item in mission.items))
    flight = follow_in(world, stored, vehicle, rtl_rel_home_m=rtl_rel_home_m, terrain_error_m=terrain_error_m)
    if (unsure := why_unknown(mission.home, vehicle, world)) is not None:
        return Verdict(mission, (), (), (unsure, *flight.not_judged), tuple(flight.notes))
    limits, vehicle = vehicle.limits, with_error_of_home(vehicle, mission.home, world)
    home_error_m = vehicle.limits.altitude_error_m - limits.altitude_error_m
    findings = [*_too_many(mission), *_refused(mission), *_unreached(flight)]
    if not flight.stretches:
        flight.not_judged.append(Note("flies_nowhere"))
        return Verdict(mission, (), tuple(findings), tuple(flight.not_judged), tuple(flight.notes))
    far = [_too_far(s) for s in (*flight.stretches, *flight.others) if _is_too_far(s, world)]
    if far:  # beyond the projected plane and any terrain model that could be loaded
        return Verdict(mission, (), tuple(findings + far), tuple(flight.not_judged), tuple(flight.notes))
    round_corners(flight, stored, vehicle, world.frame, tuning)
    if vehicle.turn_radius_m > 0.0:
        findings += slant_findings([*flight.stretches, *flight.others], vehicle, world)
    plane = legs_in_plane(flight.stretches, vehicle.limits, world, terrain_error_m)
    findings += _unread(flight.stretches, plane)
    report = steep_report(plane, world.airspace.examine(plane.legs, vehicle.limits), vehicle.limits)
    home = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7
    radius_m = {}
    if mission.autopilot is Autopilot.PX4:
        radius_m = {seq: tuning.px4_accepts_m(i)[0] for seq, i in enumerate(stored.items, stored.first_seq)}
    seconds = np.full(len(flight.stretches), math.nan)
    blown: FlightInWind | None = None
    waits = any(s.until_s is not None for s in (*flight.stretches, *flight.others))
    if times or wind or waits or flight.loop_seq is not None or vehicle.energy.base_w:  # the battery depends on them
        clock = FlightTimes(flight.stretches, vehicle, world, home, radius_m)
        seconds = clock.seconds()
        _set_waits(flight, seconds)
        if wind is not None and (not wind.declared.still or wind.late_s) and _judged_in_wind(flight, vehicle, wind):
            agl_m, agl_of = _agl_m(plane, report, len(flight.stretches)), partial(_agl_along_m, world, vehicle.limits)
            blown = FlightInWind(flight.stretches, clock, vehicle, wind, agl_m, agl_of)
    windy = blown is not None and blown.too_windy is None and not blown.wind.still
    costs = blown.costs_so_far if blown is not None and windy else None
    figures = _figures(flight, plane, report, vehicle, world, seconds, costs)
    findings += [*_blown_away(blown), *_missed_gates(flight, seconds, blown)]
    findings += _findings(flight.stretches, plane, report, vehicle.limits, world)
    over = nearest_pass(flight.stretches, plane.legs, plane.owner, vehicle.limits, world)
    near = nearest_misses(flight.stretches, plane.legs, plane.owner, report, vehicle, world) if misses else ()
    flown = [plane.legs]
    if others := flight.others:  # they must be legal too; the figures stay those of the mission
        plane = legs_in_plane(others, vehicle.limits, world, terrain_error_m)
        flown.append(plane.legs)
        findings += _unread(others, plane)
        report = steep_report(plane, world.airspace.examine(plane.legs, vehicle.limits), vehicle.limits)
        findings = _worst(findings, _findings(others, plane, report, vehicle.limits, world))
    flight.notes += _unlike_fitted(flight.stretches, vehicle)
    if any(s.terrain for s in flight.stretches):
        flight.notes.append(Note("reads_terrain_on_board", spacing_m=world.post_spacing_m, error_m=terrain_error_m))
    flight.notes += _terms(mission, vehicle, in_wind=costs is not None)
    if wind is not None and wind.late_s:
        flight.notes.append(Note("departs_late", late_s=wind.late_s))
    verdict = Verdict(
        mission, figures, tuple(findings), tuple(flight.not_judged), tuple(flight.notes), misses=near, zone_pass=over,
        energy_stated=vehicle.energy.stated, paper_energy=vehicle.energy.papers,
        extent=extent_of([*flight.stretches, *others], flown, mission.home, limits, home_error_m),
        in_wind=blown,
    )  # fmt: skip
    return _with_battery(verdict, vehicle, flight, costs)


def _set_waits(flight: Flight, seconds: Floats) -> None:
    """Give each wait until a time of day the seconds that it lasts in still air; in a round, and where it is not known
    when that is flown, these are not judged."""
    rounds = any(s.times > 1 or s.jumped_from is not None for s in flight.stretches)
    now_s = 0.0
    for k, s in enumerate(flight.stretches):
        if s.until_s is not None and rounds:
            flight.not_judged.append(Note("waits_until_time", s.seq))
            flight.stretches[k] = replace(s, until_s=None)
        elif s.until_s is not None:
            flight.stretches[k] = replace(s, hold_s=max(s.until_s - now_s, 0.0))
            now_s = max(s.until_s, now_s)
            continue
        now_s += float(seconds[k]) + s.hold_s
    flight.not_judged += [Note("waits_until_time", s.seq) for s in flight.others if s.until_s is not None]


def _missed_gates(flight: Flight, seconds: Floats, blown: FlightInWind | None) -> list[Finding]:
    """The findings on gates that the vehicle may reach after their second: it would wait there until the next day."""
    found: list[Finding] = []
    opened_s = reached_s = 0.0
    for k, s in enumerate(flight.stretches):
        if s.until_s is None:
            reached_s += float(seconds[k]) + s.hold_s
            continue
        latest_s = reached_s if blown is None or blown.window is None else float(blown.window.latest_s[k - 1])
        by_s = latest_s + spare_s(latest_s - opened_s) - s.until_s
        if by_s > 0.0:
            note = Note("gate_missed", s.seq, latest_s=latest_s, opens_s=s.until_s, by_s=by_s)
            found.append(Finding(s.seq, "gate", note, *on_globe(s.end), latest_s, latest_s - by_s, by_s, "s"))
        opened_s = reached_s = s.until_s
    return found


def _judged_in_wind(flight: Flight, vehicle: Vehicle, wind: FlightWind) -> bool:
    """Whether it is known what the vehicle does in a wind; why not, if not."""
    if not wind.declared.still and vehicle.autopilot is Autopilot.ARDUPLANE and not is_wing(vehicle):
        flight.not_judged.append(Note("vtol_in_wind"))
        return False
    return True


def _terms(mission: Mission, vehicle: Vehicle, *, in_wind: bool) -> Iterator[Note]:
    """The terms on which the verdict stands."""
    if needs_straight(mission.items, mission.autopilot):
        yield Note("straight_legs_until")
    if in_wind:
        yield Note("judged_in_wind")
    if vehicle.energy.papers:
        yield Note("paper_energy")
    if vehicle.limits.max_agl_m is None:
        yield Note("no_ceiling")


def _agl_m(plane: PlaneLegs, report: LegReport, count: int) -> Floats:
    """(N, 2) the lowest and highest height above ground of each stretch; NaN where some of its ground is not known."""
    found = np.tile([math.inf, -math.inf], (count, 1))
    np.minimum.at(found[:, 0], plane.owner, report.min_agl_m)
    np.maximum.at(found[:, 1], plane.owner, report.max_agl_m)
    return found


def _agl_along_m(world: World, limits: Limits, start: Floats, end: Floats) -> Floats:
    """(P, 2) the lowest and highest height above ground of straight ways; NaN where none of its ground is known."""
    report = world.airspace.examine(Legs.between(start, end, limits), limits)
    return np.column_stack([report.min_agl_m, report.max_agl_m])


def _blown_away(blown: FlightInWind | None) -> list[Finding]:
    """The finding on a wind in which the aircraft cannot fly."""
    if blown is None or (bad := blown.too_windy) is None:
        return []
    s, wind = blown.stretches[bad.stretch], blown.flies_in.declared
    lat, lon, amsl = on_globe(s.end)
    note = Note(
        "wind_too_strong", s.seq, way=s.kind, wind_m_s=bad.speed_m_s, from_deg=bad.from_deg,
        gusts=gusts_note(wind), up_to_m_s=bad.up_to_m_s,
    )  # fmt: skip
    by_m_s = wind.strongest_m_s - bad.up_to_m_s
    return [Finding(s.seq, "wind", note, lat, lon, amsl, wind.strongest_m_s, bad.up_to_m_s, by_m_s, "m/s")]


def _unlike_fitted(stretches: Sequence[Stretch], vehicle: Vehicle) -> list[Note]:
    """A note on cruise speeds for which the energy model is not fitted."""
    energy = vehicle.energy
    far = {s.speed_m_s: s.seq for s in reversed(stretches) if s.on_path and energy.unlike_fitted(s.speed_m_s)}
    if not far or energy.fitted_m_s is None:
        return []
    slow, fast = energy.fitted_m_s
    speed = max(far, key=lambda v: max(slow / max(v, 1e-9), v / fast))
    fitted = (slow,) if slow == fast else (slow, fast)
    return [Note("energy_fitted_elsewhere", far[speed], fitted=fitted, speed_m_s=speed)]


def _too_many(mission: Mission) -> list[Finding]:
    """The finding on more items than the autopilot takes."""
    count, most = len(mission.wire_items()), profile_of(mission.autopilot).max_items
    if most is None or count <= most:
        return []
    note = Note("too_many_items", count=count, autopilot=mission.autopilot.value, most=most)
    return [_finding(0, "too_many_items", note, float(count), float(most), float(count - most), "items")]


def _refused(mission: Mission) -> list[Finding]:
    """Findings for the items that the autopilot does not accept: the upload would end at the first of them."""
    refuses, found = profile_of(mission.autopilot).refuses, []
    for seq, item in enumerate(mission.items, mission.first_seq):
        if why := refuses(item):
            note = Note("refused_on_upload", seq, why=why)
            found.append(_finding(seq, "refused", note, float(item.frame), math.nan, math.nan, ""))
    return found


def _unreached(flight: Flight) -> list[Finding]:
    """Findings for the items after a hold or a loop without end."""
    return [
        _finding(u.first, "unreachable", u.note, float(u.last - u.first + 1), 0.0, math.nan, "items")
        for u in flight.unreached
    ]


def _unread(stretches: Sequence[Stretch], plane: PlaneLegs) -> list[Finding]:
    """Findings for terrain-frame legs over ground that the vehicle's grid does not know."""
    found = []
    for s in (stretches[i] for i in plane.unread):
        lat, lon, amsl = on_globe(s.end)
        note = Note("over_ground_unread", s.seq, way=s.kind, lat=lat, lon=lon, amsl_m=amsl)
        found.append(Finding(s.seq, "coverage", note, lat, lon, amsl, math.nan, math.nan, math.nan, "m"))
    return found


def _is_too_far(stretch: Stretch, world: World) -> bool:
    """Whether it leads beyond `FARTHEST_M` from the frame's origin, off the globe, or beyond `HIGHEST_JUDGED_M`."""
    frame = world.frame
    lat0, lon0 = math.radians(frame.lat_deg), math.radians(frame.lon_deg)
    for lat_deg, lon_deg, amsl_m in (stretch.start, stretch.end):
        beside_deg = abs(lat_deg - frame.lat_deg) + abs(lon_deg - frame.lon_deg)
        if beside_deg <= NEAR_DEG and abs(lat_deg) <= 90.0 and abs(amsl_m) <= HIGHEST_JUDGED_M:
            continue
        lat, lon = math.radians(lat_deg), math.radians(lon_deg)
        h = math.sin(0.5 * (lat - lat0)) ** 2 + math.cos(lat) * math.cos(lat0) * math.sin(0.5 * (lon - lon0)) ** 2
        away_m = 2.0 * EARTH_RADIUS_M * math.asin(math.sqrt(min(max(h, 0.0), 1.0)))
        if abs(lat_deg) > 90.0 or not (away_m <= FARTHEST_M and abs(amsl_m) <= HIGHEST_JUDGED_M):
            return True
    return not (stretch.reach_m <= FARTHEST_M and stretch.band_m <= HIGHEST_JUDGED_M)


def _too_far(s: Stretch) -> Finding:
    lat, lon, amsl = on_globe(s.end)
    note = Note("too_far_away", s.seq, way=s.kind, lat=lat, lon=lon, amsl_m=amsl)
    return Finding(s.seq, "coverage", note, lat, lon, amsl, math.nan, math.nan, math.nan, "m")


def _figures(
    flight: Flight, plane: PlaneLegs, report: LegReport, vehicle: Vehicle, world: World, seconds: Floats,
    costs: Costs | None,
) -> tuple[LegFigures, ...]:  # fmt: skip
    """The figures of each stretch; ``costs``: what they take in declared winds, None in still air."""
    energy = vehicle.energy
    delta = plane.legs.end - plane.legs.start
    runs, rises = np.hypot(delta[:, 0], delta[:, 1]), delta[:, 2]
    # The ground that the vehicle reads may step from one degree tile to the next, so a leg's pieces need not meet.
    apart_m = np.abs(plane.legs.start[1:, 2] - plane.legs.end[:-1, 2])
    steps = np.append(0.0, np.where((plane.owner[1:] == plane.owner[:-1]) & (apart_m > MEETS_M), apart_m, 0.0))
    edges = np.searchsorted(plane.owner, np.arange(len(flight.stretches) + 1))
    alone = len(plane.owner) == len(flight.stretches)

    def each(of: Callable[[Floats], float], values: Floats) -> list[float]:
        """A number for each stretch from the numbers of its legs; most stretches have one leg alone."""
        return values.tolist() if alone else [of(values[a:b]) for a, b in pairwise(edges.tolist())]

    def first(of: Callable[[Floats], np.intp], values: Floats) -> Indices:
        """The leg of each stretch that ``of`` finds among its own."""
        return edges[:-1] if alone else np.array([a + of(values[a:b]) for a, b in pairwise(edges.tolist())], np.intp)

    lows = first(_lowest, report.min_agl_m)
    at = np.where(np.isnan(report.min_agl_m[lows]), 0.0, report.min_agl_at[lows])
    low_en = plane.legs.start[lows, :2] + at[:, None] * (plane.legs.end[lows, :2] - plane.legs.start[lows, :2])
    near, steepest = first(np.argmin, report.zone_clearance_m), first(np.argmax, np.abs(report.climb_deg))
    ends = plane.legs.end[edges[1:] - 1]
    ways = (ends - plane.legs.start[edges[:-1]])[:, :2].tolist()
    known = ~np.isnan(report.min_agl_m)
    rows = zip(
        flight.stretches, each(np.sum, runs), each(np.sum, np.hypot(runs, rises) + steps),
        each(np.sum, np.abs(rises) + steps),
        report.climb_deg[steepest].tolist(), world.airspace.surface.ground_at(ends[:, 0], ends[:, 1]).tolist(),
        each(_least, report.min_agl_m), world.frame.to_degrees(low_en[:, 0], low_en[:, 1]).tolist(),
        each(_most, np.where(known, report.max_agl_m, math.nan)), report.zone_clearance_m[near].tolist(),
        report.nearest_zone[near].tolist(), seconds.tolist(), strict=True,
    )  # fmt: skip
    figures = []
    for i, row in enumerate(rows):
        s, run_m, length_m, rise_m, climb_deg, ground_m, agl_m, low_deg, top_m, clear_m, zone, time_s = row
        hold_s = 0.0 if math.isinf(s.hold_s) else s.hold_s
        held_s, air_m, worst_s = hold_s, float(run_m), time_s
        if costs is not None:
            held_s, air_m, worst_s = float(costs.hold_s[i]), float(costs.air_m[i]), float(costs.seconds[i])
        hold_j = _hold_w(vehicle, s, costs, i) * held_s
        moving_j = energy.under_way_j(float(rise_m), air_m, worst_s)
        figures.append(
            LegFigures(
                seq=s.seq, kind=s.kind, start=on_globe(s.start), end=on_globe(s.end),
                column=s.column, on_path=s.on_path,
                horizontal_m=float(run_m),
                length_m=float(length_m),
                climb_deg=climb_deg,
                agl_end_m=s.end[2] - ground_m,
                min_agl_m=agl_m,
                min_agl_at=(low_deg[0], low_deg[1]),
                max_agl_m=top_m,
                zone_clearance_m=clear_m,
                nearest_zone=world.airspace.zones[zone].name if zone >= 0 else "",
                energy_j=moving_j + hold_j,
                time_s=time_s + hold_s,
                hold_s=s.hold_s,
                hold_j=hold_j,
                times=s.times,
                jumped_from=s.jumped_from,
                lead_j=_lead_j(vehicle, s, float(run_m), worst_s, 0.0 if costs is None else float(costs.wind_m_s[i])),
                speed_m_s=s.speed_m_s,
                until_s=s.until_s,
                way_m=(ways[i][0], ways[i][1]),
            )
        )  # fmt: skip
    return tuple(figures)


def _lowest(agl_m: Floats) -> np.intp:
    """The leg that is lowest above known ground; the first if none is over known ground."""
    known = np.flatnonzero(~np.isnan(agl_m))
    return known[agl_m[known].argmin()] if len(known) else np.intp(0)


def _least(agl_m: Floats) -> float:
    return float(np.fmin.reduce(agl_m))


def _most(agl_m: Floats) -> float:
    return float(np.fmax.reduce(agl_m))


BROKEN_HEIGHTS = {
    "min_agl": "too_low",
    "max_agl": "too_high",
    "max_amsl": "above_ceiling",
    "terrain_clearance": "near_rising_ground",
}
BROKEN_ANGLES = {"climb": "climbs_too_steeply", "descent": "descends_too_steeply"}
"""The notes on limits of height and of angle, by the kind of the violation."""


def _worst(findings: list[Finding], more: list[Finding]) -> list[Finding]:
    """``findings`` plus ``more``; one of ``more`` replaces a lesser finding of the same kind, item and zone."""
    kept = {(f.seq, f.kind, f.zone): f for f in reversed(findings)}
    for f in more:
        key = (f.seq, f.kind, f.zone)
        if key not in kept:
            findings = [*findings, f]
        elif f.by > kept[key].by:
            findings = [f if g is kept[key] else g for g in findings]
        if key not in kept or f.by > kept[key].by:
            kept[key] = f
    return findings


def _findings(
    stretches: Sequence[Stretch], plane: PlaneLegs, report: LegReport, limits: Limits, world: World
) -> list[Finding]:
    """The worst violation of each kind and zone on each stretch, in the order flown."""
    worst: dict[tuple[int, str, int], Violation] = {}
    broken: dict[tuple[int, str, int], list[int]] = {}
    for v in report.violations:
        # All parts of one outside are one limit: the worst counts.
        outside = world.airspace.zones[v.zone].outside if v.zone >= 0 else None
        key = (int(plane.owner[v.leg]), v.kind, v.zone if outside is None else -2)
        broken.setdefault(key, []).append(v.leg)
        if key not in worst or v.by > worst[key].by:
            worst[key] = v
    found = []
    for (owner, kind, key_zone), v in sorted(worst.items(), key=lambda kv: kv[0][0]):
        s = stretches[owner]
        v = enough(v, np.array(broken[owner, kind, key_zone]), plane.legs, limits, world.airspace)
        lat, lon = (float(x) for x in world.frame.to_degrees(v.east_m, v.north_m))
        zone = world.airspace.zones[v.zone] if v.zone >= 0 else None
        name = "" if zone is None else zone.name_at(v.east_m, v.north_m)
        note = _note_of(s, v, name, (lat, lon), inside=zone is not None and zone.outside is not None)
        found.append(Finding(s.seq, kind, note, lat, lon, v.amsl_m, v.value, v.limit, v.by, v.unit, name))
    return found


def _note_of(s: Stretch, v: Violation, zone: str, at: tuple[float, float], *, inside: bool) -> Note:
    """The note on a violation on a stretch; ``at``: latitude and longitude; ``inside``: the zone is to stay in."""
    way = s.kind if s.jumped_from is None else Note("after_jump", way=s.kind, jump=s.jumped_from)
    lat, lon = at
    if v.kind == "coverage":
        return Note("over_unknown_ground", s.seq, way=way, lat=lat, lon=lon, amsl_m=v.amsl_m)
    if v.kind == "zone":
        return Note(
            "outside_keep_in" if inside else "inside_zone", s.seq, way=way, zone=zone, by_m=v.by, lat=lat, lon=lon,
            amsl_m=v.amsl_m,
        )  # fmt: skip
    if v.kind in BROKEN_ANGLES:
        return Note(
            BROKEN_ANGLES[v.kind], s.seq, way=way, value_deg=v.value, limit_deg=v.limit, by_deg=v.by, lat=lat, lon=lon,
            amsl_m=v.amsl_m,
        )  # fmt: skip
    return Note(
        BROKEN_HEIGHTS[v.kind],
        s.seq,
        way=way,
        value_m=v.value,
        limit_m=v.limit,
        by_m=v.by,
        lat=lat,
        lon=lon,
        amsl_m=v.amsl_m,
    )


def _with_battery(verdict: Verdict, vehicle: Vehicle, flight: Flight, costs: Costs | None) -> Verdict:
    energy = vehicle.energy
    if energy.battery_j is None:
        return verdict
    used, usable = verdict.energy_j, (1.0 - energy.reserve) * energy.battery_j
    verdict = replace(verdict, battery_used_percent=100.0 * used / energy.battery_j)
    last = verdict.legs[-1]
    if used > usable:
        note = Note(
            "battery_not_enough", needs_j=used, usable_j=usable, battery_j=energy.battery_j,
            reserve_percent=100 * energy.reserve, windy=costs is not None,
        )  # fmt: skip
        finding = _finding(last.seq, "battery", note, used, usable, used - usable, "J")
        return replace(verdict, findings=(*verdict.findings, finding))
    power_w = _power_w(verdict, vehicle, flight, costs)
    if power_w is None:
        return verdict
    if power_w <= 0.0:
        return replace(verdict, notes=(*verdict.notes, Note("battery_lasts_unknown", last.seq)))
    left_s = (usable - used) / power_w
    note = Note("battery_until_reserve", last.seq, loop=flight.loop_seq is not None, left_s=left_s)
    return replace(verdict, notes=(*verdict.notes, note), until_reserve_s=left_s)


def _power_w(verdict: Verdict, vehicle: Vehicle, flight: Flight, costs: Costs | None) -> float | None:
    """The power, W, of a mission's last hold or round if that has no end; None if the mission ends."""
    if flight.loop_seq is not None:
        begun = max((i for i, leg in enumerate(verdict.legs) if leg.jumped_from == flight.loop_seq), default=0)
        round_ = verdict.legs[begun:]
        seconds = math.fsum(leg.time_s * leg.times for leg in round_)
        return math.fsum(leg.energy_j * leg.times for leg in round_) / seconds if seconds > 0.0 else 0.0
    last = flight.stretches[-1]
    if not math.isinf(last.hold_s):
        return None
    return _hold_w(vehicle, last, costs, -1)


def _hold_w(vehicle: Vehicle, s: Stretch, costs: Costs | None, number: int) -> float:
    """The power, W, of the hold at the end of a stretch: of hovering in the strongest wind, or of circling if that
    takes more; ``number`` is the stretch's in ``costs``."""
    circling = s.kind == "loiter" and s.reach_m > 0.0
    wind_m_s = 0.0 if costs is None or vehicle.keeps_airspeed else float(costs.wind_m_s[number])
    return vehicle.energy.hold_w(wind_m_s + (s.speed_m_s if circling else 0.0))


def _lead_j(vehicle: Vehicle, s: Stretch, run_m: float, time_s: float, wind_m_s: float) -> float:
    """Joules of base power by which a stretch may be ahead of an even share of its energy, in winds up to a speed.

    From any place on it the rest takes at least the rest's metres at top speed. So by then no more time has passed than
    the even share at top speed and the whole of what the stretch takes longer.
    """
    base_w = vehicle.energy.base_w
    if not base_w or not s.speed_m_s > 0.0:
        return 0.0
    top_m_s = vehicle.fastest_over_ground_m_s(s.speed_m_s, max(s.start[2], s.end[2]))
    top_m_s += wind_m_s if vehicle.keeps_airspeed else 0.0
    return base_w * max(0.0, time_s - run_m / top_m_s)


def _finding(seq: int, kind: str, note: Note, value: float, limit: float, by: float, unit: str) -> Finding:
    return Finding(seq, kind, note, math.nan, math.nan, math.nan, value, limit, by, unit)


def extent_of(
    stretches: Sequence[Stretch], legs: Sequence[Legs], home: Home, limits: Limits, home_error_m: float = 0.0
) -> FlightExtent:
    """The extent of ``stretches``, at least one, with the errors of ``limits`` and what widens each of them.

    ``legs``: the same in the plane, where those of the terrain frame follow the ground; their errors of height count,
    but for ``home_error_m``, which moves home and all heights above it alike. The ground at home is part of it.
    """
    ends = np.array([(*s.start, *s.end) for s in stretches])
    lat, lon = ends[:, [0, 3]], ends[:, [1, 4]]
    home_lat, home_lon = home.lat_e7 / 1e7, home.lon_e7 / 1e7
    north_m = degree_m(0.5 * (home_lat + float(lat.mean())))[1]
    east_m = degree_m(float(np.abs(np.append(lat, home_lat)).min()))[0]  # the longest of the flight's degrees
    away_m = np.hypot(east_m * ((lon - home_lon + 180.0) % 360.0 - 180.0), north_m * (lat - home_lat)).max(axis=1)
    reach_m = float((away_m + np.array([s.reach_m for s in stretches])).max()) + limits.track_error_m
    top_m, bottom_m = -np.inf, home.amsl_m - limits.altitude_error_m
    for part in legs:
        error_m = part.altitude_error_m - home_error_m
        top_m = max(top_m, float((np.maximum(part.start[:, 2], part.end[:, 2]) + error_m).max()))
        bottom_m = min(bottom_m, float((np.minimum(part.start[:, 2], part.end[:, 2]) - error_m).min()))
    return FlightExtent(top_m - home.amsl_m, bottom_m - home.amsl_m, reach_m)
