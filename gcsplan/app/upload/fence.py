"""Fences and rally points that go to vehicles with their missions: sent before the mission, read back.

A fence is made of the mission's zones and of the file's own fence; rally points are the file's own, or proposed ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gcsplan.app.check.fence_breaches import breaches_of, fence_for
from gcsplan.check.motion.turn_parameters import Tuning
from gcsplan.errors import GcsplanError, InputError
from gcsplan.mavlink.build.fence import Fence, parts_of, require_storage
from gcsplan.mavlink.mission.mission import FENCE, RALLY, Mission, MissionItem
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
    found = breaches_of(job.fence, read_back, job.vehicle, job.world, rtl_rel_home_m=rtl_rel_home_m, tuning=tuning)
    return Note("breaches_own_fence", found=tuple(f.note for f in found)) if found else None


@dataclass(frozen=True, slots=True)
class ListsSent:
    """The lists that the user sends with missions. ``infinite``: a fence into which zones with a height go, too."""

    fence: bool = False
    rally: bool = False
    infinite: bool = False


KEY_OF_LIST = {FENCE: "geoFence", RALLY: "rallyPoints"}
"""The names of the lists in a `.plan`."""

NAME_OF_LIST = {FENCE: "fence", RALLY: "rally"}
"""Their keys in results."""


def with_lists(jobs: Sequence[UploadJob], sent: ListsSent) -> tuple[list[UploadJob], list[tuple[str, Note]]]:
    """``jobs``, each with the lists that are sent with it, and notes as (name, note).

    The fence is made of the zones of the job's world and of the file's own fence. Raises what `fence_for` raises;
    without a world, InputError if the file has no fence of its own.
    """
    made: list[UploadJob] = []
    notes: list[tuple[str, Note]] = []
    for job in jobs:
        own = job.own.get(FENCE, ())
        fenced = sent.fence or sent.infinite
        if fenced:
            fence = _fence_of(job, own, infinite=sent.infinite)
            found = fence.notes if fence.items else (*fence.notes, Note("no_zone_for_fence"))
            notes += [(job.name, note) for note in found]
            job = replace(job, fence=fence)
        if sent.rally:
            job = replace(job, rally=job.own.get(RALLY, ()))
            none = RALLY in job.own and not job.rally
            notes += [(job.name, Note("no_rally_points_to_send"))] if none else []
        unsent = [
            Note("plan_list_not_sent", key_of_list=KEY_OF_LIST[kind], count=len(items), option=option)
            for kind, option, goes in ((FENCE, "--fence", fenced), (RALLY, "--rally", sent.rally))
            if (items := job.own.get(kind, ())) and not goes
        ]
        made.append(replace(job, unsent=tuple(unsent)))
    return made, notes


def _fence_of(job: UploadJob, own: Sequence[MissionItem], *, infinite: bool) -> Fence:
    if job.vehicle is not None and job.world is not None:
        return fence_for(
            job.mission, job.vehicle, job.world, infinite=infinite, rtl_rel_home_m=job.rtl_rel_home_m, own=own
        )
    if not own:
        raise InputError(
            "a fence is made of the zones of a mission file, and of the file's own fence, which it has not: give "
            "--mission FILE, or leave --fence out",
            where=job.name,
        )
    parts = parts_of(own)
    require_storage(parts, job.mission.autopilot, [f"area {k}" for k in range(1, len(parts) + 1)])
    return Fence(tuple(own), ())


ListEnds = dict[int, "UploadResult | GcsplanError"]
"""By kind of list, how it ended."""


def upload_lists(
    jobs: Sequence[UploadJob], links: Mapping[str, Link], options: session.SessionOptions
) -> dict[str, ListEnds]:
    """Send each job's fence and rally points over its link (``links`` by job name), all at once, and read back.

    Call this before the missions are sent: an autopilot may refuse a mission because of an old fence. Lists without
    items are left on board as they are and are not in the result. A failure of one vehicle does not affect the others;
    behind it nothing more is sent to that vehicle.
    """
    from gcsplan.mavlink.link.session import session

    ended: dict[str, ListEnds] = {}
    for kind in (FENCE, RALLY):
        tasks = []
        for job in jobs:
            items = job.rally if kind == RALLY else () if job.fence is None else job.fence.items
            if not items or job.name not in links or not_held({job.name: ended.get(job.name, {})}):
                continue
            simulated = job.url == "sim"
            own = replace(options, simulated=simulated, listen_s=0.0 if simulated else options.listen_s)
            tasks.append(session.Task(job.name, job.mission.sysid, job.mission.autopilot, items, kind, own))
        results = session.upload_lists([(links[task.name], task) for task in tasks])
        for task, result in zip(tasks, results, strict=True):
            ended.setdefault(task.name, {})[kind] = result
    return ended


def not_held(ended: Mapping[str, ListEnds]) -> dict[str, GcsplanError]:
    """Vehicles of which a list is not proved to be on board, with the reason: their missions must not be sent."""
    what = {FENCE: "its fence is", RALLY: "its rally points are"}
    errors: dict[str, GcsplanError] = {}
    for name, lists in ended.items():
        for kind, r in lists.items():
            e = r if isinstance(r, GcsplanError) else r.error()
            if e is not None:
                words = f"the mission was not sent, for {what[kind]} not on board: {e.message}"
                errors[name] = type(e)(words, where=e.where, reason=e.reason)
    return errors
