"""The benchmarks of uploads: what they refuse, send and report; not how fast."""

from __future__ import annotations

import pytest

from gcsplan.bench import upload
from gcsplan.errors import InputError


def test_the_measurement_of_a_fleet_wants_a_fleet() -> None:
    with pytest.raises(InputError, match="2 to 254 vehicles"):
        upload.run_fleet(fleet=1)
    told = upload.report_fleet(
        {
            "vehicles": 20, "items": 50, "drop": 0.05, "autopilot": "px4", "together_s": 9.0, "slowest_alone_s": 8.0,
            "slowest_sysid": 7, "ratio": 1.125, "retries": 3,
        }
    )  # fmt: skip
    assert "1.125" in told
    assert "5 %" in told
