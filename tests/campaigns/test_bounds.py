"""Tests that the campaign `bounds` finds planted faults: a bound raised by 0.01 %, a false proof, a silent refusal."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gcsplan import load_mission, plan
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.errors import NoMission
from tests.campaigns.bound_paths import Ground, shortest_track, taut
from tests.campaigns.bound_worlds import Barrier, Case, Terrain, make, wall
from tests.campaigns.bounds import Planner, run

FOREVER_S = 1e9


def raised(bound_of: Callable[[VehiclePlan], float]) -> Planner:
    """A planner with other bounds."""

    def planner(file: Path) -> Plan:
        planned = plan(load_mission(file))
        return replace(
            planned,
            vehicles=tuple(replace(v, solution=replace(v.solution, lower_bound=bound_of(v))) for v in planned.vehicles),
        )

    return planner


def refused(words: str) -> Planner:
    """A planner that refuses every mission file but the ones that the campaign makes beside it."""

    def planner(file: Path) -> Plan:
        if file.stem == "mission":
            raise NoMission(words, reason="infeasible")
        return plan(load_mission(file))

    return planner


def kinds(planner: Planner, family: str, seed: int, most: int) -> set[str]:
    tally = run(FOREVER_S, seed, (family,), worlds=1, planner=planner, most=most, world_s=FOREVER_S)
    return {f.kind for f in tally.faults}


@pytest.mark.slow
def test_a_bound_that_is_raised_by_a_ten_thousandth_is_found() -> None:
    """The planted bound lies just below the plan's own cost: only a witness shows that it is wrong."""
    assert kinds(raised(lambda v: v.cost * (1.0 - 1e-6)), "walls", 12, 60) == {"undercut"}


def test_a_bound_above_the_plans_own_cost_is_found() -> None:
    # Where planning holds the two against each other itself, it ends as a bug, which the campaign finds, too.
    assert kinds(raised(lambda v: v.cost * (1.0 + 1e-6)), "walls", 2, 1) & {"own cost", "crash"}


@pytest.mark.nightly
def test_a_false_proof_is_found_by_a_way_past_the_walls() -> None:
    assert "proved" in kinds(refused("there is no path within the limits, which is proved"), "walls", 1, 60)


@pytest.mark.slow
def test_a_refusal_that_does_not_name_unknown_ground_is_found() -> None:
    seed = 2
    words = "there is no path within the limits, which is proved"
    assert "silent" in kinds(refused(words), "holes", seed, 1)
    assert "silent" not in kinds(refused(f"{words}; the ground is unknown to the terrain model"), "holes", seed, 1)


# -- what the campaign found once ------------------------------------------------------------------------------------

FOUND = [
    pytest.param("slits", 13, id="a slit with room was called shut, which is proved"),
    pytest.param("fleets", 11, id="the bound of a detour followed its zigzag, 28 % above a straight mission"),
    pytest.param("holes", 3, id="a refusal for unknown ground did not name it"),
    pytest.param("mountains", 4, id="a plan of a mission in hills cost less than its own bound"),
    *(
        pytest.param(family, seed, id=f"{family} {seed}", marks=pytest.mark.slow)
        for family, seed in (
            ("walls", 2),  # walls with clearance and errors: the planner's own margins were in the bound
            ("walls", 6),  # the same without errors: way points with a hold are not cut, 2 m were too much there
            ("slits", 2),
            ("over", 1),  # the plan's own ends are rounded for the wire
            ("stops", 5),
            ("wings", 4),  # the first turn after the climb-out counted as a part of it
            ("returns", 3),  # planned again, with the bound of the first attempt's ends
        )
    ),
]


@pytest.mark.nightly_but("slits 2", "a slit with room was called shut, which is proved")
@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), FOUND)
def test_what_the_campaign_found_once_is_cured(family: str, seed: int) -> None:
    tally = run(FOREVER_S, seed, (family,), worlds=1, most=60)
    assert [str(f) for f in tally.faults] == []
    assert tally.worlds[family] == 1


# -- the second implementation ---------------------------------------------------------------------------------------


def test_the_shortest_track_follows_the_rounded_corners_of_a_grown_wall() -> None:
    barrier = Barrier(wall(100.0, -50.0, 50.0, 20.0))
    track = shortest_track([np.array([0.0, 0.0]), np.array([200.0, 0.0])], [barrier], 30.0, fine=64)
    assert track is not None
    # Tangents from the ends to circles of 30 m around the wall's corners, arcs, and the side between.
    far = np.hypot(90.0, 50.0)
    turn = np.pi / 2.0 + np.arctan2(50.0, 90.0) - np.arccos(30.0 / far)
    exact = 2.0 * (np.sqrt(far**2 - 30.0**2) + 30.0 * turn) + 20.0
    found = float(np.hypot(*np.diff(track, axis=0).T).sum())
    assert exact - 1e-6 <= found <= exact * (1.0 + 1e-4)


def test_a_taut_profile_touches_what_is_in_its_way_and_keeps_to_the_slope() -> None:
    s = np.linspace(0.0, 100.0, 101)
    low = np.where(np.abs(s - 50.0) < 5.5, 30.0, 0.0)
    high = np.full(101, 60.0)
    low[[0, -1]] = high[[0, -1]] = 10.0
    profile = taut(s, low, high, (np.inf, np.inf))
    assert profile is not None
    assert profile == pytest.approx(np.array([[0, 10], [45, 30], [55, 30], [100, 10]]))
    assert taut(s, low, high, (0.3, 0.3)) is None
    gentle = taut(s, low, high, (0.5, 0.5))
    assert gentle is not None
    assert np.abs(np.diff(gentle[:, 1]) / np.diff(gentle[:, 0])).max() <= 0.5 + 1e-9


def test_unknown_ground_is_unknown_in_the_second_implementation_too() -> None:
    z = np.full((4, 4), 7.0)
    z[0, 0] = np.nan
    case = Case("holes", 0, [], {}, terrain=Terrain(z, 0.0, 30.0, 10.0))
    heights = Ground(case).at(np.array([5.0, 15.0, 31.0]), np.array([25.0, 15.0, 15.0]))
    assert np.isnan(heights).tolist() == [True, False, True]


@pytest.mark.nightly
def test_the_worlds_of_a_seed_are_the_same_again_and_load() -> None:
    with tempfile.TemporaryDirectory() as name:
        for family in ("slits", "over", "holes", "wings", "returns"):
            case, again = make(family, 5), make(family, 5)
            assert case.document() == again.document()
            load_mission(case.write(Path(name)))
