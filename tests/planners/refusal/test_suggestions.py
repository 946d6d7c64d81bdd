"""Cures that a refusal names: with the named limit, or without the named zone, the mission has a path."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np
import pytest

from gcsplan.app.fleet import pipeline
from gcsplan.errors import CheckFailed, NoMission
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution, Via
from gcsplan.planners.refusal.suggestions import GRACE_S, LEAST_S, MOST_TRIALS, SHARE, WHOLE, WHOLE_SHARE, with_cures
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.paths import MISSIONS
from tests.support.planner_worlds import Floats, ground

LIMIT = re.compile(r"(max_\w+) ([\d.]+)(?= and max_| would do)")
ZONE = re.compile(
    r"without (?:the |any one of the )?no-fly zones? ((?:'[^']+'(?:, | and | or )?)+)( together)? there is"
)


def hills(seed: int) -> Callable[[Floats, Floats], Floats]:
    """Ground with two ridges across the track, each with its own pass."""
    rng = np.random.default_rng(seed)
    crests, passes, places = rng.uniform(250, 400, 2), rng.uniform(80, 160, 2), rng.uniform(300, 1700, 2)

    def height(east: Floats, north: Floats) -> Floats:
        z = np.zeros_like(east)
        for crest, low, place, at in zip(crests, passes, places, (700.0, 1300.0), strict=True):
            saddle = crest - (crest - low) * np.exp(-(((north - place) / 200.0) ** 2))
            z = np.maximum(z, saddle * np.exp(-(((east - at) / 150.0) ** 2)))
        return z

    return height


def cliff(east: Floats, north: Floats) -> Floats:
    return np.where(east < 1000.0, 300.0, 0.0)


def fence(count: int, radius_m: float) -> tuple[Zone, ...]:
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    place = 1500.0 + 250.0 * np.cos(turn), 1000.0 + 250.0 * np.sin(turn)
    return tuple(Zone(f"post {k}", Circle(e, n, radius_m)) for k, (e, n) in enumerate(zip(*place, strict=True)))


def wall(name: str, east_m: float, high: Level | None = None) -> Zone:
    corners = [[east_m, -200.0], [east_m + 80.0, -200.0], [east_m + 80.0, 2200.0], [east_m, 2200.0]]
    return Zone(name, Polygon(np.array(corners)), None, high)


def refused_missions() -> dict[str, Problem]:
    start, goal, low = (200.0, 1000.0, 20.0), (1800.0, 1000.0, 20.0), Limits(10.0)
    found: dict[str, Problem] = {}
    for seed in range(5):
        air, limits = Airspace(ground(hills(seed))), replace(low, max_amsl_m=60.0 + seed / 3)
        found[f"ridges {seed}"] = Problem(air, limits, start, goal)
    margins = Limits(20.0, None, 70.5, 30.0, 3.0, 5.0)
    for seed in range(5, 9):
        air = Airspace(ground(hills(seed)), (Zone("mast", Circle(1000.0, 1000.0, 60.0)),))
        found[f"ridges with errors {seed}"] = Problem(air, margins, (200.0, 1000.0, 30.0), (1800.0, 1000.0, 30.0))
    flat = ground(0.0)
    capped = replace(low, max_amsl_m=100.0)
    found["fence"] = Problem(Airspace(flat, fence(8, 110.0)), capped, start, (1500.0, 1000.0, 20.0))
    found["fence with climb limit"] = Problem(
        Airspace(flat, fence(9, 100.0)), replace(capped, max_climb_deg=15, max_descent_deg=15), start, (1500, 1000, 20)
    )
    found["wall"] = Problem(Airspace(flat, (wall("wall", 900.0), *fence(3, 50.0))), capped, start, goal)
    found["two walls"] = Problem(Airspace(flat, (wall("west", 800.0), wall("east", 1200.0))), capped, start, goal)
    found["wall under the ceiling"] = Problem(
        Airspace(flat, (wall("wall", 900.0, Level(133.3, "amsl")),)), capped, start, goal
    )
    found["wall with a via behind"] = replace(found["wall"], via=(Via(1500.0, 300.0),))
    found["start over the ceiling"] = Problem(
        Airspace(ground(hills(3))), replace(low, max_amsl_m=105.04), (700.0, 1000.0, 400.0), goal
    )
    found["goal over max AGL"] = Problem(Airspace(flat), replace(low, max_agl_m=40.0), start, (1800.0, 1000.0, 61.7))
    found["two ceilings"] = Problem(
        Airspace(flat, (wall("wall", 900.0, Level(80.0, "agl")),)), replace(low, max_agl_m=50.0), start, goal
    )
    steep = Limits(10.0, max_agl_m=100.0, max_climb_deg=20.0, max_descent_deg=20.0)
    found["cliff"] = Problem(Airspace(ground(cliff)), steep, (1500.0, 1000.0, 20.0), (200.0, 1000.0, 310.0))
    found["cliff, long way"] = replace(found["cliff"], limits=replace(steep, max_climb_deg=5.0, max_descent_deg=5.0))
    return found


MISSIONS_REFUSED = refused_missions()


def cured(problem: Problem, message: str) -> list[Problem]:
    """The problems with the cures that a message names."""
    out = []
    limits = LIMIT.findall(message)
    for group in (
        {k: float(v) for k, v in limits if ("climb" in k or "descent" in k) == steep} for steep in (False, True)
    ):
        out += [replace(problem, limits=replace(problem.limits, **group))] if group else []
    air = problem.airspace
    for names, together in ZONE.findall(message):
        each = re.findall(r"'([^']+)'", names)
        for gone in [each] if together else [[name] for name in each]:
            zones = [zone for zone in air.zones if zone.name not in gone]
            assert len(zones) == len(air.zones) - len(gone)
            out.append(replace(problem, airspace=Airspace(air.surface, zones)))
    return out


def refusal_of(problem: Problem) -> Refusal:
    with pytest.raises(Refusal) as caught:
        plan(problem)
    return with_cures(replace(problem, budget_s=30.0), caught.value, plan)  # enough even on a busy machine


SLOW = {f"ridges {k}" for k in (2, 3, 4)}
NIGHTLY = {"two ceilings", "cliff", "cliff, long way", *(f"ridges with errors {k}" for k in (5, 6, 7, 8))}


def tier(name: str) -> list[pytest.MarkDecorator]:
    """The mark of a mission that takes long to refuse and to plan with each cure."""
    return [pytest.mark.nightly] if name in NIGHTLY else [pytest.mark.slow] if name in SLOW else []


@pytest.mark.nightly_but("fence with climb limit", "two walls")
@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=tier(name)) for name in MISSIONS_REFUSED])
def test_what_is_reported_to_help_does(name: str) -> None:
    problem = MISSIONS_REFUSED[name]
    refusal = refusal_of(problem)
    changed = cured(problem, refusal.message)
    assert changed, refusal.message
    for other in changed:
        points = plan(replace(other, gap_percent=100.0)).path.points
        assert np.allclose(points[[0, -1]], [problem.start, problem.goal])


@pytest.mark.slow
@pytest.mark.nightly_but("jacksboro.yaml-max_amsl_m-600.5")
@pytest.mark.parametrize(
    ("file", "key", "given"),
    [
        ("jacksboro.yaml", "max_amsl_m", "600.5"),
        pytest.param("jacksboro.yaml", "max_climb_deg", "0.1", marks=pytest.mark.slow),
        pytest.param("jacksboro-wing.yaml", "max_amsl_m", "500.5", marks=pytest.mark.slow),
    ],
)
def test_a_mission_file_with_the_reported_value_has_a_mission(
    tmp_path: FilePath, monkeypatch: pytest.MonkeyPatch, file: str, key: str, given: str
) -> None:
    # All values have their turn, however fast the machine is.
    monkeypatch.setattr("gcsplan.planners.refusal.suggestions.WHOLE_SHARE", 20.0)
    text = (MISSIONS / file).read_text(encoding="utf-8")
    mission = tmp_path / "mission.yaml"
    mission.write_text(re.sub(rf"{key}: [\d.]+", f"{key}: {given}", text), encoding="utf-8")
    with pytest.raises(NoMission) as caught:
        pipeline.plan(mission)
    values = [value for found, value in LIMIT.findall(caught.value.message) if found == key]
    assert len(values) == 1, caught.value.message
    mission.write_text(re.sub(rf"{key}: [\d.]+", f"{key}: {values[0]}", text), encoding="utf-8")
    assert pipeline.plan(mission).vehicles[0].verdict.safe is not False


@pytest.mark.slow
def test_a_ceiling_is_reported_close_to_the_lowest_that_does() -> None:
    problem = MISSIONS_REFUSED["wall under the ceiling"]
    (value,) = [float(v) for k, v in LIMIT.findall(refusal_of(problem).message) if k == "max_amsl_m"]
    assert 133.3 <= value <= 137.0


# -- limits of the trials ------------------------------------------------------------------------------------------


@dataclass
class SlowPlan:
    """A planner that takes ``seconds`` for every problem, and finds a path if ``opens`` returns True for it."""

    seconds: float
    opens: Callable[[Problem], bool]
    now_s: float = 0.0
    asked: int = 0

    def __call__(self, problem: Problem) -> Solution:
        self.asked += 1
        self.now_s += self.seconds
        if not self.opens(problem):
            raise Refusal("no mission: no path was found", reason="not_found", untried=True)
        return Solution(Path(np.array([problem.start, (1000.0, 1000.0, 500.0), problem.goal])))


BARE = Refusal("no mission: no path was found", reason="not_found", untried=True)


def many_limits() -> Problem:
    limits = Limits(10.0, 50.0, 100.0, max_climb_deg=10.0, max_descent_deg=10.0)
    zones = [Zone(f"zone {k}", Circle(1000.0, 1000.0, 10.0 * k + 10.0)) for k in range(40)]
    return Problem(Airspace(ground(0.0), zones), limits, (200.0, 1000.0, 20.0), (1800.0, 1000.0, 20.0))


def cures_of(problem: Problem, slow: SlowPlan, monkeypatch: pytest.MonkeyPatch) -> Refusal:
    monkeypatch.setattr("gcsplan.planners.refusal.suggestions.time.perf_counter", lambda: slow.now_s)
    return with_cures(problem, BARE, slow)


def test_nothing_is_begun_after_its_share_of_the_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowPlan(0.7, lambda p: False)
    refusal = cures_of(many_limits(), slow, monkeypatch)
    assert slow.now_s <= SHARE * 10.0 + 0.7
    slow = SlowPlan(3.0, lambda p: False)
    refusal = cures_of(replace(many_limits(), budget_s=0.01), slow, monkeypatch)
    assert slow.now_s <= LEAST_S + 3.0
    assert "would do" not in refusal.message
    assert "not tried in 1 s: without max_agl_m, the no-fly zones or max_amsl_m" in refusal.message


def test_a_plan_that_runs_on_is_stopped_when_it_reports_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    class Endless(SlowPlan):
        def __call__(self, problem: Problem) -> Solution:
            assert problem.progress is not None
            for _ in range(100):
                self.now_s += 0.25
                problem.progress(Progress(self.now_s, None, None, "search"))
            return super().__call__(problem)

    slow = Endless(0.0, lambda p: True)
    message = cures_of(many_limits(), slow, monkeypatch).message
    assert slow.now_s <= SHARE * 10.0 + GRACE_S + 0.25
    assert "none is found" not in message
    assert "not tried in 3 s: without max_climb_deg and max_descent_deg, max_agl_m, the no-fly zones or" in message


@pytest.mark.slow
@pytest.mark.parametrize("opens", [lambda p: True, lambda p: False, lambda p: p.limits.max_amsl_m is None])
def test_so_many_plans_and_no_more(opens: Callable[[Problem], bool], monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowPlan(0.0, opens)
    cures_of(many_limits(), slow, monkeypatch)
    assert 4 <= slow.asked <= MOST_TRIALS + 3 * WHOLE  # three limits have values


@pytest.mark.slow
def test_a_value_that_was_tried_in_vain_is_not_reported_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowPlan(0.0, lambda p: p.limits.max_amsl_m is None)
    message = cures_of(many_limits(), slow, monkeypatch).message
    assert "without max_amsl_m there is a path, but with" in message
    assert "would do" not in message


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        (NoMission("battery: 9 J", reason="battery"), "the battery is too small"),
        (CheckFailed("a safe return is required, and there is none", lines=["uav1: 3 m"]), "and there is none"),
    ],
)
def test_a_value_whose_whole_plan_is_refused_does_not_do(
    refused: NoMission | CheckFailed, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = replace(many_limits(), airspace=Airspace(ground(0.0)))
    problem = replace(problem, limits=Limits(10.0, 50.0))

    def opens(p: Problem) -> bool:
        return p.limits.max_agl_m is None or p.limits.max_agl_m >= 70.0

    def whole(p: Problem) -> Solution:
        asked.append(p.limits.max_agl_m)
        assert (p.gap_percent, p.budget_s) == (problem.gap_percent, problem.budget_s)
        if p.limits.max_agl_m is None or p.limits.max_agl_m < least_m:
            raise refused
        return slow(p)

    monkeypatch.setattr("gcsplan.planners.refusal.suggestions.time.perf_counter", lambda: 0.0)
    found, slow = {}, SlowPlan(0.0, opens)
    for least_m in (0.0, 90.0, 1e9):
        asked = list[float | None]()
        found[least_m] = with_cures(problem, BARE, slow, whole, "others aside").message
        assert 1 <= len(asked) <= WHOLE
    assert "max_agl_m 71 would do (50 is given, with 69 none is found); others aside" in found[0.0]
    assert "max_agl_m 71 would do" not in found[90.0] + found[1e9]
    assert re.search(rf"max_agl_m \d+ would do \(50 is given, with \d+ .*{words}\)", found[90.0])
    assert re.search(rf"without max_agl_m there is a path, but with \d+ .*{words}", found[1e9])
    assert "others" not in found[1e9]


def test_the_highest_value_with_a_path_has_its_turn_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """All lower ones may lack the same, such as a safe return."""
    problem = replace(many_limits(), airspace=Airspace(ground(0.0)), limits=Limits(10.0, 50.0))
    slow = SlowPlan(0.0, lambda p: p.limits.max_agl_m is None or p.limits.max_agl_m >= 70.0)

    def whole(p: Problem) -> Solution:
        if p.limits.max_agl_m is not None and p.limits.max_agl_m < 400.0:
            raise CheckFailed("a safe return is required, and there is none", lines=["uav1: 3 m"])
        return slow(p)

    monkeypatch.setattr("gcsplan.planners.refusal.suggestions.time.perf_counter", lambda: 0.0)
    message = with_cures(problem, BARE, slow, whole).message
    found = re.search(r"max_agl_m (\d+) would do \(50 is given, with \d+ .* there is none\)", message)
    assert found is not None, message
    assert 400 <= int(found[1]) <= 501


def test_a_whole_plan_that_runs_on_is_stopped_and_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = replace(many_limits(), airspace=Airspace(ground(0.0)), limits=Limits(10.0, 50.0))
    slow = SlowPlan(0.0, lambda p: p.limits.max_agl_m is None or p.limits.max_agl_m >= 70.0)

    def endless(p: Problem) -> Solution:
        assert p.progress is not None
        while True:
            slow.now_s += 0.25
            p.progress(Progress(slow.now_s, None, None, "search"))

    monkeypatch.setattr("gcsplan.planners.refusal.suggestions.time.perf_counter", lambda: slow.now_s)
    message = with_cures(problem, BARE, slow, endless).message
    assert "there is a path, but with 69 none is found, and with 71, whose whole mission was not tried in " in message
    assert slow.now_s <= (WHOLE_SHARE + 1.0) * problem.budget_s + 0.25


def test_what_helps_only_together_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowPlan(0.0, lambda p: p.limits.max_amsl_m is None and not p.airspace.zones)
    message = cures_of(many_limits(), slow, monkeypatch).message
    assert "without the no-fly zones and max_amsl_m together there is a path" in message


def test_what_nothing_helps_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    message = cures_of(many_limits(), SlowPlan(0.0, lambda p: False), monkeypatch).message
    assert "alone none is found, nor without all of them together" in message
    bare = Problem(Airspace(ground(0.0)), Limits(10.0), (200.0, 1000.0, 20.0), (1800.0, 1000.0, 20.0))
    assert "edge of the known terrain" in cures_of(bare, SlowPlan(0.0, lambda p: False), monkeypatch).message
