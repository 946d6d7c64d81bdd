"""The terrain benchmark: its problems are what it says, its check is the airspace's, nothing finished is lost."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label

from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.measure import Memory, flown, passes
from gcsplan.bench.terrain import ompl
from gcsplan.bench.terrain import ours as terrain_ours
from gcsplan.bench.terrain import report as terrain_report
from gcsplan.bench.terrain import rivals as terrain_rivals
from gcsplan.bench.terrain import run as terrain
from gcsplan.bench.terrain.outcome import OUR_METHOD, MethodOutcome
from gcsplan.bench.terrain.problems import PROBLEM_KINDS, NamedProblem, key_of, problems
from gcsplan.errors import InputError, NoMission
from gcsplan.planners.problem import Problem, Solution
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.path import Path as Flight
from gcsplan.world.zones import Circle

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def main() -> list[NamedProblem]:
    return problems("main", seed=1)


def straight(problem: Problem) -> np.ndarray:
    return np.array([problem.start, problem.goal])


# -- the problems -----------------------------------------------------------------------------------------------------


def test_main_is_twenty_pairs_spread_from_5_to_25_km_with_0_10_and_40_zones(main: list[NamedProblem]) -> None:
    assert [len(p.problem.airspace.zones) for p in main] == [0] * 20 + [10] * 20 + [40] * 20
    ways = [math.dist(p.problem.start[:2], p.problem.goal[:2]) for p in main[:20]]
    assert all(5_000 + 1_000 * k <= way <= 6_001 + 1_000 * k for k, way in enumerate(ways))
    assert len({p.name for p in main}) == len({key_of(p.problem) for p in main}) == 60


def test_starts_and_goals_are_legal_and_as_low_as_can_be(main: list[NamedProblem]) -> None:
    for p in main:
        a, limits = p.problem.airspace, p.problem.limits
        for east, north, amsl in (p.problem.start, p.problem.goal):
            point = np.array([[east, north, amsl]] * 2)
            assert a.clear(Legs.of_path(point, limits), limits).all(), p.name
            assert 60.0 <= amsl - float(a.surface.ground_at(east, north)) < 60.1


def test_the_ceiling_stands_on_half_a_metre_and_blocks_the_straight_line(main: list[NamedProblem]) -> None:
    for p in main[:20]:
        ceiling = p.problem.limits.max_amsl_m
        assert ceiling is not None
        assert ceiling % 1.0 == 0.5
        (e0, n0, _), (e1, n1, _) = p.problem.start, p.problem.goal
        t = np.linspace(0.0, 1.0, 20_001)
        ground = p.problem.airspace.surface.ground_at(e0 + t * (e1 - e0), n0 + t * (n1 - n0))
        assert ground.max() + 60.0 > ceiling


def test_ceiling_and_unlimited_zones_leave_start_and_goal_joined(main: list[NamedProblem]) -> None:
    for p in (main[8], main[27], main[43]):
        surface, ceiling = p.problem.airspace.surface, p.problem.limits.max_amsl_m
        assert ceiling is not None
        rows, cols = surface.ground_m.shape
        e, n = np.moveaxis(surface.grid.to_plane(*np.meshgrid(np.arange(cols), np.arange(rows))), -1, 0)
        free = surface.ground_m + 60.0 <= ceiling
        for zone in p.problem.airspace.zones:
            assert isinstance(zone.shape, Circle)
            if zone.floor is None and zone.ceiling is None:
                free &= np.hypot(e - zone.shape.east_m, n - zone.shape.north_m) >= zone.shape.radius_m
        piece = label(free)[0]
        at = [np.round(surface.grid(x[0], x[1])).astype(int) for x in (p.problem.start, p.problem.goal)]
        assert piece[at[0][1], at[0][0]] == piece[at[1][1], at[1][0]] != 0, p.name


def test_zones_are_a_mix_that_covers_no_start_and_no_goal(main: list[NamedProblem]) -> None:
    kinds = {"unlimited": 0, "over": 0, "under": 0}
    for p in main[40:]:
        for zone in p.problem.airspace.zones:
            assert isinstance(zone.shape, Circle)
            c = zone.shape
            assert 200.0 <= c.radius_m <= 1200.0
            assert min(math.dist((c.east_m, c.north_m), x[:2]) for x in (p.problem.start, p.problem.goal)) > c.radius_m
            kind = "under" if zone.floor is not None else "over" if zone.ceiling is not None else "unlimited"
            kinds[kind] += 1
    assert kinds == {"unlimited": 400, "over": 200, "under": 200}
    for few, many in zip(main[20:40], main[40:], strict=True):
        assert [z.shape for z in few.problem.airspace.zones] == [z.shape for z in many.problem.airspace.zones[:10]]


def test_everyday_missions_are_problems_too() -> None:
    few = problems("everyday", 1, count=1)
    assert {p.group for p in few} <= set(everyday_missions.EVERYDAY_KINDS) - {"vias"}
    assert len(few) >= 10
    assert not any(p.problem.via for p in few)  # over the sample, some missions have vias, too
    all_of_them = {p.name: key_of(p.problem) for p in problems("everyday", 1)}
    assert len(set(all_of_them.values())) == len(all_of_them) > 80  # polygons count in a key, too
    assert {p.name: key_of(p.problem) for p in few}.items() <= all_of_them.items()
    assert {p.problem.limits.horizontal_clearance_m for p in problems("everyday", 1, count=2)} == {0.0, 30.0}


def test_a_seed_alone_makes_the_problems() -> None:
    # Numbers of the set that figures are published for: whoever changes them makes another benchmark.
    first = problems("main", seed=1, count=1)[0]
    assert first.name == "main 1/10, 0 zones"
    assert first.problem.start == pytest.approx((220.73, 7890.06, 512.85), abs=0.02)
    assert first.problem.limits.max_amsl_m == 698.5
    other = problems("main", seed=2, count=1)[0]
    assert other.problem.start != first.problem.start


def test_the_other_kinds_are_what_they_say(main: list[NamedProblem]) -> None:
    band = problems("band", seed=1, count=2)
    assert [p.problem.limits.max_climb_deg for p in band] == [10.0] * 2 + [15.0] * 2
    assert {(p.problem.limits.min_agl_m, p.problem.limits.max_agl_m, p.problem.limits.max_amsl_m) for p in band} == {
        (60.0, 120.0, None)
    }
    turn = problems("turn", seed=1)
    assert [p.problem.turn_radius_m for p in turn] == [100.0] * 60 + [200.0] * 60
    assert [p.problem.start for p in turn[:60]] == [p.problem.start for p in main]
    energy = problems("energy", seed=1)
    assert {p.problem.objective for p in energy} == {"energy"}
    (many,) = problems("many", seed=1)
    assert len(many.problem.airspace.zones) == 1000


def test_real_errors_are_in_the_limits_and_the_ends_are_legal_under_them() -> None:
    for p in problems("main", seed=1, errors=True, count=1):
        limits = p.problem.limits
        assert (limits.horizontal_clearance_m, limits.track_error_m, limits.altitude_error_m) == (30.0, 3.0, 5.0)
        for end in (p.problem.start, p.problem.goal):
            assert p.problem.airspace.clear(Legs.of_path(np.array([end, end]), limits), limits).all()


def test_an_unknown_kind_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="main, energy, band"):
        problems("mian")


def test_the_key_tells_apart_what_bears_on_the_answer(main: list[NamedProblem]) -> None:
    p = main[45].problem
    same = replace(p, seed=7, budget_s=1.0)
    others = [
        replace(p, turn_radius_m=100.0),
        replace(p, objective="energy"),
        replace(p, limits=replace(p.limits, min_agl_m=61.0)),
        replace(p, goal=(p.goal[0], p.goal[1], p.goal[2] + 1.0)),
        replace(p, airspace=main[25].problem.airspace),
    ]
    assert key_of(same) == key_of(p)
    assert len({key_of(x) for x in [p, *others]}) == 6


# -- measuring --------------------------------------------------------------------------------------------------------


def test_only_a_whole_legal_path_passes(main: list[NamedProblem]) -> None:
    p = main[8].problem
    assert not passes(p, straight(p))  # through a hill
    assert not passes(p, [p.start])
    assert not passes(p, [p.start, p.start])  # legal, but it leads nowhere
    assert passes(replace(p, goal=p.start), [p.start, p.start])


def test_corners_are_flown_as_tangent_arcs_that_do_not_overlap() -> None:
    square = np.array([[0.0, 0.0, 10.0], [1000.0, 0.0, 20.0], [1000.0, 1000.0, 30.0]])
    track = flown(square, 100.0)
    assert track is not None
    arc, chord = track
    assert not chord[[0, -1]].any()
    assert chord[1:-1].all()
    assert np.hypot(*np.diff(arc[:, :2], axis=0).T).sum() == pytest.approx(1800.0 + 50.0 * math.pi, abs=0.1)
    away = np.hypot(arc[1:-1, 0] - 900.0, arc[1:-1, 1] - 100.0)
    assert away == pytest.approx(100.0, abs=1e-6)
    middle = np.argmin(np.abs(arc[:, 0] - 1000.0 + arc[:, 1]))
    assert arc[middle, 2] == pytest.approx(20.0)
    right = flown(square * [1.0, -1.0, 1.0], 100.0)
    assert right is not None
    assert right[0][:, :2] * [1.0, -1.0] == pytest.approx(arc[:, :2])
    assert flown(square, 1001.0) is None
    assert flown(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]), 10.0) is None


def test_a_way_point_without_a_turn_adds_no_leg_that_is_too_short_for_an_angle() -> None:
    straight_on = np.array([[0.1, 0.2, 10.0], [333.3, 444.4, 20.0], [999.9, 1333.0, 40.0], [1700.0, 900.0, 55.0]])
    track = flown(straight_on, 100.0)
    assert track is not None
    arc, chord = track
    steps = np.hypot(*np.diff(arc[:, :2], axis=0).T)
    assert steps.min() > 1e-3
    assert (np.diff(arc[:, 2]) / steps).max() < 0.03
    assert tuple(arc[0]) == tuple(straight_on[0])
    assert tuple(arc[-1]) == tuple(straight_on[-1])
    assert chord.sum() > 5
    twice = np.array([[0.0, 0.0, 10.0], [500.0, 0.0, 20.0], [500.0 + 1e-7, 0.0, 20.0], [1000.0, 0.0, 30.0]])
    merged = flown(twice, 100.0)
    assert merged is not None
    assert merged[0] == pytest.approx(twice[[0, 1, 3]])
    assert not merged[1].any()
    jump = flown(np.array([[0.0, 0.0, 10.0], [500.0, 0.0, 20.0], [500.0 + 1e-7, 0.0, 60.0]]), 100.0)
    assert jump is not None
    assert jump[0][:, 2] == pytest.approx([10.0, 20.0, 60.0])  # a climb on the spot is not smoothed away


def test_only_chords_are_widened_by_what_they_cut_off(main: list[NamedProblem]) -> None:
    p = easy(main).problem
    a, b = np.array(p.start), np.array(p.goal)
    across = np.array([a[1] - b[1], b[0] - a[0], 0.0]) / math.hypot(*(b - a)[:2])
    path = np.array([a, 0.5 * (a + b) + 400.0 * across, b])
    radius = 200.0
    track = flown(path, radius)
    assert track is not None
    beside_leg = 0.5 * (track[0][0] + track[0][1])
    ahead = (track[0][1] - track[0][0])[:2] / math.hypot(*(track[0][1] - track[0][0])[:2])
    aside = np.array([-ahead[1], ahead[0]])

    def among(centre: np.ndarray, distance_m: float) -> Problem:
        """With a cylinder so far to the side of the nearest part of the track."""
        at = centre + (50.0 + distance_m) * aside
        zone = replace(main[45].problem.airspace.zones[0], shape=Circle(*at.tolist(), 50.0), floor=None, ceiling=None)
        return replace(p, airspace=Airspace(p.airspace.surface, [zone]), turn_radius_m=radius)

    assert passes(among(beside_leg[:2], 0.02), path)
    assert not passes(among(beside_leg[:2], -0.02), path)
    chord_middle = 0.5 * (track[0][2] + track[0][3])[:2]
    ahead = (track[0][3] - track[0][2])[:2] / math.hypot(*(track[0][3] - track[0][2])[:2])
    aside = np.array([-ahead[1], ahead[0]])
    assert not passes(among(chord_middle, 0.04), path)
    assert passes(among(chord_middle, 0.5), path)


def test_a_path_with_a_corner_too_sharp_for_the_turn_radius_does_not_pass(main: list[NamedProblem]) -> None:
    p = easy(main).problem
    a, b = np.array(p.start), np.array(p.goal)
    across = np.array([a[1] - b[1], b[0] - a[0], 0.0]) / math.dist(a, b)
    zigzag = [a, 0.5 * (a + b) + 150.0 * across, 0.5 * (a + b) - 150.0 * across, b]
    assert passes(p, zigzag)
    assert passes(replace(p, turn_radius_m=100.0), zigzag)
    assert not passes(replace(p, turn_radius_m=200.0), zigzag)


def test_peak_memory_is_that_of_the_block() -> None:
    memory = Memory()
    with memory.peak():
        block = np.ones(8_000_000)
        del block
    if memory.peak_mb is None:
        pytest.skip("the system does not tell")
    assert 55.0 < memory.peak_mb < 120.0


class Fake:
    """A planner that goes the straight way, once it was asked ``fails`` times."""

    def __init__(self, error: Exception | None = None) -> None:
        self.error = error
        self.airspaces: list[int] = []

    def plan(self, problem: Problem) -> Solution:
        self.airspaces.append(id(problem.airspace))
        if self.error is not None:
            raise self.error
        way = math.dist(problem.start, problem.goal)
        return Solution(Flight(straight(problem)), 0.5 * way, "gap", 0.2, 0.1)


def easy(main: list[NamedProblem]) -> NamedProblem:
    """One whose straight line is legal."""
    p = main[8]
    high = replace(p.problem.limits, max_amsl_m=None, max_climb_deg=90.0, max_descent_deg=90.0)
    up = [(e, n, 2000.0) for e, n, _ in (p.problem.start, p.problem.goal)]
    return replace(p, problem=replace(p.problem, limits=high, start=up[0], goal=up[1]))


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (None, "solved"),
        (NoMission("no way", reason="infeasible"), "infeasible"),
        (NoMission("no way seen", reason="not_found"), "not found"),
        (ZeroDivisionError("a bug"), "failed"),
    ],
)
def test_every_answer_of_ours_is_an_outcome(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, error: Exception | None, status: str
) -> None:
    fake = Fake(error)
    monkeypatch.setattr(terrain_ours, "get_planner", lambda name: fake)
    one = easy(main)
    outcome = terrain_ours.measure(one, lambda: 0.01, runs=3)  # type: ignore[arg-type]
    assert (outcome.status, outcome.method, outcome.runs, outcome.sweep_s) == (status, OUR_METHOD, 3, 0.01)
    assert len(fake.airspaces) == 3
    assert id(one.problem.airspace) not in fake.airspaces
    if error is None:
        assert outcome.gap_percent == pytest.approx(100.0)
        assert outcome.first_path_s == 0.1
    else:
        assert str(error) in outcome.detail


def test_a_path_that_the_exact_check_rejects_is_unsafe_whatever_its_planner_says(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terrain_ours, "get_planner", lambda name: Fake())
    assert terrain_ours.measure(main[8], lambda: 0.01, runs=1).status == "unsafe"  # type: ignore[arg-type]


# -- rivals -----------------------------------------------------------------------------------------------------------


def test_the_check_of_one_leg_is_the_airspaces_own(main: list[NamedProblem]) -> None:
    p = main[48].problem
    names = ompl.KERNEL_ARGUMENTS
    arguments = ompl.kernel_arguments(p.airspace, p.limits)
    assert len(names) == len(arguments)
    place = {name: arguments[i] for i, name in enumerate(names)}
    assert place["ground"] is p.airspace.surface.ground_m
    assert (place["start"].shape, place["ok"].shape, place["seen"].shape) == ((1, 3), (1,), (40,))
    assert place["max_amsl_m"] == p.limits.max_amsl_m


def outcome(key: str, method: str, cost: float | None, **more: object) -> MethodOutcome:
    status = "not found" if cost is None else "solved"
    return replace(MethodOutcome(key, f"p {key}", "main", "0 zones", method, status, cost=cost), **more)  # type: ignore[arg-type]


def test_answers_outlive_a_run_that_is_cut_off_in_the_middle_of_a_line(tmp_path: Path) -> None:
    file = tmp_path / "sub" / "rivals.jsonl"
    answers = terrain_rivals.Answers(file)
    answers.add(outcome("a", "OMPL RRT* 1 s", 12.5, version="ompl 2", points=[[1.0, 2.0, 3.0]]))
    with file.open("a", encoding="utf-8") as torn:
        torn.write(json.dumps(asdict(outcome("b", "OMPL RRT* 1 s", 1.0)))[:40])
    again = terrain_rivals.Answers(file)
    again.add(outcome("c", "OMPL RRT* 1 s", None, version="ompl 2"))
    last = terrain_rivals.Answers(file)
    kept = last.get("a", "OMPL RRT* 1 s", "ompl 2")
    assert kept is not None
    assert (kept.cost, kept.points) == (12.5, [[1.0, 2.0, 3.0]])
    assert last.get("b", "OMPL RRT* 1 s", "") is None
    assert last.get("c", "OMPL RRT* 1 s", "ompl 2") is not None
    assert last.get("a", "OMPL RRT* 1 s", "ompl 3") is None


def test_what_is_kept_is_not_run_again_and_is_judged_again(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = easy(main)
    good, bad = terrain_rivals.rivals([1.0], swarms=False)[:2]
    monkeypatch.setattr(terrain_rivals, "release", lambda rival: "v")
    monkeypatch.setattr(terrain_rivals, "RivalProcess", None)  # nobody may be asked
    answers = terrain_rivals.Answers(tmp_path / "rivals.jsonl")
    key = key_of(one.problem)
    answers.add(outcome(key, good.method, 1.0, version="v", points=straight(one.problem).tolist()))
    answers.add(outcome(key, bad.method, 1.0, version="v", points=[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]))
    found = list(terrain_rivals.compare([one], [good, bad], answers, seed=1))
    assert [o.status for o in found] == ["solved", "unsafe"]
    more = [good, terrain_rivals.Rival("ompl", "BIT*", 3.0)]
    kept = terrain_rivals.compare([one], more, answers, seed=1, kept_only=True)
    assert [o.method for o in kept] == [good.method]


def test_a_rival_that_is_not_installed_is_named_with_the_cure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(ompl, "version", missing)
    with pytest.raises(InputError, match=r"gcsplan\[bench\]"):
        terrain.run(tmp_path, kinds=["main"], runs=1, count=1)
    assert list(tmp_path.iterdir()) == []


def test_a_swarms_path_begins_and_ends_where_it_should_and_legal_ones_cost_their_length(
    main: list[NamedProblem],
) -> None:
    from gcsplan.bench.terrain.swarms import encoding

    one = easy(main).problem
    decode, cost = encoding(replace(one, airspace=main[8].problem.airspace))
    x = np.full(16, 0.5)
    x[8:] = 1.0
    points = decode(x)
    assert points.shape == (200, 3)
    assert tuple(points[0]) == one.start
    assert tuple(points[-1]) == one.goal
    hard, harder = encoding(main[8].problem)[1], encoding(main[48].problem)[1]
    low = x.copy()
    low[8:] = 0.0
    assert harder(low) >= hard(low) > 2.0 * math.dist(one.start, one.goal)
    assert cost(x) >= float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) * (1.0 - 1e-12)


# -- the report -------------------------------------------------------------------------------------------------------


def several() -> list[MethodOutcome]:
    return [
        outcome("a", OUR_METHOD, 101.0, bound=100.0, first_path_s=0.02, planning_s=0.1, sweep_s=0.05, memory_mb=10.0),
        outcome("b", OUR_METHOD, 204.0, bound=200.0, first_path_s=0.04, planning_s=0.3, sweep_s=0.05, memory_mb=20.0),
        replace(outcome("c", OUR_METHOD, None), status="infeasible", detail="no way"),
        outcome("a", "OMPL RRT* 1 s", 110.0, planning_s=1.0),
        outcome("b", "OMPL RRT* 1 s", 202.0, planning_s=1.0),
        outcome("c", "OMPL RRT* 1 s", None),
    ]


def test_the_table_counts_and_measures_against_the_certified_bound() -> None:
    ours, theirs = terrain_report.lines(several())
    assert (ours.solved, ours.infeasible, ours.problems, ours.memory_mb) == (2, 1, 3, 20.0)
    assert ours.gaps == pytest.approx((1.0, 2.0))
    assert ours.ratio == pytest.approx(4.0)
    assert theirs.gaps == pytest.approx((10.0, 1.0))
    assert (theirs.solved, theirs.shorter, ours.shorter) == (2, 1, 0)
    assert terrain_report.beaten_by(several()) == ["p b: OMPL RRT* 1 s 202.00 against 204.00"]
    assert terrain_report.unsolved(several()) == ["p c: infeasible, no way"]


def test_the_report_is_written_whole_even_when_the_run_is_interrupted(
    main: list[NamedProblem], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[str] = []
    gaps: list[float] = []

    def measure(one: NamedProblem, sweep: object, **more: object) -> MethodOutcome:
        asked.append(one.name)
        gaps.append(one.problem.gap_percent)
        if len(asked) > 2:
            raise KeyboardInterrupt
        found = replace(several()[len(asked) - 1], key=key_of(one.problem), name=one.name, group=one.group)
        return replace(found, gap_asked_percent=one.problem.gap_percent)

    monkeypatch.setattr(terrain_ours, "measure", measure)
    monkeypatch.setattr(terrain_ours, "Sweep", lambda: None)
    monkeypatch.setattr(terrain_ours, "warm_up", lambda named, planner: 0.0)
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        terrain.run(tmp_path, kinds=["main"], runs=1, count=1, rivals=False, tell=said.append)
    assert [f"gcsplan: {name}" for name in asked] == said[2:]
    assert (tmp_path / "terrain.png").read_bytes().startswith(b"\x89PNG")
    rows = (tmp_path / "terrain.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 3
    assert set(gaps) == {terrain.GAP_PERCENT}
    assert "certified gap of 0.1 % (gcsplan)" in (tmp_path / "terrain.md").read_text(encoding="utf-8")
    assert rows[0].startswith("key,name,kind,group,method,status")
    assert asked[1].split(",")[0] in rows[2]
    assert "| 0 zones | gcsplan | 1/1 |" in (tmp_path / "terrain.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "wrong", [{"kinds": ["mian"]}, {"runs": 0}, {"count": 0}, {"seconds": [0.0]}, {"gap_percent": -1.0}]
)
def test_wrong_orders_are_refused_before_anything_is_done(wrong: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(InputError):
        terrain.run(tmp_path, **wrong)  # type: ignore[arg-type]
    assert set(PROBLEM_KINDS) >= {"main", "band", "large", "many", "turn", "energy"}
