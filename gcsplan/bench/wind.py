"""Rehearsed flights in declared winds: arrivals inside the windows of the plan, and the planned energies.

Missions of copters and fixed wings over flat ground, each with another wind of one of `WIND_KINDS` (forecasts too),
are planned, uploaded to simulated vehicles and flown `RUNS` times each, in winds and gusts drawn from what they
declare. Then missions are flown in winds beyond these: each such flight arrives inside its window all the same, or is
named as a violation.

Fleets of 2 to 8 vehicles, copters and wings mixed, arrive in sequence in such winds. Counted are the runs in which the
order, every interval up to `window_s`, and the separation are kept. A plan that does not say that its time table holds
in still air alone, and whose fleet loses one of them, is a fault.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.plan.model import Plan
from gcsplan.app.rehearse import rehearse, weather_of
from gcsplan.errors import InputError, NoMission
from gcsplan.mission_file import load_mission
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Rehearsal

RUNS = 20
"""Flights of each mission."""
WIND_KINDS = (
    "constant", "range", "up to", "levels", "forecast", "constant, varying", "range, varying", "up to, varying",
    "forecast, varying",
)  # fmt: skip
TIMES_STRONGER = 1.5, 2.0
"""How many times stronger than the declared wind one beyond it blows."""
MOST_FLIGHTS = 100_000
MIDDLE_DEG = 36.6, -84.3
FORECAST_HOURS = [f"2026-11-28T{hour:02d}:00" for hour in range(9, 15)]
FORECAST_AGL_M = 10, 80, 120
BATTERY_J = 1e7
MOST_REASONS = 20
"""Most faults, and refusals, that a report in words has."""
RUNS_OF_FLEET = 5
GATES = (1, 2, 3, "auto")
DEPARTURE = datetime(2026, 11, 28, 10, 0, 0, tzinfo=UTC)
"""The common start of a fleet with gates, which is within the forecasts."""
LANES_APART_DEG = 0.008
"""Distance of the starts, and of the goals, of neighbours in a fleet: 710 m or more, as wings circle at their goals."""
NotPlanned = tuple[str, str, str]
"""Which mission is refused, the kind of the reason, and the reason in words."""
ENERGY_SLACK = 1.002
"""Simulated motion and planned motion take the same energy up to this factor in still air."""


def run(
    flights: int = 1000, beyond: int = 200, *, seed: int = 1, tell: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """Fly; ``tell`` gets a line from time to time. Raises InputError for a number out of range."""
    if not 1 <= flights <= MOST_FLIGHTS or not 0 <= beyond <= MOST_FLIGHTS:
        raise InputError(f"give 1 to {MOST_FLIGHTS} flights and at most as many beyond, not {flights} and {beyond}")
    rows: dict[str, Counter[str]] = {}
    refusals: list[NotPlanned] = []
    faults: list[str] = []
    outside: Counter[str] = Counter()
    number = flown = blown = 0
    while flown < flights:
        number += 1
        if number > 10 * flights + 100:
            raise InputError(f"seed {seed}: too few missions can be planned")
        with TemporaryDirectory() as folder:
            kind, document = mission_of(seed, number, Path(folder))
            named = f"seed {seed}, mission {number} ({kind})"
            planned = _planned(document, named, refusals)
        if planned is None:
            continue
        runs = min(RUNS, flights - flown)
        result = rehearse(planned, weather=weather_of(planned.source, None, None, 0.0, 0.0), runs=runs, seed=number)
        flown += runs
        row = rows.setdefault(f"{document['vehicles'][0]['name']}, {kind}", Counter())
        faults += _count(row, planned, result, runs, named)
        if blown < beyond:
            blown += _beyond(planned, outside, min(RUNS, beyond - blown), number, faults)
        if tell is not None and number % 10 == 0:
            tell(f"{flown} of {flights} flights, {len(faults)} faults")
    return {
        "flights": flown, "beyond": blown, "seed": seed, "missions": number, **_refused(refusals),
        "kinds": {kind: dict(row) for kind, row in sorted(rows.items())}, "beyond_flights": dict(outside),
        "faults": faults,
    }  # fmt: skip


def run_fleets(fleets: int, *, seed: int = 1, tell: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Fly fleets; ``tell`` as in `run`. Raises InputError for a number out of range."""
    if not 1 <= fleets <= MOST_FLIGHTS:
        raise InputError(f"give 1 to {MOST_FLIGHTS} fleets, not {fleets}")
    rows: dict[str, Counter[str]] = {}
    refusals: list[NotPlanned] = []
    faults: list[str] = []
    for number in range(1, fleets + 1):
        with TemporaryDirectory() as folder:
            kind, document = fleet_of(seed, number, Path(folder))
            named = f"seed {seed}, fleet {number} ({kind})"
            planned = _planned(document, named, refusals, DEPARTURE if "gates" in document["arrival"] else None)
        if planned is None:
            continue
        weather = weather_of(planned.source, None, None, 0.0, 0.0)
        result = rehearse(planned, weather=weather, runs=RUNS_OF_FLEET, seed=number)
        kept = {
            "order": result.order_kept_runs, "intervals": result.intervals_kept_runs,
            "separation": result.separation_kept_runs,
        }  # fmt: skip
        still = any(note.code == "schedule_in_still_air" for note in planned.notes)
        row = rows.setdefault(kind, Counter())
        row.update(fleets=1, runs=RUNS_OF_FLEET, in_still_air=still, held=min(kept.values()) == RUNS_OF_FLEET, **kept)
        if not still:
            lost = [f"{what} kept in {count} of {RUNS_OF_FLEET} runs" for what, count in kept.items()]
            faults += [f"{named}: {words}" for words, n in zip(lost, kept.values(), strict=True) if n < RUNS_OF_FLEET]
        if tell is not None and number % 10 == 0:
            tell(f"{number} of {fleets} fleets, {len(faults)} faults")
    return {
        "fleets": fleets, "seed": seed, **_refused(refusals), "faults": faults,
        "kinds": {kind: dict(row) for kind, row in sorted(rows.items())},
    }  # fmt: skip


def _planned(
    document: dict[str, Any], named: str, refusals: list[NotPlanned], start: datetime | None = None
) -> Plan | None:
    """The plan of a mission that passes, with a common start or without; None, and why, of any other."""
    try:
        planned = plan(load_mission(document, departure=start), gate_utc=start)
    except NoMission as refusal:
        refusals.append((named, refusal.reason, str(refusal)))
        return None
    for v in planned.vehicles:
        if v.verdict.safe is not True:
            found, notes = v.verdict.findings, v.verdict.not_judged
            words = "; ".join(str(note) for note in found or notes)
            refusals.append((named, found[0].kind if found else "not judged", f"{v.name}: {words}"))
            return None
    return planned


def _refused(refusals: Sequence[NotPlanned]) -> dict[str, Any]:
    """How many are refused for each kind of reason, and the reason of each."""
    return {
        "refused": dict(Counter(kind for _, kind, _ in refusals)),
        "refusals": [f"{named}: {words}" for named, _, words in refusals],
    }


def _count(row: Counter[str], planned: Plan, result: Rehearsal, runs: int, named: str) -> list[str]:
    """Add the flights of a mission to its kind's row; the faults."""
    inside, _ = result.inside_windows or (0, 0)
    row.update(missions=1, flights=runs, inside=inside)
    faults = [f"{named}: {breach.note(runs)}" for breach in result.breaches if breach.kind in ("window", "arrival")]
    if result.inside_windows is None:
        faults.append(f"{named}: its plan has no window")
    verdict, percent = planned.vehicles[0].verdict, result.vehicles[0].battery_used_percent
    assert percent is not None
    took_j = 0.01 * percent * BATTERY_J
    if took_j > verdict.energy_j * ENERGY_SLACK:
        row["over_energy"] += 1
        faults.append(f"{named}: took {took_j / 1e3:.1f} kJ, planned are {verdict.energy_j / 1e3:.1f}")
    return faults


def _beyond(planned: Plan, outside: Counter[str], runs: int, seed: int, faults: list[str]) -> int:
    """Fly a mission in a wind beyond what it declares; how many flights."""
    wind = planned.source.wind
    times = TIMES_STRONGER[seed % len(TIMES_STRONGER)]
    result = rehearse(planned, weather=Weather(times * wind.most_m_s + 1.0), runs=runs, seed=seed)
    inside, _ = result.inside_windows or (0, 0)
    named = max((b.runs for b in result.breaches if b.kind == "window"), default=0)
    never = max((b.runs for b in result.breaches if b.kind == "arrival"), default=0)
    outside.update(inside=inside, named=named, never=never)
    if inside + named + never != runs:
        faults.append(f"mission {seed}: {runs} flights beyond its winds, {inside} inside, {named + never} named")
    return runs


def mission_of(seed: int, number: int, folder: Path) -> tuple[str, dict[str, Any]]:
    """The kind of the wind, and a mission file as read from YAML; a forecast is written into ``folder``."""
    rng = np.random.default_rng([seed, number])
    kind = WIND_KINDS[number % len(WIND_KINDS)]
    vehicle = _vehicle(rng, 1, MIDDLE_DEG)
    most = _most_m_s(rng, [vehicle])
    between = [round(0.5 * (a + b), 6) for a, b in zip(MIDDLE_DEG, vehicle["goal"], strict=True)]
    document = _document(rng, f"wind {number}", kind, most, [vehicle], folder)
    document["no_fly"] = [{"name": "between", "center": between, "radius_m": round(float(rng.uniform(100.0, 400.0)))}]
    return kind, document


def fleet_of(seed: int, number: int, folder: Path) -> tuple[str, dict[str, Any]]:
    """As `mission_of`, of a fleet that arrives in sequence: each flies beside its neighbour, to a goal of its own.

    `window_s` is half to twice what the wind makes of the slowest wing's time, so some fleets ask for too much. In
    every second fleet copters have gates, and cannot give up speed to keep their times.
    """
    rng = np.random.default_rng([seed, number, 1])
    kind = WIND_KINDS[number % len(WIND_KINDS)]
    turn, away_m = float(rng.uniform(0.0, 2.0 * math.pi)), float(rng.uniform(2000.0, 4500.0))
    vehicles = []
    for k in range(int(rng.integers(2, 9))):
        aside = k * LANES_APART_DEG
        start = (round(MIDDLE_DEG[0] - aside * math.cos(turn), 6), round(MIDDLE_DEG[1] + aside * math.sin(turn), 6))
        vehicles.append(_vehicle(rng, k + 1, start, turn, away_m))
    most_m_s = _most_m_s(rng, vehicles)
    document = _document(rng, f"fleet {number}", kind, most_m_s, vehicles, folder)
    window_s = round(max(2.0, float(rng.uniform(0.5, 2.0)) * _blown_s(vehicles, most_m_s, away_m)))
    document["arrival"] = {
        "mode": "sequence", "order": "best", "clock": "fleet", "separation_m": 50,
        "interval_s": window_s + round(float(rng.uniform(5.0, 60.0))), "window_s": window_s,
    }  # fmt: skip
    copters = [v for v in vehicles if v["autopilot"] == "arducopter"]
    if number % 2 and copters:
        kind = f"{kind}, gates"
        document["arrival"]["gates"] = GATES[int(rng.integers(len(GATES)))]
        for v in copters:
            v |= {"speed_m_s": [round(0.95 * v["speed_m_s"][1], 1), v["speed_m_s"][1]], "lean_angle_deg": 30}
    return kind, document


def _vehicle(
    rng: np.random.Generator, sysid: int, start_deg: tuple[float, float], turn: float | None = None,
    away_m: float = math.nan,
) -> dict[str, Any]:  # fmt: skip
    """A copter or a wing, to a goal in a direction and at a distance that are drawn, or given."""
    wing = bool(rng.random() < 0.5)
    speed = round(float(rng.uniform(16.0, 24.0) if wing else rng.uniform(5.0, 10.0)), 1)
    slowest = speed
    if turn is None:
        turn, away_m = float(rng.uniform(0.0, 2.0 * math.pi)), float(rng.uniform(2000.0, 4500.0))
    else:
        slowest = round(0.8 * speed, 1)
    goal = [
        round(start_deg[0] + away_m * math.sin(turn) / 111_000.0, 6),
        round(start_deg[1] + away_m * math.cos(turn) / 89_000.0, 6),
    ]
    vehicle: dict[str, Any] = {
        "name": f"{'wing' if wing else 'copter'}{'' if sysid == 1 else sysid}", "sysid": sysid,
        "autopilot": "arduplane" if wing else "arducopter", "start": list(start_deg), "goal": goal,
        "speed_m_s": [slowest, speed],
        "energy": {"battery_j": BATTERY_J, "reserve": 0.1, "horizontal_j_per_m": 100, "vertical_j_per_m": 120},
    }  # fmt: skip
    own = {"turn_radius_m": math.ceil(speed**2 / 3.0), "end": "loiter"} if wing else {"lean_angle_deg": 45}
    return vehicle | own


def _blown_s(vehicles: Sequence[dict[str, Any]], most_m_s: float, away_m: float) -> float:
    """About how much a wind changes the time of the slowest wing, s: what a user sees when he plans it alone."""
    slowest = min((v["speed_m_s"][1] for v in vehicles if v["autopilot"] == "arduplane"), default=math.inf)
    return away_m * most_m_s / slowest**2


def _most_m_s(rng: np.random.Generator, vehicles: Sequence[dict[str, Any]]) -> float:
    """The fastest wind of a mission, in which all of its vehicles can fly."""
    copters = any(v["autopilot"] == "arducopter" for v in vehicles)
    slowest = min((v["speed_m_s"][0] for v in vehicles if v["autopilot"] == "arduplane"), default=math.inf)
    return round(float(rng.uniform(1.0, min(0.35 * slowest, 6.0 if copters else 8.4))), 1)


def _document(
    rng: np.random.Generator, name: str, kind: str, most_m_s: float, vehicles: list[dict[str, Any]], folder: Path
) -> dict[str, Any]:
    document: dict[str, Any] = {
        "version": 1, "name": name, "terrain": {"flat_m": 300},
        "limits": {"min_agl_m": 60, "track_error_m": 10, "altitude_error_m": 8},
        "wind": _wind(rng, kind, most_m_s, folder), "vehicles": vehicles,
    }  # fmt: skip
    if "forecast" in document["wind"]:
        document["at"] = [f"{FORECAST_HOURS[1]}Z", f"{FORECAST_HOURS[-2]}Z"]
        for vehicle in vehicles:
            vehicle["end"] = "land"  # a flight without an end is beyond every forecast
    return document


def _wind(rng: np.random.Generator, kind: str, most_m_s: float, folder: Path) -> dict[str, Any]:
    """The keys of a wind of one of `WIND_KINDS`, with gusts in every second one."""
    first = round(float(rng.uniform(0.0, 359.0)))
    form, *varying = kind.split(", ")
    if form == "forecast":
        error_m_s = round(0.2 * most_m_s, 1)
        (folder / "wind.json").write_text(json.dumps(_forecast(rng, most_m_s - error_m_s, first)))
        wind: dict[str, Any] = {
            "forecast": str(folder / "wind.json"), "speed_error_m_s": error_m_s, "from_error_deg": 15,
        }  # fmt: skip
    elif form == "up to":
        wind = {"up_to_m_s": most_m_s}
    elif form == "levels":
        low = round(float(rng.uniform(0.0, most_m_s)), 1)
        wind = {"levels": [{"agl_m": 10, "speed_m_s": low, "from_deg": first},
                           {"agl_m": 120, "speed_m_s": most_m_s, "from_deg": (first + 40) % 360}]}  # fmt: skip
    else:
        ranges = form == "range"
        wind = {
            "speed_m_s": [round(0.5 * most_m_s, 1), most_m_s] if ranges else most_m_s,
            "from_deg": [first, (first + 60) % 360] if ranges else first,
        }
    gusts = {"gust_m_s": round(most_m_s + float(rng.uniform(0.5, 3.0)), 1)} if rng.random() < 0.5 else {}
    return wind | gusts | ({"varying": True} if varying else {})


def _forecast(rng: np.random.Generator, most_m_s: float, first_deg: float) -> dict[str, Any]:
    """A forecast as Open-Meteo returns it: winds that turn and freshen with the hours and with the height."""
    hourly: dict[str, list[Any]] = {"time": FORECAST_HOURS}
    for k, agl_m in enumerate(FORECAST_AGL_M):
        share = 0.6 + 0.2 * k
        hourly[f"wind_speed_{agl_m}m"] = (share * rng.uniform(0.3, 1.0, len(FORECAST_HOURS)) * most_m_s).tolist()
        turns_deg = np.cumsum(rng.uniform(-30.0, 30.0, len(FORECAST_HOURS))) + first_deg + 10.0 * k
        hourly[f"wind_direction_{agl_m}m"] = (turns_deg % 360.0).tolist()
    lat, lon = MIDDLE_DEG
    units = {name: "°" if "direction" in name else "m/s" for name in hourly if name != "time"}
    return {
        "latitude": lat, "longitude": lon, "utc_offset_seconds": 0, "hourly_units": {"time": "iso8601"} | units,
        "hourly": hourly,
    }  # fmt: skip


def report(result: dict[str, Any]) -> str:
    """The result in words."""
    inside = sum(row["inside"] for row in result["kinds"].values())
    refused = ", ".join(f"{count} {why}" for why, count in result["refused"].items()) or "none"
    lines = [
        f"{result['flights']} flights of {result['missions']} missions in declared winds, {inside} inside their "
        f"windows; missions refused: {refused}",
        "kind                            missions  flights  inside  over the plan's energy",
    ]
    lines += [
        f"{kind:<32}{row['missions']:>8}{row['flights']:>9}{row['inside']:>8}{row.get('over_energy', 0):>22}"
        for kind, row in result["kinds"].items()
    ]
    if beyond := result["beyond_flights"]:
        lines.append(
            f"{result['beyond']} flights beyond the declared winds: {beyond['inside']} inside all the same, "
            f"{beyond['named']} named as outside, {beyond['never']} named as never arriving"
        )
    return "\n".join([*lines, *_faults_and_refusals(result)])


def report_fleets(result: dict[str, Any]) -> str:
    """The result of `run_fleets` in words."""
    rows = result["kinds"].values()
    flown, held, runs = (sum(row[key] for row in rows) for key in ("fleets", "held", "runs"))
    kept = ", ".join(f"{what} in {sum(row[what] for row in rows)}" for what in ("order", "intervals", "separation"))
    refused = ", ".join(f"{count} {why}" for why, count in result["refused"].items()) or "none"
    lines = [
        f"{flown} of {result['fleets']} fleets were flown, {held} kept everything; of {runs} runs: {kept}; refused: "
        f"{refused}",
        "winds                      fleets  in still air alone  kept all  runs  order  intervals  separation",
    ]
    lines += [
        f"{kind:<26}{row['fleets']:>7}{row['in_still_air']:>20}{row['held']:>10}{row['runs']:>6}{row['order']:>7}"
        f"{row['intervals']:>11}{row['separation']:>12}"
        for kind, row in result["kinds"].items()
    ]
    return "\n".join([*lines, *_faults_and_refusals(result)])


def _faults_and_refusals(result: dict[str, Any]) -> list[str]:
    """Faults and refusals, `MOST_REASONS` of each at most."""
    lines = []
    for word, found in (("fault", result["faults"]), ("refused", result["refusals"])):
        lines += [f"{word}: {one}" for one in found[:MOST_REASONS]]
        if len(found) > MOST_REASONS:
            lines.append(f"{word}: {len(found) - MOST_REASONS} more (--json has all)")
    return lines
