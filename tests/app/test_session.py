"""A living session: the same bytes as the command line, changes, callbacks, cancelling, threads, memory."""

from __future__ import annotations

import asyncio
import filecmp
import gc
import json
import threading
import time
import tracemalloc
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from gcsplan.app.api import write
from gcsplan.app.fleet.pipeline import load_mission, plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.session import BetterPath, Planner
from gcsplan.cli.command_table import app
from gcsplan.errors import Cancelled, GcsplanError, InputError, UsageError
from gcsplan.world.geometry.zones import Circle
from tests.export.test_output_schema import FLAT
from tests.mission_file.test_memory_files import FEATURE, TERRAIN
from tests.support.batches import mission
from tests.support.forecasts import forecast

LEGS: dict[str, Any] = {
    **FLAT,
    "no_fly": [{"name": "mast", "center": {"east_m": 450, "north_m": 10}, "radius_m": 60},
               {"name": "pond", "center": {"east_m": 200, "north_m": -40}, "radius_m": 30}],
}  # fmt: skip


def same_files(folder: Path, one: Plan, other: Plan) -> list[str]:
    """The names of files that differ."""
    write(one, folder / "one")
    write(other, folder / "other")
    names = sorted(file.name for file in (folder / "one").iterdir())
    return filecmp.cmpfiles(folder / "one", folder / "other", names, shallow=False)[1:]  # type: ignore[return-value]


def figures(planned: Plan) -> tuple[object, ...]:
    return tuple(tuple(item.wire for item in v.mission.items) for v in planned.vehicles)


@pytest.mark.slow
def test_a_changed_session_writes_the_bytes_of_the_command_line(tmp_path: Path) -> None:
    session = Planner("sample:fleet-4")
    session.change({"vehicles[0].goal": session.mission["vehicles"][0]["start"], "vehicles.uav2.max_climb_deg": 40})
    session.change({"no_fly.new": {"center": [36.6, -84.3], "radius_m": 90}, "arrival": None, "vehicles[3]": None})
    session.change({"vehicles[2]": None, "vehicles[1]": None, "vehicles[0].goal": [36.62, -84.35]})
    file = tmp_path / "fleet-4.yaml"
    file.write_text(yaml.safe_dump(session.mission), encoding="utf-8")
    write(session.plan(), tmp_path / "here")
    assert CliRunner().invoke(app, ["plan", str(file), "-o", str(tmp_path / "there")]).exit_code == 0
    names = sorted(f.name for f in (tmp_path / "here").iterdir() if f.name != ".gcsplan")
    assert filecmp.cmpfiles(tmp_path / "here", tmp_path / "there", names, shallow=False)[1:] == ([], [])


@pytest.mark.nightly
def test_changes_count_from_then_on_or_for_one_plan_alone() -> None:
    session = Planner(LEGS)
    before = figures(session.plan())
    once = figures(session.plan({"no_fly.mast": None, "no_fly[0]": None}))
    assert once != before
    assert figures(session.plan()) == before
    session.change({"no_fly.mast": None, "no_fly.pond": None})
    assert figures(session.plan()) == once
    session.change({"no_fly.mast": {**LEGS["no_fly"][0], "radius_m": 90}})
    assert session.mission["no_fly"] == [{**LEGS["no_fly"][0], "radius_m": 90}]
    assert session.plan().vehicles[0].verdict.length_m > 900


@pytest.mark.nightly
def test_an_area_to_stay_in_is_added_and_removed_by_its_name() -> None:
    session = Planner(LEGS)
    before = figures(session.plan())
    field = [{"east_m": e, "north_m": n} for e, n in ((-100, -20), (1000, -20), (1000, 300), (-100, 300))]
    session.change({"keep_in.field": {"polygon": field}})
    assert session.mission["keep_in"] == [{"name": "field", "polygon": field}]
    assert figures(session.plan()) != before  # only the way past the mast through the north is left
    session.change({"keep_in": None})
    assert figures(session.plan()) == before


def test_values_may_be_tuples_and_numbers_of_numpy() -> None:
    session = Planner(LEGS)
    session.change({"vehicles.uav1.speed_m_s": (3, np.float64(12.0)), "limits.min_agl_m": "4e1"})
    assert session.mission["vehicles"][0]["speed_m_s"] == [3, 12.0]
    assert session.plan().vehicles[0].verdict.lowest.min_agl_m >= 40.0  # type: ignore[union-attr]


@pytest.mark.nightly
def test_zones_and_terrain_of_objects_are_changed_like_keys() -> None:
    vehicle = {"name": "u", "sysid": 1, "autopilot": "arducopter", "start": [36.50, -84.3], "goal": [36.52, -84.3]}
    level = {**TERRAIN, "dem": np.full_like(TERRAIN["dem"], 300.0)}
    session = Planner({"version": 1, "terrain": level, "limits": {"min_agl_m": 30}, "vehicles": [vehicle]})
    direct = session.plan().vehicles[0].verdict.length_m
    session.change({"no_fly.village": FEATURE})
    assert session.plan().vehicles[0].verdict.length_m > direct
    session.change({"no_fly": None, "terrain": {**level, "dem": level["dem"] + 400.0}})
    assert session.plan().vehicles[0].request.start[2] > 690.0


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("vehicles.uav9.goal", "no element is named 'uav9'.*Known: uav1"), ("vehicles[7].goal", "has 1 elements"),
        ("", "no key has the place"), ("limits..x", "no key has the place"), ("version.x.y", "is no key of a value"),
        (7, "a key is named by text"), ("limits.min_agl_n", "unknown key"),
    ],
)  # fmt: skip
def test_a_place_that_is_not_there_changes_nothing(place: Any, words: str) -> None:
    session = Planner(LEGS)
    before = session.mission

    def changed() -> None:
        session.change({"limits.max_agl_m": 100, place: 1})
        session.plan()

    with pytest.raises(InputError, match=words):
        changed()
    assert session.mission == before or "unknown" in words


@pytest.mark.parametrize("wrong", [7, None, {}, "x: 1\n", {"version": 1}, object()])
def test_what_is_no_mission_is_told_at_once(wrong: Any) -> None:
    with pytest.raises(GcsplanError):
        Planner(wrong)
    with pytest.raises(UsageError):
        Planner(LEGS).plan(on_path=7)  # type: ignore[arg-type]
    with pytest.raises(UsageError):
        Planner(LEGS).change([("a", 1)])  # type: ignore[arg-type]


@pytest.mark.slow
def test_each_path_is_better_than_the_one_before_and_each_bound_holds() -> None:
    paths: list[BetterPath] = []
    bounds: list[float] = []
    planned = Planner("sample:jacksboro").plan(on_path=paths.append, on_bound=lambda _, bound: bounds.append(bound))
    (one,) = planned.vehicles
    costs = [path.cost for path in paths]
    assert costs == sorted(costs, reverse=True)
    assert bounds == sorted(bounds)
    assert one.solution.lower_bound is not None
    assert bounds[-1] <= one.solution.lower_bound + 1e-6
    assert costs[-1] == pytest.approx(one.cost, rel=1e-3)
    first = paths[0].to_geojson()
    assert json.loads(json.dumps(first)) == first
    start = one.request.start_deg
    assert np.hypot(paths[0].lat_deg[0] - start[0], paths[0].lon_deg[0] - start[1]) < 1e-4


class Enough(Exception):
    """A first path is there."""


def first_path(session: Planner, goal: dict[str, float], *, draft: bool) -> BetterPath:
    found: list[BetterPath] = []

    def on_path(better: BetterPath) -> None:
        found.append(better)
        raise Enough

    with pytest.raises(Enough):
        session.plan({"vehicles.uav1.goal": goal}, on_path=on_path, draft=draft)
    return found[0]


def test_a_draft_bends_the_last_path_and_leaves_no_trace_in_a_plan() -> None:
    session, other = Planner(LEGS), Planner(LEGS)
    before = first_path(session, {"east_m": 905, "north_m": 0}, draft=False)
    bent = first_path(session, {"east_m": 915, "north_m": -10}, draft=True)
    assert len(bent.lon_deg) > 2
    assert all(np.abs(before.lon_deg - lon).min() < 1e-9 for lon in bent.lon_deg[1:-1])  # a search turns elsewhere
    assert (bent.lat_deg[-1], bent.lon_deg[-1]) != (before.lat_deg[-1], before.lon_deg[-1])
    assert session.plan(draft=True).vehicles[0].verdict.safe is True
    for goal in ({"east_m": 915, "north_m": 4}, {"east_m": -300, "north_m": 900}):
        changes = {"vehicles.uav1.goal": goal}
        assert figures(session.plan(changes)) == figures(other.plan(changes))


def test_a_draft_far_from_the_last_window_reads_ground_there() -> None:
    session = Planner(LEGS)
    session.plan(draft=True)
    planned = session.plan({"vehicles.uav1.goal": {"east_m": 9000, "north_m": 7000}}, draft=True)
    assert planned.vehicles[0].verdict.safe is True


@pytest.mark.nightly
def test_what_a_callback_raises_ends_the_plan_and_not_the_session() -> None:
    session = Planner(LEGS)

    def broken(_: BetterPath) -> None:
        raise KeyError("theirs")

    with pytest.raises(KeyError, match="theirs"):
        session.plan(on_path=broken)
    assert session.plan().vehicles[0].verdict.safe


@pytest.mark.slow
def test_a_cancelled_plan_ends_soon_and_the_next_one_is_whole() -> None:
    session = Planner("sample:jacksboro")
    whole = figures(session.plan())
    ended: list[float] = []

    def run() -> None:
        with pytest.raises(Cancelled):
            session.plan({"limits.min_agl_m": 41})  # another mission: nothing of its path is kept
        ended.append(time.perf_counter())

    for wait_s in (0.0, 0.02, 0.1):
        thread = threading.Thread(target=run)
        thread.start()
        time.sleep(wait_s)
        asked = time.perf_counter()
        while thread.is_alive() and time.perf_counter() - asked < 10.0:  # the thread may not have begun its plan
            session.cancel()
            thread.join(0.01)
        assert ended.pop() - asked < 2.0  # on any machine; `bench session` measures it
    assert figures(session.plan()) == whole


def test_cancelling_ends_the_plans_that_wait_too() -> None:
    session = Planner("sample:fleet-4")
    ended: list[type] = []

    def run() -> None:
        try:
            session.plan()
        except Cancelled as why:
            ended.append(type(why))

    threads = [threading.Thread(target=run) for _ in range(5)]
    for thread in threads:
        thread.start()
    time.sleep(0.05)
    session.cancel()
    for thread in threads:
        thread.join(20.0)
    assert ended == [Cancelled] * 5


@pytest.mark.nightly
def test_an_awaited_plan_is_the_same_and_ends_with_its_task() -> None:
    session = Planner(LEGS)

    async def both() -> Plan:
        slow = Planner("sample:fleet-4")
        task = asyncio.create_task(slow.plan_async())
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return await session.plan_async()

    assert figures(asyncio.run(both())) == figures(session.plan())


def in_threads(count: int, work: Callable[[int], None]) -> None:
    failed: list[BaseException] = []

    def run(k: int) -> None:
        try:
            work(k)
        except BaseException as why:
            failed.append(why)

    threads = [threading.Thread(target=run, args=(k,)) for k in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []


def changes_of(thread: int, number: int) -> Mapping[str, object]:
    goal = {"east_m": 700 + 3 * thread, "north_m": 2 * number}
    return {"vehicles.uav1.goal": goal, "no_fly.pond": None if number % 2 else {**LEGS["no_fly"][1], "radius_m": 35}}


def goal_of(thread: int, number: int) -> Mapping[str, object]:
    return {"vehicles.uav1.goal": {"east_m": 700 + 3 * thread, "north_m": 2 * number}, "limits.min_agl_m": 30 + number}


def run_threads(
    threads: int, changes: int, given: Mapping[str, Any], change: Callable[[int, int], Mapping[str, object]]
) -> None:
    session = Planner(given)
    found: dict[tuple[int, int], object] = {}

    def work(k: int) -> None:
        own = Planner(given) if k % 2 else session  # several sessions in one process, and one of many threads
        for n in range(changes):
            found[k, n] = figures(own.plan(change(k, n)))

    in_threads(threads, work)
    alone = Planner(given)
    for (k, n), got in found.items():
        assert got == figures(alone.plan(change(k, n)))


@pytest.mark.nightly
def test_threads_get_the_plans_that_they_would_get_alone() -> None:
    run_threads(6, 3, LEGS, changes_of)


@pytest.mark.nightly
def test_sixty_four_threads_of_many_changes_get_the_same_plans() -> None:
    run_threads(64, 20, FLAT, goal_of)  # a level leg, so that 2560 plans take a minute or two


def grown_bytes(changes: int) -> int:
    session = Planner(LEGS)

    def change(n: int) -> None:
        session.change(changes_of(n % 50, n))
        if n % 10 == 0:
            session.plan()

    for n in range(60):
        change(n)
    gc.collect()
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for n in range(changes):
            change(n)
        gc.collect()
        return tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()


@pytest.mark.nightly
def test_memory_stays_flat_over_ten_thousand_changes() -> None:
    assert grown_bytes(10_000) < 500_000


@pytest.mark.nightly
def test_memory_stays_flat_over_some_changes() -> None:
    assert grown_bytes(100) < 300_000


@pytest.mark.nightly
def test_zones_of_objects_never_take_each_others_places() -> None:
    def feature(name: str, east: float) -> dict[str, Any]:
        ring = [[-84.31 + east, 36.51], [-84.3095 + east, 36.51], [-84.3095 + east, 36.511], [-84.31 + east, 36.51]]
        return {"type": "Feature", "properties": {"name": name},
                "geometry": {"type": "Polygon", "coordinates": [ring]}}  # fmt: skip

    vehicle = {"name": "u", "sysid": 1, "autopilot": "arducopter", "start": [36.50, -84.3], "goal": [36.52, -84.3]}
    whole = {"version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30}, "vehicles": [vehicle]}
    session = Planner(whole | {"no_fly": [feature("a", 0.0), feature("b", 0.001), feature("c", 0.002)]})

    def names() -> list[str]:
        return [zone.name for zone in session.plan().source.zones]

    assert names() == ["a", "b", "c"]
    session.change({"no_fly[0]": None, "no_fly[2]": feature("d", 0.003)})
    assert names() == ["b", "c", "d"]
    session.change({"no_fly[2]": None, "no_fly.e": feature("e", 0.004)})
    assert names() == ["b", "c", "e"]
    session.change({"no_fly[0]": feature("f", 0.005)})
    assert names() == ["f", "c", "e"]


@pytest.mark.nightly
def test_a_forecast_counts_as_it_was_read_until_the_session_reloads(tmp_path: Path) -> None:
    def gusts(kmh: float) -> Path:
        file = tmp_path / "wind.json"
        file.write_text(
            json.dumps(
                forecast(
                    hourly__wind_speed_10m=[10.0] * 6,
                    hourly__wind_speed_80m=[15.0] * 6,
                    hourly__wind_gusts_10m=[kmh] * 6,
                )
            ),
            encoding="utf-8",
        )
        return file

    session = Planner({
        **yaml.safe_load(mission()), "at": "2026-11-28T10:00Z", "wind": {"forecast": str(gusts(20.0))},
    })  # fmt: skip
    before = session.plan().source.wind.gust_m_s
    gusts(23.6)
    session.change({"limits.min_agl_m": 31})
    assert session.plan().source.wind.gust_m_s == before
    session.reload()
    assert session.plan().source.wind.gust_m_s == pytest.approx((before or 0.0) + 1.0)


@pytest.mark.nightly
def test_a_session_plans_over_what_it_read_until_it_reloads(tmp_path: Path) -> None:
    zone = tmp_path / "zones.geojson"
    zone.write_text(json.dumps(FEATURE), encoding="utf-8")
    vehicle = {"name": "u", "sysid": 1, "autopilot": "arducopter", "start": [36.50, -84.3], "goal": [36.52, -84.3]}
    session = Planner({
        "version": 1, "terrain": {"flat_m": 300}, "limits": {"min_agl_m": 30}, "vehicles": [vehicle],
        "no_fly": [{"file": str(zone)}],
    })  # fmt: skip
    around = figures(session.plan())
    zone.write_text(json.dumps({**FEATURE, "geometry": {"type": "Point", "coordinates": [-84.31, 36.51]},
                                "properties": {"radius_m": 20}}), encoding="utf-8")  # fmt: skip
    assert figures(session.plan()) == around
    [before] = session.loaded().zones
    session.reload()
    [after] = session.loaded().zones
    assert (isinstance(before.shape, Circle), isinstance(after.shape, Circle)) == (False, True)
    assert figures(session.plan()) == figures(plan(load_mission(session.mission)))
