"""Executors: the same results wherever the work is done, errors in their order, and clear messages."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcsplan import __version__
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.parallel import executor as module
from gcsplan.app.parallel.executor import Dask, Executor, Inline, executor, in_order
from gcsplan.app.plan.model import Plan
from gcsplan.cli.process.exit import sent_again
from gcsplan.errors import GcsplanError, InputError, NoMission, UsageError


def square(shared: int, item: int) -> int:
    return shared + item * item


def slow_first(shared: int, item: int) -> int:
    time.sleep(3.0 if item == 0 else 0.0)
    return item


def fails_at_three(shared: int, item: int) -> int:
    if item == 3:
        raise NoMission("three", reason="infeasible")
    return item


def kills_once(marks: str, item: int) -> int:
    """End the worker at item 5, the first time."""
    mark = Path(marks) / "killed"
    if item == 5 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def kills_always(shared: int, item: int) -> int:
    """End the worker at every item, or at the one that is ``shared``."""
    if shared in (0, item):
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def interrupts(parent: int, item: int) -> int:
    """Press Ctrl-C in the process ``parent`` while item 1 is worked on, and go on for a while."""
    # The parent waits then, also on a busy machine.
    time.sleep(0.5 if item == 1 else 0.05)
    if item == 1:
        os.kill(parent, signal.SIGINT)
        time.sleep(2.0)
    return item


def fleet(**changes: Any) -> dict[str, Any]:
    rng = np.random.default_rng(5)
    vehicles = [
        {
            "name": f"uav{k + 1}", "sysid": k + 1, "autopilot": "arducopter", "speed_m_s": [3, 12],
            "start": {"east_m": 0, "north_m": 200.0 * k},
            "goal": {"east_m": 2000, "north_m": 200.0 * float(rng.integers(0, 5)) + 40.0 * k},
        }
        for k in range(4)
    ]  # fmt: skip
    whole = {
        "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "limits": {"min_agl_m": 30}, "vehicles": vehicles,
        "no_fly": [{"name": "disc", "center": {"east_m": 1000, "north_m": 300}, "radius_m": 180}],
        "arrival": {"mode": "sequence", "interval_s": 20, "separation_m": 10},
    }  # fmt: skip
    return whole | changes


def told(planned: Plan) -> list[Any]:
    """What a plan says, to the byte, but for how long it took."""
    assert planned.fleet is not None
    return [
        (v.name, v.mission.wire_items(), v.solution.lower_bound, v.verdict.describe(), v.speed_m_s, v.notes, v.cost)
        for v in planned.vehicles
    ] + [planned.notes, [(s.name, s.depart_s, s.hold_s, s.speed_m_s, s.arrive_s) for s in planned.fleet.slots]]


@pytest.fixture(scope="module")
def workers() -> Iterator[Executor]:
    pytest.importorskip("distributed")
    with executor(2, pieces=1000, piece_s=1.0) as two:
        assert isinstance(two, Dask)
        assert two.count == 2
        yield two


def test_in_this_process_dask_is_not_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "import_module", lambda name: pytest.fail(f"{name} is imported"))
    with executor(1, pieces=100, piece_s=10.0) as one, executor(8, pieces=3, piece_s=0.5) as few:
        assert isinstance(one, Inline)
        assert isinstance(few, Inline)  # starting eight would take longer than the work
        assert list(one.each(square, 100, [1, 2, 3])) == [(0, 101), (1, 104), (2, 109)]


def test_without_dask_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(module, "import_module", missing)
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    for options in ({"jobs": 2}, {"cluster": "tcp://127.0.0.1:1"}):
        with pytest.raises(InputError, match=r"--\w+ needs dask.distributed.*pip install"):  # noqa: SIM117
            with executor(**options, pieces=1000, piece_s=1.0):
                pass
    with executor(None, pieces=1000, piece_s=1.0) as default:
        assert isinstance(default, Inline)


def test_one_piece_is_done_in_this_process_whatever_is_asked_for() -> None:
    with executor(cluster="tcp://127.0.0.1:9", pieces=1, piece_s=100.0) as here:
        assert isinstance(here, Inline)
    with pytest.raises(UsageError), executor(0, cluster="tcp://127.0.0.1:9", pieces=1, piece_s=1.0):
        pass


def test_results_are_put_in_order_and_few_wait() -> None:
    come = [(2, "c"), (0, "a"), (1, "b"), (4, "e"), (3, "d")]
    assert list(in_order(iter(come))) == [(0, "a"), (1, "b"), (2, "c"), (3, "d"), (4, "e")]


@pytest.mark.parametrize("jobs", [0, -1, 513])
def test_a_wrong_number_of_processes_is_refused(jobs: int) -> None:
    with pytest.raises(UsageError, match="1 to 512"), executor(jobs, pieces=10, piece_s=1.0):
        pass


class Pickled(Executor):
    """What goes in and out passes through pickle, as between processes."""

    count, dashboard = 1, ""

    def each(self, function: Any, shared: Any, items: Any, **_: Any) -> Any:
        for number, item in enumerate(items):
            args = pickle.loads(pickle.dumps((function, shared, item)))
            yield number, pickle.loads(pickle.dumps(args[0](*args[1:])))


@pytest.mark.nightly
def test_planning_with_an_executor_is_planning() -> None:
    """The way over pickled answers, without processes: what comes back makes the same plan."""
    alone = plan(fleet())
    seen: list[str] = []
    assert told(plan(fleet(), cluster=Pickled(), progress=lambda _, what: seen.append(what.phase))) == told(alone)
    assert seen == [f"{count} of 4 planned" for count in (1, 2, 3, 4)]


def test_the_first_refusal_in_the_file_is_raised() -> None:
    class Backwards(Pickled):
        def each(self, function: Any, shared: Any, items: Any, **_: Any) -> Any:
            yield from reversed(list(Inline().each(function, shared, items)))

    ring = {"name": "ring", "floor_agl_m": 0, "ceiling_agl_m": 500}
    closed = [ring | {"polygon": box(400.0 * k)} for k in (1, 2)]
    given = fleet(no_fly=closed, planner={"budget_s": 0.5})
    given["vehicles"][1]["start"] = {"east_m": 0, "north_m": 400}
    given["vehicles"][2]["start"] = {"east_m": 0, "north_m": 800}
    with pytest.raises((NoMission, InputError)) as caught:
        plan(given, cluster=Backwards())
    with pytest.raises(type(caught.value)) as alone:
        plan(given)
    assert str(caught.value) == str(alone.value)


def box(north_m: float) -> list[dict[str, float]]:
    return [{"east_m": e, "north_m": north_m + n} for e, n in ((300, -300), (310, -300), (310, 300), (300, 300))]


@pytest.mark.nightly
def test_processes_give_the_same_results(workers: Executor) -> None:
    assert sorted(workers.each(square, 7, range(40))) == [(k, 7 + k * k) for k in range(40)]
    with pytest.raises(NoMission, match="three"):
        list(workers.each(fails_at_three, 0, range(40)))
    assert sorted(workers.each(square, 0, range(3))) == [(0, 0), (1, 1), (2, 4)]


@pytest.mark.nightly
def test_results_do_not_run_far_ahead_of_a_slow_piece(workers: Executor, monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(workers, Dask)
    monkeypatch.setattr(module, "LEAD", 2)
    most = 2 * module.AHEAD * workers.count
    early = []
    for number, _ in workers.each(slow_first, 0, range(10 * most)):
        if number == 0:
            break
        early.append(number)
    assert early
    assert max(early) < most


@pytest.mark.nightly
def test_a_killed_worker_costs_its_own_pieces_only(workers: Executor, tmp_path: Path) -> None:
    assert sorted(workers.each(kills_once, str(tmp_path), range(20))) == [(k, k) for k in range(20)]
    assert (tmp_path / "killed").exists()


@pytest.mark.nightly
def test_a_piece_that_kills_every_worker_is_named() -> None:
    pytest.importorskip("distributed")
    with (
        executor(2, pieces=1000, piece_s=1.0) as two,
        pytest.raises(GcsplanError, match="piece 1 of 1 again and again"),
    ):
        list(two.each(kills_always, 0, [1]))


@pytest.mark.nightly
def test_a_piece_that_kills_every_worker_costs_no_other(workers: Executor) -> None:
    found = workers.each(kills_always, 3, range(8), lost=lambda item, why: -item)
    assert sorted(found) == [(k, -3 if k == 3 else k) for k in range(8)]


@pytest.mark.nightly
def test_after_ctrl_c_what_is_begun_is_finished(workers: Executor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "unraisablehook", sent_again([signal.SIGINT], sys.unraisablehook))
    found: list[tuple[int, int]] = []
    with pytest.raises(KeyboardInterrupt):
        found.extend(workers.each(interrupts, os.getpid(), range(40)))
    assert (1, 1) not in found
    with pytest.raises(KeyboardInterrupt):
        found.extend(workers.each(interrupts, os.getpid(), range(40), finish=True))
    assert (1, 1) in found
    assert len(found) < 40
    assert sorted(workers.each(square, 0, range(3))) == [(0, 0), (1, 1), (2, 4)]


@pytest.mark.slow
def test_a_piece_handed_out_just_before_ctrl_c_is_no_error(workers: Executor) -> None:
    """The scheduler may not have heard of it yet."""
    assert isinstance(workers, Dask)
    for _ in range(20):
        numbers = {workers.client.submit(square, 0, 2, pure=False): 0}
        workers.keep_begun(numbers)
        assert all(kept.result(timeout=60) == 4 for kept in numbers)
    assert sorted(workers.each(square, 0, range(3))) == [(0, 0), (1, 1), (2, 4)]


@pytest.mark.nightly
def test_a_fleet_planned_by_processes_is_the_same(workers: Executor) -> None:
    assert isinstance(workers, Dask)
    assert told(plan(fleet(), cluster=workers.client)) == told(plan(fleet()))


@pytest.mark.nightly
def test_terrain_that_planning_widened_is_the_same_here() -> None:
    """The way round the wall leaves the first window, and the answer comes back over the wider one."""
    wall = [[46.9, 8.01], [46.9, 8.0101], [47.08, 8.0101], [47.08, 8.01]]
    start = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 12], "start": [47.0, 8.0]}
    mission = {
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30},
        "vehicles": [start | {"goal": [47.0, 8.02]}], "no_fly": [{"name": "wall", "polygon": wall}],
    }  # fmt: skip
    alone = plan(mission)
    assert alone.source.level > 0
    other = plan(mission, cluster=Pickled())
    assert other.source.level == alone.source.level
    assert told(other) == told(alone)


def test_a_worker_of_another_version_is_refused() -> None:
    assert module.piece_done(square, __version__, 1, 2) == 5
    with pytest.raises(InputError, match=r"a worker of the cluster has gcsplan .*, and this is 9.9"):
        module.piece_done(square, "9.9", 1, 2)


@pytest.mark.nightly
def test_a_scheduler_without_workers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(module, "ANSWER_S", 1.0)
    with (
        distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as empty,
        pytest.raises(InputError, match="no worker"),
        executor(cluster=empty.scheduler_address, pieces=2, piece_s=1.0),
    ):
        pass


@pytest.mark.nightly
def test_a_scheduler_is_found_by_its_file_or_its_object_and_its_end_is_told(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    found: list[Any] = []
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as local:
        with executor(cluster=local, pieces=2, piece_s=1.0) as one:
            assert list(one.each(square, 1, [2])) == [(0, 5)]
        with distributed.Client(local, set_as_default=False) as client:
            client.write_scheduler_file(str(file))
        with (
            executor(cluster=str(file), pieces=2, piece_s=1.0) as one,
            pytest.raises(InputError, match="the dask scheduler has ended"),
        ):
            found.extend((k, local.close()) for k, _ in one.each(square, 1, range(100)))


@pytest.mark.nightly
def test_no_scheduler_answers() -> None:
    pytest.importorskip("distributed")
    with (
        pytest.raises(InputError, match="no dask scheduler answers"),
        executor(cluster="tcp://127.0.0.1:9", pieces=2, piece_s=1.0),
    ):
        pass
    with (
        pytest.raises(InputError, match="TLS"),
        executor(cluster="tls://127.0.0.1:9", pieces=2, piece_s=1.0),
    ):
        pass
