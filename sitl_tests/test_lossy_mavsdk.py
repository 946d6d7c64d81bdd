"""MAVSDK behind a radio that loses up to six datagrams of ten: a mission reported as verified is on board."""

from __future__ import annotations

import pytest

from gcsplan.errors import GcsplanError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session.session import SessionOptions, UploadOrder, upload_fleet, verify_mission
from gcsplan.mavlink.mission.mission import MISSION
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from sitl_tests.missions import a_mission, a_vehicle
from sitl_tests.peers import MavsdkVehicle, mavsdk_station, row_for
from sitl_tests.relay import LossyRelay

pytestmark = pytest.mark.slow

PX4 = Autopilot.PX4
TIMEOUT_S = 10.0
OPTIONS = SessionOptions(unchecked=True, listen_s=0.1, timeout_s=TIMEOUT_S, discover_s=20.0)


@pytest.mark.parametrize(
    ("loss", "seed"),
    [(0.1, 1), *(pytest.param(*more, marks=pytest.mark.nightly) for more in ((0.3, 2), (0.6, 3), (0.6, 4)))],
)
def test_a_mavsdk_vehicle_that_is_called_verified_holds_the_mission(loss: float, seed: int) -> None:
    """MAVSDK gives up after five losses in a row with a part on board: the outcome is then unknown, within a bound."""
    mission = a_mission(PX4, 20)
    with (
        MavsdkVehicle() as vehicle,
        LossyRelay(("127.0.0.1", vehicle.port), loss=loss, seed=seed) as relay,
        Link(relay.url) as bad,
    ):
        (result,) = upload_fleet([UploadOrder(bad, mission, options=OPTIONS)])
        if isinstance(result, GcsplanError):
            assert result.exit_code in (5, 6)
            return
        assert result.seconds <= TIMEOUT_S + 2.0 * 20 + 2.0
        if result.verified:
            with Link(vehicle.url) as good:
                assert verify_mission(good, mission, options=OPTIONS).verified
        else:
            error = result.error()
            assert error is not None
            assert error.exit_code in (5, 6, 7)
            assert result.on_board
    assert loss > 0.2 or result.verified


@pytest.mark.parametrize(("loss", "seed"), [(0.1, 5), pytest.param(0.6, 6, marks=pytest.mark.nightly)])
def test_our_vehicle_holds_what_mavsdk_calls_a_success(loss: float, seed: int) -> None:
    """Our loopback vehicle under loss: it never answers "accepted" with another mission on board."""
    board = a_vehicle(PX4)
    sent = list(a_mission(PX4, 15).wire_items())
    rows = [row_for(n, item, current=int(n == 0)) for n, item in enumerate(sent)]
    with (
        SimServer([board], "udpin:127.0.0.1:0") as server,
        LossyRelay(server.address, loss=loss, seed=seed) as relay,
    ):
        (answer,) = mavsdk_station(relay.url, [["upload", MISSION, rows]])
        assert server.mishandled == 0
    if answer == "SUCCESS":
        assert [(i.command, i.x, i.y) for i in board.items()] == [(i.command, i.x, i.y) for i in sent]
    else:
        assert board.items() == () or len(board.items()) == len(sent)  # PX4 swaps missions at the end, or not at all
    assert loss > 0.2 or answer == "SUCCESS"
