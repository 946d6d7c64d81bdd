"""How long a transfer may take: against the clock of a transfer that goes on, stops, or never ends."""

from __future__ import annotations

import math

import pytest

from gcsplan.errors import InputError
from gcsplan.mavlink.link.options import ITEM_S, TransferPatience, checked_timeout_s
from gcsplan.mavlink.protocol.machine import Timers


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, 3600.1, math.inf, math.nan])
def test_a_timeout_beyond_an_hour_or_of_nothing_is_refused(timeout_s: float) -> None:
    with pytest.raises(InputError, match="0 … 3600 s"):
        checked_timeout_s(timeout_s)
    with pytest.raises(InputError, match="0 … 3600 s"):
        TransferPatience(timeout_s, 1, 0.0)


def test_a_timeout_of_an_hour_is_taken() -> None:
    assert checked_timeout_s(3600.0) == 3600.0


def test_silence_is_over_after_the_timeout_and_each_step_begins_it_anew() -> None:
    patience = TransferPatience(10.0, 100, now=5.0)
    assert patience.deadline == 15.0
    assert patience.over((0, 1), 100, now=14.9) is None
    assert patience.deadline == 24.9
    assert patience.over((0, 1), 100, now=24.8) is None  # the same mark again is no step
    assert patience.deadline == 24.9
    assert patience.over((0, 1), 100, now=24.9) == "nothing new for 10 s (--timeout)"


def test_steps_without_an_end_are_over_after_the_time_of_all_items() -> None:
    patience, now = TransferPatience(10.0, 5, now=0.0), 0.0
    while (words := patience.over((int(now),), 5, now)) is None:
        now += 1.0
    assert now == 10.0 + 5 * ITEM_S
    assert words.startswith("not done after 20 s, for 5 items")


def test_a_list_of_unknown_length_gets_the_time_of_what_the_vehicle_tells() -> None:
    told, untold = TransferPatience(10.0, None, now=0.0), TransferPatience(10.0, None, now=0.0)
    known = TransferPatience(10.0, 0, now=0.0)
    for patience in (told, known):
        assert patience.over((1,), 50, now=9.0) is None
    assert untold.over((1,), 0, now=9.0) is None
    assert (told.deadline, untold.deadline, known.deadline) == (19.0, 10.0, 10.0)


@pytest.mark.parametrize("name", ["response_s", "item_s", "silence_s", "stall_s"])
def test_a_timer_of_nothing_is_refused_by_its_name(name: str) -> None:
    for value in (0.0, -1.0, 3600.0, math.nan):
        with pytest.raises(InputError, match=name):
            Timers(**{name: value})
    with pytest.raises(InputError, match="retries"):
        Timers(retries=-1)
