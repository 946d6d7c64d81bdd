"""Terrain between a mission file and its vehicles: serve them what they ask for, and compare what they read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from gcsplan.app.upload.job import MissionGround
from gcsplan.app.upload.run import LISTEN_S, open_link, targets
from gcsplan.errors import GcsplanError, UsageError
from gcsplan.mission_file import MissionFile
from gcsplan.notes.note import Note, in_json
from gcsplan.world.terrain.grid import PostHeights

if TYPE_CHECKING:
    from gcsplan.mavlink.link.link import Channel, LinkSteps, PumpJob
    from gcsplan.mavlink.link.terrain import TerrainComparison, TerrainService

QUIET_S = 5.0
"""A vehicle that reports nothing pending for so long has all that it asks for."""

COMPARE_PATIENCE_S = 60.0

T = TypeVar("T")

Report = Callable[[str, int, int], None]
"""Called with a vehicle's name and two counts: parts loaded and pending, or places compared and places in all."""


@dataclass(frozen=True, slots=True)
class ServedTo:
    """The terrain that one vehicle requested and received. ``complete``: it reported that nothing is pending."""

    vehicle: str
    url: str
    requests: int
    parts: int
    blocks: int
    unknown_parts: int
    loaded: int
    pending: int
    complete: bool
    notes: tuple[Note, ...]

    def as_dict(self) -> dict[str, Any]:
        """The values for JSON."""
        return {
            "name": self.vehicle, "url": self.url, "requests": self.requests, "parts": self.parts,
            "blocks": self.blocks, "unknown_parts": self.unknown_parts, "loaded": self.loaded,
            "pending": self.pending, "complete": self.complete, **in_json("notes", self.notes),
        }  # fmt: skip


def serve(
    source: MissionFile,
    where: Sequence[str],
    *,
    seconds: float = math.inf,
    until_loaded: bool = False,
    report: Report | None = None,
) -> list[ServedTo]:
    """Answer the terrain requests of the mission's vehicles, for so long or until they have all that they ask for.

    ``where`` as in ``--upload``. Ctrl-C ends it too, with what was served until then. Raises LinkError if a vehicle is
    not heard.
    """
    from gcsplan.mavlink.link.link import pump
    from gcsplan.mavlink.link.terrain import Served, TerrainService

    urls = _vehicles_of(source, where)
    service = TerrainService(MissionGround(source))
    seen: dict[str, _Seen] = {name: _Seen() for name in urls}

    def watched(channel: Channel, name: str) -> LinkSteps[None]:
        return _watched(channel, name, seen[name], seconds, until_loaded, report)

    with _jobs(source, urls, service, watched) as jobs:
        with suppress(KeyboardInterrupt):
            pump(jobs)
        for job in jobs:
            if job.error is not None:
                raise job.error
    done = []
    for (name, url), job in zip(urls.items(), jobs, strict=True):
        served, state = service.served.get(job.channel.sysid, Served()), seen[name]
        done.append(
            ServedTo(
                name, url, served.requests, served.parts, len(served.blocks), sum(served.unknown.values()),
                state.loaded, state.pending, state.complete, tuple(served.notes),
            )
        )  # fmt: skip
    return done


@contextmanager
def _jobs(
    source: MissionFile, urls: Mapping[str, str], service: TerrainService, steps: Callable[[Channel, str], LinkSteps[T]]
) -> Iterator[list[PumpJob[T]]]:
    """A task for each vehicle, over links that answer its terrain requests beside it."""
    from gcsplan.mavlink.link.link import PumpJob

    sysids = {r.vehicle.name: r.vehicle.sysid for r in source.vehicles}
    with ExitStack() as stack:
        links = {url: stack.enter_context(open_link(url)) for url in dict.fromkeys(urls.values())}
        jobs = []
        for name, url in urls.items():
            links[url].serve(sysids[name], service.steps)
            channel = links[url].channel(sysids[name])
            jobs.append(PumpJob(channel, steps(channel, name)))
        yield jobs


@dataclass
class _Seen:
    loaded: int = 0
    pending: int = -1
    complete: bool = False


def _watched(
    channel: Channel, name: str, seen: _Seen, seconds: float, until_loaded: bool, report: Report | None
) -> LinkSteps[None]:
    from gcsplan.mavlink.link.session.steps import discover_steps
    from gcsplan.mavlink.link.watch import Watch

    clock = channel.link.clock
    yield from discover_steps(channel, Watch(channel.sysid), timeout_s=10.0, listen_s=LISTEN_S)
    began = quiet_from = clock()
    while clock() < began + seconds and not (until_loaded and seen.complete):
        yield clock() + 0.5
        for heard in channel.take():
            if heard.late or heard.message.get_type() != "TERRAIN_REPORT":
                continue
            m = heard.message
            if (m.loaded, m.pending) != (seen.loaded, seen.pending) and report:
                report(name, m.loaded, m.pending)
            seen.loaded, seen.pending = int(m.loaded), int(m.pending)
        if seen.pending != 0 or seen.loaded == 0:
            quiet_from = clock()
        seen.complete = clock() >= quiet_from + QUIET_S


def compare(
    source: MissionFile,
    where: Sequence[str],
    *,
    points: int,
    seed: int = 1,
    spacing_m: int = 100,
    report: Report | None = None,
) -> Mapping[str, TerrainComparison | GcsplanError]:
    """Ask every vehicle what terrain it reads at random places of the mission's ground, and serve what it lacks."""
    from gcsplan.mavlink.link.link import pump
    from gcsplan.mavlink.link.terrain import TerrainService

    urls = _vehicles_of(source, where)
    ground = MissionGround(source)
    service = TerrainService(ground)
    posts = service.posts(spacing_m)
    places = random_places(ground, posts, points, seed)

    def compared(channel: Channel, name: str) -> LinkSteps[TerrainComparison]:
        return _compared(channel, name, places, posts, report)

    with _jobs(source, urls, service, compared) as jobs:
        pump(jobs)
    found: dict[str, TerrainComparison | GcsplanError] = {}
    for name, job in zip(urls, jobs, strict=True):
        outcome = job.error or job.result
        assert outcome is not None
        found[name] = outcome
    return found


def _compared(
    channel: Channel, name: str, places: Sequence[tuple[int, int]], posts: PostHeights, report: Report | None
) -> LinkSteps[TerrainComparison]:
    from gcsplan.mavlink.link.session.steps import discover_steps
    from gcsplan.mavlink.link.terrain import compare_steps
    from gcsplan.mavlink.link.watch import Watch

    state = yield from discover_steps(channel, Watch(channel.sysid), timeout_s=10.0, listen_s=LISTEN_S)
    compared: TerrainComparison = yield from compare_steps(
        channel, state.address, places, posts, patience_s=COMPARE_PATIENCE_S,
        progress=None if report is None else lambda done, of: report(name, done, of),
    )  # fmt: skip
    return compared


def random_places(ground: MissionGround, posts: PostHeights, count: int, seed: int) -> list[tuple[int, int]]:
    """Places, 1e-7°, where the ground is known to the vehicle once it has got all; fewer if most of it is not."""
    rng = np.random.default_rng(seed)
    south, west, north, east = (math.floor(x * 1e7) for x in ground.degrees_box())
    found: list[tuple[int, int]] = []
    for _ in range(8):
        lat = rng.integers(south, north + 1, 2 * count)
        lon = (rng.integers(west, east + 1, 2 * count) + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
        known = ~np.isnan(posts.amsl(lat, lon))
        found += zip(lat[known].tolist(), lon[known].tolist(), strict=True)
        if len(found) >= count:
            break
    return found[:count]


def _vehicles_of(source: MissionFile, where: Sequence[str]) -> dict[str, str]:
    """The URLs of the vehicles that ask for terrain. Raises UsageError if there is none."""
    urls = targets(where, [r.vehicle for r in source.vehicles])
    kinds = {r.vehicle.name: r.vehicle.autopilot for r in source.vehicles}
    asking = {name: url for name, url in urls.items() if kinds[name].is_ardupilot and url != "sim"}
    if not asking:
        raise UsageError(
            f"--link {' '.join(where)}: no vehicle of {source.path} that asks for terrain is there; ArduPilot alone "
            "does, at a URL, NAME=URL, or `link` for the links of the mission file"
        )
    return asking
