"""Uploads of plans and files to vehicles: which vehicle gets what, over which link, and the results.

There is one link per URL; vehicles on the same URL differ by system id. For ``sim`` the caller passes a function that
starts one loopback vehicle per UAV, where its mission starts; the results then say *simulated*.

Links and transfers are imported only where a link is opened: most plans are not uploaded, and the MAVLink dialect is
slow to import.
"""

from __future__ import annotations

import logging
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from gcsplan.app.check.files import check_files
from gcsplan.app.check.worlds import Checked, split_name
from gcsplan.app.fleet.start_time import GateTime
from gcsplan.app.plan.flight_hours import hours_left, waits_s
from gcsplan.app.plan.model import Plan
from gcsplan.app.upload.fence import KEY_OF_LIST, NAME_OF_LIST, ListEnds, not_held, upload_lists
from gcsplan.app.upload.job import (
    LINK,
    SIM,
    FleetOnBoard,
    JobResult,
    MissionGround,
    ProgressCall,
    UploadJob,
    UploadOptions,
)
from gcsplan.app.upload.on_board import judge_on_board, settings_of
from gcsplan.errors import GcsplanError, InputError, LinkError, ReadBackDiffers, UsageError, VehicleRefused
from gcsplan.export.outdir import write_whole
from gcsplan.mavlink.files.formats import read_mission_file, write_plan, write_waypoints
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mavlink.mission.autopilots import autopilot_of
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, Mission
from gcsplan.mission_file import MissionFile
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.mavlink.link.link import Link
    from gcsplan.mavlink.link.session import session
    from gcsplan.mavlink.link.session.jobs import Readied
    from gcsplan.mavlink.link.session.results import UploadResult

_log = logging.getLogger(__name__)

LISTEN_S = 1.5
"""Seconds to listen for a second source of a system id's heartbeats, which come once a second."""
KINDS = {"mission": MISSION, "fence": FENCE, "rally": RALLY}
Simulator = Callable[[Sequence[Mission]], AbstractContextManager[str]]
"""Starts a vehicle for each mission; the context value is the URL where all of them answer."""


def targets(where: Sequence[str], vehicles: Sequence[Vehicle]) -> dict[str, str]:
    """Vehicle name to URL (or `SIM`) from all ``--upload`` words; empty without words. Raises UsageError."""
    by_name = {v.name: v for v in vehicles}
    chosen: dict[str, str] = {}
    single: dict[str, str] = {}
    for word in where:
        name, equals, url = word.partition("=")
        if equals and re.fullmatch(r"[A-Za-z0-9_-]+", name):
            if name not in by_name:
                known = ", ".join(by_name)
                raise UsageError(f"--upload {word}: the mission file has no vehicle {name!r}; it has {known}")
            single[name] = url if url == SIM else _url(url, word)
        elif word == LINK:
            missing = [v.name for v in vehicles if not v.link]
            if missing:
                raise UsageError(f"--upload link: {', '.join(missing)} has no `link` in the mission file")
            chosen |= {v.name: _url(v.link or "", f"link of {v.name}") for v in vehicles}
        else:
            url = SIM if word == SIM else _url(word, word)
            chosen |= dict.fromkeys(by_name, url)
    to = chosen | single
    _require_apart(to, by_name)
    return to


def _require_apart(to: Mapping[str, str], by_name: Mapping[str, Vehicle]) -> None:
    """Raise UsageError for two vehicles of one system id on one link, where nobody could tell them apart."""
    seats: dict[tuple[object, int], str] = {}
    for name, url in to.items():
        if url == SIM:
            continue  # simulated vehicles of one system id get links of their own
        other = seats.setdefault((parse_url(url).far_end, by_name[name].sysid), name)
        if other != name:
            raise UsageError(
                f"{other} and {name} both have system id {by_name[name].sysid}, and both would be reached over {url}: "
                f"give each a link of its own (--upload link takes those of the mission file)"
            )


def _url(text: str, word: str) -> str:
    """``text`` as a URL in normal form; ``word`` is what the user wrote, for the error. Raises UsageError."""
    try:
        return parse_url(text).url
    except InputError as error:
        near = [w for w in (SIM, LINK) if w == word.strip().lower()]
        hint = f"; did you mean {near[0]}?" if near else f". Besides URLs there are {SIM}, {LINK} and NAME=URL"
        raise UsageError(f"{error.message}{hint}", where=f"upload to {word!r}") from None


def jobs_of(
    plan: Plan,
    where: Mapping[str, str],
    homes: Mapping[str, WayHome] = MappingProxyType({}),
    home_required: bool = False,
    *,
    rally: bool = False,
) -> list[UploadJob]:
    """The upload jobs of a plan; vehicles without a target are left out.

    ``homes``: ways home that were judged; ``home_required``: they must be safe. ``rally``: the points that they propose
    are the lists of the jobs' files.
    """
    from gcsplan.check.returns.rally import rally_items

    source = plan.source
    ground, fleet = MissionGround(source), FleetOnBoard(plan)
    return [
        UploadJob(
            v.name, where[v.name], v.mission, v.verdict, v.request.vehicle, plan.world, v.request.rtl_rel_home_m,
            source.terrain_error_m, way_home=homes.get(v.name), home_required=home_required, ground=ground,
            hours=hours_left(source, v, plan.fleet), waits_s=0.0 if plan.fleet is None else waits_s(v, plan.fleet),
            fleet=fleet,
            own={RALLY: rally_items(homes[v.name].rally)} if rally and where[v.name] and v.name in homes else {},
        )
        for v in plan.vehicles if v.name in where
    ]  # fmt: skip


def jobs_of_files(source: MissionFile, checked: Sequence[Checked], word: str) -> list[UploadJob]:
    """The upload jobs of checked files; ``word`` as in ``--upload``.

    Raises UsageError for two files of one vehicle, and where the departure for which gates are judged is near or past.
    """
    seen: dict[str, Path] = {}
    for c in checked:
        if seen.setdefault(c.vehicle.name, c.file) is not c.file:
            raise UsageError(f"{seen[c.vehicle.name]} and {c.file} are both for {c.vehicle.name}: give one of them")
        if c.mission.leaves_s is not None and any(item.until_s is not None for item in c.mission.items):
            GateTime(datetime.fromtimestamp(c.mission.leaves_s, UTC), "at").require_ahead(datetime.now(UTC))
    to = targets([word], [r.vehicle for r in source.vehicles])
    missing = [c.vehicle.name for c in checked if c.vehicle.name not in to]
    if missing:
        raise UsageError(f"--to {word} says nothing of {', '.join(missing)}")
    ground = MissionGround(source)
    return [replace(_job(c, to[c.vehicle.name]), ground=ground) for c in checked]


def _job(c: Checked, url: str) -> UploadJob:
    return UploadJob(
        c.vehicle.name, url, c.mission, c.verdict, c.vehicle, c.world, c.request.rtl_rel_home_m, c.terrain_error_m,
        way_home=c.way_home, home_required=c.home_required, hours=c.hours, own={FENCE: c.fence, RALLY: c.rally},
    )  # fmt: skip


def unchecked_job(argument: str, url: str, sysid: int) -> tuple[UploadJob, list[Note]]:
    """The job of a file for ``--unchecked``, and notes on the parts of the file that were not read or are not sent.

    If the file names no autopilot, the vehicle must report it.
    """
    name, file = split_name(argument)
    endpoint = parse_url(url)
    require_file(file)
    autopilot = None
    if file.suffix.lower() != ".plan":
        with open_link(url) as link:
            autopilot = _autopilot_of(link, sysid)
    read = read_mission_file(file, autopilot=autopilot)
    job = UploadJob(
        name or file.stem, endpoint.url, replace(read.mission, name=name or file.stem, sysid=sysid),
        own={FENCE: read.fence, RALLY: read.rally},
    )  # fmt: skip
    return job, [*read.notes, *read.not_judged]


def open_link(url: str) -> Link:
    """The link at ``url``, signed if the environment holds a key."""
    from gcsplan.mavlink.link.frames import signing_key
    from gcsplan.mavlink.link.link import Link

    return Link(url, key=signing_key())


def _autopilot_of(link: Link, sysid: int) -> Autopilot:
    from gcsplan.mavlink.link.session import session

    state = session.discover(link, sysid, listen_s=LISTEN_S)
    autopilot = autopilot_of(state.mav_autopilot, state.mav_type)
    if autopilot is not None:
        return autopilot
    raise VehicleRefused(
        f"vehicle {sysid} calls itself {state.what}, and gcsplan knows {', '.join(Autopilot)}: give a .plan file, "
        f"which names its autopilot"
    )


def run_jobs(
    jobs: Sequence[UploadJob],
    options: UploadOptions,
    progress: ProgressCall | None = None,
    *,
    simulator: Simulator | None = None,
) -> list[JobResult]:
    """Upload all jobs at once, read back, compare, and check what was read back; results in the order of ``jobs``."""
    from gcsplan.mavlink.link.session import session

    with ExitStack() as stack:
        links, failed = _links_of(jobs, stack, simulator)
        if failed and options.atomic:  # nothing has been sent yet, so every vehicle can keep its old mission
            where = ", ".join(failed)
            held = LinkError(f"nothing was sent, all or nothing: the link {where} did not open")
            return [_result(job, failed.get(job.url) or held) for job in jobs]
        listed = _lists_sent(jobs, links, options)
        barred = not_held(listed)
        if barred and options.atomic:
            held = LinkError(
                "nothing was sent but fences and rally points, all or nothing: another vehicle's are not on board"
            )
            return [_result(job, barred.get(job.name) or held) for job in jobs]
        orders = _orders([job for job in jobs if job.name not in barred], links, options, progress)
        _log.info("uploading to %s", ", ".join(orders) or "no vehicle")
        results = session.upload_fleet(list(orders.values()), ended=report_end(progress))
        ended = dict(zip(orders, results, strict=True))
        done = [
            _with_lists(
                _result(
                    job,
                    ended.get(job.name) or barred.get(job.name) or failed.get(job.url)
                    or LinkError("the link did not open"),
                ),
                listed.get(job.name, {}), job.unsent,
            )
            for job in jobs
        ]  # fmt: skip
        for result in done:
            _log.info("%s: %s", result.vehicle, result.outcome)
        return rolled_back(done, orders, ended) if options.atomic else done


def _links_of(
    jobs: Sequence[UploadJob], stack: ExitStack, simulator: Simulator | None
) -> tuple[dict[str, Link], dict[str, LinkError]]:
    """The open links by job, which ``stack`` closes, and by URL why one did not open, which ends no other one."""
    from gcsplan.mavlink.link.link import Link

    links: dict[str, Link] = {}
    for group in _apart([job for job in jobs if job.url == SIM]):
        if simulator is None:
            raise UsageError("nothing here can simulate a vehicle")
        url = stack.enter_context(simulator([job.mission for job in group]))
        links |= dict.fromkeys((j.name for j in group), stack.enter_context(Link(url)))  # unsigned: it stays here
    failed: dict[str, LinkError] = {}
    for url in dict.fromkeys(job.url for job in jobs if job.url != SIM):
        try:
            link = stack.enter_context(open_link(url))
            links |= dict.fromkeys((j.name for j in jobs if j.url == url), link)
        except LinkError as error:
            failed[url] = error
    return links, failed


def _orders(
    jobs: Sequence[UploadJob], links: Mapping[str, Link], options: UploadOptions, progress: ProgressCall | None
) -> dict[str, session.UploadOrder]:
    """The orders of the jobs whose links are open, by name."""
    return {
        job.name: order_of(
            job, links[job.name], options, progress, simulated=job.url == SIM,
            listen_s=0.0 if job.url == SIM else LISTEN_S,
        )
        for job in jobs if job.name in links
    }  # fmt: skip


def look(
    jobs: Sequence[UploadJob], options: UploadOptions, *, simulator: Simulator | None = None
) -> dict[str, Readied | GcsplanError]:
    """What an upload of each job would meet, all at once, by name; nothing is written to a vehicle.

    The checks are those of `run_jobs` up to the first item; an error says why a vehicle could not be looked at.
    """
    from gcsplan.mavlink.link.session import session

    with ExitStack() as stack:
        links, failed = _links_of(jobs, stack, simulator)
        orders = _orders(jobs, links, options, None)
        seen = dict(zip(orders, session.look_fleet(list(orders.values())), strict=True))
    return {job.name: seen.get(job.name) or failed[job.url] for job in jobs}


def order_of(
    job: UploadJob,
    link: Link,
    options: UploadOptions,
    progress: ProgressCall | None,
    *,
    simulated: bool,
    listen_s: float,
) -> session.UploadOrder:
    """``job`` as an order of the session over ``link``. ``listen_s``: how long to listen for rivals, s."""
    from gcsplan.app.upload.wind_on_board import WIND_S, flight_wind_of, wind_judge
    from gcsplan.mavlink.link.session import session

    ground_m = None
    if job.world is not None:
        home = job.mission.home
        ground_m = job.world.ground_amsl(home.lat_e7 / 1e7, home.lon_e7 / 1e7)
        ground_m = None if math.isnan(ground_m) else ground_m
    settings = session.SessionOptions(
        unchecked=options.unchecked or (job.verdict is not None and job.verdict.safe is None),
        allow_armed=options.allow_armed,
        ignore_position=options.ignore_position,
        ground_amsl_m=ground_m,
        rtl_rel_home_m=job.rtl_rel_home_m if job.way_home is None else job.way_home.rtl_rel_home_m,
        route=None if job.way_home is None else job.way_home.route,
        advised_rel_home_m=None if job.way_home is None else job.way_home.set_rel_home_m,
        simulated=simulated,
        terrain=None if simulated else job.ground,
        timeout_s=options.timeout_s,
        listen_s=listen_s,
        vehicle=job.vehicle,
        settings=() if simulated else settings_of(job),
        wind=None if simulated else wind_judge(job),
        wind_s=0.0 if flight_wind_of(job).declared.still else WIND_S,
    )
    again = None
    if job.verdict is not None:
        again = judge_on_board(
            job, allow_unjudged=job.verdict.safe is None, allow_parameters=options.allow_parameters, simulated=simulated
        )
    return session.UploadOrder(link, job.mission, job.verdict, settings, again, progress)


def report_end(progress: ProgressCall | None) -> session.EndCall | None:
    """A call that reports the outcome of each order, in a word, to ``progress``."""
    if progress is None:
        return None
    from gcsplan.mavlink.protocol.machine import TransferProgress

    def report(order: session.UploadOrder, ended: UploadResult | GcsplanError) -> None:
        count = len(order.mission.wire_items())
        refused = isinstance(ended, VehicleRefused)
        word: str = ("refused" if refused else "unknown") if isinstance(ended, GcsplanError) else ended.outcome
        verified = not isinstance(ended, GcsplanError) and ended.verified
        if not isinstance(ended, GcsplanError) and ended.changed:
            word = f"verified, {ended.changed}" if verified else f"stopped, {ended.changed}"
        failed = not (verified and word == "accepted")
        done = TransferProgress(word if failed else "verified", count if verified else 0, count, failed)
        progress(order.mission.name, done)

    return report


def rolled_back(
    uploads: Sequence[JobResult],
    orders: Mapping[str, session.UploadOrder],
    ended: Mapping[str, UploadResult | GcsplanError],
) -> list[JobResult]:
    """All or nothing (``--atomic``): if one upload is not verified, clear the missions that the vehicles took, and read
    back that they are gone.

    A list is cleared if it was accepted or may have been; a vehicle that never took anything of this upload keeps its
    own list. Nothing further is sent to a vehicle that has changed since it was checked: it keeps what it has, and the
    result says so.
    """
    from gcsplan.mavlink.link.session import session

    failures = [d.vehicle for d in uploads if d.code]
    if not failures:
        return list(uploads)
    results = {name: result for name, result in ended.items() if not isinstance(result, GcsplanError)}
    taken = [name for name, r in results.items() if r.outcome in ("accepted", "unknown") and not r.changed]
    again = [orders[name] for name in taken]  # also listens for rivals: the upload may have ended minutes ago
    seen = {orders[name].mission.name: results[name].state for name in taken}
    cleared = dict(zip(taken, session.clear_fleet(again, seen), strict=True))
    why = f"not verified: {', '.join(failures)}"
    return [_after_clearing(d, cleared[d.vehicle], why) if d.vehicle in cleared else d for d in uploads]


def _after_clearing(d: JobResult, cleared: UploadResult | GcsplanError, why: str) -> JobResult:
    error = cleared if isinstance(cleared, GcsplanError) else cleared.error()
    if error is not None:
        earlier = f"; {d.message}" if d.message else ""
        return replace(
            d, verified=False, code=d.code or LinkError.exit_code, reason=d.reason or LinkError.default_reason,
            message=f"all or nothing ({why}), but it could not be cleared and still holds the mission: "
            f"{error}{earlier}",
        )  # fmt: skip
    earlier = f"; {d.message}" if d.message else ""
    words = f"the mission was cleared again, all or nothing ({why}): the vehicle holds none now{earlier}"
    return replace(d, outcome="withdrawn", verified=False, message=words)


def _apart(jobs: Sequence[UploadJob]) -> list[list[UploadJob]]:
    """The jobs in groups, in none of which two have one system id."""
    groups: list[list[UploadJob]] = []
    seen: dict[int, int] = {}
    for job in jobs:
        group = seen.get(job.mission.sysid, 0)
        seen[job.mission.sysid] = group + 1
        if group == len(groups):
            groups.append([])
        groups[group].append(job)
    return groups


def _lists_sent(jobs: Sequence[UploadJob], links: Mapping[str, Link], options: UploadOptions) -> dict[str, ListEnds]:
    if not any(job.fence is not None or job.rally for job in jobs):
        return {}
    from gcsplan.mavlink.link.session import session

    settings = session.SessionOptions(
        allow_armed=options.allow_armed, ignore_position=options.ignore_position, listen_s=LISTEN_S,
        timeout_s=options.timeout_s,
    )  # fmt: skip
    return upload_lists(jobs, links, settings)


def _with_lists(result: JobResult, lists: ListEnds, unsent: Sequence[Note]) -> JobResult:
    """The result with its fence and rally points, and the notes on its file's lists that were not sent."""
    details, notes = dict(result.details or {}), list(unsent)
    more: list[Note] = []
    for kind, sent in lists.items():
        if isinstance(sent, GcsplanError):
            continue
        details[NAME_OF_LIST[kind]] = {
            "outcome": sent.outcome, "verified": sent.verified, "items": sent.items, "seconds": sent.seconds,
        }  # fmt: skip
        notes += [Note("fence_on_board" if kind == FENCE else "rally_on_board", items=sent.items)] * sent.verified
        more += sent.warnings
    return replace(result, warnings=tuple(dict.fromkeys((*notes, *result.warnings, *more))), details=details)


def _result(job: UploadJob, ended: UploadResult | GcsplanError) -> JobResult:
    from gcsplan.mavlink.link.session.results import FailsCheck, failed_in_json

    if isinstance(ended, GcsplanError):
        outcome = "refused" if isinstance(ended, VehicleRefused) else "unknown"
        return JobResult(
            job.name, job.url, outcome, False, len(job.mission.wire_items()), 0.0, simulated=job.url == SIM,
            message=str(ended), code=ended.exit_code, reason=ended.reason,
            details=failed_in_json(ended.note) if isinstance(ended, FailsCheck) else None,
        )  # fmt: skip
    error = ended.error()
    return JobResult(
        job.name, job.url if job.url == SIM else ended.url, ended.outcome, ended.verified, ended.items, ended.seconds,
        ended.retries, ended.simulated, str(error) if error else "", ended.warnings,
        error.exit_code if error else 0, error.reason if error else "", ended.as_dict(),
    )  # fmt: skip


def exit_code(results: Sequence[JobResult]) -> int:
    """The exit code of a fleet: the worst of 70 (our bug), 7, 6, 5 (then 4); 0 if all are verified."""
    codes = {d.code for d in results}
    order = (GcsplanError.exit_code, ReadBackDiffers.exit_code, LinkError.exit_code, VehicleRefused.exit_code)
    return next((c for c in order if c in codes), max(codes, default=0))


def failure(results: Sequence[JobResult]) -> dict[str, Any] | None:
    """The ``error`` of ``--json``, made of the results with the worst exit code; None if all are verified."""
    code = exit_code(results)
    if code == 0:
        return None
    worst = [d for d in results if d.code == code]
    return {
        "code": code,
        "reason": worst[0].reason,
        "message": "\n".join(f"{d.vehicle}: {d.message}" for d in worst),
        "where": ", ".join(dict.fromkeys(d.url for d in worst)),
    }


def require_file(file: Path) -> None:
    """Raise InputError if there is no such file, before a vehicle is searched for."""
    if not os.path.exists(file):
        raise InputError("there is no such file", where=str(file))


def verify_file(
    argument: str, url: str, sysid: int = 1, *, source: MissionFile | None = None, tolerance_m: float | None = None,
    timeout_s: float = 60.0, allow_parameters: bool = False,
) -> JobResult:  # fmt: skip
    """Compare a file with the mission on board; nothing is written to the vehicle.

    With ``source`` the argument may be NAME=FILE, and the mission on board is judged in its world, for its vehicle,
    whose number replaces ``sysid``. ``tolerance_m``: positions that are at most so far away are no difference.
    """
    from gcsplan.app.upload import position_tolerance as shifts
    from gcsplan.mavlink.link.session import session

    shifts.require_tolerance(tolerance_m, judged=source is not None)
    file = Path(argument) if source is None else split_name(argument)[1]
    require_file(file)
    checked = None if source is None else check_files(source, [argument])[0]
    with open_link(url) as link:
        if checked is not None:
            job, notes = _job(checked, link.url), checked.notes
            own = dict(job.own)
        else:
            autopilot = None if file.suffix.lower() == ".plan" else _autopilot_of(link, sysid)
            read = read_mission_file(file, autopilot=autopilot)
            job = UploadJob(file.stem, link.url, replace(read.mission, sysid=sysid))
            notes = (*read.notes, *read.not_judged)
            own = {FENCE: read.fence, RALLY: read.rally}
        options = session.SessionOptions(
            listen_s=LISTEN_S, timeout_s=timeout_s, rtl_rel_home_m=job.rtl_rel_home_m,
            read_parameters=checked is not None, settings=settings_of(job), vehicle=job.vehicle,
        )  # fmt: skip
        judge = judge_on_board(job, allow_unjudged=False, allow_parameters=allow_parameters)
        result = session.verify_mission(link, job.mission, options=options, judge=judge)
        result, shifted, cure = shifts.within(result, job.mission, tolerance_m)
        done = _result(job, result)
    if checked is not None and done.verified and shifted is None:
        shifted = Note("judged_again_safe")
    left = [
        Note("plan_list_not_compared", key_of_list=KEY_OF_LIST[kind], count=len(items))
        for kind, items in own.items()
        if items
    ]
    warnings = (*([] if shifted is None else [shifted]), *notes, *left, *done.warnings)
    return replace(done, message=done.message + cure if done.message else "", warnings=warnings)


def download_to(url: str, sysid: int, file: Path, *, timeout_s: float = 60.0) -> Mission:
    """Write the mission on board to a `.waypoints` or `.plan` file; returns it, too."""
    if file.suffix.lower() not in (".waypoints", ".plan"):
        raise UsageError(f"-o {file}: give a name that ends in .waypoints or .plan")
    if file.is_dir() or not file.parent.is_dir():
        raise UsageError(f"-o {file}: give a file in a directory that exists")
    mission = mission_on_board(url, sysid, file.stem, timeout_s=timeout_s)
    text = write_plan(mission) if file.suffix.lower() == ".plan" else write_waypoints(mission)
    write_whole(file, text)
    return mission


def mission_on_board(url: str, sysid: int, name: str, *, timeout_s: float = 60.0) -> Mission:
    """The mission on board, with ``name``; nothing is written to the vehicle."""
    from gcsplan.mavlink.link.session import session

    with open_link(url) as link:
        autopilot = _autopilot_of(link, sysid)
        return session.download_mission(
            link, sysid, autopilot, name=name, options=session.SessionOptions(listen_s=0.0, timeout_s=timeout_s)
        )


def on_board(source: MissionFile, where: Mapping[str, str], *, timeout_s: float = 60.0) -> dict[str, Mission]:
    """The missions on board by vehicle; ``where``: name to URL. Raises LinkError, VehicleRefused, InputError."""
    from gcsplan.mavlink.link.session import session

    found: dict[str, Mission] = {}
    options = session.SessionOptions(listen_s=0.0, timeout_s=timeout_s)
    for request in (r for r in source.vehicles if r.vehicle.name in where):
        vehicle, home = request.vehicle, Home.at(*request.start_deg, request.start[2])
        with open_link(where[vehicle.name]) as link:
            found[vehicle.name] = session.download_mission(
                link, vehicle.sysid, vehicle.autopilot, home=home, name=vehicle.name, options=options
            )
    return found


def clear(url: str, sysid: int, kind: str, *, allow_armed: bool = False, timeout_s: float = 60.0) -> None:
    """Clear one list on board and read back that it is empty."""
    from gcsplan.mavlink.link.session import session

    if kind not in KINDS:
        raise UsageError(f"--type {kind}: give mission, fence or rally")
    with open_link(url) as link:
        options = session.SessionOptions(listen_s=LISTEN_S, allow_armed=allow_armed, timeout_s=timeout_s)
        session.clear_mission(link, sysid, KINDS[kind], options=options).raise_for_outcome()
