"""Upload to the same loopback vehicle by gcsplan and by MAVSDK, in turn, in one run; and to a whole fleet at once.

For both, the time covers an upload on an open link, from the call with the items until it returns on the final ACK.
The vehicle is one process, MAVSDK another (it logs to standard output). The order changes from run to run, and one
upload of each comes before the first timed one. The time of a whole verified upload by gcsplan (transfer, read-back and
comparison) is reported beside it.

A fleet is uploaded to at once, beside the slowest of its vehicles alone: both should take the same time. Every vehicle
loses packets by its own seed, in both directions, and has the same seed when it is uploaded to alone. The time covers a
whole verified upload: discovery, preflight, parameters, transfer, read-back and comparison. The vehicles run in a
separate process, with their own timers (ArduCopter repeats a request after a second).
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from gcsplan.errors import GcsplanError, InputError, LinkError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.link import run as run_steps
from gcsplan.mavlink.link.session.results import UploadResult
from gcsplan.mavlink.link.session.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.link.session.steps import drive
from gcsplan.mavlink.mission.commands import WAYPOINT
from gcsplan.mavlink.mission.mission import RELATIVE, Home, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import Address
from gcsplan.mavlink.protocol.transfer import Accepted, Upload, VerifiedUpload
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

VEHICLE = Address(1, 1)
START = (36.6, -84.3, 300.0)
PEER_WAIT_S = 180.0
SLOWEST = 3
"""Number of the slowest vehicles that are uploaded to alone; the slowest of these counts."""


def items_of(count: int) -> tuple[MissionItem, ...]:
    """A mission of ``count`` way points, as for PX4 (no home item)."""
    return tuple(
        MissionItem(WAYPOINT, RELATIVE, x=366_000_000 + 900 * i, y=-843_000_000 + 700 * (i % 7), z=60.0 + i % 40)
        for i in range(count)
    )


def run(items: int = 600, runs: int = 15) -> dict[str, Any]:
    """Median seconds of the uploads, made in turn, and the median ratio of gcsplan's to MAVSDK's, pair by pair.

    Raises InputError if MAVSDK is not installed, LinkError if an upload fails.
    """
    if find_spec("mavsdk") is None:
        raise InputError("this benchmark needs MAVSDK: pip install 'gcsplan[test]'")
    if not 1 <= items <= 2000 or not 1 <= runs <= 100:
        raise InputError(f"give 1 to 2000 items and 1 to 100 runs, not {items} and {runs}")
    mission = items_of(items)
    ours: list[float] = []
    theirs: list[float] = []
    verified: list[float] = []
    vehicle = LoopbackVehicle(1, Autopilot.PX4, lat_deg=START[0], lon_deg=START[1], amsl_m=START[2])
    with SimServer([vehicle], "udpin:127.0.0.1:0", process=True) as server, Link(server.url_for_gcs) as link:
        host, port = server.address
        peer = _Peer(f"udpout://{host}:{port}", mission)
        try:
            for number in range(-1, runs):
                for who in (ours, theirs) if number % 2 else (theirs, ours):
                    who.append(peer.upload() if who is theirs else _ours(link, mission, verify=False))
                verified.append(_ours(link, mission, verify=True))
        finally:
            peer.close()
    ours, theirs, verified = ours[1:], theirs[1:], verified[1:]
    ratios = [a / b for a, b in zip(ours, theirs, strict=True)]
    return {
        "items": items,
        "runs": runs,
        "gcsplan_s": statistics.median(ours),
        "gcsplan_verified_s": statistics.median(verified),
        "mavsdk_s": statistics.median(theirs),
        "ratio": statistics.median(ratios),
        "ratio_least": min(ratios),
        "ratio_most": max(ratios),
    }


def report(result: dict[str, Any]) -> str:
    """The result of `run` in words."""
    return (
        f"{result['items']} items to one loopback vehicle over UDP, median of {result['runs']} runs in turn\n"
        f"  gcsplan, upload               {result['gcsplan_s']:8.3f} s\n"
        f"  gcsplan, upload and read-back {result['gcsplan_verified_s']:8.3f} s\n"
        f"  MAVSDK, upload                {result['mavsdk_s']:8.3f} s\n"
        f"  ratio gcsplan / MAVSDK        {result['ratio']:8.2f}   "
        f"({result['ratio_least']:.2f} … {result['ratio_most']:.2f} pair by pair)"
    )


def run_fleet(fleet: int = 20, items: int = 50, drop: float = 0.05, autopilot: str = "arducopter") -> dict[str, Any]:
    """Seconds of the fleet at once and of its slowest vehicle alone, and their ratio.

    Raises InputError for invalid arguments, LinkError if an upload is not verified.
    """
    if not 2 <= fleet <= 254 or not 2 <= items <= 600 or not 0.0 <= drop <= 0.2:
        raise InputError(
            f"give 2 to 254 vehicles, 2 to 600 items and a loss of 0 to 0.2, not {fleet}, {items} and {drop:g}"
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


def report_fleet(result: dict[str, Any]) -> str:
    """The result of `run_fleet` in words."""
    return (
        f"{result['vehicles']} {result['autopilot']} loopback vehicles with {result['items']} items each, "
        f"{100 * result['drop']:g} % of all packets lost both ways, all verified\n"
        f"  all at once                   {result['together_s']:8.2f} s\n"
        f"  the slowest of them alone     {result['slowest_alone_s']:8.2f} s   (system {result['slowest_sysid']})\n"
        f"  ratio                         {result['ratio']:8.3f}"
    )


def _ours(link: Link, items: tuple[MissionItem, ...], *, verify: bool) -> float:
    channel = link.channel(VEHICLE.sysid)
    link.poll()  # drop what arrived during MAVSDK's turn
    channel.inbox.clear()
    started = time.perf_counter()
    if verify:
        proof = VerifiedUpload(items, Autopilot.PX4, us=link.us, vehicle=VEHICLE)
        run_steps(channel, drive(proof, channel))
        fine = proof.result is not None and proof.result.verified
    else:
        upload = Upload(items, us=link.us, vehicle=VEHICLE)
        run_steps(channel, drive(upload, channel))
        fine = isinstance(upload.outcome, Accepted)
    took = time.perf_counter() - started
    link.drop(channel)
    if not fine:
        raise LinkError("our upload to the loopback vehicle failed")
    return took


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


class _Peer:
    """MAVSDK's upload in a separate process: one line in for each upload, its seconds out."""

    def __init__(self, url: str, items: tuple[MissionItem, ...]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PEER, url, str(PEER_WAIT_S)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        rows = [(i.command, i.frame, *i.params, i.x, i.y, i.z) for i in items]
        self._tell(json.dumps(rows))
        self._expect("ready")

    def _tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def _expect(self, what: str) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline().strip()
        if not line.startswith(what):
            raise LinkError(f"MAVSDK did not get {what}: {line or 'its process ended'}")
        return line

    def upload(self) -> float:
        """Do one upload and return its seconds."""
        self._tell("upload")
        return float(self._expect("took").split()[1])

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


_PEER = """
import json, os, sys, threading, time
from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.mission_raw.mission_raw import MissionItem, MissionRaw

out = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
threading.Timer(float(sys.argv[2]), lambda: os._exit(1)).start()

def say(words):
    out.write(words + "\\n")
    out.flush()

rows = json.loads(sys.stdin.readline())
mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
if mavsdk.add_any_connection(sys.argv[1]) != ConnectionResult.SUCCESS:
    say("cannot open " + sys.argv[1])
    os._exit(1)
system = mavsdk.first_autopilot(15.0)
if system is None:
    say("no autopilot heard")
    os._exit(1)
raw = MissionRaw(system)
items = [MissionItem(seq, r[1], r[0], int(seq == 0), 1, *r[2:6], r[6], r[7], r[8], 0) for seq, r in enumerate(rows)]
say("ready")
for line in sys.stdin:
    started = time.perf_counter()
    raw.upload_mission(items)
    say(f"took {time.perf_counter() - started}")
"""
