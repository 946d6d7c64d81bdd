"""A ground station's logs: one vehicle or several, and what they hold of the battery."""

from __future__ import annotations

from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.logs.fit import fit_energy
from gcsplan.logs.tlog import read_telemetry
from tests.support.flight_logs import tlog, within


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize("status", [False, True])
def test_a_ground_stations_log(tmp_path: Path, status: bool) -> None:
    log = read_telemetry(tlog(tmp_path / "a.tlog", status=status), None)
    assert within(fit_energy([log]))
    assert bool(log.notes) is status


@pytest.mark.nightly
def test_a_ground_stations_log_of_two_vehicles_or_without_a_battery(tmp_path: Path) -> None:
    two = tlog(tmp_path / "two.tlog", sysids=(1, 7))
    with pytest.raises(InputError, match=r"systems 1, 7.*--sysid"):
        read_telemetry(two, None)
    assert within(fit_energy([read_telemetry(two, sysid=7)]))
    with pytest.raises(InputError, match="holds 1, 7"):
        read_telemetry(two, sysid=9)
    with pytest.raises(InputError, match="no battery current"):
        read_telemetry(tlog(tmp_path / "none.tlog", battery=False), None)
