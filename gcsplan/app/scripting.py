"""What scripts call beside `load_mission` and `plan`: `upload` and `rehearse`, without a command line or asyncio.

    from gcsplan import load_mission, plan, rehearse, upload

    planned = plan(load_mission("fleet.yaml"))
    flown = rehearse(planned, wind_m_s=5.0, noise_m=1.0, runs=50)
    print(flown.safe, flown.p95_s, flown.order_kept_runs)
    for delivery in upload(planned, to="link", atomic=True):
        print(delivery.vehicle, delivery.outcome, delivery.verified, delivery.message)

Everything blocks until it is done; errors are those of `gcsplan.errors`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from gcsplan.app import uploads
from gcsplan.app.model import Plan
from gcsplan.app.pipeline import require_passing
from gcsplan.app.upload_job import LINK, JobResult, ProgressCall, UploadOptions

if TYPE_CHECKING:
    from gcsplan.sim.outcome import Rehearsal

__all__ = ["rehearse", "upload"]


def upload(
    planned: Plan,
    to: str | Sequence[str] | Mapping[str, str] = LINK,
    *,
    atomic: bool = False,
    allow_unjudged: bool = False,
    allow_armed: bool = False,
    ignore_position: bool = False,
    timeout_s: float = 60.0,
    progress: ProgressCall | None = None,
) -> list[JobResult]:
    """Upload every mission of a plan, all at once, read each back, compare, and check what was read back.

    ``to``: a URL for all vehicles (told apart by system id), ``"link"`` (the mission file's links), ``"sim"`` (a
    simulated vehicle for each), ``"NAME=URL"``, several of these, or a mapping from name to URL. Vehicles that it
    says nothing of get nothing. With ``atomic``, if one upload fails, what the others took is cleared again.
    ``timeout_s`` is the longest time without progress. ``progress(name, told)`` is called on the way.

    One `JobResult` for each vehicle, in the plan's order: ``verified`` is True only where the mission was read back
    and equals what was sent; ``message`` says what went wrong. One vehicle's failure leaves the others standing and
    raises nothing; `gcsplan.app.uploads.exit_code` sums them up. Raises UsageError for targets that are none,
    CheckFailed, before anything is sent, where a verdict does not pass.
    """
    if isinstance(to, Mapping):
        words = [f"{name}={url}" for name, url in to.items()]
    else:
        words = [to] if isinstance(to, str) else list(to)
    targets = uploads.targets(words, [v.request.vehicle for v in planned.vehicles])
    require_passing({v.name: v.verdict for v in planned.vehicles if v.name in targets}, allow_unjudged=allow_unjudged)
    from gcsplan.sim.loopback import loopback_fleet

    options = UploadOptions(
        allow_armed=allow_armed, ignore_position=ignore_position, atomic=atomic, timeout_s=timeout_s
    )
    return uploads.run_jobs(uploads.jobs_of(planned, targets), options, progress, simulator=loopback_fleet)


def rehearse(
    planned: Plan,
    *,
    wind_m_s: float = 0.0,
    from_deg: float | None = None,
    gusts_m_s: float = 0.0,
    noise_m: float = 0.0,
    runs: int = 1,
    seed: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Rehearsal:
    """Upload a plan to simulated vehicles, fly what they store in simulated time, and judge it; nothing is sent out.

    Wind, gusts and position noise (`gcsplan.sim.wind.Weather`) are drawn from ``seed``, another draw for each of
    ``runs``. ``progress(done, runs)`` is called now and then. The result's ``safe`` is True where arrivals came in
    order, the separation and every limit were kept on the flown tracks; ``error()`` says what was not. Raises what an
    upload raises, InputError for weather that is none.
    """
    from gcsplan.app import rehearsing
    from gcsplan.sim.wind import Weather

    weather = Weather(wind_m_s, from_deg, gusts_m_s, noise_m)
    return rehearsing.rehearse(planned, weather=weather, runs=runs, seed=seed, progress=progress)
