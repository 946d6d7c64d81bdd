"""Uploads to a whole fleet at once, beside the slowest of its vehicles alone: both should take the same time.

Every vehicle loses packets by its own seed, in both directions, and has the same seed when it is uploaded to alone. The
time is that of a whole verified upload: discovery, preflight, parameters, transfer, read-back and comparison. The
vehicles run in a separate process, with their own timers (ArduCopter repeats a request after a second).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from gcsplan.bench.upload import START, items_of
from gcsplan.errors import GcsplanError, InputError, LinkError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.results import UploadResult
from gcsplan.mavlink.link.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.mission import Home, Mission
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

SLOWEST = 3
"""Number of the slowest vehicles that are uploaded to alone; the slowest of these counts."""


def run(fleet: int = 20, items: int = 50, drop: float = 0.05, autopilot: str = "arducopter") -> dict[str, Any]:
    """Seconds of the fleet at once and of its slowest vehicle alone, and their ratio.

    Raises InputError for invalid arguments, LinkError if an upload is not verified.
    """
    if not 2 <= fleet <= 254 or not 2 <= items <= 600 or not 0.0 <= drop <= 0.2:
        raise InputError(
            f"2 to 254 vehicles, 2 to 600 items and a loss of 0 to 0.2 are wanted, given {fleet}, {items}, {drop:g}"
        )
    kind = Autopilot(autopilot)
    together_s, results = _timed(range(1, fleet + 1), items, drop, kind)
    slowest = sorted(results, key=lambda r: -r.seconds)[:SLOWEST]
    alone = {r.sysid: _timed([r.sysid], items, drop, kind)[0] for r in slowest}
    return {
        "vehicles": fleet,
        "items": items,
        "drop": drop,
        "autopilot": str(kind),
        "together_s": together_s,
        "slowest_alone_s": max(alone.values()),
        "slowest_sysid": max(alone, key=lambda sysid: alone[sysid]),
        "ratio": together_s / max(alone.values()),
        "retries": sum(r.retries for r in results),
    }


def report(result: dict[str, Any]) -> str:
    """The result in words."""
    return (
        f"{result['vehicles']} {result['autopilot']} loopback vehicles with {result['items']} items each, "
        f"{100 * result['drop']:g} % of all packets lost both ways, all verified\n"
        f"  all at once                   {result['together_s']:8.2f} s\n"
        f"  the slowest of them alone     {result['slowest_alone_s']:8.2f} s   (system {result['slowest_sysid']})\n"
        f"  ratio                         {result['ratio']:8.3f}"
    )


def _timed(numbers: Sequence[int], items: int, drop: float, autopilot: Autopilot) -> tuple[float, list[UploadResult]]:
    lat, lon, amsl_m = START
    home = Home.at(lat, lon, amsl_m)
    missions = [Mission(autopilot, home, items_of(items), f"uav{n}", n) for n in numbers]
    boards = [
        LoopbackVehicle(
            n, autopilot, lat_deg=lat, lon_deg=lon, amsl_m=amsl_m, misbehave=Misbehaviour(drop=drop, seed=n)
        )
        for n in numbers
    ]
    options = SessionOptions(unchecked=True, simulated=True)
    with SimServer(boards, "udpin:127.0.0.1:0", process=True) as server, Link(server.url_for_gcs) as link:
        started = time.perf_counter()
        results = upload_fleet([UploadOrder(link, mission, options=options) for mission in missions])
        took_s = time.perf_counter() - started
    fine: list[UploadResult] = []
    for result in results:
        error = result if isinstance(result, GcsplanError) else result.error()
        if error is not None or isinstance(result, GcsplanError):
            raise LinkError(f"an upload to the loopback fleet failed: {error}")
        fine.append(result)
    return took_s, fine
