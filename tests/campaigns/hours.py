"""Times of zones and flights against a clock that goes minute by minute.

    python -m tests.campaigns.hours --seconds 120 [--seed 1] [--inputs N]

An input is a zone over a mission's start with random periods as its format publishes them (ED-269, ED-318, openAIP,
OpenAir: days alone, schedules without a beginning or an end, nights, 24:00, time zones, also two in one line, hours of
the sun, times without a zone, members that nobody knows; around a leap day, the turn of the year, and days on which
clocks change), a mission file with a random `at`, and a file of items with holds and loiters, waits for a time of day
and loops, some without end, that stays in the zone. The clock here shares no code with the reader: it finds for every
minute whether the zone applies in it, and it knows how long the flight lasts at least, by its holds and its distance at
the fastest speed.

A fault is a zone that is not used although it applies in a minute of the hours, or can never apply; and a verdict
`safe` of a flight during which it applies. Exits with 1 and prints the seed if there is one; ``--seed S --inputs 1``
repeats it.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from gcsplan.app.check.files import check_mission
from gcsplan.errors import InputError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import RELATIVE, Home, Mission, MissionItem
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.vehicle import Autopilot
from tests.support import zone_files

WEEK = ("MON", "TUE", "WED", "THU", "FRI", "SAT", "SUN")
MONDAYS = [datetime(*day, tzinfo=UTC) for day in ((2026, 11, 23), (2028, 2, 28), (2026, 12, 28), (2027, 3, 22))]
"""Weeks: a plain one, with 29 February, with the turn of the year, and in which many clocks change."""
MINUTE, DAY = timedelta(minutes=1), timedelta(days=1)
OFFSETS = {"Z": 0, "+02:00": 120, "-10:00": -600, "+14:00": 840, "+05:30": 330, "-03:00": -180}
"""Minutes by which clocks are ahead of UTC."""

LAT, LON = 46.03, 14.49
SQUARE = [(14.3, 45.9), (14.7, 45.9), (14.7, 46.2), (14.3, 46.2)]
FASTEST_M_S = 15.0
MAX_FOUND = 20

Line = dict[str, Any]
Period = dict[str, Any]


def moment(rng: random.Random, monday: datetime) -> tuple[str, datetime, datetime]:
    """A text, and the moment that it means as a beginning, and as an end."""
    day = monday + DAY * rng.randint(0, 8)
    if rng.random() < 0.4:
        return f"{day:%Y-%m-%d}", day, day + DAY
    if rng.random() < 0.05:
        zone = rng.choice([*OFFSETS])
        at = day + DAY - timedelta(minutes=OFFSETS[zone])
        return f"{day:%Y-%m-%d}T24:00{zone}", at, at
    at = day + timedelta(minutes=15 * rng.randint(0, 95))
    zone = rng.choice([*OFFSETS])
    local = at + timedelta(minutes=OFFSETS[zone])
    return f"{local:%Y-%m-%dT%H:%M}{zone}", at, at


def clock(rng: random.Random, zone: str) -> tuple[str, int]:
    """A time of day as text, and in minutes."""
    minutes = 15 * rng.randint(0, 96)  # 24:00, too
    return f"{minutes // 60:02}:{minutes % 60:02}{zone}", minutes


def line(rng: random.Random) -> tuple[Line, tuple[Any, ...] | None]:
    """A line of a schedule as published, and (days, start and end in minutes, their offsets); empty if the sun sets the
    times, and None if nobody can understand it."""
    days = rng.sample(WEEK, rng.randint(1, 3)) if rng.random() < 0.8 else ["ANY"]
    own = rng.choice([*OFFSETS])
    other = rng.choice([*OFFSETS]) if rng.random() < 0.2 else own
    given: Line = {"day": days}
    start = end = None
    if rng.random() < 0.8:
        given["startTime"], start = clock(rng, own)
    if rng.random() < 0.8 or start is None:
        given["endTime"], end = clock(rng, other)
    at_start = own if start is not None else other
    at_end = other if end is not None else own
    numbers = set(range(7)) if days == ["ANY"] else {WEEK.index(d) for d in days}
    if (odd := rng.random()) < 0.1:
        if odd < 0.03:
            return given | {"endEvent": "EECT"}, ()
        slips: list[Line] = [{"endDay": ["SUN"]}, {"day": [*days, "HOL"]}, {"startTime": "06:00"}, {"endTime": "EECT"}]
        return given | rng.choice(slips), None
    return given, (numbers, start or 0, 1440 if end is None else end, OFFSETS[at_start], OFFSETS[at_end])


def period(rng: random.Random, monday: datetime, *, scheduled: bool) -> tuple[Period, tuple[Any, ...] | None]:
    """A period as ED-269 publishes it, and (start or None, end or None, lines); None if it is not to be understood."""
    given: Period = {"permanent": "NO"} if rng.random() < 0.5 else {}
    start = end = None
    if rng.random() < 0.7:
        given["startDateTime"], start, _ = moment(rng, monday)
    if rng.random() < 0.7:
        given["endDateTime"], _, end = moment(rng, monday)
    lines = [line(rng) for _ in range(rng.randint(1, 2))] if scheduled and rng.random() < 0.7 else []
    if lines:
        given["schedule"] = [one for one, _ in lines]
    rule = [numbers for _, numbers in lines]
    if None in rule:
        return given, None
    if start is not None and rng.random() < 0.03:
        return given | {"startDateTime": given["startDateTime"][:10] + "T10:00"}, None
    return given, (start, end, [] if () in rule else rule)


def spans(lines: list[Any], first: datetime, last: datetime) -> Iterator[tuple[datetime, datetime]]:
    """When the lines of a schedule apply from three days before ``first``; ValueError if one contradicts itself."""
    for days, start, end, ahead, ahead_end in lines:
        day = first.replace(hour=0, minute=0) - 3 * DAY
        while day <= last + 3 * DAY:
            if day.weekday() in days:
                begins = day + timedelta(minutes=start - ahead)
                ends = day + timedelta(minutes=end - ahead_end)
                if (end > start) != (ends > begins):
                    raise ValueError("its end is before its beginning by one clock only")
                if end <= start:
                    ends += DAY
                if ends <= begins:
                    raise ValueError("its end is never after its beginning")
                yield begins, ends
            day += DAY


def applies(rule: tuple[Any, ...], minute: datetime) -> bool:
    """Whether a period applies in a minute."""
    start, end, lines = rule
    if (start is not None and minute < start) or (end is not None and minute > end):
        return False
    return not lines or any(begins <= minute <= ends for begins, ends in spans(lines, minute, minute))


def possible(rule: tuple[Any, ...] | None) -> bool:
    """Whether a period can apply at all, and can be understood."""
    if rule is None:
        return False
    start, end, lines = rule
    if start is not None and end is not None and start > end:
        return False
    try:
        found = list(spans(lines, MONDAYS[0], MONDAYS[0] + 9 * DAY))
    except ValueError:
        return False
    if not lines or start is None or end is None:
        return True
    return any(begins <= end and ends >= start for begins, ends in spans(lines, start, end)) and bool(found)


def zone(rng: random.Random, monday: datetime, folder: Path) -> tuple[str, Path, list[tuple[Any, ...] | None]]:
    """The name of a format, a file with one zone, and its periods; none means always."""
    form = rng.choice(["ed269", "ed269", "ed318", "openaip", "openair"])
    made = [period(rng, monday, scheduled=form.startswith("ed")) for _ in range(rng.randint(1, 2))]
    if form == "openaip":
        made = made[:1]
    file = zone_files.WRITERS[form](folder, [[SQUARE]])
    text = file.read_text(encoding="utf-8")
    if form == "openair":
        ends = [[p.get(key, "NONE") for key in ("startDateTime", "endDateTime")] for p, _ in made]
        file.write_text(text + "".join(f"\nAA {a}/{b}" for a, b in ends), encoding="utf-8")
        return form, file, [rule for _, rule in made]
    whole = json.loads(text)
    if form == "ed269":
        whole["features"][0]["applicability"] = [p for p, _ in made]
    elif form == "ed318":
        whole["features"][0]["properties"]["limitedApplicability"] = [p for p, _ in made]
    else:
        span = made[0][0]
        whole["items"][0] |= {"activeFrom": span.get("startDateTime"), "activeUntil": span.get("endDateTime")}
    file.write_text(json.dumps(whole), encoding="utf-8")
    return form, file, [rule for _, rule in made]


def flight(rng: random.Random) -> tuple[tuple[MissionItem, ...], float | None]:
    """The items of a flight, and how long it lasts at least, s; None without end."""

    def item(command: int, *params: float, away: float = 0.0, up: float = 60.0) -> MissionItem:
        p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
        place = round((LAT + away) * 1e7), round(LON * 1e7)
        return MissionItem(command, RELATIVE, (p1, p2, p3, p4), *place, up)

    items, lasts_s, away, held_s = [item(cmd.TAKEOFF)], 0.0, 0.0, 0.0
    for _ in range(rng.randint(1, 3)):
        hold_s = rng.choice([0.0, 0.0, 60.0, 1800.0, 7000.0, 30000.0])
        before, away = away, rng.uniform(0.001, 0.01)
        timed = cmd.LOITER_TIME if rng.random() < 0.5 else cmd.WAYPOINT
        items.append(item(timed, hold_s, away=away))
        held_s += hold_s
        lasts_s += hold_s + 111_000.0 * abs(away - before) / FASTEST_M_S
    odd = rng.random()
    if odd < 0.05:  # until a time of day
        items.append(MissionItem(cmd.DELAY, RELATIVE, (-1.0, 18.0, 0.0, 0.0), 0, 0, 0.0))
        lasts_s = math.inf
    elif odd < 0.15:
        rounds = rng.choice([-1, 1, 3])
        items.append(MissionItem(cmd.DO_JUMP, RELATIVE, (2.0, float(rounds), 0.0, 0.0), 0, 0, 0.0))
        lasts_s = math.inf if rounds < 0 else lasts_s + rounds * held_s
    ending = rng.choice(["land", "land", "rtl", "loiter", "none"])
    if ending == "land":
        items.append(item(cmd.LAND, away=away, up=0.0))
    elif ending == "rtl":
        items.append(MissionItem(cmd.RTL, RELATIVE, (0.0,) * 4, 0, 0, 0.0))
    elif ending == "loiter":
        items.append(item(cmd.LOITER_UNLIM, away=away))
    return tuple(items), lasts_s if ending in ("land", "rtl") and lasts_s < math.inf else None


def mission(file: Path, at: Any) -> MissionFile:
    """A mission over flat ground with the zones of a file."""
    vehicle = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, FASTEST_M_S],
               "start": [LAT, LON], "goal": [LAT + 0.01, LON], "lean_angle_deg": 45}  # fmt: skip
    return load_mission({
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 20}, "at": at,
        "vehicles": [vehicle], "no_fly": [{"file": str(file)}],
    })  # fmt: skip


def attack(seed: int, folder: Path) -> tuple[str, list[str]]:
    """Judge the input of that seed; how it ended, and the faults."""
    rng = random.Random(seed)
    monday = rng.choice(MONDAYS)
    form, file, periods = zone(rng, monday, folder)
    text, first, _ = moment(rng, monday)
    last = first + (DAY if len(text) == 10 else timedelta(hours=2))
    at: Any = text
    if rng.random() < 0.6:
        last = first + timedelta(minutes=rng.choice([1, 30, 120, 600, 3000]))
        at = [text, f"{last:%Y-%m-%dT%H:%MZ}"]
    always = any(rule == (None, None, []) for rule in periods) or not all(map(possible, periods))
    count = int((last - first) / MINUTE) + 1
    understood = [rule for rule in periods if rule is not None]
    meets = always or any(applies(rule, first + i * MINUTE) for i in range(count) for rule in understood)
    named = f"seed {seed} ({form})"
    try:
        source = mission(file, at)
    except InputError as why:
        if all("inside the no-fly zone" in p.message for p in why.problems):
            return "always" if always else "used" if meets else "used without need", []
        return f"refused: {why.problems[0].message[:60]}", []
    if meets:
        return "left out", [f"{named}: at {at}: the zone is left out, and applies"]
    items, lasts_s = flight(rng)
    home = Home.at(LAT, LON, 100.0)
    verdict = check_mission(source, Mission(Autopilot.ARDUCOPTER, home, items), "uav1").verdict
    if verdict.safe is not True:
        return ("left out, unsafe" if verdict.safe is False else "left out, not judged"), []
    until = first + timedelta(seconds=30 * 86400 if lasts_s is None else lasts_s)
    minutes = int((until - first) / MINUTE) + 1
    if lasts_s is None or any(applies(rule, first + i * MINUTE) for i in range(minutes) for rule in understood):
        lasts = "has no end" if lasts_s is None else f"lasts {lasts_s:.0f} s"
        return "safe", [f"{named}: at {at}: safe, and the zone applies during the flight, which {lasts}"]
    return "left out, safe", []


def main() -> int:
    """Run the campaign; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--inputs", type=int, default=10**9)
    args = parser.parse_args()
    until, seed = time.monotonic() + args.seconds, args.seed
    found: list[str] = []
    ended: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        while seed - args.seed < args.inputs and time.monotonic() < until and len(found) < MAX_FOUND:
            how, faults = attack(seed, Path(folder))
            ended[how] += 1
            found += faults
            seed += 1
    print(f"{seed - args.seed} inputs, {len(found)} faults")
    for how, count in ended.most_common():
        print(f"  {how}: {count}")
    print(*found, sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
