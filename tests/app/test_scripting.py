"""The functions for scripts, and the example that uses them, against loopback vehicles."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

import gcsplan
from gcsplan.app import uploads
from gcsplan.app.model import Plan
from gcsplan.app.pipeline import plan
from gcsplan.app.scripting import rehearse, upload
from gcsplan.errors import CheckFailed, UsageError
from gcsplan.mission_file import load_mission
from gcsplan.sim.misbehaviour import Misbehaviour
from gcsplan.sim.server import SimServer
from gcsplan.sim.vehicle import LoopbackVehicle
from gcsplan.vehicle import Autopilot
from tests.app.test_fleet_planning import CROSS
from tests.support.impatient import be_impatient
from tests.support.paths import MISSIONS

EXAMPLE = MISSIONS / "upload_fleet.py"
TEXT = yaml.safe_dump(
    CROSS
    | {
        "limits": CROSS["limits"] | {"track_error_m": 3, "altitude_error_m": 3},
        "arrival": {"mode": "sequence", "order": ["west", "south"], "interval_s": 20, "separation_m": 30},
    }
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)


@pytest.fixture(scope="module")
def cross() -> Plan:
    return plan(load_mission("cross.yaml", text=TEXT))


def boards(of: Plan, **trouble: Any) -> list[LoopbackVehicle]:
    return [
        LoopbackVehicle(
            v.mission.sysid, Autopilot.ARDUCOPTER, lat_deg=v.request.start_deg[0], lon_deg=v.request.start_deg[1],
            amsl_m=0.0, misbehave=Misbehaviour(**trouble.get(v.name, {})),
        )
        for v in of.vehicles
    ]  # fmt: skip


def test_the_four_functions_are_at_the_front_door_and_cost_nothing_until_used() -> None:
    for name in ("load_mission", "plan", "upload", "rehearse"):
        assert callable(getattr(gcsplan, name))
        assert getattr(gcsplan, name).__doc__
    with pytest.raises(AttributeError, match="uplaod"):
        gcsplan.uplaod  # type: ignore[attr-defined]  # noqa: B018
    code = (
        "import sys, gcsplan; print(sorted({'numpy', 'pyproj', 'numba', 'pymavlink', 'pydantic'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60).stdout == "[]\n"
    assert (Path(gcsplan.__file__).parent / "py.typed").exists()


def test_a_plan_is_uploaded_to_one_port_to_a_link_each_and_to_simulated_vehicles(cross: Plan) -> None:
    with SimServer(boards(cross), "udpin:127.0.0.1:0", speedup=10.0) as server:
        done = upload(cross, server.url_for_gcs)
        assert [(d.vehicle, d.verified, d.simulated) for d in done] == [("west", True, False), ("south", True, False)]
        assert all(len(v.items()) > 3 for v in server.vehicles)
    west, south = boards(cross)
    with (
        SimServer([west], "udpin:127.0.0.1:0", speedup=10.0) as one,
        SimServer([south], "udpin:127.0.0.1:0", speedup=10.0) as other,
    ):
        each = upload(cross, {"west": one.url_for_gcs, "south": other.url_for_gcs})
        assert [d.verified for d in each] == [True, True]
        assert each[0].url != each[1].url
    told: list[str] = []
    simulated = upload(cross, "sim", progress=lambda name, progress: told.append(progress.phase))
    assert all(d.simulated and d.verified for d in simulated)
    assert told.count("verified") == 2


def test_a_failure_raises_nothing_and_is_told_and_all_or_nothing_takes_back(cross: Plan) -> None:
    with SimServer(boards(cross, south={"refuse": 2}), "udpin:127.0.0.1:0", speedup=10.0) as server:
        west, south = upload(cross, server.url_for_gcs)
        assert (west.verified, south.verified, south.outcome) == (True, False, "refused")
        assert uploads.exit_code([west, south]) == 5
        west, south = upload(cross, server.url_for_gcs, atomic=True)
        assert (west.outcome, south.outcome) == ("withdrawn", "refused")
        assert server.vehicles[0].items()[1:] == ()


def test_what_is_no_target_or_not_safe_is_refused_before_anything_is_sent(cross: Plan) -> None:
    with pytest.raises(UsageError, match="nobody"):
        upload(cross, "nobody=sim")
    with pytest.raises(UsageError, match="link"):
        upload(cross)  # the file has no links
    v = cross.vehicles[0]
    bad = type(v.verdict)(v.mission, v.verdict.legs, (), ("the wind",))
    unjudged = type(v)(v.request, v.problem, v.solution, v.mission, bad, v.speed_m_s)
    doubtful = type(cross)(cross.source, cross.world, "optimal", "length", 1, (unjudged,))
    with pytest.raises(CheckFailed, match="the wind"):
        upload(doubtful, "sim")
    assert upload(doubtful, "sim", allow_unjudged=True)[0].verified


def test_a_rehearsal_flies_the_plan_and_finds_its_arrivals(cross: Plan) -> None:
    flown = rehearse(cross)
    assert flown.safe is True, flown.breaches
    assert cross.fleet is not None
    for performance, slot in zip(flown.vehicles, cross.fleet.slots, strict=True):
        assert performance.planned_s == slot.arrive_s
        assert abs(performance.errors_s[0]) < 0.5
    assert flown.order_flown == ("west", "south")
    assert [p.depart_s for p in flown.vehicles] == [s.depart_s for s in cross.fleet.slots]
    assert flown.terms.separation_m == 30
    windy = rehearse(cross, wind_m_s=4.0, noise_m=0.5, runs=3, seed=5)
    assert windy.runs == 3
    assert windy.p95_s is not None


def test_the_example_uploads_a_fleet(cross: Plan, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "cross.yaml"
    file.write_text(TEXT)
    main = runpy.run_path(str(EXAMPLE))["main"]
    with SimServer(boards(cross), "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert main(str(file), server.url_for_gcs) == 0
        out = capsys.readouterr().out
        assert out.count("verified") == 2
        assert "south: start at T+" in out
    with SimServer(boards(cross, west={"refuse": 2}), "udpin:127.0.0.1:0", speedup=10.0) as server:
        assert main(str(file), server.url_for_gcs) == 5
        assert "withdrawn" in capsys.readouterr().out
    assert main(str(tmp_path / "none.yaml"), "sim") == 2
