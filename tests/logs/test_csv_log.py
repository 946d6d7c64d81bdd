"""Logs in CSV: columns by many names, and what a file lacks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.logs.csv_log import read_csv
from gcsplan.logs.fit import fit_energy
from tests.support.flight_logs import csv_of, degrees, flown, within


def test_csv_in_degrees_or_metres_with_power_or_volt_and_amp(tmp_path: Path) -> None:
    t, place, watts = flown(seed=9)
    lat, lon = degrees(place)
    a = csv_of(tmp_path / "a.csv", "Time,Latitude,Longitude,Altitude,Voltage,Current",
               [t, lat, lon, place[:, 2] + 300, np.full(len(t), 22.2), watts / 22.2])  # fmt: skip
    b = csv_of(tmp_path / "b.csv", "time_s;x;y;z;my power", [t, *place.T, watts], ";")
    assert within(fit_energy([read_csv(a, {})]))
    assert within(fit_energy([read_csv(b, {"power_w": "my power"})]))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("time_s,lat,lon,amsl_m\n1,2,3,4\n", "no column for power_w"),
        ("a,b\n1,2\n", "no column for time_s, amsl_m, lat and lon, power_w"),
        ("time_s,lat,lon,amsl_m,power_w\n" + "1,x,3,4,y\n" * 50, "50 lines without numbers, the first is line 2"),
        ("time_s,lat,lon,amsl_m,power_w\n1,2,3,4,5\n", "1 position,"),
    ],
)
def test_a_csv_that_cannot_be_used_says_what_it_lacks(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "x.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=words):
        read_csv(file, {})
