"""Uploads over real sockets and a bad radio: a mission reported as verified is on board.

The vehicles' clocks run 30 times as fast, and our timeouts are shorter, so that many losses take little time.
"""

from __future__ import annotations

import pytest

from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session.session import (
    SessionOptions,
    UploadOrder,
    download_mission,
    upload_fleet,
    upload_items,
    upload_mission,
)
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import FENCE, MissionItem
from gcsplan.mavlink.protocol.transfer import Timers
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import a_mission, a_vehicle
from sitl_tests.relay import LossyRelay

pytestmark = pytest.mark.slow

COPTER, PX4 = Autopilot.ARDUCOPTER, Autopilot.PX4
SPEEDUP = 30.0
# These tests do not concern the check: missions are sent unchecked.
OPTIONS = SessionOptions(unchecked=True, listen_s=0.0, timers=Timers(response_s=0.3, item_s=0.03, silence_s=3.0))


@pytest.mark.parametrize(
    ("autopilot", "items", "seed"),
    [(COPTER, 50, 1), (PX4, 50, 2), pytest.param(COPTER, 600, 3, marks=pytest.mark.nightly)],
)
def test_at_ten_percent_loss_an_upload_ends_verified(autopilot: Autopilot, items: int, seed: int) -> None:
    vehicle, mission = a_vehicle(autopilot), a_mission(autopilot, items)
    with (
        SimServer([vehicle], "udpin:127.0.0.1:0", speedup=SPEEDUP) as server,
        LossyRelay(server.address, loss=0.1, seed=seed) as relay,
        Link(relay.url) as link,
    ):
        result = upload_mission(link, mission, options=OPTIONS)
        assert (result.outcome, result.verified, result.faults) == ("accepted", True, ())
        assert relay.lost > items / 10
    assert not faults(compare(mission.wire_items(), vehicle.items(), autopilot))


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_doubled_and_overtaken_datagrams_do_no_harm(autopilot: Autopilot) -> None:
    vehicle, mission = a_vehicle(autopilot), a_mission(autopilot, 50)
    with (
        SimServer([vehicle], "udpin:127.0.0.1:0", speedup=SPEEDUP) as server,
        # A PX4's download does not survive worse: a request that comes late ends it.
        LossyRelay(server.address, loss=0.05, duplicate=0.05, held_up=0.05, hold_s=0.02, seed=4) as relay,
        Link(relay.url) as link,
    ):
        result = upload_mission(link, mission, options=OPTIONS)
        assert result.verified, result.reason
        assert relay.doubled > 2
        read = download_mission(link, 1, autopilot, home=mission.home, options=OPTIONS)
    assert not faults(compare(mission.wire_items(), read.wire_items(), autopilot))


def test_two_vehicles_behind_one_bad_port_each_get_their_own() -> None:
    vehicles = [a_vehicle(COPTER, sysid=1), a_vehicle(PX4, sysid=2)]
    missions = [a_mission(COPTER, 30, sysid=1), a_mission(PX4, 40, sysid=2)]
    with (
        SimServer(vehicles, "udpin:127.0.0.1:0", speedup=SPEEDUP) as server,
        LossyRelay(server.address, loss=0.1, seed=5) as relay,
        Link(relay.url) as link,
    ):
        results = upload_fleet([UploadOrder(link, mission, options=OPTIONS) for mission in missions])
    assert [getattr(r, "verified", r) for r in results] == [True, True]
    assert [len(v.items()) for v in vehicles] == [31, 40]


def test_a_fence_goes_up_over_a_bad_link() -> None:
    vehicle = a_vehicle(COPTER)
    fence = [MissionItem(5004, 3, (50.0 + n, 0.0, 0.0, 0.0), 366_000_000 + n, -843_800_000) for n in range(20)]
    with (
        SimServer([vehicle], "udpin:127.0.0.1:0", speedup=SPEEDUP) as server,
        LossyRelay(server.address, loss=0.1, seed=6) as relay,
        Link(relay.url) as link,
    ):
        assert upload_items(link, 1, fence, COPTER, FENCE, options=OPTIONS).verified
    assert [i.params[0] for i in vehicle.items(FENCE)] == [i.params[0] for i in fence]


def test_a_link_that_loses_everything_ends_unknown_or_dead_and_never_verified() -> None:
    # The vehicle falls silent after 25 received messages, in the middle of the upload.
    vehicle, mission = a_vehicle(COPTER, "silent_after=25"), a_mission(COPTER, 50)
    options = SessionOptions(
        unchecked=True, listen_s=0.0, attempts=2, timers=Timers(response_s=0.1, item_s=0.05, silence_s=0.5, retries=2)
    )
    with SimServer([vehicle], "udpin:127.0.0.1:0", speedup=SPEEDUP) as server, Link(server.url_for_gcs) as link:
        result = upload_mission(link, mission, options=options)
    assert (result.outcome, result.verified) == ("unknown", False)
    assert len(vehicle.items()) < 50
