"""All or nothing: what a fleet's vehicles took is cleared again where one upload failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.errors import GcsplanError, LinkError

if TYPE_CHECKING:
    from gcsplan.app.upload_job import JobResult
    from gcsplan.mavlink.link import session
    from gcsplan.mavlink.link.results import UploadResult


def rolled_back(
    uploads: Sequence[JobResult],
    orders: Mapping[str, session.UploadOrder],
    ended: Mapping[str, UploadResult | GcsplanError],
) -> list[JobResult]:
    """All or nothing: where one is not verified, the missions that vehicles took are cleared and read back as gone.

    Cleared is what was accepted, or may have been: a vehicle that never took anything of ours keeps its own. To one
    that is no longer as it was when it was checked nothing further is sent: it keeps what it has, and that is said.
    """
    from gcsplan.mavlink.link import session

    failures = [d.vehicle for d in uploads if d.code]
    if not failures:
        return list(uploads)
    results = {name: result for name, result in ended.items() if not isinstance(result, GcsplanError)}
    taken = [name for name, r in results.items() if r.outcome in ("accepted", "unknown") and not r.changed]
    again = [orders[name] for name in taken]  # listening for rivals too: the upload may have ended minutes ago
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
