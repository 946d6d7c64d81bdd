"""The rehearsal: missions are uploaded to simulated vehicles, flown as stored in simulated time, and judged.

The upload is the real one, over 127.0.0.1, so the vehicles fly what they stored, not what was intended. Every vehicle
departs at its departure offset. Times result from the simulated motion (`kinematics`, `mission_flight`), which shares
no code with their planning. Separation is judged on the flown paths, limits by the exact check of those paths.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gcsplan.errors import GcsplanError, InputError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.sim.kinematics import Kinematics
from gcsplan.sim.mission_flight import fly
from gcsplan.sim.outcome import Part, Rehearsal, Tally, Terms, energy_of
from gcsplan.sim.server import SimServer
from gcsplan.sim.track import Track, make_track
from gcsplan.sim.vehicle import LoopbackVehicle
from gcsplan.sim.wind import Weather
from gcsplan.world.world import World

__all__ = ["Part", "Rehearsal", "Terms", "rehearse"]

MOST_LANES = 240
"""Most vehicles, over all runs, that are simulated at once; this bounds the memory."""


def rehearse(
    parts: Sequence[Part],
    world: World,
    terms: Terms,
    *,
    weather: Weather | None = None,
    runs: int = 1,
    seed: int = 1,
    airspeed_m_s: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Rehearsal:
    """Upload, fly and judge. ``progress(done, runs)`` is called after each run.

    ``airspeed_m_s``: highest airspeed of every vehicle, None: a little more than its own fastest cruise (`kinematics`).
    In still air all runs are the same, so only one is flown. Raises what an upload raises, and InputError for two
    vehicles with the same name or system id, or a mission that flies nowhere.
    """
    weather = weather or Weather()
    if runs < 1:
        raise InputError(f"at least one run is wanted, given {runs}")
    stored = on_board(parts)
    tracks = [_track(part, mission, world, airspeed_m_s) for part, mission in zip(parts, stored, strict=True)]
    tally = Tally(parts, world, terms)
    if weather.calm and runs > 1:
        tally.notes.append("without wind, gusts and noise every run is the same: one was flown")
        runs = 1
    departs = [part.depart_s for part in parts]
    at_once = max(1, MOST_LANES // len(parts))
    stood = [0.0] * len(parts)
    for first in range(0, runs, at_once):
        count = min(at_once, runs - first)
        flown = fly(tracks, departs, weather=weather, runs=count, seed=seed, first_run=first)
        for r in range(count):
            lanes = range(r * len(parts), (r + 1) * len(parts))
            tally.add([flown.trace(lane, leaves=part.leaves) for lane, part in zip(lanes, parts, strict=True)])
            stood = [max(s, float(flown.hold_s[lane])) for s, lane in zip(stood, lanes, strict=True)]
            if progress is not None:
                progress(first + r + 1, runs)
    energy = [energy_of(t.points, s, p.vehicle) for t, s, p in zip(tracks, stood, parts, strict=True)]
    return tally.result("gcsplan", seed, weather.as_dict(), energy, [t.not_flown for t in tracks])


def on_board(parts: Sequence[Part]) -> list[Mission]:
    """Return each part's mission as a simulated vehicle stores it, after a real upload over this machine's loopback."""
    vehicles = [
        LoopbackVehicle(
            p.mission.sysid, p.mission.autopilot, lat_deg=p.mission.home.lat_e7 / 1e7,
            lon_deg=p.mission.home.lon_e7 / 1e7, amsl_m=p.mission.home.amsl_m, name=p.mission.name,
        )
        for p in parts
    ]  # fmt: skip
    names = [p.vehicle.name for p in parts]
    if len(set(names)) != len(names):
        raise InputError(f"every vehicle needs a name of its own, given {', '.join(names)}")
    with SimServer(vehicles, "udpin:127.0.0.1:0") as server, Link(server.url_for_gcs) as link:
        orders = [
            UploadOrder(
                link, p.mission, p.verdict,
                SessionOptions(unchecked=p.verdict.safe is None, listen_s=0.0, read_parameters=False, simulated=True),
            )
            for p in parts
        ]  # fmt: skip
        for result in upload_fleet(orders):
            if isinstance(result, GcsplanError):
                raise result
            result.raise_for_outcome()
    return [
        Mission.from_wire(v.autopilot, v.items(), home=v.home, name=p.mission.name, sysid=v.sysid)
        for v, p in zip(vehicles, parts, strict=True)
    ]


def _track(part: Part, mission: Mission, world: World, airspeed_m_s: float | None) -> Track:
    try:
        return make_track(
            mission, part.vehicle, world, Kinematics.of(part.vehicle, airspeed_m_s), rtl_rel_home_m=part.rtl_rel_home_m,
            airborne=part.airborne,
        )  # fmt: skip
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{error}: there is nothing to rehearse", where=part.vehicle.name) from None
