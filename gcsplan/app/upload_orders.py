"""Turn an upload job into a session's order: settings, check of the read-back, and the call that reports the end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.app.fencing import against_fence
from gcsplan.app.flight_hours import beyond_hours
from gcsplan.app.way_home import against_on_board
from gcsplan.check.judge import judge
from gcsplan.check.tuning import Tuning
from gcsplan.errors import GcsplanError, VehicleRefused
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.return_altitude import return_on_board_m
from gcsplan.vehicle import fastest_at_m_s

if TYPE_CHECKING:
    from gcsplan.app.upload_job import ProgressCall, UploadJob, UploadOptions
    from gcsplan.mavlink.link import session
    from gcsplan.mavlink.link.link import Link
    from gcsplan.mavlink.link.results import UploadResult


def report_end(progress: ProgressCall | None) -> session.EndCall | None:
    """A call that reports the outcome of each order, in a word, to ``progress``."""
    if progress is None:
        return None
    from gcsplan.mavlink.protocol.machine import Progress

    def report(order: session.UploadOrder, ended: UploadResult | GcsplanError) -> None:
        count = len(order.mission.wire_items())
        refused = isinstance(ended, VehicleRefused)
        word: str = ("refused" if refused else "unknown") if isinstance(ended, GcsplanError) else ended.outcome
        verified = not isinstance(ended, GcsplanError) and ended.verified
        if not isinstance(ended, GcsplanError) and ended.changed:
            word = f"verified, {ended.changed}" if verified else f"stopped, {ended.changed}"
        phase = "verified" if verified and word == "accepted" else f"{word}!"
        progress(order.mission.name, Progress(phase, count if verified else 0, count))

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
    from gcsplan.mavlink.link import session

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
    )
    return session.UploadOrder(link, job.mission, job.verdict, settings, _judge_again(job, simulated), progress)


def _judge_again(job: UploadJob, simulated: bool = False) -> session.Judge | None:
    if job.verdict is None:
        return None
    return judge_on_board(job, allow_unjudged=job.verdict.safe is None, simulated=simulated)


def judge_on_board(job: UploadJob, *, allow_unjudged: bool, simulated: bool = False) -> session.Judge | None:
    """The check of the mission that was read back, since the vehicle will fly what it holds; None without a world.

    It is asked before the mission is sent too, with the vehicle's parameters: where it turns, and how high it returns,
    for an RTL item. A simulated vehicle's return altitude is nobody's, so the mission file's counts there.
    """
    if job.world is None or job.vehicle is None:
        return None
    from gcsplan.mavlink.link.parameters import lean_shortage
    from gcsplan.mavlink.link.px4_motion import speed_shortage
    from gcsplan.mavlink.link.terrain import terrain_error_m

    world, vehicle = job.world, job.vehicle
    planned_m_s = job.mission.commanded_m_s
    if vehicle.lean_angle_deg is not None:
        planned_m_s = min(planned_m_s, fastest_at_m_s(vehicle.lean_angle_deg))

    def again(read_back: Mission, values: Mapping[str, float]) -> str | None:
        if vehicle.lean_angle_deg is not None and (short := lean_shortage(values, planned_m_s)):
            return short
        if short := speed_shortage(values, vehicle, planned_m_s):
            return short
        if job.home_required and job.way_home is not None and not simulated:
            against = against_on_board(job.way_home, values, job.mission)
            if against is not None:
                return against
        # Home on board is where the vehicle is now, but the altitudes count from the planned start.
        flown, tuning = replace(read_back, home=job.mission.home), Tuning.of(values)
        returns_m = None if simulated else return_on_board_m(values)
        rtl_rel_home_m = job.rtl_rel_home_m if returns_m is None else returns_m
        spacing = values.get("TERRAIN_SPACING", math.nan)
        spaced = world.with_posts(int(spacing)) if spacing >= 1.0 else world
        error_m = terrain_error_m(values, job.terrain_error_m)
        verdict = judge(flown, vehicle, spaced, rtl_rel_home_m=rtl_rel_home_m, terrain_error_m=error_m, tuning=tuning)
        if verdict.safe is False or (verdict.safe is None and not allow_unjudged):
            return verdict.describe()
        if not allow_unjudged and (beyond := beyond_hours(verdict, job.hours)):
            return f"not judged: {beyond}"
        return against_fence(job, flown, rtl_rel_home_m, tuning)

    return again
