"""Arrival schedules: the paper's arithmetic, brute force over orders and speeds, and refusals that name what works."""

from __future__ import annotations

import itertools
import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.fleet.arrival import Craft, Crew, NoSchedule, Schedule, best_order, interval_range, schedule
from gcsplan.fleet.motion.timing import Route
from gcsplan.mission_file.request import ArrivalRequest
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.mission_file.test_load import base, load, local, the_problem
from tests.mission_file.test_load import vehicle as keys
from tests.support.effort import draws
from tests.support.flights import fly, time_to_goal_s
from tests.support.noted import codes, one

INF = math.inf
FREE = {
    "climb_m_s": INF, "descent_m_s": INF, "land_m_s": INF, "accel_m_s2": INF, "corner_accel_m_s2": INF,
    "vertical_accel_m_s2": INF,
}  # fmt: skip


def crew(name: str, length_m: float, **changes: Any) -> Crew:
    """A vehicle with a level way of that length, from 60 m above its start to 60 m above its goal."""
    craft = replace(Vehicle(name, 1, Autopilot.ARDUCOPTER, Limits(min_agl_m=5)), **changes)
    points = np.array([[0.0, 0.0, 100.0], [length_m, 0.0, 100.0]])
    return Crew(craft, Route(name, points, start_ground_amsl_m=40.0, goal_ground_amsl_m=40.0))


def ideal(lengths_m: list[float], slowest_m_s: float = 3.0) -> list[Crew]:
    """The paper's vehicles: nothing but a length and a range of speeds."""
    found = []
    for i, length_m in enumerate(lengths_m, start=1):
        one = crew(f"uav{i}", length_m, speed_min_m_s=slowest_m_s, speed_max_m_s=30.0, **FREE)
        points = one.route.points
        found.append(Crew(one.vehicle, Route(one.name, points, end="none")))
    return found


def arrivals(plan: Schedule) -> list[float]:
    return [s.arrive_s for s in plan.slots]


def least_interval_s(crews: list[Crew], **more: Any) -> float | None:
    """The smallest interval with which this order works, from the refusal of 0 s; 0 if that works."""
    try:
        schedule(crews, "sequence", interval_s=0.0, **more)
    except NoSchedule as refusal:
        return refusal.interval_s
    return 0.0


def require_sound(plan: Schedule, crews: list[Crew]) -> None:
    """Every slot is what flying it gives, and within its vehicle's means."""
    known = {c.name: c for c in crews}
    assert sorted(plan.order) == sorted(known)
    assert [s.name for s in plan.slots] == list(plan.order)
    for slot in plan.slots:
        craft = known[slot.name].vehicle
        assert slot.speed_m_s == float(np.float32(slot.speed_m_s))
        assert craft.speed_min_m_s <= slot.speed_m_s <= craft.speed_max_m_s
        assert slot.depart_s >= 0.0
        assert slot.hold_s == int(slot.hold_s) >= 0
        flown = slot.depart_s + slot.hold_s + time_to_goal_s(slot.route, craft, slot.speed_m_s)
        assert slot.arrive_s == pytest.approx(flown, abs=1e-9)
        motion = fly(slot.route, craft, slot.speed_m_s, slot.depart_s, slot.hold_s)
        assert motion.arrive_s == pytest.approx(flown, abs=1e-9)
        assert slot.energy_j == slot.route.energy_j(craft, slot.hold_s)


# -- the paper ----------------------------------------------------------------------------------------------------


def test_the_papers_sequence_comes_out_to_the_printed_digit() -> None:
    crews = ideal([261.115, 306.704, 350.520, 421.547])  # Table IV, IB-ABC
    plan = schedule(crews, "sequence", interval_s=9.0)
    assert [round(t, 3) for t in arrivals(plan)] == [8.704, 17.704, 26.704, 35.704]
    assert [round(s.speed_m_s, 3) for s in plan.slots] == [30, 17.324, 13.126, 11.807]
    assert {(s.depart_s, s.hold_s) for s in plan.slots} == {(0.0, 0.0)}
    require_sound(plan, crews)


@pytest.mark.parametrize(
    ("lengths", "times"),
    [
        ([262.65, 327.76, 452.35, 437.01], [8.755, 17.755, 26.755, 35.755]),  # ABC
        ([262.488, 328.321, 432.470, 424.269], [8.750, 17.750, 26.750, 35.750]),  # B-ABC
    ],
)
def test_the_papers_other_columns_too(lengths: list[float], times: list[float]) -> None:
    assert [round(t, 3) for t in arrivals(schedule(ideal(lengths), "sequence", interval_s=9.0))] == times


def test_the_papers_common_arrival_gives_its_speeds() -> None:
    crews = ideal([261.670, 349.734, 327.469, 301.035], slowest_m_s=0.1)  # Table II, IB-ABC
    plan = schedule(crews, "together", arrive_s=14.249)
    assert [s.speed_m_s for s in plan.slots] == pytest.approx([18.3642, 24.5445, 22.9818, 21.1268], abs=1e-3)
    assert arrivals(plan) == pytest.approx([14.249] * 4, abs=1e-6)
    # Its T is not the slowest's at 30 m/s, which is the earliest that there is.
    assert arrivals(schedule(crews, "together")) == pytest.approx([349.734 / 30] * 4, abs=1e-6)


# -- speeds, waiting on the ground, holding, longer paths ---------------------------------------------------------


def test_with_acceleration_and_columns_the_arrivals_are_as_asked() -> None:
    crews = [crew("a", 900), crew("b", 1300), crew("c", 1000), crew("d", 1500, speed_max_m_s=20.0)]
    plan = schedule(crews, "sequence", interval_s=30.0)
    first = time_to_goal_s(crews[0].route, crews[0].vehicle, 15.0)
    assert arrivals(plan) == pytest.approx([first + 30.0 * k for k in range(4)], abs=1e-5)
    assert all(s.depart_s == 0 for s in plan.slots)
    require_sound(plan, crews)
    together = schedule(crews, "together")
    slowest = max(time_to_goal_s(c.route, c.vehicle, c.vehicle.speed_max_m_s) for c in crews)
    assert arrivals(together) == pytest.approx([slowest] * 4, abs=1e-5)
    require_sound(together, crews)


def test_without_a_mode_everybody_flies_at_its_fastest_at_once() -> None:
    crews = [crew("a", 900), crew("b", 400), crew("c", 700)]
    plan = schedule(crews, "none")
    assert plan.order == ("b", "c", "a")
    assert {(s.depart_s, s.hold_s, s.speed_m_s) for s in plan.slots} == {(0.0, 0.0, 15.0)}
    require_sound(plan, crews)


def test_who_cannot_fly_so_slowly_leaves_later_and_pays_nothing() -> None:
    crews = [crew("far", 3000), crew("near", 300, energy=Energy(hover_w=400))]
    plan = schedule(crews, "together")
    near = plan.of("near")
    assert near.speed_m_s == 3.0
    assert near.hold_s == 0
    assert near.depart_s == pytest.approx(plan.of("far").arrive_s - time_to_goal_s(near.route, crews[1].vehicle, 3.0))
    assert near.energy_j == schedule(crews, "none").of("near").energy_j
    assert near.notes == (Note("waits_on_ground", wait_s=near.depart_s),)
    require_sound(plan, crews)


@pytest.mark.parametrize("autopilot", [Autopilot.ARDUCOPTER, Autopilot.PX4])
def test_where_all_leave_at_once_a_copter_holds_whole_seconds_at_the_gate(autopilot: Autopilot) -> None:
    crews = [crew("far", 3004), crew("near", 300, energy=Energy(hover_w=400), autopilot=autopilot)]
    plan = schedule(crews, "together", hold="gate")
    near = plan.of("near")
    assert near.depart_s == 0
    assert near.arrive_s == pytest.approx(plan.of("far").arrive_s, abs=1e-5)
    assert near.energy_j == pytest.approx(near.route.energy_j(crews[1].vehicle) + 400 * near.hold_s)
    spare = plan.of("far").arrive_s - time_to_goal_s(near.route, crews[1].vehicle, 3.0)
    assert 0 <= near.hold_s - spare < 1  # no second more than is needed
    assert near.speed_m_s > 3.0  # which makes up for the fraction
    require_sound(plan, crews)


def test_a_hold_is_exact_even_where_the_speed_cannot_be_changed() -> None:
    crews = [crew("far", 3000), crew("near", 300, speed_min_m_s=5.0, speed_max_m_s=5.0)]
    plan = schedule(crews, "together", hold="gate")
    near = plan.of("near")
    assert near.arrive_s == pytest.approx(plan.of("far").arrive_s, abs=1e-5)
    assert near.hold_s > 0
    assert 0 < near.depart_s < 1
    require_sound(plan, crews)


@pytest.mark.parametrize("change", [{"autopilot": Autopilot.ARDUPLANE}, {"turn_radius_m": 80.0}])
def test_what_cannot_hold_in_the_air_is_refused_a_gate_by_name(change: dict[str, Any]) -> None:
    crews = [crew("far", 3000), crew("near", 300, **change)]
    with pytest.raises(NoSchedule, match=r"near cannot arrive so late.*cannot hold in the air.*hold: ground") as caught:
        schedule(crews, "together", hold="gate")
    assert (caught.value.vehicle, caught.value.reason, caught.value.exit_code) == ("near", "time", 3)
    assert schedule(crews, "together").of("near").depart_s > 0


@pytest.mark.parametrize(
    ("speeds_m_s", "words"), [((10.0, 20.0), "4 whole circles of 80 m"), ((19.9, 20.0), "do not fit")]
)
def test_a_wing_that_could_only_circle_is_refused_by_the_number_of_circles(
    speeds_m_s: tuple[float, float], words: str
) -> None:
    low, high = speeds_m_s
    wing = {"autopilot": Autopilot.ARDUPLANE, "turn_radius_m": 80.0, "speed_min_m_s": low, "speed_max_m_s": high}
    crews = [crew("far", 3000), crew("near", 300, **wing)]
    with pytest.raises(NoSchedule, match=rf"no longer path was found.*{words}.*up to one circle later") as caught:
        schedule(crews, "together", hold="gate")
    near, due_s = Craft(crews[1]), Craft(crews[0]).fast_s
    assert near.circle_s is not None
    slow_s, fast_s = near.circle_s
    assert slow_s == pytest.approx(2 * math.pi * 80.0 / low, rel=0.01)
    counts = [n for n in range(100) if near.fast_s + n * fast_s <= due_s <= near.slow_s + n * slow_s]
    assert [f"; {n} whole circle" in str(caught.value) for n in counts[:1]] == [True] * bool(counts)


def test_a_gate_is_not_longer_than_the_autopilot_stores() -> None:
    crews = [crew("far", 300_000, speed_max_m_s=3.0), crew("near", 300)]
    with pytest.raises(NoSchedule, match="at most 65535 s"):
        schedule(crews, "together", hold="gate")


def zigzag(name: str, length_m: float) -> Route:
    """A way of that length to the same goal: out and aside."""
    aside = math.sqrt(max(length_m**2 / 4 - 150.0**2, 0.0))
    points = np.array([[0.0, 0.0, 100.0], [150.0, aside, 100.0], [300.0, 0.0, 100.0]])
    return Route(name, points, start_ground_amsl_m=40.0, goal_ground_amsl_m=40.0)


def test_a_longer_path_is_asked_for_where_nobody_may_wait() -> None:
    crews = [crew("far", 3000), crew("near", 300)]
    asked: list[tuple[str, float]] = []

    def longer(name: str, length_m: float) -> Route:
        asked.append((name, length_m))
        return zigzag(name, length_m)

    plan = schedule(crews, "together", hold="none", longer=longer)
    near = plan.of("near")
    assert {name for name, _ in asked} == {"near"}
    assert len(asked) <= 4
    assert near.depart_s == near.hold_s == 0
    assert near.arrive_s == pytest.approx(plan.of("far").arrive_s, abs=1e-5)
    assert near.route.length_m > 300
    assert near.notes == (Note("flies_longer", more_m=near.route.length_m - crews[1].route.length_m),)
    require_sound(plan, crews)
    for useless in (lambda name, length_m: None, lambda name, length_m: crews[1].route):
        with pytest.raises(NoSchedule, match="near cannot arrive so late"):
            schedule(crews, "together", hold="none", longer=useless)


def test_longer_paths_are_not_asked_for_where_waiting_does() -> None:
    def longer(name: str, length_m: float) -> Route:
        raise AssertionError(name)

    crews = [crew("far", 3000), crew("near", 300)]
    for hold in ("ground", "gate"):
        assert schedule(crews, "together", hold=hold, longer=longer).of("near").route is crews[1].route


# -- refusals say what works --------------------------------------------------------------------------------------


def test_too_short_an_interval_is_refused_with_the_smallest_that_works() -> None:
    crews = [crew("a", 300), crew("b", 3000), crew("c", 500)]
    with pytest.raises(NoSchedule) as caught:
        schedule(crews, "sequence", interval_s=9.0, clock="first")
    refusal = caught.value
    assert refusal.vehicle == "b"
    least = refusal.interval_s
    assert least is not None
    assert least == least_interval_s(crews, clock="first")
    assert f"interval_s is {math.ceil(least * 1000) / 1000:.3f}" in refusal.message
    plan = schedule(crews, "sequence", interval_s=least, clock="first")
    assert plan.of("b").speed_m_s == 15.0
    require_sound(plan, crews)
    with pytest.raises(NoSchedule):
        schedule(crews, "sequence", interval_s=least - 0.001, clock="first")
    # Or the first comes later, or another one is the first.
    assert refusal.arrive_s is not None
    cure: dict[str, Any]
    for cure in ({"arrive_s": refusal.arrive_s}, {"clock": "fleet"}, {"order": "best", "clock": "first"}):
        require_sound(schedule(crews, "sequence", interval_s=9.0, **cure), crews)
    with pytest.raises(NoSchedule):
        schedule(crews, "sequence", interval_s=9.0, arrive_s=refusal.arrive_s - 0.001)


def test_the_first_waits_where_another_could_not_keep_its_turn_and_says_for_whom() -> None:
    crews = [crew("a", 300), crew("b", 3000), crew("c", 500)]
    plan = schedule(crews, "sequence", interval_s=9.0)
    fast = Craft(crews[1]).fast_s
    assert arrivals(plan) == pytest.approx([fast - 9, fast, fast + 9], abs=1e-5)
    waits = one("first_waits_for", plan.slots[0].notes)
    assert (waits.data["last"], waits.data["needs_s"]) == ("b", fast)
    assert plan.of("b").depart_s == 0
    require_sound(plan, crews)
    on_time = schedule(crews, "sequence", interval_s=200.0)
    assert "first_waits_for" not in codes(note for s in on_time.slots for note in s.notes)
    assert arrivals(on_time) == arrivals(schedule(crews, "sequence", interval_s=200.0, clock="first"))


def test_too_early_a_common_arrival_is_refused_with_the_earliest() -> None:
    crews = [crew("a", 300), crew("b", 3000)]
    with pytest.raises(NoSchedule, match="b cannot arrive in time") as caught:
        schedule(crews, "together", arrive_s=100.0)
    earliest = caught.value.arrive_s
    assert earliest is not None
    assert arrivals(schedule(crews, "together", arrive_s=earliest)) == pytest.approx([earliest] * 2, abs=1e-5)
    with pytest.raises(NoSchedule):
        schedule(crews, "together", arrive_s=earliest - 0.001)


def test_too_late_a_turn_where_nobody_may_wait_is_refused_with_intervals_that_work() -> None:
    crews = [crew("a", 300), crew("b", 400)]
    with pytest.raises(NoSchedule, match=r"b cannot arrive so late.*interval_s from.*hold: ground") as caught:
        schedule(crews, "sequence", interval_s=500.0, hold="none", clock="first")
    least = caught.value.interval_s
    assert least is not None
    assert least == least_interval_s(crews, hold="none", clock="first") == pytest.approx(100 / 15)
    most = Craft(crews[1]).slow_s - Craft(crews[0]).fast_s
    assert f"from 6.667 to {math.floor(most * 1000) / 1000:.3f} works" in caught.value.message
    for interval in (least, most):
        require_sound(schedule(crews, "sequence", interval_s=interval, hold="none", clock="first"), crews)
    for interval in (least - 0.001, most + 0.001):
        with pytest.raises(NoSchedule):
            schedule(crews, "sequence", interval_s=interval, hold="none", clock="first")


@pytest.mark.parametrize("clock", ["first", "fleet"])
def test_where_no_interval_works_that_is_said(clock: Any) -> None:
    crews = [crew("a", 300), crew("b", 3000), crew("c", 400)]
    assert least_interval_s(crews, hold="none", clock=clock) is None
    with pytest.raises(NoSchedule, match="no interval_s works in this order") as caught:
        schedule(crews, "sequence", interval_s=9.0, hold="none", clock=clock)
    assert caught.value.interval_s is None
    assert caught.value.arrive_s is None
    with pytest.raises(NoSchedule, match="no common arrival of all"):
        schedule(crews, "together", hold="none")


def test_a_refusal_survives_another_process() -> None:
    with pytest.raises(NoSchedule) as caught:
        schedule([crew("a", 300), crew("b", 3000)], "sequence", interval_s=9.0, clock="first")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.vehicle, again.interval_s, again.message) == (
        caught.value.vehicle, caught.value.interval_s, caught.value.message,
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=draws(40))
@given(
    st.lists(st.floats(100, 2000), min_size=2, max_size=6), st.sampled_from(["ground", "gate", "none"]),
    st.sampled_from(["first", "fleet"]),
)  # fmt: skip
def test_the_least_interval_works_and_slightly_less_does_not(lengths: list[float], hold: Any, clock: Any) -> None:
    crews = [crew(f"u{i}", length) for i, length in enumerate(lengths)]
    least = least_interval_s(crews, hold=hold, clock=clock)
    if least is None:
        for interval in np.linspace(0, 800, 30):
            with pytest.raises(NoSchedule):
                schedule(crews, "sequence", interval_s=float(interval), hold=hold, clock=clock)
        return
    require_sound(schedule(crews, "sequence", interval_s=least, hold=hold, clock=clock), crews)
    if least > 0.01:
        with pytest.raises(NoSchedule):
            schedule(crews, "sequence", interval_s=least - 0.01, hold=hold, clock=clock)


# -- the best order -----------------------------------------------------------------------------------------------


def finish_of(crews: list[Crew], **more: Any) -> tuple[float, float]:
    try:
        plan = schedule(crews, "sequence", **more)
    except NoSchedule:
        return INF, INF
    require_sound(plan, crews)
    return round(plan.slots[-1].arrive_s, 3), plan.energy_j


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(s, marks=pytest.mark.nightly) for s in range(6, 30))])
def test_the_best_order_finishes_as_early_as_the_best_of_all_orders(seed: int) -> None:
    rng = np.random.default_rng(seed)
    crews = [
        crew(f"u{i}", float(rng.uniform(100, 1500)), energy=Energy(hover_w=float(rng.uniform(100, 900))))
        for i in range(int(rng.integers(2, 5)))
    ]
    more = {
        "interval_s": float(rng.choice([2.0, 15.0, 60.0])), "hold": str(rng.choice(["ground", "gate", "none"])),
        "clock": str(rng.choice(["first", "fleet"])),
    }  # fmt: skip
    brute = min(finish_of(crews, order=[c.name for c in p], **more) for p in itertools.permutations(crews))
    found = finish_of(crews, order="best", **more)
    assert found[0] == pytest.approx(brute[0], abs=2e-3)
    if math.isfinite(brute[1]):  # holds are whole seconds: that much either way
        assert found[1] <= brute[1] + 1000.0 * len(crews)


def test_the_cheapest_of_the_orders_that_finish_alike_is_taken() -> None:
    thirsty = crew("thirsty", 300, energy=Energy(hover_w=900))
    frugal = crew("frugal", 310, energy=Energy(hover_w=100))
    first = crew("first", 290, speed_max_m_s=15)
    plan = schedule([frugal, thirsty, first], "sequence", order="best", interval_s=120.0, hold="gate")
    assert plan.order == ("first", "thirsty", "frugal")


def test_a_hundred_vehicles_are_ordered_as_sorting_orders_them() -> None:
    rng = np.random.default_rng(4)
    fast = rng.uniform(50, 400, 100)
    free = np.full(100, INF)
    order = best_order(fast, free, 5.0, "fleet", None)
    assert order is not None
    assert (np.diff(fast[order]) >= 0).all()
    begin = (fast[order] - 5.0 * np.arange(100)).max()
    for _ in range(200):
        assert (fast[rng.permutation(100)] - 5.0 * np.arange(100)).max() >= begin - 1e-9
    windows = best_order(fast, fast + 600.0, 5.0, "first", None)
    assert windows is not None
    times = fast[windows[0]] + 5.0 * np.arange(100)
    assert ((fast[windows] <= times + 1e-6) & (times <= fast[windows] + 600 + 1e-6)).all()
    assert best_order(fast, fast, 5.0, "first", None) is None


@settings(max_examples=draws(50))
@given(st.lists(st.tuples(st.floats(1, 100), st.floats(0, 100)), min_size=2, max_size=6), st.booleans())
def test_an_interval_works_exactly_where_its_range_says(windows: list[tuple[float, float]], fleet: bool) -> None:
    fast = np.array([a for a, _ in windows])
    latest = fast + [b for _, b in windows]
    low, high = interval_range(fast, latest, "fleet" if fleet else "first", None)
    turn = np.arange(len(fast))
    for interval in np.linspace(0.05, 120, 60):
        begins = [float((fast - turn * interval).max())] if fleet else [float(fast[0])]
        works = any(
            (fast <= b + turn * interval + 1e-9).all() and (latest >= b + turn * interval - 1e-9).all() for b in begins
        )
        if abs(interval - low) > 1e-6 and abs(interval - high) > 1e-6:
            assert works == (low <= interval <= high)


def test_orders_and_names_that_make_no_sense_are_refused() -> None:
    crews = [crew("a", 300), crew("b", 400)]
    for order in (["a"], ["a", "a"], ["a", "b", "c"]):
        with pytest.raises(ValueError, match="every vehicle once"):
            schedule(crews, "sequence", order=order, interval_s=5.0)
    with pytest.raises(ValueError, match="different names"):
        schedule([crews[0], crews[0]], "none")
    with pytest.raises(ValueError, match="different names"):
        schedule([], "together")


def test_speeds_are_float32_within_the_range() -> None:
    craft = Craft(crew("a", 300, speed_min_m_s=3.3, speed_max_m_s=14.7))
    assert (craft.slowest_m_s, craft.fastest_m_s) == (float(np.float32(3.3000002)), float(np.float32(14.7)))
    for speed in (craft.slowest_m_s, craft.fastest_m_s):
        assert 3.3 <= speed <= 14.7
    fixed = Craft(crew("a", 300, speed_min_m_s=3.3, speed_max_m_s=3.3))
    assert fixed.slowest_m_s == fixed.fastest_m_s == float(np.float32(3.3))


def test_speeds_that_need_more_lean_than_arducopters_default_are_told() -> None:
    def notes(speed: float, **more: Any) -> tuple[Note, ...]:
        return schedule([crew("a", 300, speed_max_m_s=speed, **more)], "none").slots[0].notes

    def lean(deg: float) -> Note:
        return Note("lean_parameter", lean_deg=deg, lean_cdeg=100.0 * deg)

    assert notes(10.0) == ()
    assert notes(12.0) == (Note("lean_to_set", speed_m_s=12.0, lean_deg=36, parameter=lean(36)),)
    assert notes(16.0) == (Note("lean_to_set", speed_m_s=16.0, lean_deg=48, parameter=lean(48)),)
    assert notes(27.0) == (Note("lean_beyond_largest", speed_m_s=27.0, largest_deg=80.0),)
    assert notes(16.0, autopilot=Autopilot.PX4) == ()
    assert str(notes(12.0)[0]) == (
        "12.00 m/s needs a lean of about 36°: set ATC_ANGLE_MAX 36 (degrees, since ArduPilot 4.7) or ANGLE_MAX 3600 "
        "(hundredths of a degree, before) before it flies"
    )


# -- the mission file ---------------------------------------------------------------------------------------------

TWO = [keys(), keys(name="uav2", sysid=2)]


def arrival(**more: Any) -> dict[str, Any]:
    return base(vehicles=TWO, arrival={"mode": "sequence", "interval_s": 9, **more})


def test_the_arrival_keys_are_read() -> None:
    request = load(arrival(order="best", hold="gate", arrive_s=200, window_s=2, pad_clear_s=60)).arrival
    assert request == ArrivalRequest(
        "sequence", ("uav1", "uav2"), 9.0, 30.0, best_order=True, arrive_s=200.0, hold="gate", window_s=2.0,
        pad_clear_s=60.0,
    )  # fmt: skip
    plain = load(arrival(clock="fleet", order=["uav2", "uav1"])).arrival
    assert plain == ArrivalRequest("sequence", ("uav2", "uav1"), 9.0, 30.0, clock="fleet")


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"order": "bset"}, "arrival.order", "a list of the vehicles' names, or best, given the text 'bset'"),
        ({"order": 3}, "arrival.order", "or best, given 3"),
        ({"order": [1, "uav2"]}, "arrival.order[0]", "must be text"),
        ({"hold": "grund"}, "arrival.hold", "one of ground, gate, none, given the text 'grund'; did you mean ground?"),
        ({"clock": "last"}, "arrival.clock", "one of first, fleet"),
        ({"arrive_s": 0}, "arrival.arrive_s", "above 0"),
        ({"arrive_s": 100, "clock": "fleet"}, "arrival.clock", "keep one"),
        ({"mode": "together", "clock": "fleet"}, "arrival.clock", "mode: sequence only"),
        ({"mode": "none", "hold": "gate"}, "arrival.hold", "sequence or together only"),
        ({"mode": "none", "arrive_s": 5}, "arrival.arrive_s", "sequence or together only"),
        ({"window_s": -1}, "arrival.window_s", "at least 0"),
        ({"window_s": None}, "arrival.window_s", "must be a number"),
        ({"pad_clear_s": "60"}, "arrival.pad_clear_s", "must be a number"),
        ({"pad_cleer_s": 60}, "arrival.pad_cleer_s", "did you mean pad_clear_s?"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_arrival_is_told(change: dict[str, Any], key: str, words: str) -> None:
    where, message = the_problem(arrival(**change))
    assert where == key
    assert words in message


@pytest.mark.slow
def test_accelerations_have_defaults_on_the_earth_and_none_in_local_metres() -> None:
    names = ("climb_m_s", "descent_m_s", "land_m_s", "accel_m_s2", "corner_accel_m_s2", "vertical_accel_m_s2")
    mission = load(base())
    assert [getattr(mission.vehicles[0].vehicle, n) for n in names] == [2.5, 1.5, 0.5, 1.5, 2.5, 1.0]
    given_ = load(base(vehicles=[keys(accel_m_s2=2, corner_accel_m_s2=3, land_m_s=0.7, vertical_accel_m_s2=4)]))
    assert [getattr(given_.vehicles[0].vehicle, n) for n in names] == [2.5, 1.5, 0.7, 2.0, 3.0, 4.0]
    paper = load(local())
    assert [getattr(paper.vehicles[0].vehicle, n) for n in names] == [INF] * 6
    assert "motion_unbounded" in [note.code for note in paper.notes]
    assert "motion_unbounded" not in [note.code for note in mission.notes]
    one = local()["vehicles"][0] | {"climb_m_s": 2.5, "accel_m_s2": 1.5}
    mixed = load(local(vehicles=[one])).vehicles[0].vehicle
    assert [getattr(mixed, n) for n in names] == [2.5, INF, INF, 1.5, INF, INF]


@pytest.mark.parametrize("key", ["accel_m_s2", "corner_accel_m_s2", "vertical_accel_m_s2", "land_m_s"])
@pytest.mark.parametrize(
    ("value", "words"), [(0, "above 0"), ("1", "must be a number"), (INF, "finite"), (1e3, "at most"), (None, "number")]
)
def test_a_mistake_in_an_acceleration_is_told(key: str, value: Any, words: str) -> None:
    where, message = the_problem(base(vehicles=[keys(**{key: value})]))
    assert where == f"vehicles[0].{key}"
    assert words in message


def test_every_mistake_in_the_arrival_is_told_at_once() -> None:
    with pytest.raises(InputError) as caught:
        load(base(vehicles=TWO, arrival={"mode": "sequence", "order": ["uav3"], "clock": "fleet", "arrive_s": 3}))
    told = {p.where.split(": ", 1)[1] for p in caught.value.problems}
    assert told == {"arrival.order[0]", "arrival.interval_s", "arrival.clock"}
