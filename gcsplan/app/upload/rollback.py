"""All or nothing (`--atomic`): if one upload failed, the missions that other vehicles took are cleared again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.errors import GcsplanError, LinkError

if TYPE_CHECKING:
    from gcsplan.app.upload.job import JobResult
    from gcsplan.mavlink.link.session import session
    from gcsplan.mavlink.link.session.results import UploadResult


def rolled_back(
    uploads: Sequence[JobResult],
    orders: Mapping[str, session.UploadOrder],
    ended: Mapping[str, UploadResult | GcsplanError],
) -> list[JobResult]:
    """If one upload is not verified, clear the missions that the vehicles took, and read back that they are gone.

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
