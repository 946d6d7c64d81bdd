"""Conflicts resolved: by how little, in whose favour, what stays as asked, and what a refusal tells."""

from __future__ import annotations

import math
import pickle
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from gcsplan.errors import NoMission
from gcsplan.fleet._taken import Taken
from gcsplan.fleet.arrival import Craft, Crew, Schedule, Slot, schedule
from gcsplan.fleet.motion.timing import MissionEnd, Route, TimedPath
from gcsplan.fleet.resolve import Change, NotSeparated, Resolved, least_interval_s, resolve
from gcsplan.fleet.separation import Conflict, Rules, separation
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.fleet.test_separation import drifting_fleet, random_fleet
from tests.support.effort import draws
from tests.support.flights import motions
from tests.support.noted import codes

RULES = Rules(30.0, error_m=0.25)
Point = tuple[float, float]


def crew(
    name: str,
    *places: Point,
    end: MissionEnd = "land",
    height_m: float = 60.0,
    slowest: float = 3.0,
    hover_w: float = 400.0,
    autopilot: Autopilot = Autopilot.ARDUCOPTER,
) -> Crew:
    """A vehicle that flies level past ``places``."""
    points = np.array([(*p, height_m) for p in places])
    vehicle = Vehicle(name, 1, autopilot, Limits(20.0), speed_min_m_s=slowest, energy=Energy(hover_w=hover_w))
    grounds = (0.0, 0.0 if end == "land" else None) if end != "none" else (None, None)
    return Crew(vehicle, Route(name, points, *grounds, end))


def codes_of(change: Change) -> list[str]:
    """The codes of what a change changes."""
    return codes(change.note().data["changes"])  # type: ignore[arg-type]


def crossing() -> list[Crew]:
    """Two whose ways cross in the middle, at the same moment if they leave together."""
    return [crew("a", (0, 0), (1000, 0)), crew("b", (500, -500), (500, 500))]


def verify(found: Resolved, crews: Sequence[Crew], rules: Rules = RULES) -> None:
    """Flown as the slots say, the fleet keeps its separation; nothing is out of a vehicle's reach."""
    paths = motions(found.schedule, crews)
    gone = frozenset(s.name for s in found.schedule.slots if s.route.end == "none")
    assert separation(paths, replace(rules, leaving=gone)).safe
    assert found.separation.safe
    for slot, path, told in zip(found.schedule.slots, paths, found.paths, strict=True):
        vehicle = next(c.vehicle for c in crews if c.name == slot.name)
        assert vehicle.speed_min_m_s - 1e-6 <= slot.speed_m_s <= vehicle.speed_max_m_s + 1e-6
        assert slot.depart_s >= 0.0
        assert slot.hold_s >= 0.0
        assert abs(path.arrive_s - slot.arrive_s) < 1e-6
        assert path.name == told.name == slot.name
        assert np.allclose(path.points[-1], told.points[-1])


# -- shifts -------------------------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_shift_is_forbidden_exactly_where_the_shifted_motion_is_judged_a_conflict() -> None:
    free = looked = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        fleet = drifting_fleet(seed) if seed % 2 else random_fleet(seed)
        rules = Rules(
            float(rng.choice([5.0, 15.0])),
            window_s=float(rng.choice([0.0, 0.0, 0.3])),
            pad_clear_s=float(rng.choice([math.inf, 2.0, 0.0])),
            leaving=frozenset(p.name for p in fleet if rng.random() < 0.4),
        )
        taken = Taken(rules)
        for path in fleet[1:]:
            taken.add(path)
        spans = taken.forbidden(fleet[0], -6.0, 6.0)
        least = spans.least(-6.0, 6.0)
        ends = np.concatenate([spans.low, spans.high, [99.0]])
        for shift in [*rng.uniform(-6.0, 6.0, 5), *([] if least is None else [least])]:
            judged = separation([fleet[0].delayed(float(shift)), *fleet[1:]], rules)
            safe = not any(fleet[0].name in c.worst.vehicles for c in judged.conflicts)
            assert spans.free(float(shift)) == safe or np.abs(ends - shift).min() < 1e-5, f"seed {seed}, {shift}"
            assert safe or shift != least, f"seed {seed}"
            assert safe is False or least is None or abs(shift) >= abs(least) - 1e-9, f"seed {seed}"
            looked, free = looked + 1, free + safe
    assert 0.3 * looked < free < 0.9 * looked


# -- what is changed ----------------------------------------------------------------------------------------------


def test_a_fleet_that_keeps_its_distance_is_left_as_it_is() -> None:
    crews = [crew("a", (0, 0), (1000, 0)), crew("b", (0, 200), (1000, 200))]
    plan = schedule(crews, "none")
    found = resolve(plan, crews, RULES)
    assert found.changes == ()
    assert found.schedule.slots == plan.slots
    verify(found, crews)


def test_the_later_in_order_leaves_later_by_the_least_that_does() -> None:
    crews = crossing()
    plan = schedule(crews, "none")
    found = resolve(plan, crews, RULES)
    verify(found, crews)
    (change,) = found.changes
    assert (change.name, change.how) == (plan.order[1], "departure")
    later = change.slot.depart_s
    assert 0.0 < later < 20.0
    fixed, moved = (found.paths[[p.name for p in found.paths].index(n)] for n in plan.order)
    # The same departure a tenth of a second earlier does not do, nor does any between it and the start.
    for part in np.linspace(0.0, 1.0, 21):
        sooner = moved.delayed(-0.1 - part * (later - 0.1))
        assert not separation([fixed, sooner], RULES).safe
    said = change.slot.notes[-1]
    assert said == change.note()
    assert said.data["changes"] == (Note("leaves_later", by_s=later),)
    assert said.data["other"] == plan.order[0]
    assert str(said).startswith(f"leaves {later:.1f} s later: to keep clear of {plan.order[0]} (")
    assert change.extra_j == 0.0


def test_who_has_priority_is_not_changed() -> None:
    crews = crossing()
    plan = schedule(crews, "none")
    for first, second in (("a", "b"), ("b", "a")):
        found = resolve(plan, crews, RULES, priority=[first, second])
        assert [c.name for c in found.changes] == [second]
        assert found.schedule.of(first) == plan.of(first)
        verify(found, crews)
    with pytest.raises(ValueError, match="names every vehicle once"):
        resolve(plan, crews, RULES, priority=["a"])


@pytest.mark.parametrize("mode", ["sequence", "together"])
def test_arrivals_on_time_stay_so_and_departure_changes_with_speed(mode: str) -> None:
    crews = [crew("a", (0, 0), (1000, 0)), crew("b", (500, -500), (500, 500)), crew("c", (250, -250), (250, 750))]
    plan = schedule(crews, mode, interval_s=1.0, arrive_s=150.0)  # type: ignore[arg-type]
    found = resolve(plan, crews, RULES)
    assert found.later_s == 0.0
    verify(found, crews)
    assert found.changes != ()
    for slot in found.schedule.slots:
        assert abs(slot.arrive_s - plan.of(slot.name).arrive_s) < 1e-5
    for change in found.changes:
        assert change.how == "departure"
        assert (change.slot.depart_s > change.was.depart_s) == (change.slot.speed_m_s > change.was.speed_m_s)


def test_where_all_leave_at_once_one_holds_at_the_gate() -> None:
    crews = crossing()
    plan = schedule(crews, "none")
    found = resolve(plan, crews, RULES, hold="gate")
    verify(found, crews)
    (change,) = found.changes
    assert change.slot.depart_s == change.was.depart_s
    assert change.how in ("hold", "speed")
    if change.how == "hold":
        assert change.extra_j == pytest.approx(400.0 * change.slot.hold_s)


def test_where_nobody_may_wait_one_flies_slower() -> None:
    crews = crossing()
    found = resolve(schedule(crews, "none"), crews, RULES, hold="none")
    verify(found, crews)
    (change,) = found.changes
    assert change.how == "speed"
    assert change.slot.speed_m_s < change.was.speed_m_s
    assert change.slot.depart_s == change.slot.hold_s == 0.0


@pytest.mark.slow
def test_where_the_clock_leaves_no_room_all_arrive_later_by_the_same() -> None:
    crews = crossing()
    plan = schedule(crews, "together")  # both at their fastest: nobody could make up for leaving later
    found = resolve(plan, crews, RULES)
    verify(found, crews)
    assert 0.0 < found.later_s < 20.0
    late = [s.arrive_s - plan.of(s.name).arrive_s for s in found.schedule.slots]
    assert late == pytest.approx([found.later_s] * 2, abs=1e-5)
    assert min(s.depart_s for s in found.schedule.slots) == 0.0
    assert [c.name for c in found.changes] == ["b"]
    assert codes_of(found.changes[0])[0] == "leaves_earlier"
    with pytest.raises(NotSeparated):
        resolve(plan, crews, RULES, later_s=0.0)


@pytest.mark.slow
def test_one_that_nothing_helps_goes_before_the_one_in_its_way() -> None:
    # b can neither wait nor slow down; a can do both, is first in order, and would be where b is.
    stiff = crew("b", (345, -500), (345, 500), slowest=15.0, autopilot=Autopilot.ARDUPLANE)
    crews = [crew("a", (0, 0), (700, 0)), stiff]
    plan = schedule(crews, "together", arrive_s=Craft(stiff).fast_s)
    assert not separation(motions(plan, crews), RULES).safe
    found = resolve(plan, crews, RULES, later_s=0.0)
    verify(found, crews)
    assert [c.name for c in found.changes] == ["a"]
    with pytest.raises(NotSeparated) as refused:
        resolve(plan, crews, RULES, priority=["a", "b"], later_s=0.0)
    assert set(refused.value.vehicles) == {"a", "b"}


# -- another path -------------------------------------------------------------------------------------------------


def stuck() -> tuple[Schedule, list[Crew]]:
    """Two that meet head on, both as fast as they are slow: only another path helps."""
    a = crew("a", (0, 0), (1000, 0), slowest=15.0, autopilot=Autopilot.ARDUPLANE)
    b = crew("b", (1000, 60), (0, 60), slowest=15.0, autopilot=Autopilot.ARDUPLANE)
    b = Crew(b.vehicle, replace(b.route, points=np.array([(1000, 60, 60), (600, 0, 60), (400, 0, 60), (0, 60, 60.0)])))
    return schedule([a, b], "none"), [a, b]


@pytest.mark.slow
def test_another_path_is_asked_for_with_what_to_avoid_until_one_does() -> None:
    plan, crews = stuck()
    asked: list[tuple[str, tuple[Conflict, ...], int]] = []

    def replan(name: str, avoid: Sequence[Conflict], attempt: int) -> Route | None:
        asked.append((name, tuple(avoid), attempt))
        route = plan.of(name).route
        return replace(route, points=route.points + np.array([0.0, 0.0, 20.0 * attempt]))

    found = resolve(plan, crews, RULES, hold="none", priority=["a", "b"], replan=replan)
    verify(found, crews)
    assert [(name, attempt) for name, _, attempt in asked] == [("b", 1), ("b", 2)]
    (met,) = asked[0][1]
    assert met.worst.middle == pytest.approx((500.0, 0.0, 60.0), abs=30.0)
    assert len(asked[1][1]) == 2  # what the first idea met is to be avoided as well
    (change,) = found.changes
    assert change.how == "path"
    assert change.extra_j > 0.0
    assert found.schedule.of("b").route.points[0, 2] == 100.0
    assert codes_of(change) == ["takes_another_path", "needs_more_energy"]


def test_a_path_too_long_for_the_clock_lets_all_arrive_later_if_that_is_allowed() -> None:
    plan, crews = stuck()
    plan = schedule(crews, "together")

    def replan(name: str, avoid: Sequence[Conflict], attempt: int) -> Route | None:
        route = plan.of(name).route
        round_it = np.array([route.points[0], (900.0, 250.0, 60.0), (100.0, 250.0, 60.0), route.points[-1]])
        return replace(route, points=round_it) if attempt == 1 else None

    found = resolve(plan, crews, replace(RULES, separation_m=20.0), priority=["a", "b"], replan=replan)
    verify(found, crews, replace(RULES, separation_m=20.0))
    assert [(c.name, c.how) for c in found.changes] == [("b", "path")]
    assert found.later_s > 5.0
    assert found.schedule.of("a").depart_s == pytest.approx(plan.of("a").depart_s + found.later_s)
    with pytest.raises(NotSeparated):
        resolve(plan, crews, RULES, priority=["a", "b"], replan=replan, later_s=0.0)


def test_when_no_path_is_left_the_refusal_names_the_two_the_place_and_the_time() -> None:
    plan, crews = stuck()
    attempts: list[int] = []

    def replan(name: str, avoid: Sequence[Conflict], attempt: int) -> Route | None:
        attempts.append(attempt)
        return None if attempt == 2 else plan.of(name).route

    with pytest.raises(NoMission) as refused:
        resolve(
            plan, crews, RULES, hold="none", priority=["a", "b"], replan=replan,
            where=lambda place: f"<{round(place[1] / 10.0)}>",
        )  # fmt: skip
    error = refused.value
    assert isinstance(error, NotSeparated)
    assert attempts == [1, 2]
    assert error.reason == "separation"
    assert error.exit_code == 3
    assert set(error.vehicles) == {"a", "b"}
    flown = {p.name: p for p in motions(plan, crews)}
    apart = flown["a"].at(error.time_s) - flown["b"].at(error.time_s)
    assert float(np.linalg.norm(apart)) == pytest.approx(error.conflict.worst.distance_m, abs=1e-6)
    assert error.place == pytest.approx(tuple(flown["a"].at(error.time_s)[0] - 0.5 * apart[0]))
    assert all(word in error.message for word in ("a", "b", f"{error.time_s:.1f} s", "<0>", "needed 30.5 m"))
    assert error.interval_s is None
    assert error.goals_m is None
    again = pickle.loads(pickle.dumps(error))
    assert again.vehicles == error.vehicles


# -- goals nearer than the separation -----------------------------------------------------------------------------


def fan(count: int, apart_m: float, end: MissionEnd = "land", slowest: float = 3.0) -> list[Crew]:
    """Vehicles from all around whose goals stand in a circle, each on its own side, so far apart."""
    out = []
    for i in range(count):
        angle = 2.0 * math.pi * i / count
        way = np.array([math.cos(angle), math.sin(angle)])
        goal = way * (apart_m / (2.0 * math.sin(math.pi / count)))
        far = (goal + 800.0 * way).tolist()
        out.append(crew(f"uav{i}", (far[0], far[1]), (goal[0], goal[1]), end=end, slowest=slowest))
    return out


def test_together_at_one_goal_is_refused_with_the_distance_that_works() -> None:
    crews = fan(2, 5.0)
    with pytest.raises(NotSeparated, match=r"the goals of uav0 and uav1 are 5\.0 m apart") as refused:
        resolve(schedule(crews, "together"), crews, RULES)
    enough = refused.value.goals_m
    assert enough == 30.5
    crews = fan(2, enough)
    verify(resolve(schedule(crews, "together"), crews, RULES), crews)
    crews = fan(2, enough - 0.1)
    with pytest.raises(NotSeparated):
        resolve(schedule(crews, "together"), crews, RULES)


def test_landing_on_one_pad_has_no_interval_that_works_while_nobody_clears_it() -> None:
    crews = fan(2, 0.0)
    with pytest.raises(NotSeparated, match="both land there and stay") as refused:
        resolve(schedule(crews, "sequence", interval_s=500.0), crews, RULES)
    assert refused.value.interval_s is None
    assert refused.value.goals_m == 30.5


@pytest.mark.slow
@pytest.mark.parametrize(("end", "clear_s"), [("land", 20.0), ("none", math.inf)])
def test_the_smallest_interval_at_one_goal_works_and_a_tenth_less_does_not(end: MissionEnd, clear_s: float) -> None:
    crews = fan(2, 0.0, end)
    rules = replace(RULES, pad_clear_s=clear_s)
    with pytest.raises(NotSeparated, match="interval_s") as refused:
        resolve(schedule(crews, "sequence", interval_s=1.0), crews, rules)
    interval = refused.value.interval_s
    assert interval is not None
    assert f"interval_s {interval:g}" in refused.value.message
    verify(resolve(schedule(crews, "sequence", interval_s=interval), crews, rules), crews, rules)
    with pytest.raises(NotSeparated):
        resolve(schedule(crews, "sequence", interval_s=interval - 0.1), crews, rules)
    if end == "none":  # it is gone on arrival: the next one, braking, is then the separation away
        assert interval == math.ceil(10.0 * math.sqrt(2.0 * RULES.needed_m / 1.5)) / 10.0
    else:
        assert interval > clear_s


@pytest.mark.slow
def test_the_interval_is_looked_for_with_the_callers_own_schedule() -> None:
    crews = fan(2, 0.0, "none")
    asked: list[float] = []

    def again(interval_s: float) -> Schedule:
        asked.append(interval_s)
        if interval_s > 10.0:
            raise NoMission("too late", reason="time")
        return schedule(crews, "sequence", interval_s=interval_s)

    plan = schedule(crews, "sequence", interval_s=0.5)
    found = least_interval_s(plan, crews, RULES, again=again)
    assert found is not None
    assert found in [round(x, 1) for x in asked]

    def never(interval_s: float) -> Schedule:
        raise NoMission("never", reason="time")

    assert least_interval_s(plan, crews, RULES, again=never) is None


def test_two_that_stay_over_one_place_are_refused_at_once() -> None:
    crews = fan(2, 10.0, "loiter")
    with pytest.raises(NotSeparated, match="both stay there"):
        resolve(schedule(crews, "sequence", interval_s=60.0), crews, RULES)
    # One above the other they may.
    high = Crew(crews[1].vehicle, replace(crews[1].route, points=crews[1].route.points + np.array([0, 0, 40.0])))
    verify(resolve(schedule([crews[0], high], "together"), [crews[0], high], RULES), [crews[0], high])


# -- many ---------------------------------------------------------------------------------------------------------


def made_fleet(count: int, seed: int, side_m: float, legs: int = 6) -> list[Crew]:
    """Starts and goals on pads 60 m apart, ways that wander between them at one and the same height."""
    rng = np.random.default_rng(seed)
    across = int(side_m / 60.0)
    pads = rng.permutation(across * across)[: 2 * count]
    out = []
    for i in range(count):
        ends = [np.array([pad % across, pad // across]) * 60.0 for pad in pads[2 * i : 2 * i + 2].tolist()]
        part = np.linspace(0.0, 1.0, legs + 1)[:, None]
        flat = ends[0] * (1.0 - part) + ends[1] * part
        flat[1:-1] += rng.normal(0.0, 20.0, (legs - 1, 2))
        out.append(crew(f"uav{i:03d}", *[(float(e), float(n)) for e, n in flat]))
    return out


@pytest.mark.slow
@settings(max_examples=draws(12), phases=[Phase.explicit, Phase.generate])
@given(st.integers(0, 2**32 - 1), st.sampled_from(["none", "sequence", "together"]), st.sampled_from([0.0, 1.0]))
def test_whatever_is_resolved_keeps_its_separation_and_its_arrivals(seed: int, mode: str, window_s: float) -> None:
    crews = made_fleet(4, seed, 700.0)
    plan: Schedule = schedule(crews, mode, interval_s=4.0, clock="fleet")  # type: ignore[arg-type]
    rules = replace(RULES, window_s=window_s)
    try:
        found = resolve(plan, crews, rules)
    except NotSeparated:
        if mode == "none":
            raise  # who may leave whenever it likes always finds a time
        return
    verify(found, crews, rules)
    if mode != "none":
        for slot in found.schedule.slots:
            assert abs(slot.arrive_s - plan.of(slot.name).arrive_s - found.later_s) < 1e-5


@pytest.mark.slow
def test_a_hundred_vehicles_are_kept_apart() -> None:
    crews = made_fleet(100, 4, 3000.0, legs=20)
    plan = schedule(crews, "none")
    before = separation(motions(plan, crews), RULES)
    assert len({c.worst.vehicles for c in before.conflicts}) > 30
    found = resolve(plan, crews, RULES)
    verify(found, crews)
    moved = {c.name for c in found.changes}
    assert 10 < len(moved) < 80
    assert all(found.schedule.of(s.name) == s for s in plan.slots if s.name not in moved)
    arrivals = [s.arrive_s for s in found.schedule.slots]
    assert arrivals == sorted(arrivals)


def test_a_slot_and_its_motion_are_one() -> None:
    crews = crossing()
    found = resolve(schedule(crews, "none"), crews, RULES)
    slot: Slot = found.changes[0].slot
    path: TimedPath = next(p for p in found.paths if p.name == slot.name)
    assert path.begin_s == pytest.approx(slot.depart_s)
    assert path.arrive_s == pytest.approx(slot.arrive_s)
