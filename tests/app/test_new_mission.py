"""A new mission file: what a vehicle tells for it, and mistakes by the options that make them."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.app.new_mission import Seen, checked_text, seen_at
from gcsplan.app.upload import run as uploads
from gcsplan.errors import InputError, VehicleRefused
from gcsplan.mission_file.new_file import Draft
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.crossing import vehicle
from tests.support.impatient import be_impatient


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    be_impatient(monkeypatch)
    monkeypatch.setattr(uploads, "LISTEN_S", 0.05)


def seen(board: LoopbackVehicle, autopilot: Autopilot | None = None) -> Seen:
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
        return seen_at(server.url_for_gcs, 1, autopilot)


def test_a_vehicle_tells_its_place_its_autopilot_and_its_return() -> None:
    board = LoopbackVehicle(
        1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=471.0, parameters={"RTL_ALT": 4000.0}
    )
    found = seen(board)
    assert (found.autopilot, found.start) == (Autopilot.ARDUCOPTER, "36.6000000, -84.3800000")
    assert found.rtl_rel_home_m == 40.0
    assert found.start is not None
    draft = found.onto(Draft(start=found.start, goal="36.61, -84.35"))
    assert (draft.link, draft.rtl_rel_home_m, draft.lean_deg) == (found.url, 40.0, found.lean_deg)


def test_another_autopilot_than_is_expected_is_refused() -> None:
    with pytest.raises(VehicleRefused, match="--autopilot px4 is given: leave it out, or give arducopter"):
        seen(vehicle(), Autopilot.PX4)


def test_a_mistake_is_told_by_its_option(tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        checked_text(Draft(flat_m=100.0, start="36.6, -84.38", goal="nowhere"), tmp_path / "m.yaml")
    assert "--goal" in str(refused.value)
    assert "(line" not in str(refused.value)
    text, _ = checked_text(Draft(flat_m=100.0, start="36.6, -84.38", goal="36.61, -84.37"), tmp_path / "m.yaml")
    assert "version: 1" in text
