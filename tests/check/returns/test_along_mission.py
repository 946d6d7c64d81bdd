"""Returns that join the mission at a return path or a landing sequence: known worlds, and random ones by force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.check.judge import judge
from gcsplan.check.returns.way_home import WayHome, way_home
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import NO_POSITION, RELATIVE, Mission
from gcsplan.mavlink.mission.mission import MissionItem as Item
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.world import World
from tests.check.returns.test_way_home import BARE, OVER, judged, mission, ridge
from tests.oracles.joins import join_breach, random_path_case
from tests.oracles.returns import run_on
from tests.support.effort import seeds
from tests.support.noted import codes, within
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
START = Item(cmd.DO_RETURN_PATH_START, NO_POSITION)


def back(m: Mission, ways: Sequence[Item] | None = None, start: Item = START) -> Mission:
    """``m``, and a return path along ``ways`` (default: its own way points in reverse) to a landing at home."""
    own = [i for i in reversed(m.items) if i.command == cmd.WAYPOINT] if ways is None else ways
    down = Item(cmd.LAND, RELATIVE, x=m.home.lat_e7, y=m.home.lon_e7)
    return replace(m, items=(*m.items, start, *own, down))


def joined(w: World, m: Mission, v: Vehicle | None = None) -> WayHome:
    v = v or vehicle(m.autopilot)
    return way_home(judge(m, v, w), v, w, route="mission")


def test_a_path_back_over_the_ridge_is_safe_where_no_low_return_is() -> None:
    w, v = world(ridge), vehicle(**BARE)
    m = mission(w, OVER)
    assert judged(w, m, v, 50.0).safe is False
    home = joined(w, back(m), v)
    assert home.safe is True, home.describe()
    assert home.starts == (7,)
    assert "joined to the mission's return path (item 7)" in home.describe()
    assert "set FS_THR_ENABLE, FS_GCS_ENABLE, BATT_FS_LOW_ACT, BATT_FS_CRT_ACT 6 (Auto RTL)" in home.describe()
    assert home.as_dict()["route"] == "mission"
    assert home.as_dict()["joins"] == [7]
    assert home.set_rel_home_m is None
    # The same path without its height: from beyond the ridge it leads through the ridge.
    low = [replace(i, z=40.0) for i in reversed(m.items) if i.command == cmd.WAYPOINT]
    broken = back(m, low)
    assert any(f.kind == "min_agl" for f in judge(broken, v, w).findings)


@pytest.mark.slow
def test_the_way_to_the_path_is_judged_not_only_the_path() -> None:
    """The path is safe by itself, 300 m aside; a tower stands between the mission and the path."""
    tower = Zone("tower", Circle(1000.0, 150.0, 60.0))
    w, v = world(300.0, [tower]), vehicle(**BARE)
    m = mission(w, [(0, 0, 80), (2000, 0, 80)])
    aside = mission(w, [(2000, 300, 80), (1000, 300, 80), (0, 300, 80)])
    home = joined(w, back(m, aside.items[1:-1]), v)
    assert home.safe is False
    (stretch,) = home.unsafe
    # Up to 1000 m it flies to (0, 300), from there on to (1000, 300), past which the tower is in the way.
    assert Note("way_meets_zone", zone="tower") in within(stretch.why)
    assert 1000.0 - 45.0 - 110.0 < stretch.from_m < 1000.0  # it stops in 45 m, and one leg is not much nearer
    assert stretch.to_m < 1300.0
    assert home.headline.code == "no_return_from_part"


def test_the_battery_counts_the_way_along_the_path() -> None:
    w, v = world(), vehicle()
    m = back(mission(w, [(0, 0, 80), (3000, 0, 80), (3000, 3000, 80)]))
    rich = replace(v, energy=Energy(0.0, 100.0, battery_j=2e6, reserve=0.0))
    home = joined(w, m, rich)
    assert home.battery is not None
    # 6 km out and 6 km back, at 100 J/m; at the farthest point that and what it runs on.
    assert home.battery.most_j == pytest.approx(1.2e6, rel=0.02)
    assert home.battery.most_j >= 1.2e6
    assert home.safe is True
    poor = replace(rich, energy=replace(rich.energy, battery_j=1.0e6))
    short = joined(w, m, poor)
    assert short.safe is False
    assert short.battery is not None
    assert short.battery.no_return_m == pytest.approx(5000.0, abs=150.0)
    assert len(short.battery.legs) == len(judge(m, poor, w).legs)


def test_rounds_before_a_start_cost_their_energy_and_change_nothing_else() -> None:
    w = world()
    m = mission(w, [(0, 0, 80), (3000, 0, 80)], land=False)
    rounds = Item(cmd.DO_JUMP, NO_POSITION, (2.0, 3.0, 0.0, 0.0))
    v = replace(vehicle(), energy=Energy(0.0, 100.0, battery_j=1e7, reserve=0.0))
    once, often = (joined(w, back(replace(m, items=(*m.items, *more))), v) for more in ((), (rounds,)))
    assert once.safe is True
    assert often.safe is True, often.describe()
    assert once.battery is not None
    assert often.battery is not None
    # Three more rounds of 3 km out and 3 km back before the last point of the path, from where it flies home.
    assert often.battery.most_j - once.battery.most_j == pytest.approx(3 * 6000.0 * 100.0, rel=0.02)


@pytest.mark.slow
def test_a_plane_swings_wide_where_it_joins() -> None:
    """Over flat ground only what stands beside the path by less than two turns about is in the way."""
    w, v = world(half_m=9000.0), vehicle(PLANE)
    m = mission(w, [(0, 0, 150), (4000, 0, 150)], PLANE)
    ways = [*reversed(m.items[1:3])]
    for east in (-3000.0, -6000.0):
        lat, lon = (float(x) for x in w.frame.to_degrees(east, 0.0))
        ways.append(Item(cmd.WAYPOINT, RELATIVE, x=round(lat * 1e7), y=round(lon * 1e7), z=150.0))
    down = replace(m.items[-1], x=ways[-1].x, y=ways[-1].y)
    held = replace(m, items=(*m.items, START, *ways, down))
    short = joined(w, replace(held, items=(*held.items[:-2], replace(down, x=ways[-2].x, y=ways[-2].y))), v)
    assert short.safe is None
    assert "joins_short_legs" in codes(within(short.not_judged[0]))
    home = joined(w, held, v)
    assert home.safe is True, home.describe()
    assert home.advice == Note("set_route", setting="RTL_AUTOLAND 4")
    tower = world(half_m=9000.0, zones=[Zone("tower", Circle(2000.0, 150.0, 20.0))])
    assert joined(tower, held, v).safe is False
    away = world(half_m=9000.0, zones=[Zone("tower", Circle(2000.0, 1500.0, 20.0))])
    assert joined(away, held, v).safe is True
    climbs = replace(held, items=(*held.items[:5], *(replace(i, z=600.0) for i in held.items[5:7]), *held.items[7:]))
    high = joined(w, climbs, v)  # 450 m of climb on the way back
    assert high.safe is None
    assert "joins_too_steeply" in codes(note for said in high.not_judged for note in within(said))


def _reported(home: WayHome, seq: int, along_m: float, *, legal: bool) -> bool:
    found = [*home.unsafe, *(home.irregular if legal else ())]
    return any(s.from_seq <= seq <= s.to_seq and s.from_m - 0.5 <= along_m <= s.to_m + 0.5 for s in found)


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", seeds(12, 45, 250))
def test_no_return_that_breaks_a_limit_is_called_safe(seed: int) -> None:
    rng = np.random.default_rng([22, seed])
    case = random_path_case(rng)
    if case is None:
        pytest.skip("the ground at home is unknown")
    verdict = judge(case.mission, case.vehicle, case.world)
    home = way_home(verdict, case.vehicle, case.world, route="mission")
    if home.not_judged:
        assert home.safe is not True
        return
    corners: Floats = case.corners
    along = 0.0
    error = np.array([*[case.vehicle.limits.track_error_m / 2.0] * 2, case.vehicle.limits.altitude_error_m / 2.0])
    for k, (a, b) in enumerate(pairwise(corners)):
        long_m = float(np.hypot(*(b - a)[:2]))
        seq = case.mission.first_seq + k
        if case.mission.items[k].command == cmd.LAND:
            break
        after = corners[k + 2] if k + 2 < len(corners) else None
        for part in rng.uniform(0.0, 1.0, 5):
            at = a + part * (b - a)
            on = run_on(case, at, b, after)
            stop = at + float(rng.choice([0.0, 0.5, 1.0])) * np.array([*on, 0.0])
            wrong = rng.uniform(-1.0, 1.0, 3) * error
            for legal in (False, True):
                broken = join_breach(case, at, stop, wrong, legal=legal, column=k == 0)
                if broken:
                    words = f"leg {k} at {part:.3f}: {broken}\n{home.describe()}"
                    assert _reported(home, seq, along + part * long_m, legal=legal), words
        along += long_m
