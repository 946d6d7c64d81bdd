"""The desk: one conversation at a time, which can be stopped; listening gives way and goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gcsplan.errors import Cancelled, GcsplanError, LinkError, heed_cancel
from gcsplan.page.steps.vehicle_desk import VehicleDesk

WAIT_S = 10.0


@pytest.fixture
def failed() -> list[GcsplanError]:
    return []


@pytest.fixture
def desk(failed: list[GcsplanError]) -> Iterator[VehicleDesk]:
    made = VehicleDesk(lambda answer: None, failed.append)
    yield made
    made.close()


def setting(event: threading.Event) -> Callable[[], dict[str, Any]]:
    """A task that sets an event."""
    return lambda: {"set": event.set()}  # type: ignore[func-returns-value]


def working(begun: threading.Event, ended: list[str]) -> dict[str, Any]:
    """Work that goes on until it is cancelled."""
    begun.set()
    try:
        while True:
            heed_cancel()
            threading.Event().wait(0.001)
    except Cancelled:
        ended.append("cancelled")
        return {}


def test_one_task_at_a_time_and_a_stop_ends_it(desk: VehicleDesk) -> None:
    begun, ended = threading.Event(), list[str]()
    assert desk.do(lambda: working(begun, ended))
    assert begun.wait(WAIT_S)
    assert desk.busy
    assert not desk.do(setting(threading.Event()))
    desk.stop()
    again = threading.Event()
    while not desk.do(setting(again)):
        threading.Event().wait(0.001)
    assert again.wait(WAIT_S)
    assert ended == ["cancelled"]


def test_listening_gives_way_to_a_task_and_goes_on_behind_it(desk: VehicleDesk) -> None:
    begun, ended = threading.Event(), list[str]()
    desk.listen(lambda: [working(begun, ended)].clear())
    assert begun.wait(WAIT_S)
    begun.clear()
    done = threading.Event()
    assert desk.do(setting(done))
    assert done.wait(WAIT_S)
    assert ended == ["cancelled"]
    assert begun.wait(WAIT_S)


def test_a_link_that_fails_ends_the_listening_and_is_told_once(desk: VehicleDesk, failed: list[GcsplanError]) -> None:
    calls = []

    def fail() -> None:
        calls.append(1)
        raise LinkError("gone")

    desk.listen(fail)
    done = threading.Event()
    while not failed:
        threading.Event().wait(0.001)
    assert desk.do(setting(done))
    assert done.wait(WAIT_S)
    assert (len(calls), [str(why) for why in failed]) == (1, ["gone"])
