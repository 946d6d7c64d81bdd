"""Random returns, flown by the second implementation or by a SITL, against the judged places and heights.

    python -m tests.campaigns.returns --returns 50 --seed 1
    python -m tests.campaigns.returns --returns 3 --seed 1 --sitl /path/to/arducopter --instance 30

Each return begins at a random place of a random mission over hills, often close to a corner. It must stay within the
judged places, widened by the track error, and never come nearer to the ground than judged, less 1 m.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.flight.corners import round_corners
from gcsplan.check.flight.follow import follow
from gcsplan.check.motion.return_rules import RETURN_RULES
from gcsplan.check.motion.stopping import circle_home_m
from gcsplan.check.returns.footprint import ReturnPlaces, Target, places_of_returns
from gcsplan.check.returns.obstacles import CIRCLE_ABOVE_M
from gcsplan.check.returns.trace import MissionTrace, TraceParts, trace_of
from gcsplan.check.returns.way_home import heights_agl
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.commands import DO_CHANGE_SPEED, TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE, Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry import hulls
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.world import World
from tests.oracles.returning import Begin, copter, plane
from tests.support.worlds import surface

COPTER, PLANE = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE
JUDGED_LESS_M = 1.0
HOME_AMSL_M = 300.0


@dataclass(frozen=True)
class Scene:
    """A mission over hills, and where a return from it begins: on the way to item ``seq``, ``left_m`` before it."""

    world: World
    vehicle: Vehicle
    mission: Mission
    trace: MissionTrace
    speed_m_s: float
    rtl_rel_home_m: float
    seq: int
    left_m: float

    @property
    def target(self) -> Target:
        return Target(0.0, 0.0, HOME_AMSL_M, HOME_AMSL_M)

    def parts(self, seq: int, from_m: float, to_m: float) -> TraceParts:
        """The part of the trace on the way to item ``seq`` between two distances before its end."""
        k = longest(self.trace, seq)
        first, last = self.trace.first[k], self.trace.last[k]
        ends = self.trace.points(np.array([first, last]))[:, :2]
        share = (last - first) / max(float(np.hypot(*(ends[1] - ends[0]))), 1e-6)
        u = np.clip(last - share * np.array([from_m, to_m]), first, last)
        return TraceParts(u[:1], u[1:], np.array([k]))

    def place(self, seq: int, left_m: float) -> Floats:
        part = self.parts(seq, left_m, left_m)
        return self.trace.points(part.start)[0, :3]


def longest(trace: MissionTrace, seq: int) -> int:
    """The longest stretch on the way to an item: for a plane the straight one between two arcs."""
    mine = np.flatnonzero(trace.seq[: trace.mains] == seq)
    return int(mine[(trace.last - trace.first)[mine].argmax()])


def scene(rng: np.random.Generator, autopilot: Autopilot) -> Scene:
    """A random scene."""
    is_plane = autopilot is PLANE
    knobs = [(rng.uniform(-3e3, 3e3, 2), rng.uniform(10, 60), rng.uniform(150, 500)) for _ in range(30)]

    def hills(east: Floats, north: Floats) -> Floats:
        rise = np.zeros_like(east)
        for (e, n), top, wide in knobs:
            rise = rise + top * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * wide**2))
        return HOME_AMSL_M + rise * np.clip(np.hypot(east, north) / 500.0 - 0.5, 0.0, 1.0)

    w = World(Frame(36.6, -84.3), Airspace(surface(hills, half_m=6_000.0, step_m=60.0), (), scale=1.0))
    speed = float(rng.uniform(18.0, 24.0) if is_plane else rng.uniform(5.0, 15.0))
    vehicle = Vehicle(
        "uav1", 1, autopilot, Limits(min_agl_m=20.0, track_error_m=15.0 if is_plane else 3.0, altitude_error_m=5.0),
        speed_max_m_s=speed, climb_m_s=1.5 if is_plane else 2.5, turn_radius_m=80.0 if is_plane else 0.0,
    )  # fmt: skip
    least = 600.0 if is_plane else 60.0
    places = [np.zeros(2)]
    while len(places) < 6:
        step = rng.uniform(least, 1200.0 if is_plane else 500.0)
        turn = rng.uniform(-2.0, 2.0)
        before = places[-1] - places[-2] if len(places) > 1 else np.array([1.0, 0.0])
        course = math.atan2(before[1], before[0]) + turn
        at = places[-1] + step * np.array([math.cos(course), math.sin(course)])
        if math.hypot(*at) < 2500.0:
            places.append(at)
    lat, lon = (float(x) for x in w.frame.to_degrees(0.0, 0.0))
    home = Home.at(lat, lon, HOME_AMSL_M)
    top = 60.0
    items = [
        MissionItem(
            TAKEOFF, RELATIVE, params=(10.0 if is_plane else 0.0, 0.0, 0.0, 0.0), x=home.lat_e7, y=home.lon_e7, z=top
        )
    ]
    items.append(MissionItem(DO_CHANGE_SPEED, NO_POSITION, params=(0.0 if is_plane else 1.0, speed, -1.0, 0.0)))
    for at in places[1:]:
        lat, lon = (float(x) for x in w.frame.to_degrees(*at))
        line = at * np.linspace(0.6, 1.0, 40)[:, None]
        high = float(w.airspace.surface.ground_at(*line.T).max()) - HOME_AMSL_M
        up = max(top, high + rng.uniform(30.0, 90.0))
        items.append(MissionItem(WAYPOINT, RELATIVE, x=round(lat * 1e7), y=round(lon * 1e7), z=round(up, 1) + 0.005))
    mission = Mission(autopilot, home, tuple(items))
    stored = replace(mission, items=tuple(profile_of(autopilot).stored(i) for i in items))
    flight = follow(stored, vehicle, w.ground_amsl, rtl_rel_home_m=60.0)
    round_corners(flight, stored, vehicle, w.frame)
    trace = trace_of(flight, vehicle, w, 30.0)
    assert trace is not None
    seq = int(rng.integers(4, 4 + 4))
    seq = min(seq, int(trace.seq[: trace.mains].max()))
    k = longest(trace, seq)
    ends = trace.points(np.array([trace.first[k], trace.last[k]]))[:, :2]
    length = float(np.hypot(*(ends[1] - ends[0])))
    left = float(rng.uniform(0.3 if is_plane else 0.05, 0.9)) * length
    if rng.random() < 0.4 and not is_plane:
        left = min(float(rng.uniform(1.0, 12.0)), 0.5 * length)
    return Scene(w, vehicle, mission, trace, speed, float(round(rng.uniform(50.0, 120.0))), seq, left)


def outside_m(places: ReturnPlaces, points: Floats, scene: Scene) -> float:
    """How far the farthest of (N, 2) points lies outside the judged places, m; they include the track error."""
    limits, vehicle = scene.vehicle.limits, scene.vehicle
    gap = np.empty(len(points))
    circle = 0.0
    if not RETURN_RULES[vehicle.autopilot].climbs_first:
        high = HOME_AMSL_M + CIRCLE_ABOVE_M
        circle = circle_home_m(RETURN_RULES[vehicle.autopilot].circle_m(high), vehicle, high)
        begin = places.regions[0, :2]
        gap = np.full(len(points), np.inf)
        for f in np.linspace(0.0, 1.0, 200):
            for at in begin:
                gap = np.minimum(gap, np.hypot(*(points - (1.0 - f) * at).T) - (1.0 - f) * float(places.aside_m[0]))
        gap = np.minimum(gap, np.hypot(*points.T) - circle)
    else:
        for i in range(0, len(points), 5000):
            gap[i : i + 5000] = [hulls.to_point(places.regions, p)[0] for p in points[i : i + 5000]]
    return float((gap - places.wide_m[0] - limits.track_error_m).max())


def flown(scene: Scene, rng: np.random.Generator) -> tuple[Floats, float]:
    """The places of a return flown by the second implementation, and the distance before the item where it began."""
    at = scene.place(scene.seq, scene.left_m)
    on = scene.place(scene.seq, scene.left_m - 0.5)
    if math.dist(on[:2], at[:2]) < 1e-3:
        on = 2.0 * at - scene.place(scene.seq, scene.left_m + 0.5)
    way = (on - at) / np.hypot(*(on - at)[:2])
    home = np.array([0.0, 0.0, HOME_AMSL_M])
    level = HOME_AMSL_M + scene.rtl_rel_home_m
    if scene.vehicle.autopilot is PLANE:
        return plane(
            Begin(at, way * scene.speed_m_s * math.sqrt(1.03)), home, level, radius_m=60.0 * 1.03,
            climb_m_s=float(rng.uniform(1.5, 4.0)), bank_s=float(rng.uniform(0.4, 1.0)), late=bool(rng.random() < 0.5),
            turns_left=bool(rng.random() < 0.5),
        ), scene.left_m  # fmt: skip
    corner = corner_m_s(scene)
    fastest = math.sqrt(corner**2 + 5.0 * scene.left_m)  # it slows down for the corner
    speed = min(scene.speed_m_s, fastest) * float(rng.uniform(0.5, 1.0) if rng.random() < 0.2 else 1.0)
    velocity = way * speed
    velocity[2] = max(min(velocity[2], 2.5), -1.5)
    return copter(Begin(at, velocity), home, level, wpnav_m_s=float(rng.choice([5.0, 10.0, 15.0]))), scene.left_m


def corner_m_s(scene: Scene) -> float:
    """The speed of a copter in the corner at item ``seq``: an arc 2 m off the corner, pulled with 5 m/s²."""
    a, b = scene.place(scene.seq, 1.0), scene.place(scene.seq, 0.0)
    if scene.seq == int(scene.trace.seq[: scene.trace.mains].max()):
        return 0.0
    k = int(np.flatnonzero(scene.trace.seq[: scene.trace.mains] == scene.seq + 1)[-1])
    c = scene.trace.points(scene.trace.last[k : k + 1])[0, :3]
    one, two = (b - a)[:2], (c - b)[:2]
    turn = abs(math.remainder(math.atan2(two[1], two[0]) - math.atan2(one[1], one[0]), math.tau))
    return math.sqrt(5.0 * 2.0 / max(1.0 / math.cos(0.5 * min(turn, 3.1)) - 1.0, 1e-9))


@dataclass(frozen=True)
class Found:
    """One return: how far outside the judged places it came (m, negative: within), heights flown and judged."""

    outside_m: float
    flown_agl_m: float
    judged_agl_m: float
    aside_m: float

    @property
    def as_judged(self) -> bool:
        return self.outside_m <= 0.0 and self.flown_agl_m >= self.judged_agl_m - JUDGED_LESS_M


def compare(scene: Scene, points: Floats, part: TraceParts) -> Found:
    """``points`` (N, 3) flown from a place within ``part`` until over home, against the judgement."""
    places = places_of_returns(scene.trace, part, scene.target, scene.vehicle)
    level = HOME_AMSL_M + scene.rtl_rel_home_m
    judged_m = float(heights_agl(scene.trace, part, scene.target, scene.vehicle, level)[0])
    away = points[np.hypot(*points[:, :2].T) > 5.0] if scene.vehicle.autopilot is COPTER else points
    agl = away[:, 2] - scene.world.airspace.surface.ground_at(*away[:, :2].T)
    first = scene.trace.points(part.middle)[0, :2]
    to_home = -first / math.hypot(*first)
    aside = np.abs((points[:, :2] - first) @ np.array([-to_home[1], to_home[0]]))
    return Found(outside_m(places, points[:, :2], scene), float(agl.min()), judged_m, float(aside.max()))


def in_twin(seed: int, autopilot: Autopilot) -> Found:
    """One random return flown by the second implementation."""
    rng = np.random.default_rng(seed)
    one = scene(rng, autopilot)
    points, left = flown(one, rng)
    return compare(one, points, one.parts(one.seq, left + 0.5, max(left - 0.5, 0.0)))


def main() -> None:
    """Fly returns and print one line for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--returns", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--autopilot", choices=["arducopter", "arduplane"], default=None)
    parser.add_argument("--sitl", default=None)
    parser.add_argument("--instance", type=int, default=30)
    parser.add_argument("--defaults", default=None, help="SITL's parameter file")
    args = parser.parse_args()
    bad = 0
    for k in range(args.returns):
        autopilot = Autopilot(args.autopilot) if args.autopilot else (COPTER, PLANE)[k % 2]
        if args.sitl:
            from tests.campaigns.returns_in_sitl import fly_in_sitl

            found = fly_in_sitl(args.seed + k, autopilot, args.sitl, args.instance, args.defaults)
        else:
            found = in_twin(args.seed + k, autopilot)
        bad += not found.as_judged
        print(args.seed + k, autopilot.value, "as judged" if found.as_judged else "NOT AS JUDGED", found, flush=True)
    print(f"{args.returns} returns, {bad} not as judged")


if __name__ == "__main__":
    main()
