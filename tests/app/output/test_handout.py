"""What a plan is handed out as: the same gate and the same jobs for the command line and the map."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.app.output.handout import handout
from gcsplan.errors import CheckFailed
from gcsplan.units import METRIC

pytestmark = pytest.mark.slow


def test_files_jobs_and_refusals_come_from_one_place() -> None:
    planned = plan({
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30},
        "no_fly": [{"name": "mast", "center": [36.61, -84.3], "radius_m": 80}],
        "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 10],
                      "start": [36.6, -84.3], "goal": [36.6, -84.297]}],
    })  # fmt: skip
    plain = handout(planned)
    assert (plain.jobs, plain.homes, plain.differences) == ((), {}, [])
    assert plain.files() == outputs_of(planned)
    assert set(plain.files(METRIC)) - set(plain.files()) == {"report.html"}
    sent = handout(planned, {"uav1": "udpout:127.0.0.1:9"}, (True, False, False), home=True)
    [job] = sent.jobs
    assert (job.url, job.mission, job.way_home) == (
        "udpout:127.0.0.1:9",
        planned.vehicles[0].mission,
        sent.homes["uav1"],
    )
    assert job.fence is not None
    assert job.fence.items
    assert sent.files()["uav1.plan"] != plain.files()["uav1.plan"]
    broken = replace(planned.vehicles[0], verdict=replace(planned.vehicles[0].verdict, not_judged=planned.notes[:1]))
    unjudged = replace(planned, vehicles=(broken,))
    assert unjudged.vehicles[0].verdict.safe is None
    with pytest.raises(CheckFailed):
        handout(unjudged)
    assert handout(unjudged, allow_unjudged=True).plan is unjudged
