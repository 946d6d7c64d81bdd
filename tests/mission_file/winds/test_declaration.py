"""``wind:`` of a mission: every form as a set of winds, and each wrong key with its place and cure."""

from __future__ import annotations

import json
import pickle
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.errors import InputError
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.mission_file.values.yaml import read_yaml
from gcsplan.units import KNOT
from gcsplan.wind.declared import STILL_AIR
from tests.support.batches import mission
from tests.support.forecasts import forecast

AT = "2026-11-28T10:30Z"


def load(wind: Any, folder: Path = Path(), **more: Any) -> MissionFile:
    whole = read_yaml(mission(), where="m.yaml") | {"wind": wind} | more
    file = folder / "m.yaml"
    return load_mission(file, text=json.dumps(whole, ensure_ascii=False))


def problems(wind: Any, folder: Path = Path(), **more: Any) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as caught:
        load(wind, folder, **more)
    assert caught.value.exit_code == 2
    return [(p.where.rpartition(": ")[2], p.message) for p in caught.value.problems]


def of_forecast(folder: Path, changes: dict[str, Any] | None = None, at: Any = AT, **keys: Any) -> MissionFile:
    (folder / "f.json").write_text(json.dumps(forecast(**(changes or {}))))
    return load({"forecast": "f.json", **keys}, folder, **({} if at is None else {"at": at}))


@pytest.mark.parametrize(
    ("wind", "speeds", "directions"),
    [
        ({"speed_m_s": 5, "from_deg": 270}, [5, 5], [270, 270]),
        ({"speed_m_s": [3, 7], "from_deg": [250, 290]}, [3, 7], [250, 290]),
        ({"speed_m_s": "5 ± 2", "from_deg": "270 ± 20"}, [3, 7], [250, 290]),
        ({"speed_m_s": "5 +- 2", "from_deg": "270 +/- 20"}, [3, 7], [250, 290]),
        ({"speed_m_s": "2 ± 3", "from_deg": "5 ± 20"}, [0, 5], [345, 385]),
        ({"speed_m_s": 5, "from_deg": [350, 20]}, [5, 5], [350, 380]),
        ({"speed_m_s": 5, "from_deg": [0, 360]}, [5, 5], [0, 360]),
        ({"speed_m_s": 5, "from_deg": "90 ± 180"}, [5, 5], [0, 360]),
        ({"up_to_m_s": 8}, [0, 8], [0, 360]),
        ({"speed_m_s": 0}, [0, 0], [0, 0]),
    ],
)
def test_every_form_is_one_set_of_winds_at_all_heights(wind: Any, speeds: Any, directions: Any) -> None:
    made = load(wind).wind
    assert made.speed_m_s.tolist() == [[speeds]]
    assert made.from_deg.tolist() == [[directions]]
    assert (made.heights_m.tolist(), made.varying, made.gust_m_s) == ([0.0], False, None)


def test_errors_need_no_quotes_in_yaml() -> None:
    text = mission() + "wind: {speed_m_s: 5 ± 2, from_deg: 270 +- 20, gust_m_s: 9}\n"
    made = load_mission("m.yaml", text=text).wind
    assert (made.speed_m_s[0, 0].tolist(), made.from_deg[0, 0].tolist()) == ([3.0, 7.0], [250.0, 290.0])


def test_knots_kilometres_per_hour_and_feet_are_understood() -> None:
    assert load({"speed_kt": 10, "from_deg": 0}).wind.most_m_s == pytest.approx(10 * KNOT.size)
    assert load({"speed_kt": "10 ± 2", "from_deg": 0}).wind.most_m_s == pytest.approx(12 * KNOT.size)
    made = load({"levels": [{"agl_ft": 100, "speed_kmh": [18, 36], "from_deg": 7}], "gust_kmh": 72}).wind
    assert (made.heights_m[0], made.most_m_s, made.gust_m_s) == pytest.approx((30.48, 10.0, 20.0))


@pytest.mark.slow
@given(st.floats(0.1, 70), st.floats(0, 4.9), st.floats(0, 360), st.floats(0, 179))
def test_an_error_is_the_range_around_the_number(speed: float, more: float, turn: float, error: float) -> None:
    speed, more, turn, error = round(speed, 3), round(more, 3), round(turn, 3), round(error, 3)
    made = load({"speed_m_s": f"{speed} ± {more}", "from_deg": f"{turn} ± {error}"}).wind
    assert made.speed_m_s[0, 0] == pytest.approx([max(speed - more, 0.0), speed + more])
    low, high = made.from_deg[0, 0]
    assert high - low == pytest.approx(2 * error, abs=1e-9)
    assert np.cos(np.radians((low + high) / 2 - turn)) == pytest.approx(1.0)


@pytest.mark.slow
@given(st.floats(0, 360), st.floats(0, 360))
def test_a_range_of_directions_goes_clockwise(first: float, second: float) -> None:
    low, high = load({"speed_m_s": 3, "from_deg": [first, second]}).wind.from_deg[0, 0]
    assert (low, high % 360.0) == pytest.approx((first, second % 360.0), abs=1e-9)
    assert 0.0 <= high - low <= 360.0


def test_levels_count_from_the_ground_or_from_the_sea() -> None:
    levels = [{"agl_m": 10, "speed_m_s": 3, "from_deg": 250}, {"agl_m": 100, "speed_m_s": "6 ± 1", "from_deg": 270}]
    made = load({"levels": levels, "varying": True, "gust_m_s": 9}).wind
    assert (made.heights, made.heights_m.tolist(), made.varying, made.gust_m_s) == ("agl", [10.0, 100.0], True, 9.0)
    assert made.speed_m_s.tolist() == [[[3.0, 3.0], [5.0, 7.0]]]
    sea = [{"amsl_m": h, "speed_m_s": 3, "from_deg": 250} for h in (-10, 500)]
    assert load({"levels": sea}).wind.heights == "amsl"


def test_a_mission_without_the_key_has_still_air_and_no_note_on_wind() -> None:
    for given_wind in (None, {"up_to_m_s": 0}):
        source = load(given_wind)
        assert source.wind.still
        assert [n.code for n in source.notes if "wind" in n.code] == []
    assert load(None).wind is STILL_AIR


@pytest.mark.parametrize(
    ("wind", "place", "words"),
    [
        (5, "wind", "must be a mapping of keys"),
        (
            {},
            "wind",
            "give one of speed_m_s (with from_deg), up_to_m_s (any direction), levels and forecast, given none",
        ),
        ({"gust_m_s": 9}, "wind", "given none"),
        ({"speed_m_s": 5, "from_deg": 1, "up_to_m_s": 5}, "wind", "given speed_m_s and up_to_m_s"),
        ({"levels": [], "up_to_m_s": 5}, "wind.levels", "at least 1"),
        ({"up_to_m_s": 5, "forecast": "f.json"}, "wind", "given up_to_m_s and forecast"),
        ({"speeds": 5, "from_deg": 3}, "wind.speeds", "unknown key; did you mean speed_m_s"),
        ({"speed_m_s": 5}, "wind.from_deg", "is missing: where the wind comes from"),
        ({"up_to_m_s": 5, "from_deg": 3}, "wind.from_deg", "belongs to speed_m_s; leave it out"),
        ({"speed_m_s": 5, "from_deg": 3, "speed_error_m_s": 1}, "wind.speed_error_m_s", "belongs to a forecast"),
        ({"up_to_m_s": 5, "from_error_deg": 1}, "wind.from_error_deg", "belongs to a forecast; give a range"),
        ({"speed_m_s": -1, "from_deg": 3}, "wind.speed_m_s", "must be at least 0, given -1"),
        ({"speed_m_s": 76, "from_deg": 3}, "wind.speed_m_s", "must be at most 75, given 76"),
        ({"speed_m_s": "70 ± 9", "from_deg": 3}, "wind.speed_m_s[1]", "must be at most 75, given 79"),
        ({"up_to_m_s": 1e9}, "wind.up_to_m_s", "must be at most 75"),
        ({"up_to_m_s": float("nan")}, "wind.up_to_m_s", "must be"),
        ({"up_to_m_s": True}, "wind.up_to_m_s", "must be a number, given true"),
        ({"speed_m_s": [7, 3], "from_deg": 3}, "wind.speed_m_s", "must be [lowest, highest], given [7, 3]"),
        ({"speed_m_s": [1, 2, 3], "from_deg": 3}, "wind.speed_m_s", "at most 2 values"),
        ({"speed_m_s": "3-7", "from_deg": 3}, "wind.speed_m_s", "write [3, 7]"),
        ({"speed_m_s": 3, "from_deg": 361}, "wind.from_deg", "must be at most 360, given 361"),
        ({"speed_m_s": 3, "from_deg": "400 ± 2"}, "wind.from_deg", "must be a number"),
        ({"speed_m_s": 3, "from_deg": "west"}, "wind.from_deg", "must be a number, given the text 'west'"),
        ({"speed_m_s": [3, 7], "from_deg": 3, "gust_m_s": 6}, "wind.gust_m_s", "must be at least the fastest wind, 7"),
        ({"up_to_kt": 8, "gust_kt": 5}, "wind.gust_kt", "at least the fastest wind, 4.116 m/s, given 2.572"),
        ({"up_to_m_s": 5, "varying": "yes"}, "wind.varying", "given the text 'yes'"),
        ({"levels": [{"speed_m_s": 3, "from_deg": 3}]}, "wind.levels[0]", "give agl_m (above ground) or amsl_m"),
        (
            {"levels": [{"agl_m": 1, "amsl_m": 1, "speed_m_s": 3, "from_deg": 3}]},
            "wind.levels[0]",
            "give agl_m (above ground) or amsl_m (above sea level), not both",
        ),
        ({"levels": [{"agl_m": 1, "speed_m_s": 3}]}, "wind.levels[0].from_deg", "is missing"),
        ({"levels": [{"agl_m": -1, "speed_m_s": 3, "from_deg": 3}]}, "wind.levels[0].agl_m", "must be at least 0"),
    ],
)
def test_each_wrong_key_is_refused_with_its_place_and_cure(wind: Any, place: str, words: str) -> None:
    found = problems(wind)
    assert found[0][0] == place
    assert words in found[0][1]
    assert len(found) == 1


def test_levels_rise_and_count_from_the_same() -> None:
    def level(**height: float) -> dict[str, Any]:
        return {**height, "speed_m_s": 3, "from_deg": 9}

    [(place, words)] = problems({"levels": [level(agl_m=10), level(agl_m=10)]})
    assert place == "wind.levels[1].agl_m"
    assert "must be above the level before it, 10, given 10" in words
    [(place, words)] = problems({"levels": [level(agl_m=10), level(agl_m=20), level(amsl_m=900)]})
    assert place == "wind.levels[2].amsl_m"
    assert "give agl_m, or all amsl_m" in words
    [(_, words)] = problems({"levels": [level(amsl_m=900), level(agl_m=20)]})
    assert "give amsl_m, or all agl_m" in words


def test_gusts_that_equal_the_wind_in_another_unit_are_taken() -> None:
    assert load({"speed_kmh": "18 ± 2", "from_deg": 3, "gust_kmh": 20}).wind.gusts_add_m_s == pytest.approx(0.0)


def test_a_forecast_counts_in_the_missions_hours(tmp_path: Path) -> None:
    source = of_forecast(tmp_path)
    wind = source.wind
    assert source.departure == datetime(2026, 11, 28, 10, 30, tzinfo=UTC)
    hours = [datetime.fromtimestamp(t, UTC).hour for t in wind.times_s]
    assert hours == [10, 11, 12, 13]
    assert wind.heights_m.tolist() == [10.0, 80.0]
    assert wind.speed_m_s[0].tolist() == pytest.approx(np.array([[11.0, 11.0], [21.0, 21.0]]))
    assert wind.from_deg[:, 1, 0].tolist() == [5.0, 10.0, 15.0, 20.0]
    assert wind.gusts_add_m_s == pytest.approx(7.0)
    [note] = [n for n in source.notes if n.code == "wind_of_forecast"]
    assert "f.json for 47.0000, 8.0100" in str(note)


def test_errors_widen_a_forecast(tmp_path: Path) -> None:
    wind = of_forecast(tmp_path, speed_error_m_s=12, from_error_deg=20, gust_m_s=50).wind
    assert wind.speed_m_s[0, 0].tolist() == pytest.approx([0.0, 23.0])
    assert wind.from_deg[0, 0].tolist() == [335.0, 375.0]
    assert wind.gust_m_s == 50.0
    assert of_forecast(tmp_path, speed_error_m_s=2).wind.gusts_add_m_s == pytest.approx(7.0)


def test_a_forecast_needs_the_time_of_departure(tmp_path: Path) -> None:
    for at in (None, "2026-11-28", ["2026-11-28", "2026-11-28T12:00Z"]):
        with pytest.raises(InputError, match="needs the time of departure"):
            of_forecast(tmp_path, at=at)
    with pytest.raises(InputError, match=r"m\.yaml: at: ") as caught:
        of_forecast(tmp_path, at="noon")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("at", ["2026-11-28T08:59Z", "2026-11-28T12:30Z", ["2026-11-28T10:00Z", "2026-11-28T14:01Z"]])
def test_a_forecast_that_does_not_hold_the_hours_is_refused(tmp_path: Path, at: Any) -> None:
    with pytest.raises(InputError, match="covers 2026-11-28 09:00Z to 2026-11-28 14:00Z, and the flight's hours are"):
        of_forecast(tmp_path, at=at)


def test_a_common_start_is_the_departure_with_all_its_hours(tmp_path: Path) -> None:
    (tmp_path / "f.json").write_text(json.dumps(forecast()))
    file = tmp_path / "m.yaml"
    file.write_text(mission(wind={"forecast": "f.json"}))
    start = datetime(2026, 11, 28, 10, 15, tzinfo=UTC)
    source = load_mission(file, departure=start)
    assert source.departure == start
    assert [datetime.fromtimestamp(t, UTC).hour for t in source.wind.times_s] == [9, 10, 11, 12, 13]
    with pytest.raises(InputError, match="the flight's hours are 2026-11-28 08:00Z to 12:15Z"):
        load_mission(file, departure=start, at="2026-11-28T08:00Z")


@pytest.mark.parametrize(("latitude", "longitude"), [(47.3, 8.01), (47.0, 8.5), (-47.0, -172.0), (90.0, 0.0)])
def test_a_forecast_of_another_place_is_refused(tmp_path: Path, latitude: float, longitude: float) -> None:
    with pytest.raises(InputError, match=r"more than 30 km from a place of the mission; get the forecast for 47\.0"):
        of_forecast(tmp_path, {"latitude": latitude, "longitude": longitude})


def test_a_longitude_to_360_is_the_same_place(tmp_path: Path) -> None:
    assert of_forecast(tmp_path, {"longitude": 8.01 - 360.0}).wind.most_m_s > 0.0


def test_a_mission_goes_to_other_processes_with_its_wind(tmp_path: Path) -> None:
    source = of_forecast(tmp_path)
    again = pickle.loads(pickle.dumps(source))
    assert again.wind.speed_m_s.tolist() == source.wind.speed_m_s.tolist()
    assert again.departure == source.departure
