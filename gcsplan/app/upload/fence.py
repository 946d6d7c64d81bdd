"""Fences that go to vehicles with their missions: made of the zones, sent before the mission, read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.app.check.fence_breaches import breaches, fence_areas, fence_for
from gcsplan.check.motion.turn_parameters import Tuning
from gcsplan.errors import GcsplanError, InputError
from gcsplan.mavlink.build.fence import Fence
from gcsplan.mavlink.mission.mission import FENCE, Mission
from gcsplan.notes.note import Note

if TYPE_CHECKING:
    from gcsplan.app.upload.job import UploadJob
    from gcsplan.mavlink.link.link import Link
    from gcsplan.mavlink.link.session import session
    from gcsplan.mavlink.link.session.results import UploadResult


def against_fence(job: UploadJob, read_back: Mission, rtl_rel_home_m: float | None, tuning: Tuning) -> Note | None:
    """Why the vehicle would breach the job's fence as it flies with the parameters that were read; None if not."""
    if job.fence is None or not job.fence.items or job.vehicle is None or job.world is None:
        return None
    areas = fence_areas(job.fence, read_back, job.world)
    found = breaches(areas, read_back, job.vehicle, job.world, rtl_rel_home_m=rtl_rel_home_m, tuning=tuning)
    return Note("breaches_own_fence", found=tuple(f.note for f in found)) if found else None


def with_fences(jobs: Sequence[UploadJob], *, infinite: bool = False) -> tuple[list[UploadJob], list[tuple[str, Note]]]:
    """``jobs``, each with the fence that its world's zones make for its mission, and notes as (name, note).

    Raises what `fence_for` raises, and InputError for a mission that was not checked, since nobody knows what it would
    breach.
    """
    fenced: list[UploadJob] = []
    notes: list[tuple[str, Note]] = []
    for job in jobs:
        if job.vehicle is None or job.world is None:
            raise InputError("a fence is made of the zones that a mission was checked with, and this one was not")
        fence = fence_for(job.mission, job.vehicle, job.world, infinite=infinite, rtl_rel_home_m=job.rtl_rel_home_m)
        found = fence.notes if fence.items else (*fence.notes, Note("no_zone_for_fence"))
        notes += [(job.name, note) for note in found]
        fenced.append(replace(job, fence=fence))
    return fenced, notes


def upload_fences(
    jobs: Sequence[UploadJob], links: Mapping[str, Link], options: session.SessionOptions
) -> dict[str, UploadResult | GcsplanError]:
    """Send each job's fence over its link (``links`` by job name), all at once, and read back; results by job name.

    Call this before the missions are sent: an autopilot may refuse a mission because of an old fence. Vehicles without
    a fence, or with an empty one, are left as they are and are not in the result. A failure of one vehicle does not
    affect the others.
    """
    from gcsplan.mavlink.link.session import session

    def task_of(job: UploadJob, fence: Fence) -> session.Task:
        simulated = job.url == "sim"
        own = replace(options, simulated=simulated, listen_s=0.0 if simulated else options.listen_s)
        mission = job.mission
        return session.Task(job.name, mission.sysid, mission.autopilot, fence.items, FENCE, own)

    tasks = [task_of(j, j.fence) for j in jobs if j.fence is not None and j.fence.items and j.name in links]
    ended = session.upload_lists([(links[task.name], task) for task in tasks])
    return dict(zip([task.name for task in tasks], ended, strict=True))


def not_fenced(ended: Mapping[str, UploadResult | GcsplanError]) -> dict[str, GcsplanError]:
    """Vehicles whose fence is not proved to be on board, with the reason: their missions must not be sent."""
    errors = {name: r if isinstance(r, GcsplanError) else r.error() for name, r in ended.items()}
    return {
        name: type(e)(f"the mission was not sent, for its fence is not on board: {e.message}", where=e.where,
                      reason=e.reason)
        for name, e in errors.items() if e is not None
    }  # fmt: skip
