"""Readings of a flight: refused where they are in another unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.logs.flight_log import together, watts_of
from gcsplan.logs.reader import read_log
from tests.support.flight_logs import csv_of, flown


@pytest.mark.parametrize(
    ("volt", "ampere", "what"), [(100.0, 100.0, "voltage"), (1000.0, 1.0, "voltage"), (1.0, 1000.0, "current")]
)
def test_readings_in_another_unit_are_refused(tmp_path: Path, volt: float, ampere: float, what: str) -> None:
    t, place, watts = flown(seed=25)
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,volt,amp", [t, *place.T, np.full(len(t), 22.2 * volt),
                  watts / 22.2 * ampere])  # fmt: skip
    with pytest.raises(InputError, match=f"has a {what} of .*another unit"):
        read_log(file)
    milli = csv_of(tmp_path / "b.csv", "time_s,x,y,z,power", [t, *place.T, 1000.0 * watts])
    with pytest.raises(InputError, match="has a power of"):
        read_log(milli)


def test_the_power_of_batteries_is_added_at_the_times_of_the_one_read_most() -> None:
    often = [(float(t), 100.0 + t) for t in range(10)]
    seldom = [(0.0, 50.0), (9.0, 59.0)]
    whole = together({0: seldom, 1: often})
    assert whole[:, 0].tolist() == [float(t) for t in range(10)]
    assert whole[:, 1] == pytest.approx([150.0 + 2 * t for t in range(10)])
    assert together({3: seldom}).tolist() == [[0.0, 50.0], [9.0, 59.0]]


def test_watts_are_volts_times_amperes_of_each_reading() -> None:
    assert watts_of([(1.0, 22.0, 10.0), (2.0, 21.0, 12.0)], "log").tolist() == [[1.0, 220.0], [2.0, 252.0]]
    assert watts_of([(1.0, 22.0, 0.0)], "log").tolist() == [[1.0, 0.0]]  # on the ground: no unit is mistaken
