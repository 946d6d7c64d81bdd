"""Forecasts of Open-Meteo: their hours, units and heights, and spoilt files."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.winds.forecast import MOST_FORECAST_BYTES, Forecast, read_forecast
from tests.support.forecasts import HOURS, forecast


def read(folder: Path, whole: Any) -> Forecast:
    file = folder / "f.json"
    file.write_text(whole if isinstance(whole, str) else json.dumps(whole))
    return read_forecast(file, "m.yaml: wind.forecast")


def hours(first: str, last: str) -> Hours:
    return Hours(*(datetime.fromisoformat(f"2026-11-28T{t}:00+00:00") for t in (first, last)))


def test_local_hours_are_in_utc_and_speeds_in_metres_per_second(tmp_path: Path) -> None:
    made = read(tmp_path, forecast())
    assert datetime.fromtimestamp(made.times_s[0], UTC) == datetime(2026, 11, 28, 9, tzinfo=UTC)
    assert made.speed_m_s[:, 0] == pytest.approx([10.0, 11.0, 12.0, 13.0, 14.0, 15.0])
    assert made.agl_m.tolist() == [10.0, 80.0]
    assert made.gust_m_s == pytest.approx(np.array([15.0, 16.0, 18.0, 18.0, 19.0, 30.0]))
    assert (made.lat_deg, made.lon_deg) == (47.0, 8.01)
    assert len(made.sha256) == 64


def test_times_of_the_unix_clock_are_utc_whatever_the_zone(tmp_path: Path) -> None:
    start = int(datetime(2026, 11, 28, 9, tzinfo=UTC).timestamp())
    made = read(tmp_path, forecast(hourly__time=[start + 3600 * k for k in range(6)]))
    assert made.times_s.tolist() == read(tmp_path, forecast()).times_s.tolist()


@pytest.mark.parametrize(("unit", "size"), [("m/s", 1.0), ("km/h", 1 / 3.6), ("kn", 1852 / 3600), ("mp/h", 0.44704)])
def test_every_unit_of_the_api_is_read(tmp_path: Path, unit: str, size: float) -> None:
    made = read(tmp_path, forecast(hourly_units__wind_speed_10m=unit))
    assert made.speed_m_s[0, 0] == pytest.approx(36.0 * size)
    assert made.speed_m_s[0, 1] == pytest.approx(20.0)


def test_a_height_of_which_a_model_knows_nothing_is_left_and_gusts_may_be_absent(tmp_path: Path) -> None:
    made = read(tmp_path, forecast(hourly__wind_speed_80m=[None] * 6, hourly__wind_gusts_10m=...))
    assert made.agl_m.tolist() == [10.0]
    assert made.gust_m_s is None


def test_gusts_add_what_exceeds_the_lower_wind_of_their_hour(tmp_path: Path) -> None:
    made = read(tmp_path, forecast()).within(hours("10:00", "12:00"))
    assert made.gusts_add_m_s() == pytest.approx(7.0)  # 18 m/s since 10 o'clock UTC, where the wind was 11 m/s
    gustless = read(tmp_path, forecast(hourly__wind_gusts_10m=[None] * 6))
    assert (gustless.gust_m_s, gustless.gusts_add_m_s()) == (None, 0.0)


def test_hours_are_cut_to_the_flight_and_the_hours_around_it(tmp_path: Path) -> None:
    made = read(tmp_path, forecast())
    assert len(made.within(hours("10:00", "12:00")).times_s) == 3
    assert len(made.within(hours("10:01", "12:01")).times_s) == 4
    assert len(made.within(hours("09:00", "14:00")).times_s) == 6
    for outside in (("08:59", "10:00"), ("13:00", "14:01")):
        with pytest.raises(InputError, match=r"covers .* get a forecast of these hours"):
            made.within(hours(*outside))


@pytest.mark.parametrize(
    ("name", "column"),
    [("wind_speed_80m", [80.0]), ("wind_direction_10m", [0]), ("wind_gusts_10m", [60.0])],
)
def test_a_number_that_is_absent_in_the_hours_is_refused(tmp_path: Path, name: str, column: list[float]) -> None:
    made = read(tmp_path, forecast(**{f"hourly__{name}": [*column * 2, None, *column * 3]}))
    with pytest.raises(InputError, match=rf"has no {name} at 2026-11-28 11:00Z, within the flight's hours"):
        made.within(hours("10:00", "12:00"))
    assert len(made.within(hours("12:00", "14:00")).times_s) == 3


def test_missing_hours_are_refused(tmp_path: Path) -> None:
    made = read(tmp_path, forecast(hourly__time=[*HOURS[:3], *(f"2026-11-28T{h}:00" for h in (20, 21, 22))]))
    with pytest.raises(InputError, match="has no hours from 2026-11-28 11:00Z to 2026-11-28 19:00Z"):
        made.within(hours("10:00", "12:00"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hourly": ...}, "has no hourly winds"),
        ({"hourly_units": []}, "has no hourly winds"),
        ({"error": True, "reason": "Latitude must be in range"}, "is Open-Meteo's refusal: Latitude must be in range"),
        ({"utc_offset_seconds": ...}, "utc_offset_seconds: must be the seconds"),
        ({"utc_offset_seconds": 1e6}, "utc_offset_seconds: must be the seconds"),
        ({"latitude": None}, "latitude: must be the degrees"),
        ({"longitude": 361}, "longitude: must be the degrees"),
        ({"hourly__time": []}, "has no hours"),
        ({"hourly__time": [*HOURS[:5], "noon"]}, r"hourly.time\[5\]: must be a time such as"),
        ({"hourly__time": [*HOURS[:5], HOURS[0]]}, r"hourly.time\[5\]: must be later than the hour before it"),
        ({"hourly__time": [*HOURS[:5], 1e300]}, r"hourly.time\[5\]: must be a time"),
        ({"hourly__wind_direction_80m": ...}, "has wind_speed_80m without wind_direction_80m"),
        ({"hourly__wind_speed_10m": [1.0]}, r"wind_speed_10m: must be a list of 6, one for each hour, given 1 values"),
        ({"hourly__wind_speed_10m": ["1"] * 6}, r"wind_speed_10m\[0\]: must be a number or null"),
        ({"hourly__wind_speed_10m": [-1.0] * 6}, r"wind_speed_10m\[0\]: must be 0 to 75 m/s"),
        ({"hourly__wind_speed_10m": [9999.0] * 6}, r"wind_speed_10m\[0\]: must be 0 to 75 m/s, given 2777.5 m/s"),
        ({"hourly__wind_direction_10m": [361] * 6}, r"wind_direction_10m\[0\]: must be 0 to 360"),
        ({"hourly_units__wind_speed_10m": "Bft"}, "hourly_units.wind_speed_10m: must be one of m/s, km/h, kn, mp/h"),
        (
            {"hourly_units__wind_direction_80m": "rad"},
            "hourly_units.wind_direction_80m: must be °, given the text 'rad'",
        ),
        ({"hourly_units__wind_gusts_10m": ...}, "hourly_units.wind_gusts_10m: must be one of"),
        ({"hourly__wind_speed_10m": [None] * 6}, "has gusts at 10 m without the wind there"),
        ({"hourly__wind_speed_10m": [None] * 6, "hourly__wind_speed_80m": [None] * 6}, "has no speed at any hour"),
        ({"hourly__wind_speed_10m": ..., "hourly__wind_speed_80m": ...}, "has no wind_speed_10m in hourly"),
    ],
)
def test_each_fault_of_a_file_is_refused_with_its_place(tmp_path: Path, changes: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(tmp_path, forecast(**changes))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "this is not JSON"),
        ("[]", "holds forecasts of 0 places; ask for one"),
        ("3", "must be a forecast as Open-Meteo returns it, given 3"),
        ("[" * 100_000, "nested too deeply"),
        ('{"hourly": {"a": NaN}}', "NaN is no number"),
        ("x" * (MOST_FORECAST_BYTES + 1), "bytes, more than"),
    ],
    ids=["empty", "list", "number", "nested", "nan", "large"],
)
def test_what_is_no_forecast_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(tmp_path, text)


def test_a_file_that_is_absent_or_a_folder_is_refused(tmp_path: Path) -> None:
    for path, words in ((tmp_path / "none.json", "is not there"), (tmp_path, "is no file: give a file, not a folder")):
        with pytest.raises(InputError, match=words):
            read_forecast(path, "m.yaml: wind.forecast")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_spoilt_forecast_is_refused_or_has_winds_in_bounds(tmp_path: Path, data: st.DataObject) -> None:
    text = json.dumps(forecast())
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(text) - 1))
        text = text[:k] + data.draw(st.sampled_from(["", "9", "-", '"', "}", "null", "[", "e9"])) + text[k + 1 :]
    try:
        made = read(tmp_path, text).within(hours("10:00", "12:00"))
    except InputError:
        return
    assert ((made.speed_m_s >= 0.0) & (made.speed_m_s <= 75.0)).all()
    assert ((made.from_deg >= 0.0) & (made.from_deg <= 360.0)).all()
    assert (np.diff(made.times_s) > 0.0).all()
