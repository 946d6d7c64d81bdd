"""Fleets of loopback vehicles on one lossy port: everybody verified, the bad ones named, all or nothing on request."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from gcsplan.app.upload import run as uploads
from gcsplan.app.upload.job import JobResult, UploadJob
from gcsplan.cli.output import console
from gcsplan.errors import GcsplanError, LinkError, ReadBackDiffers, VehicleRefused
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import session
from gcsplan.mavlink.link.session.session import SessionOptions, UploadOrder, upload_fleet
from gcsplan.mavlink.mission.autopilots import altitude_of_cm
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.mavlink.protocol.machine import TransferProgress
from gcsplan.mavlink.protocol.transfer import Timers
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

COPTER = Autopilot.ARDUCOPTER
HOME = Home.at(36.6, -84.38, 371.0)
QUICK = Timers(response_s=0.3, item_s=0.05, silence_s=1.5, retries=4)
OPTIONS = SessionOptions(
    unchecked=True, listen_s=0.0, standby_s=0.0, discover_s=2.0, read_parameters=False, timers=QUICK
)
FLEET = range(1, 21)


def mission(sysid: int, count: int = 50) -> Mission:
    z = altitude_of_cm(6500, COPTER)
    items = tuple(
        MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000 + 1000 * n, -843_800_000 + 700 * n + sysid, z + n)
        for n in range(count - 1)  # item 0 is home
    )
    return Mission(COPTER, HOME, items, f"uav{sysid}", sysid)


@contextmanager
def fleet(numbers: range, trouble: Mapping[int, Mapping[str, Any]], drop: float) -> Iterator[SimServer]:
    """A vehicle for each of ``numbers`` on one port, each losing packets by its own seed."""
    boards = [
        LoopbackVehicle(
            n, COPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0,
            misbehave=Misbehaviour(drop=drop, seed=n, **trouble.get(n, {})),
        )
        for n in numbers
    ]  # fmt: skip
    with SimServer(boards, "udpin:127.0.0.1:0", speedup=10.0) as server:
        yield server
    assert server.mishandled == 0


@pytest.mark.nightly
def test_twenty_vehicles_are_verified_over_a_link_that_loses_a_twentieth() -> None:
    sent = [mission(n) for n in FLEET]
    ended: list[str] = []
    with fleet(FLEET, {}, drop=0.05) as server, Link(server.url_for_gcs) as link:
        orders = [UploadOrder(link, each, options=OPTIONS) for each in sent]
        results = upload_fleet(orders, ended=lambda order, outcome: ended.append(order.mission.name))
        for board, each, result in zip(server.vehicles, sent, results, strict=True):
            assert not isinstance(result, GcsplanError), result
            assert result.verified, result.reason
            assert (result.sysid, result.items) == (board.sysid, 50)
            assert not faults(compare(each.wire_items(), board.items(), COPTER))
    assert sum(r.retries for r in results if not isinstance(r, GcsplanError)) > 0  # the link did lose something
    assert sorted(ended) == sorted(each.name for each in sent)


@pytest.mark.nightly
def test_three_failing_vehicles_are_named_and_the_other_seventeen_verified() -> None:
    trouble: dict[int, dict[str, Any]] = {
        4: {"silent_after": 0},
        9: {"refuse": 7, "refuse_code": 5},
        13: {"corrupt": 5},
    }
    with fleet(FLEET, trouble, drop=0.05) as server, Link(server.url_for_gcs) as link:
        results = upload_fleet([UploadOrder(link, mission(n), options=OPTIONS) for n in FLEET])
    by_number = dict(zip(FLEET, results, strict=True))
    errors = {
        n: r if isinstance(r, GcsplanError) else r.error()
        for n, r in by_number.items() if isinstance(r, GcsplanError) or not r.verified
    }  # fmt: skip
    assert {n: type(e) for n, e in errors.items()} == {4: LinkError, 9: VehicleRefused, 13: ReadBackDiffers}
    assert "4" in str(errors[4])
    assert "item 7" in str(errors[9])
    assert "item 5" in str(errors[13])
    assert "uav9" in str(errors[9])
    assert "uav13" in str(errors[13])


# -- all or nothing -----------------------------------------------------------------------------------------------


def delivered(
    trouble: Mapping[int, Mapping[str, Any]], monkeypatch: pytest.MonkeyPatch, *, atomic: bool = True, count: int = 4
) -> tuple[dict[str, JobResult], dict[str, int], list[tuple[str, TransferProgress]]]:
    """What became of a small fleet: deliveries, items on board without home, and what was told on the way."""
    monkeypatch.setattr(uploads, "LISTEN_S", 0.0)
    order = uploads.order_of
    monkeypatch.setattr(
        uploads, "order_of", lambda *a, **k: replace(o := order(*a, **k), options=replace(o.options, timers=QUICK))
    )
    told: list[tuple[str, TransferProgress]] = []
    with fleet(range(1, count + 1), trouble, drop=0.0) as server:
        jobs = [UploadJob(f"uav{n}", server.url_for_gcs, mission(n, 12)) for n in range(1, count + 1)]
        options = uploads.UploadOptions(unchecked=True, atomic=atomic)
        done = uploads.run_jobs(jobs, options, lambda name, progress: told.append((name, progress)))
        boards = {f"uav{v.sysid}": len(v.items()[1:]) for v in server.vehicles}
    return {d.vehicle: d for d in done}, boards, told


@pytest.mark.nightly
def test_one_failure_leaves_the_others_results_standing(monkeypatch: pytest.MonkeyPatch) -> None:
    done, boards, told = delivered({2: {"refuse": 3}, 3: {"corrupt": 4}}, monkeypatch, atomic=False)
    assert [d.verified for d in done.values()] == [True, False, False, True]
    assert uploads.exit_code(list(done.values())) == 7
    assert boards["uav1"] == boards["uav4"] == 11
    last = {name: (progress.phase, progress.failed) for name, progress in told}
    assert last == {
        "uav1": ("verified", False), "uav2": ("refused", True), "uav3": ("accepted", True), "uav4": ("verified", False),
    }  # fmt: skip
    assert {progress.failed for _, progress in told if progress.phase in ("upload", "read back")} == {None}


@pytest.mark.nightly
def test_all_or_nothing_takes_back_what_the_others_took_and_reads_that_back(monkeypatch: pytest.MonkeyPatch) -> None:
    done, boards, _ = delivered({2: {"refuse": 3}}, monkeypatch)
    assert {n: d.outcome for n, d in done.items()} == {
        "uav1": "withdrawn", "uav2": "refused", "uav3": "withdrawn", "uav4": "withdrawn",
    }  # fmt: skip
    assert not any(d.verified for d in done.values())
    assert all(boards[n] == 0 for n in ("uav1", "uav3", "uav4"))
    assert uploads.exit_code(list(done.values())) == 5
    assert "uav2" in done["uav1"].message
    assert "item 3" in done["uav2"].message


def test_all_or_nothing_changes_nothing_where_all_went_well(monkeypatch: pytest.MonkeyPatch) -> None:
    done, boards, _ = delivered({}, monkeypatch)
    assert all(d.verified and d.outcome == "accepted" for d in done.values())
    assert set(boards.values()) == {11}
    assert uploads.exit_code(list(done.values())) == 0


@pytest.mark.nightly
def test_what_read_back_wrong_is_cleared_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    done, boards, _ = delivered({3: {"corrupt": 4}}, monkeypatch)
    assert done["uav3"].outcome == "withdrawn"
    assert done["uav3"].code == 7
    assert set(boards.values()) == {0}
    assert uploads.exit_code(list(done.values())) == 7


@pytest.mark.nightly
def test_a_vehicle_that_keeps_its_mission_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    clear = session.clear_fleet

    def armed_in_between(orders: list[UploadOrder], seen: Any) -> Any:
        results = clear(orders[1:], seen)
        return [VehicleRefused("not cleared: the vehicle is armed"), *results]

    monkeypatch.setattr(session, "clear_fleet", armed_in_between)
    done, boards, _ = delivered({4: {"refuse": 3}}, monkeypatch)
    assert done["uav1"].outcome == "accepted"
    assert done["uav1"].code == LinkError.exit_code
    assert "still holds" in done["uav1"].message
    assert boards["uav1"] == 11
    assert boards["uav2"] == boards["uav3"] == 0
    assert uploads.exit_code(list(done.values())) == 6


def test_all_or_nothing_sends_nothing_where_a_link_does_not_open(monkeypatch: pytest.MonkeyPatch) -> None:
    with fleet(range(1, 2), {}, drop=0.0) as server:
        jobs = [
            UploadJob("uav1", server.url_for_gcs, mission(1, 12)),
            UploadJob("uav2", "tcp:127.0.0.1:1", mission(2, 12)),
        ]
        done = uploads.run_jobs(jobs, uploads.UploadOptions(unchecked=True, atomic=True))
        assert server.vehicles[0].items()[1:] == ()
    assert [d.code for d in done] == [6, 6]
    assert "nothing was sent" in done[0].message


# -- what is seen of it -------------------------------------------------------------------------------------------


def test_the_live_table_is_for_terminals_and_shows_where_each_vehicle_is(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = io.StringIO()
    monkeypatch.setattr(console, "aside", Console(file=screen, force_terminal=True, width=100, color_system=None))
    with console.transfer_progress(["uav1", "[/]odd"]) as tell:
        tell("uav1", TransferProgress("upload", 3, 12))
        tell("uav1", TransferProgress("verified", 12, 12, failed=False))
        tell("[/]odd", TransferProgress("refused", 0, 12, failed=True))
    shown = screen.getvalue()
    assert all(word in shown for word in ("uav1", "[/]odd", "verified", "refused", "12/12"))
    plain = io.StringIO()
    monkeypatch.setattr(console, "aside", Console(file=plain, width=100))
    with console.transfer_progress(["uav1"]) as tell:
        tell("uav1", TransferProgress("upload", 3, 12))
    assert plain.getvalue() == ""
