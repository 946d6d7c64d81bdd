"""A fixed wing's climb-out: straight and slanting, where a multicopter has a column; and what lines up and down keep.

What ArduPlane does (commands_logic.cpp, `do_takeoff`, `verify_takeoff`; takeoff.cpp): once it is fast, it records the
course over ground on which it was launched and holds its nose on that heading, so a cross wind carries it aside. It
climbs with the pitch of param1 (4° if that is 0). With an airspeed sensor that is the least pitch: with power to spare
it climbs at up to TECS_PITCH_MAX (15°; its path is steeper still: 23° flown), so the space between the slant and the
item's altitude is judged too. At the item's altitude, wherever that is, it turns and flies straight to the next item,
not along the leg from the item's place: one that climbs well is there early (`turns_early`). The mission holds no
heading, so the climb-out is judged towards the item's place, as maps draw it; if the item has no place, towards the
next item.

In declared winds (`Vehicle.blows_m_s`) the slant is the one over ground with the strongest wind behind, for a wind adds
to the speed over ground and not to the climb. The climb-out and the ways from it to the next item are widened by how
far a wind across its heading carries it aside (`drift_m`).

Climb-outs and glides (`glide`) are exempt from min AGL, climb angle and terrain clearance, as columns are; never from
zones, their clearance and ceilings. They must keep a clearance over the ground and what stands on it: the altitude
error. Near the ends, where that is more than half of the height above the touch point, the aircraft is over the landing
strip: there it keeps that half, over bare ground.

`climbed`: the speeds of the climb-out, where the vehicle says how it climbs (`vehicle.ClimbOut`). It climbs at its own
speed, is at the altitude of its take-off long before the slant of its least pitch is, levels off there, and slows down
to its cruise speed. The slant stays the climb-out's line, for with less power it is flown; its pieces get the speeds
over ground at which their places are passed.

A VTOL (quadplane.cpp; Q_ENABLE 1) flies a mission's way points on its wing; take-off and landing items alone are flown
on its lift motors (`in_vtol_auto`). At the top of its take-off it speeds up where its nose points, and no item turns it
there (`sets_off`). To its landing it flies on at the altitude that it has (`do_vtol_land`), and brakes over v²/2a
(`stopping_distance`, Q_TRANS_DECEL): begun nearer to its place than that, it flies past, and back (`level_approach`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, takewhile

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.motion.circles import circle_growth, circle_reach_m
from gcsplan.check.motion.flight_state import Aboard
from gcsplan.check.motion.spline import towards
from gcsplan.check.motion.stopping import about_turn_m
from gcsplan.check.motion.stretch import SAME_PLACE_M, Place, Stretch, degree_m, flat_m, offset_m, on_globe, place_on
from gcsplan.check.motion.turn_parameters import DEFAULTS
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import BRAKES_M_S2, OVER_TAKEOFF_M, Autopilot, ClimbOut, Vehicle
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geodesy.atmosphere import true_per_indicated
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.world import World

LEAST_PITCH_DEG = 4.0
"""ArduPlane's pitch if the item has none."""

NO_COURSE_M = 1.0
"""An item this near to home, m, does not define the direction of a climb-out."""

CLEARANCE_PART = 0.5
"""The part of its height that the aircraft needs as clearance while it is too low for the full altitude error."""


OVER_S, OVER_FROM = 2.0, 0.15
"""How far above the altitude of its take-off an aircraft with much power gets, for it levels off late: flown were 11 to
18 m, 1.4 to 1.8 s of its mean climb rate. `OVER_TAKEOFF_M` metres if that rate is not known, otherwise its seconds; and
from which part of its climb-out on."""

MOST_BANDS = 24
"""Most level bands into which the space above a climb-out is divided."""

REACHED_M = 5.0
"""LOITER_TO_ALT counts an altitude as reached within this, m (navigation.cpp, `loiter_angle_update`)."""

CIRCLE_CHORD_M = 2.0
"""How far the chords of a climbing circle may lie inside it, m."""

BOUND_M = 0.05
"""Violations up to this, m, are ignored: the exact check bounds the ground beside a line, at times a few centimetres
too high, and the aircraft stands on it."""


def is_wing(vehicle: Vehicle) -> bool:
    """Return whether the vehicle takes off and lands on its wing."""
    return vehicle.turn_radius_m > 0.0 and not vehicle.vtol


def climb_out(pilot: Aboard, seq: int, item: MissionItem, after: MissionItem | None) -> None:
    """NAV_TAKEOFF: straight ahead until the item's altitude is reached; ``after``: the next item that is flown to."""
    lat, lon, ground = pilot.home
    top = pilot.altitude(item, (lat, lon, ground))
    ahead = place_of(pilot, item)
    if ahead is None and after is not None:
        ahead = place_of(pilot, after)
        pilot.note(Note("climb_out_towards_next", seq))
    pilot.airborne = True
    frame = m.FRAME_SYNONYMS.get(item.frame, item.frame)
    if ahead is None or top is None or top <= ground or frame == m.TERRAIN:
        pilot.flight.not_judged.append(Note("climb_out_unclear", seq))
        pilot.known = False
        return
    pitch = item.params[0] if item.params[0] > 0.0 else LEAST_PITCH_DEG
    climb_deg = min(pitch, pilot.vehicle.steepest_in_air_deg)
    in_air_m = (top - ground) / math.tan(math.radians(climb_deg))
    run_m = in_air_m / pilot.vehicle.tail_ratio
    end = ahead
    for _ in range(2):  # metres per degree change with the latitude, so the first end is millimetres off
        part = run_m / flat_m((lat, lon, 0.0), end)
        end = (lat + part * (end[0] - lat), lon + part * (end[1] - lon), top)
    known = pilot.vehicle.climb_out
    counted = Note("climb_as_judged") if known is None else Note("climb_as_given", climb_m_s=known.climb_m_s)
    heading_deg = _bearing(pilot.home, ahead)
    pilot.note(
        Note("climb_out_straight", seq, climb_deg=climb_deg, heading_deg=heading_deg, run_m=run_m, counted=counted)
    )
    aside_m, from_part = drift_of(pilot.vehicle, *offset_m(pilot.home, end))
    if pilot.vehicle.blows_m_s:
        pilot.note(Note("climb_out_blown", seq, drift_m=aside_m, wind_m_s=pilot.vehicle.wind_m_s))
    else:
        pilot.note(Note("climb_out_drifts", seq, drift_m=in_air_m / max(pilot.pace.speed_m_s, 1.0)))
    pilot.add(seq, "takeoff", pilot.home, end, column=True)
    for low, high, reach_m in blown_slant(pilot.home, end, aside_m, from_part):
        pilot.instead(seq, "takeoff", low, high, column=True, reach_m=reach_m)
    for low, high, band_m in above_slant(pilot.home, end, pilot.vehicle.limits, over_m(pilot.vehicle)):
        pilot.instead(seq, "takeoff", low, high, column=True, band_m=band_m, reach_m=aside_m)
    pilot.at, pilot.direction = end, towards(pilot.home, end)


BLOWN_PARTS = 4
"""Parts of a climb-out, each as wide as it is blown aside at its end."""


def drift_m(vehicle: Vehicle, ground: Place, top: Place) -> float:
    """How far the declared winds carry a climb-out aside until its top, m; 0 in still air."""
    return drift_of(vehicle, *offset_m(ground, top))[0]


def drift_of(vehicle: Vehicle, east_m: float, north_m: float) -> tuple[float, float]:
    """As `drift_m`, by the way over ground from the start to the top; and the part of it on which it may be so far.

    The climb takes as long as its way through the air at the slowest speed; against a wind it is on a shorter way.
    """
    course, slowest = math.atan2(north_m, east_m), vehicle.speed_min_m_s
    seconds = math.hypot(east_m, north_m) * vehicle.tail_ratio / slowest
    against = max(1.0 - vehicle.tail_m_s(course + math.pi) / slowest, 0.0)
    return seconds * vehicle.aside_m_s(course), vehicle.tail_ratio * against


def blown_slant(ground: Place, top: Place, aside_m: float, from_part: float) -> list[tuple[Place, Place, float]]:
    """A climb-out that is carried aside by ``aside_m``, from a part of its way on: parts, and how far each is carried.

    Without parts if it is not carried. A place may be any three numbers.
    """
    if not aside_m > 0.0:
        return []
    ends = [k / BLOWN_PARTS for k in range(BLOWN_PARTS + 1)]
    at = [place_on(ground, top, part) for part in ends]
    carried = [aside_m * min(1.0, part / max(from_part, 1e-9)) for part in ends]
    return [(at[k], at[k + 1], carried[k + 1]) for k in range(BLOWN_PARTS)]


def above_slant(ground: Place, top: Place, limits: Limits, over_m: float) -> list[tuple[Place, Place, float]]:
    """The space between a climb-out and the altitude of its end, as level lines and half the heights of their bands.

    A place may be any three numbers. The altitude errors cover the gaps between the bands and the slant. ``over_m``:
    how far above its end the space reaches, from the altitude error on (`over_m`).
    """
    rise = top[2] - ground[2]
    parts = min(max(1, math.ceil(0.5 * rise / max(limits.altitude_error_m, 0.1))), MOST_BANDS)
    found = []
    for i in range(parts - 1):
        a, b, half = i / parts, (i + 1) / parts, 0.5 * rise * (1.0 - (i + 1) / parts)
        low, high = (
            (ground[0] + f * (top[0] - ground[0]), ground[1] + f * (top[1] - ground[1]), top[2] - half) for f in (a, b)
        )
        found.append((low, high, half))
    if (half := over_m / 2.0) > 0.0:
        found.append(((*place_on(ground, top, OVER_FROM)[:2], top[2] + half), (*top[:2], top[2] + half), half))
    return found


def over_m(vehicle: Vehicle) -> float:
    """How far above its take-off's altitude, and beyond the altitude error, an aircraft may get."""
    over = OVER_TAKEOFF_M if vehicle.climb_out is None else OVER_S * vehicle.climb_out.climb_m_s
    return max(0.0, over - vehicle.limits.altitude_error_m)


def circle_up(pilot: Aboard, seq: int, item: MissionItem, radius_m: float) -> bool:
    """Continue the take-off in circles: LOITER_TO_ALT right after a climb-out that ends on its circle.

    Return False and change nothing otherwise. The aircraft may be anywhere within the circle, as low as the
    climb-out ended.
    """
    before = pilot.flight.stretches[-1] if pilot.flight.stretches else None
    target = pilot.target(item) if pilot.has_place(item) else None
    if before is None or target is None or not slants([before]) or before.kind != "takeoff":
        return False
    reach_m = circle_reach_m(radius_m, target[2], pilot.vehicle.speed_max_m_s, pilot.vehicle.wind_m_s)
    if target[2] <= pilot.at[2] or flat_m(pilot.at, target) > reach_m:
        return False
    low = (*target[:2], pilot.at[2])
    turns = -1.0 if item.params[1] < 0.0 else 1.0
    for a, b in pairwise(_helix(pilot.at, target, radius_m, turns, pilot.vehicle.limits.max_climb_slope)):
        pilot.add(seq, "takeoff", a, b, column=True, reach_m=reach_m - radius_m + CIRCLE_CHORD_M)
    pilot.add(seq, "takeoff", target, target, reach_m=reach_m)
    blown_m = drift_m(pilot.vehicle, pilot.home, pilot.at)
    pilot.instead(seq, "takeoff", low, target, column=True, reach_m=reach_m + blown_m)
    # A climb that is steeper than judged reaches these altitudes before the circle.
    middle, half = 0.5 * (low[2] + target[2]), 0.5 * (target[2] - low[2])
    start, end = ((*place[:2], middle) for place in (pilot.home, pilot.at))
    pilot.instead(seq, "takeoff", start, end, column=True, band_m=half, reach_m=blown_m)
    pilot.note(Note("climb_out_circles", seq, reach_m=reach_m))
    pilot.low_m, pilot.around_m = min(REACHED_M, target[2] - low[2]), reach_m
    pilot.at, pilot.direction = target, None
    return True


def _helix(begin: Place, top: Place, radius_m: float, turns: float, slope: float) -> list[Place]:
    """A climb from ``begin`` to the altitude of ``top`` on a circle around it; ``turns`` 1: clockwise."""
    east_m, north_m = degree_m(top[0])
    east, north = offset_m(top, begin)
    angle = math.atan2(north, east)
    whole = (top[2] - begin[2]) / slope / radius_m
    parts = max(1, math.ceil(whole / (2.0 * math.acos(max(0.0, 1.0 - CIRCLE_CHORD_M / radius_m)))))
    places = [begin]
    for i in range(1, parts + 1):
        now, z = angle - turns * whole * i / parts, begin[2] + (top[2] - begin[2]) * i / parts
        flat = radius_m * math.sin(now) / north_m, radius_m * math.cos(now) / east_m
        places.append((top[0] + flat[0], top[1] + flat[1], z))
    return places


def slants(stretches: Sequence[Stretch]) -> list[Stretch]:
    """The stretches that leave the ground or come down to it on a slant."""
    return [
        s for s in stretches if s.column and s.kind in ("takeoff", "land") and flat_m(s.start, s.end) > SAME_PLACE_M
    ]


def slant_findings(stretches: Sequence[Stretch], vehicle: Vehicle, world: World) -> list[Finding]:
    """Findings where a climb-out or a glide is too near to the ground or too steep."""
    found = []
    for s in stretches:
        if s.column and s.kind == "takeoff" and s.reach_m > 0.0 and flat_m(s.start, s.end) <= SAME_PLACE_M:
            east, north, amsl = (float(x) for x in _one(s.start, world))
            by = circle_missing_m(np.array([east, north, amsl]), s.reach_m, vehicle.limits, world.airspace)
            if by > BOUND_M:
                found.append(_low(s, east, north, amsl, by, world))
    home = {"takeoff": 0, "land": -1}
    for kind in ("takeoff", "land"):
        mine = [s for s in slants(stretches) if s.kind == kind]
        if not mine:
            continue
        touch = mine[home[kind]]
        point = touch.start if kind == "takeoff" else touch.end
        for s in mine:
            worst = slant_shortage(_in_plane(s, world), _one(point, world), s.reach_m, vehicle.limits, world.airspace)
            if worst is not None:
                found.append(_low(s, *worst, world))
            steep = math.degrees(math.atan2(s.start[2] - s.end[2], max(flat_m(s.start, s.end), 1e-9)))
            limit = vehicle.limits.max_descent_deg
            if kind == "land" and s is mine[0] and steep > limit * 1.01 + 0.01:
                note = Note("glides_too_steeply", s.seq, way="land", value_deg=steep, limit_deg=limit)
                found.append(Finding(s.seq, "descent", note, *on_globe(s.start), steep, limit, steep - limit, "deg"))
    return found


def slant_shortage(
    line: Floats, touch: Floats, reach_m: float, limits: Limits, air: Airspace
) -> tuple[float, float, float, float] | None:
    """The worst place where ``line`` (2, 3), rising from ``touch`` (3,) or falling to it, is too near to the ground.

    Return (east, north, amsl, metres missing), or None if the line is high enough everywhere. The required clearance
    rises linearly from 0 at ``touch`` to the altitude error and then stays, so each of the two parts of the line,
    lowered by its clearance, is straight. Over the strip, the lower part, bare ground counts; beyond it obstacles too.
    """
    a, b = (line[0], line[1]) if line[0, 2] <= line[1, 2] else (line[1], line[0])
    rise = float(b[2] - a[2])
    if rise <= 0.0:
        return None
    error = limits.altitude_error_m
    begun = float(a[2] - touch[2])

    def clearance(z: float) -> float:
        return min(error, CLEARANCE_PART * max(z - float(touch[2]), 0.0))

    split = min(max((error / CLEARANCE_PART - begun) / rise, 0.0), 1.0)
    middle = a + split * (b - a)
    plain, bad = Limits(min_agl_m=0.0), []
    for p, q in ((a, middle), (middle, b)):
        if float(np.linalg.norm(q - p)) <= 1e-6:
            continue
        start, end = p - [0.0, 0.0, clearance(p[2])], q - [0.0, 0.0, clearance(q[2])]
        low = p[2] - touch[2] < error / CLEARANCE_PART - 1e-9
        # So near to the touch point the aircraft is over the landing strip: no track error.
        track = np.array([reach_m if low else limits.track_error_m + reach_m])
        leg = Legs(start[None], end[None], np.zeros(1, bool), track, np.zeros(1))
        found = (bare(air) if low else air).examine(leg, plain).violations
        bad += [v for v in found if v.kind in ("min_agl", "coverage") and v.by > BOUND_M]
    if not bad:
        return None
    worst = max(bad, key=lambda v: v.by)
    return worst.east_m, worst.north_m, worst.amsl_m, worst.by


def circle_missing_m(low: Floats, reach_m: float, limits: Limits, air: Airspace) -> float:
    """By how much a circle around ``low`` (3,) is too near to ground and what stands on it, m; inf where unknown."""
    plain = Limits(
        min_agl_m=0.0, track_error_m=limits.track_error_m + reach_m, altitude_error_m=limits.altitude_error_m
    )
    return float(air.floor_amsl(low[0], low[1], plain)) - float(low[2])


def bare(air: Airspace) -> Airspace:
    """The airspace over the greatest bare ground: what stands beside the landing strip does not count."""
    surface = air.surface
    if surface.top_m is surface.high_m:
        return air
    return Airspace(Surface(surface.ground_m, surface.high, surface.grid, high_m=surface.high), (), scale=air.scale)


def beside_strip(air: Airspace) -> Note | None:
    """A note on obstacles for a refused climb-out or glide, with a cure; None over bare ground."""
    return None if air.surface.top_m is air.surface.high_m else Note("obstacles_beside_strip")


def _low(s: Stretch, east: float, north: float, amsl: float, by: float, world: World) -> Finding:
    lat, lon = (float(x) for x in world.frame.to_degrees(east, north))
    note = Note(
        "near_ground_on_slant", s.seq, way=s.kind, glide=s.kind != "takeoff", by_m=by, lat=lat, lon=lon, amsl_m=amsl,
        obstacles=beside_strip(world.airspace),
    )  # fmt: skip
    return Finding(s.seq, "min_agl", note, lat, lon, amsl, -by, 0.0, by, "m")


def place_of(pilot: Aboard, item: MissionItem) -> Place | None:
    if not pilot.has_place(item):
        return None
    place = (*pilot.place(item), 0.0)
    return place if flat_m(pilot.home, place) > NO_COURSE_M else None


def _bearing(a: Place, b: Place) -> float:
    east = (b[1] - a[1]) * math.cos(math.radians(a[0]))
    return math.degrees(math.atan2(east, b[0] - a[0])) % 360.0


def _one(p: Place, world: World) -> Floats:
    return np.array([*world.frame.to_plane(p[0], p[1]), p[2]])


def _in_plane(s: Stretch, world: World) -> Floats:
    return np.array([_one(s.start, world), _one(s.end, world)])


STEEPEST_DEG = 45.0
"""No aircraft climbs out more steeply; 30° were flown in simulation, with TECS_PITCH_MAX 25."""

OVER_FOR_M = 150.0
"""It is above the altitude of its take-off for so many metres after it was there first."""


def turns_early(pilot: Aboard, seq: int, after: MissionItem | None) -> None:
    """The ways to the next item from all places of the climb-out at which the aircraft may be at its altitude."""
    if after is None or not pilot.known or place_of(pilot, after) is None or after.command == cmd.LOITER_TO_ALT:
        return
    target = pilot.target(after)
    if target is None:
        return
    home, end = pilot.home, pilot.at
    first = min((end[2] - home[2]) / math.tan(math.radians(STEEPEST_DEG)) / flat_m(home, end), 1.0)
    ahead = offset_m(home, end)
    place = (home[0] + first * (end[0] - home[0]), home[1] + first * (end[1] - home[1]), end[2])
    way, rest = offset_m(place, target), offset_m(place, end)
    part = min(max((rest[0] * way[0] + rest[1] * way[1]) / max(way[0] ** 2 + way[1] ** 2, 1e-9), 0.0), 1.0)
    aside_m = math.hypot(rest[0] - part * way[0], rest[1] - part * way[1])
    blown_m = drift_m(pilot.vehicle, home, end)
    if aside_m <= pilot.vehicle.limits.track_error_m and not blown_m:
        return
    parts = min(math.ceil(max(aside_m, 1e-9) / max(pilot.vehicle.limits.track_error_m, 1.0)), MOST_BANDS)
    half = over_m(pilot.vehicle) / 2.0
    terrain = m.FRAME_SYNONYMS.get(after.frame, after.frame) == m.TERRAIN
    for k in range(parts):
        share = first + (1.0 - first) * (k + 0.5) / parts
        start = (home[0] + share * (end[0] - home[0]), home[1] + share * (end[1] - home[1]), end[2])
        turn = offset_m(start, target)
        length = math.hypot(*ahead) * math.hypot(*turn)
        cosine = (ahead[0] * turn[0] + ahead[1] * turn[1]) / max(length, 1e-9)
        swing_m = 0.5 * (1.0 - cosine) * about_turn_m(pilot.vehicle, pilot.pace.speed_m_s, end[2])
        gap_m = 0.5 * (1.0 - first) * math.hypot(*ahead) / parts * math.sqrt(max(0.0, 1.0 - cosine**2)) + blown_m
        pilot.instead(seq, "cruise", start, target, terrain=terrain, reach_m=swing_m + gap_m)
        pilot.at_once(seq, "cruise", start, target, terrain=terrain, reach_m=swing_m + gap_m)
        if half > 0.0:
            near = min(1.0, OVER_FOR_M / max(flat_m(start, target), 1.0))
            low, high = (*start[:2], end[2] + half), (*place_on(start, target, near)[:2], end[2] + half)
            pilot.instead(seq, "takeoff", low, high, column=True, reach_m=swing_m + gap_m, band_m=half)
    pilot.note(Note("turns_early", seq))


SLOWS_M_S2 = 1.5
"""How quickly an aircraft that climbed with more than its cruise speed loses the rest: ten flights, within 1.4 s."""


def climbed(stretches: Sequence[Stretch], vehicle: Vehicle) -> list[Stretch]:
    """The stretches with the climb-out in pieces at the speeds of the vehicle's own; the same if it says nothing."""
    known = vehicle.climb_out
    out = list(takewhile(lambda s: s.column and s.kind == "takeoff" and s.seq == stretches[0].seq, stretches))
    if known is None or not out or flat_m(out[0].start, out[-1].end) <= SAME_PLACE_M:
        return list(stretches)
    top_m = out[-1].end[2]
    cruise_m_s = out[-1].speed_m_s * float(true_per_indicated(top_m))
    up_m = (top_m - out[0].start[2]) * known.speed_m_s / known.climb_m_s
    slow_m = max(known.space_m_s**2 - cruise_m_s**2, 0.0) / (2.0 * SLOWS_M_S2)
    pieces, at_m = [], 0.0
    for s in out:
        length = flat_m(s.start, s.end)
        if length <= SAME_PLACE_M:
            pieces.append(s)
            continue
        within = {x for x in (up_m, up_m + slow_m) if at_m + SAME_PLACE_M < x < at_m + length - SAME_PLACE_M}
        for a, b in pairwise([at_m, *sorted(within), at_m + length]):
            took_s = _seconds(b, up_m, known, cruise_m_s) - _seconds(a, up_m, known, cruise_m_s)
            start, end = (place_on(s.start, s.end, (m - at_m) / length) for m in (a, b))
            true_m_s = math.hypot(b - a, end[2] - start[2]) / took_s
            indicated = true_m_s / float(true_per_indicated(0.5 * (start[2] + end[2])))
            rates = (true_m_s, true_m_s)  # they bound nothing
            pieces.append(replace(s, start=start, end=end, speed_m_s=indicated, rates_m_s=rates))
        at_m += length
    return pieces + list(stretches[len(out) :])  # circles that continue it have another item


def _seconds(along_m: float, up_m: float, known: ClimbOut, cruise_m_s: float) -> float:
    """Seconds from leaving the ground to a place ``along_m`` ahead over ground; it is high enough at ``up_m``."""
    if along_m <= up_m:
        return along_m / known.speed_m_s
    first_s, level_m, fast_m_s = up_m / known.speed_m_s, along_m - up_m, known.space_m_s
    if fast_m_s <= cruise_m_s:
        return first_s + level_m / cruise_m_s
    slow_m = (fast_m_s**2 - cruise_m_s**2) / (2.0 * SLOWS_M_S2)
    if level_m < slow_m:
        return first_s + (fast_m_s - math.sqrt(fast_m_s**2 - 2.0 * SLOWS_M_S2 * level_m)) / SLOWS_M_S2
    return first_s + (fast_m_s - cruise_m_s) / SLOWS_M_S2 + (level_m - slow_m) / cruise_m_s


FLARE_S, FLARE_MOST_M, LAND_SINK_M_S = 2.0, 6.0, 0.25
"""Defaults of LAND_FLARE_SEC, of twice LAND_FLARE_ALT, and of TECS_LAND_SINK."""

BEFORE_M, STEP_M = 200.0, 10.0
DOWNHILL, DOWNHILL_M = 0.02, 2.0
"""How far before a landing its ground is looked at, m; the slope and height from which that ground gets a note."""


def glide(pilot: Aboard, seq: int, item: MissionItem) -> None:
    """NAV_LAND: a straight descent from the present place to the place of the item."""
    target = pilot.target(item) if pilot.has_place(item) else None
    pilot.landed = True
    if target is None:
        pilot.flight.not_judged.append(Note("landing_without_place", seq))
        return
    ground = pilot.ground(*target[:2])
    off_m = target[2] - ground
    if not abs(off_m) <= max(1.0, pilot.vehicle.limits.altitude_error_m):
        pilot.flight.not_judged.append(
            Note("glide_to_unknown_ground", seq)
            if math.isnan(off_m)
            else Note("glide_off_ground", seq, off_m=abs(off_m), below=off_m > 0.0)
        )
        return
    end = (*target[:2], ground)
    pilot.note(Note("glide_straight", seq))
    pilot.note(_downhill(pilot, seq, end))
    pilot.add(seq, "land", pilot.at, end, column=True)
    pilot.begins_low(seq, "land", pilot.at, end, column=True)
    for speed_m_s in landing_speeds_m_s(pilot.vehicle, pilot.pace.speed_m_s):
        for a, b in pairwise(flared(pilot.at, end, flat_m(pilot.at, end), speed_m_s)):
            pilot.instead(seq, "land", a, b, column=True)
    pilot.at = end


def landing_speeds_m_s(vehicle: Vehicle, speed_m_s: float) -> list[float]:
    """The speeds over ground from which a landing flares: in still air, the strongest wind ahead, and behind."""
    wind_m_s = vehicle.wind_m_s
    return sorted({speed_m_s, max(speed_m_s - wind_m_s, 1.0), speed_m_s + wind_m_s} if wind_m_s else {speed_m_s})


def _downhill(pilot: Aboard, seq: int, end: Place) -> Note | None:
    """That a landing leads down a slope, where the aircraft meets the ground before its place; None if not."""
    top, run_m = pilot.at, flat_m(pilot.at, end)
    if run_m < STEP_M:
        return None
    steepest, early_m = (0.0, 0.0), 0.0
    for k in range(1, int(min(BEFORE_M, run_m) / STEP_M) + 1):
        away_m = k * STEP_M
        part = away_m / run_m
        lat, lon = (end[i] + part * (top[i] - end[i]) for i in (0, 1))
        higher_m = pilot.ground(lat, lon) - end[2]
        if higher_m >= max(DOWNHILL * away_m, DOWNHILL_M) and higher_m / away_m > steepest[0]:
            steepest = higher_m / away_m, away_m
        if part * (top[2] - end[2]) - pilot.vehicle.limits.altitude_error_m <= higher_m:
            early_m = away_m
    slope, away_m = steepest
    if slope == 0.0:
        return None
    east_m, north_m = offset_m(top, end)
    uphill_deg = (math.degrees(math.atan2(east_m, north_m)) + 180.0) % 360.0
    return Note(
        "lands_downhill", seq, away_m=away_m, higher_m=slope * away_m, slope_percent=100.0 * slope, early_m=early_m,
        uphill_deg=uphill_deg,
    )  # fmt: skip


def flared(top: Place, ground: Place, run_m: float, speed_m_s: float) -> list[Place]:
    """The second half of a glide as it is flown below its line: to the beginning of the flare, then to the ground.

    A place may be any three numbers. Empty if the glide stays on its line. AP_Landing_Slope.cpp,
    `type_slope_setup_landing_glide_slope`, with the defaults.
    """
    fall = top[2] - ground[2]
    sink_m_s = speed_m_s * fall / max(run_m, 1.0)
    high_m = min(FLARE_S * sink_m_s, FLARE_MOST_M)
    part = min(0.5, speed_m_s * high_m / max(0.5 * (LAND_SINK_M_S + sink_m_s), 0.1) / max(run_m, 1.0))
    if high_m >= part * fall:
        return []

    def at(down: float, z: float) -> Place:
        return top[0] + down * (ground[0] - top[0]), top[1] + down * (ground[1] - top[1]), z

    aim = at(1.0 - part, ground[2] + high_m)
    middle = at(0.5, top[2] - 0.5 * (fall - high_m) / (1.0 - part))
    return [aim, ground] if part == 0.5 else [middle, aim, ground]


def brakes_m(vehicle: Vehicle, amsl_m: float, speed_m_s: float | None = None) -> float:
    """How far a VTOL flies at an altitude, from an indicated airspeed (None: its fastest) to a standstill, m."""
    indicated = vehicle.speed_max_m_s if speed_m_s is None else speed_m_s
    return indicated**2 * circle_growth(amsl_m) / (2.0 * BRAKES_M_S2)


def sets_off(pilot: Aboard, target: Place) -> Note | None:
    """The heading on which a VTOL must stand, if its first leg leads to ``target``; None if this is no such leg."""
    flown = pilot.flight.stretches
    if not (flown and _is(pilot, flown[-1], cmd.VTOL_TAKEOFF)) or flat_m(pilot.at, target) <= SAME_PLACE_M:
        return None
    return Note("vtol_sets_off", heading_deg=math.degrees(math.atan2(*offset_m(pilot.at, target))) % 360.0)


def level_approach(pilot: Aboard, seq: int, item: MissionItem) -> None:
    """All the altitudes at which a VTOL may fly to its landing, and the places around it that it reaches because the
    way there is too short to brake on."""
    if pilot.autopilot is not Autopilot.ARDUPLANE:
        return
    last, here = pilot.flight.stretches[-1], pilot.at
    place, accepts_m = (*pilot.place(item), here[2]), _accepts_m(pilot, last)
    pilot.begins_low(seq, "cruise", here, place, part=1.0)
    # It keeps the altitude that it has where the item begins, on the slope of the leg before.
    long_m = flat_m(last.start, last.end)
    off_m = (last.end[2] - last.start[2]) * min(accepts_m / long_m, 1.0) if long_m > SAME_PLACE_M else 0.0
    level_m = here[2] - 0.5 * off_m
    start, end = (*here[:2], level_m), (*place[:2], level_m)
    if off_m and not last.column:
        pilot.instead(seq, "cruise", start, end, band_m=0.5 * abs(off_m))
    brakes = brakes_m(pilot.vehicle, here[2], pilot.pace.speed_m_s)
    past_m = brakes - max(flat_m(here, place) - accepts_m - last.reach_m, 0.0)
    if past_m > 0.0 and not _is(pilot, last, cmd.VTOL_TAKEOFF):
        pilot.instead(seq, "cruise", end, end, reach_m=past_m, band_m=0.5 * abs(off_m))
        pilot.note(Note("vtol_overshoots", seq, brakes_m=brakes, past_m=past_m))


def _is(pilot: Aboard, s: Stretch, command: int) -> bool:
    """Whether ArduPlane flies a stretch for an item of a command."""
    return pilot.autopilot is Autopilot.ARDUPLANE and pilot.items[s.seq - pilot.first_seq].command == command


def _accepts_m(pilot: Aboard, s: Stretch) -> float:
    """How far before the end of a stretch the next item may begin, m."""
    if not _is(pilot, s, cmd.WAYPOINT):
        return 0.0
    own_m = pilot.items[s.seq - pilot.first_seq].params[1]
    default_m = min(DEFAULTS.plane_radius_m, DEFAULTS.l1_ahead_m(pilot.pace.speed_m_s))
    return own_m if own_m > 0.0 else default_m * circle_growth(pilot.at[2])
