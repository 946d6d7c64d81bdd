"""When a zone applies, and for which hours the mission is planned.

A zone is left out only if it certainly does not apply at any moment of the mission's hours. What is not understood, and
sunrise and sunset, count as always.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from typing import Any

from gcsplan.errors import Mistake, elements

ALONE = timedelta(hours=2)
"""How long the hours last if their beginning alone is stated."""

EARLIEST_LIFT_OFF = timedelta(minutes=30)
"""How long before a common start vehicles may leave the ground: they wait for it in the air."""

LONGEST_HOURS = timedelta(days=31)
DAY = timedelta(days=1)
_DATE = re.compile(r"\d{4}-\d{2}-\d{2}", re.ASCII)
_MOST_TIME_CHARACTERS = 40

_OF_PERIOD = ("permanent", "startDateTime", "endDateTime", "schedule")
_OF_LINE = ("day", "startTime", "endTime", "startEvent", "endEvent")

WEEK = ("MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")
HOURS_TO_GIVE = "2026-11-23T10:00Z, a day such as 2026-11-23 (UTC), or [from, to]"


class TimeError(ValueError):
    """A time cannot be read; the text says why."""


@dataclass(frozen=True, slots=True)
class Hours:
    """The hours for which a mission is planned, both ends included."""

    start: datetime
    end: datetime

    def __str__(self) -> str:
        last = f"{self.end:%H:%M}Z" if self.end.date() == self.start.date() else f"{self.end:%Y-%m-%d %H:%M}Z"
        return f"{self.start:%Y-%m-%d %H:%M}Z to {last}"

    @classmethod
    def read(cls, given: Any) -> Hours:
        """The hours of a mission's ``at``. Raises TimeError."""
        texts = given if isinstance(given, list) else [given]
        if not 1 <= len(texts) <= 2 or not all(isinstance(t, str) for t in texts):
            raise TimeError(f"must be {HOURS_TO_GIVE}")
        start, end = read_instant(texts[0]), read_end(texts[-1])
        if len(texts) == 1 and not _DATE.fullmatch(texts[-1].strip()):
            end += ALONE
        if not timedelta(0) < end - start <= LONGEST_HOURS:
            words = "the end must lie behind the start" if end <= start else f"give {LONGEST_HOURS.days} days at most"
            raise TimeError(f"{words}, given {' to '.join(t.strip()[:_MOST_TIME_CHARACTERS] for t in texts)}")
        return cls(start, end)

    @classmethod
    def around(cls, departure: datetime) -> Hours:
        """The hours of a mission with a common start at ``departure``."""
        return cls(departure - EARLIEST_LIFT_OFF, departure + ALONE)


def begins_with_day(given: Any) -> bool:
    """Whether an ``at`` that can be read begins with a day, without a time of day."""
    return _DATE.fullmatch(str(given[0] if isinstance(given, list | tuple) else given).strip()) is not None


def texts_of(at: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """The texts of an ``at`` that is given beside a mission: one, or from and to; ``FROM/TO`` is both."""
    if at is None:
        return None
    if isinstance(at, str):
        return tuple(part.strip() for part in at.split("/"))
    return elements("at", "at", at, str, HOURS_TO_GIVE)


def read_end(text: str) -> datetime:
    """The end of a period: as `read_instant`, but a day means all of it. Raises TimeError."""
    return read_instant(text) + (DAY if _DATE.fullmatch(text.strip()) else timedelta(0))


def read_instant(text: str) -> datetime:
    """A moment in UTC: a day (its first moment), or a day and a time with ``Z`` or an offset. Raises TimeError."""
    plain = text.strip()
    shown = repr(plain[:_MOST_TIME_CHARACTERS])
    if len(plain) > _MOST_TIME_CHARACTERS:
        raise TimeError(f"{shown}… is no time")
    last = re.fullmatch(r"(\d{4}-\d{2}-\d{2})T24:00(?::00(?:\.0+)?)?(Z|[+-]\d{2}:?\d{2})", plain, re.ASCII)
    try:
        moment = datetime.fromisoformat(f"{last[1]}T00:00{last[2]}" if last else plain)
        if last:
            moment += DAY
        if moment.tzinfo is None:
            if not _DATE.fullmatch(plain):
                raise TimeError(f"{shown} has no time zone; write Z behind it for UTC")
            moment = moment.replace(tzinfo=UTC)
        moment = moment.astimezone(UTC)
    except TimeError:
        raise
    except (ValueError, OverflowError):
        raise TimeError(f"{shown} is no time; write {HOURS_TO_GIVE}") from None
    if not 1900 <= moment.year <= 2999:  # far from where a day more or less does not exist
        raise TimeError(f"{shown} lies outside the years 1900 to 2999")
    return moment


@dataclass(frozen=True, slots=True)
class Daily:
    """Hours of some days of the week (0 is Monday): the beginning and the end as time from that day's midnight UTC."""

    days: frozenset[int]
    start: timedelta
    end: timedelta


@dataclass(frozen=True, slots=True)
class Period:
    """A time in which a zone applies; an end that is None is open, and without a schedule it applies throughout.

    Raises TimeError if it never applies, because it ends before it begins, or its schedule has no time in it: nobody
    publishes such a zone, so that something of it is not understood.
    """

    start: datetime | None = None
    end: datetime | None = None
    schedule: tuple[Daily, ...] = ()

    def __post_init__(self) -> None:
        if self.start is not None and self.end is not None and self.start > self.end:
            raise TimeError(f"it ends at {self.end:%Y-%m-%d %H:%M}Z, before it begins")
        lasts = None if self.start is None or self.end is None else Hours(self.start, self.end)
        if self.schedule and lasts is not None and not self.meets(lasts):
            raise TimeError(f"its schedule has no time from {lasts}")

    def meets(self, hours: Hours) -> bool:
        """Whether the zone may apply at some moment of the hours."""
        first = hours.start if self.start is None else max(self.start, hours.start)
        last = hours.end if self.end is None else min(self.end, hours.end)
        if first > last:
            return False
        if not self.schedule:
            return True
        midnight = first.replace(hour=0, minute=0, second=0, microsecond=0) - 2 * DAY  # times have offsets, and nights
        while midnight <= last + DAY:
            for daily in self.schedule:
                if midnight.weekday() not in daily.days:
                    continue
                end = daily.end if daily.end > daily.start else daily.end + DAY
                if midnight + daily.start <= last and midnight + end >= first:
                    return True
            midnight += DAY
        return False


ALWAYS = Period()


def read_periods(given: Any) -> tuple[tuple[Period, ...], str]:
    """The periods of ED-269's ``applicability`` and ED-318's ``limitedApplicability``, and what is not understood.

    No periods mean always, which is also what anything that is not understood means.
    """
    if given is None or given == []:
        return (), ""
    try:
        if not isinstance(given, list) or len(given) > 1000:
            raise TimeError("it is no list of periods")
        periods = tuple(_period(one) for one in given)
    except TimeError as why:
        return (), str(why)
    return (() if ALWAYS in periods else periods), ""


def _period(given: Any) -> Period:
    if not isinstance(given, dict):
        raise TimeError("a period is no object")
    permanent = given.get("permanent")
    if permanent not in (None, "YES", "NO"):
        raise TimeError(f"permanent {str(permanent)[:20]!r} is neither YES nor NO")
    if permanent == "YES":
        return ALWAYS
    _require_known(given, _OF_PERIOD, "a period")
    start, end = _moment(given.get("startDateTime")), _moment(given.get("endDateTime"), read_end)
    schedule = given.get("schedule")
    if schedule is None or schedule == []:
        return Period(start, end)
    if not isinstance(schedule, list) or len(schedule) > 1000:
        raise TimeError("the schedule is no list")
    daily = [_daily(one) for one in schedule]
    return Period(start, end, () if None in daily else tuple(d for d in daily if d is not None))


def _require_known(given: dict[str, Any], known: Sequence[str], what: str) -> None:
    """Raise TimeError for a member that the standard does not have: it may say that the zone applies at other times."""
    unknown = sorted(str(key)[:40] for key in given if key not in known)
    if unknown:
        raise TimeError(f"{unknown[0]!r} of {what} is not known")


def _moment(given: Any, read: Callable[[str], datetime] = read_instant) -> datetime | None:
    if given is None or given == "":
        return None
    if not isinstance(given, str):
        raise TimeError(f"{str(given)[:40]!r} is no time")
    return read(given)


def _daily(given: Any) -> Daily | None:
    """One line of a schedule; None if it depends on the sun, whose times are not computed."""
    day = given.get("day") if isinstance(given, dict) else None
    listed = [day] if isinstance(day, str) else day
    if not isinstance(listed, list) or not listed:
        raise TimeError("a line of a schedule has no days")
    _require_known(given, _OF_LINE, "a line of a schedule")
    if any(given.get(key) not in (None, "") for key in ("startEvent", "endEvent")):
        return None
    days: set[int] = set()
    for day in listed:
        if day not in (*WEEK, "ANY"):
            raise TimeError(f"{str(day)[:20]!r} is no day of the week")
        days |= set(range(7)) if day == "ANY" else {WEEK.index(day)}
    start, end = _of_day(given.get("startTime")), _of_day(given.get("endTime"))
    # Without a beginning it is the day's midnight, and without an end the next, in the time zone of the other one.
    offset = (start or end or (timedelta(0), timedelta(0)))[1]
    first, last = start or (timedelta(0), offset), end or (DAY, offset)
    line = Daily(frozenset(days), first[0] - first[1], last[0] - last[1])
    if (last[0] > first[0]) != (line.end > line.start) or line.end + DAY <= line.start:
        raise TimeError("a line of a schedule ends before it begins, in time zones that differ")
    return line


def _of_day(given: Any) -> tuple[timedelta, timedelta] | None:
    """The time since midnight, and the offset from UTC, of ``06:00Z``, ``00:00:00.00Z`` or ``08:00+02:00``."""
    if given is None or given == "":
        return None
    if not isinstance(given, str) or len(given) > _MOST_TIME_CHARACTERS:
        raise TimeError(f"{str(given)[:40]!r} is no time of day")
    text = given.strip()
    last = re.fullmatch(r"24:00(?::00(?:\.0+)?)?(Z|[+-]\d{2}:?\d{2})", text, re.ASCII)
    try:
        at = time.fromisoformat(f"00:00{last[1]}" if last else text)
    except ValueError:
        raise TimeError(f"{text[:40]!r} is no time of day") from None
    offset = at.utcoffset()
    if offset is None:
        raise TimeError(f"{text[:40]!r} has no time zone")
    whole = timedelta(hours=at.hour, minutes=at.minute, seconds=at.second, microseconds=at.microsecond)
    return whole + (DAY if last else timedelta(0)), offset


def apply_in(periods: Sequence[Period], hours: Hours | None) -> bool:
    """Whether a zone with these periods may apply in the hours; without hours, or without periods, it does."""
    return hours is None or not periods or any(p.meets(hours) for p in periods)


def hours_of(
    given: Any, departure: datetime | None, where: str, problems: list[Mistake],
    *, instead: Sequence[str] | None = None,
) -> Hours | None:  # fmt: skip
    """When a mission is flown: its ``at`` as ``given``, if it has one, or else the departure that the caller states.

    ``instead`` is an ``at`` from elsewhere, which counts in its place.
    """
    given, where = (given, where) if instead is None else (list(instead), "at")
    if given is None:
        return None if departure is None else Hours.around(departure)
    try:
        return Hours.read(given)
    except TimeError as why:
        problems.append(Mistake(where, str(why)))
        return None
