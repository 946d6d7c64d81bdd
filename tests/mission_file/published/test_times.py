"""When zones apply: minute by minute as the oracle, and that what is not understood counts as always."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mission_file.published.times import WEEK, Hours, TimeError, apply_in, read_instant, read_periods
from tests.support.effort import draws

MONDAY = datetime(2026, 11, 23, tzinfo=UTC)


def text(moment: datetime) -> str:
    return moment.strftime("%Y-%m-%dT%H:%MZ")


def applies(minute: datetime, period: dict[str, Any]) -> bool:
    """Whether a period as published applies in a minute, by its definition."""
    if "startDateTime" in period and minute < datetime.fromisoformat(period["startDateTime"]):
        return False
    if "endDateTime" in period and minute > datetime.fromisoformat(period["endDateTime"]):
        return False
    for line in period.get("schedule", []):
        for back in (0, 1):  # a night belongs to the day on which it begins
            day = minute.replace(hour=0, minute=0) - timedelta(days=back)
            if WEEK[day.weekday()] not in line["day"] and "ANY" not in line["day"]:
                continue
            start, end = (
                day + timedelta(hours=int(line[k][:2]), minutes=int(line[k][3:5])) for k in ("startTime", "endTime")
            )
            if start <= minute <= (end if end > start else end + timedelta(days=1)):
                return True
    return "schedule" not in period


def can_apply(period: dict[str, Any]) -> bool:
    """Whether a period that says when it begins and ends applies in one of its quarters of an hour."""
    if not {"startDateTime", "endDateTime", "schedule"} <= period.keys():
        return True
    first, last = (datetime.fromisoformat(period[k]) for k in ("startDateTime", "endDateTime"))
    return any(applies(first + timedelta(minutes=15 * i), period) for i in range((last - first) // QUARTER + 1))


QUARTER = timedelta(minutes=15)
CLOCK = st.builds(lambda h, m: f"{h:02}:{m:02}Z", st.integers(0, 23), st.sampled_from([0, 15, 30]))
LINE = st.fixed_dictionaries(
    {"day": st.lists(st.sampled_from([*WEEK, "ANY"]), min_size=1, max_size=2), "startTime": CLOCK, "endTime": CLOCK}
)
MOMENT = st.integers(0, 7 * 96).map(lambda n: text(MONDAY + timedelta(minutes=15 * n)))
PERIOD = st.fixed_dictionaries(
    {}, optional={"startDateTime": MOMENT, "endDateTime": MOMENT, "schedule": st.lists(LINE, min_size=1, max_size=2)}
)


@pytest.mark.slow
@given(st.lists(PERIOD, min_size=1, max_size=2), st.integers(0, 6 * 96), st.integers(1, 40))
@settings(max_examples=draws(200), deadline=None)
def test_periods_against_every_minute(given_: list[Any], first: int, quarters: int) -> None:
    start = MONDAY + timedelta(minutes=15 * first)
    hours = Hours(start, start + timedelta(minutes=15 * quarters))
    minutes = [start + timedelta(minutes=5 * i) for i in range(3 * quarters + 1)]
    periods, unread = read_periods(given_)
    ends_first = any(p.get("startDateTime", "") > p.get("endDateTime", "~") for p in given_)
    if ends_first or not all(can_apply(p) for p in given_):  # whichever is read first is named
        assert (ends_first and "before it begins" in unread) or "its schedule has no time" in unread
        assert apply_in(periods, hours)
        return
    assert not unread
    assert apply_in(periods, hours) == any(applies(m, p) for m in minutes for p in given_)


@pytest.mark.parametrize(
    "given_",
    [
        [{"permanent": "YES"}], [], None, [{}], [{"permanent": "MAYBE"}], [{"startDateTime": "soon"}], "always", [5],
        [{"startDateTime": "2020-01-01T00:00:00"}],  # no time zone
        [{"endDateTime": "2020-01-01T00:00Z"}, {"permanent": "YES"}],
        [{"schedule": [{"day": ["ANY"], "startEvent": "SR", "endEvent": "SS"}]}],  # sunrise to sunset
        [{"schedule": [{"day": ["MON"], "startTime": "06:00"}]}], [{"schedule": [{"startTime": "06:00Z"}]}],
        [{"startDateTime": "2026-11-25T00:00Z", "endDateTime": "2026-11-20T00:00Z"}],
        [{"schedule": [{"day": ["XMAS"]}]}],
        [{"schedule": [{"day": ["MON"], "startTime": "23:00-10:00", "endTime": "01:00+14:00"}]}],
        [{"schedule": [{"day": ["MON"], "startTime": "10:00-10:00", "endTime": "12:00+10:00"}]}],
        [{"startDateTime": "2026-11-23", "endDateTime": "2026-11-23", "schedule": [{"day": ["THU"]}]}],
        [{"endDateTime": "2020-01-01T00:00Z", "holidays": True}],
        [{"schedule": [{"day": ["MON"], "endDay": ["FRI"], "startTime": "06:00Z", "endTime": "18:00Z"}]}],
    ],
)  # fmt: skip
def test_what_is_not_understood_applies_always(given_: Any) -> None:
    periods, _ = read_periods(given_)
    for at in ("1970-01-01T00:00Z", "2026-11-24T12:00Z", "2099-12-31T23:59Z"):
        assert apply_in(periods, Hours.read(at)) is True


def test_offsets_and_the_end_of_a_day() -> None:
    tuesday = [{"schedule": [{"day": ["TUE"], "startTime": "00:30+02:00", "endTime": "24:00:00Z"}]}]
    periods, _ = read_periods(tuesday)
    assert not apply_in(periods, Hours.read(["2026-11-23T20:00Z", "2026-11-23T22:29Z"]))
    assert apply_in(periods, Hours.read(["2026-11-23T20:00Z", "2026-11-23T22:30Z"]))
    assert read_instant("2026-11-23T24:00Z") == read_instant("2026-11-24") == MONDAY + timedelta(days=1)


def test_a_day_alone_as_an_end_is_all_of_it() -> None:
    for given_ in (
        [{"endDateTime": "2026-11-24"}],
        [{"startDateTime": "2026-11-24T10:00Z", "endDateTime": "2026-11-24"}],
    ):
        periods, unread = read_periods(given_)
        assert not unread
        assert apply_in(periods, Hours.read("2026-11-24T22:30Z"))
        assert not apply_in(periods, Hours.read("2026-11-25T00:01Z"))


def test_a_schedule_without_a_beginning_begins_at_local_midnight() -> None:
    until, _ = read_periods([{"schedule": [{"day": ["TUE"], "endTime": "06:00-10:00"}]}])
    assert not apply_in(until, Hours.read(["2026-11-24T00:00Z", "2026-11-24T09:59Z"]))
    assert apply_in(until, Hours.read(["2026-11-24T10:00Z", "2026-11-24T10:01Z"]))
    assert apply_in(until, Hours.read(["2026-11-24T15:59Z", "2026-11-24T16:00Z"]))
    since, _ = read_periods([{"schedule": [{"day": ["TUE"], "startTime": "22:00+02:00"}]}])
    assert apply_in(since, Hours.read(["2026-11-24T21:59Z", "2026-11-24T22:00Z"]))
    assert not apply_in(since, Hours.read(["2026-11-24T22:01Z", "2026-11-24T23:00Z"]))
    east, _ = read_periods([{"schedule": [{"day": ["TUE"], "endTime": "06:00+02:00"}]}])
    assert apply_in(east, Hours.read(["2026-11-23T22:00Z", "2026-11-23T22:01Z"]))


def test_a_night_belongs_to_the_day_on_which_it_begins_and_ends_count() -> None:
    night, _ = read_periods([{"schedule": [{"day": ["SUN"], "startTime": "22:00Z", "endTime": "06:00Z"}]}])
    assert apply_in(night, Hours.read(["2026-11-23T01:00Z", "2026-11-23T02:00Z"]))
    assert not apply_in(night, Hours.read(["2026-11-24T01:00Z", "2026-11-24T02:00Z"]))
    west, _ = read_periods([{"schedule": [{"day": ["SUN"], "startTime": "21:00-10:00", "endTime": "05:00-10:00"}]}])
    assert apply_in(west, Hours.read(["2026-11-23T14:30Z", "2026-11-23T14:40Z"]))
    until, _ = read_periods([{"endDateTime": "2026-11-23T10:00Z"}])
    assert apply_in(until, Hours.read("2026-11-23T10:00Z"))
    assert not apply_in(until, Hours.read("2026-11-23T10:01Z"))


@pytest.mark.parametrize(
    ("given_", "start", "end"),
    [
        ("2026-11-23", MONDAY, MONDAY + timedelta(days=1)),
        ("2026-11-23T10:00Z", MONDAY + timedelta(hours=10), MONDAY + timedelta(hours=12)),
        ("2026-11-23T10:00+02:00", MONDAY + timedelta(hours=8), MONDAY + timedelta(hours=10)),
        (["2026-11-23T10:00Z", "2026-11-23"], MONDAY + timedelta(hours=10), MONDAY + timedelta(days=1)),
    ],
)
def test_the_hours_of_a_mission(given_: Any, start: datetime, end: datetime) -> None:
    assert Hours.read(given_) == Hours(start, end)


@pytest.mark.parametrize(
    "given_",
    ["tomorrow", "10:00", "2026-11-23T10:00", "2026-13-01", "0001-01-01", "x" * 500, 5, [], ["2026-11-23"] * 3,
     ["2026-11-24", "2026-11-23T00:00Z"], ["2026-11-23", "2027-11-23"], ["2026-11-23", 5]],
)  # fmt: skip
def test_hours_that_are_none_are_refused(given_: Any) -> None:
    with pytest.raises(TimeError):
        Hours.read(given_)
