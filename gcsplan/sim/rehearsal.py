"""The rehearsal: missions are uploaded to simulated vehicles, flown as stored in simulated time, and judged.

The upload is the real one, over 127.0.0.1, so the vehicles fly what they stored, not what was intended. Every vehicle
departs at its departure offset. Times result from the simulated motion (`kinematics`, `mission_flight`), which shares
no code with their planning. Separation is judged on the flown paths, limits by the exact check of those paths.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.errors import GcsplanError, InputError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import FlownLanes, fly
from gcsplan.sim.flight.track import CommandedTrack, make_track
from gcsplan.sim.flight.wind import Weather
from gcsplan.sim.outcome import Rehearsal, RehearsalPart, Tally, Terms, energy_of
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.world.world import World

__all__ = [
    "Flights",
    "Rehearsal",
    "RehearsalPart",
    "RunBlock",
    "Terms",
    "concluded",
    "different",
    "flown",
    "prepared",
    "rehearse",
]

MOST_LANES = 240
"""Most vehicles, over all runs, that are simulated at once; this bounds the memory."""


@dataclass(frozen=True, eq=False, slots=True)
class Flights:
    """The data that all runs of a rehearsal share: the vehicles' parts, the tracks that they fly, and the weather."""

    parts: Sequence[RehearsalPart]
    terms: Terms
    tracks: Sequence[CommandedTrack]
    weather: Weather
    seed: int

    def blocks(self, runs: int, at_once: int) -> list[RunBlock]:
        """All runs in blocks for ``at_once`` processes; each keeps the bound of `MOST_LANES`."""
        size = max(1, min(MOST_LANES // len(self.parts), -(-runs // at_once)))
        return [(first, min(size, runs - first)) for first in range(0, runs, size)]

    @property
    def run_s(self) -> float:
        """Seconds of processor time that a run takes, about, in a block as large as they get."""
        flown_s = max(p.leaves_s + p.verdict.time_s for p in self.parts)
        most = max(1, MOST_LANES // len(self.parts))
        return LANE_S * len(self.parts) + STEPS_S * flown_s / most if math.isfinite(flown_s) else LANE_S


RunBlock = tuple[int, int]
"""The number of its first run, and how many runs it has."""

LANE_S, STEPS_S = 0.02, 2e-3
"""Seconds of processor time, about: to judge a vehicle in a run, and for each simulated second of a block."""


def rehearse(
    parts: Sequence[RehearsalPart],
    world: World,
    terms: Terms,
    *,
    weather: Weather | None = None,
    runs: int = 1,
    seed: int = 1,
    airspeed_m_s: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rehearsal:
    """Upload, fly and judge. ``progress(done, runs)`` is called after each block of runs.

    ``airspeed_m_s``: highest airspeed of every vehicle, None: a little more than its own fastest cruise (`kinematics`).
    In still air all runs are the same, so only one is flown. Raises what an upload raises, and InputError for two
    vehicles with the same name or system id, or a mission that flies nowhere.
    """
    flights = prepared(parts, world, terms, weather=weather, runs=runs, seed=seed, airspeed_m_s=airspeed_m_s)
    blocks = flights.blocks(different(flights, runs), 1)
    tallies = []
    for first, count in blocks:
        tallies.append(flown(flights, world, (first, count)))
        if progress is not None:
            progress(first + count, runs)
    return concluded(flights, runs, tallies)


def prepared(
    parts: Sequence[RehearsalPart],
    world: World,
    terms: Terms,
    *,
    weather: Weather | None = None,
    runs: int = 1,
    seed: int = 1,
    airspeed_m_s: float | None = None,
) -> Flights:
    """Upload, and make the tracks of what the vehicles stored. Raises as `rehearse`."""
    if runs < 1:
        raise InputError(f"give at least one run, not {runs}")
    stored = on_board(parts)
    tracks = [track_of(part, mission, world, airspeed_m_s) for part, mission in zip(parts, stored, strict=True)]
    return Flights(parts, terms, tracks, weather or Weather(), seed)


def different(flights: Flights, runs: int) -> int:
    """How many of ``runs`` are flown: one if nothing makes them differ."""
    return 1 if flights.weather.calm and not any(p.depart_window_s for p in flights.parts) else runs


def flown(flights: Flights, world: World, block: RunBlock) -> Tally:
    """Fly and judge a block of runs. A run does not depend on its block."""
    first, count = block
    parts = flights.parts
    tally = Tally(parts, flights.terms)
    windows_s = np.array([part.depart_window_s for part in parts])
    drawn = np.array([np.random.default_rng((flights.seed, first + r, 2)).random(len(parts)) for r in range(count)])
    departs = (np.array([part.leaves_s for part in parts]) + drawn * windows_s).ravel()
    flight = fly(flights.tracks, departs, weather=flights.weather, runs=count, seed=flights.seed, first_run=first)
    for r in range(count):
        lanes = range(r * len(parts), (r + 1) * len(parts))
        traces = [flight.trace(lane, leaves=part.leaves) for lane, part in zip(lanes, parts, strict=True)]
        tally.add(traces, world, [_spent_j(flights, flight, lane) for lane in lanes])
        for lane, part in zip(lanes, parts, strict=True):
            if part.vehicle.energy.unlike_fitted(speed := float(flight.cruise_m_s[lane])) and not flights.weather.calm:
                slow, fast = part.vehicle.energy.fitted_m_s or (0.0, 0.0)
                tally.notes.append(
                    Note(
                        "energy_fitted_to_other_air", vehicle=part.vehicle.name, slow_m_s=slow, fast_m_s=fast,
                        speed_m_s=round(speed),
                    )
                )  # fmt: skip
    return tally


def _spent_j(flights: Flights, flight: FlownLanes, lane: int) -> float:
    """The energy of a lane's flight, J: of its track in still air, else of its way through the air."""
    k = lane % len(flights.parts)
    vehicle = flights.parts[k].vehicle
    if flights.weather.calm:
        points, held_s = flights.tracks[k].points, float(flight.hold_s[lane])
        return energy_of(points, held_s, vehicle, flight.moved_s(lane))
    return flight.energy_j(lane, vehicle)


def concluded(flights: Flights, runs: int, tallies: Sequence[Tally]) -> Rehearsal:
    """The result of all blocks, given in their order."""
    tally = Tally(flights.parts, flights.terms)
    if runs > different(flights, runs):
        tally.notes.append(Note("runs_alike"))
    for one in tallies:
        tally.join(one)
    not_flown = [t.not_flown for t in flights.tracks]
    return tally.result("gcsplan", flights.seed, flights.weather.as_dict(), not_flown)


def on_board(parts: Sequence[RehearsalPart]) -> list[Mission]:
    """Return each part's mission as a simulated vehicle stores it, after a real upload over this machine's loopback."""
    vehicles = [LoopbackVehicle.for_mission(p.mission) for p in parts]
    names = [p.vehicle.name for p in parts]
    if len(set(names)) != len(names):
        raise InputError(f"every vehicle needs a name of its own, given {', '.join(names)}")
    with SimServer(vehicles, "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        upload_parts(parts, [link] * len(parts))
    return [
        replace(
            Mission.from_wire(v.autopilot, v.items(), home=v.home, name=p.mission.name, sysid=v.sysid),
            leaves_s=p.mission.leaves_s,
        )
        for v, p in zip(vehicles, parts, strict=True)
    ]


def upload_parts(parts: Sequence[RehearsalPart], links: Sequence[Link]) -> None:
    """Upload each part's mission over its link to a simulator. Raises what an upload raises."""
    orders = [
        UploadOrder(
            link, p.mission, p.verdict,
            SessionOptions(unchecked=p.verdict.safe is None, listen_s=0.0, read_parameters=False, simulated=True),
        )
        for link, p in zip(links, parts, strict=True)
    ]  # fmt: skip
    for result in upload_fleet(orders):
        if isinstance(result, GcsplanError):
            raise result
        result.raise_for_outcome()


def track_of(part: RehearsalPart, mission: Mission, world: World, airspeed_m_s: float | None) -> CommandedTrack:
    """Return the track of a part whose vehicle stored ``mission``. Raises InputError if that flies nowhere."""
    try:
        return make_track(
            mission, part.vehicle, world, Kinematics.of(part.vehicle, airspeed_m_s), rtl_rel_home_m=part.rtl_rel_home_m,
            airborne=part.airborne, depart_s=part.depart_s,
        )  # fmt: skip
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{error}: there is nothing to rehearse", where=part.vehicle.name) from None
