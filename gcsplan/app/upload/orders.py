"""Turn an upload job into a session's order: settings, check of the read-back, and the call that reports the end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gcsplan.app.upload.on_board import judge_on_board, settings_of
from gcsplan.errors import GcsplanError, VehicleRefused

if TYPE_CHECKING:
    from gcsplan.app.upload.job import ProgressCall, UploadJob, UploadOptions
    from gcsplan.mavlink.link.link import Link
    from gcsplan.mavlink.link.session import session
    from gcsplan.mavlink.link.session.results import UploadResult


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
        phase = "verified" if verified and word == "accepted" else f"{word}!"
        progress(order.mission.name, TransferProgress(phase, count if verified else 0, count))

    return report


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
    )
    again = _judge_again(job, simulated, allow_parameters=options.allow_parameters)
    return session.UploadOrder(link, job.mission, job.verdict, settings, again, progress)


def _judge_again(
    job: UploadJob, simulated: bool = False, *, allow_parameters: bool = False
) -> session.ReadBackJudge | None:
    if job.verdict is None:
        return None
    return judge_on_board(
        job, allow_unjudged=job.verdict.safe is None, allow_parameters=allow_parameters, simulated=simulated
    )
