"""Rehearsal of a plan: when each vehicle leaves, and what the fleet must keep.

    from gcsplan import load_mission, plan
    from gcsplan.app.rehearse import rehearse

    result = rehearse(plan(load_mission("fleet.yaml")))
    print(result.safe, result.p95_s, result.order_flown)

Errors are those of `gcsplan.errors`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gcsplan.app.parallel.executor import Executor, Inline, executor
from gcsplan.app.parallel.sites import Site, site_of
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.app.upload.on_board import settings_of_plan
from gcsplan.check.verdict import WHOLE_S
from gcsplan.errors import UsageError
from gcsplan.mavlink.mission.parameter_file import read_param_file
from gcsplan.mavlink.mission.parameter_list import off, vehicle_on_board
from gcsplan.mavlink.mission.return_parameters import return_on_board_m
from gcsplan.sim.outcome import Rehearsal, RehearsalPart, Tally, Terms

if TYPE_CHECKING:
    from gcsplan.mission_file import MissionFile
    from gcsplan.sim.flight.wind import Weather
    from gcsplan.sim.rehearsal import Flights, RunBlock

__all__ = [
    "Rehearsal",
    "RehearsalPart",
    "Terms",
    "late_of",
    "parameters_of",
    "parts_of",
    "rehearse",
    "rehearse_in_sitl",
    "seats_of",
    "terms_of",
    "weather_of",
]


MOST_LATE_S = 86_400.0
"""Most seconds by which a vehicle may depart late in a rehearsal."""


def parts_of(planned: Plan) -> list[RehearsalPart]:
    """The part of each vehicle, with its departure and arrival in the fleet's time table."""
    return [_part(planned, v) for v in planned.vehicles]


def _part(planned: Plan, v: VehiclePlan) -> RehearsalPart:
    request = v.request
    leaves = request.end == "none"
    slot = None if planned.fleet is None else planned.fleet.slot(v.name)
    return RehearsalPart(
        request.vehicle, v.mission, v.verdict,
        depart_s=0.0 if slot is None else slot.depart_s,
        arrive_s=v.verdict.arrive_s if slot is None else slot.arrive_s,
        rtl_rel_home_m=request.rtl_rel_home_m,
        airborne=leaves and request.start_amsl_m is not None,
        leaves=leaves,
        window_s=v.verdict.arrive_window_s(slot), depart_window_s=request.depart_window_s,
    )  # fmt: skip


def terms_of(planned: Plan) -> Terms:
    """The requirements of the mission file on the fleet: the order of a sequence, the times between arrivals, and the
    separation."""
    arrival = planned.source.arrival
    if arrival is None or len(planned.vehicles) < 2:
        return Terms()
    order = planned.fleet.order if planned.fleet is not None and arrival.mode == "sequence" else ()
    pad_clear_s = math.inf if arrival.pad_clear_s is None else arrival.pad_clear_s
    intervals_s: tuple[float, ...] = ()
    window_s = arrival.window_s
    if planned.fleet is not None and planned.fleet.intervals:
        intervals_s = tuple(interval.requested_s for interval in planned.fleet.intervals) if order else ()
        window_s += 0.0 if planned.fleet.start_utc is None else WHOLE_S
    together = arrival.mode == "together"
    return Terms(order, arrival.separation_m, pad_clear_s, window_s, intervals_s, together)


def weather_of(
    source: MissionFile, wind_m_s: float | None, from_deg: float | None, gusts_m_s: float, noise_m: float
) -> Weather:
    """The given wind and gusts; without any of them, the set of winds that the mission declares. Raises InputError."""
    from gcsplan.sim.flight.wind import Weather

    if wind_m_s is None and from_deg is None and not gusts_m_s and not source.wind.still:
        start_s = 0.0 if source.departure is None else source.departure.timestamp()
        return Weather(noise_m=noise_m, declared=source.wind, start_s=start_s)
    return Weather(wind_m_s or 0.0, from_deg, gusts_m_s, noise_m)


def rehearse(  # noqa: PLR0913 - options by name, each with a default
    planned: Plan,
    *,
    weather: Weather | None = None,
    runs: int = 1,
    seed: int = 1,
    airspeed_m_s: float | None = None,
    parameters: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
    late_s: Mapping[str, float] = MappingProxyType({}),
    progress: Callable[[int, int], None] | None = None,
    jobs: int | None = 1,
    cluster: Any = None,
    watch: Callable[[Executor], None] | None = None,
) -> Rehearsal:
    """Upload to one simulated vehicle per UAV, fly all of them in simulated time, and judge; see `sim.rehearsal`.

    ``jobs`` processes or the workers of ``cluster`` share the runs (`executor`); a few runs are flown in this process.
    The result does not depend on it. ``parameters``: by vehicle, the parameters that it flies with in place of
    the assumed ones; the plan stays. ``late_s``: by vehicle, how much later than planned it departs. ``watch`` is
    called with the executor before the work begins.
    """
    from gcsplan.sim.rehearsal import concluded, different, flown, prepared

    flights = prepared(
        [_set_up(part, parameters.get(name := part.vehicle.name, {}), late_s.get(name, 0.0))
         for part in parts_of(planned)], planned.world,
        terms_of(planned), weather=weather, runs=runs, seed=seed, airspeed_m_s=airspeed_m_s,
    )  # fmt: skip
    count = different(flights, runs)
    tallies: dict[int, Tally] = {}
    with executor(jobs, cluster if count > 1 else None, pieces=count, piece_s=flights.run_s) as workers:
        if watch is not None:
            watch(workers)
        here = isinstance(workers, Inline)
        blocks = flights.blocks(count, workers.count)
        done = (
            ((k, flown(flights, planned.world, block)) for k, block in enumerate(blocks))
            if here
            else workers.each(block_of, (site_of(planned.source), flights), blocks)
        )
        for number, tally in done:
            tallies[number] = tally
            if progress is not None:
                progress(sum(blocks[k][1] for k in tallies), runs)
    return _outside(planned, parameters, concluded(flights, runs, [tallies[k] for k in range(len(blocks))]))


def _outside(planned: Plan, parameters: Mapping[str, Mapping[str, float]], result: Rehearsal) -> Rehearsal:
    """``result``, where parameters that no simulated flight shows, or that end it, are parts not flown."""
    vehicles, notes = [], list(result.notes)
    for v, flown in zip(planned.vehicles, result.vehicles, strict=True):
        found = off(settings_of_plan(v, None), parameters.get(v.name, {}), v.mission.autopilot)
        notes += [o.note().of(vehicle=v.name) for o in found if o.setting.matters in ("time", "report")]
        others = tuple(o.note() for o in found if o.setting.matters not in ("time", "report"))
        vehicles.append(replace(flown, not_flown=(*flown.not_flown, *others)) if others else flown)
    return replace(result, vehicles=tuple(vehicles), notes=tuple(notes))


def _set_up(part: RehearsalPart, values: Mapping[str, float], late_s: float) -> RehearsalPart:
    """``part``, flown as these parameters make the vehicle fly, and so late."""
    part = replace(part, late_s=late_s)
    if not values:
        return part
    returns_m = return_on_board_m(values)
    return replace(
        part, vehicle=vehicle_on_board(part.vehicle, part.mission, values),
        rtl_rel_home_m=part.rtl_rel_home_m if returns_m is None or part.rtl_rel_home_m is None else returns_m,
    )  # fmt: skip


def late_of(words: Sequence[str], names: Sequence[str]) -> dict[str, float]:
    """Vehicle to seconds from the ``--late`` words NAME=SECONDS. Raises UsageError."""
    found: dict[str, float] = {}
    for word in words:
        name, _, text = word.partition("=")
        try:
            seconds = float(text)
        except ValueError:
            seconds = math.nan
        if not 0.0 <= seconds <= MOST_LATE_S:
            raise UsageError(f"--late {word}: give NAME=SECONDS, from 0 to {MOST_LATE_S:.0f}, such as uav2=40")
        if name not in names:
            raise UsageError(f"--late {word}: the mission file has no vehicle {name!r}; it has {', '.join(names)}")
        if name in found:
            raise UsageError(f"--late is given twice for {name}; keep one")
        found[name] = seconds
    return found


def parameters_of(words: Sequence[str], planned: Plan) -> dict[str, Mapping[str, float]]:
    """Parameters by vehicle from the ``--params`` words: a file or a vehicle's URL, for all, or NAME= it for one.

    From a URL each vehicle is read by its system id. Raises InputError, UsageError, LinkError.
    """
    from gcsplan.app.upload.run import open_link
    from gcsplan.mavlink.link.session.session import read_vehicle

    sysids = {v.name: v.request.vehicle.sysid for v in planned.vehicles}
    found: dict[str, Mapping[str, float]] = {}
    for word in words:
        name, equals, where = word.partition("=")
        if equals and name not in sysids:
            known = ", ".join(sysids)
            raise UsageError(f"--params {word}: the mission file has no vehicle {name!r}; it has {known}")
        source = where if equals else word
        for one in [name] if equals else sysids:
            if re.match(r"(udp|tcp|/dev/|COM\d)", source) and not Path(source).is_file():
                with open_link(source) as link:
                    found[one] = read_vehicle(link, sysids[one])[2]
            else:
                found[one] = read_param_file(Path(source))
    return found


def block_of(shared: tuple[Site, Flights], block: RunBlock) -> Tally:
    """Fly and judge a block of runs, in whatever process, over the terrain that it reads itself."""
    from gcsplan.sim.rehearsal import flown

    site, flights = shared
    tally = flown(flights, site.read()[1], block)
    if block[0]:
        tally.flown = ()  # a report shows the flights of the first run alone
    return tally


def rehearse_in_sitl(
    planned: Plan,
    *,
    binary: Path | None = None,
    addresses: Mapping[str, str] | None = None,
    speedup: float | None = None,
    i_know: bool = False,
    report: Callable[[str, str], None] | None = None,
    weather: Weather | None = None,
    seed: int = 1,
) -> Rehearsal:
    """Rehearse with real ArduPilot SITL; starts one of ``binary`` for each vehicle without one of ``addresses``.

    ``binary``: a program, or a folder with arducopter and arduplane; its instances have the mission's terrain. Raises
    UsageError if a vehicle has neither. See `sim.sitl` for the other arguments.
    """
    from gcsplan.sim.sitl.flights import rehearse_sitl, require_here
    from gcsplan.sim.sitl.instances import SPEEDUP, sitl_instances

    parts, seats = parts_of(planned), dict(addresses or {})
    if any(part.mission.leaves_s is not None for part in parts):
        raise UsageError(
            "gates on the way open at times of the day, which a simulator at its own pace does not keep: rehearse "
            "without --sitl, or without arrival.gates"
        )
    if not i_know:
        require_here(list(seats.values()))
    without = [p for p in parts if p.vehicle.name not in seats] if binary is not None else []
    with ExitStack() as stack:
        if binary is not None:
            faster = SPEEDUP if speedup is None else speedup
            seats |= stack.enter_context(sitl_instances(binary, without, speedup=faster, world=planned.world))
        return rehearse_sitl(
            parts, planned.world, terms_of(planned), seats, i_know=i_know, report=report, weather=weather, seed=seed
        )


def seats_of(words: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Vehicle to URL from the ``--sitl`` words: NAME=URL, or one URL alone for a single vehicle. Raises UsageError."""
    found: dict[str, str] = {}
    for word in words:
        name, equals, url = word.partition("=")
        if not equals and len(names) == 1:
            name, url = names[0], word
        elif not equals:
            raise UsageError(f"--sitl {word}: give NAME=URL for each of {', '.join(names)}")
        if name not in names:
            raise UsageError(f"--sitl {word}: the mission file has no vehicle {name!r}; it has {', '.join(names)}")
        if found.setdefault(name, url) is not url:
            raise UsageError(f"--sitl {word}: {name} has the address {found[name]} already")
    return found
