"""Readings of a flight: refused where they are in another unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.logs.reader import read_log
from tests.support.flight_logs import csv_of, flown


@pytest.mark.parametrize(
    ("volt", "ampere", "what"), [(100.0, 100.0, "voltage"), (1000.0, 1.0, "voltage"), (1.0, 1000.0, "current")]
)
def test_readings_in_another_unit_are_refused(tmp_path: Path, volt: float, ampere: float, what: str) -> None:
    t, place, watts = flown(seed=25)
    file = csv_of(tmp_path / "a.csv", "time_s,x,y,z,volt,amp", [t, *place.T, np.full(len(t), 22.2 * volt),
                  watts / 22.2 * ampere])  # fmt: skip
    with pytest.raises(InputError, match=f"tells a {what} of .*another unit"):
        read_log(file)
    milli = csv_of(tmp_path / "b.csv", "time_s,x,y,z,power", [t, *place.T, 1000.0 * watts])
    with pytest.raises(InputError, match="tells a power of"):
        read_log(milli)
