"""Whether a flight lies within the hours for which zones were left out, and those of a forecast."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

import pytest

from gcsplan.app.api import check
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.flight_hours import FAR_S, beyond_hours, hours_left, landing_of, waits_s, within_hours
from gcsplan.app.plan.model import Plan
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.published.times import Hours
from tests.support.batches import mission
from tests.support.forecasts import mission_in_forecast

TEN = datetime(2026, 11, 24, 10, tzinfo=UTC)


@cache
def planned() -> Plan:
    return plan(load_mission(text=mission(arrival={"mode": "together"})))


def verdict() -> Verdict:
    return planned().vehicles[0].verdict


def hours(seconds: float) -> Hours:
    return Hours(TEN, TEN + timedelta(seconds=seconds))


def test_a_flight_is_over_a_whole_second_after_its_time() -> None:
    landed = landing_of(verdict(), TEN)
    assert landed == TEN + timedelta(seconds=math.ceil(verdict().time_s))


def test_a_flight_in_wind_lasts_until_its_latest_landing() -> None:
    blown = check(planned(), wind={"speed_m_s": 8, "from_deg": 90})["uav1"]
    assert blown.in_wind is not None
    assert blown.in_wind.window is not None
    landed = landing_of(blown, TEN)
    assert landed == TEN + timedelta(seconds=math.ceil(blown.in_wind.window.latest_s[-1]))
    assert landed > TEN + timedelta(seconds=blown.time_s + 30.0)


def test_a_flight_that_ends_in_the_air_or_waits_for_ever_has_no_landing() -> None:
    made = verdict()
    *legs, last = made.legs
    assert landing_of(replace(made, legs=(*legs, replace(last, kind="cruise"))), TEN) is None
    assert landing_of(replace(made, legs=(replace(legs[0], hold_s=math.inf), *legs[1:], last)), TEN) is None
    assert landing_of(replace(made, legs=()), TEN) is None


@pytest.mark.parametrize(("spare_s", "code"), [(1.0, None), (-1.0, "flies_beyond_hours")])
def test_the_hours_hold_a_flight_to_the_second(spare_s: float, code: str | None) -> None:
    note = beyond_hours(verdict(), hours(math.ceil(verdict().time_s) + spare_s))
    assert (note.code if note else None) == code
    assert beyond_hours(verdict(), None) is None


def test_a_plan_that_lasts_beyond_its_hours_is_refused_by_its_vehicle() -> None:
    made = planned()
    assert made.fleet is not None
    fleet = replace(made.fleet, start_utc=None)
    enough = replace(made.source, hours=hours(24 * 3600))
    verdicts = [v.verdict for v in made.vehicles]
    assert within_hours(enough, made.vehicles, verdicts, fleet) == verdicts
    with pytest.raises(InputError, match=r"uav1 flies from 2026-11-24 10:00Z to .*; write at: \[from, to\]"):
        within_hours(replace(made.source, hours=hours(60)), made.vehicles, verdicts, fleet)
    late = replace(fleet, start_utc=TEN - timedelta(minutes=1))
    with pytest.raises(InputError, match="flies from 2026-11-24 09:59Z"):
        within_hours(enough, made.vehicles, verdicts, late)


def test_a_vehicle_that_waits_has_fewer_hours_left() -> None:
    made = planned()
    assert made.fleet is not None
    [v] = made.vehicles
    source = replace(made.source, hours=hours(3600))
    wait_s = waits_s(v, made.fleet)
    assert 0.0 <= wait_s < FAR_S
    left = hours_left(source, v, replace(made.fleet, start_utc=TEN))
    assert left == Hours(TEN + timedelta(seconds=wait_s), TEN + timedelta(hours=1))
    assert hours_left(source, v, None) == source.hours
    assert hours_left(replace(source, hours=None), v, made.fleet) is None


@pytest.mark.slow
def test_a_flight_beyond_its_forecast_is_not_judged_however_it_is_checked(tmp_path: Path) -> None:
    late = ["2026-11-28T13:55Z", "2026-11-28T13:59Z"]  # the forecast ends at 14:00
    source = load_mission(mission_in_forecast(tmp_path / "f.json", late, (47.0, 8.07)))
    made = plan(source)
    for judged in (made.vehicles[0].verdict, check(made)["uav1"], check(made.vehicles[0].mission, source)):
        assert isinstance(judged, Verdict)
        assert judged.safe is None
        assert [note.code for note in judged.not_judged] == ["flies_beyond_forecast"]


@pytest.mark.slow
def test_gates_do_not_open_at_another_time_than_the_winds_were_read_for(tmp_path: Path) -> None:
    early = ["2026-11-28T09:10Z", "2026-11-28T09:30Z"]
    source = load_mission(mission_in_forecast(tmp_path / "f.json", early, (47.0, 8.02)))
    with pytest.raises(InputError, match="give `departure` to load_mission"):
        plan(source, gate_utc=datetime(2026, 11, 28, 13, 20, tzinfo=UTC))
    assert plan(source, gate_utc=source.departure).vehicles[0].verdict.in_wind is not None
